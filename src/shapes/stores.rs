//! All stores of a render, and the one place that chooses among them.

use glam::{DVec2, DVec3};

use super::{
    Boxes, Cones, Cylinders, Disks, Planes, Polygons, Ray64, Sides, Spheres, Store, Surface8, Surface64, TurnedBoxes,
};
use crate::lanes::{Float8, LANES, Mask8, RayPacket, Vec3x8};
use crate::plan::{Kind, Owner, Parts};
use crate::scene::Visible;

/// One store a kind.
#[derive(Debug)]
pub struct Stores {
    spheres: Spheres,
    planes: Planes,
    disks: Disks,
    triangles: Polygons<3>,
    quads: Polygons<4>,
    octagons: Polygons<8>,
    boxes: Boxes,
    turned_boxes: TurnedBoxes,
    cylinders: Cylinders,
    cones: Cones,
    /// By kind and row.
    owners: Vec<Vec<Owner>>,
}

/// Work on the store of a kind that is known at run time: compiled once for every kind.
pub trait Visit {
    /// What comes of it.
    type Output;
    /// Does the work.
    fn visit<S: Store>(self, store: &S) -> Self::Output;
}

impl Stores {
    /// Stores the parts in their order; `visible` tells which sides of a material are seen.
    pub fn new(parts: Parts, visible: &[Visible]) -> Self {
        let mut stores = Stores {
            spheres: store(parts.spheres, visible),
            planes: store(parts.planes, visible),
            disks: store(parts.disks, visible),
            triangles: store(parts.triangles, visible),
            quads: store(parts.quads, visible),
            octagons: store(parts.octagons, visible),
            boxes: store(parts.boxes, visible),
            turned_boxes: store(parts.turned_boxes, visible),
            cylinders: store(parts.cylinders, visible),
            cones: store(parts.cones, visible),
            owners: Vec::new(),
        };
        stores.owners = Kind::ALL.iter().map(|kind| stores.visit(*kind, Owners)).collect();
        stores
    }

    /// Sends a visitor to the store of a kind.
    #[inline(always)]
    pub fn visit<V: Visit>(&self, kind: Kind, visitor: V) -> V::Output {
        match kind {
            Kind::Sphere => visitor.visit(&self.spheres),
            Kind::Plane => visitor.visit(&self.planes),
            Kind::Disk => visitor.visit(&self.disks),
            Kind::Triangle => visitor.visit(&self.triangles),
            Kind::Quad => visitor.visit(&self.quads),
            Kind::Octagon => visitor.visit(&self.octagons),
            Kind::Box => visitor.visit(&self.boxes),
            Kind::TurnedBox => visitor.visit(&self.turned_boxes),
            Kind::Cylinder => visitor.visit(&self.cylinders),
            Kind::Cone => visitor.visit(&self.cones),
        }
    }

    /// How many parts of a kind there are.
    pub fn count(&self, kind: Kind) -> usize {
        self.visit(kind, Count)
    }

    /// Whose part a row is.
    #[inline(always)]
    pub fn owner(&self, kind: Kind, row: usize) -> Owner {
        self.owners[kind as usize][row]
    }

    /// Which of two rows wins where both are met at the same `t`: the primitive of the lowest index, and
    /// within one primitive the part that is stored first.
    pub fn first_of(&self, a: RowRef, b: RowRef) -> RowRef {
        let key = |row: RowRef| row.kind().map(|kind| (self.owner(kind, row.row()).primitive, row));
        match (key(a), key(b)) {
            (None, _) => b,
            (_, None) => a,
            (a, b) => a.min(b).map_or(RowRef::MISS, |(_, row)| row),
        }
    }

    /// Where eight rays meet the rows that they met, whatever their kinds. Lanes that missed mean nothing.
    pub fn surface(&self, hits: Float8, rays: &RayPacket, t: Float8) -> Surface8 {
        let hits = hits.to_array().map(RowRef::from_lane);
        let mut surface = Surface8 { point: Vec3x8::ZERO, normal: Vec3x8::ZERO, error: Float8::ZERO };
        let mut done = 0u32;
        for hit in hits {
            let Some(kind) = hit.kind().filter(|kind| done >> *kind as u32 & 1 == 0) else { continue };
            let (mut rows, mut same) = ([0; LANES], 0);
            for (lane, hit) in hits.into_iter().enumerate() {
                let is_same = hit.is_of(kind);
                rows[lane] = if is_same { hit.row() as u32 } else { 0 };
                same |= u32::from(is_same) << lane;
            }
            let found = self.visit(kind, SurfaceOf { rows, rays, t });
            surface = if done == 0 { found } else { surface.with(Mask8::from_bits(same), &found) };
            done |= 1 << kind as u32;
        }
        surface
    }

