//! Infinite planes. They have no bounds and stay outside the tree.

use glam::{DVec2, DVec3};

use super::{Hidden8, Part, Ray64, Surface8, Surface64, roundings};
use crate::lanes::{Float8, Hit8, Mask8, RayPacket, Vec3x8, float8};
use crate::plan::{Owner, PlanePart};
use crate::scene::{Visible, basis};

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    height: Float8, // n . (point - origin)
    error: Float8,  // of the height, the rounding of the scene included
    normal: Vec3x8,
}

impl Part for PlanePart {
    /// A point and the unit normal.
    type Rows = [Vec3x8; 2];
    type Face = Self::Rows;
    type Anchor = Anchor;

    fn row(&self) -> [DVec3; 2] {
        [self.point, self.normal]
    }

    fn bounds8(_: &Self::Rows) -> (Vec3x8, Vec3x8) {
        EVERYWHERE
    }

    fn anchor(rows: &Self::Rows, origin: &Vec3x8) -> Anchor {
        let [point, normal] = *rows;
        let f = point - *origin;
        Anchor { height: normal.dot(f), error: height_error(normal, point, f), normal }
    }

    /// `t = n . (point - origin) / n . dir`: equation (6) of the paper with its sign put right. A ray in
    /// the plane or beside it gives NaN or infinity, which no interval accepts.
    ///
    /// Source: Kucherov, Morgun and Golenkovskaya, "A visualization of 3D images by back ray tracing:
    /// the geometric approach", 2016, section IV A.
    #[inline(always)]
    fn hit<'a, const CULL: bool, const CERTIFY: bool>(
        _: &Self::Rows,
        anchor: &Anchor,
        rays: &RayPacket,
        hidden: &Hidden8,
        _: impl Fn(usize) -> Option<&'a Self>,
    ) -> Hit8 {
        let nd = anchor.normal.dot(rays.dir);
        let crossing = Crossing::new::<CERTIFY>(anchor.height, anchor.error, nd, rays.dir.abs().sum());
        let (mut mask, doubt) = crossing.on::<CERTIFY>(rays);
        if CULL {
            mask &= !side_hidden(nd, hidden) | doubt;
        }
        Hit8 { t: crossing.t, error: crossing.error, mask: mask & !doubt, doubt }
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let nd = self.normal.dot(ray.dir);
        let t = self.normal.dot(self.point - ray.origin) / nd;
        (t.is_finite() && ray.accepts(t) && shows(nd, visible)).then_some(t)
    }

    fn refine(&self, ray: &Ray64, _: f64, _: Visible) -> Surface64 {
        flat_surface64(self.point, self.normal, ray)
    }

    #[inline(always)]
    fn face(rows: &Self::Rows) -> &Self::Rows {
        rows
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

    fn reach(&self, from: DVec3) -> f64 {
        (self.point - from).abs().max_element()
    }

    fn owner(&self) -> Owner {
        self.owner
    }
}

/// The bounds of planes.
const EVERYWHERE: (Vec3x8, Vec3x8) = (Vec3x8::constant(f32::NEG_INFINITY), Vec3x8::constant(f32::INFINITY));

/// The error of `n . f`, where f goes from the ray's origin to `anchor`: the anchor rounds with the scene, the origin with
/// the camera by no more than both others do, f with the subtraction, the normal and the products each once, the sum
/// three times.
#[inline(always)]
pub(super) fn height_error(normal: Vec3x8, anchor: Vec3x8, f: Vec3x8) -> Float8 {
    let (anchor, f) = (anchor.abs(), f.abs());
    normal.abs().dot(f * roundings(10.0) + anchor * roundings(3.5))
}

/// Where eight rays cross eight planes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    pub t: Float8,
    pub error: Float8,
    /// Lanes in which the ray may as well run beside the plane: nothing is known of `t` there.
    pub beside: Mask8,
}

impl Crossing {
    /// `height` is known to `error`, `nd` to six roundings of the direction's 1-norm, its own rounding included.
    #[inline(always)]
    pub fn new<const CERTIFY: bool>(height: Float8, error: Float8, nd: Float8, dir: Float8) -> Self {
        let inv = float8(1.0) / nd;
        let t = height * inv;
        if !CERTIFY {
            return Crossing { t, error: Float8::ZERO, beside: Mask8::NONE };
        }
        let slip = roundings(6.0) * dir;
        // Where slip is a quarter of n . dir at most, 4/3 stands for what is of second order.
        let first = t.abs().mul_add(slip, error) * (inv.abs() * float8(4.0 / 3.0));
        let error = t.abs().mul_add(roundings(2.0), first);
        Crossing { t, error, beside: Mask8::le(nd.abs(), slip * float8(4.0)) }
    }

    /// The same by one bound, which is `slip` and some roundings of the way to there, over the cosine; `dir` is the 1-norm
    /// of the direction.
    #[inline(always)]
    pub fn within<const CERTIFY: bool>(height: Float8, slip: Float8, nd: Float8, dir: Float8) -> Self {
        let inv = float8(1.0) / nd;
        let t = height * inv;
        if !CERTIFY {
            return Crossing { t, error: Float8::ZERO, beside: Mask8::NONE };
        }
        let error = roundings(20.5).mul_add(t.abs() * dir, slip) * inv.abs();
        Crossing { t, error, beside: Mask8::le(nd.abs(), roundings(24.0) * dir) }
    }

    /// Lanes that may be met, and among them those in which that is open.
    #[inline(always)]
    pub fn on<const CERTIFY: bool>(&self, rays: &RayPacket) -> (Mask8, Mask8) {
        let (met, open) = rays.reaches(self.t, self.error);
        if !CERTIFY {
            return (met & Mask8::lt(self.t, float8(f32::INFINITY)), Mask8::NONE);
        }
        let beside = self.beside & rays.live();
        (met | beside, open | beside)
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
    Surface8::sure(point, normal, error)
}
