//! Image metrics between two pictures of one size.
//!
//! Linear values are what the pictures hold: scene-linear, premultiplied. Display values are their sRGB codes as
//! real numbers: colour over black, clamped to 0..1, by the piecewise curve. A sample that is not finite equals
//! only its like (NaN any NaN); from any other sample it is infinitely far, so that no bound lets it pass.

use serde::Serialize;
use thiserror::Error;

use super::ssim::ssim;
use crate::film::{self, Cryptomatte, Picture, SampleKind, Samples, Window};
use crate::output::srgb;

/// What keeps the relative error finite on black, in squared radiance.
pub const REL_MSE_EPSILON: f64 = 0.01;

/// How two pictures `a` and `b` differ; `b` is the reference where it matters.
///
/// Serialised as JSON, every number that is not finite becomes `null`: `psnr` of pictures without a difference,
/// and the means where a sample is not finite in one picture only.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Version of these names: 1.
    pub schema: u32,
    /// Pixels compared.
    pub pixels: u64,
    /// Root of the mean squared difference of linear values: over red, green and blue, and over alpha as well
    /// unless both pictures are opaque.
    pub rmse: f64,
    /// Mean of `(a - b)^2 / (b^2 + 0.01)` over the same samples. The form is Rousselle, Knaus and Zwicker's,
    /// "Adaptive sampling and reconstruction using greedy error minimization", ACM Transactions on Graphics 30(6),
    /// 2011; the constant, [`REL_MSE_EPSILON`], differs from author to author.
    pub rel_mse: f64,
    /// `-10 log10` of the mean squared difference of display values (red, green, blue), whose peak is 1; in dB.
    pub psnr: f64,
    /// Mean structural similarity of the display values' luma, 1 where they are equal. Wang, Bovik, Sheikh and
    /// Simoncelli, "Image quality assessment: from error visibility to structural similarity", IEEE Transactions
    /// on Image Processing 13(4), 2004: Gaussian window of 11x11 pixels with standard deviation 1.5, K1 = 0.01,
    /// K2 = 0.03, windows wholly inside the picture (in a smaller picture, one as wide or high as the picture).
    pub ssim: f64,
    /// The largest difference in any channel; ids differ by 1 or not at all.
    pub max: Largest,
    /// Pixels with any sample that differs at all, as a share of all pixels.
    pub different_share: f64,
    /// Samples that are not finite in `a` or in `b`.
    pub non_finite: u64,
    /// Red, green, blue, alpha by themselves, then the layers that both pictures have, in the order of `a`.
    pub channels: Vec<Channel>,
    /// Layers that `b` does not have.
    pub only_a: Vec<String>,
    /// Layers that `a` does not have.
    pub only_b: Vec<String>,
}

/// The largest absolute difference of linear values; the first such sample of the picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Largest {
    /// The difference, >= 0; may be infinite.
    pub value: f64,
    /// Column in the display window.
    pub x: i32,
    /// Row in the display window.
    pub y: i32,
    /// "R", "G", "B", "A" or the full name of a layer.
    pub channel: String,
}

/// One channel of both pictures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Channel {
    /// "R", "G", "B", "A" or the full name of a layer.
    pub name: String,
    /// Pixels that differ at all, as a share of all pixels.
    pub different_share: f64,
    /// How far they differ; `None` of integers, which number things.
    #[serde(flatten)]
    pub spread: Option<Spread>,
}

/// The absolute differences of one channel, linear values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Root of the mean square.
    pub rmse: f64,
    /// Mean of `a - b`, with its sign: a picture that is brighter as a whole shows here.
    pub bias: f64,
    /// Half of the pixels differ by no more.
    pub p50: f64,
    /// 95 % of the pixels differ by no more.
    pub p95: f64,
    /// 99 % of the pixels differ by no more.
    pub p99: f64,
    /// The largest.
    pub max: f64,
}

