//! OpenEXR files: scan lines from the top, scene-linear and premultiplied, all layers of a picture beside its colour.
//!
//! One part, unless one a layer is asked for or a lossy compression needs a second. Display window and data window are
//! the picture's. Colour is stored in halves, or in floats where asked for; every other channel in its own type.
//! Neither NaN nor infinity is ever written. Equal pictures with equal descriptions become equal bytes, with
//! any number of threads.

mod header;
mod layout;
mod manifest;
mod sort;
mod zip;

use std::io::Cursor;

use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Text};
use exr::meta::header::Header;
use rayon::prelude::*;

pub use self::header::Attributes;
pub(super) use self::header::PIXEL_HASH;
pub use self::manifest::Beside;
pub(super) use self::manifest::is_about as is_about_mattes;

use self::layout::Part;
use super::color::{self, Primaries};
use super::pixel_hash::{Digests, PixelHash};
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
    /// The primaries of colour, albedo and variance.
    pub color: ColorSpace,
    /// The manifests of Cryptomattes in files beside the picture's, whatever their size.
    pub sidecar: bool,
}

impl Storage {
    fn primaries(self) -> Primaries {
        match self.color {
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
    let matrix = Primaries::REC709.matrix_to(storage.primaries()).filter(|_| storage.color != ColorSpace::Rec709);
    let picture = &*color::converted(picture, matrix.unwrap_or_default());
    let parts = layout::parts(picture, storage)?;
    let manifests = manifest::manifests(picture, storage.sidecar, description.file_stem.as_deref());
    let mut headers = header::headers(picture, &parts, storage, description, &manifests)?;
    MetaData::validate(&headers, true).map_err(EncodeError::new)?;
    let packed = pack(picture, &parts, &headers)?;
    let hash = hash(picture, &parts, &packed);
    headers[0].own_attributes.other.insert(text(PIXEL_HASH), AttributeValue::Text(text(&hash)));
    let bytes = file(headers, packed)?;
    let channels = parts.par_iter().flat_map(|part| part.channels.par_iter());
    let losses = channels.map(|channel| channel.source.losses()).reduce(Losses::default, Losses::and);
    Ok(Encoded { bytes, losses, beside: manifests.into_iter().filter_map(manifest::Manifest::beside).collect() })
}

/// A chunk of a file, its place among those of its part, and the digests of its rows, one a channel.
struct Packed {
    index: usize,
    chunk: Chunk,
    digests: Vec<Digests>,
}

/// Fills, hashes and compresses all chunks, each by itself.
fn pack(picture: &Picture, parts: &[Part<'_>], headers: &[Header]) -> Result<Vec<Packed>, EncodeError> {
    let meta = MetaData {
        requirements: MetaData::validate(headers, false).map_err(EncodeError::new)?,
        headers: headers.iter().cloned().collect(),
    };
    let blocks: Vec<(usize, BlockIndex)> = meta.enumerate_ordered_header_block_indices().collect();
    let one = |(index, block): (usize, BlockIndex)| {
        let (part, header) = (&parts[block.layer], &headers[block.layer]);
        let block = UncompressedBlock { index: block, data: rows(picture, part, header, block) };
        let exact = !header.compression.may_loose_data();
        let mut digests = if exact { digest(part, header, &block) } else { Vec::new() };
        let chunk = chunk(block, headers)?;
        if !exact {
            // The hash is of what a reader finds.
            let back = UncompressedBlock::decompress_chunk(chunk.clone(), &meta, true).map_err(EncodeError::new)?;
            digests = digest(part, header, &back);
        }
        Ok(Packed { index, chunk, digests })
    };
    blocks.into_par_iter().with_min_len(32).map(one).collect()
}

/// A block as it is stored.
fn chunk(block: UncompressedBlock, headers: &[Header]) -> Result<Chunk, EncodeError> {
    use exr::prelude::Compression::{ZIP1, ZIP16};
    let (layer_index, header) = (block.index.layer, &headers[block.index.layer]);
    if cfg!(target_endian = "big") || !matches!(header.compression, ZIP1 | ZIP16) {
        return block.compress_to_chunk(headers).map_err(EncodeError::new);
    }
    let y = i32::try_from(block.index.pixel_position.y()).map_err(EncodeError::new)?;
    let lines = CompressedScanLineBlock {
        y_coordinate: header.own_attributes.layer_position.y() + y,
        compressed_pixels_le: zip::pack(block.data),
    };
    Ok(Chunk { layer_index, compressed_block: CompressedBlock::ScanLine(lines) })
}

/// The rows of a block, as they are before compression.
fn rows(picture: &Picture, part: &Part<'_>, header: &Header, block: BlockIndex) -> Vec<u8> {
    let width = picture.window.width();
    let row_bytes = width * header.channels.bytes_per_pixel;
    let mut bytes = vec![0; row_bytes * block.pixel_size.height()];
    for (y, row) in (block.pixel_position.y()..).zip(bytes.chunks_exact_mut(row_bytes)) {
        part.put_row(y * width..(y + 1) * width, row);
    }
    bytes
}

/// For each channel, the digests of its rows in a block.
fn digest(part: &Part<'_>, header: &Header, block: &UncompressedBlock) -> Vec<Digests> {
    let mut digests = vec![Digests::default(); part.channels.len()];
    for line in block.lines(&header.channels) {
        let (channel, y) = (line.location.channel, line.location.position.y());
        digests[channel].push(y, line.value, header.channels.list[channel].sample_type);
    }
    digests
}

fn hash(picture: &Picture, parts: &[Part<'_>], packed: &[Packed]) -> String {
    let mut hash = PixelHash::new(picture.display, picture.window);
    for (layer, part) in parts.iter().enumerate() {
        let mine: Vec<&Packed> = packed.iter().filter(|packed| packed.chunk.layer_index == layer).collect();
        for (index, channel) in part.channels.iter().enumerate() {
            let rows = mine.iter().map(|packed| &packed.digests[index]);
            hash.add(channel.name.as_bytes(), channel.source.kind(), rows);
        }
    }
    hash.finish()
}

fn file(headers: Vec<Header>, packed: Vec<Packed>) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Cursor::new(Vec::new());
    let written = exr::block::write(&mut bytes, headers.into_iter().collect(), true, |_, writer| {
        packed.into_iter().try_for_each(|packed| writer.write_chunk(packed.index, packed.chunk))
    });
    written.map_err(EncodeError::new)?;
    let mut bytes = bytes.into_inner();
    sort::sort_attributes(&mut bytes).ok_or_else(|| EncodeError::new("the header cannot be read back"))?;
    Ok(bytes)
}

/// UTF-8 as it is: the crate's own conversion panics beyond Latin-1.
fn text(words: &str) -> Text {
    Text::from_slice_unchecked(words.as_bytes())
}

#[cfg(test)]
mod tests;
