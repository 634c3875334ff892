//! Colour maps: numbers as colours.

use crate::scene::picture_file::linear_from_srgb;

/// A map from 0..1 to colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ColorMap {
    /// Dark violet over green to yellow, even to the eye.
    ///
    /// Source: Smith and van der Walt, "A better default colormap for Matplotlib", SciPy 2015; ten colours of it,
    /// evenly spaced.
    #[default]
    Viridis,
    /// Blue over grey to red, for values about a middle.
    ///
    /// Source: Moreland, "Diverging color maps for scientific visualization", ISVC 2009; its ends and middle.
    CoolWarm,
    /// Black to white.
    Grey,
}

const VIRIDIS: &[u32] =
    &[0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b, 0xfde725];
const COOL_WARM: &[u32] = &[0x3b4cc0, 0xdddddd, 0xb40426];
const GREY: &[u32] = &[0x000000, 0xffffff];

impl ColorMap {
    /// The colour of `x` in 0..1, linear Rec. 709; stops are joined by straight lines on the curve of sRGB.
    pub fn color(self, x: f64) -> [f32; 3] {
        let stops = match self {
            ColorMap::Viridis => VIRIDIS,
            ColorMap::CoolWarm => COOL_WARM,
            ColorMap::Grey => GREY,
        };
        let place = x.clamp(0.0, 1.0) * (stops.len() - 1) as f64;
        let index = (place as usize).min(stops.len() - 2);
        let share = |hex: u32, shift: u32| f64::from(hex >> shift & 0xff) / 255.0;
        [16, 8, 0].map(|shift| {
            let (a, b) = (share(stops[index], shift), share(stops[index + 1], shift));
            linear_from_srgb(a + (place - index as f64) * (b - a)) as f32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::particles::element::from_hex;

    #[test]
    fn ends_and_middles_are_those_of_the_sources() {
        assert_eq!(ColorMap::Viridis.color(0.0), from_hex(0x440154));
        assert_eq!(ColorMap::Viridis.color(7.0), from_hex(0xfde725));
        assert_eq!(ColorMap::CoolWarm.color(0.5), from_hex(0xdddddd));
        assert_eq!(ColorMap::Grey.color(-1.0), [0.0; 3]);
        let steps: Vec<f32> = (0..=50).map(|i| ColorMap::Grey.color(f64::from(i) / 50.0)[1]).collect();
        assert!(steps.is_sorted());
    }
}
