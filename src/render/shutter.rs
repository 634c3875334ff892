//! Motion blur: the samples of a pixel are shared out over moments while the shutter is open.
//!
//! Each moment is a scene of its own, with a tree of its own, traced as any other: so whatever can move blurs, hits are as
//! certain as those of a still picture, and a picture has the same bits in any crop and with any number of threads. Runs
//! of a pixel's samples are spread evenly by themselves, so every moment sees all of the pixel.

use std::ops::Range;

use super::Renderer;
use crate::scene::Scene;

/// Most moments of a picture.
const MOST: u32 = 32;

/// The scenes at the middles of equal parts of the time that the shutter is open: from the frame on for `shutter` (0 to 1)
/// of the way to the next one, as many as samples, at most 32.
pub fn moments(scene: &Scene, next: &Scene, shutter: f64, spp: u32) -> Vec<Scene> {
    let count = spp.clamp(1, MOST);
    let middle = |k: u32| shutter * (f64::from(k) + 0.5) / f64::from(count);
    (0..count).map(|k| scene.between(next, middle(k))).collect()
}

/// The samples that belong to a moment.
pub(super) fn samples(moment: usize, moments: usize, spp: u32) -> Range<u32> {
    let edge = |k: usize| (k as u64 * u64::from(spp) / moments as u64) as u32;
    edge(moment)..edge(moment + 1)
}

/// The moment that a sample belongs to; the only one where there is but one, however many samples there are.
pub(super) fn moment(sample: u32, moments: usize, spp: u32) -> usize {
    if moments == 1 {
        return 0;
    }
    (((u64::from(sample) + 1) * moments as u64 - 1) / u64::from(spp)) as usize
}

impl<'s> Renderer<'s> {
    /// How many moments there are.
    pub fn moment_count(&self) -> usize {
        self.moments.len().max(1)
    }

    /// By moment: the same picture of the scene as it is then. One where the shutter opens for no time.
    pub(super) fn at_moments(&self) -> Vec<Renderer<'s>> {
        if self.moments.is_empty() {
            return vec![self.clone()];
        }
        let own = self.scene.cameras.iter().position(|camera| std::ptr::eq(camera, self.camera));
        let then = |scene: &'s Scene| {
            let camera = own.and_then(|index| scene.cameras.get(index)).unwrap_or(self.camera);
            Renderer { scene, camera, ..self.clone() }
        };
        self.moments.iter().map(then).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_has_its_moment() {
        for (spp, moments) in [(1, 1), (5, 5), (16, 16), (100, 32), (33, 32), (64, 32)] {
            let mut next = 0;
            for k in 0..moments {
                let range = samples(k, moments, spp);
                assert!(range.start == next && !range.is_empty());
                assert!(range.clone().all(|sample| moment(sample, moments, spp) == k), "{spp} {moments} {range:?}");
                next = range.end;
            }
            assert_eq!(next, spp);
        }
    }
}