/// Two pictures that cannot be compared.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum CompareError {
    /// The full frames have different sizes.
    #[error("the pictures have different sizes: {}x{} and {}x{}", .0.0, .0.1, .1.0, .1.1)]
    Size((u32, u32), (u32, u32)),
    /// The frames are of one size, but other parts of them are present.
    #[error("the pictures cover different parts of the frame: {0} and {1}")]
    Window(Window, Window),
    /// A picture without pixels, or whose list of pixels does not fill its window.
    #[error("the pictures hold no pixels to compare")]
    Empty,
}

const NAMES: [&str; 4] = ["R", "G", "B", "A"];

/// All metrics of two pictures.
///
/// # Errors
/// [`CompareError`]: sizes or windows that differ ([`Picture::crop`] can bring them together), no pixels.
pub fn compare(a: &Picture, b: &Picture) -> Result<Comparison, CompareError> {
    same_size(a, b)?;
    let count = if is_opaque(a) && is_opaque(b) { 3 } else { 4 };
    let pixels = a.pixels.len();
    let mut tally = Tally { different: vec![false; pixels], largest: (-1.0, 0, String::new()), non_finite: 0 };
    let colors: [Channel; 4] = std::array::from_fn(|index| {
        tally.add(NAMES[index], samples(a, b, index).map(|(a, b)| (f64::from(a), f64::from(b))))
    });
    let layers = a.channels.iter().filter_map(|layer| {
        let (own, other) = (&layer.samples, &b.channel(&layer.name)?.samples);
        let pairs = numbers(own).into_iter().zip(numbers(other));
        if ![a, b].into_iter().all(|picture| holds_ids(picture, &layer.name)) {
            return Some(tally.add(&layer.name, pairs));
        }
        // What is next to a number is no more like it than any other.
        let channel = tally.add(&layer.name, pairs.map(|(a, b)| (f64::from(u8::from(a != b)), 0.0)));
        Some(Channel { spread: None, ..channel })
    });
    let layers: Vec<Channel> = layers.collect();
    let mean = |values: [f64; 4]| values[..count].iter().sum::<f64>() / count as f64;
    let lacking = |a: &Picture, b: &Picture| {
        let names = a.channels.iter().map(|layer| layer.name.clone());
        names.filter(|name| b.channel(name).is_none()).collect()
    };
    Ok(Comparison {
        schema: 1,
        pixels: pixels as u64,
        rmse: mean(colors.each_ref().map(|channel| channel.spread.map_or(0.0, |spread| spread.rmse.powi(2)))).sqrt(),
        rel_mse: mean(std::array::from_fn(|index| relative(a, b, index))),
        psnr: psnr(a, b),
        ssim: ssim(&luma(a), &luma(b), a.window.width()),
        max: tally.largest(a.window),
        different_share: tally.different.iter().filter(|differs| **differs).count() as f64 / pixels as f64,
        non_finite: tally.non_finite,
        channels: colors.into_iter().chain(layers).collect(),
        only_a: lacking(a, b),
        only_b: lacking(b, a),
    })
}

/// Refuses pictures whose pixels do not lie upon each other.
pub(super) fn same_size(a: &Picture, b: &Picture) -> Result<(), CompareError> {
    if a.display != b.display {
        return Err(CompareError::Size(a.display, b.display));
    }
    if a.window != b.window {
        return Err(CompareError::Window(a.window, b.window));
    }
    if a.is_whole() && b.is_whole() { Ok(()) } else { Err(CompareError::Empty) }
}

/// `a - b`; 0 where both are NaN or the same infinity, infinite where only one is finite.
#[inline]
fn difference(a: impl Into<f64>, b: impl Into<f64>) -> f64 {
    let (a, b) = (a.into(), b.into());
    if a == b || (a.is_nan() && b.is_nan()) {
        0.0
    } else if a.is_finite() && b.is_finite() {
        a - b
    } else {
        f64::INFINITY
    }
}

/// The largest absolute difference among the channels of a pixel.
pub(super) fn pixel_difference(a: &[f32; 4], b: &[f32; 4]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| difference(a, b).abs()).fold(0.0, f64::max)
}

fn is_opaque(picture: &Picture) -> bool {
    picture.pixels.iter().all(|pixel| pixel[3] == 1.0)
}

