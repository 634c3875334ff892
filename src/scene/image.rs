//! The picture: size, samples, filter, integrator.

/// Size and sampling of the picture.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageSettings {
    /// Pixels, 1 to 65,536.
    pub width: u32,
    /// Pixels, 1 to 65,536; width x height at most 2^30.
    pub height: u32,
    /// Samples per pixel, >= 1. One sample sits at the pixel's centre.
    pub spp: u32,
    /// Pixel filter.
    pub filter: Filter,
}

/// What is computed, and how far.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderSettings {
    /// How radiance is found.
    pub integrator: Integrator,
    /// Longest chain of rays, the camera ray being 1.
    pub max_depth: u32,
    /// Chooses the sample pattern.
    pub seed: u64,
    /// Relative error of each tile at which sampling stops, > 0; `None`: all pixels have as many samples as the
    /// picture says.
    pub noise: Option<f64>,
    /// How far occluders count in ambient occlusion, scene units, > 0; may be infinite.
    pub ao_distance: f64,
    /// Whether ambient light reaches a place only from where nothing is nearer than that, but for `Ao`, which has none.
    pub ambient_occlusion: bool,
    /// How long the shutter is open, from the frame on, as a share (0 to 1) of the time to the next one.
    pub shutter: f64,
}

impl Default for RenderSettings {
    fn default() -> Self {
        RenderSettings {
            integrator: Integrator::Direct,
            max_depth: 5,
            seed: 0,
            noise: None,
            ao_distance: f64::INFINITY,
            ambient_occlusion: false,
            shutter: 0.0,
        }
    }
}

/// How radiance is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Integrator {
    /// Direct light with mirror reflection and refraction (Whitted).
    Direct,
    /// Ambient occlusion: surfaces that scatter light show their albedo times the share of the hemisphere, weighed
    /// with the cosine, where nothing is nearer than [`RenderSettings::ao_distance`]. Lights and
    /// ambient light are left out; mirrors and glass are as in `Direct`.
    Ao,
    /// All light: direct light as in `Direct`, and what surfaces throw on each other. Of the ways on (scattered,
    /// mirrored, refracted) each sample takes one.
    Path,
}

/// A separable pixel filter, zero beyond its radius.
///
/// Samples are drawn from the filter itself and weigh the same, so that a sample belongs to one pixel
/// alone: Ernst, Stamminger and Greiner, "Filter importance sampling", IEEE Symposium on Interactive
/// Ray Tracing, 2006.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter {
    /// Its shape.
    pub kind: FilterKind,
    /// Half its width in pixels, > 0.
    pub radius: f64,
}

/// The shape of a pixel filter over `x` in `-radius..radius`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilterKind {
    /// The same weight everywhere.
    Box,
    /// `exp(-x^2/2s^2) - exp(-radius^2/2s^2)` with `s = radius/3`.
    Gaussian,
    /// The four-term window: Harris, "On the use of windows for harmonic analysis", Proceedings of the
    /// IEEE 66(1), 1978.
    BlackmanHarris,
}

impl Default for Filter {
    fn default() -> Self {
        Filter { kind: FilterKind::Gaussian, radius: 1.5 }
    }
}

impl FilterKind {
    /// The weight at `x` radii from the centre, for `|x| <= 1`; the scale is free.
    pub fn weight(self, x: f64) -> f64 {
        use std::f64::consts::PI;
        match self {
            FilterKind::Box => 1.0,
            FilterKind::Gaussian => (-4.5 * x * x).exp() - (-4.5f64).exp(),
            FilterKind::BlackmanHarris => {
                let turn = PI * (x + 1.0);
                0.35875 - 0.48829 * turn.cos() + 0.14128 * (2.0 * turn).cos() - 0.01168 * (3.0 * turn).cos()
            }
        }
    }
}

