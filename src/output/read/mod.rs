//! Pictures back from files: EXR and PNG, told apart by their first bytes.
//!
//! Sizes that a file states are held against its length before anything is allocated, so a short file cannot
//! ask for much memory.

mod exr;
mod mattes;
mod png;

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::color::{self, Primaries};
use super::exr::{Attributes, Storage};
use crate::film::Picture;

/// Pixels of the largest picture that is read: the largest that a scene may ask for.
pub(super) const MOST_PIXELS: usize = 1 << 30;

/// A file that could not be read as a picture.
#[derive(Debug, Error)]
pub enum ReadError {
    /// The system refused, or there is no such file.
    #[error("{}: cannot be read: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The first bytes are those of no format that is read here.
    #[error("{}: is neither an EXR nor a PNG file", path.display())]
    Unknown {
        /// The file.
        path: PathBuf,
    },
    /// The file contradicts itself or ends too early.
    #[error("{}: is damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
    /// The file may be sound, but holds something that is not read here.
    #[error("{}: is not supported: {reason}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it holds.
        reason: String,
    },
}

/// Why a stream of bytes is no picture.
enum Fault {
    Io(std::io::Error),
    Damaged(String),
    Unsupported(String),
}

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Contents {
    /// The picture with its layers, linear and premultiplied.
    pub picture: Picture,
    /// The primaries of its colours, where not those of Rec. 709: [`read_all`] leaves none.
    primaries: Option<Primaries>,
    /// What is wrong with manifests of Cryptomattes, whose names are missing then.
    pub unnamed: Vec<String>,
    /// Whether colour has more bits than halves.
    pub float: bool,
    /// Of an EXR: how its samples are stored, whatever makes up their hash.
    pub storage: Option<Storage>,
    /// Of an EXR: what its header says beside.
    pub attributes: Option<Attributes>,
    /// The hash of its samples that an EXR states, and the one that they have.
    pub pixel_hash: Option<HashPair>,
}

impl Contents {
    /// With all colours linear Rec. 709; `path` is the file that they are of.
    ///
    /// # Errors
    /// [`ReadError::Damaged`], where the primaries span no colours.
    pub fn in_rec709(mut self, path: &Path) -> Result<Self, ReadError> {
        if let Some(primaries) = self.primaries.take() {
            let fault =
                || ReadError::Damaged { path: path.into(), reason: "its chromaticities span no colours".into() };
            let matrix = primaries.matrix_to(Primaries::REC709).ok_or_else(fault)?;
            self.picture = color::converted(&self.picture, matrix).into_owned();
        }
        Ok(self)
    }
}

/// A hash as it is stated, and as it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HashPair {
    /// What the file's header says.
    pub stored: String,
    /// What the file's samples give.
    pub found: String,
}

/// Reads a picture: [`read_all`] without what stands beside it.
///
/// # Errors
/// Any [`ReadError`]; each names the path and the cause.
pub fn read(path: &Path) -> Result<Picture, ReadError> {
    read_all(path).map(|contents| contents.picture)
}

/// Reads a picture, linear Rec. 709 and premultiplied, and what stands beside it.
///
/// EXR: colour is that of the first part with channels `R G B` (and `A`, else 1) or `Y`, in the primaries that the
/// file states, and what there is none of is black; all other channels of all flat parts are layers, with the name
/// of their part before theirs where they have none. Types are half, float or uint, compressions all but HTJ2K;
/// layers that cover other pixels than the colour are cut or filled up with 0. Where the display window begins
/// elsewhere than at (0, 0), all windows move ([`Attributes::origin`] says from where). PNG: any depth and colour type, by
/// the curve of Rec. 2100 (PQ) where its `cICP` chunk says so and the sRGB curve whatever else its chunks say, alpha
/// multiplied in; its window is the full frame.
///
/// # Errors
/// Any [`ReadError`]; each names the path and the cause.
pub fn read_all(path: &Path) -> Result<Contents, ReadError> {
    read_as_stored(path)?.in_rec709(path)
}

/// The same in the primaries of the file.
///
/// # Errors
/// Any [`ReadError`]; each names the path and the cause.
pub fn read_as_stored(path: &Path) -> Result<Contents, ReadError> {
    let io = |source| ReadError::Io { path: path.into(), source };
    let file = File::open(path).map_err(io)?;
    let found = file.metadata().map_err(io)?;
    if !found.is_file() {
        return Err(ReadError::Unsupported { path: path.into(), reason: "it is no regular file".into() });
    }
    let length = usize::try_from(found.len()).unwrap_or(usize::MAX);
    let mut reader = BufReader::new(file);
    let head = reader.fill_buf().map_err(io)?;
    let contents = if head.starts_with(&::exr::meta::magic_number::BYTES) {
        exr::read(reader, length, path.parent().unwrap_or(Path::new("")))
    } else if head.starts_with(b"\x89PNG\r\n\x1a\n") {
        png::read(reader, length).map(|(picture, float)| Contents {
            picture,
            primaries: None,
            unnamed: Vec::new(),
            float,
            storage: None,
            attributes: None,
            pixel_hash: None,
        })
    } else {
        return Err(ReadError::Unknown { path: path.into() });
    };
    contents.map_err(|fault| match fault {
        Fault::Io(source) => ReadError::Io { path: path.into(), source },
        Fault::Damaged(reason) => ReadError::Damaged { path: path.into(), reason },
        Fault::Unsupported(reason) => ReadError::Unsupported { path: path.into(), reason },
    })
}

