//! 64 rays down the tree: a lane is a packet, in leaves a ray.

use super::bundle::Bundle;
use super::descend::{Company, Room};
use super::leaf::PacketLeaf;
use super::node::{Beam, Child, Content, Leaf, Node, reach};
use super::{Tree, Walk};
use crate::lanes::{Columns, Float8, Mask8, RayPacket, Vec3x8, bits, float8, greatest};
use crate::shapes::RowRef;

/// Packets of a tile.
pub const PACKETS: usize = 8;

/// 64 rays, best of all those of an 8 x 8 square of pixels, a packet being 4 x 2 of them.
#[derive(Debug, Clone)]
pub struct Tile {
    /// The rays. After a walk `t_max` is the place of the hit where there is one.
    pub packets: [RayPacket; PACKETS],
    /// What each lane met: bits of a [`RowRef`].
    pub hits: [Float8; PACKETS],
    /// The origin, where all rays share it to the bit.
    pub common: Option<[f32; 3]>,
}

/// A packet that is so much wider than a box goes on as rays.
const WIDE: f32 = 1.0;

/// So few rays of a packet go on alone.
const FEW_RAYS: u32 = 2;

/// The packets of a tile on their way.
struct Packets<'a, const ANY: bool, const CULL: bool> {
    beam: Beam,
    whole: Beam,
    /// Widths of origins and directions.
    widths: [Float8; 2],
    far: Float8,
    farthest: Float8,
    tile: &'a mut Tile,
    /// Bounds of the rays of each packet, a lane a ray, where they are known already.
    beams: &'a mut [Beam],
    known: u32,
}

/// The rays of one packet on their way.
struct Rays<'a, const ANY: bool, const CULL: bool> {
    beam: &'a Beam,
    whole: Beam,
    far: Float8,
    farthest: Float8,
    packet: usize,
    tile: &'a mut Tile,
}

impl Tile {
    /// Rays that have met nothing yet.
    pub fn new(packets: [RayPacket; PACKETS], common: Option<[f32; 3]>) -> Self {
        Tile { packets, hits: [float8(RowRef::MISS.to_lane()); PACKETS], common }
    }

    /// Dead rays.
    pub fn empty() -> Self {
        Tile::new([RayPacket::dead(); PACKETS], None)
    }

    /// Takes the tile for new rays, which have met nothing yet; its packets are still to be set.
    pub fn renew(&mut self, common: Option<[f32; 3]>) {
        self.hits = [float8(RowRef::MISS.to_lane()); PACKETS];
        self.common = common;
    }

    /// What lane `lane` of packet `packet` met.
    pub fn hit(&self, packet: usize, lane: usize) -> RowRef {
        RowRef::from_lane(self.hits[packet].as_array()[lane])
    }
}

impl Tree {
    /// Finds what each ray of a tile meets first.
    pub fn closest_tile(&self, tile: &mut Tile, walk: &mut Walk) {
        match self.culls {
            true => self.walk_tile::<false, true>(tile, walk),
            false => self.walk_tile::<false, false>(tile, walk),
        }
    }

    /// Finds which rays of a tile meet anything: those lanes are dead afterwards.
    pub fn occluded_tile(&self, tile: &mut Tile, walk: &mut Walk) {
        self.walk_tile::<true, false>(tile, walk);
    }

    fn walk_tile<const ANY: bool, const CULL: bool>(&self, tile: &mut Tile, walk: &mut Walk) {
        let live = (0..PACKETS).map(|p| u32::from(tile.packets[p].live().any()) << p).sum();
        if live == 0 {
            return;
        }
        self.make_room(walk);
        let one_by_one = match self.one_by_one {
            true => live,
            false => self.walk_together::<ANY, CULL>(live, tile, walk),
        };
        bits(one_by_one).for_each(|p| self.walk_one_by_one::<ANY, CULL>(p, tile, walk));
    }

