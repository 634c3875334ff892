//! Lights on hits, one light and one wave at a time, and their shadow rays.

use std::slice::from_mut;

use super::direct::{Direct, Sink};
use super::hits::Shaded;
use super::record::{RayKind, Record};
use super::wave::Wave;
use crate::accel::PACKETS;
use crate::lanes::{Float8, Mask8, RayPacket, UNIT_ROUNDOFF, Vec3x8, bits, float8};
use crate::plan::{LEAST_COSINE, Skip};
use crate::shade::{Illumination, Toward};
use crate::shapes::RowRef;

/// What one light gives to the hits of a wave.
struct Shares {
    radiance: [Vec3x8; PACKETS],
    /// Lanes that it shines on, by packet.
    lit: [u32; PACKETS],
    /// Lanes whose shadow rays are traced, by packet.
    cast: [u32; PACKETS],
}

/// Hits by packet, and the packets that have any.
pub(super) type Hits<'a> = (&'a [Shaded], u32);

impl Direct<'_> {
    /// Adds one light, by its index, to the radiance along a wave.
    pub(super) fn add_light<R: Record>(
        &self,
        (index, light): &(usize, Illumination),
        wave: &Wave,
        hits: Hits,
        sink: &mut Sink<R>,
    ) {
        let mut shares = self.shares(light, wave, hits, sink);
        if let Some(free) = &self.plan.unshadowed[*index] {
            leave_out_free(free, light, hits, &mut shares, sink);
        }
        if light.shadows {
            self.cast_shadows((*index, light), wave, hits, &mut shares, sink);
        } else if R::ON {
            for (p, lit) in shares.lit.into_iter().enumerate() {
                bits(lit).for_each(|i| sink.record.lit(*index, wave.slot(p, i), wave.path(p, i)));
            }
        }
        for p in bits(hits.1) {
            let sum = sink.radiance[p] + shares.radiance[p];
            sink.radiance[p] = Vec3x8::select(Mask8::from_bits(shares.lit[p]), sum, sink.radiance[p]);
        }
    }

    #[inline(always)]
    fn shares<R: Record>(&self, light: &Illumination, wave: &Wave, hits: Hits, sink: &mut Sink<R>) -> Shares {
        let mut shares = Shares { radiance: [Vec3x8::ZERO; PACKETS], lit: [0; PACKETS], cast: [0; PACKETS] };
        let skip = self.plan.skips.allows(Skip::Shadows);
        for p in bits(hits.1) {
            let shaded = &hits.0[p];
            let (wi, strength) = light.sample(shaded.point);
            let (share, facing) = shaded.share(wi, strength);
            let share = wave.weighted(p, share);
            let gives = Mask8::gt(share.sum(), Float8::ZERO);
            let lit = if skip { facing & gives } else { facing };
            (shares.radiance[p], shares.lit[p]) = (share, lit.bits() & shaded.hit);
            shares.cast[p] = match (light.shadows, skip) {
                (false, _) => 0,
                (true, true) => shares.lit[p],
                // All but those in the light itself, where there is no way to go.
                (true, false) => Mask8::le(wi.x, wi.x).bits() & shaded.hit,
            };
            if light.shadows {
                sink.left_out[Skip::Shadows] += u64::from((shaded.hit & !shares.cast[p]).count_ones());
            }
        }
        shares
    }

    /// Takes the lanes that lie in shadow out of `lit`.
    fn cast_shadows<R: Record>(
        &self,
        (index, light): (usize, &Illumination),
        wave: &Wave,
        hits: Hits,
        shares: &mut Shares,
        sink: &mut Sink<R>,
    ) {
        if shares.cast == [0; PACKETS] && !R::ON {
            return;
        }
        let tile = &mut *sink.shadows;
        tile.renew(match light.toward {
            Toward::Point(position) => Some(position),
            Toward::Direction(_) => None,
        });
        for (p, packet) in tile.packets.iter_mut().enumerate() {
            *packet = match shares.cast[p] {
                0 => RayPacket::dead(),
                cast => hits.0[p].shadow_rays(light, Mask8::from_bits(cast)),
            };
        }
        self.settle(index, wave, hits, (&shares.cast, &mut shares.lit), sink);
    }

    /// Traces the shadow rays of a light, and takes the lanes that lie in shadow out of `lit`.
    pub(super) fn settle<R: Record>(
        &self,
        index: usize,
        wave: &Wave,
        (shaded, packets): Hits,
        (cast, lit): (&[u32; PACKETS], &mut [u32; PACKETS]),
        sink: &mut Sink<R>,
    ) {
        let tile = &mut *sink.shadows;
        for p in bits(packets) {
            tile.own[p] = left(wave.tile.hits[p], shaded[p].front);
        }
        let told = R::ON.then_some(tile.packets);
        let redecided = sink.walk.counts.redecided;
        self.tree.occluded_tiles(from_mut(tile), sink.walk);
        sink.rays.redecided[RayKind::Shadow as usize] += sink.walk.counts.redecided - redecided;
        for p in bits(packets) {
            let (cast, lit) = (cast[p], &mut lit[p]);
            let bright = cast & tile.packets[p].live().bits();
            sink.rays.rays[RayKind::Shadow as usize] += u64::from(cast.count_ones());
            sink.rays.hits[RayKind::Shadow as usize] += u64::from((cast & !bright).count_ones());
            sink.rays.packets[RayKind::Shadow as usize] += u64::from(cast != 0);
            if let Some(packets) = &told {
                for i in bits(*lit & !cast) {
                    sink.record.lit(index, wave.slot(p, i), wave.path(p, i));
                }
                for i in bits(*lit & cast) {
                    let dark = bright >> i & 1 == 0;
                    sink.record.shadow(index, packets[p].lane(i), dark, wave.slot(p, i), wave.path(p, i));
                }
            }
            *lit &= bright | !cast;
        }
    }
}

/// The rows that shadow rays cannot meet: those they leave from, or end on, from outside. All of them are convex, and the
/// rays stay clear of them by more than anything rounds by.
#[inline(always)]
fn left(rows: Float8, front: Mask8) -> Float8 {
    let mut flat = 0;
    for (lane, row) in rows.to_array().into_iter().enumerate() {
        flat |= u32::from(RowRef::from_lane(row).is_flat()) << lane;
    }
    (front | Mask8::from_bits(flat)).select(rows, float8(RowRef::MISS.to_lane()))
}

/// Casts no rays from the fronts of primitives that nothing can put in the shadow of this light: from the inside of
/// one its other side may be in the way. Next to the terminator they are cast all the same: there a surface could seem
/// to shadow itself.
fn leave_out_free<R: Record>(free: &[bool], light: &Illumination, hits: Hits, shares: &mut Shares, sink: &mut Sink<R>) {
    for p in bits(hits.1) {
        let shaded = &hits.0[p];
        let (wi, _) = light.sample(shaded.point);
        let steep = Mask8::gt(shaded.n_g.dot(wi), float8(LEAST_COSINE)).bits() & shares.cast[p];
        let steep = steep & shaded.front.bits();
        let is_free = |i: &usize| free[shaded.primitives[*i] as usize];
        let free: u32 = bits(steep).filter(is_free).map(|i| 1 << i).sum();
        shares.cast[p] &= !free;
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
