//! What is wrong with a scene, and where: every reader speaks of mistakes through these types.
//!
//! An error is one line that an editor can jump to, such as
//! `scenes/balls.toml:12:9: sphere radius must be > 0, found -1`; [`SceneErrors::report`] adds the line
//! itself, a caret and a hint. A reader collects all errors of all files it reads and gives them back
//! at once.

use std::borrow::Cow;
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, NamedSource, SourceCode};

/// Errors kept of one load; a broken file of a million rows is not shown a million times.
const MOST_ERRORS: usize = 100;
/// Longest line of a snippet, in bytes.
const LONGEST_LINE: usize = 240;
/// Longest part of a value that a message repeats, in characters.
const LONGEST_QUOTE: usize = 60;

/// A place in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file, as the user named it or as a scene refers to it.
    pub path: PathBuf,
    /// Counted from 1; 0 is the file as a whole.
    pub line: usize,
    /// Characters, counted from 1; 0 is the file as a whole.
    pub column: usize,
}

/// A scene that breaks a rule: where, which rule, and what stands there instead.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneError {
    /// Where.
    pub place: Place,
    /// What would be right.
    pub rule: Cow<'static, str>,
    /// What is there; empty where the rule says it all.
    pub found: String,
    /// One more sentence, such as the nearest names.
    pub help: Option<String>,
    /// Bytes of the file that the snippet marks; `None`: no snippet.
    pub span: Option<Range<usize>>,
}

/// Something that a reader mended or left out: the scene is valid without it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// Where.
    pub place: Place,
    /// What was done about it.
    pub text: String,
}

/// All errors of a scene, in the order in which they were met, with the texts of the files they are in.
#[derive(Debug, Clone, Default)]
pub struct SceneErrors {
    errors: Vec<SceneError>,
    /// Errors past [`MOST_ERRORS`].
    more: usize,
    sources: Vec<Source>,
}

/// The text of a scene file, cheap to copy; turns byte offsets into places.
#[derive(Debug, Clone)]
pub struct Source {
    path: Arc<Path>,
    text: Arc<str>,
    /// Byte offset of the start of each line.
    starts: Arc<[usize]>,
}

impl Place {
    /// A file as a whole.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Place { path: path.into(), line: 0, column: 0 }
    }
}

impl SceneError {
    /// An error about a file as a whole: not to be read, too long, of an unknown kind.
    pub fn of_file(path: &Path, rule: impl Into<Cow<'static, str>>, found: impl Into<String>) -> Self {
        SceneError { place: Place::file(path), rule: rule.into(), found: found.into(), help: None, span: None }
    }

    /// The rule and what was found, without the place: `sphere radius must be > 0, found -1`.
    pub fn message(&self) -> String {
        match self.found.as_str() {
            "" => self.rule.to_string(),
            found => format!("{}, found {found}", self.rule),
        }
    }

    /// The same with a sentence that helps.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl Source {
    /// The text of the file at `path`, which is read no more.
    pub fn new(path: &Path, text: &str) -> Self {
        let breaks = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at + 1);
        Source { path: path.into(), text: text.into(), starts: std::iter::once(0).chain(breaks).collect() }
    }

    /// The file's path as given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The whole text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The place of a byte offset; offsets past the end are the end.
    pub fn place(&self, offset: usize) -> Place {
        let offset = offset.min(self.text.len());
        let line = self.starts.partition_point(|start| *start <= offset);
        let before = &self.text.as_bytes()[self.starts[line - 1]..offset];
        // Bytes that continue a character (10xxxxxx) count no column.
        let column = before.iter().filter(|byte| **byte & 0xc0 != 0x80).count() + 1;
        Place { path: self.path.to_path_buf(), line, column }
    }

    /// The byte range of a line counted from 1, without its line break; empty past the last line.
    pub fn line(&self, line: usize) -> Range<usize> {
        let end_of_text = self.text.len();
        let start = line.checked_sub(1).and_then(|i| self.starts.get(i)).copied().unwrap_or(end_of_text);
        let end = self.starts.get(line).map_or(end_of_text, |next| next - 1);
        start..start + self.text.get(start..end).unwrap_or_default().trim_end_matches('\r').len()
    }

    /// An error about the bytes `span` of this text.
    pub fn error(
        &self,
        span: Range<usize>,
        rule: impl Into<Cow<'static, str>>,
        found: impl Into<String>,
    ) -> SceneError {
        let place = self.place(span.start);
        SceneError { place, rule: rule.into(), found: found.into(), help: None, span: Some(span) }
    }

    /// Whether a line and its neighbours are short enough to be shown.
    fn fits_a_screen(&self, line: usize) -> bool {
        (line.saturating_sub(1)..=line + 1).all(|line| self.line(line).len() <= LONGEST_LINE)
    }

    /// The part of a span that is on its first line: a list of a thousand points is marked where it starts.
    fn first_line_of(&self, span: Range<usize>) -> Range<usize> {
        let line = self.line(self.place(span.start).line);
        span.start..span.end.min(line.end.max(span.start))
    }

    fn named(&self) -> NamedSource<Arc<str>> {
        // A terminal must not obey what a broken file holds; the same number of bytes keeps all places.
        let shows = |c: char| c == '\n' || c == '\t' || !c.is_ascii_control();
        let text: Arc<str> = match self.text.chars().all(shows) {
            true => self.text.clone(),
            false => self.text.chars().map(|c| if shows(c) { c } else { '?' }).collect::<String>().into(),
        };
        NamedSource::new(self.path.display().to_string(), text)
    }

    /// What stands at `span`, shortened and on one line, for the `found` of an error.
    pub fn quote(&self, span: Range<usize>) -> String {
        shorten(self.text.get(span).unwrap_or_default())
    }
}

