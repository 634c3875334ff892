//! All parts of one kind: a structure of arrays in blocks of eight rows, so that a leaf of the tree lies in
//! neighbouring cache lines.

use prefetch_index::prefetch_index;
use rayon::prelude::*;

use super::Part;
use crate::lanes::{Columns, LANES, Mask8};
use crate::plan::Owner;
use crate::scene::Visible;

/// All parts of one kind. Row `i` is lane `i % 8` of block `i / 8`; each group of parts, a leaf of the tree, has a
/// block of its own. Rows past its last part repeat that: they meet what it meets, and nobody asks for them.
#[derive(Debug)]
pub struct Store<P: Part> {
    blocks: Vec<Block<P::Rows>>,
    groups: Vec<Group>,
    sides: Sides,
    parts: Vec<P>,
    /// By row: whose it is; of padding, whose the last part of the group is.
    owners: Vec<Owner>,
}

/// Eight rows, from the start of a cache line.
#[derive(Debug)]
#[repr(align(64))]
struct Block<R>(R);

/// What a block holds: some parts in a row.
#[derive(Debug, Clone, Copy)]
struct Group {
    first: u32,
    count: u32,
}

impl<P: Part> Store<P> {
    /// Stores the parts in this order, in groups of these sizes, 1 to 8.
    pub fn new(parts: Vec<P>, sizes: impl IntoIterator<Item = usize>, visible: &[Visible]) -> Self {
        let mut first = 0;
        let group = |count| {
            first += count;
            Group { first: (first - count) as u32, count: count as u32 }
        };
        let groups: Vec<Group> = sizes.into_iter().map(group).collect();
        let parts_of = |group: &Group| &parts[group.first as usize..][..group.count as usize];
        let row = |group: &[P], lane: usize| group.get(lane).or(group.last()).map(P::row);
        let pack = |group: &[P]| Block(P::Rows::pack(std::array::from_fn(|lane| row(group, lane))));
        let blocks = groups.par_iter().map(|group| pack(parts_of(group))).collect();
        let mut sides = Sides::default();
        if visible.iter().any(|side| *side != Visible::Both) {
            let shown = |row| visible[parts[part_of(&groups, row)].owner().material as usize];
            sides = Sides::new((0..groups.len() * LANES).map(shown).collect());
        }
        let owners =
            (0..groups.len() * LANES).into_par_iter().map(|row| parts[part_of(&groups, row)].owner()).collect();
        Store { blocks, groups, sides, parts, owners }
    }

    /// A block that no ray can hit, in a store that has none.
    pub fn pad(&mut self) {
        self.blocks.push(Block(P::Rows::pack([const { None }; LANES])));
        self.groups.push(Group { first: 0, count: 0 });
    }

    /// The parts, group by group.
    pub fn parts(&self) -> &[P] {
        &self.parts
    }

    /// How many blocks there are.
    pub fn blocks(&self) -> usize {
        self.blocks.len()
    }

    /// The part of a row.
    #[inline(always)]
    pub fn part(&self, row: usize) -> Option<&P> {
        let (group, lane) = (self.groups.get(row / LANES)?, (row % LANES) as u32);
        if lane < group.count { self.parts.get((group.first + lane) as usize) } else { None }
    }

    /// Whose part a row is.
    #[inline(always)]
    pub fn owner(&self, row: usize) -> Owner {
        self.owners[row]
    }

    /// The rows of a block, a lane each.
    #[inline(always)]
    pub fn block(&self, block: usize) -> &P::Rows {
        &self.blocks[block].0
    }

    /// Asks for the first rows of a block to be brought near.
    #[inline(always)]
    pub fn fetch(&self, block: usize) {
        prefetch_index(&self.blocks, block);
    }

    /// A row in all lanes.
    #[inline(always)]
    pub fn splat(&self, row: usize) -> P::Rows {
        self.block(row / LANES).broadcast(row % LANES)
    }

    /// Lane `k` is the face of row `rows[k]`.
    #[inline(always)]
    pub fn faces(&self, rows: &[u32; LANES]) -> P::Face {
        let mut faces = [P::face(self.block(0)); LANES];
        for (face, row) in faces.iter_mut().zip(rows) {
            *face = P::face(self.block(*row as usize / LANES));
        }
        P::Face::gather(|i| (faces[i], rows[i] as usize % LANES))
    }

    /// Which sides of the rows are seen.
    pub fn sides(&self) -> &Sides {
        &self.sides
    }

    /// Memory of the columns in bytes.
    pub fn column_bytes(&self) -> usize {
        self.blocks.capacity() * size_of::<Block<P::Rows>>()
            + self.groups.capacity() * size_of::<Group>()
            + self.owners.capacity() * size_of::<Owner>()
    }
}

/// The part of a row, or the last one of its group where there is none.
#[inline(always)]
fn part_of(groups: &[Group], row: usize) -> usize {
    let Group { first, count } = groups[row / LANES];
    (first + (row % LANES) as u32).min(first + count - 1) as usize
}

/// Which sides of each row are seen; nothing is stored where all rows show both.
#[derive(Debug, Clone, Default)]
pub struct Sides(Option<Vec<Visible>>);

/// Hidden sides of eight rows.
#[derive(Debug, Clone, Copy)]
pub struct Hidden8 {
    /// Lanes whose front is not met.
    pub front: Mask8,
    /// Lanes whose back is not met.
    pub back: Mask8,
}

impl Sides {
    fn new(rows: Vec<Visible>) -> Self {
        Sides(rows.iter().any(|side| *side != Visible::Both).then_some(rows))
    }

    /// Whether any row hides a side.
    pub fn hide_any(&self) -> bool {
        self.0.is_some()
    }

    /// What row `i` shows.
    pub fn row(&self, i: usize) -> Visible {
        self.0.as_ref().map_or(Visible::Both, |rows| rows[i])
    }

    /// Lane `k` is row `row(k)`.
    #[inline(always)]
    pub fn lanes(&self, row: impl Fn(usize) -> usize) -> Hidden8 {
        let Some(rows) = &self.0 else { return Hidden8::NONE };
        let bits = |side| (0..LANES).map(|lane| u32::from(rows[row(lane)] == side) << lane).sum();
        Hidden8 { front: Mask8::from_bits(bits(Visible::Back)), back: Mask8::from_bits(bits(Visible::Front)) }
    }
}

impl Hidden8 {
    /// All sides are seen.
    pub const NONE: Hidden8 = Hidden8 { front: Mask8::NONE, back: Mask8::NONE };
}
