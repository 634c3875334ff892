//! A table of a scene file, read key by key: every key is asked for by the rule it must keep, every
//! mistake is noted with its place, and what nobody asked for is an unknown key.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::ops::Range;
use std::path::PathBuf;

use ::toml::Spanned;
use ::toml::de::{DeString, DeTable, DeValue};

use super::names;
use crate::scene::Track;
use crate::scene::error::{Place, SceneError, SceneErrors, Source, Warning};
use crate::scene::rules::Broken;

/// One parsed file.
pub struct File<'t> {
    pub source: &'t Source,
    /// Where its relative paths start.
    pub dir: PathBuf,
    pub root: DeTable<'t>,
    /// The frame that is being read.
    pub frame: i64,
    /// Lines on which the syntax is broken, ascending; what follows from that is not reported.
    pub broken_lines: Vec<usize>,
}

/// What is wrong or worth a word, of all files together.
#[derive(Default)]
pub struct Log {
    errors: RefCell<SceneErrors>,
    warnings: RefCell<Vec<Warning>>,
    /// Values over time that no part has claimed yet.
    tracks: RefCell<Vec<Track>>,
    /// A file could not be read whole, so that names may be missing through no further fault.
    pub incomplete: Cell<bool>,
}

/// Where something is read, and where its mistakes go.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    pub file: &'a File<'a>,
    pub log: &'a Log,
}

/// A value with the key it stands under.
#[derive(Clone)]
pub struct Item<'a> {
    pub context: Context<'a>,
    /// What the key belongs to, such as "sphere".
    owner: &'static str,
    pub key: &'static str,
    pub value: &'a DeValue<'a>,
    pub span: Range<usize>,
}

/// A table whose keys are being asked for.
pub struct Table<'a> {
    pub context: Context<'a>,
    /// What messages call it, such as "sphere".
    pub what: Cow<'static, str>,
    pub owner: &'static str,
    entries: &'a DeTable<'a>,
    /// Its header or its braces.
    pub span: Range<usize>,
    asked: RefCell<Vec<&'static str>>,
}

/// A table with the name that its header gives.
pub struct Named<'a> {
    pub name: &'a str,
    pub span: Range<usize>,
    pub table: Table<'a>,
}

impl Log {
    pub fn push(&self, error: SceneError) {
        self.errors.borrow_mut().push(error);
    }

    pub fn add_source(&self, source: &Source) {
        self.errors.borrow_mut().add_source(source);
    }

    /// Notes a value over time, for the part that is being read.
    pub fn animate(&self, track: Track) {
        self.tracks.borrow_mut().push(track);
    }

    /// The values over time that were noted since the last call.
    pub fn take_tracks(&self) -> Vec<Track> {
        self.tracks.take()
    }

    pub fn warn(&self, warning: Warning) {
        self.warnings.borrow_mut().push(warning);
    }

    pub fn count(&self) -> usize {
        self.errors.borrow().len()
    }

    /// Errors and warnings in the order of their places.
    pub fn into_parts(self) -> (SceneErrors, Vec<Warning>) {
        let mut errors = self.errors.into_inner();
        errors.sort();
        (errors, self.warnings.into_inner())
    }
}

impl<'a> Context<'a> {
    pub fn place(self, span: &Range<usize>) -> Place {
        self.file.source.place(span.start)
    }

    pub fn fail(self, span: &Range<usize>, rule: impl Into<Cow<'static, str>>, found: impl Into<String>) {
        self.push(self.file.source.error(span.clone(), rule, found));
    }

    pub fn fail_with_help(self, span: &Range<usize>, rule: impl Into<Cow<'static, str>>, help: impl Into<String>) {
        self.push(self.file.source.error(span.clone(), rule, "").help(help));
    }

    pub fn warn(self, span: &Range<usize>, text: String) {
        self.log.warn(Warning { place: self.place(span), text });
    }

    /// Notes an error, but for what the parser made up while it recovered from an error of syntax.
    fn push(self, error: SceneError) {
        let lines = &self.file.broken_lines;
        let empty = error.span.as_ref().is_none_or(|span| span.is_empty());
        if lines.is_empty() || !(empty || lines.binary_search(&error.place.line).is_ok()) {
            self.log.push(error);
        }
    }
}

impl<'a> Item<'a> {
    /// Such as "sphere radius".
    pub fn name(&self) -> String {
        if self.owner.is_empty() { self.key.to_owned() } else { format!("{} {}", self.owner, self.key) }
    }

