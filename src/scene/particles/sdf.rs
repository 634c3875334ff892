//! SDF and MOL, versions V2000 and V3000: molecules with their bonds, each up to `$$$$`.
//!
//! Source: BIOVIA, "CTfile formats" (2020), chapters "The connection table" and "SDfiles".

use std::collections::HashMap;

use super::element::Element;
use super::frame::{Columns, Frame, Kinds, wrong};
use super::lines::{Lines, Reading, Slip, Words, count, number};
use crate::scene::error::shorten;

/// Reads the next molecule; `None` at the end of the file.
pub fn read(lines: &mut Lines, columns: &Columns) -> Reading<Option<Frame>> {
    if let Some(name) = columns.radius.as_ref().or(columns.value.as_ref()) {
        return Err(lines.error(0, format!("an SDF file has no column {name:?}"), ""));
    }
    let Some([atoms, bonds]) = header(lines)? else { return Ok(None) };
    let (mut frame, mut kinds) = (Frame::with_room(atoms), Kinds::default());
    if atoms == 0 && lines.text().contains("V3000") {
        version_3(lines, &mut frame, &mut kinds)?;
    } else {
        for index in 0..atoms {
            lines.need(format_args!("atom {} of {atoms}", index + 1))?;
            atom(lines.line(), &mut frame, &mut kinds).map_err(|slip| lines.slip(slip))?;
        }
        for index in 0..bonds {
            lines.need(format_args!("bond {} of {bonds}", index + 1))?;
            let pair = [0, 3].map(|from| count(fixed(lines.line(), from, 3)));
            bond(lines, pair, &mut frame)?;
        }
    }
    if frame.atoms.is_empty() {
        return Err(lines.error(0, "a molecule must have at least one atom", "0"));
    }
    frame.kinds = kinds.into_list();
    end(lines)?;
    Ok(Some(frame))
}

/// Passes over the next molecule; `false` at the end of the file.
pub fn skip(lines: &mut Lines) -> Reading<bool> {
    if header(lines)?.is_none() {
        return Ok(false);
    }
    end(lines)?;
    Ok(true)
}

/// Goes past the end of a molecule: what follows its atoms and bonds is not used.
fn end(lines: &mut Lines) -> Reading<()> {
    while lines.advance()? {
        if lines.line().starts_with(b"$$$$") {
            break;
        }
    }
    Ok(())
}

/// Reads up to the counts of atoms and bonds; `None` at the end of the file.
fn header(lines: &mut Lines) -> Reading<Option<[u64; 2]>> {
    // The name may be empty, but at the end of a file blank lines are no molecule.
    let first = lines.number();
    if !lines.advance_to_text()? {
        return Ok(None);
    }
    let blank = lines.number() - first - 1;
    for line in (blank + 1).min(3)..3 {
        lines.need(["", "the second line of a molecule", "the third line of a molecule"][line])?;
    }
    if blank < 3 {
        lines.need("the counts of atoms and bonds")?;
    }
    let line = lines.line();
    let counts = [0, 3].map(|from| count(fixed(line, from, 3)));
    let ([Some(atoms), Some(bonds)], 10..) = (counts, line.len()) else {
        let rule = "the fourth line of a molecule must start with the counts of atoms and bonds, three columns each, \
                    and end with its version, V2000 or V3000";
        return Err(lines.error(0, rule, format!("{:?}", shorten(&lines.text()))));
    };
    Ok(Some([atoms, bonds]))
}

/// Columns of a line without blanks; empty where it is shorter.
fn fixed(line: &[u8], from: usize, length: usize) -> &[u8] {
    line.get(from..line.len().min(from + length)).unwrap_or_default().trim_ascii()
}

