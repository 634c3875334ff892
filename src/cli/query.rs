//! `octray query`: what the rays of a file meet.

use std::path::PathBuf;
use std::time::Instant;

use octray::render::Engine;
use octray::{Batch, Query};
use serde_json::json;

use super::Run;
use super::args::{EngineName, StatsFile, Threads};
use super::exit::{Exit, Failure};
use super::scene_file::Moment;
use super::stats_json::{self, Seconds};
use super::{hits, pictures, scene_file, system};

/// Memory that a ray takes at the most, in bytes: as numbers, as a ray, its hit, and that in the file.
const RAY_BYTES: u64 = 200;

const EXAMPLES: &str = "\
Examples:
  octray query fig5.toml rays.npy -o hits.npy
  octray query fig5.toml rays.npy -o dark.npy --any
  octray query fig5.toml rays.npy -o hits.npy --repeat 5 --stats times.json";

/// Arguments of `octray query`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    long_about = "Trace the rays of a file and write what they meet\n\n\
        RAYS is a NumPy file of float32, N x 8: origin (3), t_min, direction (3), t_max; a ray is the points \
        origin + t direction with t_min < t <= t_max, in the coordinates of the scene. HITS gets N records: t, \
        primitive, material, normal (3, outward), uv (2), front; a miss has primitive -1 and t = inf. With \
        --any it gets N booleans: does the ray meet anything?"
)]
pub struct Args {
    /// Scene file (.toml, .nff, .nff.gz), or atoms (.xyz, .lammpstrj, .data, .pdb, .sdf, ... or with .gz)
    scene: PathBuf,
    /// Rays, .npy
    rays: PathBuf,
    /// File for the hits, .npy
    #[arg(short, long, value_name = "HITS.npy")]
    output: PathBuf,
    /// Who finds what rays meet
    #[arg(long, value_enum, value_name = "NAME", default_value_t)]
    engine: EngineName,
    /// Only whether a ray meets anything, as shadow rays ask
    #[arg(long)]
    any: bool,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    moment: Moment,
    /// Trace so many times over, for the clock; the median counts
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    repeat: u32,
    #[command(flatten)]
    stats: StatsFile,
}

/// Tracing by the clocks.
#[derive(Debug, Clone, Copy)]
struct Times {
    wall: f64,
    /// All threads together.
    cpu: Option<f64>,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    run.warn_of_build();
    let npy = args.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
    if !npy {
        return Err(Failure::new(Exit::Usage, "unknown kind of file: hits should go to a .npy file").of(&args.output));
    }
    run.check_output(&args.output, &[&args.scene, &args.rays])?;
    if let Some(stats) = &args.stats.stats {
        run.check_output(stats, &[&args.scene, &args.rays, &args.output])?;
    }
    let loaded = args.moment.load(&args.scene, None, run)?;
    let rays = hits::read_rays(&args.rays)?;
    let memory = RAY_BYTES.saturating_mul(rays.len() as u64);
    scene_file::need_memory(&loaded.scene, memory, &format!("the query of {} rays", rays.len()))?;

    let building = Instant::now();
    let query = Query::new(&loaded.scene, Engine::from(args.engine), args.threads.count())?;
    let build = building.elapsed().as_secs_f64();
    let (count, batch) = (rays.len(), Batch::new(rays));
    let (bytes, met, counts, times) = if args.any {
        let mut dark = vec![0; batch.tiles()];
        let (counts, times) = timed(args.repeat, || query.find_occluded(&batch, &mut dark));
        let answers = batch.unpack(&dark);
        (hits::bools_file(&answers), answers.iter().filter(|met| **met).count(), counts, times)
    } else {
        let mut answers = query.room(&batch);
        let (counts, times) = timed(args.repeat, || query.find_closest(&batch, &mut answers));
        let answers = query.hits(&batch, answers);
        (hits::hits_file(&answers), answers.iter().flatten().count(), counts, times)
    };
    let writing = Instant::now();
    pictures::write_bytes(&args.output, &bytes, run)?;
    let write = writing.elapsed().as_secs_f64();
    if let Some(path) = &args.stats.stats {
        let seconds = Seconds { load: loaded.seconds, plan: 0.0, build, trace: times.wall, write };
        let mut stats = stats_json::common(run, query.threads(), &seconds);
        let (columns, tree) = query.tracer().map_or((0, 0), |tracer| {
            let tree = tracer.tree();
            (tree.stores().column_bytes(), tree.bytes())
        });
        stats_json::add_memory(&mut stats, columns, tree);
        let Times { wall, cpu } = times;
        let query = json!({ "rays": count, "hits": met, "trace_seconds": wall, "trace_cpu_seconds": cpu });
        stats.insert("query".to_owned(), query);
        stats_json::add_tests(&mut stats, &counts);
        stats_json::write(path, stats, run)?;
    }
    let (millions, output) = (count as f64 / 1e6, args.output.display());
    let rate = millions / times.wall.max(1e-9);
    run.console.note(&format!(
        "{output}: {met} of {} rays met something, traced in {:.3} s ({rate:.1} Mrays/s)",
        count, times.wall
    ));
    Ok(Exit::Done)
}

/// Does something several times, and once before the clock starts: the last result and median times.
fn timed<T>(repeat: u32, mut trace: impl FnMut() -> T) -> (T, Times) {
    let mut result = None;
    if repeat > 1 {
        trace();
    }
    let mut once = || {
        let (start, cpu) = (Instant::now(), system::cpu_seconds());
        result = Some(trace());
        let cpu = system::cpu_seconds().zip(cpu).map(|(after, before)| after - before);
        (start.elapsed().as_secs_f64(), cpu)
    };
    let (wall, cpu): (Vec<f64>, Vec<Option<f64>>) = (0..repeat).map(|_| once()).unzip();
    let times = Times { wall: median(wall), cpu: cpu.into_iter().collect::<Option<_>>().map(median) };
    (result.expect("traced at least once"), times)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { values[middle - 1].midpoint(values[middle]) }
}
