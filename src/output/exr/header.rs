//! What a header says beside its channels: windows, colours, camera, where the picture comes from.
//!
//! Attributes follow "Standard Attributes" of the OpenEXR documentation; those of our own begin with `render/`.

use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, Text};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes, standard_names};
use exr::prelude::LineOrder;

use super::layout::Part;
use super::manifest::{self, Manifest};
use super::{Storage, text};
use crate::film::{Picture, Window};
use crate::output::color::Primaries;
use crate::output::read::MOST_PIXELS;
use crate::output::view::View;
use crate::output::{Description, EncodeError, description};

/// The attribute that holds the hash of the samples.
pub const PIXEL_HASH: &str = "render/pixelHash";

/// The attribute that holds the window that was rendered.
const RENDERED: &str = "render/window";

/// Attributes of a file that say neither what its samples are nor where they lie, kept for the next file.
#[derive(Debug, Clone, PartialEq)]
pub struct Attributes {
    pub(in crate::output) shared: ImageAttributes,
    pub(in crate::output) own: LayerAttributes,
}

impl Attributes {
    /// Text of an attribute, `render/scene`; numbers as text. `None` where there is none, or it is neither.
    pub fn text(&self, name: &str) -> Option<String> {
        match self.own.other.get(&text(name))? {
            AttributeValue::Text(text) => Some(String::from_utf8_lossy(text.as_slice()).into_owned()),
            AttributeValue::I32(number) => Some(number.to_string()),
            AttributeValue::F32(number) => Some(number.to_string()),
            _ => None,
        }
    }

    /// Where the display window begins: there is (0, 0) of the picture.
    pub fn origin(&self) -> (i32, i32) {
        let Vec2(x, y) = self.shared.display_window.position;
        (x, y)
    }

    /// The window that was rendered, where that is said to be larger than the picture's.
    pub fn rendered(&self, picture: &Picture) -> Option<Window> {
        let AttributeValue::IntegerBounds(found) = self.own.other.get(&text(RENDERED))? else { return None };
        let far = |from: i32, size: usize| from.checked_add(i32::try_from(size).ok()?);
        let (Vec2(x0, y0), Vec2(width, height)) = (found.position, found.size);
        let origin = self.origin();
        let (x0, y0) = (x0.checked_sub(origin.0)?, y0.checked_sub(origin.1)?);
        let window = Window { x0, y0, x1: far(x0, width)?, y1: far(y0, height)? };
        (window.holds(&picture.window) && window.area() <= MOST_PIXELS).then_some(window)
    }

    /// Without what differs from run to run: date, seconds, threads, rays, shard.
    pub fn without_run(mut self) -> Self {
        let run = ["render/seconds", "renderTimeSeconds", "render/threads", "render/rays", "render/shard"];
        run.iter().for_each(|name| drop(self.own.other.remove(&text(name))));
        (self.own.capture_date, self.own.utc_offset) = (None, None);
        self
    }

    /// Whether anything of that is there.
    pub fn has_run(&self) -> bool {
        *self != self.clone().without_run()
    }
}

/// The headers of all parts, their Cryptomatte metadata included.
///
/// # Errors
/// Sizes beyond those of the format.
pub(super) fn headers(
    picture: &Picture,
    parts: &[Part],
    storage: Storage,
    description: &Description,
    manifests: &[Manifest],
) -> Result<Vec<Header>, EncodeError> {
    let shared = image_attributes(picture, storage, description)?;
    let own = layer_attributes(picture, description);
    let size = Vec2(picture.window.width(), picture.window.height());
    let header = |part: &Part| {
        let mut own = own.clone();
        own.layer_name = (parts.len() > 1).then(|| text(&part.name));
        for manifest in manifests.iter().filter(|manifest| manifest.is_of(part)) {
            own.other
                .extend(manifest.attributes().map(|(name, value)| (text(&name), AttributeValue::Text(text(&value)))));
        }
        let mut header = Header::new(text(&part.name), size, Default::default());
        header.channels = part.list();
        header.with_shared_attributes(shared.clone()).with_attributes(own).with_encoding(
            part.compression.method(),
            BlockDescription::ScanLines,
            LineOrder::Increasing,
        )
    };
    Ok(parts.iter().map(header).collect())
}

fn image_attributes(
    picture: &Picture,
    storage: Storage,
    description: &Description,
) -> Result<ImageAttributes, EncodeError> {
    let (width, height) = picture.display;
    let size = |size: u32| usize::try_from(size).map_err(EncodeError::new);
    let frame = IntegerBounds::new(origin(description), (size(width)?, size(height)?));
    let kept = description.kept.as_ref().map(|kept| kept.shared.clone());
    let mut attributes = kept.unwrap_or_else(|| ImageAttributes::new(frame));
    attributes.display_window = frame;
    attributes.other.retain(|name, _| is_sound(name.as_slice()));
    attributes.chromaticities = Some(chromaticities(storage.color.primaries()));
    Ok(attributes)
}

/// Where the display window begins: at (0, 0), unless the file that the picture was read from says otherwise.
fn origin(description: &Description) -> (i32, i32) {
    description.kept.as_ref().map_or((0, 0), Attributes::origin)
}

fn chromaticities(primaries: Primaries) -> Chromaticities {
    let [red, green, blue, white] = primaries.xy.map(|xy| Vec2(xy.x as f32, xy.y as f32));
    Chromaticities { red, green, blue, white }
}

fn layer_attributes(picture: &Picture, description: &Description) -> LayerAttributes {
    let mut attributes = match &description.kept {
        Some(kept) => kept.own.clone(),
        None => LayerAttributes { frames_per_second: Some((24, 1)), ..LayerAttributes::default() },
    };
    let origin = origin(description);
    // Added up these are what was read, or what the check of headers refuses.
    let moved = |x: i32, y: i32| (x.saturating_add(origin.0), y.saturating_add(origin.1));
    let (x0, y0) = moved(picture.window.x0, picture.window.y0);
    attributes.layer_position = Vec2(x0, y0);
    attributes.software_name = Some(text(&description::software()));
    let words = |slot: &mut Option<Text>, words: &Option<String>| {
        if let Some(words) = words {
            *slot = Some(text(words));
        }
    };
    words(&mut attributes.owner, &description.owner);
    words(&mut attributes.comments, &description.comments);
    attributes.frames_per_second = description.frames_per_second.or(attributes.frames_per_second);
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
    // What was said of other samples is said anew; a damaged file may have said what none can.
    let is_about_samples =
        |name: &[u8]| manifest::is_about(name) || [PIXEL_HASH, RENDERED].iter().any(|own| name == own.as_bytes());
    // Colours and time codes are shared by all parts, and may not stand among those of one.
    let is_shared =
        |value: &AttributeValue| matches!(value, AttributeValue::Chromaticities(_) | AttributeValue::TimeCode(_));
    attributes
        .other
        .retain(|name, value| is_sound(name.as_slice()) && !is_about_samples(name.as_slice()) && !is_shared(value));
    attributes.other.extend(own_attributes(description).map(|(name, value)| (text(name), value)));
    if let Some(window) = description.rendered {
        let bounds = IntegerBounds::new(moved(window.x0, window.y0), (window.width(), window.height()));
        attributes.other.insert(text(RENDERED), AttributeValue::IntegerBounds(bounds));
    }
    attributes
}

/// Whether an attribute beside the standard ones can have this name.
fn is_sound(name: &[u8]) -> bool {
    !name.is_empty() && !name.contains(&0) && !standard_names::ALL.contains(&name)
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
        ("render/settings", words(&description.settings)),
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
