//! A frame by the reference tracer to a noise level: the squares that the engine samples, by the same rule.

use std::ops::Range;
use std::time::Instant;

use super::adaptive::{Effort, Noise, Pixels, Sums};
use super::block::Block;
use super::reference::add;
use super::{Renderer, Stats};
use crate::film::Window;
use crate::integrate::RayCounts;
use crate::reference::{Reference, View};

/// A frame whose squares are its blocks.
pub(super) struct Tiles {
    tracer: Reference,
    view: View,
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
        let view = tracer.view(renderer.camera, &image, &renderer.settings);
        let blocks = Block::tiles(window);
        Tiles { tracer, view, noise, blocks, plan_seconds: start.elapsed().as_secs_f64() }
    }

    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// A square, counted from 0; `None` where `stop` asked for that within.
    pub fn trace(&self, index: usize, stop: &(dyn Fn() -> bool + Sync)) -> Option<TileWork> {
        let (block, mut counts) = (self.blocks[index], RayCounts::default());
        let whole = block.whole();
        let mut add_to = |sum: &mut [f64; 4], range: &Range<u32>, (x, y)| {
            let pixel = (!stop()).then(|| self.tracer.samples(&self.view, x, y, range.clone()))?;
            add(&mut counts, &pixel);
            *sum = std::array::from_fn(|k| sum[k] + pixel.rgba[k] * range.len() as f64);
            Some(())
        };
        let (_, cells) = whole.cells();
        let draw = |cell: usize, sums: &mut Sums, range: Range<u32>| {
            cells.pixels[cell].iter().try_for_each(|i| add_to(&mut sums[*i], &range, whole.window.pixel(*i)))
        };
        let (pixels, effort) = self.noise.sample(&cells, draw)?;
        Some(TileWork { block, pixels: block.part(&whole, &pixels), effort, counts })
    }

    pub fn stats(&self) -> Stats {
        Stats { plan_seconds: self.plan_seconds, ..Stats::default() }
    }
}