    /// Packets that go the same way, all together or each on its own. Left are those whose own rays do not.
    fn walk_together<const ANY: bool, const CULL: bool>(&self, all: u32, tile: &mut Tile, walk: &mut Walk) -> u32 {
        let bundle = Bundle::new::<ANY>(tile, all);
        let merged = bundle.merged(all);
        let together = merged.narrow(self.size) != 0;
        let live = if together { all } else { all & bundle.narrow(self.size) };
        if live == 0 {
            return all;
        }
        for leaf in &self.planes {
            tile.meet::<ANY, CULL>(self, *leaf, live, walk);
        }
        let (mut beams, mut room) = (std::mem::take(&mut walk.beams), std::mem::take(&mut walk.companies));
        let (beam, whole) = (bundle.beam(live), merged.beam(live));
        beams.resize(PACKETS, beam);
        let (widths, far, farthest) = (bundle.widths(), reach(bundle.far), Float8::ZERO);
        let mut packets =
            Packets::<ANY, CULL> { beam, whole, widths, far, farthest, tile, beams: &mut beams, known: 0 };
        packets.look_again(live);
        match (self.nodes.is_empty(), together) {
            (true, _) => {}
            (_, true) => self.descend::<ANY, _>(&mut packets, Child::node(0), live, &mut room, walk),
            (_, false) => packets.alone(self, Child::node(0), live, &mut room, walk),
        }
        (walk.beams, walk.companies) = (beams, room);
        all & !live
    }

    /// One ray of a tile, from some child on.
    fn go_on<const ANY: bool, const CULL: bool>(
        &self,
        from: Child,
        tile: &mut Tile,
        (packet, lane): (usize, usize),
        walk: &mut Walk,
    ) {
        let (rays, hits) = (&mut tile.packets[packet], &mut tile.hits[packet]);
        let mut ray = rays.broadcast(lane);
        let mut row = RowRef::from_lane(hits.as_array()[lane]);
        self.descend_single::<ANY, CULL>(from, &mut ray, &mut row, walk);
        if ANY && row != RowRef::MISS {
            rays.t_min.as_mut_array()[lane] = f32::INFINITY;
            rays.t_max.as_mut_array()[lane] = f32::NEG_INFINITY;
        } else {
            rays.t_max.as_mut_array()[lane] = ray.t_max.as_array()[0];
            hits.as_mut_array()[lane] = row.to_lane();
        }
    }

    fn walk_one_by_one<const ANY: bool, const CULL: bool>(&self, packet: usize, tile: &mut Tile, walk: &mut Walk) {
        for leaf in &self.planes {
            tile.meet::<ANY, CULL>(self, *leaf, 1 << packet, walk);
        }
        if !self.nodes.is_empty() {
            let live = tile.packets[packet].live();
            live.lanes().for_each(|lane| self.go_on::<ANY, CULL>(Child::node(0), tile, (packet, lane), walk));
        }
    }
}

impl Tile {
    /// Holds some packets against a leaf: those in which something was met.
    #[inline(always)]
    fn meet<const ANY: bool, const CULL: bool>(&mut self, tree: &Tree, leaf: Leaf, mask: u32, walk: &mut Walk) -> u32 {
        let (stores, counts) = (&tree.stores, &mut walk.counts);
        let (packets, hits) = (&mut self.packets[..], &mut self.hits[..]);
        let common = self.common.map(Vec3x8::splat);
        stores.visit(leaf.kind, PacketLeaf::<ANY, CULL> { stores, leaf, packets, hits, mask, common, counts })
    }
}

