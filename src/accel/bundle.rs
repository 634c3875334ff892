//! Bounds of the rays of a tile, packet by packet.

use super::node::{Beam, OUTWARD, least_direction, near_planes};
use super::tile::{PACKETS, Tile};
use crate::lanes::{Float8, Mask8, RayPacket, UNIT_ROUNDOFF, Vec3x8, bits, float8, greatest, least};

/// Bounds of origins, directions and ends of eight packets, a lane a packet.
#[derive(Debug)]
pub struct Bundle {
    origins: [Interval; 3],
    dirs: [Interval; 3],
    /// Open ends, the least of all packets.
    start: f32,
    /// Closed ends, the greatest by packet; below everything where no ray is live.
    pub far: Float8,
}

#[derive(Debug, Clone, Copy)]
struct Interval {
    low: Float8,
    high: Float8,
}

/// Rays go together where their directions spread no further than this share of the largest coordinate, and their
/// origins no further than this share of the scene.
pub const SPREAD: f32 = 0.05;

/// All packets of a tile, each of which is that narrow, look for the closest hits together up to this spread. Tiles of
/// pictures of 128 x 128 are wider than the above; they would all go ray by ray, which takes 20 % longer for 12 spheres.
const TOGETHER: f32 = 0.12;

impl Bundle {
    /// Bounds of the packets of `live`. Rays that ask for `ANY` hit are taken with directions of length 1, whatever they
    /// are, and seen from where they are closest together.
    pub fn new<const ANY: bool>(tile: &Tile, live: u32) -> Self {
        let packets = &tile.packets;
        let start = packets.iter().map(|rays| rays.t_min).reduce(Float8::fast_min).map_or(0.0, least);
        let full = packets.iter().map(|rays| rays.live()).reduce(|a, b| a & b).is_some_and(Mask8::all);
        // Dead lanes stand where a live one of theirs does.
        let filled: [RayPacket; PACKETS];
        let rays = if full {
            packets
        } else {
            filled = std::array::from_fn(|p| packets[p].filled());
            &filled
        };
        let measured = |p: usize| Mask8::le(rays[p].inv_dd, rays[p].inv_dd).all();
        if ANY && start >= 0.0 && bits(live).all(measured) {
            return Bundle::of_ways(rays, tile.common, live);
        }
        let far = by_packet(|p| packets[p].t_max, Float8::fast_max);
        Bundle { origins: origins(rays, tile.common), dirs: intervals(|p| rays[p].dir), start, far }
    }

    /// Places on the rays are distances. Directions are widened by what their length rounds, and origins that are moved
    /// by what moving them does.
    fn of_ways(rays: &[RayPacket; PACKETS], common: Option<[f32; 3]>, live: u32) -> Self {
        let slack = float8(4.0 * UNIT_ROUNDOFF);
        let units: [Vec3x8; PACKETS] = std::array::from_fn(|p| rays[p].dir * rays[p].inv_dd.sqrt());
        let far = by_packet(|p| rays[p].t_max * rays[p].dir.length(), Float8::fast_max);
        let far = Mask8::gt(far, Float8::ZERO).select(far.mul_add(slack, far), far);
        let dirs = intervals(|p| units[p]);
        let dirs = axes(|k| dirs[k].widened(dirs[k].size() * slack));
        let bundle = Bundle { origins: origins(rays, common), dirs, start: 0.0, far };
        if common.is_some() {
            return bundle;
        }
        let is_finite = greatest(Mask8::from_bits(live).select(far, Float8::ZERO)) < f32::INFINITY;
        let other = if is_finite { bundle.backwards(rays) } else { bundle.across(rays, &units, live) };
        let width = |of: &Bundle| widest(&merged(&of.origins, live)).as_array()[0];
        if width(&other) < width(&bundle) { other } else { bundle }
    }

    /// The same rays from their ends back: shadow rays of a light.
    fn backwards(&self, rays: &[RayPacket; PACKETS]) -> Self {
        let ends = intervals(|p| rays[p].dir.mul_add(rays[p].t_max, rays[p].origin));
        let moved = axes(|k| self.far.mul_add(self.dirs[k].size(), self.origins[k].size()));
        let back = axes(|k| Interval { low: -self.dirs[k].high, high: -self.dirs[k].low });
        Bundle { origins: widened(&ends, &moved), dirs: back, ..*self }
    }

    /// The same rays from a plane across them on, behind all their origins: those of a distant light.
    fn across(&self, rays: &[RayPacket; PACKETS], units: &[Vec3x8; PACKETS], live: u32) -> Self {
        let along: [Float8; PACKETS] = std::array::from_fn(|p| rays[p].origin.dot(units[p]));
        let least_along = by_packet(|p| along[p], Float8::fast_min);
        let plane = float8(least(Mask8::from_bits(live).select(least_along, float8(f32::INFINITY))));
        let moved = intervals(|p| units[p].mul_add(plane - along[p], rays[p].origin));
        let size = self.origins[0].size() + self.origins[1].size() + self.origins[2].size() + plane.abs();
        Bundle { origins: widened(&moved, &[size; 3]), ..*self }
    }

    /// The rays of one packet, a lane a ray.
    pub fn of_rays(rays: &RayPacket) -> Self {
        let point = |v: &Vec3x8| [v.x, v.y, v.z].map(|x| Interval { low: x, high: x });
        Bundle { origins: point(&rays.origin), dirs: point(&rays.dir), start: least(rays.t_min), far: rays.t_max }
    }
}

impl Bundle {
    /// Bounds of the packets of `live` together, in all lanes.
    pub fn merged(&self, live: u32) -> Self {
        Bundle { origins: merged(&self.origins, live), dirs: merged(&self.dirs, live), ..*self }
    }

