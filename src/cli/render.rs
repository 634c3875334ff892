//! `octray render`: a scene to a picture.

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime};

use clap::ValueEnum;
use clap::builder::PossibleValuesParser;
use octray::film::{Picture, Window};
use octray::measure::heatmap;
use octray::output::{Description, Options, description, png};
use octray::plan::{Skip, SkipSet};
use octray::render::{Engine, Stats};
use octray::scene::{Aov, Frames, Integrator, Scene, particles};
use octray::{Renderer, Rendering};

use super::Run;
use super::args::{self, EngineName, StatsFile, Threads};
use super::atoms::Atoms;
use super::exit::{Exit, Failure};
use super::frames::{self, FrameList};
use super::layers::{LayerArgs, Windows};
use super::pictures::{self, Depth, Target};
use super::preview::{Preview, Tev};
use super::progress::Bar;
use super::stats_json::{self, Seconds};
use super::{scene_file, system};

/// Memory that a pixel takes at the most, in bytes: its value in its block and in the picture while blocks are
/// put together, or in the picture, as samples of the file and in the file (measured, rounded up).
const PIXEL_BYTES: u64 = 40;

const EXAMPLES: &str = "\
Examples:
  octray render fig5.toml                                    writes fig5.exr here
  octray render fig5.toml -o fig5.png --bits 16              a picture to look at
  octray render fig5.toml -o draft.png --resolution 320x240 --spp 1
  octray render fig5.toml -o part.exr --crop 100,100,200,200 --stats part.json
  octray render fig5.toml -o slow.exr --engine reference     by the f64 reference
  octray render protein.pdb -o protein.png                   atoms, without a scene
  octray render water.xyz.gz --frames 1-100 --out-dir out    out/water.0001.exr and so on
  octray render fig5.toml -o - -q | oiiotool - -o fig5.tif   EXR to standard output";

/// Arguments of `octray render`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Scene file (.toml, .nff, .nff.gz), or atoms (.xyz, .lammpstrj, .data, .pdb, .sdf, ... or with .gz)
    scene: PathBuf,
    /// Picture to write, .exr or .png; - is EXR to standard output; #### stands for the frame's number [default: the
    /// scene's name with .exr, here]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Directory for the pictures, made where it is missing: the scene's name with .####.exr
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    out_dir: Option<PathBuf>,
    /// Frames of an animation or trajectory: 1-100, 1-100x2 (every second one), 1,5,10-20 [default: 1]
    #[arg(long, value_name = "LIST", value_parser = frames::list, allow_hyphen_values = true)]
    frames: Option<FrameList>,
    /// Camera of the scene, by its name [default: the first one]
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// Pixels of the whole picture [default: as in the scene]
    #[arg(long, value_name = "WxH", value_parser = args::resolution)]
    resolution: Option<(u32, u32)>,
    #[command(flatten)]
    windows: Windows,
    #[command(flatten)]
    layers: LayerArgs,
    /// Let rays that meet nothing be transparent: alpha 0, and no more pixels in an EXR than those that show something
    #[arg(long, value_name = "KIND", value_parser = ["transparent"])]
    background: Option<String>,
    /// Samples per pixel [default: as in the scene]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: Option<u32>,
    /// How light is found [default: as in the scene]
    #[arg(long, value_enum, value_name = "NAME")]
    integrator: Option<IntegratorName>,
    /// Longest chain of rays, the camera ray being 1 [default: as in the scene]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    max_depth: Option<u32>,
    /// Who finds what rays meet
    #[arg(long, value_enum, value_name = "NAME", default_value_t)]
    engine: EngineName,
    #[command(flatten)]
    threads: Threads,
    /// Seed of the sample pattern [default: as in the scene]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Show the picture in the tev viewer while it is rendered, such as at 127.0.0.1:14158
    #[arg(long, value_name = "HOST:PORT")]
    tev: Option<String>,
    #[command(flatten)]
    stats: StatsFile,
    /// Do all the work, needed or not, or that of some kinds (as `octray info` names them): the same picture to the bit
    #[arg(long, value_name = "NAME,...", num_args = 0..=1, require_equals = true, value_delimiter = ',',
        default_missing_value = "all", value_parser = skip_names())]
    no_skip: Vec<String>,
    #[command(flatten)]
    depth: Depth,
    /// Leave out of the file what differs from run to run (date, seconds, threads); so does SOURCE_DATE_EPOCH
    #[arg(long)]
    no_date: bool,
    #[command(flatten)]
    atoms: Atoms,
}

