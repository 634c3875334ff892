//! From scene-linear light to what a display is to show of it: exposure, white point, tone map.
//!
//! All of it is linear Rec. 709 still; the display's own curve is [`srgb`](super::srgb). A tone map fits light
//! without a bound into 0..1; each is some ten lines after its author's publication. A [`Display`] as it is by
//! default changes nothing.

use glam::{DMat3, DVec3};

/// How bright light becomes display light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ToneMap {
    /// As it is; what is above 1 is cut off.
    #[default]
    None,
    /// Luminance L becomes L / (1 + L), or with a white point W, L (1 + L / W²) / (1 + L).
    ///
    /// Source: Reinhard, Stark, Shirley, Ferwerda, "Photographic tone reproduction for digital images" (2002),
    /// equations 3 and 4.
    Reinhard,
    /// The reference and output transforms of the Academy Color Encoding System, fitted by a rational function.
    ///
    /// Source: Hill, in Pettineo and Hill, "BakingLab" (2016), `ACES.hlsl`.
    Aces,
    /// Sobotka's AgX in its base look: a contrast curve over 16.5 stops in a space of its own primaries.
    ///
    /// Source: Sobotka, "AgX" (2022); matrix and polynomial as fitted by Wrensch, "Minimal AgX implementation" (2023).
    Agx,
    /// Khronos PBR Neutral: true colours below 0.8, highlights compressed and desaturated above.
    ///
    /// Source: Khronos Group, "PBR Neutral Tone Mapper" (2024).
    Khronos,
}

/// What a display is to show of light.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Display {
    /// Stops: light is multiplied by 2 to this power before all else.
    pub exposure: f32,
    /// The light that becomes the display's white, > 0, after exposure. `None`: 1 without a tone map, and with one
    /// wherever it leads.
    pub white: Option<f32>,
    /// The tone map.
    pub tone_map: ToneMap,
}

/// A [`Display`] with its factors worked out.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shown {
    display: Display,
    /// Light is multiplied by it.
    gain: f64,
    /// 1 / W² of Reinhard's equation 4, 0 without a white point.
    burn: f64,
    /// What white becomes by itself; results are divided by it.
    white: f64,
    is_plain: bool,
}

impl Display {
    pub(super) fn prepare(self) -> Shown {
        let gain = f64::from(self.exposure).exp2();
        let mut shown = Shown { display: self, gain, burn: 0.0, white: 1.0, is_plain: self == Display::default() };
        if let Some(white) = self.white.map(f64::from) {
            match self.tone_map {
                ToneMap::Reinhard => shown.burn = 1.0 / (white * white),
                _ => shown.white = shown.map(DVec3::splat(white)).max_element(),
            }
        }
        shown
    }
}

impl Shown {
    /// Finite light to display light, both linear. Not clamped, but never below 0 behind a tone map.
    #[inline]
    pub fn light(&self, rgb: [f32; 3]) -> [f32; 3] {
        if self.is_plain {
            return rgb;
        }
        let light = DVec3::from(rgb.map(f64::from)) * self.gain;
        (self.map(light) / self.white).to_array().map(|value| value as f32)
    }

    fn map(&self, light: DVec3) -> DVec3 {
        match self.display.tone_map {
            ToneMap::None => light,
            ToneMap::Reinhard => reinhard(light.max(DVec3::ZERO), self.burn),
            ToneMap::Aces => aces(light.max(DVec3::ZERO)),
            ToneMap::Agx => agx(light.max(DVec3::ZERO)),
            ToneMap::Khronos => khronos(light.max(DVec3::ZERO)),
        }
    }
}

/// Luminance of linear Rec. 709: the middle row of its matrix to CIE XYZ.
const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

fn reinhard(light: DVec3, burn: f64) -> DVec3 {
    let luminance = light.dot(LUMINANCE);
    light * ((1.0 + luminance * burn) / (1.0 + luminance))
}

fn aces(light: DVec3) -> DVec3 {
    // Rec. 709 to AP1 with the reference transform's saturation, and back from the output transform's.
    let there = rows([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]);
    let back = rows([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]);
    let v = there * light;
    let above = v * (v + 0.0245786) - 0.000090537;
    let below = v * (0.983729 * v + 0.4329510) + 0.238081;
    (back * (above / below)).max(DVec3::ZERO)
}

fn agx(light: DVec3) -> DVec3 {
    let inset = rows([
        [0.842_479_062_253_094, 0.078_433_599_999_999_2, 0.079_223_745_147_764_3],
        [0.042_328_242_261_012_3, 0.878_468_636_469_772, 0.079_166_127_460_543_4],
        [0.042_375_654_905_705_1, 0.078_433_6, 0.879_142_973_793_104],
    ]);
    const LOWEST: f64 = -12.473_93; // stops about middle grey
    const HIGHEST: f64 = 4.026_069;
    let stops = (inset * light).max(DVec3::splat(1e-10)).map(f64::log2);
    let x = (stops.clamp(DVec3::splat(LOWEST), DVec3::splat(HIGHEST)) - LOWEST) / (HIGHEST - LOWEST);
    let curve = |x: f64| {
        let x2 = x * x;
        let x4 = x2 * x2;
        15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232
    };
    // The curve ends on the display's scale, by a power of 2.2.
    (inset.inverse() * x.map(curve)).max(DVec3::ZERO).map(|v| v.powf(2.2))
}

