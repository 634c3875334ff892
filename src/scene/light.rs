//! Lights: sources at a point, infinitely far, or with an area.

use glam::DVec3;

use super::{Disk, Polygon, Shape, Sphere, split};

/// One light. At a surface point it gives a direction `wi` (unit, toward the light) and an irradiance
/// `E` on a plane that faces it; the materials say what they make of both.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// The user's name; may be absent.
    pub name: Option<String>,
    /// Whether anything casts a shadow in this light.
    pub shadows: bool,
    /// Kind and strength.
    pub source: Source,
}

/// Where light comes from. Colours are linear Rec. 709.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// `E = intensity / d^2`, or `E = intensity` without falloff, at distance `d`.
    Point {
        /// World coordinates.
        position: DVec3,
        /// W/sr.
        intensity: DVec3,
        /// Whether the strength falls with the distance.
        falloff: Falloff,
    },
    /// `wi = -direction`, `E = irradiance` everywhere.
    Directional {
        /// The way the light travels; not zero.
        direction: DVec3,
        /// W/m^2 on a plane that faces the light.
        irradiance: DVec3,
    },
    /// A point light times `smoothstep` of the angle from the axis: 1 within `cone - penumbra`, 0 from
    /// `cone` on, `s^2 (3 - 2 s)` with `s = (cone - angle)/penumbra` between. Falls with `d^2`.
    Spot {
        /// World coordinates.
        position: DVec3,
        /// The axis, away from the light; not zero.
        direction: DVec3,
        /// W/sr along the axis.
        intensity: DVec3,
        /// Half angle in degrees, 0 < cone <= 90.
        cone: f64,
        /// Degrees inside the cone, 0 <= penumbra <= cone.
        penumbra: f64,
    },
    /// A surface that shines, the same in all directions. It is light, not geometry: it casts no shadow,
    /// and its unlit side is not there. Rays from the camera, mirrors and glass that meet its lit side
    /// see `radiance` and end there, if it is visible.
    Area {
        /// Where it shines from.
        emitter: Emitter,
        /// W/sr/m^2.
        radiance: DVec3,
        /// Whether camera, mirrors and glass see it.
        visible: bool,
    },
}

/// The surface of an area light, and how a surface point that it lights draws a direction to it from a
/// pair (u, v) of the sample: with the density 1/solid angle from a sphere, evenly by area else.
#[derive(Debug, Clone, PartialEq)]
pub enum Emitter {
    /// Shines outward. With `w` the unit vector to the centre at distance d and `(e1, e2)` its
    /// [`frame`]: `c = 1 - u (1 - sqrt(1 - r^2/d^2))`, `wi = c w + sqrt(1 - c^2) (cos 2pi v e1 + sin 2pi v e2)`.
    ///
    /// Source: Shirley, Wang and Zimmerman, "Monte Carlo techniques for direct lighting calculations",
    /// ACM Transactions on Graphics 15(1), 1996.
    Sphere {
        /// World coordinates.
        center: DVec3,
        /// Scene units, > 0.
        radius: f64,
    },
    /// Shines where its normal points to: the point at distance `sqrt(u) radius` and angle `2 pi v` in the
    /// [`basis`](super::basis) of the unit normal.
    Disk {
        /// World coordinates.
        center: DVec3,
        /// Not zero.
        normal: DVec3,
        /// Scene units, > 0.
        radius: f64,
    },
    /// Shines to where its corners are seen counter-clockwise; see [`Patches`].
    Polygon(Polygon),
}

impl Emitter {
    /// The same as a shape, whose front is what shines.
    pub fn shape(&self) -> Shape {
        match self {
            Emitter::Sphere { center, radius } => Shape::Sphere(Sphere { center: *center, radius: *radius }),
            Emitter::Disk { center, normal, radius } => {
                Shape::Disk(Disk { center: *center, normal: *normal, radius: *radius, inner_radius: 0.0 })
            }
            Emitter::Polygon(polygon) => Shape::Polygon(polygon.clone()),
        }
    }
}

/// Two axes that with the unit vector `w` are an orthonormal basis. Unlike [`basis`](super::basis) it jumps
/// where `w.z = -0.7`, which no one aims at, not where `w.z = 0`.
pub fn frame(w: DVec3) -> (DVec3, DVec3) {
    let sign = if w.z < -0.7 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + w.z);
    let b = w.x * w.y * a;
    (DVec3::new(1.0 + sign * w.x * w.x * a, sign * b, -sign * w.x), DVec3::new(b, sign + w.y * w.y * a, -w.y))
}

/// A polygon as it is sampled: a parallelogram as such, others as triangles, chosen by area.
#[derive(Debug, Clone, PartialEq)]
pub struct Patches {
    /// A corner and two edges.
    patches: Vec<[DVec3; 3]>,
    /// Share of the area up to the end of each.
    ends: Vec<f64>,
    parallelogram: bool,
    /// Scene units squared.
    pub area: f64,
}

