//! Paths: of the ways on from a hit each sample takes one, and perhaps none.
//!
//! Source: Kajiya, "The rendering equation", SIGGRAPH 1986; how lights are drawn and met is in `lamps`.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::branches::Later;
use super::camera::Samples8;
use super::direct::Direct;
use super::hits::{Exact, Shaded};
use super::lamps::{pairs, share};
use super::wave::{Branch, Wave};
use crate::lanes::{Float8, LANES, Vec3x8};
use crate::sample::{dimension, unit};
use crate::scene::Backdrop;
use crate::shade::{Facing, Way};

/// Rays from this depth on end by chance, the darker the likelier.
const ROULETTE: u32 = 3;

/// A way on that was taken.
struct Taken {
    /// Of the rays to be traced later.
    list: usize,
    path: u32,
    dir: DVec3,
    /// Over the chance with which it was taken.
    share: DVec3,
    density: f64,
}

impl Direct<'_> {
    /// Adds the rays that go on from hits.
    pub(super) fn take_ways(
        &self,
        wave: &Wave,
        shaded: &[Shaded],
        exact: &[Exact],
        seeds: &[Samples8],
        later: &mut Later,
    ) {
        for exact in exact.chunk_by(|a, b| a.packet == b.packet) {
            let p = exact[0].packet;
            let choices = pairs(wave, p, dimension::CHOICE, seeds);
            let places = pairs(wave, p, dimension::SCATTER, seeds);
            for exact in exact {
                let at = |pairs: &[[u32; LANES]; 2]| pairs.map(|axis| unit(axis[exact.lane]));
                self.take_way(wave, &shaded[p], exact, [at(&choices), at(&places)], later);
            }
        }
    }

    /// Adds the ray that goes on from a hit, if any does.
    fn take_way(
        &self,
        wave: &Wave,
        shaded: &Shaded,
        Exact { packet: p, lane: i, point, facing, material }: &Exact,
        [[choice, life], place]: [[f64; 2]; 2],
        later: &mut Later,
    ) {
        let (p, i) = (*p, *i);
        let color = DVec3::from_array(Vec3x8::lane(&shaded.bsdf.color, i).map(f64::from));
        let ways = self.materials.onward(*material).ways(color, facing);
        let albedo = color * f64::from(shaded.bsdf.diffuse.as_array()[i]);
        let path = wave.path(p, i).wrapping_mul(2);
        let Some(taken) = take(choice, albedo, ways, path, || scattered(facing, place)) else { return };
        let weight = taken.share * DVec3::from_array(wave.weight(p, i).map(f64::from));
        let lives = if wave.depth < ROULETTE { 1.0 } else { weight.max_element().min(1.0) };
        if life < lives {
            later[taken.list].push(Branch {
                origin: shaded.leave(taken.dir.dot(facing.n_g) > 0.0, shaded.error).lane(i),
                exact: (*point, taken.dir),
                weight: (weight / lives).as_vec3().to_array(),
                density: taken.density as f32,
                slot: wave.slot(p, i) as u32,
                path: taken.path,
            });
        }
    }

    /// Weighs what scattered rays bring from the background against drawing it as a light.
    pub(super) fn weigh_background(&self, wave: &Wave, p: usize, miss: u32, radiance: Vec3x8) -> Vec3x8 {
        match (&self.lamps.sky, &self.plan.scene.background.backdrop) {
            (Some(sky), _) => {
                let (dirs, densities) = (wave.tile.packets[p].dir.to_arrays(), wave.density[p].to_array());
                let weight = |i: usize| match miss >> i & 1 {
                    0 => 0.0,
                    _ => {
                        let dir = DVec3::from_array(dirs[i].map(f64::from));
                        share(f64::from(densities[i]), sky.density(dir)) as f32
                    }
                };
                radiance * Float8::from(std::array::from_fn::<f32, LANES, _>(weight))
            }
            (None, Backdrop::Image { .. }) => Vec3x8::ZERO,
            (None, Backdrop::Color(_) | Backdrop::Gradient { .. }) => radiance,
        }
    }
}

/// Chooses a way by what it could bring; `None` where the path ends.
fn take(
    choice: f64,
    albedo: DVec3,
    (reflected, refracted): (Way, Way),
    path: u32,
    scatter: impl Fn() -> Option<(DVec3, f64, f64)>,
) -> Option<Taken> {
    let brightest = |way: Way| way.map_or(0.0, |(_, share)| share.max_element());
    let shares = [albedo.max_element(), brightest(reflected), brightest(refracted)];
    let sum: f64 = shares.iter().sum();
    let place = choice * sum;
    let density = f64::INFINITY;
    if place < shares[0] {
        let (dir, density, softened) = scatter()?;
        let share = albedo * (softened * sum / shares[0]);
        return Some(Taken { list: 2, path, dir, share, density });
    }
    if let (true, Some((dir, share))) = (place < shares[0] + shares[1], reflected) {
        return Some(Taken { list: 0, path, dir, share: share * (sum / shares[1]), density });
    }
    let (dir, share) = refracted.filter(|_| shares[2] > 0.0)?;
    Some(Taken { list: 1, path: path + 1, dir, share: share * (sum / shares[2]), density })
}

/// A scattered direction, its density and the factor on its cosine; `None` below the surface. See
/// [`scattered`](crate::shade::scattered).
fn scattered(facing: &Facing, [u, v]: [f64; 2]) -> Option<(DVec3, f64, f64)> {
    let ((sin, cos), ring) = ((TAU * v).sin_cos(), 2.0 * (u * (1.0 - u)).sqrt());
    let (n_s, n_g) = (facing.n_s, facing.n_g);
    let dir = (n_s + DVec3::new(ring * cos, ring * sin, 1.0 - 2.0 * u)).normalize_or(n_s);
    let (cos, cos_g) = (n_s.dot(dir), n_g.dot(dir));
    if cos <= 0.0 || cos_g <= 0.0 {
        return None;
    }
    let x = (cos_g / (cos * n_s.dot(n_g))).clamp(0.0, 1.0);
    let softened = if n_s == n_g { 1.0 } else { x * (1.0 + x * (1.0 - x)) };
    Some((dir, cos / PI, softened))
}
