//! How a path goes on: of the ways there are it takes one, and perhaps none.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::emitter::NEARER;
use super::integrator::{EventKind, Step, Walk};
use super::material::{Onward, Side, albedo};
use super::{Hit, emitter};
use crate::sample::{self, dimension};
use crate::scene::Model;

/// Rays from this depth on end by chance, the darker the likelier.
const ROULETTE: u32 = 3;

/// A direction in which a side scatters evenly, weighed with the cosine: a point of the unit sphere,
/// `z = 1 - 2u` and azimuth `2 pi v`, added to the normal.
pub fn scattered(n: DVec3, [u, v]: [f64; 2]) -> DVec3 {
    let (z, (sin, cos)) = (1.0 - 2.0 * u, (TAU * v).sin_cos());
    let ring = (1.0 - z * z).sqrt();
    (n + DVec3::new(ring * cos, ring * sin, z)).normalize_or(n)
}

/// The share of light drawn with one density that counts where the same light may also be drawn with another.
///
/// Source: Veach and Guibas, "Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995:
/// the power heuristic.
pub fn share(density: f64, other: f64) -> f64 {
    let ratio = other / density;
    if ratio.is_nan() { 1.0 } else { 1.0 / (1.0 + ratio * ratio) }
}

impl Walk<'_> {
    /// Numbers of this sample for a use at a depth.
    pub(super) fn pair(&self, depth: u32, what: u32) -> [f64; 2] {
        sample::pair(self.key, self.sample, dimension::at(depth, what)).map(sample::unit)
    }

    /// What a scattered ray brings from lights that it meets, weighed against drawing the lights themselves; a
    /// light does not hide another.
    pub(super) fn scattered_light(&self, step: &Step, t_max: f64) -> DVec3 {
        let t_max = t_max * (1.0 + NEARER);
        let counts = |(i, area): (usize, &Option<emitter::AreaLight>)| {
            let area = area.as_ref().filter(|_| self.tracer.lights[i].shadows)?;
            let (_, density) = area.meet(&step.ray, t_max)?;
            Some(area.radiance * share(step.density, density))
        };
        self.tracer.areas.iter().enumerate().filter_map(counts).sum()
    }

    /// The nearest visible light that a ray of another kind meets before `t_max`: its index and radiance.
    pub(super) fn light_seen(&self, step: &Step, t_max: f64) -> Option<(usize, f64, DVec3)> {
        let mut nearest = (t_max * (1.0 + NEARER), None);
        for (i, area) in self.tracer.areas.iter().enumerate() {
            let Some(area) = area.as_ref().filter(|area| area.visible) else { continue };
            if let Some((t, _)) = area.meet(&step.ray, nearest.0).filter(|(t, _)| *t < nearest.0) {
                nearest = (t, Some((i, t, area.radiance)));
            }
        }
        nearest.1
    }

    /// What a scattered or other ray brings from the background.
    pub(super) fn background(&self, step: &Step) -> DVec3 {
        let background = &self.tracer.background;
        let seen = super::background::radiance(&background.backdrop, step.ray.dir);
        match (&self.tracer.sky, step.kind) {
            (Some(sky), EventKind::Bounce) => {
                seen * share(step.density, emitter::sky_density(sky, background, step.ray.dir))
            }
            (None, EventKind::Bounce) if super::background::is_picture(&background.backdrop) => DVec3::ZERO,
            _ => seen,
        }
    }

    /// Adds the ray that goes on, if any does.
    pub(super) fn take_one(
        &self,
        step: &Step,
        hit: &Hit,
        side: &Side,
        (model, color): (&Model, DVec3),
        onward: &Onward,
        steps: &mut Vec<Step>,
    ) {
        let diffuse = albedo(model, color);
        let refracted = onward.refracted.map_or(DVec3::ZERO, |(weight, _)| weight);
        let shares = [diffuse, onward.reflected.unwrap_or_default(), refracted].map(DVec3::max_element);
        let [choice, life] = self.pair(step.depth, dimension::CHOICE);
        let sum: f64 = shares.iter().sum();
        let place = choice * sum;
        let child = step.path.wrapping_mul(2);
        let (kind, path, weight, dir, density, chance) = if place < shares[0] {
            let dir = scattered(side.n, self.pair(step.depth, dimension::SCATTER));
            if !side.faces(dir) {
                return;
            }
            let density = side.n.dot(dir) / PI;
            (EventKind::Bounce, child, diffuse * side.terminator(dir), dir, density, shares[0])
        } else if let (true, Some(weight)) = (place < shares[0] + shares[1], onward.reflected) {
            (EventKind::Reflection, child, weight, side.reflection(), f64::INFINITY, shares[1])
        } else if let Some((weight, dir)) = onward.refracted {
            (EventKind::Refraction, child.wrapping_add(1), weight, dir, f64::INFINITY, shares[2])
        } else {
            return;
        };
        let weight = step.weight * weight * (sum / chance);
        let lives = if step.depth < ROULETTE { 1.0 } else { weight.max_element().min(1.0) };
        if life < lives {
            steps.push(step.next(kind, path, weight / lives, hit.spawn(dir), dir, density));
        }
    }
}
