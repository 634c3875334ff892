//! Builds the tree from the root: the largest of a node's parts is cut in two by the surface area heuristic until there
//! are eight children, and the parts are put in the order of their leaves.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::Tree;
use super::node::{Child, Content, Leaf, Node};
use super::split::{Item, Span};
use crate::lanes::LANES;
use crate::plan::{Kind, Parts, Plan, Skip};
use crate::scene::Visible;
use crate::shapes::{Groups, Part, Stores};

/// Parts below a node from which on its children are built side by side.
const SIDE_BY_SIDE: usize = 1 << 12;

impl Tree {
    /// All that takes part in a plan.
    pub fn planned(plan: &Plan) -> Self {
        let mut tree = match plan.skips.leaves_out(Skip::Tree) {
            true => Tree::straight(plan.parts(), &plan.visible),
            false => Tree::new(plan.parts(), &plan.visible),
        };
        if !plan.skips.allows(Skip::Kinds) {
            let absent = tree.stores.pad().into_iter();
            tree.loose.extend(absent.map(|kind| Leaf { kind, block: 0, count: 1 }));
        }
        tree
    }

    /// Takes the parts; `visible` tells by material which sides are seen.
    pub fn new(parts: Parts, visible: &[Visible]) -> Self {
        let items = items(&parts);
        Tree::of(parts, visible, items)
    }

    /// The same without nodes: every ray is held against every part, which is faster where there are few.
    pub fn straight(parts: Parts, visible: &[Visible]) -> Self {
        let corners = |item: &Item| item.bounds().corners().map(Vec3::from);
        let loose_boxes = items(&parts).iter().map(corners).collect();
        Tree { loose_boxes, ..Tree::of(parts, visible, Vec::new()) }
    }

    fn of(mut parts: Parts, visible: &[Visible], mut items: Vec<Item>) -> Self {
        let mut nodes = Vec::new();
        let counts =
            Kind::ALL.map(|kind| if items.is_empty() || kind == Kind::Plane { count(&parts, kind) } else { 0 });
        let (mut size, mut depth, mut groups) = (0.0, 0, None);
        if !items.is_empty() {
            let root = Span::new(&items, 0, items.len());
            size = root.bounds.edges().into_iter().fold(0.0, f32::max);
            let branch = Branch::new(&mut items, root);
            (nodes, depth) = (branch.nodes, branch.depth);
            nodes.shrink_to_fit();
            let (order, sizes) = rows(&items, &branch.leaves);
            drop(items);
            parts = reorder(parts, &order);
            groups = Some(sizes);
        }
        let stores = Stores::new(parts, groups.as_ref(), visible);
        let leaves = |(kind, count): (Kind, usize)| {
            let leaf = move |block| Leaf { kind, block, count: LANES.min(count - block * LANES) };
            (0..count.div_ceil(LANES)).map(leaf)
        };
        let loose = Kind::ALL.into_iter().zip(counts).flat_map(leaves).collect();
        let culls = stores.hide_any();
        let (grain, room) = (grain(&nodes), LANES * depth);
        Tree { stores, nodes, room, loose, loose_boxes: Vec::new(), culls, size, grain, one_by_one: false }
    }
}

/// The median of the longest edges of the boxes of leaves.
fn grain(nodes: &[Node]) -> f32 {
    let edge = |(_, min, max): (usize, Vec3, Vec3)| (max - min).max_element();
    let leaves = |node: &Node| -> Vec<f32> {
        let is_leaf = |(slot, ..): &(usize, Vec3, Vec3)| matches!(node.child(*slot).content(), Content::Leaf(_));
        node.boxes().filter(is_leaf).map(edge).collect()
    };
    let mut edges: Vec<f32> = nodes.iter().flat_map(leaves).collect();
    let middle = edges.len() / 2;
    if edges.is_empty() { 0.0 } else { *edges.select_nth_unstable_by(middle, f32::total_cmp).1 }
}

