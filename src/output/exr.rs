//! OpenEXR files: one part, scan lines from the top, ZIPS, channels `R G B A`, scene-linear and premultiplied.
//!
//! Display window and data window are the picture's. Samples are halves, or floats where asked for; neither NaN
//! nor infinity is ever written. Equal pictures with equal descriptions become equal bytes. Attributes follow
//! "Standard Attributes" of the OpenEXR documentation, those of our own begin with `render/`.

use std::io::Cursor;

use exr::image::{Encoding, Image, IntoSample, Layer, SpecificChannels};
use exr::math::Vec2;
use exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::prelude::{Blocks, Compression, LineOrder, WritableImage};
use half::f16;

use super::description::{self, Description};
use super::view::View;
use super::{EncodeError, Losses};
use crate::film::Picture;

/// The largest finite half; beyond it the format has only infinity.
const HALF_MAX: f32 = 65504.0;

/// The bytes of an EXR file, and what it could not hold.
///
/// # Errors
/// A picture that is empty or not whole, or a window that reaches further than the format counts (2^30).
pub fn encode(picture: &Picture, float: bool, description: &Description) -> Result<(Vec<u8>, Losses), EncodeError> {
    EncodeError::unless_whole(picture)?;
    let bytes = if float {
        file(picture, description, |sample| if sample.is_finite() { sample } else { 0.0 })
    } else {
        file(picture, description, |sample| f16::from_f32(half_range(sample)))
    }?;
    Ok((bytes, losses(picture, float)))
}

/// Rounding to the nearest half would turn 65520 and more into infinity.
fn half_range(sample: f32) -> f32 {
    if sample.is_finite() { sample.clamp(-HALF_MAX, HALF_MAX) } else { 0.0 }
}

fn losses(picture: &Picture, float: bool) -> Losses {
    let mut losses = Losses::default();
    for sample in picture.pixels.iter().flatten() {
        losses.dropped += u64::from(!sample.is_finite());
        losses.clamped += u64::from(!float && sample.is_finite() && sample.abs() > HALF_MAX);
    }
    losses
}

fn file<S: IntoSample>(
    picture: &Picture,
    description: &Description,
    sample: impl Fn(f32) -> S + Sync,
) -> Result<Vec<u8>, EncodeError> {
    let width = picture.window.width();
    let channels = SpecificChannels::rgba(|Vec2(x, y)| {
        let [r, g, b, a] = picture.pixels[y * width + x];
        (sample(r), sample(g), sample(b), sample(a))
    });
    let encoding =
        Encoding { compression: Compression::ZIP1, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let layer =
        Layer::new((width, picture.window.height()), layer_attributes(picture, description), encoding, channels);
    let image = Image::new(image_attributes(picture)?, layer);
    let mut bytes = Cursor::new(Vec::new());
    // One thread: frames are written beside rendering, and its own threads gained nothing (measured).
    image.write().non_parallel().to_buffered(&mut bytes).map_err(EncodeError::new)?;
    let mut bytes = bytes.into_inner();
    sort_attributes(&mut bytes).ok_or_else(|| EncodeError::new("the header cannot be read back"))?;
    Ok(bytes)
}

fn image_attributes(picture: &Picture) -> Result<ImageAttributes, EncodeError> {
    let (width, height) = picture.display;
    let size = |size: u32| usize::try_from(size).map_err(EncodeError::new);
    let mut attributes = ImageAttributes::new(IntegerBounds::from_dimensions((size(width)?, size(height)?)));
    attributes.chromaticities = Some(Chromaticities {
        // Rec. ITU-R BT.709 with D65.
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.3290),
    });
    Ok(attributes)
}

fn layer_attributes(picture: &Picture, description: &Description) -> LayerAttributes {
    let mut attributes = LayerAttributes {
        layer_position: Vec2(picture.window.x0, picture.window.y0),
        software_name: Some(text(&description::software())),
        owner: description.owner.as_deref().map(text),
        comments: description.comments.as_deref().map(text),
        frames_per_second: Some(description.frames_per_second.unwrap_or((24, 1))),
        ..LayerAttributes::default()
    };
    if let Some(camera) = &description.camera {
        let view = View::new(camera, picture.display);
        attributes.world_to_camera = Some(view.world_to_camera);
        attributes.world_to_normalized_device = view.world_to_ndc;
        attributes.screen_window_width = view.screen_window_width;
    }
    if let Some(run) = &description.run {
        attributes.capture_date = Some(text(&description::utc(run.date)));
        attributes.utc_offset = Some(0.0);
    }
    attributes.other = own_attributes(description).map(|(name, value)| (text(name), value)).collect();
    attributes
}

