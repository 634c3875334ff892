//! XYZ and extended XYZ: a count, a comment, and so many rows; frames follow each other.
//!
//! Sources: the format description of XMol (Minnesota Supercomputer Center, 1990s); the extended form as the
//! Atomic Simulation Environment documents it (`ase.io.extxyz`): `key=value` pairs in the comment, of which
//! `Lattice`, `Origin`, `pbc` and `Properties` are used here. Without `Properties` a row is a symbol, x, y, z and
//! whatever follows; columns are then called by their number from 1.

use glam::{DMat3, DVec3};

use super::fields::{Field, Fields, Rows};
use super::frame::{Cell, Columns, Frame};
use super::lines::{Lines, Reading, count, number};
use crate::scene::error::shorten;

/// Most columns of a table.
const MOST_COLUMNS: usize = 1000;

/// Reads the next frame; `None` at the end of the file.
pub fn read(lines: &mut Lines, columns: &Columns) -> Reading<Option<Frame>> {
    let Some(atoms) = atoms(lines)? else { return Ok(None) };
    lines.need("a comment line, which may be empty")?;
    let comment = lines.text().into_owned();
    let mut frame = Frame::with_room(atoms);
    frame.cell = cell(lines, &comment)?;
    let fields = match value(&comment, "Properties") {
        Some((at, properties)) => self::properties(lines, at, &properties, columns)?,
        None => plain(lines, columns)?,
    };
    let mut rows = Rows::new(&fields);
    let read = rows.read_parts(lines, atoms, &mut frame, |rows, _, line, frame| rows.read(line, frame).map(|_| ()))?;
    for index in read..atoms {
        lines.need(format_args!("atom {} of {atoms}", index + 1))?;
        rows.read(lines.current(), &mut frame)?;
    }
    rows.finish(lines, &mut frame);
    end(lines)?;
    Ok(Some(frame))
}

/// Passes over the next frame; `false` at the end of the file.
pub fn skip(lines: &mut Lines) -> Reading<bool> {
    let Some(atoms) = atoms(lines)? else { return Ok(false) };
    lines.need("a comment line, which may be empty")?;
    for index in lines.parts(atoms, None, |_| (), Ok)?..atoms {
        lines.need(format_args!("atom {} of {atoms}", index + 1))?;
    }
    end(lines)?;
    Ok(true)
}

/// The count that a frame starts with; `None` at the end of the file.
fn atoms(lines: &mut Lines) -> Reading<Option<u64>> {
    if !lines.advance_to_text()? {
        return Ok(None);
    }
    let found = count(lines.line().trim_ascii());
    match found {
        Some(0) => Err(lines.error(0, "a frame must have at least one atom", "0")),
        Some(atoms) => Ok(Some(atoms)),
        None => {
            let rule = "a frame must start with the number of its atoms, alone on its line";
            let found = shorten(&lines.text());
            Err(lines.error(0, rule, format!("{found:?}")))
        }
    }
}

/// What follows a frame is the next one or nothing: else its count is wrong, and atoms would be missing.
fn end(lines: &mut Lines) -> Reading<()> {
    if lines.advance_to_text()? {
        if count(lines.line().trim_ascii()).is_none() {
            let rule = "the number of atoms of the next frame must follow, or the end of the file";
            let found = shorten(&lines.text());
            return Err(lines.error(0, rule, format!("{found:?}")));
        }
        lines.hold();
    }
    Ok(())
}

fn plain(lines: &Lines, columns: &Columns) -> Reading<Fields> {
    let mut list = vec![Field::Species, Field::Place(0), Field::Place(1), Field::Place(2)];
    let wanted = |name: &Option<String>| name.as_deref().and_then(|name| name.parse::<usize>().ok());
    let last = wanted(&columns.radius).max(wanted(&columns.value)).unwrap_or(0).min(MOST_COLUMNS);
    list.resize(last.max(4), Field::Other);
    let list = list.into_iter().enumerate().map(|(index, field)| ((index + 1).to_string(), field));
    Fields::new(lines, list.collect(), columns, true, false)
}

