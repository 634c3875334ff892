//! Eight f32, and sums of products that do not cancel.

use wide::f32x8;

/// Eight lanes of f32.
pub type Float8 = f32x8;

/// The same number in all lanes.
#[inline(always)]
pub fn float8(x: f32) -> Float8 {
    f32x8::splat(x)
}

/// `a b - c d` to about one rounding of the result, however much the products cancel.
///
/// Source: Kahan's algorithm, analysed in Jeannerod, Louvet and Muller, "Further analysis of Kahan's
/// algorithm for the accurate computation of 2x2 determinants", Mathematics of Computation 82, 2013.
/// It needs a fused multiply-add; where the build has none the products are formed in f64, exactly.
#[inline(always)]
pub fn difference_of_products(a: Float8, b: Float8, c: Float8, d: Float8) -> Float8 {
    if cfg!(target_feature = "fma") {
        let cd = c * d;
        let error = c.mul_neg_add(d, cd);
        a.mul_sub(b, cd) + error
    } else {
        by_lane([a, b, c, d], |[a, b, c, d]| a * b - c * d)
    }
}

/// `x^2 + y^2 + z^2 - w^2` with exact squares and error-free sums: right to about one rounding of
/// the result plus 1e-14 of the largest square.
///
/// Source: Ogita, Rump and Oishi, "Accurate sum and dot product", SIAM Journal on Scientific
/// Computing 26(6), 2005; without a fused multiply-add in f64, where the squares are exact.
#[inline(always)]
pub fn square_sum_minus(x: Float8, y: Float8, z: Float8, w: Float8) -> Float8 {
    if cfg!(target_feature = "fma") {
        let square = |v: Float8| (v * v, v.mul_sub(v, v * v));
        let ((a, da), (b, db), (c, dc), (d, dd)) = (square(x), square(y), square(z), square(w));
        let (s, e1) = two_sum(a, -d);
        let (s, e2) = two_sum(s, b);
        let (s, e3) = two_sum(s, c);
        s + ((e1 + e2) + (e3 + ((da - dd) + (db + dc))))
    } else {
        by_lane([x, y, z, w], |[x, y, z, w]| ((x - w) * (x + w) + y * y) + z * z)
    }
}

/// `a + b` rounded, and what the rounding lost (Knuth, The Art of Computer Programming 2, 4.2.2).
#[inline(always)]
fn two_sum(a: Float8, b: Float8) -> (Float8, Float8) {
    let sum = a + b;
    let b_part = sum - a;
    (sum, (a - (sum - b_part)) + (b - b_part))
}

fn by_lane(values: [Float8; 4], f: impl Fn([f64; 4]) -> f64) -> Float8 {
    let rows = values.map(Float8::to_array);
    Float8::from(std::array::from_fn::<f32, 8, _>(|lane| f(rows.map(|row| f64::from(row[lane]))) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_that_cancel_keep_their_difference() {
        // (1 + 2^-12)^2 - (1 + 2^-11) = 2^-24, below the rounding of either product.
        let (a, c) = (1.0 + 2f32.powi(-12), 1.0 + 2f32.powi(-11));
        let got = difference_of_products(float8(a), float8(a), float8(c), float8(1.0));
        assert_eq!(got.to_array(), [2f32.powi(-24); 8]);
    }

    #[test]
    fn square_sums_that_cancel_keep_their_difference() {
        for i in 1..2000 {
            let r = 1e7f32;
            let (x, y) = (3.25 * i as f32, 0.125 * i as f32);
            let z = (f64::from(r).powi(2) - f64::from(x).powi(2)).sqrt() as f32;
            let exact = |v: f32| f64::from(v) * f64::from(v);
            let want = (exact(z) - exact(r)) + (exact(x) + exact(y));
            let got = square_sum_minus(float8(x), float8(y), float8(z), float8(r)).to_array()[3];
            assert!((f64::from(got) - want).abs() <= want.abs() * 2e-7 + 1.0, "{i}: {got} {want}");
        }
    }
}
