//! Polygons, convex or concave, as one outline.

use glam::{DVec2, DVec3};

use super::line::{Line, Root, Roots, Surface};
use super::margin::ratio;
use super::plane::Plane;
use crate::scene;

/// A polygon in the plane through its first corner.
#[derive(Debug, Clone)]
pub struct Polygon {
    plane: Plane,
    corners: Vec<DVec3>,
    uvs: Vec<DVec2>,
    normals: Vec<DVec3>,
}

impl Polygon {
    pub fn new(polygon: &scene::Polygon, origin: DVec3) -> Polygon {
        let corners: Vec<DVec3> = polygon.corners.iter().map(|corner| *corner - origin).collect();
        // A polygon without corners is no valid one; with a normal of zero it is never met.
        let (point, normal) = corners.first().map_or_else(Default::default, |first| (*first, polygon.normal()));
        let warp = corners.iter().map(|corner| normal.dot(*corner - point).abs()).fold(0.0, f64::max);
        let plane = Plane { point, normal, warp };
        Polygon { plane, corners, uvs: polygon.uvs.clone(), normals: polygon.normals.clone() }
    }

    fn edges(&self) -> impl Iterator<Item = (DVec3, DVec3)> {
        self.corners.iter().copied().zip(self.corners.iter().copied().cycle().skip(1))
    }

    pub fn roots(&self, line: &Line) -> Roots {
        let Some(root) = self.plane.root(line) else { return [None, None] };
        let inside = self.surrounds(line);
        if !line.judged {
            return [inside.then_some(root), None];
        }
        let clearance = self.clearance(line);
        let margin = root.margin.min(if inside { clearance } else { -clearance });
        [Some(Root { hit: root.hit && inside, margin, ..root }), None]
    }

    /// Whether the outline, seen along the line, goes around it or touches it.
    ///
    /// Counts how often the outline winds about the line: every edge that changes sides of a plane
    /// through the line passes it on the left or on the right. Which side a corner is on depends on
    /// the corner alone, and an edge walked backwards passes on exactly the other hand, so the
    /// windings of neighbours add up to that of their union to the last bit: no line slips through
    /// between two polygons that share an edge, whatever the rounding.
    ///
    /// The hand is the sign of d . (a x b), the side product of Plücker coordinates, written with
    /// (a + b) x (b - a) = 2 a x b: this keeps its sign symmetric, and its error is that of one
    /// distance times the edge instead of two distances. Source of the count: Alciatore and Miranda,
    /// "A winding number and point-in-polygon algorithm", Colorado State University, 1995.
    fn surrounds(&self, line: &Line) -> bool {
        let (o, d) = (line.origin, line.dir);
        let side_normal = perpendicular(d);
        let side = |corner: DVec3| side_normal.dot(corner - o);
        let mut windings = 0;
        let mut from = side(self.corners[self.corners.len() - 1]);
        for (i, b) in self.corners.iter().copied().enumerate() {
            let to = side(b);
            let (up, crosses) = (to >= 0.0, (from >= 0.0) != (to >= 0.0));
            if crosses || from == 0.0 || to == 0.0 {
                let a = self.corners[(i + self.corners.len() - 1) % self.corners.len()];
                let hand = d.dot(((a - o) + (b - o)).cross(b - a));
                if hand == 0.0 && (a - o).cross(d).dot((b - o).cross(d)) <= 0.0 {
                    return true; // the line touches the edge
                }
                if crosses && up && hand > 0.0 {
                    windings += 1;
                } else if crosses && !up && hand < 0.0 {
                    windings -= 1;
                }
            }
            from = to;
        }
        windings != 0
    }

