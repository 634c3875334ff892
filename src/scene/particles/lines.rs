//! The lines of a text file, plain or packed by gzip, one at a time: memory holds a line, not a file.

use std::borrow::Cow;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;

use crate::scene::error::{Place, SceneError, Warning, shorten};

/// Longest line in bytes: other files may have no line breaks at all.
const LONGEST_LINE: u64 = 1 << 20;
/// Bytes that are read at a time.
const CHUNK: usize = 1 << 17;

/// What reading gives: the error is boxed, since it is large and rare.
pub type Reading<T> = Result<T, Box<SceneError>>;

/// What is wrong with a line, without the file and the line number.
#[derive(Debug, PartialEq)]
pub struct Slip {
    /// Byte of the line.
    pub at: usize,
    /// What would be right.
    pub rule: Cow<'static, str>,
    /// What is there.
    pub found: String,
}

impl Slip {
    /// About the word that starts at byte `at`.
    pub fn new(at: usize, rule: impl Into<Cow<'static, str>>, found: &[u8]) -> Self {
        let found = match found.is_empty() {
            true => "the end of the line".to_owned(),
            false => format!("{:?}", shorten(&String::from_utf8_lossy(found))),
        };
        Slip { at, rule: rule.into(), found }
    }
}

/// A file that is being read.
pub struct Lines {
    path: PathBuf,
    input: Box<dyn BufRead + Send>,
    line: Vec<u8>,
    /// Of `line`, from 1.
    number: usize,
    /// The line is to come again.
    held: bool,
}

impl Lines {
    /// Opens a file; its name tells whether it is packed.
    ///
    /// # Errors
    /// A file that is none or cannot be opened.
    pub fn open(path: &Path) -> Reading<Self> {
        let fail = |rule: String| Box::new(SceneError::of_file(path, rule, ""));
        let cannot = |error: io::Error| fail(format!("cannot be read: {error}"));
        if !fs::metadata(path).map_err(cannot)?.is_file() {
            return Err(fail("must be a file, not a directory or device".to_owned()));
        }
        let file = BufReader::with_capacity(CHUNK, File::open(path).map_err(cannot)?);
        let packed = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
        let input: Box<dyn BufRead + Send> = match packed {
            true => Box::new(BufReader::with_capacity(CHUNK, MultiGzDecoder::new(file))),
            false => Box::new(file),
        };
        Ok(Lines { path: path.to_owned(), input, line: Vec::new(), number: 0, held: false })
    }