    /// What a ray meets on a row near `t`, in f64.
    pub fn refine(&self, row: RowRef, ray: &Ray64, t: f64) -> Option<Surface64> {
        row.kind().map(|kind| self.visit(kind, Refine { row: row.row(), ray, t }))
    }

    /// Texture coordinates of a point, relative to the plan's origin, on a row.
    pub fn uv(&self, row: RowRef, point: DVec3) -> Option<DVec2> {
        row.kind().map(|kind| self.visit(kind, UvOf { row: row.row(), point }))
    }

    /// Whether any row of any kind hides a side.
    pub fn hide_any(&self) -> bool {
        Kind::ALL.iter().any(|kind| self.visit(*kind, HideAny))
    }

    /// Memory of the columns in bytes.
    pub fn column_bytes(&self) -> usize {
        let owners = self.owners.iter().map(|owners| owners.capacity() * size_of::<Owner>()).sum::<usize>();
        owners + Kind::ALL.iter().map(|kind| self.visit(*kind, ColumnBytes)).sum::<usize>()
    }
}

fn store<S: Store>(parts: Vec<S::Part>, visible: &[Visible]) -> S {
    let sides = parts.iter().map(|part| visible[S::owner(part).material as usize]).collect();
    S::new(parts, Sides::new(sides))
}

/// A row of a store: kind and row in 32 bits, so that eight fit a vector of lanes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct RowRef(u32);

impl RowRef {
    /// No row: the ray met nothing.
    pub const MISS: RowRef = RowRef(u32::MAX);
    /// Most rows of a kind.
    pub const MOST: usize = 1 << 28;

    /// A row of a kind.
    #[inline(always)]
    pub fn new(kind: Kind, row: usize) -> Self {
        RowRef((kind as u32) << 28 | row as u32)
    }

    /// Its kind, or `None` for a miss.
    #[inline(always)]
    pub fn kind(self) -> Option<Kind> {
        Kind::ALL.get((self.0 >> 28) as usize).copied()
    }

    /// Whether it is of a kind.
    #[inline(always)]
    pub fn is_of(self, kind: Kind) -> bool {
        self.0 >> 28 == kind as u32
    }

    /// Its row in the store of its kind.
    #[inline(always)]
    pub fn row(self) -> usize {
        (self.0 & (RowRef::MOST as u32 - 1)) as usize
    }

    /// The bits as a float that nobody computes with, to be kept in lanes.
    #[inline(always)]
    pub fn to_lane(self) -> f32 {
        f32::from_bits(self.0)
    }

    /// Back from a lane.
    #[inline(always)]
    pub fn from_lane(lane: f32) -> Self {
        RowRef(lane.to_bits())
    }
}

struct Count;

impl Visit for Count {
    type Output = usize;
    fn visit<S: Store>(self, store: &S) -> usize {
        store.parts().len()
    }
}

struct Owners;

impl Visit for Owners {
    type Output = Vec<Owner>;
    fn visit<S: Store>(self, store: &S) -> Vec<Owner> {
        store.parts().iter().map(S::owner).collect()
    }
}

struct SurfaceOf<'a> {
    rows: [u32; LANES],
    rays: &'a RayPacket,
    t: Float8,
}

impl Visit for SurfaceOf<'_> {
    type Output = Surface8;
    fn visit<S: Store>(self, store: &S) -> Surface8 {
        S::surface(&store.gather(self.rows), self.rays, self.t)
    }
}

struct Refine<'a> {
    row: usize,
    ray: &'a Ray64,
    t: f64,
}

impl Visit for Refine<'_> {
    type Output = Surface64;
    fn visit<S: Store>(self, store: &S) -> Surface64 {
        S::refine(&store.parts()[self.row], self.ray, self.t)
    }
}

struct UvOf {
    row: usize,
    point: DVec3,
}

impl Visit for UvOf {
    type Output = DVec2;
    fn visit<S: Store>(self, store: &S) -> DVec2 {
        S::uv(&store.parts()[self.row], self.point)
    }
}

struct HideAny;

impl Visit for HideAny {
    type Output = bool;
    fn visit<S: Store>(self, store: &S) -> bool {
        store.sides().hide_any()
    }
}

struct ColumnBytes;

impl Visit for ColumnBytes {
    type Output = usize;
    fn visit<S: Store>(self, store: &S) -> usize {
        store.column_bytes()
    }
}
