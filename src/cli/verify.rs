//! `octray verify`: does a picture hold what its header says, and does rendering again give the same?

use std::path::{Path, PathBuf};

use clap::Parser;
use octray::batch::{self, Job, Options, Overscan, Sources, View};
use octray::film::{Picture, Window};
use octray::output::{self, Contents, Format};
use serde_json::json;

use super::Run;
use super::args::Threads;
use super::exit::{Exit, Failure};
use super::progress::Teller;
use super::settings::Settings;
use super::{jobs, scene_file};

const EXAMPLES: &str = "\
Examples:
  octray verify out/turn.0012.exr                      its scene lies beside it, here, or in scenes/
  octray verify fig5.exr elsewhere/fig5.toml --json
  octray verify fig5.exr --file-only                   only whether the file is as it was written";

/// Arguments of `octray verify`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    long_about = "Confirm a picture by rendering it again\n\n\
        An EXR file of octray states a hash of its samples. First the samples must have that hash. Then the scene, whose \
        hash must be the one that is stated, is rendered again with the settings, size, window and frame that the header \
        states, and all samples of all layers must come out the same. Ends with 1 where a hash is another one. A build for \
        another SIMD level (octray --version) gives other last bits."
)]
pub struct Args {
    /// Picture, EXR
    image: PathBuf,
    /// Its scene [default: what the header names, beside the picture, here, or in scenes/ here]
    scene: Option<PathBuf>,
    /// Do not render again
    #[arg(long)]
    file_only: bool,
    #[command(flatten)]
    threads: Threads,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// The words of `render/settings`.
#[derive(Debug, Parser)]
#[command(no_binary_name = true)]
struct Recalled {
    #[arg(long)]
    camera: Option<String>,
    #[command(flatten)]
    settings: Settings,
}

/// What came of it.
struct Verdict {
    stored: String,
    found: String,
    again: Option<Again>,
}

/// The picture rendered again.
enum Again {
    /// Not at all: the scene has another hash than the header states.
    Other { path: PathBuf, stored: String, found: String },
    /// With this hash, and so many pixels in which colour or a layer differs.
    Rendered { path: PathBuf, hash: String, pixels: usize },
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    run.warn_of_build();
    args.threads.rule();
    let contents = output::read_all(&args.image)?;
    let Some(pair) = contents.pixel_hash.clone() else {
        let text = "states no hash of its samples: only EXR files written by octray do";
        return Err(Failure::new(Exit::Input, text).of(&args.image));
    };
    let mut verdict = Verdict { stored: pair.stored, found: pair.found, again: None };
    if verdict.stored == verdict.found && !args.file_only {
        verdict.again = Some(args.again(&contents, run)?);
    }
    let pass = verdict.pass();
    if args.json {
        run.console.print_json(&verdict.json(pass))?;
    } else {
        run.console.print(&format!("{}: {}\n", args.image.display(), verdict.text()))?;
    }
    Ok(if pass { Exit::Done } else { Exit::No })
}

impl Verdict {
    fn pass(&self) -> bool {
        let same = match &self.again {
            None => true,
            Some(Again::Other { .. }) => false,
            Some(Again::Rendered { hash, .. }) => *hash == self.stored,
        };
        self.stored == self.found && same
    }

    fn text(&self) -> String {
        let stored = &self.stored;
        match &self.again {
            _ if *stored != self.found => {
                format!("damaged: the header states {stored}, the samples have {}", self.found)
            }
            None => format!("the samples have the hash that the header states, {stored}"),
            Some(Again::Other { path, stored, found }) => format!(
                "not confirmed: {} and the settings that the header states have the hash {found}, and not {stored}: the \
                 scene has changed, or the picture was seen from a camera that is not the scene's",
                path.display()
            ),
            Some(Again::Rendered { path, hash, .. }) if hash == stored => {
                format!("confirmed: rendering {} again gives the same samples, {hash}", path.display())
            }
            Some(Again::Rendered { path, hash, pixels }) => format!(
                "not confirmed: rendering {} again gives {hash} instead of {stored}; {pixels} pixels differ",
                path.display()
            ),
        }
    }

    fn json(&self, pass: bool) -> serde_json::Value {
        let (mut scene, mut hashes, mut rendered, mut pixels) = (None, None, None, None);
        match &self.again {
            None => {}
            Some(Again::Other { path, stored, found }) => {
                (scene, hashes) = (Some(path), Some(json!({ "stored": stored, "found": found })));
            }
            Some(Again::Rendered { path, hash, pixels: count }) => {
                (scene, rendered, pixels) = (Some(path), Some(hash), Some(count));
            }
        }
        json!({
            "schema": 1,
            "pass": pass,
            "stored": self.stored,
            "found": self.found,
            "scene": scene.map(|path| path.display().to_string()),
            "scene_hash": hashes,
            "rendered": rendered,
            "different_pixels": pixels,
        })
    }
}

impl Args {
    fn again(&self, contents: &Contents, run: &Run) -> Result<Again, Failure> {
        let path = self.scene_path(contents)?;
        let room = tempfile::tempdir().map_err(|error| Failure::output(&std::env::temp_dir(), &error))?;
        let job = self.job(contents, &path, &room.path().join("again.exr"))?;
        let stored = text(contents, "render/sceneHash").unwrap_or_default();
        let sources = Sources::default();
        let found = hash(&job, &sources, run)?;
        if stored != found {
            return Ok(Again::Other { path, stored, found });
        }
        let options = Options { threads: self.threads.count(), ..Options::default() };
        let mut teller = Teller::new(run, None, None, true, 1, false);
        let work = || batch::run(std::slice::from_ref(&job), &options, &sources, &teller);
        let summary = run.signals.graceful(work)?;
        teller.end(&summary);
        if summary.cancelled {
            run.signals.end();
        }
        if let Some((_, error)) = summary.failed.into_iter().next() {
            return Err(jobs::failure(error, run.console.color));
        }
        let again = output::read_all(&job.output)?;
        let pixels = differing(&again.picture, &contents.picture);
        Ok(Again::Rendered { path, hash: again.pixel_hash.map_or_else(String::new, |pair| pair.found), pixels })
    }

