//! A scene ready to be asked what a ray meets.

use std::borrow::Cow;

use glam::DVec3;

use crate::accel::{Counts, PACKETS, Tile, Tree, Walk};
use crate::lanes::{Float8, LANES, Ray, RayPacket, UNIT_ROUNDOFF, Vec3x8};
use crate::plan::{InvalidScene, Plan, validate};
use crate::scene::Scene;
use crate::shade::attributes;
use crate::shapes::{Ray64, RowRef, Surface64};

/// The columns and the tree of one scene.
///
/// ```
/// use octray::{Ray, Tracer, scene::{Material, Model, Object, Paint, Scene, Shape, Sphere, Visible}};
/// let mut scene = Scene::default();
/// let model = Model::Diffuse { albedo: Paint::Color([0.8; 3].into()) };
/// scene.materials.push(Material { name: "clay".into(), model, back: None, visible: Visible::Both });
/// let shape = Shape::Sphere(Sphere { center: [0.0, 0.0, -5.0].into(), radius: 1.0 });
/// scene.objects.push(Object { shape, material: 0, name: None, group: None });
///
/// let tracer = Tracer::new(&scene)?;
/// let hit = tracer.closest_hit(&Ray::new([0.0; 3], [0.0, 0.0, -1.0])).unwrap();
/// assert_eq!((hit.t, hit.primitive, hit.front), (4.0, 0, true));
/// # Ok::<(), octray::plan::InvalidScene>(())
/// ```
#[derive(Debug)]
pub struct Tracer<'s> {
    plan: Plan<'s>,
    tree: Tree,
}

/// Where a ray met something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Place on the ray, in lengths of its direction; within one ulp.
    pub t: f32,
    /// Index of the primitive: objects in file order, then the rows of the clouds.
    pub primitive: u32,
    /// Index of the material of the side that was met.
    pub material: u32,
    /// Geometric, outward, unit length.
    pub normal: [f32; 3],
    /// Texture coordinates.
    pub uv: [f32; 2],
    /// Whether the side that the normal points to was met.
    pub front: bool,
    /// The hit point, put on the surface.
    pub point: [f32; 3],
    /// Bound on its distance from the exact surface, scene units.
    pub error: f32,
}

impl Hit {
    /// With its place in other units.
    fn in_units(self, unit: f32) -> Self {
        Hit { t: self.t * unit, ..self }
    }

    /// The ray that leaves the surface in a direction, without meeting it again where it was.
    ///
    /// Source: after Pharr, Jakob and Humphreys, Physically Based Rendering, 4th edition, 2023, section
    /// 6.8: the origin is moved along the normal past the bound on its own error.
    pub fn spawn(&self, dir: [f32; 3]) -> Ray {
        let n = self.normal;
        let along = n[0] * dir[0] + n[1] * dir[1] + n[2] * dir[2];
        let step = self.error.copysign(along);
        let origin = std::array::from_fn(|k| {
            let moved = n[k].mul_add(step, self.point[k]);
            if n[k] * step > 0.0 { moved.next_up() } else { moved.next_down() }
        });
        Ray::new(origin, dir)
    }
}

impl<'s> Tracer<'s> {
    /// Plans, stores and builds; rays are in the coordinates of the scene.
    ///
    /// # Errors
    /// A scene that was made by hand and breaks a rule; one that was read does not.
    pub fn new(scene: &'s Scene) -> Result<Self, InvalidScene> {
        Tracer::relative_to(scene, DVec3::ZERO)
    }

    /// The same for rays whose origins are given relative to `origin`, which keeps f32 exact near a place
    /// that is far from the scene's own origin.
    ///
    /// # Errors
    /// As [`Tracer::new`].
    pub fn relative_to(scene: &'s Scene, origin: DVec3) -> Result<Self, InvalidScene> {
        validate(scene)?;
        let plan = Plan::new(scene, origin);
        let tree = Tree::planned(&plan);
        Ok(Tracer { plan, tree })
    }

