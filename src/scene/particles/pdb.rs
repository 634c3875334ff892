//! PDB: records in fixed columns.
//!
//! Source: wwPDB, "Protein Data Bank contents guide: atomic coordinate entry format description", version 3.30
//! (2012). Used are `ATOM`, `HETATM`, `CRYST1`, `CONECT`; `ENDMDL` and `END` end a frame. Lines may stop behind
//! their coordinates. Serials are five characters, whatever they are, so that files with letters in them read too.

use std::collections::HashMap;
use std::path::Path;

use super::element::Element;
use super::frame::{Cell, Columns, Frame, Kinds, TOO_MANY_KINDS};
use super::lines::{Line, Lines, Part, Reading, Slip, number};
use crate::scene::error::{Place, SceneError, Warning};

/// A file that is being read.
#[derive(Default)]
pub struct Pdb {
    /// The cell of the last `CRYST1`: one record is good for all models.
    cell: Option<Cell>,
    /// Bonds by serials, with their lines; of the whole file, once it has been looked through for them.
    bonds: Option<Vec<([Serial; 2], usize)>>,
}

/// The columns of a serial without blanks.
type Serial = [u8; 5];

/// Names of the residues whose atoms are C, N, O, H, S or P by the first letter, wherever that stands.
const COMMON: &[&str] = &[
    "ALA", "ARG", "ASN", "ASP", "CYS", "GLN", "GLU", "GLY", "HIS", "ILE", "LEU", "LYS", "MET", "PHE", "PRO", "SER",
    "THR", "TRP", "TYR", "VAL", "A", "C", "G", "U", "DA", "DC", "DG", "DT", "HOH", "WAT", "TIP", "SOL",
];

impl Pdb {
    /// Reads the next frame; `None` at the end of the file.
    pub fn read(&mut self, lines: &mut Lines, columns: &Columns, bonds: bool) -> Reading<Option<Frame>> {
        let wanted = Wanted { value: value(lines, columns)?, serials: bonds };
        let (mut model, mut many) = (Model::default(), true);
        loop {
            if std::mem::take(&mut many) {
                let parse = |part: Part<'_>| Model::of(part, wanted);
                lines.parts(u64::MAX, Some(b"END"), parse, |part| model.append(part))?;
            }
            if !lines.advance()? {
                break;
            }
            match record(lines.line()) {
                b"ENDMDL" | b"END" if !model.frame.atoms.is_empty() => break,
                b"ENDMDL" | b"END" => many = true,
                _ => model.read(lines.current(), wanted)?,
            }
        }
        let Model { mut frame, kinds, serials, cell, .. } = model;
        self.cell = cell.unwrap_or(self.cell);
        if frame.atoms.is_empty() {
            return Ok(None);
        }
        frame.cell = self.cell;
        frame.kinds = kinds.into_list();
        if bonds {
            self.join(lines, &mut frame, &serials)?;
        }
        Ok(Some(frame))
    }

    /// Passes over the next frame; `false` at the end of the file.
    pub fn skip(&mut self, lines: &mut Lines) -> Reading<bool> {
        let mut atoms = false;
        while lines.advance()? {
            match record(lines.line()) {
                b"ATOM" | b"HETATM" => atoms = true,
                b"CRYST1" => self.cell = cell(lines.current(), &mut Vec::new()),
                b"ENDMDL" | b"END" if atoms => break,
                _ => {}
            }
        }
        Ok(atoms)
    }

    /// Adds the bonds of the file, which stand behind its last model.
    fn join(&mut self, lines: &Lines, frame: &mut Frame, serials: &[Serial]) -> Reading<()> {
        if self.bonds.is_none() {
            self.bonds = Some(connections(lines)?);
        }
        let index: HashMap<Serial, u32> = serials.iter().zip(0..).map(|(serial, index)| (*serial, index)).collect();
        let mut lost: Option<(usize, usize)> = None;
        for (pair, line) in self.bonds.iter().flatten() {
            match pair.map(|serial| index.get(&serial).copied()) {
                [Some(a), Some(b)] if a != b => frame.bonds.push([a.min(b), a.max(b)]),
                [Some(_), Some(_)] => {}
                _ => lost = Some(lost.map_or((*line, 1), |(first, count)| (first, count + 1))),
            }
        }
        if let Some((line, count)) = lost {
            let mut warning =
                lines.warning(format!("bonds to atoms that the frame does not have are left out: {count}"));
            warning.place.line = line;
            frame.warnings.push(warning);
        }
        Ok(())
    }
}

