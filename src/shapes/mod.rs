//! The primitives: one file each, with its columns, bounds, kernel, normal, uv and tests.
//!
//! A kernel takes eight (ray, primitive) pairs and does not know which side was splatted, so eight
//! rays against one primitive and one ray against eight primitives run the same lines and give the
//! same bits. What depends on the ray's origin and the primitive alone is an *anchor*, made once for
//! all rays that share an origin. Where a kernel cannot tell hit from miss it says so, and the pair is
//! decided in f64 from the scene's own numbers ([`Store::decide`]).

#[cfg(test)]
pub(crate) mod brute;
mod cone;
mod cuboid;
mod cylinder;
mod disk;
mod plane;
mod polygon;
mod sphere;
mod stores;
#[cfg(test)]
mod tests;
mod turned;

use glam::{DVec2, DVec3};

pub use self::cone::Cones;
pub use self::cuboid::Boxes;
pub use self::cylinder::Cylinders;
pub use self::disk::Disks;
pub use self::plane::Planes;
pub use self::polygon::Polygons;
pub use self::sphere::Spheres;
pub use self::stores::{RowRef, Stores, Visit};
pub use self::turned::TurnedBoxes;

use crate::lanes::{Column, Float8, Hit8, LANES, Mask8, Ray, RayPacket, Vec3x8, float8};
use crate::plan::Owner;
use crate::scene::Visible;

/// All primitives of one kind, structure of arrays: primitive `i` is row `i` of every column.
pub trait Store: Sized + Sync {
    /// One primitive in f64, relative to the plan's origin.
    type Part: Clone + Send + Sync;
    /// Eight rows of all columns.
    type Row: Copy;
    /// What depends on the origin of a ray and the primitive alone.
    type Anchor: Copy;

    /// Stores the parts in this order.
    fn new(parts: Vec<Self::Part>, sides: Sides) -> Self;
    /// The parts, in the order of the rows.
    fn parts(&self) -> &[Self::Part];
    /// Row `i` in all lanes.
    fn splat(&self, i: usize) -> Self::Row;
    /// Rows `first..first + 8`, a lane each; rows past the last one cannot be hit.
    fn block(&self, first: usize) -> Self::Row;
    /// Lane `k` is row `rows[k]`.
    fn gather(&self, rows: [u32; LANES]) -> Self::Row;
    /// What the kernel needs of these rows for rays from `origin`.
    fn anchor(row: &Self::Row, origin: &Vec3x8) -> Self::Anchor;
    /// First hit with `t_min < t <= t_max`; with `CULL` hidden sides are not met.
    fn hit<const CULL: bool>(anchor: &Self::Anchor, rays: &RayPacket) -> Hit8;
    /// The f64 answer where the kernel is in doubt: touching counts as a hit.
    fn decide(part: &Self::Part, ray: &Ray64, visible: Visible) -> Option<f64>;
    /// The hit near `t` again, in f64.
    fn refine(part: &Self::Part, ray: &Ray64, t: f64) -> Surface64;
    /// Where the rays are at `t`, put on the surface.
    fn surface(row: &Self::Row, rays: &RayPacket, t: Float8) -> Surface8;
    /// Texture coordinates of one hit point on one part.
    fn uv(part: &Self::Part, point: DVec3) -> DVec2;
    /// Bounds of a part: lower and upper corner.
    fn bounds(part: &Self::Part) -> (DVec3, DVec3);
    /// Whose part it is.
    fn owner(part: &Self::Part) -> Owner;
    /// Which sides of the rows are seen.
    fn sides(&self) -> &Sides;
    /// Memory of the columns in bytes.
    fn column_bytes(&self) -> usize;
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
}

impl Surface8 {
    /// With the lanes of `mask` from `other`.
    fn with(&self, mask: Mask8, other: &Surface8) -> Surface8 {
        Surface8 {
            point: Vec3x8::select(mask, other.point, self.point),
            normal: Vec3x8::select(mask, other.normal, self.normal),
            error: mask.select(other.error, self.error),
        }
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

    /// The whole line.
    pub fn endless(self) -> Self {
        Ray64 { t_min: f64::NEG_INFINITY, t_max: f64::INFINITY, ..self }
    }

    /// Whether a hit at `t` lies on the ray. Hits are stored in f32, and so they are compared: else of two
    /// hits at the same place the second would lie beyond the first where that was rounded down.
    pub fn accepts(&self, t: f64) -> bool {
        let t = f64::from(t as f32);
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

/// The one of two roots that is nearer to `t`.
fn nearer(a: f64, b: f64, t: f64) -> f64 {
    if (a - t).abs() <= (b - t).abs() { a } else { b }
}

/// Which sides of each row are seen; nothing is stored where all rows show both.
#[derive(Debug, Clone, Default)]
pub struct Sides(Option<Vec<Visible>>);

/// Hidden sides of eight rows.
#[derive(Debug, Clone, Copy)]
pub struct Hidden8 {
    /// Lanes whose front is not met.
    pub front: Mask8,
    /// Lanes whose back is not met.
    pub back: Mask8,
}

impl Sides {
    /// One entry a row.
    pub fn new(rows: Vec<Visible>) -> Self {
        Sides(rows.iter().any(|side| *side != Visible::Both).then_some(rows))
    }

    /// Whether any row hides a side.
    pub fn hide_any(&self) -> bool {
        self.0.is_some()
    }

    /// What row `i` shows.
    pub fn row(&self, i: usize) -> Visible {
        self.0.as_ref().map_or(Visible::Both, |rows| rows[i])
    }

    #[inline(always)]
    fn splat(&self, i: usize) -> Hidden8 {
        self.lanes(|_| i)
    }

    #[inline(always)]
    fn block(&self, first: usize) -> Hidden8 {
        self.lanes(|lane| first + lane)
    }

    #[inline(always)]
    fn lanes(&self, row: impl Fn(usize) -> usize) -> Hidden8 {
        let Some(rows) = &self.0 else { return Hidden8 { front: Mask8::NONE, back: Mask8::NONE } };
        let bits = |side| (0..LANES).map(|lane| u32::from(rows.get(row(lane)) == Some(&side)) << lane).sum();
        Hidden8 { front: Mask8::from_bits(bits(Visible::Back)), back: Mask8::from_bits(bits(Visible::Front)) }
    }
}

/// The half-width of a decision's doubt, in units of [`UNIT_ROUNDOFF`](crate::lanes::UNIT_ROUNDOFF) of its terms.
#[inline(always)]
fn roundings(n: f32) -> Float8 {
    float8(n * crate::lanes::UNIT_ROUNDOFF)
}

/// Unit normals of parts, rounded to f32.
fn column_of<P>(parts: &[P], f: impl Fn(&P) -> f64) -> Column {
    Column::new(parts.iter().map(f))
}
