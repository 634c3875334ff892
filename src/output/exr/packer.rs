//! A file in the making: rows of its picture are packed as they come.
//!
//! Chunks do not know of each other, nor of the header before them, which can only be written once all is known: so rows
//! that are done need not wait for the others, and what they were in memory can be given to the next ones.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::AttributeValue;
use exr::meta::header::Header;
use glam::DMat3;
use rayon::prelude::*;

use super::header::PIXEL_HASH;
use super::layout::{self, Part};
use super::{Encoded, Storage, header, manifest, sort, text, zip};
use crate::film::{Cryptomatte, Picture, Window};
use crate::output::color;
use crate::output::pixel_hash::{Digests, PixelHash};
use crate::output::{Description, EncodeError, Losses};

/// Chunks of a job that is worth a thread, at least.
const JOB: usize = 8;

/// Takes the rows of a picture in any order and from any threads, and makes a file of them.
#[derive(Debug)]
pub struct Packer {
    /// What it is a picture of, without a sample.
    picture: Picture,
    storage: Storage,
    /// From the primaries of pictures to those of the file.
    matrix: DMat3,
    parts: Vec<Part>,
    /// All that chunks need to know of the headers.
    meta: MetaData,
    packed: Mutex<Result<Chunks, EncodeError>>,
    /// Nanoseconds of all threads.
    spent: AtomicU64,
}

/// By part and place among its chunks.
type Chunks = BTreeMap<(usize, usize), Packed>;

/// A chunk, the digests of its rows, one a channel, and what it could not hold.
#[derive(Debug, Clone)]
struct Packed {
    chunk: Chunk,
    digests: Vec<Digests>,
    losses: Losses,
}

impl Packer {
    /// For a picture of this window, these channels and these Cryptomattes: its samples are not looked at.
    ///
    /// # Errors
    /// A window that is empty or reaches further than the format counts (2^30), channels without a name or with one name.
    pub fn new(picture: &Picture, storage: Storage) -> Result<Self, EncodeError> {
        let picture = picture.hollow();
        let parts = layout::parts(&picture, storage)?;
        let headers = header::headers(&picture, &parts, storage, &Description::default(), &[])?;
        let requirements = MetaData::validate(&headers, true).map_err(EncodeError::new)?;
        let Storage { given, color, .. } = storage;
        let matrix = given.primaries().matrix_to(color.primaries()).filter(|_| color != given);
        Ok(Packer {
            picture,
            storage,
            matrix: matrix.unwrap_or_default(),
            parts,
            meta: MetaData { requirements, headers: headers.into_iter().collect() },
            packed: Mutex::new(Ok(Chunks::new())),
            spent: AtomicU64::new(0),
        })
    }

    /// Rows that come at once are some multiple of so many, counted from the first one, or the last ones.
    pub fn rows(&self) -> usize {
        let lines = self.meta.headers.iter().map(|header| header.compression.scan_lines_per_block());
        lines.max().unwrap_or(1)
    }

    /// Packs rows of the picture, all of its width, on the threads of the pool that this is called in.
    pub fn pack(&self, rows: &Picture) {
        let rows = &*self.timed(|| color::converted(rows, self.matrix));
        let blocks = self.blocks(rows.window).into_par_iter().with_min_len(JOB);
        self.add(blocks.map(|(place, block)| Ok((place, self.timed(|| self.chunk(rows, block))?))).collect());
    }

    /// Seconds that packing took, of all threads together.
    pub fn seconds(&self) -> f64 {
        self.spent.load(Ordering::Relaxed) as f64 * 1e-9
    }

    /// One of the rows so far and of those that wait for others: as it would be if these were all.
    ///
    /// # Errors
    /// As [`Packer::new`].
    pub fn so_far(&self, waiting: impl Iterator<Item = Picture>) -> Result<Packer, EncodeError> {
        let packer = Packer::new(&self.picture, self.storage)?;
        // Those that are being packed meanwhile wait no more, and are there later.
        waiting.for_each(|rows| packer.pack(&rows));
        packer.add(self.packed.lock().unwrap_or_else(PoisonError::into_inner).clone());
        Ok(packer)
    }

    /// The file, once all rows are there.
    ///
    /// # Errors
    /// Rows that did not fit, or are not there.
    pub fn finish(self, cryptomattes: &[Cryptomatte], description: &Description) -> Result<Encoded, EncodeError> {
        let Packer { picture, storage, parts, packed, .. } = self;
        let packed = packed.into_inner().unwrap_or_else(PoisonError::into_inner)?;
        let manifests = manifest::manifests(cryptomattes, storage.sidecar, description.file_stem.as_deref());
        let mut headers = header::headers(&picture, &parts, storage, description, &manifests)?;
        MetaData::validate(&headers, true).map_err(EncodeError::new)?;
        let hash = hash(&picture, &parts, &packed);
        headers[0].own_attributes.other.insert(text(PIXEL_HASH), AttributeValue::Text(text(&hash)));
        // Rows were counted from a display window at (0, 0).
        let above = headers[0].own_attributes.layer_position.y() - picture.window.y0;
        let losses = packed.values().fold(Losses::default(), |losses, packed| losses.and(packed.losses));
        let bytes = file(headers, packed, above)?;
        Ok(Encoded { bytes, losses, beside: manifests.into_iter().filter_map(manifest::Manifest::beside).collect() })
    }

