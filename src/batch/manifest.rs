//! Lists of jobs in files: JSON, one job a line, or TOML with `[[jobs]]`.
//!
//! A job says what is different from the defaults: its scene, camera (by name, or as a table as in a scene), frame or
//! frames, size, samples, seed, output. Scenes are relative to the file that names them.

use std::fmt;
use std::path::{Component, Path, PathBuf};

use serde::Deserialize;
use thiserror::Error;

use super::frames;
use super::{Job, View, WindowChoice, names};
use crate::film::Window;
use crate::output::Format;
use crate::scene::{Integrator, Scene};

/// A mistake in a list: where, and why.
#[derive(Debug, Error)]
#[error("{place}: {text}")]
pub struct ManifestError {
    /// File and line.
    pub place: String,
    /// What is wrong, and what would be right.
    pub text: String,
}

/// A list that cannot be used: all its mistakes.
#[derive(Debug, Error)]
pub struct ManifestErrors(pub Vec<ManifestError>);

/// Most mistakes that are shown.
const MOST_SHOWN: usize = 50;

impl fmt::Display for ManifestErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, error) in self.0.iter().take(MOST_SHOWN).enumerate() {
            let separator = if index == 0 { "" } else { "\n" };
            write!(f, "{separator}{error}")?;
        }
        match self.0.len().saturating_sub(MOST_SHOWN) {
            0 => Ok(()),
            more => write!(f, "\n{more} more mistakes"),
        }
    }
}

/// What a job, or the defaults of a list, may say.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    scene: Option<PathBuf>,
    camera: Option<toml::Value>,
    frame: Option<i64>,
    frames: Option<String>,
    resolution: Option<(u32, u32)>,
    crop: Option<[i32; 4]>,
    spp: Option<u32>,
    shutter: Option<f64>,
    seed: Option<u64>,
    max_depth: Option<u32>,
    integrator: Option<String>,
    aovs: Option<Vec<String>>,
    output: Option<PathBuf>,
}

/// A list in TOML.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    #[serde(default)]
    defaults: Entry,
    #[serde(default)]
    jobs: Vec<toml::Spanned<toml::Value>>,
}

/// Reads a list. `base` has what no job says, its scene and output are not used; `out_dir` is where outputs start, and
/// where they must stay if one is given; `pattern` names the pictures of jobs that do not.
///
/// # Errors
/// All jobs that cannot be understood, by line.
pub fn read(
    path: &Path,
    text: &str,
    base: &Job,
    out_dir: Option<&Path>,
    pattern: &str,
) -> Result<Vec<Job>, ManifestErrors> {
    let is_toml = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"));
    let mut errors = Vec::new();
    let mut fail = |line: usize, text: String| {
        errors.push((line, ManifestError { place: format!("{}:{line}", path.display()), text }));
    };
    let entries = if is_toml { from_toml(text, &mut fail) } else { from_lines(text, &mut fail) };
    let reader = Reader { base, folder: path.parent().unwrap_or(Path::new("")), out_dir, pattern };
    let mut jobs = Vec::new();
    for (line, entry) in entries {
        match reader.jobs(entry, jobs.len()) {
            Ok(more) => jobs.extend(more),
            Err(text) => fail(line, text),
        }
    }
    errors.sort_by_key(|(line, _)| *line);
    match errors.is_empty() {
        true => Ok(jobs),
        false => Err(ManifestErrors(errors.into_iter().map(|(_, error)| error).collect())),
    }
}

/// Entries by line; `fail` gets the mistakes.
fn from_toml(text: &str, fail: &mut impl FnMut(usize, String)) -> Vec<(usize, Entry)> {
    let line = |at: usize| text.as_bytes()[..at.min(text.len())].iter().filter(|byte| **byte == b'\n').count() + 1;
    let place = |at: usize, error: &toml::de::Error| line(error.span().map_or(at, |span| span.start));
    let manifest: Manifest = match toml::from_str(text) {
        Ok(manifest) => manifest,
        Err(error) => {
            fail(place(0, &error), error.message().to_owned());
            return Vec::new();
        }
    };
    let mut entries = Vec::new();
    for job in manifest.jobs {
        let at = job.span().start;
        match job.into_inner().try_into::<Entry>() {
            Ok(entry) => entries.push((line(at), entry.or(&manifest.defaults))),
            Err(error) => fail(place(at, &error), error.message().to_owned()),
        }
    }
    entries
}

