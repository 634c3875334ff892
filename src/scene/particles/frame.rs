//! One frame of a trajectory: what its atoms are and where.

use std::collections::HashMap;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::element::Element;
use super::lines::{Lines, Reading, Words, number};
use crate::scene::error::{SceneError, Warning};

/// Most kinds of atoms in a frame.
const MOST_KINDS: usize = u16::MAX as usize;
/// What is wrong with a frame of more.
pub const TOO_MANY_KINDS: &str = "a frame must have less than 65536 kinds of atoms";
/// Atoms that room is made for before any is read: what a file promises may be nonsense.
const TRUSTED: u64 = 1 << 22;

/// The atoms of one moment.
#[derive(Debug, Default)]
pub struct Frame {
    /// x, y, z and radius; radius 0: that of its kind.
    pub atoms: Vec<[f64; 4]>,
    /// Which of [`Frame::kinds`] each atom is.
    pub kind: Vec<u16>,
    /// The kinds of atoms in order of appearance.
    pub kinds: Vec<Kind>,
    /// The column that colours are made of, one number an atom; empty where none was asked for.
    pub values: Vec<f32>,
    /// Colours that the file itself gives, linear Rec. 709, one an atom or none.
    pub colors: Vec<[f32; 3]>,
    /// Identifiers, one an atom or none.
    pub ids: Vec<u64>,
    /// Bonds that the file gives, by the indices of two atoms.
    pub bonds: Vec<[u32; 2]>,
    /// The box that the atoms are in.
    pub cell: Option<Cell>,
    /// What was passed over.
    pub warnings: Vec<Warning>,
}

/// Atoms that look the same unless a column says otherwise.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Kind {
    /// What the file calls it: "C", "OW", the number of a LAMMPS type.
    pub label: String,
    /// The element, where it is known.
    pub element: Option<Element>,
}

/// A parallelepiped, periodic along some of its edges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// The corner where the edges start.
    pub origin: DVec3,
    /// The edges, one a column.
    pub edges: DMat3,
    /// Along which edges it repeats.
    pub periodic: [bool; 3],
}

/// Columns that are read beside positions and kinds.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub struct Columns {
    /// Radius of each atom.
    pub radius: Option<String>,
    /// Value that colours are made of.
    pub value: Option<String>,
}

impl Cell {
    /// A cell, unless its volume is 0 or not finite.
    pub fn new(origin: DVec3, edges: DMat3, periodic: [bool; 3]) -> Option<Cell> {
        let volume = edges.determinant().abs();
        (volume > 0.0 && volume.is_finite() && origin.is_finite()).then_some(Cell { origin, edges, periodic })
    }

    /// A cell by the lengths of its edges and the angles between them in degrees: the first edge along x, the
    /// second in the xy plane.
    ///
    /// Source: International Tables for Crystallography, volume B (2001), section 1.1.
    pub fn of_angles(lengths: [f64; 3], angles: [f64; 3]) -> Option<Cell> {
        let cos = angles.map(|angle| if angle == 90.0 { 0.0 } else { angle.to_radians().cos() });
        let sin = (1.0 - cos[2] * cos[2]).sqrt();
        let (x, y) = (cos[1], (cos[0] - cos[1] * cos[2]) / sin);
        let a = DVec3::X * lengths[0];
        let b = DVec3::new(cos[2], sin, 0.0) * lengths[1];
        let c = DVec3::new(x, y, (1.0 - x * x - y * y).sqrt()) * lengths[2];
        Cell::new(DVec3::ZERO, DMat3::from_cols(a, b, c), [true; 3])
    }

    /// The vector between two atoms, taken to the nearest periodic image.
    pub fn nearest(&self, between: DVec3) -> DVec3 {
        let whole = (self.edges.inverse() * between).round();
        let cells = DVec3::from_array([0, 1, 2].map(|axis| if self.periodic[axis] { whole[axis] } else { 0.0 }));
        between - self.edges * cells
    }
}

impl Frame {
    /// An empty frame with room for what a file promises.
    pub fn with_room(atoms: u64) -> Frame {
        let room = atoms.min(TRUSTED) as usize;
        Frame { atoms: Vec::with_capacity(room), kind: Vec::with_capacity(room), ..Frame::default() }
    }

    /// How many atoms.
    pub fn len(&self) -> usize {
        self.atoms.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.atoms.is_empty()
    }

