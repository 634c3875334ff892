//! What a pixel keeps: the sample nearest to its centre, and batches of samples for the variance of its mean.

use crate::shapes::RowRef;

/// What the sample nearest to a pixel's centre saw.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Near {
    /// Square of its distance from the centre; infinite before the first sample.
    pub distance: f64,
    /// Place of the hit on its ray.
    pub t: f32,
    /// Along the view axis.
    pub depth: f32,
    /// What was met.
    pub row: RowRef,
    pub primitive: u32,
    pub material: u32,
    /// Its index.
    pub sample: u32,
}

impl Near {
    /// No sample yet.
    pub const NONE: Near = Near {
        distance: f64::INFINITY,
        t: 0.0,
        depth: super::MISS_DEPTH,
        row: RowRef::MISS,
        primitive: 0,
        material: 0,
        sample: 0,
    };
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
