//! The film: what a render leaves behind.
//!
//! This room answers for the [`Picture`], the type that a renderer fills, that every writer of
//! [`crate::output`] takes and that every metric of [`crate::measure`] compares. Files, curves and
//! quantisation belong to `output`.

mod picture;

pub use self::picture::{Picture, Window};
