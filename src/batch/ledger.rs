//! The record of a batch: one line a picture, beside the pictures, appended and never changed.
//!
//! A line says from what a picture was made (hashes of scene and settings), what it is (length and hash of the file) and
//! what it took. The last line of a name counts; lines that a killed process left unfinished are passed over. Several
//! processes may append to one record: each line goes out in one write.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{Job, Report};
use crate::scene::inputs::hex;

/// The name of a record, in the directory of the pictures.
pub const NAME: &str = "octray-ledger.jsonl";

/// What is known of one picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Version of this format: 1.
    pub schema: u32,
    /// The file, in the record's own directory.
    pub file: String,
    /// The scene file as it was named.
    pub scene: String,
    /// The frame.
    pub frame: i64,
    /// Hash over all files of the scene.
    pub scene_hash: String,
    /// Hash over what else the picture depends on: camera, size, samples and so on, and this program's version.
    pub settings_hash: String,
    /// SHA-256 of the file.
    pub hash: String,
    /// Length of the file.
    pub bytes: u64,
    /// Seconds for load, trace (with plan and build) and write.
    pub seconds: [f64; 3],
}

/// The records of all directories of a batch.
#[derive(Debug, Default)]
pub struct Ledgers {
    folders: HashMap<PathBuf, Ledger>,
}

#[derive(Debug, Default)]
struct Ledger {
    known: HashMap<String, Entry>,
    file: Mutex<Option<File>>,
}

impl Ledgers {
    /// Reads the records that are there; those that are not are made with their first line.
    pub fn open(jobs: &[Job]) -> Self {
        let mut ledgers = Ledgers::default();
        for job in jobs {
            if let Some(folder) = folder(job)
                && !ledgers.folders.contains_key(&folder)
            {
                let known = read(&folder).unwrap_or_default();
                let known = known.into_iter().map(|entry| (entry.file.clone(), entry)).collect();
                ledgers.folders.insert(folder, Ledger { known, file: Mutex::default() });
            }
        }
        ledgers
    }

    /// What was known of a job's file when the batch began.
    pub fn entry(&self, job: &Job) -> Option<&Entry> {
        self.folders.get(&folder(job)?)?.known.get(&name(job)?)
    }

    /// Adds a line.
    ///
    /// # Errors
    /// As the system gives them.
    pub fn add(&self, job: &Job, scene_hash: &str, report: &Report) -> io::Result<()> {
        let (Some(folder), Some(file)) = (folder(job), name(job)) else { return Ok(()) };
        let Some(ledger) = self.folders.get(&folder) else { return Ok(()) };
        let stats = &report.stats;
        let entry = Entry {
            schema: 1,
            file,
            scene: job.scene.display().to_string(),
            frame: job.frame(),
            scene_hash: scene_hash.to_owned(),
            settings_hash: settings_hash(job),
            hash: report.hash.clone(),
            bytes: report.bytes,
            seconds: [
                report.load_seconds,
                stats.plan_seconds + stats.build_seconds + stats.trace_seconds,
                report.write_seconds,
            ],
        };
        let mut line = serde_json::to_string(&entry)?;
        line.push('\n');
        let mut file = ledger.file.lock().unwrap_or_else(PoisonError::into_inner);
        let file = match &mut *file {
            Some(file) => file,
            none => none.insert(append(&folder.join(NAME))?),
        };
        file.write_all(line.as_bytes())
    }
}

/// Opens a record to append to; a line that was cut short is ended first.
fn append(path: &Path) -> io::Result<File> {
    let mut file = OpenOptions::new().read(true).append(true).create(true).open(path)?;
    if file.seek(SeekFrom::End(0))? > 0 {
        let mut last = [0];
        file.seek(SeekFrom::End(-1))?;
        file.read_exact(&mut last)?;
        if last != *b"\n" {
            file.write_all(b"\n")?;
        }
    }
    Ok(file)
}

/// The last entry of each file of a directory's record, in the order in which they were first written; lines that are
/// none are passed over.
///
/// # Errors
/// There is no record, or it cannot be read.
pub fn read(folder: &Path) -> io::Result<Vec<Entry>> {
    let bytes = fs::read(folder.join(NAME))?;
    let mut entries: Vec<Entry> = Vec::new();
    let mut places: HashMap<String, usize> = HashMap::new();
    for line in bytes.split(|byte| *byte == b'\n') {
        let Ok(entry) = serde_json::from_slice::<Entry>(line) else { continue };
        match places.get(&entry.file) {
            Some(place) => entries[*place] = entry,
            None => {
                places.insert(entry.file.clone(), entries.len());
                entries.push(entry);
            }
        }
    }
    Ok(entries)
}

/// A hash over all that a picture depends on beside the files of its scene.
pub fn settings_hash(job: &Job) -> String {
    // The words of a `Debug` output name every field, so that a new setting cannot be forgotten.
    let words =
        format!("{} {:?}", env!("CARGO_PKG_VERSION"), (&job.look, &job.view, job.frame, &job.settings, job.format));
    hex(&Sha256::digest(words.as_bytes()))
}

fn folder(job: &Job) -> Option<PathBuf> {
    let folder = job.output.parent().filter(|_| job.output.as_os_str() != "-")?;
    Some(if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder.to_owned() })
}

fn name(job: &Job) -> Option<String> {
    Some(job.output.file_name()?.to_string_lossy().into_owned())
}
