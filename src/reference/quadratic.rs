//! Where a line meets something round: one quadratic equation serves spheres, cylinders and cones.

use glam::DVec3;

use super::exact;

/// The equation `|g - t e| = |p + q t|`: a distance that equals a radius.
///
/// A sphere has `g` = centre - origin, `e` = direction, `p` = radius and `q` = 0; a cylinder the same
/// across its axis; a cone has a radius that changes along the line. Written `a t^2 - 2 b t + c = 0`.
#[derive(Debug, Clone, Copy)]
pub struct Quadratic {
    /// `e.e - q^2`: negative for a line steeper than the cone.
    pub a: f64,
    /// `g.e + p q`.
    pub b: f64,
    /// `g.g - p^2`: negative inside.
    pub c: f64,
    /// `b^2 - a c`.
    pub discriminant: f64,
}

impl Quadratic {
    /// `g_low` is what rounding left out of `g`; it matters beside huge bodies.
    ///
    /// The discriminant has two forms: Lagrange's identity turns `b^2 - a c` into
    /// `|p e + q g|^2 - |g x e|^2` (for a sphere: `r^2 d.d - |f x d|^2`), which is small where the body is
    /// small and far; the plain form is small where the origin is close to a huge surface. Either errs
    /// by the rounding of its larger term, so the one with the smaller terms is taken.
    pub fn new(g: DVec3, g_low: DVec3, e: DVec3, p: f64, q: f64) -> Quadratic {
        let a = exact::dot([e.x, e.y, e.z, q], [e.x, e.y, e.z, -q]);
        let b = exact::dot([g.x, g.y, g.z, p], [e.x, e.y, e.z, q]) + g_low.dot(e);
        let c = exact::dot([g.x, g.y, g.z, p], [g.x, g.y, g.z, -p]) + 2.0 * g.dot(g_low);
        let (radial, moment) = (p * e + q * g, exact::cross(g, e) + g_low.cross(e));
        let (r2, m2) = (radial.length_squared(), moment.length_squared());
        let near = b * b + (a * c).abs() < r2 + m2;
        let discriminant = if near {
            exact::product_difference(b, b, a, c)
        } else {
            let (r, m) = (r2.sqrt(), m2.sqrt());
            (r - m) * (r + m)
        };
        Quadratic { a, b, c, discriminant }
    }

    /// Where the line comes in and where it goes out; an end that does not exist is infinite.
    ///
    /// Going in comes first (`a >= 0`), unless the line runs inside both halves of a double cone.
    /// `None`: outside all along.
    pub fn crossings(&self) -> Option<(f64, f64)> {
        let Quadratic { a, b, c, discriminant } = *self;
        if a > 0.0 && discriminant < 0.0 {
            return None;
        }
        let z = self.large();
        if z != 0.0 {
            // The product of the roots is c/a: the small one comes from the large one, unharmed.
            return Some(if b >= 0.0 { (c / z, z / a) } else { (z / a, c / z) });
        }
        match a {
            0.0 if c > 0.0 => None,
            0.0 => Some((f64::NEG_INFINITY, f64::INFINITY)),
            _ => Some((0.0, 0.0)),
        }
    }

    /// `b` and the root of the discriminant added without cancellation: `a` times the larger root.
    pub fn large(&self) -> f64 {
        self.b + self.half_width().copysign(self.b)
    }

    /// The root of the discriminant: `|a|` times half the distance between the crossings.
    pub fn half_width(&self) -> f64 {
        self.discriminant.max(0.0).sqrt()
    }
}
