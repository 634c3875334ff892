//! Direct light with mirror reflection and refraction.
//!
//! Source: Whitted, "An improved illumination model for shaded display", Communications of the ACM
//! 23(6), 1980; what each material and light does is said in [`scene`](crate::scene).

use glam::DVec3;

use super::record::{RayCounts, RayKind, Record};
use super::wave::{Branch, Wave, lanes};
use crate::accel::{PACKETS, Tile, Tree, Walk};
use crate::lanes::{Float8, LANES, Mask8, Ray, RayPacket, UNIT_ROUNDOFF, Vec3x8, float8};
use crate::plan::{Owner, Plan};
use crate::shade::{Backdrop8, Bsdf8, Illumination, LightTable, MaterialTable, Toward, attributes};
use crate::shapes::RowRef;

/// All that is needed to find the radiance along rays.
#[derive(Debug)]
pub struct Direct<'s> {
    plan: &'s Plan<'s>,
    tree: &'s Tree,
    materials: MaterialTable,
    lights: LightTable,
    backdrop: Backdrop8<'s>,
    ambient: Vec3x8,
    max_depth: u32,
    /// Leaves out rays that cannot change the picture.
    skip: bool,
}

/// Radiance and alpha of the samples of one tile.
#[derive(Debug, Clone)]
pub struct Samples {
    /// Linear Rec. 709 by packet.
    pub radiance: [Vec3x8; PACKETS],
    /// 1 where a surface or the backdrop is seen.
    pub alpha: [Float8; PACKETS],
}

/// Room for work, and its counts: one a thread.
#[derive(Debug, Default)]
pub struct Room {
    /// Tests done.
    pub walk: Walk,
    /// Rays traced.
    pub rays: RayCounts,
}

/// Eight hits, made ready for light.
#[derive(Clone, Copy)]
struct Shaded {
    hit: u32,
    front: Mask8,
    point: Vec3x8,
    error: Float8,
    /// Unit, toward the viewer.
    wo: Vec3x8,
    /// Geometric and shading normal on the viewer's side.
    n_g: Vec3x8,
    n_s: Vec3x8,
    /// Lanes whose shading normal is interpolated.
    smooth: Mask8,
    bsdf: Bsdf8,
}

impl<'s> Direct<'s> {
    /// Makes tables of the plan's materials and lights.
    pub fn new(plan: &'s Plan<'s>, tree: &'s Tree, max_depth: u32, skip: bool) -> Self {
        Direct {
            plan,
            tree,
            materials: MaterialTable::new(plan.scene),
            lights: LightTable::new(plan),
            backdrop: Backdrop8::new(&plan.scene.background.backdrop),
            ambient: Vec3x8::splat(plan.scene.ambient.as_vec3().to_array()),
            max_depth,
            skip,
        }
    }

    /// Radiance along the camera rays of a tile.
    pub fn radiance<R: Record>(&self, tile: Tile, room: &mut Room, record: &mut R) -> Samples {
        let mut samples = Samples { radiance: [Vec3x8::ZERO; PACKETS], alpha: [Float8::ZERO; PACKETS] };
        self.trace(Wave::camera(tile), &mut samples, room, record);
        samples
    }

    fn trace<R: Record>(&self, mut wave: Wave, samples: &mut Samples, room: &mut Room, record: &mut R) {
        let live = wave.tile.packets.map(|rays| rays.live().bits());
        let redecided = room.walk.counts.redecided;
        self.tree.closest_tile(&mut wave.tile, &mut room.walk);
        room.rays.redecided[wave.kind as usize] += room.walk.counts.redecided - redecided;
        let mut shaded = [None; PACKETS];
        for p in 0..PACKETS {
            if live[p] == 0 {
                continue;
            }
            let hit = lanes(live[p]).filter(|i| wave.tile.hit(p, *i) != RowRef::MISS).map(|i| 1 << i).sum::<u32>();
            room.rays.rays[wave.kind as usize] += u64::from(live[p].count_ones());
            room.rays.hits[wave.kind as usize] += u64::from(hit.count_ones());
            if R::ON {
                self.tell(&wave, p, live[p], record);
            }
            self.add_background(&wave, p, live[p] & !hit, samples);
            if hit != 0 {
                shaded[p] = Some(self.shade(&wave, p, hit, record));
            }
        }
        self.add_ambient(&wave, &shaded, samples);
        for (index, light) in self.lights.iter().enumerate() {
            self.add_light(index, light, &wave, &shaded, samples, room, record);
        }
        if wave.depth < self.max_depth {
            let (reflected, refracted) = self.branches(&wave, &shaded);
            for (kind, branches) in [(RayKind::Reflection, reflected), (RayKind::Refraction, refracted)] {
                for chunk in branches.chunks(PACKETS * LANES) {
                    let next = Wave::of_branches(chunk, kind, wave.depth + 1);
                    self.trace(next, samples, room, record);
                }
            }
        }
    }