/// Pairs of samples of one channel.
fn samples<'p>(a: &'p Picture, b: &'p Picture, channel: usize) -> impl Iterator<Item = (f32, f32)> + 'p {
    a.pixels.iter().zip(&b.pixels).map(move |(a, b)| (a[channel], b[channel]))
}

/// Whether a layer numbers things, as hashes of Cryptomattes do in floats.
fn holds_ids(picture: &Picture, layer: &str) -> bool {
    let is_rank =
        |matte: &Cryptomatte| layer.starts_with(&matte.name) && (layer.ends_with(".R") || layer.ends_with(".B"));
    let is_uint = |channel: &film::Channel| channel.samples.kind() == SampleKind::Uint;
    picture.channel(layer).is_some_and(is_uint) || picture.cryptomattes.iter().any(is_rank)
}

/// The samples of a layer; f64 holds all of them exactly.
fn numbers(samples: &Samples) -> Vec<f64> {
    match samples {
        Samples::Half(samples) => samples.iter().map(|sample| sample.to_f64()).collect(),
        Samples::Unrounded(samples) | Samples::Float(samples) => samples.iter().map(|&sample| sample.into()).collect(),
        Samples::Uint(samples) => samples.iter().map(|&sample| sample.into()).collect(),
    }
}

/// What is told of all channels together.
struct Tally {
    /// Of each pixel whether any channel differs.
    different: Vec<bool>,
    /// The largest difference, its pixel and its channel.
    largest: (f64, usize, String),
    non_finite: u64,
}

impl Tally {
    /// Measures a channel by its pairs of samples, one a pixel.
    fn add(&mut self, name: &str, pairs: impl Iterator<Item = (f64, f64)>) -> Channel {
        let count = self.different.len();
        let mut sizes = Vec::with_capacity(count);
        let (mut sum, mut squares, mut different) = (0.0, 0.0, 0);
        for (pixel, (a, b)) in pairs.enumerate() {
            let difference = difference(a, b);
            let size = difference.abs();
            sum += difference;
            squares += difference * difference;
            sizes.push(size);
            if size > 0.0 {
                different += 1;
                self.different[pixel] = true;
            }
            let (most, first, _) = self.largest;
            if size > most || (size == most && pixel < first) {
                self.largest = (size, pixel, name.to_owned());
            }
            self.non_finite += u64::from(!a.is_finite() || !b.is_finite());
        }
        let spread = Spread {
            rmse: (squares / count as f64).sqrt(),
            bias: sum / count as f64,
            p50: percentile(&mut sizes, 50),
            p95: percentile(&mut sizes, 95),
            p99: percentile(&mut sizes, 99),
            max: percentile(&mut sizes, 100),
        };
        Channel { name: name.to_owned(), different_share: f64::from(different) / count as f64, spread: Some(spread) }
    }

    fn largest(&self, window: Window) -> Largest {
        let (value, pixel, ref channel) = self.largest;
        let (x, y) = window.pixel(pixel);
        Largest { value, x, y, channel: channel.clone() }
    }
}

/// The smallest value that so many percent of all values do not exceed (nearest rank); `values` is not empty.
fn percentile(values: &mut [f64], percent: usize) -> f64 {
    let rank = (values.len() * percent).div_ceil(100).clamp(1, values.len()) - 1;
    *values.select_nth_unstable_by(rank, f64::total_cmp).1
}

fn relative(a: &Picture, b: &Picture, index: usize) -> f64 {
    let term = |(a, b): (f32, f32)| {
        let difference = difference(a, b);
        // An infinite reference would turn an infinite difference into NaN.
        let scale = if b.is_finite() { f64::from(b).powi(2) } else { 0.0 };
        difference * difference / (scale + REL_MSE_EPSILON)
    };
    samples(a, b, index).map(term).sum::<f64>() / a.pixels.len() as f64
}