    /// With `true`, rays go one by one: the same bits, more slowly.
    pub fn one_by_one(self, one_by_one: bool) -> Self {
        Tracer { tree: self.tree.one_by_one(one_by_one), ..self }
    }

    /// With `false`, f32 alone decides what rays meet, wrongly at times: for measuring what certainty costs.
    pub fn certify(self, certify: bool) -> Self {
        Tracer { tree: self.tree.certify(certify), ..self }
    }

    /// The plan behind it.
    pub fn plan(&self) -> &Plan<'s> {
        &self.plan
    }

    /// The tree behind it.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// What one ray meets first.
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let (ray, unit) = &tamed(ray);
        let (t, row) = self.tree.closest(ray, &mut Walk::default());
        let found = self.found(&RayPacket::splat(ray), Float8::splat(t), Float8::splat(row.to_lane()));
        self.eight_hits(&RayPacket::splat(ray), &found)[0].map(|hit| hit.in_units(*unit))
    }

    /// What each ray meets first: the same bits as one by one, faster.
    pub fn closest_hits(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        let batch = RayBatch::new(rays);
        let mut found = vec![Found::default(); batch.tiles()];
        self.find_closest(&batch, 0, &mut found, &mut Room::default());
        let mut hits = (0..batch.tiles()).flat_map(|i| self.hits(&batch, i, &found[i])).collect::<Vec<_>>();
        hits.truncate(rays.len());
        hits
    }

    /// Whether each ray meets anything, either side of it.
    pub fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        let batch = RayBatch::new(rays);
        let mut dark = vec![0; batch.tiles()];
        self.find_occluded(&batch, 0, &mut dark, &mut Room::default());
        (0..rays.len()).map(|i| dark[i / TILE] >> (i % TILE) & 1 == 1).collect()
    }

    /// What the rays of some tiles of a batch meet first, from tile `first` on, and the tests that took.
    pub fn find_closest(&self, batch: &RayBatch, first: usize, found: &mut [Found], room: &mut Room) -> Counts {
        room.tiles.resize(found.len(), Tile::empty());
        batch.unpack(first, &mut room.tiles);
        self.find(room, found)
    }

    /// The same for rays that are made where they are traced: `packet(k, p)` is packet `p` of tile `k`.
    pub fn find_made(
        &self,
        common: Option<[f32; 3]>,
        packet: impl Fn(usize, usize) -> RayPacket,
        found: &mut [Found],
        room: &mut Room,
    ) -> Counts {
        let packets = |k: usize| std::array::from_fn(|p| packet(k, p));
        room.tiles.clear();
        room.tiles.extend((0..found.len()).map(|k| Tile::new(packets(k), common)));
        self.find(room, found)
    }

    fn find(&self, Room { tiles, walk }: &mut Room, found: &mut [Found]) -> Counts {
        self.tree.closest_tiles(tiles, walk);
        for (tile, found) in tiles.iter().zip(found) {
            for (p, found) in found.packets.iter_mut().enumerate() {
                let rays = &tile.packets[p];
                *found = self.found(rays, rays.t_max, tile.hits[p]);
            }
        }
        std::mem::take(&mut walk.counts)
    }

    /// Which rays of some tiles of a batch meet anything, a bit each, from tile `first` on, and the tests that took.
    pub fn find_occluded(&self, batch: &RayBatch, first: usize, dark: &mut [u64], room: &mut Room) -> Counts {
        let Room { tiles, walk } = room;
        tiles.resize(dark.len(), Tile::empty());
        batch.unpack(first, tiles);
        let live = |tile: &Tile| (0..PACKETS).map(|p| u64::from(tile.packets[p].live().bits()) << (p * LANES)).sum();
        for (tile, dark) in tiles.iter().zip(&mut *dark) {
            *dark = live(tile);
        }
        self.tree.occluded_tiles(tiles, walk);
        for (tile, dark) in tiles.iter().zip(dark) {
            let after: u64 = live(tile);
            *dark &= !after;
        }
        std::mem::take(&mut walk.counts)
    }

    /// Whether one ray meets anything.
    pub fn is_occluded(&self, ray: &Ray) -> bool {
        self.tree.occluded(&tamed(ray).0, &mut Walk::default())
    }

    #[inline(always)]
    fn found(&self, rays: &RayPacket, t: Float8, rows: Float8) -> Found8 {
        let (surface, owners) = self.tree.stores().surface::<true>(rows, rays, t, None);
        Found8 { t, rows, normal: surface.normal, primitives: owners.map(|owner| owner.primitive) }
    }

    /// What the rays of one tile of a batch met, in full.
    pub fn hits(&self, batch: &RayBatch, i: usize, found: &Found) -> Vec<Option<Hit>> {
        let mut tile = Tile::empty();
        batch.unpack(i, std::slice::from_mut(&mut tile));
        let packets = tile.packets.iter().zip(&found.packets);
        let hits = packets.flat_map(|(rays, found)| self.eight_hits(rays, found));
        match batch.units.get(i) {
            None => hits.collect(),
            Some(units) => hits.zip(units).map(|(hit, unit)| hit.map(|hit| hit.in_units(*unit))).collect(),
        }
    }

    /// Place, point and normal again in f64, from which what is told of a hit is rounded.
    fn eight_hits(&self, rays: &RayPacket, found: &Found8) -> [Option<Hit>; LANES] {
        let stores = self.tree.stores();
        std::array::from_fn(|i| {
            let (row, t) = (RowRef::from_lane(found.rows.as_array()[i]), f64::from(found.t.as_array()[i]));
            let ray = Ray64::exact(&rays.lane(i));
            let place = stores.decide(row, &ray).unwrap_or(t);
            let Surface64 { point, normal, t } = stores.refine(row, &ray, place)?;
            let owner = stores.owner(row.kind()?, row.row());
            let front = normal.dot(ray.dir) < 0.0;
            let material = self.plan.side_material(owner.material, front);
            let uv = attributes::uv(&self.plan, stores, row, owner, point).as_vec2().to_array();
            let (point, normal) = (point.as_vec3().to_array(), normal.as_vec3().to_array());
            let error = 2.0 * UNIT_ROUNDOFF * point.iter().map(|x| x.abs()).sum::<f32>();
            Some(Hit { t: t as f32, primitive: found.primitives[i], material, normal, uv, front, point, error })
        })
    }
}

