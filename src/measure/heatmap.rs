//! Where two pictures differ, as a picture with a scale bar to read values from.

use super::canvas;
use super::metrics::{CompareError, pixel_difference, same_size};
use crate::film::{Picture, Window};
use crate::output::png::Raster;

/// Decades from the lower to the upper end of the scale.
const DECADES: i32 = 4;
/// Equal pixels. The scale's own colours begin at a dark violet.
const EQUAL: [u8; 3] = [0, 0, 0];
/// Pixels where only one picture is finite.
const NOT_FINITE: [u8; 3] = [255, 255, 255];
const GROUND: [u8; 3] = [40, 40, 40];
const INK: [u8; 3] = [235, 235, 235];

/// The colour map "viridis", every 16th of its 256 entries: van der Walt and Smith for matplotlib, 2015, CC0. Its
/// lightness rises evenly, so the order of values is seen in grey and by colour-blind readers as well.
const VIRIDIS: [[u8; 3]; 17] = [
    [68, 1, 84],
    [72, 24, 106],
    [71, 45, 123],
    [66, 64, 134],
    [59, 82, 139],
    [51, 99, 141],
    [44, 114, 142],
    [38, 130, 142],
    [33, 145, 140],
    [31, 159, 136],
    [39, 173, 129],
    [61, 188, 116],
    [92, 200, 99],
    [129, 211, 77],
    [170, 220, 50],
    [213, 226, 26],
    [253, 231, 37],
];

/// The differences of two pictures, pixel by pixel, with a scale bar below.
///
/// A pixel shows the largest absolute difference of its four linear samples on a logarithmic scale: four decades,
/// of which the uppermost holds the largest difference of all; smaller ones get the lowest colour. Black means
/// equal to the bit, white that only one picture is finite. The bar's marks are labelled "1e-3" and the like. The
/// raster is as wide as the picture, or as the bar where that is wider.
///
/// # Errors
/// As [`super::compare`].
pub fn heatmap(a: &Picture, b: &Picture) -> Result<Raster, CompareError> {
    same_size(a, b)?;
    let differences: Vec<f64> = a.pixels.iter().zip(&b.pixels).map(|(a, b)| pixel_difference(a, b)).collect();
    map_of(&differences, a.window)
}

/// Values of the pixels of a window, row by row, none of them negative, on the same scale; black means 0.
///
/// # Errors
/// The window is empty, or not as large as there are values.
pub fn map_of(values: &[f64], window: Window) -> Result<Raster, CompareError> {
    if window.area() == 0 || values.len() != window.area() {
        return Err(CompareError::Empty);
    }
    let largest = values.iter().copied().filter(|value| value.is_finite()).fold(0.0, f64::max);
    let top = if largest > 0.0 { largest.log10().ceil() as i32 } else { 0 };
    let (width, height) = (window.width(), window.height());
    let bar = Bar::new(width);
    let mut raster = empty(width.max(bar.width), height + bar.height)?;
    let columns = raster.width as usize;
    for (row, values) in raster.pixels.chunks_exact_mut(columns).zip(values.chunks_exact(width)) {
        for (pixel, &value) in row.iter_mut().zip(values) {
            *pixel = color(value, top);
        }
    }
    bar.draw(&mut raster, height, top);
    Ok(raster)
}

fn empty(width: usize, height: usize) -> Result<Raster, CompareError> {
    match (u32::try_from(width), u32::try_from(height)) {
        (Ok(w), Ok(h)) => Ok(Raster { width: w, height: h, pixels: vec![GROUND; width * height] }),
        _ => Err(CompareError::Empty), // no window is that large
    }
}

/// The colour of a difference on the scale that ends at 10^top.
fn color(difference: f64, top: i32) -> [u8; 3] {
    if difference == 0.0 {
        EQUAL
    } else if difference.is_finite() {
        viridis((difference.log10() - f64::from(top)) / f64::from(DECADES) + 1.0)
    } else {
        NOT_FINITE
    }
}