/// The columns that `Properties=species:S:1:pos:R:3` lists.
fn properties(lines: &Lines, at: usize, text: &str, columns: &Columns) -> Reading<Fields> {
    let wrong = |part: &str| {
        let rule = "Properties must list its columns as name:type:count, the type S, R, I or L, the count from 1 on";
        lines.error(at, rule, format!("{:?}", shorten(part)))
    };
    let parts: Vec<&str> = text.split(':').collect();
    let mut list = Vec::new();
    for triple in parts.chunks(3) {
        let [name, kind, width] = triple else { return Err(wrong(&triple.join(":"))) };
        let width: usize = width.parse().map_err(|_| wrong(&triple.join(":")))?;
        let other = match *kind {
            "S" => Field::Other,
            "R" => Field::Real,
            "I" => Field::Whole,
            "L" => Field::Flag,
            _ => return Err(wrong(&triple.join(":"))),
        };
        if name.is_empty() || !(1..=MOST_COLUMNS).contains(&width) {
            return Err(wrong(&triple.join(":")));
        }
        for part in 0..width {
            let name = if width == 1 { (*name).to_owned() } else { format!("{name}.{}", part + 1) };
            let field = known(&name, kind).unwrap_or(other);
            list.push((name, field));
        }
    }
    let fields = Fields::new(lines, list, columns, false, false)?;
    if !(0..3).all(|axis| fields.has(Field::Place(axis))) {
        return Err(lines.error(at, "Properties must have a column pos:R:3", format!("{text:?}")));
    }
    Ok(fields)
}

/// Names of columns, as the Atomic Simulation Environment and OVITO write them.
fn known(name: &str, kind: &str) -> Option<Field> {
    Some(match (name.to_ascii_lowercase().as_str(), kind) {
        ("species" | "element" | "symbol", "S") => Field::Species,
        ("z" | "numbers" | "atomic_number", "I") => Field::Number,
        ("pos.1" | "positions.1", "R") => Field::Place(0),
        ("pos.2" | "positions.2", "R") => Field::Place(1),
        ("pos.3" | "positions.3", "R") => Field::Place(2),
        ("radius", "R") => Field::Radius,
        ("color.1", "R") => Field::Color(0),
        ("color.2", "R") => Field::Color(1),
        ("color.3", "R") => Field::Color(2),
        ("id", "I") => Field::Id,
        _ => return None,
    })
}

/// The value of a key of a comment, in quotes or brackets where it has blanks, with the byte at which it starts.
fn value(comment: &str, key: &str) -> Option<(usize, String)> {
    let mut rest = 0;
    while let Some(found) = comment[rest..].find('=') {
        let sign = rest + found;
        let name = comment[rest..sign].trim_end().rsplit(char::is_whitespace).next().unwrap_or_default();
        let start = comment.len() - comment[sign + 1..].trim_start().len();
        let inside = extent(&comment[start..]);
        let after = &comment[start..];
        // A word in which or behind which there is an equals sign is the next key: this one has no value.
        let is_key =
            inside.0 == 0 && (after[..inside.1].contains('=') || after[inside.1..].trim_start().starts_with('='));
        let (from, to) = match start > sign + 1 && is_key {
            true => (sign + 1, sign + 1),
            false => (start + inside.0, start + inside.1),
        };
        if name.trim_matches('"').eq_ignore_ascii_case(key) {
            return Some((from, comment[from..to].to_owned()));
        }
        rest = to;
    }
    None
}

/// From where to where the value reaches that a text starts with, without its quotes or outer brackets.
fn extent(text: &str) -> (usize, usize) {
    let (open, close) = match text.chars().next() {
        Some('"') => ('"', '"'),
        Some('[') => ('[', ']'),
        Some('{') => ('{', '}'),
        _ => return (0, text.find(char::is_whitespace).unwrap_or(text.len())),
    };
    let (mut depth, mut escaped) = (0, false);
    for (at, c) in text.char_indices() {
        match c {
            _ if std::mem::take(&mut escaped) => {}
            '\\' if open == '"' => escaped = true,
            _ if c == close && (depth == 1 || open == close && at > 0) => return (1, at),
            _ if c == close && open != close => depth -= 1,
            _ if c == open => depth += 1,
            _ => {}
        }
    }
    (1, text.len())
}

fn cell(lines: &Lines, comment: &str) -> Reading<Option<Cell>> {
    let Some((at, text)) = value(comment, "Lattice") else { return Ok(None) };
    let diagonal = |[x, y, z]: [f64; 3]| [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z];
    let Some(edges) = reals::<9>(&text).or_else(|| reals(&text).map(diagonal)) else {
        let found = format!("{:?}", shorten(&text));
        let rule =
            "Lattice must be nine numbers, the three edges of the cell, or three, their lengths along x, y and z";
        return Err(lines.error(at, rule, found));
    };
    let origin = match value(comment, "Origin") {
        None => [0.0; 3],
        Some((at, text)) => reals(&text).ok_or_else(|| {
            let found = format!("{:?}", shorten(&text));
            lines.error(at, "Origin must be three numbers", found)
        })?,
    };
    let periodic = match value(comment, "pbc") {
        None => [true; 3],
        Some((at, text)) => flags(&text).ok_or_else(|| {
            let found = format!("{:?}", shorten(&text));
            lines.error(at, "pbc must be three of T and F", found)
        })?,
    };
    let cell = Cell::new(DVec3::from_array(origin), DMat3::from_cols_array(&edges), periodic);
    match cell {
        Some(cell) => Ok(Some(cell)),
        None => Err(lines.error(at, "Lattice must span a volume", format!("{:?}", shorten(&text)))),
    }
}

