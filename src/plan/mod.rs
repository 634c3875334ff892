//! What a render needs of a scene, decided once: the parts that kernels know, relative to an origin,
//! and what can be left out.

mod needs;
mod origin;
mod parts;
mod reach;
mod skips;
mod split;
mod valid;

use glam::DVec3;

pub use self::origin::SPECK;
pub use self::reach::{LEAST_COSINE, Sight};
pub use self::skips::{LeftOut, Skip, SkipSet, Skipped, Skips};
pub use self::valid::{InvalidScene, validate};

use self::needs::Needs;
pub use self::parts::{
    BoxPart, ConePart, CylinderPart, DiskPart, Kind, Owner, Parts, PlanePart, PolygonPart, SpherePart, TurnedBoxPart,
};
use crate::scene::{Aov, Camera, Integrator, Layers, Lens, Material, Object, Scene, Shape, Visible};

/// Decisions about one scene seen from one origin.
#[derive(Debug)]
pub struct Plan<'s> {
    /// The scene.
    pub scene: &'s Scene,
    /// What all f32 coordinates are relative to, subtracted in f64 before they are rounded: a scene that
    /// is moved far away renders the same.
    pub origin: DVec3,
    /// Camera rays meet surfaces in f64, since f32 would show.
    pub sharp: bool,
    /// Some spheres are so small for their distance that f32 would show in how camera rays see them shaded: those are met
    /// in f64.
    pub specks: bool,
    /// The most that the coordinates of origins are which were rounded to f32, relative to `origin`.
    pub rounded_origins: DVec3,
    /// By material: the sides that are seen.
    pub visible: Vec<Visible>,
    /// By material: the materials of its back and of its front.
    sides: Vec<[u32; 2]>,
    /// Some cloud has colours.
    pub colored: bool,
    /// Some polygon has normals.
    pub smooth: bool,
    /// Some material in use has a texture.
    pub textured: bool,
    /// Some material in use has a highlight.
    pub shines: bool,
    /// Rays go on from some material in use.
    pub scatters: bool,
    /// By material: whether rays go on from either side of it. Such hits are found again in f64, since curved
    /// mirrors multiply rounding.
    pub goes_on: Vec<bool>,
    /// By light: whether it is to be asked at all.
    pub lights: Vec<bool>,
    /// By light: the primitives that nothing can put in its shadow, where there are any.
    pub unshadowed: Vec<Option<Vec<bool>>>,
    /// By primitive: whether it takes part; `None`: all do.
    needed: Option<Vec<bool>>,
    /// What is left out, and why.
    pub skips: Skips,
}

/// Most primitives for which a straight loop is faster than a tree.
const FEW: usize = 6;

impl<'s> Plan<'s> {
    /// Plans for rays that are given relative to `origin`; all that is not needed is left out.
    pub fn new(scene: &'s Scene, origin: DVec3) -> Self {
        Plan::leaving_out(SkipSet::ALL, scene, origin)
    }

    /// The same where only some kinds of work may be left out.
    pub fn leaving_out(allowed: SkipSet, scene: &'s Scene, origin: DVec3) -> Self {
        let visible = scene.materials.iter().map(|material: &Material| material.visible).collect();
        let side = |(front, material): (usize, &Material)| [material.back.unwrap_or(front) as u32, front as u32];
        let sides: Vec<[u32; 2]> = scene.materials.iter().enumerate().map(side).collect();
        let needs = Needs::of(scene);
        let mut skips = Skips::new(allowed);
        needs.decide(scene, &mut skips);
        let unshadowed = match skips.allows(Skip::Occlusion) {
            true => reach::unshadowed(scene, &needs.lights, origin, &mut skips),
            false => vec![None; scene.lights.len()],
        };
        decide_kinds(scene, &mut skips);
        let count = scene.primitive_count();
        let why = || format!("a straight loop over {count} primitives is faster");
        skips.decide(Skip::Tree, 0, (1..=FEW).contains(&count).then(why));
        let lights = needs.lights.iter().map(|needed| *needed || !skips.allows(Skip::Lights)).collect();
        let goes_on =
            |side: &[u32; 2]| side.iter().any(|material| scene.materials[*material as usize].model.scatters());
        let goes_on = sides.iter().map(goes_on).collect();
        let textured = needs.textures.contains(&true);
        let Needs { colored, smooth, shines, scatters, .. } = needs;
        let mut plan = Plan {
            scene,
            origin,
            sharp: false,
            specks: false,
            rounded_origins: DVec3::ZERO,
            visible,
            sides,
            colored,
            smooth,
            textured,
            shines,
            scatters,
            goes_on,
            lights,
            unshadowed,
            needed: None,
            skips,
        };
        plan.leave_out_layers(scene.layers);
        plan
    }