/// The colour at a place in 0..1 of the map; nearer ends for places outside.
fn viridis(place: f64) -> [u8; 3] {
    let last = VIRIDIS.len() - 1;
    let place = place.clamp(0.0, 1.0) * last as f64;
    let below = (place as usize).min(last - 1);
    let part = place - below as f64;
    let mix = |channel: usize| {
        let (from, to) = (f64::from(VIRIDIS[below][channel]), f64::from(VIRIDIS[below + 1][channel]));
        (from + part * (to - from)).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}

/// The scale bar: a black field for "equal", then the colours from left to right, marks and numbers beneath.
struct Bar {
    /// Pixels a length of 1 has: more on large pictures.
    unit: usize,
    width: usize,
    height: usize,
}

/// Lengths in units: the two fields, their height, and where they stand.
const MARGIN: usize = 6;
const FIELD: usize = 16;
const DECADE: usize = 56;
const COLORS: usize = MARGIN + FIELD + 24;
const THICK: usize = 12;
const NUMBERS: usize = MARGIN + THICK + 6;

impl Bar {
    fn new(picture_width: usize) -> Self {
        let unit = (picture_width / 640).max(1);
        let width = COLORS + DECADE * DECADES as usize + 24;
        Bar { unit, width: width * unit, height: (NUMBERS + 2 * canvas::CHARACTER.1 + MARGIN) * unit }
    }

    fn draw(&self, raster: &mut Raster, y: usize, top: i32) {
        let scaled = |[left, above, width, height]: [usize; 4]| {
            [left * self.unit, y + above * self.unit, width * self.unit, height * self.unit]
        };
        let length = DECADE * DECADES as usize;
        canvas::fill(raster, scaled([MARGIN - 1, MARGIN - 1, FIELD + 2, THICK + 2]), INK);
        canvas::fill(raster, scaled([MARGIN, MARGIN, FIELD, THICK]), EQUAL);
        for step in 0..length {
            let place = (step as f64 + 0.5) / length as f64;
            canvas::fill(raster, scaled([COLORS + step, MARGIN, 1, THICK]), viridis(place));
        }
        self.number(raster, "0", MARGIN + FIELD / 2, y);
        for decade in 0..=DECADES {
            let x = COLORS + DECADE * decade as usize;
            canvas::fill(raster, scaled([x, MARGIN + THICK, 1, 4]), INK);
            self.number(raster, &format!("1e{}", top - DECADES + decade), x, y);
        }
    }

    /// A number centred below `x`, in dots of two units.
    fn number(&self, raster: &mut Raster, text: &str, x: usize, y: usize) {
        let half = (canvas::CHARACTER.0 * text.len()).saturating_sub(1);
        let place = (x.saturating_sub(half) * self.unit, y + NUMBERS * self.unit);
        canvas::write(raster, text, place, 2 * self.unit, INK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;

    fn picture(width: u32, height: u32) -> Picture {
        let mut picture = Picture::new((width, height), Window::full((width, height)));
        picture.pixels.fill([0.0, 0.0, 0.0, 1.0]);
        picture
    }

    #[test]
    fn colors_follow_the_decades() {
        assert_eq!((color(0.0, 0), color(f64::INFINITY, 0)), (EQUAL, NOT_FINITE));
        assert_eq!((color(1.0, 0), color(1e-9, 0), color(1e-4, 0)), (VIRIDIS[16], VIRIDIS[0], VIRIDIS[0]));
        assert_eq!((color(0.01, 0), color(0.01, 1), color(1e-3, -1)), (VIRIDIS[8], VIRIDIS[4], VIRIDIS[8]));
    }

    /// Relative luminance never falls along the map, so that more is always lighter.
    #[test]
    fn lighter_means_more() {
        let luma = |[r, g, b]: [u8; 3]| 2126 * u32::from(r) + 7152 * u32::from(g) + 722 * u32::from(b);
        // Finer steps would show the rounding to whole codes.
        let steps: Vec<u32> = (0..=64).map(|i| luma(viridis(f64::from(i) / 64.0))).collect();
        assert!(steps.is_sorted() && steps[0] < steps[64] / 4, "{steps:?}");
    }

    #[test]
    fn each_pixel_has_its_place_and_the_bar_its_colors() {
        let (a, mut b) = (picture(300, 20), picture(300, 20));
        b.pixels[300 * 7 + 9][2] = 0.2;
        b.pixels[300 * 8 + 10][0] = 0.02;
        b.pixels[300 * 8 + 11][1] = f32::NAN;
        let map = heatmap(&a, &b).unwrap();
        let at = |x: usize, y: usize| map.pixels[y * map.width as usize + x];
        assert_eq!((at(0, 0), at(9, 7), at(11, 8)), (EQUAL, color(0.2, 0), NOT_FINITE));
        assert_eq!(at(10, 8), color(0.02, 0));
        // The mark "1e-2" stands where its colour is.
        assert_eq!(at(COLORS + 2 * DECADE, 20 + MARGIN), viridis(0.5 + 0.5 / 224.0));
        assert_eq!(at(COLORS + 2 * DECADE, 20 + MARGIN + THICK), INK);
    }

    #[test]
    fn any_size_and_any_difference_has_a_map() {
        for (width, height) in [(1, 1), (5, 900), (2000, 3)] {
            let a = picture(width, height);
            let mut b = a.clone();
            let map = heatmap(&a, &b).unwrap();
            assert_eq!(map.pixels.len(), (map.width * map.height) as usize);
            assert!(map.width >= width && map.height > height);
            for value in [f32::MIN_POSITIVE, f32::MAX, f32::INFINITY] {
                b.pixels[0][0] = value;
                assert_eq!(heatmap(&a, &b).unwrap().pixels.len(), map.pixels.len());
            }
        }
        assert!(heatmap(&picture(2, 2), &picture(2, 3)).is_err());
    }
}