impl<const ANY: bool, const CULL: bool> Company for Packets<'_, ANY, CULL> {
    fn beam(&self) -> &Beam {
        &self.beam
    }

    fn open(&self, node: &Node, members: u32) -> (Float8, Mask8) {
        if members & (members - 1) == 0 {
            let p = members.trailing_zeros() as usize;
            return self.beam.broadcast(p).meets_children(node, self.far.broadcast(p));
        }
        self.whole.meets_children(node, self.farthest)
    }

    fn far(&self) -> Float8 {
        self.far
    }

    fn farthest(&self) -> f32 {
        self.farthest.as_array()[0]
    }

    fn wider_than(&self, size: Float8, places: Float8) -> u32 {
        Mask8::gt(places.mul_add(self.widths[1], self.widths[0]), size * float8(WIDE)).bits()
    }

    fn part_ways(&self, _: &Content, _: u32) -> bool {
        false
    }

    fn alone(&mut self, tree: &Tree, child: Child, members: u32, room: &mut Room, walk: &mut Walk) {
        for p in bits(members) {
            let live = self.tile.packets[p].live().bits();
            if self.known >> p & 1 == 0 {
                self.beams[p] = Bundle::of_rays(&self.tile.packets[p]).beam(live);
                self.known |= 1 << p;
            }
            let (whole, farthest) = (self.beam.broadcast(p), self.far.broadcast(p));
            let far = reach(self.tile.packets[p].t_max);
            let mut rays = Rays::<ANY, CULL> { beam: &self.beams[p], whole, far, farthest, packet: p, tile: self.tile };
            tree.descend::<ANY, _>(&mut rays, child, live, room, walk);
        }
        self.look_again(members);
    }

    fn leaf(&mut self, tree: &Tree, leaf: Leaf, members: u32, walk: &mut Walk) {
        let touched = self.tile.meet::<ANY, CULL>(tree, leaf, members, walk);
        self.look_again(touched);
    }
}

impl<const ANY: bool, const CULL: bool> Packets<'_, ANY, CULL> {
    /// Sees how far some packets still look.
    #[inline(always)]
    fn look_again(&mut self, packets: u32) {
        for p in bits(packets) {
            let rays = &self.tile.packets[p];
            let limit = match ANY {
                true if rays.live().any() => continue,
                true => f32::NEG_INFINITY,
                false => greatest(reach(rays.t_max)),
            };
            self.far.as_mut_array()[p] = limit;
        }
        self.farthest = float8(greatest(self.far));
    }
}

impl<const ANY: bool, const CULL: bool> Company for Rays<'_, ANY, CULL> {
    fn beam(&self) -> &Beam {
        self.beam
    }

    fn open(&self, node: &Node, _: u32) -> (Float8, Mask8) {
        self.whole.meets_children(node, self.farthest)
    }

    fn far(&self) -> Float8 {
        self.far
    }

    fn farthest(&self) -> f32 {
        self.farthest.as_array()[0]
    }

    fn wider_than(&self, _: Float8, _: Float8) -> u32 {
        0
    }

    fn part_ways(&self, content: &Content, members: u32) -> bool {
        match content {
            Content::Node(_) => members.count_ones() <= FEW_RAYS,
            Content::Leaf(leaf) => 2 * members.count_ones() <= leaf.count as u32,
        }
    }

    fn alone(&mut self, tree: &Tree, child: Child, members: u32, _: &mut Room, walk: &mut Walk) {
        bits(members).for_each(|lane| tree.go_on::<ANY, CULL>(child, self.tile, (self.packet, lane), walk));
        self.look_again();
    }

    fn leaf(&mut self, tree: &Tree, leaf: Leaf, _: u32, walk: &mut Walk) {
        if self.tile.meet::<ANY, CULL>(tree, leaf, 1 << self.packet, walk) != 0 {
            self.look_again();
        }
    }
}

impl<const ANY: bool, const CULL: bool> Rays<'_, ANY, CULL> {
    /// Sees how far the rays still look.
    #[inline(always)]
    fn look_again(&mut self) {
        let rays = &self.tile.packets[self.packet];
        self.far = reach(rays.t_max);
        match ANY {
            // The whole may be seen from the other end: it looks all the way as long as some ray looks.
            true if rays.live().any() => {}
            _ => self.farthest = float8(greatest(self.far)),
        }
    }
}
