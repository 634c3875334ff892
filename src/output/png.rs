//! PNG files: what a display shows of a picture, by the exact sRGB curve or that of Rec. 2100, with straight alpha.
//!
//! The file holds the pixels of the picture's window. Colour is divided by alpha, goes through exposure, white point
//! and tone map ([`Display`]) and then the curve, is clamped to 0..1 and becomes a code: the nearest of 65,536, or one
//! of the two of 256 around it by a fixed table of 8 x 8 places (dither), the nearest without it. A picture that is
//! opaque in halves has no alpha channel, so that a picture gives the same file whether it went through a half-float
//! EXR or not, but for a code's difference.
//! The `sRGB` chunk says which curve it was, `gAMA` and `cHRM` say it to readers that do not know that one; `cICP` says it
//! of high dynamic range, which has 65,536 codes and no dither.

use half::f16;
use png::{BitDepth, ColorType, Compression, Encoder, ScaledFloat, SourceChromaticities, SrgbRenderingIntent};
use rayon::prelude::*;

use super::color::Primaries;
use super::description::{self, Description};
use super::{Display, EncodeError, Losses, pq, srgb};
use crate::film::Picture;

/// How a picture becomes the codes of a PNG.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coding {
    /// Bits per sample.
    pub bits: Bits,
    /// What the display is to show.
    pub display: Display,
    /// Whether 8-bit codes are dithered.
    pub dither: bool,
    /// From light to codes.
    pub transfer: Transfer,
}

/// The curve between light and codes, and the primaries that go with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Transfer {
    /// IEC 61966-2-1: light above 1 is cut off.
    #[default]
    Srgb,
    /// Rec. ITU-R BT.2100 with the perceptual quantiser, 16 bits whatever [`Bits`] say: light of 1 is 203 cd/m2, what is
    /// above 49 is cut off.
    Pq,
}

/// Eight bits, dithered, as it is.
impl Default for Coding {
    fn default() -> Self {
        Coding { bits: Bits::Eight, display: Display::default(), dither: true, transfer: Transfer::Srgb }
    }
}

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
pub fn encode(picture: &Picture, coding: Coding, description: &Description) -> Result<(Vec<u8>, Losses), EncodeError> {
    EncodeError::unless_whole(picture)?;
    let shown = coding.display.prepare();
    let light = |rgb| shown.light(rgb);
    let byte = |a: f32| [(srgb::unit(a) * 255.0).round() as u8];
    let word = |a: f32| ((srgb::unit(a) * 65535.0).round() as u16).to_be_bytes();
    let (color, losses, samples) = match (coding.transfer, coding.bits, coding.dither) {
        (Transfer::Srgb, Bits::Eight, true) => samples(picture, light, |v, x, y| [srgb::to_u8_dithered(v, x, y)], byte),
        (Transfer::Srgb, Bits::Eight, false) => samples(picture, light, |v, _, _| [srgb::to_u8(v)], byte),
        (Transfer::Srgb, Bits::Sixteen, _) => samples(picture, light, |v, _, _| srgb::to_u16(v).to_be_bytes(), word),
        (Transfer::Pq, ..) => {
            let shares = |rgb| pq::shares(shown.light(rgb));
            samples(picture, shares, |v, _, _| pq::to_u16(v).to_be_bytes(), word)
        }
    };
    let size = |size: usize| u32::try_from(size).map_err(EncodeError::new);
    let size = (size(picture.window.width())?, size(picture.window.height())?);
    let depth = match (coding.transfer, coding.bits) {
        (Transfer::Srgb, Bits::Eight) => BitDepth::Eight,
        (Transfer::Pq, _) | (_, Bits::Sixteen) => BitDepth::Sixteen,
    };
    Ok((file(size, (color, depth, coding.transfer), description.scene.as_deref(), &samples)?, losses))
}

