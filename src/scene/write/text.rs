//! The grammar of TOML: tables, keys and values.

use std::fmt::{Display, Write};
use std::io;
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::scene::{Interpolation, Part, Scene, Track};

/// One table of the file: its header and a line for each key.
#[derive(Debug)]
pub(super) struct Table {
    lines: String,
}

impl Table {
    /// `[name]`
    pub fn new(name: &str) -> Self {
        Table { lines: format!("\n[{name}]\n") }
    }

    /// `[kind.name]`
    pub fn named(kind: &str, name: &str) -> Self {
        Table::new(&format!("{kind}.{}", key(name)))
    }

    /// `[[name]]`
    pub fn one_of(name: &str) -> Self {
        Table { lines: format!("\n[[{name}]]\n") }
    }

    /// `key = value`, where the value is TOML already.
    pub fn set(mut self, key: &str, value: impl Display) -> Self {
        // Writing to a string cannot fail.
        let _ = writeln!(self.lines, "{key} = {value}");
        self
    }

    /// The same, where there is a value.
    pub fn set_some(self, key: &str, value: Option<impl Display>) -> Self {
        match value {
            Some(value) => self.set(key, value),
            None => self,
        }
    }

    /// Gives the keys that are there the values over time that a part has, instead of those of one frame.
    pub fn over_time(mut self, scene: &Scene, part: Part) -> Self {
        for track in scene.tracks.iter().filter(|track| track.part == Some(part)) {
            let start = format!("{} = ", track.key);
            let line = |line: &str| match line.starts_with(&start) {
                true => format!("{start}{}\n", keys(track)),
                false => format!("{line}\n"),
            };
            self.lines = self.lines.lines().map(line).collect();
        }
        self
    }

    pub fn finish(self) -> String {
        self.lines
    }
}

/// `{ keys = [[1, 0.5], [24, 2]], interpolation = "smooth" }`
pub(super) fn keys(track: &Track) -> String {
    let value = |value: &[f64]| if let [x] = value { number(*x) } else { numbers(value) };
    let pairs = list(track.keys.iter().map(|(frame, key)| format!("[{}, {}]", number(*frame), value(key))));
    let interpolation = match track.interpolation {
        Interpolation::Linear => "linear",
        Interpolation::Smooth => "smooth",
        Interpolation::Step => "step",
    };
    format!("{{ keys = {pairs}, interpolation = {} }}", quoted(interpolation))
}

/// A number by its shortest digits that read back as the same bits.
pub(super) fn number(value: f64) -> String {
    let digits = format!("{value:?}");
    match digits.strip_suffix(".0") {
        // TOML's integer 0 has no sign.
        Some(whole) if value != 0.0 || value.is_sign_positive() => whole.to_owned(),
        _ => digits,
    }
}

pub(super) fn vector(value: DVec3) -> String {
    numbers(&value.to_array())
}

pub(super) fn numbers(values: &[f64]) -> String {
    list(values.iter().map(|value| number(*value)))
}

pub(super) fn list(values: impl Iterator<Item = String>) -> String {
    format!("[{}]", values.collect::<Vec<_>>().join(", "))
}

/// A basic string.
pub(super) fn quoted(text: &str) -> String {
    let mut quoted = "\"".to_owned();
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            _ if c.is_control() => quoted.push_str(&format!("\\u{:04X}", u32::from(c))),
            _ => quoted.push(c),
        }
    }
    quoted + "\""
}

/// A key, bare where TOML lets it be.
fn key(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(bare) { name.to_owned() } else { quoted(name) }
}

/// The folder of a file: `.` where its name says none.
pub(super) fn folder(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// The path of a file as a scene in `folder` names it.
pub(super) fn path(file: &Path, scene: &Path) -> io::Result<String> {
    let beside = scene.parent().and_then(|folder| file.strip_prefix(folder).ok());
    let path = beside.map_or_else(|| std::path::absolute(file), |path| Ok(PathBuf::from(path)))?;
    match path.to_str() {
        Some(path) => Ok(quoted(path)),
        None => Err(unsupported(format!("a scene file cannot name {}, which is not Unicode", path.display()))),
    }
}

pub(super) fn unsupported(why: String) -> io::Error {
    io::Error::new(io::ErrorKind::Unsupported, why)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back_to_the_bit() {
        let values = [0.0, -0.0, 1.0, -3.0, 0.1, 1e15, 1e16, 1e-300, 5e-324, f64::MAX, 1.0 / 3.0, 123_456_789.25];
        for value in values {
            let read = format!("x = {}", number(value)).parse::<toml::Table>().unwrap();
            let read = match &read["x"] {
                toml::Value::Integer(whole) => *whole as f64,
                other => other.as_float().unwrap(),
            };
            assert_eq!(read.to_bits(), value.to_bits(), "{value:?} as {}", number(value));
        }
        assert_eq!(vector(DVec3::new(1.0, -2.5, 0.0)), "[1, -2.5, 0]");
    }

    #[test]
    fn any_name_can_be_a_key_or_a_string() {
        for name in ["clay", "a b", "", "quote\" and \\ slash", "line\nbreak\u{1}\u{7f}", "µ.x"] {
            let text = Table::named("materials", name).set("type", quoted(name)).finish();
            let read = text.parse::<toml::Table>().unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_eq!(read["materials"][name]["type"].as_str(), Some(name));
        }
    }

    #[test]
    fn paths_are_told_from_the_scene() {
        let name = |file, scene| path(Path::new(file), Path::new(scene)).unwrap();
        assert_eq!(name("scenes/maps/a.png", "scenes/b.toml"), "\"maps/a.png\"");
        assert_eq!(name("maps/a.png", "b.toml"), "\"maps/a.png\"");
        let absolute = std::path::absolute("maps/a.png").unwrap();
        assert_eq!(name("maps/a.png", "out/b.toml"), quoted(absolute.to_str().unwrap()));
    }
}
