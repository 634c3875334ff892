//! Boxes of parts, and where a set of them is best cut in two.

use crate::lanes::{Float8, LANES, float8};
use crate::plan::Kind;

/// Most rows of a leaf.
const MOST_ROWS: usize = LANES;
/// Cost of a row in a leaf where that of a binary node, and of opening a leaf, is 1, for the surface area heuristic.
/// Rows share a block and a kernel call, so eight of them cost a single ray what one does, and full leaves are what
/// keeps a large scene in the caches; a packet tests them one by one.
const ROW_COST: f32 = 0.1;
/// The same for a sphere, which is the cheapest to test.
const SPHERE_COST: f32 = 0.125;

/// Most bins an axis.
const MOST_BINS: usize = 16;
/// What centres reach of the last bin at most, so that rounding leaves none beyond it.
const WITHIN: f32 = 0.9999;

/// Lanes of the lower corner, of the upper one, and those between.
const LOWER: usize = 0;
const UPPER: usize = 4;
const INDEX: usize = 3;
const KIND: usize = 7;
/// Bits that make floats of what stands in the lanes between, which nothing overflows with, nor slows down as numbers
/// below the least normal one do.
const TAG: u32 = 0x4000_0000;

/// A box: the lower corner, a lane that means nothing, the upper corner negated, and another, so that the least of two is
/// around both.
#[derive(Debug, Clone, Copy)]
pub struct Bounds(Float8);

impl Bounds {
    /// Around nothing.
    pub const NOTHING: Bounds = Bounds(Float8::new([f32::INFINITY; LANES]));

    /// Around both.
    #[inline(always)]
    pub fn join(self, other: Bounds) -> Self {
        Bounds(self.0.fast_min(other.0))
    }

    /// Its corners, scene units.
    #[inline(always)]
    pub fn corners(&self) -> [[f32; 3]; 2] {
        let [a, b, c, _, d, e, f, _] = self.0.to_array();
        [[a, b, c], [-d, -e, -f]]
    }

    /// Its edges, scene units.
    #[inline(always)]
    pub fn edges(&self) -> [f32; 3] {
        let [low, high] = self.corners();
        std::array::from_fn(|axis| high[axis] - low[axis])
    }

    /// Half its surface, square scene units.
    #[inline(always)]
    pub fn half_area(&self) -> f32 {
        let [x, y, z] = self.edges();
        x * y + y * z + z * x
    }
}

/// A part with bounds: a box whose lanes between tell which part it is.
#[derive(Debug, Clone, Copy)]
pub struct Item(Float8);

impl Item {
    /// A part of a kind, and its corners.
    pub fn new(kind: Kind, index: usize, low: [f32; 3], high: [f32; 3]) -> Self {
        let tag = |bits| f32::from_bits(TAG | bits);
        let ([a, b, c], [d, e, f]) = (low, high);
        Item(Float8::new([a, b, c, tag(index as u32), -d, -e, -f, tag(kind as u32)]))
    }

    /// Its index among the parts of its kind.
    pub fn index(&self) -> u32 {
        self.0.as_array()[INDEX].to_bits() & !TAG
    }

    /// What it is.
    pub fn kind(&self) -> Kind {
        Kind::ALL[(self.0.as_array()[KIND].to_bits() & !TAG) as usize]
    }

    /// Its box.
    #[inline(always)]
    pub fn bounds(&self) -> Bounds {
        Bounds(self.0)
    }

    /// Twice its centre, as a box of a point.
    #[inline(always)]
    fn center(&self) -> Bounds {
        let [a, b, c, d, e, f, g, h] = self.0.to_array();
        Bounds(self.0 - Float8::new([e, f, g, h, a, b, c, d]))
    }

    /// One coordinate of that.
    #[inline(always)]
    fn center_on(&self, axis: usize) -> f32 {
        let lanes = self.0.as_array();
        lanes[LOWER + axis] - lanes[UPPER + axis]
    }
}

