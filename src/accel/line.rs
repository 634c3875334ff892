//! One ray with all that its way down the tree takes.

use super::leaf::Best;
use super::node::{OUTWARD, least_direction, reach};
use crate::lanes::{Float8, LANES, Mask8, RayPacket, Vec3x8, float8};
use crate::shapes::RowRef;

/// A ray in one cache line: what boxes need, then what primitives need besides.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub struct Line {
    /// Origin, open end, inverse direction, and how far boxes are looked for.
    way: Float8,
    /// Direction, `1 / (dir . dir)`, closed end, and of what was met row, place and the least that may be: see [`Best`].
    ray: Float8,
}

const ORIGIN: usize = 0;
const T_MIN: usize = 3;
const INVERSE: usize = 4;
const REACH: usize = 7;
const DIR: usize = 0;
const INV_DD: usize = 3;
const T_MAX: usize = 4;
const HIT: usize = 5;
const PLACE: usize = 6;
const LOW: usize = 7;

impl Line {
    /// The rays of a packet, and the octant of each; `best`: rows, places and lows of what they have met.
    #[inline(always)]
    pub fn of_packet(rays: &RayPacket, [hits, places, lows]: [Float8; 3]) -> ([Line; LANES], [u8; LANES]) {
        let (origin, dir) = ([rays.origin.x, rays.origin.y, rays.origin.z], [rays.dir.x, rays.dir.y, rays.dir.z]);
        let [x, y, z] = dir.map(|d| d.abs());
        let least = least_direction(x.fast_max(y).fast_max(z));
        let [x, y, z] = dir.map(|d| inverse(d, least));
        let way = [origin[0], origin[1], origin[2], rays.t_min, x, y, z, reach(rays.t_max)];
        let ray = [dir[0], dir[1], dir[2], rays.inv_dd, rays.t_max, hits, places, lows];
        let (way, ray) = (Float8::transpose(way), Float8::transpose(ray));
        let [x, y, z] = dir.map(|d| Mask8::sign(d).bits());
        let octant = |lane| (x >> lane & 1 | (y >> lane & 1) << 1 | (z >> lane & 1) << 2) as u8;
        (std::array::from_fn(|i| Line { way: way[i], ray: ray[i] }), std::array::from_fn(octant))
    }

    /// Where the ray may enter each of eight boxes at the earliest, and which it may meet; by axis the planes by which
    /// it enters and leaves.
    #[inline(always)]
    pub fn meets(&self, planes: &[(Float8, Float8); 3]) -> (Float8, Mask8) {
        let way = self.way.as_array();
        let at = |k: usize| {
            let (origin, inverse) = (float8(way[ORIGIN + k]), float8(way[INVERSE + k]));
            ((planes[k].0 - origin) * inverse, (planes[k].1 - origin) * inverse)
        };
        let (x, y, z) = (at(0), at(1), at(2));
        let entry = x.0.fast_max(y.0).fast_max(z.0.fast_max(float8(way[T_MIN])));
        let exit = x.1.fast_min(y.1).fast_min(z.1);
        // Outwards, on rays that begin behind their origin too.
        let exit = exit.abs().mul_add(float8(OUTWARD - 1.0), exit);
        (entry, Mask8::le(entry, exit.fast_min(float8(way[REACH]))))
    }

    /// The ray in all lanes.
    #[inline(always)]
    pub fn splat(&self) -> RayPacket {
        let (way, ray) = (self.way.as_array(), self.ray.as_array());
        RayPacket {
            origin: Vec3x8::splat([way[ORIGIN], way[ORIGIN + 1], way[ORIGIN + 2]]),
            dir: Vec3x8::splat([ray[DIR], ray[DIR + 1], ray[DIR + 2]]),
            t_min: float8(way[T_MIN]),
            t_max: float8(ray[T_MAX]),
            inv_dd: float8(ray[INV_DD]),
        }
    }

    /// How far boxes are looked for.
    #[inline(always)]
    pub fn reach(&self) -> f32 {
        self.way.as_array()[REACH]
    }

    /// The best hit.
    #[inline(always)]
    pub fn best(&self) -> Best {
        let ray = self.ray.as_array();
        Best { row: RowRef::from_lane(ray[HIT]), t: ray[PLACE], low: ray[LOW], high: ray[T_MAX] }
    }

    /// Sets the best hit.
    #[inline(always)]
    pub fn set(&mut self, best: &Best) {
        let ray = self.ray.as_mut_array();
        (ray[T_MAX], ray[HIT], ray[PLACE], ray[LOW]) = (best.high, best.row.to_lane(), best.t, best.low);
        self.way.as_mut_array()[REACH] = reach(float8(best.high)).as_array()[0];
    }

    /// Ends the ray, which met something.
    #[inline(always)]
    pub fn end(&mut self, row: RowRef) {
        self.way.as_mut_array()[T_MIN] = f32::INFINITY;
        let end = f32::NEG_INFINITY;
        self.set(&Best { row, t: end, low: end, high: end });
    }
}

/// `1 / d`, short of infinity.
#[inline(always)]
fn inverse(d: Float8, least: Float8) -> Float8 {
    let magnitude = float8(1.0) / d.abs().fast_max(least);
    Mask8::sign(d).select(-magnitude, magnitude)
}