/// A text on one line, cut where it is long.
pub fn shorten(text: &str) -> String {
    let mut words = String::new();
    // Four bytes a character at most: no need to look at the rest of a long text.
    for word in text.split_whitespace().take(LONGEST_QUOTE) {
        if !words.is_empty() {
            words.push(' ');
        }
        words.extend(word.chars().take(LONGEST_QUOTE + 1).map(|c| if c.is_control() { '\u{fffd}' } else { c }));
        if words.len() > 4 * LONGEST_QUOTE {
            break;
        }
    }
    match words.char_indices().nth(LONGEST_QUOTE) {
        Some((cut, _)) => format!("{}...", &words[..cut]),
        None => words,
    }
}

impl SceneErrors {
    /// Takes in one more error.
    pub fn push(&mut self, error: SceneError) {
        if self.errors.len() < MOST_ERRORS {
            self.errors.push(error);
        } else {
            self.more += 1;
        }
    }

    /// Takes in the text of a file, for snippets.
    pub fn add_source(&mut self, source: &Source) {
        self.sources.push(source.clone());
    }

    /// Whether nothing is wrong.
    pub fn is_empty(&self) -> bool {
        self.errors.is_empty()
    }

    /// Puts the errors in the order of their places: by file as the texts were added, then by line.
    pub(crate) fn sort(&mut self) {
        let SceneErrors { errors, sources, .. } = self;
        let file = |error: &SceneError| sources.iter().position(|source| source.path() == error.place.path);
        errors.sort_by_cached_key(|error| (file(error), error.place.line, error.place.column));
    }

    /// How many errors there are, those past the first hundred included.
    pub fn len(&self) -> usize {
        self.errors.len() + self.more
    }

    /// The first hundred errors in the order in which they were met.
    pub fn iter(&self) -> std::slice::Iter<'_, SceneError> {
        self.errors.iter()
    }

    /// Every error with the line it is in, a caret and its hint, over several lines each.
    pub fn report(&self, color: bool) -> String {
        let theme = if color { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
        let handler = GraphicalReportHandler::new_themed(theme).with_context_lines(1).with_wrap_lines(false);
        let handler = handler.with_links(false).without_syntax_highlighting();
        let mut page = String::new();
        for error in &self.errors {
            let source = self.sources.iter().find(|source| source.path() == error.place.path);
            let source = source.filter(|source| source.fits_a_screen(error.place.line));
            let span = error.span.clone().zip(source).map(|(span, source)| source.first_line_of(span));
            let snippet = Snippet { error, span, source: source.map(Source::named) };
            // Writing to a string cannot fail; should the span not fit its text, the line alone must do.
            if handler.render_report(&mut page, &snippet).is_err() {
                page.push_str(&format!("{error}\n"));
            }
            page.push('\n');
        }
        if self.more > 0 {
            page.push_str(&format!("and {} more errors\n", self.more));
        }
        page
    }
}

/// One error as `miette` draws it.
#[derive(Debug)]
struct Snippet<'a> {
    error: &'a SceneError,
    span: Option<Range<usize>>,
    source: Option<NamedSource<Arc<str>>>,
}

