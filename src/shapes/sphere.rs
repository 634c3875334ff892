//! Spheres.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::{Hidden8, Ray64, Sides, Store, Surface8, Surface64, column_of, nearer, roundings};
use crate::lanes::{
    Column, Column3, Float8, Hit8, LANES, Mask8, RayPacket, Vec3x8, difference_of_products, square_sum_minus,
};
use crate::plan::{Owner, SpherePart};
use crate::scene::Visible;

/// All spheres of a render.
#[derive(Debug)]
pub struct Spheres {
    center: Column3,     // scene units
    radius: Column,      // scene units, > 0
    center_low: Column3, // what rounding took from the center
    radius_low: Column,  // and from the radius
    sides: Sides,
    parts: Vec<SpherePart>,
}

/// Eight rows.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    center: Vec3x8,
    radius: Float8,
    center_low: Vec3x8,
    radius_low: Float8,
    hidden: Hidden8,
}

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    f: Vec3x8,     // from the origin to the center
    r2: Float8,    // radius squared
    c: Float8,     // |f|^2 - r^2, which does not cancel
    near: Mask8,   // origins whose distance from the surface is small beside the radius
    bound: Float8, // error of the slack below, the rounding of the scene to f32 included
    hidden: Hidden8,
}

impl Store for Spheres {
    type Part = SpherePart;
    type Row = Row;
    type Anchor = Anchor;

    fn new(parts: Vec<SpherePart>, sides: Sides) -> Self {
        let center = Column3::new(parts.iter().map(|part| part.center));
        let radius = column_of(&parts, |part| part.radius);
        let low = |x: f64| x - f64::from(x as f32);
        let center_low = Column3::new(parts.iter().map(|part| DVec3::from_array(part.center.to_array().map(low))));
        let radius_low = column_of(&parts, |part| low(part.radius));
        Spheres { center, radius, center_low, radius_low, sides, parts }
    }

    fn parts(&self) -> &[SpherePart] {
        &self.parts
    }

    #[inline(always)]
    fn splat(&self, i: usize) -> Row {
        Row {
            center: self.center.splat(i),
            radius: self.radius.splat(i),
            center_low: self.center_low.splat(i),
            radius_low: self.radius_low.splat(i),
            hidden: self.sides.splat(i),
        }
    }

    #[inline(always)]
    fn block(&self, first: usize) -> Row {
        Row {
            center: self.center.block(first),
            radius: self.radius.block(first),
            center_low: self.center_low.block(first),
            radius_low: self.radius_low.block(first),
            hidden: self.sides.block(first),
        }
    }

    fn gather(&self, rows: [u32; LANES]) -> Row {
        let hidden = self.sides.lanes(|lane| rows[lane] as usize);
        Row {
            center: self.center.gather(rows),
            radius: self.radius.gather(rows),
            center_low: self.center_low.gather(rows),
            radius_low: self.radius_low.gather(rows),
            hidden,
        }
    }

    #[inline(always)]
    fn anchor(row: &Row, origin: &Vec3x8) -> Anchor {
        let f = row.center - *origin;
        let (ff, r2) = (f.dot(f), row.radius * row.radius);
        let near = Mask8::lt((ff - r2).abs(), r2);
        let mut c = ff - r2;
        if near.any() {
            c = near.select(row.height_product(f, origin), c);
        }
        // |c| rounds with the scene, f with the subtraction; 1-norms stand for lengths.
        let reach = row.center.abs() + f.abs();
        let reach = reach.x + reach.y + reach.z;
        let far = roundings(6.0) * reach;
        let bound = roundings(24.0) * r2 + roundings(3.0) * row.radius * reach + far * far;
        Anchor { f, r2, c, near, bound, hidden: row.hidden }
    }

    /// Shapes: eight lanes throughout. Units: `t` counts lengths of `dir`, which need not be 1.
    ///
    /// Source: Haines, Günther and Akenine-Möller, "Precision improvements for ray/sphere
    /// intersection", Ray Tracing Gems, 2019, chapter 7: the distance from the line to the centre is
    /// measured before it is squared, so that nothing cancels far away, and the second root comes
    /// from the product of both. Close to a surface that is large beside the distance, that distance
    /// says nothing and the discriminant is formed from compensated products instead.
    #[inline(always)]
    fn hit<const CULL: bool>(anchor: &Anchor, rays: &RayPacket) -> Hit8 {
        let Anchor { f, r2, c, near, bound, hidden } = *anchor;
        let fd = f.dot(rays.dir);
        let p = fd * rays.inv_dd;
        let perp = rays.dir.mul_add(-p, f); // from the closest approach to the center
        let mut slack = r2 - perp.dot(perp); // < 0 outside the silhouette, 0 when touching
        if near.any() {
            let dd = rays.dir.dot(rays.dir);
            slack = near.select(difference_of_products(fd, fd, dd, c) * rays.inv_dd, slack);
        }
        let possible = Mask8::ge(slack, -bound);
        if !possible.any() {
            return Hit8::none();
        }
        let doubt = possible & Mask8::le(slack, bound);
        let dd = rays.dir.dot(rays.dir);
        let s = (slack * dd).sqrt(); // NaN outside, and NaN fails every comparison
        let z = fd + copysign(s, fd);
        let (a, b) = (z * rays.inv_dd, c / z);
        let (entry, exit) = (a.fast_min(b), a.fast_max(b));
        let mut entry_ok = rays.accepts(entry);
        let mut exit_ok = rays.accepts(exit);
        if CULL {
            entry_ok &= !hidden.front;
            exit_ok &= !hidden.back;
        }
        let hit = Hit8 { t: entry_ok.select(entry, exit), mask: entry_ok | exit_ok, doubt: Mask8::NONE };
        if !doubt.any() {
            return hit;
        }
        let half = ((slack.abs() + bound) * rays.inv_dd).sqrt(); // no root lies further from p
        let doubt = doubt & Mask8::gt(p + half, rays.t_min) & Mask8::le(p - half, rays.t_max);
        Hit8 { mask: hit.mask & !doubt, doubt, ..hit }
    }

