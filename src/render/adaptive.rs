//! Sampling a tile until it is good enough.
//!
//! A tile consists of cells, each with a number of samples of its own: as long as the tile is not good enough, that of the cell
//! where more samples help most is doubled. So noise in a part of a tile costs samples there and not elsewhere. All
//! samples of a pixel are those of one sequence: it has the bits that as many samples for all would give.
//!
//! The two halves of each doubling are spread evenly by themselves. As neither half differs from the other in law, the mean
//! square of half the difference of their means is `V(n/2) - V(n)`, where `V(n)` is the variance of a mean of n samples:
//! exactly, however the halves depend on each other. How fast `V` falls is seen by comparing these from doubling to
//! doubling while all cells have as many samples; where it falls by a factor `f`, the variance is that difference over
//! `f - 1`.

use std::ops::Range;

/// Least samples of a pixel.
const LEAST: u32 = 8;
/// Most samples of a pixel.
const MOST: u32 = 4096;
/// What keeps relative errors finite on black, in squared radiance: values below 0.1 count as that.
const EPSILON: f64 = 0.01;
/// A cell counts as at least this part as noisy as its neighbours.
const SPREAD: f64 = 1.0 / 16.0;
/// By which factor the variance falls with twice the samples: from that of random points to that of edges in the four
/// dimensions of pixel and light, `n^(-5/4)`. Where at first it falls faster, edges decide in the end.
const FALL: [f64; 2] = [2.0, 2.38];

/// How good is good enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Relative error of a tile: the root of the mean of `V / (v^2 + 0.01)` over its pixels and channels, where `v` is the
    /// value and `V` the variance of its mean. So its square is the relative mean squared error of image metrics.
    pub target: f64,
}

/// What was spent on a tile, and what came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Effort {
    /// Samples of each pixel, row by row.
    pub samples: Vec<u32>,
    /// Estimated square of the standard error by channel, row by row.
    pub variance: Vec<[f32; 3]>,
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
    error: f64,
    met: bool,
}

impl Effort {
    /// All of it but what is said of single pixels.
    pub fn spent(&self) -> Spent {
        let pixels = self.variance.len() as u64;
        let samples = self.samples.iter().map(|samples| u64::from(*samples)).sum();
        Spent { samples, pixels, error: self.error, met: self.met }
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

/// The cells of a tile, row by row.
#[derive(Debug, Clone)]
pub struct Cells {
    /// Cells in a row.
    pub columns: usize,
    /// Pixels of each, by their places in the tile.
    pub pixels: Vec<Vec<usize>>,
}

impl Cells {
    fn count(&self) -> usize {
        self.pixels.len()
    }

    /// Those that touch a cell, and itself.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> {
        let (x, y, columns, rows) =
            (cell % self.columns, cell / self.columns, self.columns, self.count() / self.columns);
        let rows = y.saturating_sub(1)..(y + 2).min(rows);
        rows.flat_map(move |row| (x.saturating_sub(1)..(x + 2).min(columns)).map(move |column| row * columns + column))
    }
}

/// Sums of colours and alphas, row by row.
pub type Sums = Vec<[f64; 4]>;

/// Colours and alphas, row by row.
pub type Pixels = Vec<[f32; 4]>;

impl Noise {
    /// Samples a tile whose cells have these pixels. `draw` adds some samples of a cell to the sums of its pixels; `None`
    /// stops it all.
    pub fn sample(
        &self,
        cells: &Cells,
        mut draw: impl FnMut(usize, &mut Sums, Range<u32>) -> Option<()>,
    ) -> Option<(Pixels, Effort)> {
        let mut tile = Tile::new(cells);
        (0..cells.count()).try_for_each(|cell| tile.begin(cell, &mut draw))?;
        tile.double_all(&mut draw)?;
        let before = tile.squares();
        tile.double_all(&mut draw)?;
        let fall = before / tile.squares();
        // Not a number where nothing differs.
        tile.fall = if fall >= FALL[0] { fall.min(FALL[1]) } else { FALL[0] };
        while tile.error() > self.target {
            let Some(cell) = tile.worst() else { break };
            tile.double(cell, &mut draw)?;
        }
        Some(tile.finish(self.target))
    }
}

/// A tile in the making.
struct Tile<'a> {
    cells: &'a Cells,
    /// Samples of a pixel, and the sum of the relative `squares`, by cell.
    state: Vec<(u32, f64)>,
    sums: Sums,
    /// Of half the difference between the means of the first half of the samples and of the second.
    squares: Vec<[f64; 3]>,
    fall: f64,
}

impl<'a> Tile<'a> {
    fn new(cells: &'a Cells) -> Self {
        let pixels = cells.pixels.iter().map(Vec::len).sum();
        let (sums, squares) = (vec![[0.0; 4]; pixels], vec![[0.0; 3]; pixels]);
        Tile { cells, state: vec![(0, 0.0); cells.count()], sums, squares, fall: FALL[0] }
    }

