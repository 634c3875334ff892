//! Lights with an area and the sky: drawn from surfaces, and met by rays.

use std::slice::from_mut;

use glam::DVec3;

use super::camera::Samples8;
use super::direct::{Direct, Sink};
use super::hits::Shaded;
use super::lights::Hits;
use super::record::{Lit, RayKind, Record};
use super::shadows::{Share, own};
use super::wave::Wave;
use crate::accel::{PACKETS, Tree};
use crate::lanes::{Float8, LANES, Mask8, RayPacket, UNIT_ROUNDOFF, Vec3x8, bits, float8};
use crate::plan::{Plan, Skip};
use crate::sample::{Pattern8, dimension};
use crate::scene::{Integrator, Material, Model, Object, Paint, Scene, Source, Visible};
use crate::shade::{AreaLight, Drawn, SkyLight};

/// A light counts as nearer than a surface that is nearer by no more than this share, about the error of a few
/// roundings: so a lamp on a ceiling is seen, whichever way both are rounded.
const NEARER: f32 = 1.0 / 262_144.0;

/// All lights that are sampled, ready to be drawn and to be met.
#[derive(Debug)]
pub struct Lamps<'s> {
    areas: Vec<AreaLight>,
    pub(super) sky: Option<SkyLight<'s>>,
    /// What camera, mirrors and glass see.
    seen: Option<Emitters>,
    /// What scattered rays meet.
    met: Option<Emitters>,
}

/// Area lights as primitives.
#[derive(Debug)]
struct Emitters {
    tree: Tree,
    /// Place among the area lights, by primitive.
    places: Vec<usize>,
}

impl<'s> Lamps<'s> {
    /// Those of a plan; the picture of the background is a light but for ambient occlusion.
    pub fn new(plan: &Plan<'s>, integrator: Integrator) -> Self {
        let areas = AreaLight::of(plan);
        let seen = Emitters::new(plan, &areas, |area| area.visible);
        let path = integrator == Integrator::Path;
        let met = Emitters::new(plan, &areas, |area| path && area.shadows);
        let sky = if integrator == Integrator::Ao { None } else { SkyLight::of(plan) };
        Lamps { areas, sky, seen, met }
    }
}

impl Emitters {
    /// The chosen ones in a tree of their own; `None` without any.
    fn new(plan: &Plan, areas: &[AreaLight], chosen: impl Fn(&AreaLight) -> bool) -> Option<Self> {
        let places: Vec<usize> = (0..areas.len()).filter(|place| chosen(&areas[*place])).collect();
        let shape = |place: &usize| match &plan.scene.lights[areas[*place].index].source {
            Source::Area { emitter, .. } => Some(emitter.shape()),
            Source::Point { .. } | Source::Directional { .. } | Source::Spot { .. } => None,
        };
        let object = |shape| Object { shape, material: 0, name: None, group: None };
        let model = Model::Diffuse { albedo: Paint::Color(DVec3::ONE) };
        let lit = Material { name: String::new(), model, back: None, visible: Visible::Front };
        let objects: Vec<Object> = places.iter().filter_map(shape).map(object).collect();
        let scene = Scene { objects, materials: vec![lit], ..Scene::default() };
        let mut own = Plan::new(&scene, plan.origin);
        own.rounded_origins = plan.rounded_origins;
        (!places.is_empty()).then(|| Emitters { tree: Tree::new(own.parts(), &own.visible), places })
    }
}

impl Lamps<'_> {
    /// Whether any of them are drawn from surfaces.
    pub(super) fn draws(&self) -> bool {
        !self.areas.is_empty() || self.sky.is_some()
    }

    /// Whether camera, mirrors and glass may see any.
    pub(super) fn are_seen(&self) -> bool {
        self.seen.is_some()
    }
}

/// Numbers for the samples of a packet of a wave.
#[inline(always)]
pub(super) fn pairs(wave: &Wave, p: usize, what: u32, seeds: &[Samples8]) -> [[u32; LANES]; 2] {
    let dimension = dimension::at(wave.depth, what);
    if let Some(first) = wave.whose.first {
        let seeds = &seeds[first / LANES + p];
        return Pattern8::new(&seeds.key, dimension).sample(&seeds.index);
    }
    let (mut keys, mut index) = ([0; LANES], [0; LANES]);
    // The lanes behind the last ray of a wave have no sample: any will do.
    for lane in 0..LANES {
        let slot = wave.slot(p, lane).min(LANES * seeds.len() - 1);
        let seeds = &seeds[slot / LANES];
        (keys[lane], index[lane]) = (seeds.key[slot % LANES], seeds.index[slot % LANES]);
    }
    Pattern8::new(&keys, dimension).sample(&index)
}

