//! What lights give to hits, one light and one wave at a time, and their shadow rays.

use super::direct::{Direct, Sink};
use super::hits::Shaded;
use super::record::Record;
use super::shadows::{Share, own};
use super::wave::Wave;
use crate::accel::PACKETS;
use crate::lanes::{Float8, Mask8, RayPacket, UNIT_ROUNDOFF, Vec3x8, bits, float8};
use crate::plan::{LEAST_COSINE, Skip};
use crate::shade::{Illumination, Toward};

/// Hits by packet, and the packets that have any.
pub(super) type Hits<'a> = (&'a [Shaded], u32);

impl Direct<'_> {
    /// Adds one light, by its index, to what waits for its shadow rays.
    pub(super) fn add_light<R: Record>(
        &self,
        (index, light): &(usize, Illumination),
        wave: &Wave,
        hits: Hits,
        sink: &mut Sink<R>,
    ) {
        let mut share = self.share(*index, light, wave, hits, sink);
        if let Some(free) = &self.plan.unshadowed[*index] {
            leave_out_free(free, light, hits, &mut share, sink);
        }
        if share.cast != [0; PACKETS] {
            cast_shadows(light, wave, hits, &mut share, sink);
        }
        sink.shadows.add(share);
    }

    #[inline(always)]
    fn share<R: Record>(
        &self,
        index: usize,
        light: &Illumination,
        wave: &Wave,
        hits: Hits,
        sink: &mut Sink<R>,
    ) -> Share {
        let mut given = Share::new(index, hits.1);
        let skip = self.plan.skips.allows(Skip::Shadows);
        for p in bits(hits.1) {
            let shaded = &hits.0[p];
            let (wi, strength) = light.sample(shaded.point);
            let (share, facing) = shaded.share(wi, strength);
            let share = wave.weighted(p, share);
            let gives = Mask8::gt(share.sum(), Float8::ZERO);
            let lit = if skip { facing & gives } else { facing };
            (given.radiance[p], given.lit[p]) = (share, lit.bits() & shaded.hit);
            given.cast[p] = match (light.shadows, skip) {
                (false, _) => 0,
                (true, true) => given.lit[p],
                // All but those in the light itself, where there is no way to go.
                (true, false) => Mask8::le(wi.x, wi.x).bits() & shaded.hit,
            };
            if light.shadows {
                sink.left_out[Skip::Shadows] += u64::from((shaded.hit & !given.cast[p]).count_ones());
            }
        }
        given
    }
}

/// Makes the shadow rays of a light.
fn cast_shadows<R: Record>(light: &Illumination, wave: &Wave, hits: Hits, share: &mut Share, sink: &mut Sink<R>) {
    let common = match light.toward {
        Toward::Point(position) => Some(position),
        Toward::Direction(_) => None,
    };
    let (tile, place) = sink.shadows.tile(share.light, common);
    for p in bits(hits.1).filter(|p| share.cast[*p] != 0) {
        tile.packets[p] = hits.0[p].shadow_rays(light, Mask8::from_bits(share.cast[p]));
        tile.own[p] = own(wave.tile.hits[p], hits.0[p].front);
    }
    share.tile = Some(place);
}

/// Casts no rays from the fronts of primitives that nothing can put in the shadow of this light: from the inside of
/// one its other side may be in the way. Next to the terminator they are cast all the same: there a surface could seem
/// to shadow itself.
fn leave_out_free<R: Record>(free: &[bool], light: &Illumination, hits: Hits, share: &mut Share, sink: &mut Sink<R>) {
    for p in bits(hits.1) {
        let shaded = &hits.0[p];
        let (wi, _) = light.sample(shaded.point);
        let steep = Mask8::gt(shaded.n_g.dot(wi), float8(LEAST_COSINE)).bits() & share.cast[p];
        let steep = steep & shaded.front.bits();
        let is_free = |i: &usize| free[shaded.primitives[*i] as usize];
        let free: u32 = bits(steep).filter(is_free).map(|i| 1 << i).sum();
        share.cast[p] &= !free;
        sink.left_out[Skip::Occlusion] += u64::from(free.count_ones());
    }
}

impl Shaded {
    /// What one light gives without regard to shadows, and the lanes that face it where it gives anything.
    #[inline(always)]
    fn share(&self, wi: Vec3x8, strength: Vec3x8) -> (Vec3x8, Mask8) {
        self.weighed_share(wi, strength, float8(1.0))
    }

    /// The same with a factor on what is scattered evenly.
    #[inline(always)]
    pub(super) fn weighed_share(&self, wi: Vec3x8, strength: Vec3x8, factor: Float8) -> (Vec3x8, Mask8) {
        let (cos, cos_g) = (self.n_s.dot(wi), self.n_g.dot(wi));
        let zero = Float8::ZERO;
        let facing = Mask8::gt(cos, zero) & Mask8::gt(cos_g, zero) & Mask8::gt(self.bsdf.lit, zero);
        let facing = facing & Mask8::gt(strength.x + strength.y + strength.z, zero);
        let mut diffuse = cos;
        if self.smooth.any() {
            diffuse = self.smooth.select(cos * self.terminator(cos, cos_g), cos);
        }
        let highlight = || {
            let mirrored = self.n_s.mul_add(cos + cos, -wi);
            mirrored.dot(self.wo)
        };
        (self.bsdf.response(diffuse * factor, highlight).scale(strength), facing)
    }

    /// The factor that softens the terminator of interpolated normals; 1 elsewhere.
    #[inline(always)]
    pub(super) fn softened(&self, wi: Vec3x8) -> Float8 {
        match self.smooth.any() {
            true => self.smooth.select(self.terminator(self.n_s.dot(wi), self.n_g.dot(wi)), float8(1.0)),
            false => float8(1.0),
        }
    }

    /// Source: Chiang, Li and Burley, "Taming the shadow terminator", SIGGRAPH 2019 talks.
    fn terminator(&self, cos: Float8, cos_g: Float8) -> Float8 {
        let one = float8(1.0);
        let x = (cos_g / (cos * self.n_s.dot(self.n_g))).fast_min(one).fast_max(Float8::ZERO);
        x * (one + x * (one - x))
    }

    /// From a point light to the surface, so that all rays of a tile share an origin; toward a distant
    /// light from the surface.
    #[inline(always)]
    fn shadow_rays(&self, light: &Illumination, live: Mask8) -> RayPacket {
        match light.toward {
            Toward::Direction(wi) => {
                let origin = self.leave(true, self.error);
                RayPacket::new(origin, Vec3x8::splat(wi), float8(f32::INFINITY), live)
            }
            Toward::Point(position) => {
                let position = Vec3x8::splat(position);
                // Seen from the light the surface is as uncertain as the ray is long: beyond the bound of any kernel on
                // its own surface, or every ray would have to be decided again.
                let way = (position - self.point).abs();
                let error = float8(8.0 * UNIT_ROUNDOFF).mul_add(way.x + way.y + way.z, self.error);
                let dir = self.leave(true, error) - position;
                RayPacket::new(position, dir, float8(1.0 - 16.0 * UNIT_ROUNDOFF), live)
            }
        }
    }
}
