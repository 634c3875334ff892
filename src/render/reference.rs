//! A frame by the reference tracer: slow and plain, what the engine is measured by.

use std::time::Instant;

use glam::DVec3;

use super::layers::{LayerPlan, LayerWork, Near, Place, Sums};
use super::{Renderer, Stats, shutter};
use crate::film::Window;
use crate::integrate::{RayCounts, RayKind};
use crate::plan::Kind;
use crate::reference::{EventKind, Pixel, Reference, View};
use crate::scene::Aov;
use crate::shapes::RowRef;

/// A frame whose rows are its blocks. There are no columns, no tree and no tests to count; of the shadow rays it is
/// not known how many met something.
pub(super) struct Rows {
    /// By moment.
    tracers: Vec<(Reference, View)>,
    spp: u32,
    window: Window,
    /// What the tracer's coordinates are relative to.
    origin: DVec3,
    plan_seconds: f64,
}

/// A row.
#[derive(Debug)]
pub(super) struct RowWork {
    row: usize,
    pub pixels: Vec<[f32; 4]>,
    pub counts: RayCounts,
    pub layers: Option<LayerWork>,
}

impl Rows {
    pub fn new(renderer: &Renderer, window: Window) -> Self {
        let start = Instant::now();
        let origin = renderer.camera.eye;
        let then = |renderer: &Renderer| {
            let tracer = Reference::relative_to(renderer.scene, origin);
            let view = tracer.view(renderer.camera, &renderer.image, &renderer.settings);
            (tracer, view)
        };
        let tracers = renderer.at_moments().iter().map(then).collect();
        let spp = renderer.image.spp;
        Rows { tracers, spp, window, origin, plan_seconds: start.elapsed().as_secs_f64() }
    }

    /// A row, counted from 0; `None` where `stop` asked for that within.
    pub fn trace(&self, row: usize, layers: Option<&LayerPlan>, stop: &(dyn Fn() -> bool + Sync)) -> Option<RowWork> {
        let (mut counts, y) = (RayCounts::default(), self.window.y0 + row as i32);
        let (width, spp) = (self.window.width(), self.spp);
        let mut sums = layers.map(|plan| (plan, Sums::new(plan, width, Some(spp))));
        let mut places = Vec::new();
        let mut pixel = |(index, x)| {
            if stop() {
                return None;
            }
            let pixel = self.pixel(x, y);
            add(&mut counts, &pixel);
            if let Some((plan, sums)) = &mut sums {
                add_layers(plan, sums, index, &pixel);
                places.push(place(&pixel, self.origin));
            }
            Some(pixel.rgba.map(|sample| sample as f32))
        };
        let pixels: Option<Vec<_>> = (self.window.x0..self.window.x1).enumerate().map(&mut pixel).collect();
        let pixels = pixels?;
        let layers = sums.map(|(plan, sums)| sums.finish(plan, |pixel, _| places[pixel]));
        Some(RowWork { row, pixels, counts, layers })
    }

    /// The samples of all moments.
    fn pixel(&self, x: i32, y: i32) -> Pixel {
        let mut all = Pixel::default();
        for (moment, (tracer, view)) in self.tracers.iter().enumerate() {
            let range = shutter::samples(moment, self.tracers.len(), self.spp);
            let share = range.len() as f64 / f64::from(self.spp);
            all.absorb(tracer.samples(view, x, y, range), share);
        }
        all
    }

    pub fn stats(&self) -> Stats {
        Stats { plan_seconds: self.plan_seconds, ..Stats::default() }
    }
}

impl RowWork {
    /// Its pixels, in a picture of this window.
    pub fn window(&self, window: Window) -> Window {
        let y0 = window.y0 + self.row as i32;
        Window { y0, y1: y0 + 1, ..window }
    }
}

/// Adds the samples of a pixel to the layers of its row.
fn add_layers(plan: &LayerPlan, sums: &mut Sums, index: usize, pixel: &Pixel) {
    for (sample, seen) in pixel.samples.iter().enumerate() {
        if sums.want_variance() {
            sums.add_radiance(index, seen.radiance.as_vec3().to_array());
        }
        if let Some(light) = &seen.light {
            let near = Near::light(0.0, plan.light_key(Aov::CryptoMaterial, light.index), sample as u32);
            let nearest = (nearest(pixel) == Some(sample)).then_some((near, light.depth as f32));
            sums.add_light(plan, index, light.index, nearest);
        }
        let Some(first) = &seen.first else { continue };
        let (primitive, material) = (first.primitive as u32, first.material as u32);
        sums.filtered.add(index, first.normal, first.albedo);
        if sums.want_mattes() {
            sums.add_to_mattes(plan, index, primitive, material);
        }
        if nearest(pixel) == Some(sample) {
            // A row of no store: any that is no miss will do.
            let row = RowRef::new(Kind::Sphere, 0);
            let near = Near { t: 0.0, row, primitive, material, sample: sample as u32 };
            sums.nearest().see(index, near, first.depth as f32, plan.objects.of(primitive));
        }
    }
}

/// The sample nearest to the pixel's centre, the first of equals.
fn nearest(pixel: &Pixel) -> Option<usize> {
    let samples = pixel.samples.iter().enumerate();
    samples.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance)).map(|(sample, _)| sample)
}

/// Where the nearest sample sees something.
fn place(pixel: &Pixel, origin: DVec3) -> Place {
    let nearest = nearest(pixel).map(|sample| &pixel.samples[sample]);
    if let Some(light) = nearest.and_then(|sample| sample.light) {
        return Place { point: light.point + origin, ..Place::NONE };
    }
    let first = nearest.and_then(|sample| sample.first.as_ref());
    first.map_or(Place::NONE, |first| Place { point: first.point + origin, uv: first.uv, margin: first.margin })
}

pub(super) fn add(counts: &mut RayCounts, pixel: &Pixel) {
    let rays = pixel.rays;
    for (kind, count) in
        RayKind::ALL.into_iter().zip([rays.camera, rays.shadow, rays.reflection, rays.refraction, rays.bounce])
    {
        counts.rays[kind as usize] += count;
    }
    for event in pixel.events.iter().filter(|event| event.outcome >= 0) {
        let kind = match event.kind {
            EventKind::Camera => RayKind::Camera,
            EventKind::Reflection => RayKind::Reflection,
            EventKind::Refraction => RayKind::Refraction,
            EventKind::Bounce => RayKind::Bounce,
            EventKind::Light(_) | EventKind::Texture(_) => continue,
        };
        counts.hits[kind as usize] += 1;
    }
}
