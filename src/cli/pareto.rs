//! `octray pareto`: run time against error.

use std::path::{Path, PathBuf};

use octray::measure::pareto::{ParetoSettings, Point, Sweep, csv, page, sweep};

use super::Run;
use super::args::{self, Threads};
use super::exit::{Exit, Failure};
use super::scene_file::{self, Moment};
use super::{pictures, system};

const EXAMPLES: &str = "\
Examples:
  octray pareto scenes/fig5.toml                      writes pareto/index.html, points.csv and plots
  octray pareto a.toml b.toml --time-budget 300 --out-dir report
  octray pareto a.toml --resolution 256x256 -t 1";

/// Arguments of `octray pareto`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    long_about = "Measure run time against error\n\n\
        Each scene is rendered in many ways: with 1, 2, 4, ... samples per pixel, to noise levels, by packets, by single rays and by the f64 \
        reference, without certification, with other filters, and with its spheres cut into about 1,000 and 10,000 triangles. CPU and wall seconds, RMSE, \
        relative MSE and the largest error, all against a converged picture, go to a CSV file, to plots, and to one page \
        for a browser that needs no other file. The front is marked: what nothing else beats in both time and error."
)]
pub struct Args {
    /// Scene files
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Seconds that each scene may take, about
    #[arg(long, value_name = "S", default_value = "60", value_parser = args::limit)]
    time_budget: f64,
    /// Directory for index.html, points.csv and the plots, made where it is missing
    #[arg(long, value_name = "DIR", default_value = "pareto")]
    out_dir: PathBuf,
    /// Pixels of the whole picture [default: as in the scene]
    #[arg(long, value_name = "WxH", value_parser = args::resolution)]
    resolution: Option<(u32, u32)>,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    moment: Moment,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    run.warn_of_build();
    std::fs::create_dir_all(&args.out_dir).map_err(|error| Failure::output(&args.out_dir, &error))?;
    run.check_output(&args.out_dir.join("index.html"), &[])?;
    let settings = ParetoSettings { seconds: args.time_budget, threads: args.threads.count() };
    let mut sweeps = Vec::new();
    for path in &args.scenes {
        let mut scene = args.moment.load(path, args.resolution, run)?.scene;
        scene_file::resize(&mut scene, args.resolution);
        scene_file::need_memory(&scene, 0, "the sweep of this scene")?;
        let name = path.file_stem().map_or_else(|| path.display().to_string(), |stem| stem.to_string_lossy().into());
        let tell = &mut |point: &Point| run.console.note(&line(&name, point));
        sweeps.push(sweep(&name, &scene, &settings, tell)?);
    }
    write(args, &sweeps, run)?;
    run.console.print(&fronts(&sweeps))?;
    run.console.note(&format!("{}: the report, for a browser", args.out_dir.join("index.html").display()));
    Ok(Exit::Done)
}

fn write(args: &Args, sweeps: &[Sweep], run: &Run) -> Result<(), Failure> {
    let put = |name: &Path, text: &str| pictures::write_bytes(&args.out_dir.join(name), text.as_bytes(), run);
    put(Path::new("points.csv"), &csv(sweeps))?;
    for (index, sweep) in sweeps.iter().enumerate() {
        // Two scenes may have one name.
        let twice = sweeps[..index].iter().any(|other| other.name == sweep.name);
        let stem = if twice { format!("{}-{}", sweep.name, index + 1) } else { sweep.name.clone() };
        for (kind, chart) in sweep.charts() {
            put(Path::new(&format!("{stem}.{kind}.svg")), &chart.svg())?;
        }
    }
    put(Path::new("index.html"), &page(sweeps, &system::cpu_model()))
}

fn line(scene: &str, point: &Point) -> String {
    let Point { series, spp, seconds, rmse, .. } = point;
    format!("{scene}: {series}, {spp} spp: {seconds:.4} s, RMSE {rmse:.3e}")
}

fn fronts(sweeps: &[Sweep]) -> String {
    let mut text = String::new();
    for sweep in sweeps {
        text += &format!("{}: the front (against {} spp)\n", sweep.name, sweep.converged_spp);
        text += &format!(
            "{:<28} {:>6} {:>10} {:>10} {:>10} {:>10}\n",
            "how", "spp", "CPU s", "RMSE", "rel. MSE", "largest"
        );
        let mut front: Vec<&Point> = sweep.points.iter().filter(|point| point.front).collect();
        front.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        for Point { series, spp, seconds, rmse, rel_mse, max, .. } in front {
            text += &format!("{series:<28} {spp:>6} {seconds:>10.4} {rmse:>10.2e} {rel_mse:>10.2e} {max:>10.2e}\n");
        }
        sweep.left_out.iter().for_each(|line| text += &format!("left out: {line}\n"));
    }
    text
}