    /// Appends the atoms of another part of it, whose kinds have these indices here.
    pub fn append(&mut self, mut part: Frame, kinds: &[u16]) {
        self.atoms.append(&mut part.atoms);
        self.kind.extend(part.kind.iter().map(|kind| kinds[usize::from(*kind)]));
        self.values.append(&mut part.values);
        self.colors.append(&mut part.colors);
        self.ids.append(&mut part.ids);
        self.warnings.append(&mut part.warnings);
    }

    /// The index of the atom of an identifier, in a frame whose identifiers ascend.
    pub fn find(&self, id: u64) -> Option<u32> {
        self.ids.binary_search(&id).ok().map(|index| index as u32)
    }

    /// Puts the atoms in the order of their identifiers, so that an atom keeps its index from frame to frame.
    /// One that is given twice stays, with a warning.
    pub fn sort(&mut self, lines: &Lines) {
        if self.ids.is_sorted_by(|a, b| a < b) {
            return;
        }
        let order = ascending(&self.ids);
        let twice = order.windows(2).find(|pair| self.ids[pair[0] as usize] == self.ids[pair[1] as usize]);
        if let Some(second) = twice.map(|pair| pair[1] as usize) {
            let mut warning = lines.warning(format!("id {} is given twice", self.ids[second]));
            // The current line is that of the last atom.
            warning.place.line -= self.ids.len() - 1 - second;
            self.warnings.push(warning);
        }
        self.atoms = in_order(&self.atoms, &order);
        self.kind = in_order(&self.kind, &order);
        self.values = in_order(&self.values, &order);
        self.colors = in_order(&self.colors, &order);
        self.ids = in_order(&self.ids, &order);
    }
}

/// The indices of identifiers in ascending order; of equal ones in the order that they have.
fn ascending(ids: &[u64]) -> Vec<u32> {
    let by_sorting = || {
        let mut order: Vec<u32> = (0..ids.len() as u32).collect();
        order.par_sort_by_key(|index| ids[*index as usize]);
        order
    };
    by_counting(ids).unwrap_or_else(by_sorting)
}

/// [`ascending`] where that is a matter of putting each in its place: they differ, and few are missing between them.
fn by_counting(ids: &[u64]) -> Option<Vec<u32>> {
    let (least, most) = (*ids.iter().min()?, *ids.iter().max()?);
    let places = usize::try_from(most - least).ok().filter(|places| *places < 2 * ids.len())? + 1;
    let mut order = vec![u32::MAX; places];
    for (index, id) in ids.iter().enumerate() {
        let place = &mut order[(id - least) as usize];
        if *place != u32::MAX {
            return None;
        }
        *place = index as u32;
    }
    order.retain(|index| *index != u32::MAX);
    Some(order)
}

/// The entries of a column in another order; a column that is not there stays empty.
fn in_order<T: Copy + Send + Sync>(column: &[T], order: &[u32]) -> Vec<T> {
    if column.is_empty() { Vec::new() } else { order.par_iter().map(|index| column[*index as usize]).collect() }
}

/// Finds kinds by their labels.
#[derive(Debug, Default)]
pub struct Kinds {
    list: Vec<Kind>,
    /// Labels in order of appearance, and which kind each is.
    labels: Vec<(Vec<u8>, u16)>,
    by_label: HashMap<Vec<u8>, u16>,
}

/// Labels that are compared before they are looked up.
const FIRST_LABELS: usize = 4;

impl Kinds {
    /// The index of a label; a new one becomes a kind, of the element that `element` says. All labels of an
    /// element are one kind. `None`: there are too many kinds.
    pub fn find(&mut self, label: &[u8], element: impl FnOnce(&str) -> Option<Element>) -> Option<u16> {
        let mut first = self.labels.iter().take(FIRST_LABELS);
        if let Some((_, kind)) = first.find(|(known, _)| known == label) {
            return Some(*kind);
        }
        match self.by_label.get(label) {
            Some(kind) => Some(*kind),
            None => self.add(label, element),
        }
    }

    /// Takes in those of another part of the frame: the index here of each of them.
    ///
    /// # Errors
    /// The first one for which there are too many.
    pub fn merge(&mut self, part: &Kinds) -> Result<Vec<u16>, u16> {
        // Kinds have labels from the first one on, so that each is found here before a later one.
        let mut here: Vec<u16> = Vec::with_capacity(part.list.len());
        for (label, kind) in &part.labels {
            let index = usize::from(*kind);
            if index == here.len() {
                here.push(self.find(label, |_| part.list[index].element).ok_or(*kind)?);
            }
        }
        Ok(here)
    }