/// Pixels of a picture of this size, unless they are none or too many.
fn check_pixels(width: usize, height: usize) -> Result<usize, Fault> {
    match width.checked_mul(height) {
        Some(0) => Err(Fault::Damaged("it has no pixels".into())),
        Some(area) if area <= MOST_PIXELS => Ok(area),
        _ => Err(Fault::Unsupported(format!("{width}x{height} pixels are too many (at most {MOST_PIXELS})"))),
    }
}

/// Refuses a promise that a file of this length cannot keep; `expansion` is the most that one byte can become.
fn check_length(bytes: usize, expansion: usize, length: usize) -> Result<(), Fault> {
    if bytes / expansion <= length {
        return Ok(());
    }
    Err(Fault::Damaged(format!("it promises {bytes} bytes of pixels, but is only {length} bytes long")))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use ::png::{BitDepth, ColorType, Encoder};

    use super::*;
    use crate::film::{Channel, Cryptomatte, Samples, Window};
    use crate::output::{self, Bits, Coding, Compression, Description, Options, Storage, srgb};

    fn picture() -> Picture {
        let mut picture = Picture::new((50, 40), Window { x0: 3, y0: 2, x1: 34, y1: 23 });
        for (i, pixel) in picture.pixels.iter_mut().enumerate() {
            let a = 0.25 + 0.75 * (i % 4) as f32 / 3.0;
            *pixel = [(i as f32 * 0.37).fract() * a, (i as f32 * 0.11).fract() * a, 0.5 * a, a];
        }
        picture
    }

    fn message(name: &str, bytes: &[u8]) -> String {
        let room = tempfile::tempdir().unwrap();
        let path = room.path().join(name);
        fs::write(&path, bytes).unwrap();
        let message = read(&path).unwrap_err().to_string();
        message.strip_prefix(&format!("{}: ", path.display())).expect("the path comes first").into()
    }

    fn encoded(name: &str) -> Vec<u8> {
        encoded_as(name, &picture(), Storage::default())
    }

    fn encoded_as(name: &str, picture: &Picture, exr: Storage) -> Vec<u8> {
        let room = tempfile::tempdir().unwrap();
        let path = room.path().join(name);
        output::write(&path, picture, Options { exr, ..Options::default() }, &Description::default()).unwrap();
        fs::read(path).unwrap()
    }

    /// Files of every kind that is read, with layers where they can have some.
    fn files() -> Vec<(&'static str, Vec<u8>)> {
        let mut layered = picture();
        let area = layered.window.area();
        layered.channels = vec![
            Channel { name: "depth.Z".into(), samples: Samples::Float(vec![2.5; area].into()) },
            Channel { name: "id.object".into(), samples: Samples::Uint((0..area as u32).collect()) },
            Channel { name: "crypto_object00.R".into(), samples: Samples::Float(vec![1.5; area].into()) },
        ];
        let manifest = [("ball".to_owned(), 1.5f32.to_bits())].into();
        layered.cryptomattes = vec![Cryptomatte { name: "crypto_object".into(), manifest }];
        let exr = |compression, multipart| {
            encoded_as("a.exr", &layered, Storage { compression, multipart, ..Storage::default() })
        };
        let mut files: Vec<_> = Compression::ALL.map(|compression| ("a.exr", exr(compression, false))).into();
        files.extend([
            ("a.exr", exr(Compression::Zips, true)),
            ("a.exr", encoded("a.exr")),
            ("a.png", encoded("a.png")),
        ]);
        files
    }

    #[test]
    fn what_is_no_picture_says_so() {
        assert_eq!(message("a.exr", b"hello"), "is neither an EXR nor a PNG file");
        assert_eq!(message("a.png", b""), "is neither an EXR nor a PNG file");
        let missing = read(Path::new("no/such.exr")).unwrap_err();
        assert!(missing.to_string().starts_with("no/such.exr: cannot be read: No such file"), "{missing}");
        assert!(matches!(read(&std::env::temp_dir()), Err(ReadError::Unsupported { .. } | ReadError::Io { .. })));
    }

    /// A file cut anywhere is refused. The last 12 bytes of a PNG are its end mark, after all its pixels.
    #[test]
    fn a_cut_file_is_damaged() {
        for (name, bytes) in files() {
            let spare = if name == "a.png" { 12 } else { 0 };
            for length in (8..bytes.len() - spare).step_by(bytes.len() / 90 + 1).chain([bytes.len() - spare - 1]) {
                let message = message(name, &bytes[..length]);
                assert!(message.starts_with("is damaged: "), "{name} {length}: {message}");
            }
        }
    }

    /// Whatever a broken file says, the answer is a picture or one line, and never a panic.
    #[test]
    fn a_spoilt_file_never_panics() {
        let room = tempfile::tempdir().unwrap();
        let mut refused = 0;
        for (name, bytes) in files() {
            let path = room.path().join(name);
            let mut state = 0x5eed_u32;
            let mut random = |below: usize| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) as usize % below
            };
            for _ in 0..300 {
                let mut bytes = bytes.clone();
                for _ in 0..1 + random(3) {
                    // The head decides most, so it is hit most.
                    let reach = if random(3) > 0 { 1500 } else { bytes.len() };
                    let place = random(reach.min(bytes.len()));
                    bytes[place] = [0, 0xff, 0x80, random(256) as u8][random(4)];
                }
                fs::write(&path, &bytes).unwrap();
                if let Err(error) = read(&path) {
                    refused += 1;
                    assert_eq!(error.to_string().lines().count(), 1, "{error}");
                }
            }
        }
        assert!(refused > 500, "{refused}");
    }

    #[test]
    fn a_small_file_cannot_ask_for_much_memory() {
        let mut exr = encoded("a.exr");
        // Past the attribute's name and type, both ended by a zero, and the size of its value.
        let value = |bytes: &[u8], name: &[u8], kind: &[u8]| {
            bytes.windows(name.len()).position(|part| part == name).unwrap() + name.len() + kind.len() + 6
        };
        let (window, chunks) = (value(&exr, b"dataWindow", b"box2i"), value(&exr, b"chunkCount", b"int"));
        for (index, number) in [0, 0, 29_999i32, 29_999].into_iter().enumerate() {
            exr[window + 4 * index..][..4].copy_from_slice(&number.to_le_bytes());
        }
        exr[chunks..][..4].copy_from_slice(&30_000i32.to_le_bytes());
        let found = message("a.exr", &exr);
        assert!(found.starts_with("is damaged: it promises 7200000000 bytes"), "{found}");
        let mut png = Vec::new();
        let mut encoder = Encoder::new(&mut png, 30_000, 30_000);
        encoder.set_color(ColorType::Rgba);
        drop(encoder.write_header().unwrap());
        // A header, and nothing of what it promises but an image chunk to begin with.
        png.truncate(8 + 25);
        png.extend([0, 0, 0, 0, b'I', b'D', b'A', b'T', 0x35, 0xaf, 0x06, 0x1e]);
        let found = message("a.png", &png);
        assert!(found.starts_with("is damaged: it promises 3600"), "{found}");
    }

    #[test]
    fn a_png_comes_back_within_half_a_code() {
        let room = tempfile::tempdir().unwrap();
        let path = room.path().join("a.png");
        let picture = picture();
        for (bits, codes) in [(Bits::Eight, 255.0), (Bits::Sixteen, 65535.0)] {
            let options = Options { coding: Coding { bits, dither: false, ..Coding::default() }, ..Options::default() };
            output::write(&path, &picture, options, &Description::default()).unwrap();
            let back = read(&path).unwrap();
            assert_eq!((back.display, back.window), ((31, 21), Window::full((31, 21))));
            for (got, want) in back.pixels.iter().zip(&picture.pixels) {
                assert!((got[3] - want[3]).abs() * codes < 0.501, "{got:?} {want:?}");
                for channel in 0..3 {
                    // Straight values on the display's scale; alpha's own rounding is divided out.
                    let display = |pixel: &[f32; 4]| srgb::encode(f64::from(pixel[channel] / pixel[3]));
                    assert!((display(got) - display(want)).abs() * f64::from(codes) < 0.51, "{got:?} {want:?}");
                }
            }
        }
    }

    #[test]
    fn grey_and_palette_pngs_are_read() {
        let mut bytes = Vec::new();
        let mut encoder = Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(ColorType::Indexed);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_palette(vec![255, 0, 0, 0, 0, 255]);
        encoder.set_trns(vec![255, 0]);
        encoder.write_header().unwrap().write_image_data(&[0, 1]).unwrap();
        let room = tempfile::tempdir().unwrap();
        let path = room.path().join("a.png");
        fs::write(&path, &bytes).unwrap();
        assert_eq!(read(&path).unwrap().pixels, [[1.0, 0.0, 0.0, 1.0], [0.0; 4]]);
        let mut bytes = Vec::new();
        let mut encoder = Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(ColorType::Grayscale);
        encoder.set_depth(BitDepth::One);
        encoder.write_header().unwrap().write_image_data(&[0b0100_0000]).unwrap();
        fs::write(&path, &bytes).unwrap();
        assert_eq!(read(&path).unwrap().pixels, [[0.0, 0.0, 0.0, 1.0], [1.0; 4]]);
    }
}
