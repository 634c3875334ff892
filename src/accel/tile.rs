//! 64 rays down the tree: a lane is a packet, in leaves a ray.

use super::bundle::Bundle;
use super::leaf::{Beams, Best, PacketLeaf};
use super::node::{Beam, Child, Content, Leaf, Node, reach};
use super::regroup::Regroup;
use super::stack::{Entry, Stack};
use super::stream::Stream;
use super::{Counts, Tree, Walk};
use crate::lanes::{ExactPacket, Float8, LANES, Mask8, Ray, RayPacket, Vec3x8, bits, float8, greatest};
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
    /// By ray that asks for any hit, the row that it begins or ends on, where that is known to lie behind it: from
    /// outside no primitive is met twice. Bits of a [`RowRef`], a miss where nothing is known.
    pub own: [Float8; PACKETS],
    /// The rays before they were rounded, where what f32 leaves open is to be decided by these and not by the numbers
    /// that their bits are.
    pub exact: Option<Box<[ExactPacket; PACKETS]>>,
    /// Room for these.
    spare: Option<Box<[ExactPacket; PACKETS]>>,
    /// Where the hits are, and the least that their exact places may be; on the way `t_max` is the most. Where any hit
    /// will do, the rows of `own` stand for places.
    pub(super) places: [Float8; PACKETS],
    pub(super) lows: [Float8; PACKETS],
}

/// A packet that is so much wider than a box goes on as rays.
const WIDE: f32 = 1.0;

/// Of so many nodes with leaves alone, every leaf is asked by every packet: cheaper than finding out.
const TINY: usize = 1;

/// A child that some packets may meet.
#[derive(Debug, Clone, Copy, Default)]
pub struct Waiting {
    node: u32,
    slot: u8,
    /// Packets that may meet the node, a bit each.
    members: u8,
}

/// The packets of a tile on their way.
struct Packets<'a, const ANY: bool, const CULL: bool> {
    tree: &'a Tree,
    tile: &'a mut Tile,
    /// Bounds of each packet, a lane a packet, and of all together.
    beam: Beam,
    whole: Beam,
    /// Widths of origins and directions.
    widths: [Float8; 2],
    /// How far each of them still looks, below everything once it is done, and the greatest of these.
    far: Float8,
    farthest: Float8,
    own: Own<'a>,
}

/// The rays of the packets of a tile, where they are known already.
struct Own<'a> {
    /// Bounds of the rays of each packet, a lane a ray, and the number of the packet in the stream.
    beams: &'a mut [(Beam, usize)],
    stream: &'a mut Stream,
    known: u32,
}

impl Tile {
    /// Rays that have met nothing yet.
    pub fn new(packets: [RayPacket; PACKETS], common: Option<[f32; 3]>) -> Self {
        let none = [Float8::ZERO; PACKETS];
        let hits = [float8(RowRef::MISS.to_lane()); PACKETS];
        Tile { packets, hits, common, own: hits, exact: None, spare: None, places: none, lows: none }
    }

    /// Dead rays.
    pub fn empty() -> Self {
        Tile::new([RayPacket::dead(); PACKETS], None)
    }

    /// One ray, all else dead.
    pub fn of_one(ray: &Ray) -> Self {
        let mut tile = Tile::empty();
        tile.packets[0] = RayPacket::gather(std::slice::from_ref(ray));
        tile
    }

    /// Takes the tile for new rays, which have met nothing yet; its packets are still to be set.
    pub fn renew(&mut self, common: Option<[f32; 3]>) {
        self.hits = [float8(RowRef::MISS.to_lane()); PACKETS];
        self.own = self.hits;
        self.common = common;
        self.spare = self.exact.take().or(self.spare.take());
    }

    /// Room for the rays before they were rounded, which from now on decide.
    pub fn exact_mut(&mut self) -> &mut [ExactPacket; PACKETS] {
        let spare = self.spare.take();
        self.exact.get_or_insert_with(|| spare.unwrap_or_else(|| Box::new([ExactPacket::default(); PACKETS])))
    }

