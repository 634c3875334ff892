//! One ray down the tree: a lane is a child, in leaves a primitive.

use super::leaf::RayLeaf;
use super::node::{Beam, Child};
use super::{Tree, Walk};
use crate::lanes::{LANES, Ray, RayPacket, float8};
use crate::plan::Kind;
use crate::shapes::RowRef;

/// A child that may hold something nearer.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    entry: f32,
    child: Child,
}

impl Tree {
    /// The closest hit of one valid ray, or with `ANY` the first one found.
    pub(super) fn walk_single<const ANY: bool, const CULL: bool>(&self, ray: &Ray, walk: &mut Walk) -> (f32, RowRef) {
        let mut rays = RayPacket::splat(ray);
        let mut hit = RowRef::MISS;
        let planes = 0..self.stores.count(Kind::Plane);
        self.ray_leaf::<ANY, CULL>(Kind::Plane, planes, &mut rays, &mut hit, walk);
        if self.nodes.is_empty() || (ANY && hit != RowRef::MISS) {
            return (rays.t_max.to_array()[0], hit);
        }
        let beam = Beam::of_ray(ray);
        let mut stack = std::mem::take(&mut walk.short);
        stack.clear();
        stack.push(Entry { entry: ray.t_min, child: Child::Node(0) });
        while let Some(Entry { entry, child }) = stack.pop() {
            if entry > rays.t_max.to_array()[0] {
                continue;
            }
            match child {
                Child::Node(index) => self.open(index, &beam, &rays, &mut stack, walk),
                Child::Leaf { kind, first, count } => {
                    self.ray_leaf::<ANY, CULL>(kind, first..first + count, &mut rays, &mut hit, walk);
                    if ANY && hit != RowRef::MISS {
                        break;
                    }
                }
            }
        }
        walk.short = stack;
        (rays.t_max.to_array()[0], hit)
    }

    /// Pushes the children that the ray may meet, the nearest last.
    #[inline(always)]
    fn open(&self, index: usize, beam: &Beam, rays: &RayPacket, stack: &mut Vec<Entry>, walk: &mut Walk) {
        let node = &self.nodes[index];
        walk.counts.boxes += LANES as u64;
        let (entries, met) = beam.meets(&node.planes(beam.back), rays.t_max);
        let entries = entries.to_array();
        let (bottom, mut lanes) = (stack.len(), met.bits());
        while lanes != 0 {
            let slot = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let mut at = stack.len();
            let new = Entry { entry: entries[slot], child: node.child(slot) };
            stack.push(new);
            while at > bottom && stack[at - 1].entry < new.entry {
                stack[at] = stack[at - 1];
                at -= 1;
            }
            stack[at] = new;
        }
    }

    #[inline(always)]
    fn ray_leaf<const ANY: bool, const CULL: bool>(
        &self,
        kind: Kind,
        rows: std::ops::Range<usize>,
        ray: &mut RayPacket,
        hit: &mut RowRef,
        walk: &mut Walk,
    ) {
        let (stores, counts) = (&self.stores, &mut walk.counts);
        stores.visit(kind, RayLeaf::<ANY, CULL> { stores, kind, rows, ray, hit, counts });
        debug_assert!(ray.t_max.to_array() == float8(ray.t_max.to_array()[0]).to_array());
    }
}
