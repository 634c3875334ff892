//! Leaves: eight rays against one primitive, or one ray after the other against eight.

use super::line::Line;
use super::node::{Beam, Leaf, Node};
use super::stream::Exact;
use crate::accel::Counts;
use crate::lanes::{Columns, ExactPacket, Float8, LANES, Mask8, Ray, RayPacket, Vec3x8, bits, float8};
use crate::scene::Visible;
use crate::shapes::{Hidden8, Part, Ray64, RowRef, Store, Stores, Visit, noise};

/// Some packets of a tile in a leaf: a lane is a ray.
pub struct PacketLeaf<'a, const ANY: bool, const CULL: bool> {
    pub stores: &'a Stores,
    pub leaf: Leaf,
    /// `t_max` of a ray that has met something is the most that the exact place may be.
    pub packets: &'a mut [RayPacket],
    pub hits: &'a mut [Float8],
    /// Where the hits are; with `ANY` the rows that the rays are known not to meet.
    pub places: &'a mut [Float8],
    /// The least that their exact places may be; without a hit the end of the ray.
    pub lows: &'a mut [Float8],
    /// The rays before they were rounded, where they are to be judged by that.
    pub exact: Option<&'a [ExactPacket]>,
    /// Packets that take part, a bit each.
    pub mask: u32,
    /// The origin, where all rays share it.
    pub common: Option<Vec3x8>,
    /// Bounds of the packets, by which rows are passed over.
    pub beams: Option<Beams<'a>>,
    pub counts: &'a mut Counts,
}

/// Bounds of some packets that go together.
#[derive(Debug, Clone, Copy)]
pub struct Beams<'a> {
    /// A lane a packet.
    pub each: &'a Beam,
    /// All together.
    pub whole: &'a Beam,
    /// How far each of them still looks, and the greatest of these.
    pub far: &'a Float8,
    pub farthest: &'a Float8,
}

impl Beams<'_> {
    /// Where some of them together may enter the boxes of a node at the earliest, and which they may meet.
    #[inline(always)]
    pub fn open(&self, node: &Node, members: u32) -> (Float8, Mask8) {
        if members & (members - 1) == 0 {
            let p = members.trailing_zeros() as usize;
            return self.each.broadcast(p).meets_children(node, self.far.broadcast(p));
        }
        self.whole.meets_children(node, *self.farthest)
    }
}

impl<const ANY: bool, const CULL: bool> Visit for PacketLeaf<'_, ANY, CULL> {
    /// The packets in which something was met.
    type Output = u32;

    #[inline(never)]
    fn visit<P: Part>(mut self, store: &Store<P>) -> u32 {
        match (self.common, self.stores.certify()) {
            (Some(origin), true) => self.each_row::<P, true>(store, Some(&origin)),
            (Some(origin), false) => self.each_row::<P, false>(store, Some(&origin)),
            (None, true) => self.each_row::<P, true>(store, None),
            (None, false) => self.each_row::<P, false>(store, None),
        }
    }
}

