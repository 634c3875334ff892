//! Infinite planes. They have no bounds and stay outside the tree.

use glam::{DVec2, DVec3};

use super::{Hidden8, Ray64, Sides, Store, Surface8, Surface64, roundings};
use crate::lanes::{Column3, Float8, Hit8, LANES, Mask8, RayPacket, Vec3x8};
use crate::plan::{Owner, PlanePart};
use crate::scene::{Visible, basis};

/// All planes of a render.
#[derive(Debug)]
pub struct Planes {
    point: Column3,  // scene units
    normal: Column3, // unit
    sides: Sides,
    parts: Vec<PlanePart>,
}

/// Eight rows.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    point: Vec3x8,
    normal: Vec3x8,
    hidden: Hidden8,
}

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    height: Float8, // n . (point - origin)
    normal: Vec3x8,
    hidden: Hidden8,
}

impl Store for Planes {
    type Part = PlanePart;
    type Row = Row;
    type Anchor = Anchor;

    fn new(parts: Vec<PlanePart>, sides: Sides) -> Self {
        let point = Column3::new(parts.iter().map(|part| part.point));
        let normal = Column3::new(parts.iter().map(|part| part.normal));
        Planes { point, normal, sides, parts }
    }

    fn parts(&self) -> &[PlanePart] {
        &self.parts
    }

    fn splat(&self, i: usize) -> Row {
        Row { point: self.point.splat(i), normal: self.normal.splat(i), hidden: self.sides.splat(i) }
    }

    fn block(&self, first: usize) -> Row {
        Row { point: self.point.block(first), normal: self.normal.block(first), hidden: self.sides.block(first) }
    }

    fn gather(&self, rows: [u32; LANES]) -> Row {
        let hidden = self.sides.lanes(|lane| rows[lane] as usize);
        Row { point: self.point.gather(rows), normal: self.normal.gather(rows), hidden }
    }

    fn anchor(row: &Row, origin: &Vec3x8) -> Anchor {
        let height = row.normal.dot(row.point - *origin);
        Anchor { height, normal: row.normal, hidden: row.hidden }
    }

    /// `t = n . (point - origin) / n . dir`: equation (6) of the paper with its sign put right. A ray in
    /// the plane or beside it gives NaN or infinity, which no interval accepts.
    ///
    /// Source: Kucherov, Morgun and Golenkovskaya, "A visualization of 3D images by back ray tracing:
    /// the geometric approach", 2016, section IV A.
    #[inline(always)]
    fn hit<const CULL: bool>(anchor: &Anchor, rays: &RayPacket) -> Hit8 {
        let nd = anchor.normal.dot(rays.dir);
        let t = anchor.height / nd;
        let mut mask = rays.accepts(t) & Mask8::lt(t, Float8::splat(f32::INFINITY));
        if CULL {
            mask &= !side_hidden(nd, &anchor.hidden);
        }
        Hit8 { t, mask, doubt: Mask8::NONE }
    }

    fn decide(part: &PlanePart, ray: &Ray64, visible: Visible) -> Option<f64> {
        let nd = part.normal.dot(ray.dir);
        let t = part.normal.dot(part.point - ray.origin) / nd;
        (t.is_finite() && ray.accepts(t) && shows(nd, visible)).then_some(t)
    }

    fn refine(part: &PlanePart, ray: &Ray64, _: f64) -> Surface64 {
        flat_surface64(part.point, part.normal, ray)
    }

    #[inline(always)]
    fn surface(row: &Row, rays: &RayPacket, t: Float8) -> Surface8 {
        flat_surface(row.point, row.normal, rays, t)
    }

    fn uv(part: &PlanePart, point: DVec3) -> DVec2 {
        let (x, y) = basis(part.normal);
        let d = point - part.point;
        DVec2::new(d.dot(x), d.dot(y))
    }

    fn bounds(_: &PlanePart) -> (DVec3, DVec3) {
        (DVec3::NEG_INFINITY, DVec3::INFINITY)
    }

    fn owner(part: &PlanePart) -> Owner {
        part.owner
    }

    fn sides(&self) -> &Sides {
        &self.sides
    }

    fn column_bytes(&self) -> usize {
        self.point.bytes() + self.normal.bytes()
    }
}

/// Lanes in which a ray with this `n . dir` would meet a hidden side of a flat primitive.
#[inline(always)]
pub(super) fn side_hidden(nd: Float8, hidden: &Hidden8) -> Mask8 {
    let from_front = Mask8::sign(nd);
    (from_front & hidden.front) | (!from_front & hidden.back)
}

/// The same for one ray in f64.
pub(super) fn shows(nd: f64, visible: Visible) -> bool {
    match visible {
        Visible::Both => true,
        Visible::Front => nd < 0.0,
        Visible::Back => nd >= 0.0,
    }
}

/// Where a ray meets the plane through `anchor`.
pub(super) fn flat_surface64(anchor: DVec3, normal: DVec3, ray: &Ray64) -> Surface64 {
    let t = normal.dot(anchor - ray.origin) / normal.dot(ray.dir);
    let point = ray.at(t);
    Surface64 { t, point: point + normal * normal.dot(anchor - point), normal }
}

/// The hit point moved along the normal onto the plane through `anchor`.
#[inline(always)]
pub(super) fn flat_surface(anchor: Vec3x8, normal: Vec3x8, rays: &RayPacket, t: Float8) -> Surface8 {
    let point = rays.dir.mul_add(t, rays.origin);
    let lift = normal.dot(anchor - point);
    let point = normal.mul_add(lift, point);
    // The plane through the rounded anchor and the rounded normal, against the exact one at this point.
    let reach = anchor.abs() + point.abs() + point.abs() + (point - anchor).abs();
    let error = roundings(3.0) * normal.abs().dot(reach) + roundings(4.0) * (point - anchor).length();
    Surface8 { point, normal, error }
}
