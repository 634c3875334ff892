//! LAMMPS data files: a title, a header of counts, then titled sections.
//!
//! Source: LAMMPS manual, "read_data command". Used are `Masses` and `Atom Type Labels` (for elements), `Atoms`
//! and `Bonds`. The style of the atoms is what the comment behind `Atoms` says, else what the title says
//! ("atom_style full"), else what the number of columns allows; where it allows two, that is an error.

use glam::{DMat3, DVec3};

use super::element::Element;
use super::fields::{Field, Fields, Rows};
use super::frame::{Cell, Columns, Frame, wrong};
use super::lines::{Line, Lines, Reading, Words, count, number};
use crate::scene::error::{Warning, shorten};

/// What the header says.
#[derive(Default)]
struct Header {
    atoms: u64,
    bonds: u64,
    types: u64,
    bounds: [Option<[f64; 2]>; 3],
    tilt: [f64; 3],
    /// The style that the title names.
    style: Option<String>,
}

/// Columns of the atom styles that are known.
const STYLES: &[(&str, &[&str])] = &[
    ("atomic", &["id", "type", "x", "y", "z"]),
    ("charge", &["id", "type", "q", "x", "y", "z"]),
    ("angle", &["id", "molecule", "type", "x", "y", "z"]),
    ("bond", &["id", "molecule", "type", "x", "y", "z"]),
    ("molecular", &["id", "molecule", "type", "x", "y", "z"]),
    ("full", &["id", "molecule", "type", "q", "x", "y", "z"]),
    ("sphere", &["id", "type", "diameter", "density", "x", "y", "z"]),
    ("ellipsoid", &["id", "type", "ellipsoidflag", "density", "x", "y", "z"]),
    ("dipole", &["id", "type", "q", "x", "y", "z", "mux", "muy", "muz"]),
];

/// Reads the only frame of a file.
pub fn read(lines: &mut Lines, columns: &Columns, bonds: bool) -> Reading<Option<Frame>> {
    let header = header(lines)?;
    let mut elements: Vec<(Vec<u8>, Option<Element>)> = Vec::new();
    let (mut frame, mut pairs) = (None, Vec::new());
    while let Some((section, comment)) = section(lines)? {
        match section.as_str() {
            "Masses" => masses(lines, header.types, &mut elements)?,
            "Atom Type Labels" => labels(lines, header.types, &mut elements)?,
            "Atoms" => frame = Some(atoms(lines, &header, &comment, columns)?),
            "Bonds" if bonds => pairs = self::bonds(lines, header.bonds)?,
            _ => pass(lines)?,
        }
    }
    let Some(mut frame) = frame else {
        return Err(lines.error(0, "a data file must have a section \"Atoms\"", "the end of the file"));
    };
    for kind in &mut frame.kinds {
        let known = elements.iter().find(|(label, _)| label == kind.label.as_bytes());
        kind.element = kind.element.or_else(|| known.and_then(|(_, element)| *element));
    }
    frame.bonds = join(lines, &frame, &pairs)?;
    Ok(Some(frame))
}

/// The text of a line before its comment, and the comment.
fn split(line: &str) -> (&str, &str) {
    line.split_once('#').map_or((line.trim(), ""), |(text, comment)| (text.trim(), comment.trim()))
}

fn header(lines: &mut Lines) -> Reading<Header> {
    lines.need("a title")?;
    let mut header = Header::default();
    let title = lines.text().into_owned();
    header.style = title.split_whitespace().skip_while(|word| *word != "atom_style").nth(1).map(str::to_owned);
    let mut counted = false;
    while lines.advance_to_text()? {
        let text = lines.text().into_owned();
        let (text, _) = split(&text);
        if text.starts_with(|c: char| c.is_ascii_alphabetic()) {
            lines.hold();
            break;
        }
        let words: Vec<&str> = text.split_whitespace().collect();
        let values = words.iter().take_while(|word| number(word.as_bytes()).is_some()).count();
        let integer = |what: &str| {
            count(words[0].as_bytes())
                .ok_or_else(|| wrong(lines, 0, words[0].as_bytes(), &format!("the number of {what} must be whole")))
        };
        let real = |index: usize| number(words[index].as_bytes()).unwrap_or(f64::NAN);
        match (values, &words[values.min(words.len())..]) {
            (0, []) => {} // a comment alone
            (1, ["atoms"]) => (header.atoms, counted) = (integer("atoms")?, true),
            (1, ["bonds"]) => header.bonds = integer("bonds")?,
            (1, ["atom", "types"]) => header.types = integer("atom types")?,
            (2, ["xlo", "xhi"]) => header.bounds[0] = Some([real(0), real(1)]),
            (2, ["ylo", "yhi"]) => header.bounds[1] = Some([real(0), real(1)]),
            (2, ["zlo", "zhi"]) => header.bounds[2] = Some([real(0), real(1)]),
            (3, ["xy", "xz", "yz"]) => header.tilt = [real(0), real(1), real(2)],
            (0, _) => {
                let found = format!("{:?}", shorten(text));
                return Err(lines.error(
                    0,
                    "a line of the header must be values and what they are, or a section's title",
                    found,
                ));
            }
            _ => {} // counts of what is not drawn
        }
    }
    match counted {
        true => Ok(header),
        false => Err(lines.error(0, "the header must say the number of atoms, such as \"512 atoms\"", "")),
    }
}

