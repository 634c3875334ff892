//! Files under their names: written on a thread of their own, made durable in groups.
//!
//! While one group is flushed the next one gathers, so a group is as large as the disk is slow: few small files a
//! flush where it is fast, hundreds where it is not. A name appears when what it stands for is on the disk.

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Instant;

use super::Report;
use crate::output::OutputError;
use crate::output::aside::Aside;

/// Most files of a group.
const GROUP: usize = 512;
/// Most bytes that wait to be written; one file may be longer.
const WAITING: u64 = 256 << 20;

/// A file to write.
pub struct Finished {
    pub job: usize,
    pub path: PathBuf,
    /// Files that belong to it and are to be there before it.
    pub beside: Vec<(PathBuf, Vec<u8>)>,
    pub bytes: Vec<u8>,
    pub report: Report,
}

/// The way to the thread that writes.
pub struct Writer<'r> {
    sender: Sender<Finished>,
    room: &'r Room,
}

/// Bytes on their way.
#[derive(Debug, Default)]
pub struct Room {
    bytes: Mutex<u64>,
    freed: Condvar,
}

/// The thread's end of it.
pub struct Inbox<'r> {
    receiver: Receiver<Finished>,
    room: &'r Room,
    durable: bool,
}

/// Both ends; with `durable` every file is flushed by itself at once.
pub fn line(room: &Room, durable: bool) -> (Writer<'_>, Inbox<'_>) {
    let (sender, receiver) = channel();
    (Writer { sender, room }, Inbox { receiver, room, durable })
}

impl Clone for Writer<'_> {
    fn clone(&self) -> Self {
        Writer { sender: self.sender.clone(), room: self.room }
    }
}

impl Writer<'_> {
    /// Hands a file over; waits where too much is waiting already.
    pub fn write(&self, finished: Finished) {
        let length = finished.bytes.len() as u64;
        let mut bytes = self.room.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        while *bytes > 0 && *bytes + length > WAITING {
            bytes = self.room.freed.wait(bytes).unwrap_or_else(PoisonError::into_inner);
        }
        *bytes += length;
        drop(bytes);
        // The inbox lives as long as there are writers; were it gone, there would be nobody to tell.
        let _ = self.sender.send(finished);
    }
}

impl Inbox<'_> {
    /// Writes until all writers are gone, and tells what became of each file.
    pub fn run(self, stop: &dyn Fn() -> bool, told: &mut dyn FnMut(usize, Result<Report, OutputError>)) {
        while let Ok(first) = self.receiver.recv() {
            let mut group = Group::default();
            let mut next = Some(first);
            while let Some(finished) = next {
                let (job, start) = (finished.job, Instant::now());
                match self.put(finished, stop) {
                    Ok((files, report)) => group.push(job, files, report, start),
                    Err(error) => told(job, Err(error)),
                }
                next = if group.jobs.len() < GROUP && !self.durable { self.receiver.try_recv().ok() } else { None };
            }
            group.end(told);
        }
    }

    /// Writes aside what a job came to.
    fn put(&self, finished: Finished, stop: &dyn Fn() -> bool) -> Result<(Vec<Aside>, Report), OutputError> {
        let Finished { path, beside, bytes, report, .. } = finished;
        let picture = (path, bytes);
        let (path, bytes) = &picture;
        let written = (|| {
            if path.as_os_str() == "-" {
                return stream(bytes).map(|()| Vec::new());
            }
            let all = beside.iter().chain(std::iter::once(&picture));
            all.map(|(path, bytes)| Aside::write(path, bytes, || !stop())).collect()
        })();
        let mut waiting = self.room.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        *waiting = waiting.saturating_sub(bytes.len() as u64);
        self.room.freed.notify_all();
        written.map(|files| (files, report))
    }
}

fn stream(bytes: &[u8]) -> Result<(), OutputError> {
    let mut out = io::stdout().lock();
    let path = || PathBuf::from("standard output");
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|source| OutputError::Io { path: path(), source })
}

/// Files that are flushed together.
#[derive(Default)]
struct Group {
    jobs: Vec<(usize, Report, Instant)>,
    /// Of each job in turn: those beside the picture first.
    files: Vec<Aside>,
    /// How many each job has; a stream has none.
    counts: Vec<usize>,
}

impl Group {
    fn push(&mut self, job: usize, files: Vec<Aside>, report: Report, start: Instant) {
        self.counts.push(files.len());
        self.files.extend(files);
        self.jobs.push((job, report, start));
    }

    /// Flushes all, then gives them their names.
    fn end(self, told: &mut dyn FnMut(usize, Result<Report, OutputError>)) {
        let flushed = Aside::flush_all(&self.files);
        let share = 1.0 / self.jobs.len().max(1) as f64;
        let mut files = self.files.into_iter().zip(flushed);
        for ((job, mut report, start), count) in self.jobs.into_iter().zip(self.counts) {
            // All are taken off the list, those behind one that failed as well: they are removed.
            let own: Vec<_> = files.by_ref().take(count).collect();
            let named = own.into_iter().try_for_each(|(file, flushed)| flushed.and_then(|()| file.take_name()));
            report.write_seconds += share * start.elapsed().as_secs_f64();
            told(job, named.map(|()| report));
        }
    }
}
