//! Polygons into convex pieces of at most eight corners. All corners of the pieces are corners of the
//! polygon, so that neighbours share their end points to the bit.

use glam::DVec3;

use crate::scene::split::triangles;

/// Most corners of a piece.
const MOST: usize = 8;

/// The polygon itself where it is convex and small, else fans of a convex one or triangles of a concave
/// one; all in the polygon's own sense of rotation. `normal` is the polygon's, of unit length.
pub(super) fn convex_pieces(corners: &[DVec3], normal: DVec3) -> Vec<Vec<DVec3>> {
    if is_convex(corners, normal) { fans(corners) } else { triangles(corners, normal) }
}

fn is_convex(corners: &[DVec3], normal: DVec3) -> bool {
    let n = corners.len();
    let turn = |i: usize| {
        let (a, b, c) = (corners[i], corners[(i + 1) % n], corners[(i + 2) % n]);
        (b - a).cross(c - b).dot(normal)
    };
    n == 3 || ((0..n).all(|i| turn(i) >= 0.0) && turns_once(corners, normal))
}

/// Whether the corners go round once: a star turns the same way everywhere, but twice round.
fn turns_once(corners: &[DVec3], normal: DVec3) -> bool {
    let a = corners[0];
    corners[1..].windows(2).all(|edge| (edge[0] - a).cross(edge[1] - a).dot(normal) >= 0.0)
}

fn fans(corners: &[DVec3]) -> Vec<Vec<DVec3>> {
    let step = MOST - 2;
    let starts = (1..corners.len() - 1).step_by(step);
    let fan = |first: usize| {
        let last = (first + step).min(corners.len() - 1);
        std::iter::once(corners[0]).chain(corners[first..=last].iter().copied()).collect()
    };
    starts.map(fan).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(pieces: &[Vec<DVec3>], normal: DVec3) -> f64 {
        let fan = |p: &Vec<DVec3>| p[1..].windows(2).map(|e| (e[0] - p[0]).cross(e[1] - p[0])).sum::<DVec3>();
        pieces.iter().map(|p| fan(p).dot(normal) / 2.0).sum()
    }

    fn star(points: usize, inner: f64) -> Vec<DVec3> {
        let corner = |k: usize| {
            let angle = k as f64 * std::f64::consts::PI / points as f64;
            let r = if k.is_multiple_of(2) { 1.0 } else { inner };
            DVec3::new(r * angle.cos(), r * angle.sin(), 3.0)
        };
        (0..2 * points).map(corner).collect()
    }

    #[test]
    fn pieces_cover_the_polygon_and_are_convex() {
        let sizes = [(3, 0.4), (5, 0.5), (72, 0.9), (4, (std::f64::consts::PI / 4.0).cos()), (16, 0.999)];
        for (points, inner) in sizes {
            let corners = star(points, inner);
            let want = points as f64 * inner * (std::f64::consts::PI / points as f64).sin();
            let pieces = convex_pieces(&corners, DVec3::Z);
            assert!((area(&pieces, DVec3::Z) - want).abs() < 1e-12, "{points}");
            assert!(pieces.iter().all(|p| (3..=MOST).contains(&p.len()) && is_convex(p, DVec3::Z)), "{points}");
        }
    }

    #[test]
    fn a_large_convex_polygon_becomes_fans() {
        let corners: Vec<DVec3> = star(50, 1.0);
        assert_eq!(convex_pieces(&corners, DVec3::Z).len(), 98usize.div_ceil(6));
    }
}