impl Header {
    fn cell(&self) -> Option<Cell> {
        let [Some(x), Some(y), Some(z)] = self.bounds else { return None };
        let ([xy, xz, yz], size) = (self.tilt, DVec3::new(x[1] - x[0], y[1] - y[0], z[1] - z[0]));
        let edges = DMat3::from_cols(DVec3::X * size.x, DVec3::new(xy, size.y, 0.0), DVec3::new(xz, yz, size.z));
        Cell::new(DVec3::new(x[0], y[0], z[0]), edges, [true; 3])
    }
}

/// The next section's title and the comment behind it; `None` at the end of the file.
fn section(lines: &mut Lines) -> Reading<Option<(String, String)>> {
    while lines.advance_to_text()? {
        let text = lines.text();
        let (title, comment) = split(&text);
        match title {
            "" => {} // a comment alone
            _ if title.starts_with(|c: char| c.is_ascii_alphabetic()) => {
                return Ok(Some((title.split_whitespace().collect::<Vec<_>>().join(" "), comment.to_owned())));
            }
            _ => {
                let rule = "the title of the next section must follow: this one has more lines than the header says";
                return Err(lines.error(0, rule, format!("{:?}", shorten(title))));
            }
        }
    }
    Ok(None)
}

/// Passes over the lines of a section that is not used: all up to the next title.
fn pass(lines: &mut Lines) -> Reading<()> {
    while lines.advance_to_text()? {
        if lines.line().trim_ascii_start()[0].is_ascii_alphabetic() {
            lines.hold();
            break;
        }
    }
    Ok(())
}

/// Goes to the next row of a section of `count` rows.
fn row(lines: &mut Lines, what: &str, index: u64, count: u64) -> Reading<()> {
    loop {
        lines.need(format_args!("{what} {} of {count}", index + 1))?;
        if is_row(lines.line()) {
            return Ok(());
        }
    }
}

/// Whether a line is neither blank nor a comment alone.
fn is_row(line: &[u8]) -> bool {
    !matches!(line.trim_ascii_start(), [] | [b'#', ..])
}

/// By mass; the comment counts where the mass is of no element (one site for many atoms).
fn masses(lines: &mut Lines, types: u64, elements: &mut Vec<(Vec<u8>, Option<Element>)>) -> Reading<()> {
    for index in 0..types {
        row(lines, "the mass of type", index, types)?;
        let text = lines.text().into_owned();
        let (text, comment) = split(&text);
        let [label, mass] = text.split_whitespace().collect::<Vec<_>>()[..] else {
            return Err(lines.error(0, "a mass must be a type and a number", format!("{:?}", shorten(text))));
        };
        let Some(mass) = number(mass.as_bytes()) else {
            return Err(lines.error(0, "a mass must be a number", format!("{mass:?}")));
        };
        let named = || Element::of_label(comment.split_whitespace().next()?);
        // Masses of reduced units say nothing, and neither do comments beside them.
        let element = Element::of_mass(mass).or_else(|| if mass > 2.5 { named() } else { None });
        elements.push((label.as_bytes().to_vec(), element));
    }
    Ok(())
}

fn labels(lines: &mut Lines, types: u64, elements: &mut Vec<(Vec<u8>, Option<Element>)>) -> Reading<()> {
    for index in 0..types {
        row(lines, "the label of type", index, types)?;
        let mut words = Words::of(lines.line()).map(|(_, word)| word);
        if let (Some(number), Some(label)) = (words.next(), words.next()) {
            let element = Element::of_label(&String::from_utf8_lossy(label));
            elements.push((number.to_vec(), element));
        }
    }
    Ok(())
}