/// Attributes beside the standard ones: ours, and two that other tools read (pbrt-v4, `image.cpp`).
fn own_attributes(description: &Description) -> impl Iterator<Item = (&'static str, AttributeValue)> {
    let words = |value: &Option<String>| value.as_deref().map(|value| AttributeValue::Text(text(value)));
    let count = |value: u32| AttributeValue::I32(i32::try_from(value).unwrap_or(i32::MAX));
    let run = description.run.as_ref();
    let seconds = run.map(|run| AttributeValue::F32(run.seconds as f32));
    let all = [
        ("render/scene", words(&description.scene)),
        ("render/sceneHash", words(&description.scene_hash)),
        ("render/spp", description.spp.map(count)),
        ("samplesPerPixel", description.spp.map(count)),
        ("render/seed", description.seed.map(|seed| AttributeValue::Text(text(&seed.to_string())))),
        ("render/frame", description.frame.map(AttributeValue::I32)),
        ("render/seconds", seconds.clone()),
        ("renderTimeSeconds", seconds),
        ("render/threads", run.map(|run| count(run.threads))),
        ("render/rays", run.and_then(|run| words(&run.rays))),
        ("render/shard", run.and_then(|run| words(&run.shard))),
    ];
    all.into_iter().filter_map(|(name, value)| Some((name, value?)))
}

/// UTF-8 as it is: the crate's own conversion panics beyond Latin-1.
fn text(words: &str) -> Text {
    Text::from_slice_unchecked(words.as_bytes())
}

/// Puts the attributes of the header in the order of their names.
///
/// The crate keeps some of them in a hash map, so their order differs from run to run. The header's length
/// stays, and with it every offset behind it. `None` where the bytes are no single-part file.
/// Source: "OpenEXR File Layout", OpenEXR documentation: magic number and version, four bytes each, then
/// attributes (name, 0, type, 0, size in four bytes, value), then 0.
fn sort_attributes(bytes: &mut [u8]) -> Option<()> {
    const START: usize = 8;
    let mut attributes = Vec::new();
    let mut place = START;
    while *bytes.get(place)? != 0 {
        let name = until_zero(bytes, place)?;
        let kind = until_zero(bytes, place + name.len() + 1)?;
        let value = place + name.len() + kind.len() + 6;
        let size = i32::from_le_bytes(bytes.get(value - 4..value)?.try_into().ok()?);
        let end = value.checked_add(usize::try_from(size).ok()?)?;
        attributes.push((name.to_vec(), bytes.get(place..end)?.to_vec()));
        place = end;
    }
    attributes.sort();
    let sorted: Vec<u8> = attributes.into_iter().flat_map(|(_, attribute)| attribute).collect();
    bytes.get_mut(START..place)?.copy_from_slice(&sorted);
    Some(())
}

