//! Disks and rings: a plane with a bound on the distance from its centre. The caps of cylinders and
//! cones are disks too.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::plane::{flat_surface, flat_surface64, shows, side_hidden};
use super::{Hidden8, Ray64, Sides, Store, Surface8, Surface64, column_of, roundings};
use crate::lanes::{Column, Column3, Float8, Hit8, LANES, Mask8, RayPacket, Vec3x8};
use crate::plan::{DiskPart, Owner};
use crate::scene::{Visible, basis};

/// All disks of a render.
#[derive(Debug)]
pub struct Disks {
    center: Column3, // scene units
    normal: Column3, // unit
    radius: Column,  // scene units, > 0
    inner: Column,   // scene units, >= 0
    sides: Sides,
    parts: Vec<DiskPart>,
}

/// Eight rows.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    center: Vec3x8,
    normal: Vec3x8,
    radius: Float8,
    inner: Float8,
    hidden: Hidden8,
}

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    f: Vec3x8,      // from the origin to the center
    height: Float8, // n . f
    normal: Vec3x8,
    radius: Float8,
    inner: Float8,
    reach: Float8, // sum of the magnitudes whose rounding moves the plane and the center
    hidden: Hidden8,
}

impl Store for Disks {
    type Part = DiskPart;
    type Row = Row;
    type Anchor = Anchor;

    fn new(parts: Vec<DiskPart>, sides: Sides) -> Self {
        let center = Column3::new(parts.iter().map(|part| part.center));
        let normal = Column3::new(parts.iter().map(|part| part.normal));
        let radius = column_of(&parts, |part| part.radius);
        let inner = column_of(&parts, |part| part.inner);
        Disks { center, normal, radius, inner, sides, parts }
    }

    fn parts(&self) -> &[DiskPart] {
        &self.parts
    }

    #[inline(always)]
    fn splat(&self, i: usize) -> Row {
        let (center, normal) = (self.center.splat(i), self.normal.splat(i));
        Row { center, normal, radius: self.radius.splat(i), inner: self.inner.splat(i), hidden: self.sides.splat(i) }
    }

    #[inline(always)]
    fn block(&self, i: usize) -> Row {
        let (center, normal) = (self.center.block(i), self.normal.block(i));
        Row { center, normal, radius: self.radius.block(i), inner: self.inner.block(i), hidden: self.sides.block(i) }
    }

    fn gather(&self, rows: [u32; LANES]) -> Row {
        let hidden = self.sides.lanes(|lane| rows[lane] as usize);
        let (center, normal) = (self.center.gather(rows), self.normal.gather(rows));
        Row { center, normal, radius: self.radius.gather(rows), inner: self.inner.gather(rows), hidden }
    }

    #[inline(always)]
    fn anchor(row: &Row, origin: &Vec3x8) -> Anchor {
        let f = row.center - *origin;
        let reach = row.center.abs() + f.abs();
        let reach = reach.x + reach.y + reach.z;
        let Row { normal, radius, inner, hidden, .. } = *row;
        Anchor { f, height: normal.dot(f), normal, radius, inner, reach, hidden }
    }

    /// The plane of equation (6), then (7) and (8) of the paper with the vector from the centre formed as
    /// `t dir - f`, so that nothing large cancels: Kucherov, Morgun and Golenkovskaya, 2016, section IV B.
    #[inline(always)]
    fn hit<const CULL: bool>(anchor: &Anchor, rays: &RayPacket) -> Hit8 {
        let nd = anchor.normal.dot(rays.dir);
        let t = anchor.height / nd;
        let mut on_ray = rays.accepts(t);
        if CULL {
            on_ray &= !side_hidden(nd, &anchor.hidden);
        }
        if !on_ray.any() {
            return Hit8::none();
        }
        let x = rays.dir.mul_add(t, -anchor.f);
        let rho2 = x.dot(x);
        // The plane's roundings move x along the ray, by |dir|/|n . dir| of what they move the plane.
        let dd = rays.dir.dot(rays.dir);
        let shift = roundings(4.0) * anchor.reach * (Float8::ONE + (dd / (nd * nd)).sqrt());
        let near_rim = |r: Float8| {
            let bound = (shift + roundings(4.0) * r) * (r + r + shift);
            Mask8::le((rho2 - r * r).abs(), bound)
        };
        let inside = Mask8::le(rho2, anchor.radius * anchor.radius) & Mask8::ge(rho2, anchor.inner * anchor.inner);
        let hole = Mask8::gt(anchor.inner, Float8::ZERO);
        let doubt = on_ray & (near_rim(anchor.radius) | (near_rim(anchor.inner) & hole));
        Hit8 { t, mask: on_ray & inside & !doubt, doubt }
    }

    fn decide(part: &DiskPart, ray: &Ray64, visible: Visible) -> Option<f64> {
        let f = part.center - ray.origin;
        let nd = part.normal.dot(ray.dir);
        let t = part.normal.dot(f) / nd;
        if !(t.is_finite() && ray.accepts(t) && shows(nd, visible)) {
            return None;
        }
        let rho = (t * ray.dir - f).length();
        let bound = 8.0 * f64::EPSILON * (f.length() * (1.0 + ray.dir.length() / nd.abs()) + part.radius);
        (rho <= part.radius + bound && rho >= part.inner - bound).then_some(t)
    }

    fn refine(part: &DiskPart, ray: &Ray64, _: f64) -> Surface64 {
        flat_surface64(part.center, part.normal, ray)
    }

    #[inline(always)]
    fn surface(row: &Row, rays: &RayPacket, t: Float8) -> Surface8 {
        flat_surface(row.center, row.normal, rays, t)
    }

    /// In the basis of the normal; a cap's u is its solid's, about the solid's axis.
    fn uv(part: &DiskPart, point: DVec3) -> DVec2 {
        let (x, y) = basis(part.normal);
        let d = point - part.center;
        let azimuth = d.dot(y).atan2(d.dot(x)) / TAU;
        DVec2::new(azimuth - azimuth.floor(), d.length() / part.radius)
    }

    /// Half extent along an axis: r sqrt(n_j^2 + n_k^2) of the other two axes.
    fn bounds(part: &DiskPart) -> (DVec3, DVec3) {
        let n = part.normal;
        let half = DVec3::new(n.y.hypot(n.z), n.z.hypot(n.x), n.x.hypot(n.y)) * part.radius;
        (part.center - half, part.center + half)
    }

    fn owner(part: &DiskPart) -> Owner {
        part.owner
    }

    fn sides(&self) -> &Sides {
        &self.sides
    }

    fn column_bytes(&self) -> usize {
        self.center.bytes() + self.normal.bytes() + self.radius.bytes() + self.inner.bytes()
    }
}
