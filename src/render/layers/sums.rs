//! The layers of a block in the making, and as channels.

use std::mem::take;

use glam::{DVec2, DVec3};

use super::filtered::Filtered;
use super::matte::{Rank, Tally, ranked};
use super::near::{Batches, Near, Nearest};
use super::{LayerPlan, MOST_MARGIN};
use crate::film::Samples;
use crate::lanes::{LANES, bits};
use crate::scene::Aov;
use crate::shapes::RowRef;

/// Sums and choices of a block's pixels, row by row; empty where no layer needs them.
#[derive(Debug)]
pub(in crate::render) struct Sums {
    pixels: usize,
    /// Samples of each pixel.
    spp: u32,
    /// The same where pixels differ.
    took: Vec<u32>,
    pub filtered: Filtered,
    /// Sums of shares: box tests, primitive tests, live lanes, lanes.
    pub cost: Vec<[f64; 4]>,
    nearest: Nearest,
    batches: Vec<Batches>,
    batch: u32,
    tallies: [Option<Tally>; Aov::CRYPTOMATTES.len()],
}

/// Samples of a packet.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Places<'a> {
    /// Their pixels.
    pub pixels: &'a [u32; LANES],
    /// Those that count.
    pub lanes: u32,
    /// Whether all lanes are of one pixel, whose samples are so many packets in any block.
    pub whole: bool,
    /// Where all lanes are the only samples of 4 x 2 pixels, the place of those below the first.
    pub below: Option<usize>,
}

impl Places<'_> {
    /// Sets the pixels of those that count; where all lanes are 4 x 2 pixels, all of them: the others are to hold what no
    /// sample sees.
    #[inline(always)]
    pub fn set<T: Copy>(&self, column: &mut [T], values: &[T; LANES]) {
        if let Some(below) = self.below {
            let first = self.pixels[0] as usize;
            column[first..first + 4].copy_from_slice(&values[..4]);
            column[below..below + 4].copy_from_slice(&values[4..]);
        } else if self.lanes == (1 << LANES) - 1 {
            (0..LANES).for_each(|i| column[self.pixels[i] as usize] = values[i]);
        } else {
            bits(self.lanes).for_each(|i| column[self.pixels[i] as usize] = values[i]);
        }
    }
}

/// The layers of a block, ready to be put where they belong.
#[derive(Debug)]
pub(in crate::render) struct LayerWork {
    /// In the order of the plan's channels.
    pub channels: Vec<Samples>,
    /// Keys that each Cryptomatte shows, in order.
    pub seen: [Vec<u32>; Aov::CRYPTOMATTES.len()],
}

impl Sums {
    /// For a block of so many pixels; `spp` is `None` where it is not known before how many samples each of them has.
    pub fn new(plan: &LayerPlan, pixels: usize, spp: Option<u32>) -> Self {
        let layers = plan.layers;
        let room = |aovs: &[Aov]| if layers.has_any(aovs) { pixels } else { 0 };
        let samples = spp.unwrap_or(plan.spp);
        Sums {
            pixels,
            spp: samples,
            took: Vec::new(),
            filtered: Filtered::new(layers, pixels, spp),
            cost: vec![[0.0; 4]; room(&[Aov::Cost])],
            nearest: Nearest::new(layers, pixels, spp),
            batches: vec![Batches::default(); room(&[Aov::Variance])],
            batch: Batches::size(samples),
            tallies: Aov::CRYPTOMATTES.map(|aov| layers.has(aov).then(|| Tally::new(pixels))),
        }
    }

    /// How many samples each pixel had, where that was not known before.
    pub fn took(&mut self, samples: &[u32]) {
        self.took = samples.to_vec();
    }

    fn samples(&self, pixel: usize) -> u32 {
        self.took.get(pixel).copied().unwrap_or(self.spp)
    }

    /// Whether the variance is asked for.
    pub fn want_variance(&self) -> bool {
        !self.batches.is_empty()
    }

    /// Adds the next sample's radiance to the variance of a pixel.
    #[inline]
    pub fn add_radiance(&mut self, pixel: usize, radiance: [f32; 3]) {
        self.batches[pixel].add(radiance, self.batch);
    }

    /// What is seen by the samples nearest to the centres.
    pub fn nearest(&mut self) -> &mut Nearest {
        &mut self.nearest
    }

    /// Whether any Cryptomatte is asked for.
    pub fn want_mattes(&self) -> bool {
        self.tallies.iter().any(Option::is_some)
    }

    /// Adds what a sample of a pixel saw to the Cryptomattes.
    pub fn add_to_mattes(&mut self, plan: &LayerPlan, pixel: usize, primitive: u32, material: u32) {
        for (tally, aov) in self.tallies.iter_mut().zip(Aov::CRYPTOMATTES) {
            if let Some(tally) = tally {
                tally.add(pixel, plan.key(aov, primitive, material));
            }
        }
    }