impl Direct<'_> {
    /// Adds area lights and the sky to the radiance along a wave.
    pub(super) fn add_lamps<R: Record>(&self, wave: &Wave, hits: Hits, sink: &mut Sink<R>) {
        for area in self.lamps.areas.iter().filter(|area| self.plan.lights[area.index]) {
            self.add_lamp((area.index, area.shadows), wave, hits, sink, |point, bits| area.draw(point, bits));
        }
        if let Some(sky) = &self.lamps.sky {
            let index = self.plan.scene.lights.len();
            self.add_lamp((index, true), wave, hits, sink, |_, bits| sky.draw(bits));
        }
    }

    fn add_lamp<R: Record>(
        &self,
        (index, shadows): (usize, bool),
        wave: &Wave,
        hits: Hits,
        sink: &mut Sink<R>,
        draw: impl Fn(Vec3x8, [[u32; LANES]; 2]) -> Drawn,
    ) {
        // What scattered rays may meet as well is weighed.
        let weighed = self.is_path() && shadows && wave.depth < self.settings.max_depth;
        let skip = self.plan.skips.allows(Skip::Shadows);
        let mut given = Share::new(index, hits.1);
        let mut tile = shadows.then(|| sink.shadows.tile(index, None));
        for p in bits(hits.1) {
            let shaded = &hits.0[p];
            let drawn = draw(shaded.point, pairs(wave, p, dimension::LIGHTS + index as u32, sink.seeds));
            let diffuse = if weighed { heuristic(drawn.density, shaded.density(drawn.wi)) } else { float8(1.0) };
            let (share, facing) = shaded.weighed_share(drawn.wi, drawn.strength, diffuse);
            let share = wave.weighted(p, share);
            let facing = if skip { facing & Mask8::gt(share.sum(), Float8::ZERO) } else { facing };
            (given.radiance[p], given.lit[p]) = (share, facing.bits() & shaded.hit);
            if let Some((tile, place)) = &mut tile {
                // All but those in the light itself, where there is no way to go.
                let all = || Mask8::le(drawn.wi.x, drawn.wi.x).bits() & shaded.hit;
                given.cast[p] = if skip { given.lit[p] } else { all() };
                sink.left_out[Skip::Shadows] += u64::from((shaded.hit & !given.cast[p]).count_ones());
                tile.packets[p] = shaded.rays_to(&drawn, Mask8::from_bits(given.cast[p]));
                tile.own[p] = own(wave.tile.hits[p], shaded.front);
                given.tile = Some(*place);
            }
        }
        sink.shadows.add(given);
    }

    /// Adds the lights that rays meet before they meet anything else, and tells whose rays end there.
    pub(super) fn meet_lamps<R: Record>(
        &self,
        wave: &Wave,
        live: &[u32; PACKETS],
        sink: &mut Sink<R>,
    ) -> [u32; PACKETS] {
        let lamps = self.lamps;
        match (wave.kind, &lamps.met, &lamps.seen) {
            (RayKind::Bounce, Some(emitters), _) => self.scatter_into(emitters, wave, live, sink),
            (RayKind::Bounce, None, _) | (_, _, None) => {}
            (_, _, Some(emitters)) => return self.look_into(emitters, wave, live, sink),
        }
        [0; PACKETS]
    }

    /// Camera, mirrors and glass see the nearest light, and what is behind it not.
    fn look_into<R: Record>(
        &self,
        Emitters { tree, places }: &Emitters,
        wave: &Wave,
        live: &[u32; PACKETS],
        sink: &mut Sink<R>,
    ) -> [u32; PACKETS] {
        let mut taken = [0; PACKETS];
        sink.scratch.renew(wave.tile.common);
        for (p, rays) in wave.tile.packets.iter().enumerate() {
            let t_max = rays.t_max * float8(1.0 + NEARER);
            sink.scratch.packets[p] = RayPacket::new(rays.origin, rays.dir, t_max, Mask8::from_bits(live[p]));
        }
        tree.closest_tiles(from_mut(sink.scratch), sink.walk);
        for p in (0..PACKETS).filter(|p| live[*p] != 0) {
            let (mut radiance, mut lights) = ([[0.0; 3]; LANES], [None; LANES]);
            for i in bits(live[p]) {
                let row = sink.scratch.hit(p, i);
                let Some(kind) = row.kind() else { continue };
                let place = places[tree.stores().owner(kind, row.row()).primitive as usize];
                let area = &self.lamps.areas[place];
                (radiance[i], taken[p]) = (area.radiance, taken[p] | 1 << i);
                lights[i] = Some(area.index);
                sink.record.seen(area.index, wave.slot(p, i), wave.path(p, i));
            }
            if R::SURFACES && wave.depth == 1 && taken[p] != 0 {
                sink.record.lamps(&Lit { packet: p, rays: &sink.scratch.packets[p], lights });
            }
            sink.radiance[p] = wave.weighted(p, Vec3x8::from_fn(|i| radiance[i]));
        }
        taken
    }

    /// Scattered rays meet lights one after the other: a light hides no other.
    fn scatter_into<R: Record>(
        &self,
        Emitters { tree, places }: &Emitters,
        wave: &Wave,
        live: &[u32; PACKETS],
        sink: &mut Sink<R>,
    ) {
        let mut left = *live;
        let (mut from, mut last) = ([Float8::ZERO; PACKETS], [[usize::MAX; LANES]; PACKETS]);
        while left.iter().any(|left| *left != 0) {
            sink.scratch.renew(None);
            for (p, rays) in wave.tile.packets.iter().enumerate() {
                let open = Mask8::from_bits(left[p]);
                let (dead_from, dead_to) = (float8(f32::INFINITY), float8(f32::NEG_INFINITY));
                let (t_min, t_max) = (open.select(from[p], dead_from), rays.t_max * float8(1.0 + NEARER));
                let packet = RayPacket::within(rays.origin, rays.dir, t_min, open.select(t_max, dead_to));
                sink.scratch.packets[p] = packet;
            }
            tree.closest_tiles(from_mut(sink.scratch), sink.walk);
            for p in 0..PACKETS {
                let t = sink.scratch.packets[p].t_max;
                let mut met = 0;
                for i in bits(left[p]) {
                    let row = sink.scratch.hit(p, i);
                    let Some(kind) = row.kind() else { continue };
                    let place = places[tree.stores().owner(kind, row.row()).primitive as usize];
                    met |= 1 << i;
                    // A lit side is met once: it is the same place again, which f64 found a rounding further on.
                    if std::mem::replace(&mut last[p][i], place) == place {
                        continue;
                    }
                    let share = self.met_share(place, wave, (p, i), t.as_array()[i]);
                    let sum = Vec3x8::lane(&sink.radiance[p], i);
                    let (radiance, weight) = (self.lamps.areas[place].radiance, wave.weight(p, i));
                    sink.radiance[p].set_lane(i, std::array::from_fn(|k| sum[k] + radiance[k] * share * weight[k]));
                }
                (left[p], from[p]) = (met, t.fast_max(from[p]) * float8(1.0 + NEARER));
            }
        }
    }

    /// The share of a light met by a scattered ray at `t` that counts, as it may be drawn as well.
    fn met_share(&self, place: usize, wave: &Wave, (p, i): (usize, usize), t: f32) -> f32 {
        let ray = wave.ray(p, i, t);
        let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        let other = self.lamps.areas[place].density(wide(ray.origin), wide(ray.dir) * f64::from(t));
        share(f64::from(wave.density[p].as_array()[i]), other) as f32
    }
}

