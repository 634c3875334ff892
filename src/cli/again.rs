//! `--verify`: some pictures of a batch are rendered once more, and must be the same.

use octray::batch::{self, Job, Options, Sources};
use octray::output;

use super::Run;
use super::exit::{Exit, Failure};
use super::progress::Teller;

/// Renders a share of the pictures again, at least one, and names those that are not what they were.
pub fn verify(jobs: &[Job], percent: f64, options: &Options, run: &Run) -> Result<(), Failure> {
    let room = tempfile::tempdir().map_err(|error| Failure::output(&std::env::temp_dir(), &error))?;
    let there: Vec<&Job> = jobs.iter().filter(|job| job.output.is_file()).collect();
    let count = ((there.len() as f64 * percent / 100.0).ceil() as usize).min(there.len());
    // Evenly over the list, from a place in it that does not depend on the run.
    let chosen = (0..count).map(|k| (k * there.len() + there.len() / 2) / count.max(1));
    let again: Vec<Job> = chosen
        .map(|index| {
            let ending = there[index].output.extension().unwrap_or_default();
            let output = room.path().join(index.to_string()).with_extension(ending);
            Job { output, ..there[index].clone() }
        })
        .collect();
    let options = Options {
        ledger: false,
        resume: false,
        checkpoint: None,
        annotations: false,
        durable: false,
        ..options.clone()
    };
    let mut teller = Teller::new(run, None, None, true, again.len(), false);
    let summary = run.signals.graceful(|| batch::run(&again, &options, &Sources::default(), &teller))?;
    teller.end(&summary);
    if summary.cancelled {
        run.signals.end();
    }
    let of = |job: &Job| job.output.file_stem().and_then(|stem| stem.to_str()?.parse::<usize>().ok());
    let mut different = Vec::new();
    for job in &again {
        let Some(first) = of(job).map(|index| there[index]) else { continue };
        let same = match (output::read(&job.output), output::read(&first.output)) {
            (Ok(now), Ok(then)) => now == then,
            _ => false,
        };
        if !same {
            different.push(first.to_string());
        }
    }
    run.console.note(&format!("octray: {} of {} pictures rendered again", again.len(), there.len()));
    match different.len() {
        0 => Ok(()),
        count => {
            let text = format!("{count} of {} are not what they were: {}", again.len(), different.join(", "));
            Err(Failure::new(Exit::No, text))
        }
    }
}
