//! The way down for eight at a time.
//!
//! Eight packets of a tile, or eight rays of a packet, share one walk: a node is opened by all of them together, a
//! lane a child, and each child is then held against every one of them, a lane a member. Where few are left they
//! go on alone: a packet as eight rays, a ray by itself.

use super::node::{Beam, Child, Content, Leaf, Node};
use super::stack::{Entry, Stack};
use super::{Tree, Walk};
use crate::lanes::{Float8, LANES, Mask8};

/// A child that some members may meet.
#[derive(Debug, Clone, Copy, Default)]
pub struct Waiting {
    node: u32,
    slot: u8,
    /// Members that may meet the node, a bit each.
    members: u8,
}

/// Room for what waits.
pub type Room = [Entry<Waiting>];

/// Eight that go down together.
pub trait Company {
    /// Bounds of each, a lane a member.
    fn beam(&self) -> &Beam;
    /// Opens a node: where some of them together may enter its boxes at the earliest, and which they may meet.
    fn open(&self, node: &Node, members: u32) -> (Float8, Mask8);
    /// How far each of them still looks: below everything once it is done.
    fn far(&self) -> Float8;
    /// The greatest of these.
    fn farthest(&self) -> f32;
    /// Whether so few of them had better go on alone.
    fn part_ways(&self, content: &Content, members: u32) -> bool;
    /// Members that at these places are wider than a box.
    fn wider_than(&self, size: Float8, places: Float8) -> u32;
    /// Lets some go on alone.
    fn alone(&mut self, tree: &Tree, child: Child, members: u32, room: &mut Room, walk: &mut Walk);
    /// Tests some against a leaf.
    fn leaf(&mut self, tree: &Tree, leaf: Leaf, members: u32, walk: &mut Walk);
}

impl Tree {
    /// Takes some members down from a child that they meet.
    #[inline(always)]
    pub(super) fn descend<const ANY: bool, C: Company>(
        &self,
        company: &mut C,
        from: Child,
        members: u32,
        room: &mut Room,
        walk: &mut Walk,
    ) {
        let mut stack = Stack::new(room);
        let mut next = Some((from, members));
        while let Some((child, members)) = next {
            let content = child.content();
            let mut nearest = None;
            match content {
                _ if company.part_ways(&content, members) => company.alone(self, child, members, stack.free(), walk),
                Content::Leaf(leaf) => company.leaf(self, leaf, members, walk),
                Content::Node(index) => {
                    let node = &self.nodes[index];
                    walk.counts.boxes += LANES as u64;
                    let (entries, met) = company.open(node, members);
                    let (node, members) = (index as u32, members as u8);
                    let waiting = |slot| Waiting { node, slot: slot as u8, members };
                    nearest = stack.nearest_first::<ANY>(entries, met, waiting);
                }
            }
            next = loop {
                let farthest = company.farthest();
                let Some(waiting) = nearest.take().or_else(|| stack.pop(farthest)) else { break None };
                let Waiting { node, slot, members } = waiting;
                let (node, slot) = (&self.nodes[node as usize], usize::from(slot));
                walk.counts.boxes += LANES as u64;
                let (entries, met) = company.beam().meets_child(node, slot, company.far());
                let mut met = met.bits() & u32::from(members);
                let wide = company.wider_than(node.size(slot), entries) & met;
                if wide != 0 {
                    company.alone(self, node.child(slot), wide, stack.free(), walk);
                    met &= !wide;
                }
                if met != 0 {
                    break Some((node.child(slot), met));
                }
            };
        }
    }
}