    /// The same value, called as another one in messages.
    pub fn called_as(&self, other: &Item<'a>) -> Item<'a> {
        Item { owner: other.owner, key: other.key, ..self.clone() }
    }

    /// The text of the value, shortened.
    pub fn quote(&self) -> String {
        self.context.file.source.quote(self.span.clone())
    }

    /// Notes that the value is not what `text` ("must be a number") says; always `None`.
    pub fn wrong<T>(&self, text: &str) -> Option<T> {
        self.context.fail(&self.span, format!("{} {text}", self.name()), self.quote());
        None
    }

    /// The elements of an array, or `None` if it is none.
    pub fn elements(&self) -> Option<impl ExactSizeIterator<Item = Item<'a>> + Clone + use<'a>> {
        let array = self.value.as_array()?;
        let (context, owner, key) = (self.context, self.owner, self.key);
        Some((0..array.len()).map(move |i| {
            let element = &array[i];
            Item { context, owner, key, value: element.get_ref(), span: element.span() }
        }))
    }

    /// The table that the value is.
    pub fn table(&self) -> Option<Table<'a>> {
        let DeValue::Table(entries) = self.value else {
            let text = format!("must be a table such as {}", table_example(self.key));
            return self.wrong(&text);
        };
        Some(Table::new(self.context, self.key, entries, self.span.clone()))
    }
}

fn table_example(key: &str) -> String {
    match key {
        "rotation" => "{ axis = [0, 1, 0], angle = 90 }".to_owned(),
        _ => format!("[{key}]"),
    }
}

impl<'a> Table<'a> {
    pub fn new(context: Context<'a>, what: &'static str, entries: &'a DeTable<'a>, span: Range<usize>) -> Self {
        Table { context, what: what.into(), owner: what, entries, span, asked: RefCell::default() }
    }

    /// The value of a key; the key is known from now on.
    pub fn item(&self, key: &'static str) -> Option<Item<'a>> {
        self.asked.borrow_mut().push(key);
        let value = self.entries.get(key)?;
        Some(Item { context: self.context, owner: self.owner, key, value: value.get_ref(), span: value.span() })
    }

    /// Whether a key is there.
    pub fn has(&self, key: &'static str) -> bool {
        self.item(key).is_some()
    }

    /// The value of a key that must be there.
    pub fn need<T>(&self, key: &'static str, read: impl FnOnce(&Item<'a>) -> Option<T>) -> Option<T> {
        match self.item(key) {
            Some(item) => read(&item),
            None => self.missing(&format!("{key:?}")),
        }
    }

