//! The rules of polygons: corners dropped where they add nothing, then area, planarity, simplicity.

use glam::{DVec2, DVec3};

use super::{Broken, Rule, point, simple};
use crate::scene::Polygon;

/// Most corners of one polygon.
pub const MOST_CORNERS: usize = 65_535;
/// Largest distance of a corner from the plane, in sizes of the polygon.
const FLATNESS: f64 = 1e-4;
/// A corner nearer than this to the line through its neighbours, in sizes of the polygon, is on it.
const STRAIGHTNESS: f64 = 1e-12;

/// Checks how many corners a polygon has, before any is read.
///
/// # Errors
/// Fewer than 3, or more than [`MOST_CORNERS`].
pub fn count(corners: usize) -> Result<(), Broken> {
    match corners {
        3..=MOST_CORNERS => Ok(()),
        _ => Err(broken("must have 3 to 65535 corners", format!("{corners}"))),
    }
}

/// Checks a polygon that is said to be clean.
///
/// # Errors
/// As [`clean`], and a corner that should have been dropped.
pub fn check(polygon: &Polygon) -> Result<(), Broken> {
    let (_, dropped) = clean(polygon.clone())?;
    match dropped.first() {
        None => Ok(()),
        Some(corner) => Err(broken("must not repeat corners or have three in line", format!("corner {corner}"))),
    }
}

/// Drops corners that repeat a neighbour or are in line with both, then checks what is left. Gives back
/// the polygon and the indices of the dropped corners, ascending.
///
/// # Errors
/// A count of corners out of 3 to 65,535; `uvs` or `normals` that are not one a corner; a coordinate out
/// of range; no area; a corner off the plane of Newell's normal through the mean of the corners; edges
/// that cross or touch.
pub fn clean(polygon: Polygon) -> Result<(Polygon, Vec<usize>), Broken> {
    count(polygon.corners.len())?;
    one_a_corner(&polygon, "uvs", polygon.uvs.len())?;
    one_a_corner(&polygon, "normals", polygon.normals.len())?;
    polygon.corners.iter().try_for_each(|corner| point("polygon", "corners", *corner))?;
    for x in polygon.uvs.iter().flat_map(|uv| uv.to_array()) {
        super::number("polygon", "uvs", x, Rule::COORDINATE)?;
    }
    polygon.normals.iter().try_for_each(|normal| super::direction("polygon", "normals", *normal))?;

    let size = extent(&polygon.corners);
    let kept = needed(&polygon.corners, size);
    let mut left = Polygon { corners: pick(&polygon.corners, &kept), ..Polygon::default() };
    if left.corners.len() < 3 || area(&left.corners) <= STRAIGHTNESS * size * size {
        return Err(broken("must have an area", "none: its corners are in line or cancel out".to_owned()));
    }
    flat(&left, &kept, size)?;
    if let Some((a, b)) = simple::meeting_edges(&flattened(&left)) {
        let found = format!("the edges from corner {} and from corner {} meeting (the first is 0)", kept[a], kept[b]);
        return Err(broken("must not cross or touch itself", found));
    }
    if !polygon.uvs.is_empty() {
        left.uvs = pick(&polygon.uvs, &kept);
    }
    if !polygon.normals.is_empty() {
        left.normals = pick(&polygon.normals, &kept);
    }
    let mut keep = vec![false; polygon.corners.len()];
    kept.iter().for_each(|corner| keep[*corner] = true);
    Ok((left, (0..keep.len()).filter(|corner| !keep[*corner]).collect()))
}

/// What a warning says about dropped corners.
pub fn dropped_text(dropped: &[usize]) -> String {
    let some: Vec<_> = dropped.iter().take(5).map(usize::to_string).collect();
    let (corners, are) = if dropped.len() == 1 { ("corner", "is") } else { ("corners", "are") };
    let more = if dropped.len() > some.len() { ", ..." } else { "" };
    format!("polygon {corners} {}{more} repeated or in line with both neighbours {are} dropped", some.join(", "))
}

fn broken(text: &str, found: String) -> Broken {
    Broken { key: "corners", rule: format!("polygon {text}").into(), found }
}