    fn tell<R: Record>(&self, wave: &Wave, p: usize, live: u32, record: &mut R) {
        let t = wave.tile.packets[p].t_max.to_array();
        for i in lanes(live) {
            let row = wave.tile.hit(p, i);
            let met = row.kind().map(|kind| self.tree.stores().owner(kind, row.row()).primitive);
            record.ray(wave.kind, wave.ray(p, i, f32::INFINITY), met, t[i], wave.slot(p, i), wave.paths[p][i]);
        }
    }

    fn add_background(&self, wave: &Wave, p: usize, miss: u32, samples: &mut Samples) {
        let camera = wave.kind == RayKind::Camera;
        let transparent = camera && self.plan.scene.background.transparent;
        if camera {
            let opaque = if transparent { !miss } else { !0 };
            samples.alpha[p] = Mask8::from_bits(opaque & 0xff).select(float8(1.0), Float8::ZERO);
        }
        if miss != 0 && !transparent {
            let radiance = self.backdrop.radiance(wave.tile.packets[p].dir, miss);
            samples.add(wave, p, radiance.scale(wave.weight[p]), miss);
        }
    }

    fn shade<R: Record>(&self, wave: &Wave, p: usize, hit: u32, record: &mut R) -> Shaded {
        let (rays, stores) = (&wave.tile.packets[p], self.tree.stores());
        let rows: [RowRef; LANES] = std::array::from_fn(|i| wave.tile.hit(p, i));
        let surface = stores.surface(wave.tile.hits[p], rays, rays.t_max);
        let front = Mask8::sign(surface.normal.dot(rays.dir));
        let n_g = Vec3x8::select(front, surface.normal, -surface.normal);
        let any = hit.trailing_zeros() as usize;
        let owner = |i: usize| match rows[i].kind() {
            Some(kind) => stores.owner(kind, rows[i].row()),
            None => Owner { primitive: 0, material: 0 },
        };
        let owners: [Owner; LANES] = std::array::from_fn(owner);
        let fronts = front.bits();
        let side = |i: usize| self.plan.side_material(owners[i].material, fronts >> i & 1 == 1);
        let materials = std::array::from_fn(|i| side(if hit >> i & 1 == 1 { i } else { any }));
        let mut shaded = Shaded {
            hit,
            front,
            point: surface.point,
            error: surface.error,
            wo: -rays.dir.normalize(),
            n_g,
            n_s: n_g,
            smooth: Mask8::NONE,
            bsdf: self.materials.gather(materials),
        };
        self.add_textures(wave, p, &rows, &owners, &materials, &mut shaded, record);
        self.add_normals(&owners, &mut shaded);
        shaded
    }

    #[allow(clippy::too_many_arguments)] // the parts of one hit, each from another table
    fn add_textures<R: Record>(
        &self,
        wave: &Wave,
        p: usize,
        rows: &[RowRef; LANES],
        owners: &[Owner; LANES],
        materials: &[u32; LANES],
        shaded: &mut Shaded,
        record: &mut R,
    ) {
        let textured = lanes(shaded.hit).any(|i| self.materials.is_textured(materials[i]));
        if !textured && !self.plan.colored {
            return;
        }
        let (mut colors, points) = (shaded.bsdf.color.to_arrays(), shaded.point.to_arrays());
        for i in lanes(shaded.hit) {
            if let Some(texture) = self.materials.texture(materials[i]) {
                let point = DVec3::from_array(points[i].map(f64::from));
                let uv = attributes::uv(self.plan, self.tree.stores(), rows[i], owners[i], point);
                let (color, cell) = self.materials.texel(self.plan.scene, texture, uv);
                colors[i] = color;
                if R::ON {
                    record.texture(texture, cell, wave.slot(p, i), wave.paths[p][i]);
                }
            }
            if self.plan.colored {
                let factor = self.plan.scene.color_factor(owners[i].primitive as usize).as_vec3().to_array();
                colors[i] = std::array::from_fn(|k| colors[i][k] * factor[k]);
            }
        }
        shaded.bsdf.color = Vec3x8::from_fn(|i| colors[i]);
    }

