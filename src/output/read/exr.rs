//! EXR: colour and layers of all flat parts, chunk by chunk.
//!
//! Chunks are taken one by one, so that what they promise can be held against their size before they are decoded.

use std::io::{BufRead, Seek};
use std::path::Path;

use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::lines::LineRef;
use exr::block::reader::ChunksReader;
use exr::block::{self, UncompressedBlock};
use exr::math::Vec2;
use exr::meta::attribute::{AttributeValue, ChannelDescription, Compression, SampleType, Text};
use exr::meta::header::Header;
use glam::DVec2;
use half::f16;

use super::mattes;
use super::{Contents, Fault, HashPair, check_length, check_pixels};
use crate::film::{Channel, Picture, SampleKind, Samples, Window};
use crate::output::color::Primaries;
use crate::output::exr::{Attributes, ColorSpace, PIXEL_HASH, Storage};
use crate::output::pixel_hash::{Digests, PixelHash};

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

/// Reads a file; manifests that it names are looked for in `directory`.
pub(super) fn read(reader: impl BufRead + Seek, length: usize, directory: &Path) -> Result<Contents, Fault> {
    let chunks = block::read(reader, false)?;
    let plan = Plan::new(chunks.headers(), length)?;
    let mut sums = plan.sums(chunks.headers());
    let mut picture = plan.picture();
    // Strict about the places of chunks, so that none is missed in silence.
    let chunks = chunks
        .filter_chunks(true, |_, tile, block| plan.parts[block.layer].is_some() && tile.level_index == Vec2(0, 0))?;
    let meta = chunks.meta_data().clone();
    for chunk in chunks {
        let chunk = chunk?;
        let layer = chunk.layer_index;
        let (header, Some(part)) = (&meta.headers[layer], &plan.parts[layer]) else { continue };
        check_chunk(header, &chunk)?;
        let block = UncompressedBlock::decompress_chunk(chunk, &meta, true)?;
        for line in block.lines(&header.channels) {
            let kind = header.channels.list[line.location.channel].sample_type;
            if let Some(sums) = &mut sums {
                sums.add(layer, &line, kind);
            }
            part.fill(&mut picture, line, kind)?;
        }
    }
    plan.finish(&meta.headers, picture, sums, directory)
}

/// What becomes of each part of a file.
struct Plan {
    display: (u32, u32),
    window: Window,
    /// By the number of the part; `None` for one that is not read.
    parts: Vec<Option<Part>>,
    /// Channels beside the colour, with their types.
    names: Vec<(String, SampleType)>,
    /// The part that holds the colour.
    color: usize,
}

struct Part {
    /// What becomes of each channel.
    slots: Vec<Slot>,
    /// Where its window begins in that of the picture.
    offset: (i64, i64),
}

/// What a channel of the file becomes.
#[derive(Debug, Clone, Copy)]
enum Slot {
    /// These samples of a pixel.
    Color(&'static [usize]),
    /// A channel beside the colour.
    Channel(usize),
}

impl Plan {
    fn new(headers: &[Header], length: usize) -> Result<Plan, Fault> {
        let color = color_part(headers)?;
        check_header(&headers[color], length)?;
        let (display, window) = windows(&headers[color])?;
        let mut plan = Plan { display, window, parts: Vec::new(), names: Vec::new(), color };
        for (number, header) in headers.iter().enumerate() {
            let part = match unread(header) {
                Some(_) => None,
                None => {
                    check_header(header, length)?;
                    Some(plan.part(number, header)?)
                }
            };
            plan.parts.push(part);
        }
        // Layers smaller than the picture are held in its size.
        let bytes = window.area().saturating_mul(plan.names.len().saturating_mul(4));
        check_length(bytes, LARGEST_EXPANSION, length)?;
        Ok(plan)
    }

