//! A frame by the reference tracer: slow and plain, what the engine is measured by.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use super::{Progress, RenderError, Renderer, Rendering, Stats};
use crate::film::{Picture, Window};
use crate::integrate::{RayCounts, RayKind};
use crate::reference::{EventKind, Pixel, Reference};
use crate::scene::RenderSettings;

/// Renders a window, a row a task. There are no columns, no tree and no tests to count; of the shadow
/// rays it is not known how many met something.
pub(super) fn render(
    renderer: &Renderer,
    window: Window,
    threads: usize,
    progress: &dyn Progress,
) -> Result<Rendering, RenderError> {
    let start = Instant::now();
    let tracer = Reference::relative_to(renderer.scene, renderer.camera.eye);
    let integrator = renderer.scene.render.integrator;
    let settings = RenderSettings { integrator, max_depth: renderer.max_depth, seed: renderer.seed };
    let view = tracer.view(renderer.camera, &renderer.image, &settings);
    let plan_seconds = start.elapsed().as_secs_f64();

    let (done, spp) = (AtomicU64::new(0), u64::from(renderer.image.spp));
    let total = window.area() as u64 * spp;
    let pixel = |x, y, counts: &mut RayCounts| {
        if progress.cancelled() {
            return None;
        }
        let pixel = tracer.pixel(&view, x, y);
        add(counts, &pixel);
        progress.advance(done.fetch_add(spp, Ordering::Relaxed) + spp, total);
        Some(pixel.rgba.map(|sample| sample as f32))
    };
    let row = |y| {
        let mut counts = RayCounts::default();
        let pixels: Option<Vec<_>> = (window.x0..window.x1).map(|x| pixel(x, y, &mut counts)).collect();
        Some((pixels?, counts))
    };
    let rows: Option<Vec<_>> = (window.y0..window.y1).into_par_iter().map(row).collect();

    let trace_seconds = start.elapsed().as_secs_f64() - plan_seconds;
    let mut stats = Stats { threads, plan_seconds, trace_seconds, ..Stats::default() };
    let mut picture = Picture::new((renderer.image.width, renderer.image.height), window);
    let rows = rows.ok_or(RenderError::Cancelled)?;
    for ((pixels, counts), place) in rows.iter().zip(picture.pixels.chunks_mut(window.width())) {
        place.copy_from_slice(pixels);
        stats.rays.add(counts);
    }
    Ok(Rendering { picture, stats })
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