impl Patches {
    /// Takes a polygon of at least three corners that has an area.
    pub fn new(polygon: &Polygon) -> Self {
        let corners = &polygon.corners;
        let skew = |c: &[DVec3]| (c[0] - c[1] + c[2] - c[3]).length() <= 1e-12 * (c[2] - c[0]).length();
        let parallelogram = corners.len() == 4 && skew(corners);
        let patches: Vec<[DVec3; 3]> = match parallelogram {
            true => vec![[corners[0], corners[1] - corners[0], corners[3] - corners[0]]],
            false => split::triangles(corners, polygon.normal())
                .into_iter()
                .map(|t| [t[0], t[1] - t[0], t[2] - t[0]])
                .collect(),
        };
        let mut sum = 0.0;
        let half = if parallelogram { 1.0 } else { 0.5 };
        let sums: Vec<f64> = patches
            .iter()
            .map(|[_, a, b]| {
                sum += half * a.cross(*b).length();
                sum
            })
            .collect();
        let ends = sums.into_iter().map(|end| end / sum).collect();
        Patches { patches, ends, parallelogram, area: sum }
    }

    /// The corner and the two edges of a parallelogram.
    pub fn parallelogram(&self) -> Option<[DVec3; 3]> {
        self.parallelogram.then(|| self.patches[0])
    }

    /// The point of (u, v): u chooses the patch; what is left of it is u again within that, where the point
    /// is `corner + u a + v b` in a parallelogram and `corner + (1 - sqrt u) a + v sqrt u b` in a triangle.
    pub fn point(&self, u: f64, v: f64) -> DVec3 {
        let last = self.patches.len() - 1;
        let k = self.ends.partition_point(|end| *end <= u).min(last);
        let start = if k == 0 { 0.0 } else { self.ends[k - 1] };
        let u = ((u - start) / (self.ends[k] - start)).clamp(0.0, 1.0);
        let [corner, a, b] = self.patches[k];
        match self.parallelogram {
            true => corner + a * u + b * v,
            false => corner + a * (1.0 - u.sqrt()) + b * (v * u.sqrt()),
        }
    }
}

/// How the strength of a point light changes with distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Falloff {
    /// With the inverse square, as light does.
    #[default]
    InverseSquare,
    /// Not at all, as NFF has it.
    None,
}

impl Source {
    /// Whether it has no power.
    pub fn is_dark(&self) -> bool {
        match *self {
            Source::Point { intensity: power, .. } | Source::Spot { intensity: power, .. } => power == DVec3::ZERO,
            Source::Directional { irradiance, .. } => irradiance == DVec3::ZERO,
            Source::Area { radiance, .. } => radiance == DVec3::ZERO,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners: &[[f64; 2]]) -> Polygon {
        let corners = corners.iter().map(|[x, y]| DVec3::new(*x, *y, 1.0)).collect();
        Polygon { corners, ..Polygon::default() }
    }

    /// Points of an even grid of (u, v) have the polygon's centroid and second moment, concave or not.
    #[test]
    fn patches_are_even() {
        let square = polygon(&[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
        let bent = polygon(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]]);
        // The L is 2 x 1 and 1 x 2: area 4, centroid (2 (1, 1/2) + 2 (1/2, 2))/4, mean x^2 (8/3 + 2/3)/4.
        for (polygon, area, center, square_x) in
            [(square, 4.0, DVec3::ONE, 4.0 / 3.0), (bent, 4.0, DVec3::new(0.75, 1.25, 1.0), 10.0 / 12.0)]
        {
            let patches = Patches::new(&polygon);
            assert!((patches.area - area).abs() < 1e-12);
            let (mut sum, mut squares, n) = (DVec3::ZERO, 0.0, 400);
            for i in 0..n * n {
                let at = |k: usize| (k as f64 + 0.5) / n as f64;
                let point = patches.point(at(i / n), at(i % n));
                (sum, squares) = (sum + point, squares + point.x * point.x);
            }
            let count = (n * n) as f64;
            // The square root in the triangles costs the midpoint rule its second order.
            assert!((sum / count - center).length() < 1e-3 && (squares / count - square_x).abs() < 1e-3);
        }
    }

    #[test]
    fn frames_are_orthonormal() {
        for w in [DVec3::X, DVec3::Z, DVec3::NEG_Z, DVec3::new(0.3, -0.4, -0.1), DVec3::new(0.1, 0.2, -0.9)] {
            let w = w.normalize();
            let (a, b) = frame(w);
            assert!((a.cross(b) - w).length() < 1e-14 && (a.length() - 1.0).abs() < 1e-14);
        }
    }
}
