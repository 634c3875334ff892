//! Running jobs for the commands: what is checked before, how it goes on, how it ends.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use octray::batch::{self, Checkpoint, Job, JobError, Shard, Sources, Summary};
use octray::output::{Format, OutputError};

use super::Run;
use super::args::{StatsFile, Threads};
use super::exit::{Exit, Failure};
use super::pictures::Target;
use super::preview::Preview;
use super::progress::{Lines, Teller};
use super::{again, scene_file, sheet, stats_json};

/// How jobs are run.
#[derive(Debug, Clone, Args)]
pub struct Running {
    #[command(flatten)]
    pub threads: Threads,
    /// Leave out pictures that are there already, whole and up to date
    #[arg(long, visible_alias = "skip-existing")]
    pub resume: bool,
    /// Render only part I of N of the list: pictures I, I+N, ...
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<Shard>,
    /// Flush every file to the disk by itself at once, instead of in groups
    #[arg(long)]
    durable: bool,
    /// Most memory for scenes, trees and pictures, as forecast from the files: 4G, 500M
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    max_memory: Option<u64>,
    /// Write what is seen where beside each picture, as JSON after the manner of COCO: its name with .json
    #[arg(long)]
    annotations: bool,
    /// Draw all pictures in rows, each with its number in the list, to look at
    #[arg(long, value_name = "FILE.png")]
    contact_sheet: Option<PathBuf>,
    /// Render so many percent of the pictures again, those that were there as well, and compare
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    verify: Option<f64>,
    /// Keep what is done of a single long picture in a file; the same command goes on from there, to the same bits
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Time between two writes of --checkpoint: 60s, 10m, 1h
    #[arg(long, value_name = "TIME", value_parser = duration, default_value = "60s", requires = "checkpoint")]
    checkpoint_every: Duration,
    /// Lines about progress on standard output, for machines
    #[arg(long, value_enum, value_name = "FORM")]
    progress: Option<Lines>,
    /// Show a single picture in the tev viewer while it is rendered, such as at 127.0.0.1:14158
    #[arg(long, value_name = "HOST:PORT", value_parser = host)]
    tev: Option<String>,
    #[command(flatten)]
    stats: StatsFile,
}

/// `2/8`.
fn shard(text: &str) -> Result<Shard, String> {
    let numbers = text.split_once('/').and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
    match numbers {
        Some((index, of)) if (1..=of).contains(&index) => Ok(Shard { index, of }),
        _ => Err("should be I/N with I from 1 to N, such as 2/8".to_owned()),
    }
}

/// Above 0, up to 100.
fn percent(text: &str) -> Result<f64, String> {
    let number = text.trim_end_matches('%').parse().ok().filter(|percent| *percent > 0.0 && *percent <= 100.0);
    number.ok_or_else(|| "should be a number above 0, up to 100".to_owned())
}

/// `127.0.0.1:14158`, `localhost:14158`, `[::1]:14158`.
fn host(text: &str) -> Result<String, String> {
    let port = text.rsplit_once(':').filter(|(name, _)| !name.is_empty()).and_then(|(_, port)| port.parse().ok());
    let found = port.is_some_and(|port: u16| port > 0).then(|| text.to_owned());
    found.ok_or_else(|| "should be HOST:PORT, such as 127.0.0.1:14158".to_owned())
}

/// `60s`, `10m`, `1h`, `2.5`.
fn duration(text: &str) -> Result<Duration, String> {
    let at = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let factor = match &text[at..] {
        "" | "s" => Some(1.0),
        "m" | "min" => Some(60.0),
        "h" => Some(3600.0),
        _ => None,
    };
    let seconds = factor.and_then(|factor| Some(factor * text[..at].parse::<f64>().ok()?));
    let seconds = seconds.filter(|seconds| (0.0..1e9).contains(seconds));
    seconds.map(Duration::from_secs_f64).ok_or_else(|| "should be a time such as 60s, 10m or 1h".to_owned())
}

/// `4G`, `500M`, `1048576`.
fn bytes(text: &str) -> Result<u64, String> {
    let wrong = || "should be a size such as 4G, 500M or 1048576".to_owned();
    let text = text.trim_end_matches(['B', 'b']).trim_end_matches('i');
    let at = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let factor = match text[at..].to_ascii_lowercase().as_str() {
        "" => 1.0,
        "k" => 1024.0,
        "m" => 1024.0 * 1024.0,
        "g" => 1024.0 * 1024.0 * 1024.0,
        "t" => 1024.0 * 1024.0 * 1024.0 * 1024.0,
        _ => return Err(wrong()),
    };
    let number: f64 = text[..at].parse().map_err(|_| wrong())?;
    if number > 0.0 && number * factor < 1e19 { Ok((number * factor) as u64) } else { Err(wrong()) }
}

