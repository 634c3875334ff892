//! Scenes that jobs share: each is read once, one frame of a file after the other.

use std::collections::{HashMap, VecDeque};
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};

use super::Job;
use crate::render::Renderer;
use crate::scene::inputs::{hex, sha256};
use crate::scene::particles::Look;
use crate::scene::{Frames, Scene, SceneErrors, SceneSum};

/// Scenes that are kept after their last job, in case that there will be another one.
const KEPT: usize = 4;
/// Primitives that the kept ones have together at most, but for the last one.
const KEPT_PRIMITIVES: usize = 4_000_000;

/// All scene files of a batch.
#[derive(Default)]
pub struct Sources {
    files: Mutex<Vec<Arc<Source>>>,
    kept: Mutex<VecDeque<(Key, Arc<Shared>)>>,
}

/// A scene, and what all its pictures need of it.
#[derive(Debug)]
pub struct Shared {
    /// The scene.
    pub scene: Scene,
    sum: OnceLock<SceneSum>,
}

impl Shared {
    /// The hash of the scene and of a picture's settings, and of the next frame where what is blurred goes there.
    pub fn picture_hash(&self, renderer: &Renderer, next: Option<&Shared>) -> String {
        let own = renderer.hash_after(self.sum());
        match next {
            Some(next) if renderer.settings().shutter > 0.0 => {
                let both = format!("{own} {}", next.sum().hash(""));
                sha256(&mut both.as_bytes()).map_or(own, |hash| hex(&hash))
            }
            _ => own,
        }
    }

    /// It as a hash, made once.
    pub fn sum(&self) -> &SceneSum {
        self.sum.get_or_init(|| self.scene.sum())
    }
}

/// A scene file, the size of its picture, the frame, and whether its background is transparent.
type Key = (PathBuf, Option<(u32, u32)>, i64, bool);

/// One file, whose frames are read in the order in which jobs asked for them.
struct Source {
    path: PathBuf,
    resolution: Option<(u32, u32)>,
    look: Look,
    turns: Mutex<Turns>,
    next: Condvar,
}

struct Turns {
    frames: Option<Frames>,
    handed_out: u64,
    served: u64,
}

/// A place in the line for a scene file.
pub struct Ticket {
    source: Arc<Source>,
    turn: u64,
    key: Key,
}

impl Sources {
    /// A place in the line for the scene of a job, given up when it is dropped.
    pub fn ticket(&self, job: &Job) -> Ticket {
        let resolution = job.settings.resolution;
        let mut files = lock(&self.files);
        let known = files
            .iter()
            .rev()
            .find(|file| file.path == job.scene && file.resolution == resolution && file.look == job.look);
        let source = known.cloned().unwrap_or_else(|| {
            let frames = Frames::new(&job.scene).look(job.look.clone()).resolution(resolution);
            let turns = Mutex::new(Turns { frames: Some(frames), handed_out: 0, served: 0 });
            let (path, look) = (job.scene.clone(), job.look.clone());
            let source = Arc::new(Source { path, resolution, look, turns, next: Condvar::new() });
            files.push(Arc::clone(&source));
            source
        });
        drop(files);
        let mut turns = lock(&source.turns);
        let turn = turns.handed_out;
        turns.handed_out += 1;
        drop(turns);
        Ticket { key: (job.scene.clone(), resolution, job.frame(), job.settings.transparent), source, turn }
    }

    /// The scene of a ticket, and whether it was read for it; waits for those who asked before.
    ///
    /// # Errors
    /// What is wrong with the scene.
    pub fn load(&self, ticket: Ticket) -> Result<(Arc<Shared>, bool), SceneErrors> {
        let (source, key) = (&ticket.source, &ticket.key);
        let mut turns = lock(&source.turns);
        while turns.served < ticket.turn {
            turns = source.next.wait(turns).unwrap_or_else(PoisonError::into_inner);
        }
        if let Some(scene) = self.kept(key) {
            return Ok((scene, false));
        }
        // A reader that panics is gone, and the next one begins anew.
        let mut frames = turns.frames.take().unwrap_or_else(|| source.frames());
        drop(turns);
        let scene = frames.scene(key.2).map(|mut scene| {
            scene.background.transparent |= key.3;
            Arc::new(Shared { scene, sum: OnceLock::new() })
        });
        lock(&source.turns).frames = Some(frames);
        let scene = scene?;
        self.keep(key.clone(), &scene);
        Ok((scene, true))
    }

    fn kept(&self, key: &Key) -> Option<Arc<Shared>> {
        let mut kept = lock(&self.kept);
        let at = kept.iter().position(|(known, _)| known == key)?;
        let found = kept.remove(at)?;
        let scene = Arc::clone(&found.1);
        kept.push_front(found);
        Some(scene)
    }

    fn keep(&self, key: Key, scene: &Arc<Shared>) {
        let mut kept = lock(&self.kept);
        kept.push_front((key, Arc::clone(scene)));
        let mut primitives = 0;
        let mut fits = |(place, (_, shared)): (usize, &(Key, Arc<Shared>))| {
            primitives += shared.scene.primitive_count();
            place == 0 || (place < KEPT && primitives <= KEPT_PRIMITIVES)
        };
        let count = kept.iter().enumerate().take_while(|entry| fits(*entry)).count();
        kept.truncate(count);
    }
}

/// Lets the next one in, however the reading ended.
impl Drop for Ticket {
    fn drop(&mut self) {
        let mut turns = lock(&self.source.turns);
        turns.served = turns.served.max(self.turn + 1);
        self.source.next.notify_all();
    }
}

impl Source {
    fn frames(&self) -> Frames {
        Frames::new(&self.path).look(self.look.clone()).resolution(self.resolution)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// How often each file was asked for.
impl std::fmt::Debug for Sources {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: HashMap<PathBuf, u64> =
            lock(&self.files).iter().map(|file| (file.path.clone(), lock(&file.turns).served)).collect();
        f.debug_tuple("Sources").field(&names).finish()
    }
}
