//! octray: a batch renderer and ray-tracing library for analytic primitives.
#![forbid(unsafe_code)]

pub mod accel;
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

pub use lanes::Ray;
pub use render::{Progress, Query, Renderer, Rendering};
pub use scene::Scene;
pub use tracer::{Hit, Tracer};