    /// Interpolated normals, turned to the side that is seen.
    fn add_normals(&self, owners: &[Owner; LANES], shaded: &mut Shaded) {
        if !self.plan.smooth {
            return;
        }
        let (points, fronts) = (shaded.point.to_arrays(), shaded.front.bits());
        let mut normals = shaded.n_s.to_arrays();
        let mut smooth = 0;
        for i in lanes(shaded.hit) {
            let point = DVec3::from_array(points[i].map(f64::from));
            if let Some(normal) = attributes::shading_normal(self.plan, owners[i], point) {
                let turned = if fronts >> i & 1 == 1 { normal } else { -normal };
                (normals[i], smooth) = (turned.as_vec3().to_array(), smooth | 1 << i);
            }
        }
        shaded.n_s = Vec3x8::from_fn(|i| normals[i]);
        shaded.smooth = Mask8::from_bits(smooth);
    }

    fn add_ambient(&self, wave: &Wave, shaded: &[Option<Shaded>; PACKETS], samples: &mut Samples) {
        for (p, shaded) in shaded.iter().enumerate() {
            let Some(shaded) = shaded else { continue };
            let albedo = shaded.bsdf.color * shaded.bsdf.diffuse;
            samples.add(wave, p, albedo.scale(self.ambient).scale(wave.weight[p]), shaded.hit);
        }
    }

    #[allow(clippy::too_many_arguments)] // one light against one wave
    fn add_light<R: Record>(
        &self,
        index: usize,
        light: &Illumination,
        wave: &Wave,
        shaded: &[Option<Shaded>; PACKETS],
        samples: &mut Samples,
        room: &mut Room,
        record: &mut R,
    ) {
        let dead = RayPacket::new(Vec3x8::ZERO, Vec3x8::splat([1.0; 3]), Float8::ZERO, Mask8::NONE);
        let mut packets = [dead; PACKETS];
        let mut shares = [Vec3x8::ZERO; PACKETS];
        let mut lit = [0; PACKETS];
        for (p, shaded) in shaded.iter().enumerate() {
            let Some(shaded) = shaded else { continue };
            let (wi, strength) = light.sample(shaded.point);
            let (share, facing) = shaded.share(wi, strength);
            let share = share.scale(wave.weight[p]);
            lit[p] = shaded.hit & facing.bits();
            if self.skip {
                lit[p] &= Mask8::gt(share.x + share.y + share.z, Float8::ZERO).bits();
            }
            shares[p] = share;
            if light.shadows {
                packets[p] = shaded.shadow_rays(light, Mask8::from_bits(lit[p]));
            }
        }
        if light.shadows {
            let common = match light.toward {
                Toward::Point(position) => Some(position),
                Toward::Direction(_) => None,
            };
            let t_max = packets.map(|rays| rays.t_max.to_array());
            let mut tile = Tile::new(packets, common);
            let redecided = room.walk.counts.redecided;
            self.tree.occluded_tile(&mut tile, &mut room.walk);
            room.rays.redecided[RayKind::Shadow as usize] += room.walk.counts.redecided - redecided;
            for p in 0..PACKETS {
                let bright = tile.packets[p].live().bits();
                room.rays.rays[RayKind::Shadow as usize] += u64::from(lit[p].count_ones());
                room.rays.hits[RayKind::Shadow as usize] += u64::from((lit[p] & !bright).count_ones());
                if R::ON {
                    for i in lanes(lit[p]) {
                        let (origin, dir) = (packets[p].origin.lane(i), packets[p].dir.lane(i));
                        let ray = Ray { origin, t_min: 0.0, dir, t_max: t_max[p][i] };
                        let dark = bright >> i & 1 == 0;
                        record.shadow(index, ray, dark, wave.slot(p, i), wave.paths[p][i]);
                    }
                }
                lit[p] &= bright;
            }
        } else if R::ON {
            for p in 0..PACKETS {
                lanes(lit[p]).for_each(|i| record.lit(index, wave.slot(p, i), wave.paths[p][i]));
            }
        }
        for p in 0..PACKETS {
            if lit[p] != 0 {
                samples.add(wave, p, shares[p], lit[p]);
            }
        }
    }

    /// The rays that go on: reflected, refracted.
    fn branches(&self, wave: &Wave, shaded: &[Option<Shaded>; PACKETS]) -> (Vec<Branch>, Vec<Branch>) {
        let (mut reflected, mut refracted) = (Vec::new(), Vec::new());
        for (p, shaded) in shaded.iter().enumerate() {
            let Some(shaded) = shaded else { continue };
            let (reflects, refracts) = shaded.scatters();
            if reflects | refracts == 0 {
                continue;
            }
            let scattered = shaded.scatter();
            let push = |list: &mut Vec<Branch>, mask: u32, (dir, share): (Vec3x8, Vec3x8), out: bool| {
                let weight = share.scale(wave.weight[p]);
                let carries = Mask8::gt(weight.x + weight.y + weight.z, Float8::ZERO).bits();
                let mask = if self.skip { mask & carries } else { mask };
                let origin = shaded.leave(out, shaded.error).to_arrays();
                let (dirs, weights) = (dir.to_arrays(), weight.to_arrays());
                for i in lanes(mask) {
                    let path = wave.paths[p][i].wrapping_mul(2) + u32::from(!out);
                    let slot = wave.slot(p, i) as u8;
                    list.push(Branch { origin: origin[i], dir: dirs[i], weight: weights[i], slot, path });
                }
            };
            push(&mut reflected, reflects, scattered.reflected, true);
            push(&mut refracted, refracts & !scattered.total.bits(), scattered.refracted, false);
        }
        (reflected, refracted)
    }
}

