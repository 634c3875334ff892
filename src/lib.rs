//! octray: a batch renderer and ray-tracing library for analytic primitives.
#![forbid(unsafe_code)]

pub mod accel;
pub mod batch;
pub mod film;
pub mod integrate;
pub mod lanes;
pub mod measure;
pub mod output;
pub mod plan;
pub mod reference;
pub mod render;
pub mod sample;
pub mod scene;
pub mod shade;
pub mod shapes;
mod tracer;

// Fixtures name this crate as the tests outside of it do.
#[cfg(test)]
extern crate self as octray;
#[cfg(test)]
#[path = "../tests/common/mod.rs"]
mod fixtures;

pub use lanes::Ray;
pub use render::{Batch, Progress, Query, Renderer, Rendering};
pub use scene::Scene;
pub use tracer::{Hit, Tracer};