    fn begin(&mut self, cell: usize, draw: &mut impl FnMut(usize, &mut Sums, Range<u32>) -> Option<()>) -> Option<()> {
        self.state[cell].0 = LEAST / 4;
        draw(cell, &mut self.sums, 0..LEAST / 4)
    }

    fn double_all(&mut self, draw: &mut impl FnMut(usize, &mut Sums, Range<u32>) -> Option<()>) -> Option<()> {
        (0..self.cells.count()).try_for_each(|cell| self.double(cell, draw))
    }

    /// Twice the samples for a cell.
    fn double(&mut self, cell: usize, draw: &mut impl FnMut(usize, &mut Sums, Range<u32>) -> Option<()>) -> Option<()> {
        let (pixels, count) = (&self.cells.pixels[cell], self.state[cell].0);
        let first: Vec<_> = pixels.iter().map(|pixel| self.sums[*pixel]).collect();
        draw(cell, &mut self.sums, count..2 * count)?;
        let (share, mut sum) = (0.5 / f64::from(count), 0.0);
        for (pixel, first) in pixels.iter().zip(first) {
            let both = &self.sums[*pixel];
            let squares = std::array::from_fn(|k| ((2.0 * first[k] - both[k]) * share).powi(2));
            sum += (0..3).map(|k| squares[k] / ((both[k] * share).powi(2) + EPSILON)).sum::<f64>();
            self.squares[*pixel] = squares;
        }
        self.state[cell] = (2 * count, sum);
        Some(())
    }

    /// The cell where more samples help most for what they cost. What a cell does not know yet its neighbours may: it
    /// counts as at least a part as noisy as they are.
    fn worst(&self) -> Option<usize> {
        // Of one sample.
        let noise = |cell: usize| self.state[cell].1 * f64::from(self.state[cell].0);
        let gain = |cell: &usize| {
            let about = self.cells.around(*cell).map(noise).fold(0.0, f64::max);
            noise(*cell).max(about * SPREAD) / f64::from(self.state[*cell].0).powi(2)
        };
        let open = (0..self.cells.count()).filter(|cell| self.state[*cell].0 < MOST);
        let best = open.map(|cell| (gain(&cell), cell)).filter(|(gain, _)| *gain > 0.0);
        best.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))).map(|(_, cell)| cell)
    }

    fn squares(&self) -> f64 {
        self.state.iter().map(|(_, squares)| squares).sum()
    }

    fn error(&self) -> f64 {
        (self.squares() / (self.fall - 1.0) / (3.0 * self.sums.len() as f64)).sqrt()
    }

    fn finish(self, target: f64) -> (Pixels, Effort) {
        let mut samples = vec![0; self.sums.len()];
        for (pixels, (count, _)) in self.cells.pixels.iter().zip(&self.state) {
            pixels.iter().for_each(|pixel| samples[*pixel] = *count);
        }
        let mean = |(sum, count): (&[f64; 4], &u32)| sum.map(|x| (x * (1.0 / f64::from(*count))) as f32);
        let pixels = self.sums.iter().zip(&samples).map(mean).collect();
        let variance = self.squares.iter().map(|squares| squares.map(|x| (x / (self.fall - 1.0)) as f32)).collect();
        let error = self.error();
        (pixels, Effort { samples, variance, error, met: error <= target })
    }
}