    /// Adds a light that a sample of a pixel saw, to the Cryptomattes and, where it is the nearest, to all that it tells.
    pub fn add_light(&mut self, plan: &LayerPlan, pixel: usize, light: usize, nearest: Option<(Near, f32)>) {
        for (tally, aov) in self.tallies.iter_mut().zip(Aov::CRYPTOMATTES) {
            if let Some(tally) = tally {
                tally.add(pixel, plan.light_key(aov, light));
            }
        }
        if let Some((near, depth)) = nearest {
            self.nearest.see(pixel, near, depth, plan.light_key(Aov::CryptoObject, light));
        }
    }

    /// All channels. `place` tells where the nearest sample of a pixel sees something.
    pub fn finish(mut self, plan: &LayerPlan, place: impl Fn(usize, &Near) -> Place) -> LayerWork {
        let mut work = LayerWork { channels: Vec::new(), seen: Default::default() };
        let near = take(&mut self.nearest.near);
        let places = near.iter().enumerate().map(|(pixel, near)| placed(near, || place(pixel, near)));
        let places: Vec<_> = places.collect();
        let filtered = take(&mut self.filtered);
        let [mut normal, mut albedo] = filtered.finish(|pixel| self.samples(pixel)).map(Vec::from);
        for aov in plan.layers.iter() {
            match aov {
                Aov::Depth => work.channels.push(Samples::Float(take(&mut self.nearest.depth).into())),
                Aov::Position => (0..3).for_each(|k| work.floats(places.iter().map(|place| place.point[k] as f32))),
                Aov::Normal => work.channels.append(&mut normal),
                Aov::Albedo => work.channels.append(&mut albedo),
                Aov::Uv => (0..2).for_each(|k| work.floats(places.iter().map(|place| place.uv[k] as f32))),
                Aov::Motion => {
                    let moves = near.iter().zip(&places).map(|(near, place)| match near.row {
                        RowRef::MISS => [0.0; 2],
                        _ => plan.motion(near, place.point),
                    });
                    let moves: Vec<_> = moves.collect();
                    (0..2).for_each(|k| work.floats(moves.iter().map(|way| way[k])));
                }
                Aov::Ids => {
                    let ids = [take(&mut self.nearest.objects), take(&mut self.nearest.materials)];
                    work.channels.extend(ids.map(|ids| Samples::Uint(ids.into())));
                }
                Aov::Samples => work.floats((0..self.pixels).map(|pixel| self.samples(pixel) as f32)),
                Aov::Variance => {
                    let all: Vec<_> = self.batches.iter().map(|batches| batches.variance(self.batch)).collect();
                    (0..3).for_each(|k| work.floats(all.iter().map(|variance| variance[k])));
                }
                Aov::Margin => work.floats(places.iter().map(|place| place.margin as f32)),
                Aov::Cost => {
                    (0..2).for_each(|k| work.floats(self.cost.iter().map(|cost| cost[k] as f32)));
                    work.floats(self.cost.iter().map(|cost| (cost[2] / cost[3].max(1.0)) as f32));
                }
                Aov::CryptoObject | Aov::CryptoMaterial | Aov::CryptoGroup => self.add_mattes(plan, aov, &mut work),
            }
        }
        work
    }

    fn add_mattes(&self, plan: &LayerPlan, aov: Aov, work: &mut LayerWork) {
        let index = aov as usize - Aov::CryptoObject as usize;
        let (Some(tally), kept) = (&self.tallies[index], usize::from(plan.layers.ranks)) else { return };
        let mut columns = vec![vec![0f32; self.pixels]; 2 * kept];
        let mut ranks: Vec<Rank> = Vec::new();
        for pixel in 0..self.pixels {
            ranked(tally.of(pixel), &plan.ids[index], &mut ranks);
            for (rank, pair) in ranks.iter().zip(columns.chunks_exact_mut(2)) {
                pair[0][pixel] = f32::from_bits(rank.id);
                pair[1][pixel] = (f64::from(rank.count) / f64::from(self.samples(pixel))) as f32;
            }
            work.seen[index].extend(ranks.iter().take(kept).map(|rank| rank.key));
        }
        work.seen[index].sort_unstable();
        work.seen[index].dedup();
        work.channels.extend(columns.into_iter().map(|column| Samples::Float(column.into())));
    }
}

impl LayerWork {
    fn floats(&mut self, samples: impl Iterator<Item = f32>) {
        self.channels.push(Samples::Float(samples.collect()));
    }
}

/// Where a sample sees something.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Place {
    /// World coordinates.
    pub point: DVec3,
    pub uv: DVec2,
    /// Of the decision, if that was asked for.
    pub margin: f64,
}

impl Place {
    /// What a miss has instead.
    pub const NONE: Place = Place { point: DVec3::ZERO, uv: DVec2::ZERO, margin: MOST_MARGIN };
}

fn placed(near: &Near, place: impl FnOnce() -> Place) -> Place {
    if near.row == RowRef::MISS {
        return Place::NONE;
    }
    let place = place();
    Place { margin: place.margin.clamp(-MOST_MARGIN, MOST_MARGIN), ..place }
}
