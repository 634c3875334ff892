//! Where the primitives are, as boxes: from the largest to those of the rows of leaves.

use glam::Vec3;

use super::Tree;
use super::node::{Content, Leaf, Node};
use crate::plan::Kind;
use crate::shapes::{Part, Store, Visit};

impl Tree {
    /// Shows the boxes of the tree, in f32 and holding all that is in them, from the outermost on: `look` is told the
    /// lower and the upper corner and whether there are none within, and answers whether it wants to see those.
    /// `false`, and nothing is shown, where something has no bounds.
    pub fn outline(&self, mut look: impl FnMut(Vec3, Vec3, bool) -> bool) -> bool {
        if self.loose.iter().any(|leaf| leaf.kind == Kind::Plane) {
            return false;
        }
        for [min, max] in &self.loose_boxes {
            look(*min, *max, true);
        }
        let mut waiting = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(index) = waiting.pop() {
            let node = &self.nodes[index];
            for (slot, min, max) in node.boxes() {
                match node.child(slot).content() {
                    Content::Node(child) if look(min, max, false) => waiting.push(child),
                    Content::Leaf(leaf) if look(min, max, leaf.count == 1) => {
                        for (_, low, high) in self.stores.visit(leaf.kind, RowBoxes(leaf)).boxes() {
                            look(low.max(min), high.min(max), true);
                        }
                    }
                    Content::Node(_) | Content::Leaf(_) => {}
                }
            }
        }
        true
    }
}

/// The boxes of the rows of a leaf.
struct RowBoxes(Leaf);

impl Visit for RowBoxes {
    type Output = Node;

    fn visit<P: Part>(self, store: &Store<P>) -> Node {
        Node::around(P::bounds8(store.block(self.0.block)))
    }
}
