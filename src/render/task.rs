//! One picture as blocks of work: any threads may trace them in any order, to the same bits.
//!
//! [`Renderer::render`] gives all blocks to the threads of one pool; a batch hands out those of several pictures.

use std::time::Instant;

use super::block::{Block, BlockWork};
use super::reference::{RowWork, Rows};
use super::{Engine, Frame, RenderError, Renderer, Rendering};
use crate::film::{Picture, Window};
use crate::integrate::Silent;

/// A picture whose tree is built and whose blocks wait for threads.
pub struct Task<'s> {
    display: (u32, u32),
    window: Window,
    spp: u32,
    work: Work<'s>,
}

enum Work<'s> {
    /// By the engine, squares of pixels.
    Blocks(Box<Frame<'s>>, Vec<Block>),
    /// By the reference, rows.
    Rows(Box<Rows>),
}

/// What a block came to; [`Task::finish`] puts it where it belongs.
#[derive(Debug)]
pub struct Traced(Part);

#[derive(Debug)]
enum Part {
    Block(Block, Box<BlockWork>),
    Row(RowWork),
}

impl<'s> Task<'s> {
    /// Plans and builds, on this thread.
    ///
    /// # Errors
    /// [`RenderError::BadWindow`].
    pub fn new(renderer: &Renderer<'s>) -> Result<Self, RenderError> {
        let window = renderer.checked_window()?;
        let work = match renderer.engine {
            Engine::Reference => Work::Rows(Box::new(Rows::new(renderer, window))),
            Engine::Packet | Engine::Single => Work::Blocks(Box::new(Frame::prepare(renderer)), Block::cover(window)),
        };
        let display = (renderer.image.width, renderer.image.height);
        Ok(Task { display, window, spp: renderer.image.spp, work })
    }

    /// How many blocks there are.
    pub fn blocks(&self) -> usize {
        match &self.work {
            Work::Blocks(_, blocks) => blocks.len(),
            Work::Rows(_) => self.window.height(),
        }
    }

    /// Samples of a block: what it costs, roughly.
    pub fn samples(&self, block: usize) -> u64 {
        let pixels = match &self.work {
            Work::Blocks(_, blocks) => blocks[block].window.area(),
            Work::Rows(_) => self.window.width(),
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
            Work::Blocks(frame, blocks) => {
                let block = blocks[block];
                Part::Block(block, Box::new(block.trace(&frame.rays, &frame.direct(), self.spp, &mut Silent)))
            }
            Work::Rows(rows) => Part::Row(rows.trace(block, stop)?),
        };
        Some(Traced(part))
    }

    /// The picture of all blocks, whatever their order; `threads` and `start` (of tracing) are for its statistics.
    pub fn finish(&self, traced: Vec<Traced>, threads: usize, start: Instant) -> Rendering {
        let seconds = start.elapsed().as_secs_f64();
        let mut picture = Picture::new(self.display, self.window);
        let mut stats = match &self.work {
            Work::Blocks(frame, _) => frame.stats(threads, seconds),
            Work::Rows(rows) => rows.stats(threads, seconds),
        };
        for Traced(part) in traced {
            match part {
                Part::Block(block, work) => {
                    block.copy_to(&work.pixels, &mut picture);
                    stats.add(&work);
                }
                Part::Row(row) => row.add_to(&mut picture, &mut stats),
            }
        }
        if let Work::Blocks(frame, _) = &self.work {
            stats.skipped = frame.plan.skips.report(&stats.left_out);
        }
        Rendering { picture, stats }
    }
}