fn psnr(a: &Picture, b: &Picture) -> f64 {
    let squares = a.pixels.iter().zip(&b.pixels).flat_map(|(a, b)| {
        (0..3).map(|channel| {
            let (a, b) = (a[channel], b[channel]);
            if difference(a, b).is_infinite() { f64::INFINITY } else { (display(a) - display(b)).powi(2) }
        })
    });
    -10.0 * (squares.sum::<f64>() / (3 * a.pixels.len()) as f64).log10()
}

/// The display value of a linear one; NaN is black.
fn display(linear: f32) -> f64 {
    srgb::encode(f64::from(srgb::unit(linear)))
}

/// Luma of display values with the weights of Rec. ITU-R BT.709.
fn luma(picture: &Picture) -> Vec<f64> {
    let luma = |&[r, g, b, _]: &[f32; 4]| 0.2126 * display(r) + 0.7152 * display(g) + 0.0722 * display(b);
    picture.pixels.iter().map(luma).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn noise(width: u32, height: u32, seed: u32) -> Picture {
        let mut picture = Picture::new((width, height), Window::full((width, height)));
        let mut state = seed;
        for pixel in &mut picture.pixels {
            *pixel = std::array::from_fn(|channel| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                if channel == 3 { 1.0 } else { (state >> 8) as f32 / (1 << 24) as f32 }
            });
        }
        picture
    }

    #[test]
    fn equal_pictures_have_no_difference() {
        let mut picture = noise(40, 30, 1);
        picture.pixels[77] = [f32::NAN, f32::INFINITY, -1.0, 0.5];
        let comparison = compare(&picture, &picture.clone()).unwrap();
        assert_eq!((comparison.rmse, comparison.rel_mse, comparison.psnr), (0.0, 0.0, f64::INFINITY));
        assert_eq!((comparison.ssim, comparison.different_share), (1.0, 0.0));
        assert_eq!(comparison.max, Largest { value: 0.0, x: 0, y: 0, channel: "R".into() });
        assert_eq!((comparison.pixels, comparison.non_finite), (1200, 2));
    }

    /// One sample of 12 pixels is off by 0.5, the others are equal.
    #[test]
    fn a_known_difference_is_found() {
        let b = Picture { pixels: vec![[0.25, 0.25, 0.25, 1.0]; 12].into(), ..noise(4, 3, 1) };
        let mut a = b.clone();
        a.pixels[6][1] = 0.75;
        let comparison = compare(&a, &b).unwrap();
        let close = |got: f64, want: f64| assert!((got - want).abs() < 1e-12 * want.abs(), "{got} {want}");
        close(comparison.rmse, (0.25f64 / 36.0).sqrt());
        close(comparison.rel_mse, 0.25 / (0.0625 + 0.01) / 36.0);
        let step = srgb::encode(0.75) - srgb::encode(0.25);
        close(comparison.psnr, -10.0 * (step * step / 36.0).log10());
        close(comparison.different_share, 1.0 / 12.0);
        assert_eq!(comparison.max, Largest { value: 0.5, x: 2, y: 1, channel: "G".into() });
        let green = comparison.channels[1].spread.unwrap();
        close(green.rmse, (0.25f64 / 12.0).sqrt());
        close(green.bias, 0.5 / 12.0);
        assert_eq!((green.p50, green.p95, green.p99, green.max), (0.0, 0.5, 0.5, 0.5));
        assert_eq!(comparison.channels[0].spread.unwrap().max, 0.0);
    }

    #[test]
    fn percentiles_are_nearest_ranks() {
        let mut values: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        let found = [1, 50, 95, 99, 100].map(|percent| percentile(&mut values, percent));
        assert_eq!(found, [2.0, 100.0, 190.0, 198.0, 200.0]);
        assert_eq!(percentile(&mut [3.0], 50), 3.0);
    }

    /// Alpha counts in the means as soon as either picture has any.
    #[test]
    fn alpha_is_compared() {
        let a = noise(8, 8, 3);
        let mut b = a.clone();
        b.pixels[9][3] = 0.0;
        let comparison = compare(&a, &b).unwrap();
        assert!((comparison.rmse - (1.0f64 / 256.0).sqrt()).abs() < 1e-15);
        assert_eq!(comparison.max, Largest { value: 1.0, x: 1, y: 1, channel: "A".into() });
    }

    #[test]
    fn a_nan_on_one_side_passes_no_bound() {
        let a = noise(16, 16, 5);
        let mut b = a.clone();
        b.pixels[20][2] = f32::NAN;
        for (a, b) in [(&a, &b), (&b, &a)] {
            let comparison = compare(a, b).unwrap();
            assert!(comparison.rmse > 1e30 && comparison.rel_mse > 1e30 && comparison.psnr < -1e30);
            assert_eq!(comparison.max, Largest { value: f64::INFINITY, x: 4, y: 1, channel: "B".into() });
            assert!(comparison.ssim < 1.0 && comparison.non_finite == 1);
            let json = serde_json::to_value(&comparison).unwrap();
            assert!(json["rmse"].is_null() && json["max"]["value"].is_null());
        }
    }

    #[test]
    fn layers_are_compared() {
        let layer = |name: &str, samples| film::Channel { name: name.into(), samples };
        let (mut a, mut b) = (noise(2, 1, 5), noise(2, 1, 5));
        let names = |a: u32| Samples::Uint(vec![a, 7].into());
        a.channels = vec![
            layer("depth.Z", Samples::Float(vec![1.0, 2.0].into())),
            layer("id.object", names(900)),
            layer("uv.U", Samples::Float(vec![0.0; 2].into())),
        ];
        b.channels = vec![
            layer("normal.X", Samples::halves(&[0.0; 2])),
            layer("id.object", names(1)),
            layer("depth.Z", Samples::halves(&[1.0, 7.0])),
        ];
        let found = compare(&a, &b).unwrap();
        assert_eq!((found.rmse, found.different_share), (0.0, 1.0));
        assert_eq!(found.max, Largest { value: 5.0, x: 1, y: 0, channel: "depth.Z".into() });
        let [depth, ids] = &found.channels[4..] else { panic!("{:?}", found.channels) };
        assert_eq!((depth.name.as_str(), depth.different_share), ("depth.Z", 0.5));
        assert_eq!(depth.spread.map(|spread| (spread.max, spread.bias)), Some((5.0, -2.5)));
        assert_eq!((ids.name.as_str(), ids.different_share, ids.spread), ("id.object", 0.5, None));
        assert_eq!((found.only_a, found.only_b), (vec!["uv.U".to_owned()], vec!["normal.X".to_owned()]));
    }

    #[test]
    fn the_json_has_the_promised_names() {
        let (a, b) = (noise(16, 16, 5), noise(16, 16, 6));
        let json = serde_json::to_value(compare(&a, &b).unwrap()).unwrap();
        assert_eq!(json["schema"], 1);
        for name in ["rmse", "rel_mse", "psnr", "ssim", "different_share"] {
            assert!(json[name].is_f64(), "{name}");
        }
        let max = &json["max"];
        assert!(max["value"].is_f64() && max["x"].is_i64() && max["y"].is_i64() && max["channel"].is_string());
        assert!(serde_json::to_value(compare(&a, &a).unwrap()).unwrap()["psnr"].is_null());
    }

    #[test]
    fn other_sizes_are_an_error_that_says_both() {
        let message = |a: &Picture, b: &Picture| compare(a, b).unwrap_err().to_string();
        let (a, b) = (noise(16, 8, 1), noise(8, 16, 1));
        assert_eq!(message(&a, &b), "the pictures have different sizes: 16x8 and 8x16");
        let part = a.crop(Window { x0: 2, y0: 3, x1: 10, y1: 7 }).unwrap();
        assert_eq!(message(&a, &part), "the pictures cover different parts of the frame: 16x8 at 0,0 and 8x4 at 2,3");
        let short = Picture { pixels: vec![[0.0; 4]; 3].into(), ..a.clone() };
        assert_eq!(compare(&a, &short), Err(CompareError::Empty));
        assert_eq!(compare(&part, &part).unwrap().max.x, 2);
    }
}
