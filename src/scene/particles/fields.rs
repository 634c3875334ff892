//! Rows of words, one an atom: what the columns of XYZ files and of LAMMPS dumps mean.

use super::element::Element;
use super::frame::{Columns, Frame, Kinds, TOO_MANY_KINDS};
use super::lines::{Line, Lines, Part, Reading, Slip, Words, count, number};
use crate::scene::error::{Place, SceneError};
use glam::DVec3;
use std::path::Path;

/// What one column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// Nothing that is used: any word.
    Other,
    /// Nothing that is used: a number.
    Real,
    /// Nothing that is used: a whole number.
    Whole,
    /// Nothing that is used: T or F.
    Flag,
    /// Identifier of the atom.
    Id,
    /// Element symbol or label.
    Species,
    /// Atomic number.
    Number,
    /// Type of a simulation: a number that means no element.
    Type,
    /// A coordinate, 0 to 2.
    Place(usize),
    /// Radius.
    Radius,
    /// Diameter.
    Diameter,
    /// A share of red, green or blue on the curve of sRGB, 0 to 2.
    Color(usize),
}

/// The columns of a table of atoms.
#[derive(Debug, Clone)]
pub struct Fields {
    list: Vec<Field>,
    /// Whether rows may be longer than this; what follows is not used.
    open: bool,
    /// Whether the coordinates are shares of the cell.
    scaled: bool,
    /// Whether there are colours.
    colored: bool,
    /// The columns that somebody asked for, whatever else they hold.
    radius: Option<usize>,
    value: Option<usize>,
}

/// The first row whose unused columns are not what they should be, and how many there are.
#[derive(Debug, Default)]
struct Odd {
    rows: usize,
    first: Option<(usize, Slip)>,
}

/// Reads the rows of one frame.
pub struct Rows<'a> {
    fields: &'a Fields,
    kinds: Kinds,
    odd: Odd,
}

/// Rows that were read by one thread, up to the first one that is wrong.
struct Piece<'a> {
    rows: Rows<'a>,
    frame: Frame,
    /// Number of the first line.
    line: usize,
    wrong: Option<Box<SceneError>>,
}

impl Fields {
    /// A table with exactly the columns of these names, or with more at the end where it is `open`; `scaled`
    /// where its coordinates are shares of the cell.
    ///
    /// # Errors
    /// A column that somebody asked for and that is not there.
    pub fn new(
        lines: &Lines,
        list: Vec<(String, Field)>,
        columns: &Columns,
        open: bool,
        scaled: bool,
    ) -> Reading<Self> {
        let find = |wanted: &Option<String>| -> Reading<Option<usize>> {
            let Some(wanted) = wanted else { return Ok(None) };
            let index = list.iter().position(|(name, _)| name == wanted);
            let names = || list.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
            match index {
                Some(index) => Ok(Some(index)),
                None => {
                    Err(lines.error(0, format!("the atoms have no column {wanted:?}; their columns: {}", names()), ""))
                }
            }
        };
        let (radius, value) = (find(&columns.radius)?, find(&columns.value)?);
        let list: Vec<Field> = list.into_iter().map(|(_, field)| field).collect();
        let colored = list.contains(&Field::Color(0));
        Ok(Fields { list, open, scaled, colored, radius, value })
    }

    /// Whether some column holds this.
    pub fn has(&self, field: Field) -> bool {
        self.list.contains(&field)
    }
}

impl<'a> Rows<'a> {
    /// Starts with the first row.
    pub fn new(fields: &'a Fields) -> Self {
        Rows { fields, kinds: Kinds::default(), odd: Odd::default() }
    }

    /// Reads a line as an atom. Returns the byte at which what was read of it ends.
    ///
    /// # Errors
    /// What is wrong with the line.
    pub fn read(&mut self, line: Line<'_>, frame: &mut Frame) -> Reading<usize> {
        self.row(line.bytes, line.number, frame).map_err(|slip| line.slip(slip))
    }

