//! Axis-aligned boxes.

use glam::{DVec2, DVec3};

use super::{Hidden8, Part, Ray64, Surface8, Surface64, nearer, roundings};
use crate::lanes::{Float8, Hit8, Mask8, RayPacket, Vec3x8, float8};
use crate::plan::{BoxPart, Owner};
use crate::scene::Visible;

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    min: Vec3x8,
    max: Vec3x8,
}

impl Part for BoxPart {
    /// Lower and upper corner.
    type Rows = [Vec3x8; 2];
    type Anchor = Anchor;

    fn row(&self) -> [DVec3; 2] {
        [self.min, self.max]
    }

    #[inline(always)]
    fn anchor<'a>(rows: &Self::Rows, origin: &Vec3x8, _: impl Fn(usize) -> Option<&'a Self>) -> Anchor {
        Anchor { min: rows[0] - *origin, max: rows[1] - *origin }
    }

    #[inline(always)]
    fn hit<const CULL: bool>(anchor: &Anchor, rays: &RayPacket, hidden: &Hidden8) -> Hit8 {
        let (entry, exit) = slabs(anchor.min, anchor.max, rays.dir);
        first_of::<CULL>(entry, exit, hidden, rays)
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let (entry, exit) = slabs64(self.min - ray.origin, self.max - ray.origin, ray.dir);
        (entry <= exit).then(|| ray.first(entry, exit, visible)).flatten()
    }

    fn refine(&self, ray: &Ray64, t: f64) -> Surface64 {
        let (entry, exit) = slabs64(self.min - ray.origin, self.max - ray.origin, ray.dir);
        let t = nearer(entry, exit, t);
        let (point, normal) = face64(self.min, self.max, ray.at(t));
        Surface64 { t, point, normal }
    }

    #[inline(always)]
    fn surface([min, max]: &[Vec3x8; 2], rays: &RayPacket, t: Float8) -> Surface8 {
        let (point, normal) = face(*min, *max, rays.dir.mul_add(t, rays.origin));
        let reach = point.abs() + (min.abs() + max.abs());
        Surface8 { point, normal, error: roundings(2.0) * normal.abs().dot(reach) }
    }

    fn uv(&self, point: DVec3) -> DVec2 {
        face_uv(self.min, self.max, point)
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        (self.min, self.max)
    }

    fn owner(&self) -> Owner {
        self.owner
    }
}

/// Where rays from the origin of `min` and `max` enter and leave a box: `entry > exit` is a miss.
///
/// Source: Williams, Barrus, Morley and Shirley, "An efficient and robust ray-box intersection
/// algorithm", Journal of Graphics Tools 10(1), 2005. A ray along a slab divides by a zero of either
/// sign: it is inside everywhere or nowhere, its faces included.
#[inline(always)]
pub(super) fn slabs(min: Vec3x8, max: Vec3x8, dir: Vec3x8) -> (Float8, Float8) {
    let axis = |lo: Float8, hi: Float8, d: Float8| {
        let back = Mask8::sign(d);
        let (near, far) = (back.select(hi, lo) / d, back.select(lo, hi) / d);
        let along = Mask8::le(d.abs(), Float8::ZERO);
        if !along.any() {
            return (near, far);
        }
        let within = Mask8::le(lo, Float8::ZERO) & Mask8::ge(hi, Float8::ZERO);
        let infinity = float8(f32::INFINITY);
        (along.select(within.select(-infinity, infinity), near), along.select(within.select(infinity, -infinity), far))
    };
    let (x, y, z) = (axis(min.x, max.x, dir.x), axis(min.y, max.y, dir.y), axis(min.z, max.z, dir.z));
    (x.0.fast_max(y.0).fast_max(z.0), x.1.fast_min(y.1).fast_min(z.1))
}

/// The first of entry and exit that lies on the ray and is not hidden.
#[inline(always)]
pub(super) fn first_of<const CULL: bool>(entry: Float8, exit: Float8, hidden: &Hidden8, rays: &RayPacket) -> Hit8 {
    let met = Mask8::le(entry, exit);
    let mut entry_ok = rays.accepts(entry);
    let mut exit_ok = rays.accepts(exit);
    if CULL {
        entry_ok &= !hidden.front;
        exit_ok &= !hidden.back;
    }
    Hit8 { t: entry_ok.select(entry, exit), mask: met & (entry_ok | exit_ok), doubt: Mask8::NONE }
}

/// [`slabs`] in f64.
pub(super) fn slabs64(min: DVec3, max: DVec3, dir: DVec3) -> (f64, f64) {
    let (mut entry, mut exit) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        if dir[k] == 0.0 {
            if min[k] > 0.0 || max[k] < 0.0 {
                return (f64::INFINITY, f64::NEG_INFINITY);
            }
            continue;
        }
        let (a, b) = (min[k] / dir[k], max[k] / dir[k]);
        entry = entry.max(a.min(b));
        exit = exit.min(a.max(b));
    }
    (entry, exit)
}

/// Puts points on the nearest face; ties go to the lowest axis. The normal is that face's.
#[inline(always)]
pub(super) fn face(min: Vec3x8, max: Vec3x8, point: Vec3x8) -> (Vec3x8, Vec3x8) {
    let axis = |lo: Float8, hi: Float8, x: Float8| {
        let (below, above) = ((x - lo).abs(), (x - hi).abs());
        let low = Mask8::le(below, above);
        (below.fast_min(above), low.select(lo, hi), low.select(float8(-1.0), float8(1.0)))
    };
    let x = axis(min.x, max.x, point.x);
    let y = axis(min.y, max.y, point.y);
    let z = axis(min.z, max.z, point.z);
    let on_x = Mask8::le(x.0, y.0) & Mask8::le(x.0, z.0);
    let on_y = !on_x & Mask8::le(y.0, z.0);
    let on_z = !on_x & !on_y;
    let zero = Float8::ZERO;
    let normal = Vec3x8::new(on_x.select(x.2, zero), on_y.select(y.2, zero), on_z.select(z.2, zero));
    let point = Vec3x8::new(on_x.select(x.1, point.x), on_y.select(y.1, point.y), on_z.select(z.1, point.z));
    (point, normal)
}

/// [`face`] in f64.
pub(super) fn face64(min: DVec3, max: DVec3, mut point: DVec3) -> (DVec3, DVec3) {
    let (below, above) = ((point - min).abs(), (point - max).abs());
    let gap = below.min(above);
    let axis = (0..3).fold(0, |best, k| if gap[k] < gap[best] { k } else { best });
    let low = below[axis] <= above[axis];
    point[axis] = if low { min[axis] } else { max[axis] };
    let mut normal = DVec3::ZERO;
    normal[axis] = if low { -1.0 } else { 1.0 };
    (point, normal)
}

/// 0 to 1 along the two axes after the face's own, in cyclic order.
pub(super) fn face_uv(min: DVec3, max: DVec3, point: DVec3) -> DVec2 {
    let gap = (point - min).abs().min((point - max).abs());
    let axis = (0..3).fold(0, |best, k| if gap[k] < gap[best] { k } else { best });
    let part = (point - min) / (max - min);
    DVec2::new(part[(axis + 1) % 3], part[(axis + 2) % 3])
}