/// Integrators by their names in scene files.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum IntegratorName {
    /// Direct light with mirror reflection and refraction
    Direct,
}

impl From<IntegratorName> for Integrator {
    fn from(name: IntegratorName) -> Integrator {
        match name {
            IntegratorName::Direct => Integrator::Direct,
        }
    }
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    run.warn_of_build();
    args.threads.rule();
    let list = args.frames.as_ref().map_or(&[1][..], |list| &list.0);
    let many = list.len() > 1;
    let name = args.output_name()?;
    let outputs: Vec<PathBuf> =
        list.iter().map(|frame| frames::output(&name, *frame, many)).collect::<Result<_, _>>()?;
    if many && args.stats.stats.is_some() {
        return Err(Failure::new(Exit::Usage, "--stats is about one frame: leave it out, or --frames"));
    }
    let mut scenes = scene_file::frames(&args.scene, &args.atoms, args.resolution)?;
    if !many {
        return render(args, &mut scenes, list[0], outputs[0].clone(), run);
    }
    let mut failed = Vec::new();
    for (frame, output) in list.iter().zip(outputs) {
        if let Err(failure) = render(args, &mut scenes, *frame, output, run) {
            run.console.error(&failure.message);
            // What no other frame would do better ends it all.
            if matches!(failure.exit, Exit::Usage | Exit::Cpu) {
                return Ok(failure.exit);
            }
            failed.push(frame.to_string());
        }
    }
    match failed.len() {
        0 => Ok(Exit::Done),
        count => {
            let text = format!("{count} of {} frames failed: {}", list.len(), failed.join(", "));
            Err(Failure::new(Exit::No, text).of(&args.scene))
        }
    }
}

/// Renders one frame.
fn render(args: &Args, scenes: &mut Frames, frame: i64, output: PathBuf, run: &Run) -> Result<Exit, Failure> {
    let start = Instant::now();
    let target = Target::new(&output, &[&args.scene], run)?;
    let options = args.depth.options(&target, run)?;
    if let Some(stats) = &args.stats.stats {
        if *stats == output {
            return Err(Failure::new(Exit::Usage, format!("{}: both the picture and --stats", stats.display())));
        }
        run.check_output(stats, &[&args.scene])?;
    }
    let loaded = scene_file::load(scenes, &args.scene, frame, run)?;
    let mut scene = loaded.scene;
    scene_file::resize(&mut scene, args.resolution);
    if args.background.is_some() {
        scene.background.transparent = true;
    }
    if let Some(name) = args.integrator {
        scene.render.integrator = name.into();
    }
    let next = args.next_frame(scenes, frame, &scene, run)?;
    let mut renderer = args.renderer(&scene)?;
    if let Some(next) = &next {
        renderer = renderer.next_frame(next);
    }
    let image = renderer.image();
    let window = renderer.window()?;
    let work = format!("a picture of {}x{} pixels", window.width(), window.height());
    scene_file::need_memory(&scene, PIXEL_BYTES.saturating_mul(window.area() as u64), &work)?;
    if args.output.is_none() && args.out_dir.is_none() {
        run.console.note(&format!("octray: no -o given: the picture goes to {target}"));
    }

    let bar = Bar::new(run, format!("{target}"));
    let write = |unfinished: &Rendering| args.write_unfinished(unfinished, &renderer, &target, options, frame, run);
    let preview = Preview::new(run, bar, args.tev(&target, window, run), &write);
    let mut rendering = renderer.render(&preview)?;
    preview.finish();
    if scene.background.transparent && !args.windows.is_crop() && target.is_exr() {
        rendering.picture.trim();
    }
    let stats = &rendering.stats;
    let writing = Instant::now();
    let picture = args.description(&renderer, stats, frame);
    pictures::write(&rendering.picture, &target, options, &picture, run)?;
    let seconds = Seconds {
        load: loaded.seconds,
        plan: stats.plan_seconds,
        build: stats.build_seconds,
        trace: stats.trace_seconds,
        write: writing.elapsed().as_secs_f64(),
    };
    args.write_stats(&rendering, &seconds, run)?;
    args.write_cost(&rendering.picture, &target, run)?;
    run.console.note(&summary(&rendering, image.spp, &target, start));
    Ok(Exit::Done)
}

