//! Eight f32, and sums of products that do not cancel.

use wide::{f32x4, f32x8};

/// Eight lanes of f32.
pub type Float8 = f32x8;

/// The same number in all lanes.
#[inline(always)]
pub fn float8(x: f32) -> Float8 {
    f32x8::splat(x)
}

/// The least of the lanes.
#[inline(always)]
pub fn least(x: Float8) -> f32 {
    let [a, b, c, d, e, f, g, h] = x.to_array();
    let half = f32x4::new([a, b, c, d]).fast_min(f32x4::new([e, f, g, h]));
    let [a, b, c, d] = half.to_array();
    let min = |a: f32, b: f32| if a < b { a } else { b };
    min(min(a, b), min(c, d))
}

/// The greatest of the lanes.
#[inline(always)]
pub fn greatest(x: Float8) -> f32 {
    -least(-x)
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
}
