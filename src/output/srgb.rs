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
    TABLE.code(linear, &TABLE.nearest)
}

/// Linear light to one of the two codes around it, so that the codes of many pixels have its mean: ordered dither.
///
/// `x`, `y` are the pixel's place in the display window; the same place always rounds alike. A value that is a code
/// stays that code. Clamped as [`to_u8`] does.
/// Source: Bayer, "An optimum method for two-level rendition of continuous-tone pictures" (1973), 8 x 8.
#[inline]
pub fn to_u8_dithered(linear: f32, x: i32, y: i32) -> u8 {
    let place = (y & 7) << 3 | (x & 7);
    TABLE.code(linear, &TABLE.dithered[place as usize])
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

/// Quantises with one look-up and two comparisons. A bucket holds the floats that share their exponent and
/// the first seven bits of their mantissa; it is so narrow that no two codes begin inside it, so the code of a float is
/// at most two above the one that its bucket begins with, rounded down.
struct Table {
    /// Rounds to the nearest code.
    nearest: Begin,
    /// Rounds up from a threshold that differs by the pixel's place, 8 x 8 of them.
    dithered: Vec<Begin>,
    /// The code of the smallest float of each bucket, rounded down.
    code: Vec<u8>,
    /// Linear light of each code.
    linear: [f32; 256],
}

/// `begin[k]` is the smallest float whose code is above `k`; infinite for 255.
type Begin = [f32; 256];

/// 2^-19 is below 1 / (128 x 255 x 12.92), where the first code 1 of the dithered ones begins: what is less is 0 anywhere.
const LOWEST: f32 = 1.0 / 524_288.0;
const SHIFT: u32 = 23 - 7;

impl Table {
    fn new() -> Self {
        let begin = |above: f64| -> Begin {
            std::array::from_fn(|code| if code < 255 { first_above(code, above) } else { f32::INFINITY })
        };
        let whole = begin(1.0);
        let first = LOWEST.to_bits() >> SHIFT;
        let last = 1f32.to_bits() >> SHIFT;
        let code = (first..=last).map(|bucket| {
            let smallest = f32::from_bits(bucket << SHIFT);
            whole.partition_point(|&begin| begin <= smallest) as u8
        });
        Table {
            nearest: begin(0.5),
            dithered: (0..64).map(|place| begin((f64::from(bayer(place)) + 0.5) / 64.0)).collect(),
            code: code.collect(),
            linear: std::array::from_fn(|code| decode(code as f64 / 255.0) as f32),
        }
    }

    #[inline]
    fn code(&self, linear: f32, begin: &Begin) -> u8 {
        // Without a branch, since pictures go back and forth between black and bright.
        #[allow(clippy::manual_clamp)] // the greater of NaN and a number is the number, a clamped NaN is NaN
        let linear = linear.max(LOWEST).min(1.0);
        let mut code = self.code[((linear.to_bits() >> SHIFT) - (LOWEST.to_bits() >> SHIFT)) as usize];
        code += u8::from(linear >= begin[usize::from(code)]);
        code + u8::from(linear >= begin[usize::from(code)])
    }
}

/// Bayer's matrix of 8 x 8, row by row: the bits of x and x ^ y, the lowest first, as those of a number, the highest first.
fn bayer(place: u32) -> u32 {
    let (x, y) = (place & 7, place >> 3);
    (0..3).fold(0, |rank, bit| rank << 2 | ((x ^ y) >> bit & 1) << 1 | y >> bit & 1)
}

/// The smallest float on the display's scale at `code` and this share of a code above it, or beyond.
fn first_above(code: usize, share: f64) -> f32 {
    let place = decode((code as f64 + share) / 255.0);
    let near = place as f32;
    if f64::from(near) >= place { near } else { near.next_up() }
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
            let begin = first_above(code, 0.5);
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
    fn dithered_codes_have_the_mean_of_what_they_show() {
        let ranks: std::collections::BTreeSet<u32> = (0..64).map(bayer).collect();
        assert!(ranks.into_iter().eq(0..64));
        assert_eq!([bayer(0), bayer(1), bayer(8), bayer(9)], [0, 32, 48, 16]);
        for step in 0..=1000 {
            let linear = step as f32 / 1000.0;
            let display = encode(f64::from(linear)) * 255.0;
            let codes = (0..64).map(|place| f64::from(to_u8_dithered(linear, place % 8 - 16, place / 8 + 800)));
            let (mut sum, mut off) = (0.0, 0f64);
            codes.for_each(|code| (sum, off) = (sum + code, off.max((code - display).abs())));
            // 64 thresholds are 1/64 apart, and the first one is half of that.
            assert!(
                (sum / 64.0 - display).abs() <= 0.5 / 64.0 + 1e-5 && off < 1.0,
                "{linear}: {} {display}",
                sum / 64.0
            );
        }
        for code in 0..=255 {
            assert!((0..64).all(|place| to_u8_dithered(from_u8(code), place % 8, place / 8) == code), "{code}");
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
