//! The film: what a render leaves behind.
//!
//! This room answers for the [`Picture`], the type that a renderer fills, that every writer of
//! [`crate::output`] takes and that every metric of [`crate::measure`] compares: colour, the [`Channel`]s
//! beside it, and the names behind [`Cryptomatte`] ids. Files, curves and quantisation belong to `output`.

mod band;
mod channel;
mod cryptomatte;
mod join;
mod picture;
mod plane;

pub use self::band::Band;
pub use self::channel::{Channel, SampleKind, Samples};
pub use self::cryptomatte::Cryptomatte;
pub use self::join::JoinError;
pub use self::picture::{Picture, Window};
pub use self::plane::Plane;
