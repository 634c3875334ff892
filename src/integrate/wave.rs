//! Rays of one kind and depth that are traced together.

use glam::DVec3;

use super::camera::ExactPacket;
use super::record::RayKind;
use crate::accel::{PACKETS, Tile};
use crate::lanes::{LANES, Mask8, Ray, RayPacket, Vec3x8, float8};

/// Up to 64 rays, what each of them stands for, and what of it reaches the pixel.
pub struct Wave {
    /// The rays and what they met.
    pub tile: Box<Tile>,
    /// Why they are traced.
    pub kind: RayKind,
    /// The camera ray is 1.
    pub depth: u32,
    /// Share of each ray's radiance.
    pub weight: [Vec3x8; PACKETS],
    /// The sample of each ray by its place in the camera's tile; `None`: its own place.
    pub slots: Option<[[u8; LANES]; PACKETS]>,
    /// How each ray came about.
    pub paths: [[u32; LANES]; PACKETS],
    /// The rays before they were rounded, where rays go on from what they meet.
    pub exact: Option<Box<ExactRays>>,
}

/// 64 rays in f64.
pub type ExactRays = [ExactPacket; PACKETS];

/// A ray to be traced later.
#[derive(Debug, Clone, Copy)]
pub(super) struct Branch {
    /// Off the surface, for f32.
    pub origin: [f32; 3],
    /// On the surface, and where to from there.
    pub exact: (DVec3, DVec3),
    pub weight: [f32; 3],
    pub slot: u8,
    pub path: u32,
}

impl Wave {
    /// Room for camera rays.
    pub fn camera(tile: Box<Tile>, keep_exact: bool) -> Self {
        let weight = [Vec3x8::splat([1.0; 3]); PACKETS];
        let exact = keep_exact.then(|| Box::new([ExactPacket::default(); PACKETS]));
        Wave { tile, kind: RayKind::Camera, depth: 1, weight, slots: None, paths: [[1; LANES]; PACKETS], exact }
    }

    /// Up to 64 later rays.
    pub(super) fn of_branches(mut tile: Box<Tile>, branches: &[Branch], kind: RayKind, depth: u32) -> Self {
        let lane = |p: usize, i: usize| branches.get(p * LANES + i);
        let ray = |p: usize, f: fn(&Branch) -> [f32; 3], fill| Vec3x8::from_fn(|i| lane(p, i).map_or(fill, f));
        let number = |f: fn(&Branch) -> u32| -> [[u32; LANES]; PACKETS] {
            std::array::from_fn(|p| std::array::from_fn(|i| lane(p, i).map_or(0, f)))
        };
        for (p, packet) in tile.packets.iter_mut().enumerate() {
            let live = Mask8::from_bits((0..LANES).filter(|i| lane(p, *i).is_some()).map(|i| 1 << i).sum());
            let (origin, dir) = (ray(p, |b| b.origin, [0.0; 3]), ray(p, |b| b.exact.1.as_vec3().to_array(), [1.0; 3]));
            *packet = RayPacket::new(origin, dir, float8(f32::INFINITY), live);
        }
        let mut exact = Box::new([ExactPacket::default(); PACKETS]);
        for (k, branch) in branches.iter().enumerate() {
            exact[k / LANES].set_lane(k % LANES, branch.exact.0, branch.exact.1);
        }
        Wave {
            tile,
            kind,
            depth,
            weight: std::array::from_fn(|p| ray(p, |b| b.weight, [0.0; 3])),
            slots: Some(number(|b| u32::from(b.slot)).map(|slots| slots.map(|slot| slot as u8))),
            paths: number(|b| b.path),
            exact: Some(exact),
        }
    }

    /// The sample of a ray.
    #[inline(always)]
    pub(super) fn slot(&self, packet: usize, lane: usize) -> usize {
        self.slots.as_ref().map_or(packet * LANES + lane, |slots| usize::from(slots[packet][lane]))
    }

    /// The bits of a ray as they were traced.
    pub(super) fn ray(&self, packet: usize, lane: usize, t_max: f32) -> Ray {
        let rays = &self.tile.packets[packet];
        Ray { origin: rays.origin.lane(lane), t_min: 0.0, dir: rays.dir.lane(lane), t_max }
    }
}

/// Lanes of a mask, from the lowest.
pub(super) fn lanes(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (mask != 0).then(|| mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        lane
    })
}
