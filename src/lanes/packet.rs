//! Eight rays, eight hits.

use super::{Columns, Float8, LANES, Mask8, Ray, Vec3x8, float8};

/// Eight rays. A dead lane has an empty interval, `t_min = +inf` and `t_max = -inf`, which accepts
/// nothing, so kernels carry no extra mask.
#[derive(Debug, Clone, Copy)]
pub struct RayPacket {
    /// Scene units, camera-relative.
    pub origin: Vec3x8,
    /// Any length.
    pub dir: Vec3x8,
    /// Open ends.
    pub t_min: Float8,
    /// Closed ends.
    pub t_max: Float8,
    /// `1 / (dir . dir)`; NaN, which leaves all open that is made of it, where f32 does not hold such squares well.
    pub inv_dd: Float8,
}

impl RayPacket {
    /// Eight rays that are known to be valid; the lanes of `live` take part.
    #[inline(always)]
    pub fn new(origin: Vec3x8, dir: Vec3x8, t_max: Float8, live: Mask8) -> Self {
        let t_min = live.select(float8(0.0), float8(f32::INFINITY));
        let t_max = live.select(t_max, float8(f32::NEG_INFINITY));
        RayPacket::within(origin, dir, t_min, t_max)
    }

    /// Eight rays that hit nothing.
    #[inline(always)]
    pub fn dead() -> Self {
        RayPacket::new(Vec3x8::ZERO, Vec3x8::splat([1.0; 3]), Float8::ZERO, Mask8::NONE)
    }

    /// Eight rays with ends, which tell the dead ones.
    #[inline(always)]
    pub fn within(origin: Vec3x8, dir: Vec3x8, t_min: Float8, t_max: Float8) -> Self {
        RayPacket { origin, dir, t_min, t_max, inv_dd: inverse_square(dir) }
    }

    /// Up to eight rays; what is missing or invalid is dead.
    pub fn gather(rays: &[Ray]) -> Self {
        let dead = Ray { origin: [0.0; 3], t_min: f32::INFINITY, dir: [1.0; 3], t_max: f32::NEG_INFINITY };
        let ray = |i: usize| *rays.get(i).filter(|ray| ray.is_valid()).unwrap_or(&dead);
        let rays: [Ray; LANES] = std::array::from_fn(ray);
        let dir = Vec3x8::from_fn(|i| rays[i].dir);
        RayPacket {
            origin: Vec3x8::from_fn(|i| rays[i].origin),
            dir,
            t_min: Float8::from(rays.map(|ray| ray.t_min)),
            t_max: Float8::from(rays.map(|ray| ray.t_max)),
            inv_dd: inverse_square(dir),
        }
    }

    /// One valid ray in all lanes.
    #[inline(always)]
    pub fn splat(ray: &Ray) -> Self {
        let (origin, dir) = (Vec3x8::splat(ray.origin), Vec3x8::splat(ray.dir));
        RayPacket { origin, dir, t_min: float8(ray.t_min), t_max: float8(ray.t_max), inv_dd: inverse_square(dir) }
    }

    /// The ray of one lane in all lanes.
    #[inline(always)]
    pub fn broadcast(&self, i: usize) -> Self {
        RayPacket {
            origin: self.origin.broadcast(i),
            dir: self.dir.broadcast(i),
            t_min: self.t_min.broadcast(i),
            t_max: self.t_max.broadcast(i),
            inv_dd: self.inv_dd.broadcast(i),
        }
    }

    /// The ray of one lane.
    pub fn lane(&self, i: usize) -> Ray {
        let (t_min, t_max) = (self.t_min.to_array()[i], self.t_max.to_array()[i]);
        Ray { origin: self.origin.lane(i), t_min, dir: self.dir.lane(i), t_max }
    }

