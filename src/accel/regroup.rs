//! Rays of many tiles that ask for any hit, put into new tiles with those that are close to them.
//!
//! What neighbouring pixels see may lie far apart in depth, and so do the rays between there and a light: tiles of
//! them are wide, and overlap. Sorted along a Z curve the same rays fill tiles that are narrow.

use super::bundle::{SPREAD, by_packet};
use super::tile::{PACKETS, Tile};
use crate::lanes::{Float8, LANES, Mask8, RayPacket, Vec3x8, bits, float8, greatest, least};

/// Rays of a tile.
const TILE: usize = PACKETS * LANES;
/// Rays are sorted into a square of cells, so many along an edge.
const EDGE: usize = 128;
/// Packets that overlap so many times on average are taken apart.
const OVERLAP: f32 = 1.0;
/// The cell of dead rays.
const DEAD: usize = EDGE * EDGE;
/// A light that is so many lengths of the scene away counts as distant.
const FAR: f32 = 16.0;
/// The tiles that are looked at beforehand.
const SAMPLE: usize = 4;
/// Packets that are so many times as wide as a leaf are worth it.
const WIDE: f32 = 0.5;
/// Fewer tiles are not worth it.
const FEWEST: usize = 4;

/// Room for the rays of some tiles in another order.
#[derive(Debug, Default)]
pub struct Regroup {
    /// By ray its cell along a Z curve, [`DEAD`] where it is dead.
    cells: Vec<u16>,
    /// By cell the next place in the order.
    places: Vec<u16>,
    /// By place the number of the ray, live ones first.
    order: Vec<u16>,
    /// By ray its origin, end, direction and the row it begins or ends on.
    lines: Vec<Float8>,
    tiles: Vec<Tile>,
}

/// How points that stand for rays spread.
#[derive(Debug)]
struct Spread {
    /// The least of their coordinates, and how far they spread.
    low: [f32; 3],
    extent: [f32; 3],
    /// The two axes on which they spread most.
    axes: [usize; 2],
    /// The area of a packet on these axes on average.
    packet: f32,
    /// How often packets of that area would cover all of it.
    overlap: f32,
    tiles: f32,
}

impl Regroup {
    /// Most tiles at a time.
    pub const MOST: usize = 512;

    /// The rays in other tiles, where that is worth it in a scene of this size with leaves of this one; dead ones are left
    /// out.
    pub fn sort(&mut self, tiles: &[Tile], size: f32, grain: f32) -> Option<&mut [Tile]> {
        if tiles.len() < FEWEST || !tiles.iter().all(is_plain) {
            return None;
        }
        let common = tiles[0].common.filter(|_| tiles.iter().all(|tile| tile.common == tiles[0].common));
        let dirs = Spread::of(tiles, unit);
        let feet = if common.is_some() { None } else { Some(Spread::of(tiles, foot)) };
        match feet.filter(|feet| feet.widest() > FAR * size * dirs.widest()) {
            Some(feet) if feet.is_worth_it(1.0, SPREAD * size, grain) => self.find_cells(tiles, &feet, foot),
            None if dirs.is_worth_it(length(tiles), SPREAD, grain) => self.find_cells(tiles, &dirs, unit),
            _ => return None,
        }
        self.order_cells();
        self.fill(tiles, common);
        Some(&mut self.tiles)
    }

    /// Lets the rays die that did so in the other tiles.
    pub fn hand_back(&self, tiles: &mut [Tile]) {
        for (p, order) in self.order.chunks(LANES).enumerate() {
            let live = self.tiles[p / PACKETS].packets[p % PACKETS].live().bits();
            for i in bits(!live & ((1 << order.len()) - 1)) {
                let (tile, p, lane) = place(order[i]);
                tiles[tile].packets[p].t_min.as_mut_array()[lane] = f32::INFINITY;
            }
        }
    }

