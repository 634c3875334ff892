//! What makes errors visible: the difference of engine and reference, pixel by pixel, as layers and as figures.

use glam::DVec3;
use serde::Serialize;

use super::check::{Cast, ulps};
use crate::film::{Channel, Picture, Samples, Window};
use crate::reference::{self, Reference};
use crate::tracer::Tracer;

/// One pixel by both.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelDifference {
    at: (i32, i32),
    engine: [f32; 4],
    reference: [f64; 4],
    /// Where the first camera ray ends, scene units, by both.
    depth: Option<[f64; 2]>,
    /// Difference of its `t`.
    ulps: Option<f64>,
    /// Between the geometric normals.
    degrees: Option<f64>,
    /// Another primitive than the reference's, or none, or one for none.
    wrong: bool,
}

/// Figures of the layers, over the pixels compared.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct LayerReport {
    /// Pixels compared.
    pub pixels: u64,
    /// Those whose first camera ray met another primitive.
    pub wrong_object: u64,
    /// Largest difference of red, green, blue.
    pub radiance: Percentiles,
    /// Difference of the depth, in ulps of f32.
    pub depth_ulps: Percentiles,
    /// Angle between the geometric normals, in degrees.
    pub normal_degrees: Percentiles,
}

/// Of absolute values.
#[derive(Debug, Clone, Copy, Default, Serialize)]
#[allow(missing_docs)] // the names say it
pub struct Percentiles {
    pub count: u64,
    pub p50: f64,
    pub p90: f64,
    pub p99: f64,
    pub max: f64,
}

/// The pictures; pixels that were not compared are empty.
#[derive(Debug, Clone)]
pub struct Layers {
    /// Engine minus reference in R, G, B, and as channels: both pictures, depth, normal, wrong object.
    pub differences: Picture,
    /// The engine's picture.
    pub engine: Picture,
    /// The reference's.
    pub reference: Picture,
}

/// What is needed to know normals and depths of both.
pub(super) struct Eyes<'a, 's> {
    pub tracer: &'a Tracer<'s>,
    pub reference: &'a Reference,
}

impl Eyes<'_, '_> {
    /// One pixel: values, and the camera ray of its first sample as both traced it.
    pub fn see(
        &self,
        at: (i32, i32),
        (engine, reference): ([f32; 4], [f64; 4]),
        cast: Option<&Cast>,
        ray: &reference::Ray,
    ) -> PixelDifference {
        let met = cast.and_then(|cast| cast.met.map(|primitive| primitive as usize));
        let hit = self.reference.closest(ray);
        let mut pixel = PixelDifference {
            at,
            engine,
            reference,
            depth: None,
            ulps: None,
            degrees: None,
            wrong: met != hit.as_ref().map(|hit| hit.primitive),
        };
        let (Some(cast), Some(hit), false) = (cast, hit, pixel.wrong) else { return pixel };
        let length = DVec3::from_array(cast.ray.dir.map(f64::from)).length();
        pixel.depth = Some([f64::from(cast.t) * length, hit.t * ray.dir.length()]);
        pixel.ulps = Some(ulps(cast.t, hit.t));
        let seen = self.tracer.closest_hit(&cast.ray).filter(|seen| seen.primitive as usize == hit.primitive);
        pixel.degrees = seen.map(|seen| {
            let normal = DVec3::from_array(seen.normal.map(f64::from));
            normal.cross(hit.normal).length().atan2(normal.dot(hit.normal)).to_degrees()
        });
        pixel
    }
}

/// Figures of some pixels.
pub(super) fn figures(pixels: &[PixelDifference]) -> LayerReport {
    let radiance = |pixel: &PixelDifference| (0..3).map(|k| (pixel.difference(k)).abs()).fold(0.0, f64::max);
    LayerReport {
        pixels: pixels.len() as u64,
        wrong_object: pixels.iter().filter(|pixel| pixel.wrong).count() as u64,
        radiance: Percentiles::of(pixels.iter().map(radiance)),
        depth_ulps: Percentiles::of(pixels.iter().filter_map(|pixel| pixel.ulps)),
        normal_degrees: Percentiles::of(pixels.iter().filter_map(|pixel| pixel.degrees)),
    }
}

/// Pictures of some pixels.
pub(super) fn pictures(pixels: &[PixelDifference], display: (u32, u32)) -> Layers {
    let window = Window::full(display);
    let empty = || Picture::new(display, window);
    let (mut differences, mut engine, mut reference) = (empty(), empty(), empty());
    let names =
        ["engine.R", "engine.G", "engine.B", "reference.R", "reference.G", "reference.B", "depth.Z", "depth.ulps"];
    let mut channels: Vec<(&str, Vec<f32>)> = names
        .into_iter()
        .chain(["depth.difference", "normal.degrees", "wrong.Y"])
        .map(|name| (name, vec![0.0; window.area()]))
        .collect();
    for pixel in pixels {
        let Some(i) = window.index(pixel.at.0, pixel.at.1) else { continue };
        let want = pixel.reference.map(|value| value as f32);
        (engine.pixels[i], reference.pixels[i]) = (pixel.engine, want);
        let [r, g, b] = [0, 1, 2].map(|k| pixel.difference(k) as f32);
        differences.pixels[i] = [r, g, b, 1.0];
        let depth = pixel.depth.unwrap_or_default();
        let values = [
            pixel.engine[0],
            pixel.engine[1],
            pixel.engine[2],
            want[0],
            want[1],
            want[2],
            depth[0] as f32,
            pixel.ulps.unwrap_or(0.0) as f32,
            (depth[0] - depth[1]) as f32,
            pixel.degrees.unwrap_or(0.0) as f32,
            f32::from(u8::from(pixel.wrong)),
        ];
        channels.iter_mut().zip(values).for_each(|((_, samples), value)| samples[i] = value);
    }
    let channel =
        |(name, samples): (&str, Vec<f32>)| Channel { name: name.into(), samples: Samples::Float(samples.into()) };
    differences.channels = channels.into_iter().map(channel).collect();
    Layers { differences, engine, reference }
}

impl PixelDifference {
    fn difference(&self, k: usize) -> f64 {
        f64::from(self.engine[k]) - self.reference[k]
    }
}

impl Percentiles {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.map(f64::abs).collect();
        values.sort_unstable_by(f64::total_cmp);
        let at =
            |share: f64| values.get((share * values.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(0.0);
        Percentiles { count: values.len() as u64, p50: at(0.5), p90: at(0.9), p99: at(0.99), max: at(1.0) }
    }
}

impl std::fmt::Display for LayerReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "{:<22} {:>10} {:>10} {:>10} {:>10} {:>10}", "layer", "pixels", "p50", "p90", "p99", "max")?;
        let rows = [
            ("radiance", &self.radiance),
            ("depth, ulps", &self.depth_ulps),
            ("normal, degrees", &self.normal_degrees),
        ];
        for (name, Percentiles { count, p50, p90, p99, max }) in rows {
            writeln!(f, "{name:<22} {count:>10} {p50:>10.2e} {p90:>10.2e} {p99:>10.2e} {max:>10.2e}")?;
        }
        write!(f, "wrong object: {} of {} pixels", self.wrong_object, self.pixels)
    }
}
