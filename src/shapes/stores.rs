//! All stores of a render, and the one place that chooses among them.

use glam::{DVec2, DVec3};

use super::{Part, Ray64, Store, Surface8, Surface64, Surface64x8, noise};
use crate::lanes::{Columns, ExactPacket, Float8, LANES, Mask8, RayPacket, Vec3x8, bits, float8};
use crate::plan::{
    BoxPart, ConePart, CylinderPart, DiskPart, Kind, Owner, Parts, PlanePart, PolygonPart, SPECK, SpherePart,
    TurnedBoxPart,
};
use crate::scene::Visible;

/// One store a kind.
#[derive(Debug)]
pub struct Stores {
    spheres: Store<SpherePart>,
    planes: Store<PlanePart>,
    disks: Store<DiskPart>,
    triangles: Store<PolygonPart<3>>,
    quads: Store<PolygonPart<4>>,
    octagons: Store<PolygonPart<8>>,
    boxes: Store<BoxPart>,
    turned_boxes: Store<TurnedBoxPart>,
    cylinders: Store<CylinderPart>,
    cones: Store<ConePart>,
    /// Whether what f32 leaves open is decided in f64.
    certify: bool,
}

/// Sizes of the groups that the parts of each kind stand in.
pub type Groups = [Vec<u8>; Kind::ALL.len()];

/// Work on the store of a kind that is known at run time: compiled once for every kind.
pub trait Visit {
    /// What comes of it.
    type Output;
    /// Does the work.
    fn visit<P: Part>(self, store: &Store<P>) -> Self::Output;
}

impl Stores {
    /// Stores the parts in their order; `groups` tells which of them belong together (without, eight by eight),
    /// `visible` which sides of a material are seen.
    pub fn new(parts: Parts, groups: Option<&Groups>, visible: &[Visible]) -> Self {
        fn store<P: Part>(kind: Kind, parts: Vec<P>, groups: Option<&Groups>, visible: &[Visible]) -> Store<P> {
            match groups.map(|groups| &groups[kind as usize]) {
                Some(groups) => Store::new(parts, groups.iter().map(|count| usize::from(*count)), visible),
                None => {
                    let count = parts.len();
                    Store::new(parts, (0..count).step_by(LANES).map(|first| LANES.min(count - first)), visible)
                }
            }
        }
        Stores {
            spheres: store(Kind::Sphere, parts.spheres, groups, visible),
            planes: store(Kind::Plane, parts.planes, None, visible),
            disks: store(Kind::Disk, parts.disks, groups, visible),
            triangles: store(Kind::Triangle, parts.triangles, groups, visible),
            quads: store(Kind::Quad, parts.quads, groups, visible),
            octagons: store(Kind::Octagon, parts.octagons, groups, visible),
            boxes: store(Kind::Box, parts.boxes, groups, visible),
            turned_boxes: store(Kind::TurnedBox, parts.turned_boxes, groups, visible),
            cylinders: store(Kind::Cylinder, parts.cylinders, groups, visible),
            cones: store(Kind::Cone, parts.cones, groups, visible),
            certify: true,
        }
    }

    /// Whether what f32 leaves open is decided in f64, as it should be.
    #[inline(always)]
    pub fn certify(&self) -> bool {
        self.certify
    }

    /// With `false`, f32 alone decides.
    pub fn set_certify(&mut self, certify: bool) {
        self.certify = certify;
    }

