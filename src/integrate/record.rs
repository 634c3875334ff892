//! What is counted of rays, and who may look on.

use crate::lanes::Ray;

/// Why a ray was traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RayKind {
    /// From the eye.
    Camera,
    /// Between a surface and a light.
    Shadow,
    /// Mirrored.
    Reflection,
    /// Through a surface.
    Refraction,
}

impl RayKind {
    /// All kinds, by their number.
    pub const ALL: [RayKind; 4] = [RayKind::Camera, RayKind::Shadow, RayKind::Reflection, RayKind::Refraction];

    /// The word for it in statistics.
    pub fn name(self) -> &'static str {
        match self {
            RayKind::Camera => "camera",
            RayKind::Shadow => "shadow",
            RayKind::Reflection => "reflection",
            RayKind::Refraction => "refraction",
        }
    }
}

/// Rays traced and rays that met something, by [`RayKind`].
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct RayCounts {
    /// Rays traced.
    pub rays: [u64; RayKind::ALL.len()],
    /// Those that met something.
    pub hits: [u64; RayKind::ALL.len()],
    /// (Ray, primitive) pairs decided again in f64.
    pub redecided: [u64; RayKind::ALL.len()],
}

impl RayCounts {
    /// Sums up.
    pub fn add(&mut self, other: &RayCounts) {
        for kind in RayKind::ALL {
            self.rays[kind as usize] += other.rays[kind as usize];
            self.hits[kind as usize] += other.hits[kind as usize];
            self.redecided[kind as usize] += other.redecided[kind as usize];
        }
    }
}

/// Looks on while rays are traced. A path is 1 for the camera ray, 2p for the ray reflected and 2p + 1 for
/// the one refracted where path p ended; a slot is the sample's place in its batch.
pub trait Record {
    /// Whether anything is to be told: what only the record needs is left out otherwise.
    const ON: bool;
    /// A tile of camera rays begins: pixel and sample index of the slots from `first` on; 0 begins a batch.
    fn tile(&mut self, first: usize, samples: &mut dyn Iterator<Item = (i32, i32, u32)>);
    /// A ray met a primitive, or nothing; `ray` holds the very bits that were traced, `t` where it was met.
    fn ray(&mut self, kind: RayKind, ray: Ray, met: Option<u32>, t: f32, slot: usize, path: u32);
    /// A surface at the end of a path was lit by a light, or lay in shadow.
    fn shadow(&mut self, light: usize, ray: Ray, dark: bool, slot: usize, path: u32);
    /// A light that casts no shadows shone on a surface.
    fn lit(&mut self, light: usize, slot: usize, path: u32);
    /// A surface took its colour from a cell of a texture.
    fn texture(&mut self, texture: usize, cell: i64, slot: usize, path: u32);
}

/// Nobody looks on.
#[derive(Debug, Default, Clone, Copy)]
pub struct Silent;

impl Record for Silent {
    const ON: bool = false;
    fn tile(&mut self, _: usize, _: &mut dyn Iterator<Item = (i32, i32, u32)>) {}
    fn ray(&mut self, _: RayKind, _: Ray, _: Option<u32>, _: f32, _: usize, _: u32) {}
    fn shadow(&mut self, _: usize, _: Ray, _: bool, _: usize, _: u32) {}
    fn lit(&mut self, _: usize, _: usize, _: u32) {}
    fn texture(&mut self, _: usize, _: i64, _: usize, _: u32) {}
}