    /// Goes to the next line; `false` at the end of the file.
    ///
    /// # Errors
    /// A file that cannot be read or unpacked any further, a line of more than 1 MiB.
    pub fn advance(&mut self) -> Reading<bool> {
        if std::mem::take(&mut self.held) {
            return Ok(true);
        }
        self.line.clear();
        let read = self.input.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut self.line);
        self.number += 1;
        let bytes = read.map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => self.error(0, "must be a whole gzip file", "the end of the file"),
            io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => {
                self.error(0, format!("must be a sound gzip file ({error})"), "")
            }
            _ => self.error(0, format!("cannot be read: {error}"), ""),
        })?;
        if bytes as u64 == LONGEST_LINE {
            return Err(self.error(0, "a line must be shorter than 1 MiB: this is no text of atoms", ""));
        }
        if self.line.last() == Some(&b'\n') {
            self.line.pop();
        }
        if self.line.last() == Some(&b'\r') {
            self.line.pop();
        }
        if self.number == 1 && self.line.starts_with(b"\xef\xbb\xbf") {
            self.line.drain(..3); // the mark of UTF-8
        }
        Ok(bytes > 0)
    }

    /// Goes to the next line that is not blank; `false` at the end of the file.
    ///
    /// # Errors
    /// As [`Lines::advance`].
    pub fn advance_to_text(&mut self) -> Reading<bool> {
        while self.advance()? {
            if !self.line.trim_ascii().is_empty() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Goes to the next line, which must exist: `what` says what it should be.
    ///
    /// # Errors
    /// As [`Lines::advance`], and the end of the file.
    pub fn need(&mut self, what: &str) -> Reading<()> {
        match self.advance()? {
            true => Ok(()),
            false => Err(self.error(0, format!("there must be {what}"), "the end of the file")),
        }
    }

    /// Gives the current line once more at the next call.
    pub fn hold(&mut self) {
        self.held = true;
    }

    /// The current line without its break.
    pub fn line(&self) -> &[u8] {
        &self.line
    }

    /// The current line as text.
    pub fn text(&self) -> Cow<'_, str> {
        String::from_utf8_lossy(&self.line)
    }

    /// Number of the current line, from 1.
    pub fn number(&self) -> usize {
        self.number
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// An error about the current line from byte `at` on.
    pub fn error(&self, at: usize, rule: impl Into<Cow<'static, str>>, found: impl Into<String>) -> Box<SceneError> {
        let place = self.place(at);
        Box::new(SceneError { place, rule: rule.into(), found: found.into(), help: None, span: None })
    }

    /// A slip in the current line.
    pub fn slip(&self, slip: Slip) -> Box<SceneError> {
        self.error(slip.at, slip.rule, slip.found)
    }

    /// A warning about the current line as a whole.
    pub fn warning(&self, text: impl Into<String>) -> Warning {
        Warning { place: self.place(0), text: text.into() }
    }

    /// Byte `at` of the current line, counted in characters.
    pub fn place(&self, at: usize) -> Place {
        let before = &self.line[..at.min(self.line.len())];
        let column = before.iter().filter(|byte| **byte & 0xc0 != 0x80).count() + 1;
        Place { path: self.path.clone(), line: self.number, column }
    }
}

/// The words of a line with the bytes at which they start.
pub struct Words<'a> {
    line: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    /// All words of a line.
    pub fn of(line: &'a [u8]) -> Self {
        Words { line, at: 0 }
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = (usize, &'a [u8]);

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let rest = &self.line[self.at..];
        let start = self.at + rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let word = &self.line[start..];
        let length = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
        self.at = start + length;
        Some((start, &word[..length]))
    }
}

/// A finite number; Fortran's exponents (1.5D+00) are read too.
#[inline]
pub fn number(word: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(word).ok()?;
    let value = text.parse::<f64>().ok().or_else(|| text.replace(['d', 'D'], "e").parse().ok());
    value.filter(|value| value.is_finite())
}

/// A whole number from 0 on.
#[inline]
pub fn count(word: &[u8]) -> Option<u64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_know_where_they_start() {
        let words: Vec<_> = Words::of(b"  C 1.5\t-2 ").collect();
        assert_eq!(words, [(2, &b"C"[..]), (4, &b"1.5"[..]), (8, &b"-2"[..])]);
        assert_eq!(Words::of(b" \t ").count(), 0);
    }

    #[test]
    fn numbers_are_finite() {
        assert_eq!([number(b"1.5"), number(b"-2e3"), number(b"1.5D+01")], [Some(1.5), Some(-2000.0), Some(15.0)]);
        assert_eq!([number(b"nan"), number(b"inf"), number(b"1e999"), number(b"x"), number(b"")], [None; 5]);
        assert_eq!([count(b"12"), count(b"-1"), count(b"1.0"), count(b"aaa")], [Some(12), None, None, None]);
    }

    #[test]
    fn lines_come_without_breaks_and_can_be_held() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.xyz");
        fs::write(&file, b"\xef\xbb\xbfa\r\n\n \nb").unwrap();
        let mut lines = Lines::open(&file).unwrap();
        assert!(lines.advance().unwrap() && lines.line() == b"a");
        lines.hold();
        assert!(lines.advance().unwrap() && lines.line() == b"a" && lines.number() == 1);
        assert!(lines.advance_to_text().unwrap() && lines.line() == b"b" && lines.number() == 4);
        let error = lines.need("an atom").unwrap_err().to_string();
        assert!(error.ends_with("a.xyz:5:1: there must be an atom, found the end of the file"), "{error}");
    }

    #[test]
    fn what_is_no_text_ends_in_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, bytes: &[u8]| {
            let file = folder.path().join(name);
            fs::write(&file, bytes).unwrap();
            Lines::open(&file).and_then(|mut lines| lines.advance()).unwrap_err().message()
        };
        assert!(write("a.xyz", &vec![b'x'; 2 << 20]).contains("shorter than 1 MiB"));
        assert!(write("a.xyz.gz", b"plain text").contains("gzip file"));
        assert!(Lines::open(folder.path()).err().unwrap().message().contains("must be a file"));
    }
}