    /// The job that the header states.
    fn job(&self, contents: &Contents, scene: &Path, output: &Path) -> Result<Job, Failure> {
        let words = text(contents, "render/settings").unwrap_or_default();
        let recalled = shlex::split(&words).and_then(|words| Recalled::try_parse_from(words).ok());
        let Some(Recalled { camera, settings }) = recalled else {
            let text = format!("its render/settings are none that this version knows: {words}");
            return Err(Failure::new(Exit::Input, text).of(&self.image));
        };
        let mut job = settings.job(scene.to_owned())?;
        (job.output, job.format) = (output.to_owned(), Format::Exr);
        job.settings.options.exr = contents.storage.unwrap_or_default();
        job.settings.undated = true;
        job.view = camera.map_or(View::First, View::Named);
        job.frame = text(contents, "render/frame").and_then(|frame| frame.parse().ok());
        let Picture { display, window, .. } = contents.picture;
        job.settings.resolution = Some(display);
        job.settings.windows.crop = Some(window);
        job.settings.windows.overscan = Some(Overscan::Pixels(beyond(window, display)));
        let number = |name: &str| text(contents, name).and_then(|text| text.parse().ok());
        job.settings.seed = number("render/seed").or(job.settings.seed);
        if job.settings.noise.is_none() {
            job.settings.spp = number("render/spp").and_then(|spp| u32::try_from(spp).ok()).or(job.settings.spp);
        }
        Ok(job)
    }

    fn scene_path(&self, contents: &Contents) -> Result<PathBuf, Failure> {
        if let Some(path) = &self.scene {
            return Ok(path.clone());
        }
        let name = text(contents, "render/scene");
        let beside = self.image.parent().unwrap_or(Path::new(""));
        let places =
            name.iter().flat_map(|name| [beside.join(name), PathBuf::from(name), Path::new("scenes").join(name)]);
        places.into_iter().find(|path| path.is_file()).ok_or_else(|| {
            let text = match &name {
                Some(name) => {
                    format!("its scene {name} is neither beside it nor here nor in scenes/: octray verify IMAGE SCENE")
                }
                None => "its header names no scene: octray verify IMAGE SCENE".to_owned(),
            };
            Failure::new(Exit::Input, text).of(&self.image)
        })
    }
}

fn text(contents: &Contents, name: &str) -> Option<String> {
    contents.attributes.as_ref()?.text(name)
}

/// The hash of the job's scene and settings.
fn hash(job: &Job, sources: &Sources, run: &Run) -> Result<String, Failure> {
    let loaded = sources.load(sources.ticket(job));
    let (shared, _) = loaded.map_err(|errors| scene_file::failure(&job.scene, &errors, run.console.color))?;
    let renderer = job.renderer(&shared.scene).map_err(|error| Failure::from(error).of(&job.scene))?;
    let next = (renderer.settings().shutter > 0.0).then(|| Job { frame: Some(job.frame() + 1), ..job.clone() });
    let next = next.and_then(|next| sources.load(sources.ticket(&next)).ok());
    Ok(shared.picture_hash(&renderer, next.as_ref().map(|(next, _)| &**next)))
}

/// How far a window reaches beyond the picture, at most.
fn beyond(window: Window, (width, height): (u32, u32)) -> u32 {
    let [width, height] = [width, height].map(i64::from);
    let Window { x0, y0, x1, y1 } = window;
    let [x0, y0, x1, y1] = [x0, y0, x1, y1].map(i64::from);
    let most = [-x0, -y0, x1 - width, y1 - height].into_iter().fold(0, i64::max);
    u32::try_from(most).unwrap_or(u32::MAX)
}

/// In how many pixels the colours or any of the layers differ; all of them where there are other layers.
fn differing(a: &Picture, b: &Picture) -> usize {
    let names = |picture: &Picture| picture.channels.iter().map(|channel| channel.name.clone()).collect::<Vec<_>>();
    if a.window != b.window || names(a) != names(b) {
        return b.pixels.len();
    }
    let color = |i: usize| a.pixels[i].map(f32::to_bits) != b.pixels[i].map(f32::to_bits);
    let layers = |i: usize| a.channels.iter().zip(&b.channels).any(|(a, b)| a.samples.bits(i) != b.samples.bits(i));
    (0..a.pixels.len()).filter(|i| color(*i) || layers(*i)).count()
}