    /// Asks for the first rows of a block to be brought near.
    #[inline(always)]
    pub fn fetch(&self, kind: Kind, block: usize) {
        self.visit(kind, Fetch(block));
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

    /// Gives kinds that are absent a block that no ray can hit; which they are.
    pub fn pad(&mut self) -> Vec<Kind> {
        fn pad<P: Part>(store: &mut Store<P>) {
            if store.blocks() == 0 {
                store.pad();
            }
        }
        let absent = Kind::ALL.into_iter().filter(|kind| self.blocks(*kind) == 0).collect();
        pad(&mut self.spheres);
        pad(&mut self.planes);
        pad(&mut self.disks);
        pad(&mut self.triangles);
        pad(&mut self.quads);
        pad(&mut self.octagons);
        pad(&mut self.boxes);
        pad(&mut self.turned_boxes);
        pad(&mut self.cylinders);
        pad(&mut self.cones);
        absent
    }

    /// How many blocks of a kind there are.
    pub fn blocks(&self, kind: Kind) -> usize {
        self.visit(kind, Blocks)
    }

    /// Whose part a row is.
    #[inline(always)]
    pub fn owner(&self, kind: Kind, row: usize) -> Owner {
        self.visit(kind, OwnerOf(row))
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

    /// Where eight rays meet the rows that they met, whatever their kinds, and whose those are. Lanes that missed
    /// mean nothing. With `NORMAL` alone, points and their errors are left out. Faces that f32 cannot tell apart are
    /// told by the rays before they were rounded where those are given.
    #[inline(always)]
    pub fn surface<const NORMAL: bool>(
        &self,
        hits: Float8,
        rays: &RayPacket,
        t: Float8,
        exact: Option<&ExactPacket>,
    ) -> (Surface8, [Owner; LANES]) {
        let hits = hits.to_array();
        let mut left = 0;
        for (lane, hit) in hits.iter().enumerate() {
            left |= u32::from(RowRef::from_lane(*hit) != RowRef::MISS) << lane;
        }
        if left == 0 {
            return (Surface8::NOTHING, [Owner::default(); LANES]);
        }
        let (mut surface, mut owners, others) = self.surface_of_kind::<NORMAL>(&hits, left, rays, t);
        left &= others;
        while left != 0 {
            let (found, whose, others) = self.surface_of_kind::<NORMAL>(&hits, left, rays, t);
            for lane in bits(left & !others) {
                owners[lane] = whose[lane];
            }
            surface = surface.with(Mask8::from_bits(left & !others), &found);
            left &= others;
        }
        if surface.vague.any() && self.certify {
            self.sharpen(surface.vague, &hits, (rays, t), exact, &mut surface);
        }
        (surface, owners)
    }

    /// Takes some lanes of a surface from f64, of rays before they were rounded where those are given.
    #[cold]
    #[inline(never)]
    pub fn sharpen(
        &self,
        lanes: Mask8,
        hits: &[f32; LANES],
        (rays, t): (&RayPacket, Float8),
        exact: Option<&ExactPacket>,
        surface: &mut Surface8,
    ) {
        for lane in lanes.lanes() {
            let ray = Ray64::exact(&rays.lane(lane));
            let ray = exact.map_or(ray, |exact| ray.from(exact, lane));
            if let Some(found) = self.refine(RowRef::from_lane(hits[lane]), &ray, f64::from(t.as_array()[lane])) {
                surface.set(lane, &found);
            }
        }
    }

    /// Takes the normals of those lanes of a surface that met spheres which are specks from there from f64, of rays
    /// before they were rounded.
    #[inline(never)]
    pub fn sharpen_specks(
        &self,
        lanes: u32,
        hits: &[f32; LANES],
        (rays, exact): (&RayPacket, &ExactPacket),
        surface: &mut Surface8,
    ) {
        let (t, mut radius) = (rays.t_max, [f32::INFINITY; LANES]);
        for lane in bits(lanes) {
            let row = RowRef::from_lane(hits[lane]);
            if row.kind() == Some(Kind::Sphere) {
                radius[lane] = self.spheres.block(row.row() / LANES).1.as_array()[row.row() % LANES];
            }
        }
        let flatness = rays.dir.dot(rays.dir) / surface.normal.dot(rays.dir).abs();
        let specks = Mask8::gt(t * flatness, Float8::from(radius) * float8(SPECK as f32));
        if specks.any() {
            let normal = Vec3x8::rounded(&self.refine8(specks.bits(), hits, exact, t.as_array()).normal);
            surface.normal = Vec3x8::select(specks, normal, surface.normal);
        }
    }

    /// The same for the lanes that met something of the kind that the first of `left` met, and which did not.
    #[inline(always)]
    fn surface_of_kind<const NORMAL: bool>(
        &self,
        hits: &[f32; LANES],
        left: u32,
        rays: &RayPacket,
        t: Float8,
    ) -> (Surface8, [Owner; LANES], u32) {
        let first = RowRef::from_lane(hits[left.trailing_zeros() as usize % LANES]);
        let (mut rows, mut others) = ([first.row() as u32; LANES], 0);
        for (lane, row) in rows.iter_mut().enumerate() {
            let hit = RowRef::from_lane(hits[lane]);
            let same = hit.0 >> 28 == first.0 >> 28;
            *row = if same { hit.row() as u32 } else { *row };
            others |= u32::from(!same) << lane;
        }
        let kind = first.kind().unwrap_or(Kind::Sphere);
        let (surface, owners) = self.visit(kind, SurfaceOf::<NORMAL> { rows: &rows, rays, t });
        (surface, owners, others)
    }

    /// Where a ray first meets a side of a row that is seen, in f64.
    pub fn decide(&self, row: RowRef, ray: &Ray64) -> Option<f64> {
        row.kind().and_then(|kind| self.visit(kind, Decide { row: row.row(), ray, all: false }))
    }

    /// The same of any side.
    pub fn decide_any(&self, row: RowRef, ray: &Ray64) -> Option<f64> {
        row.kind().and_then(|kind| self.visit(kind, Decide { row: row.row(), ray, all: true }))
    }

    /// What f64 may be off by where a ray meets a row at `t`.
    pub fn noise(&self, row: RowRef, ray: &Ray64, t: f64) -> f64 {
        row.kind().map_or(0.0, |kind| self.visit(kind, Noise { row: row.row(), ray, t }))
    }

    /// What a ray meets on a row near `t`, in f64.
    pub fn refine(&self, row: RowRef, ray: &Ray64, t: f64) -> Option<Surface64> {
        row.kind().and_then(|kind| self.visit(kind, Refine { row: row.row(), ray, t }))
    }

    /// What eight rays meet near `t` on the rows that they met, in f64; the other lanes mean nothing.
    pub fn refine8(&self, lanes: u32, hits: &[f32; LANES], rays: &ExactPacket, t: &[f32; LANES]) -> Surface64x8 {
        let (mut found, mut left) = (Surface64x8::default(), lanes);
        while left != 0 {
            let first = RowRef::from_lane(hits[left.trailing_zeros() as usize % LANES]);
            let mut lanes = 0;
            for (lane, hit) in hits.iter().enumerate() {
                lanes |= u32::from(RowRef::from_lane(*hit).0 >> 28 == first.0 >> 28) << lane;
            }
            lanes &= left;
            left &= !lanes;
            let Some(kind) = first.kind() else { continue };
            let more = self.visit(kind, RefineEight { lanes, hits, rays, t });
            if lanes == u32::MAX >> (32 - LANES) { found = more } else { found.set_lanes(lanes, &more) }
        }
        found
    }

    /// Texture coordinates of a point, relative to the plan's origin, on a row.
    pub fn uv(&self, row: RowRef, point: DVec3) -> Option<DVec2> {
        row.kind().and_then(|kind| self.visit(kind, UvOf { row: row.row(), point }))
    }

    /// Whether any row of any kind hides a side.
    pub fn hide_any(&self) -> bool {
        Kind::ALL.iter().any(|kind| self.visit(*kind, HideAny))
    }

    /// Memory of the columns in bytes.
    pub fn column_bytes(&self) -> usize {
        Kind::ALL.iter().map(|kind| self.visit(*kind, ColumnBytes)).sum::<usize>()
    }
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

    /// Whether it lies in a plane.
    #[inline(always)]
    pub fn is_flat(self) -> bool {
        let kind = self.0 >> 28;
        kind >= Kind::Plane as u32 && kind <= Kind::Octagon as u32
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

struct Blocks;

impl Visit for Blocks {
    type Output = usize;
    fn visit<P: Part>(self, store: &Store<P>) -> usize {
        store.blocks()
    }
}

struct Fetch(usize);

impl Visit for Fetch {
    type Output = ();
    #[inline(always)]
    fn visit<P: Part>(self, store: &Store<P>) {
        store.fetch(self.0);
    }
}

struct OwnerOf(usize);

impl Visit for OwnerOf {
    type Output = Owner;
    #[inline(always)]
    fn visit<P: Part>(self, store: &Store<P>) -> Owner {
        store.owner(self.0)
    }
}

struct SurfaceOf<'a, const NORMAL: bool> {
    rows: &'a [u32; LANES],
    rays: &'a RayPacket,
    t: Float8,
}

impl<const NORMAL: bool> Visit for SurfaceOf<'_, NORMAL> {
    type Output = (Surface8, [Owner; LANES]);
    #[inline(never)]
    fn visit<P: Part>(self, store: &Store<P>) -> Self::Output {
        let first = self.rows[0];
        let mut owners = [store.owner(first as usize); LANES];
        let mut surface = if self.rows.iter().all(|row| *row == first) {
            let face = P::face(store.block(first as usize / LANES)).broadcast(first as usize % LANES);
            P::surface(&face, self.rays, self.t)
        } else {
            for (owner, row) in owners.iter_mut().zip(self.rows) {
                *owner = store.owner(*row as usize);
            }
            P::surface(&store.faces(self.rows), self.rays, self.t)
        };
        if NORMAL {
            let Surface8 { normal, vague, .. } = surface;
            surface = Surface8 { normal, vague, ..Surface8::NOTHING };
        }
        (surface, owners)
    }
}

struct Decide<'a> {
    row: usize,
    ray: &'a Ray64,
    /// Hidden sides too.
    all: bool,
}

impl Visit for Decide<'_> {
    type Output = Option<f64>;
    fn visit<P: Part>(self, store: &Store<P>) -> Option<f64> {
        let visible = if self.all { Visible::Both } else { store.sides().row(self.row) };
        store.part(self.row).and_then(|part| part.decide(self.ray, visible))
    }
}

