//! Pictures in and out of files.
//!
//! This room answers for what a file holds, byte by byte: [`exr`] and [`png`] encode a picture,
//! [`aside`] puts bytes under a name without ever leaving half a file there, [`mod@read`] brings a file
//! back as a picture, [`description`] says where a picture comes from, [`srgb`] is the display curve, and `pq` that of displays of high dynamic range.
//! What the pixels mean is settled before: scene-linear, premultiplied ([`Picture`]).

pub mod aside;
mod color;
pub mod description;
mod display;
pub mod exr;
mod pixel_hash;
pub mod png;
mod pq;
pub mod read;
pub mod srgb;
mod view;

use std::path::{Path, PathBuf};

use thiserror::Error;

pub use self::description::{Description, Run};
pub use self::display::{Display, ToneMap};
pub use self::exr::{Attributes, Beside, ColorSpace, Compression, Encoded, Storage};
pub use self::png::{Bits, Coding, Transfer};
pub use self::read::{Contents, HashPair, ReadError, read, read_all, read_as_stored};
use crate::film::Picture;

/// The kinds of file that a picture can become.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// OpenEXR: scene-linear, with all that is known of the picture.
    Exr,
    /// PNG: what a display shows.
    Png,
}

impl Format {
    /// By the extension of a name, upper or lower case; `None` for any other.
    pub fn of(path: &Path) -> Option<Format> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "exr" => Some(Format::Exr),
            "png" => Some(Format::Png),
            _ => None,
        }
    }
}

/// How samples are stored.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Options {
    /// EXR: types, compression, parts.
    pub exr: Storage,
    /// PNG: bits per sample, and what a display is to show.
    pub coding: Coding,
}

/// Samples that a file could not hold as they were.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Losses {
    /// Samples beyond the largest half (EXR), or outside 0..1 (PNG), stored as the nearest bound.
    pub clamped: u64,
    /// Samples that were NaN or infinite, stored as 0.
    pub dropped: u64,
}

/// A picture that could not be written. Nothing is left behind under its name, or what was there before.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The name says no known format.
    #[error("{}: unknown kind of picture: the name should end in .exr or .png", path.display())]
    Format {
        /// The output name.
        path: PathBuf,
    },
    /// The name belongs to a directory, or names no file at all.
    #[error("{}: is a directory: the output should be a file name", path.display())]
    Directory {
        /// The output name.
        path: PathBuf,
    },
    /// The directory of the name is not there.
    #[error("{}: cannot be written: there is no directory {}", path.display(), directory.display())]
    NoDirectory {
        /// The output name.
        path: PathBuf,
        /// What is missing.
        directory: PathBuf,
    },
    /// The system refused: no permission, no space, a broken disk.
    #[error("{}: cannot be written: {source}", path.display())]
    Io {
        /// The output name.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The picture does not fit the format, or is not whole.
    #[error("{}: cannot be encoded: {reason}", path.display())]
    Encode {
        /// The output name.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
}

/// Writes a picture in the format that the name says, so that the name stands for a whole file or is left as it was.
///
/// # Errors
/// Any [`OutputError`]; each names the path and the cause.
pub fn write(
    path: &Path,
    picture: &Picture,
    options: Options,
    description: &Description,
) -> Result<Losses, OutputError> {
    let format = Format::of(path).ok_or_else(|| OutputError::Format { path: path.into() })?;
    let described = Description { file_stem: stem(path), ..description.clone() };
    let encoded = encode(format, picture, options, &described);
    let encoded = encoded.map_err(|reason| OutputError::Encode { path: path.into(), reason: reason.0 })?;
    for file in &encoded.beside {
        aside::write(&path.with_file_name(&file.name), &file.bytes)?;
    }
    aside::write(path, &encoded.bytes)?;
    Ok(encoded.losses)
}

/// The bytes of a picture's file, and what else belongs to it.
///
/// # Errors
/// A picture that is not whole, or does not fit the format.
pub fn encode(
    format: Format,
    picture: &Picture,
    options: Options,
    description: &Description,
) -> Result<Encoded, EncodeError> {
    match format {
        Format::Exr => exr::encode(picture, options.exr, description),
        Format::Png => {
            let (bytes, losses) = png::encode(picture, options.coding, description)?;
            Ok(Encoded { bytes, losses, beside: Vec::new() })
        }
    }
}

/// The name of a file without directory and extension, after which files beside it are named; beside standard output,
/// `-`, there are none.
pub fn stem(path: &Path) -> Option<String> {
    path.file_stem().filter(|_| path.as_os_str() != "-").map(|stem| stem.to_string_lossy().into_owned())
}

/// Why a picture cannot be encoded: it is not whole, or too large for the format.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct EncodeError(pub String);

impl EncodeError {
    fn new(reason: impl ToString) -> Self {
        EncodeError(reason.to_string())
    }

    /// Refuses a picture whose list of pixels does not fill its window.
    fn unless_whole(picture: &Picture) -> Result<(), EncodeError> {
        if picture.is_whole() {
            return Ok(());
        }
        Err(EncodeError(format!("{} pixels for a window of {}", picture.pixels.len(), picture.window)))
    }
}