/// Room for some tiles of a batch and for their walk, to be used again: one a thread.
#[derive(Debug, Default)]
pub struct Room {
    tiles: Vec<Tile>,
    walk: Walk,
}

/// Rays of a tile.
pub const TILE: usize = PACKETS * LANES;

/// What 64 rays met, in columns.
#[derive(Debug, Clone, Copy, Default)]
pub struct Found {
    packets: [Found8; PACKETS],
}

impl Found {
    /// How many of the rays met something.
    pub fn hits(&self) -> usize {
        let met = |found: &Found8| {
            found.rows.to_array().iter().filter(|row| RowRef::from_lane(**row).kind().is_some()).count()
        };
        self.packets.iter().map(met).sum()
    }

    /// The unit normal, outward, where ray `i` of the tile met something, as f32 alone has it.
    pub fn normal(&self, i: usize) -> [f32; 3] {
        self.packets[i / LANES].normal.lane(i % LANES)
    }
}

/// What eight rays met: place, row, unit normal (outward) and whose it is.
#[derive(Debug, Clone, Copy)]
struct Found8 {
    t: Float8,
    rows: Float8,
    normal: Vec3x8,
    primitives: [u32; LANES],
}

impl Default for Found8 {
    fn default() -> Self {
        let rows = Float8::splat(RowRef::MISS.to_lane());
        Found8 { t: Float8::ZERO, rows, normal: Vec3x8::ZERO, primitives: [0; LANES] }
    }
}

/// Rays in columns, 64 a tile, ready to be traced again and again.
#[derive(Debug)]
pub struct RayBatch {
    tiles: Vec<Columns64>,
    /// By tile; none where the rays of each tile share their origin.
    origins: Vec<[Vec3x8; PACKETS]>,
    /// By tile and ray what places are to be multiplied with; none where that is 1 everywhere.
    units: Vec<[f32; TILE]>,
}

