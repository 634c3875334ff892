//! Measuring: how far apart two pictures are, and two tracers.
//!
//! This room answers for [`mod@check`] (the engine against the reference), [`metrics`] (numbers), `ssim` (one of them, with an algorithm of its own) and
//! [`mod@heatmap`] (a picture of the differences). It judges; it changes nothing.

mod canvas;
pub mod check;
pub mod heatmap;
pub mod metrics;
mod ssim;

pub use self::heatmap::heatmap;
pub use self::metrics::{CompareError, Comparison, compare};
