//! A long picture that can be gone on with: the blocks that are done, in a file.
//!
//! A block is a square of pixels with all of their samples, so its pixels are final: sums, compensation and sample
//! index are behind it. A file holds the values of the finished blocks as they are in memory, to the bit, of colour and
//! layers, and a picture that goes on from it is the one that was never interrupted. What a stop loses is the blocks that
//! were being traced.

use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::film::{Channel, Cryptomatte, Picture, SampleKind, Samples, Window};
use crate::output::{OutputError, aside};
use crate::render::{Gathering, Task, Unfinished};

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

/// The checkpoint of a picture in the making.
pub struct Saves<'c> {
    to: &'c Checkpoint,
    /// What it must be of: scene, settings, size.
    key: String,
    last: Mutex<Instant>,
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
}

impl<'c> Saves<'c> {
    /// Of the picture with this key.
    pub fn new(to: &'c Checkpoint, key: String) -> Self {
        Saves { to, key, last: Mutex::new(Instant::now()) }
    }

    /// The file.
    pub fn path(&self) -> PathBuf {
        self.to.path.clone()
    }

    /// Begins, or goes on from a file that is there and of the same picture.
    ///
    /// # Errors
    /// A file of another picture, or of none: what was found there.
    pub fn open(&self, task: &Task) -> Result<Unfinished, String> {
        let bytes = match std::fs::read(&self.to.path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(task.begin()),
            Err(error) => return Err(format!("cannot be read: {error}")),
        };
        let (head, mut picture) =
            decode(&bytes).ok_or("is no checkpoint, or not a whole one: remove it to begin anew")?;
        let matte = |(name, manifest)| Cryptomatte { name, manifest };
        picture.cryptomattes = head.cryptomattes.into_iter().map(matte).collect();
        let unfinished = if head.key == self.key { task.go_on(picture, head.done) } else { None };
        unfinished.ok_or_else(|| {
            "is the checkpoint of another picture (scene, settings or size): remove it to begin anew".into()
        })
    }

    /// Writes all that is done, where the last time is long enough ago.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_if_due(&self, gathering: &Gathering) -> Result<(), OutputError> {
        // While one thread writes, the others go on.
        let Ok(mut last) = self.last.try_lock() else { return Ok(()) };
        if last.elapsed() < self.to.every {
            return Ok(());
        }
        self.write(gathering)?;
        *last = Instant::now();
        Ok(())
    }

    /// Writes all that is done.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, gathering: &Gathering) -> Result<(), OutputError> {
        let so_far = gathering.so_far();
        let done = so_far.done();
        let picture = gathering.task().finish(so_far, 0, Instant::now()).picture;
        aside::write(&self.to.path, &encode(&self.key, done, &picture))
    }
}

fn encode(key: &str, done: Vec<bool>, picture: &Picture) -> Vec<u8> {
    let kind = |channel: &Channel| match channel.samples.kind() {
        SampleKind::Half => 'h',
        SampleKind::Float => 'f',
        SampleKind::Uint => 'u',
    };
    let Window { x0, y0, x1, y1 } = picture.window;
    let head = Head {
        key: key.to_owned(),
        done,
        display: picture.display,
        window: [x0, y0, x1, y1],
        channels: picture.channels.iter().map(|channel| (channel.name.clone(), kind(channel))).collect(),
        cryptomattes: picture.cryptomattes.iter().map(|matte| (matte.name.clone(), matte.manifest.clone())).collect(),
    };
    let mut bytes = MAGIC.to_vec();
    // Names, numbers and flags: nothing that JSON cannot hold.
    bytes.extend(serde_json::to_vec(&head).unwrap_or_default());
    bytes.push(b'\n');
    bytes.extend(picture.pixels.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
    for channel in &picture.channels {
        match &channel.samples {
            Samples::Uint(values) => bytes.extend(values.iter().flat_map(|value| value.to_le_bytes())),
            floats => bytes.extend(floats.floats().iter().flat_map(|all| all.iter()).flat_map(|one| one.to_le_bytes())),
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
    picture.pixels = values.as_chunks::<4>().0.to_vec().into();
    for (name, kind) in &head.channels {
        let words = words(area);
        let floats = || words.iter().copied().map(f32::from_le_bytes).collect::<Vec<_>>();
        let samples = match kind {
            'h' => Samples::halves(&floats()),
            'f' => Samples::Float(floats().into()),
            'u' => Samples::Uint(words.iter().copied().map(u32::from_le_bytes).collect()),
            _ => return None,
        };
        picture.channels.push(Channel { name: name.clone(), samples });
    }
    Some((head, picture))
}