fn until_zero(bytes: &[u8], start: usize) -> Option<&[u8]> {
    bytes.get(start..)?.split(|&byte| byte == 0).next()
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, SystemTime};

    use exr::meta::MetaData;
    use exr::meta::attribute::SampleType;
    use exr::meta::header::Header;
    use glam::DVec3;

    use super::*;
    use crate::film::Window;
    use crate::output::{self, Options, Run};
    use crate::scene::{Camera, Lens};

    /// A crop whose samples no half holds exactly.
    fn picture() -> Picture {
        let mut picture = Picture::new((40, 30), Window { x0: 7, y0: 5, x1: 24, y1: 18 });
        for (i, pixel) in picture.pixels.iter_mut().enumerate() {
            let i = i as f32;
            *pixel = [i * 0.1, 1.0 / (i + 3.0), (i * 0.7).sin().abs() * 1e3, 1.0 / (1.0 + i % 2.0)];
        }
        picture
    }

    fn described() -> Description {
        let date = SystemTime::UNIX_EPOCH + Duration::from_secs(1_709_210_096);
        Description {
            scene: Some("сцена.toml".into()),
            scene_hash: Some("00ff".into()),
            camera: Some(Camera {
                name: None,
                eye: DVec3::new(0.0, 0.0, 8.0),
                target: DVec3::ZERO,
                up: DVec3::Y,
                lens: Lens::Pinhole { vfov: 45.0 },
            }),
            spp: Some(16),
            seed: Some(u64::MAX),
            frame: Some(12),
            frames_per_second: Some((25, 1)),
            owner: Some("someone".into()),
            comments: Some(String::new()),
            run: Some(Run { date, seconds: 1.5, threads: 2, rays: Some("9".into()), shard: Some("1/4".into()) }),
        }
    }

    fn header(bytes: &[u8]) -> Header {
        MetaData::read_from_buffered(bytes, true).unwrap().headers[0].clone()
    }

    fn written_and_read(picture: &Picture, float: bool) -> (Picture, Losses) {
        let room = tempfile::tempdir().unwrap();
        let path = room.path().join("a.exr");
        let options = Options { float, ..Options::default() };
        let losses = output::write(&path, picture, options, &described()).unwrap();
        (output::read(&path).unwrap(), losses)
    }

    #[test]
    fn floats_come_back_as_they_were() {
        let picture = picture();
        assert_eq!(written_and_read(&picture, true), (picture, Losses::default()));
    }

    #[test]
    fn halves_come_back_as_the_nearest_ones() {
        let picture = picture();
        let (back, losses) = written_and_read(&picture, false);
        assert_eq!((back.display, back.window, losses), (picture.display, picture.window, Losses::default()));
        let mut rounded = 0;
        for (got, want) in back.pixels.iter().flatten().zip(picture.pixels.iter().flatten()) {
            assert_eq!(*got, f16::from_f32(*want).to_f32());
            // Half a unit in the last of eleven bits.
            assert!((got - want).abs() <= want * 2f32.powi(-11), "{got} {want}");
            rounded += usize::from(got != want);
        }
        assert!(rounded > 400, "{rounded}");
    }

    #[test]
    fn what_a_sample_cannot_be_is_clamped_or_dropped_and_counted() {
        let mut picture = Picture::new((2, 1), Window::full((2, 1)));
        picture.pixels = vec![[f32::NAN, f32::INFINITY, 65519.0, 1.0], [1e9, -1e9, f32::NEG_INFINITY, 65504.0]];
        let (half, losses) = written_and_read(&picture, false);
        assert_eq!(half.pixels, [[0.0, 0.0, 65504.0, 1.0], [65504.0, -65504.0, 0.0, 65504.0]]);
        assert_eq!(losses, Losses { clamped: 3, dropped: 3 });
        let (float, losses) = written_and_read(&picture, true);
        assert_eq!(float.pixels, [[0.0, 0.0, 65519.0, 1.0], [1e9, -1e9, 0.0, 65504.0]]);
        assert_eq!(losses, Losses { clamped: 0, dropped: 3 });
    }

    #[test]
    fn the_header_says_windows_channels_and_compression() {
        let header = header(&encode(&picture(), false, &described()).unwrap().0);
        assert_eq!(header.data_window(), IntegerBounds::new((7, 5), (17, 13)));
        assert_eq!(header.shared_attributes.display_window, IntegerBounds::new((0, 0), (40, 30)));
        assert_eq!((header.compression, header.line_order), (Compression::ZIP1, LineOrder::Increasing));
        let channels = header.channels.list.iter().map(|channel| channel.name.to_string());
        assert_eq!(channels.collect::<String>(), "ABGR");
        assert_eq!(header.channels.uniform_sample_type, Some(SampleType::F16));
        let white = header.shared_attributes.chromaticities.unwrap().white;
        assert_eq!(white, Vec2(0.3127, 0.3290));
    }

    #[test]
    fn the_header_says_where_the_picture_comes_from() {
        let header = header(&encode(&picture(), true, &described()).unwrap().0);
        let own = &header.own_attributes;
        assert_eq!(own.software_name, Some(text(&description::software())));
        assert_eq!(own.capture_date, Some(text("2024:02:29 12:34:56")));
        assert_eq!((own.utc_offset, own.frames_per_second), (Some(0.0), Some((25, 1))));
        assert_eq!((own.owner.clone(), own.screen_window_center), (Some(text("someone")), Vec2(0.0, 0.0)));
        let value = |name: &str| own.other.get(&text(name)).cloned();
        assert_eq!(value("render/scene"), Some(AttributeValue::Text(text("сцена.toml"))));
        assert_eq!(value("render/seed"), Some(AttributeValue::Text(text("18446744073709551615"))));
        assert_eq!(value("samplesPerPixel"), Some(AttributeValue::I32(16)));
        assert_eq!(value("renderTimeSeconds"), Some(AttributeValue::F32(1.5)));
        assert_eq!(value("render/threads"), Some(AttributeValue::I32(2)));
        assert_eq!(own.other.len(), 11);
    }

    #[test]
    fn without_a_run_nothing_differs_between_runs() {
        let description = Description { run: None, ..described() };
        let first = encode(&picture(), false, &description).unwrap();
        // Every hash map has seeds of its own, so unsorted attributes would differ at once.
        for _ in 0..8 {
            assert!(encode(&picture(), false, &description).unwrap() == first);
        }
        let own = header(&first.0).own_attributes;
        assert_eq!((own.capture_date, own.utc_offset, own.other.len()), (None, None, 6));
    }

    #[test]
    fn a_picture_that_is_not_whole_is_refused() {
        let empty = Picture::new((4, 4), Window { x0: 2, y0: 2, x1: 2, y1: 4 });
        let mut short = picture();
        short.pixels.pop();
        let one = Window::full((1, 1));
        let far = Window { x0: i32::MAX - 1, y0: 0, x1: i32::MAX, y1: 1 };
        for picture in
            [empty, short, Picture::new((4, 4), far), Picture::new((0, 0), one), Picture::new((u32::MAX, 1), one)]
        {
            assert!(encode(&picture, false, &described()).is_err(), "{:?}", picture.window);
        }
    }
}
