//! Files, their syntax, and the files they include.

use std::collections::HashMap;
use std::fs::{self, File as OpenFile};
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

use ::toml::de::DeTable;

use super::table::{Context, File, Item, Log, Table};
use super::values;
use crate::scene::error::{Place, SceneError, Source};

/// Longest scene file in bytes; what is larger belongs into clouds.
const LONGEST_FILE: u64 = 1 << 28;
/// Deepest chain of includes.
const DEEPEST: usize = 16;
/// Most files of one scene.
const MOST_FILES: usize = 1000;

/// The texts of a scene in merge order: the files that a file includes come before it.
pub struct Texts {
    /// The frame that is being read.
    frame: i64,
    /// Each with the directory in which its relative paths start.
    texts: Vec<(Source, PathBuf)>,
    pub log: Log,
    /// The chain of files that are being read, each by its canonical path.
    open: Vec<PathBuf>,
    /// Where each file was included.
    included: HashMap<PathBuf, Place>,
}

impl Texts {
    /// None yet, to be read at a frame.
    pub fn new(frame: i64) -> Self {
        Texts { frame, texts: Vec::new(), log: Log::default(), open: Vec::new(), included: HashMap::new() }
    }

    /// Reads the file that the user named, and what it includes.
    pub fn load(&mut self, path: &Path) {
        match read_text(path) {
            Ok(text) => {
                let canonical = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
                self.open.push(canonical);
                self.add(path, path.parent().unwrap_or(Path::new("")), &text);
            }
            Err(why) => self.log.push(SceneError::of_file(path, why, "")),
        }
    }

    /// Takes in a text and, before it, what it includes.
    pub fn add(&mut self, path: &Path, dir: &Path, text: &str) {
        let source = Source::new(path, text);
        self.log.add_source(&source);
        // Few files include others: the rest is parsed once, later.
        if text.contains("include") {
            self.include(&source, dir);
        }
        self.texts.push((source, dir.to_path_buf()));
    }

    /// All files, parsed.
    pub fn parse(&self) -> Vec<File<'_>> {
        self.texts.iter().map(|(source, dir)| parse(source, dir, self.frame, Some(&self.log))).collect()
    }

    fn include(&mut self, source: &Source, dir: &Path) {
        let log = std::mem::take(&mut self.log);
        let mut wanted = Vec::new();
        let file = parse(source, dir, self.frame, None);
        let context = Context { file: &file, log: &log };
        if let Some(item) = Table::new(context, "", &file.root, 0..0).item("include") {
            let read = |item: &Item<'_>| values::file(item).map(|named| (named, item.span.clone()));
            wanted = values::list(&item, "paths", read).unwrap_or_default();
        }
        self.log = log;
        for (named, span) in wanted {
            if let Err(why) = self.include_one(source, &named.path, &span) {
                self.log.push(source.error(span, format!("{} {why}", named.shown), ""));
                self.log.incomplete.set(true);
            }
        }
    }

    fn include_one(&mut self, source: &Source, path: &Path, span: &Range<usize>) -> Result<(), String> {
        let text = read_text(path)?;
        let canonical = fs::canonicalize(path).map_err(|error| format!("cannot be read: {error}"))?;
        if self.open.contains(&canonical) {
            return Err("would include itself".to_owned());
        }
        if let Some(first) = self.included.get(&canonical) {
            return Err(format!("is included twice, first at {first}"));
        }
        if self.open.len() >= DEEPEST || self.included.len() >= MOST_FILES {
            return Err(format!("is too much: includes go {DEEPEST} files deep and name {MOST_FILES} files at most"));
        }
        self.included.insert(canonical.clone(), source.place(span.start));
        self.open.push(canonical);
        self.add(path, path.parent().unwrap_or(Path::new("")), &text);
        self.open.pop();
        Ok(())
    }
}

/// Parses a text; its mistakes go to the log, if there is one.
fn parse<'t>(source: &'t Source, dir: &Path, frame: i64, log: Option<&Log>) -> File<'t> {
    let (root, mistakes) = DeTable::parse_recoverable(source.text());
    let mut broken_lines = Vec::new();
    for mistake in mistakes {
        let end = source.text().len();
        let error = syntax_error(source, mistake.message(), mistake.span().unwrap_or(end..end));
        // The parser goes on within the line and stumbles over what is left of it.
        if broken_lines.last() == Some(&error.place.line) {
            continue;
        }
        broken_lines.push(error.place.line);
        if let Some(log) = log {
            log.push(error);
            log.incomplete.set(true);
        }
    }
    broken_lines.sort_unstable();
    File { source, dir: dir.to_path_buf(), root: root.into_inner(), frame, broken_lines }
}

/// The text of a file, or why it cannot be had.
fn read_text(path: &Path) -> Result<String, String> {
    let cannot = |error: std::io::Error| format!("cannot be read: {error}");
    if !fs::metadata(path).map_err(cannot)?.is_file() {
        return Err("must be a file, not a directory or device".to_owned());
    }
    let mut bytes = Vec::new();
    OpenFile::open(path).map_err(cannot)?.take(LONGEST_FILE + 1).read_to_end(&mut bytes).map_err(cannot)?;
    if bytes.len() as u64 > LONGEST_FILE {
        return Err("must be at most 256 MiB long; keep large data in clouds".to_owned());
    }
    String::from_utf8(bytes).map_err(|error| {
        let line =
            error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|byte| **byte == b'\n').count() + 1;
        format!("must be UTF-8 text; line {line} is not")
    })
}

fn syntax_error(source: &Source, message: &str, span: Range<usize>) -> SceneError {
    let quote = source.quote(span.clone());
    // At the end of a line the break itself would be quoted.
    let found = if quote.is_empty() { "the end of the line".to_owned() } else { quote.clone() };
    match message {
        "duplicate key" => {
            let error = source.error(span, format!("{quote} is given twice"), "");
            error.help("each key stands once; a list of tables has double brackets: [[shapes]]")
        }
        // What the parser says of anything that it cannot read as a value.
        _ if message.starts_with("string values must be quoted") => {
            let error =
                source.error(span, "a value must be a number, true, false, a text in quotes, a list or a table", found);
            error.help("texts need quotes: name = \"ball\"")
        }
        _ => source.error(span, format!("this is not TOML: {message}"), found),
    }
}