struct Noise<'a> {
    row: usize,
    ray: &'a Ray64,
    t: f64,
}

impl Visit for Noise<'_> {
    type Output = f64;
    fn visit<P: Part>(self, store: &Store<P>) -> f64 {
        store.part(self.row).map_or(0.0, |part| noise(part, self.ray, self.t))
    }
}

struct Refine<'a> {
    row: usize,
    ray: &'a Ray64,
    t: f64,
}

impl Visit for Refine<'_> {
    type Output = Option<Surface64>;
    fn visit<P: Part>(self, store: &Store<P>) -> Self::Output {
        let visible = store.sides().row(self.row);
        store.part(self.row).map(|part| part.refine(self.ray, self.t, visible))
    }
}

struct RefineEight<'a> {
    lanes: u32,
    hits: &'a [f32; LANES],
    rays: &'a ExactPacket,
    t: &'a [f32; LANES],
}

impl Visit for RefineEight<'_> {
    type Output = Surface64x8;
    fn visit<P: Part>(self, store: &Store<P>) -> Surface64x8 {
        let mut parts = [None; LANES];
        for lane in bits(self.lanes) {
            let row = RowRef::from_lane(self.hits[lane]).row();
            parts[lane] = store.part(row).map(|part| (part, store.sides().row(row)));
        }
        P::refine8(&parts, self.rays, self.t)
    }
}

struct UvOf {
    row: usize,
    point: DVec3,
}

impl Visit for UvOf {
    type Output = Option<DVec2>;
    fn visit<P: Part>(self, store: &Store<P>) -> Self::Output {
        store.part(self.row).map(|part| part.uv(self.point))
    }
}

struct HideAny;

impl Visit for HideAny {
    type Output = bool;
    fn visit<P: Part>(self, store: &Store<P>) -> bool {
        store.sides().hide_any()
    }
}

struct ColumnBytes;

impl Visit for ColumnBytes {
    type Output = usize;
    fn visit<P: Part>(self, store: &Store<P>) -> usize {
        store.column_bytes()
    }
}
