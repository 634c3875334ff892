//! What a render needs of a scene, decided once: the parts that kernels know, relative to an origin,
//! and what can be left out.

mod parts;
mod split;
mod valid;

use glam::DVec3;

pub use self::valid::{InvalidScene, validate};

pub use self::parts::{
    BoxPart, ConePart, CylinderPart, DiskPart, Kind, Owner, Parts, PlanePart, PolygonPart, SpherePart, TurnedBoxPart,
};
use crate::scene::{CloudMaterial, Material, Object, Scene, Shape, Visible};

/// Decisions about one scene seen from one origin.
#[derive(Debug)]
pub struct Plan<'s> {
    /// The scene.
    pub scene: &'s Scene,
    /// What all f32 coordinates are relative to, subtracted in f64 before they are rounded: a scene that
    /// is moved far away renders the same.
    pub origin: DVec3,
    /// By material: the sides that are seen.
    pub visible: Vec<Visible>,
    /// By material: the materials of its back and of its front.
    sides: Vec<[u32; 2]>,
    /// Some cloud has colours.
    pub colored: bool,
    /// Some polygon has normals.
    pub smooth: bool,
    /// Rays go on from some material: hits are found again in f64, since curved mirrors multiply rounding.
    pub scatters: bool,
}

/// Materials that some primitive shows, their backs among them.
fn used_materials(scene: &Scene) -> Vec<usize> {
    let mut used = vec![false; scene.materials.len()];
    scene.objects.iter().for_each(|object| used[object.material] = true);
    for cloud in &scene.clouds {
        match &cloud.material {
            CloudMaterial::One(material) => used[*material] = true,
            CloudMaterial::Each(materials) => materials.iter().for_each(|material| used[*material as usize] = true),
        }
    }
    let backs: Vec<usize> = (0..used.len()).filter(|i| used[*i]).filter_map(|i| scene.materials[i].back).collect();
    backs.into_iter().for_each(|back| used[back] = true);
    (0..used.len()).filter(|i| used[*i]).collect()
}

impl<'s> Plan<'s> {
    /// Plans for rays that are given relative to `origin`.
    pub fn new(scene: &'s Scene, origin: DVec3) -> Self {
        let visible = scene.materials.iter().map(|material: &Material| material.visible).collect();
        let colored = scene.clouds.iter().any(|cloud| cloud.colors.is_some());
        let has_normals = |object: &Object| match &object.shape {
            Shape::Polygon(polygon) => !polygon.normals.is_empty(),
            _ => false,
        };
        let smooth = scene.objects.iter().any(has_normals);
        let scatters = used_materials(scene).iter().any(|index| scene.materials[*index].model.scatters());
        let side = |(front, material): (usize, &Material)| [material.back.unwrap_or(front) as u32, front as u32];
        let sides = scene.materials.iter().enumerate().map(side).collect();
        Plan { scene, origin, visible, sides, colored, smooth, scatters }
    }

    /// All parts of the scene, relative to the origin.
    pub fn parts(&self) -> Parts {
        Parts::new(self.scene, self.origin)
    }

    /// The material of the side that a ray met.
    #[inline(always)]
    pub fn side_material(&self, material: u32, front: bool) -> u32 {
        self.sides[material as usize][usize::from(front)]
    }
}