    /// The value of a key that may be left out.
    pub fn or<T>(&self, key: &'static str, default: T, read: impl FnOnce(&Item<'a>) -> Option<T>) -> Option<T> {
        self.item(key).map_or(Some(default), |item| read(&item))
    }

    /// The value of a key without a default; the outer `None` is a broken one.
    pub fn maybe<T>(&self, key: &'static str, read: impl FnOnce(&Item<'a>) -> Option<T>) -> Option<Option<T>> {
        self.item(key).map_or(Some(None), |item| read(&item).map(Some))
    }

    /// Notes that something is missing; always `None`.
    pub fn missing<T>(&self, keys: &str) -> Option<T> {
        // A line that does not parse may well be the one that is missing.
        if self.context.file.broken_lines.is_empty() {
            self.context.fail(&self.span, format!("{} needs {keys}", self.what), "");
        }
        None
    }

    /// Notes a broken rule at the key it names, or at the table.
    pub fn broken<T>(&self, broken: Broken) -> Option<T> {
        let span = self.entries.get(broken.key).map_or(self.span.clone(), |value| value.span());
        self.context.fail(&span, broken.rule, broken.found);
        None
    }

    /// Notes that keys that exclude each other are both there, at the second one.
    pub fn exclusive<T>(&self, rule: String, keys: &[&str]) -> Option<T> {
        let places = keys.iter().filter_map(|key| self.entries.get_key_value(*key));
        let last = places.map(|(key, _)| key.span()).max_by_key(|span| span.start);
        self.context.fail(&last.unwrap_or(self.span.clone()), rule, "");
        None
    }

    /// The `type` key, once it says one of `kinds`: from there on the table is called by it. Kinds that
    /// exist but cannot be read yet are in `later`, each with what to say about it.
    pub fn kind<T: Copy>(&mut self, kinds: &[(&'static str, T)], later: &[(&str, &str)]) -> Option<T> {
        let item = self.item("type");
        let listed = || kinds.iter().map(|(name, _)| format!("{name:?}")).collect::<Vec<_>>().join(", ");
        let Some(item) = item else {
            return self.missing(&format!("\"type\": one of {}", listed()));
        };
        let Some(word) = item.value.as_str() else {
            return item.wrong(&format!("must be one of {}", listed()));
        };
        if let Some((_, text)) = later.iter().find(|(name, _)| *name == word) {
            self.context.fail(&item.span, (*text).to_owned(), "");
            return None;
        }
        let Some((name, kind)) = kinds.iter().find(|(name, _)| *name == word) else {
            let near = names::did_you_mean(word, kinds.iter().map(|(name, _)| *name));
            let rule = format!("{} must be one of {}", item.name(), listed());
            let error = self.context.file.source.error(item.span.clone(), rule, item.quote());
            self.context.push(if near.is_empty() { error } else { error.help(near) });
            return None;
        };
        (self.owner, self.what) = match (self.owner, *name) {
            ("light", "point") => ("point light", "point light".into()),
            ("light", "directional") => ("directional light", "directional light".into()),
            ("light", "spot") => ("spot light", "spot light".into()),
            ("light", "sphere") => ("sphere light", "sphere light".into()),
            ("light", "disk") => ("disk light", "disk light".into()),
            ("light", "polygon") => ("polygon light", "polygon light".into()),
            ("texture", "image") => ("image texture", "image texture".into()),
            ("cloud", _) => ("cloud", format!("cloud of {name}").into()),
            ("camera", _) => ("camera", format!("{name} camera").into()),
            ("material", _) => (*name, format!("{name} material").into()),
            _ => (*name, (*name).into()),
        };
        Some(*kind)
    }

    /// The tables of `[[key]]`.
    pub fn tables(&self, key: &'static str, what: &'static str) -> Vec<Table<'a>> {
        let Some(item) = self.item(key) else { return Vec::new() };
        let example = || format!("must be tables, each under its own [[{key}]]");
        let Some(elements) = item.elements() else {
            return item.wrong(&example()).unwrap_or_default();
        };
        let table = |element: Item<'a>| match element.value {
            DeValue::Table(entries) => Some(Table::new(self.context, what, entries, element.span)),
            _ => element.wrong(&example()),
        };
        elements.filter_map(table).collect()
    }

    /// The tables of `[key.NAME]` in the order in which their names appear.
    pub fn named(&self, key: &'static str, what: &'static str) -> Vec<Named<'a>> {
        let Some(item) = self.item(key) else { return Vec::new() };
        let example = || format!("must be tables, each under its own [{key}.NAME]");
        let Some(entries) = item.value.as_table() else {
            return item.wrong(&example()).unwrap_or_default();
        };
        let named = |(name, value): (&'a Spanned<DeString<'a>>, &'a Spanned<DeValue<'a>>)| {
            let DeValue::Table(entries) = value.get_ref() else {
                let (context, owner, value, span) = (self.context, "", value.get_ref(), value.span());
                return Item { context, owner, key, value, span }.wrong(&example());
            };
            let table = Table::new(self.context, what, entries, value.span());
            Some(Named { name: name.get_ref(), span: name.span(), table })
        };
        let mut all: Vec<_> = entries.iter().filter_map(named).collect();
        all.sort_by_key(|named| named.span.start);
        all
    }

    /// Notes every key that nobody asked for.
    pub fn finish(self) {
        if !self.context.file.broken_lines.is_empty() {
            // Behind a broken header, keys are in the wrong table.
            return;
        }
        let asked = self.asked.borrow();
        for (key, _) in self.entries.iter() {
            if asked.contains(&key.get_ref().as_ref()) {
                continue;
            }
            let near = names::did_you_mean(key.get_ref(), asked.iter().copied());
            let name = crate::scene::error::shorten(key.get_ref());
            let rule = match near.as_str() {
                "" => format!("{} has no key {name:?}", self.what),
                _ => format!("{} has no key {name:?}: {near}", self.what),
            };
            self.context.fail_with_help(&key.span(), rule, format!("its keys: {}", asked.join(", ")));
        }
    }
}