fn atoms(lines: &mut Lines, header: &Header, comment: &str, columns: &Columns) -> Reading<Frame> {
    if header.atoms == 0 {
        return Err(lines.error(0, "a data file must have at least one atom", "0"));
    }
    row(lines, "atom", 0, header.atoms)?;
    let ((name, names), guessed) = style(lines, header, comment)?;
    let width = names.len();
    let field = |name: &str| match name {
        "id" => Field::Id,
        "type" => Field::Type,
        "x" => Field::Place(0),
        "y" => Field::Place(1),
        "z" => Field::Place(2),
        "diameter" => Field::Diameter,
        _ => Field::Other,
    };
    let list = names.iter().map(|name| ((*name).to_owned(), field(name))).collect();
    let fields = Fields::new(lines, list, columns, true, false)?;
    let mut frame = Frame { cell: header.cell(), ..Frame::with_room(header.atoms) };
    frame.warnings.extend(guessed);
    let mut rows = Rows::new(&fields);
    let read = |rows: &mut Rows<'_>, line: Line<'_>, frame: &mut Frame| {
        let read = rows.read(line, frame);
        let images = read.as_ref().map(|end| Words::of(&line.bytes[*end..]).count());
        if matches!(images, Ok(0 | 3)) && !line.bytes.contains(&b'#') {
            return Ok(());
        }
        let found = Words::of(line.bytes).take_while(|(_, word)| word[0] != b'#').count();
        if found != width && found != width + 3 {
            let rule = format!("an atom of style {name} must have {width} columns, and three image counts or none");
            return Err(line.error(0, rule, found.to_string()));
        }
        read.map(|_| ())
    };
    let one = |rows: &mut Rows<'_>, _, line: Line<'_>, frame: &mut Frame| match is_row(line.bytes) {
        true => read(rows, line, frame),
        false => Ok(()),
    };
    read(&mut rows, lines.current(), &mut frame)?;
    let left = |frame: &Frame| header.atoms - frame.len() as u64;
    while left(&frame) > 0 && rows.read_parts(lines, left(&frame), &mut frame, one)? > 0 {}
    while left(&frame) > 0 {
        row(lines, "atom", frame.len() as u64, header.atoms)?;
        read(&mut rows, lines.current(), &mut frame)?;
    }
    rows.finish(lines, &mut frame);
    Ok(frame)
}

type Style = (&'static str, &'static [&'static str]);

/// The style of the atoms, and a warning where it was found by its number of columns.
fn style(lines: &Lines, header: &Header, comment: &str) -> Reading<(Style, Option<Warning>)> {
    let said = comment.split_whitespace().next().map(str::to_owned);
    let known = |name: &String| STYLES.iter().find(|(style, _)| style == name).copied();
    if let Some(style) = said.as_ref().and_then(known).or_else(|| header.style.as_ref().and_then(known)) {
        return Ok((style, None));
    }
    let names = || STYLES.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    if let Some(name) = said {
        let rule = format!("the style behind \"Atoms #\" must be one of {}", names());
        return Err(lines.error(0, rule, format!("{name:?}")));
    }
    let words: Vec<_> = Words::of(lines.line()).map(|(_, word)| word).take_while(|word| word[0] != b'#').collect();
    // Image counts stand at the end of a row or do not; ids of molecules are whole, charges are not written so.
    let whole = |index: usize| words.get(index).is_some_and(|word| word.iter().all(u8::is_ascii_digit));
    let name = match words.len() {
        5 | 8 => "atomic",
        6 | 9 if whole(2) => "molecular",
        6 | 9 => "charge",
        7 | 10 if whole(2) => "full",
        _ => {
            let rule = format!("the style of the atoms must be said, such as \"Atoms # full\": one of {}", names());
            return Err(lines.error(0, rule, format!("{} columns", words.len())));
        }
    };
    let text = format!("no atom style is named: by its {} columns it is taken for {name}", words.len());
    Ok((known(&name.to_owned()).unwrap_or(STYLES[0]), Some(lines.warning(text))))
}

/// The identifiers that each bond joins, with the line they stand in.
fn bonds(lines: &mut Lines, bonds: u64) -> Reading<Vec<([u64; 2], usize)>> {
    let mut pairs = Vec::new();
    for index in 0..bonds {
        row(lines, "bond", index, bonds)?;
        let mut words = Words::of(lines.line()).skip(2);
        let mut id = || {
            let (at, word) = words.next().unwrap_or((lines.line().len(), b""));
            count(word).ok_or_else(|| wrong(lines, at, word, "a bond must be an id, a type and the ids of two atoms"))
        };
        pairs.push(([id()?, id()?], lines.number()));
    }
    Ok(pairs)
}

fn join(lines: &Lines, frame: &Frame, pairs: &[([u64; 2], usize)]) -> Reading<Vec<[u32; 2]>> {
    let mut bonds = Vec::with_capacity(pairs.len());
    for (pair, line) in pairs {
        let found = pair.map(|id| frame.find(id));
        let [Some(a), Some(b)] = found else {
            let id = if found[0].is_none() { pair[0] } else { pair[1] };
            let mut error = lines.error(0, "a bond must join two atoms of the file", format!("the id {id}"));
            (error.place.line, error.place.column) = (*line, 1);
            return Err(error);
        };
        bonds.push([a, b]);
    }
    Ok(bonds)
}