impl Args {
    /// The name of the picture, with a place for the frame's number where there is one.
    fn output_name(&self) -> Result<PathBuf, Failure> {
        let name = self.output.clone().unwrap_or_else(|| default_output(&self.scene));
        let Some(folder) = &self.out_dir else { return Ok(name) };
        std::fs::create_dir_all(folder).map_err(|error| Failure::output(folder, &error))?;
        let name = if self.frames.is_some() { name.with_extension("####.exr") } else { name };
        Ok(folder.join(name))
    }

    /// The scene that motion leads to, where that is asked for and anything moves.
    fn next_frame(&self, scenes: &mut Frames, frame: i64, now: &Scene, run: &Run) -> Result<Option<Scene>, Failure> {
        if !self.layers.layers(now)?.has(Aov::Motion) {
            return Ok(None);
        }
        let next = scenes.scene(frame + 1);
        let told = |errors| run.console.warn(&format!("motion is 0: there is no frame {}: {errors}", frame + 1));
        Ok(next.map_err(told).ok())
    }

    fn renderer<'s>(&self, scene: &'s Scene) -> Result<Renderer<'s>, Failure> {
        let mut renderer =
            Renderer::new(scene)?.threads(self.threads.count()).skips(self.skips()).engine(Engine::from(self.engine));
        if let Some(name) = &self.camera {
            renderer = renderer.camera(name)?;
        }
        if let Some(spp) = self.spp {
            renderer = renderer.spp(spp);
        }
        if let Some(depth) = self.max_depth {
            renderer = renderer.max_depth(depth);
        }
        if let Some(seed) = self.seed {
            renderer = renderer.seed(seed);
        }
        Ok(self.windows.apply(renderer).layers(self.layers.layers(scene)?))
    }

    /// What may be left out.
    fn skips(&self) -> SkipSet {
        let without = |set: SkipSet, name: &String| Skip::named(name).map_or(SkipSet::NONE, |skip| set.without(skip));
        self.no_skip.iter().fold(SkipSet::ALL, without)
    }

    fn description(&self, renderer: &Renderer, stats: &Stats, frame: i64) -> Description {
        let run = description::Run {
            date: SystemTime::now(),
            seconds: stats.plan_seconds + stats.build_seconds + stats.trace_seconds,
            threads: u32::try_from(stats.threads).unwrap_or(u32::MAX),
            rays: Some(total_rays(stats).to_string()),
            shard: None,
        };
        let dated = !self.no_date && std::env::var_os("SOURCE_DATE_EPOCH").is_none();
        Description {
            scene: self.scene.file_name().map(|name| name.to_string_lossy().into_owned()),
            scene_hash: Some(renderer.scene_hash()),
            camera: Some(renderer.view().clone()),
            spp: Some(renderer.image().spp),
            seed: Some(renderer.pattern()),
            frame: self.frames.is_some().then(|| i32::try_from(frame).ok()).flatten(),
            run: dated.then_some(run),
            ..Description::default()
        }
    }

    /// The viewer that the user asked for. A render goes on without one that does not answer.
    fn tev(&self, target: &Target, window: Window, run: &Run) -> Option<Tev> {
        let host = self.tev.as_deref()?;
        let opened = Tev::open(host, &target.to_string(), window);
        let told = |error: io::Error| run.console.warn(&format!("--tev {host}: {error}: rendering without a viewer"));
        opened.map_err(told).ok()
    }

    /// Writes what there is so far beside the target, whose own name stays that of a whole picture.
    fn write_unfinished(
        &self,
        unfinished: &Rendering,
        renderer: &Renderer,
        target: &Target,
        options: Options,
        frame: i64,
        run: &Run,
    ) {
        let name = target.beside(if target.is_exr() { "partial.exr" } else { "partial.png" });
        let name = name.unwrap_or_else(|| PathBuf::from("octray.partial.exr"));
        let description = self.description(renderer, &unfinished.stats, frame);
        let written = Target::new(&name, &[&self.scene], run)
            .and_then(|target| pictures::write(&unfinished.picture, &target, options, &description, run));
        match written {
            Ok(()) => run.console.note(&format!("{}: the picture so far", name.display())),
            Err(failure) => run.console.warn(&failure.message),
        }
    }

    /// Draws the cost layer beside the picture.
    fn write_cost(&self, picture: &Picture, target: &Target, run: &Run) -> Result<(), Failure> {
        let Some(name) = target.beside("cost.png").filter(|_| self.layers.cost) else { return Ok(()) };
        let tests = |name: &str| picture.channel(name).and_then(|channel| channel.samples.floats()).unwrap_or_default();
        let pairs = tests("cost.box").iter().zip(tests("cost.prim"));
        let values: Vec<f64> = pairs.map(|(boxes, prims)| f64::from(*boxes) + f64::from(*prims)).collect();
        let map = heatmap::map_of(&values, picture.window).map_err(|error| Failure::new(Exit::Output, error))?;
        let bytes = png::encode_raster(&map, "Box and primitive tests of each pixel")
            .map_err(|error| Failure::new(Exit::Output, error))?;
        pictures::write_bytes(&name, &bytes, run)?;
        run.console.note(&format!("{}: box and primitive tests of each pixel", name.display()));
        Ok(())
    }

    fn write_stats(&self, rendering: &Rendering, seconds: &Seconds, run: &Run) -> Result<(), Failure> {
        let Some(path) = &self.stats.stats else { return Ok(()) };
        let work = &rendering.stats;
        let mut stats = stats_json::common(run, work.threads, seconds);
        stats_json::add_render(&mut stats, work, self.engine == EngineName::Reference);
        stats_json::add_memory(&mut stats, work.column_bytes, work.tree_bytes);
        stats_json::add_names(&mut stats, &rendering.names);
        stats_json::write(path, stats, run)
    }
}

