//! The tree and the ways down it.
//!
//! One 8-wide tree serves two kinds of walk. Coherent rays go down as a tile of eight packets, first
//! all of them against eight boxes, then a lane a packet; in a leaf a lane is a ray. Incoherent rays go
//! down as a stream, each for itself, a lane a box, and in a leaf a lane is a primitive.
//! Shadow rays whose packets overlap are put into other tiles first, where they are close together.

mod build;
mod bundle;
mod leaf;
mod line;
mod node;
mod outline;
mod regroup;
mod split;
mod stack;
mod stream;
#[cfg(test)]
mod tests;
mod tile;

pub use self::tile::{PACKETS, Tile};

use glam::Vec3;

use self::node::{Beam, Leaf, Node};
use self::regroup::Regroup;
use self::stack::Entry;
use self::stream::Stream;
use self::tile::Waiting;
use crate::lanes::Ray;
use crate::plan::Kind;
use crate::shapes::{RowRef, Stores};

/// All primitives of a render, ready to be met.
#[derive(Debug)]
pub struct Tree {
    stores: Stores,
    nodes: Vec<Node>,            // the root first; empty where nothing has bounds
    room: usize,                 // the most that waits on the way down
    loose: Vec<Leaf>,            // met by every ray: planes, which have no bounds, and all there is of tiny scenes
    loose_boxes: Vec<[Vec3; 2]>, // bounds of what is loose, planes apart
    culls: bool,                 // some row hides a side
    size: f32,                   // longest edge of the bounds, scene units
    grain: f32,                  // the same of the boxes of leaves, their median
    one_by_one: bool,            // no tiles
}

/// Work done, and room for it: one a thread.
#[derive(Debug, Default)]
pub struct Walk {
    /// What was done so far.
    pub counts: Counts,
    waiting: Vec<Entry<Waiting>>,
    /// Rays of the packets of one tile.
    own: Stream,
    beams: Vec<(Beam, usize)>,
    /// Rays of packets that go different ways, and by packet its tile and its place there.
    apart: Stream,
    parted: Vec<(u32, u32)>,
    regroup: Regroup,
}

/// Tests done, in pairs of a ray or packet and a box or primitive.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct Counts {
    /// Boxes of tree nodes.
    pub boxes: u64,
    /// (Ray, primitive) pairs by [`Kind`].
    pub kinds: [u64; Kind::ALL.len()],
    /// Pairs decided again in f64.
    pub redecided: u64,
    /// Pairs of hits among them whose order f64 cannot tell either.
    pub ties: u64,
}

impl Counts {
    /// Both together.
    pub fn sum(mut self, other: Counts) -> Self {
        self.add(&other);
        self
    }

    /// What was added to an earlier state.
    pub fn since(&self, before: &Counts) -> Self {
        Counts {
            boxes: self.boxes - before.boxes,
            kinds: std::array::from_fn(|kind| self.kinds[kind] - before.kinds[kind]),
            redecided: self.redecided - before.redecided,
            ties: self.ties - before.ties,
        }
    }

    /// Sums up.
    pub fn add(&mut self, other: &Counts) {
        self.boxes += other.boxes;
        self.redecided += other.redecided;
        self.ties += other.ties;
        for (sum, count) in self.kinds.iter_mut().zip(other.kinds) {
            *sum += count;
        }
    }
}

impl Tree {
    /// With `true`, tiles are taken apart and their rays go one by one: the same bits, more slowly.
    pub fn one_by_one(self, one_by_one: bool) -> Self {
        Tree { one_by_one, ..self }
    }

    /// With `false`, f32 alone decides, and some rays are decided wrongly: for measuring what certainty costs.
    pub fn certify(mut self, certify: bool) -> Self {
        self.stores.set_certify(certify);
        self
    }

    /// The stores, for what is to be known of a row that was met.
    pub fn stores(&self) -> &Stores {
        &self.stores
    }

    /// Memory of the nodes in bytes.
    pub fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>()
    }

    /// What one ray meets first, and where.
    pub fn closest(&self, ray: &Ray, walk: &mut Walk) -> (f32, RowRef) {
        let mut tile = Tile::of_one(ray);
        self.closest_tiles(std::slice::from_mut(&mut tile), walk);
        match tile.hit(0, 0) {
            RowRef::MISS => (ray.t_max, RowRef::MISS),
            row => (tile.packets[0].t_max.as_array()[0], row),
        }
    }

    /// Whether one ray meets anything, either side of it.
    pub fn occluded(&self, ray: &Ray, walk: &mut Walk) -> bool {
        let mut tile = Tile::of_one(ray);
        self.occluded_tiles(std::slice::from_mut(&mut tile), walk);
        ray.is_valid() && !tile.packets[0].live().any()
    }
}

impl Walk {
    fn make_room(&mut self, room: usize) {
        if self.waiting.len() < room {
            self.waiting.resize(room, Entry::default());
        }
        if self.beams.is_empty() {
            self.beams.resize(PACKETS, (Beam::default(), 0));
        }
    }
}