    fn part(&mut self, number: usize, header: &Header) -> Result<Part, Fault> {
        let (_, window) = windows(header)?;
        let offset =
            (i64::from(window.x0) - i64::from(self.window.x0), i64::from(window.y0) - i64::from(self.window.y0));
        let mut slots = Vec::new();
        for channel in &header.channels.list {
            let bytes = channel.name.as_slice();
            let color = if number == self.color { color_slot(header, bytes) } else { None };
            let slot = match color {
                Some(slots) => Slot::Color(slots),
                None => {
                    let name = self.name(header, &String::from_utf8_lossy(bytes))?;
                    self.names.push((name, channel.sample_type));
                    Slot::Channel(self.names.len() - 1)
                }
            };
            slots.push(slot);
        }
        Ok(Part { slots, offset })
    }

    /// The full name of a channel: with the name of its part where it has no layer, or the name is taken.
    fn name(&self, header: &Header, name: &str) -> Result<String, Fault> {
        let taken = |name: &str| self.names.iter().any(|(known, _)| known == name);
        let part = header.own_attributes.layer_name.as_ref().map(|part| String::from_utf8_lossy(part.as_slice()));
        let longer = part.map(|part| format!("{part}.{name}"));
        let first = if self.parts.len() == self.color || name.contains('.') { Some(name.to_owned()) } else { None };
        let mut names = first.into_iter().chain(longer).chain([name.to_owned()]);
        let free = names.find(|name| !taken(name));
        free.ok_or_else(|| Fault::Unsupported(format!("two of its channels are called \"{name}\"")))
    }

    fn picture(&self) -> Picture {
        let area = self.window.area();
        let channel = |(name, kind): &(String, SampleType)| Channel {
            name: name.clone(),
            samples: match kind {
                SampleType::F16 => SampleKind::Half.zeros(area),
                SampleType::F32 => SampleKind::Float.zeros(area),
                SampleType::U32 => SampleKind::Uint.zeros(area),
            },
        };
        Picture {
            pixels: vec![[0.0, 0.0, 0.0, 1.0]; area].into(),
            channels: self.names.iter().map(channel).collect(),
            window: self.window,
            display: self.display,
            cryptomattes: Vec::new(),
        }
    }

    /// Nothing yet; for files that state no hash, nothing ever.
    fn sums(&self, headers: &[Header]) -> Option<Sums> {
        stored_hash(headers)?;
        let count = |part: &Option<Part>| part.as_ref().map_or(0, |part| part.slots.len());
        Some(Sums(self.parts.iter().map(|part| vec![Digests::default(); count(part)]).collect()))
    }

    fn finish(
        self,
        headers: &[Header],
        mut picture: Picture,
        sums: Option<Sums>,
        directory: &Path,
    ) -> Result<Contents, Fault> {
        let header = &headers[self.color];
        let mut unnamed = Vec::new();
        picture.cryptomattes = mattes::read(headers, directory, &mut unnamed);
        let is_float = |channel: &ChannelDescription| {
            color_slot(header, channel.name.as_slice()).is_some() && channel.sample_type != SampleType::F16
        };
        let float = header.channels.list.iter().any(is_float);
        Ok(Contents {
            picture,
            primaries: primaries(header).filter(|primaries| !primaries.is_near(&Primaries::REC709)),
            unnamed,
            float,
            storage: Some(storage(headers, header, float)),
            attributes: Some(Attributes {
                shared: header.shared_attributes.clone(),
                own: header.own_attributes.clone(),
            }),
            pixel_hash: sums.and_then(|sums| sums.compare(&self, headers)),
        })
    }
}

/// The digests of all rows, by part and channel.
struct Sums(Vec<Vec<Digests>>);

impl Sums {
    fn add(&mut self, layer: usize, line: &LineRef<'_>, kind: SampleType) {
        let place = line.location;
        self.0[layer][place.channel].push(place.position.y(), line.value, kind);
    }