/// Kinds of work that may be left out, and all of them.
fn skip_names() -> PossibleValuesParser {
    PossibleValuesParser::new(std::iter::once("all").chain(Skip::names()))
}

/// The scene's name with another ending, in the directory that the command was called from.
fn default_output(scene: &Path) -> PathBuf {
    let name = scene.file_name().unwrap_or_default().to_string_lossy();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    let stem = if is_scene(scene) { name.rsplit_once('.').map(|(stem, _)| stem) } else { None };
    PathBuf::from(format!("{}.exr", stem.unwrap_or(name)))
}

/// Whether a name ends as those of scenes and of atoms do.
fn is_scene(path: &Path) -> bool {
    let name = path.to_string_lossy().to_lowercase();
    [".toml", ".nff", ".nff.gz"].iter().any(|ending| name.ends_with(ending)) || particles::Format::of(path).is_some()
}

fn total_rays(stats: &Stats) -> u64 {
    stats.rays.rays.iter().sum()
}

fn summary(rendering: &Rendering, spp: u32, target: &Target, start: Instant) -> String {
    let (window, stats) = (rendering.picture.window, &rendering.stats);
    let (millions, seconds) = (total_rays(stats) as f64 / 1e6, stats.trace_seconds);
    format!(
        "{target}: {}x{} pixels, {spp} spp, {millions:.2} million rays in {seconds:.2} s ({:.1} Mrays/s), {:.2} s in all, {}",
        window.width(),
        window.height(),
        millions / seconds.max(1e-9),
        start.elapsed().as_secs_f64(),
        system::peak_bytes().map_or_else(|| "done".to_owned(), |bytes| format!("{} of memory", system::size(bytes))),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_output_is_named_after_the_scene() {
        let names = ["scenes/fig5.toml", "balls.nff.gz", "../a.b.nff", "odd", "water.xyz.gz"]
            .map(|name| default_output(Path::new(name)));
        assert_eq!(
            names.map(|name| name.display().to_string()),
            ["fig5.exr", "balls.exr", "a.b.exr", "odd.exr", "water.exr"]
        );
    }
}
