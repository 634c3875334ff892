//! Which channels a file has, of which types, in which parts and order.

use std::ops::Range;

use exr::meta::attribute::{ChannelDescription, ChannelList, SampleType};
use half::f16;
use half::slice::HalfFloatSliceExt;

use super::{Compression, HALF_MAX, Storage, text};
use crate::film::{Channel, Picture, SampleKind, Samples};
use crate::output::{EncodeError, Losses};

/// A part of a file: its channels, and how they are compressed.
#[derive(Debug, Clone)]
pub(super) struct Part {
    /// Its name, which files of one part do not state.
    pub name: String,
    pub compression: Compression,
    /// In the order of their names, as the format wants them.
    pub channels: Vec<Stored>,
}

/// A channel as it is stored.
#[derive(Debug, Clone)]
pub(super) struct Stored {
    pub name: String,
    pub source: Source,
}

/// Where in a picture the samples of a channel are, and their type in the file.
#[derive(Debug, Clone, Copy)]
pub(super) enum Source {
    /// One of red, green, blue, alpha, as floats or halves.
    Color { slot: usize, float: bool },
    /// A channel beside them, by its place.
    Beside(usize, SampleType),
}

/// All parts of a picture's file.
///
/// One, unless one a layer is asked for, or the compression loses something: then layers of floats and integers, among
/// them depth, positions, ids and Cryptomattes, have a part of their own that loses nothing.
///
/// # Errors
/// A name that is empty, occurs twice, or holds a zero.
pub(super) fn parts(picture: &Picture, storage: Storage) -> Result<Vec<Part>, EncodeError> {
    let lossy = storage.compression.may_loose_data();
    let mut parts: Vec<Part> = Vec::new();
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
        part.channels.sort_by(|a, b| a.name.cmp(&b.name));
        check_names(part)?;
    }
    parts.retain(|part| !part.channels.is_empty());
    // Colour comes first, since some readers show the first part alone.
    parts.sort_by(|a, b| (a.name != "rgba", &a.name).cmp(&(b.name != "rgba", &b.name)));
    Ok(parts)
}

/// All channels with the layers that they belong to: `None` for colour.
fn stored(picture: &Picture, storage: Storage) -> impl Iterator<Item = (Stored, Option<String>)> {
    let color = ["R", "G", "B", "A"].into_iter().enumerate().map(move |(slot, name)| {
        let source = Source::Color { slot, float: storage.float };
        (Stored { name: name.to_owned(), source }, None)
    });
    let beside = picture.channels.iter().enumerate().map(move |(index, channel)| {
        let kind = match channel.samples.kind() {
            SampleKind::Half => SampleType::F16,
            SampleKind::Float => SampleType::F32,
            SampleKind::Uint => SampleType::U32,
        };
        let name = if storage.root_depth && channel.name == "depth.Z" { "Z" } else { &channel.name };
        (Stored { name: name.to_owned(), source: Source::Beside(index, kind) }, Some(group(picture, channel)))
    });
    color.chain(beside)
}

/// The layer of a channel; all ranks of a Cryptomatte are one.
fn group(picture: &Picture, channel: &Channel) -> String {
    let matte = picture.cryptomattes.iter().find(|matte| matte.owns(channel));
    let layer = matte.map_or(channel.layer(), |matte| &matte.name);
    if layer.is_empty() { channel.name.clone() } else { layer.to_owned() }
}

fn check_names(part: &Part) -> Result<(), EncodeError> {
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

impl Part {
    /// As the header says it.
    pub fn list(&self) -> ChannelList {
        let one = |channel: &Stored| ChannelDescription::new(text(&channel.name), channel.source.kind(), false);
        ChannelList::new(self.channels.iter().map(one).collect())
    }

    /// The samples of a row of a picture, channel after channel, in the byte order of this machine; what the types of the
    /// channels do not hold.
    pub fn put_row(&self, picture: &Picture, row: Range<usize>, bytes: &mut [u8]) -> Losses {
        let (mut rest, mut losses) = (bytes, Losses::default());
        for channel in &self.channels {
            let size = row.len() * channel.source.kind().bytes_per_sample();
            let (mine, more) = rest.split_at_mut(size);
            losses = losses.and(channel.source.put(picture, row.clone(), mine));
            rest = more;
        }
        losses
    }
}

impl Source {
    pub fn kind(self) -> SampleType {
        match self {
            Source::Color { float: false, .. } => SampleType::F16,
            Source::Color { float: true, .. } => SampleType::F32,
            Source::Beside(_, kind) => kind,
        }
    }

    fn put(self, picture: &Picture, row: Range<usize>, bytes: &mut [u8]) -> Losses {
        match self {
            Source::Color { slot, float } => {
                let samples: Vec<f32> = picture.pixels[row].iter().map(|pixel| pixel[slot]).collect();
                if float { put_floats(&samples, bytes) } else { put_halves(&samples, bytes) }
            }
            Source::Beside(index, _) => match &picture.channels[index].samples {
                Samples::Half(samples) => put_sound_halves(&samples[row], bytes),
                Samples::Unrounded(samples) => put_halves(&samples[row], bytes),
                Samples::Float(samples) => put_floats(&samples[row], bytes),
                Samples::Uint(samples) => {
                    let places = bytes.as_chunks_mut().0.iter_mut();
                    places.zip(&samples[row]).for_each(|(place, sample)| *place = sample.to_ne_bytes());
                    Losses::default()
                }
            },
        }
    }
}

/// Samples that are not finite, and those beyond the largest half.
fn losses(samples: &[f32]) -> Losses {
    let (dropped, clamped) = samples.iter().fold((0, 0), |(dropped, clamped), sample| {
        let size = sample.abs();
        // NaN is not beyond anything.
        (dropped + u32::from(!sample.is_finite()), clamped + u32::from(size > HALF_MAX && size < f32::INFINITY))
    });
    Losses { dropped: dropped.into(), clamped: clamped.into() }
}

fn put_sound_halves(samples: &[f16], bytes: &mut [u8]) -> Losses {
    let mut dropped = 0u32;
    for (place, sample) in bytes.as_chunks_mut().0.iter_mut().zip(samples) {
        dropped += u32::from(!sample.is_finite());
        *place = if sample.is_finite() { *sample } else { f16::ZERO }.to_ne_bytes();
    }
    Losses { dropped: dropped.into(), clamped: 0 }
}

/// Rounding to the nearest half would turn 65520 and more into infinity.
fn put_halves(samples: &[f32], bytes: &mut [u8]) -> Losses {
    let sound = |sample: &f32| if sample.is_finite() { sample.clamp(-HALF_MAX, HALF_MAX) } else { 0.0 };
    let sounds: Vec<f32> = samples.iter().map(sound).collect();
    let mut halves = vec![f16::ZERO; samples.len()];
    halves.convert_from_f32_slice(&sounds);
    let places = bytes.as_chunks_mut().0.iter_mut();
    places.zip(halves).for_each(|(place, half)| *place = half.to_ne_bytes());
    losses(samples)
}

fn put_floats(samples: &[f32], bytes: &mut [u8]) -> Losses {
    let mut dropped = 0u32;
    for (place, sample) in bytes.as_chunks_mut().0.iter_mut().zip(samples) {
        dropped += u32::from(!sample.is_finite());
        *place = if sample.is_finite() { *sample } else { 0.0 }.to_ne_bytes();
    }
    Losses { dropped: dropped.into(), clamped: 0 }
}