/// The bytes of a PNG file that shows a raster.
///
/// # Errors
/// A raster that is empty, or whose list of pixels is not as long as its size says.
pub fn encode_raster(raster: &Raster, title: &str) -> Result<Vec<u8>, EncodeError> {
    let size = (raster.width, raster.height);
    file(size, (ColorType::Rgb, BitDepth::Eight, Transfer::Srgb), Some(title), raster.pixels.as_flattened())
}

/// Codes of all pixels, with alpha unless the picture is opaque.
fn samples<const BYTES: usize>(
    picture: &Picture,
    light: impl Fn([f32; 3]) -> [f32; 3] + Sync,
    color_code: impl Fn(f32, i32, i32) -> [u8; BYTES] + Sync,
    alpha_code: impl Fn(f32) -> [u8; BYTES] + Sync,
) -> (ColorType, Losses, Vec<u8>) {
    let opaque = picture.pixels.par_iter().all(|pixel| pixel[3] >= 1.0 || f16::from_f32(pixel[3]) >= f16::ONE);
    let channels = if opaque { 3 } else { 4 };
    let window = picture.window;
    let mut samples = vec![0; picture.pixels.len() * BYTES * channels];
    let row = |y: usize, codes: &mut [u8]| {
        let mut losses = Losses::default();
        let pixels = &picture.pixels[y * window.width()..][..window.width()];
        for ((x, pixel), codes) in (window.x0..).zip(pixels).zip(codes.chunks_exact_mut(BYTES * channels)) {
            let invisible = !opaque && alpha_code(f16::from_f32(pixel[3]).to_f32()) == [0; BYTES];
            let color = if invisible { [0.0; 3] } else { straight(pixel) };
            let shown = light(color.map(|value| losses.finite(value)));
            for (value, code) in shown.into_iter().zip(codes.chunks_exact_mut(BYTES)) {
                losses.bounded(value);
                code.copy_from_slice(&color_code(value, x, window.y0 + y as i32));
            }
            let alpha = losses.finite(pixel[3]);
            losses.bounded(alpha);
            if !opaque {
                codes[3 * BYTES..].copy_from_slice(&alpha_code(pixel[3]));
            }
        }
        losses
    };
    let rows = samples.par_chunks_mut(window.width() * BYTES * channels).enumerate();
    let losses = rows.map(|(y, codes)| row(y, codes)).reduce(Losses::default, Losses::and);
    (if opaque { ColorType::Rgb } else { ColorType::Rgba }, losses, samples)
}

/// Colour before it was multiplied by alpha. Where alpha's code is 0 no colour shows and black is written: a tiny alpha
/// is so coarse in halves that colours would differ.
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
    /// The sample, or 0 for one that is not finite, which is counted.
    #[inline]
    fn finite(&mut self, value: f32) -> f32 {
        let is_finite = value.is_finite();
        self.dropped += u64::from(!is_finite);
        if is_finite { value } else { 0.0 }
    }

    /// Counts a sample that the range 0..1 does not hold.
    #[inline]
    fn bounded(&mut self, value: f32) {
        self.clamped += u64::from(!(0.0..=1.0).contains(&value));
    }

    pub(super) fn and(self, other: Losses) -> Losses {
        Losses { clamped: self.clamped + other.clamped, dropped: self.dropped + other.dropped }
    }
}

