//! One picture as blocks of work: any threads may trace them in any order, to the same bits.
//!
//! [`Renderer::render`] gives all blocks to the threads of one pool; a batch hands out those of several pictures.

use std::ops::Range;
use std::time::Instant;

use super::adaptive::{Effort, Noise, Spent};
use super::block::{Block, BlockWork};
use super::layers::{LayerPlan, LayerTape, LayerWork};
use super::reference::{RowWork, Rows};
use super::tiles::{TileWork, Tiles};
use super::{Engine, Frame, RenderError, Renderer, Stats, shutter};
use crate::film::{Picture, Plane, Window};
use crate::integrate::{Record, Silent};
use crate::plan::Skip;
use crate::scene::{Aov, Layers};

/// A picture whose tree is built and whose blocks wait for threads.
pub struct Task<'s> {
    display: (u32, u32),
    pub(super) window: Window,
    spp: u32,
    /// Relative error asked for.
    pub(super) target: Option<f64>,
    work: Work<'s>,
    /// Where layers are asked for.
    layers: Option<LayerPlan<'s>>,
    /// Nobody asked for the layers.
    unasked: bool,
}

enum Work<'s> {
    /// By the engine, squares of pixels, a frame a moment.
    Blocks(Vec<Frame<'s>>, Vec<Block>),
    /// By the reference, rows.
    Rows(Box<Rows>),
    /// By the reference to a noise level, squares of pixels.
    Tiles(Box<Tiles>),
}

/// What a block came to; [`Gathering::add`](super::Gathering::add) puts it where it belongs.
#[derive(Debug)]
pub struct Traced {
    /// Which one, from 0.
    pub(super) block: usize,
    part: Part,
    /// What it took.
    pub(super) seconds: f64,
}

#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // there is one at a time
enum Part {
    Block(Block, BlockWork),
    Row(RowWork),
    Tile(TileWork),
}

impl Traced {
    pub(super) fn spent(&self) -> Option<Spent> {
        match &self.part {
            Part::Block(_, work) => work.effort.as_ref().map(Effort::spent),
            Part::Tile(tile) => Some(tile.effort.spent()),
            Part::Row(_) => None,
        }
    }

    /// Adds its counts.
    pub(super) fn count_in(&self, stats: &mut Stats) {
        match &self.part {
            Part::Block(_, work) => stats.add(work),
            Part::Row(row) => stats.rays.add(&row.counts),
            Part::Tile(tile) => stats.rays.add(&tile.counts),
        }
    }
}

impl<'s> Task<'s> {
    /// Plans and builds, on this thread.
    ///
    /// # Errors
    /// [`RenderError::BadWindow`]; settings that do not go together.
    pub fn new(renderer: &Renderer<'s>) -> Result<Self, RenderError> {
        let window = renderer.checked_window()?;
        if renderer.noise_level().is_some() && !renderer.moments.is_empty() {
            return Err(RenderError::NoiseWithShutter);
        }
        let work = match (renderer.engine, renderer.noise_level()) {
            (Engine::Reference, Some(_)) if !renderer.layers.is_empty() => return Err(RenderError::NoiseWithLayers),
            (Engine::Reference, Some(noise)) => Work::Tiles(Box::new(Tiles::new(renderer, noise, window))),
            (Engine::Reference, None) => Work::Rows(Box::new(Rows::new(renderer, window))),
            (Engine::Packet | Engine::Single, _) => {
                let frames = renderer.at_moments().iter().map(Frame::prepare).collect();
                let blocks = if renderer.noise_level().is_some() { Block::tiles(window) } else { Block::cover(window) };
                Work::Blocks(frames, blocks)
            }
        };
        let display = (renderer.image.width, renderer.image.height);
        // Work that is not to be left out is done, and what comes of it dropped.
        let unasked = renderer.layers.is_empty() && !renderer.skips.has(Skip::Layers);
        let all = Aov::ALL.into_iter().fold(renderer.layers, Layers::with);
        let layers = match unasked {
            true => Some(LayerPlan::new(renderer, all)),
            false => (!renderer.layers.is_empty()).then(|| LayerPlan::new(renderer, renderer.layers)),
        };
        Ok(Task { display, window, spp: renderer.image.spp, target: renderer.settings.noise, work, layers, unasked })
    }

    /// How many blocks there are.
    pub fn blocks(&self) -> usize {
        match &self.work {
            Work::Blocks(_, blocks) => blocks.len(),
            Work::Rows(_) => self.window.height(),
            Work::Tiles(tiles) => tiles.blocks().len(),
        }
    }

    /// Where a block lies.
    pub(super) fn place(&self, block: usize) -> Window {
        match &self.work {
            Work::Blocks(_, blocks) => blocks[block].window,
            Work::Rows(_) => {
                let y0 = self.window.y0 + block as i32;
                Window { y0, y1: y0 + 1, ..self.window }
            }
            Work::Tiles(tiles) => tiles.blocks()[block].window,
        }
    }

    /// Samples of a block: what it costs, roughly.
    pub fn samples(&self, block: usize) -> u64 {
        self.place(block).area() as u64 * u64::from(self.spp)
    }

    /// Samples of all blocks.
    pub fn total(&self) -> u64 {
        self.window.area() as u64 * u64::from(self.spp)
    }

    /// Traces a block, counted from 0, on this thread; `None` where `stop` asked for that within.
    pub fn trace(&self, block: usize, stop: &(dyn Fn() -> bool + Sync)) -> Option<Traced> {
        let start = Instant::now();
        let part = match &self.work {
            Work::Blocks(frames, blocks) => {
                let place = blocks[block];
                Part::Block(place, self.trace_block(frames, &place, stop)?)
            }
            Work::Rows(rows) => Part::Row(rows.trace(block, self.layers.as_ref(), stop)?),
            Work::Tiles(tiles) => Part::Tile(tiles.trace(block, stop)?),
        };
        Some(Traced { block, part, seconds: start.elapsed().as_secs_f64() })
    }

