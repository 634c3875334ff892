//! LAMMPS dump files (`dump custom` and `dump atom`): sections that start with `ITEM:`.
//!
//! Source: LAMMPS manual, "dump command" and "Howto triclinic". Positions are `x y z`, else `xu yu zu`, else the
//! scaled `xs ys zs` or `xsu ysu zsu`. `element` wins over `type`; `radius` and `diameter` are used where they are.

use glam::{DMat3, DVec3};

use super::fields::{Field, Fields, Rows};
use super::frame::{Cell, Columns, Frame, numbers, wrong};
use super::lines::{Line, Lines, Part, Reading, Words, count};
use crate::scene::error::{SceneError, Warning, shorten};

/// A dump that is being read.
#[derive(Default)]
pub struct Dump {
    /// The header of the next frame, once it has been looked at, or what is wrong with it.
    next: Option<Reading<Option<Header>>>,
}

/// All of a frame but its atoms.
struct Header {
    atoms: u64,
    cell: Option<Cell>,
    /// Names of the columns.
    names: Vec<String>,
}

const TIMESTEP: &str = "a frame must start with \"ITEM: TIMESTEP\"";

impl Dump {
    /// Reads the next frame; `None` at the end of the file.
    pub fn read(&mut self, lines: &mut Lines, columns: &Columns) -> Reading<Option<Frame>> {
        let Some(header) = self.header(lines)? else { return Ok(None) };
        let fields = fields(lines, &header.names, columns)?;
        if header.cell.is_none() && fields.has(Field::Place(0)) && scaled(&header.names) {
            return Err(lines.error(0, "scaled positions need a box of some volume", ""));
        }
        let mut frame = Frame { cell: header.cell, ..Frame::with_room(header.atoms) };
        let mut rows = Rows::new(&fields);
        let atoms = header.atoms;
        let row = |rows: &mut Rows<'_>, index, line: Line<'_>, frame: &mut Frame| {
            atom(line, index, atoms)?;
            rows.read(line, frame).map(|_| ())
        };
        for index in rows.read_parts(lines, atoms, &mut frame, row)?..atoms {
            next_atom(lines, index, atoms)?;
            rows.read(lines.current(), &mut frame)?;
        }
        rows.finish(lines, &mut frame);
        frame.warnings.extend(self.look_ahead(lines)?);
        Ok(Some(frame))
    }

    /// Passes over the next frame; `false` at the end of the file.
    pub fn skip(&mut self, lines: &mut Lines) -> Reading<bool> {
        let Some(header) = self.header(lines)? else { return Ok(false) };
        let atoms = header.atoms;
        let all = |part: Part<'_>| part.lines().try_for_each(|(index, line)| atom(line, index, atoms));
        for index in lines.parts(atoms, None, all, |found| found)?..atoms {
            next_atom(lines, index, atoms)?;
        }
        self.look_ahead(lines)?;
        Ok(true)
    }

    fn header(&mut self, lines: &mut Lines) -> Reading<Option<Header>> {
        match self.next.take() {
            Some(next) => next,
            None => header(lines),
        }
    }

    /// Looks at what follows a frame. A line that starts no section means that the count is wrong; a next frame
    /// that breaks off in its header is worth a word already now.
    fn look_ahead(&mut self, lines: &mut Lines) -> Reading<Option<Warning>> {
        if lines.advance_to_text()? {
            if !lines.line().starts_with(b"ITEM:") {
                let rule = "the next frame must follow, which starts with \"ITEM: TIMESTEP\", or the end of the file";
                return Err(lines.error(0, rule, quote(lines.line())));
            }
            lines.hold();
        }
        let next = header(lines);
        let warning = next.as_ref().err().map(|error| Warning {
            place: error.place.clone(),
            text: format!("the next frame is broken: {}", error.message()),
        });
        self.next = Some(next);
        Ok(warning)
    }
}

fn quote(line: &[u8]) -> String {
    format!("{:?}", shorten(&String::from_utf8_lossy(line)))
}

/// Goes to the line of an atom.
fn next_atom(lines: &mut Lines, index: u64, atoms: u64) -> Reading<()> {
    lines.need(format_args!("atom {} of {atoms}", index + 1))?;
    atom(lines.current(), index, atoms)
}

/// Whether a line may be that of an atom.
fn atom(line: Line<'_>, index: u64, atoms: u64) -> Reading<()> {
    match line.bytes.starts_with(b"ITEM:") {
        true => Err(line.error(0, format!("there must be atom {} of {atoms}", index + 1), quote(line.bytes))),
        false => Ok(()),
    }
}

/// Reads up to the atoms of a frame; `None` at the end of the file.
fn header(lines: &mut Lines) -> Reading<Option<Header>> {
    if !lines.advance_to_text()? {
        return Ok(None);
    }
    lines.hold();
    let (mut begun, mut atoms, mut cell) = (false, None, None);
    loop {
        lines.need(if begun { "the next \"ITEM:\" of the frame" } else { "\"ITEM: TIMESTEP\"" })?;
        let item = lines.text().trim_end().to_owned();
        match item.strip_prefix("ITEM: ") {
            // Written before the time step, where somebody asked for them.
            Some("UNITS" | "TIME") if !begun => lines.need("the value of this item")?,
            Some("TIMESTEP") if !begun => {
                lines.need("the number of the time step")?;
                whole(lines, "the time step")?;
                begun = true;
            }
            Some("NUMBER OF ATOMS") if begun => {
                lines.need("the number of atoms")?;
                atoms = Some(whole(lines, "the number of atoms")?);
            }
            Some(bounds) if begun && (bounds == "BOX BOUNDS" || bounds.starts_with("BOX BOUNDS ")) => {
                cell = Some(box_bounds(lines, bounds)?);
            }
            Some(names) if begun && (names == "ATOMS" || names.starts_with("ATOMS ")) => {
                let missing =
                    |what: &str| lines.error(0, format!("{what} must come before the atoms"), quote(lines.line()));
                let atoms = atoms.ok_or_else(|| missing("\"ITEM: NUMBER OF ATOMS\""))?;
                let cell = cell.ok_or_else(|| missing("\"ITEM: BOX BOUNDS\""))?;
                let names = names.split_whitespace().skip(1).map(str::to_owned).collect();
                return Ok(Some(Header { atoms, cell, names }));
            }
            _ => return Err(unexpected(lines, begun, atoms.is_some(), cell.is_some())),
        }
    }
}

