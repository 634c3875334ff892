//! Rays down the tree, each for itself: a lane is a child, in leaves a primitive.
//!
//! Rays of one octant go down as a list, so that a node is fetched once for all of them, and no ray waits for the
//! answer of another: which boxes each of them meets is written down first, and the lists of the children follow
//! from that without a branch.
//!
//! Source: Barringer and Akenine-Möller, "Dynamic ray stream traversal", ACM Transactions on Graphics 33(4), 2014.

use super::leaf::{LineLeaf, end};
use super::line::Line;
use super::node::{Child, Content, Node, near_planes};
use super::stack::{Entry, Stack};
use super::tile::Tile;
use super::{Counts, Tree};
use crate::lanes::{ExactPacket, Float8, LANES, Mask8, Ray, bits, float8};
use crate::shapes::{Ray64, RowRef};

/// Rays that are to go down on their own, and room for it.
#[derive(Debug, Default)]
pub struct Stream {
    /// Eight a packet.
    lines: Vec<Line>,
    octants: Vec<u8>,
    exact: Exact,
    /// By octant: rays that wait.
    waiting: [Vec<u16>; 8],
    room: Room,
}

/// Rays before they were rounded, where those decide what f32 leaves open.
#[derive(Debug, Default)]
pub struct Exact {
    packets: Vec<ExactPacket>,
    /// By packet of the stream, its place among those; [`u32::MAX`] for rays that are what their bits are.
    places: Vec<u32>,
}

impl Exact {
    fn clear(&mut self) {
        self.packets.clear();
        self.places.clear();
    }

    #[inline(always)]
    fn add(&mut self, packet: Option<&ExactPacket>) {
        self.places.push(packet.map_or(u32::MAX, |_| self.packets.len() as u32));
        self.packets.extend(packet);
    }

    /// The ray that decides for the ray of a stream with these bits.
    pub fn ray(&self, number: u16, bits: &Ray) -> Ray64 {
        let (packet, lane) = (usize::from(number) / LANES, usize::from(number) % LANES);
        let ray = Ray64::exact(bits);
        match self.packets.get(self.places[packet] as usize) {
            Some(packet) => ray.from(packet, lane),
            None => ray,
        }
    }
}

/// Lists of the nodes on the way, one behind the other, and what waits.
#[derive(Debug, Default)]
struct Room {
    rays: Vec<u16>,
    /// By ray of a list: the slots that it meets, a bit each.
    slots: Vec<u8>,
    todo: Vec<Entry<Todo>>,
}

/// A child that some rays of a list meet.
#[derive(Debug, Default, Clone, Copy)]
struct Todo {
    child: Child,
    slot: u32,
    first: u32,
    count: u32,
}

impl Stream {
    /// Most packets at a time.
    pub const MOST: usize = 4096 / LANES;

    /// Holds no rays.
    pub fn clear(&mut self) {
        self.lines.clear();
        self.octants.clear();
        self.exact.clear();
    }

    /// How many packets there are.
    pub fn packets(&self) -> usize {
        self.lines.len() / LANES
    }

    /// Takes a packet of a tile, and tells its number.
    #[inline(always)]
    pub fn add(&mut self, tile: &Tile, p: usize) -> usize {
        let (lines, octants) = Line::of_packet(&tile.packets[p], [tile.hits[p], tile.places[p], tile.lows[p]]);
        self.lines.extend(lines);
        self.octants.extend(octants);
        self.exact.add(tile.exact.as_ref().map(|exact| &exact[p]));
        self.packets() - 1
    }

    /// Some rays of a packet are to go down next.
    #[inline(always)]
    pub fn wait(&mut self, packet: usize, lanes: u32) {
        for lane in bits(lanes) {
            let ray = packet * LANES + lane;
            self.waiting[usize::from(self.octants[ray] % 8)].push(ray as u16);
        }
    }

    /// Takes over what some rays of a packet of a tile have met since. Those that any hit ends are not asked again.
    #[inline(always)]
    pub fn refresh<const ANY: bool>(&mut self, packet: usize, lanes: u32, tile: &Tile, p: usize) {
        if !ANY {
            let lines = &mut self.lines[packet * LANES..][..LANES];
            bits(lanes).for_each(|lane| lines[lane].set(&tile.best(p, lane)));
        }
    }

    /// Hands back what some rays of a packet have met; with `ANY` those that met something are dead.
    #[inline(always)]
    pub fn hand_back<const ANY: bool>(&self, packet: usize, lanes: u32, tile: &mut Tile, p: usize) {
        let lines = &self.lines[packet * LANES..][..LANES];
        if ANY {
            let met = bits(lanes).filter(|lane| lines[*lane].best().row != RowRef::MISS);
            end(&mut tile.packets[p], Mask8::from_bits(met.map(|lane| 1 << lane).sum()));
        } else {
            bits(lanes).for_each(|lane| tile.set_best(p, lane, &lines[lane].best()));
        }
    }
}

