//! What a render did.

use super::adaptive::Reached;
use super::block::BlockWork;
use crate::accel::Counts;
use crate::integrate::RayCounts;
use crate::plan::{LeftOut, Skipped};

/// Work and time of one frame. Counts are exact and do not depend on threads; seconds are wall time.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Stats {
    /// Threads used.
    pub threads: usize,
    /// Taking the scene apart.
    pub plan_seconds: f64,
    /// Columns and tree.
    pub build_seconds: f64,
    /// Tracing and shading.
    pub trace_seconds: f64,
    /// The same of all threads together, by themselves.
    pub(super) busy_seconds: f64,
    /// Rays by kind.
    pub rays: RayCounts,
    /// Box and primitive tests.
    pub tests: Counts,
    /// Tiles of up to 64 camera rays.
    pub tiles: u64,
    /// Those in which no camera ray met anything.
    pub background_tiles: u64,
    /// Work left out, and why.
    pub skipped: Vec<Skipped>,
    /// The same as counts, while blocks are put together.
    pub(super) left_out: LeftOut,
    /// How good the picture is, where that was asked for.
    pub noise: Option<Reached>,
    /// Memory of the columns.
    pub column_bytes: usize,
    /// Memory of the tree.
    pub tree_bytes: usize,
}

impl Stats {
    /// Adds what the frame of another moment took to prepare.
    pub(super) fn prepared(mut self, other: &Stats) -> Self {
        self.plan_seconds += other.plan_seconds;
        self.build_seconds += other.build_seconds;
        self.column_bytes += other.column_bytes;
        self.tree_bytes += other.tree_bytes;
        self
    }

    /// Takes out of the time of tracing what threads did in between, in seconds of all threads: its share.
    pub fn set_apart(&mut self, seconds: f64) -> f64 {
        let apart = self.trace_seconds * seconds / (self.busy_seconds + seconds).max(f64::MIN_POSITIVE);
        self.trace_seconds -= apart;
        apart
    }

    pub(super) fn add(&mut self, work: &BlockWork) {
        self.rays.add(&work.rays);
        self.tests.add(&work.tests);
        self.left_out.add(&work.left_out);
        self.tiles += work.tiles;
        self.background_tiles += work.background_tiles;
    }
}