/// The rays of a tile but for their origins.
#[derive(Debug)]
struct Columns64 {
    dirs: [Vec3x8; PACKETS],
    t_min: [Float8; PACKETS],
    t_max: [Float8; PACKETS],
    common: Option<[f32; 3]>,
}

impl RayBatch {
    /// Turns rays into columns; those that cannot hit anything are dead.
    pub fn new(rays: &[Ray]) -> Self {
        let (mut tiles, mut origins) = (Vec::new(), Vec::new());
        let (rays, units) = all_tamed(rays);
        for Tile { packets, common, .. } in rays.chunks(TILE).map(tile) {
            let (dirs, t_min) = (packets.map(|rays| rays.dir), packets.map(|rays| rays.t_min));
            tiles.push(Columns64 { dirs, t_min, t_max: packets.map(|rays| rays.t_max), common });
            origins.push(packets.map(|rays| rays.origin));
        }
        if tiles.iter().all(|tile| tile.common.is_some()) {
            origins = Vec::new();
        }
        RayBatch { tiles, origins, units }
    }

    /// Tiles of 64 rays, the last of them perhaps of fewer.
    pub fn tiles(&self) -> usize {
        self.tiles.len()
    }

    /// Takes the rays of as many tiles, from tile `first` on.
    fn unpack(&self, first: usize, tiles: &mut [Tile]) {
        for (i, tile) in (first..).zip(tiles) {
            let Columns64 { dirs, t_min, t_max, common } = &self.tiles[i];
            tile.renew(*common);
            for p in 0..PACKETS {
                let origin = match common {
                    Some(origin) => Vec3x8::splat(*origin),
                    None => self.origins[i][p],
                };
                tile.packets[p] = RayPacket::within(origin, dirs[p], t_min[p], t_max[p]);
            }
        }
    }
}

/// Lengths of directions, by their largest coordinate, with which kernels are at ease.
const AT_EASE: std::ops::RangeInclusive<f32> = 1e-6..=1e6;

/// The same ray with a direction that is not extreme, and what places on it are to be multiplied with: a power of two, so
/// nothing is rounded by that.
fn tamed(ray: &Ray) -> (Ray, f32) {
    let largest = ray.dir.iter().fold(0.0f32, |most, d| most.max(d.abs()));
    if AT_EASE.contains(&largest) || !ray.is_valid() {
        return (*ray, 1.0);
    }
    let exponent = (f64::from(largest).log2().floor() as i32).clamp(-126, 126);
    let (unit, inverse) = (2f32.powi(-exponent), 2f32.powi(exponent));
    let tamed = Ray { dir: ray.dir.map(|d| d * unit), t_min: ray.t_min * inverse, t_max: ray.t_max * inverse, ..*ray };
    (tamed, unit)
}

/// All of them, and where any is another than it was their units, 64 a tile.
fn all_tamed(rays: &[Ray]) -> (Cow<'_, [Ray]>, Vec<[f32; TILE]>) {
    if rays.iter().all(|ray| tamed(ray).1 == 1.0) {
        return (Cow::Borrowed(rays), Vec::new());
    }
    let (tamed, units): (Vec<Ray>, Vec<f32>) = rays.iter().map(tamed).unzip();
    let tile = |units: &[f32]| std::array::from_fn(|i| units.get(i).copied().unwrap_or(1.0));
    (Cow::Owned(tamed), units.chunks(TILE).map(tile).collect())
}

/// Up to 64 rays as a tile.
pub fn tile(rays: &[Ray]) -> Tile {
    let packets = std::array::from_fn(|p| RayPacket::gather(rays.get(p * LANES..).unwrap_or(&[])));
    let first = rays.first().map(|ray| ray.origin);
    let same = |origin: [f32; 3]| rays.iter().all(|ray| !ray.is_valid() || ray.origin == origin);
    Tile::new(packets, first.filter(|origin| same(*origin)))
}