/// Items that go together.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    /// The first of them.
    pub first: usize,
    /// How many there are.
    pub count: usize,
    /// Around them.
    pub bounds: Bounds,
    /// Around twice their centres.
    centers: Bounds,
    /// The kind that holds them all, where they are to be a leaf.
    pub leaf: Option<Kind>,
}

impl Span {
    /// Some of the items, at least one.
    pub fn new(items: &[Item], first: usize, count: usize) -> Self {
        let own = &items[first..][..count];
        let around = |of: fn(&Item) -> Bounds| own.iter().map(of).fold(Bounds::NOTHING, Bounds::join);
        Span::with(items, first, count, around(Item::bounds), around(Item::center))
    }

    fn with(items: &[Item], first: usize, count: usize, bounds: Bounds, centers: Bounds) -> Self {
        let leaf = leaf_kind(&items[first..][..count], &bounds);
        Span { first, count, bounds, centers, leaf }
    }

    /// The same where the items before it are left out.
    pub fn at_start(&self) -> Self {
        Span { first: 0, ..*self }
    }

    /// Cuts it in two by the surface area heuristic and puts the items in that order.
    ///
    /// Source: Wald, "On fast construction of SAH-based bounding volume hierarchies", IEEE Symposium on Interactive Ray
    /// Tracing, 2007: centres are put into bins along each axis, and the cut is one between bins.
    pub fn split(&self, items: &mut [Item]) -> [Span; 2] {
        let own = &mut items[self.first..][..self.count];
        if self.count > MOST_ROWS
            && let Some(cut) = Bins::new(self, own).best()
        {
            let (left, centers) = cut.part(own);
            let counts = [left, self.count - left];
            let span = |k: usize, first| Span::with(items, first, counts[k], cut.bounds[k], centers[k]);
            return [span(0, self.first), span(1, self.first + left)];
        }
        let left = match self.count > MOST_ROWS {
            true => cut_in_half(own, self.longest_axis()),
            false => sweep(own, |rows| rows as f32).0,
        };
        [Span::new(items, self.first, left), Span::new(items, self.first + left, self.count - left)]
    }

    fn longest_axis(&self) -> usize {
        let edges = self.centers.edges();
        (0..3).max_by(|a, b| edges[*a].total_cmp(&edges[*b])).unwrap_or(0)
    }
}

/// The kind that holds all of some items, where a leaf of them costs no more than two do.
fn leaf_kind(items: &[Item], bounds: &Bounds) -> Option<Kind> {
    if items.len() > MOST_ROWS {
        return None;
    }
    let (first, others) = items.split_first()?;
    let kind = others.iter().try_fold(first.kind(), |kind, item| kind.holding(item.kind()))?;
    if others.is_empty() {
        return Some(kind);
    }
    let (mut sorted, area) = ([*first; MOST_ROWS], bounds.half_area());
    sorted[..items.len()].copy_from_slice(items);
    let (_, apart) = sweep(&mut sorted[..items.len()], |rows| leaf_cost(kind, rows));
    (area * leaf_cost(kind, items.len()) <= area + apart).then_some(kind)
}

fn leaf_cost(kind: Kind, rows: usize) -> f32 {
    let row = if kind == Kind::Sphere { SPHERE_COST } else { ROW_COST };
    1.0 + row * rows as f32
}

/// Puts at most [`MOST_ROWS`] items in the order where they are best cut in two: how many are left of the cut, and what
/// both sides cost, half areas times `cost` of their counts.
fn sweep(items: &mut [Item], cost: impl Fn(usize) -> f32) -> (usize, f32) {
    let (mut axis, mut left, mut least) = (0, items.len() / 2, f32::INFINITY);
    for k in 0..3 {
        sort(items, k);
        let (mut after, mut around) = ([0.0; MOST_ROWS], Bounds::NOTHING);
        for first in (1..items.len()).rev() {
            around = around.join(items[first].bounds());
            after[first] = around.half_area() * cost(items.len() - first);
        }
        around = Bounds::NOTHING;
        for count in 1..items.len() {
            around = around.join(items[count - 1].bounds());
            let both = around.half_area() * cost(count) + after[count];
            if both < least {
                (axis, left, least) = (k, count, both);
            }
        }
    }
    sort(items, axis);
    (left, least)
}

