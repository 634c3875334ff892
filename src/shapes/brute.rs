//! Every row asked, without a tree: what the tests hold kernels and walks against.

use super::{Hidden8, Part, Ray64, RowRef, Store, Stores, Visit};
use crate::lanes::{Hit8, LANES, Ray, RayPacket};
use crate::plan::Kind;
use crate::scene::Visible;

/// By row of a kind, those of padding among them, what eight rays make of it: a lane a ray.
pub fn packet_against_rows(stores: &Stores, kind: Kind, rays: &RayPacket, cull: bool) -> Vec<[Option<f32>; LANES]> {
    stores.visit(kind, ByRow { rays, cull })
}

/// By row of a kind, those of padding among them, where one ray meets it: a lane a row.
pub fn ray_against_rows(stores: &Stores, kind: Kind, ray: &Ray, cull: bool) -> Vec<Option<f32>> {
    stores.visit(kind, ByBlock { rays: RayPacket::splat(ray), cull })
}

/// What one ray meets first: of equal places the lowest primitive, as the walks have it.
pub fn closest(stores: &Stores, ray: &Ray, cull: bool) -> Option<(f32, RowRef)> {
    let mut best: Option<(f32, RowRef)> = None;
    for kind in Kind::ALL {
        for (row, t) in ray_against_rows(stores, kind, ray, cull).into_iter().enumerate() {
            let (Some(t), row) = (t, RowRef::new(kind, row)) else { continue };
            best = Some(match best {
                Some((other, _)) if t < other => (t, row),
                Some((other, old)) if t == other => (t, stores.first_of(old, row)),
                Some(old) => old,
                None => (t, row),
            });
        }
    }
    best
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
        let all: Vec<Option<f32>> = (0..store.blocks()).flat_map(block).collect();
        let padding = |row: &usize| store.part(*row).is_none();
        assert!((0..all.len()).filter(padding).all(|row| all[row].is_none()), "a padding row was hit");
        all
    }
}

/// The kernel's answers, doubts decided.
fn decided<P: Part>(
    store: &Store<P>,
    rows: &P::Rows,
    rays: &RayPacket,
    cull: bool,
    row: impl Fn(usize) -> usize,
) -> [Option<f32>; LANES] {
    let anchor = P::anchor(rows, &rays.origin, |lane| store.part(row(lane)));
    let hidden = store.sides().lanes(&row);
    let Hit8 { t, mask, doubt } = match cull {
        true => P::hit::<true>(&anchor, rays, &hidden),
        false => P::hit::<false>(&anchor, rays, &Hidden8::NONE),
    };
    let lane = |lane: usize| {
        if doubt.bits() >> lane & 1 == 0 {
            return (mask.bits() >> lane & 1 == 1).then(|| t.to_array()[lane]);
        }
        let i = row(lane);
        let visible = if cull { store.sides().row(i) } else { Visible::Both };
        let (place, exact) = (t.to_array()[lane], Ray64::exact(&rays.lane(lane)));
        let keeps = mask.bits() >> lane & 1 == 1;
        let ray = if keeps { exact.endless() } else { exact };
        store.part(i)?.decide(&ray, visible).map(|t| if keeps { place } else { t as f32 })
    };
    std::array::from_fn(lane)
}
