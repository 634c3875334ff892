//! A node of the tree: eight boxes, and the test of eight boxes or eight packets at once.

use glam::Vec3;

use crate::lanes::{Float8, LANES, Mask8, Ray, UNIT_ROUNDOFF, float8};
use crate::plan::Kind;

/// Eight boxes and what they hold. An empty slot has an inverted box, which nothing meets.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct Node {
    /// Lower and upper bounds by axis, a lane a child.
    pub bounds: [[Float8; 3]; 2],
    /// First row of a leaf, or the index of a node.
    first: [u32; LANES],
    /// 0 for a node; kind and number of rows for a leaf.
    leaf: [u8; LANES],
}

/// What a slot holds.
#[derive(Debug, Clone, Copy)]
pub enum Child {
    /// A node, by index.
    Node(usize),
    /// Rows of one kind.
    Leaf {
        /// Their kind.
        kind: Kind,
        /// The first one.
        first: usize,
        /// How many, 1 to 8.
        count: usize,
    },
}

impl Node {
    /// Eight empty slots.
    pub fn empty() -> Self {
        let infinity = float8(f32::INFINITY);
        Node { bounds: [[infinity; 3], [-infinity; 3]], first: [0; LANES], leaf: [0; LANES] }
    }

    /// Fills a slot; bounds must be those of f32 already.
    pub fn set(&mut self, slot: usize, min: Vec3, max: Vec3, child: Child) {
        for axis in 0..3 {
            for (bound, value) in [(0, min[axis]), (1, max[axis])] {
                let mut lanes = self.bounds[bound][axis].to_array();
                lanes[slot] = value;
                self.bounds[bound][axis] = Float8::from(lanes);
            }
        }
        (self.first[slot], self.leaf[slot]) = match child {
            Child::Node(index) => (index as u32, 0),
            Child::Leaf { kind, first, count } => (first as u32, (kind as u8) << 4 | count as u8),
        };
    }

    /// What a slot holds.
    #[inline(always)]
    pub fn child(&self, slot: usize) -> Child {
        let (first, leaf) = (self.first[slot] as usize, self.leaf[slot]);
        match leaf & 15 {
            0 => Child::Node(first),
            count => Child::Leaf { kind: Kind::ALL[usize::from(leaf >> 4)], first, count: usize::from(count) },
        }
    }

    /// The planes that a ray of these signs enters and leaves by, a lane a child.
    #[inline(always)]
    pub fn planes(&self, back: [bool; 3]) -> Planes {
        let side = |first: bool| std::array::from_fn(|axis| self.bounds[usize::from(back[axis] != first)][axis]);
        Planes { near: side(false), far: side(true) }
    }

    /// The same of one child, in all lanes.
    #[inline(always)]
    pub fn planes_of(&self, slot: usize, back: [bool; 3]) -> Planes {
        let Planes { near, far } = self.planes(back);
        let splat = |planes: [Float8; 3]| planes.map(|plane| float8(plane.as_array()[slot]));
        Planes { near: splat(near), far: splat(far) }
    }
}

/// Where boxes are entered and left, by axis.
#[derive(Debug, Clone, Copy)]
pub struct Planes {
    near: [Float8; 3],
    far: [Float8; 3],
}

/// Bounds of some rays that go the same way on every axis: for one ray they are the ray.
#[derive(Debug, Clone, Copy)]
pub struct Beam {
    /// Origins furthest along the direction, which reach a plane first.
    pub origin_near: [Float8; 3],
    /// Origins least far along it.
    pub origin_far: [Float8; 3],
    /// Inverse directions of least magnitude.
    pub inv_near: [Float8; 3],
    /// Inverse directions of greatest magnitude.
    pub inv_far: [Float8; 3],
    /// Axes on which the rays go down.
    pub back: [bool; 3],
    /// Open ends of the rays, the least.
    pub start: Float8,
}

/// Directions closer to zero than this count as this: nothing overflows to NaN, and a ray along a slab
/// stays within it.
pub const LEAST_DIRECTION: f32 = 1e-30;

/// How far a hit may seem to lie before the box that it is in, as a share of its `t`: a flat primitive divides
/// the roundings of its `t` by the cosine it is seen at, which this covers down to 0.003.
const HIT_SLACK: f32 = 4096.0 * UNIT_ROUNDOFF;

impl Beam {
    /// One ray in all lanes.
    pub fn of_ray(ray: &Ray) -> Self {
        let back = ray.dir.map(f32::is_sign_negative);
        let inv = ray.dir.map(|d| float8(1.0 / d.abs().max(LEAST_DIRECTION).copysign(d)));
        let origin = ray.origin.map(float8);
        Beam { origin_near: origin, origin_far: origin, inv_near: inv, inv_far: inv, back, start: float8(ray.t_min) }
    }

    /// Where the rays may enter the boxes at the earliest, and which boxes they may meet before `limit`.
    ///
    /// `(plane - origin) * inverse` with 8 roundings of slack loses no hit (Ize, "Robust BVH ray traversal",
    /// Journal of Computer Graphics Techniques 2(2), 2013, needs 4). The comparison with the best hit has
    /// [`HIT_SLACK`]: of hits at the same `t` all are found, so that the lowest primitive wins on every walk.
    #[inline(always)]
    pub fn meets(&self, planes: &Planes, limit: Float8) -> (Float8, Mask8) {
        let (mut entry, mut exit) = (self.start, float8(f32::INFINITY));
        for k in 0..3 {
            entry = ((planes.near[k] - self.origin_near[k]) * self.inv_near[k]).fast_max(entry);
            exit = ((planes.far[k] - self.origin_far[k]) * self.inv_far[k]).fast_min(exit);
        }
        let size = entry.abs();
        let tight = size.mul_neg_add(float8(8.0 * UNIT_ROUNDOFF), entry);
        let early = size.mul_neg_add(float8(HIT_SLACK), entry);
        (early, Mask8::le(tight, exit) & Mask8::le(early, limit))
    }
}