    fn add(&mut self, label: &[u8], element: impl FnOnce(&str) -> Option<Element>) -> Option<u16> {
        let text = String::from_utf8_lossy(label).into_owned();
        let element = element(&text);
        let known = self.list.iter().position(|kind| element.is_some() && kind.element == element);
        let index = known.unwrap_or(self.list.len());
        if index >= MOST_KINDS {
            return None;
        }
        if known.is_none() {
            let label = element.map_or(text, |element| element.symbol().to_owned());
            self.list.push(Kind { label, element });
        }
        self.by_label.insert(label.to_vec(), index as u16);
        self.labels.push((label.to_vec(), index as u16));
        Some(index as u16)
    }

    /// All of them.
    pub fn into_list(self) -> Vec<Kind> {
        self.list
    }
}

/// So many finite numbers from the words of a line; `what` says what they are.
pub fn numbers<const N: usize>(lines: &Lines, words: &mut Words<'_>, what: &str) -> Reading<[f64; N]> {
    let mut values = [0.0; N];
    for value in &mut values {
        let (at, word) = words.next().unwrap_or((lines.line().len(), b""));
        *value = number(word).ok_or_else(|| wrong(lines, at, word, &format!("{what} must be a number")))?;
    }
    Ok(values)
}

/// An error about a word of the current line.
pub fn wrong(lines: &Lines, at: usize, word: &[u8], rule: &str) -> Box<SceneError> {
    lines.slip(super::lines::Slip::new(at, rule.to_owned(), word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_by_angles_have_these_angles() {
        let cell = Cell::of_angles([3.0, 4.0, 5.0], [80.0, 99.34, 120.0]).unwrap();
        let [a, b, c] = [cell.edges.x_axis, cell.edges.y_axis, cell.edges.z_axis];
        let angle = |a: DVec3, b: DVec3| a.angle_between(b).to_degrees();
        for (got, want) in
            [(a.length(), 3.0), (c.length(), 5.0), (angle(b, c), 80.0), (angle(a, c), 99.34), (angle(a, b), 120.0)]
        {
            assert!((got - want).abs() < 1e-12, "{got} {want}");
        }
        assert_eq!(Cell::of_angles([1.0; 3], [0.0; 3]), None);
        assert_eq!(Cell::of_angles([10.0; 3], [90.0; 3]).unwrap().edges, DMat3::IDENTITY * 10.0);
    }

    #[test]
    fn the_nearest_image_is_along_periodic_edges_only() {
        let cell = Cell::new(DVec3::ZERO, DMat3::IDENTITY * 10.0, [true, true, false]).unwrap();
        assert_eq!(cell.nearest(DVec3::new(9.0, -6.0, 9.0)), DVec3::new(-1.0, 4.0, 9.0));
    }

    #[test]
    fn identifiers_are_put_in_order_by_counting_and_by_sorting() {
        for (ids, counted) in [
            (&[5, 3, 4, 7][..], true),
            (&[u64::MAX, 0, 7], false),
            (&[2, 1, 2, 1], false),
            (&[u64::MAX, u64::MAX - 1], true),
        ] {
            let mut want: Vec<u32> = (0..ids.len() as u32).collect();
            want.sort_by_key(|index| ids[*index as usize]);
            assert_eq!(ascending(ids), want, "{ids:?}");
            assert_eq!(by_counting(ids), counted.then_some(want), "{ids:?}");
        }
    }

    #[test]
    fn labels_of_an_element_are_one_kind() {
        let mut kinds = Kinds::default();
        let find: Vec<_> =
            ["C1", "O", "C2", "X", "C1"].map(|label| kinds.find(label.as_bytes(), Element::of_label).unwrap()).into();
        assert_eq!(find, [0, 1, 0, 2, 0]);
        let labels: Vec<_> = kinds.into_list().into_iter().map(|kind| kind.label).collect();
        assert_eq!(labels, ["C", "O", "X"]);
    }

    #[test]
    fn kinds_of_parts_are_those_of_the_whole() {
        let find = |kinds: &mut Kinds, label: &str| kinds.find(label.as_bytes(), Element::of_label).unwrap();
        let (mut all, mut part) = (Kinds::default(), Kinds::default());
        ["C1", "X"].iter().for_each(|label| _ = find(&mut all, label));
        ["O", "C2", "X", "Y"].iter().for_each(|label| _ = find(&mut part, label));
        assert_eq!(all.merge(&part), Ok(vec![2, 0, 1, 3]));
        assert_eq!(find(&mut all, "Y"), 3);
    }
}
