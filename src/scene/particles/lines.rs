//! The lines of a text file, plain or packed by gzip: one at a time, or many on all threads while more is read. Memory
//! holds some MiB of text, not a file.

use std::borrow::Cow;
use std::fmt::Display;
use std::fs::{self, File};
use std::io::{self, BufReader, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;
use memchr::{memchr, memchr_iter, memmem, memrchr};
use rayon::prelude::*;

use crate::scene::error::{Place, SceneError, Warning, shorten};

/// Longest line in bytes: other files may have no line breaks at all.
const LONGEST_LINE: usize = 1 << 20;
/// Bytes that are read at a time for lines one by one, and for many.
const CHUNK: usize = 1 << 17;
const BLOCK: usize = 1 << 21;
/// Bytes of a part, which one thread parses.
const PART: usize = 1 << 16;

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
    input: Input,
    /// What was read and is still of use.
    buffer: Vec<u8>,
    /// The current line in it, without its break.
    line: Range<usize>,
    /// Where the next line starts in it.
    next: usize,
    /// Of `line`, from 1.
    number: usize,
    /// The line is to come again.
    held: bool,
    /// What is read while the buffer is parsed.
    ahead: Vec<u8>,
}

/// The bytes of a file, unpacked.
struct Input {
    stream: Box<dyn Read + Send>,
    /// Nothing more comes; where the file is broken: what would be right, and what is there.
    end: Option<Result<(), (Cow<'static, str>, &'static str)>>,
}

impl Input {
    /// Appends bytes, as many as wanted unless the file ends before.
    fn read(&mut self, buffer: &mut Vec<u8>, bytes: usize) {
        if self.end.is_some() {
            return;
        }
        self.end = match self.stream.by_ref().take(bytes as u64).read_to_end(buffer) {
            Ok(read) => (read < bytes).then_some(Ok(())),
            Err(error) => Some(Err(match error.kind() {
                io::ErrorKind::UnexpectedEof => ("must be a whole gzip file".into(), "the end of the file"),
                io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => {
                    (format!("must be a sound gzip file ({error})").into(), "")
                }
                _ => (format!("cannot be read: {error}").into(), ""),
            })),
        };
    }
}

/// A line and where it stands.
#[derive(Clone, Copy)]
pub struct Line<'a> {
    path: &'a Path,
    /// Without its break.
    pub bytes: &'a [u8],
    /// From 1.
    pub number: usize,
}

impl Line<'_> {
    /// An error about it from byte `at` on.
    pub fn error(&self, at: usize, rule: impl Into<Cow<'static, str>>, found: impl Into<String>) -> Box<SceneError> {
        let place = self.place(at);
        Box::new(SceneError { place, rule: rule.into(), found: found.into(), help: None, span: None })
    }

    /// A slip in it.
    pub fn slip(&self, slip: Slip) -> Box<SceneError> {
        self.error(slip.at, slip.rule, slip.found)
    }

    /// A warning about it as a whole.
    pub fn warning(&self, text: impl Into<String>) -> Warning {
        Warning { place: self.place(0), text: text.into() }
    }

    /// Its byte `at`, counted in characters.
    pub fn place(&self, at: usize) -> Place {
        let before = &self.bytes[..at.min(self.bytes.len())];
        let column = before.iter().filter(|byte| **byte & 0xc0 != 0x80).count() + 1;
        Place { path: self.path.to_owned(), line: self.number, column }
    }
}

/// Whole lines that follow each other.
pub struct Part<'a> {
    path: &'a Path,
    text: &'a [u8],
    /// How many they are.
    pub count: usize,
    /// How many lines came before, since [`Lines::parts`] was called and in the file.
    before: (u64, usize),
}

