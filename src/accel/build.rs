//! Builds the tree: a binary one by PLOC with reinsertion, leaves whose parts one kind holds by the surface area
//! heuristic, then eight children a node, and the parts in the order of their leaves.

use glam::{DVec3, Vec3, Vec3A};
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;

use super::Tree;
use super::node::{Child, Content, Leaf, Node};
use crate::lanes::LANES;
use crate::plan::{Kind, Parts, Plan, Skip};
use crate::scene::Visible;
use crate::shapes::{Groups, Part, Stores};

/// Most rows of a leaf.
const MOST_ROWS: u32 = 8;
/// Cost of a row in a leaf where that of a binary node, and of opening a leaf, is 1, for the surface area heuristic.
/// Rows share a block and a kernel call, so eight of them cost a single ray what one does, and full leaves are what
/// keeps a large scene in the caches; a packet tests them one by one.
const ROW_COST: f32 = 0.1;
/// The same for a sphere, which is the cheapest to test.
const SPHERE_COST: f32 = 0.125;

/// A part with bounds, and its bounds.
struct Item {
    kind: Kind,
    index: u32,
    aabb: Aabb,
}

impl Boundable for Item {
    fn aabb(&self) -> Aabb {
        self.aabb
    }
}

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
        let loose_boxes = items(&parts).iter().map(|item| [item.aabb.min.into(), item.aabb.max.into()]).collect();
        Tree { loose_boxes, ..Tree::of(parts, visible, Vec::new()) }
    }

    fn of(mut parts: Parts, visible: &[Visible], items: Vec<Item>) -> Self {
        let mut nodes = Vec::new();
        let counts =
            Kind::ALL.map(|kind| if items.is_empty() || kind == Kind::Plane { count(&parts, kind) } else { 0 });
        let (mut size, mut depth, mut groups) = (0.0, 0, None);
        if !items.is_empty() {
            let binary = build_binary(&items);
            let bounds = binary.nodes[0].aabb();
            size = (bounds.max - bounds.min).max_element();
            let mut wide = Widen::new(&binary, &items);
            wide.build();
            wide.nodes.shrink_to_fit();
            (nodes, depth) = (wide.nodes, wide.depth);
            parts = reorder(parts, &wide.order);
            groups = Some(wide.groups);
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
        let (min, max) = part.bounds();
        Item { kind, index: index as u32, aabb: outward(min, max, origins) }
    };
    items.par_extend(parts.par_iter().enumerate().map(item));
}

/// Bounds in f32 that hold the exact part and the rounded one, where rays that were rounded see them too: 4 roundings of
/// the larger coordinate out, and of that of an origin.
fn outward(min: DVec3, max: DVec3, origins: DVec3) -> Aabb {
    let pad = (min.abs().max(max.abs()) + origins) * f64::from(2.0 * f32::EPSILON);
    let (min, max) = ((min - pad).as_vec3(), (max + pad).as_vec3());
    let down = Vec3::new(min.x.next_down(), min.y.next_down(), min.z.next_down());
    let up = Vec3::new(max.x.next_up(), max.y.next_up(), max.z.next_up());
    Aabb::new(Vec3A::from(down), Vec3A::from(up))
}

/// Sources: Meister and Bittner, "Parallel locally-ordered clustering for bounding volume hierarchy
/// construction", IEEE TVCG 24(3), 2018, and "Parallel reinsertion for bounding volume hierarchy
/// optimization", Computer Graphics Forum 37(2), 2018.
fn build_binary(items: &[Item]) -> Bvh2 {
    let indices = (0..items.len() as u32).collect();
    let mut builder = PlocBuilder::with_capacity(items.len());
    let mut binary = builder.build(PlocSearchDistance::Medium, items, indices, SortPrecision::U64, 3);
    ReinsertionOptimizer::default().run(&mut binary, 0.05, None);
    binary
}

/// A part among those of its kind.
type Place = (Kind, u32);

/// From the binary tree to the wide one.
struct Widen<'a> {
    binary: &'a Bvh2,
    items: &'a [Item],
    /// By binary node: items below it, or 0 where they are of several kinds or too many for a leaf.
    leaf: Vec<u32>,
    nodes: Vec<Node>,
    /// By kind: parts in the order of their rows.
    order: Vec<Vec<Place>>,
    groups: Groups,
    /// Levels of nodes.
    depth: usize,
}

impl<'a> Widen<'a> {
    fn new(binary: &'a Bvh2, items: &'a [Item]) -> Self {
        let leaf = choose_leaves(binary, items);
        Widen {
            binary,
            items,
            leaf,
            nodes: Vec::new(),
            order: vec![Vec::new(); Kind::ALL.len()],
            groups: Groups::default(),
            depth: 0,
        }
    }

