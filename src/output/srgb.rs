//! The piecewise sRGB curve, in both directions, and its exact quantisation to 8 and 16 bits.
//!
//! Source: IEC 61966-2-1:1999, section 5.2, with its constants 0.0031308 and 0.04045 as printed.

use std::sync::LazyLock;

/// Linear light 0..1 to the display value 0..1. Values outside follow the same formula; clamp first.
pub fn encode(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The display value 0..1 to linear light 0..1.
pub fn decode(display: f64) -> f64 {
    if display <= 0.04045 { display / 12.92 } else { ((display + 0.055) / 1.055).powf(2.4) }
}

/// Clamped to 0..1; NaN becomes 0.
#[inline]
pub fn unit(value: f32) -> f32 {
    if value > 0.0 { value.min(1.0) } else { 0.0 }
}

/// Linear light to the nearest of 256 codes; what is below 0 or NaN becomes 0, what is above 1 becomes 255.
#[inline]
pub fn to_u8(linear: f32) -> u8 {
    TABLE.code(linear)
}

/// Linear light to the nearest of 65,536 codes, clamped as [`to_u8`] does.
pub fn to_u16(linear: f32) -> u16 {
    (encode(f64::from(unit(linear))) * 65535.0).round() as u16
}

/// Linear light of an 8-bit code.
pub fn from_u8(code: u8) -> f32 {
    TABLE.linear[usize::from(code)]
}

/// Linear light of a 16-bit code.
pub fn from_u16(code: u16) -> f32 {
    decode(f64::from(code) / 65535.0) as f32
}

static TABLE: LazyLock<Table> = LazyLock::new(Table::new);

/// Quantises with one look-up and one comparison. A bucket holds the floats that share their exponent and
/// the first seven bits of their mantissa; it is so narrow that at most one code begins inside it.
struct Table {
    /// `begin[k]` is the smallest float whose code is above `k`; infinite for 255.
    begin: [f32; 256],
    /// The code of the smallest float of each bucket.
    code: Vec<u8>,
    /// Linear light of each code.
    linear: [f32; 256],
}

/// 2^-13 is the largest power of two with code 0 up to itself: half a code is 1 / (2 x 255 x 12.92), or 2^-12.7.
const LOWEST: f32 = 1.0 / 8192.0;
const SHIFT: u32 = 23 - 7;

impl Table {
    fn new() -> Self {
        let begin = std::array::from_fn(|code| if code < 255 { first_above(code) } else { f32::INFINITY });
        let first = LOWEST.to_bits() >> SHIFT;
        let last = 1f32.to_bits() >> SHIFT;
        let code = (first..last).map(|bucket| {
            let smallest = f32::from_bits(bucket << SHIFT);
            begin.partition_point(|&begin| begin <= smallest) as u8
        });
        let linear = std::array::from_fn(|code| decode(code as f64 / 255.0) as f32);
        Table { begin, code: code.collect(), linear }
    }

    #[inline]
    fn code(&self, linear: f32) -> u8 {
        if linear >= 1.0 {
            return 255;
        }
        if linear.is_nan() || linear < LOWEST {
            return 0;
        }
        let code = self.code[((linear.to_bits() >> SHIFT) - (LOWEST.to_bits() >> SHIFT)) as usize];
        code + u8::from(linear >= self.begin[usize::from(code)])
    }
}

/// The smallest float that is nearer to code + 1 than to code.
fn first_above(code: usize) -> f32 {
    let half_way = decode((code as f64 + 0.5) / 255.0);
    let near = half_way as f32;
    if f64::from(near) >= half_way { near } else { near.next_up() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Display codes of linear values: those that the standard's formulas give in 50-digit decimal arithmetic.
    #[test]
    fn curve_passes_through_known_points() {
        let points = [
            (0.0, 0.0),
            (0.001, 0.01292),
            (0.003_130_8, 0.040_449_936),
            (0.01, 0.099_852_822_4),
            (0.18, 0.461_356_129_5),
            (0.5, 0.735_356_983_052),
            (0.8, 0.906_331_753_8),
            (1.0, 1.0),
        ];
        for (linear, display) in points {
            assert!((encode(linear) - display).abs() < 1e-9, "{linear}: {}", encode(linear));
            // The two printed constants leave a step of 3e-8 between the pieces.
            assert!((decode(display) - linear).abs() < 1e-7, "{display}: {}", decode(display));
        }
    }

    #[test]
    fn eight_bits_are_the_nearest_code_on_both_sides_of_every_half_way_point() {
        let rounded = |linear: f32| (encode(f64::from(linear)) * 255.0).round() as u8;
        for code in 0..255 {
            let begin = first_above(code);
            for linear in [begin.next_down(), begin, begin.next_up()] {
                assert_eq!(to_u8(linear), rounded(linear), "{linear:e}");
            }
            assert_eq!((to_u8(begin.next_down()), to_u8(begin)), (code as u8, code as u8 + 1));
        }
    }

    #[test]
    fn eight_bits_are_the_nearest_code_at_every_bucket_and_between() {
        let rounded = |linear: f32| (encode(f64::from(linear)) * 255.0).round() as u8;
        for bits in (0..=1f32.to_bits()).step_by(4_099).chain((0..=1f32.to_bits()).step_by(1 << SHIFT)) {
            let linear = f32::from_bits(bits);
            assert_eq!(to_u8(linear), rounded(linear), "{linear:e}");
        }
    }

    #[test]
    fn codes_return_to_themselves_and_the_rest_is_clamped() {
        assert!((0..=255).all(|code| to_u8(from_u8(code)) == code));
        assert!((0..=65535).all(|code| to_u16(from_u16(code)) == code));
        for (linear, code) in [(f32::NAN, 0), (-1.0, 0), (f32::NEG_INFINITY, 0), (2.0, 255), (f32::INFINITY, 255)] {
            assert_eq!((to_u8(linear), to_u16(linear)), (code, u16::from(code) * 257));
        }
    }
}