fn file(
    (width, height): (u32, u32),
    (color, depth, transfer): (ColorType, BitDepth, Transfer),
    title: Option<&str>,
    samples: &[u8],
) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::Fast);
    if transfer == Transfer::Srgb {
        encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
        encoder.set_source_gamma(ScaledFloat::from_scaled(45455));
        let [red, green, blue, white] = Primaries::REC709.xy.map(|xy| (xy.x as f32, xy.y as f32));
        encoder.set_source_chromaticities(SourceChromaticities::new(white, red, green, blue));
    }
    encoder.add_text_chunk("Software".into(), description::software()).map_err(EncodeError::new)?;
    if let Some(title) = title {
        // International text: a scene's name need not be Latin-1.
        encoder.add_itxt_chunk("Title".into(), title.replace('\0', " ")).map_err(EncodeError::new)?;
    }
    let mut writer = encoder.write_header().map_err(EncodeError::new)?;
    if transfer == Transfer::Pq {
        writer.write_chunk(png::chunk::cICP, &pq::CODE_POINTS).map_err(EncodeError::new)?;
    }
    writer.write_image_data(samples).map_err(EncodeError::new)?;
    writer.finish().map_err(EncodeError::new)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;
    use crate::output::ToneMap;

    const PLAIN: Coding = Coding {
        bits: Bits::Eight,
        display: Display { exposure: 0.0, white: None, tone_map: ToneMap::None },
        dither: false,
        transfer: Transfer::Srgb,
    };

    fn row(pixels: &[[f32; 4]]) -> Picture {
        let display = (pixels.len() as u32, 1);
        Picture { pixels: pixels.to_vec().into(), ..Picture::new(display, Window::full(display)) }
    }

    fn decoded(bytes: &[u8]) -> (png::OutputInfo, Vec<u8>) {
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut samples = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut samples).unwrap();
        let said = reader.info();
        assert_eq!(said.srgb, Some(SrgbRenderingIntent::Perceptual));
        assert!(said.gama_chunk.is_some() && said.chrm_chunk.is_some());
        (info, samples)
    }

    #[test]
    fn an_opaque_picture_has_no_alpha_and_is_clamped() {
        let picture = row(&[[0.5, 1.5, -0.25, 1.0], [0.0, f32::NAN, f32::INFINITY, 1.0]]);
        let (bytes, losses) = encode(&picture, PLAIN, &Description::default()).unwrap();
        let (info, samples) = decoded(&bytes);
        assert_eq!((info.color_type, info.bit_depth), (ColorType::Rgb, BitDepth::Eight));
        assert_eq!(samples, [188, 255, 0, 0, 0, 0]);
        assert_eq!(losses, Losses { clamped: 2, dropped: 2 });
    }

    #[test]
    fn alpha_is_straight_and_not_bent_by_the_curve() {
        let picture = row(&[[0.25, 0.0, 0.5, 0.5], [3.0, 3.0, 3.0, 0.0], [1.0; 4]]);
        let (bytes, losses) = encode(&picture, PLAIN, &Description::default()).unwrap();
        let (info, samples) = decoded(&bytes);
        assert_eq!(info.color_type, ColorType::Rgba);
        assert_eq!(samples, [188, 0, 255, 128, 0, 0, 0, 0, 255, 255, 255, 255]);
        assert_eq!(losses, Losses::default());
        let (bytes, _) = encode(&picture, Coding { bits: Bits::Sixteen, ..PLAIN }, &Description::default()).unwrap();
        let (info, samples) = decoded(&bytes);
        assert_eq!((info.color_type, info.bit_depth), (ColorType::Rgba, BitDepth::Sixteen));
        assert_eq!(samples[..8], [0xbc, 0x40, 0, 0, 0xff, 0xff, 0x80, 0]); // 0.735357 x 65535 = 48191.6
    }

    /// What a file of halves gives is within a code of what the floats give, in every mode, however small alpha is.
    #[test]
    fn halves_give_the_same_codes_but_for_one() {
        let mut seed = 1u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / (1 << 24) as f32
        };
        let pixels = (0..40_000).map(|_| {
            let a = if random() < 0.2 { 1.0 } else { random().powi(1 + (random() * 9.0) as i32) };
            [a * 3.0 * random().powi(6), a * random(), a * random().powi(3), a]
        });
        let floats = row(&pixels.collect::<Vec<_>>());
        let half = |pixel: &[f32; 4]| pixel.map(|value| f16::from_f32(value).to_f32());
        let halves = row(&floats.pixels.iter().map(half).collect::<Vec<_>>());
        for tone_map in [ToneMap::None, ToneMap::Reinhard, ToneMap::Aces, ToneMap::Agx, ToneMap::Khronos] {
            for dither in [true, false] {
                let display = Display { exposure: 1.0, white: None, tone_map };
                let codes = |picture| {
                    let (bytes, _) =
                        encode(picture, Coding { display, dither, ..PLAIN }, &Description::default()).unwrap();
                    decoded(&bytes).1
                };
                let (a, b) = (codes(&floats), codes(&halves));
                let off: Vec<_> = a.iter().zip(&b).map(|(a, b)| a.abs_diff(*b)).collect();
                assert!(off.iter().all(|off| *off <= 1), "{tone_map:?} {dither}: {:?}", off.iter().max());
                assert!(off.contains(&1));
            }
        }
    }

    /// The file says so, and is read as the light that it was made of.
    #[test]
    fn high_dynamic_range_keeps_what_is_brighter_than_white() {
        let picture =
            row(&[[1.0, 1.0, 1.0, 1.0], [12.0, 0.5, 0.0, 1.0], [60.0, 60.0, 60.0, 1.0], [0.5, 0.0, 1.0, 0.5]]);
        let coding = Coding { transfer: Transfer::Pq, ..Coding::default() };
        let (bytes, losses) = encode(&picture, coding, &Description::default()).unwrap();
        assert_eq!(losses, Losses { clamped: 3, dropped: 0 });
        let reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let points = reader.info().coding_independent_code_points.unwrap();
        assert_eq!((points.color_primaries, points.transfer_function), (9, 16));
        assert_eq!((reader.info().bit_depth, reader.info().srgb), (BitDepth::Sixteen, None));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hdr.png");
        std::fs::write(&path, &bytes).unwrap();
        let back = crate::output::read(&path).unwrap();
        for (i, (back, was)) in back.pixels.iter().zip(picture.pixels.iter()).enumerate().filter(|(i, _)| *i != 2) {
            let off = back.iter().zip(was).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f32::max) < 2e-3, "{i}: {back:?} {was:?}");
        }
        assert!(back.pixels[2].iter().take(3).all(|light| (light - 49.26).abs() < 0.01), "{:?}", back.pixels[2]);
    }

    #[test]
    fn dither_goes_by_the_place_in_the_frame() {
        let mut whole = Picture::new((24, 16), Window::full((24, 16)));
        whole.pixels.iter_mut().enumerate().for_each(|(i, pixel)| *pixel = [i as f32 / 400.0, 0.2, 0.01, 1.0]);
        let part = whole.crop(Window { x0: 5, y0: 3, x1: 23, y1: 12 }).unwrap();
        let codes = |picture| decoded(&encode(picture, Coding::default(), &Description::default()).unwrap().0).1;
        let (all, some) = (codes(&whole), codes(&part));
        for (index, code) in some.as_chunks::<3>().0.iter().enumerate() {
            let (x, y) = part.window.pixel(index);
            assert_eq!(code, &all.as_chunks::<3>().0[whole.window.index(x, y).unwrap()], "{x} {y}");
        }
        let greens: std::collections::BTreeSet<_> = all.iter().skip(1).step_by(3).collect();
        assert_eq!(greens.len(), 2);
    }

    #[test]
    fn the_file_says_who_made_it_of_what() {
        let description = Description { scene: Some("сцена.toml".into()), ..Description::default() };
        let (bytes, _) = encode(&row(&[[1.0; 4]]), PLAIN, &description).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let info = reader.info();
        assert_eq!(info.uncompressed_latin1_text[0].text, description::software());
        assert_eq!(info.utf8_text[0].keyword, "Title");
        assert_eq!(info.utf8_text[0].get_text().unwrap(), "сцена.toml");
    }

    #[test]
    fn what_is_not_whole_is_refused() {
        let mut picture = row(&[[1.0; 4]; 3]);
        picture.pixels = picture.pixels[1..].to_vec().into();
        assert!(encode(&picture, PLAIN, &Description::default()).is_err());
        assert!(encode_raster(&Raster { width: 2, height: 2, pixels: vec![[0; 3]; 3] }, "x").is_err());
        assert!(encode_raster(&Raster { width: 0, height: 0, pixels: vec![] }, "x").is_err());
    }
}