impl Diagnostic for Snippet<'_> {
    fn help(&self) -> Option<Box<dyn fmt::Display + '_>> {
        self.error.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.span.as_ref()?;
        self.source.as_ref().map(|source| source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let span = self.span.clone()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(Some("here".to_owned()), span))))
    }
}

impl fmt::Display for Snippet<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.error.fmt(f)
    }
}

impl std::error::Error for Snippet<'_> {}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "{}", self.path.display()),
            _ => write!(f, "{}:{}:{}", self.path.display(), self.line, self.column),
        }
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.message())
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: warning: {}", self.place, self.text)
    }
}

/// One error a line.
impl fmt::Display for SceneErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, error) in self.errors.iter().enumerate() {
            let line_break = if i == 0 { "" } else { "\n" };
            write!(f, "{line_break}{error}")?;
        }
        if self.more > 0 { write!(f, "\nand {} more errors", self.more) } else { Ok(()) }
    }
}

impl std::error::Error for SceneError {}
impl std::error::Error for SceneErrors {}

impl From<SceneError> for SceneErrors {
    fn from(error: SceneError) -> Self {
        SceneErrors { errors: vec![error], ..SceneErrors::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_count_lines_and_characters_from_one() {
        let source = Source::new(Path::new("a.toml"), "x = 1\r\nµ = 22\n");
        let at = |offset| source.place(offset).to_string();
        assert_eq!([at(0), at(4), at(7)], ["a.toml:1:1", "a.toml:1:5", "a.toml:2:1"]);
        assert_eq!([at(12), at(15), at(99)], ["a.toml:2:5", "a.toml:3:1", "a.toml:3:1"]);
        assert_eq!([source.line(1), source.line(2), source.line(3), source.line(9)], [0..5, 7..14, 15..15, 15..15]);
        assert_eq!(source.quote(12..14), "22");
    }

    #[test]
    fn errors_read_as_lines_and_as_snippets() {
        let source = Source::new(Path::new("balls.toml"), "type = \"sphere\"\nradius = -1\n");
        let mut errors = SceneErrors::default();
        errors.push(source.error(25..27, "sphere radius must be > 0", "-1").help("a negative radius has no inside"));
        errors.push(SceneError::of_file(Path::new("gone.toml"), "a scene file must exist", ""));
        assert_eq!(
            errors.to_string(),
            "balls.toml:2:10: sphere radius must be > 0, found -1\ngone.toml: a scene file must exist"
        );
        assert!(!errors.report(false).contains("type ="), "no text, no snippet");
        errors.add_source(&source);
        let report = errors.report(false);
        for part in ["balls.toml:2:10: sphere radius must be > 0, found -1", "radius = -1", "type =", "inside", "gone"]
        {
            assert!(report.contains(part), "{part} is missing from\n{report}");
        }
        assert!(!report.contains('\u{1b}') && errors.report(true).contains('\u{1b}'));
    }

    #[test]
    fn long_lines_and_long_lists_make_short_reports() {
        let text = format!("corners = [\n{}]\nradius = {}\n", "[0, 0, 0],\n".repeat(1000), "9".repeat(10_000));
        let source = Source::new(Path::new("a.toml"), &text);
        let mut errors = SceneErrors::default();
        errors.push(source.error(10..text.len() - 10_011, "polygon must have an area", ""));
        errors.push(source.error(text.len() - 10_001..text.len() - 1, "sphere radius must be finite", ""));
        errors.add_source(&source);
        let report = errors.report(false);
        assert!(report.contains("corners = [") && report.contains("1003:10"), "{report}");
        assert!(report.len() < 1000, "{report}");
    }

    #[test]
    fn a_flood_of_errors_is_counted_not_kept() {
        let mut errors = SceneErrors::default();
        for _ in 0..1_000_000 {
            errors.push(SceneError::of_file(Path::new("a.nff"), "no", ""));
        }
        assert_eq!((errors.iter().len(), errors.len()), (MOST_ERRORS, 1_000_000));
        assert!(errors.to_string().ends_with("\nand 999900 more errors"));
    }

    #[test]
    fn long_values_are_cut() {
        assert_eq!(shorten("a \t\n b\u{1b}"), "a b\u{fffd}");
        assert_eq!(shorten(&"µ".repeat(1000)), format!("{}...", "µ".repeat(LONGEST_QUOTE)));
        assert_eq!(shorten(&"x ".repeat(1000)).chars().count(), LONGEST_QUOTE + 3);
    }
}
