//! `octray batch`: a list of pictures.

use std::io::Read;
use std::path::{Path, PathBuf};

use octray::batch::{Sources, manifest};

use super::Run;
use super::exit::{Exit, Failure};
use super::jobs::{self, List, Running};
use super::settings::Settings;

const EXAMPLES: &str = "\
A list is JSON, one job a line, or TOML with [[jobs]]; options of the command are for jobs that do not say it.
Scenes are relative to the list, outputs to --out-dir:
  {\"defaults\": {\"scene\": \"fig5.toml\", \"resolution\": [128, 128], \"spp\": 1}}
  {\"camera\": {\"type\": \"pinhole\", \"eye\": [0, 0, 8], \"target\": [0, 0, 0], \"vfov\": 45}, \"output\": \"a.exr\"}
  {\"camera\": \"top\", \"frames\": \"1-10\", \"output\": \"top.####.exr\", \"seed\": 7}

Pictures that are there already, whole and up to date, are left out; --again renders all.

Examples:
  octray batch jobs.jsonl --out-dir out                  what is missing or stale
  octray batch jobs.toml --out-dir out --shard 2/8       every eighth picture from the second on
  make-jobs | octray batch - --out-dir out --progress json";

/// Arguments of `octray batch`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// List of jobs: .toml, anything else is JSON lines; - is standard input
    list: PathBuf,
    /// Directory for the pictures, made where it is missing; an output that leaves it is refused [default: outputs start
    /// here and may be anywhere]
    #[arg(long, value_name = "DIR")]
    out_dir: Option<PathBuf>,
    /// Names of pictures whose jobs give none; {scene}, {camera}, {job} and #### stand for what differs
    #[arg(long, value_name = "PATTERN", default_value = "{scene}.{job}.exr")]
    name: String,
    /// Render all pictures, those that are there as well
    #[arg(long, conflicts_with = "resume")]
    again: bool,
    #[command(flatten)]
    settings: Settings,
    #[command(flatten)]
    running: Running,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    run.warn_of_build();
    args.running.threads.rule();
    let text = read(&args.list)?;
    let base = args.settings.job(PathBuf::new())?;
    let jobs = manifest::read(&args.list, &text, &base, args.out_dir.as_deref(), &args.name)
        .map_err(|error| Failure::new(Exit::Input, error))?;
    if jobs.is_empty() {
        return Err(Failure::new(Exit::Input, "there is no job in it").of(&args.list));
    }
    let mut folders: Vec<&Path> = jobs.iter().filter_map(|job| job.output.parent()).collect();
    folders.sort_unstable();
    folders.dedup();
    for folder in folders.into_iter().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|error| Failure::output(folder, &error))?;
    }
    let mut jobs = jobs;
    for job in &mut jobs {
        let target = jobs::target(&job.output, &[], true, run)?;
        args.settings.aim(job, &target, run)?;
    }
    let list = List { jobs, many: true, ledger: true, resume: !args.again };
    jobs::run(list, &args.running, &Sources::default(), run)
}

fn read(list: &Path) -> Result<String, Failure> {
    let cannot = |error| Failure::new(Exit::Input, format!("{}: cannot be read: {error}", list.display()));
    if list.as_os_str() != "-" {
        return std::fs::read_to_string(list).map_err(cannot);
    }
    let mut text = String::new();
    std::io::stdin().lock().read_to_string(&mut text).map_err(cannot)?;
    Ok(text)
}
