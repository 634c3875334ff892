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

#[cfg(test)]
mod tests {
    use super::*;

    /// Against integers: numbers of 24 bits make every term of the discriminant exact in 128.
    #[test]
    fn discriminants_are_right_to_their_smaller_terms() {
        let mut state = 1u64;
        let mut roll = |bits: u32| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            i128::from((state >> 33) % (1 << bits)) - (1 << (bits - 1))
        };
        let real = |v: [i128; 3]| DVec3::from_array(v.map(|x| x as f64));
        let dot = |a: [i128; 3], b: [i128; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (mut outside, mut inside) = (0, 0);
        for case in 0..30_000 {
            // Small and far, of the size of its distance, and almost touched by the origin.
            let (far, size) = [(24, 4), (12, 12), (24, 24)][case % 3];
            let mut g = [roll(far), roll(far), roll(far)];
            let e = [roll(10), roll(10), roll(10)];
            let (mut p, q) = (roll(size).abs(), roll(if case % 2 == 0 { 6 } else { 1 }) * i128::from(case % 2 == 0));
            if case % 3 == 2 {
                g = [roll(4), p + roll(3), roll(4)];
                p = p.max(1);
            }
            let (a, b, c) = (dot(e, e) - q * q, dot(g, e) + p * q, dot(g, g) - p * p);
            let exact = b * b - a * c;
            let found = Quadratic::new(real(g), DVec3::ZERO, real(e), p as f64, q as f64);
            assert_eq!((found.a, found.c), (a as f64, c as f64));
            let radial: [i128; 3] = std::array::from_fn(|i| p * e[i] + q * g[i]);
            let smaller = (b * b + (a * c).abs()).min(2 * dot(radial, radial) - exact) as f64;
            let error = (found.discriminant - exact as f64).abs();
            assert!(error <= 8.0 * f64::EPSILON * smaller, "{g:?} {e:?} {p} {q}: {error:e} of {smaller:e}");
            match found.crossings() {
                None => outside += 1,
                Some(ends) => {
                    inside += 1;
                    for t in [ends.0, ends.1].into_iter().filter(|t| t.is_finite()) {
                        let residual = (found.a * t - 2.0 * found.b) * t + found.c;
                        let terms = found.a.abs() * t * t + 2.0 * (found.b * t).abs() + found.c.abs();
                        let grazing = error / found.a.abs().max(1.0);
                        assert!(residual.abs() <= 1e-14 * terms + grazing, "{g:?} {e:?} {p} {q}: {t} {residual:e}");
                    }
                }
            }
        }
        assert!(outside > 3000 && inside > 8000, "{outside} {inside}");
    }
}
