//! Sampling a tile until it is good enough.
//!
//! The samples of a pixel come in two halves, each of a pattern of its own: so the halves are independent, and how far
//! apart their means are tells the error of both together without bias, however much better than random points a
//! pattern is. Stopping at that very error is what little bias remains: a tile decides by a thousand pixels at once.

use std::ops::Range;

/// Most samples of a pixel, unless a scene asks for more to begin with.
const MOST: u32 = 4096;

/// How good is good enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Relative error of a tile: the root of the mean square of its pixels' standard errors over their mean.
    pub target: f64,
    /// Samples of each half to begin with.
    pub fewest: u32,
}

/// What was spent on a tile, and what came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Effort {
    /// Samples of each pixel.
    pub samples: u32,
    /// Estimated square of the standard error by channel, row by row.
    pub variance: Vec<[f32; 3]>,
    /// Sum of the values of all pixels and channels.
    pub sum: f64,
    /// Relative error.
    pub error: f64,
    /// Whether that is the one asked for.
    pub met: bool,
}

/// What was spent on a tile, in numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spent {
    /// Of all of its pixels.
    samples: u64,
    pixels: u64,
    /// Sum of the values of all pixels and channels, and of the squares of their standard errors.
    sum: f64,
    squares: f64,
    error: f64,
    met: bool,
}

impl Effort {
    /// All of it but what is said of single pixels.
    pub fn spent(&self) -> Spent {
        let pixels = self.variance.len() as u64;
        let squares = self.variance.iter().flatten().map(|square| f64::from(*square)).sum();
        let samples = pixels * u64::from(self.samples);
        Spent { samples, pixels, sum: self.sum, squares, error: self.error, met: self.met }
    }
}

/// What a render to a noise level came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reached {
    /// Relative error asked for.
    pub target: f64,
    /// That of the whole picture.
    pub error: f64,
    /// That of the worst tile.
    pub worst: f64,
    /// Tiles that had as many samples as there are, and were not good enough.
    pub short: u64,
    /// Samples of all pixels of all tiles, beyond a crop as well.
    pub samples: u64,
    /// Those pixels.
    pub pixels: u64,
}

impl Noise {
    /// To a relative error, with so many samples a pixel to begin with.
    pub fn new(target: f64, spp: u32) -> Self {
        Noise { target, fewest: (spp / 2).max(4) }
    }

    /// Samples a tile. `draw` gives the means of some samples of a half, row by row, or `None` to stop it all.
    pub fn sample(&self, draw: impl FnMut(usize, Range<u32>) -> Option<Vec<[f32; 4]>>) -> Option<(Pixels, Effort)> {
        let (mut halves, mut draw) = (Halves::default(), draw);
        let most = self.fewest.max(MOST / 2);
        let mut next = self.fewest;
        loop {
            let range = halves.count..next;
            for half in 0..2 {
                halves.add(half, &range, &draw(half, range.clone())?);
            }
            halves.count = next;
            let effort = halves.effort(self.target);
            if effort.met || next == most {
                return Some((halves.pixels(), effort));
            }
            // Powers of two and one between each two: patterns are best there.
            let power = 1 << next.ilog2();
            next = if next < power + power / 2 { power + power / 2 } else { 2 * power };
            next = next.min(most);
        }
    }
}

/// Colours and alphas, row by row.
pub type Pixels = Vec<[f32; 4]>;

/// Sums of both halves.
#[derive(Default)]
struct Halves {
    sums: [Vec<[f64; 4]>; 2],
    count: u32,
}

impl Halves {
    fn add(&mut self, half: usize, range: &Range<u32>, means: &[[f32; 4]]) {
        let (sums, samples) = (&mut self.sums[half], range.len() as f64);
        sums.resize(means.len(), [0.0; 4]);
        for (sum, mean) in sums.iter_mut().zip(means) {
            *sum = std::array::from_fn(|k| sum[k] + samples * f64::from(mean[k]));
        }
    }

    fn pixels(&self) -> Pixels {
        let share = 0.5 / f64::from(self.count);
        let both = self.sums[0].iter().zip(&self.sums[1]);
        both.map(|(a, b)| std::array::from_fn(|k| ((a[k] + b[k]) * share) as f32)).collect()
    }

