//! The layers of a block in the making, and as channels.

use glam::{DVec2, DVec3};

use super::matte::{Rank, Tally, ranked};
use super::near::{Batches, Near};
use super::{LayerPlan, MOST_MARGIN};
use crate::film::Samples;
use crate::lanes::{Float8, LANES, Vec3x8};
use crate::scene::Aov;
use crate::shapes::RowRef;

/// Sums and choices of a block's pixels, row by row; empty where no layer needs them.
#[derive(Debug)]
pub(in crate::render) struct Sums {
    pixels: usize,
    /// Samples of each pixel.
    spp: u32,
    /// Sums of what passes the pixel filter, by axis: samples are drawn from it, so all weigh the same.
    pub normal: Filtered,
    pub albedo: Filtered,
    /// Sums of shares: box tests, primitive tests, live lanes, lanes.
    pub cost: Vec<[f64; 4]>,
    pub near: Vec<Near>,
    batches: Vec<Batches>,
    batch: u32,
    tallies: [Option<Tally>; Aov::CRYPTOMATTES.len()],
}

/// Sums of three values of each pixel, by value; empty where no layer needs them.
#[derive(Debug)]
pub(in crate::render) struct Filtered([Vec<f64>; 3]);

impl Filtered {
    fn new(pixels: usize) -> Self {
        Filtered([(); 3].map(|()| vec![0.0; pixels]))
    }

    pub fn is_empty(&self) -> bool {
        self.0[0].is_empty()
    }

    /// Adds the values of eight samples to their pixels, in the order of the lanes; misses have 0.
    #[inline]
    pub fn add8(&mut self, values: &Vec3x8, pixels: &[u32; LANES]) {
        let axes = [values.x, values.y, values.z].map(Float8::to_array);
        let one = pixels.iter().all(|pixel| *pixel == pixels[0]);
        for (sums, values) in self.0.iter_mut().zip(axes) {
            if one {
                let sum = &mut sums[pixels[0] as usize];
                *sum = values.iter().fold(*sum, |sum, value| sum + f64::from(*value));
            } else {
                for (pixel, value) in pixels.iter().zip(values) {
                    sums[*pixel as usize] += f64::from(value);
                }
            }
        }
    }

    /// Adds one sample to a pixel.
    pub fn add(&mut self, pixel: usize, value: DVec3) {
        if !self.is_empty() {
            self.0.iter_mut().zip(value.to_array()).for_each(|(sums, value)| sums[pixel] += value);
        }
    }

    fn means(&self, spp: u32) -> impl Iterator<Item = Samples> {
        let share = 1.0 / f64::from(spp);
        self.0.iter().map(move |sums| Samples::Half(sums.iter().map(|sum| (sum * share) as f32).collect()))
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
    pub fn new(plan: &LayerPlan, pixels: usize, spp: u32) -> Self {
        let layers = plan.layers;
        let room = |aovs: &[Aov]| if layers.has_any(aovs) { pixels } else { 0 };
        Sums {
            pixels,
            spp,
            normal: Filtered::new(room(&[Aov::Normal])),
            albedo: Filtered::new(room(&[Aov::Albedo])),
            cost: vec![[0.0; 4]; room(&[Aov::Cost])],
            near: vec![Near::NONE; room(&[Aov::Depth, Aov::Position, Aov::Uv, Aov::Motion, Aov::Ids, Aov::Margin])],
            batches: vec![Batches::default(); room(&[Aov::Variance])],
            batch: Batches::size(spp),
            tallies: Aov::CRYPTOMATTES.map(|aov| layers.has(aov).then(|| Tally::new(pixels))),
        }
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

    /// All channels. `place` tells where the nearest sample of a pixel sees something.
    pub fn finish(self, plan: &LayerPlan, place: impl Fn(usize, &Near) -> Place) -> LayerWork {
        let mut work = LayerWork { channels: Vec::new(), seen: Default::default() };
        let wants_place = plan.layers.has_any(&[Aov::Position, Aov::Uv, Aov::Motion, Aov::Margin]);
        let places: Vec<_> = match wants_place {
            true => self.near.iter().enumerate().map(|(pixel, near)| placed(near, || place(pixel, near))).collect(),
            false => Vec::new(),
        };
        for aov in plan.layers.iter() {
            match aov {
                Aov::Depth => work.floats(self.near.iter().map(|near| near.depth)),
                Aov::Position => (0..3).for_each(|k| work.floats(places.iter().map(|place| place.point[k] as f32))),
                Aov::Normal => self.normal.means(self.spp).for_each(|mean| work.channels.push(mean)),
                Aov::Albedo => self.albedo.means(self.spp).for_each(|mean| work.channels.push(mean)),
                Aov::Uv => (0..2).for_each(|k| work.floats(places.iter().map(|place| place.uv[k] as f32))),
                Aov::Motion => {
                    let moves = self.near.iter().zip(&places).map(|(near, place)| match near.row {
                        RowRef::MISS => [0.0; 2],
                        _ => plan.motion(near, place.point),
                    });
                    let moves: Vec<_> = moves.collect();
                    (0..2).for_each(|k| work.floats(moves.iter().map(|way| way[k])));
                }
                Aov::Ids => self.add_ids(plan, &mut work),
                Aov::Samples => work.floats(std::iter::repeat_n(self.spp as f32, self.pixels)),
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

    fn add_ids(&self, plan: &LayerPlan, work: &mut LayerWork) {
        let seen = |near: &Near| near.row != RowRef::MISS;
        let number = |near: &Near, id: u32| if seen(near) { id + 1 } else { 0 };
        let objects = self.near.iter().map(|near| number(near, plan.objects.of(near.primitive)));
        work.channels.push(Samples::Uint(objects.collect()));
        work.channels.push(Samples::Uint(self.near.iter().map(|near| number(near, near.material)).collect()));
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
                pair[1][pixel] = (f64::from(rank.count) / f64::from(self.spp)) as f32;
            }
            work.seen[index].extend(ranks.iter().take(kept).map(|rank| rank.key));
        }
        work.seen[index].sort_unstable();
        work.seen[index].dedup();
        work.channels.extend(columns.into_iter().map(Samples::Float));
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
