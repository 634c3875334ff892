//! Lights on hits, one light and one wave at a time, and their shadow rays.

use super::direct::{Direct, Sink};
use super::hits::Shaded;
use super::record::{RayKind, Record};
use super::wave::{Wave, lanes};
use crate::accel::PACKETS;
use crate::lanes::{Float8, Mask8, RayPacket, UNIT_ROUNDOFF, Vec3x8, float8};
use crate::shade::{Illumination, Toward};

/// What one light gives to the hits of a wave.
struct Shares {
    radiance: [Vec3x8; PACKETS],
    /// Lanes that it shines on, by packet.
    lit: [u32; PACKETS],
}

impl Direct<'_> {
    /// Adds one light, by its index, to the samples of a wave.
    pub(super) fn add_light<R: Record>(
        &self,
        (index, light): (usize, &Illumination),
        wave: &Wave,
        shaded: &[Shaded],
        sink: &mut Sink<R>,
    ) {
        let mut shares = self.shares(light, wave, shaded);
        if light.shadows {
            self.cast_shadows((index, light), wave, shaded, &mut shares.lit, sink);
        } else if R::ON {
            for (p, lit) in shares.lit.into_iter().enumerate() {
                lanes(lit).for_each(|i| sink.record.lit(index, wave.slot(p, i), wave.paths[p][i]));
            }
        }
        for (p, radiance) in shares.radiance.into_iter().enumerate() {
            if shares.lit[p] != 0 {
                sink.samples.add(wave, p, radiance, shares.lit[p]);
            }
        }
    }

    fn shares(&self, light: &Illumination, wave: &Wave, shaded: &[Shaded]) -> Shares {
        let mut shares = Shares { radiance: [Vec3x8::ZERO; PACKETS], lit: [0; PACKETS] };
        for shaded in shaded {
            let p = shaded.packet;
            let (wi, strength) = light.sample(shaded.point);
            let (share, facing) = shaded.share(wi, strength);
            let share = share.scale(wave.weight[p]);
            let gives = Mask8::gt(share.x + share.y + share.z, Float8::ZERO);
            let lit = if self.skip { facing & gives } else { facing };
            (shares.radiance[p], shares.lit[p]) = (share, lit.bits() & shaded.hit);
        }
        shares
    }

    /// Takes the lanes that lie in shadow out of `lit`.
    fn cast_shadows<R: Record>(
        &self,
        (index, light): (usize, &Illumination),
        wave: &Wave,
        shaded: &[Shaded],
        lit: &mut [u32; PACKETS],
        sink: &mut Sink<R>,
    ) {
        let common = match light.toward {
            Toward::Point(position) => Some(position),
            Toward::Direction(_) => None,
        };
        let mut tile = sink.room.tile(common);
        let mut rest = shaded.iter().peekable();
        for (p, packet) in tile.packets.iter_mut().enumerate() {
            *packet = match rest.next_if(|shaded| shaded.packet == p) {
                Some(shaded) if lit[p] != 0 => shaded.shadow_rays(light, Mask8::from_bits(lit[p])),
                _ => RayPacket::dead(),
            };
        }
        let told = R::ON.then_some(tile.packets);
        let redecided = sink.room.walk.counts.redecided;
        self.tree.occluded_tiles(std::slice::from_mut(&mut tile), &mut sink.room.walk);
        let counts = &mut sink.room.rays;
        counts.redecided[RayKind::Shadow as usize] += sink.room.walk.counts.redecided - redecided;
        for (p, lit) in lit.iter_mut().enumerate() {
            let bright = *lit & tile.packets[p].live().bits();
            counts.rays[RayKind::Shadow as usize] += u64::from(lit.count_ones());
            counts.hits[RayKind::Shadow as usize] += u64::from((*lit & !bright).count_ones());
            if let Some(packets) = &told {
                for i in lanes(*lit) {
                    let dark = bright >> i & 1 == 0;
                    sink.record.shadow(index, packets[p].lane(i), dark, wave.slot(p, i), wave.paths[p][i]);
                }
            }
            *lit = bright;
        }
        sink.room.tiles.push(tile);
    }
}

impl Shaded {
    /// What one light gives without regard to shadows, and the lanes that face it where it gives anything.
    #[inline(always)]
    fn share(&self, wi: Vec3x8, strength: Vec3x8) -> (Vec3x8, Mask8) {
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
        (self.bsdf.response(diffuse, highlight).scale(strength), facing)
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
                // Seen from the light the surface is as uncertain as the ray is long.
                let way = (position - self.point).abs();
                let error = float8(8.0 * UNIT_ROUNDOFF).mul_add(way.x + way.y + way.z, self.error);
                let dir = self.leave(true, error) - position;
                RayPacket::new(position, dir, float8(1.0 - 8.0 * UNIT_ROUNDOFF), live)
            }
        }
    }
}
