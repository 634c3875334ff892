//! What a pixel keeps: the sample nearest to its centre, and batches of samples for the variance of its mean.

use super::sums::Places;
use crate::lanes::{Float8, LANES, Mask8, bits, float8};
use crate::plan::Kind;
use crate::scene::{Aov, Layers};
use crate::shapes::RowRef;

/// What the sample nearest to a pixel's centre saw.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Near {
    /// Place of the hit on its ray.
    pub t: f32,
    /// What was met.
    pub row: RowRef,
    pub primitive: u32,
    pub material: u32,
    /// Its index.
    pub sample: u32,
}

impl Near {
    /// Nothing, or no sample yet.
    pub const NONE: Near = Near { t: 0.0, row: RowRef::MISS, primitive: 0, material: 0, sample: 0 };

    /// A light, which is no primitive; its material is a number of its own.
    pub fn light(t: f32, material: u32, sample: u32) -> Self {
        // A row of no store: any that is no miss will do.
        Near { t, row: RowRef::new(Kind::Sphere, 0), primitive: u32::MAX, material, sample }
    }

    /// Whether it is a light.
    pub fn is_light(&self) -> bool {
        self.primitive == u32::MAX
    }
}

/// What the samples nearest to the centres of a block's pixels saw, as far as layers need it: the rest is empty.
#[derive(Debug)]
pub(in crate::render) struct Nearest {
    /// Squares of their distances from the centres; infinite before the first sample.
    distances: Vec<f64>,
    /// Along the view axis.
    pub depth: Vec<f32>,
    /// Numbers of what is seen, 0 for nothing.
    pub objects: Vec<u32>,
    pub materials: Vec<u32>,
    /// For what follows from the hit itself.
    pub near: Vec<Near>,
    /// Whether any of it is needed.
    is_asked: bool,
}

impl Nearest {
    pub fn new(layers: Layers, pixels: usize, spp: Option<u32>) -> Self {
        let near = [Aov::Position, Aov::Uv, Aov::Motion, Aov::Margin];
        let asks = |aovs: &[Aov]| if layers.has_any(aovs) { pixels } else { 0 };
        let is_asked = layers.has_any(&[&near[..], &[Aov::Depth, Aov::Ids]].concat());
        let choices = if is_asked && spp != Some(1) { pixels } else { 0 };
        Nearest {
            distances: vec![f64::INFINITY; choices],
            depth: vec![super::MISS_DEPTH; asks(&[Aov::Depth])],
            objects: vec![0; asks(&[Aov::Ids])],
            materials: vec![0; asks(&[Aov::Ids])],
            near: vec![Near::NONE; asks(&near)],
            is_asked,
        }
    }

    /// Whether samples are to be chosen among several of their pixels.
    pub fn chooses(&self) -> bool {
        !self.distances.is_empty()
    }

    /// Of some samples of a packet, counted from lane 0, those that are the nearest of their pixels so far, the first of
    /// equals. Until more is said of them they see nothing.
    #[inline]
    pub fn choose(&mut self, pixels: &[u32; LANES], distances: &[f64; LANES], count: usize) -> u32 {
        if !self.chooses() {
            return if self.is_asked { (1 << count) - 1 } else { 0 };
        }
        let (mut chosen, mut i) = (0, 0);
        while i < count {
            let end = i + pixels[i..count].iter().take_while(|pixel| **pixel == pixels[i]).count();
            let least = |a: (usize, f64), b: (usize, f64)| if b.1 < a.1 { b } else { a };
            let best = (i..end).map(|i| (i, distances[i])).fold((i, f64::INFINITY), least);
            chosen |= self.choose_if(pixels[i] as usize, best);
            i = end;
        }
        chosen
    }

    /// The same for samples of one pixel, of which this lane is the first of the nearest.
    #[inline(always)]
    pub fn choose_if(&mut self, pixel: usize, (lane, distance): (usize, f64)) -> u32 {
        let so_far = std::mem::replace(&mut self.distances[pixel], distance);
        if distance < so_far {
            if so_far < f64::INFINITY {
                self.clear(pixel);
            }
            return 1 << lane;
        }
        self.distances[pixel] = so_far;
        0
    }

    fn clear(&mut self, pixel: usize) {
        set(&mut self.depth, pixel, super::MISS_DEPTH);
        set(&mut self.objects, pixel, 0);
        set(&mut self.materials, pixel, 0);
        set(&mut self.near, pixel, Near::NONE);
    }

    /// What a sample sees that was chosen; `object` is the number of the object that was met.
    #[inline]
    pub fn see(&mut self, pixel: usize, near: Near, depth: f32, object: u32) {
        set(&mut self.depth, pixel, depth);
        set(&mut self.objects, pixel, object + 1);
        set(&mut self.materials, pixel, near.material + 1);
        set(&mut self.near, pixel, near);
    }

    /// The same for some samples of a packet, layer by layer; lanes that do not count may hold anything. `indices` are
    /// those of objects and materials.
    #[inline(always)]
    pub fn see8(&mut self, places: &Places, depth: Float8, indices: [[u32; LANES]; 2], near: impl Fn(usize) -> Near) {
        if !self.depth.is_empty() {
            let depth = Mask8::from_bits(places.lanes).select(depth, float8(super::MISS_DEPTH));
            places.set(&mut self.depth, &depth.to_array());
        }
        if !self.objects.is_empty() {
            let number = |i: usize, index: u32| if places.lanes >> i & 1 == 1 { index.wrapping_add(1) } else { 0 };
            let [objects, materials] = indices.map(|all| std::array::from_fn(|i| number(i, all[i])));
            places.set(&mut self.objects, &objects);
            places.set(&mut self.materials, &materials);
        }
        if !self.near.is_empty() {
            bits(places.lanes).for_each(|i| self.near[places.pixels[i] as usize] = near(i));
        }
    }
}