/// What is read of an atom beside its place and kind.
#[derive(Clone, Copy)]
struct Wanted {
    value: Option<(usize, &'static str)>,
    serials: bool,
}

/// A frame that is being read, or a part of one.
#[derive(Default)]
struct Model {
    frame: Frame,
    kinds: Kinds,
    serials: Vec<Serial>,
    /// What its last `CRYST1` says, where it has one.
    cell: Option<Option<Cell>>,
    wrong: Option<Box<SceneError>>,
    /// Where a part starts.
    start: Option<Place>,
}

impl Model {
    /// The lines of a part, up to the first one that is wrong.
    fn of(part: Part<'_>, wanted: Wanted) -> Model {
        let start = part.lines().next().map(|(_, line)| line.place(0));
        let mut model = Model { start, ..Model::default() };
        model.wrong = part.lines().try_for_each(|(_, line)| model.read(line, wanted)).err();
        model
    }

    fn read(&mut self, line: Line<'_>, wanted: Wanted) -> Reading<()> {
        match record(line.bytes) {
            b"ATOM" | b"HETATM" => self.add(line.bytes, wanted).map_err(|slip| line.slip(slip))?,
            b"CRYST1" => self.cell = Some(cell(line, &mut self.frame.warnings)),
            _ => {}
        }
        Ok(())
    }

    fn add(&mut self, line: &[u8], wanted: Wanted) -> Result<(), Slip> {
        let (atom, kind) = atom(line, &mut self.kinds)?;
        self.frame.atoms.push(atom);
        self.frame.kind.push(kind);
        if let Some((from, what)) = wanted.value {
            self.frame.values.push(real(line, from, 6, what)? as f32);
        }
        if wanted.serials {
            self.serials.push(serial(line, 6));
        }
        Ok(())
    }