    /// Lanes whose rays go together in a scene of this size, a bit each.
    pub fn narrow(&self, scene: f32) -> u32 {
        self.within(SPREAD, scene)
    }

    /// Whether packets go together whose bounds, in all lanes, these are; `narrow`: each of them does so by itself.
    pub fn together<const ANY: bool>(&self, scene: f32, narrow: bool) -> bool {
        self.within(if narrow && !ANY { TOGETHER } else { SPREAD }, scene) != 0
    }

    /// Lanes whose directions spread no further than so, a bit each. Behind the origins the nearest and the farthest ray
    /// would change places: such rays go one by one.
    fn within(&self, spread: f32, scene: f32) -> u32 {
        if self.start < 0.0 {
            return 0;
        }
        let [x, y, z] = axes(|k| self.dirs[k].size());
        let reach = x.fast_max(y).fast_max(z);
        let narrow = Mask8::le(widest(&self.dirs), reach * float8(spread));
        (narrow & Mask8::le(widest(&self.origins), float8(SPREAD * scene))).bits()
    }

    /// Widths of origins and of directions, the greatest of the axes.
    pub fn widths(&self) -> [Float8; 2] {
        [widest(&self.origins), widest(&self.dirs)]
    }

    /// Bounds of the packets of `live`, a lane a packet; the other lanes mean nothing.
    pub fn beam(&self, live: u32) -> Beam {
        let (mut back, mut split) = ([false; 3], [false; 3]);
        // Origins of camera rays may have been rounded.
        let origins = widened(&self.origins, &axes(|k| self.origins[k].size()));
        let mut beam = Beam {
            origin_near: axes(|k| origins[k].high),
            origin_far: axes(|k| origins[k].low),
            inv_near: [Float8::ZERO; 3],
            inv_far: [Float8::ZERO; 3],
            near: near_planes(back),
            split,
            start: float8(self.start),
        };
        let live = Mask8::from_bits(live);
        let [x, y, z] = axes(|k| self.dirs[k].size());
        let least = least_direction(x.fast_max(y).fast_max(z));
        for k in 0..3 {
            let Interval { low, high } = self.dirs[k];
            let (down, up) = (live & Mask8::lt(low, Float8::ZERO), live & Mask8::gt(high, Float8::ZERO));
            (split[k], back[k]) = (down.any() && up.any(), down.any() && !up.any());
            let (one, outward) = (float8(1.0), float8(OUTWARD));
            (beam.inv_near[k], beam.inv_far[k]) = match (back[k], split[k]) {
                (false, false) => (one / high.fast_max(least), outward / low.fast_max(least)),
                (false, true) => (one / high.fast_max(least), one / low.fast_min(-least)),
                (true, _) => (one / low.fast_min(-least), outward / high.fast_min(-least)),
            };
            if back[k] {
                std::mem::swap(&mut beam.origin_near[k], &mut beam.origin_far[k]);
            }
        }
        Beam { near: near_planes(back), split, ..beam }
    }
}

impl Interval {
    fn widened(&self, by: Float8) -> Self {
        Interval { low: self.low - by, high: self.high + by }
    }

    fn size(&self) -> Float8 {
        self.low.abs().fast_max(self.high.abs())
    }

    /// Bounds of all lanes of `live`, in all lanes.
    fn merged(&self, live: Mask8) -> Self {
        let low = least(live.select(self.low, float8(f32::INFINITY)));
        let high = greatest(live.select(self.high, float8(f32::NEG_INFINITY)));
        Interval { low: float8(low), high: float8(high) }
    }
}

/// `f` of each axis, in line: `map` of an array of lanes is a call.
#[inline(always)]
fn axes<T>(f: impl FnMut(usize) -> T) -> [T; 3] {
    std::array::from_fn(f)
}

fn origins(rays: &[RayPacket; PACKETS], common: Option<[f32; 3]>) -> [Interval; 3] {
    match common {
        Some(origin) => axes(|k| Interval { low: float8(origin[k]), high: float8(origin[k]) }),
        None => intervals(|p| rays[p].origin),
    }
}

/// By what rounding moves points that are made of coordinates of this size.
fn widened(all: &[Interval; 3], sizes: &[Float8; 3]) -> [Interval; 3] {
    axes(|k| all[k].widened(sizes[k] * float8(4.0 * UNIT_ROUNDOFF)))
}

fn merged(all: &[Interval; 3], live: u32) -> [Interval; 3] {
    let live = Mask8::from_bits(live);
    axes(|k| all[k].merged(live))
}

/// The greatest width of an axis.
fn widest(all: &[Interval; 3]) -> Float8 {
    let [x, y, z] = axes(|k| all[k].high - all[k].low);
    x.fast_max(y).fast_max(z)
}

fn intervals(of: impl Fn(usize) -> Vec3x8) -> [Interval; 3] {
    let axis = |pick: fn(&Vec3x8) -> Float8| {
        let rows = Float8::transpose(std::array::from_fn(|p| pick(&of(p))));
        let fold = |f: fn(Float8, Float8) -> Float8| rows.into_iter().reduce(f).expect("eight rows");
        Interval { low: fold(Float8::fast_min), high: fold(Float8::fast_max) }
    };
    [axis(|v| v.x), axis(|v| v.y), axis(|v| v.z)]
}

/// The lanes of each packet folded into one, a lane a packet.
pub fn by_packet(of: impl Fn(usize) -> Float8, fold: fn(Float8, Float8) -> Float8) -> Float8 {
    Float8::transpose(std::array::from_fn(of)).into_iter().reduce(fold).expect("eight rows")
}
