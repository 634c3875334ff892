//! Sums and products whose rounding is caught: for the few places where f64 alone would cancel.
//!
//! Sources: Ogita, Rump and Oishi, "Accurate sum and dot product", SIAM Journal on Scientific
//! Computing 26(6), 2005; Jeannerod, Louvet and Muller, "Further analysis of Kahan's algorithm for
//! the accurate computation of 2 x 2 determinants", Mathematics of Computation 82, 2013.

use glam::DVec3;

/// `a + b` as its rounded value and what rounding left out (Knuth's two-sum).
fn sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let part = s - a;
    (s, (a - (s - part)) + (b - part))
}

/// `a . b` as if in twice the precision, then rounded.
pub fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    let (mut total, mut rest) = (0.0, 0.0);
    for (a, b) in a.into_iter().zip(b) {
        let product = a * b;
        let (s, lost) = sum(total, product);
        total = s;
        rest += lost + a.mul_add(b, -product);
    }
    total + rest
}

/// `a - b` as its rounded value and what rounding left out.
pub fn difference(a: DVec3, b: DVec3) -> (DVec3, DVec3) {
    let [x, y, z] = [sum(a.x, -b.x), sum(a.y, -b.y), sum(a.z, -b.z)];
    (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1))
}

/// `a b - c d` to two ulps of the result (Kahan).
pub fn product_difference(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let cd = c * d;
    a.mul_add(b, -cd) + (-c).mul_add(d, cd)
}

/// `a x b`, each component to two ulps.
pub fn cross(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(
        product_difference(a.y, b.z, a.z, b.y),
        product_difference(a.z, b.x, a.x, b.z),
        product_difference(a.x, b.y, a.y, b.x),
    )
}

/// `t d - f`, each component rounded once.
pub fn along(t: f64, d: DVec3, f: DVec3) -> DVec3 {
    DVec3::new(t.mul_add(d.x, -f.x), t.mul_add(d.y, -f.y), t.mul_add(d.z, -f.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_plain_sums_lose_is_kept() {
        let (big, tiny) = (1e8, 1.0 + f64::EPSILON);
        assert_eq!(dot([big, 1.0, big], [big, tiny, -big]), tiny);
        assert_eq!(product_difference(tiny, tiny, 1.0, 1.0 + 2.0 * f64::EPSILON), f64::EPSILON * f64::EPSILON);
        let (high, low) = difference(DVec3::splat(1e16), DVec3::splat(-1.0));
        assert_eq!((high, low), (DVec3::splat(1e16), DVec3::splat(1.0)));
        assert_eq!(cross(DVec3::X, DVec3::Y), DVec3::Z);
    }
}