/// Entries by line; `fail` gets the mistakes. Behind defaults that are none, nothing is read.
fn from_lines(text: &str, fail: &mut impl FnMut(usize, String)) -> Vec<(usize, Entry)> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Defaults {
        defaults: Entry,
    }
    let (mut defaults, mut entries) = (Entry::default(), Vec::new());
    for (index, words) in text.lines().enumerate().filter(|(_, words)| !words.trim().is_empty()) {
        let has_defaults =
            || serde_json::from_str::<serde_json::Value>(words).is_ok_and(|job| job.get("defaults").is_some());
        match (serde_json::from_str::<Entry>(words), serde_json::from_str::<Defaults>(words)) {
            (Ok(entry), _) => entries.push((index + 1, entry.or(&defaults))),
            (_, Ok(found)) => defaults = found.defaults,
            (_, Err(error)) if has_defaults() => {
                fail(index + 1, message(&error));
                break;
            }
            (Err(error), _) => fail(index + 1, message(&error)),
        }
    }
    entries
}

/// What is wrong with a line, which is all that its reader saw.
fn message(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let place = format!(" at line {} column {}", error.line(), error.column());
    format!("{} (column {})", text.strip_suffix(&place).unwrap_or(&text), error.column())
}

/// Whether a file lies in a folder, by their names.
fn is_inside(folder: &Path, file: &Path) -> bool {
    let plain = |path: &Path| {
        let mut plain = PathBuf::new();
        for part in std::path::absolute(path).unwrap_or_else(|_| path.to_owned()).components() {
            match part {
                Component::ParentDir => _ = plain.pop(),
                part => plain.push(part),
            }
        }
        plain
    };
    plain(file).starts_with(plain(folder))
}

impl Entry {
    /// What it does not say is as in another one.
    fn or(self, other: &Entry) -> Entry {
        // A frame of the job's own stands against a default list of them, and the other way round.
        let (frame, frames) = match (self.frame, self.frames) {
            (None, None) => (other.frame, other.frames.clone()),
            own => own,
        };
        Entry {
            scene: self.scene.or_else(|| other.scene.clone()),
            camera: self.camera.or_else(|| other.camera.clone()),
            frame,
            frames,
            resolution: self.resolution.or(other.resolution),
            crop: self.crop.or(other.crop),
            spp: self.spp.or(other.spp),
            shutter: self.shutter.or(other.shutter),
            seed: self.seed.or(other.seed),
            max_depth: self.max_depth.or(other.max_depth),
            integrator: self.integrator.or_else(|| other.integrator.clone()),
            aovs: self.aovs.or_else(|| other.aovs.clone()),
            output: self.output.or_else(|| other.output.clone()),
        }
    }
}

struct Reader<'a> {
    base: &'a Job,
    folder: &'a Path,
    out_dir: Option<&'a Path>,
    pattern: &'a str,
}

impl Reader<'_> {
    /// The jobs of an entry: one a frame. `first` is the number of the first one.
    fn jobs(&self, entry: Entry, first: usize) -> Result<Vec<Job>, String> {
        let scene = entry.scene.ok_or("a job needs a scene: the name of a file")?;
        let mut job = Job { scene: self.folder.join(scene), ..self.base.clone() };
        if let Some(camera) = entry.camera {
            job.view = view(camera)?;
        }
        let settings = &mut job.settings;
        settings.resolution = entry.resolution.or(settings.resolution);
        settings.spp = entry.spp.or(settings.spp);
        settings.shutter = entry.shutter.or(settings.shutter);
        if settings.shutter.is_some_and(|shutter| !(0.0..=1.0).contains(&shutter)) {
            return Err("shutter should be from 0 to 1".to_owned());
        }
        settings.seed = entry.seed.or(settings.seed);
        settings.max_depth = entry.max_depth.or(settings.max_depth);
        if let Some([x0, y0, x1, y1]) = entry.crop {
            settings.windows = WindowChoice { crop: Some(Window { x0, y0, x1, y1 }), ..WindowChoice::default() };
        }
        if let Some(name) = entry.integrator {
            settings.integrator = Some(integrator(&name)?);
        }
        if let Some(aovs) = entry.aovs {
            settings.layers.aovs = aovs;
            settings.layers.check().map_err(|unknown| format!("aovs: {unknown}"))?;
        }
        check(settings.resolution, settings.spp, settings.max_depth)?;
        let frames = match (entry.frame, entry.frames) {
            (Some(_), Some(_)) => return Err("a job has a frame or frames, not both".to_owned()),
            (Some(frame), None) => vec![Some(frame)],
            (None, Some(list)) => frames::list(&list)?.0.into_iter().map(Some).collect(),
            (None, None) => vec![job.frame],
        };
        let pattern = entry.output.map_or_else(|| self.pattern.to_owned(), |name| name.to_string_lossy().into_owned());
        let many = frames.len() > 1;
        let one = |(index, frame): (usize, Option<i64>)| {
            let mut job = Job { frame, ..job.clone() };
            let name = names::name(&pattern, &job, first + index + 1, many)?;
            job.output = self.out_dir.unwrap_or(Path::new(".")).join(&name);
            if self.out_dir.is_some_and(|folder| !is_inside(folder, &job.output)) {
                let rule = "the output should stay in the directory that --out-dir names";
                return Err(format!("{}: {rule}; without it, it may be anywhere", name.display()));
            }
            job.format = Format::of(&job.output)
                .ok_or_else(|| format!("{}: the output should end in .exr or .png", job.output.display()))?;
            Ok(job)
        };
        frames.into_iter().enumerate().map(one).collect()
    }
}

