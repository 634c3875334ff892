//! Ambient occlusion: how open each place is, as all there is to see or as a factor on ambient light.

use super::direct::{Direct, Sink};
use super::lamps::pairs;
use super::lights::Hits;
use super::record::Record;
use super::shadows::{Share, own};
use super::wave::Wave;
use crate::lanes::{Float8, Mask8, RayPacket, Vec3x8, bits, float8};
use crate::sample::dimension;
use crate::shade::scattered;

impl Direct<'_> {
    /// Adds the albedo where a scattered ray meets nothing near. As a light it has the number of the sky.
    pub(super) fn add_openness<R: Record>(&self, wave: &Wave, hits: Hits, sink: &mut Sink<R>) {
        let number = self.plan.scene.lights.len();
        self.add_open(wave, hits, sink, (number, dimension::SCATTER), Vec3x8::splat([1.0; 3]));
    }

    /// Adds ambient light where it is not hidden. As a light it has the number after that of the sky.
    pub(super) fn add_open_ambient<R: Record>(&self, wave: &Wave, hits: Hits, sink: &mut Sink<R>) {
        if let Some(ambient) = self.ambient.filter(|_| self.settings.ambient_occlusion) {
            let number = self.plan.scene.lights.len() + 1;
            self.add_open(wave, hits, sink, (number, dimension::OPENNESS), ambient);
        }
    }

    fn add_open<R: Record>(
        &self,
        wave: &Wave,
        hits: Hits,
        sink: &mut Sink<R>,
        (number, dimension): (usize, u32),
        light: Vec3x8,
    ) {
        let t_max = float8(self.settings.ao_distance as f32);
        let mut given = Share::new(number, hits.1);
        let (tile, place) = sink.shadows.tile(number, None);
        for p in bits(hits.1) {
            let shaded = &hits.0[p];
            let dir = scattered(shaded.n_s, pairs(wave, p, dimension, sink.seeds));
            let zero = Float8::ZERO;
            let above = Mask8::gt(shaded.n_s.dot(dir), zero) & Mask8::gt(shaded.n_g.dot(dir), zero);
            let facing = above & Mask8::gt(shaded.bsdf.lit, zero);
            let albedo = shaded.bsdf.color * (shaded.bsdf.diffuse * shaded.softened(dir));
            let share = wave.weighted(p, albedo.scale(light));
            (given.radiance[p], given.lit[p]) = (share, facing.bits() & shaded.hit);
            let (origin, live) = (shaded.leave(true, shaded.error), Mask8::from_bits(given.lit[p]));
            tile.packets[p] = RayPacket::new(origin, dir, t_max, live);
            tile.own[p] = own(wave.tile.hits[p], shaded.front);
        }
        (given.cast, given.tile) = (given.lit, Some(place));
        sink.shadows.add(given);
    }
}