    /// The best hit of a ray so far.
    #[inline(always)]
    pub(super) fn best(&self, packet: usize, lane: usize) -> Best {
        Best {
            row: self.hit(packet, lane),
            t: self.places[packet].as_array()[lane],
            low: self.lows[packet].as_array()[lane],
            high: self.packets[packet].t_max.as_array()[lane],
        }
    }

    /// Sets it.
    #[inline(always)]
    pub(super) fn set_best(&mut self, packet: usize, lane: usize, best: &Best) {
        self.hits[packet].as_mut_array()[lane] = best.row.to_lane();
        self.places[packet].as_mut_array()[lane] = best.t;
        self.lows[packet].as_mut_array()[lane] = best.low;
        self.packets[packet].t_max.as_mut_array()[lane] = best.high;
    }

    /// Begins a walk: the ends of the rays are the places to beat.
    fn begin<const ANY: bool>(&mut self) {
        for p in 0..PACKETS {
            self.lows[p] = self.packets[p].t_max;
        }
        self.places = if ANY { self.own } else { self.lows };
    }

    /// Ends it: `t_max` is the place of the hit.
    fn finish(&mut self) {
        (0..PACKETS).for_each(|p| self.packets[p].t_max = self.places[p]);
    }

    /// Lanes of a packet that met something: a miss is the only reference whose bits are a NaN, as long as there
    /// are fewer than 260 million turned boxes.
    #[inline(always)]
    pub fn met(&self, packet: usize) -> Mask8 {
        Mask8::le(self.hits[packet], self.hits[packet])
    }

    /// What lane `lane` of packet `packet` met.
    pub fn hit(&self, packet: usize, lane: usize) -> RowRef {
        RowRef::from_lane(self.hits[packet].as_array()[lane])
    }
}

impl Tree {
    /// Finds what each ray of some tiles meets first.
    pub fn closest_tiles(&self, tiles: &mut [Tile], walk: &mut Walk) {
        match self.culls {
            true => self.walk_tiles::<false, true>(tiles, walk),
            false => self.walk_tiles::<false, false>(tiles, walk),
        }
    }

    /// Finds which rays of some tiles meet anything: those lanes are dead afterwards.
    pub fn occluded_tiles(&self, tiles: &mut [Tile], walk: &mut Walk) {
        let mut regroup = std::mem::take(&mut walk.regroup);
        for tiles in tiles.chunks_mut(Regroup::MOST) {
            let is_worth_it = !self.one_by_one && self.nodes.len() > TINY;
            match Some(tiles as &[Tile])
                .filter(|_| is_worth_it)
                .and_then(|tiles| regroup.sort(tiles, self.size, self.grain))
            {
                Some(sorted) => {
                    self.walk_tiles::<true, false>(sorted, walk);
                    regroup.hand_back(tiles);
                }
                None => self.walk_tiles::<true, false>(tiles, walk),
            }
        }
        walk.regroup = regroup;
    }

    /// Packets that go the same way go together; the rays of the others are gathered from many tiles.
    fn walk_tiles<const ANY: bool, const CULL: bool>(&self, tiles: &mut [Tile], walk: &mut Walk) {
        walk.make_room(self.room);
        for tiles in tiles.chunks_mut(Stream::MOST / PACKETS) {
            walk.apart.clear();
            let mut parted = std::mem::take(&mut walk.parted);
            for (i, tile) in tiles.iter_mut().enumerate() {
                tile.begin::<ANY>();
                let apart = self.walk_tile::<ANY, CULL>(tile, walk);
                parted.extend(bits(apart).map(|p| (i as u32, p as u32)));
                for p in bits(apart) {
                    let number = walk.apart.add(tile, p);
                    walk.apart.wait(number, tile.packets[p].live().bits());
                }
            }
            self.descend_rays::<ANY, CULL>(Child::node(0), &mut walk.apart, &mut walk.counts);
            for (number, (i, p)) in parted.drain(..).enumerate() {
                let (tile, p) = (&mut tiles[i as usize], p as usize);
                let live = tile.packets[p].live().bits();
                walk.apart.hand_back::<ANY>(number, live, tile, p);
            }
            walk.parted = parted;
            if !ANY {
                tiles.iter_mut().for_each(Tile::finish);
            }
        }
    }

