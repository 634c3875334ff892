//! `octray bench`: throughput by the kind of ray. `octray bench gate` is in [`gate`].

use std::path::PathBuf;

use clap::{Subcommand, ValueEnum};
use octray::accel::Counts;
use octray::measure::bench::{BenchSettings, LEAST_REPEATS, RaySet, Supply, Throughput, bench, has_light};
use octray::plan::Kind;
use serde_json::{Map, Value, json};

use super::Run;
use super::args::{self, Threads};
use super::exit::{Exit, Failure};
use super::scene_file::{self, Moment};
use super::{cpu, gate, stats_json, system};

/// Memory that a ray takes at the most, in bytes: the sets, their columns and their hits.
const RAY_BYTES: u64 = 700;

const EXAMPLES: &str = "\
Examples:
  octray bench fig5.toml                        all kinds of rays, a table
  octray bench fig5.toml --rays bounce -t 1     one kind, one thread
  octray bench fig5.toml --json > today.json
  octray bench gate fig5.toml --against old/octray
  octray bench gate --help                      guard the speed of your scenes in your CI";

/// Arguments of `octray bench`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    long_about = "Measure how many rays a second a scene takes, by kind of ray\n\n\
        Camera rays go through the centres of the pixels in tiles of 8 x 8; shadow rays from what those met to the \
        first light at a place; bounce rays from there in cosine-distributed directions. All lie in memory in columns; \
        timed is finding t, primitive and normal and storing them, or for `any` one bit. Some rays of each set are \
        traced one by one first and must meet the same. One pass warms up; of the others the median counts. Rows marked \
        `own` use what a renderer knows: camera rays are made where they are traced (and that is timed), shadow rays \
        start at the light."
)]
pub struct Args {
    /// Scene file (.toml, .nff, .nff.gz), or atoms (.xyz, .lammpstrj, .data, .pdb, .sdf, ... or with .gz)
    #[arg(required = true)]
    scene: Option<PathBuf>,
    /// Kind of rays
    #[arg(long, value_enum, value_name = "KIND", default_value_t)]
    rays: Kinds,
    /// Repetitions that are timed, at least 5; the median counts
    #[arg(long, value_name = "N", default_value_t = LEAST_REPEATS, value_parser = clap::value_parser!(u32).range(5..=1000))]
    repeat: u32,
    /// Pixels of the whole picture, one camera ray each [default: as in the scene]
    #[arg(long, value_name = "WxH", value_parser = args::resolution)]
    resolution: Option<(u32, u32)>,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    moment: Moment,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
    #[command(subcommand)]
    command: Option<Sub>,
}

#[derive(Debug, Subcommand)]
enum Sub {
    /// Compare work, time and error of this build with a baseline or another build; exit 1 where they got worse
    Gate(gate::Args),
}

/// Kinds of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum Kinds {
    /// Through the pixels
    Camera,
    /// To a light
    Shadow,
    /// Off diffuse surfaces
    Bounce,
    /// One after the other
    #[default]
    All,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    match (&args.command, &args.scene) {
        (Some(Sub::Gate(gate)), _) => gate::run(gate, run),
        (None, Some(scene)) => measure(args, scene, run),
        (None, None) => Err(Failure::new(Exit::Usage, "bench takes a scene: octray bench SCENE")),
    }
}

fn measure(args: &Args, path: &std::path::Path, run: &Run) -> Result<Exit, Failure> {
    run.warn_of_build();
    let mut scene = args.moment.load(path, args.resolution, run)?.scene;
    scene_file::resize(&mut scene, args.resolution);
    let pixels = scene.image.as_ref().map_or(0, |image| u64::from(image.width) * u64::from(image.height));
    scene_file::need_memory(&scene, RAY_BYTES.saturating_mul(pixels), &format!("a bench of {pixels} rays"))?;
    let sets = match args.rays {
        Kinds::Camera => vec![RaySet::Camera],
        Kinds::Shadow => vec![RaySet::Shadow],
        Kinds::Bounce => vec![RaySet::Bounce],
        Kinds::All if has_light(&scene) => RaySet::ALL.to_vec(),
        Kinds::All => {
            run.console.note(&format!("{}: no light at a place, so there are no shadow rays", path.display()));
            vec![RaySet::Camera, RaySet::Bounce]
        }
    };
    let settings = BenchSettings { sets, threads: args.threads.count(), repeats: args.repeat, resolution: None };
    if args.json {
        let figures = bench(&scene, &settings, &mut |_| ())?;
        let rays: Vec<Value> = figures.iter().map(figure_json).collect();
        let threads = figures.first().map_or(0, |figure| figure.threads);
        run.console.print_json(&json!({
            "schema": 1, "octray": env!("CARGO_PKG_VERSION"), "simd": cpu::SIMD, "cpu": system::cpu_model(), "threads": threads,
            "scene": path.display().to_string(), "repeats": args.repeat, "rays": rays,
        }))?;
        return Ok(Exit::Done);
    }
    run.console.print(&header(path, args))?;
    let mut told = Ok(());
    bench(&scene, &settings, &mut |figure| {
        if told.is_ok() {
            told = run.console.print(&row(figure));
        }
    })?;
    told.map(|()| Exit::Done)
}

fn header(path: &std::path::Path, args: &Args) -> String {
    let (path, repeats, cpu) = (path.display(), args.repeat, system::cpu_model());
    let page = format!("{path}: median of {repeats} after one to warm up, on {cpu}\n");
    let names = ["Mrays/s", "Mrays/CPU s", "spread", "threads", "rays", "met", "boxes/ray", "tests/ray"];
    page + &line("rays", &names.map(str::to_owned))
}

fn row(figure: &Throughput) -> String {
    let own = if figure.supply == Supply::Own { " own" } else { "" };
    let name = format!("{} {}{own}", figure.set.name(), figure.question.name());
    let cpu = figure.mrays_per_cpu_s.map_or_else(|| "-".to_owned(), |rate| format!("{rate:.1}"));
    let by_ray = |tests: u64| format!("{:.2}", tests as f64 / figure.rays.max(1) as f64);
    let Counts { boxes, kinds, .. } = &figure.tests;
    let cells = [
        format!("{:.1}", figure.mrays_per_s),
        cpu,
        format!("{:.1} %", 100.0 * figure.spread),
        figure.threads.to_string(),
        figure.rays.to_string(),
        format!("{:.1} %", 100.0 * figure.hits as f64 / figure.rays.max(1) as f64),
        by_ray(*boxes),
        by_ray(Kind::ALL.iter().map(|kind| kinds[*kind as usize]).sum()),
    ];
    line(&name, &cells)
}

/// A line of the table.
fn line(name: &str, cells: &[String; 8]) -> String {
    let cells: String = cells.iter().map(|cell| format!(" {cell:>11}")).collect();
    format!("{name:<19}{cells}\n")
}

fn figure_json(figure: &Throughput) -> Value {
    let source = match figure.supply {
        Supply::Stored => "stored",
        Supply::Own => "own",
    };
    let mut json = Map::new();
    let mut set = |name: &str, value: Value| json.insert(name.to_owned(), value);
    set("kind", json!(figure.set.name()));
    set("query", json!(figure.question.name()));
    set("source", json!(source));
    set("threads", json!(figure.threads));
    set("mrays_per_s", json!(figure.mrays_per_s));
    set("mrays_per_cpu_s", json!(figure.mrays_per_cpu_s));
    set("spread", json!(figure.spread));
    set("rays", json!(figure.rays));
    set("hits", json!(figure.hits));
    stats_json::add_tests(&mut json, &figure.tests);
    Value::Object(json)
}
