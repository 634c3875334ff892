//! Rows against rays: the loops behind the one match on the kind.

use crate::accel::Counts;
use crate::lanes::{Float8, Hit8, LANES, Mask8, RayPacket, Vec3x8, float8};
use crate::plan::Kind;
use crate::scene::Visible;
use crate::shapes::{Ray64, RowRef, Store, Stores, Visit};

/// Some rows of a kind against some packets, a lane a ray.
pub struct PacketLeaf<'a, const ANY: bool, const CULL: bool> {
    pub stores: &'a Stores,
    pub kind: Kind,
    pub rows: std::ops::Range<usize>,
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

    #[inline(always)]
    fn visit<S: Store>(mut self, store: &S) -> u32 {
        self.counts.kinds[self.kind as usize] +=
            (self.rows.len() as u32 * self.mask.count_ones()) as u64 * LANES as u64;
        match self.common {
            Some(origin) => self.loop_rows(store, |row, _| S::anchor(row, &origin), true),
            None => self.loop_rows(store, |row, rays: &RayPacket| S::anchor(row, &rays.origin), false),
        }
    }
}

impl<const ANY: bool, const CULL: bool> PacketLeaf<'_, ANY, CULL> {
    #[inline(always)]
    fn loop_rows<S: Store>(
        &mut self,
        store: &S,
        anchor: impl Fn(&S::Row, &RayPacket) -> S::Anchor,
        shared: bool,
    ) -> u32 {
        let mut touched = 0;
        for i in self.rows.clone() {
            let row = store.splat(i);
            let once = shared.then(|| anchor(&row, &self.packets[0]));
            let mut live = self.mask;
            while live != 0 {
                let p = live.trailing_zeros() as usize;
                live &= live - 1;
                let rays = &mut self.packets[p];
                let anchor = once.unwrap_or_else(|| anchor(&row, rays));
                let mut hit = S::hit::<CULL>(&anchor, rays);
                if hit.doubt.any() {
                    decide::<S, CULL>(store, |_| i, rays, &mut hit, self.counts);
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
                let row = RowRef::new(self.kind, i);
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

/// Some rows of a kind against one ray, a lane a row.
pub struct RayLeaf<'a, const ANY: bool, const CULL: bool> {
    pub stores: &'a Stores,
    pub kind: Kind,
    pub rows: std::ops::Range<usize>,
    /// The ray in all lanes; its `t_max` is the place of the best hit.
    pub ray: &'a mut RayPacket,
    pub hit: &'a mut RowRef,
    pub counts: &'a mut Counts,
}

impl<const ANY: bool, const CULL: bool> Visit for RayLeaf<'_, ANY, CULL> {
    type Output = ();

    #[inline(always)]
    fn visit<S: Store>(self, store: &S) {
        for first in self.rows.clone().step_by(LANES) {
            self.counts.kinds[self.kind as usize] += LANES as u64;
            let row = store.block(first);
            let mut hit = S::hit::<CULL>(&S::anchor(&row, &self.ray.origin), self.ray);
            if hit.doubt.any() {
                decide::<S, CULL>(store, |lane| first + lane, self.ray, &mut hit, self.counts);
            }
            let mut lanes = hit.mask.bits();
            if lanes == 0 {
                continue;
            }
            let (t, mut best) = (hit.t.to_array(), self.ray.t_max.to_array()[0]);
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                let row = RowRef::new(self.kind, first + lane);
                if t[lane] < best {
                    (best, *self.hit) = (t[lane], row);
                } else if t[lane] == best {
                    *self.hit = self.stores.first_of(*self.hit, row);
                }
            }
            self.ray.t_max = float8(best);
            if ANY {
                return;
            }
        }
    }
}

/// Decides doubtful lanes from the exact numbers of ray and part.
#[cold]
#[inline(never)]
fn decide<S: Store, const CULL: bool>(
    store: &S,
    row: impl Fn(usize) -> usize,
    rays: &RayPacket,
    hit: &mut Hit8,
    counts: &mut Counts,
) {
    let (mut t, mut mask) = (hit.t.to_array(), hit.mask.bits());
    let mut doubt = hit.doubt.bits();
    while doubt != 0 {
        let lane = doubt.trailing_zeros() as usize;
        doubt &= doubt - 1;
        let i = row(lane);
        let has_place = mask >> lane & 1 == 1;
        mask &= !(1 << lane);
        let Some(part) = store.parts().get(i) else { continue };
        counts.redecided += 1;
        let visible = if CULL { store.sides().row(i) } else { Visible::Both };
        let exact = Ray64::exact(&rays.lane(lane));
        // Whether a place of the kernel's own lies on the ray is decided already.
        let ray = if has_place { exact.endless() } else { exact };
        let met = S::decide(part, &ray, visible);
        mask |= u32::from(met.is_some()) << lane;
        t[lane] = met.filter(|_| !has_place).map_or(t[lane], |t| t as f32);
    }
    *hit = Hit8 { t: Float8::from(t), mask: Mask8::from_bits(mask), doubt: Mask8::NONE };
}

/// The lanes whose old hit, at the same `t`, wins.
#[cold]
#[inline(never)]
fn settle_ties(stores: &Stores, row: RowRef, old: &Float8, ties: Mask8) -> Mask8 {
    let old = old.to_array();
    let keeps = |lane: &usize| {
        let old = RowRef::from_lane(old[*lane]);
        ties.bits() >> lane & 1 == 1 && stores.first_of(row, old) != row
    };
    Mask8::from_bits((0..LANES).filter(keeps).map(|lane| 1 << lane).sum())
}
