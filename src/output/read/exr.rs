//! EXR: the colours of the first part, chunk by chunk.
//!
//! Chunks are taken one by one, so that what they promise can be held against their size before they are decoded.

use std::io::{BufRead, Seek};

use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::lines::LineRef;
use exr::block::reader::ChunksReader;
use exr::block::{self, UncompressedBlock};
use exr::math::Vec2;
use exr::meta::attribute::{Compression, SampleType};
use exr::meta::header::Header;
use half::f16;

use super::{Fault, check_length, check_pixels};
use crate::film::{Picture, Window};

impl From<exr::error::Error> for Fault {
    fn from(error: exr::error::Error) -> Self {
        match error {
            exr::error::Error::Io(error) => Fault::Io(error),
            exr::error::Error::NotSupported(reason) => Fault::Unsupported(reason.into()),
            exr::error::Error::Invalid(reason) => Fault::Damaged(reason.into()),
            exr::error::Error::Aborted => Fault::Damaged("reading was cut off".into()),
        }
    }
}

pub(super) fn read(reader: impl BufRead + Seek, length: usize) -> Result<Picture, Fault> {
    let chunks = block::read(reader, false)?;
    let header = chunks.headers().first().cloned().ok_or_else(|| Fault::Damaged("it has no header".into()))?;
    let slots = slots(&header);
    check_header(&header, length)?;
    let (display, window) = windows(&header)?;
    let mut picture = Picture { pixels: vec![[0.0, 0.0, 0.0, 1.0]; window.area()], ..Picture::new(display, window) };
    // Strict about the places of chunks, so that none is missed in silence.
    let chunks = chunks.filter_chunks(true, |_, tile, block| block.layer == 0 && tile.level_index == Vec2(0, 0))?;
    let meta = chunks.meta_data().clone();
    for chunk in chunks {
        let chunk = chunk?;
        check_chunk(&header, &chunk)?;
        let block = UncompressedBlock::decompress_chunk(chunk, &meta, true)?;
        for line in block.lines(&header.channels) {
            let channel = line.location.channel;
            fill(&mut picture, line, header.channels.list[channel].sample_type, slots[channel])?;
        }
    }
    Ok(picture)
}

/// Which samples of a pixel each channel of the file becomes.
fn slots(header: &Header) -> Vec<&'static [usize]> {
    let grey = !has(header, "R");
    let slot = |name: &[u8]| -> &'static [usize] {
        match name {
            b"R" => &[0],
            b"G" if !grey => &[1],
            b"B" if !grey => &[2],
            b"A" => &[3],
            b"Y" if grey => &[0, 1, 2],
            _ => &[],
        }
    };
    header.channels.list.iter().map(|channel| slot(channel.name.as_slice())).collect()
}

/// Puts a line of one channel into its place.
fn fill(picture: &mut Picture, line: LineRef<'_>, kind: SampleType, slots: &[usize]) -> Result<(), Fault> {
    if slots.is_empty() {
        return Ok(());
    }
    let Vec2(x, y) = line.location.position;
    let start = y * picture.window.width() + x;
    let pixels = picture.pixels.get_mut(start..start + line.location.sample_count);
    let pixels = pixels.ok_or_else(|| Fault::Damaged("a line lies outside its window".into()))?;
    let mut put = |index: usize, value: f32| slots.iter().for_each(|&slot| pixels[index][slot] = value);
    match kind {
        SampleType::F16 => line.read_samples::<f16>().enumerate().try_for_each(|(i, v)| v.map(|v| put(i, v.to_f32()))),
        SampleType::F32 => line.read_samples::<f32>().enumerate().try_for_each(|(i, v)| v.map(|v| put(i, v))),
        SampleType::U32 => line.read_samples::<u32>().enumerate().try_for_each(|(i, v)| v.map(|v| put(i, v as f32))),
    }?;
    Ok(())
}

fn has(header: &Header, name: &str) -> bool {
    header.channels.list.iter().any(|channel| channel.name == *name)
}