impl Shaded {
    /// The density with which a surface scatters into a direction on its side.
    #[inline(always)]
    fn density(&self, wi: Vec3x8) -> Float8 {
        self.n_s.dot(wi) * float8(std::f32::consts::FRAC_1_PI)
    }

    /// From the surface to what was drawn.
    #[inline(always)]
    fn rays_to(&self, drawn: &Drawn, live: Mask8) -> RayPacket {
        let origin = self.leave(true, self.error);
        match drawn.target {
            None => RayPacket::new(origin, drawn.wi, float8(f32::INFINITY), live),
            Some(target) => RayPacket::new(origin, target - origin, float8(1.0 - 8.0 * UNIT_ROUNDOFF), live),
        }
    }
}

/// The share of light drawn with one density that counts where the same light may also be drawn with another.
///
/// Source: Veach and Guibas, "Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995:
/// the power heuristic.
pub(super) fn share(density: f64, other: f64) -> f64 {
    let ratio = other / density;
    if ratio.is_nan() { 1.0 } else { 1.0 / (1.0 + ratio * ratio) }
}

/// Eight of them.
#[inline(always)]
fn heuristic(density: Float8, other: Float8) -> Float8 {
    let (one, ratio) = (float8(1.0), other / density);
    one / (one + ratio * ratio)
}
