//! Whether the edges of a closed line in the plane meet anywhere but at shared corners.
//!
//! A tree of bounds over runs of edges: neighbours along the line are neighbours in the plane, so runs
//! make good nodes without any sorting. Bounds are octagons (x, y, x + y, x - y), since the boxes of
//! long slanted edges side by side would all overlap.

use glam::DVec2;

/// Edges of a leaf.
const LEAF: usize = 8;

/// The first corners of two edges that meet without being neighbours, or `None` for a simple polygon.
/// Edge `i` goes from corner `i` to the next one; no two neighbours may be the same point.
pub fn meeting_edges(corners: &[DVec2]) -> Option<(usize, usize)> {
    let mut tree = Tree { corners, nodes: Vec::new() };
    let root = tree.build(0, corners.len());
    tree.within(root)
}

/// Least and greatest x, y, x + y, x - y.
#[derive(Clone, Copy)]
struct Octagon {
    low: [f64; 4],
    high: [f64; 4],
}

struct Node {
    bounds: Octagon,
    start: usize,
    end: usize,
    /// Both halves; none in a leaf.
    halves: Option<(usize, usize)>,
}

struct Tree<'a> {
    corners: &'a [DVec2],
    nodes: Vec<Node>,
}

impl Octagon {
    const EMPTY: Octagon = Octagon { low: [f64::INFINITY; 4], high: [f64::NEG_INFINITY; 4] };

    fn with(mut self, p: DVec2) -> Self {
        for (k, along) in [p.x, p.y, p.x + p.y, p.x - p.y].into_iter().enumerate() {
            self.low[k] = self.low[k].min(along);
            self.high[k] = self.high[k].max(along);
        }
        self
    }

    fn meets(&self, other: &Octagon) -> bool {
        (0..4).all(|k| self.low[k] <= other.high[k] && other.low[k] <= self.high[k])
    }
}

impl Tree<'_> {
    fn edge(&self, i: usize) -> (DVec2, DVec2) {
        (self.corners[i], self.corners[(i + 1) % self.corners.len()])
    }

    fn build(&mut self, start: usize, end: usize) -> usize {
        let halves = (end - start > LEAF).then(|| {
            let middle = start + (end - start) / 2;
            (self.build(start, middle), self.build(middle, end))
        });
        let points = (start..=end).map(|i| self.corners[i % self.corners.len()]);
        let bounds = points.fold(Octagon::EMPTY, Octagon::with);
        self.nodes.push(Node { bounds, start, end, halves });
        self.nodes.len() - 1
    }

    /// A meeting among the edges of one node.
    fn within(&self, node: usize) -> Option<(usize, usize)> {
        let Node { start, end, halves, .. } = self.nodes[node];
        match halves {
            Some((a, b)) => self.within(a).or_else(|| self.within(b)).or_else(|| self.between(a, b)),
            None => (start..end).find_map(|i| self.against(i, i + 1, end)),
        }
    }

    /// A meeting of an edge of one node with an edge of another.
    fn between(&self, a: usize, b: usize) -> Option<(usize, usize)> {
        let (first, second) = (&self.nodes[a], &self.nodes[b]);
        if !first.bounds.meets(&second.bounds) {
            return None;
        }
        match (first.halves, second.halves) {
            (None, None) => (first.start..first.end).find_map(|i| self.against(i, second.start, second.end)),
            (Some((left, right)), None) => self.between(left, b).or_else(|| self.between(right, b)),
            (None, Some((left, right))) => self.between(a, left).or_else(|| self.between(a, right)),
            (Some((left, right)), Some(_)) if first.end - first.start >= second.end - second.start => {
                self.between(left, b).or_else(|| self.between(right, b))
            }
            (Some(_), Some((left, right))) => self.between(a, left).or_else(|| self.between(a, right)),
        }
    }

    /// A meeting of edge `i` with one of the edges `start..end`, its neighbours apart.
    fn against(&self, i: usize, start: usize, end: usize) -> Option<(usize, usize)> {
        let n = self.corners.len();
        let strangers = (start..end).filter(|j| *j != i && (i + 1) % n != *j && (j + 1) % n != i);
        strangers.into_iter().find(|j| meet(self.edge(i), self.edge(*j))).map(|j| (i.min(j), i.max(j)))
    }
}

/// Whether two closed segments have a point in common.
fn meet((a, b): (DVec2, DVec2), (c, d): (DVec2, DVec2)) -> bool {
    let sides = [side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)];
    if sides[0] * sides[1] < 0 && sides[2] * sides[3] < 0 {
        return true;
    }
    let touches = [(a, b, c), (a, b, d), (c, d, a), (c, d, b)];
    touches.iter().zip(sides).any(|((a, b, p), side)| side == 0 && between(*a, *b, *p))
}

/// -1, 0 or 1: on which side of the line `ab` the point `p` is, 0 within rounding of the products.
fn side(a: DVec2, b: DVec2, p: DVec2) -> i32 {
    let (u, v) = (b - a, p - a);
    let (left, right) = (u.x * v.y, u.y * v.x);
    match left - right {
        det if det.abs() <= 4.0 * f64::EPSILON * (left.abs() + right.abs()) => 0,
        det => det.signum() as i32,
    }
}

/// Whether `p`, on the line `ab`, is within the box of `ab`.
fn between(a: DVec2, b: DVec2, p: DVec2) -> bool {
    a.min(b).cmple(p).all() && p.cmple(a.max(b)).all()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The tree against all pairs, on closed lines of seeded corners that a small grid lets touch often.
    #[test]
    fn the_tree_finds_what_all_pairs_find() {
        let mut state = 0x5eed_u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let (mut simple, mut crossed) = (0, 0);
        for round in 0..4_000 {
            let n = 3 + round % 40;
            let jitter = if round % 2 == 0 { 100 } else { 2 };
            let corners: Vec<_> = (0..n)
                .map(|i| {
                    let (sin, cos) = (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
                    let around = DVec2::new((1000.0 * cos).round(), (1000.0 * sin).round());
                    around + DVec2::new(random(jitter * 8) as f64, random(jitter * 8) as f64)
                })
                .collect();
            let tree = Tree { corners: &corners, nodes: Vec::new() };
            let all = (0..n).find_map(|i| tree.against(i, 0, n));
            let found = meeting_edges(&corners);
            assert_eq!(found.is_some(), all.is_some(), "{corners:?}");
            if let Some((i, j)) = found {
                assert!(meet(tree.edge(i), tree.edge(j)));
                crossed += 1;
            } else {
                simple += 1;
            }
        }
        assert!(simple > 500 && crossed > 500, "{simple} {crossed}");
    }
}
