//! Measuring: how far apart two pictures are.
//!
//! This room answers for [`metrics`] (numbers), `ssim` (one of them, with an algorithm of its own) and
//! [`mod@heatmap`] (a picture of the differences). It reads and judges; it renders nothing.

mod canvas;
pub mod heatmap;
pub mod metrics;
mod ssim;

pub use self::heatmap::heatmap;
pub use self::metrics::{CompareError, Comparison, compare};