    /// Walks with the packets that go the same way, all together or each on its own. Left are those whose own rays
    /// do not, which have been held against what is loose.
    fn walk_tile<const ANY: bool, const CULL: bool>(&self, tile: &mut Tile, walk: &mut Walk) -> u32 {
        let live_packets = |tile: &Tile| (0..PACKETS).map(|p| u32::from(tile.packets[p].live().any()) << p).sum();
        let mut all = live_packets(tile);
        for leaf in &self.loose {
            tile.meet::<ANY, CULL>(self, *leaf, all, None, &mut walk.counts);
        }
        if ANY && !self.loose.is_empty() {
            all = live_packets(tile);
        }
        if all == 0 || self.nodes.is_empty() {
            return 0;
        }
        if self.one_by_one || (all == 1 && tile.packets[0].live().bits() == 1) {
            return all;
        }
        let bundle = Bundle::new::<ANY>(tile, all);
        let merged = bundle.merged(all);
        let narrow = all & bundle.narrow(self.size);
        let together = merged.together::<ANY>(self.size, narrow == all);
        let live = if together { all } else { narrow };
        if live != 0 {
            self.walk_together::<ANY, CULL>(&bundle, &merged, live, together, tile, walk);
        }
        if live != all && self.nodes.len() <= TINY {
            self.meet_all::<ANY, CULL>(all & !live, tile, walk);
            return 0;
        }
        all & !live
    }

    /// Holds some packets against everything there is.
    fn meet_all<const ANY: bool, const CULL: bool>(&self, packets: u32, tile: &mut Tile, walk: &mut Walk) {
        for leaf in self.nodes.iter().flat_map(Node::leaves) {
            tile.meet::<ANY, CULL>(self, leaf, packets, None, &mut walk.counts);
        }
    }

    fn walk_together<const ANY: bool, const CULL: bool>(
        &self,
        bundle: &Bundle,
        merged: &Bundle,
        live: u32,
        together: bool,
        tile: &mut Tile,
        walk: &mut Walk,
    ) {
        let (beam, whole) = (bundle.beam(live), merged.beam(live));
        let Walk { counts, waiting, own, beams, .. } = walk;
        own.clear();
        let own = Own { beams, stream: own, known: 0 };
        let (widths, far, farthest) = (bundle.widths(), reach(bundle.far), Float8::ZERO);
        let mut packets = Packets::<ANY, CULL> { tree: self, tile, beam, whole, widths, far, farthest, own };
        packets.look_again(live);
        if together {
            packets.descend(live, waiting, counts);
        } else {
            packets.alone(Child::node(0), None, live, counts);
        }
    }
}

impl Tile {
    /// Holds some packets against a leaf: those in which something was met.
    #[inline(always)]
    fn meet<const ANY: bool, const CULL: bool>(
        &mut self,
        tree: &Tree,
        leaf: Leaf,
        mask: u32,
        beams: Option<Beams>,
        counts: &mut Counts,
    ) -> u32 {
        let stores = &tree.stores;
        let (packets, hits) = (&mut self.packets[..], &mut self.hits[..]);
        let common = self.common.map(Vec3x8::splat);
        let (places, lows) = (&mut self.places[..], &mut self.lows[..]);
        let exact = self.exact.as_ref().map(|exact| &exact[..]);
        let work =
            PacketLeaf::<ANY, CULL> { stores, leaf, packets, hits, places, lows, exact, mask, common, beams, counts };
        stores.visit(leaf.kind, work)
    }
}