/// By insertion, which is the fastest for so few.
fn sort(items: &mut [Item], axis: usize) {
    let mut keys = [0.0; MOST_ROWS];
    for (next, key) in keys.iter_mut().enumerate().take(items.len()) {
        *key = items[next].center_on(axis);
    }
    for next in 1..items.len() {
        let (item, key, mut at) = (items[next], keys[next], next);
        while at > 0 && keys[at - 1] > key {
            (items[at], keys[at]) = (items[at - 1], keys[at - 1]);
            at -= 1;
        }
        (items[at], keys[at]) = (item, key);
    }
}

/// Where no bins help: half of them to each side.
fn cut_in_half(items: &mut [Item], axis: usize) -> usize {
    let left = items.len() / 2;
    items.select_nth_unstable_by(left, |a, b| a.center_on(axis).total_cmp(&b.center_on(axis)));
    left
}

/// Items by where their centres lie, on each axis.
struct Bins {
    /// How many an axis.
    count: usize,
    origin: Float8,
    /// Bins per unit; 0 on axes where centres do not differ.
    scale: Float8,
    bounds: [[Bounds; 3]; MOST_BINS],
    items: [[u32; 3]; MOST_BINS],
}

impl Bins {
    fn new(span: &Span, items: &[Item]) -> Self {
        let count = if items.len() > 2 * MOST_BINS { MOST_BINS } else { MOST_BINS / 2 };
        let scale = |edge: f32| match count as f32 * WITHIN / edge {
            scale if scale < f32::INFINITY => scale,
            _ => 0.0,
        };
        let [x, y, z] = span.centers.edges().map(scale);
        let mut bins = Bins {
            count,
            origin: span.centers.0,
            scale: Float8::new([x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0]),
            bounds: [[Bounds::NOTHING; 3]; MOST_BINS],
            items: [[0; 3]; MOST_BINS],
        };
        for item in items {
            let at = ((item.center().0 - bins.origin) * bins.scale).fast_trunc_int().to_array();
            for (axis, at) in at.into_iter().enumerate().take(3) {
                let bin = at as usize % MOST_BINS;
                bins.bounds[bin][axis] = bins.bounds[bin][axis].join(item.bounds());
                bins.items[bin][axis] += 1;
            }
        }
        bins
    }

    /// Where both sides together cost least, if there is such a place.
    fn best(&self) -> Option<Cut> {
        let (mut best, mut least) = (None, f32::INFINITY);
        for axis in 0..3 {
            let mut after = [(f32::INFINITY, Bounds::NOTHING); MOST_BINS];
            let (mut around, mut items) = (Bounds::NOTHING, 0);
            for bin in (1..self.count).rev() {
                around = around.join(self.bounds[bin][axis]);
                items += self.items[bin][axis];
                if items > 0 {
                    after[bin] = (around.half_area() * items as f32, around);
                }
            }
            (around, items) = (Bounds::NOTHING, 0);
            for (bin, (right, beyond)) in after.iter().enumerate().take(self.count).skip(1) {
                around = around.join(self.bounds[bin - 1][axis]);
                items += self.items[bin - 1][axis];
                let both = around.half_area() * items as f32 + right;
                if items > 0 && both < least {
                    (best, least) = (Some((axis, bin, [around, *beyond])), both);
                }
            }
        }
        let (axis, bin, bounds) = best?;
        let (origin, scale) = (self.origin.as_array()[axis], self.scale.as_array()[axis]);
        Some(Cut { axis, origin, scale, bin: bin as f32, bounds })
    }
}

/// A cut between two bins of an axis.
struct Cut {
    axis: usize,
    origin: f32,
    scale: f32,
    /// The first bin right of it.
    bin: f32,
    /// Around the items of each side.
    bounds: [Bounds; 2],
}