fn khronos(light: DVec3) -> DVec3 {
    const START: f64 = 0.8 - 0.04;
    const DESATURATION: f64 = 0.15;
    let least = light.min_element();
    let toe = if least < 0.08 { least - 6.25 * least * least } else { 0.04 };
    let color = light - toe;
    let peak = color.max_element();
    if peak < START {
        return color;
    }
    let room = 1.0 - START;
    let new_peak = 1.0 - room * room / (peak + room - START);
    let grey = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    (color * (new_peak / peak)).lerp(DVec3::splat(new_peak), grey)
}

fn rows(rows: [[f64; 3]; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&rows).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [ToneMap; 5] = [ToneMap::None, ToneMap::Reinhard, ToneMap::Aces, ToneMap::Agx, ToneMap::Khronos];

    fn shown(tone_map: ToneMap, exposure: f32, white: Option<f32>, rgb: [f32; 3]) -> [f32; 3] {
        Display { exposure, white, tone_map }.prepare().light(rgb)
    }

    #[test]
    fn the_usual_display_changes_no_bit() {
        let light = [0.1, 7.3e4, -2.5e-9];
        assert_eq!(shown(ToneMap::None, 0.0, None, light), light);
        assert_eq!(shown(ToneMap::None, 2.0, None, [0.1, 3.0, 0.0]), [0.4, 12.0, 0.0]);
        assert_eq!(shown(ToneMap::None, 1.0, Some(4.0), [0.5, 2.0, 8.0]), [0.25, 1.0, 4.0]);
    }

    /// Values worked out by hand or printed by the authors.
    #[test]
    fn curves_pass_through_known_points() {
        let near = |tone_map, white, light: f32, want: f32| {
            let got = shown(tone_map, 0.0, white, [light; 3]);
            assert!(got.iter().all(|got| (got - want).abs() < 2e-4), "{tone_map:?} {light}: {got:?} {want}");
        };
        near(ToneMap::Reinhard, None, 1.0, 0.5);
        near(ToneMap::Reinhard, Some(4.0), 4.0, 1.0);
        near(ToneMap::Reinhard, Some(4.0), 1.0, 0.53125);
        // v = 0.18: (0.0324 + 0.004424 - 0.0000905) / (0.031873 + 0.077931 + 0.238081) = 0.036734 / 0.347885.
        near(ToneMap::Aces, None, 0.18, 0.10556);
        // Below the shoulder, grey loses the toe of 0.04; at 0.08 and less it becomes 6.25 x².
        near(ToneMap::Khronos, None, 0.5, 0.46);
        near(ToneMap::Khronos, None, 0.04, 0.01);
        // peak 1.96: 1 - 0.0576 / (1.96 + 0.24 - 0.76) = 0.96.
        near(ToneMap::Khronos, None, 2.0, 0.96);
        // Middle grey of the log encoding: (log2 0.18 + 12.47393) / 16.5 = 0.606060, by the polynomial 0.49673.
        near(ToneMap::Agx, None, 0.18, 0.21452);
    }

    #[test]
    fn grey_stays_grey_and_rises() {
        for tone_map in ALL {
            let mut before = -1.0;
            for step in 0..400 {
                let light = (step as f32 / 20.0 - 10.0).exp2();
                let [r, g, b] = shown(tone_map, 0.0, None, [light; 3]);
                // The published matrices have five digits, or rows that add up to 1 within some 1e-4.
                assert!((r - g).abs() < 2e-3 * g + 1e-6 && (b - g).abs() < 2e-3 * g + 1e-6, "{tone_map:?} {r} {g} {b}");
                assert!(
                    g >= before && g.is_finite() && (tone_map == ToneMap::None || g < 1.06),
                    "{tone_map:?} {light} {g}"
                );
                before = g;
            }
        }
    }

    #[test]
    fn white_is_where_it_is_said_to_be_and_nothing_is_negative() {
        for tone_map in ALL {
            let [r, g, b] = shown(tone_map, 1.0, Some(6.0), [3.0; 3]);
            assert!([r, g, b].iter().all(|v| (v - 1.0).abs() < 2e-3), "{tone_map:?} {r} {g} {b}");
            for light in [[0.0; 3], [1e30, 0.0, 0.0], [0.0, 0.0, 5.0], [-1.0, 2.0, 0.5], [65504.0; 3]] {
                let found = shown(tone_map, 0.0, None, light);
                let sound = found.iter().all(|v| v.is_finite() && (*v >= 0.0 || tone_map == ToneMap::None));
                assert!(sound, "{tone_map:?} {light:?} {found:?}");
            }
        }
    }
}