    /// Where a block lies, and its colour row by row.
    pub fn pixels<'t>(&self, traced: &'t Traced) -> (Window, &'t [[f32; 4]]) {
        match &traced.part {
            Part::Block(block, work) => (block.window, &work.pixels),
            Part::Row(row) => (row.window(self.window), &row.pixels),
            Part::Tile(tile) => (tile.block.window, &tile.pixels),
        }
    }

    fn trace_block(&self, frames: &[Frame], block: &Block, stop: &(dyn Fn() -> bool + Sync)) -> Option<BlockWork> {
        if let Some(noise) = &frames[0].noise {
            return self.trace_until(frames, noise, block, stop);
        }
        let Some(plan) = &self.layers else {
            return self.trace_moments(frames, block, &mut Silent, |_, _| {}, stop);
        };
        // What a pixel costs depends on those that are traced with it: they must not depend on a crop.
        let asked_for_cost = plan.layers.has(Aov::Cost) && !self.unasked;
        let whole = if asked_for_cost { block.whole() } else { *block };
        let mut tape = LayerTape::new(frames, plan, whole.window);
        let mut work = self.trace_moments(frames, &whole, &mut tape, LayerTape::at, stop)?;
        work.layers = Some(tape.finish(whole.window));
        if whole.window != block.window {
            block.cut(&whole, &mut work);
        }
        Some(work)
    }

    /// The samples of each moment in turn; `at` tells the record which one it is.
    fn trace_moments<R: Record>(
        &self,
        frames: &[Frame],
        block: &Block,
        record: &mut R,
        at: impl Fn(&mut R, usize),
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Option<BlockWork> {
        let mut trace = |moment: usize, range: Range<u32>| {
            at(record, moment);
            let frame = &frames[moment];
            block.trace(&frame.view(), &frame.direct(), range, record, stop)
        };
        if frames.len() == 1 {
            return trace(0, 0..self.spp);
        }
        let (mut sums, mut all) = (vec![[0.0; 4]; block.window.area()], None::<BlockWork>);
        for moment in 0..frames.len() {
            let range = shutter::samples(moment, frames.len(), self.spp);
            let share = range.len() as f64 / f64::from(self.spp);
            let work = trace(moment, range)?;
            for (sum, pixel) in sums.iter_mut().zip(&work.pixels) {
                *sum = std::array::from_fn(|k| sum[k] + share * f64::from(pixel[k]));
            }
            match &mut all {
                None => all = Some(work),
                Some(all) => all.absorb(&work),
            }
        }
        let pixels = sums.into_iter().map(|sum| sum.map(|x| x as f32)).collect();
        all.map(|all| BlockWork { pixels, ..all })
    }

    /// To a noise level.
    fn trace_until(
        &self,
        frames: &[Frame],
        noise: &Noise,
        block: &Block,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Option<BlockWork> {
        let (whole, direct, view) = (block.whole(), frames[0].direct(), frames[0].view());
        let mut work = match &self.layers {
            None => block.trace_until(noise, &view, &direct, &mut Silent, stop)?,
            Some(plan) => {
                let mut tape = LayerTape::new(frames, plan, whole.window);
                let work = block.trace_until(noise, &view, &direct, &mut tape, stop)?;
                work.effort.iter().for_each(|effort| tape.took(&effort.samples));
                let mut layers = tape.finish(whole.window);
                work.effort.iter().for_each(|effort| plan.tell_effort(effort, &mut layers));
                BlockWork { layers: Some(layers), ..work }
            }
        };
        block.cut(&whole, &mut work);
        Some(work)
    }

    /// The layers that were asked for.
    pub(super) fn asked(&self) -> Option<&LayerPlan<'s>> {
        self.layers.as_ref().filter(|_| !self.unasked)
    }

    /// The layers of a block.
    pub(super) fn layers<'t>(&self, traced: &'t Traced) -> Option<&'t LayerWork> {
        match &traced.part {
            Part::Block(_, work) => work.layers.as_ref(),
            Part::Row(row) => row.layers.as_ref(),
            Part::Tile(_) => None,
        }
    }

    /// Its picture without any block: all channels that were asked for, and nothing in them.
    pub(super) fn blank(&self) -> Picture {
        self.opened(Picture::new(self.display, self.window))
    }

    /// What its picture is one of, without a sample.
    pub fn hollow(&self) -> Picture {
        let pixels = Plane::default();
        let (channels, cryptomattes) = (Vec::new(), Vec::new());
        self.opened(Picture { display: self.display, window: self.window, pixels, channels, cryptomattes })
    }

    fn opened(&self, mut picture: Picture) -> Picture {
        self.asked().into_iter().for_each(|plan| plan.open(&mut picture));
        picture
    }

    /// What is known before the first block.
    pub(super) fn prepared(&self) -> Stats {
        match &self.work {
            Work::Blocks(frames, _) => {
                let first = frames[0].stats();
                frames[1..].iter().fold(first, |stats, frame| stats.prepared(&frame.stats()))
            }
            Work::Rows(rows) => rows.stats(),
            Work::Tiles(tiles) => tiles.stats(),
        }
    }

    /// Says what was left out, once all is counted.
    pub(super) fn report_skips(&self, stats: &mut Stats) {
        if let Work::Blocks(frames, _) = &self.work {
            stats.skipped = frames[0].plan.skips.report(&stats.left_out);
        }
    }
}