    fn compare(self, plan: &Plan, headers: &[Header]) -> Option<HashPair> {
        let mut hash = PixelHash::new(plan.display, plan.window);
        for (header, digests) in headers.iter().zip(&self.0) {
            for (channel, rows) in header.channels.list.iter().zip(digests) {
                hash.add(channel.name.as_slice(), channel.sample_type, [rows].into_iter());
            }
        }
        Some(HashPair { stored: stored_hash(headers)?, found: hash.finish() })
    }
}

/// How a file is stored, as far as that makes up its samples and their names.
fn storage(headers: &[Header], color: &Header, float: bool) -> Storage {
    let compression = crate::output::Compression::ALL.into_iter().find(|known| known.method() == color.compression);
    let is_aces = primaries(color).is_some_and(|primaries| primaries.is_near(&Primaries::ACESCG));
    Storage {
        float,
        compression: compression.unwrap_or_default(),
        root_depth: headers.iter().any(|header| has(header, "Z")),
        color: if is_aces { ColorSpace::AcesCg } else { ColorSpace::Rec709 },
        ..Storage::default()
    }
}

/// The hash of the samples that a file states.
fn stored_hash(headers: &[Header]) -> Option<String> {
    let name = Text::from(PIXEL_HASH);
    headers.iter().find_map(|header| match header.own_attributes.other.get(&name)? {
        AttributeValue::Text(text) => Some(text.to_string()),
        _ => None,
    })
}

/// The first part with colours that is read, or else with a part of them, or else with anything.
fn color_part(headers: &[Header]) -> Result<usize, Fault> {
    let whole = |header: &Header| match is_grey(header) {
        true => has(header, "Y"),
        false => COLORS.iter().all(|name| has(header, name)),
    };
    let first =
        |holds: &dyn Fn(&Header) -> bool| headers.iter().position(|header| unread(header).is_none() && holds(header));
    let found = first(&whole).or_else(|| first(&|header| !is_grey(header))).or_else(|| first(&|_| true));
    found.ok_or_else(|| match headers.first().map(unread) {
        Some(Some(reason)) => Fault::Unsupported(reason.into()),
        _ => Fault::Damaged("it has no header".into()),
    })
}

/// Why a part is not read, if it is not.
fn unread(header: &Header) -> Option<&'static str> {
    if header.deep {
        return Some("it holds deep data");
    }
    header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1)).then_some("it holds subsampled channels")
}

/// Which samples of a pixel a channel becomes.
fn color_slot(header: &Header, name: &[u8]) -> Option<&'static [usize]> {
    let grey = is_grey(header);
    match name {
        b"R" => Some(&[0]),
        b"G" => Some(&[1]),
        b"B" => Some(&[2]),
        b"A" => Some(&[3]),
        b"Y" if grey => Some(&[0, 1, 2]),
        _ => None,
    }
}

const COLORS: [&str; 3] = ["R", "G", "B"];

/// Whether it has none of the colours.
fn is_grey(header: &Header) -> bool {
    !COLORS.iter().any(|name| has(header, name))
}

fn has(header: &Header, name: &str) -> bool {
    header.channels.list.iter().any(|channel| channel.name == *name)
}

/// The primaries that a file states.
fn primaries(header: &Header) -> Option<Primaries> {
    let found = header.shared_attributes.chromaticities?;
    let xy = [found.red, found.green, found.blue, found.white].map(|Vec2(x, y)| DVec2::new(x.into(), y.into()));
    Some(Primaries { xy })
}

