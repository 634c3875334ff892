//! A frame by the reference tracer to a noise level: the squares that the engine samples, by the same rule.

use std::ops::Range;
use std::time::Instant;

use super::adaptive::{Effort, Noise, Pixels};
use super::block::Block;
use super::reference::add;
use super::{Renderer, Stats};
use crate::film::Window;
use crate::integrate::RayCounts;
use crate::reference::{Reference, View};
use crate::sample;
use crate::scene::RenderSettings;

/// A frame whose squares are its blocks.
pub(super) struct Tiles {
    tracer: Reference,
    /// One for each half of the samples.
    views: [View; 2],
    noise: Noise,
    blocks: Vec<Block>,
    plan_seconds: f64,
}

/// A square.
#[derive(Debug)]
pub(super) struct TileWork {
    pub block: Block,
    /// Of the block, which may be a part of the square.
    pub pixels: Pixels,
    /// Of the square.
    pub effort: Effort,
    pub counts: RayCounts,
}

impl Tiles {
    pub fn new(renderer: &Renderer, noise: Noise, window: Window) -> Self {
        let start = Instant::now();
        let tracer = Reference::relative_to(renderer.scene, renderer.camera.eye);
        let mut image = renderer.image.clone();
        image.spp = image.spp.max(2); // or all samples would sit at the centre
        let seed = renderer.settings.seed;
        let view = |seed| tracer.view(renderer.camera, &image, &RenderSettings { seed, ..renderer.settings.clone() });
        let views = [view(seed), view(sample::other_seed(seed))];
        let blocks = Block::cover(window);
        Tiles { tracer, views, noise, blocks, plan_seconds: start.elapsed().as_secs_f64() }
    }

    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// A square, counted from 0; `None` where `stop` asked for that within.
    pub fn trace(&self, index: usize, stop: &(dyn Fn() -> bool + Sync)) -> Option<TileWork> {
        let (block, mut counts) = (self.blocks[index], RayCounts::default());
        let whole = block.whole();
        let mut pixel = |half: usize, range: &Range<u32>, (x, y)| {
            if stop() {
                return None;
            }
            let pixel = self.tracer.samples(&self.views[half], x, y, range.clone());
            add(&mut counts, &pixel);
            Some(pixel.rgba.map(|mean| mean as f32))
        };
        let draw = |half: usize, range: Range<u32>| {
            (0..whole.window.area()).map(|i| pixel(half, &range, whole.window.pixel(i))).collect()
        };
        let (pixels, effort) = self.noise.sample(draw)?;
        Some(TileWork { block, pixels: block.part(&whole, &pixels), effort, counts })
    }

    pub fn stats(&self) -> Stats {
        Stats { plan_seconds: self.plan_seconds, ..Stats::default() }
    }
}