fn count(parts: &Parts, kind: Kind) -> usize {
    match kind {
        Kind::Sphere => parts.spheres.len(),
        Kind::Plane => parts.planes.len(),
        Kind::Disk => parts.disks.len(),
        Kind::Triangle => parts.triangles.len(),
        Kind::Quad => parts.quads.len(),
        Kind::Octagon => parts.octagons.len(),
        Kind::Box => parts.boxes.len(),
        Kind::TurnedBox => parts.turned_boxes.len(),
        Kind::Cylinder => parts.cylinders.len(),
        Kind::Cone => parts.cones.len(),
    }
}

fn items(parts: &Parts) -> Vec<Item> {
    let mut items = Vec::new();
    add(&mut items, parts.rounded_origins, Kind::Sphere, &parts.spheres);
    add(&mut items, parts.rounded_origins, Kind::Disk, &parts.disks);
    add(&mut items, parts.rounded_origins, Kind::Triangle, &parts.triangles);
    add(&mut items, parts.rounded_origins, Kind::Quad, &parts.quads);
    add(&mut items, parts.rounded_origins, Kind::Octagon, &parts.octagons);
    add(&mut items, parts.rounded_origins, Kind::Box, &parts.boxes);
    add(&mut items, parts.rounded_origins, Kind::TurnedBox, &parts.turned_boxes);
    add(&mut items, parts.rounded_origins, Kind::Cylinder, &parts.cylinders);
    add(&mut items, parts.rounded_origins, Kind::Cone, &parts.cones);
    items
}

fn add<P: Part>(items: &mut Vec<Item>, origins: DVec3, kind: Kind, parts: &[P]) {
    let item = |(index, part): (usize, &P)| {
        let [low, high] = outward(part.bounds(), origins);
        Item::new(kind, index, low, high)
    };
    items.par_extend(parts.par_iter().enumerate().map(item));
}

/// Bounds in f32 that hold the exact part and the rounded one, where rays that were rounded see them too: 4 roundings of
/// the larger coordinate out, and of that of an origin.
fn outward((min, max): (DVec3, DVec3), origins: DVec3) -> [[f32; 3]; 2] {
    let pad = (min.abs().max(max.abs()) + origins) * f64::from(2.0 * f32::EPSILON);
    let (min, max) = ((min - pad).as_vec3(), (max + pad).as_vec3());
    [min.to_array().map(f32::next_down), max.to_array().map(f32::next_up)]
}

/// A node with all that is below it. Its nodes and blocks are counted from its own first ones.
#[derive(Default)]
struct Branch {
    nodes: Vec<Node>,
    /// Kinds and counts of the leaves, in the order of their items.
    leaves: Vec<(Kind, u8)>,
    /// By kind: how many leaves there are.
    blocks: [usize; Kind::ALL.len()],
    /// Levels of nodes.
    depth: usize,
}

impl Branch {
    /// All the items, which `span` takes in: they are in the order of their leaves when it is done.
    fn new(items: &mut [Item], span: Span) -> Self {
        let mut branch = Branch::default();
        branch.depth = branch.grow(items, span);
        branch
    }

    /// Adds a node and all below it; how many levels those are.
    fn grow(&mut self, items: &mut [Item], span: Span) -> usize {
        let (children, count) = open(items, span);
        let children = &children[..count];
        let own = self.nodes.len();
        self.nodes.push(Node::empty());
        let apart = if span.count > SIDE_BY_SIDE { side_by_side(items, children) } else { Vec::new() };
        let (mut apart, mut deepest) = (apart.into_iter(), 0);
        for (slot, child) in children.iter().enumerate() {
            let content = match child.leaf {
                Some(kind) => Child::leaf(self.add_leaf(kind, child.count)),
                None => Child::node(self.nodes.len()),
            };
            let [low, high] = child.bounds.corners().map(Vec3::from);
            self.nodes[own].set(slot, low, high, content);
            if child.leaf.is_none() {
                let depth = match apart.next() {
                    Some(branch) => self.append(branch),
                    None => self.grow(items, *child),
                };
                deepest = deepest.max(depth);
            }
        }
        1 + deepest
    }

    fn add_leaf(&mut self, kind: Kind, count: usize) -> Leaf {
        let block = self.blocks[kind as usize];
        self.blocks[kind as usize] += 1;
        self.leaves.push((kind, count as u8));
        Leaf { kind, block, count }
    }