impl Cut {
    /// Puts the items of the left side first: how many those are, and what is around the centres of each side. Without
    /// branches, which nobody could foretell: every item changes places with the first of the right side.
    fn part(&self, items: &mut [Item]) -> (usize, [Bounds; 2]) {
        const AWAY: [f32; 2] = [0.0, f32::INFINITY];
        let (mut left, mut centers) = (0, [Bounds::NOTHING; 2]);
        for next in 0..items.len() {
            let item = items[next];
            let is_left = (item.center_on(self.axis) - self.origin) * self.scale < self.bin;
            items.swap(left, next);
            left += usize::from(is_left);
            let center = item.center().0;
            centers[0] = centers[0].join(Bounds(center + float8(AWAY[usize::from(!is_left)])));
            centers[1] = centers[1].join(Bounds(center + float8(AWAY[usize::from(is_left)])));
        }
        (left, centers)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn is_within(inner: &Bounds, outer: &Bounds) -> bool {
        let ([a, b], [c, d]) = (inner.corners(), outer.corners());
        (0..3).all(|axis| c[axis] <= a[axis] && b[axis] <= d[axis])
    }

    /// Cuts spans down to their leaves: the counts of those.
    fn cut_down(items: &mut [Item], span: Span) -> Vec<usize> {
        assert!(items[span.first..][..span.count].iter().all(|item| is_within(&item.bounds(), &span.bounds)));
        if span.leaf.is_some() {
            return vec![span.count];
        }
        let [a, b] = span.split(items);
        assert!(a.count > 0 && b.count > 0 && a.count + b.count == span.count);
        assert_eq!([a.first, b.first], [span.first, span.first + a.count]);
        assert!(is_within(&a.bounds, &span.bounds) && is_within(&b.bounds, &span.bounds));
        [cut_down(items, a), cut_down(items, b)].concat()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn cuts_keep_every_part_within_its_box(
            places in prop::collection::vec((prop::array::uniform3(-4..4i8), 0..3usize, 0.0..1.0f32), 1..400),
            scale in prop::sample::select(vec![1e-38f32, 1e-20, 1.0, 1e19, 5e37]),
        ) {
            // Many places are taken more than once, and areas reach from nothing to infinity.
            let item = |(index, (place, kind, size)): (usize, &([i8; 3], usize, f32))| {
                let low = place.map(|x| f32::from(x) * scale);
                let kind = [Kind::Sphere, Kind::Triangle, Kind::Quad][*kind];
                Item::new(kind, index, low, low.map(|x| x + size * scale))
            };
            let mut items: Vec<Item> = places.iter().enumerate().map(item).collect();
            let root = Span::new(&items, 0, items.len());
            let leaves = cut_down(&mut items, root);
            prop_assert_eq!(leaves.iter().sum::<usize>(), places.len());
            prop_assert!(leaves.iter().all(|count| (1..=MOST_ROWS).contains(count)));
            let mut seen: Vec<u32> = items.iter().map(Item::index).collect();
            seen.sort_unstable();
            prop_assert!(seen.into_iter().eq(0..places.len() as u32));
            let kinds = |item: &Item| [Kind::Sphere, Kind::Triangle, Kind::Quad][places[item.index() as usize].1];
            prop_assert!(items.iter().all(|item| item.kind() == kinds(item)));
        }
    }

    #[test]
    fn parts_that_lie_apart_are_cut_between() {
        let item = |index: usize| {
            let x = index as f32 + if index.is_multiple_of(3) { 1e4 } else { 0.0 };
            Item::new(Kind::Sphere, index, [x, 0.0, 0.0], [x + 1.0, 1.0, 1.0])
        };
        let mut items: Vec<Item> = (0..300).map(item).collect();
        let [near, far] = Span::new(&items, 0, items.len()).split(&mut items);
        assert_eq!([near.count, far.count], [200, 100]);
        assert!(items[..200].iter().all(|item| item.index() % 3 != 0));
        assert_eq!(near.bounds.corners(), [[1.0, 0.0, 0.0], [300.0, 1.0, 1.0]]);
    }
}