    /// Orders rays by their cells; those of one cell keep their order.
    fn order_cells(&mut self) {
        let Regroup { cells, places, order, .. } = self;
        places.clear();
        places.resize(DEAD + 1, 0);
        cells.iter().for_each(|cell| places[usize::from(*cell)] += 1);
        let mut next = 0;
        for place in &mut *places {
            (*place, next) = (next, next + *place);
        }
        let live = usize::from(places[DEAD]);
        order.resize(cells.len(), 0);
        for (ray, cell) in cells.iter().enumerate() {
            let place = &mut places[usize::from(*cell)];
            order[usize::from(*place)] = ray as u16;
            *place += 1;
        }
        order.truncate(live);
    }

    /// Puts the rays into tiles in their order.
    fn fill(&mut self, from: &[Tile], common: Option<[f32; 3]>) {
        let Regroup { order, lines, tiles, .. } = self;
        lines.clear();
        for tile in from {
            for (rays, own) in tile.packets.iter().zip(&tile.own) {
                let (RayPacket { origin, dir, t_max, .. }, own) = (rays, *own);
                let columns = [origin.x, origin.y, origin.z, *t_max, dir.x, dir.y, dir.z, own];
                lines.extend(Float8::transpose(columns));
            }
        }
        tiles.resize_with(order.len().div_ceil(TILE), Tile::empty);
        for (tile, order) in tiles.iter_mut().zip(order.chunks(TILE)) {
            tile.renew(common);
            tile.packets[order.len().div_ceil(LANES)..].fill(RayPacket::dead());
            for (p, order) in order.chunks(LANES).enumerate() {
                let line = |i: usize| lines[usize::from(order[i.min(order.len() - 1)])];
                let [ox, oy, oz, t_max, dx, dy, dz, own] = Float8::transpose(std::array::from_fn(line));
                let (origin, dir) = (Vec3x8::new(ox, oy, oz), Vec3x8::new(dx, dy, dz));
                let live = Mask8::from_bits((1 << order.len()) - 1);
                (tile.packets[p], tile.own[p]) = (RayPacket::new(origin, dir, t_max, live), own);
            }
        }
    }
}

impl Spread {
    /// Looks at every fourth tile.
    fn of(tiles: &[Tile], of: impl Fn(&RayPacket) -> Vec3x8) -> Self {
        let (first, last) = (Vec3x8::constant(f32::INFINITY), Vec3x8::constant(f32::NEG_INFINITY));
        let (mut all_low, mut all_high) = ([first.x; 3], [last.x; 3]);
        // By axis that is left out.
        let (mut areas, mut seen) = ([Float8::ZERO; 3], 0.0);
        for tile in tiles.iter().step_by(SAMPLE) {
            let points: [Vec3x8; PACKETS] = std::array::from_fn(|p| of(&tile.packets[p]));
            let bound = |beyond: Vec3x8| -> [Vec3x8; PACKETS] {
                std::array::from_fn(|p| Vec3x8::select(tile.packets[p].live(), points[p], beyond))
            };
            let (low, high) = (bound(first), bound(last));
            let (low, high) = (axes(&low, Float8::fast_min), axes(&high, Float8::fast_max));
            let extent: [Float8; 3] = std::array::from_fn(|k| (high[k] - low[k]).fast_max(Float8::ZERO));
            for k in 0..3 {
                areas[k] += extent[(k + 1) % 3] * extent[(k + 2) % 3];
                all_low[k] = all_low[k].fast_min(low[k]);
                all_high[k] = all_high[k].fast_max(high[k]);
            }
            seen += PACKETS as f32;
        }
        let low = all_low.map(least);
        let extent: [f32; 3] = std::array::from_fn(|k| greatest(all_high[k]) - low[k]);
        let thin = (0..3).min_by(|a, b| extent[*a].total_cmp(&extent[*b])).unwrap_or(0);
        let axes = [(thin + 1) % 3, (thin + 2) % 3];
        let packet = areas[thin].reduce_add() / seen;
        let packets = (tiles.len() * PACKETS) as f32;
        let overlap = packet * packets / (extent[axes[0]] * extent[axes[1]]);
        Spread { low, extent, axes, packet, overlap, tiles: tiles.len() as f32 }
    }