    /// Adds the part that follows.
    fn append(&mut self, mut part: Model) -> Reading<()> {
        let too_many = |_| {
            let place = part.start.clone().unwrap_or_else(|| Place::file(Path::new("")));
            Box::new(SceneError { place, rule: TOO_MANY_KINDS.into(), found: String::new(), help: None, span: None })
        };
        let kinds = self.kinds.merge(&part.kinds).map_err(too_many)?;
        self.frame.append(part.frame, &kinds);
        self.serials.append(&mut part.serials);
        self.cell = part.cell.or(self.cell);
        part.wrong.map_or(Ok(()), Err)
    }
}

/// The name of a record.
fn record(line: &[u8]) -> &[u8] {
    line[..line.len().min(6)].trim_ascii_end()
}

/// The columns `from..from + length` without blanks, counted from 0; empty where the line is shorter.
fn columns_of(line: &[u8], from: usize, length: usize) -> &[u8] {
    let end = line.len().min(from + length);
    line.get(from..end).unwrap_or_default().trim_ascii()
}

fn real(line: &[u8], from: usize, length: usize, what: &str) -> Result<f64, Slip> {
    let word = columns_of(line, from, length);
    let rule = || format!("columns {} to {} must hold {what}, a number", from + 1, from + length);
    number(word).ok_or_else(|| Slip::new(from.min(line.len()), rule(), word))
}

fn serial(line: &[u8], from: usize) -> Serial {
    let mut serial = *b"     ";
    let word = columns_of(line, from, 5);
    serial[..word.len()].copy_from_slice(word);
    serial
}

fn atom(line: &[u8], kinds: &mut Kinds) -> Result<([f64; 4], u16), Slip> {
    let place = |index: usize| real(line, 30 + 8 * index, 8, ["x", "y", "z"][index]);
    let atom = [place(0)?, place(1)?, place(2)?, 0.0];
    let symbol = columns_of(line, 76, 2);
    let given = std::str::from_utf8(symbol).ok().and_then(Element::of_symbol);
    let kind = match given {
        Some(_) => kinds.find(symbol, |_| given),
        None => {
            // By its name; blanks count there, so all four columns are the label.
            let name = line.get(12..line.len().min(16)).unwrap_or_default();
            let residue = columns_of(line, 17, 4);
            let element = of_name(name, residue);
            match element {
                Some(element) => kinds.find(element.symbol().as_bytes(), |_| Some(element)),
                None => kinds.find(if symbol.is_empty() { name.trim_ascii() } else { symbol }, |_| None),
            }
        }
    };
    kind.map(|kind| (atom, kind)).ok_or_else(|| Slip::new(12, TOO_MANY_KINDS, symbol))
}

/// The element of an atom by its name: the symbol ends in the second of the four columns. Names that start
/// too far left are common, so the letters count where the residue or the length of the name tells more.
fn of_name(name: &[u8], residue: &[u8]) -> Option<Element> {
    let name = std::str::from_utf8(name).ok()?;
    let residue = std::str::from_utf8(residue).unwrap_or_default();
    let letters = name.trim().trim_start_matches(|c: char| c.is_ascii_digit());
    let first = || Element::of_symbol(letters.get(..1)?);
    let ion = name.trim().eq_ignore_ascii_case(residue).then(|| Element::of_symbol(residue)).flatten();
    if ion.is_some() {
        return ion;
    }
    let by_first = name.starts_with([' ', '1', '2', '3', '4', '5', '6', '7', '8', '9'])
        || COMMON.contains(&residue)
        || (name.trim_end().len() == 4 && letters.starts_with('H'));
    let two = || Element::of_symbol(letters.get(..2).filter(|two| two.bytes().all(|byte| byte.is_ascii_alphabetic()))?);
    if by_first { first() } else { two().or_else(first) }
}

/// The column that colours are made of, if one was asked for.
fn value(lines: &Lines, columns: &Columns) -> Reading<Option<(usize, &'static str)>> {
    let find = |name: &String| match name.as_str() {
        "occupancy" => Ok((54, "the occupancy")),
        "b_factor" => Ok((60, "the temperature factor")),
        _ => {
            let rule = format!("the atoms have no column {name:?}; their columns: occupancy, b_factor");
            Err(lines.error(0, rule, ""))
        }
    };
    if let Some(name) = &columns.radius {
        return Err(lines.error(0, format!("a PDB file has no column {name:?} of radii"), ""));
    }
    columns.value.as_ref().map(find).transpose()
}

/// The cell of a `CRYST1` record; a unit cube stands for none.
fn cell(line: Line<'_>, warnings: &mut Vec<Warning>) -> Option<Cell> {
    let read = |from, length| real(line.bytes, from, length, "a length or angle").ok();
    let lengths = [read(6, 9), read(15, 9), read(24, 9)];
    let angles = [read(33, 7), read(40, 7), read(47, 7)];
    let (Some(lengths), Some(angles)) = (all(lengths), all(angles)) else {
        warnings.push(line.warning("CRYST1 must hold three lengths and three angles: taken for no cell"));
        return None;
    };
    if lengths == [1.0; 3] { None } else { Cell::of_angles(lengths, angles) }
}

fn all(values: [Option<f64>; 3]) -> Option<[f64; 3]> {
    let [Some(a), Some(b), Some(c)] = values else { return None };
    Some([a, b, c])
}

/// All bonds of a file, read once more from its start.
fn connections(lines: &Lines) -> Reading<Vec<([Serial; 2], usize)>> {
    let (mut again, mut bonds) = (Lines::open(lines.path())?, Vec::new());
    while again.advance()? {
        let line = again.line();
        if record(line) != b"CONECT" {
            continue;
        }
        let partners = (0..4).map(|index| serial(line, 11 + 5 * index));
        for partner in partners.filter(|serial| serial != b"     ") {
            bonds.push(([serial(line, 6), partner], again.number()));
        }
    }
    Ok(bonds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_elements() {
        let symbol = |name: &str, residue: &str| of_name(name.as_bytes(), residue.as_bytes()).map(Element::symbol);
        for (name, residue, want) in [
            (" CA ", "ALA", "C"),
            ("CA  ", "ALA", "C"),
            ("CA  ", "CA", "Ca"),
            (" CA ", "CA", "Ca"),
            ("FE  ", "HEM", "Fe"),
            ("HG11", "VAL", "H"),
            ("1HB ", "ALA", "H"),
            ("HO5'", "XYZ", "H"),
            (" NA ", "HEM", "N"),
            ("ZN  ", "ZN", "Zn"),
            (" O  ", "", "O"),
            ("O   ", "", "O"),
            ("H1", "", "H"),
            ("C1'", "LIG", "C"),
            ("CL1 ", "LIG", "Cl"),
            ("OXT ", "LYS", "O"),
        ] {
            assert_eq!(symbol(name, residue), Some(want), "{name:?} of {residue:?}");
        }
        assert_eq!(symbol(" X  ", "XXX"), None);
        assert_eq!(symbol("", ""), None);
    }
}