impl Tree {
    /// Takes the rays that wait down from some child on.
    pub(super) fn descend_rays<const ANY: bool, const CULL: bool>(
        &self,
        from: Child,
        stream: &mut Stream,
        counts: &mut Counts,
    ) {
        let Stream { lines, waiting, room, exact, .. } = stream;
        for (octant, list) in waiting.iter_mut().enumerate().filter(|(_, list)| !list.is_empty()) {
            room.fit(self.room, list.len());
            if self.one_by_one {
                for ray in list.iter() {
                    room.rays[0] = *ray;
                    self.descend_octant::<ANY, CULL>(from, (octant, 1), (lines, exact), room, counts);
                }
            } else {
                room.rays[..list.len()].copy_from_slice(list);
                self.descend_octant::<ANY, CULL>(from, (octant, list.len()), (lines, exact), room, counts);
            }
            list.clear();
        }
    }

    /// Asks for a child to be brought near before it is looked at.
    #[inline(always)]
    pub(super) fn fetch(&self, child: Child) {
        match child.content() {
            Content::Node(index) => self.nodes[index].fetch(),
            Content::Leaf(leaf) => self.stores.fetch(leaf.kind, leaf.block),
        }
    }

    /// Takes the first `count` rays of the room down.
    fn descend_octant<const ANY: bool, const CULL: bool>(
        &self,
        from: Child,
        (octant, count): (usize, usize),
        (lines, exact): (&mut [Line], &Exact),
        room: &mut Room,
        counts: &mut Counts,
    ) {
        let octant = Octant::new(octant);
        let Room { rays, slots, todo } = room;
        let mut todo = Stack::new(todo);
        let mut next = Some(Todo { child: from, slot: 0, first: 0, count: count as u32 });
        while let Some(Todo { child, first, count, .. }) = next {
            let range = first as usize..(first + count) as usize;
            let nearest = match child.content() {
                Content::Leaf(leaf) => {
                    let (stores, rays) = (&self.stores, &rays[range]);
                    stores.visit(leaf.kind, LineLeaf::<ANY, CULL> { stores, leaf, rays, lines, exact, counts });
                    None
                }
                Content::Node(index) => {
                    let node = &self.nodes[index];
                    counts.boxes += u64::from(count) * LANES as u64;
                    let (order, met) = octant.meets(node, &rays[range.clone()], &mut slots[range], lines);
                    let child = |slot| {
                        let child = node.child(slot);
                        self.fetch(child);
                        Todo { child, slot: slot as u32, first, count }
                    };
                    todo.nearest_first::<ANY>(&order, met, child)
                }
            };
            next = nearest.or_else(|| {
                todo.pop_if(|entry, todo| {
                    todo.count > 1 || entry <= lines[usize::from(rays[todo.first as usize])].reach()
                })
            });
            if let Some(todo) = next.as_mut().filter(|todo| todo.count > 1) {
                todo.pick(rays, slots);
            }
        }
    }
}

impl Todo {
    /// Moves on from the list of a node to the rays of it that meet the child.
    #[inline(always)]
    fn pick(&mut self, rays: &mut [u16], slots: &[u8]) {
        let range = self.first as usize..(self.first + self.count) as usize;
        let (list, picked) = rays.split_at_mut(range.end);
        let mut count = 0;
        for (ray, slots) in list[range.start..].iter().zip(&slots[range.clone()]) {
            picked[count] = *ray;
            count += usize::from(slots >> (self.slot & 7) & 1);
        }
        (self.first, self.count) = (range.end as u32, count as u32);
    }
}

impl Room {
    /// Room for so many rays, and what waits above them.
    fn fit(&mut self, room: usize, rays: usize) {
        let lists = (room / LANES + 2) * rays + 1;
        if self.rays.len() < lists {
            self.rays.resize(lists, 0);
            self.slots.resize(lists, 0);
        }
        if self.todo.len() < room {
            self.todo.resize(room, Entry::default());
        }
    }
}

/// Rays that go up and down on the same axes.
struct Octant {
    near: [usize; 3],
    signs: [Float8; 3],
}

impl Octant {
    fn new(octant: usize) -> Self {
        let back = [0, 1, 2].map(|k| octant >> k & 1 == 1);
        Octant { near: near_planes(back), signs: back.map(|back| float8(if back { -1.0 } else { 1.0 })) }
    }

    /// Which slots of a node each ray of a list meets, which any of them, and in what order they had better be
    /// looked at: for one ray where it enters them.
    #[inline(always)]
    fn meets(&self, node: &Node, rays: &[u16], slots: &mut [u8], lines: &[Line]) -> (Float8, u32) {
        // Spelled out: `map` of an array is a call.
        let [x, y, z] = self.near;
        let planes = [node.planes(x), node.planes(y), node.planes(z)];
        if let [ray] = rays {
            let (entry, met) = lines[usize::from(*ray)].meets(&planes);
            return (entry, met.bits());
        }
        let mut any = Mask8::NONE;
        for (ray, slots) in rays.iter().zip(slots) {
            let (_, met) = lines[usize::from(*ray)].meets(&planes);
            *slots = met.bits() as u8;
            any |= met;
        }
        let [x, y, z] = self.signs;
        (planes[0].0 * x + planes[1].0 * y + planes[2].0 * z, any.bits())
    }
}