    fn timed<T>(&self, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let done = work();
        let spent = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.spent.fetch_add(spent, Ordering::Relaxed);
        done
    }

    fn add(&self, packed: Result<Chunks, EncodeError>) {
        let mut all = self.packed.lock().unwrap_or_else(PoisonError::into_inner);
        match (&mut *all, packed) {
            (Ok(all), Ok(more)) => all.extend(more),
            (Ok(_), Err(error)) => *all = Err(error),
            (Err(_), _) => {}
        }
    }

    /// All blocks of all parts in some rows, with their places.
    fn blocks(&self, rows: Window) -> Vec<((usize, usize), BlockIndex)> {
        let place = |y: i32| y.abs_diff(self.picture.window.y0) as usize;
        let blocks = |(layer, header): (usize, &Header)| {
            let lines = header.compression.scan_lines_per_block();
            let block = move |y: usize| BlockIndex {
                layer,
                pixel_position: Vec2(0, y),
                pixel_size: Vec2(rows.width(), lines.min(place(rows.y1) - y)),
                level: Vec2(0, 0),
            };
            (place(rows.y0)..place(rows.y1)).step_by(lines).map(move |y| ((layer, y / lines), block(y)))
        };
        self.meta.headers.iter().enumerate().flat_map(blocks).collect()
    }

    /// Fills, hashes and compresses a block.
    fn chunk(&self, rows: &Picture, block: BlockIndex) -> Result<Packed, EncodeError> {
        let (part, header) = (&self.parts[block.layer], &self.meta.headers[block.layer]);
        let (block, losses) = self.filled(rows, block);
        let exact = !header.compression.may_loose_data();
        let mut digests = if exact { digest(part, header, &block) } else { Vec::new() };
        let chunk = compressed(block, &self.meta.headers)?;
        if !exact {
            // The hash is of what a reader finds.
            let back = UncompressedBlock::decompress_chunk(chunk.clone(), &self.meta, true);
            digests = digest(part, header, &back.map_err(EncodeError::new)?);
        }
        Ok(Packed { chunk, digests, losses })
    }

    /// A block as it is before compression, and what it does not hold.
    fn filled(&self, rows: &Picture, index: BlockIndex) -> (UncompressedBlock, Losses) {
        let (part, header) = (&self.parts[index.layer], &self.meta.headers[index.layer]);
        let (width, above) = (rows.window.width(), rows.window.y0.abs_diff(self.picture.window.y0) as usize);
        let row_bytes = width * header.channels.bytes_per_pixel;
        let mut data = vec![0; row_bytes * index.pixel_size.height()];
        let lines = (index.pixel_position.y() - above..).zip(data.chunks_exact_mut(row_bytes));
        let put = |losses: Losses, (y, row): (usize, &mut [u8])| {
            losses.and(part.put_row(rows, y * width..(y + 1) * width, row))
        };
        let losses = lines.fold(Losses::default(), put);
        (UncompressedBlock { index, data }, losses)
    }
}

/// A block as it is stored.
fn compressed(block: UncompressedBlock, headers: &[Header]) -> Result<Chunk, EncodeError> {
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

/// For each channel, the digests of its rows in a block.
fn digest(part: &Part, header: &Header, block: &UncompressedBlock) -> Vec<Digests> {
    let mut digests = vec![Digests::default(); part.channels.len()];
    for line in block.lines(&header.channels) {
        let (channel, y) = (line.location.channel, line.location.position.y());
        digests[channel].push(y, line.value, header.channels.list[channel].sample_type);
    }
    digests
}

fn hash(picture: &Picture, parts: &[Part], packed: &Chunks) -> String {
    let mut hash = PixelHash::new(picture.display, picture.window);
    for (layer, part) in parts.iter().enumerate() {
        for (index, channel) in part.channels.iter().enumerate() {
            let rows = packed.range((layer, 0)..(layer + 1, 0)).map(|(_, packed)| &packed.digests[index]);
            hash.add(channel.name.as_bytes(), channel.source.kind(), rows);
        }
    }
    hash.finish()
}

/// All of a file; the rows of chunks lie so much lower in it than they say.
fn file(headers: Vec<Header>, packed: Chunks, above: i32) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Cursor::new(Vec::new());
    let written = exr::block::write(&mut bytes, headers.into_iter().collect(), true, |_, writer| {
        packed.into_iter().try_for_each(|((_, index), Packed { mut chunk, .. })| {
            if let CompressedBlock::ScanLine(lines) = &mut chunk.compressed_block {
                lines.y_coordinate += above;
            }
            writer.write_chunk(index, chunk)
        })
    });
    written.map_err(EncodeError::new)?;
    let mut bytes = bytes.into_inner();
    sort::sort_attributes(&mut bytes).ok_or_else(|| EncodeError::new("the header cannot be read back"))?;
    Ok(bytes)
}