    /// Adds a branch that was built apart; how many levels it has.
    fn append(&mut self, branch: Branch) -> usize {
        let first = self.nodes.len();
        self.nodes.extend(branch.nodes);
        self.nodes[first..].iter_mut().for_each(|node| node.shift(first, &self.blocks));
        self.leaves.extend(branch.leaves);
        self.blocks.iter_mut().zip(branch.blocks).for_each(|(own, blocks)| *own += blocks);
        branch.depth
    }
}

/// The branches of those children that are no leaves.
fn side_by_side(mut items: &mut [Item], children: &[Span]) -> Vec<Branch> {
    let mut tasks = Vec::with_capacity(children.len());
    // They follow each other, and the last of them comes first off the end.
    for child in children.iter().rev() {
        let (rest, own) = items.split_at_mut(child.first);
        items = rest;
        if child.leaf.is_none() {
            tasks.push((&mut own[..child.count], child.at_start()));
        }
    }
    tasks.into_par_iter().rev().map(|(items, span)| Branch::new(items, span)).collect()
}

/// Cuts the largest span again and again until there are eight, or as many as there can be, and puts them in the order of
/// their items.
fn open(items: &mut [Item], span: Span) -> ([Span; LANES], usize) {
    let (mut open, mut areas, mut count) = ([span; LANES], [f32::INFINITY; LANES], 1);
    while count < LANES {
        let inner = (0..count).filter(|k| open[*k].leaf.is_none());
        let Some(largest) = inner.max_by(|a, b| areas[*a].total_cmp(&areas[*b])) else { break };
        [open[largest], open[count]] = open[largest].split(items);
        (areas[largest], areas[count]) = (open[largest].bounds.half_area(), open[count].bounds.half_area());
        count += 1;
    }
    open[..count].sort_unstable_by_key(|span| span.first);
    (open, count)
}

/// A part among those of its kind.
type Place = (Kind, u32);

/// By kind: the parts in the order of their rows, and how many of them each leaf has, from items in the order of leaves.
fn rows(mut items: &[Item], leaves: &[(Kind, u8)]) -> ([Vec<Place>; Kind::ALL.len()], Groups) {
    let (mut order, mut sizes) = (<[Vec<Place>; Kind::ALL.len()]>::default(), Groups::default());
    for (kind, count) in leaves {
        let (own, rest) = items.split_at(usize::from(*count));
        order[*kind as usize].extend(own.iter().map(|item| (item.kind(), item.index())));
        sizes[*kind as usize].push(*count);
        items = rest;
    }
    (order, sizes)
}

fn reorder(parts: Parts, order: &[Vec<Place>]) -> Parts {
    fn pick<P: Part>(order: &[Vec<Place>], kind: Kind, part: impl Fn(&Place) -> P + Sync + Send) -> Vec<P> {
        order[kind as usize].par_iter().map(part).collect()
    }
    fn same<P: Part>(parts: &[P], order: &[Vec<Place>], kind: Kind) -> Vec<P> {
        pick(order, kind, |(_, i)| parts[*i as usize].clone())
    }
    let Parts { triangles, quads, octagons, .. } = &parts;
    let quad = |(kind, i): &Place| match kind {
        Kind::Triangle => triangles[*i as usize].with_corners(),
        _ => quads[*i as usize],
    };
    let octagon = |(kind, i): &Place| match kind {
        Kind::Triangle => triangles[*i as usize].with_corners(),
        Kind::Quad => quads[*i as usize].with_corners(),
        _ => octagons[*i as usize],
    };
    Parts {
        spheres: same(&parts.spheres, order, Kind::Sphere),
        disks: same(&parts.disks, order, Kind::Disk),
        triangles: same(triangles, order, Kind::Triangle),
        quads: pick(order, Kind::Quad, quad),
        octagons: pick(order, Kind::Octagon, octagon),
        boxes: same(&parts.boxes, order, Kind::Box),
        turned_boxes: same(&parts.turned_boxes, order, Kind::TurnedBox),
        cylinders: same(&parts.cylinders, order, Kind::Cylinder),
        cones: same(&parts.cones, order, Kind::Cone),
        planes: parts.planes,
        rounded_origins: parts.rounded_origins,
    }
}