/// A camera by its name, or a table as in a scene.
fn view(camera: toml::Value) -> Result<View, String> {
    let table = match camera {
        toml::Value::String(name) => return Ok(View::Named(name)),
        toml::Value::Table(table) => table,
        _ => return Err("camera should be the name of one of the scene's, or a table as in a scene".to_owned()),
    };
    if !table.contains_key("eye") || !table.contains_key("target") {
        return Err("a camera of a job needs eye and target".to_owned());
    }
    let root = toml::Table::from_iter([("camera".to_owned(), toml::Value::Table(table))]);
    let text = toml::to_string(&root).map_err(|error| error.to_string())?;
    let scene = Scene::from_toml(&text, Path::new("")).map_err(|errors| {
        let messages: Vec<String> = errors.iter().map(|error| error.message()).collect();
        format!("camera: {}", messages.join("; "))
    })?;
    let camera = scene.cameras.into_iter().next().ok_or("camera: none was understood")?;
    Ok(View::Given(Box::new(camera)))
}

fn integrator(name: &str) -> Result<Integrator, String> {
    let text = format!("[render]\nintegrator = {name:?}\n");
    let scene = Scene::from_toml(&text, Path::new(""))
        .map_err(|errors| errors.iter().map(|error| error.message()).collect::<Vec<_>>().join("; "))?;
    Ok(scene.render.integrator)
}

