//! Bonds: each is two halves, one from each atom to the middle, so that each has the colour of its atom and a bond
//! through a periodic boundary sticks out of both sides.

use glam::{DMat3, DVec3};

use super::frame::{Cell, Frame};

/// Most bins of the grid for an atom.
const BINS_PER_ATOM: usize = 4;

/// Halves of bonds.
#[derive(Debug, Default)]
pub struct Halves {
    /// Base (the atom), apex (the middle of the bond) and radius.
    pub rows: Vec<[f64; 7]>,
    /// The atom that each belongs to.
    pub atoms: Vec<u32>,
}

/// Which pairs of atoms are bonded, by their distance.
#[derive(Debug)]
pub struct Reach {
    /// By kind: the share of the distance that an atom may add; negative: such atoms have no bonds.
    pub shares: Vec<f64>,
    /// Nearer atoms are the same one twice.
    pub least: f64,
}

impl Reach {
    /// Whether atoms of two kinds so far apart are bonded.
    pub fn holds(&self, a: u16, b: u16, square: f64) -> bool {
        let (a, b) = (self.shares[usize::from(a)], self.shares[usize::from(b)]);
        a >= 0.0 && b >= 0.0 && square <= (a + b) * (a + b) && square > self.least * self.least
    }
}

impl Halves {
    fn add(&mut self, atom: u32, place: DVec3, half: DVec3, radius: f64) {
        let middle = place + half;
        if middle != place {
            self.rows.push([place.x, place.y, place.z, middle.x, middle.y, middle.z, radius]);
            self.atoms.push(atom);
        }
    }

    /// Adds the bonds that the file gives, but for those that `known` would add by distance.
    pub fn add_given(&mut self, frame: &Frame, radius: f64, known: Option<&Reach>) {
        let mut pairs = frame.bonds.clone();
        pairs.sort_unstable();
        pairs.dedup();
        for [a, b] in pairs {
            let [from, to] = [a, b].map(|atom| place(frame, atom as usize));
            let between = frame.cell.map_or(to - from, |cell| cell.nearest(to - from));
            let kinds = [a, b].map(|atom| frame.kind[atom as usize]);
            if known.is_none_or(|reach| !reach.holds(kinds[0], kinds[1], between.length_squared())) {
                self.add(a, from, 0.5 * between, radius);
                self.add(b, to, -0.5 * between, radius);
            }
        }
    }

    /// Adds a bond between each two atoms that are near enough, periodic images included.
    pub fn add_near(&mut self, frame: &Frame, radius: f64, reach: &Reach) {
        let longest = 2.0 * reach.shares.iter().copied().fold(0.0, f64::max);
        if longest <= 0.0 || frame.atoms.is_empty() {
            return;
        }
        let grid = Grid::new(frame, longest);
        for atom in 0..frame.len() {
            grid.near(atom, |other, between| {
                if reach.holds(frame.kind[atom], frame.kind[other], between.length_squared()) {
                    self.add(atom as u32, place(frame, atom), 0.5 * between, radius);
                }
            });
        }
    }
}

fn place(frame: &Frame, atom: usize) -> DVec3 {
    let [x, y, z, _] = frame.atoms[atom];
    DVec3::new(x, y, z)
}

/// Atoms in bins along the edges of their cell, or of the axes where there is none. A bin is at least as wide as
/// the distance that is asked for, unless the cell itself is thinner.
struct Grid {
    edges: DMat3,
    periodic: [bool; 3],
    bins: [usize; 3],
    /// Bins to look at on both sides.
    span: [i64; 3],
    /// First atom of each bin in `order`.
    starts: Vec<u32>,
    order: Vec<u32>,
    /// Bin of each atom.
    bin: Vec<[u32; 3]>,
    /// Where each atom is once it has been moved into the cell.
    inside: Vec<DVec3>,
}

impl Grid {
    fn new(frame: &Frame, longest: f64) -> Self {
        let cell = frame.cell.unwrap_or(Cell { origin: DVec3::ZERO, edges: DMat3::IDENTITY, periodic: [false; 3] });
        let inverse = cell.edges.inverse();
        let mut parts: Vec<DVec3> = (0..frame.len()).map(|atom| inverse * (place(frame, atom) - cell.origin)).collect();
        for part in &mut parts {
            let whole = part.floor();
            *part -= DVec3::from_array([0, 1, 2].map(|axis| if cell.periodic[axis] { whole[axis] } else { 0.0 }));
        }
        let low = parts.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = parts.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let (mut bins, mut span) = ([1; 3], [0; 3]);
        let (mut from, mut width) = (DVec3::ZERO, DVec3::ONE);
        // Planes of constant part along an edge are so far apart.
        let heights = DVec3::from_array([0, 1, 2].map(|axis| 1.0 / inverse.row(axis).length()));
        let most = ((BINS_PER_ATOM * frame.len()) as f64).cbrt().ceil() + 1.0;
        for axis in 0..3 {
            let (start, size) = if cell.periodic[axis] { (0.0, 1.0) } else { (low[axis], high[axis] - low[axis]) };
            let count = (size * heights[axis] / longest).floor().clamp(1.0, most);
            bins[axis] = count as usize;
            (from[axis], width[axis]) = (start, if size > 0.0 { size / count } else { 1.0 });
            span[axis] = match cell.periodic[axis] {
                true => (longest / (width[axis] * heights[axis])).ceil() as i64,
                false => 1,
            };
        }
        let bin_of = |part: &DVec3| {
            let place = (*part - from) / width;
            [0, 1, 2].map(|axis| (place[axis] as usize).min(bins[axis] - 1) as u32)
        };
        let bin: Vec<[u32; 3]> = parts.iter().map(bin_of).collect();
        let inside = parts.iter().map(|part| cell.edges * *part).collect();
        let mut grid = Grid {
            edges: cell.edges,
            periodic: cell.periodic,
            bins,
            span,
            starts: vec![0; bins.iter().product::<usize>() + 1],
            order: vec![0; frame.len()],
            bin,
            inside,
        };
        grid.sort();
        grid
    }

