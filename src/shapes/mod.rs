//! The primitives: one file each, with its columns, bounds, kernel, normal, uv and tests.
//!
//! A kernel takes eight (ray, primitive) pairs and does not know which side was splatted, so eight
//! rays against one primitive and one ray against eight primitives run the same lines and give the
//! same bits. What depends on the ray's origin and the primitive alone is an *anchor*, made once for
//! all rays that share an origin. Where a kernel cannot tell hit from miss it says so, and the pair is
//! decided in f64 from the scene's own numbers ([`Part::decide`]).

#[cfg(test)]
pub(crate) mod brute;
mod cone;
mod cuboid;
mod cylinder;
mod disk;
mod plane;
mod polygon;
mod sphere;
mod store;
mod stores;
#[cfg(test)]
mod tests;
mod turned;

use glam::{DVec2, DVec3};

pub use self::store::{Hidden8, Store};
pub use self::stores::{Groups, RowRef, Stores, Visit};

use crate::lanes::{
    Columns, DVec3x8, ExactPacket, Float8, Hit8, LANES, Mask8, Ray, RayPacket, UNIT_ROUNDOFF, Vec3x8, float8,
};
use crate::plan::Owner;
use crate::scene::Visible;

/// A kind of part: its columns, its kernel, and the same in f64.
pub trait Part: Clone + Send + Sync {
    /// Eight parts as kernels see them.
    type Rows: Columns;
    /// What of them tells where the surface is and which way it looks.
    type Face: Columns;
    /// What depends on the origin of a ray and the primitive alone.
    type Anchor: Copy;

    /// The numbers of one part, to be rounded.
    fn row(&self) -> <Self::Rows as Columns>::One;
    /// Bounds, lower and upper corner, as good as f32 is.
    fn bounds8(rows: &Self::Rows) -> (Vec3x8, Vec3x8);
    /// What the kernel needs of these rows for rays from `origin`.
    fn anchor(rows: &Self::Rows, origin: &Vec3x8) -> Self::Anchor;
    /// Lanes that certainly miss, whatever was rounded, by as little of their rows as can tell: asked before one ray is held
    /// against eight rows, most of whose memory it then need not touch.
    #[inline(always)]
    fn misses(_: &Self::Rows, _: &Self::Anchor, _: &RayPacket) -> Mask8 {
        Mask8::NONE
    }
    /// First hit with `t_min < t <= t_max`; with `CULL` hidden sides are not met. With `CERTIFY` it says what f32
    /// cannot tell: the error of `t`, which hits within that of the end of the ray are told of too, and doubts. `part`
    /// tells what a lane of `rows` stands for.
    fn hit<'a, const CULL: bool, const CERTIFY: bool>(
        rows: &Self::Rows,
        anchor: &Self::Anchor,
        rays: &RayPacket,
        hidden: &Hidden8,
        part: impl Fn(usize) -> Option<&'a Self>,
    ) -> Hit8
    where
        Self: 'a;
    /// The f64 answer where the kernel is in doubt: touching counts as a hit.
    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64>;
    /// The hit near `t` again, in f64; of two that f32 cannot tell apart the first one of a side that is seen.
    fn refine(&self, ray: &Ray64, t: f64, visible: Visible) -> Surface64;
    /// The same of up to eight parts, each met by the ray of its lane: the same bits. Lanes without a part mean nothing.
    fn refine8(parts: &[Option<(&Self, Visible)>; LANES], rays: &ExactPacket, t: &[f32; LANES]) -> Surface64x8 {
        let mut found = Surface64x8::default();
        for (lane, part) in parts.iter().enumerate() {
            let Some((part, visible)) = part else { continue };
            let (origin, dir) = rays.lane(lane);
            let ray = Ray64 { origin, dir, t_min: 0.0, t_max: f64::INFINITY };
            let Surface64 { point, normal, .. } = part.refine(&ray, f64::from(t[lane]), *visible);
            (0..3).for_each(|k| (found.point[k][lane], found.normal[k][lane]) = (point[k], normal[k]));
        }
        found
    }
    /// What of them tells where the surface is.
    fn face(rows: &Self::Rows) -> &Self::Face;
    /// Where the rays are at `t`, put on the surface.
    fn surface(face: &Self::Face, rays: &RayPacket, t: Float8) -> Surface8;
    /// Texture coordinates of a point on the part.
    fn uv(&self, point: DVec3) -> DVec2;
    /// Bounds: lower and upper corner.
    fn bounds(&self) -> (DVec3, DVec3);
    /// The largest distance from a point, by coordinate, of what the part is made of.
    fn reach(&self, from: DVec3) -> f64 {
        let (low, high) = self.bounds();
        (low - from).abs().max((high - from).abs()).max_element()
    }
    /// Whose part it is.
    fn owner(&self) -> Owner;
}

