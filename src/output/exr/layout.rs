//! Which channels a file has, of which types, in which parts and order.

use exr::meta::attribute::{ChannelDescription, ChannelList, SampleType};
use half::f16;
use half::slice::HalfFloatSliceExt;

use super::{Compression, HALF_MAX, Storage, text};
use crate::film::{Channel, Picture, Samples};
use crate::output::{EncodeError, Losses};

/// A part of a file: its channels, and how they are compressed.
#[derive(Debug)]
pub(super) struct Part<'a> {
    /// Its name, which files of one part do not state.
    pub name: String,
    pub compression: Compression,
    /// In the order of their names, as the format wants them.
    pub channels: Vec<Stored<'a>>,
}

/// A channel as it is stored.
#[derive(Debug)]
pub(super) struct Stored<'a> {
    pub name: &'a str,
    pub source: Source<'a>,
}

/// Where the samples of a channel come from, and by that their type.
#[derive(Debug, Clone, Copy)]
pub(super) enum Source<'a> {
    /// One of red, green, blue, alpha of all pixels, as halves or floats.
    Color {
        pixels: &'a [[f32; 4]],
        slot: usize,
        float: bool,
    },
    Half(&'a [f16]),
    Unrounded(&'a [f32]),
    Float(&'a [f32]),
    Uint(&'a [u32]),
}

/// All parts of a picture's file.
///
/// One, unless one a layer is asked for, or the compression loses something: then layers of floats and integers, among
/// them depth, positions, ids and Cryptomattes, have a part of their own that loses nothing.
///
/// # Errors
/// A name that is empty, occurs twice, or holds a zero.
pub(super) fn parts<'a>(picture: &'a Picture, storage: Storage) -> Result<Vec<Part<'a>>, EncodeError> {
    let lossy = storage.compression.may_loose_data();
    let mut parts: Vec<Part<'a>> = Vec::new();
    for (channel, group) in stored(picture, storage) {
        let exact = lossy && group.is_some() && channel.source.kind() != SampleType::F16;
        let name = match group {
            Some(layer) if storage.multipart => layer,
            _ if exact => "data".to_owned(),
            _ => "rgba".to_owned(),
        };
        match parts.iter_mut().find(|part| part.name == name) {
            Some(part) => part.channels.push(channel),
            None => {
                let compression = if exact { Compression::Zips } else { storage.compression };
                parts.push(Part { name, compression, channels: vec![channel] });
            }
        }
    }
    for part in &mut parts {
        part.channels.sort_by_key(|channel| channel.name);
        check_names(part)?;
    }
    parts.retain(|part| !part.channels.is_empty());
    // Colour comes first, since some readers show the first part alone.
    parts.sort_by(|a, b| (a.name != "rgba", &a.name).cmp(&(b.name != "rgba", &b.name)));
    Ok(parts)
}

/// All channels with the layers that they belong to: `None` for colour.
fn stored<'a>(picture: &'a Picture, storage: Storage) -> impl Iterator<Item = (Stored<'a>, Option<String>)> {
    let color = ["R", "G", "B", "A"].into_iter().enumerate().map(move |(slot, name)| {
        let source = Source::Color { pixels: &picture.pixels, slot, float: storage.float };
        (Stored { name, source }, None)
    });
    let beside = picture.channels.iter().map(move |channel| {
        let source = match &channel.samples {
            Samples::Half(samples) => Source::Half(samples),
            Samples::Unrounded(samples) => Source::Unrounded(samples),
            Samples::Float(samples) => Source::Float(samples),
            Samples::Uint(samples) => Source::Uint(samples),
        };
        let name = if storage.root_depth && channel.name == "depth.Z" { "Z" } else { &channel.name };
        (Stored { name, source }, Some(group(picture, channel)))
    });
    color.chain(beside)
}

/// The layer of a channel; all ranks of a Cryptomatte are one.
fn group(picture: &Picture, channel: &Channel) -> String {
    let matte = picture.cryptomattes.iter().find(|matte| matte.owns(channel));
    let layer = matte.map_or(channel.layer(), |matte| &matte.name);
    if layer.is_empty() { channel.name.clone() } else { layer.to_owned() }
}

