//! Pictures from files, as linear texels: PNG, JPEG, Radiance HDR, OpenEXR.

use std::fs;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

use image::{ColorType, DynamicImage, ImageDecoder, ImageReader, Limits};

use super::rules::Broken;
use super::{ColorSpace, Texel};

/// Most texels of a picture: a lat-long of 16,384 x 8,192.
const MOST_TEXELS: u64 = 1 << 27;
/// Most bytes that a decoder may hold besides.
const MOST_BYTES: u64 = 4 << 30;

/// A picture in memory.
#[derive(Debug, Clone)]
pub struct Picture {
    /// Texels, >= 1.
    pub width: usize,
    /// Texels, >= 1.
    pub height: usize,
    /// How the file's values were read.
    pub color_space: ColorSpace,
    /// Linear Rec. 709, row by row from the top.
    pub texels: Arc<[Texel]>,
    /// How many values were below 0 and are 0 now.
    pub negative: usize,
}

/// Reads a picture. Whole numbers of 8 or 16 bits are sRGB and floats linear, unless `color_space` says
/// otherwise. An alpha channel is passed over.
///
/// # Errors
/// What is wrong with the file; the rule goes on from the file's name.
pub fn read(path: &Path, color_space: Option<ColorSpace>) -> Result<Picture, Broken> {
    let image = DynamicImage::from_decoder(open(path)?).map_err(unsound)?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let color_space = color_space.unwrap_or(usual(image.color()));
    let mut texels = linear(image, color_space);
    if let Some(bad) = texels.iter().position(|texel| texel.iter().any(|value| !value.is_finite())) {
        let found = format!("{:?} in column {}, row {}", texels[bad], bad % width, bad / width);
        return Err(broken("must hold finite numbers", found));
    }
    let mut negative = 0;
    for value in texels.iter_mut().flatten().filter(|value| **value < 0.0) {
        (*value, negative) = (0.0, negative + 1);
    }
    Ok(Picture { width, height, color_space, texels: texels.into(), negative })
}

/// The size of a picture and how its values would be read; no texels.
///
/// # Errors
/// As [`read`], as far as the head of the file shows it.
pub fn look(path: &Path, color_space: Option<ColorSpace>) -> Result<Picture, Broken> {
    let decoder = open(path)?;
    let (width, height) = decoder.dimensions();
    let color_space = color_space.unwrap_or(usual(decoder.color_type()));
    let (width, height) = (width as usize, height as usize);
    Ok(Picture { width, height, color_space, texels: Arc::new([]), negative: 0 })
}

fn usual(color: ColorType) -> ColorSpace {
    match color {
        ColorType::Rgb32F | ColorType::Rgba32F => ColorSpace::Linear,
        _ => ColorSpace::Srgb,
    }
}

fn broken(rule: &str, found: String) -> Broken {
    Broken { key: "", rule: rule.to_owned().into(), found }
}

fn unsound(error: image::ImageError) -> Broken {
    broken(&format!("must be a sound PNG, JPEG, HDR or EXR picture: {error}"), String::new())
}

fn open(path: &Path) -> Result<impl ImageDecoder + use<>, Broken> {
    let cannot = |error: std::io::Error| broken(&format!("cannot be read: {error}"), String::new());
    if !fs::metadata(path).map_err(cannot)?.is_file() {
        return Err(broken("must be a file, not a directory or device", String::new()));
    }
    let file = BufReader::new(fs::File::open(path).map_err(cannot)?);
    let mut reader = ImageReader::new(file).with_guessed_format().map_err(cannot)?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(unsound)?;
    let (width, height) = decoder.dimensions();
    let texels = u64::from(width) * u64::from(height);
    if texels == 0 || texels > MOST_TEXELS {
        return Err(broken("must have 1 to 2^27 pixels", format!("{width} x {height}")));
    }
    Ok(decoder)
}

fn linear(image: DynamicImage, color_space: ColorSpace) -> Vec<Texel> {
    let curve = |value: f64| match color_space {
        ColorSpace::Srgb => linear_from_srgb(value),
        ColorSpace::Linear => value,
    };
    let three = |values: &[f32]| values.as_chunks().0.to_vec();
    match image.color() {
        ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => {
            let table: Vec<f32> = (0..=255).map(|value| curve(f64::from(value) / 255.0) as f32).collect();
            let texel = |texel: &[u8; 3]| texel.map(|value| table[usize::from(value)]);
            image.into_rgb8().into_raw().as_chunks().0.iter().map(texel).collect()
        }
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {
            let table: Vec<f32> = (0..=65_535).map(|value| curve(f64::from(value) / 65_535.0) as f32).collect();
            let texel = |texel: &[u16; 3]| texel.map(|value| table[usize::from(value)]);
            image.into_rgb16().into_raw().as_chunks().0.iter().map(texel).collect()
        }
        _ => {
            let mut texels = three(&image.into_rgb32f().into_raw());
            if color_space == ColorSpace::Srgb {
                texels.iter_mut().flatten().for_each(|value| *value = curve(f64::from(*value)) as f32);
            }
            texels
        }
    }
}

/// The inverse of the piecewise sRGB curve; beyond 1 it goes on.
///
/// Source: IEC 61966-2-1:1999, section 5.2.
pub(super) fn linear_from_srgb(value: f64) -> f64 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}