/// Eight hit points.
#[derive(Debug, Clone, Copy)]
pub struct Surface8 {
    /// On the surface up to `error`.
    pub point: Vec3x8,
    /// Geometric, outward, unit length to 4 roundings.
    pub normal: Vec3x8,
    /// Bound on the distance of `point` from the exact surface, scene units.
    pub error: Float8,
    /// Lanes in which f32 cannot tell which face of several was met.
    pub vague: Mask8,
}

impl Surface8 {
    const NOTHING: Surface8 =
        Surface8 { point: Vec3x8::ZERO, normal: Vec3x8::ZERO, error: Float8::ZERO, vague: Mask8::NONE };

    /// All of which is certain up to its error.
    #[inline(always)]
    fn sure(point: Vec3x8, normal: Vec3x8, error: Float8) -> Self {
        Surface8 { point, normal, error, vague: Mask8::NONE }
    }

    /// With the lanes of `mask` from `other`.
    fn with(&self, mask: Mask8, other: &Surface8) -> Surface8 {
        Surface8 {
            point: Vec3x8::select(mask, other.point, self.point),
            normal: Vec3x8::select(mask, other.normal, self.normal),
            error: mask.select(other.error, self.error),
            vague: (self.vague & !mask) | (other.vague & mask),
        }
    }

    /// Takes a lane from f64.
    fn set(&mut self, lane: usize, exact: &Surface64) {
        self.point.set_lane(lane, exact.point.as_vec3().to_array());
        self.normal.set_lane(lane, exact.normal.as_vec3().to_array());
    }
}

/// One hit point to f64 accuracy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface64 {
    /// Place on the ray.
    pub t: f64,
    /// On the surface.
    pub point: DVec3,
    /// Geometric, outward, unit.
    pub normal: DVec3,
}

/// Eight hit points to f64 accuracy.
#[derive(Debug, Clone, Copy, Default)]
pub struct Surface64x8 {
    /// On the surface.
    pub point: DVec3x8,
    /// Geometric, outward, unit.
    pub normal: DVec3x8,
}

impl Surface64x8 {
    /// With some lanes from another.
    #[inline(always)]
    fn set_lanes(&mut self, lanes: u32, other: &Surface64x8) {
        for k in 0..3 {
            for i in 0..LANES {
                let taken = lanes >> i & 1 == 1;
                self.point[k][i] = if taken { other.point[k][i] } else { self.point[k][i] };
                self.normal[k][i] = if taken { other.normal[k][i] } else { self.normal[k][i] };
            }
        }
    }
}

/// A ray in f64, relative to the plan's origin.
#[derive(Debug, Clone, Copy)]
pub struct Ray64 {
    /// Scene units.
    pub origin: DVec3,
    /// Any length.
    pub dir: DVec3,
    /// Open end.
    pub t_min: f64,
    /// Closed end.
    pub t_max: f64,
}