fn atom(line: &[u8], frame: &mut Frame, kinds: &mut Kinds) -> Result<(), Slip> {
    let mut atom = [0.0; 4];
    for (axis, value) in atom[..3].iter_mut().enumerate() {
        let word = fixed(line, 10 * axis, 10);
        let rule = || format!("columns {} to {} must hold a coordinate, a number", 10 * axis + 1, 10 * axis + 10);
        *value = number(word).ok_or_else(|| Slip::new((10 * axis).min(line.len()), rule(), word))?;
    }
    let symbol = fixed(line, 31, 3);
    if symbol.is_empty() {
        return Err(Slip::new(31.min(line.len()), "columns 32 to 34 must hold the symbol of an element", symbol));
    }
    add(atom, symbol, frame, kinds)
        .ok_or_else(|| Slip::new(31, "a molecule must have less than 65536 kinds of atoms", symbol))
}

fn add(atom: [f64; 4], symbol: &[u8], frame: &mut Frame, kinds: &mut Kinds) -> Option<()> {
    frame.kind.push(kinds.find(symbol, Element::of_symbol)?);
    frame.atoms.push(atom);
    Some(())
}

/// Adds a bond between two atoms by their numbers from 1.
fn bond(lines: &Lines, pair: [Option<u64>; 2], frame: &mut Frame) -> Reading<()> {
    let atoms = frame.len() as u64;
    let index = |number: u64| (1..=atoms).contains(&number).then(|| number as u32 - 1);
    let [Some(a), Some(b)] = pair.map(|number| number.and_then(index)) else {
        let rule = format!("a bond must start with the numbers of two atoms, from 1 to {atoms}");
        return Err(lines.error(0, rule, format!("{:?}", shorten(&lines.text()))));
    };
    if a != b {
        frame.bonds.push([a.min(b), a.max(b)]);
    }
    Ok(())
}

/// A line of version V3000 after its `M  V30`; one that ends with a hyphen goes on in the next.
fn line_3(lines: &mut Lines) -> Reading<String> {
    let mut all = String::new();
    loop {
        lines.need("\"M  V30 END CTAB\"")?;
        let text = lines.text();
        let Some(rest) = text.strip_prefix("M  V30 ") else {
            let rule = "a line of this version must start with \"M  V30\"";
            return Err(lines.error(0, rule, format!("{:?}", shorten(&text))));
        };
        match rest.trim_end().strip_suffix('-') {
            Some(begun) if all.len() < LONGEST => all.push_str(begun),
            _ => return Ok(all + rest),
        }
    }
}

/// Longest line that is put together of several, in bytes.
const LONGEST: usize = 1 << 16;

/// The blocks of atoms and bonds of version V3000. Atoms have numbers of any order there, by which bonds know them.
fn version_3(lines: &mut Lines, frame: &mut Frame, kinds: &mut Kinds) -> Reading<()> {
    let (mut block, mut atoms) = (String::new(), HashMap::new());
    loop {
        let rest = line_3(lines)?;
        let words: Vec<&str> = rest.split_whitespace().collect();
        match words[..] {
            ["END", "CTAB", ..] => return Ok(()),
            ["BEGIN", name, ..] => block = name.to_owned(),
            ["END", ..] => block.clear(),
            [name, symbol, x, y, z, ..] if block == "ATOM" => {
                let place = [x, y, z].map(|word| number(word.as_bytes()));
                let [Some(x), Some(y), Some(z)] = place else {
                    return Err(lines.error(0, "a coordinate must be a number", format!("{:?}", shorten(&rest))));
                };
                if let Some(number) = count(name.as_bytes()) {
                    atoms.insert(number, frame.len() as u64 + 1);
                }
                let added = add([x, y, z, 0.0], symbol.as_bytes(), frame, kinds);
                added.ok_or_else(|| lines.error(0, "a molecule must have less than 65536 kinds of atoms", ""))?;
            }
            [_, _, a, b, ..] if block == "BOND" => {
                let atom = |word: &str| atoms.get(&count(word.as_bytes())?).copied();
                bond(lines, [a, b].map(atom), frame)?;
            }
            _ if block == "ATOM" || block == "BOND" => {
                let (at, word) = Words::of(lines.line()).last().unwrap_or((0, b""));
                return Err(wrong(lines, at, word, "a line of atoms or bonds must be whole"));
            }
            _ => {}
        }
    }
}
