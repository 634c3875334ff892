//! What is counted of rays, and who may look on.

use super::camera::Samples8;
use super::direct::Samples;
use crate::accel::{Counts, PACKETS};
use crate::lanes::{Float8, LANES, Ray, RayPacket, Vec3x8};
use crate::plan::Owner;
use crate::shade::Bsdf8;

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
    /// Scattered by a surface.
    Bounce,
}

impl RayKind {
    /// All kinds, by their number.
    pub const ALL: [RayKind; 5] =
        [RayKind::Camera, RayKind::Shadow, RayKind::Reflection, RayKind::Refraction, RayKind::Bounce];

    /// The word for it in statistics.
    pub fn name(self) -> &'static str {
        match self {
            RayKind::Camera => "camera",
            RayKind::Shadow => "shadow",
            RayKind::Reflection => "reflection",
            RayKind::Refraction => "refraction",
            RayKind::Bounce => "bounce",
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
    /// Packets that the rays were in.
    pub packets: [u64; RayKind::ALL.len()],
}

impl RayCounts {
    /// What was added to an earlier state.
    pub fn since(&self, before: &RayCounts) -> Self {
        let rest = |now: &[u64; RayKind::ALL.len()], before: &[u64; RayKind::ALL.len()]| {
            std::array::from_fn(|kind| now[kind] - before[kind])
        };
        RayCounts {
            rays: rest(&self.rays, &before.rays),
            hits: rest(&self.hits, &before.hits),
            redecided: rest(&self.redecided, &before.redecided),
            packets: rest(&self.packets, &before.packets),
        }
    }

    /// Sums up.
    pub fn add(&mut self, other: &RayCounts) {
        for kind in RayKind::ALL {
            self.rays[kind as usize] += other.rays[kind as usize];
            self.hits[kind as usize] += other.hits[kind as usize];
            self.redecided[kind as usize] += other.redecided[kind as usize];
            self.packets[kind as usize] += other.packets[kind as usize];
        }
    }
}

/// Looks on while rays are traced. A path is 1 for the camera ray, 2p for the ray reflected or scattered and
/// 2p + 1 for the one refracted where path p ended; a slot is the sample's place in its batch.
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
    /// A ray met a light itself, and ended there.
    fn seen(&mut self, light: usize, slot: usize, path: u32);
    /// A surface took its colour from a cell of a texture.
    fn texture(&mut self, texture: usize, cell: i64, slot: usize, path: u32);

    /// Whether what camera rays see is to be told, and what came of each tile.
    const SURFACES: bool = false;
    /// Whether samples may be left out that are known to meet nothing.
    fn passes_blanks(&self) -> bool {
        !Self::ON && !Self::SURFACES
    }
    /// Whether what each tile costs is to be told, for which shadow rays do not wait for those of others.
    fn counts_tiles(&self) -> bool {
        false
    }
    /// The camera rays of a tile are about to be traced.
    fn taken(&mut self, _: &Taken) {}
    /// Camera rays of one packet of that tile met surfaces.
    fn surface(&mut self, _: &Seen) {}
    /// Camera rays of one packet of that tile met lights themselves.
    fn lamps(&mut self, _: &Lit) {}
    /// All that goes on from some tiles is known.
    fn summed(&mut self, _: &Summed) {}
    /// What some samples took; a sample may be told of more than once.
    fn spent(&mut self, _: &Spent) {}
}

/// What the camera rays of a packet met. Lanes that are not in `hit` mean nothing.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a> {
    /// Its place in the tile.
    pub packet: usize,
    /// Lanes that met something.
    pub hit: u32,
    /// The rays, ending where they met it.
    pub rays: &'a RayPacket,
    /// What they met: bits of a [`RowRef`](crate::shapes::RowRef).
    pub rows: Float8,
    /// Whose that is.
    pub owners: &'a [Owner; LANES],
    /// Materials of the sides that are seen.
    pub materials: &'a [u32; LANES],
    /// Shading normals on the viewer's side, unit.
    pub normal: Vec3x8,
    /// The materials' numbers.
    pub bsdf: &'a Bsdf8,
}

/// The lights that camera rays of a packet met.
#[derive(Debug, Clone, Copy)]
pub struct Lit<'a> {
    /// Its place in the tile.
    pub packet: usize,
    /// The rays, ending where they met a light, if they did.
    pub rays: &'a RayPacket,
    /// Indices of the lights.
    pub lights: [Option<usize>; LANES],
}

/// The samples of a tile of camera rays.
#[derive(Debug, Clone, Copy)]
pub struct Taken<'a> {
    /// How many there are; they fill packet after packet.
    pub count: usize,
    /// The samples.
    pub samples: &'a [Samples8; PACKETS],
    /// The pixel of each in the block's row-by-row list, by packet.
    pub pixels: &'a [[u32; LANES]],
    /// Squares of their distances from the centres of their pixels, pixels.
    pub distances: &'a [[f64; LANES]; PACKETS],
    /// Packets that are one sample of each of 4 x 2 pixels, row by row, a bit each.
    pub squares: u32,
}

/// Samples of some tiles and what came of them.
#[derive(Debug, Clone, Copy)]
pub struct Summed<'a> {
    /// How many there are; they fill packet after packet.
    pub count: usize,
    /// The pixel of each in the block's row-by-row list, by packet.
    pub pixels: &'a [[u32; LANES]],
    /// Radiance and alpha.
    pub samples: &'a Samples,
}

/// Work for some samples.
#[derive(Debug, Clone, Copy)]
pub struct Spent<'a> {
    /// How many there are; they fill packet after packet.
    pub count: usize,
    /// The pixel of each in the block's row-by-row list, by packet.
    pub pixels: &'a [[u32; LANES]],
    /// Tests done for them.
    pub tests: Counts,
    /// Rays traced for them, and packets.
    pub rays: RayCounts,
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
    fn seen(&mut self, _: usize, _: usize, _: u32) {}
    fn texture(&mut self, _: usize, _: i64, _: usize, _: u32) {}
}
