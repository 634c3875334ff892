//! One ray down the tree: a lane is a child, in leaves a primitive.

use super::leaf::RayLeaf;
use super::node::{Child, Content, Leaf, Line, reach};
use super::stack::Stack;
use super::{Tree, Walk};
use crate::lanes::{LANES, RayPacket};
use crate::shapes::RowRef;

impl Tree {
    /// Finds the closest hit of one valid ray, which is in all lanes, or with `ANY` the first one found; its `t_max`
    /// is then the place of the hit.
    pub(super) fn walk_single<const ANY: bool, const CULL: bool>(
        &self,
        ray: &mut RayPacket,
        walk: &mut Walk,
    ) -> RowRef {
        let mut hit = RowRef::MISS;
        for leaf in &self.planes {
            self.ray_leaf::<ANY, CULL>(*leaf, ray, &mut hit, walk);
        }
        if self.nodes.is_empty() || (ANY && hit != RowRef::MISS) {
            return hit;
        }
        self.descend_single::<ANY, CULL>(Child::node(0), ray, &mut hit, walk);
        hit
    }

    /// The same from some child on, and better than `hit`.
    pub(super) fn descend_single<const ANY: bool, const CULL: bool>(
        &self,
        from: Child,
        ray: &mut RayPacket,
        hit: &mut RowRef,
        walk: &mut Walk,
    ) {
        let line = Line::new(ray);
        let mut far = reach(ray.t_max);
        let mut room = std::mem::take(&mut walk.singles);
        let mut stack = Stack::new(&mut room);
        let (mut next, mut opened) = (Some(from), 0);
        while let Some(child) = next {
            let nearest = match child.content() {
                Content::Node(index) => {
                    let node = &self.nodes[index];
                    opened += 1;
                    let (entries, met) = line.meets(node, far);
                    stack.nearest_first::<ANY>(entries, met, |slot| node.child(slot))
                }
                Content::Leaf(leaf) => {
                    self.ray_leaf::<ANY, CULL>(leaf, ray, hit, walk);
                    if ANY && *hit != RowRef::MISS {
                        break;
                    }
                    far = reach(ray.t_max);
                    None
                }
            };
            next = nearest.or_else(|| stack.pop(far.as_array()[0]));
        }
        walk.counts.boxes += opened * LANES as u64;
        walk.singles = room;
    }

    #[inline(always)]
    fn ray_leaf<const ANY: bool, const CULL: bool>(
        &self,
        leaf: Leaf,
        ray: &mut RayPacket,
        hit: &mut RowRef,
        walk: &mut Walk,
    ) {
        let (stores, counts) = (&self.stores, &mut walk.counts);
        stores.visit(leaf.kind, RayLeaf::<ANY, CULL> { stores, leaf, ray, hit, counts });
    }
}
