//! Measuring: how far apart two pictures are, and two tracers.
//!
//! This room answers for [`mod@check`] (the engine against the reference), [`metrics`] (numbers), `ssim` (one of them, with an algorithm of its own) and
//! [`mod@heatmap`] (a picture of the differences), [`mod@bench`] (throughput by the kind of ray), [`mod@gate`] (one build against another), and [`mod@pareto`] (run time against error). It judges; it changes nothing.

pub mod bench;
mod canvas;
pub mod check;
pub mod explain;
pub mod gate;
pub mod heatmap;
pub mod layers;
pub mod metrics;
pub mod pareto;
pub mod plot;
mod ssim;
pub mod stress;

pub use self::heatmap::heatmap;
pub use self::metrics::{Channel, CompareError, Comparison, Spread, compare};
