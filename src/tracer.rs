//! A scene ready to be asked what a ray meets.

use glam::DVec3;

use crate::accel::{PACKETS, Tile, Tree, Walk};
use crate::lanes::{Float8, LANES, Ray, RayPacket, UNIT_ROUNDOFF};
use crate::plan::{InvalidScene, Plan, validate};
use crate::scene::Scene;
use crate::shade::attributes;
use crate::shapes::RowRef;

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
    /// Place on the ray, in lengths of its direction.
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
        let tree = Tree::new(plan.parts(), &plan.visible);
        Ok(Tracer { plan, tree })
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
        let (t, row) = self.tree.closest(ray, &mut Walk::default());
        let rays = RayPacket::splat(ray);
        self.hits(&rays, [t; LANES], [row; LANES])[0]
    }

    /// What each ray meets first: the same bits as one by one, faster.
    pub fn closest_hits(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        let mut walk = Walk::default();
        let mut hits = Vec::with_capacity(rays.len());
        for chunk in rays.chunks(PACKETS * LANES) {
            let mut tile = tile(chunk);
            self.tree.closest_tile(&mut tile, &mut walk);
            for (packet, rows) in tile.packets.iter().zip(tile.hits) {
                let rows = rows.to_array().map(RowRef::from_lane);
                hits.extend(self.hits(packet, packet.t_max.to_array(), rows));
            }
            hits.truncate(hits.len() - (PACKETS * LANES - chunk.len()));
        }
        hits
    }

    /// Whether each ray meets anything, either side of it.
    pub fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        let mut walk = Walk::default();
        let mut dark = Vec::with_capacity(rays.len());
        for chunk in rays.chunks(PACKETS * LANES) {
            let mut tile = tile(chunk);
            let before = tile.packets.map(|rays| rays.live().bits());
            self.tree.occluded_tile(&mut tile, &mut walk);
            let after = tile.packets.map(|rays| rays.live().bits());
            let met = |i: usize| (before[i / LANES] & !after[i / LANES]) >> (i % LANES) & 1 == 1;
            dark.extend((0..chunk.len()).map(met));
        }
        dark
    }

    /// Whether one ray meets anything.
    pub fn is_occluded(&self, ray: &Ray) -> bool {
        self.tree.occluded(ray, &mut Walk::default())
    }

    fn hits(&self, rays: &RayPacket, t: [f32; LANES], rows: [RowRef; LANES]) -> [Option<Hit>; LANES] {
        let stores = self.tree.stores();
        let lanes = Float8::from(rows.map(RowRef::to_lane));
        let surface = stores.surface(lanes, rays, Float8::from(t));
        let (points, normals) = (surface.point.to_arrays(), surface.normal.to_arrays());
        let (dirs, errors) = (rays.dir.to_arrays(), surface.error.to_array());
        std::array::from_fn(|i| {
            let kind = rows[i].kind()?;
            let owner = stores.owner(kind, rows[i].row());
            let (point, normal) = (points[i], normals[i]);
            let front = normal[0] * dirs[i][0] + normal[1] * dirs[i][1] + normal[2] * dirs[i][2] < 0.0;
            let material = self.plan.side_material(owner.material, front);
            let uv = attributes::uv(&self.plan, stores, rows[i], owner, DVec3::from_array(point.map(f64::from)));
            let error = errors[i] + 2.0 * UNIT_ROUNDOFF * point.iter().map(|x| x.abs()).sum::<f32>();
            let uv = uv.as_vec2().to_array();
            Some(Hit { t: t[i], primitive: owner.primitive, material, normal, uv, front, point, error })
        })
    }
}

/// Up to 64 rays as a tile.
pub fn tile(rays: &[Ray]) -> Tile {
    let packets = std::array::from_fn(|p| RayPacket::gather(rays.get(p * LANES..).unwrap_or(&[])));
    let first = rays.first().map(|ray| ray.origin);
    let same = |origin: [f32; 3]| rays.iter().all(|ray| !ray.is_valid() || ray.origin == origin);
    Tile::new(packets, first.filter(|origin| same(*origin)))
}
