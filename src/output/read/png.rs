//! PNG: any depth and colour type, by the sRGB curve.

use std::io::{BufRead, ErrorKind, Seek};

use png::{BitDepth, ColorType, Decoder, DecodingError, Transformations};

use super::{Fault, check_length, check_pixels};
use crate::film::{Picture, Window};
use crate::output::srgb;

/// Bytes that zlib makes of one byte at most: 1032, says "zlib Technical Details"; the rest is for small files.
const MOST_EXPANSION: usize = 2048;

impl From<DecodingError> for Fault {
    fn from(error: DecodingError) -> Self {
        match error {
            DecodingError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof => {
                Fault::Damaged("it ends too early".into())
            }
            DecodingError::IoError(error) => Fault::Io(error),
            other => Fault::Damaged(other.to_string()),
        }
    }
}

/// The picture, and whether its samples have more than eight bits.
pub(super) fn read(reader: impl BufRead + Seek, length: usize) -> Result<(Picture, bool), Fault> {
    let mut decoder = Decoder::new(reader);
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info()?;
    let info = reader.info();
    let (width, height) = (info.width, info.height);
    check_pixels(width as usize, height as usize)?;
    check_length(info.raw_row_length().saturating_mul(height as usize), MOST_EXPANSION, length)?;
    let (color, depth) = reader.output_color_type();
    let size = reader.output_buffer_size().ok_or_else(|| Fault::Unsupported("it is too large".into()))?;
    let mut samples = vec![0; size];
    reader.next_frame(&mut samples)?;
    let pixels = match depth {
        BitDepth::Sixteen => linear::<2>(&samples, color, |code| srgb::from_u16(u16::from_be_bytes(code)), 65535.0),
        _ => linear::<1>(&samples, color, |[code]| srgb::from_u8(code), 255.0),
    };
    let display = (width, height);
    let picture = Picture { pixels: pixels.into(), ..Picture::new(display, Window::full(display)) };
    Ok((picture, depth == BitDepth::Sixteen))
}

/// Codes to linear light, alpha multiplied in. `BYTES` a sample, the most significant first.
fn linear<const BYTES: usize>(
    samples: &[u8],
    color: ColorType,
    curve: impl Fn([u8; BYTES]) -> f32,
    highest: f32,
) -> Vec<[f32; 4]> {
    let codes = samples.as_chunks::<BYTES>().0;
    let alpha = |code: [u8; BYTES]| code.iter().fold(0.0, |value, &byte| value * 256.0 + f32::from(byte)) / highest;
    let pixel = |code: &[[u8; BYTES]]| {
        let (rgb, a) = match *code {
            [grey] => ([grey; 3], 1.0),
            [grey, a] => ([grey; 3], alpha(a)),
            [r, g, b] => ([r, g, b], 1.0),
            [r, g, b, a, ..] => ([r, g, b], alpha(a)),
            [] => return [0.0; 4],
        };
        let [r, g, b] = rgb.map(|code| curve(code) * a);
        [r, g, b, a]
    };
    codes.chunks_exact(color.samples()).map(pixel).collect()
}
