//! All parts of one kind: a structure of arrays in blocks of eight rows, so that a leaf of the tree lies in
//! neighbouring cache lines.

use super::Part;
use crate::lanes::{Columns, LANES, Mask8};
use crate::plan::Owner;
use crate::scene::Visible;

/// All parts of one kind. Row `i` is lane `i % 8` of block `i / 8`; each group of parts, a leaf of the tree, has a
/// block of its own, and rows past its last part cannot be hit.
#[derive(Debug)]
pub struct Store<P: Part> {
    blocks: Vec<Block<P::Rows>>,
    groups: Vec<Group>,
    sides: Sides,
    parts: Vec<P>,
}

/// Eight rows, from the start of a cache line.
#[derive(Debug)]
#[repr(align(64))]
struct Block<R>(R);

/// What a block holds: some parts in a row, and whose they are.
#[derive(Debug)]
struct Group {
    first: u32,
    count: u32,
    owners: [Owner; LANES],
}

impl<P: Part> Store<P> {
    /// Stores the parts in this order, in groups of these sizes, 1 to 8.
    pub fn new(parts: Vec<P>, sizes: impl IntoIterator<Item = usize>, visible: &[Visible]) -> Self {
        let (mut blocks, mut groups, mut shown, mut first) = (Vec::new(), Vec::new(), Vec::new(), 0);
        for count in sizes {
            let group = &parts[first..first + count];
            let owners = std::array::from_fn(|lane| group[lane.min(count - 1)].owner());
            blocks.push(Block(P::Rows::pack(std::array::from_fn(|lane| group.get(lane).map(P::row)))));
            groups.push(Group { first: first as u32, count: count as u32, owners });
            shown.extend(owners.map(|owner| visible[owner.material as usize]));
            first += count;
        }
        Store { blocks, groups, sides: Sides::new(shown), parts }
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
        self.groups[row / LANES].owners[row % LANES]
    }

    /// The rows of a block, a lane each.
    #[inline(always)]
    pub fn block(&self, block: usize) -> &P::Rows {
        &self.blocks[block].0
    }

    /// A row in all lanes.
    #[inline(always)]
    pub fn splat(&self, row: usize) -> P::Rows {
        self.block(row / LANES).broadcast(row % LANES)
    }

    /// Lane `k` is row `rows[k]`.
    #[inline(always)]
    pub fn gather(&self, rows: [usize; LANES]) -> P::Rows {
        P::Rows::gather(rows.map(|row| (self.block(row / LANES), row % LANES)))
    }

    /// Which sides of the rows are seen.
    pub fn sides(&self) -> &Sides {
        &self.sides
    }

    /// Memory of the columns in bytes.
    pub fn column_bytes(&self) -> usize {
        self.blocks.capacity() * size_of::<Block<P::Rows>>() + self.groups.capacity() * size_of::<Group>()
    }
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
