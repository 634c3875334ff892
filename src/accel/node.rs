//! A node of the tree: eight boxes, and the test of eight boxes or eight packets at once.

use glam::Vec3;
use prefetch_index::prefetch_index;

use crate::lanes::{Columns, Float8, LANES, Mask8, UNIT_ROUNDOFF, Vec3x8, float8};
use crate::plan::Kind;

/// Eight boxes and what they hold. An empty slot has an inverted box, which nothing meets.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct Node {
    /// A lane a child: by axis lower and upper bounds, then what the slots hold, and how large.
    columns: [Float8; 8],
}

/// Column of the children.
const CHILDREN: usize = 6;
/// Column of the longest edges of their boxes.
const SIZES: usize = 7;

/// What bounds of rows that f32 computed are moved out by, as a share: rows round, and then their bounds do.
const ROW_PAD: f32 = 16.0 * UNIT_ROUNDOFF;

/// What a slot holds, in 32 bits.
#[derive(Debug, Clone, Copy, Default)]
pub struct Child(u32);

/// The same spelled out.
#[derive(Debug, Clone, Copy)]
pub enum Content {
    /// A node, by index.
    Node(usize),
    /// The first rows of a block.
    Leaf(Leaf),
}

/// Parts of one kind.
#[derive(Debug, Clone, Copy)]
pub struct Leaf {
    /// Their kind.
    pub kind: Kind,
    /// Their block in its store.
    pub block: usize,
    /// How many there are, 1 to 8.
    pub count: usize,
}

impl Child {
    const BLOCK_BITS: u32 = 25;
    const KIND_BIT: u32 = 28;

    /// A node, by index.
    pub fn node(index: usize) -> Self {
        Child(index as u32)
    }

    /// Parts of one kind.
    pub fn leaf(leaf: Leaf) -> Self {
        let kind = (leaf.kind as u32 + 1) << Child::KIND_BIT;
        Child(kind | (leaf.count as u32 - 1) << Child::BLOCK_BITS | leaf.block as u32)
    }

    /// What it is.
    #[inline(always)]
    pub fn content(self) -> Content {
        let Some(kind) = (self.0 >> Child::KIND_BIT).checked_sub(1) else { return Content::Node(self.0 as usize) };
        Content::Leaf(Leaf {
            kind: Kind::ALL[kind as usize % Kind::ALL.len()],
            block: (self.0 & ((1 << Child::BLOCK_BITS) - 1)) as usize,
            count: (self.0 >> Child::BLOCK_BITS & 7) as usize + 1,
        })
    }
}

impl Node {
    /// Eight empty slots.
    #[inline(always)]
    pub fn empty() -> Self {
        let (low, high, zero) = (float8(f32::INFINITY), float8(f32::NEG_INFINITY), Float8::ZERO);
        Node { columns: [low, high, low, high, low, high, zero, zero] }
    }

    /// Fills a slot; bounds must be those of f32 already.
    pub fn set(&mut self, slot: usize, min: Vec3, max: Vec3, child: Child) {
        for axis in 0..3 {
            self.columns[2 * axis].as_mut_array()[slot] = min[axis];
            self.columns[2 * axis + 1].as_mut_array()[slot] = max[axis];
        }
        self.columns[CHILDREN].as_mut_array()[slot] = f32::from_bits(child.0);
        self.columns[SIZES].as_mut_array()[slot] = (max - min).max_element();
    }

    /// What a slot holds.
    #[inline(always)]
    pub fn child(&self, slot: usize) -> Child {
        Child(self.columns[CHILDREN].as_array()[slot % LANES].to_bits())
    }

    /// Counts its children from other first ones: nodes, and blocks by kind.
    pub fn shift(&mut self, nodes: usize, blocks: &[usize; Kind::ALL.len()]) {
        for lane in 0..LANES {
            let moved = match self.child(lane).content() {
                Content::Node(0) => continue, // nobody's child: an empty slot
                Content::Node(index) => Child::node(index + nodes),
                Content::Leaf(leaf) => Child::leaf(Leaf { block: leaf.block + blocks[leaf.kind as usize], ..leaf }),
            };
            self.columns[CHILDREN].as_mut_array()[lane] = f32::from_bits(moved.0);
        }
    }

    /// Asks for all of it to be brought near.
    #[inline(always)]
    pub fn fetch(&self) {
        (0..self.columns.len()).step_by(2).for_each(|column| prefetch_index(self.columns.as_slice(), column));
    }

    /// The leaves among its children.
    pub fn leaves(&self) -> impl Iterator<Item = Leaf> {
        // The root is nobody's child: an empty slot.
        let child = |slot| match self.child(slot).content() {
            Content::Leaf(leaf) => Some(leaf),
            Content::Node(_) => None,
        };
        (0..LANES).filter_map(child)
    }

    /// The longest edge of the box of a slot, in all lanes.
    #[inline(always)]
    pub fn size(&self, slot: usize) -> Float8 {
        self.columns[SIZES].broadcast(slot)
    }

    /// The slots that hold something: lower and upper corners of their boxes.
    pub fn boxes(&self) -> impl Iterator<Item = (usize, Vec3, Vec3)> {
        let corner = |slot: usize, side: usize| {
            let at = |axis: usize| self.columns[2 * axis + side].as_array()[slot];
            Vec3::new(at(0), at(1), at(2))
        };
        let boxes = (0..LANES).map(move |slot| (slot, corner(slot, 0), corner(slot, 1)));
        boxes.filter(|(_, min, max)| min.x <= max.x)
    }