impl<const ANY: bool, const CULL: bool> PacketLeaf<'_, ANY, CULL> {
    #[inline(always)]
    fn each_row<P: Part, const CERTIFY: bool>(&mut self, store: &Store<P>, common: Option<&Vec3x8>) -> u32 {
        let Leaf { kind, block, count } = self.leaf;
        let (mut rows, mut touched) = ((1 << count) - 1, 0);
        let mut node = Node::empty();
        if let Some(beams) = &self.beams {
            node = Node::around(P::bounds8(store.block(block)));
            self.counts.boxes += LANES as u64;
            rows &= beams.open(&node, self.mask).1.bits();
        }
        for lane in bits(rows) {
            let row = block * LANES + lane;
            let mut packets = self.mask;
            if let Some(beams) = &self.beams
                && packets & (packets - 1) != 0
            {
                self.counts.boxes += LANES as u64;
                packets &= beams.each.meets_child(&node, lane, *beams.far).1.bits();
            }
            self.counts.kinds[kind as usize] += u64::from(packets.count_ones()) * LANES as u64;
            let rows = store.splat(row);
            let part = |_| store.part(row);
            let hidden = if CULL { store.sides().lanes(|_| row) } else { Hidden8::NONE };
            let once = common.map(|origin| P::anchor(&rows, origin));
            for p in bits(packets) {
                let rays = &mut self.packets[p];
                let anchor = once.unwrap_or_else(|| P::anchor(&rows, &rays.origin));
                let hit = P::hit::<CULL, CERTIFY>(&rows, &anchor, rays, &hidden, part);
                let met = hit.mask | hit.doubt;
                if !met.any() {
                    continue;
                }
                touched |= 1 << p;
                let high = hit.t + hit.error;
                // Of a place before all that the best one may be there is nothing to decide.
                let mut clear = hit.mask & !hit.doubt;
                if ANY {
                    clear &= Mask8::le(high, rays.t_max);
                    end(rays, clear);
                } else {
                    clear &= Mask8::lt(high, self.lows[p]);
                    rays.t_max = clear.select(high, rays.t_max);
                    self.lows[p] = clear.select(hit.t - hit.error, self.lows[p]);
                    self.places[p] = clear.select(hit.t, self.places[p]);
                    self.hits[p] = clear.select(float8(RowRef::new(kind, row).to_lane()), self.hits[p]);
                }
                let mut open = met & !clear;
                if ANY {
                    open &= !Mask8::same_bits(self.places[p], float8(RowRef::new(kind, row).to_lane()));
                }
                if open.any() {
                    self.settle::<P, CERTIFY>(store, row, p, open, (hit.t, hit.mask));
                }
            }
        }
        touched
    }

    /// Decides the open lanes of a packet, one by one.
    #[cold]
    #[inline(never)]
    fn settle<P: Part, const CERTIFY: bool>(
        &mut self,
        store: &Store<P>,
        row: usize,
        p: usize,
        open: Mask8,
        (t, has_place): (Float8, Mask8),
    ) {
        let Some(part) = store.part(row) else { return };
        let visible = if CULL { store.sides().row(row) } else { Visible::Both };
        let rays = &mut self.packets[p];
        let (places, mut dark) = (t.to_array(), 0);
        for lane in open.lanes() {
            let bits = rays.lane(lane);
            let ray = Ray64::exact(&bits);
            let ray = self.exact.map_or(ray, |exact| ray.from(&exact[p], lane));
            let challenger = Challenger {
                row: RowRef::new(self.leaf.kind, row),
                place: (has_place.bits() >> lane & 1 == 1).then(|| places[lane]),
            };
            let mut best = Best {
                row: RowRef::from_lane(self.hits[p].as_array()[lane]),
                t: self.places[p].as_array()[lane],
                low: self.lows[p].as_array()[lane],
                high: bits.t_max,
            };
            let wins = challenger.against::<P, CERTIFY>(&mut best, part, visible, &ray, self.stores, self.counts);
            if ANY {
                dark |= u32::from(wins) << lane;
            } else if wins {
                self.hits[p].as_mut_array()[lane] = best.row.to_lane();
                self.places[p].as_mut_array()[lane] = best.t;
                self.lows[p].as_mut_array()[lane] = best.low;
                rays.t_max.as_mut_array()[lane] = best.high;
            }
        }
        if ANY {
            end(rays, Mask8::from_bits(dark));
        }
    }
}

/// Kills lanes.
#[inline(always)]
pub fn end(rays: &mut RayPacket, lanes: Mask8) {
    rays.t_max = lanes.select(float8(f32::NEG_INFINITY), rays.t_max);
    rays.t_min = lanes.select(float8(f32::INFINITY), rays.t_min);
}

/// Some rays in a leaf, one after the other: a lane is a primitive.
pub struct LineLeaf<'a, const ANY: bool, const CULL: bool> {
    pub stores: &'a Stores,
    pub leaf: Leaf,
    /// Rays that take part.
    pub rays: &'a [u16],
    pub lines: &'a mut [Line],
    /// The rays before they were rounded.
    pub exact: &'a Exact,
    pub counts: &'a mut Counts,
}

impl<const ANY: bool, const CULL: bool> Visit for LineLeaf<'_, ANY, CULL> {
    type Output = ();

    #[inline(never)]
    fn visit<P: Part>(self, store: &Store<P>) {
        self.counts.kinds[self.leaf.kind as usize] += (self.rays.len() * LANES) as u64;
        match self.stores.certify() {
            true => self.each_ray::<P, true>(store),
            false => self.each_ray::<P, false>(store),
        }
    }
}

