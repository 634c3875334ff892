//! octray: a batch renderer and ray-tracing library for analytic primitives.
#![forbid(unsafe_code)]

pub mod film;
pub mod measure;
pub mod output;
pub mod sample;
pub mod scene;