    /// Reads the next lines by `read`, `most` of them, as far as [`Lines::parts`] goes. Returns how many they were.
    ///
    /// # Errors
    /// The first one of `read`, which is given how many lines came before.
    pub fn read_parts(
        &mut self,
        lines: &mut Lines,
        most: u64,
        frame: &mut Frame,
        read: impl Fn(&mut Rows<'a>, u64, Line<'_>, &mut Frame) -> Reading<()> + Sync,
    ) -> Reading<u64> {
        let (fields, cell, path) = (self.fields, frame.cell, lines.path().to_owned());
        let parse = |part: Part<'_>| {
            let frame = Frame { cell, ..Frame::with_room(part.count as u64) };
            let mut piece = Piece { rows: Rows::new(fields), frame, line: 0, wrong: None };
            for (before, line) in part.lines() {
                piece.line = if piece.line == 0 { line.number } else { piece.line };
                if let Err(error) = read(&mut piece.rows, before, line, &mut piece.frame) {
                    piece.wrong = Some(error);
                    break;
                }
            }
            piece
        };
        lines.parts(most, None, parse, |piece| self.add(piece, frame, &path))
    }

    fn add(&mut self, piece: Piece<'_>, frame: &mut Frame, path: &Path) -> Reading<()> {
        let Piece { rows, frame: part, line, wrong } = piece;
        let kinds = self.kinds.merge(&rows.kinds).map_err(|kind| {
            let row = part.kind.iter().position(|known| *known == kind).unwrap_or(0);
            let place = Place { path: path.to_owned(), line: line + row, column: 1 };
            Box::new(SceneError { place, rule: TOO_MANY_KINDS.into(), found: String::new(), help: None, span: None })
        })?;
        frame.append(part, &kinds);
        self.odd.rows += rows.odd.rows;
        self.odd.first = self.odd.first.take().or(rows.odd.first);
        wrong.map_or(Ok(()), Err)
    }

    #[inline]
    fn row(&mut self, line: &[u8], line_number: usize, frame: &mut Frame) -> Result<usize, Slip> {
        let mut words = Words::of(line);
        let (mut atom, mut color, mut kind) = ([0.0; 4], [0.0; 3], None);
        for (index, field) in self.fields.list.iter().enumerate() {
            let Some((at, word)) = words.next() else {
                let rule = format!("an atom must have {} columns", self.fields.list.len());
                return Err(Slip { at: line.len(), rule: rule.into(), found: index.to_string() });
            };
            let real = |what: &'static str| number(word).ok_or_else(|| Slip::new(at, what, word));
            if self.fields.value == Some(index) {
                frame.values.push(real("the column of colours must hold numbers")? as f32);
            }
            if self.fields.radius == Some(index) {
                atom[3] = positive(real("a radius must be a number")?, at, word)?;
            }
            match *field {
                Field::Other => {}
                Field::Real if number(word).is_none() => self.odd.note(line_number, at, "a number", word),
                Field::Whole if whole(word).is_none() => self.odd.note(line_number, at, "a whole number", word),
                Field::Flag if !is_flag(word) => self.odd.note(line_number, at, "T or F", word),
                Field::Real | Field::Whole | Field::Flag => {}
                Field::Id => {
                    frame.ids.push(count(word).ok_or_else(|| Slip::new(at, "an id must be a whole number", word))?)
                }
                Field::Species => kind = self.kinds.find(word, Element::of_label),
                Field::Type => kind = self.kinds.find(word, of_type),
                Field::Number => kind = self.kinds.find(word, |text| Element::of_number(text.parse().ok()?)),
                Field::Place(axis) => atom[axis] = real("a coordinate must be a number")?,
                Field::Radius | Field::Diameter if self.fields.radius.is_some() => {}
                Field::Radius => atom[3] = positive(real("a radius must be a number")?, at, word)?,
                Field::Diameter => atom[3] = 0.5 * positive(real("a diameter must be a number")?, at, word)?,
                Field::Color(part) => color[part] = real("a colour must be three numbers from 0 to 1")?,
            }
        }
        if !self.fields.open
            && let Some((at, word)) = words.next()
        {
            return Err(Slip::new(at, format!("an atom must have {} columns", self.fields.list.len()), word));
        }
        if kind.is_none() {
            kind = self.kinds.find(b"", |_| None);
        }
        frame.kind.push(kind.ok_or_else(|| Slip::new(0, TOO_MANY_KINDS, line))?);
        if self.fields.scaled
            && let Some(cell) = &frame.cell
        {
            let place = cell.origin + cell.edges * DVec3::new(atom[0], atom[1], atom[2]);
            atom[..3].copy_from_slice(&place.to_array());
        }
        if self.fields.colored {
            frame.colors.push(
                color.map(|share: f64| crate::scene::picture_file::linear_from_srgb(share.clamp(0.0, 1.0)) as f32),
            );
        }
        frame.atoms.push(atom);
        Ok(words.at())
    }

    /// Ends a frame: its kinds, what was odd about it, its atoms in the order of their identifiers.
    pub fn finish(self, lines: &Lines, frame: &mut Frame) {
        frame.kinds = self.kinds.into_list();
        if let Some((line, slip)) = self.odd.first {
            let mut warning = lines.warning("");
            (warning.place.line, warning.place.column) = (line, slip.at + 1);
            let more = match self.odd.rows {
                1 => String::new(),
                rows => format!(" (and {} more of the frame)", rows - 1),
            };
            warning.text =
                format!("{}, found {}: passed over, nothing is made of this column{more}", slip.rule, slip.found);
            frame.warnings.push(warning);
        }
        frame.sort(lines);
    }
}

impl Odd {
    #[cold]
    fn note(&mut self, line: usize, at: usize, what: &str, word: &[u8]) {
        self.rows += 1;
        self.first.get_or_insert_with(|| (line, Slip::new(at, format!("this column should hold {what}"), word)));
    }
}

/// Types are numbers, or names of them that LAMMPS calls labels.
fn of_type(text: &str) -> Option<Element> {
    if text.starts_with(|c: char| c.is_ascii_digit()) { None } else { Element::of_label(text) }
}

fn positive(x: f64, at: usize, word: &[u8]) -> Result<f64, Slip> {
    if x > 0.0 { Ok(x) } else { Err(Slip::new(at, "a radius must be > 0", word)) }
}

fn whole(word: &[u8]) -> Option<i64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

fn is_flag(word: &[u8]) -> bool {
    let known: [&[u8]; 8] = [b"T", b"F", b"true", b"false", b"True", b"False", b"TRUE", b"FALSE"];
    known.contains(&word)
}
