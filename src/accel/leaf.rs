//! Leaves: eight rays against one primitive, or one ray after the other against eight.

use super::line::Line;
use super::node::Leaf;
use crate::accel::Counts;
use crate::lanes::{Float8, Hit8, LANES, Mask8, RayPacket, Vec3x8, bits, float8};
use crate::scene::Visible;
use crate::shapes::{Hidden8, Part, Ray64, RowRef, Store, Stores, Visit};

/// Some packets of a tile in a leaf: a lane is a ray.
pub struct PacketLeaf<'a, const ANY: bool, const CULL: bool> {
    pub stores: &'a Stores,
    pub leaf: Leaf,
    pub packets: &'a mut [RayPacket],
    pub hits: &'a mut [Float8],
    /// Packets that take part, a bit each.
    pub mask: u32,
    /// The origin, where all rays share it.
    pub common: Option<Vec3x8>,
    pub counts: &'a mut Counts,
}

impl<const ANY: bool, const CULL: bool> Visit for PacketLeaf<'_, ANY, CULL> {
    /// The packets in which something was met.
    type Output = u32;

    #[inline(never)]
    fn visit<P: Part>(mut self, store: &Store<P>) -> u32 {
        let Leaf { kind, count, .. } = self.leaf;
        self.counts.kinds[kind as usize] += (count as u32 * self.mask.count_ones()) as u64 * LANES as u64;
        match self.common {
            Some(origin) => self.each_row(store, Some(&origin)),
            None => self.each_row(store, None),
        }
    }
}

impl<const ANY: bool, const CULL: bool> PacketLeaf<'_, ANY, CULL> {
    #[inline(always)]
    fn each_row<P: Part>(&mut self, store: &Store<P>, common: Option<&Vec3x8>) -> u32 {
        let Leaf { kind, block, count } = self.leaf;
        let mut touched = 0;
        for lane in 0..count {
            let row = block * LANES + lane;
            let rows = store.splat(row);
            let part = |_| store.part(row);
            let hidden = if CULL { store.sides().lanes(|_| row) } else { Hidden8::NONE };
            let once = common.map(|origin| P::anchor(&rows, origin, part));
            for p in bits(self.mask) {
                let rays = &mut self.packets[p];
                let anchor = once.unwrap_or_else(|| P::anchor(&rows, &rays.origin, part));
                let mut hit = P::hit::<CULL>(&anchor, rays, &hidden);
                if hit.doubt.any() {
                    decide::<P, CULL>(store, |_| row, rays, &mut hit, self.counts);
                }
                if !hit.mask.any() {
                    continue;
                }
                touched |= 1 << p;
                if ANY {
                    rays.t_max = hit.mask.select(float8(f32::NEG_INFINITY), rays.t_max);
                    rays.t_min = hit.mask.select(float8(f32::INFINITY), rays.t_min);
                    continue;
                }
                let row = RowRef::new(kind, row);
                let ties = hit.mask & Mask8::ge(hit.t, rays.t_max);
                if ties.any() {
                    hit.mask &= !settle_ties(self.stores, row, &self.hits[p], ties);
                }
                rays.t_max = hit.mask.select(hit.t, rays.t_max);
                self.hits[p] = hit.mask.select(float8(row.to_lane()), self.hits[p]);
            }
        }
        touched
    }
}

/// Some rays in a leaf, one after the other: a lane is a primitive.
pub struct LineLeaf<'a, const ANY: bool, const CULL: bool> {
    pub stores: &'a Stores,
    pub leaf: Leaf,
    /// Rays that take part.
    pub rays: &'a [u16],
    pub lines: &'a mut [Line],
    pub counts: &'a mut Counts,
}

impl<const ANY: bool, const CULL: bool> Visit for LineLeaf<'_, ANY, CULL> {
    type Output = ();

    #[inline(never)]
    fn visit<P: Part>(self, store: &Store<P>) {
        let Leaf { kind, block, .. } = self.leaf;
        self.counts.kinds[kind as usize] += (self.rays.len() * LANES) as u64;
        let row = |lane: usize| block * LANES + lane;
        let rows = store.block(block);
        let hidden = if CULL { store.sides().lanes(row) } else { Hidden8::NONE };
        for ray in self.rays {
            let line = &mut self.lines[usize::from(*ray)];
            let ray = line.splat();
            let anchor = P::anchor(rows, &ray.origin, |lane| store.part(row(lane)));
            let mut hit = P::hit::<CULL>(&anchor, &ray, &hidden);
            if hit.doubt.any() {
                decide::<P, CULL>(store, row, &ray, &mut hit, self.counts);
            }
            let lanes = hit.mask.bits();
            if lanes == 0 {
                continue;
            }
            if ANY {
                line.end(RowRef::new(kind, row(lanes.trailing_zeros() as usize)));
                continue;
            }
            let (t, mut best) = (hit.t.as_array(), (line.t_max(), line.hit()));
            for lane in bits(lanes) {
                let row = RowRef::new(kind, row(lane));
                if t[lane] < best.0 {
                    best = (t[lane], row);
                } else if t[lane] == best.0 {
                    best.1 = self.stores.first_of(best.1, row);
                }
            }
            line.set(best.0, best.1);
        }
    }
}

/// Answers in f64 where the kernel was in doubt.
#[cold]
#[inline(never)]
fn decide<P: Part, const CULL: bool>(
    store: &Store<P>,
    row: impl Fn(usize) -> usize,
    rays: &RayPacket,
    hit: &mut Hit8,
    counts: &mut Counts,
) {
    let (mut t, mut mask) = (hit.t.to_array(), hit.mask.bits());
    for lane in hit.doubt.lanes() {
        let has_place = mask >> lane & 1 == 1;
        mask &= !(1 << lane);
        let Some(part) = store.part(row(lane)) else { continue };
        counts.redecided += 1;
        let visible = if CULL { store.sides().row(row(lane)) } else { Visible::Both };
        let exact = Ray64::exact(&rays.lane(lane));
        // Whether a place of the kernel's own lies on the ray is decided already.
        let ray = if has_place { exact.endless() } else { exact };
        let met = part.decide(&ray, visible);
        mask |= u32::from(met.is_some()) << lane;
        t[lane] = met.filter(|_| !has_place).map_or(t[lane], |t| t as f32);
    }
    *hit = Hit8 { t: Float8::from(t), mask: Mask8::from_bits(mask), doubt: Mask8::NONE };
}

/// Lanes of `ties` in which the old hit wins over `row` at the same place.
#[cold]
#[inline(never)]
fn settle_ties(stores: &Stores, row: RowRef, old: &Float8, ties: Mask8) -> Mask8 {
    let keeps = |lane: &usize| stores.first_of(row, RowRef::from_lane(old.as_array()[*lane])) != row;
    Mask8::from_bits(ties.lanes().filter(keeps).map(|lane| 1 << lane).sum())
}
