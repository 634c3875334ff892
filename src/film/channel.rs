//! One channel beside the colour.

use std::borrow::Cow;
use std::ops::Range;

use half::f16;
use half::slice::HalfFloatSliceExt;

use super::Plane;

/// A channel of a picture beside red, green, blue and alpha.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// The full name as a file has it: layer, one dot, suffix ("depth.Z").
    pub name: String,
    /// One sample a pixel of the picture's window, row by row from the top.
    pub samples: Samples,
}

/// Samples of a channel, by the type that a file stores them in.
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    /// 16-bit floats.
    Half(Plane<f16>),
    /// 16-bit floats that are rounded when they are written: those of colours in other primaries than their file's.
    Unrounded(Plane<f32>),
    /// 32-bit floats, also where colour is stored in 16.
    Float(Plane<f32>),
    /// 32-bit unsigned integers.
    Uint(Plane<u32>),
}

/// The type that a file stores samples in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleKind {
    /// 16-bit floats.
    Half,
    /// 32-bit floats.
    Float,
    /// 32-bit unsigned integers.
    Uint,
}

impl SampleKind {
    /// So many zeros.
    pub fn zeros(self, count: usize) -> Samples {
        match self {
            SampleKind::Half => Samples::Half(Plane::zeroed(count)),
            SampleKind::Float => Samples::Float(Plane::zeroed(count)),
            SampleKind::Uint => Samples::Uint(Plane::zeroed(count)),
        }
    }
}

impl Samples {
    /// Rounded to the nearest halves, of which the largest is 65504 and the next infinity.
    pub fn halves(samples: &[f32]) -> Samples {
        let mut halves = vec![f16::ZERO; samples.len()];
        halves.convert_from_f32_slice(samples);
        Samples::Half(halves.into())
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Samples::Half(samples) => samples.len(),
            Samples::Unrounded(samples) | Samples::Float(samples) => samples.len(),
            Samples::Uint(samples) => samples.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The type that a file stores them in.
    pub fn kind(&self) -> SampleKind {
        match self {
            Samples::Half(_) | Samples::Unrounded(_) => SampleKind::Half,
            Samples::Float(_) => SampleKind::Float,
            Samples::Uint(_) => SampleKind::Uint,
        }
    }

    /// The bits of one of them, as it is held here.
    pub fn bits(&self, i: usize) -> u32 {
        match self {
            Samples::Half(samples) => samples[i].to_bits().into(),
            Samples::Unrounded(samples) | Samples::Float(samples) => samples[i].to_bits(),
            Samples::Uint(samples) => samples[i],
        }
    }

    /// Some stretches of them, one after another.
    pub fn rows(&self, rows: &[Range<usize>]) -> Samples {
        match self {
            Samples::Half(samples) => Samples::Half(pick(samples, rows)),
            Samples::Unrounded(samples) => Samples::Unrounded(pick(samples, rows)),
            Samples::Float(samples) => Samples::Float(pick(samples, rows)),
            Samples::Uint(samples) => Samples::Uint(pick(samples, rows)),
        }
    }

    /// Floats of either width; `None` for integers.
    pub fn floats(&self) -> Option<Cow<'_, [f32]>> {
        match self {
            Samples::Half(samples) => Some(samples.to_f32_vec().into()),
            Samples::Unrounded(samples) | Samples::Float(samples) => Some(Cow::Borrowed(samples)),
            Samples::Uint(_) => None,
        }
    }

    /// The same floats to write in, no longer rounded; `None` for integers.
    pub fn unrounded(&mut self) -> Option<&mut [f32]> {
        if let Samples::Half(samples) = self {
            *self = Samples::Unrounded(samples.to_f32_vec().into());
        }
        match self {
            Samples::Unrounded(samples) | Samples::Float(samples) => Some(samples),
            Samples::Half(_) | Samples::Uint(_) => None,
        }
    }
}

impl Channel {
    /// What comes before the dot of the name; nothing where there is none.
    pub fn layer(&self) -> &str {
        self.name.rsplit_once('.').map_or("", |(layer, _)| layer)
    }

    /// Some stretches of the samples, one after another.
    pub(super) fn rows(&self, rows: &[Range<usize>]) -> Channel {
        Channel { name: self.name.clone(), samples: self.samples.rows(rows) }
    }
}

fn pick<T: Copy>(samples: &[T], rows: &[Range<usize>]) -> Plane<T> {
    rows.iter().flat_map(|row| &samples[row.clone()]).copied().collect()
}
