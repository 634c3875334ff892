//! Rays of one kind and depth that are traced together.

use glam::DVec3;

use super::record::RayKind;
use crate::accel::{PACKETS, Tile};
use crate::lanes::{LANES, Mask8, Ray, RayPacket, Vec3x8, float8};

/// Up to 64 rays, what each of them stands for, and what of it reaches the pixel.
pub struct Wave {
    pub tile: Tile,
    pub kind: RayKind,
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

/// Origins and directions of 64 rays in f64.
pub type ExactRays = [[(DVec3, DVec3); LANES]; PACKETS];

/// A ray to be traced later.
#[derive(Debug, Clone, Copy)]
pub struct Branch {
    /// Off the surface, for f32.
    pub origin: [f32; 3],
    /// On the surface, and where to from there.
    pub exact: (DVec3, DVec3),
    pub weight: [f32; 3],
    pub slot: u8,
    pub path: u32,
}

impl Wave {
    /// Camera rays.
    pub fn camera(tile: Tile, exact: Option<Box<ExactRays>>) -> Self {
        let weight = [Vec3x8::splat([1.0; 3]); PACKETS];
        Wave { tile, kind: RayKind::Camera, depth: 1, weight, slots: None, paths: [[1; LANES]; PACKETS], exact }
    }

    /// Up to 64 later rays.
    pub fn of_branches(branches: &[Branch], kind: RayKind, depth: u32) -> Self {
        let lane = |p: usize, i: usize| branches.get(p * LANES + i);
        let ray = |p: usize, f: fn(&Branch) -> [f32; 3], fill| Vec3x8::from_fn(|i| lane(p, i).map_or(fill, f));
        let packet = |p: usize| {
            let live = Mask8::from_bits((0..LANES).filter(|i| lane(p, *i).is_some()).map(|i| 1 << i).sum());
            let (origin, dir) = (ray(p, |b| b.origin, [0.0; 3]), ray(p, |b| b.exact.1.as_vec3().to_array(), [1.0; 3]));
            RayPacket::new(origin, dir, float8(f32::INFINITY), live)
        };
        let number = |f: fn(&Branch) -> u32| -> [[u32; LANES]; PACKETS] {
            std::array::from_fn(|p| std::array::from_fn(|i| lane(p, i).map_or(0, f)))
        };
        let exact =
            std::array::from_fn(|p| std::array::from_fn(|i| lane(p, i).map_or((DVec3::ZERO, DVec3::ONE), |b| b.exact)));
        Wave {
            tile: Tile::new(std::array::from_fn(packet), None),
            kind,
            depth,
            weight: std::array::from_fn(|p| ray(p, |b| b.weight, [0.0; 3])),
            slots: Some(number(|b| u32::from(b.slot)).map(|slots| slots.map(|slot| slot as u8))),
            paths: number(|b| b.path),
            exact: Some(Box::new(exact)),
        }
    }

    /// The sample of a ray.
    #[inline(always)]
    pub fn slot(&self, packet: usize, lane: usize) -> usize {
        self.slots.as_ref().map_or(packet * LANES + lane, |slots| usize::from(slots[packet][lane]))
    }

    /// The bits of a ray as they were traced.
    pub fn ray(&self, packet: usize, lane: usize, t_max: f32) -> Ray {
        let rays = &self.tile.packets[packet];
        Ray { origin: rays.origin.lane(lane), t_min: 0.0, dir: rays.dir.lane(lane), t_max }
    }
}

/// Lanes of a mask, from the lowest.
pub fn lanes(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (mask != 0).then(|| mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        lane
    })
}