fn one_a_corner(polygon: &Polygon, key: &'static str, len: usize) -> Result<(), Broken> {
    let corners = polygon.corners.len();
    if len == 0 || len == corners {
        return Ok(());
    }
    let rule = format!("polygon {key} must be one for each of its {corners} corners");
    Err(Broken { key, rule: rule.into(), found: len.to_string() })
}

fn pick<T: Copy>(all: &[T], kept: &[usize]) -> Vec<T> {
    kept.iter().map(|i| all[*i]).collect()
}

/// The longest side of the bounding box.
fn extent(corners: &[DVec3]) -> f64 {
    let low = corners.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = corners.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    (high - low).max_element()
}

/// The corners that shape the polygon, ascending. Dropping one may put its neighbours in line with
/// theirs, so a corner is looked at again whenever a neighbour goes.
fn needed(corners: &[DVec3], size: f64) -> Vec<usize> {
    let n = corners.len();
    let largest = corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
    let near = STRAIGHTNESS * size + 4.0 * f64::EPSILON * largest;
    let mut next: Vec<usize> = (0..n).map(|i| (i + 1) % n).collect();
    let mut previous: Vec<usize> = (0..n).map(|i| (i + n - 1) % n).collect();
    let (mut alive, mut left) = (vec![true; n], n);
    let mut open: Vec<usize> = (0..n).rev().collect();
    while let Some(i) = open.pop() {
        let (a, b) = (previous[i], next[i]);
        if alive[i] && left > 2 && on_line(corners[a], corners[i], corners[b], near) {
            (alive[i], next[a], previous[b]) = (false, b, a);
            left -= 1;
            open.extend([b, a]);
        }
    }
    (0..n).filter(|i| alive[*i]).collect()
}

/// Whether `x` is no farther than `near` from `a`, from `b` or from the line through both.
fn on_line(a: DVec3, x: DVec3, b: DVec3, near: f64) -> bool {
    let (ax, ab) = (x - a, b - a);
    let off = if ab.length() > near { ax.cross(ab).length() / ab.length() } else { 0.0 };
    off <= near || ax.length() <= near || (b - x).length() <= near
}

fn newell(corners: &[DVec3]) -> DVec3 {
    let origin = corners[0];
    let pairs = corners.iter().zip(corners.iter().cycle().skip(1));
    pairs.map(|(a, b)| (*a - origin).cross(*b - origin)).sum()
}

fn area(corners: &[DVec3]) -> f64 {
    newell(corners).length() / 2.0
}

fn flat(polygon: &Polygon, kept: &[usize], size: f64) -> Result<(), Broken> {
    let (normal, corners) = (polygon.normal(), &polygon.corners);
    let origin = corners[0];
    let mean = corners.iter().map(|corner| *corner - origin).sum::<DVec3>() / corners.len() as f64;
    let largest = corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max) as f32;
    let ulp = f64::from(largest.next_up() - largest);
    let (mut far, mut worst) = (0.0, 0);
    for (i, corner) in corners.iter().enumerate() {
        let off = normal.dot(*corner - origin - mean).abs();
        if off > far {
            (far, worst) = (off, i);
        }
    }
    if far <= (FLATNESS * size).max(4.0 * ulp) {
        return Ok(());
    }
    let found =
        format!("corner {} (the first is 0) {} off its plane", kept[worst], super::show((far * 1e6).round() / 1e6));
    Err(broken("must be flat to 1e-4 of its size", found))
}