/// The limits of scene files.
fn check(resolution: Option<(u32, u32)>, spp: Option<u32>, depth: Option<u32>) -> Result<(), String> {
    let side = 1..=65_536;
    if resolution.is_some_and(|(w, h)| !side.contains(&w) || !side.contains(&h) || w as u64 * h as u64 > 1 << 30) {
        return Err("resolution should be [width, height] in pixels, each from 1 to 65536".to_owned());
    }
    if spp.is_some_and(|spp| !(1..=1 << 20).contains(&spp)) {
        return Err("spp should be from 1 to 1048576".to_owned());
    }
    match depth.is_some_and(|depth| !(1..=1000).contains(&depth)) {
        true => Err("max_depth should be from 1 to 1000".to_owned()),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Lens;

    fn base() -> Job {
        Job {
            scene: PathBuf::new(),
            look: Default::default(),
            view: View::First,
            frame: None,
            settings: Default::default(),
            output: PathBuf::new(),
            format: Format::Exr,
        }
    }

    fn jobs(name: &str, text: &str) -> Result<Vec<Job>, String> {
        let jobs = read(Path::new(name), text, &base(), Some(Path::new("out")), "{scene}.{job}.exr");
        jobs.map_err(|error| error.to_string())
    }

    const LINES: &str = r#"{"defaults": {"scene": "a.toml", "spp": 4, "resolution": [64, 48]}}
{"camera": "top", "seed": 7}

{"scene": "../b.toml", "camera": {"type": "pinhole", "eye": [0, 0, 8], "target": [0, 0, 0], "vfov": 45}, "output": "x.png"}
{"frames": "1-3x2", "output": "f/{scene}.##.exr", "spp": 1}
"#;

    const TABLES: &str = r#"
[defaults]
scene = "a.toml"
spp = 4
resolution = [64, 48]
[[jobs]]
camera = "top"
seed = 7
[[jobs]]
scene = "../b.toml"
camera = { type = "pinhole", eye = [0, 0, 8], target = [0, 0, 0], vfov = 45 }
output = "x.png"
[[jobs]]
frames = "1-3x2"
output = "f/{scene}.##.exr"
spp = 1
"#;

    #[test]
    fn both_forms_say_the_same() {
        let lines = jobs("in/jobs.jsonl", LINES).unwrap();
        assert_eq!(lines, jobs("in/jobs.toml", TABLES).unwrap());
        let outputs: Vec<String> = lines.iter().map(|job| job.output.display().to_string()).collect();
        assert_eq!(outputs, ["out/a.000001.exr", "out/x.png", "out/f/a.01.exr", "out/f/a.03.exr"]);
        assert_eq!(lines[1].scene, Path::new("in/../b.toml"));
        assert_eq!((lines[0].view.clone(), lines[0].settings.seed), (View::Named("top".into()), Some(7)));
        assert_eq!((lines[0].settings.spp, lines[3].settings.spp, lines[3].frame), (Some(4), Some(1), Some(3)));
        let View::Given(camera) = &lines[1].view else { panic!("{:?}", lines[1].view) };
        assert_eq!((camera.eye.z, camera.lens), (8.0, Lens::Pinhole { vfov: 45.0 }));
    }

    #[test]
    fn outputs_stay_in_a_folder_that_is_given() {
        let out = std::path::absolute("out/a.exr").unwrap().display().to_string();
        for output in ["a.exr", "x/../a.exr", "./x//a.exr", "..a/a.exr", &out] {
            let text = format!("{{\"scene\": \"a.toml\", \"output\": {output:?}}}");
            assert!(jobs("j", &text).is_ok(), "{output}");
        }
        let text = r#"{"scene": "a.toml", "output": "../a.exr"}"#;
        let jobs = read(Path::new("j"), text, &base(), None, "").unwrap();
        assert_eq!(jobs[0].output, Path::new("./../a.exr"), "without one they start here and may be anywhere");
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let wrong = [
            ("{\"scene\": \"a.toml\"}\n{\"scene\": 5}\n", "j:2: "),
            ("{\"scene\": \"a.toml\", \"sp\": 5}", "unknown field `sp`"),
            ("{\"spp\": 5}", "j:1: a job needs a scene"),
            ("{\"scene\": \"a.toml\", \"spp\": 0}", "spp should be"),
            ("{\"scene\": \"a.toml\", \"resolution\": [0, 5]}", "resolution should be"),
            ("{\"scene\": \"a.toml\", \"frames\": \"x\"}", "should be frames such as"),
            ("{\"scene\": \"a.toml\", \"frames\": \"1-2\", \"output\": \"a.exr\"}", "no place for the number"),
            ("{\"scene\": \"a.toml\", \"output\": \"a.gif\"}", "should end in .exr or .png"),
            ("{\"scene\": \"a.toml\", \"camera\": {\"type\": \"pinhole\"}}", "needs eye and target"),
            (
                "{\"scene\": \"a.toml\", \"camera\": {\"type\": \"x\", \"eye\": [0,0,1], \"target\": [0,0,0]}}",
                "camera: ",
            ),
            ("{\"scene\": \"a.toml\", \"integrator\": \"magic\"}", "integrator"),
            ("nonsense", "j:1: "),
            ("{\"scene\": \"a.toml\", \"spp\": \"x\"}", "expected u32 (column 30)"),
            ("{\"defaults\": {\"sp\": 5}}\n{\"spp\": 5}", "unknown field `sp`"),
            ("{\"scene\": \"a.toml\", \"output\": \"../a.exr\"}", "../a.exr: the output should stay in the directory"),
            ("{\"scene\": \"a.toml\", \"output\": \"/a.exr\"}", "the output should stay in the directory"),
            ("{\"scene\": \"a.toml\", \"output\": \"x/../../out2/a.exr\"}", "the output should stay in the directory"),
        ];
        for (text, want) in wrong {
            let error = jobs("j", text).unwrap_err();
            assert!(error.contains(want), "{text}: {error}");
        }
        let error = jobs("j", "{\"spp\": 1}\n\n{\"scene\": 5}\n{\"scene\": \"a\"}\n{\"scene\": \"a\", \"spp\": 0}")
            .unwrap_err();
        let lines: Vec<&str> = error.lines().map(|line| &line[..4]).collect();
        assert_eq!(lines, ["j:1:", "j:3:", "j:5:"], "{error}");
        let error =
            jobs("j.toml", "[[jobs]]\nspp = 5\n[[jobs]]\nsp = 5\n[[jobs]]\nscene = \"a\"\nspp = 0\n").unwrap_err();
        assert_eq!(error.lines().count(), 3, "{error}");
        let many = jobs("j", &"{\"scene\": 5}\n".repeat(60)).unwrap_err();
        assert!(many.lines().count() == 51 && many.ends_with("10 more mistakes"), "{many}");
        let error = jobs("a/j.toml", "[[jobs]]\nscene = \"a\"\n[[jobs]]\nsp = 5\n").unwrap_err();
        assert!(error.starts_with("a/j.toml:3") || error.starts_with("a/j.toml:4"), "{error}");
    }
}