impl Part {
    /// Puts a line of one channel into its place, as far as it lies in the picture's window.
    fn fill(&self, picture: &mut Picture, line: LineRef<'_>, kind: SampleType) -> Result<(), Fault> {
        let window = picture.window;
        let Vec2(x, y) = line.location.position;
        let (x, y) = (x as i64 + self.offset.0, y as i64 + self.offset.1);
        if y < 0 || y >= window.height() as i64 {
            return Ok(());
        }
        let end = (x + line.location.sample_count as i64).min(window.width() as i64);
        let skipped = (-x).max(0) as usize;
        let Some(count) = usize::try_from(end - x.max(0)).ok().filter(|count| *count > 0) else { return Ok(()) };
        let start = y as usize * window.width() + x.max(0) as usize;
        let row = start..start + count;
        match self.slots[line.location.channel] {
            Slot::Color(slots) => {
                let pixels = &mut picture.pixels[row];
                let mut put = |index: usize, value: f32| slots.iter().for_each(|&slot| pixels[index][slot] = value);
                for (index, value) in floats(&line, kind)?.into_iter().skip(skipped).take(count).enumerate() {
                    put(index, value);
                }
            }
            Slot::Channel(channel) => match &mut picture.channels[channel].samples {
                Samples::Half(samples) => {
                    let found = line.read_samples::<f16>().skip(skipped);
                    samples[row]
                        .iter_mut()
                        .zip(found)
                        .try_for_each(|(slot, value)| value.map(|value| *slot = value))?;
                }
                Samples::Unrounded(samples) | Samples::Float(samples) => {
                    samples[row].copy_from_slice(&floats(&line, kind)?[skipped..skipped + count]);
                }
                Samples::Uint(samples) => {
                    let found = line.read_samples::<u32>().skip(skipped);
                    samples[row]
                        .iter_mut()
                        .zip(found)
                        .try_for_each(|(slot, value)| value.map(|value| *slot = value))?;
                }
            },
        }
        Ok(())
    }
}

fn floats(line: &LineRef<'_>, kind: SampleType) -> Result<Vec<f32>, Fault> {
    let samples: Result<Vec<f32>, exr::error::Error> = match kind {
        SampleType::F16 => line.read_samples::<f16>().map(|value| value.map(f16::to_f32)).collect(),
        SampleType::F32 => line.read_samples::<f32>().collect(),
        SampleType::U32 => line.read_samples::<u32>().map(|value| value.map(|value| value as f32)).collect(),
    };
    Ok(samples?)
}

/// Refuses sizes that a file of this length cannot hold.
fn check_header(header: &Header, length: usize) -> Result<(), Fault> {
    let Vec2(width, height) = header.layer_size;
    let bytes = check_pixels(width, height)?.saturating_mul(header.channels.bytes_per_pixel);
    check_length(bytes, most_expansion(header.compression), length)
}

/// The most of [`most_expansion`].
const LARGEST_EXPANSION: usize = 1 << 17;

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
        let found = read(Cursor::new(bytes), bytes.len(), Path::new("."));
        found.map(|contents| contents.picture).map_err(|fault| match fault {
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
    fn colors_that_a_file_lacks_are_black() {
        let alone = |name: &str| {
            let channels = SpecificChannels::build().with_channel(name).with_pixel_fn(|_| (0.25f32,));
            let mut bytes = Cursor::new(Vec::new());
            Image::from_channels((2, 1), channels).write().to_buffered(&mut bytes).unwrap();
            let picture = decoded(&bytes.into_inner()).unwrap();
            assert_eq!(picture.pixels[0], picture.pixels[1]);
            (picture.pixels[0], picture.channels.iter().map(|channel| channel.name.clone()).collect::<Vec<_>>())
        };
        assert_eq!(alone("Y"), ([0.25, 0.25, 0.25, 1.0], vec![]));
        assert_eq!(alone("R"), ([0.25, 0.0, 0.0, 1.0], vec![]));
        assert_eq!(alone("B"), ([0.0, 0.0, 0.25, 1.0], vec![]));
        assert_eq!(alone("A"), ([0.0, 0.0, 0.0, 0.25], vec![]));
        for layer in ["Z", "depth.Z", "left.R"] {
            assert_eq!(alone(layer), ([0.0, 0.0, 0.0, 1.0], vec![layer.to_owned()]));
        }
    }
}