/// What is to be done.
pub struct List {
    pub jobs: Vec<Job>,
    /// Whether it is meant as a batch, however long it is.
    pub many: bool,
    /// Whether a record is kept.
    pub ledger: bool,
    /// Whether what is there already is left out.
    pub resume: bool,
}

/// Runs all jobs; a single one ends with its own cause.
pub fn run(list: List, running: &Running, sources: &Sources, run: &Run) -> Result<Exit, Failure> {
    let List { jobs, many, ledger, resume } = list;
    if running.tev.is_some() && jobs.len() > 1 {
        return Err(Failure::new(Exit::Usage, format!("--tev shows a single picture, not {}", jobs.len())));
    }
    let inputs = check(&jobs, running, run)?;
    let jobs: Vec<Job> = match running.shard {
        None => jobs,
        Some(shard) => jobs.into_iter().enumerate().filter(|(i, _)| shard.holds(*i)).map(|(_, job)| job).collect(),
    };
    if let Some(stats) = &running.stats.stats {
        if jobs.iter().any(|job| job.output == *stats) {
            return Err(Failure::new(Exit::Usage, format!("{}: both the picture and --stats", stats.display())));
        }
        let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
        run.check_output(stats, &inputs)?;
    }
    let every = running.checkpoint_every;
    let checkpoint = running.checkpoint.clone().map(|path| Checkpoint { path, every });
    if let Some(Checkpoint { path, .. }) = &checkpoint {
        if many {
            return Err(Failure::new(Exit::Usage, "--checkpoint is about one picture; a batch goes on with --resume"));
        }
        let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
        run.check_output(path, &inputs)?;
    }
    if let Some(sheet) = &running.contact_sheet {
        if sheet.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("png")) {
            return Err(Failure::new(Exit::Usage, "--contact-sheet should end in .png").of(sheet));
        }
        let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
        run.check_output(sheet, &inputs)?;
    }
    let options = batch::Options {
        threads: running.threads.count(),
        durable: running.durable,
        resume,
        ledger,
        max_memory: running.max_memory,
        shard: running.shard,
        annotations: running.annotations,
        checkpoint,
    };
    let preview = Some(Preview::new(run, running.tev.as_deref()));
    let mut teller = Teller::new(run, running.progress, preview, many, jobs.len(), running.stats.stats.is_some());
    let summary = run.signals.graceful(|| batch::run(&jobs, &options, sources, &teller))?;
    teller.end(&summary);
    if summary.cancelled {
        run.signals.end();
    }
    if let Some(path) = &running.contact_sheet {
        sheet::write(&jobs, path, run)?;
    }
    if let Some(percent) = running.verify {
        again::verify(&jobs, percent, &options, run)?;
    }
    if let Some(path) = &running.stats.stats {
        let frames = teller.reports();
        if !frames.is_empty() {
            stats_json::write(path, stats_json::of_jobs(&jobs, &frames, many, run), run)?;
        }
    }
    ending(&jobs, summary, many, running.progress, &teller, run)
}

/// Makes sure of everything that can be known before the work: names, formats, directories.
fn check(jobs: &[Job], running: &Running, run: &Run) -> Result<Vec<PathBuf>, Failure> {
    let mut inputs: Vec<PathBuf> = jobs.iter().map(|job| job.scene.clone()).collect();
    inputs.sort_unstable();
    inputs.dedup();
    if let Some(job) = jobs.iter().find(|job| job.format == Format::Png && !job.settings.layers.aovs.is_empty()) {
        let text =
            "a PNG holds the colours alone, and the layers of --aov are not written: give a name that ends in .exr";
        run.console.warn(&format!("{job}: {text}"));
    }
    let mut outputs: HashMap<&Path, usize> = HashMap::new();
    let mut folders: Vec<&Path> = Vec::new();
    for (index, job) in jobs.iter().enumerate() {
        if job.output.as_os_str() == "-" {
            if running.progress.is_some() {
                let text = "--progress has standard output for itself: the picture needs another place than -";
                return Err(Failure::new(Exit::Usage, text));
            }
            continue;
        }
        if let Some(other) = outputs.insert(&job.output, index) {
            let text = format!(
                "would be the picture of two jobs, {} and {}: give --name with {{scene}}, {{camera}} or ####",
                other + 1,
                index + 1
            );
            return Err(Failure::new(Exit::Usage, text).of(&job.output));
        }
        if Format::of(&job.output).is_none() && jobs.len() > 1 {
            return Err(OutputError::Format { path: job.output.clone() }.into());
        }
        let folder = job.output.parent().unwrap_or(Path::new(""));
        if !folders.contains(&folder) {
            folders.push(folder);
            let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
            run.check_output(&job.output, &inputs)?;
        } else if inputs.binary_search(&job.output).is_ok() {
            let text = "is an input as well: the output should be another file";
            return Err(Failure::new(Exit::Usage, text).of(&job.output));
        }
    }
    Ok(inputs)
}

