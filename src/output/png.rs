//! PNG files: what a display shows of a picture, by the exact sRGB curve, with straight alpha.
//!
//! The file holds the pixels of the picture's window. Colour is divided by alpha before the curve, then clamped
//! to 0..1 and rounded to the nearest code. A picture that is opaque at this depth has no alpha channel.
//! The `sRGB` chunk says which curve it was; the crate adds the matching `gAMA` and `cHRM`.

use png::{BitDepth, ColorType, Compression, Encoder, SrgbRenderingIntent};

use super::description::{self, Description};
use super::{EncodeError, Losses, srgb};
use crate::film::Picture;

/// Bits per sample of a PNG.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Bits {
    /// 256 codes.
    #[default]
    Eight,
    /// 65,536 codes.
    Sixteen,
}

/// An opaque picture of display values, row by row: what a plot or a heat map is made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Raster {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
    /// Red, green, blue of each pixel, sRGB codes.
    pub pixels: Vec<[u8; 3]>,
}

/// The bytes of a PNG file, and what it could not hold.
///
/// # Errors
/// A picture that is empty or not whole, or larger than the format counts (2^31).
pub fn encode(picture: &Picture, bits: Bits, description: &Description) -> Result<(Vec<u8>, Losses), EncodeError> {
    EncodeError::unless_whole(picture)?;
    let mut losses = Losses::default();
    let (color, samples) = match bits {
        Bits::Eight => samples(picture, &mut losses, |v| [srgb::to_u8(v)], |a| [(a * 255.0).round() as u8]),
        Bits::Sixteen => samples(
            picture,
            &mut losses,
            |v| srgb::to_u16(v).to_be_bytes(),
            |a| ((a * 65535.0).round() as u16).to_be_bytes(),
        ),
    };
    let size = |size: usize| u32::try_from(size).map_err(EncodeError::new);
    let size = (size(picture.window.width())?, size(picture.window.height())?);
    let depth = if bits == Bits::Eight { BitDepth::Eight } else { BitDepth::Sixteen };
    Ok((file(size, color, depth, description.scene.as_deref(), &samples)?, losses))
}

/// The bytes of a PNG file that shows a raster.
///
/// # Errors
/// A raster that is empty, or whose list of pixels is not as long as its size says.
pub fn encode_raster(raster: &Raster, title: &str) -> Result<Vec<u8>, EncodeError> {
    let size = (raster.width, raster.height);
    file(size, ColorType::Rgb, BitDepth::Eight, Some(title), raster.pixels.as_flattened())
}

/// Codes of all pixels, with alpha unless every alpha is the highest code.
fn samples<const BYTES: usize>(
    picture: &Picture,
    losses: &mut Losses,
    color_code: impl Fn(f32) -> [u8; BYTES],
    alpha_code: impl Fn(f32) -> [u8; BYTES],
) -> (ColorType, Vec<u8>) {
    let highest = [u8::MAX; BYTES];
    let alpha = |pixel: &[f32; 4]| alpha_code(srgb::unit(pixel[3]));
    let opaque = picture.pixels.iter().all(|pixel| alpha(pixel) == highest);
    let mut samples = Vec::with_capacity(picture.pixels.len() * BYTES * if opaque { 3 } else { 4 });
    for pixel in &picture.pixels {
        for value in straight(pixel) {
            losses.count(value);
            samples.extend_from_slice(&color_code(if value.is_finite() { value } else { 0.0 }));
        }
        losses.count(pixel[3]);
        if !opaque {
            samples.extend_from_slice(&alpha(pixel));
        }
    }
    (if opaque { ColorType::Rgb } else { ColorType::Rgba }, samples)
}

/// Colour before it was multiplied by alpha; black where nothing covers the pixel, since no colour would show.
#[inline]
fn straight(&[r, g, b, a]: &[f32; 4]) -> [f32; 3] {
    if a >= 1.0 {
        [r, g, b]
    } else if a > 0.0 {
        [r / a, g / a, b / a]
    } else {
        [0.0; 3]
    }
}