impl Ray64 {
    /// The exact numbers that the bits of `ray` are.
    pub fn exact(ray: &Ray) -> Self {
        let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        let (origin, dir) = (wide(ray.origin), wide(ray.dir));
        Ray64 { origin, dir, t_min: f64::from(ray.t_min), t_max: f64::from(ray.t_max) }
    }

    /// With origin and direction of one ray of eight.
    pub fn from(self, rays: &ExactPacket, lane: usize) -> Self {
        let (origin, dir) = rays.lane(lane);
        Ray64 { origin, dir, ..self }
    }

    /// Without an end.
    pub fn endless(self) -> Self {
        Ray64 { t_max: f64::INFINITY, ..self }
    }

    /// Whether a hit at `t` lies on the ray.
    pub fn accepts(&self, t: f64) -> bool {
        self.t_min < t && t <= self.t_max
    }

    /// The point at `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.dir
    }

    /// The smaller of two roots that lies on the ray, unless its side is hidden; the entry meets the
    /// front, the exit the back.
    pub fn first(&self, entry: f64, exit: f64, visible: Visible) -> Option<f64> {
        let entry = Some(entry).filter(|t| visible != Visible::Back && self.accepts(*t));
        entry.or_else(|| Some(exit).filter(|t| visible != Visible::Front && self.accepts(*t)))
    }
}

/// What f64 may be off by where a ray meets a part at `t`: some roundings of all the numbers involved, over the cosine
/// at which the ray meets the surface. Those are differences from the origin of the ray: where that lies does not count.
pub fn noise<P: Part>(part: &P, ray: &Ray64, t: f64) -> f64 {
    let way = t.abs() * ray.dir.abs().element_sum();
    let moved = 16.0 * f64::EPSILON * (part.reach(ray.origin) + way);
    let speed = part.refine(ray, t, Visible::Both).normal.dot(ray.dir).abs();
    let noise = moved / speed;
    // Where a ray grazes a round surface the square root of it is what opens.
    if noise.is_finite() { noise.min(1e-6 * t.abs() + moved) } else { 1e-6 * t.abs() }
}

/// The one of two roots that is nearer to `t`, which f32 may have rounded; where that cannot tell them apart the first
/// one, or the last one where only backs are seen.
#[inline(always)]
fn nearer(a: f64, b: f64, t: f64, visible: Visible) -> f64 {
    let (first, last) = (a.min(b), a.max(b));
    let rounded = 16.0 * f64::from(UNIT_ROUNDOFF) * t.abs();
    let is_first =
        if last - first <= rounded { visible != Visible::Back } else { (first - t).abs() <= (last - t).abs() };
    if is_first { first } else { last }
}

/// A length, in scene units, whose square is as small as f32 holds well: added to what places are off by, it leaves open
/// what squares that vanish cannot tell.
const VANISHING: f32 = 1e-18;

/// What products that vanish are off by, many times over: no smaller, for CPUs take a hundred cycles for sums with numbers
/// below this.
const VANISHED: f32 = f32::MIN_POSITIVE;

/// Squared lengths from which on no square that matters has vanished.
const LEAST_SQUARE: f32 = 1e-26;

/// To unit length, however short; a zero vector gives NaN.
#[inline(always)]
fn unit(v: Vec3x8) -> Vec3x8 {
    let squared = v.length_squared();
    if Mask8::lt(squared, float8(LEAST_SQUARE)).any() {
        return unit_of_short(&v);
    }
    v * (float8(1.0) / squared.sqrt())
}

/// A power of two changes no bit of what is long enough.
#[cold]
#[inline(never)]
fn unit_of_short(v: &Vec3x8) -> Vec3x8 {
    let is_short = Mask8::lt(v.length_squared(), float8(LEAST_SQUARE));
    Vec3x8::select(is_short, *v * float8(2f32.powi(80)), *v).normalize()
}

/// The half-width of a decision's doubt, in units of [`UNIT_ROUNDOFF`] of its terms.
#[inline(always)]
fn roundings(n: f32) -> Float8 {
    float8(n * UNIT_ROUNDOFF)
}
