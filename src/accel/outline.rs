//! Where the primitives are, as boxes: from the largest to the leaves.

use glam::Vec3;

use super::Tree;
use super::node::Content;
use crate::plan::Kind;

impl Tree {
    /// Shows the boxes of the tree, in f32 and holding all that is in them, from the outermost on: `look` is told the
    /// lower and the upper corner and whether the box is a leaf, and answers whether it wants to see what is in it.
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
                    Content::Node(_) => {}
                    Content::Leaf(_) => {
                        look(min, max, true);
                    }
                }
            }
        }
        true
    }
}