    fn widest(&self) -> f32 {
        self.extent[self.axes[0]].max(self.extent[self.axes[1]])
    }

    /// Whether packets are wide beside the leaves of the tree where they are `far`, and overlap, so that other ones would be
    /// much narrower; and tiles of those so `narrow` that they go down together.
    fn is_worth_it(&self, far: f32, narrow: f32, grain: f32) -> bool {
        let all = self.extent[self.axes[0]] * self.extent[self.axes[1]];
        self.overlap >= OVERLAP && self.packet.sqrt() * far >= WIDE * grain && all <= narrow * narrow * self.tiles
    }
}

impl Regroup {
    /// The cells of all rays along a Z curve.
    fn find_cells(&mut self, tiles: &[Tile], spread: &Spread, of: impl Fn(&RayPacket) -> Vec3x8) {
        let Spread { low, extent, axes, .. } = spread;
        let scale = axes.map(|k| (EDGE - 1) as f32 / extent[k]);
        let most = float8((EDGE - 1) as f32);
        self.cells.clear();
        for rays in tiles.iter().flat_map(|tile| &tile.packets) {
            let point = of(rays);
            let columns = [point.x, point.y, point.z];
            let at = |i: usize| {
                let at = (columns[axes[i]] - float8(low[axes[i]])) * float8(scale[i]);
                (at.fast_min(most).fast_max(Float8::ZERO) + float8(INTEGERS)).to_array()
            };
            let (a, b, live) = (at(0), at(1), rays.live().bits());
            let number = |x: f32| x.to_bits() as usize % EDGE;
            let mut eight = [DEAD as u16; LANES];
            for (i, cell) in eight.iter_mut().enumerate() {
                let z = EVERY_SECOND[number(a[i])] | EVERY_SECOND[number(b[i])] << 1;
                *cell = if live >> i & 1 == 1 { z } else { *cell };
            }
            self.cells.extend_from_slice(&eight);
        }
    }
}

/// Unit directions.
#[inline(always)]
fn unit(rays: &RayPacket) -> Vec3x8 {
    rays.dir * rays.inv_dd.sqrt()
}

/// Where the lines that the rays are on pass zero.
#[inline(always)]
fn foot(rays: &RayPacket) -> Vec3x8 {
    let unit = unit(rays);
    unit.mul_add(-rays.origin.dot(unit), rays.origin)
}

/// The length of the rays, roughly.
fn length(tiles: &[Tile]) -> f32 {
    let length = |rays: &RayPacket| greatest(rays.live().select(rays.dir.length() * rays.t_max, Float8::ZERO));
    tiles.iter().step_by(SAMPLE).map(|tile| length(&tile.packets[0])).fold(0.0, f32::max)
}

/// From here on floats are the integers, which their last bits count.
const INTEGERS: f32 = 8_388_608.0;

/// Coordinates of packets folded, a lane a packet.
fn axes(points: &[Vec3x8; PACKETS], fold: fn(Float8, Float8) -> Float8) -> [Float8; 3] {
    [by_packet(|p| points[p].x, fold), by_packet(|p| points[p].y, fold), by_packet(|p| points[p].z, fold)]
}

/// The bits of numbers on every second place.
const EVERY_SECOND: [u16; EDGE] = {
    let (mut table, mut i) = ([0; EDGE], 0);
    while i < EDGE {
        let mut bit = 0;
        while bit < 7 {
            table[i] |= ((i >> bit & 1) << (2 * bit)) as u16;
            bit += 1;
        }
        i += 1;
    }
    table
};

/// Tile, packet and lane of a ray, by its number.
#[inline(always)]
fn place(ray: u16) -> (usize, usize, usize) {
    let ray = usize::from(ray);
    (ray / TILE, ray / LANES % PACKETS, ray % LANES)
}

