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
                    Ok((aside, report)) => group.push(job, aside, report, start),
                    Err(error) => told(job, Err(error)),
                }
                next = if group.jobs.len() < GROUP && !self.durable { self.receiver.try_recv().ok() } else { None };
            }
            group.end(told);
        }
    }

    /// Writes aside what a job came to.
    fn put(&self, finished: Finished, stop: &dyn Fn() -> bool) -> Result<(Option<Aside>, Report), OutputError> {
        let Finished { path, beside, bytes, report, .. } = finished;
        let written = (|| {
            for (path, bytes) in &beside {
                crate::output::aside::write(path, bytes)?;
            }
            if path.as_os_str() == "-" {
                return stream(&bytes).map(|()| None);
            }
            Aside::write(&path, &bytes, || !stop()).map(Some)
        })();
        let mut waiting = self.room.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        *waiting = waiting.saturating_sub(bytes.len() as u64);
        self.room.freed.notify_all();
        written.map(|aside| (aside, report))
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
    files: Vec<Aside>,
    /// Jobs that went to a stream.
    streamed: Vec<(usize, Report)>,
}

impl Group {
    fn push(&mut self, job: usize, aside: Option<Aside>, report: Report, start: Instant) {
        match aside {
            Some(aside) => {
                self.files.push(aside);
                self.jobs.push((job, report, start));
            }
            None => self.streamed.push((job, report)),
        }
    }

    /// Flushes all, then gives them their names.
    fn end(self, told: &mut dyn FnMut(usize, Result<Report, OutputError>)) {
        self.streamed.into_iter().for_each(|(job, report)| told(job, Ok(report)));
        let (flushed, count) = (Aside::flush_all(&self.files), self.files.len() as f64);
        for ((file, flushed), (job, mut report, start)) in self.files.into_iter().zip(flushed).zip(self.jobs) {
            report.write_seconds += start.elapsed().as_secs_f64() / count;
            told(job, flushed.and_then(|()| file.take_name()).map(|()| report));
        }
    }
}
