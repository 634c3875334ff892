//! Texture coordinates and shading normals of single hit points, in f64.

use glam::{DVec2, DVec3};

use crate::plan::{Owner, Plan};
use crate::scene::{Polygon, Shape};
use crate::shapes::{RowRef, Stores};

/// Texture coordinates of a point, relative to the plan's origin, on a row of the stores.
pub fn uv(plan: &Plan, stores: &Stores, row: RowRef, owner: Owner, point: DVec3) -> DVec2 {
    match polygon(plan, owner).filter(|polygon| !polygon.uvs.is_empty()) {
        None => stores.uv(row, point).unwrap_or_default(),
        Some(polygon) => {
            let weights = mean_value_weights(polygon, point + plan.origin);
            polygon.uvs.iter().zip(weights).map(|(uv, weight)| *uv * weight).sum()
        }
    }
}

/// The interpolated normal of a polygon with normals, of unit length.
pub fn shading_normal(plan: &Plan, owner: Owner, point: DVec3) -> Option<DVec3> {
    let polygon = polygon(plan, owner).filter(|polygon| !polygon.normals.is_empty())?;
    let weights = mean_value_weights(polygon, point + plan.origin);
    let sum: DVec3 = polygon.normals.iter().zip(weights).map(|(normal, weight)| *normal * weight).sum();
    sum.try_normalize()
}

fn polygon<'s>(plan: &Plan<'s>, owner: Owner) -> Option<&'s Polygon> {
    match &plan.scene.objects.get(owner.primitive as usize)?.shape {
        Shape::Polygon(polygon) => Some(polygon),
        _ => None,
    }
}

/// Mean value coordinates of a point in a polygon: they sum to 1, and in a triangle they are barycentric.
///
/// Source: Hormann and Floater, "Mean value coordinates for arbitrary planar polygons", ACM Transactions
/// on Graphics 25(4), 2006, section 5.
fn mean_value_weights(polygon: &Polygon, point: DVec3) -> Vec<f64> {
    let n = polygon.corners.len();
    let normal = polygon.normal();
    let spoke: Vec<DVec3> = polygon.corners.iter().map(|corner| *corner - point).collect();
    let next = |i: usize| (i + 1) % n;
    let area: Vec<f64> = (0..n).map(|i| spoke[i].cross(spoke[next(i)]).dot(normal)).collect();
    if n == 3 {
        let whole: f64 = area.iter().sum();
        return (0..3).map(|i| area[next(i)] / whole).collect();
    }
    let length: Vec<f64> = spoke.iter().map(|s| s.length()).collect();
    if let Some(corner) = length.iter().position(|length| *length == 0.0) {
        return (0..n).map(|i| f64::from(u8::from(i == corner))).collect();
    }
    let dot = |i: usize| spoke[i].dot(spoke[next(i)]);
    if let Some(edge) = (0..n).find(|i| area[*i] == 0.0 && dot(*i) < 0.0) {
        let whole = length[edge] + length[next(edge)];
        let weight = |i| match i {
            i if i == edge => length[next(edge)] / whole,
            i if i == next(edge) => length[edge] / whole,
            _ => 0.0,
        };
        return (0..n).map(weight).collect();
    }
    let half_tangent = |i: usize| match area[i] {
        0.0 => 0.0,
        area => (length[i] * length[next(i)] - dot(i)) / area,
    };
    let half: Vec<f64> = (0..n).map(half_tangent).collect();
    let weights: Vec<f64> = (0..n).map(|i| (half[(i + n - 1) % n] + half[i]) / length[i]).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Linear functions are reproduced: the defining property of such coordinates.
    #[test]
    fn weights_reproduce_the_point() {
        let star: Vec<DVec3> = (0..10)
            .map(|k| {
                let (r, angle) = (if k % 2 == 0 { 2.0 } else { 0.9 }, f64::from(k) * 0.2 * std::f64::consts::PI);
                DVec3::new(r * angle.cos(), r * angle.sin(), 0.0)
            })
            .collect();
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let triangle = square[..3].to_vec();
        for corners in [star, square.to_vec(), triangle] {
            let center = corners.iter().sum::<DVec3>() / corners.len() as f64;
            let polygon = Polygon { corners: corners.clone(), ..Polygon::default() };
            let edge = (corners[0] + corners[1]) / 2.0;
            for point in [center, edge, corners[1], center.lerp(edge, 0.999_999), center.lerp(corners[1], 0.3)] {
                let weights = mean_value_weights(&polygon, point);
                let got: DVec3 = corners.iter().zip(&weights).map(|(corner, weight)| *corner * *weight).sum();
                assert!((got - point).length() < 1e-9, "{point} {got} {weights:?}");
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }
}