/// The corners without the coordinate in which the polygon extends least, exactly.
fn flattened(polygon: &Polygon) -> Vec<DVec2> {
    let n = polygon.normal().abs();
    let drop = |corner: &DVec3| match n.max_element() {
        most if most == n.x => DVec2::new(corner.y, corner.z),
        most if most == n.y => DVec2::new(corner.z, corner.x),
        _ => DVec2::new(corner.x, corner.y),
    };
    polygon.corners.iter().map(drop).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(points: &[[f64; 2]]) -> Polygon {
        let corners = points.iter().map(|[x, y]| DVec3::new(*x, *y, 2.0)).collect();
        Polygon { corners, ..Polygon::default() }
    }

    /// A ring of `n` corners, every other one pulled in.
    fn star(n: usize, inner: f64) -> Polygon {
        let corner = |i: usize| {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
            let r = if i.is_multiple_of(2) { 1.0 } else { inner };
            [r * cos, r * sin]
        };
        polygon(&(0..n).map(corner).collect::<Vec<_>>())
    }

    #[test]
    fn useless_corners_go_with_their_uvs_and_normals() {
        let mut square = polygon(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [2.0, 2.0], [0.0, 2.0], [0.0, 1.0]]);
        square.uvs = square.corners.iter().map(|corner| DVec2::new(corner.x, corner.y)).collect();
        square.normals = (1..8).map(|i| DVec3::Z * f64::from(i)).collect();
        let (clean, dropped) = clean(square.clone()).unwrap();
        assert_eq!(dropped, [1, 3, 6]);
        let left = [0, 2, 4, 5];
        assert_eq!(clean.corners, left.map(|i| square.corners[i]));
        assert_eq!(clean.uvs, left.map(|i| square.uvs[i]));
        assert_eq!(clean.normals, left.map(|i| square.normals[i]));
        assert!(check(&clean).is_ok() && check(&square).is_err());
    }

    #[test]
    fn a_spike_without_area_is_dropped() {
        let (clean, dropped) =
            clean(polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 1.0], [0.5, 3.0], [0.5, 1.0], [0.0, 1.0]]))
                .unwrap();
        assert_eq!((clean.corners.len(), dropped.len()), (4, 3));
    }

    #[test]
    fn broken_polygons_say_what_is_wrong() {
        let rule = |points: &[[f64; 2]]| clean(polygon(points)).unwrap_err().rule;
        assert!(rule(&[[0.0, 0.0], [1.0, 1.0]]).contains("3 to 65535"));
        assert!(rule(&[[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]]).contains("area"));
        assert!(rule(&[[5.0, 5.0]; 6]).contains("area"));
        assert!(rule(&[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]]).contains("area"), "both halves cancel");
        assert!(rule(&[[0.0, 0.0], [3.0, 3.0], [3.0, 0.0], [0.0, 2.0]]).contains("cross"));
        assert!(rule(&[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.0], [0.0, 2.0]]).contains("touch"));
        assert!(rule(&[[f64::NAN, 0.0], [2.0, 0.0], [2.0, 2.0]]).contains("finite"));
        assert!(rule(&[[2e15, 0.0], [2.0, 0.0], [2.0, 2.0]]).contains("1e15"));
    }

    #[test]
    fn flatness_is_judged_by_size_and_by_coordinates() {
        let bent = |shift: f64, height: f64| {
            let mut square = polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
            square.corners[2].z += height;
            square.corners.iter_mut().for_each(|corner| *corner += DVec3::splat(shift));
            clean(square).map(|_| ())
        };
        // A quarter of the bend is what Newell's plane through the mean leaves at each corner.
        assert!(bent(0.0, 3.9e-4).is_ok());
        let far = bent(0.0, 4.1e-4).unwrap_err();
        assert!(far.rule.contains("flat") && far.found.contains("0.000102"), "{far:?}");
        // At 10,000 an f32 has steps of 0.001: four of them excuse 0.004.
        assert!(bent(10_000.0, 0.015).is_ok());
        assert!(bent(10_000.0, 0.017).is_err());
    }

    #[test]
    fn the_largest_polygons_are_checked_fast() {
        let start = std::time::Instant::now();
        let (whole, dropped) = clean(star(65_534, 0.5)).unwrap();
        assert_eq!((whole.corners.len(), dropped.len()), (65_534, 0));
        // A comb of slanted teeth: all bounding boxes along x and y overlap.
        let teeth = 32_000;
        let x = |i: usize| i as f64 / teeth as f64;
        let top = (0..teeth).flat_map(|i| [[x(i), 0.0], [x(i) + 1.0 + 0.4 / teeth as f64, 1.0]]);
        let comb: Vec<_> = top.chain([[5.0, -1.0], [-5.0, -1.0]]).collect();
        assert!(clean(polygon(&comb)).is_ok());
        let mut crossed = comb;
        crossed.swap(30_000, 30_002);
        assert!(clean(polygon(&crossed)).unwrap_err().rule.contains("cross"));
        // Seconds would do; minutes are what must not happen.
        assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
        assert_eq!(clean(star(65_536, 0.5)).unwrap_err().found, "65536");
    }
}