impl<const ANY: bool, const CULL: bool> Packets<'_, ANY, CULL> {
    /// Takes some packets down from the root: a node is opened by all of them together, a lane a child, and each
    /// child is then held against every one of them, a lane a packet.
    fn descend(&mut self, members: u32, room: &mut [Entry<Waiting>], counts: &mut Counts) {
        let tree = self.tree;
        let mut stack = Stack::new(room);
        let mut next = Some((Child::node(0), members));
        while let Some((child, members)) = next {
            let mut nearest = None;
            match child.content() {
                Content::Leaf(leaf) => {
                    let Packets { tile, beam: each, whole, far, farthest, .. } = self;
                    let beams = Beams { each, whole, far, farthest };
                    let beams = Some(beams).filter(|_| leaf.count > 1);
                    let touched = tile.meet::<ANY, CULL>(tree, leaf, members, beams, counts);
                    self.look_again(touched);
                }
                Content::Node(index) => {
                    counts.boxes += LANES as u64;
                    let opened = &tree.nodes[index];
                    let (entries, met) = self.beams().open(opened, members);
                    let (node, members) = (index as u32, members as u8);
                    let waiting = |slot| {
                        tree.fetch(opened.child(slot));
                        Waiting { node, slot: slot as u8, members }
                    };
                    nearest = stack.nearest_first::<ANY>(&entries, met.bits(), waiting);
                }
            }
            next = loop {
                let farthest = self.farthest.as_array()[0];
                let Some(waiting) = nearest.take().or_else(|| stack.pop(farthest)) else { break None };
                let Waiting { node, slot, members } = waiting;
                let (node, slot) = (&tree.nodes[node as usize], usize::from(slot));
                counts.boxes += LANES as u64;
                let (entries, met) = self.beam.meets_child(node, slot, self.far);
                let met = met.bits() & u32::from(members);
                let wide = self.wider_than(node.size(slot), entries) & met;
                if wide != 0 {
                    self.alone(node.child(slot), Some((node, slot)), wide, counts);
                }
                if met != wide {
                    break Some((node.child(slot), met & !wide));
                }
            };
        }
    }

    #[inline(always)]
    fn beams(&self) -> Beams<'_> {
        Beams { each: &self.beam, whole: &self.whole, far: &self.far, farthest: &self.farthest }
    }

    /// Packets that at these places are wider than a box.
    #[inline(always)]
    fn wider_than(&self, size: Float8, places: Float8) -> u32 {
        Mask8::gt(places.mul_add(self.widths[1], self.widths[0]), size * float8(WIDE)).bits()
    }

    /// Lets the rays of some packets that meet a child go on alone; `slot` is where it lies.
    #[inline(never)]
    fn alone(&mut self, child: Child, slot: Option<(&Node, usize)>, members: u32, counts: &mut Counts) {
        let (mut touched, mut waiting) = (0, [0; PACKETS]);
        for p in bits(members) {
            let rays = &self.tile.packets[p];
            let mut lanes = rays.live().bits();
            self.own.know(p, self.tile);
            if let Some((node, slot)) = slot {
                counts.boxes += LANES as u64;
                lanes &= self.own.beams[p].0.meets_child(node, slot, reach(rays.t_max)).1.bits();
            }
            match child.content() {
                Content::Leaf(leaf) if 2 * lanes.count_ones() > leaf.count as u32 => {
                    touched |= self.tile.meet::<ANY, CULL>(self.tree, leaf, 1 << p, None, counts);
                }
                _ if lanes != 0 => {
                    self.own.stream.refresh::<ANY>(self.own.beams[p].1, lanes, self.tile, p);
                    self.own.stream.wait(self.own.beams[p].1, lanes);
                    waiting[p] = lanes;
                    touched |= 1 << p;
                }
                _ => {}
            }
        }
        self.tree.descend_rays::<ANY, CULL>(child, self.own.stream, counts);
        for (p, lanes) in waiting.into_iter().enumerate() {
            if lanes != 0 {
                self.own.stream.hand_back::<ANY>(self.own.beams[p].1, lanes, self.tile, p);
            }
        }
        self.look_again(touched);
    }

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
            // Not through memory, where a number that was just stored stalls the whole vector.
            self.far = Mask8::from_bits(1 << p).select(float8(limit), self.far);
        }
        self.farthest = float8(greatest(self.far));
    }
}

impl Own<'_> {
    /// Makes the rays of a packet known.
    #[inline(always)]
    fn know(&mut self, p: usize, tile: &Tile) {
        if self.known >> p & 1 == 0 {
            let rays = &tile.packets[p];
            let beam = Bundle::of_rays(rays).beam(rays.live().bits());
            self.beams[p] = (beam, self.stream.add(tile, p));
            self.known |= 1 << p;
        }
    }
}
