//! What passes the pixel filter: normals and albedos.

use glam::DVec3;

use super::sums::Places;
use crate::film::Samples;
use crate::lanes::{Float8, LANES, Vec3x8};
use crate::scene::{Aov, Layers};

/// Means of the normals and albedos of each pixel. Samples are drawn from the filter, so all weigh the same.
#[derive(Debug, Default)]
pub(in crate::render) enum Filtered {
    /// No layer needs them.
    #[default]
    Unasked,
    /// Of a single sample: x, y, z, red, green, blue of all pixels.
    Single([Vec<f32>; 6]),
    /// Of several: their sums, x, y, z, red, green, blue, and two to spare, so that a packet is turned into rows once and
    /// each of them added at one go; and what is to be added yet.
    Sums(Vec<[f64; LANES]>, Open),
}

/// Sums of some packets of one pixel, a lane each.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Open {
    pixel: u32,
    packets: usize,
    /// x, y, z, red, green, blue.
    sums: [Float8; 6],
}

impl Open {
    const NONE: Open = Open { pixel: u32::MAX, packets: 0, sums: [Float8::ZERO; 6] };
    /// So few that f32 does to sum them up.
    const MOST: usize = 8;

    /// Adds what there is to its pixel, in an order that is always the same for these samples.
    #[inline(always)]
    fn close(&mut self, rows: &mut [[f64; LANES]]) {
        let Some(row) = rows.get_mut(self.pixel as usize) else { return };
        let lanes = lanes(&self.sums);
        let four: [Float8; 4] = std::array::from_fn(|i| lanes[i] + lanes[i + 4]);
        add(row, (four[0] + four[2]) + (four[1] + four[3]));
    }
}

impl Filtered {
    /// `spp` is `None` where pixels differ.
    pub fn new(layers: Layers, pixels: usize, spp: Option<u32>) -> Self {
        match (layers.has_any(&[Aov::Normal, Aov::Albedo]), spp) {
            (false, _) => Filtered::Unasked,
            (true, Some(1)) => Filtered::Single([(); 6].map(|()| vec![0.0; pixels])),
            (true, _) => Filtered::Sums(vec![[0.0; LANES]; pixels], Open::NONE),
        }
    }

    pub fn is_asked(&self) -> bool {
        !matches!(self, Filtered::Unasked)
    }

    /// Adds a packet to its pixels; lanes that do not count have 0.
    #[inline(always)]
    pub fn add8(&mut self, normal: &Vec3x8, albedo: &Vec3x8, places: &Places) {
        let values = [normal.x, normal.y, normal.z, albedo.x, albedo.y, albedo.z];
        match self {
            Filtered::Unasked => {}
            Filtered::Single(columns) => {
                // A sum, so that there is no zero below zero.
                let values = values.map(|value| (value + Float8::ZERO).to_array());
                columns.iter_mut().zip(&values).for_each(|(column, values)| places.set(column, values));
            }
            Filtered::Sums(rows, open) if places.whole => {
                if open.pixel != places.pixels[0] || open.packets == Open::MOST {
                    open.close(rows);
                    *open = Open { pixel: places.pixels[0], packets: 1, sums: values };
                } else {
                    open.packets += 1;
                    (0..6).for_each(|k| open.sums[k] += values[k]);
                }
            }
            Filtered::Sums(rows, _) => add_lanes(rows, places.pixels, &values),
        }
    }

    /// Adds one sample to a pixel.
    pub fn add(&mut self, pixel: usize, normal: DVec3, albedo: DVec3) {
        let values = normal.to_array().into_iter().chain(albedo.to_array());
        match self {
            Filtered::Unasked => {}
            Filtered::Single(columns) => {
                columns.iter_mut().zip(values).for_each(|(column, value)| column[pixel] += value as f32);
            }
            Filtered::Sums(rows, _) => rows[pixel].iter_mut().zip(values).for_each(|(own, value)| *own += value),
        }
    }

    /// Normals and albedos of all pixels, three channels each; `samples` is how many a pixel has.
    pub fn finish(self, samples: impl Fn(usize) -> u32) -> [[Samples; 3]; 2] {
        let columns = match self {
            Filtered::Unasked => Default::default(),
            Filtered::Single(columns) => columns,
            Filtered::Sums(mut rows, mut open) => {
                open.close(&mut rows);
                columns(rows.len(), |pixel| {
                    let share = 1.0 / f64::from(samples(pixel));
                    Float8::new(rows[pixel].map(|sum| (sum * share) as f32))
                })
            }
        };
        let [x, y, z, red, green, blue] = columns.map(|column| Samples::halves(&column));
        [[x, y, z], [red, green, blue]]
    }
}

/// Adds a packet lane by lane, so that it does not matter how samples are spread over packets.
#[inline(never)]
fn add_lanes(rows: &mut [[f64; LANES]], pixels: &[u32; LANES], values: &[Float8; 6]) {
    pixels.iter().zip(lanes(values)).for_each(|(pixel, lane)| add(&mut rows[*pixel as usize], lane));
}

/// What each lane adds to the row of its pixel.
#[inline(always)]
fn lanes(&[x, y, z, red, green, blue]: &[Float8; 6]) -> [Float8; LANES] {
    Float8::transpose([x, y, z, red, green, blue, Float8::ZERO, Float8::ZERO])
}

#[inline(always)]
fn add(sums: &mut [f64; LANES], values: Float8) {
    sums.iter_mut().zip(values.to_array()).for_each(|(sum, value)| *sum += f64::from(value));
}

/// The first six numbers of so many rows, by column.
#[inline(always)]
fn columns(count: usize, row: impl Fn(usize) -> Float8) -> [Vec<f32>; 6] {
    let mut columns = [(); 6].map(|()| Vec::with_capacity(count));
    for first in (0..count).step_by(LANES) {
        let own = LANES.min(count - first);
        let rows = std::array::from_fn(|i| if i < own { row(first + i) } else { Float8::ZERO });
        for (column, values) in columns.iter_mut().zip(Float8::transpose(rows)) {
            column.extend_from_slice(&values.to_array()[..own]);
        }
    }
    columns
}
