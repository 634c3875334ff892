//! Infinite planes. They have no bounds and stay outside the tree.

use glam::{DVec2, DVec3};

use super::{Hidden8, Part, Ray64, Surface8, Surface64, roundings};
use crate::lanes::{Float8, Hit8, Mask8, RayPacket, Vec3x8};
use crate::plan::{Owner, PlanePart};
use crate::scene::{Visible, basis};

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    height: Float8, // n . (point - origin)
    normal: Vec3x8,
}

impl Part for PlanePart {
    /// A point and the unit normal.
    type Rows = [Vec3x8; 2];
    type Anchor = Anchor;

    fn row(&self) -> [DVec3; 2] {
        [self.point, self.normal]
    }

    fn anchor<'a>(rows: &Self::Rows, origin: &Vec3x8, _: impl Fn(usize) -> Option<&'a Self>) -> Anchor {
        let [point, normal] = *rows;
        Anchor { height: normal.dot(point - *origin), normal }
    }

    /// `t = n . (point - origin) / n . dir`: equation (6) of the paper with its sign put right. A ray in
    /// the plane or beside it gives NaN or infinity, which no interval accepts.
    ///
    /// Source: Kucherov, Morgun and Golenkovskaya, "A visualization of 3D images by back ray tracing:
    /// the geometric approach", 2016, section IV A.
    #[inline(always)]
    fn hit<const CULL: bool>(anchor: &Anchor, rays: &RayPacket, hidden: &Hidden8) -> Hit8 {
        let nd = anchor.normal.dot(rays.dir);
        let t = anchor.height / nd;
        let mut mask = rays.accepts(t) & Mask8::lt(t, Float8::splat(f32::INFINITY));
        if CULL {
            mask &= !side_hidden(nd, hidden);
        }
        Hit8 { t, mask, doubt: Mask8::NONE }
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let nd = self.normal.dot(ray.dir);
        let t = self.normal.dot(self.point - ray.origin) / nd;
        (t.is_finite() && ray.accepts(t) && shows(nd, visible)).then_some(t)
    }

    fn refine(&self, ray: &Ray64, _: f64) -> Surface64 {
        flat_surface64(self.point, self.normal, ray)
    }

    #[inline(always)]
    fn surface([point, normal]: &[Vec3x8; 2], rays: &RayPacket, t: Float8) -> Surface8 {
        flat_surface(*point, *normal, rays, t)
    }

    fn uv(&self, point: DVec3) -> DVec2 {
        let (x, y) = basis(self.normal);
        let d = point - self.point;
        DVec2::new(d.dot(x), d.dot(y))
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        (DVec3::NEG_INFINITY, DVec3::INFINITY)
    }

    fn owner(&self) -> Owner {
        self.owner
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