    fn index(&self, bin: [u32; 3]) -> usize {
        (bin[2] as usize * self.bins[1] + bin[1] as usize) * self.bins[0] + bin[0] as usize
    }

    /// Counting sort of the atoms by their bins.
    fn sort(&mut self) {
        for atom in 0..self.bin.len() {
            let index = self.index(self.bin[atom]);
            self.starts[index + 1] += 1;
        }
        for index in 1..self.starts.len() {
            self.starts[index] += self.starts[index - 1];
        }
        let mut next = self.starts.clone();
        for atom in 0..self.bin.len() {
            let slot = &mut next[self.index(self.bin[atom])];
            self.order[*slot as usize] = atom as u32;
            *slot += 1;
        }
    }

    /// Bin `offset` away along an axis, with the number of cells gone through; `None` outside.
    fn step(&self, axis: usize, bin: u32, offset: i64) -> Option<(u32, f64)> {
        let (count, raw) = (self.bins[axis] as i64, i64::from(bin) + offset);
        match self.periodic[axis] {
            true => Some((raw.rem_euclid(count) as u32, raw.div_euclid(count) as f64)),
            false => (0..count).contains(&raw).then_some((raw as u32, 0.0)),
        }
    }

    /// Calls `found` with each other atom, or image of any atom, in the bins around one, and the vector to it.
    fn near(&self, atom: usize, mut found: impl FnMut(usize, DVec3)) {
        let (bin, here) = (self.bin[atom], self.inside[atom]);
        let steps = |axis: usize| {
            (-self.span[axis]..=self.span[axis]).filter_map(move |offset| self.step(axis, bin[axis], offset))
        };
        for (z, shift_z) in steps(2) {
            for (y, shift_y) in steps(1) {
                for (x, shift_x) in steps(0) {
                    let shift = self.edges * DVec3::new(shift_x, shift_y, shift_z);
                    let index = self.index([x, y, z]);
                    for other in &self.order[self.starts[index] as usize..self.starts[index + 1] as usize] {
                        let between = self.inside[*other as usize] + shift - here;
                        if *other as usize != atom || shift != DVec3::ZERO {
                            found(*other as usize, between);
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::particles::frame::Kind;

    fn frame(cell: Option<Cell>, count: usize, size: f64) -> Frame {
        let mut state = 0x5eed_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as f64 / (1u64 << 31) as f64 * 1.4 - 0.2) * size
        };
        let atoms: Vec<_> = (0..count).map(|_| [random(), random(), random(), 0.0]).collect();
        let kinds = vec![Kind { label: "a".into(), element: None }, Kind { label: "b".into(), element: None }];
        let kind = (0..count).map(|atom| (atom % 2) as u16).collect();
        Frame { atoms, kind, kinds, cell, ..Frame::default() }
    }

    /// All pairs with all images up to three cells away.
    fn all_pairs(frame: &Frame, reach: &Reach) -> usize {
        let cell = frame.cell.unwrap_or(Cell { origin: DVec3::ZERO, edges: DMat3::IDENTITY, periodic: [false; 3] });
        let images = |axis: usize| if cell.periodic[axis] { -4..=4 } else { 0..=0 };
        let mut bonds = 0;
        for a in 0..frame.len() {
            for b in 0..frame.len() {
                for x in images(0) {
                    for y in images(1) {
                        for z in images(2) {
                            let shift = cell.edges * DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                            let square = (place(frame, b) + shift - place(frame, a)).length_squared();
                            bonds += usize::from(reach.holds(frame.kind[a], frame.kind[b], square));
                        }
                    }
                }
            }
        }
        bonds
    }

    #[test]
    fn the_grid_finds_what_all_pairs_find() {
        let reach = Reach { shares: vec![0.8, 0.5], least: 0.1 };
        let edges = |size: f64| {
            DMat3::from_cols(DVec3::X * size, DVec3::new(0.4 * size, size, 0.0), DVec3::new(-0.2, 0.3, 0.8) * size)
        };
        let cell = |size, periodic| Cell::new(DVec3::new(0.3, -1.0, 2.0), edges(size), periodic);
        let cases = [
            (None, 150, 9.0),
            (cell(9.0, [true; 3]), 150, 9.0),
            (cell(9.0, [true, false, true]), 150, 9.0),
            (cell(1.4, [true; 3]), 5, 1.4),
        ];
        for (cell, count, size) in cases {
            let frame = frame(cell, count, size);
            let mut halves = Halves::default();
            halves.add_near(&frame, 0.1, &reach);
            assert_eq!(halves.rows.len(), all_pairs(&frame, &reach), "{cell:?}");
            assert!(halves.rows.len() > 20);
        }
    }

    #[test]
    fn a_bond_through_a_boundary_is_two_stumps() {
        let cell = Cell::new(DVec3::ZERO, DMat3::IDENTITY * 10.0, [true; 3]);
        let mut frame = Frame { atoms: vec![[0.5, 5.0, 5.0, 0.0], [9.5, 5.0, 5.0, 0.0]], cell, ..Frame::default() };
        (frame.kind, frame.bonds) = (vec![0, 0], vec![[0, 1], [0, 1]]);
        let mut halves = Halves::default();
        halves.add_given(&frame, 0.1, None);
        assert_eq!(halves.rows, [[0.5, 5.0, 5.0, 0.0, 5.0, 5.0, 0.1], [9.5, 5.0, 5.0, 10.0, 5.0, 5.0, 0.1]]);
    }
}