fn unexpected(lines: &Lines, begun: bool, atoms: bool, cell: bool) -> Box<SceneError> {
    let rule = match (begun, atoms, cell) {
        (false, ..) => TIMESTEP,
        (true, false, _) => "this must be \"ITEM: NUMBER OF ATOMS\"",
        (true, true, false) => "this must be \"ITEM: BOX BOUNDS\"",
        (true, true, true) => "this must be \"ITEM: ATOMS\" with the names of the columns",
    };
    lines.error(0, rule, quote(lines.line()))
}

fn whole(lines: &Lines, what: &str) -> Reading<u64> {
    let word = lines.line().trim_ascii();
    count(word).ok_or_else(|| wrong(lines, 0, word, &format!("{what} must be a whole number")))
}

/// The box of a frame; `None` inside for one without volume, such as that of a plane.
fn box_bounds(lines: &mut Lines, header: &str) -> Reading<Option<Cell>> {
    let words: Vec<&str> = header.split_whitespace().skip(2).collect();
    let (tilted, free) = (words.starts_with(&["xy", "xz", "yz"]), words.starts_with(&["abc", "origin"]));
    let flags = words.iter().rev().take(3).rev().collect::<Vec<_>>();
    let periodic = [0, 1, 2].map(|axis| flags.get(axis).is_some_and(|flag| **flag == "pp"));
    let width = if free { 4 } else { 2 + usize::from(tilted) };
    let mut rows = [[0.0; 4]; 3];
    for row in &mut rows {
        lines.need("a line of the box")?;
        let mut words = Words::of(lines.line());
        match width {
            2 => row[..2].copy_from_slice(&numbers::<2>(lines, &mut words, "a bound of the box")?),
            3 => row[..3].copy_from_slice(&numbers::<3>(lines, &mut words, "a bound or tilt of the box")?),
            _ => *row = numbers::<4>(lines, &mut words, "an edge or the origin of the box")?,
        }
        if let Some((at, word)) = words.next() {
            return Err(wrong(lines, at, word, &format!("a line of this box must have {width} numbers")));
        }
    }
    if free {
        let edges = rows.map(|[x, y, z, _]| DVec3::new(x, y, z));
        let origin = DVec3::from_array(rows.map(|row| row[3]));
        return Ok(Cell::new(origin, DMat3::from_cols(edges[0], edges[1], edges[2]), periodic));
    }
    // The bounds are those of the tilted box: the tilts are taken off them first.
    let [xy, xz, yz] = rows.map(|row| row[2]);
    let low = DVec3::new(rows[0][0] - 0f64.min(xy).min(xz).min(xy + xz), rows[1][0] - 0f64.min(yz), rows[2][0]);
    let high = DVec3::new(rows[0][1] - 0f64.max(xy).max(xz).max(xy + xz), rows[1][1] - 0f64.max(yz), rows[2][1]);
    let size = high - low;
    if size.min_element() < 0.0 {
        return Err(lines.error(
            0,
            "the upper bounds of a box must not be less than the lower ones",
            quote(lines.line()),
        ));
    }
    let edges = DMat3::from_cols(DVec3::X * size.x, DVec3::new(xy, size.y, 0.0), DVec3::new(xz, yz, size.z));
    Ok(Cell::new(low, edges, periodic))
}

/// Names of positions in the order in which they are taken.
const PLACES: [[&str; 3]; 4] = [["x", "y", "z"], ["xu", "yu", "zu"], ["xs", "ys", "zs"], ["xsu", "ysu", "zsu"]];

fn places(names: &[String]) -> Option<usize> {
    PLACES.iter().position(|place| place.iter().all(|axis| names.iter().any(|name| name == axis)))
}

fn scaled(names: &[String]) -> bool {
    places(names).is_some_and(|place| place >= 2)
}

fn fields(lines: &Lines, names: &[String], columns: &Columns) -> Reading<Fields> {
    let Some(place) = places(names) else {
        let rule = "ITEM: ATOMS must name the columns of positions: x y z, xu yu zu, xs ys zs or xsu ysu zsu";
        return Err(lines.error(0, rule, format!("{:?}", shorten(&names.join(" ")))));
    };
    let elements = names.iter().any(|name| name == "element");
    let own = |name: &str| -> Option<Field> {
        Some(match name {
            "id" => Field::Id,
            "element" => Field::Species,
            "type" if !elements => Field::Type,
            "radius" => Field::Radius,
            "diameter" => Field::Diameter,
            _ => Field::Place(PLACES[place].iter().position(|axis| *axis == name)?),
        })
    };
    let twice = names.iter().enumerate().find(|(index, name)| names[..*index].contains(name));
    if let Some((_, name)) = twice {
        return Err(lines.error(0, "ITEM: ATOMS must name each column once", format!("{name:?} twice")));
    }
    let list = names.iter().map(|name| (name.clone(), own(name).unwrap_or(Field::Other)));
    Fields::new(lines, list.collect(), columns, false, place >= 2)
}