    /// Boxes around eight rows; those of rows that hold nothing are NaN, which nothing meets.
    #[inline(always)]
    pub fn around((low, high): (Vec3x8, Vec3x8)) -> Self {
        let pad = (low.abs() + high.abs()) * float8(ROW_PAD);
        let (low, high, zero) = (low - pad, high + pad, Float8::ZERO);
        Node { columns: [low.x, high.x, low.y, high.y, low.z, high.z, zero, zero] }
    }

    /// The planes of all boxes that are entered and left by on an axis, a lane a child.
    #[inline(always)]
    pub fn planes(&self, near: usize) -> (Float8, Float8) {
        (self.columns[near % 8], self.columns[(near ^ 1) % 8])
    }
}

/// By axis the column of the planes that rays enter by which go down on the axes of `back`.
pub fn near_planes(back: [bool; 3]) -> [usize; 3] {
    [usize::from(back[0]), 2 + usize::from(back[1]), 4 + usize::from(back[2])]
}

/// Bounds of some rays: for one ray they are the ray.
#[derive(Debug, Default, Clone, Copy)]
pub struct Beam {
    /// Origins furthest along the direction, which reach a plane first.
    pub origin_near: [Float8; 3],
    /// Origins least far along it.
    pub origin_far: [Float8; 3],
    /// Inverse directions of least magnitude.
    pub inv_near: [Float8; 3],
    /// Inverse directions of greatest magnitude.
    pub inv_far: [Float8; 3],
    /// By axis the column of the planes by which they enter.
    pub near: [usize; 3],
    /// Axes on which some rays go up and some go down: those that go up enter by the lower plane, and those that go
    /// down, which the far values stand for, by the upper one.
    pub split: [bool; 3],
    /// Where the rays begin at the earliest, not before their origins.
    pub start: Float8,
}

/// Coordinates of a direction closer to zero than this share of the largest one count as that: nothing overflows to
/// NaN, and a ray along a slab stays within it.
const LEAST_DIRECTION: f32 = 1e-30;

/// The least that coordinates of directions count as, where the largest of them is `largest`.
#[inline(always)]
pub fn least_direction(largest: Float8) -> Float8 {
    (largest * float8(LEAST_DIRECTION)).fast_max(float8(f32::MIN_POSITIVE))
}

/// What inverses of far planes are longer by, so that no hit is lost to rounding (Ize, "Robust BVH ray traversal",
/// Journal of Computer Graphics Techniques 2(2), 2013, needs 4 roundings).
pub const OUTWARD: f32 = 1.0 + 8.0 * UNIT_ROUNDOFF;

/// How far a hit may seem to lie before the box that it is in, as a share of its `t`: a flat primitive divides
/// the roundings of its `t` by the cosine it is seen at, which this covers down to 0.003.
const HIT_SLACK: f32 = 4096.0 * UNIT_ROUNDOFF;

/// How far boxes are looked for where the best hits are at `t`: of hits at the same place all are to be found, so
/// that the lowest primitive wins on every walk. Short of infinity, where empty slots are.
#[inline(always)]
pub fn reach(t: Float8) -> Float8 {
    let most = float8(f32::MAX);
    t.abs().fast_min(most).mul_add(float8(HIT_SLACK), t).fast_min(most)
}

impl Beam {
    /// The bounds of one lane in all lanes.
    #[inline(always)]
    pub fn broadcast(&self, lane: usize) -> Self {
        Beam {
            origin_near: self.origin_near.broadcast(lane),
            origin_far: self.origin_far.broadcast(lane),
            inv_near: self.inv_near.broadcast(lane),
            inv_far: self.inv_far.broadcast(lane),
            ..*self
        }
    }

    /// Where the rays may enter the boxes of a node at the earliest, and which boxes they may meet before `limit`.
    #[inline(always)]
    pub fn meets_children(&self, node: &Node, limit: Float8) -> (Float8, Mask8) {
        self.meets(|k| node.planes(self.near[k]), limit)
    }

    /// Where each of the rays may enter one box of a node at the earliest, and which may meet it before `limit`.
    #[inline(always)]
    pub fn meets_child(&self, node: &Node, slot: usize, limit: Float8) -> (Float8, Mask8) {
        let plane = |column: usize| float8(node.columns[column % 8].as_array()[slot % LANES]);
        self.meets(|k| (plane(self.near[k]), plane(self.near[k] ^ 1)), limit)
    }

    #[inline(always)]
    fn meets(&self, planes: impl Fn(usize) -> (Float8, Float8), limit: Float8) -> (Float8, Mask8) {
        let (mut entry, mut exit) = (self.start, limit);
        for k in 0..3 {
            let (near, far) = planes(k);
            let near = (near - self.origin_near[k]) * self.inv_near[k];
            let far = (far - self.origin_far[k]) * self.inv_far[k];
            entry = near.fast_max(entry);
            if self.split[k] {
                entry = far.fast_max(entry);
            } else {
                exit = far.fast_min(exit);
            }
        }
        (entry, Mask8::le(entry, exit))
    }
}
