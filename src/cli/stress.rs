//! `octray stress`: what f32 is bad at.

use std::path::PathBuf;

use octray::measure::stress::{StressSettings, names, plot, stress};

use super::Run;
use super::args::Threads;
use super::exit::{Exit, Failure};

const EXAMPLES: &str = "\
Examples:
  octray stress                                   every family, a minute or two
  octray stress --family sphere --seed 7          families whose name holds a word, other shapes and rays
  octray stress --json --plot stress.svg          for a machine, and to look at";

/// Arguments of `octray stress`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    long_about = "Run the numerical stress families\n\n\
        Scenes and rays that f32 is bad at, on every engine, against numbers of 320 bits. Engines: f32 (the kernels \
        alone, not judged), packet, single, reference. Ends with 1 where a bound is not kept: no wrong answer that f64 \
        could have told, no NaN, t within 1 ulp, within 4 times (99 %: 2 times) the error that f32 cannot avoid, \
        normals within 4 times theirs."
)]
pub struct Args {
    /// Only families whose name holds this
    #[arg(long, value_name = "NAME")]
    family: Option<String>,
    /// Other shapes and rays of the same families
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Rays of each value of a family's parameter
    #[arg(long, value_name = "N", default_value_t = 480, value_parser = clap::value_parser!(u32).range(8..=1 << 20))]
    rays: u32,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
    /// Write a plot of the time a ray takes against the largest error
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    run.warn_of_build();
    if let Some(path) = &args.plot {
        run.check_output(path, &[])?;
    }
    if let Some(part) = args.family.as_ref().filter(|part| !names().iter().any(|name| name.contains(part.as_str()))) {
        let text = format!("--family {part}: no family has a name like this; there are: {}", names().join(", "));
        return Err(Failure::new(Exit::Usage, text));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads.count()).build();
    let pool = pool.map_err(|error| Failure::new(Exit::Limit, format!("cannot start threads: {error}")))?;
    let settings = StressSettings { family: args.family.clone(), seed: args.seed, rays: args.rays as usize };
    let report = pool.install(|| stress(&settings));
    if let Some(path) = &args.plot {
        std::fs::write(path, plot(&report))
            .map_err(|error| Failure::new(Exit::Output, format!("{}: {error}", path.display())))?;
    }
    if args.json {
        let json = serde_json::to_value(&report).map_err(|error| Failure::new(Exit::Limit, error))?;
        run.console.print_json(&json)?;
    } else {
        run.console.print(&format!("{report}\n"))?;
    }
    Ok(if report.pass { Exit::Done } else { Exit::No })
}
