//! Many pictures in one process: jobs over the cores, each failing by itself.
//!
//! This room answers for what is rendered when and by whom ([`run()`]), for what jobs share ([`Sources`]), for the order
//! in which files appear, and for what is left to do after an interruption ([`existing`], [`ledger`]). What a picture
//! shows is settled by the scene and by [`Settings`]; a picture is the same to the bit alone and in a batch.
//!
//! Data goes through four stages that overlap: a scene is read once for all jobs that share it, its picture is traced
//! (small ones one a core, large ones by all cores), encoded (the rows of an EXR as soon as their blocks are there, all else
//! on the core that finished the picture), and written by a thread of its own, which makes files durable in groups.

mod annotate;
mod checkpoint;
mod choice;
pub mod existing;
pub mod frames;
mod job;
pub mod ledger;
pub mod manifest;
pub mod memory;
pub mod names;

mod run;
mod source;
mod watch;
mod words;
mod write;

pub use self::checkpoint::Checkpoint;
pub use self::choice::{LayerChoice, Overscan, Tile, WindowChoice};
pub use self::job::{Job, Settings, Shard, View, stem};
pub use self::run::{Options, Summary, run};
pub use self::source::Sources;
pub use self::watch::{Event, Fresh, JobError, Report, Watch};
