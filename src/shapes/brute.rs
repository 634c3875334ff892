//! Every row asked, without a tree: what the tests hold kernels and walks against.

use super::{Hidden8, Part, Ray64, RowRef, Store, Stores, Visit};
use crate::lanes::{Hit8, LANES, Ray, RayPacket};
use crate::plan::Kind;
use crate::scene::Visible;

/// By row of a kind what eight rays make of it, nothing of padding: a lane a ray.
pub fn packet_against_rows(stores: &Stores, kind: Kind, rays: &RayPacket, cull: bool) -> Vec<[Option<f32>; LANES]> {
    stores.visit(kind, ByRow { rays, cull })
}

/// By row of a kind where one ray meets it, nowhere for padding: a lane a row.
pub fn ray_against_rows(stores: &Stores, kind: Kind, ray: &Ray, cull: bool) -> Vec<Option<f32>> {
    stores.visit(kind, ByBlock { rays: RayPacket::splat(ray), cull })
}

/// What one ray meets first, and where the kernels put it: order and ties are those of f64.
pub fn closest(stores: &Stores, ray: &Ray, cull: bool) -> Option<(f32, RowRef)> {
    let exact = Ray64::exact(ray);
    let mut best: Option<(f64, f32, RowRef)> = None;
    for kind in Kind::ALL {
        for (row, t) in ray_against_rows(stores, kind, ray, cull).into_iter().enumerate() {
            let (Some(place), row) = (t, RowRef::new(kind, row)) else { continue };
            let t = if cull { stores.decide(row, &exact) } else { stores.decide_any(row, &exact) };
            let t = t.unwrap_or(f64::from(place));
            let Some((other, _, old)) = best else {
                best = Some((t, place, row));
                continue;
            };
            let tie = (t - other).abs() <= stores.noise(row, &exact, t) + stores.noise(old, &exact, other);
            let wins = if tie { stores.first_of(old, row) == row } else { t < other };
            if wins {
                best = Some((t, place, row));
            }
        }
    }
    best.map(|(_, place, row)| (place, row))
}

struct ByRow<'a> {
    rays: &'a RayPacket,
    cull: bool,
}

impl Visit for ByRow<'_> {
    type Output = Vec<[Option<f32>; LANES]>;
    fn visit<P: Part>(self, store: &Store<P>) -> Self::Output {
        let row = |i: usize| {
            let rows = store.splat(i);
            decided(store, &rows, self.rays, self.cull, |_| i)
        };
        (0..store.blocks() * LANES).map(row).collect()
    }
}

struct ByBlock {
    rays: RayPacket,
    cull: bool,
}

impl Visit for ByBlock {
    type Output = Vec<Option<f32>>;
    fn visit<P: Part>(self, store: &Store<P>) -> Self::Output {
        let block = |b| decided(store, store.block(b), &self.rays, self.cull, move |lane| b * LANES + lane);
        (0..store.blocks()).flat_map(block).collect()
    }
}

/// The kernel's answers, doubts decided; asserts that what certainly misses is not met.
fn decided<P: Part>(
    store: &Store<P>,
    rows: &P::Rows,
    rays: &RayPacket,
    cull: bool,
    row: impl Fn(usize) -> usize,
) -> [Option<f32>; LANES] {
    let part = |lane| store.part(row(lane));
    let anchor = P::anchor(rows, &rays.origin);
    let misses = P::misses(rows, &anchor, rays).bits();
    let hidden = store.sides().lanes(&row);
    let Hit8 { t, mask, doubt, .. } = match cull {
        true => P::hit::<true, true>(rows, &anchor, rays, &hidden, part),
        false => P::hit::<false, true>(rows, &anchor, rays, &Hidden8::NONE, part),
    };
    let lane = |lane: usize| {
        let part = part(lane)?;
        let (place, bits) = (t.to_array()[lane], rays.lane(lane));
        let kept = (mask.bits() >> lane & 1 == 1).then_some(place);
        // The kernel tells of places that are past the end by their error too.
        if doubt.bits() >> lane & 1 == 0 && kept.is_none_or(|t| t < bits.t_max * (1.0 - 1e-5)) {
            return kept;
        }
        let visible = if cull { store.sides().row(row(lane)) } else { Visible::Both };
        part.decide(&Ray64::exact(&bits), visible).map(|t| kept.unwrap_or(t as f32))
    };
    let met: [Option<f32>; LANES] = std::array::from_fn(lane);
    assert!((0..LANES).all(|lane| misses >> lane & 1 == 0 || met[lane].is_none()), "{misses:b}: {met:?} {rays:?}");
    met
}