/// Whether the rays begin at their origins, and are what their bits are.
fn is_plain(tile: &Tile) -> bool {
    let begins = |rays: &RayPacket| (Mask8::same_bits(rays.t_min, Float8::ZERO) | !rays.live()).all();
    tile.exact.is_none() && tile.packets.iter().all(begins)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions on a square grid, in tiles of 8 x 8, or so that every tile spreads over all of it.
    fn tiles(scattered: bool) -> Vec<Tile> {
        let packet = |tile: usize, p: usize| {
            let at = |i: usize| match scattered {
                true => [p * 8 + tile / 8, i * 8 + tile % 8],
                false => [tile / 8 * 8 + p, tile % 8 * 8 + i],
            };
            let dir = Vec3x8::from_fn(|i| [at(i)[0] as f32, at(i)[1] as f32, 200.0]);
            RayPacket::new(Vec3x8::ZERO, dir, float8(1.0), Mask8::from_bits(0xff))
        };
        (0..64).map(|tile| Tile::new(std::array::from_fn(|p| packet(tile, p)), Some([0.0; 3]))).collect()
    }

    #[test]
    fn tiles_that_lie_side_by_side_stay_as_they_are() {
        assert!(Regroup::default().sort(&tiles(false), 1.0, 0.01).is_none());
    }

    /// Every which way: no order would make narrow tiles of them.
    #[test]
    fn tiles_of_rays_that_have_nothing_in_common_stay_as_they_are() {
        let mut from = tiles(true);
        for rays in from.iter_mut().flat_map(|tile| &mut tile.packets) {
            rays.dir.z *= float8(0.1);
            *rays = RayPacket::within(rays.origin, rays.dir, rays.t_min, rays.t_max);
        }
        assert!(Regroup::default().sort(&from, 1.0, 0.01).is_none());
    }

    /// However often they overlap.
    #[test]
    fn tiles_that_are_narrow_beside_the_leaves_stay_as_they_are() {
        assert!(Regroup::default().sort(&tiles(true), 1.0, 200.0).is_none());
    }

    #[test]
    fn tiles_that_overlap_are_parted() {
        let (mut regroup, mut from) = (Regroup::default(), tiles(true));
        from[3].packets[2].t_min = float8(f32::INFINITY);
        let sorted = regroup.sort(&from, 1.0, 0.01).expect("tiles that overlap");
        let live = |tiles: &[Tile]| -> Vec<[u32; 3]> {
            let rays = tiles.iter().flat_map(|tile| tile.packets);
            let dirs = rays.flat_map(|rays| rays.live().lanes().map(|i| rays.dir.lane(i)).collect::<Vec<_>>());
            dirs.map(|dir| dir.map(f32::to_bits)).collect()
        };
        let (mut before, mut after) = (live(&from), live(sorted));
        assert_eq!(after.len(), 64 * 64 - 8);
        before.sort_unstable();
        after.sort_unstable();
        assert_eq!(before, after);
        let overlap = Spread::of(sorted, unit).overlap;
        assert!(overlap * 4.0 < Spread::of(&from, unit).overlap, "{overlap}");
    }

    #[test]
    fn what_dies_in_new_tiles_dies_in_the_old_ones() {
        let (mut regroup, mut from) = (Regroup::default(), tiles(true));
        let sorted = regroup.sort(&from, 1.0, 0.01).expect("tiles that overlap");
        let dead = sorted[7].packets[5].dir.lane(3);
        sorted[7].packets[5].t_min.as_mut_array()[3] = f32::INFINITY;
        regroup.hand_back(&mut from);
        let packets = from.iter().flat_map(|tile| &tile.packets);
        let gone: Vec<_> =
            packets.flat_map(|rays| (!rays.live()).lanes().map(|i| rays.dir.lane(i)).collect::<Vec<_>>()).collect();
        assert_eq!(gone, [dead]);
    }
}
