//! Bounds of the rays of a tile, packet by packet.

use super::node::{Beam, OUTWARD, least_direction, near_planes};
use super::tile::{PACKETS, Tile};
use crate::lanes::{Columns, Float8, Mask8, RayPacket, UNIT_ROUNDOFF, Vec3x8, float8, greatest, least};

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
const SPREAD: f32 = 0.05;

impl Bundle {
    /// Bounds of the packets of `live`. Rays that ask for `ANY` hit may be looked at from their ends, where those are
    /// closer together: shadow rays of a light.
    pub fn new<const ANY: bool>(tile: &Tile, live: u32) -> Self {
        let packets = &tile.packets;
        let start = packets.iter().map(|rays| rays.t_min).reduce(Float8::fast_min).map_or(0.0, least);
        let far = by_packet(|p| packets[p].t_max, Float8::fast_max);
        let full = packets.iter().map(|rays| rays.live()).reduce(|a, b| a & b).is_some_and(Mask8::all);
        if full && (!ANY || tile.common.is_some()) {
            let origins = match tile.common {
                Some(origin) => origin.map(|x| Interval { low: float8(x), high: float8(x) }),
                None => intervals(|p| packets[p].origin),
            };
            return Bundle { origins, dirs: intervals(|p| packets[p].dir), start, far };
        }
        // Dead lanes stand where a live one of theirs does.
        let lanes: [(Vec3x8, Vec3x8); PACKETS] = std::array::from_fn(|p| packets[p].filled());
        let (origins, dirs) = (intervals(|p| lanes[p].0), intervals(|p| lanes[p].1));
        let bundle = Bundle { origins, dirs, start, far };
        let finite = greatest(far) < f32::INFINITY && start >= 0.0;
        if ANY && tile.common.is_none() && finite { bundle.or_from_ends(live, &lanes) } else { bundle }
    }

    /// The rays of one packet, a lane a ray.
    pub fn of_rays(rays: &RayPacket) -> Self {
        let point = |v: &Vec3x8| [v.x, v.y, v.z].map(|x| Interval { low: x, high: x });
        Bundle { origins: point(&rays.origin), dirs: point(&rays.dir), start: least(rays.t_min), far: rays.t_max }
    }

    /// Where the ends are closer together than the origins, the same rays from there: `end - s (t_max dir)` for
    /// `0 <= s < 1`, widened by what rounding moves the ends.
    fn or_from_ends(self, live: u32, lanes: &[(Vec3x8, Vec3x8); PACKETS]) -> Self {
        let ways: [Vec3x8; PACKETS] = std::array::from_fn(|p| lanes[p].1 * self.far.broadcast(p));
        let ends = intervals(|p| lanes[p].0 + ways[p]);
        let width = |all| widest(&merged(all, live)).as_array()[0];
        if width(&ends) >= width(&self.origins) {
            return self;
        }
        let back = intervals(|p| -ways[p]);
        let slack = float8(4.0 * UNIT_ROUNDOFF);
        let dirs = std::array::from_fn(|k| back[k].widened(back[k].size() * slack));
        let origins = std::array::from_fn(|k| ends[k].widened((self.origins[k].size() + back[k].size()) * slack));
        Bundle { origins, dirs, start: 0.0, far: Mask8::gt(self.far, Float8::ZERO).select(Float8::ONE, self.far) }
    }
}

impl Bundle {
    /// Bounds of the packets of `live` together, in all lanes.
    pub fn merged(&self, live: u32) -> Self {
        Bundle { origins: merged(&self.origins, live), dirs: merged(&self.dirs, live), ..*self }
    }

    /// Lanes whose rays go together in a scene of this size, a bit each. Behind the origins the
    /// nearest and the farthest ray would change places: such rays go one by one.
    pub fn narrow(&self, scene: f32) -> u32 {
        if self.start < 0.0 {
            return 0;
        }
        let [x, y, z] = self.dirs.map(|axis| axis.size());
        let reach = x.fast_max(y).fast_max(z);
        let together = Mask8::le(widest(&self.dirs), reach * float8(SPREAD));
        (together & Mask8::le(widest(&self.origins), float8(SPREAD * scene))).bits()
    }

    /// Widths of origins and of directions, the greatest of the axes.
    pub fn widths(&self) -> [Float8; 2] {
        [widest(&self.origins), widest(&self.dirs)]
    }

    /// Bounds of the packets of `live`, a lane a packet; the other lanes mean nothing.
    pub fn beam(&self, live: u32) -> Beam {
        let (mut back, mut split) = ([false; 3], [false; 3]);
        // Origins of camera rays may have been rounded.
        let origins = self.origins.map(|axis| axis.widened(axis.size() * float8(4.0 * UNIT_ROUNDOFF)));
        let mut beam = Beam {
            origin_near: origins.map(|axis| axis.high),
            origin_far: origins.map(|axis| axis.low),
            inv_near: [Float8::ZERO; 3],
            inv_far: [Float8::ZERO; 3],
            near: near_planes(back),
            split,
            start: float8(self.start),
        };
        let live = Mask8::from_bits(live);
        let [x, y, z] = self.dirs.map(|axis| axis.size());
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

fn merged(all: &[Interval; 3], live: u32) -> [Interval; 3] {
    let live = Mask8::from_bits(live);
    [0, 1, 2].map(|k| all[k].merged(live))
}

/// The greatest width of an axis.
fn widest(all: &[Interval; 3]) -> Float8 {
    let [x, y, z] = [0, 1, 2].map(|k| all[k].high - all[k].low);
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