/// What a batch came to, in words and as an exit code.
fn ending(
    jobs: &[Job],
    summary: Summary,
    many: bool,
    lines: Option<Lines>,
    teller: &Teller,
    run: &Run,
) -> Result<Exit, Failure> {
    let Summary { written, skipped, mut failed, left, .. } = summary;
    if !many {
        return match failed.pop() {
            // The lines for machines have said it already, and so has standard error.
            Some((_, error)) => Err(failure(error, run.console.color)),
            None => Ok(Exit::Done),
        };
    }
    let done = match skipped {
        0 => format!("{written} of {} pictures written", jobs.len()),
        _ => format!("{written} of {} pictures written, {skipped} were there already", jobs.len()),
    };
    if lines.is_none() {
        run.console.note(&format!("octray: {done}; {}", teller.pace(written)));
    }
    if failed.is_empty() && left == 0 {
        return Ok(Exit::Done);
    }
    const SHOWN: usize = 20;
    let names: Vec<String> = failed.iter().take(SHOWN).map(|(index, _)| jobs[*index].to_string()).collect();
    let more = failed.len().saturating_sub(SHOWN);
    let mut text = format!("{} of {} pictures failed: {}", failed.len(), jobs.len(), names.join(", "));
    if more > 0 {
        text += &format!(" and {more} more");
    }
    if left > 0 {
        text += &format!("; {left} were not begun");
    }
    let exits: Vec<Exit> = failed.iter().map(|(_, error)| exit(error)).collect();
    let same = exits.iter().all(|exit| *exit == exits[0]) && written + skipped == 0;
    Err(Failure::new(if same && !exits.is_empty() { exits[0] } else { Exit::No }, text))
}

/// How a single job ends.
pub fn failure(error: JobError, color: bool) -> Failure {
    match error {
        JobError::Scene { path, errors } => scene_file::failure(&path, &errors, color),
        JobError::Render { path, error } => {
            let failure = Failure::from(error);
            if failure.exit == Exit::Input { failure.of(&path) } else { failure }
        }
        JobError::Output(error) => error.into(),
        error => Failure::new(exit(&error), error),
    }
}

fn exit(error: &JobError) -> Exit {
    match error {
        JobError::Scene { .. } => Exit::Input,
        JobError::Render { error, .. } => Failure::from(error.clone()).exit,
        JobError::Checkpoint { .. } => Exit::Input,
        JobError::Encode { .. } | JobError::Output(_) => Exit::Output,
        JobError::Memory(_) | JobError::Cancelled => Exit::Limit,
        JobError::Mistake { .. } => Exit::No,
    }
}

/// The targets of names: one is looked at closely, of many the kind alone.
pub fn target(path: &Path, inputs: &[&Path], many: bool, run: &Run) -> Result<Target, Failure> {
    if !many {
        return Target::new(path, inputs, run);
    }
    let format = Format::of(path).ok_or_else(|| OutputError::Format { path: path.into() })?;
    Ok(Target::File(path.into(), format))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viewers_have_a_host_and_a_port() {
        assert!(["127.0.0.1:14158", "viewer:1", "[::1]:14158"].iter().all(|text| host(text).is_ok()));
        for text in ["", "nonsense", "host:", ":14158", "host:0", "host:65536", "host:port"] {
            assert!(host(text).is_err_and(|reason| reason.contains("127.0.0.1:14158")), "{text}");
        }
    }

    #[test]
    fn sizes_and_shards_are_read_or_explained() {
        assert_eq!(
            (bytes("4G"), bytes("1.5k"), bytes("7"), bytes("2MiB")),
            (Ok(4 << 30), Ok(1536), Ok(7), Ok(2 << 20))
        );
        assert!(["", "G", "-1", "0", "4X", "1e3", "99999999T"].iter().all(|text| bytes(text).is_err()));
        assert_eq!(shard("2/8"), Ok(Shard { index: 2, of: 8 }));
        assert!(["", "2", "0/8", "9/8", "1/0", "a/b", "-1/2"].iter().all(|text| shard(text).is_err()));
    }
}
