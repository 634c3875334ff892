//! Paths: of the ways on from a hit each sample takes one, and perhaps none.
//!
//! Source: Kajiya, "The rendering equation", SIGGRAPH 1986; how lights are drawn and met is in `lamps`.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::branches::Later;
use super::camera::Samples8;
use super::direct::Direct;
use super::hits::{Shaded, Vertex8};
use super::lamps::{pairs, share};
use super::wave::{Branch, Wave};
use crate::lanes::{DVec3x8, Float8, LANES, Mask8, Vec3x8, bits, dot8, float8};
use crate::sample::{dimension, unit};
use crate::scene::Backdrop;
use crate::shade::{Onward, Way};

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
        vertices: &[Vertex8],
        seeds: &[Samples8],
        later: &mut Later,
    ) {
        for (p, vertex) in vertices.iter().enumerate().filter(|(_, vertex)| vertex.lanes != 0) {
            let smooth = shaded[p].smooth.any();
            let scattered = Scattered8::new(vertex, pairs(wave, p, dimension::SCATTER, seeds), smooth);
            let chooses = |i: usize| self.materials.onward(vertex.materials[i]) != Onward::Nothing;
            let choosing: u32 = bits(vertex.lanes).filter(|i| chooses(*i)).map(|i| 1 << i).sum();
            let mut numbers = [[0; LANES]; 2];
            if choosing != 0 || wave.depth >= ROULETTE {
                numbers = pairs(wave, p, dimension::CHOICE, seeds);
            }
            self.scatter(
                wave,
                &shaded[p],
                (vertex, vertex.lanes & !choosing),
                (&scattered, &numbers[1]),
                &mut later[2],
            );
            for i in bits(choosing) {
                let numbers = numbers.map(|axis| unit(axis[i]));
                self.take_way(wave, (&shaded[p], vertex, i), (numbers, &scattered), later);
            }
        }
    }

    /// Adds the rays that go on from hits on what only scatters.
    fn scatter(
        &self,
        wave: &Wave,
        shaded: &Shaded,
        (vertex, lanes): (&Vertex8, u32),
        (scattered, life): (&Scattered8, &[u32; LANES]),
        later: &mut Vec<Branch>,
    ) {
        let p = shaded.packet;
        let single = |lanes: &Lanes| Float8::from(std::array::from_fn::<f32, LANES, _>(|i| lanes[i] as f32));
        let (softened, density) = (single(&scattered.softened), single(&scattered.density));
        let mut weight = wave.weighted(p, shaded.bsdf.color * (shaded.bsdf.diffuse * softened));
        let brightest = weight.x.fast_max(weight.y).fast_max(weight.z);
        let mut lives = Mask8::gt(brightest, Float8::ZERO) & Mask8::gt(density, Float8::ZERO);
        if wave.depth >= ROULETTE {
            let chance = brightest.fast_min(float8(1.0));
            let lived = |i: &usize| unit(life[*i]) < f64::from(chance.as_array()[*i]);
            lives &= Mask8::from_bits((0..LANES).filter(lived).map(|i| 1 << i).sum());
            weight = weight * (float8(1.0) / chance);
        }
        let (origin, weight) = (shaded.leave(true, shaded.error).to_arrays(), weight.to_arrays());
        let density = density.as_array();
        for i in bits(lives.bits() & lanes) {
            later.push(Branch {
                origin: origin[i],
                exact: (vertex.point(i), DVec3::from_array(scattered.dir.map(|axis| axis[i]))),
                weight: weight[i],
                density: density[i],
                slot: wave.slot(p, i) as u32,
                path: wave.path(p, i).wrapping_mul(2),
            });
        }
    }

    /// Adds the ray that goes on from a hit, if any does.
    fn take_way(
        &self,
        wave: &Wave,
        (shaded, vertex, i): (&Shaded, &Vertex8, usize),
        ([choice, life], scattered): ([f64; 2], &Scattered8),
        later: &mut Later,
    ) {
        let p = shaded.packet;
        let color = DVec3::from_array(Vec3x8::lane(&shaded.bsdf.color, i).map(f64::from));
        let facing = vertex.facing(i, wave.exact[p].lane(i).1);
        let ways = self.materials.onward(vertex.materials[i]).ways(color, &facing);
        let albedo = color * f64::from(shaded.bsdf.diffuse.as_array()[i]);
        let path = wave.path(p, i).wrapping_mul(2);
        let Some(taken) = take(choice, albedo, ways, path, || scattered.lane(i)) else { return };
        let weight = taken.share * DVec3::from_array(wave.weight(p, i).map(f64::from));
        let lives = if wave.depth < ROULETTE { 1.0 } else { weight.max_element().min(1.0) };
        if life < lives {
            later[taken.list].push(Branch {
                origin: shaded.leave(taken.dir.dot(facing.n_g) > 0.0, shaded.error).lane(i),
                exact: (vertex.point(i), taken.dir),
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

/// Numbers in f64, a lane a hit.
type Lanes = [f64; LANES];

/// Directions in which eight hits scatter, see [`scattered`](crate::shade::scattered): in f64 as all that rays go on from,
/// but eight at a time.
struct Scattered8 {
    dir: DVec3x8,
    /// 0 below the surface.
    density: Lanes,
    /// The factor on the cosine.
    softened: Lanes,
}

impl Scattered8 {
    /// Those of the hits of one packet; some of them may be `smooth`, with normals that are interpolated.
    fn new(Vertex8 { n_s, n_g, .. }: &Vertex8, bits: [[u32; LANES]; 2], smooth: bool) -> Self {
        let [u, v] = [0, 1].map(|k| std::array::from_fn(|i| unit(bits[k][i])));
        let [sin, cos] = turns(&v);
        let mut way = [[0.0; LANES]; 3];
        for i in 0..LANES {
            let ring = 2.0 * (u[i] * (1.0 - u[i])).sqrt();
            way[0][i] = n_s[0][i] + ring * cos[i];
            way[1][i] = n_s[1][i] + ring * sin[i];
            way[2][i] = n_s[2][i] + (1.0 - 2.0 * u[i]);
        }
        let squared = dot8(&way, &way);
        let length: Lanes = std::array::from_fn(|i| squared[i].sqrt());
        let mut dir = way;
        for (axis, normal) in dir.iter_mut().zip(n_s) {
            for i in 0..LANES {
                axis[i] = if length[i] > 0.0 { axis[i] / length[i] } else { normal[i] };
            }
        }
        let (cos, cos_g) = (dot8(n_s, &dir), dot8(n_g, &dir));
        let mut density = [0.0; LANES];
        for i in 0..LANES {
            density[i] = if cos[i].min(cos_g[i]) > 0.0 { cos[i] / PI } else { 0.0 };
        }
        let mut softened = [1.0; LANES];
        if smooth {
            let between = dot8(n_s, n_g);
            for i in (0..LANES).filter(|i| (0..3).any(|k| n_s[k][*i] != n_g[k][*i])) {
                let x = (cos_g[i] / (cos[i] * between[i])).clamp(0.0, 1.0);
                softened[i] = x * (1.0 + x * (1.0 - x));
            }
        }
        Scattered8 { dir, density, softened }
    }

    /// One of them, its density and the factor on its cosine; `None` below the surface.
    fn lane(&self, i: usize) -> Option<(DVec3, f64, f64)> {
        let dir = DVec3::from_array(self.dir.map(|axis| axis[i]));
        (self.density[i] > 0.0).then(|| (dir, self.density[i], self.softened[i]))
    }
}

/// Sines and cosines of turns from 0 to 1, by their series around the nearest quarter.
fn turns(v: &Lanes) -> [Lanes; 2] {
    let (mut sin, mut cos) = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        let quarter = (4.0 * v[i]).round_ties_even();
        let angle = (v[i] - 0.25 * quarter) * TAU;
        let sum = |series: &[f64]| series.iter().fold(0.0, |sum: f64, term| sum * (angle * angle) + term);
        let (s, c, number) = (angle * sum(&SINE), sum(&COSINE), quarter as i32);
        let (s, c) = if number & 1 == 1 { (c, s) } else { (s, c) };
        sin[i] = if number & 2 == 2 { -s } else { s };
        cos[i] = if (number + 1) & 2 == 2 { -c } else { c };
    }
    [sin, cos]
}

/// Taylor's, the last term first: what is left out is below 1e-16 up to an eighth of a turn.
const SINE: [f64; 8] = [
    -1.0 / 1_307_674_368_000.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 39_916_800.0,
    1.0 / 362_880.0,
    -1.0 / 5_040.0,
    1.0 / 120.0,
    -1.0 / 6.0,
    1.0,
];
const COSINE: [f64; 9] = [
    1.0 / 20_922_789_888_000.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 479_001_600.0,
    -1.0 / 3_628_800.0,
    1.0 / 40_320.0,
    -1.0 / 720.0,
    1.0 / 24.0,
    -0.5,
    1.0,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_go_round() {
        for k in 0..100_000u32 {
            let v: Lanes = std::array::from_fn(|i| unit((k * 8 + i as u32) * 5_369));
            let [sin, cos] = turns(&v);
            for i in 0..LANES {
                let want = (TAU * v[i]).sin_cos();
                assert!((sin[i] - want.0).abs() < 1e-15 && (cos[i] - want.1).abs() < 1e-15, "{}", v[i]);
            }
        }
    }
}