/// The numbers or words of an array, which may have rows in brackets of their own, or be JSON and say so.
fn parts(text: &str) -> impl Iterator<Item = &str> {
    let text = text.trim().strip_prefix("_JSON").unwrap_or(text);
    text.split(|c: char| c.is_whitespace() || matches!(c, ',' | '[' | ']')).filter(|part| !part.is_empty())
}

fn reals<const N: usize>(text: &str) -> Option<[f64; N]> {
    let values: Option<Vec<f64>> = parts(text).map(|part| number(part.as_bytes())).collect();
    values?.try_into().ok()
}

fn flags(text: &str) -> Option<[bool; 3]> {
    let flag = |part: &str| match part {
        "T" | "True" | "true" | "TRUE" | "1" => Some(true),
        "F" | "False" | "false" | "FALSE" | "0" => Some(false),
        _ => None,
    };
    let values: Option<Vec<bool>> = parts(text).map(flag).collect();
    values?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_comments_are_found() {
        let comment = r#"a=1 lattice="1 0 0" s='x' note="pbc=no" Properties=species:S:1:pos:R:3 pbc=[T, F, T]"#;
        let text = |key| value(comment, key).map(|(_, text)| text);
        assert_eq!(text("Lattice").as_deref(), Some("1 0 0"));
        assert_eq!(text("Properties").as_deref(), Some("species:S:1:pos:R:3"));
        assert_eq!(text("pbc").map(|text| flags(&text)), Some(Some([true, false, true])));
        assert_eq!(text("Origin"), None);
        let comment = r#"note="a \"Lattice=1\" b" empty= Lattice = [[1, 0, 0], [0, 2, 0], [0, 0, 3]] pbc=T T"#;
        let text = |key| value(comment, key).map(|(_, text)| text);
        assert_eq!(text("Lattice").as_deref(), Some("[1, 0, 0], [0, 2, 0], [0, 0, 3]"));
        assert_eq!([text("empty").as_deref(), text("pbc").as_deref()], [Some(""), Some("T")]);
        for odd in ["", "=", "===", "a=\"", "é=\"é", "Lattice=[", "= =\"= \"=", "a=]", "a=[]]", "a= é=\\", "a=\"\\"]
        {
            let _ = value(odd, "Lattice");
        }
    }

    /// Every way in which programs write a cell.
    #[test]
    fn cells_are_read_in_all_forms() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("a.xyz");
        for form in [
            r#"Lattice="1 0 0 0 2 0 0 0 3""#,
            r#"lattice="1.0 0 0  0 2 0 0 0 3""#,
            "Lattice={1 0 0 0 2 0 0 0 3}",
            "Lattice=[1, 0, 0, 0, 2, 0, 0, 0, 3]",
            "Lattice=[[1,0,0],[0,2,0],[0,0,3]]",
            "Lattice = [[1, 0, 0], [0, 2, 0], [0, 0, 3]]",
            r#"Lattice="[[1,0,0],[0,2,0],[0,0,3]]""#,
            r#"Lattice="_JSON [[1, 0, 0], [0, 2, 0], [0, 0, 3]]""#,
            r#"Lattice="1 2 3""#,
        ] {
            std::fs::write(&name, format!("1\n{form} pbc=[T, F, TRUE] energy=-1\nC 0 0 0\n")).unwrap();
            let mut lines = Lines::open(&name).unwrap();
            let cell = read(&mut lines, &Columns::default()).unwrap().unwrap().cell.unwrap();
            assert_eq!(cell.edges, DMat3::from_diagonal(DVec3::new(1.0, 2.0, 3.0)), "{form}");
            assert_eq!(cell.periodic, [true, false, true]);
        }
        std::fs::write(&name, "1\nLattice=[[1,0],[0,2]]\nC 0 0 0\n").unwrap();
        let error = read(&mut Lines::open(&name).unwrap(), &Columns::default()).unwrap_err().to_string();
        assert!(error.contains("a.xyz:2:10: Lattice must be nine numbers"), "{error}");
    }
}