/// Where light goes on, and how much of it.
struct Scattered {
    reflected: (Vec3x8, Vec3x8),
    refracted: (Vec3x8, Vec3x8),
    /// Lanes whose reflection is total.
    total: Mask8,
}

impl Shaded {
    /// What one light gives without regard to shadows, and the lanes that face it.
    #[inline(always)]
    fn share(&self, wi: Vec3x8, strength: Vec3x8) -> (Vec3x8, Mask8) {
        let (cos, cos_g) = (self.n_s.dot(wi), self.n_g.dot(wi));
        let facing = Mask8::gt(cos, Float8::ZERO) & Mask8::gt(cos_g, Float8::ZERO);
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
        let x = (cos_g / (cos * self.n_s.dot(self.n_g))).fast_min(one);
        x * (one + x * (one - x))
    }

    /// The hit points moved off the surface, to the viewer's side or the other one.
    #[inline(always)]
    fn leave(&self, viewer_side: bool, error: Float8) -> Vec3x8 {
        let size = self.point.abs();
        let step = error + float8(2.0 * UNIT_ROUNDOFF) * (size.x + size.y + size.z);
        let step = if viewer_side { step } else { -step };
        self.n_g.mul_add(step, self.point)
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

    /// Lanes that reflect, and lanes that refract.
    #[inline(always)]
    fn scatters(&self) -> (u32, u32) {
        let positive = |x: Float8| Mask8::gt(x, Float8::ZERO).bits();
        let through = positive(self.bsdf.dielectric + self.bsdf.transmittance) & self.hit;
        (through | (positive(self.bsdf.mirror + self.bsdf.specular) & self.hit), through)
    }

    fn scatter(&self) -> Scattered {
        let (one, n) = (float8(1.0), self.n_s);
        let cos_i = n.dot(self.wo).fast_max(Float8::ZERO);
        let ratio = self.front.select(one / self.bsdf.ior, self.bsdf.ior);
        let sin2_t = ratio * ratio * (one - cos_i * cos_i).fast_max(Float8::ZERO);
        let total = Mask8::ge(sin2_t, one);
        let cos_t = (one - sin2_t).fast_max(Float8::ZERO).sqrt();
        let (reflected, refracted) = self.bsdf.scatter(cos_i, cos_t, ratio, total);
        let through = n.mul_add(ratio * cos_i - cos_t, -(self.wo * ratio));
        Scattered { reflected: (self.mirrored(), reflected), refracted: (through, refracted), total }
    }

    /// The mirror direction, bent back where an interpolated normal sends it below the surface.
    fn mirrored(&self) -> Vec3x8 {
        let cos = self.n_s.dot(self.wo);
        let mirrored = self.n_s.mul_add(cos + cos, -self.wo);
        let below = self.smooth & Mask8::le(mirrored.dot(self.n_g), Float8::ZERO);
        if !below.any() {
            return mirrored;
        }
        let lift = float8(1e-3) - mirrored.dot(self.n_g);
        Vec3x8::select(below, self.n_g.mul_add(lift, mirrored), mirrored)
    }
}

impl Samples {
    /// Adds radiance to the samples of some lanes.
    #[inline(always)]
    fn add(&mut self, wave: &Wave, p: usize, radiance: Vec3x8, mask: u32) {
        if wave.slots.is_none() {
            let radiance = Vec3x8::select(Mask8::from_bits(mask), radiance, Vec3x8::ZERO);
            self.radiance[p] = self.radiance[p] + radiance;
            return;
        }
        let values = radiance.to_arrays();
        for i in lanes(mask) {
            let slot = wave.slot(p, i);
            let sums = &mut self.radiance[slot / LANES];
            sums.x.as_mut_array()[slot % LANES] += values[i][0];
            sums.y.as_mut_array()[slot % LANES] += values[i][1];
            sums.z.as_mut_array()[slot % LANES] += values[i][2];
        }
    }
}
