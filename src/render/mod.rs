//! A frame: tiles over the cores, cancellation, statistics.

mod adaptive;
mod block;
mod coverage;
mod frame;
mod gather;
mod layers;
mod passing;
mod query;
mod reference;
mod renderer;
mod shutter;
mod stats;
mod task;
mod tiles;

pub use self::adaptive::Reached;
pub use self::frame::Frame;
pub use self::gather::{Gathering, Shown, Unfinished};
pub use self::layers::IdNames;
pub use self::query::{Answers, Batch, Query};
pub(crate) use self::renderer::pool;
pub use self::renderer::{Renderer, Rendering};
pub use self::shutter::moments;
pub use self::stats::Stats;
pub use self::task::{Task, Traced};

use crate::film::Window;
use crate::plan::InvalidScene;

/// Which tracer finds the hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Engine {
    /// Tiles of packets where rays agree, single rays where they do not.
    #[default]
    Packet,
    /// Every ray by itself: the same bits, more slowly.
    Single,
    /// The [reference](crate::reference) in f64: every ray against every primitive.
    Reference,
}

/// Told how a render goes on, and asked whether it is to go on. Called from any thread.
pub trait Progress: Sync {
    /// `done` of `total` samples are finished.
    fn advance(&self, done: u64, total: u64);
    /// A block is done and about to be put into the picture.
    fn block(&self, _shown: &Shown) {}
    /// Whether to stop as soon as possible.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Nobody to tell.
impl Progress for () {
    fn advance(&self, _: u64, _: u64) {}
}

/// Why there is no picture.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RenderError {
    /// The scene has no camera.
    #[error("the scene has no camera: add a [camera] table with eye, target and vfov")]
    NoCamera,
    /// No camera of this name; the names there are.
    #[error("there is no camera named \"{name}\" in the scene; it has {known}")]
    UnknownCamera {
        /// The name asked for.
        name: String,
        /// The names there are, for a reader.
        known: String,
    },
    /// The scene has no image size.
    #[error("the scene has no image size: add an [image] table with width and height, or say --resolution WxH")]
    NoImage,
    /// The window lies outside the picture, or holds nothing.
    #[error("the crop {window} does not lie inside the picture of {width}x{height} pixels")]
    BadWindow {
        /// The window asked for.
        window: Window,
        /// Of the display window.
        width: u32,
        /// Of the display window.
        height: u32,
    },
    /// The scene was made by hand and breaks a rule.
    #[error(transparent)]
    Scene(#[from] InvalidScene),
    /// The reference does not do both.
    #[error(
        "the reference engine renders layers with as many samples for all pixels: leave the noise level or the layers out"
    )]
    NoiseWithLayers,
    /// Moments have as many samples each.
    #[error("motion blur needs as many samples for all pixels: leave the noise level or the shutter out")]
    NoiseWithShutter,
    /// The threads could not be started.
    #[error("cannot start threads: {0}")]
    Threads(String),
    /// Asked to stop.
    #[error("stopped before the picture was finished")]
    Cancelled,
}