impl Losses {
    /// Counts a sample that the range 0..1 does not hold.
    #[inline]
    fn count(&mut self, value: f32) {
        if !value.is_finite() {
            self.dropped += 1;
        } else if !(0.0..=1.0).contains(&value) {
            self.clamped += 1;
        }
    }
}

fn file(
    (width, height): (u32, u32),
    color: ColorType,
    depth: BitDepth,
    title: Option<&str>,
    samples: &[u8],
) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::Fast);
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    encoder.add_text_chunk("Software".into(), description::software()).map_err(EncodeError::new)?;
    if let Some(title) = title {
        // International text: a scene's name need not be Latin-1.
        encoder.add_itxt_chunk("Title".into(), title.replace('\0', " ")).map_err(EncodeError::new)?;
    }
    let mut writer = encoder.write_header().map_err(EncodeError::new)?;
    writer.write_image_data(samples).map_err(EncodeError::new)?;
    writer.finish().map_err(EncodeError::new)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;

    fn row(pixels: &[[f32; 4]]) -> Picture {
        let display = (pixels.len() as u32, 1);
        Picture { pixels: pixels.to_vec(), ..Picture::new(display, Window::full(display)) }
    }

    fn decoded(bytes: &[u8]) -> (png::OutputInfo, Vec<u8>) {
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut samples = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut samples).unwrap();
        assert_eq!(reader.info().srgb, Some(SrgbRenderingIntent::Perceptual));
        (info, samples)
    }

    #[test]
    fn an_opaque_picture_has_no_alpha_and_is_clamped() {
        let picture = row(&[[0.5, 1.5, -0.25, 1.0], [0.0, f32::NAN, f32::INFINITY, 1.0]]);
        let (bytes, losses) = encode(&picture, Bits::Eight, &Description::default()).unwrap();
        let (info, samples) = decoded(&bytes);
        assert_eq!((info.color_type, info.bit_depth), (ColorType::Rgb, BitDepth::Eight));
        assert_eq!(samples, [188, 255, 0, 0, 0, 0]);
        assert_eq!(losses, Losses { clamped: 2, dropped: 2 });
    }

    #[test]
    fn alpha_is_straight_and_not_bent_by_the_curve() {
        let picture = row(&[[0.25, 0.0, 0.5, 0.5], [3.0, 3.0, 3.0, 0.0], [1.0; 4]]);
        let (bytes, losses) = encode(&picture, Bits::Eight, &Description::default()).unwrap();
        let (info, samples) = decoded(&bytes);
        assert_eq!(info.color_type, ColorType::Rgba);
        assert_eq!(samples, [188, 0, 255, 128, 0, 0, 0, 0, 255, 255, 255, 255]);
        assert_eq!(losses, Losses::default());
        let (bytes, _) = encode(&picture, Bits::Sixteen, &Description::default()).unwrap();
        let (info, samples) = decoded(&bytes);
        assert_eq!((info.color_type, info.bit_depth), (ColorType::Rgba, BitDepth::Sixteen));
        assert_eq!(samples[..8], [0xbc, 0x40, 0, 0, 0xff, 0xff, 0x80, 0]); // 0.735357 x 65535 = 48191.6
    }

    #[test]
    fn the_file_says_who_made_it_of_what() {
        let description = Description { scene: Some("сцена.toml".into()), ..Description::default() };
        let (bytes, _) = encode(&row(&[[1.0; 4]]), Bits::Eight, &description).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let info = reader.info();
        assert_eq!(info.uncompressed_latin1_text[0].text, description::software());
        assert_eq!(info.utf8_text[0].keyword, "Title");
        assert_eq!(info.utf8_text[0].get_text().unwrap(), "сцена.toml");
    }

    #[test]
    fn what_is_not_whole_is_refused() {
        let mut picture = row(&[[1.0; 4]; 3]);
        picture.pixels.pop();
        assert!(encode(&picture, Bits::Eight, &Description::default()).is_err());
        assert!(encode_raster(&Raster { width: 2, height: 2, pixels: vec![[0; 3]; 3] }, "x").is_err());
        assert!(encode_raster(&Raster { width: 0, height: 0, pixels: vec![] }, "x").is_err());
    }
}