/// Refuses what is not read here, and sizes that a file of this length cannot hold.
fn check_header(header: &Header, length: usize) -> Result<(), Fault> {
    let unsupported = |reason: &str| Err(Fault::Unsupported(reason.into()));
    if header.deep {
        return unsupported("it holds deep data");
    }
    if header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1)) {
        return unsupported("it holds subsampled channels");
    }
    if !["R", "G", "B"].iter().all(|name| has(header, name)) && (has(header, "R") || !has(header, "Y")) {
        let names: Vec<_> = header.channels.list.iter().take(12).map(|channel| channel.name.to_string()).collect();
        return unsupported(&format!("its first part has no channels R G B, but {}", names.join(" ")));
    }
    let Vec2(width, height) = header.layer_size;
    let bytes = check_pixels(width, height)?.saturating_mul(header.channels.bytes_per_pixel);
    check_length(bytes, most_expansion(header.compression), length)
}

/// Bytes that one byte of a file can become at most, generously: zlib reaches 1032 (its "Technical Details" page),
/// run lengths 64, PIZ some 500 (255 samples of two bytes for nine bits), B44 at most 16; DWA stores one number for
/// a block of 64 samples, through zlib. A block's smallest piece is covered by the file's own header.
fn most_expansion(compression: Compression) -> usize {
    match compression {
        Compression::Uncompressed => 1,
        Compression::RLE | Compression::B44 | Compression::B44A => 64,
        Compression::DWAA(_) | Compression::DWAB(_) => 1 << 17,
        _ => 2048,
    }
}

/// Refuses a DWA chunk whose counters are out of all proportion to its pixels.
///
/// The crate (1.74.2) allocates by these counters without a bound, and a failed allocation ends the process.
/// Source: OpenEXR, `internal_dwa_compressor.h`: eleven 64-bit counters begin a chunk; those looked at are sizes in
/// bytes (1, 6, 7) or numbers of halves (8, 9), 64 of them at most for a block of 8x8 samples.
fn check_chunk(header: &Header, chunk: &Chunk) -> Result<(), Fault> {
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    let bytes = match &chunk.compressed_block {
        CompressedBlock::ScanLine(lines) => &lines.compressed_pixels_le,
        CompressedBlock::Tile(tile) => &tile.compressed_pixels_le,
        _ => return Err(Fault::Unsupported("it holds deep data".into())),
    };
    let place = header.get_block_data_indices(&chunk.compressed_block)?;
    let Vec2(width, height) = header.get_absolute_block_pixel_coordinates(place)?.size;
    if bytes.len() == width * height * header.channels.bytes_per_pixel {
        return Ok(()); // stored as it is, without counters
    }
    // Four bytes a sample, twice that where run lengths do not shorten; blocks are padded to whole ones.
    let most = ((width + 7) * (height + 7) * header.channels.list.len() * 8) as u64;
    let counters = bytes.as_chunks::<8>().0.iter().map(|&counter| u64::from_le_bytes(counter));
    if counters.enumerate().any(|(index, counter)| matches!(index, 1 | 6..=9) && counter > most) {
        return Err(Fault::Damaged("a DWA chunk promises more than its pixels".into()));
    }
    Ok(())
}

