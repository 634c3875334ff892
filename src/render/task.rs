//! One picture as blocks of work: any threads may trace them in any order, to the same bits.
//!
//! [`Renderer::render`] gives all blocks to the threads of one pool; a batch hands out those of several pictures.

use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use super::adaptive::{Effort, Noise, Reached};
use super::block::{Block, BlockWork};
use super::layers::{LayerPlan, LayerTape};
use super::reference::{RowWork, Rows};
use super::tiles::{TileWork, Tiles};
use super::{Engine, Frame, IdNames, RenderError, Renderer, Rendering, shutter};
use crate::film::{Picture, Samples, Window};
use crate::integrate::{Record, Silent};
use crate::plan::Skip;
use crate::scene::{Aov, Layers};

/// A picture whose tree is built and whose blocks wait for threads.
pub struct Task<'s> {
    display: (u32, u32),
    window: Window,
    spp: u32,
    /// Relative error asked for.
    target: Option<f64>,
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

/// What a block came to; [`Task::finish`] puts it where it belongs. Copies share it.
#[derive(Debug, Clone)]
pub struct Traced(Arc<Part>);

#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // each lies behind a pointer of its own
enum Part {
    Block(Block, BlockWork),
    Row(RowWork),
    Tile(TileWork),
}

impl Traced {
    fn effort(&self) -> Option<&Effort> {
        match &*self.0 {
            Part::Block(_, work) => work.effort.as_ref(),
            Part::Tile(tile) => Some(&tile.effort),
            Part::Row(_) => None,
        }
    }

    /// Puts samples and variances into the layers of these names.
    fn tell_effort(&self, picture: &mut Picture) {
        let Part::Block(block, BlockWork { effort: Some(effort), .. }) = &*self.0 else { return };
        let (window, whole) = (picture.window, block.whole().window);
        let inside: Vec<(usize, usize)> = (0..block.window.area())
            .map(|index| block.window.pixel(index))
            .filter_map(|(x, y)| window.index(x, y).zip(whole.index(x, y)))
            .collect();
        for channel in &mut picture.channels {
            let Samples::Float(samples) = &mut channel.samples else { continue };
            let name = channel.name.split('.').next().unwrap_or_default();
            let part = ["R", "G", "B"].iter().position(|part| channel.name.ends_with(&format!(".{part}")));
            for (to, from) in &inside {
                match (name, part) {
                    ("samples", _) => samples[*to] = effort.samples as f32,
                    ("variance", Some(part)) => samples[*to] = effort.variance[*from][part],
                    _ => {}
                }
            }
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
                Work::Blocks(frames, Block::cover(window))
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

    /// Samples of a block: what it costs, roughly.
    pub fn samples(&self, block: usize) -> u64 {
        let pixels = match &self.work {
            Work::Blocks(_, blocks) => blocks[block].window.area(),
            Work::Rows(_) => self.window.width(),
            Work::Tiles(tiles) => tiles.blocks()[block].window.area(),
        };
        pixels as u64 * u64::from(self.spp)
    }

    /// Samples of all blocks.
    pub fn total(&self) -> u64 {
        self.window.area() as u64 * u64::from(self.spp)
    }

    /// Traces a block, counted from 0, on this thread; `None` where `stop` asked for that within.
    pub fn trace(&self, block: usize, stop: &(dyn Fn() -> bool + Sync)) -> Option<Traced> {
        let part = match &self.work {
            Work::Blocks(frames, blocks) => {
                let block = blocks[block];
                Part::Block(block, self.trace_block(frames, &block, stop)?)
            }
            Work::Rows(rows) => Part::Row(rows.trace(block, self.layers.as_ref(), stop)?),
            Work::Tiles(tiles) => Part::Tile(tiles.trace(block, stop)?),
        };
        Some(Traced(Arc::new(part)))
    }

    /// Where a block lies, and its colour row by row.
    pub fn pixels<'t>(&self, traced: &'t Traced) -> (Window, &'t [[f32; 4]]) {
        match &*traced.0 {
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
        let mut tape = LayerTape::new(frames, plan, whole.window.area());
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

    /// To a noise level: layers are those of the first samples.
    fn trace_until(
        &self,
        frames: &[Frame],
        noise: &Noise,
        block: &Block,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Option<BlockWork> {
        let (whole, direct, views) = (block.whole(), frames[0].direct(), frames[0].views());
        let mut work = match &self.layers {
            None => block.trace_until(noise, views, &direct, &mut Silent, stop)?,
            Some(plan) => {
                let mut tape = LayerTape::new(frames, plan, whole.window.area());
                let work = block.trace_until(noise, views, &direct, &mut tape, stop)?;
                BlockWork { layers: Some(tape.finish(whole.window)), ..work }
            }
        };
        block.cut(&whole, &mut work);
        Some(work)
    }

    /// The picture of all blocks, whatever their order; `threads` and `start` (of tracing) are for its statistics.
    pub fn finish(&self, traced: Vec<Traced>, threads: usize, start: Instant) -> Rendering {
        let seconds = start.elapsed().as_secs_f64();
        let mut picture = Picture::new(self.display, self.window);
        let mut stats = match &self.work {
            Work::Blocks(frames, _) => {
                let first = frames[0].stats(threads, seconds);
                frames[1..].iter().fold(first, |stats, frame| stats.prepared(&frame.stats(threads, seconds)))
            }
            Work::Rows(rows) => rows.stats(threads, seconds),
            Work::Tiles(tiles) => tiles.stats(threads, seconds),
        };
        stats.noise = self.target.map(|target| Reached::of(target, traced.iter().filter_map(Traced::effort)));
        for Traced(part) in &traced {
            match &**part {
                Part::Block(block, work) => {
                    block.copy_to(&work.pixels, &mut picture);
                    stats.add(work);
                }
                Part::Row(row) => row.add_to(&mut picture, &mut stats),
                Part::Tile(tile) => {
                    tile.block.copy_to(&tile.pixels, &mut picture);
                    stats.rays.add(&tile.counts);
                }
            }
        }
        if let Work::Blocks(frames, _) = &self.work {
            stats.skipped = frames[0].plan.skips.report(&stats.left_out);
        }
        let mut names = IdNames::default();
        if let Some(plan) = self.layers.as_ref().filter(|_| !self.unasked) {
            let works = traced.iter().filter_map(|Traced(part)| match &**part {
                Part::Block(block, work) => Some((block.window, work.layers.as_ref()?)),
                Part::Row(row) => Some((row.window(self.window), row.layers.as_ref()?)),
                Part::Tile(_) => None,
            });
            plan.add_to(works, &mut picture);
            traced.iter().for_each(|traced| traced.tell_effort(&mut picture));
            names = plan.names(&picture);
        }
        Rendering { picture, stats, names }
    }
}
