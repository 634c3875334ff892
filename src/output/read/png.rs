//! PNG: any depth and colour type, by the sRGB curve, or by that of Rec. 2100 where the file says so.

use std::io::{BufRead, ErrorKind, Seek};

use png::{BitDepth, ColorType, Decoder, DecodingError, Transformations};

use super::{Fault, check_length, check_pixels};
use crate::film::{Picture, Window};
use crate::output::{pq, srgb};

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
    let points = info.coding_independent_code_points.map(|points| [points.color_primaries, points.transfer_function]);
    let is_pq = points.is_some_and(|points| pq::CODE_POINTS.starts_with(&points));
    check_pixels(width as usize, height as usize)?;
    check_length(info.raw_row_length().saturating_mul(height as usize), MOST_EXPANSION, length)?;
    let (color, depth) = reader.output_color_type();
    let size = reader.output_buffer_size().ok_or_else(|| Fault::Unsupported("it is too large".into()))?;
    let mut samples = vec![0; size];
    reader.next_frame(&mut samples)?;
    let each = |curve: fn(u16) -> f32| move |rgb: [u16; 3]| rgb.map(curve);
    let pixels = match (depth, is_pq) {
        (BitDepth::Sixteen, false) => linear::<2>(&samples, color, each(srgb::from_u16)),
        (BitDepth::Sixteen, true) => {
            linear::<2>(&samples, color, |rgb| pq::light(rgb.map(|code| f64::from(code) / 65535.0)))
        }
        (_, false) => linear::<1>(&samples, color, each(|code| srgb::from_u8(code as u8))),
        (_, true) => linear::<1>(&samples, color, |rgb| pq::light(rgb.map(|code| f64::from(code) / 255.0))),
    };
    let display = (width, height);
    let picture = Picture { pixels: pixels.into(), ..Picture::new(display, Window::full(display)) };
    Ok((picture, depth == BitDepth::Sixteen))
}

/// Codes to linear light, alpha multiplied in. `BYTES` a sample, the most significant first.
fn linear<const BYTES: usize>(samples: &[u8], color: ColorType, light: impl Fn([u16; 3]) -> [f32; 3]) -> Vec<[f32; 4]> {
    let codes = samples.as_chunks::<BYTES>().0;
    let number = |code: [u8; BYTES]| code.iter().fold(0, |value, &byte| value << 8 | u16::from(byte));
    let alpha = |code| f32::from(number(code)) / f32::from(number([u8::MAX; BYTES]));
    let pixel = |code: &[[u8; BYTES]]| {
        let (rgb, a) = match *code {
            [grey] => ([grey; 3], 1.0),
            [grey, a] => ([grey; 3], alpha(a)),
            [r, g, b] => ([r, g, b], 1.0),
            [r, g, b, a, ..] => ([r, g, b], alpha(a)),
            [] => return [0.0; 4],
        };
        let [r, g, b] = light(rgb.map(number)).map(|light| light * a);
        [r, g, b, a]
    };
    codes.chunks_exact(color.samples()).map(pixel).collect()
}