    /// Fills the nodes level by level from the root.
    fn build(&mut self) {
        self.nodes.push(Node::empty());
        let mut waiting: Vec<(usize, u32, usize)> = vec![(0, 0, 1)];
        while let Some((wide, binary, depth)) = waiting.pop() {
            self.depth = self.depth.max(depth);
            let (open, count) = self.eight_below(binary);
            for (slot, child) in open.into_iter().take(count).enumerate() {
                let aabb = *self.binary.nodes[child as usize].aabb();
                let content = if self.leaf[child as usize] > 0 {
                    self.add_leaf(child)
                } else {
                    self.nodes.push(Node::empty());
                    waiting.push((self.nodes.len() - 1, child, depth + 1));
                    Child::node(self.nodes.len() - 1)
                };
                self.nodes[wide].set(slot, aabb.min.into(), aabb.max.into(), content);
            }
        }
    }

    /// Opens the largest node again and again until there are eight children, or as many as there can be.
    fn eight_below(&self, root: u32) -> ([u32; LANES], usize) {
        let area = |child: u32| match self.leaf[child as usize] {
            0 => self.binary.nodes[child as usize].aabb().half_area(),
            _ => f32::NEG_INFINITY,
        };
        let (mut open, mut areas, mut count) = ([root; LANES], [area(root); LANES], 1);
        while count < LANES {
            let largest = (0..count).max_by(|a, b| areas[*a].total_cmp(&areas[*b])).unwrap_or(0);
            if self.leaf[open[largest] as usize] != 0 {
                break;
            }
            let first = self.binary.nodes[open[largest] as usize].first_index;
            (open[largest], open[count]) = (first, first + 1);
            (areas[largest], areas[count]) = (area(first), area(first + 1));
            count += 1;
        }
        (open, count)
    }

    /// A leaf takes the kind that holds all its parts.
    fn add_leaf(&mut self, root: u32) -> Child {
        let (mut below, mut places, mut kind) = (vec![root], Vec::with_capacity(LANES), None);
        while let Some(index) = below.pop() {
            let node = &self.binary.nodes[index as usize];
            if node.prim_count == 0 {
                below.extend([node.first_index, node.first_index + 1]);
                continue;
            }
            let range = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            for item in &self.binary.primitive_indices[range] {
                let Item { kind: own, index, .. } = self.items[*item as usize];
                kind = kind.map_or(Some(own), |kind: Kind| kind.holding(own));
                places.push((own, index));
            }
        }
        let (kind, count) = (kind.expect("leaves hold parts that go together"), places.len());
        self.order[kind as usize].extend(places);
        let groups = &mut self.groups[kind as usize];
        groups.push(count as u8);
        Child::leaf(Leaf { kind, block: groups.len() - 1, count })
    }
}

/// By binary node: how many rows a leaf there would have, or 0 where there is to be no leaf.
fn choose_leaves(binary: &Bvh2, items: &[Item]) -> Vec<u32> {
    let mut preorder = vec![0u32];
    let mut next = 0;
    while next < preorder.len() {
        let node = &binary.nodes[preorder[next] as usize];
        if node.prim_count == 0 {
            preorder.extend([node.first_index, node.first_index + 1]);
        }
        next += 1;
    }
    let mut below = vec![Below::default(); binary.nodes.len()];
    let mut leaf = vec![0; binary.nodes.len()];
    for index in preorder.into_iter().rev().map(|index| index as usize) {
        let node = &binary.nodes[index];
        let area = node.aabb().half_area();
        if node.prim_count > 0 {
            let kind = Some(items[binary.primitive_indices[node.first_index as usize] as usize].kind);
            below[index] = Below { count: node.prim_count, kind, cost: area * leaf_cost(kind, node.prim_count) };
            leaf[index] = node.prim_count;
            continue;
        }
        let children = node.first_index as usize;
        let (a, b) = (below[children], below[children + 1]);
        let split = a.cost + b.cost + area;
        let kind = a.kind.zip(b.kind).and_then(|(a, b)| a.holding(b));
        let count = a.count.saturating_add(b.count);
        let whole = area * leaf_cost(kind, count);
        let fits = kind.is_some() && count <= MOST_ROWS && whole <= split;
        let kind = kind.filter(|_| fits);
        below[index] = Below { count, kind, cost: if fits { whole } else { split } };
        leaf[index] = if fits { count } else { 0 };
    }
    leaf
}

fn leaf_cost(kind: Option<Kind>, rows: u32) -> f32 {
    let row = if kind == Some(Kind::Sphere) { SPHERE_COST } else { ROW_COST };
    1.0 + row * rows as f32
}

/// What lies below a binary node.
#[derive(Debug, Clone, Copy, Default)]
struct Below {
    count: u32,
    /// The one kind of it, where it may be a leaf.
    kind: Option<Kind>,
    cost: f32,
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
