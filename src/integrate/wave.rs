//! Rays of one kind and depth that are traced together.

use glam::DVec3;

use super::record::RayKind;
use crate::accel::{PACKETS, Tile};
use crate::lanes::{ExactPacket, Float8, LANES, Mask8, Ray, RayPacket, Vec3x8, float8};

/// Rays of a wave.
pub const WAVE: usize = PACKETS * LANES;

/// Up to 64 rays, what each of them stands for, and what of it reaches the pixel.
#[derive(Debug)]
pub struct Wave {
    /// The rays and what they met.
    pub tile: Tile,
    /// Why they are traced.
    pub kind: RayKind,
    /// The camera ray is 1.
    pub depth: u32,
    /// Whose rays they are.
    pub(super) whose: Whose,
    /// Share of each ray's radiance, but for camera rays, of which all counts.
    weight: [Vec3x8; PACKETS],
    /// With which each ray was drawn, per steradian, where they are scattered.
    pub(super) density: [Float8; PACKETS],
    /// The rays before they were rounded, where rays go on from what they meet.
    pub exact: [ExactPacket; PACKETS],
}

/// The samples that rays belong to, and how they came about.
#[derive(Debug, Clone, Copy)]
pub(super) struct Whose {
    /// The sample of the first ray, where ray k belongs to sample `first + k`: camera rays.
    pub first: Option<usize>,
    /// The sample of each of the others.
    slots: [[u32; LANES]; PACKETS],
    /// How each of them came about.
    paths: [[u32; LANES]; PACKETS],
}

/// A ray to be traced later.
#[derive(Debug, Clone, Copy)]
pub(super) struct Branch {
    /// Off the surface, for f32.
    pub origin: [f32; 3],
    /// On the surface, and where to from there.
    pub exact: (DVec3, DVec3),
    pub weight: [f32; 3],
    /// With which a scattered ray was drawn, per steradian.
    pub density: f32,
    pub slot: u32,
    pub path: u32,
}

impl Branch {
    /// Up to 64 of them, as rays.
    pub fn set_tile(branches: &[Branch], tile: &mut Tile) {
        tile.renew(None);
        tile.packets[branches.len().div_ceil(LANES)..].fill(RayPacket::dead());
        for (packet, branches) in tile.packets.iter_mut().zip(branches.chunks(LANES)) {
            let lane = |i: usize| &branches[i.min(branches.len() - 1)];
            let live = Mask8::from_bits((1 << branches.len()) - 1);
            let origin = Vec3x8::from_fn(|i| lane(i).origin);
            let dir = Vec3x8::from_fn(|i| lane(i).exact.1.as_vec3().to_array());
            *packet = RayPacket::new(origin, dir, float8(f32::INFINITY), live);
        }
    }
}

impl Wave {
    /// Dead rays.
    pub fn empty() -> Self {
        Wave {
            tile: Tile::empty(),
            kind: RayKind::Camera,
            depth: 1,
            whose: Whose { first: Some(0), slots: [[0; LANES]; PACKETS], paths: [[0; LANES]; PACKETS] },
            weight: [Vec3x8::ZERO; PACKETS],
            density: [Float8::ZERO; PACKETS],
            exact: [ExactPacket::default(); PACKETS],
        }
    }

    /// Takes it for camera rays, whose packets are still to be set.
    pub fn begin(&mut self, first: usize, common: Option<[f32; 3]>) {
        (self.kind, self.depth, self.whose.first) = (RayKind::Camera, 1, Some(first));
        self.tile.renew(common);
    }

    /// Takes it for up to 64 later rays, which have been traced.
    pub(super) fn fill(&mut self, tile: &mut Tile, branches: &[Branch], kind: RayKind, depth: u32) {
        (self.kind, self.depth, self.whose.first) = (kind, depth, None);
        std::mem::swap(&mut self.tile, tile);
        for (p, branches) in branches.chunks(LANES).enumerate() {
            let lane = |i: usize| &branches[i.min(branches.len() - 1)];
            self.weight[p] = Vec3x8::from_fn(|i| lane(i).weight);
            self.density[p] = Float8::from(std::array::from_fn::<f32, LANES, _>(|i| lane(i).density));
            for (i, branch) in branches.iter().enumerate() {
                (self.whose.slots[p][i], self.whose.paths[p][i]) = (branch.slot, branch.path);
                self.exact[p].set_lane(i, branch.exact.0, branch.exact.1);
            }
        }
    }

    /// How many rays there are.
    pub fn count(&self) -> u64 {
        self.tile.packets.iter().map(|rays| u64::from(rays.live().bits().count_ones())).sum()
    }

    /// What of the radiance along the rays of a packet reaches their pixels.
    #[inline(always)]
    pub(super) fn weighted(&self, p: usize, radiance: Vec3x8) -> Vec3x8 {
        if self.kind == RayKind::Camera { radiance } else { radiance.scale(self.weight[p]) }
    }

    /// The share of one ray.
    pub(super) fn weight(&self, p: usize, lane: usize) -> [f32; 3] {
        if self.kind == RayKind::Camera { [1.0; 3] } else { self.weight[p].lane(lane) }
    }

    /// The sample of a ray.
    #[inline(always)]
    pub(super) fn slot(&self, p: usize, lane: usize) -> usize {
        self.whose.slot(p, lane)
    }

    /// How a ray came about.
    #[inline(always)]
    pub(super) fn path(&self, p: usize, lane: usize) -> u32 {
        self.whose.path(p, lane)
    }

    /// The bits of a ray as they were traced.
    pub(super) fn ray(&self, p: usize, lane: usize, t_max: f32) -> Ray {
        let rays = &self.tile.packets[p];
        Ray { origin: rays.origin.lane(lane), t_min: 0.0, dir: rays.dir.lane(lane), t_max }
    }
}

impl Whose {
    /// The sample of a ray.
    #[inline(always)]
    pub fn slot(&self, p: usize, lane: usize) -> usize {
        self.first.map_or_else(|| self.slots[p][lane] as usize, |first| first + p * LANES + lane)
    }

    /// How a ray came about.
    #[inline(always)]
    pub fn path(&self, p: usize, lane: usize) -> u32 {
        if self.first.is_some() { 1 } else { self.paths[p][lane] }
    }
}