/// Sets an element, if there is one.
#[inline]
fn set<T>(all: &mut [T], index: usize, value: T) {
    if let Some(place) = all.get_mut(index) {
        *place = value;
    }
}

/// Samples of a pixel in batches, for the variance of their mean.
///
/// Samples of one pixel are not independent: they are spread evenly, so their scatter says far too much of the
/// error of their mean. But each aligned run of 2^k of them is spread evenly by itself, in all its dimensions, so
/// the means of 4 to 7 such batches scatter as means of that many samples do. What is left of the bias is that batches
/// keep out of each other's way, too: where the error falls with n^-a, the estimate is
/// (4^a - (1 - 4^(a-1)) 4/3)/4 times too large, 1 for a = 1 (noise), 2.3 for a = 3/2 (edges), never too small.
///
/// Source: batch means, Law and Kelton, "Simulation modeling and analysis", 2000, section 9.5.3.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Batches {
    /// Of the batch that is being filled.
    sum: [f64; 3],
    /// Of all samples.
    total: [f64; 3],
    /// Squares of the batches' sums over their sizes.
    squares: [f64; 3],
    taken: u32,
    filled: u32,
}

impl Batches {
    /// Samples in a batch, for so many in all.
    pub fn size(samples: u32) -> u32 {
        1 << (samples / 4).max(1).ilog2()
    }

    /// Adds the next sample.
    #[inline]
    pub fn add(&mut self, value: [f32; 3], size: u32) {
        for (sum, value) in self.sum.iter_mut().zip(value) {
            *sum += f64::from(value);
        }
        self.taken += 1;
        if self.taken.is_multiple_of(size) {
            self.close(size);
        }
    }

    fn close(&mut self, size: u32) {
        for k in 0..3 {
            self.total[k] += self.sum[k];
            self.squares[k] += self.sum[k] * self.sum[k] / f64::from(size);
        }
        self.sum = [0.0; 3];
        self.filled += 1;
    }

    /// The variance of the mean of all samples: that of means of independent batches, whatever their sizes.
    pub fn variance(mut self, size: u32) -> [f32; 3] {
        let rest = self.taken % size;
        if rest > 0 {
            self.close(rest);
        }
        let (samples, batches) = (f64::from(self.taken), f64::from(self.filled));
        if self.filled < 2 {
            return [0.0; 3];
        }
        let variance = |k: usize| {
            let scatter = self.squares[k] - self.total[k] * self.total[k] / samples;
            (scatter.max(0.0) / ((batches - 1.0) * samples)) as f32
        };
        [0, 1, 2].map(variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    fn variance(values: &[f32]) -> f64 {
        let size = Batches::size(values.len() as u32);
        let mut batches = Batches::default();
        values.iter().for_each(|value| batches.add([*value, 0.0, 1.0], size));
        let [variance, zero, none] = batches.variance(size);
        assert_eq!((zero, none), (0.0, 0.0));
        f64::from(variance)
    }

    #[test]
    fn batches_are_powers_of_two() {
        let sizes = [1, 4, 7, 8, 15, 16, 31, 100, 1 << 20].map(Batches::size);
        assert_eq!(sizes, [1, 1, 1, 2, 2, 4, 4, 16, 1 << 18]);
        assert_eq!(variance(&[3.0]), 0.0);
        assert!((variance(&[1.0, 3.0]) - 1.0).abs() < 1e-7); // s^2 = 2, over two samples
    }

    /// The mean of the estimates over many pixels against the scatter of their means.
    #[test]
    fn estimates_are_the_scatter_of_means() {
        type Value = fn([u32; 2], u32) -> f32;
        let noise: Value = |_, key| (sample::unit(key) * 4.0) as f32;
        let edge: Value = |[x, y], _| f32::from(u8::from(sample::unit(x) + 0.3 * sample::unit(y) < 0.6));
        for (value, least, most) in [(noise, 0.9, 1.1), (edge, 1.0, 3.0)] {
            for spp in [4u32, 10, 16, 64, 100] {
                let (mut estimate, mut sum, mut squares) = (0.0, 0.0, 0.0);
                const PIXELS: u32 = 4000;
                for pixel in 0..PIXELS {
                    let key = sample::pixel_key(1, pixel as i32, 7);
                    let one = |i: u32| value(sample::pair(key, i, 0), sample::pixel_key(u64::from(i), pixel as i32, 8));
                    let values: Vec<f32> = (0..spp).map(one).collect();
                    let mean = values.iter().map(|value| f64::from(*value)).sum::<f64>() / f64::from(spp);
                    estimate += variance(&values);
                    (sum, squares) = (sum + mean, squares + mean * mean);
                }
                let pixels = f64::from(PIXELS);
                let scatter = squares / pixels - (sum / pixels).powi(2);
                let ratio = estimate / pixels / scatter;
                // Four samples are four batches: what stratification gains within a batch they do not see.
                let most = if spp == 4 { 2.0 * most } else { most };
                assert!((least..=most).contains(&ratio), "{spp}: {ratio}");
            }
        }
    }
}