impl<const ANY: bool, const CULL: bool> LineLeaf<'_, ANY, CULL> {
    #[inline(always)]
    fn each_ray<P: Part, const CERTIFY: bool>(self, store: &Store<P>) {
        let Leaf { kind, block, count } = self.leaf;
        let row = |lane: usize| block * LANES + lane;
        let rows = store.block(block);
        let hidden = if CULL { store.sides().lanes(row) } else { Hidden8::NONE };
        for number in self.rays {
            let line = &mut self.lines[usize::from(*number)];
            let ray = line.splat();
            let anchor = P::anchor(rows, &ray.origin);
            if CERTIFY && P::misses(rows, &anchor, &ray).all() {
                continue;
            }
            let hit = P::hit::<CULL, CERTIFY>(rows, &anchor, &ray, &hidden, |lane| store.part(row(lane)));
            let lanes = (hit.mask | hit.doubt).bits() & ((1 << count) - 1);
            if lanes == 0 {
                continue;
            }
            let sure = hit.mask & !hit.doubt;
            if ANY {
                let met = (sure & Mask8::le(hit.t + hit.error, ray.t_max)).bits() & lanes;
                if met != 0 {
                    line.end(RowRef::new(kind, row(met.trailing_zeros() as usize)));
                    continue;
                }
            }
            let (mask, sure) = (hit.mask.bits(), sure.bits());
            let (t, error, mut best) = (hit.t.as_array(), hit.error.as_array(), line.best());
            let own = RowRef::from_lane(best.t);
            for lane in bits(lanes) {
                if ANY && own == RowRef::new(kind, row(lane)) {
                    continue;
                }
                let (low, high) = (t[lane] - error[lane], t[lane] + error[lane]);
                let sure = sure >> lane & 1 == 1;
                if sure && high < best.low {
                    best = Best { row: RowRef::new(kind, row(lane)), t: t[lane], low, high };
                } else if !sure || low <= best.high {
                    let place = (mask >> lane & 1 == 1).then_some(t[lane]);
                    let challenger = Challenger { row: RowRef::new(kind, row(lane)), place };
                    let visible = if CULL { store.sides().row(row(lane)) } else { Visible::Both };
                    let Some(part) = store.part(row(lane)) else { continue };
                    let bits = Ray { t_max: best.high, ..ray.lane(0) };
                    let ray = self.exact.ray(*number, &bits);
                    challenger.against::<P, CERTIFY>(&mut best, part, visible, &ray, self.stores, self.counts);
                }
            }
            match ANY {
                true if best.row != RowRef::MISS => line.end(best.row),
                true => {}
                false => line.set(&best),
            }
        }
    }
}

/// What one ray has met first so far.
#[derive(Debug, Clone, Copy)]
pub struct Best {
    /// The row, or a miss.
    pub row: RowRef,
    /// Its place: a function of ray and row alone, whatever else was met on the way. Where any hit will do, the row
    /// that the ray is known not to meet.
    pub t: f32,
    /// The least that the exact place may be; without a hit the end of the ray.
    pub low: f32,
    /// The most that it may be; without a hit the end of the ray.
    pub high: f32,
}

/// A row that may be met, and nearer than the best one.
struct Challenger {
    row: RowRef,
    /// Where the kernel found it, if it did.
    place: Option<f32>,
}

impl Challenger {
    /// Decides in f64 whether it is met, and first: then it becomes the best. Of places that f64 cannot tell apart the
    /// lowest primitive wins.
    #[cold]
    #[inline(never)]
    fn against<P: Part, const CERTIFY: bool>(
        &self,
        best: &mut Best,
        part: &P,
        visible: Visible,
        ray: &Ray64,
        stores: &Stores,
        counts: &mut Counts,
    ) -> bool {
        let alone = best.row == RowRef::MISS;
        if !CERTIFY {
            let Some(t) = self.place.filter(|t| *t <= best.t) else { return false };
            let wins = alone || t < best.t || stores.first_of(best.row, self.row) == self.row;
            if wins {
                *best = Best { row: self.row, t, low: t, high: t };
            }
            return wins;
        }
        counts.redecided += 1;
        let ray = if alone { *ray } else { ray.endless() };
        let Some(t) = part.decide(&ray, visible) else { return false };
        if !alone {
            let old = stores.decide(best.row, &ray).unwrap_or(f64::from(best.t));
            let tie = (t - old).abs() <= noise(part, &ray, t) + stores.noise(best.row, &ray, old);
            counts.ties += u64::from(tie);
            let wins = if tie { stores.first_of(best.row, self.row) == self.row } else { t < old };
            if !wins {
                return false;
            }
        }
        let rounded = t as f32;
        let (low, high) = (rounded.next_down(), rounded.next_up());
        *best = Best { row: self.row, t: self.place.unwrap_or(rounded), low, high };
        true
    }
}
