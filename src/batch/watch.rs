//! What a batch tells while it goes on.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::Job;
use crate::film::Window;
use crate::output::{EncodeError, Encoded, Losses, OutputError};
use crate::render::{IdNames, RenderError, Renderer, Rendering, Stats};
use crate::scene::SceneErrors;

/// Told how a batch goes on, and asked whether it is to go on. Called from any thread.
pub trait Watch: Sync {
    /// Something happened.
    fn event(&self, event: &Event<'_>);
    /// Whether to stop as soon as possible.
    fn cancelled(&self) -> bool {
        false
    }
    /// Asked before a picture is begun that will need so many bytes of memory.
    ///
    /// # Errors
    /// Why that is too much.
    fn room(&self, _bytes: u64, _work: &str) -> Result<(), String> {
        Ok(())
    }
}

/// What happened; jobs are named by their index in the list.
pub enum Event<'a> {
    /// A job begins.
    FrameStart(usize, &'a Job),
    /// So much of all jobs is done, 0..1, and work on this one was the last.
    Progress(f64, usize, &'a Job),
    /// A block of a job's picture was traced and is about to be put among those before.
    Block(usize, &'a Job, &'a Renderer<'a>, &'a Fresh<'a>),
    /// The picture of a job is there, but not written yet: told of those that are kept until then.
    Traced(usize, &'a Job, &'a Rendering),
    /// The file of a job has its name.
    FrameDone(usize, &'a Job, &'a Report),
    /// The file of a job was there already, whole and up to date.
    Skipped(usize, &'a Job),
    /// The first job of a scene file: MiB that it will take, as guessed from its files, and MiB that are allowed.
    Forecast(&'a Job, u64, u64),
    /// Something about a job that may be wrong.
    Warning(usize, &'a Job, String),
    /// A job failed; the others go on.
    Error(usize, &'a Job, &'a JobError),
}

/// A block that was traced, for those who look on.
pub struct Fresh<'a> {
    /// Where it lies.
    pub window: Window,
    /// Its colour, row by row.
    pub pixels: &'a [[f32; 4]],
    /// Makes a file of this name of the blocks before it.
    pub so_far: &'a dyn Fn(&Path) -> Result<Encoded, EncodeError>,
}

/// How a picture came about.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Report {
    /// Work and time of the render.
    pub stats: Stats,
    /// Seconds for reading the scene; 0 where another job had read it.
    pub load_seconds: f64,
    /// Seconds for encoding and writing.
    pub write_seconds: f64,
    /// The pixels rendered.
    pub window: Option<Window>,
    /// Samples per pixel.
    pub spp: u32,
    /// What the numbers in its id channels stand for.
    pub names: IdNames,
    /// What the format could not hold.
    pub losses: Losses,
    /// Length of the file.
    pub bytes: u64,
    /// SHA-256 of the file, in hexadecimal.
    pub hash: String,
}

/// Why there is no picture.
#[derive(Debug, Error)]
pub enum JobError {
    /// The scene is wrong.
    #[error("{errors}")]
    Scene {
        /// The scene file.
        path: PathBuf,
        /// All mistakes.
        errors: SceneErrors,
    },
    /// The picture cannot be rendered.
    #[error("{}: {error}", path.display())]
    Render {
        /// The scene file.
        path: PathBuf,
        /// What does not fit.
        error: RenderError,
    },
    /// The picture cannot be encoded.
    #[error("{}: cannot be encoded: {error}", path.display())]
    Encode {
        /// The output name.
        path: PathBuf,
        /// What does not fit.
        error: EncodeError,
    },
    /// The checkpoint cannot be gone on from.
    #[error("{}: {reason}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// It would need more memory than there is, or than was allowed.
    #[error("{0}")]
    Memory(String),
    /// A mistake in octray itself.
    #[error("{}: a mistake in octray itself", path.display())]
    Mistake {
        /// The scene file.
        path: PathBuf,
    },
    /// Asked to stop before it was done.
    #[error("stopped before the picture was finished")]
    Cancelled,
}