    /// The same with a copy of a live ray in dead lanes.
    #[inline(always)]
    pub fn filled(&self) -> Self {
        let live = self.live();
        let one = live.bits().trailing_zeros() as usize % LANES;
        let fill = |lanes: Float8| live.select(lanes, lanes.broadcast(one));
        RayPacket {
            origin: Vec3x8::select(live, self.origin, self.origin.broadcast(one)),
            dir: Vec3x8::select(live, self.dir, self.dir.broadcast(one)),
            t_min: fill(self.t_min),
            t_max: fill(self.t_max),
            inv_dd: fill(self.inv_dd),
        }
    }

    /// Lanes in which a hit at `t` lies on the ray.
    #[inline(always)]
    pub fn accepts(&self, t: Float8) -> Mask8 {
        Mask8::gt(t, self.t_min) & Mask8::le(t, self.t_max)
    }

    /// Lanes in which a hit at `t`, known to within `error`, may lie on the ray, and among them those of which it is
    /// open whether it lies beyond the start.
    #[inline(always)]
    pub fn reaches(&self, t: Float8, error: Float8) -> (Mask8, Mask8) {
        let (low, high) = (t - error, t + error);
        let possible = Mask8::gt(high, self.t_min) & Mask8::le(low, self.t_max);
        (possible, possible & Mask8::le(low, self.t_min))
    }

    /// Lanes that take part.
    #[inline(always)]
    pub fn live(&self) -> Mask8 {
        Mask8::lt(self.t_min, self.t_max)
    }
}

/// Directions whose squares, and products of those with squares of places, neither vanish nor overflow.
const SQUARES: [f32; 2] = [1e-30, 1e30];

#[inline(always)]
fn inverse_square(dir: Vec3x8) -> Float8 {
    let dd = dir.dot(dir);
    let held = Mask8::ge(dd, float8(SQUARES[0])) & Mask8::le(dd, float8(SQUARES[1]));
    held.select(float8(1.0) / dd, float8(f32::NAN))
}

/// What eight (ray, primitive) pairs came to.
#[derive(Debug, Clone, Copy)]
pub struct Hit8 {
    /// Place of the hit on its ray; means nothing in missed lanes.
    pub t: Float8,
    /// Bound on the distance of `t` from the place that exact geometry has: that of the scene in f64, and of any ray
    /// whose coordinates round to these.
    pub error: Float8,
    /// Lanes that hit, as far as f32 can tell, and no further than the ray's end by more than the error.
    pub mask: Mask8,
    /// Lanes too close to call: hit or miss is to be decided in f64. Those in `mask` as well have a `t` that is
    /// right if they hit, and keep it; the others get theirs in f64.
    pub doubt: Mask8,
}

impl Hit8 {
    /// No lane hits and none is in doubt.
    #[inline(always)]
    pub fn none() -> Self {
        Hit8 { t: Float8::ZERO, error: Float8::ZERO, mask: Mask8::NONE, doubt: Mask8::NONE }
    }

    /// The `t` of one lane, if it hit for certain.
    pub fn lane(&self, i: usize) -> Option<f32> {
        let bit = 1 << i;
        (self.mask.bits() & bit != 0 && self.doubt.bits() & bit == 0).then(|| self.t.to_array()[i])
    }
}

/// Eight vectors in f64, by axis.
pub type DVec3x8 = [[f64; LANES]; 3];

/// Dot products, not fused.
#[inline(always)]
pub fn dot8(a: &DVec3x8, b: &DVec3x8) -> [f64; LANES] {
    let mut dots = [0.0; LANES];
    for i in 0..LANES {
        dots[i] = a[0][i] * b[0][i] + a[1][i] * b[1][i] + a[2][i] * b[2][i];
    }
    dots
}

/// Origins and directions of eight rays in f64.
#[derive(Debug, Clone, Copy, Default)]
pub struct ExactPacket {
    /// Scene units, relative to the plan's origin.
    pub origin: DVec3x8,
    /// Any length.
    pub dir: DVec3x8,
}
