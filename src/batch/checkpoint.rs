//! A long picture that can be gone on with: the blocks that are done, in a file.
//!
//! A block is a square of pixels with all of their samples, so its pixels are final: sums, compensation and sample
//! index are behind it. A file holds the values of the finished blocks as they are in memory, to the bit, of colour and
//! layers, and a picture that goes on from it is the one that was never interrupted. What a stop loses is the blocks that
//! were being traced.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::film::{Channel, Cryptomatte, Picture, Samples, Window};
use crate::output::{OutputError, aside};
use crate::render::{Rendering, Task, Traced};

/// The first bytes of a file.
const MAGIC: &[u8] = b"octray checkpoint 1\n";

/// Where and how often.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Checkpoint {
    /// The file.
    pub path: PathBuf,
    /// Time between two writes.
    pub every: Duration,
}

/// A picture in the making, with the blocks that are in it.
pub struct Partial {
    /// What it must be of: scene, settings, size.
    key: String,
    done: Vec<bool>,
    waiting: Vec<(usize, Traced)>,
    whole: Option<Rendering>,
    start: Instant,
    last: Instant,
}

/// The head of a file, one line of JSON; samples follow: red, green, blue, alpha of each pixel, then each channel.
#[derive(Debug, Serialize, Deserialize)]
struct Head {
    key: String,
    done: Vec<bool>,
    display: (u32, u32),
    window: [i32; 4],
    /// Names of channels and their types: half, float, uint.
    channels: Vec<(String, char)>,
    cryptomattes: Vec<(String, BTreeMap<String, u32>)>,
    object: BTreeMap<u32, String>,
    material: BTreeMap<u32, String>,
}

impl Partial {
    /// Begins, or goes on from a file that is there and of the same picture.
    ///
    /// # Errors
    /// A file of another picture, or of none: what was found there.
    pub fn open(path: &Path, key: String, task: &Task) -> Result<Self, String> {
        let now = Instant::now();
        let done = vec![false; task.blocks()];
        let mut partial = Partial { key, done, waiting: Vec::new(), whole: None, start: now, last: now };
        let bytes = match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(partial),
            Err(error) => return Err(format!("cannot be read: {error}")),
        };
        let (head, mut picture) =
            decode(&bytes).ok_or("is no checkpoint, or not a whole one: remove it to begin anew")?;
        if head.key != partial.key || head.done.len() != partial.done.len() {
            return Err(
                "is the checkpoint of another picture (scene, settings or size): remove it to begin anew".into()
            );
        }
        picture.cryptomattes =
            head.cryptomattes.into_iter().map(|(name, manifest)| Cryptomatte { name, manifest }).collect();
        let mut whole = task.finish(Vec::new(), 0, now);
        (whole.names.object, whole.names.material) = (head.object, head.material);
        whole.picture = picture;
        partial.done = head.done;
        partial.whole = Some(whole);
        Ok(partial)
    }

    /// Whether a block is in it already.
    pub fn has(&self, block: usize) -> bool {
        self.done[block]
    }

    /// Takes a block in.
    pub fn add(&mut self, block: usize, traced: Traced) {
        self.waiting.push((block, traced));
    }

    /// Whether it is time to write.
    pub fn is_due(&self, every: Duration) -> bool {
        self.last.elapsed() >= every
    }

    /// Writes all that is done.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&mut self, path: &Path, task: &Task) -> Result<(), OutputError> {
        self.absorb(task, 0);
        self.last = Instant::now();
        let Some(whole) = &self.whole else { return Ok(()) };
        aside::write(path, &encode(&self.key, &self.done, whole))
    }

    /// The finished picture.
    pub fn finish(mut self, task: &Task, threads: usize) -> Rendering {
        self.absorb(task, threads);
        let mut whole = self.whole.unwrap_or_else(|| task.finish(Vec::new(), threads, self.start));
        whole.stats.trace_seconds = self.start.elapsed().as_secs_f64();
        whole.stats.threads = threads;
        whole
    }

    /// Puts the blocks that wait into the picture.
    fn absorb(&mut self, task: &Task, threads: usize) {
        let waiting = std::mem::take(&mut self.waiting);
        if waiting.is_empty() {
            return;
        }
        let windows: Vec<Window> = waiting.iter().map(|(_, traced)| task.pixels(traced).0).collect();
        let (blocks, traced): (Vec<usize>, Vec<Traced>) = waiting.into_iter().unzip();
        blocks.iter().for_each(|block| self.done[*block] = true);
        let part = task.finish(traced, threads, self.start);
        let Some(whole) = &mut self.whole else {
            self.whole = Some(part);
            return;
        };
        windows.iter().for_each(|window| copy(&part.picture, &mut whole.picture, *window));
        for (own, more) in whole.picture.cryptomattes.iter_mut().zip(part.picture.cryptomattes) {
            own.manifest.extend(more.manifest);
        }
        whole.names.object.extend(part.names.object);
        whole.names.material.extend(part.names.material);
        // Counts of the parts add up only in the render itself: those of the larger one stand for the picture.
        if part.stats.rays.rays.iter().sum::<u64>() > whole.stats.rays.rays.iter().sum::<u64>() {
            whole.stats = part.stats;
        }
    }
}