/// Where in a filter a sample falls: the inverse of the filter's integral along one axis.
#[derive(Debug, Clone)]
pub struct FilterTable {
    /// Offset in pixels at evenly spaced fractions 0, 1/STEPS, ... of the integral, and the way to the next one.
    steps: Box<[[f64; 2]; Self::STEPS]>,
}

impl FilterTable {
    const STEPS: usize = 1024;
    const SHIFT: u32 = 32 - Self::STEPS.trailing_zeros();

    /// Inverts the integral of a filter: trapezoids on 16 points a step, then linear between them.
    pub fn new(filter: Filter) -> Self {
        let points = 16 * Self::STEPS;
        let place = |k: usize| 2.0 * k as f64 / points as f64 - 1.0;
        let mut sums = Vec::with_capacity(points + 1);
        sums.push(0.0);
        let mut weight = filter.kind.weight(place(0));
        for k in 0..points {
            let before = std::mem::replace(&mut weight, filter.kind.weight(place(k + 1)));
            sums.push(sums[k] + (before + weight));
        }
        let mut k = 0;
        let offsets = (0..=Self::STEPS).map(|step| {
            let goal = sums[points] * step as f64 / Self::STEPS as f64;
            while k + 1 < points && sums[k + 1] < goal {
                k += 1;
            }
            let part = ((goal - sums[k]) / (sums[k + 1] - sums[k])).clamp(0.0, 1.0);
            filter.radius * (place(k) + part * (place(k + 1) - place(k)))
        });
        let offsets: Vec<f64> = offsets.collect();
        let steps: Vec<[f64; 2]> = offsets.windows(2).map(|ends| [ends[0], ends[1] - ends[0]]).collect();
        FilterTable { steps: steps.try_into().expect("one between each two of the offsets") }
    }

    /// The offset from the pixel's centre, in pixels, at a fraction of 2^32 of the integral.
    #[inline(always)]
    pub fn offset(&self, fraction: u32) -> f64 {
        let [start, way] = self.steps[(fraction >> Self::SHIFT) as usize];
        start + Self::part(fraction) * way
    }

    /// Eight of them: the same bits.
    #[inline(always)]
    pub fn offsets(&self, fractions: &[u32; 8]) -> [f64; 8] {
        let (mut start, mut way) = ([0.0; 8], [0.0; 8]);
        for lane in 0..8 {
            [start[lane], way[lane]] = self.steps[(fractions[lane] >> Self::SHIFT) as usize];
        }
        for lane in 0..8 {
            start[lane] += Self::part(fractions[lane]) * way[lane];
        }
        start
    }

    /// How far a fraction is on its step.
    #[inline(always)]
    fn part(fraction: u32) -> f64 {
        // The bits fit an i32, which AVX2 converts.
        let part = (fraction & ((1 << Self::SHIFT) - 1)) as i32;
        (f64::from(part) + 0.5) * (1.0 / f64::from(1 << Self::SHIFT))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_follow_the_filter() {
        for kind in [FilterKind::Box, FilterKind::Gaussian, FilterKind::BlackmanHarris] {
            let table = FilterTable::new(Filter { kind, radius: 1.5 });
            assert!((table.offset(1 << 31)).abs() < 1e-5 && (table.offset(0) + 1.5).abs() < 1e-2, "{kind:?}");
            let variance = (0..100_000)
                .map(|i| table.offset(((i as f64 + 0.5) / 1e5 * 2f64.powi(32)) as u32).powi(2))
                .sum::<f64>()
                / 1e5;
            let (mut moment, mut area) = (0.0, 0.0);
            for i in 0..100_000 {
                let x = (i as f64 + 0.5) / 5e4 - 1.0;
                (moment, area) = (moment + x * x * 2.25 * kind.weight(x), area + kind.weight(x));
            }
            // The outermost of 1,024 steps are the longest: straight lines there widen the filter by 1e-3.
            assert!((variance - moment / area).abs() < 5e-4, "{kind:?}: {variance} {}", moment / area);
        }
    }
}