impl Part<'_> {
    /// The lines, each with how many came before it since [`Lines::parts`] was called.
    pub fn lines(&self) -> impl Iterator<Item = (u64, Line<'_>)> {
        let (mut rest, (index, number)) = (self.text, self.before);
        (0..self.count).map(move |line| {
            let end = memchr(b'\n', rest).unwrap_or(rest.len());
            let bytes = rest[..end].strip_suffix(b"\r").unwrap_or(&rest[..end]);
            rest = rest.get(end + 1..).unwrap_or_default();
            (index + line as u64, Line { path: self.path, bytes, number: number + line + 1 })
        })
    }
}

/// Lines and the bytes that they take, of each part.
type Cuts = Vec<(usize, Range<usize>)>;

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
        let file = File::open(path).map_err(cannot)?;
        let packed = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
        let stream: Box<dyn Read + Send> = match packed {
            true => Box::new(MultiGzDecoder::new(BufReader::with_capacity(CHUNK, file))),
            false => Box::new(file),
        };
        let (input, path) = (Input { stream, end: None }, path.to_owned());
        let (buffer, ahead) = (Vec::new(), Vec::new());
        Ok(Lines { path, input, buffer, line: 0..0, next: 0, number: 0, held: false, ahead })
    }

    /// Goes to the next line; `false` at the end of the file.
    ///
    /// # Errors
    /// A file that cannot be read or unpacked any further, a line of 1 MiB or more.
    pub fn advance(&mut self) -> Reading<bool> {
        if std::mem::take(&mut self.held) {
            return Ok(true);
        }
        let mut seen = 0;
        let length = loop {
            let rest = &self.buffer[self.next..];
            match memchr(b'\n', &rest[seen..]) {
                Some(end) => break seen + end + 1,
                None if rest.len() >= LONGEST_LINE || self.input.end.is_some() => break rest.len(),
                None => seen = rest.len(),
            }
            self.fill(CHUNK);
        };
        let end = self.next + length;
        (self.line, self.next, self.number) = (self.next..end, end, self.number + 1);
        if length >= LONGEST_LINE {
            return Err(self.error(0, "a line must be shorter than 1 MiB: this is no text of atoms", ""));
        }
        if self.line().last() == Some(&b'\n') {
            self.line.end -= 1;
        } else if let Some(Err((rule, found))) = &self.input.end {
            return Err(self.error(0, rule.clone(), *found));
        }
        if self.line().last() == Some(&b'\r') {
            self.line.end -= 1;
        }
        if self.number == 1 && self.line().starts_with(b"\xef\xbb\xbf") {
            self.line.start += 3; // the mark of UTF-8
        }
        Ok(length > 0)
    }

    /// Drops what is behind, and reads on.
    fn fill(&mut self, bytes: usize) {
        self.buffer.drain(..self.next);
        (self.line, self.next) = (0..0, 0);
        self.input.read(&mut self.buffer, bytes);
    }

    /// Goes past lines, `most` of them and none that starts with `stop`, on all threads: `take` gets what `parse` made
    /// of some lines, in the order of the file. Returns how many lines they were.
    ///
    /// It goes as far as that is easy and worth the while, which may be nowhere: the rest is for [`Lines::advance`],
    /// and so is what is wrong with the file.
    ///
    /// # Errors
    /// Those of `take`, after which there is no going on.
    pub fn parts<T: Send>(
        &mut self,
        most: u64,
        stop: Option<&[u8]>,
        parse: impl Fn(Part<'_>) -> T + Sync,
        mut take: impl FnMut(T) -> Reading<()> + Send,
    ) -> Reading<u64> {
        let (mut gone, mut made) = (0, Vec::new());
        while !self.held && gone < most {
            let (cuts, is_last) = self.cut(most - gone, stop);
            if !is_last && self.buffer.len() - self.next < BLOCK && self.input.end.is_none() {
                self.fill(BLOCK);
                continue;
            }
            let end = cuts.last().map_or(self.next, |(_, range)| range.end);
            if cuts.len() < 2 && gone == 0 || cuts.is_empty() {
                break;
            }
            let mut before = (gone, self.number);
            let part = |(count, range): (usize, Range<usize>)| {
                let part = Part { path: &self.path, text: &self.buffer[range], count, before };
                before = (before.0 + count as u64, before.1 + count);
                part
            };
            let parts: Vec<Part<'_>> = cuts.into_iter().map(part).collect();
            let (input, ahead, rest) = (&mut self.input, &mut self.ahead, &self.buffer[end..]);
            let meanwhile = || {
                if !is_last {
                    ahead.clear();
                    ahead.extend_from_slice(rest);
                    input.read(ahead, BLOCK);
                }
                made.drain(..).try_for_each(&mut take)
            };
            let parse = || parts.into_par_iter().with_max_len(1).map(&parse).collect::<Vec<T>>();
            let (taken, new) = rayon::join(meanwhile, parse);
            taken?;
            made = new;
            (gone, self.number, self.next) = (before.0, before.1, end);
            self.line = end..end;
            if is_last {
                break;
            }
            std::mem::swap(&mut self.buffer, &mut self.ahead);
            (self.line, self.next) = (0..0, 0);
        }
        made.into_iter().try_for_each(take)?;
        Ok(gone)
    }

    /// The parts of the lines that [`Lines::parts`] may go past in the buffer, and whether these are all.
    fn cut(&self, most: u64, stop: Option<&[u8]>) -> (Cuts, bool) {
        let end = stop.and_then(|stop| self.find(stop));
        let text = &self.buffer[..end.unwrap_or(self.buffer.len())];
        let (mut cuts, mut start, mut left) = (Cuts::new(), self.next, most);
        while start < text.len() && left > 0 {
            let near = (start + PART).min(text.len());
            let behind = || memrchr(b'\n', &text[start..near]).map(|at| start + at);
            let Some(last) = memchr(b'\n', &text[near..]).map(|at| near + at).or_else(behind) else { break };
            let part = &text[start..=last];
            if part.len() >= LONGEST_LINE {
                break;
            }
            let (count, bytes) = match memchr_iter(b'\n', part).count() {
                count if count as u64 <= left => (count, part.len()),
                _ => (left as usize, memchr_iter(b'\n', part).nth(left as usize - 1).map_or(0, |at| at + 1)),
            };
            cuts.push((count, start..start + bytes));
            (start, left) = (start + bytes, left - count as u64);
        }
        (cuts, left == 0 || end.is_some_and(|end| start == end))
    }

    /// Where the next line that starts so starts, in the buffer.
    fn find(&self, start: &[u8]) -> Option<usize> {
        let rest = &self.buffer[self.next..];
        let behind = || {
            let mut found = memmem::find_iter(rest, start);
            found.find(|at| *at > 0 && rest[at - 1] == b'\n')
        };
        let found = if rest.starts_with(start) { Some(0) } else { behind() };
        found.map(|at| self.next + at)
    }

    /// Goes to the next line that is not blank; `false` at the end of the file.
    ///
    /// # Errors
    /// As [`Lines::advance`].
    pub fn advance_to_text(&mut self) -> Reading<bool> {
        while self.advance()? {
            if !self.line().trim_ascii().is_empty() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Goes to the next line, which must exist: `what` says what it should be.
    ///
    /// # Errors
    /// As [`Lines::advance`], and the end of the file.
    pub fn need(&mut self, what: impl Display) -> Reading<()> {
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
        &self.buffer[self.line.clone()]
    }

    /// The current line with its place.
    pub fn current(&self) -> Line<'_> {
        Line { path: &self.path, bytes: self.line(), number: self.number }
    }

    /// The current line as text.
    pub fn text(&self) -> Cow<'_, str> {
        String::from_utf8_lossy(self.line())
    }

    /// Number of the current line, from 1.
    pub fn number(&self) -> usize {
        self.number
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// [`Line::error`] about the current line.
    pub fn error(&self, at: usize, rule: impl Into<Cow<'static, str>>, found: impl Into<String>) -> Box<SceneError> {
        self.current().error(at, rule, found)
    }

    /// [`Line::slip`] of the current line.
    pub fn slip(&self, slip: Slip) -> Box<SceneError> {
        self.current().slip(slip)
    }

    /// [`Line::warning`] about the current line.
    pub fn warning(&self, text: impl Into<String>) -> Warning {
        self.current().warning(text)
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

    /// The byte at which the last one ended.
    pub fn at(&self) -> usize {
        self.at
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
    short_decimal(word).or_else(|| any_number(word))
}

/// Powers of ten that are exact.
const TENS: [f64; 16] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// A number of 15 digits or less without an exponent: its digits and the power of ten are exact, so that the one
/// division rounds as it must. `None` for any other word.
///
/// Source: Clinger, "How to read floating point numbers accurately", PLDI 1990.
#[inline]
fn short_decimal(word: &[u8]) -> Option<f64> {
    let text = word.strip_prefix(b"-").unwrap_or(word);
    let (mut whole, mut point) = (0u64, text.len());
    for (at, byte) in text.iter().take(TENS.len() + 1).enumerate() {
        match byte.wrapping_sub(b'0') {
            digit @ ..10 => whole = 10 * whole + u64::from(digit),
            _ if *byte == b'.' && point == text.len() => point = at,
            _ => return None,
        }
    }
    let decimals = text.len().saturating_sub(point + 1);
    if !(1..TENS.len()).contains(&(point + decimals)) {
        return None;
    }
    let size = whole as f64 / TENS[decimals];
    Some(if text.len() < word.len() { -size } else { size })
}

#[cold]
fn any_number(word: &[u8]) -> Option<f64> {
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
        for text in
            ["0", "-0", "007.5", "-12.", ".25", "999999999999999", "123456789.012345", "0.00000000000001", "-1.10"]
        {
            let (short, std) = (short_decimal(text.as_bytes()), text.parse::<f64>().unwrap());
            assert_eq!(short.map(f64::to_bits), Some(std.to_bits()), "{text}");
        }
        for text in ["", "-", ".", "+1", "1e5", "1.2.3", "--1", "1234567890123456", "0.1234567890123456", " 1", "0x1"] {
            assert_eq!(short_decimal(text.as_bytes()), None, "{text}");
        }
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

    /// Parts, and what is left for one by one, are all lines of the file in order, wherever it is cut.
    #[test]
    fn parts_are_all_lines_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("a.xyz");
        let text: String = (1..=300_000).map(|line| format!("line {line} {}\r\n", "x".repeat(line % 37))).collect();
        fs::write(&name, text.trim_end()).unwrap();
        for (most, stop, want) in [
            (u64::MAX, None, 299_999),
            (200_000, None, 200_000),
            (7, None, 0),
            (u64::MAX, Some("line 250001"), 249_999),
        ] {
            let mut lines = Lines::open(&name).unwrap();
            assert!(lines.advance().unwrap());
            let mut seen = 1;
            let parse = |part: Part<'_>| {
                let known = part.lines().all(|(index, line)| {
                    let start = format!("line {} ", index + 2);
                    line.number as u64 == index + 2
                        && line.bytes.starts_with(start.as_bytes())
                        && !line.bytes.ends_with(b"\r")
                });
                (known, part.count)
            };
            let stop = stop.map(str::as_bytes);
            let gone = lines.parts(most, stop, parse, |(known, count)| {
                assert!(known);
                seen += count;
                Ok(())
            });
            let gone = gone.unwrap();
            assert_eq!(gone as usize + 1, seen);
            assert!(gone <= want && gone + 1 >= want, "{gone} of {want}");
            assert_eq!(lines.number(), seen);
            while lines.advance().unwrap() {
                seen += 1;
                let start = format!("line {seen} ");
                assert!(lines.line().starts_with(start.as_bytes()) && lines.number() == seen);
            }
            assert_eq!(seen, 300_000);
        }
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
