//! Eight f32, and sums of products that do not cancel.

use wide::{f32x4, f32x8, f64x4};

use super::LANES;

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

/// The first lane of the least of eight f64, none of them NaN, and that: without branches, which nobody could foretell.
#[inline]
pub fn first_least(values: &[f64; LANES]) -> (usize, f64) {
    let [low, high] = [0, 4].map(|first| f64x4::new(std::array::from_fn(|i| values[first + i])));
    let [a, b, c, d] = low.fast_min(high).to_array();
    let min = |a: f64, b: f64| if a < b { a } else { b };
    let least = min(min(a, c), min(b, d));
    let lanes = [low, high].map(|four| four.simd_eq(f64x4::splat(least)).to_bitmask());
    ((lanes[0] | lanes[1] << 4).trailing_zeros() as usize % LANES, least)
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
    fn the_first_of_equals_is_the_least() {
        assert_eq!(first_least(&[5.0, 3.0, 7.0, 3.0, 9.0, 4.0, 3.0, 8.0]), (1, 3.0));
        assert_eq!(first_least(&[5.0, 3.0, 7.0, 3.0, 9.0, 0.5, 3.0, 8.0]), (5, 0.5));
        assert_eq!(first_least(&[0.0; LANES]), (0, 0.0));
    }

    #[test]
    fn products_that_cancel_keep_their_difference() {
        // (1 + 2^-12)^2 - (1 + 2^-11) = 2^-24, below the rounding of either product.
        let (a, c) = (1.0 + 2f32.powi(-12), 1.0 + 2f32.powi(-11));
        let got = difference_of_products(float8(a), float8(a), float8(c), float8(1.0));
        assert_eq!(got.to_array(), [2f32.powi(-24); 8]);
    }
}
