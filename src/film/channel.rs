//! One channel beside the colour.

use std::ops::Range;

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
    /// 16-bit floats; held here in 32, rounded when written.
    Half(Plane<f32>),
    /// 32-bit floats, also where colour is stored in 16.
    Float(Plane<f32>),
    /// 32-bit unsigned integers.
    Uint(Plane<u32>),
}

impl Samples {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Samples::Half(samples) | Samples::Float(samples) => samples.len(),
            Samples::Uint(samples) => samples.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The bits of one of them, as it is held here.
    pub fn bits(&self, i: usize) -> u32 {
        match self {
            Samples::Half(samples) | Samples::Float(samples) => samples[i].to_bits(),
            Samples::Uint(samples) => samples[i],
        }
    }

    /// Some stretches of them, one after another.
    pub fn rows(&self, rows: &[Range<usize>]) -> Samples {
        match self {
            Samples::Half(samples) => Samples::Half(pick(samples, rows)),
            Samples::Float(samples) => Samples::Float(pick(samples, rows)),
            Samples::Uint(samples) => Samples::Uint(pick(samples, rows)),
        }
    }

    /// Floats of either width; `None` for integers.
    pub fn floats(&self) -> Option<&[f32]> {
        match self {
            Samples::Half(samples) | Samples::Float(samples) => Some(samples),
            Samples::Uint(_) => None,
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