    fn decide(part: &SpherePart, ray: &Ray64, visible: Visible) -> Option<f64> {
        let f = part.center - ray.origin;
        let (disc, [a, b]) = roots(part, ray);
        let reach = part.radius * (part.radius + f.length());
        let bound = 8.0 * f64::EPSILON * ray.dir.length_squared() * reach;
        (disc >= -bound).then(|| ray.first(a.min(b), a.max(b), visible)).flatten()
    }

    fn refine(part: &SpherePart, ray: &Ray64, t: f64) -> Surface64 {
        let (_, [a, b]) = roots(part, ray);
        let t = nearer(a, b, t);
        let normal = (t * ray.dir - (part.center - ray.origin)).normalize();
        Surface64 { t, point: part.center + normal * part.radius, normal }
    }

    /// From the decomposition that the kernel uses, never from (origin + t dir) - center.
    #[inline(always)]
    fn surface(row: &Row, rays: &RayPacket, t: Float8) -> Surface8 {
        let f = row.center - rays.origin;
        let p = f.dot(rays.dir) * rays.inv_dd;
        let perp = rays.dir.mul_add(-p, f);
        let normal = rays.dir.mul_add(t - p, -perp).normalize();
        let norm = |v: Vec3x8| (v.abs().x + v.abs().y) + v.abs().z;
        let by_center = roundings(6.0) * (norm(row.center) + row.radius);
        let way = rays.dir * t;
        let by_ray = roundings(6.0) * (norm(rays.origin) + norm(way) + norm(way));
        // A sphere that is large beside the ray has a center too far away to start from.
        let along = Mask8::lt(by_ray, by_center);
        let point = normal.mul_add(row.radius, row.center);
        let point = Vec3x8::select(along, rays.dir.mul_add(t, rays.origin), point);
        Surface8 { point, normal, error: along.select(by_ray, by_center) }
    }

    fn uv(part: &SpherePart, point: DVec3) -> DVec2 {
        let n = (point - part.center).normalize();
        let azimuth = n.z.atan2(n.x) / TAU;
        DVec2::new(azimuth - azimuth.floor(), n.y.clamp(-1.0, 1.0).acos() / PI)
    }

    fn bounds(part: &SpherePart) -> (DVec3, DVec3) {
        (part.center - part.radius, part.center + part.radius)
    }

    fn owner(part: &SpherePart) -> Owner {
        part.owner
    }

    fn sides(&self) -> &Sides {
        &self.sides
    }

    fn column_bytes(&self) -> usize {
        self.center.bytes() + self.radius.bytes() + self.center_low.bytes() + self.radius_low.bytes()
    }
}

impl Row {
    /// `|f|^2 - r^2` where both are nearly the same, with what rounding took from the center, the radius and
    /// `f` itself: beside a huge sphere that is more than the height above it.
    fn height_product(&self, f: Vec3x8, origin: &Vec3x8) -> Float8 {
        let lost = |c: Float8, o: Float8, f: Float8| {
            let o_part = c - f;
            (c - (f + o_part)) + (o_part - o)
        };
        let low = Vec3x8::new(
            lost(self.center.x, origin.x, f.x),
            lost(self.center.y, origin.y, f.y),
            lost(self.center.z, origin.z, f.z),
        ) + self.center_low;
        let rest = f.dot(low) - self.radius * self.radius_low;
        square_sum_minus(f.x, f.y, f.z, self.radius) + (rest + rest)
    }
}

/// By Lagrange's identity: the discriminant `r^2 d.d - |f x d|^2`, and both roots (of a tangent where
/// it is negative).
fn roots(part: &SpherePart, ray: &Ray64) -> (f64, [f64; 2]) {
    let f = part.center - ray.origin;
    let (fd, dd) = (f.dot(ray.dir), ray.dir.length_squared());
    let disc = part.radius * part.radius * dd - f.cross(ray.dir).length_squared();
    let z = fd + disc.max(0.0).sqrt().copysign(fd);
    (disc, [z / dd, (f.length() - part.radius) * (f.length() + part.radius) / z])
}

/// `x` with the sign of `sign`; `x >= 0` or NaN.
#[inline(always)]
pub(super) fn copysign(x: Float8, sign: Float8) -> Float8 {
    Mask8::sign(sign).select(-x, x)
}