impl Reached {
    /// Sums up the tiles of a picture.
    pub fn of(target: f64, tiles: impl Iterator<Item = Spent>) -> Self {
        let mut reached = Reached { target, error: 0.0, worst: 0.0, short: 0, samples: 0, pixels: 0 };
        let mut squares = 0.0;
        for tile in tiles {
            squares += tile.pixels as f64 * tile.error.powi(2);
            reached.pixels += tile.pixels;
            reached.samples += tile.samples;
            reached.short += u64::from(!tile.met);
            reached.worst = reached.worst.max(tile.error);
        }
        reached.error = (squares / (reached.pixels.max(1) as f64)).sqrt();
        reached
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::{Pattern, pixel_key, unit};

    const EDGE: usize = 32;

    /// Squares of 8 x 8 pixels.
    fn cells() -> Cells {
        let pixels = |cell: usize| (0..64).map(move |i| (cell / 4 * 8 + i / 8) * EDGE + cell % 4 * 8 + i % 8);
        Cells { columns: 4, pixels: (0..16).map(|cell| pixels(cell).collect()).collect() }
    }

    /// A tile of which one channel is `1 + value(pixel, sample)` and two are 1, sampled.
    fn sampled(target: f64, value: impl Fn(u64, u32) -> f64) -> (Pixels, Effort) {
        let cells = cells();
        let draw = |cell: usize, sums: &mut Sums, range: Range<u32>| {
            for pixel in &cells.pixels[cell] {
                let new: f64 = range.clone().map(|sample| 1.0 + value(*pixel as u64, sample)).sum();
                let [r, rest @ ..] = &mut sums[*pixel];
                *r += new;
                rest.iter_mut().for_each(|x| *x += range.len() as f64);
            }
            Some(())
        };
        Noise { target }.sample(&cells, draw).unwrap()
    }

    /// The error that is told over the one that is there.
    fn told((pixels, effort): &(Pixels, Effort)) -> f64 {
        let squares: f64 = pixels.iter().map(|pixel| f64::from(pixel[0] - 1.0).powi(2) / 1.01).sum();
        effort.error / (squares / (3.0 * pixels.len() as f64)).sqrt()
    }

    fn mean_samples(effort: &Effort) -> f64 {
        effort.samples.iter().map(|samples| f64::from(*samples)).sum::<f64>() / effort.samples.len() as f64
    }

    fn random(pixel: u64, sample: u32) -> f64 {
        unit(pixel_key(77, pixel as i32, sample as i32)) - 0.5
    }

    /// With random samples of deviation s around m the samples needed are (s/(m T))^2, and the error told is the one
    /// there is.
    #[test]
    fn a_tile_takes_the_samples_it_needs() {
        for target in [0.05, 0.02, 0.5] {
            let found = sampled(target, random);
            // One channel of three is noisy.
            let needed = 1.0 / 12.0 / target.powi(2) / 3.0;
            let samples = mean_samples(&found.1);
            assert!(found.1.met && (samples == 8.0 || samples < 1.3 * needed) && samples > 0.8 * needed, "{samples}");
            assert!((told(&found) - 1.0).abs() < 0.15, "{}", told(&found));
        }
    }

    /// Where a sixteenth of a tile is noisy, and is 1/16 of what as many samples for all would take.
    #[test]
    fn samples_go_where_the_noise_is() {
        let cell = |pixel: u64| pixel % 32 < 8 && pixel / 32 < 8;
        let found = sampled(0.005, |pixel, sample| if cell(pixel) { random(pixel, sample) } else { 0.0 });
        let needed = 1.0 / 12.0 / 0.005f64.powi(2) / 3.0 / 16.0;
        assert!(found.1.met && found.1.samples[0] >= 64 && found.1.samples[31] == 8, "{}", found.1.samples[0]);
        assert!(f64::from(found.1.samples[0]) > 0.8 * needed && f64::from(found.1.samples[0]) < 2.3 * needed);
        assert!((told(&found) - 1.0).abs() < 0.25, "{}", told(&found));
    }

    /// A straight edge through each pixel, anywhere: the pattern does far better than random points, which is seen.
    #[test]
    fn what_a_pattern_gains_is_seen() {
        let edge = |pixel: u64, sample: u32| {
            let [x, y] = Pattern::new(pixel_key(5, pixel as i32, 0), 0).sample(sample).map(unit);
            let place = unit(pixel_key(6, pixel as i32, 0));
            let slope = unit(pixel_key(7, pixel as i32, 0)) - 0.5;
            let covered = |y: f64| place + slope * (y - 0.5);
            let share = (0..512).map(|i| covered((f64::from(i) + 0.5) / 512.0).clamp(0.0, 1.0)).sum::<f64>() / 512.0;
            f64::from(u8::from(x < covered(y))) - share
        };
        for target in [0.02, 0.005] {
            let found = sampled(target, edge);
            let (ratio, samples) = (told(&found), mean_samples(&found.1));
            let random = (1.0 / 6.0 / samples / 3.0).sqrt();
            assert!(found.1.met && ratio > 0.85 && ratio < 1.5, "{target} {ratio} {samples}");
            assert!(found.1.error < 0.7 * random, "{} {random}", found.1.error);
        }
    }

    #[test]
    fn what_is_black_or_still_stops_at_once_and_the_rest_stops_in_the_end() {
        let cells = Cells { columns: 1, pixels: vec![(0..10).collect()] };
        let run = |value: fn(u32) -> f64| {
            let draw = |_, sums: &mut Sums, range: Range<u32>| {
                sums.iter_mut().for_each(|sum| range.clone().for_each(|i| *sum = sum.map(|x| x + value(i))));
                Some(())
            };
            Noise { target: 0.01 }.sample(&cells, draw).unwrap().1
        };
        assert_eq!(run(|_| 0.5).samples, [LEAST; 10]);
        assert!(run(|_| 0.0).met);
        // Each new half is brighter.
        let effort = run(|i| f64::from(i + 1));
        assert!(!effort.met && effort.samples == [MOST; 10], "{effort:?}");
        let reached = Reached::of(0.01, [effort.spent(); 2].into_iter());
        assert!(reached.short == 2 && reached.samples == 20 * u64::from(MOST), "{reached:?}");
        assert!((reached.error / effort.error - 1.0).abs() < 1e-6, "{reached:?}");
        assert!(Noise { target: 0.01 }.sample(&cells, |_, _, _| None).is_none());
    }
}
