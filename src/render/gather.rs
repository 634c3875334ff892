//! Where the blocks of a picture come together: each is put in its place as it is done, and its room is used again.
//!
//! Blocks that are kept until all are there take the memory of a picture twice, and memory that is touched for the first
//! time costs more than what is written there, because the system clears it page by page.

use std::mem::take;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::adaptive::{Reached, Spent};
use super::block::EDGE;
use super::layers::{Numbers, Seen, missed};
use super::passing::Passing;
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
    place: Place<'p>,
    tally: &'p Mutex<Tally>,
}

/// Where blocks go.
enum Place<'p> {
    /// Into a picture; the first band has its first row.
    Picture(Vec<Mutex<Band<'p>>>),
    /// On, with the others of their rows.
    On(Passing, &'p (dyn Fn(&Picture) + Sync)),
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
#[derive(Debug, Clone, Default)]
struct Tally {
    done: Vec<bool>,
    stats: Stats,
    /// By block, where there is a noise level.
    spent: Vec<(usize, Spent)>,
    seen: Seen,
    /// Of rows that were passed on.
    numbers: Numbers,
    /// Seconds of all threads.
    busy: f64,
    /// What is known of blocks from a run before.
    earlier: Vec<Cryptomatte>,
}

impl<'s> Task<'s> {
    /// A picture without any block.
    pub fn begin(&self) -> Unfinished {
        self.begin_with(self.blank())
    }

    /// One whose rows are to be passed on: it stays without samples.
    pub fn begin_hollow(&self) -> Unfinished {
        self.begin_with(self.hollow())
    }

    fn begin_with(&self, picture: Picture) -> Unfinished {
        let tally = Tally { done: vec![false; self.blocks()], stats: self.prepared(), ..Tally::default() };
        Unfinished { picture, tally: Mutex::new(tally) }
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
        let Tally { mut stats, mut spent, seen, earlier, mut numbers, busy, .. } =
            tally.into_inner().unwrap_or_else(PoisonError::into_inner);
        (stats.threads, stats.trace_seconds, stats.busy_seconds) = (threads, seconds, busy);
        // Sums of floats depend on their order, blocks come in any.
        spent.sort_unstable_by_key(|(block, _)| *block);
        stats.noise = self.target.map(|target| Reached::of(target, spent.iter().map(|(_, spent)| *spent)));
        self.report_skips(&mut stats);
        picture.cryptomattes = earlier;
        let names = match self.asked() {
            Some(plan) => {
                plan.add_cryptomattes(&seen, &mut picture);
                numbers.add(Numbers::of(&picture));
                plan.names(numbers)
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
        Gathering { task, place: Place::Picture(bands), tally: &self.tally }
    }

    /// Opens it for blocks whose rows are passed on as soon as they are whole: so many at a time or some multiple, counted
    /// from the first one. Their samples are kept no longer.
    pub fn pass<'p, 's>(
        &'p mut self,
        task: &'p Task<'s>,
        rows: usize,
        to: &'p (dyn Fn(&Picture) + Sync),
    ) -> Gathering<'p, 's> {
        let rows = i32::try_from(rows).unwrap_or(i32::MAX).max(1);
        let rows = rows.saturating_mul(EDGE.div_euclid(rows).max(1));
        Gathering { task, place: Place::On(Passing::new(&self.picture, rows), to), tally: &self.tally }
    }
}

impl<'s> Gathering<'_, 's> {
    /// What the blocks are of.
    pub fn task(&self) -> &Task<'s> {
        self.task
    }

    /// Puts a block where it belongs. Blocks of different rows of blocks do not wait for each other.
    pub fn add(&self, traced: Traced) {
        let start = Instant::now();
        let (window, pixels) = self.task.pixels(&traced);
        let layers = self.task.asked().and_then(|_| self.task.layers(&traced));
        let channels = layers.map_or(&[][..], |work| &work.channels);
        let mut whole = Vec::new();
        match &self.place {
            Place::Picture(bands) => {
                let number = |y: i32| y.div_euclid(EDGE);
                let first = number(self.task.window.y0);
                for number in number(window.y0)..=number(window.y1 - 1) {
                    let band = usize::try_from(number - first).ok().and_then(|band| bands.get(band));
                    band.into_iter().for_each(|band| lock(band).put(window, pixels, channels));
                }
            }
            Place::On(passing, _) => whole = passing.put(window, pixels, channels),
        }
        let mut tally = lock(self.tally);
        if let Some(work) = layers {
            tally.seen.iter_mut().zip(&work.seen).for_each(|(all, more)| all.extend(more));
        }
        traced.count_in(&mut tally.stats);
        tally.spent.extend(traced.spent().map(|spent| (traced.block, spent)));
        tally.busy += traced.seconds + start.elapsed().as_secs_f64();
        // Last of all: what is said to be done is there.
        tally.done[traced.block] = true;
        drop(tally);
        if let Place::On(passing, to) = &self.place {
            whole.into_iter().for_each(|rows| passing.pass(rows, |rows| self.pass(rows, to)));
        }
    }

    fn pass(&self, rows: &Picture, to: &dyn Fn(&Picture)) {
        let numbers = Numbers::of(rows);
        lock(self.tally).numbers.add(numbers);
        to(rows);
    }

    /// Shows a block that is about to be put where it belongs.
    pub fn show(&self, traced: &Traced, look: impl FnOnce(&Shown)) {
        let (window, pixels) = self.task.pixels(traced);
        look(&Shown { window, pixels, so_far: &|| self.task.finish(self.so_far(), 0, Instant::now()) });
    }

    /// A copy of it with the blocks that are there by now; without samples where rows are passed on.
    pub fn so_far(&self) -> Unfinished {
        let tally = lock(self.tally).clone();
        let picture = match &self.place {
            Place::Picture(bands) => {
                let (mut picture, hollow) = (self.task.blank(), self.task.hollow());
                bands.iter().for_each(|band| lock(band).copy_to(&mut picture));
                // Nor is there anything of blocks that came since the tally was taken.
                let left = (0..self.task.blocks()).filter(|block| !tally.done[*block]);
                left.for_each(|block| picture.put(missed(&hollow, self.task.place(block))));
                picture
            }
            Place::On(..) => self.task.hollow(),
        };
        Unfinished { picture, tally: Mutex::new(tally) }
    }

    /// Where rows are passed on, copies of those that were not yet, with the blocks that are there by now.
    pub fn waiting(&self) -> impl Iterator<Item = Picture> {
        let passing = match &self.place {
            Place::Picture(_) => None,
            Place::On(passing, _) => Some(passing),
        };
        passing.into_iter().flat_map(Passing::waiting)
    }
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