/// Both windows, moved so that the display window begins at (0, 0).
fn windows(header: &Header) -> Result<((u32, u32), Window), Fault> {
    let wrong = || Fault::Damaged("its windows are too large".into());
    let (frame, data) = (header.shared_attributes.display_window, header.data_window());
    let size = |size: usize| u32::try_from(size).map_err(|_| wrong());
    let edges = |frame: i32, data: i32, size: usize| {
        let from = data.checked_sub(frame).ok_or_else(wrong)?;
        let to = i32::try_from(size).ok().and_then(|size| from.checked_add(size)).ok_or_else(wrong)?;
        Ok::<_, Fault>((from, to))
    };
    let (x0, x1) = edges(frame.position.x(), data.position.x(), data.size.width())?;
    let (y0, y1) = edges(frame.position.y(), data.position.y(), data.size.height())?;
    Ok(((size(frame.size.width())?, size(frame.size.height())?), Window { x0, y0, x1, y1 }))
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use exr::image::{Encoding, Image, Layer, SpecificChannels};
    use exr::meta::header::LayerAttributes;
    use exr::prelude::{Blocks, LineOrder, WritableImage};

    use super::*;

    const SIZE: (usize, usize) = (45, 37);

    /// Smooth, so that lossy compressions stay close; exact in halves.
    fn color(x: usize, y: usize) -> [f32; 4] {
        [x as f32 / 64.0, y as f32 / 64.0, (x + y) as f32 / 128.0, 1.0]
    }

    fn encoded(compression: Compression, blocks: Blocks) -> Vec<u8> {
        let channels = SpecificChannels::rgba(|Vec2(x, y)| {
            let [r, g, b, a] = color(x, y).map(f16::from_f32);
            (r, g, b, a)
        });
        let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
        let attributes = LayerAttributes::default().with_position(Vec2(-4, 3));
        let mut bytes = Cursor::new(Vec::new());
        let image = Image::from_layer(Layer::new(SIZE, attributes, encoding, channels));
        image.write().non_parallel().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    fn decoded(bytes: &[u8]) -> Result<Picture, String> {
        read(Cursor::new(bytes), bytes.len()).map_err(|fault| match fault {
            Fault::Io(error) => error.to_string(),
            Fault::Damaged(reason) | Fault::Unsupported(reason) => reason,
        })
    }

    #[test]
    fn every_compression_and_tiles_are_read() {
        use Compression::*;
        let lossless = [(Uncompressed, 0.0), (RLE, 0.0), (ZIP1, 0.0), (ZIP16, 0.0), (PIZ, 0.0), (PXR24, 0.0)];
        let lossy = [(B44, 0.02), (B44A, 0.02), (DWAA(Some(45.0)), 0.02), (DWAB(Some(45.0)), 0.02)];
        for (compression, bound) in lossless.into_iter().chain(lossy) {
            for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(16, 16))] {
                let picture = decoded(&encoded(compression, blocks)).unwrap();
                assert_eq!(picture.window, Window { x0: 0, y0: 0, x1: 45, y1: 37 });
                for (index, pixel) in picture.pixels.iter().enumerate() {
                    for (got, want) in pixel.iter().zip(color(index % SIZE.0, index / SIZE.0)) {
                        assert!((got - want).abs() <= bound, "{compression} {blocks:?} {index}: {got} {want}");
                    }
                }
            }
        }
    }

    /// Each counter in turn asks for 2^50 bytes.
    #[test]
    fn a_dwa_chunk_cannot_ask_for_much_memory() {
        let bytes = encoded(Compression::DWAA(Some(45.0)), Blocks::ScanLines);
        let chunks = block::read(Cursor::new(&bytes), false).unwrap();
        let count = chunks.headers()[0].chunk_count;
        let table = bytes.len()
            - chunks
                .filter_chunks(false, |_, _, _| true)
                .unwrap()
                .map(|chunk| {
                    let CompressedBlock::ScanLine(lines) = chunk.unwrap().compressed_block else { unreachable!() };
                    lines.compressed_pixels_le.len() + 8
                })
                .sum::<usize>()
            - 8 * count;
        let first = u64::from_le_bytes(bytes[table..][..8].try_into().unwrap()) as usize + 8;
        for counter in [1, 6, 7, 8, 9] {
            let mut bytes = bytes.clone();
            bytes[first + 8 * counter..][..8].copy_from_slice(&(1u64 << 50).to_le_bytes());
            assert_eq!(decoded(&bytes), Err("a DWA chunk promises more than its pixels".into()), "{counter}");
        }
    }

    #[test]
    fn a_file_without_colors_says_what_it_has() {
        let channels = SpecificChannels::build().with_channel("depth.Z").with_pixel_fn(|_| (1f32,));
        let mut bytes = Cursor::new(Vec::new());
        Image::from_channels((4, 4), channels).write().to_buffered(&mut bytes).unwrap();
        let found = decoded(&bytes.into_inner());
        assert_eq!(found, Err("its first part has no channels R G B, but depth.Z".into()));
        let channels = SpecificChannels::build().with_channel("Y").with_pixel_fn(|_| (0.25f32,));
        let mut bytes = Cursor::new(Vec::new());
        Image::from_channels((2, 1), channels).write().to_buffered(&mut bytes).unwrap();
        assert_eq!(decoded(&bytes.into_inner()).unwrap().pixels, [[0.25, 0.25, 0.25, 1.0]; 2]);
    }
}
