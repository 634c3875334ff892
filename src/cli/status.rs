//! `octray status`: what a batch has done so far, by its record.

use std::path::{Path, PathBuf};

use octray::batch::ledger::{self, Entry};
use octray::scene::inputs::{hex, sha256};
use serde_json::json;

use super::Run;
use super::console::pretty;
use super::exit::{Exit, Failure};
use super::system;

/// Arguments of `octray status`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Exit code 1 where pictures of the record are missing or not what they were.

Examples:
  octray status out
  octray status out --json | jq .missing")]
pub struct Args {
    /// Directory of the pictures
    directory: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What became of a picture of the record.
enum Found {
    Whole,
    Missing,
    Changed,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    let entries = ledger::read(&args.directory).map_err(|error| {
        let path = args.directory.join(ledger::NAME);
        Failure::new(Exit::Input, format!("{}: cannot be read: {error}", path.display()))
    })?;
    let found: Vec<Found> = entries.iter().map(|entry| look(&args.directory, entry)).collect();
    let names = |wanted: fn(&Found) -> bool| -> Vec<&str> {
        let pairs = entries.iter().zip(&found).filter(|(_, found)| wanted(found));
        pairs.map(|(entry, _)| entry.file.as_str()).collect()
    };
    let missing = names(|found| matches!(found, Found::Missing));
    let changed = names(|found| matches!(found, Found::Changed));
    let bytes: u64 = entries.iter().map(|entry| entry.bytes).sum();
    let seconds = entries.iter().fold([0.0; 3], |sum, entry| [0, 1, 2].map(|i| sum[i] + entry.seconds[i]));
    let slowest = entries.iter().max_by(|a, b| total(a).total_cmp(&total(b)));
    if args.json {
        let page = json!({
            "schema": 1, "pictures": entries.len(), "whole": entries.len() - missing.len() - changed.len(),
            "missing": missing, "changed": changed, "bytes": bytes,
            "seconds": { "load": seconds[0], "render": seconds[1], "write": seconds[2] },
            "slowest": slowest.map(|entry| json!({ "file": entry.file, "seconds": total(entry) })),
        });
        run.console.print(&pretty(&page))?;
    } else {
        let mut page = format!(
            "{} pictures, {}: {} whole, {} missing, {} not what they were\n",
            entries.len(),
            system::size(bytes),
            entries.len() - missing.len() - changed.len(),
            missing.len(),
            changed.len(),
        );
        page += &format!("seconds: load {:.2}, render {:.2}, write {:.2}\n", seconds[0], seconds[1], seconds[2]);
        if let Some(entry) = slowest {
            page += &format!("slowest: {} with {:.2} s\n", entry.file, total(entry));
        }
        missing.iter().for_each(|name| page += &format!("missing: {name}\n"));
        changed.iter().for_each(|name| page += &format!("changed: {name}\n"));
        run.console.print(&page)?;
    }
    Ok(if missing.is_empty() && changed.is_empty() { Exit::Done } else { Exit::No })
}

fn total(entry: &Entry) -> f64 {
    entry.seconds.iter().sum()
}

fn look(directory: &Path, entry: &Entry) -> Found {
    let Ok(mut file) = std::fs::File::open(directory.join(&entry.file)) else { return Found::Missing };
    match sha256(&mut file) {
        Ok(hash) if hex(&hash) == entry.hash => Found::Whole,
        _ => Found::Changed,
    }
}
