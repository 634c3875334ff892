//! The order of the house: imports point down only.
//!
//! Reads every source file, leaves out what is compiled for tests alone, and looks at each path that
//! begins with `crate::`, in `use` lines and elsewhere.

use std::path::{Path, PathBuf};

/// From the top down; rooms on one floor are in one entry. A room may use what stands below it and,
/// where this says so, a neighbour of its floor.
const FLOORS: [&[&str]; 15] = [
    &["main", "cli"],
    &["measure"],
    &["batch"],
    &["render"],
    &["tracer"],
    &["integrate"],
    &["shade"],
    &["output"],
    &["film"],
    &["accel"],
    &["shapes"],
    &["plan"],
    &["lanes"],
    &["reference"],
    &["sample"],
];

/// The ground floor.
const GROUND: &str = "scene";

/// Where a crate may be named.
const CRATES: [(&str, &[&str]); 2] = [
    ("wide", &["lanes"]),
    (
        "rayon",
        &[
            "render",
            "batch",
            "accel/build",
            "shapes/store",
            "plan/parts",
            "measure",
            "cli",
            "output",
            "scene/particles",
        ],
    ),
];

#[derive(Debug)]
struct File {
    /// Below `src`, without `.rs` and `/mod`.
    name: String,
    /// Code as it is compiled into the library, without comments and strings.
    code: String,
}

impl File {
    fn room(&self) -> &str {
        self.name.split('/').next().unwrap_or_default()
    }
}

fn files() -> Vec<File> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    collect(&root, &mut paths);
    let name = |path: &Path| {
        let below = path.strip_prefix(&root).expect("below src").with_extension("");
        let name = below.to_string_lossy().replace('\\', "/");
        name.strip_suffix("/mod").map_or(name.clone(), str::to_string)
    };
    let read = |path: &PathBuf| std::fs::read_to_string(path).expect("a source file");
    let all: Vec<File> =
        paths.iter().map(|path| File { name: name(path), code: without_tests(&bare(&read(path))) }).collect();
    // Modules declared under #[cfg(test)] are tests wholly: `tests.rs`, `tests/`, and those said here.
    all.into_iter().filter(|file| !is_test_module(&file.name)).collect()
}

fn is_test_module(name: &str) -> bool {
    name.split('/').any(|part| part == "tests") || name == "shapes/brute"
}

fn collect(folder: &Path, paths: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            collect(&path, paths);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            paths.push(path);
        }
    }
}

/// The code without comments, and with empty strings and character literals.
fn bare(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let (mut code, mut i) = (String::new(), 0);
    let starts = |i: usize, with: &str| with.chars().enumerate().all(|(k, c)| chars.get(i + k) == Some(&c));
    while i < chars.len() {
        if starts(i, "//") {
            while i < chars.len() && chars[i] != '\n' {
                i += 1;
            }
        } else if starts(i, "/*") {
            let mut depth = 0;
            loop {
                if starts(i, "/*") {
                    (depth, i) = (depth + 1, i + 2);
                } else if starts(i, "*/") {
                    (depth, i) = (depth - 1, i + 2);
                } else {
                    i += 1;
                }
                if depth == 0 || i >= chars.len() {
                    break;
                }
            }
        } else if let Some(hashes) = raw_string(&chars, i) {
            let end: String = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
            i += hashes + 2;
            while i < chars.len() && !starts(i, &end) {
                i += 1;
            }
            i += end.len();
            code.push_str("\"\"");
        } else if chars[i] == '"' {
            i += 1;
            while i < chars.len() && chars[i] != '"' {
                i += if chars[i] == '\\' { 2 } else { 1 };
            }
            i += 1;
            code.push_str("\"\"");
        } else if chars[i] == '\'' && (chars.get(i + 1) == Some(&'\\') || chars.get(i + 2) == Some(&'\'')) {
            i += if chars[i + 1] == '\\' { 3 } else { 2 };
            while i < chars.len() && chars[i] != '\'' {
                i += 1;
            }
            i += 1;
            code.push_str("' '");
        } else {
            code.push(chars[i]);
            i += 1;
        }
    }
    code
}

/// How many `#` stand between the `r` at `i` and its quote, if a raw string begins here.
fn raw_string(chars: &[char], i: usize) -> Option<usize> {
    let word_before = i > 0 && (chars[i - 1].is_alphanumeric() || chars[i - 1] == '_');
    let is_raw = chars[i] == 'r' && (!word_before || (i > 0 && chars[i - 1] == 'b'));
    let hashes = is_raw.then(|| chars[i + 1..].iter().take_while(|c| **c == '#').count())?;
    (chars.get(i + 1 + hashes) == Some(&'"')).then_some(hashes)
}