    /// The distance at which the line passes the outline, over the f32 error of the outline there.
    ///
    /// The error of a kernel that projects the corners along the ray: u |corner - origin|, and what
    /// storing and subtracting cost. (NUMERICS allows the product of two such distances over the
    /// edge's length, which for a small polygon far away would excuse anything.)
    fn clearance(&self, line: &Line) -> f64 {
        let (o, length) = (line.origin, line.dir.length());
        // A quarter turn about the line changes no distance from it.
        let seen = |corner: DVec3| (corner - o).cross(line.dir) / length;
        let error = |corner: DVec3| 2.0 * line.u * corner.distance(o) + line.anchor_error(corner).length();
        let pass = |(a, b): (DVec3, DVec3)| ratio(segment_distance(seen(a), seen(b)), error(a).max(error(b)));
        self.edges().map(pass).fold(f64::INFINITY, f64::min)
    }

    pub fn surface(&self, line: &Line, root: &Root) -> Surface {
        let n = self.plane.normal;
        let x = self.plane.offset(line, root.t);
        let point = self.plane.point + x;
        let size = self.corners.iter().map(|corner| (*corner - self.plane.point).abs().max_element());
        let reach = size.fold(x.abs().max_element(), f64::max);
        let edge = (self.corners[1] - self.corners[0]).normalize();
        let mut surface = Surface::flat(point, n, DVec2::new(x.dot(edge), x.dot(n.cross(edge))), reach);
        if self.uvs.is_empty() && self.normals.is_empty() {
            return surface;
        }
        let weights = self.mean_values(x);
        if !self.uvs.is_empty() {
            surface.uv = self.uvs.iter().zip(&weights).map(|(uv, weight)| *uv * *weight).sum();
        }
        if !self.normals.is_empty() {
            let sum: DVec3 = self.normals.iter().zip(&weights).map(|(normal, weight)| *normal * *weight).sum();
            let unit = sum.normalize_or(n);
            surface.shading_normal = if unit.dot(n) < 0.0 { -unit } else { unit };
        }
        surface
    }

    /// The mean value coordinates of the place `x` from the first corner: one weight a corner, sum 1.
    ///
    /// Weight i is `(tan(left/2) + tan(right/2)) / r_i` with the angles that the two edges of corner i
    /// subtend. Source: Hormann and Floater, 2006 (see [`scene::Polygon`]), section 4.
    fn mean_values(&self, x: DVec3) -> Vec<f64> {
        let count = self.corners.len();
        let spokes: Vec<DVec3> = self.corners.iter().map(|corner| (*corner - self.plane.point) - x).collect();
        let radii: Vec<f64> = spokes.iter().map(|spoke| spoke.length()).collect();
        let mut weights = vec![0.0; count];
        if let Some(here) = radii.iter().position(|radius| *radius == 0.0) {
            weights[here] = 1.0;
            return weights;
        }
        let mut tangents = vec![0.0; count];
        for i in 0..count {
            let next = (i + 1) % count;
            let area = self.plane.normal.dot(spokes[i].cross(spokes[next]));
            let (rr, dot) = (radii[i] * radii[next], spokes[i].dot(spokes[next]));
            if area == 0.0 && dot < 0.0 {
                // On the edge the angle is half a turn: linear between its ends.
                weights[i] = radii[next] / (radii[i] + radii[next]);
                weights[next] = radii[i] / (radii[i] + radii[next]);
                return weights;
            }
            // Of two forms of the half angle's tangent, the one that does not cancel.
            tangents[i] = if dot > 0.0 { area / (rr + dot) } else { (rr - dot) / area };
        }
        for i in 0..count {
            weights[i] = (tangents[(i + count - 1) % count] + tangents[i]) / radii[i];
        }
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= sum);
        weights
    }
}

/// A vector across `d`, exactly so: the two larger components swapped, one of them negated.
fn perpendicular(d: DVec3) -> DVec3 {
    let size = d.abs();
    if size.x <= size.y && size.x <= size.z {
        DVec3::new(0.0, d.z, -d.y)
    } else if size.y <= size.z {
        DVec3::new(d.z, 0.0, -d.x)
    } else {
        DVec3::new(d.y, -d.x, 0.0)
    }
}

/// The distance from 0 to the segment from `a` to `b`.
fn segment_distance(a: DVec3, b: DVec3) -> f64 {
    let edge = b - a;
    let part = ratio(-a.dot(edge), edge.length_squared()).clamp(0.0, 1.0);
    (a + part * edge).length()
}