    fn effort(&self, target: f64) -> Effort {
        let share = 0.5 / f64::from(self.count);
        let (mut sum, mut squares) = (0.0, 0.0);
        let mut variance = Vec::with_capacity(self.sums[0].len());
        for (a, b) in self.sums[0].iter().zip(&self.sums[1]) {
            let square: [f64; 3] = std::array::from_fn(|k| ((a[k] - b[k]) * share).powi(2));
            sum += (0..3).map(|k| (a[k] + b[k]) * share).sum::<f64>();
            squares += square.iter().sum::<f64>();
            variance.push(square.map(|square| square as f32));
        }
        let error = relative(squares, sum, 3 * variance.len());
        Effort { samples: 2 * self.count, variance, sum, error, met: error <= target }
    }
}

/// The root of a mean square over a mean; 0 where both are.
fn relative(squares: f64, sum: f64, count: usize) -> f64 {
    if squares == 0.0 { 0.0 } else { (squares * count as f64).sqrt() / sum }
}

impl Reached {
    /// Sums up the tiles of a picture.
    pub fn of(target: f64, tiles: impl Iterator<Item = Spent>) -> Self {
        let mut reached = Reached { target, error: 0.0, worst: 0.0, short: 0, samples: 0, pixels: 0 };
        let (mut squares, mut sum) = (0.0, 0.0);
        for tile in tiles {
            squares += tile.squares;
            sum += tile.sum;
            reached.pixels += tile.pixels;
            reached.samples += tile.samples;
            reached.short += u64::from(!tile.met);
            reached.worst = reached.worst.max(tile.error);
        }
        reached.error = relative(squares, sum, 3 * reached.pixels as usize);
        reached
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hash as a number of mean 0 and variance 1/12.
    fn noise(half: usize, pixel: u64, sample: u32) -> f64 {
        let key = crate::sample::pixel_key(half as u64 + 77, pixel as i32, sample as i32);
        crate::sample::unit(key) - 0.5
    }

    /// With random samples of deviation s around m the samples needed are (s/(m T))^2, and the error told is the one
    /// there is.
    #[test]
    fn a_tile_takes_the_samples_it_needs() {
        let deviation = 1f64 / 12f64.sqrt();
        for target in [0.05, 0.02, 0.5] {
            let mean = |half: usize, range: &Range<u32>, pixel: u64| {
                let sum: f64 = range.clone().map(|sample| noise(half, pixel, sample)).sum();
                (1.0 + sum / range.len() as f64) as f32
            };
            let draw = |half: usize, range: Range<u32>| {
                Some((0..1024).map(|pixel| [mean(half, &range, pixel), 1.0, 1.0, 1.0]).collect())
            };
            let (pixels, effort) = Noise::new(target, 8).sample(draw).unwrap();
            // One channel of three is noisy.
            let needed = (deviation / target).powi(2) / 3.0;
            let samples = f64::from(effort.samples);
            assert!(effort.met && (samples == 8.0 || samples < 2.2 * needed) && samples > 0.8 * needed, "{effort:?}");
            let squares: f64 = pixels.iter().map(|pixel| f64::from(pixel[0] - 1.0).powi(2)).sum();
            let real = (squares / 3072.0).sqrt();
            assert!((real / effort.error - 1.0).abs() < 0.1, "{real} {}", effort.error);
        }
    }

    #[test]
    fn what_is_black_or_still_stops_at_once_and_the_rest_stops_in_the_end() {
        let still = |_, _| Some(vec![[0.0, 0.0, 0.5, 1.0]; 10]);
        assert_eq!(Noise::new(0.01, 16).sample(still).unwrap().1.samples, 16);
        let black = |_, _| Some(vec![[0.0; 4]; 10]);
        assert!(Noise::new(0.01, 16).sample(black).unwrap().1.met);
        let parted = |half: usize, _| Some(vec![[half as f32; 4]; 10]);
        let (_, effort) = Noise::new(0.01, 16).sample(parted).unwrap();
        assert!(!effort.met && effort.samples == MOST && (effort.error - 1.0).abs() < 1e-12);
        let reached = Reached::of(0.01, [effort.spent(); 2].into_iter());
        assert!(reached.short == 2 && reached.samples == 20 * u64::from(MOST) && (reached.error - 1.0).abs() < 1e-6);
        assert!(Noise::new(0.01, 16).sample(|_, _| None).is_none());
    }
}
