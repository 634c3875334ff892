//! OpenEXR files: scan lines from the top, scene-linear and premultiplied, all layers of a picture beside its colour.
//!
//! One part, unless one a layer is asked for or a lossy compression needs a second. Display window and data window are
//! the picture's. Colour is stored in halves, or in floats where asked for; every other channel in its own type.
//! Neither NaN nor infinity is ever written. Equal pictures with equal descriptions become equal bytes, with
//! any number of threads.

mod header;
mod layout;
mod manifest;
mod packer;
mod sort;
mod zip;

use exr::meta::attribute::Text;

pub use self::header::Attributes;
pub(super) use self::header::PIXEL_HASH;
pub use self::manifest::Beside;
pub(super) use self::manifest::is_about as is_about_mattes;
pub use self::packer::Packer;

use super::color::Primaries;
use super::{Description, EncodeError, Losses};
use crate::film::Picture;

/// The largest finite half; beyond it the format has only infinity.
const HALF_MAX: f32 = 65504.0;

/// How the samples of a file are packed, by the names that OpenImageIO uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compression {
    /// As they are.
    None,
    /// Run lengths.
    Rle,
    /// Zlib, line by line: fast to read in compositing programs.
    #[default]
    Zips,
    /// Zlib, sixteen lines at once.
    Zip,
    /// Wavelets, 32 lines at once.
    Piz,
    /// Zlib of floats that are rounded to 24 bits.
    Pxr24,
    /// Lossy cosine transform, 32 lines at once.
    Dwaa,
    /// Lossy cosine transform, 256 lines at once.
    Dwab,
}

impl Compression {
    /// All, from the plainest on.
    pub const ALL: [Compression; 8] = {
        use Compression::*;
        [None, Rle, Zips, Zip, Piz, Pxr24, Dwaa, Dwab]
    };

    /// As OpenImageIO spells it.
    pub fn name(self) -> &'static str {
        match self {
            Compression::None => "none",
            Compression::Rle => "rle",
            Compression::Zips => "zips",
            Compression::Zip => "zip",
            Compression::Piz => "piz",
            Compression::Pxr24 => "pxr24",
            Compression::Dwaa => "dwaa",
            Compression::Dwab => "dwab",
        }
    }

    /// Whether samples may come back as others.
    pub fn may_loose_data(self) -> bool {
        self.method().may_loose_data()
    }

    pub(super) fn method(self) -> exr::prelude::Compression {
        use exr::prelude::Compression as Method;
        match self {
            Compression::None => Method::Uncompressed,
            Compression::Rle => Method::RLE,
            Compression::Zips => Method::ZIP1,
            Compression::Zip => Method::ZIP16,
            Compression::Piz => Method::PIZ,
            Compression::Pxr24 => Method::PXR24,
            Compression::Dwaa => Method::DWAA(None),
            Compression::Dwab => Method::DWAB(None),
        }
    }
}

/// The primaries in which colours are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ColorSpace {
    /// Linear Rec. 709 with D65, which readers take for granted.
    #[default]
    Rec709,
    /// ACEScg: linear, primaries AP1.
    AcesCg,
}

/// How a picture becomes an EXR file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Storage {
    /// Colour in 32-bit floats instead of halves.
    pub float: bool,
    /// How samples are packed. What loses data is kept from all channels but those of halves and the colour.
    pub compression: Compression,
    /// A part for each layer.
    pub multipart: bool,
    /// Depth as the channel `Z` instead of `depth.Z`.
    pub root_depth: bool,
    /// The primaries of colour, albedo and variance in the file.
    pub color: ColorSpace,
    /// Those that the picture is in.
    pub given: ColorSpace,
    /// The manifests of Cryptomattes in files beside the picture's, whatever their size.
    pub sidecar: bool,
}

impl ColorSpace {
    fn primaries(self) -> Primaries {
        match self {
            ColorSpace::Rec709 => Primaries::REC709,
            ColorSpace::AcesCg => Primaries::ACESCG,
        }
    }
}

/// An encoded file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Encoded {
    /// The file's bytes.
    pub bytes: Vec<u8>,
    /// What it could not hold.
    pub losses: Losses,
    /// Files that belong beside it, and are written before it.
    pub beside: Vec<Beside>,
}

/// The bytes of an EXR file, compressed on the threads of the pool that this is called in.
///
/// # Errors
/// A picture that is empty or not whole, a window that reaches further than the format counts (2^30), channels
/// without a name or with one name.
pub fn encode(picture: &Picture, storage: Storage, description: &Description) -> Result<Encoded, EncodeError> {
    EncodeError::unless_whole(picture)?;
    let packer = Packer::new(picture, storage)?;
    packer.pack(picture);
    packer.finish(&picture.cryptomattes, description)
}

/// UTF-8 as it is: the crate's own conversion panics beyond Latin-1.
fn text(words: &str) -> Text {
    Text::from_slice_unchecked(words.as_bytes())
}

#[cfg(test)]
mod tests;