/// The code without the items that stand under `#[cfg(test)]`.
fn without_tests(code: &str) -> String {
    let (mut kept, mut rest) = (String::new(), code);
    while let Some(at) = rest.find("#[cfg(test)]") {
        kept.push_str(&rest[..at]);
        rest = &rest[at + "#[cfg(test)]".len()..];
        // The item ends with the first `;` outside of braces, or with its closing brace.
        let (mut depth, mut end) = (0, rest.len());
        for (i, c) in rest.char_indices() {
            match c {
                '{' | '(' | '[' => depth += 1,
                '}' | ')' | ']' => depth -= 1,
                _ => {}
            }
            if depth == 0 && (c == ';' || c == '}') {
                end = i + 1;
                break;
            }
        }
        rest = &rest[end..];
    }
    kept.push_str(rest);
    kept
}

/// The rooms that a file names: the words after `crate::`, groups taken apart, and after `super::` where
/// that is the crate's root.
fn rooms_named(file: &File) -> Vec<String> {
    let mut named = Vec::new();
    let depth = file.name.split('/').count();
    let root = match depth {
        1 => "super::".to_string(),
        n => "super::".repeat(n),
    };
    let modules = ["crate::", root.as_str()];
    for prefix in modules {
        let mut rest = file.code.as_str();
        while let Some(at) = rest.find(prefix) {
            let before = rest[..at].chars().next_back();
            rest = &rest[at + prefix.len()..];
            let continues = before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':');
            if !continues {
                named.extend(first_words(rest));
            }
        }
    }
    named
}

/// The first word of a path, or of each path of a group `{a::{b, c}, d}`.
fn first_words(path: &str) -> Vec<String> {
    let word =
        |text: &str| text.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let Some(group) = path.trim_start().strip_prefix('{') else { return vec![word(path)] };
    let (mut depth, mut words, mut start) = (0, Vec::new(), 0);
    for (i, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => {
                words.push(word(&group[start..i]));
                break;
            }
            '}' => depth -= 1,
            ',' if depth == 0 => {
                words.push(word(&group[start..i]));
                start = i + 1;
            }
            _ => {}
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Counted from the top; the ground lies below all. `None`: not a room.
fn floor(room: &str) -> Option<usize> {
    if room == GROUND {
        return Some(FLOORS.len());
    }
    FLOORS.iter().position(|floor| floor.contains(&room))
}

#[test]
fn imports_point_down_only() {
    let (mut arrows, mut broken) = (0, Vec::new());
    for file in files().iter().filter(|file| file.name != "lib") {
        let room = file.room();
        let from = floor(room).unwrap_or_else(|| panic!("{} stands on no floor", file.name));
        for named in rooms_named(file) {
            // What lib.rs lifts to the root is used under the name of its room inside.
            let Some(to) = floor(&named) else {
                panic!("{} names crate::{named}, which is no room", file.name);
            };
            let allowed = match room {
                _ if named == room => true,
                "reference" => ["scene", "sample"].contains(&named.as_str()),
                "scene" | "sample" => false,
                _ => to > from || (from == to && room == "main"),
            };
            arrows += usize::from(named != room);
            if !allowed {
                broken.push(format!("{} uses {named}", file.name));
            }
        }
    }
    assert!(broken.is_empty(), "imports that point up: {broken:#?}");
    assert!(arrows > 80, "only {arrows} imports were found");
}

#[test]
fn lanes_alone_know_the_vector_crate_and_few_know_threads() {
    let files = files();
    for (name, homes) in CRATES {
        let mut found = 0;
        for file in &files {
            let mut rest = file.code.as_str();
            while let Some(at) = rest.find(&format!("{name}::")) {
                let before = rest[..at].chars().next_back();
                rest = &rest[at + name.len()..];
                if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
                    continue;
                }
                found += 1;
                let at_home = homes.iter().any(|home| file.name == *home || file.name.starts_with(&format!("{home}/")));
                assert!(at_home, "{} names {name}", file.name);
            }
        }
        assert!(found >= 1, "{name} was not found at all");
    }
}

#[test]
fn nothing_is_unsafe() {
    let files = files();
    assert!(files.len() > 80, "only {} files were found", files.len());
    for file in &files {
        let mut words = file.code.split(|c: char| !c.is_alphanumeric() && c != '_');
        assert!(!words.any(|word| word == "unsafe"), "{}", file.name);
    }
}

/// The reader reads: groups, nesting, comments, strings, characters and tests.
#[test]
fn what_is_compiled_is_what_is_read() {
    let text = r##"
        use crate::{
            lanes::{Ray, Float8}, // crate::film
            plan::Plan,
        };
        /* crate::film /* nested */ crate::film */
        fn f<'a>(x: &'a str) { let s = "crate::film \" "; let r = r#"crate::film"#; let c = '"'; super::shade::g(); }
        #[cfg(test)]
        mod tests { use crate::film::Picture; fn g() { {} } }
        #[cfg(test)]
        use crate::film::Window;
        fn h() { crate::sample::pair(0, 0, 0); }
    "##;
    let file = File { name: "tracer".into(), code: without_tests(&bare(text)) };
    assert_eq!(rooms_named(&file), ["lanes", "plan", "sample", "shade"]);
}
