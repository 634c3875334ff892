//! High dynamic range for a display: linear Rec. 709 to Rec. 2100 by its perceptual quantiser, and back.
//!
//! Source: Rec. ITU-R BT.2100-2 (2018), table 4 (the curve of SMPTE ST 2084) and table 2 (primaries); light of 1 is as
//! bright as graphics white in Rep. ITU-R BT.2408-7 (2023), 203 cd/m2.

use std::sync::LazyLock;

use glam::{DMat3, DVec3};

use super::color::Primaries;

/// Coding-independent code points of the result (ITU-T H.273): primaries 9, curve 16, RGB, full range.
pub const CODE_POINTS: [u8; 4] = [9, 16, 0, 1];

/// Luminance of light of 1, and the highest there is, cd/m2.
const WHITE: f64 = 203.0;
const PEAK: f64 = 10_000.0;

const M1: f64 = 2610.0 / 16384.0;
const M2: f64 = 2523.0 / 4096.0 * 128.0;
const C1: f64 = 3424.0 / 4096.0;
const C2: f64 = 2413.0 / 4096.0 * 32.0;
const C3: f64 = 2392.0 / 4096.0 * 32.0;

/// From linear Rec. 709 to shares of the peak of each primary, and back.
static MATRICES: LazyLock<[DMat3; 2]> = LazyLock::new(|| {
    let there = Primaries::REC709.matrix_to(Primaries::REC2020).unwrap_or_default() * (WHITE / PEAK);
    [there, there.inverse()]
});

/// Finite linear Rec. 709 to shares of the peak, 0..1 of what there is.
#[inline]
pub fn shares(rgb: [f32; 3]) -> [f32; 3] {
    (MATRICES[0] * DVec3::from(rgb.map(f64::from))).to_array().map(|share| share as f32)
}

/// A share of the peak to the nearest of 65,536 codes; what is below 0 or NaN becomes 0, what is above 1 becomes 65,535.
#[inline]
pub fn to_u16(share: f32) -> u16 {
    let y = f64::from(super::srgb::unit(share)).powf(M1);
    (((C1 + C2 * y) / (1.0 + C3 * y)).powf(M2) * 65_535.0).round() as u16
}

/// Codes 0..1 to linear Rec. 709.
#[inline]
pub fn light(codes: [f64; 3]) -> [f32; 3] {
    let share = |code: f64| {
        let e = code.powf(1.0 / M2);
        ((e - C1).max(0.0) / (C2 - C3 * e)).powf(1.0 / M1)
    };
    (MATRICES[1] * DVec3::from(codes.map(share))).to_array().map(|light| light as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Signals that the reports print: graphics white 58 %, the peak 100 %, 1 cd/m2 15 %.
    #[test]
    fn curve_passes_through_known_points() {
        for (luminance, signal) in
            [(203.0, 0.580_69), (10_000.0, 1.0), (1.0, 0.149_946), (100.0, 0.508_078), (0.0, 0.0)]
        {
            let code = f64::from(to_u16(luminance / 10_000.0)) / 65_535.0;
            assert!((code - signal).abs() < 2e-5, "{luminance}: {code}");
        }
        assert_eq!([f32::NAN, -1.0, 2.0].map(to_u16), [0, 0, 65_535]);
    }

    #[test]
    fn light_returns_and_white_stays_white() {
        let [r, g, b] = shares([1.0; 3]);
        assert!([r, g, b].iter().all(|share| (share - 0.0203).abs() < 1e-6), "{r} {g} {b}");
        for rgb in [[1.0, 0.0, 0.0], [0.2, 3.0, 40.0], [1e-3, 0.5, 0.02]] {
            let codes = shares(rgb).map(|share| f64::from(to_u16(share)) / 65_535.0);
            for (back, light) in light(codes).into_iter().zip(rgb) {
                assert!((back - light).abs() < 5e-4 * (light + 0.1), "{rgb:?}: {back}");
            }
        }
    }
}