/// The pixels of a window, in colour and in all layers.
fn copy(from: &Picture, to: &mut Picture, window: Window) {
    for y in window.y0..window.y1 {
        let Some(start) = to.window.index(window.x0, y) else { continue };
        let row = start..start + window.width();
        to.pixels[row.clone()].copy_from_slice(&from.pixels[row.clone()]);
        for (own, other) in to.channels.iter_mut().zip(&from.channels) {
            match (&mut own.samples, &other.samples) {
                (Samples::Half(own), Samples::Half(other)) | (Samples::Float(own), Samples::Float(other)) => {
                    own[row.clone()].copy_from_slice(&other[row.clone()]);
                }
                (Samples::Uint(own), Samples::Uint(other)) => own[row.clone()].copy_from_slice(&other[row.clone()]),
                _ => {}
            }
        }
    }
}

fn encode(key: &str, done: &[bool], whole: &Rendering) -> Vec<u8> {
    let picture = &whole.picture;
    let kind = |channel: &Channel| match channel.samples {
        Samples::Half(_) => 'h',
        Samples::Float(_) => 'f',
        Samples::Uint(_) => 'u',
    };
    let Window { x0, y0, x1, y1 } = picture.window;
    let head = Head {
        key: key.to_owned(),
        done: done.to_vec(),
        display: picture.display,
        window: [x0, y0, x1, y1],
        channels: picture.channels.iter().map(|channel| (channel.name.clone(), kind(channel))).collect(),
        cryptomattes: picture.cryptomattes.iter().map(|matte| (matte.name.clone(), matte.manifest.clone())).collect(),
        object: whole.names.object.clone(),
        material: whole.names.material.clone(),
    };
    let mut bytes = MAGIC.to_vec();
    // Names, numbers and flags: nothing that JSON cannot hold.
    bytes.extend(serde_json::to_vec(&head).unwrap_or_default());
    bytes.push(b'\n');
    bytes.extend(picture.pixels.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
    for channel in &picture.channels {
        match &channel.samples {
            Samples::Half(values) | Samples::Float(values) => {
                bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            }
            Samples::Uint(values) => bytes.extend(values.iter().flat_map(|value| value.to_le_bytes())),
        }
    }
    bytes
}

fn decode(bytes: &[u8]) -> Option<(Head, Picture)> {
    let rest = bytes.strip_prefix(MAGIC)?;
    let end = rest.iter().position(|byte| *byte == b'\n')?;
    let head: Head = serde_json::from_slice(&rest[..end]).ok()?;
    let mut rest = &rest[end + 1..];
    let [x0, y0, x1, y1] = head.window;
    let window = Window { x0, y0, x1, y1 };
    let area = window.area();
    if rest.len() != area.checked_mul(4 * (4 + head.channels.len()))? {
        return None;
    }
    let mut words = |count: usize| -> Vec<[u8; 4]> {
        let (these, others) = rest.split_at(4 * count);
        rest = others;
        these.as_chunks::<4>().0.to_vec()
    };
    let mut picture = Picture::new(head.display, window);
    let values: Vec<f32> = words(4 * area).into_iter().map(f32::from_le_bytes).collect();
    picture.pixels = values.as_chunks::<4>().0.to_vec();
    for (name, kind) in &head.channels {
        let words = words(area);
        let floats = || words.iter().copied().map(f32::from_le_bytes).collect();
        let samples = match kind {
            'h' => Samples::Half(floats()),
            'f' => Samples::Float(floats()),
            'u' => Samples::Uint(words.iter().copied().map(u32::from_le_bytes).collect()),
            _ => return None,
        };
        picture.channels.push(Channel { name: name.clone(), samples });
    }
    Some((head, picture))
}