fn check_names(part: &Part<'_>) -> Result<(), EncodeError> {
    for pair in part.channels.windows(2) {
        if pair[0].name == pair[1].name {
            return Err(EncodeError(format!("two channels are called \"{}\"", pair[0].name)));
        }
    }
    let bad = part.channels.iter().find(|channel| {
        let length = channel.name.len();
        length == 0 || length > 255 || channel.name.contains('\0')
    });
    bad.map_or(Ok(()), |bad| Err(EncodeError(format!("a channel cannot be called {:?}", bad.name))))
}

impl Part<'_> {
    /// As the header says it.
    pub fn list(&self) -> ChannelList {
        let one = |channel: &Stored<'_>| ChannelDescription::new(text(channel.name), channel.source.kind(), false);
        ChannelList::new(self.channels.iter().map(one).collect())
    }

    /// The samples of a row, channel after channel, in the byte order of this machine.
    pub fn put_row(&self, row: std::ops::Range<usize>, bytes: &mut [u8]) {
        let mut rest = bytes;
        for channel in &self.channels {
            let size = row.len() * channel.source.kind().bytes_per_sample();
            let (mine, more) = rest.split_at_mut(size);
            channel.source.put(row.clone(), mine);
            rest = more;
        }
    }
}

impl Source<'_> {
    pub fn kind(&self) -> SampleType {
        match self {
            Source::Color { float: false, .. } | Source::Half(_) | Source::Unrounded(_) => SampleType::F16,
            Source::Color { float: true, .. } | Source::Float(_) => SampleType::F32,
            Source::Uint(_) => SampleType::U32,
        }
    }

    fn put(&self, row: std::ops::Range<usize>, bytes: &mut [u8]) {
        match *self {
            Source::Color { pixels, slot, float } => {
                let samples: Vec<f32> = pixels[row].iter().map(|pixel| pixel[slot]).collect();
                if float { put_floats(&samples, bytes) } else { put_halves(&samples, bytes) }
            }
            Source::Half(samples) => {
                let places = bytes.as_chunks_mut().0.iter_mut();
                let sound = |sample: &f16| if sample.is_finite() { *sample } else { f16::ZERO };
                places.zip(&samples[row]).for_each(|(place, sample)| *place = sound(sample).to_ne_bytes());
            }
            Source::Unrounded(samples) => put_halves(&samples[row], bytes),
            Source::Float(samples) => put_floats(&samples[row], bytes),
            Source::Uint(samples) => {
                let places = bytes.as_chunks_mut().0.iter_mut();
                places.zip(&samples[row]).for_each(|(place, sample)| *place = sample.to_ne_bytes());
            }
        }
    }

    /// What the type of the channel does not hold.
    pub fn losses(&self) -> Losses {
        match *self {
            Source::Color { pixels, slot, float } => losses(!float, pixels.iter().map(|pixel| pixel[slot])),
            Source::Half(samples) => losses(true, samples.iter().map(|sample| sample.to_f32())),
            Source::Unrounded(samples) => losses(true, samples.iter().copied()),
            Source::Float(samples) => losses(false, samples.iter().copied()),
            Source::Uint(_) => Losses::default(),
        }
    }
}

/// Samples that are not finite, and those that a half does not hold.
fn losses(half: bool, samples: impl Iterator<Item = f32>) -> Losses {
    let limit = if half { HALF_MAX } else { f32::MAX };
    let (dropped, beyond) = samples.fold((0u64, 0u64), |(dropped, beyond), sample| {
        let size = sample.abs();
        // NaN is not beyond anything.
        (dropped + u64::from(!sample.is_finite()), beyond + u64::from(size > limit && size < f32::INFINITY))
    });
    Losses { dropped, clamped: beyond }
}

/// Rounding to the nearest half would turn 65520 and more into infinity.
fn put_halves(samples: &[f32], bytes: &mut [u8]) {
    let sound = |sample: &f32| if sample.is_finite() { sample.clamp(-HALF_MAX, HALF_MAX) } else { 0.0 };
    let samples: Vec<f32> = samples.iter().map(sound).collect();
    let mut halves = vec![f16::ZERO; samples.len()];
    halves.convert_from_f32_slice(&samples);
    let places = bytes.as_chunks_mut().0.iter_mut();
    places.zip(halves).for_each(|(place, half)| *place = half.to_ne_bytes());
}

fn put_floats(samples: &[f32], bytes: &mut [u8]) {
    let places = bytes.as_chunks_mut().0.iter_mut();
    places.zip(samples).for_each(|(place, sample)| {
        *place = if sample.is_finite() { *sample } else { 0.0 }.to_ne_bytes();
    });
}