    /// Plans for the rays of a camera, in a picture of so many rows.
    pub fn seen_from(allowed: SkipSet, scene: &'s Scene, camera: &Camera, rows: u32) -> Self {
        let (origin, sharp) = origin::origin(scene, camera, rows);
        let specks = origin::has_specks(scene, camera.eye);
        Plan { sharp, specks, ..Plan::leaving_out(allowed, scene, origin) }
    }

    /// Leaves out the layers that are not among those asked for, in place of the scene's.
    pub fn leave_out_layers(&mut self, asked: Layers) {
        let unasked: Vec<&str> = Aov::ALL.into_iter().filter(|aov| !asked.has(*aov)).map(Aov::name).collect();
        let why = || format!("nobody asked for {}", unasked.join(", "));
        self.skips.decide(Skip::Layers, unasked.len() as u64, (!unasked.is_empty()).then(why));
    }

    /// Leaves out what only matters beside the pixels that are asked for.
    pub fn look(&mut self, sight: &Sight) {
        self.rounded_origins = origin::origins(sight, self.origin);
        let is_plane = |object: &Object| matches!(object.shape, Shape::Plane(_));
        let is_straight = match sight.camera.lens {
            Lens::Pinhole { .. } | Lens::Orthographic { .. } => true,
            Lens::ThinLens { .. } | Lens::Panoramic => false,
        };
        let bounded = is_straight && !self.scene.objects.iter().any(is_plane);
        let why = || "outside of what the boxes around all primitives cover there is nothing else".to_owned();
        self.skips.decide(Skip::Background, 0, bounded.then(why));
        if sight.settings.integrator == Integrator::Path {
            self.skips.decide(Skip::Bounces, 0, None);
        }
        if !self.scatters {
            self.needed = reach::needed(self.scene, &self.lights, sight, &mut self.skips);
        }
    }

    /// All parts of the scene, relative to the origin.
    pub fn parts(&self) -> Parts {
        let parts = Parts::new(self.scene, self.origin, self.needed.as_deref());
        Parts { rounded_origins: self.rounded_origins, ..parts }
    }

    /// The material of the side that a ray met.
    #[inline(always)]
    pub fn side_material(&self, material: u32, front: bool) -> u32 {
        self.sides[material as usize][usize::from(front)]
    }

    /// Whether both sides of a material are the same.
    #[inline(always)]
    pub fn is_same_on_both_sides(&self, material: u32) -> bool {
        let [back, front] = self.sides[material as usize];
        back == front
    }
}

/// Leaves out the kernels of what a scene does not hold.
fn decide_kinds(scene: &Scene, skips: &mut Skips) {
    let mut absent = Kind::ALL.to_vec();
    let mut mark = |shape: &Shape| absent.retain(|kind| !may_be_of(shape, *kind));
    scene.objects.iter().for_each(|object| mark(&object.shape));
    // All rows of a cloud are of one kind.
    scene.clouds.iter().filter(|cloud| !cloud.is_empty()).for_each(|cloud| mark(&cloud.primitive(0).shape));
    let names: Vec<&str> = absent.iter().map(|kind| kind.name()).collect();
    let why = || format!("the scene holds no {}", names.join(", no "));
    skips.decide(Skip::Kinds, names.len() as u64, (!names.is_empty()).then(why));
}

/// Whether some part of a shape may be of a kind.
fn may_be_of(shape: &Shape, kind: Kind) -> bool {
    match (shape, kind) {
        (Shape::Sphere(_), Kind::Sphere) | (Shape::Plane(_), Kind::Plane) | (Shape::Disk(_), Kind::Disk) => true,
        (Shape::Polygon(_), Kind::Triangle | Kind::Quad | Kind::Octagon) => true,
        (Shape::Box(cuboid), Kind::Box) => cuboid.rotation.is_none(),
        (Shape::Box(cuboid), Kind::TurnedBox) => cuboid.rotation.is_some(),
        (Shape::Cylinder(_), Kind::Cylinder) | (Shape::Cone(_), Kind::Cone) => true,
        (Shape::Cylinder(cylinder), Kind::Disk) => cylinder.caps,
        (Shape::Cone(cone), Kind::Disk) => cone.caps,
        _ => false,
    }
}
