//! A frame by the reference tracer: slow and plain, what the engine is measured by.

use std::time::Instant;

use super::{Renderer, Stats};
use crate::film::{Picture, Window};
use crate::integrate::{RayCounts, RayKind};
use crate::reference::{EventKind, Pixel, Reference, View};
use crate::scene::RenderSettings;

/// A frame whose rows are its blocks. There are no columns, no tree and no tests to count; of the shadow rays it is
/// not known how many met something.
pub(super) struct Rows {
    tracer: Reference,
    view: View,
    window: Window,
    plan_seconds: f64,
}

/// A row.
#[derive(Debug)]
pub(super) struct RowWork {
    row: usize,
    pixels: Vec<[f32; 4]>,
    counts: RayCounts,
}

impl Rows {
    pub fn new(renderer: &Renderer, window: Window) -> Self {
        let start = Instant::now();
        let tracer = Reference::relative_to(renderer.scene, renderer.camera.eye);
        let integrator = renderer.scene.render.integrator;
        let settings = RenderSettings { integrator, max_depth: renderer.max_depth, seed: renderer.seed };
        let view = tracer.view(renderer.camera, &renderer.image, &settings);
        Rows { tracer, view, window, plan_seconds: start.elapsed().as_secs_f64() }
    }

    /// A row, counted from 0; `None` where `stop` asked for that within.
    pub fn trace(&self, row: usize, stop: &(dyn Fn() -> bool + Sync)) -> Option<RowWork> {
        let (mut counts, y) = (RayCounts::default(), self.window.y0 + row as i32);
        let mut pixel = |x| {
            if stop() {
                return None;
            }
            let pixel = self.tracer.pixel(&self.view, x, y);
            add(&mut counts, &pixel);
            Some(pixel.rgba.map(|sample| sample as f32))
        };
        let pixels: Option<Vec<_>> = (self.window.x0..self.window.x1).map(&mut pixel).collect();
        Some(RowWork { row, pixels: pixels?, counts })
    }

    pub fn stats(&self, threads: usize, trace_seconds: f64) -> Stats {
        Stats { threads, plan_seconds: self.plan_seconds, trace_seconds, ..Stats::default() }
    }
}

impl RowWork {
    /// Puts the row where it belongs.
    pub fn add_to(&self, picture: &mut Picture, stats: &mut Stats) {
        let start = self.row * self.pixels.len();
        picture.pixels[start..start + self.pixels.len()].copy_from_slice(&self.pixels);
        stats.rays.add(&self.counts);
    }
}

fn add(counts: &mut RayCounts, pixel: &Pixel) {
    let rays = pixel.rays;
    for (kind, count) in RayKind::ALL.into_iter().zip([rays.camera, rays.shadow, rays.reflection, rays.refraction]) {
        counts.rays[kind as usize] += count;
    }
    for event in pixel.events.iter().filter(|event| event.outcome >= 0) {
        let kind = match event.kind {
            EventKind::Camera => RayKind::Camera,
            EventKind::Reflection => RayKind::Reflection,
            EventKind::Refraction => RayKind::Refraction,
            EventKind::Light(_) | EventKind::Texture(_) => continue,
        };
        counts.hits[kind as usize] += 1;
    }
}
