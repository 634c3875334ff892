//! Where the blocks of a picture come together: each is put in its place as it is done, and its room is used again.
//!
//! Blocks that are kept until all are there take the memory of a picture twice, and memory that is touched for the first
//! time costs more than what is written there, because the system clears it page by page.

use std::mem::take;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::adaptive::{Reached, Spent};
use super::block::EDGE;
use super::layers::Seen;
use super::{IdNames, Rendering, Stats, Task, Traced};
use crate::film::{Band, Channel, Cryptomatte, Picture, Window};

/// A picture of which some blocks may be there.
#[derive(Debug)]
pub struct Unfinished {
    picture: Picture,
    tally: Mutex<Tally>,
}

/// An [`Unfinished`] picture that is open to all threads, with blocks to come.
pub struct Gathering<'p, 's> {
    task: &'p Task<'s>,
    /// The first one has the picture's first row.
    bands: Vec<Mutex<Band<'p>>>,
    tally: &'p Mutex<Tally>,
}

/// A block that is done, for those who look on.
pub struct Shown<'a> {
    /// Where it lies.
    pub window: Window,
    /// Its colour, row by row.
    pub pixels: &'a [[f32; 4]],
    /// Makes a picture of the blocks before it.
    pub so_far: &'a dyn Fn() -> Rendering,
}

/// What is known of the blocks that are there.
#[derive(Debug, Clone)]
struct Tally {
    done: Vec<bool>,
    stats: Stats,
    /// By block, where there is a noise level.
    spent: Vec<(usize, Spent)>,
    seen: Seen,
    /// What is known of blocks from a run before.
    earlier: Vec<Cryptomatte>,
}

impl<'s> Task<'s> {
    /// A picture without any block.
    pub fn begin(&self) -> Unfinished {
        let (done, stats) = (vec![false; self.blocks()], self.prepared());
        let tally = Tally { done, stats, spent: Vec::new(), seen: Default::default(), earlier: Vec::new() };
        Unfinished { picture: self.blank(), tally: Mutex::new(tally) }
    }

    /// A picture of this task with some blocks from a run before; `None` where it is not of this task.
    pub fn go_on(&self, picture: Picture, done: Vec<bool>) -> Option<Unfinished> {
        let mut unfinished = self.begin();
        let kinds = |picture: &Picture| -> Vec<_> {
            let kind = |channel: &Channel| (channel.name.clone(), channel.samples.kind());
            picture.channels.iter().map(kind).collect()
        };
        let own = &unfinished.picture;
        let fits = (own.display, own.window) == (picture.display, picture.window) && kinds(own) == kinds(&picture);
        if !fits || !picture.is_whole() || done.len() != self.blocks() {
            return None;
        }
        unfinished.picture = picture;
        let tally = unfinished.tally.get_mut().unwrap_or_else(PoisonError::into_inner);
        (tally.done, tally.earlier) = (done, take(&mut unfinished.picture.cryptomattes));
        Some(unfinished)
    }

    /// The picture of all blocks that are there; `threads` and `start` (of tracing) are for its statistics.
    pub fn finish(&self, unfinished: Unfinished, threads: usize, start: Instant) -> Rendering {
        let seconds = start.elapsed().as_secs_f64();
        let Unfinished { mut picture, tally } = unfinished;
        let Tally { mut stats, mut spent, seen, earlier, .. } =
            tally.into_inner().unwrap_or_else(PoisonError::into_inner);
        (stats.threads, stats.trace_seconds) = (threads, seconds);
        // Sums of floats depend on their order, blocks come in any.
        spent.sort_unstable_by_key(|(block, _)| *block);
        stats.noise = self.target.map(|target| Reached::of(target, spent.iter().map(|(_, spent)| *spent)));
        self.report_skips(&mut stats);
        picture.cryptomattes = earlier;
        let names = match self.asked() {
            Some(plan) => {
                plan.add_cryptomattes(&seen, &mut picture);
                plan.names(&picture)
            }
            None => IdNames::default(),
        };
        Rendering { picture, stats, names }
    }
}

impl Unfinished {
    /// The blocks that are there.
    pub fn done(&self) -> Vec<bool> {
        lock(&self.tally).done.clone()
    }

    /// Opens it for more blocks.
    pub fn open<'p, 's>(&'p mut self, task: &'p Task<'s>) -> Gathering<'p, 's> {
        let bands = self.picture.bands(EDGE).into_iter().map(Mutex::new).collect();
        Gathering { task, bands, tally: &self.tally }
    }
}

impl<'s> Gathering<'_, 's> {
    /// What the blocks are of.
    pub fn task(&self) -> &Task<'s> {
        self.task
    }

    /// Puts a block where it belongs. Blocks of different rows of blocks do not wait for each other.
    pub fn add(&self, traced: Traced) {
        let (window, pixels) = self.task.pixels(&traced);
        let layers = self.task.asked().and_then(|_| self.task.layers(&traced));
        let number = |y: i32| y.div_euclid(EDGE);
        let first = number(self.task.window.y0);
        for number in number(window.y0)..=number(window.y1 - 1) {
            let band = usize::try_from(number - first).ok().and_then(|band| self.bands.get(band));
            band.into_iter().for_each(|band| lock(band).put(window, pixels, layers.map_or(&[], |work| &work.channels)));
        }
        let mut tally = lock(self.tally);
        if let Some(work) = layers {
            tally.seen.iter_mut().zip(&work.seen).for_each(|(all, more)| all.extend(more));
        }
        traced.count_in(&mut tally.stats);
        tally.spent.extend(traced.spent().map(|spent| (traced.block, spent)));
        // Last of all: what is said to be done is there.
        tally.done[traced.block] = true;
    }

    /// Shows a block that is about to be put where it belongs.
    pub fn show(&self, traced: &Traced, look: impl FnOnce(&Shown)) {
        let (window, pixels) = self.task.pixels(traced);
        look(&Shown { window, pixels, so_far: &|| self.task.finish(self.so_far(), 0, Instant::now()) });
    }

    /// A copy of it with the blocks that are there by now.
    pub fn so_far(&self) -> Unfinished {
        let tally = lock(self.tally).clone();
        let mut picture = self.task.blank();
        self.bands.iter().for_each(|band| lock(band).copy_to(&mut picture));
        Unfinished { picture, tally: Mutex::new(tally) }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
