//! Hits made ready for light: normals, materials and colours, in f64 where rays go on from them.

use glam::DVec3;

use super::direct::Direct;
use super::record::{RayKind, Record, Seen};
use super::wave::Wave;
use crate::lanes::{DVec3x8, Float8, LANES, Mask8, UNIT_ROUNDOFF, Vec3x8, bits, dot8, float8};
use crate::plan::{Owner, Skip};
use crate::shade::{Bsdf8, Facing, attributes};
use crate::shapes::{Surface8, Surface64x8};

/// Eight hits, made ready for light.
#[derive(Debug, Clone, Copy)]
pub struct Shaded {
    pub packet: usize,
    pub hit: u32,
    pub front: Mask8,
    pub point: Vec3x8,
    pub error: Float8,
    /// Unit, toward the viewer, where something has highlights.
    pub wo: Vec3x8,
    /// Geometric and shading normal on the viewer's side.
    pub n_g: Vec3x8,
    pub n_s: Vec3x8,
    /// Lanes whose shading normal is interpolated.
    pub smooth: Mask8,
    pub bsdf: Bsdf8,
    /// Whose they are, where some light has primitives that nothing can put in its shadow.
    pub primitives: [u32; LANES],
}

/// Eight hits in f64, as rays go on from them.
#[derive(Debug, Clone, Copy, Default)]
pub struct Vertex8 {
    /// Lanes from which rays may go on; the others mean nothing.
    pub lanes: u32,
    pub point: DVec3x8,
    /// Geometric and shading normal on the viewer's side.
    pub n_g: DVec3x8,
    pub n_s: DVec3x8,
    /// Lanes whose front was met.
    pub fronts: u32,
    pub materials: [u32; LANES],
}

impl Direct<'_> {
    /// What the lights and the rays that go on need of the hits of a packet.
    #[inline(always)]
    pub(super) fn shade<R: Record>(
        &self,
        wave: &Wave,
        (p, hit): (usize, u32),
        shaded: &mut Shaded,
        vertex: &mut Vertex8,
        record: &mut R,
    ) {
        let (rays, stores) = (&wave.tile.packets[p], self.tree.stores());
        let before = wave.tile.exact.as_ref().map(|exact| &exact[p]);
        let (mut surface, owners) = stores.surface::<false>(wave.tile.hits[p], rays, rays.t_max, before);
        let owners = &owners;
        vertex.lanes = self.lanes_that_go_on(owners, hit);
        if wave.kind == RayKind::Camera {
            let (hits, plain) = (wave.tile.hits[p].to_array(), hit & !vertex.lanes);
            if self.plan.sharp {
                stores.sharpen(Mask8::from_bits(plain), &hits, (rays, rays.t_max), before, &mut surface);
            } else if let (true, Some(exact)) = (self.plan.specks && plain != 0, before) {
                stores.sharpen_specks(plain, &hits, (rays, exact), &mut surface);
            }
        }
        if self.goes_on() {
            self.refine(wave, (p, hit), &mut surface, vertex);
        }
        let front = Mask8::sign(surface.normal.dot(rays.dir));
        let materials = self.materials_of(owners, front.bits(), hit);
        shaded.packet = p;
        shaded.hit = hit;
        shaded.front = front;
        shaded.point = surface.point;
        shaded.error = surface.error;
        if self.frees {
            shaded.primitives = owners.map(|owner| owner.primitive);
        }
        if self.plan.shines {
            shaded.wo = -rays.dir.normalize();
        }
        shaded.n_g = Vec3x8::select(front, surface.normal, -surface.normal);
        shaded.n_s = shaded.n_g;
        shaded.smooth = Mask8::NONE;
        self.materials.gather(materials, &mut shaded.bsdf);
        vertex.materials = materials;
        let all = !self.plan.skips.allows(Skip::Shading);
        if self.plan.textured || self.plan.colored || all {
            self.add_colors((wave, p), owners, &materials, shaded, record);
        }
        if self.plan.smooth || all {
            self.add_normals(owners, shaded, vertex);
        }
        if R::SURFACES && wave.depth == 1 {
            let (rows, owners, materials) = (wave.tile.hits[p], owners, &materials);
            let (normal, bsdf) = (shaded.n_s, &shaded.bsdf);
            record.surface(&Seen { packet: p, hit, rays, rows, owners, materials, normal, bsdf });
        }
    }

    /// The materials of the sides that were met; lanes that missed have one of them.
    #[inline(always)]
    fn materials_of(&self, owners: &[Owner; LANES], fronts: u32, hit: u32) -> [u32; LANES] {
        let any = hit.trailing_zeros() as usize;
        let one = owners[any].material;
        if self.plan.is_same_on_both_sides(one) && owners.iter().all(|owner| owner.material == one) {
            return [one; LANES];
        }
        let side = |i: usize| self.plan.side_material(owners[i].material, fronts >> i & 1 == 1);
        std::array::from_fn(|i| side(if hit >> i & 1 == 1 { i } else { any }))
    }

    /// Colours from textures and clouds.
    #[inline(never)]
    fn add_colors<R: Record>(
        &self,
        (wave, p): (&Wave, usize),
        owners: &[Owner; LANES],
        materials: &[u32; LANES],
        shaded: &mut Shaded,
        record: &mut R,
    ) {
        let (mut colors, points) = (shaded.bsdf.color.to_arrays(), shaded.point.to_arrays());
        let all = !self.plan.skips.allows(Skip::Shading);
        for i in bits(shaded.hit) {
            let texture = self.materials.texture(materials[i]);
            if texture.is_some() || all {
                let point = DVec3::from_array(points[i].map(f64::from));
                let uv = attributes::uv(self.plan, self.tree.stores(), wave.tile.hit(p, i), owners[i], point);
                let uv = std::hint::black_box(uv);
                if let Some(texture) = texture {
                    let (color, cell) = self.materials.texel(self.plan.scene, texture, uv);
                    colors[i] = color;
                    if R::ON {
                        record.texture(texture, cell, wave.slot(p, i), wave.path(p, i));
                    }
                }
            }
            if self.plan.colored || all {
                let factor = self.plan.scene.color_factor(owners[i].primitive as usize).as_vec3().to_array();
                colors[i] = std::array::from_fn(|k| colors[i][k] * factor[k]);
            }
        }
        shaded.bsdf.color = Vec3x8::from_fn(|i| colors[i]);
    }

    /// Interpolated normals, turned to the side that is seen.
    #[inline(never)]
    fn add_normals(&self, owners: &[Owner; LANES], shaded: &mut Shaded, vertex: &mut Vertex8) {
        let (points, fronts) = (shaded.point.to_arrays(), shaded.front.bits());
        let mut normals = shaded.n_s.to_arrays();
        let mut smooth = 0;
        for i in bits(shaded.hit) {
            let point = DVec3::from_array(points[i].map(f64::from));
            if let Some(normal) = attributes::shading_normal(self.plan, owners[i], point) {
                let turned = if fronts >> i & 1 == 1 { normal } else { -normal };
                (normals[i], smooth) = (turned.as_vec3().to_array(), smooth | 1 << i);
                (0..3).for_each(|k| vertex.n_s[k][i] = turned[k]);
            }
        }
        shaded.n_s = Vec3x8::from_fn(|i| normals[i]);
        shaded.smooth = Mask8::from_bits(smooth);
    }

    /// Hits from which rays may go on.
    #[inline(always)]
    fn lanes_that_go_on(&self, owners: &[Owner; LANES], hit: u32) -> u32 {
        if self.is_path() {
            return hit;
        }
        if !self.plan.scatters {
            return 0;
        }
        bits(hit).filter(|i| self.plan.goes_on[owners[*i].material as usize]).map(|i| 1 << i).sum()
    }

    /// The hits of a packet from which rays go on again in f64, rounded into `surface`. So the bits of a hit
    /// depend on its own material alone.
    #[inline(never)]
    fn refine(&self, wave: &Wave, (p, hit): (usize, u32), surface: &mut Surface8, vertex: &mut Vertex8) {
        let (hits, t) = (wave.tile.hits[p].to_array(), wave.tile.packets[p].t_max.to_array());
        let wanted = if self.plan.skips.allows(Skip::Bounces) { vertex.lanes } else { hit };
        if wanted == 0 {
            return;
        }
        let rays = &wave.exact[p];
        let Surface64x8 { point, normal } = self.tree.stores().refine8(wanted, &hits, rays, &t);
        let lanes = Mask8::from_bits(vertex.lanes);
        surface.point = Vec3x8::select(lanes, Vec3x8::rounded(&point), surface.point);
        surface.normal = Vec3x8::select(lanes, Vec3x8::rounded(&normal), surface.normal);
        let along = dot8(&normal, &rays.dir);
        vertex.fronts = (0..LANES).map(|i| u32::from(along[i] < 0.0) << i).sum();
        (vertex.point, vertex.n_g) = (point, normal);
        for axis in &mut vertex.n_g {
            for i in 0..LANES {
                axis[i] = if along[i] < 0.0 { axis[i] } else { -axis[i] };
            }
        }
        vertex.n_s = vertex.n_g;
    }
}

impl Vertex8 {
    /// One of the hits, met by a ray of this direction.
    pub fn facing(&self, i: usize, dir: DVec3) -> Facing {
        let [n_s, n_g] = [&self.n_s, &self.n_g].map(|axes| DVec3::from_array(axes.map(|axis| axis[i])));
        Facing { dir: dir.normalize(), n_s, n_g, front: self.fronts >> i & 1 == 1 }
    }

    /// Where one of them is.
    pub fn point(&self, i: usize) -> DVec3 {
        DVec3::from_array(self.point.map(|axis| axis[i]))
    }
}

impl Shaded {
    /// No hits.
    pub const NOTHING: Shaded = Shaded {
        packet: 0,
        hit: 0,
        front: Mask8::NONE,
        point: Vec3x8::ZERO,
        error: Float8::ZERO,
        wo: Vec3x8::ZERO,
        n_g: Vec3x8::ZERO,
        n_s: Vec3x8::ZERO,
        smooth: Mask8::NONE,
        bsdf: Bsdf8::NOTHING,
        primitives: [0; LANES],
    };

    /// The hit points moved off the surface, to the viewer's side or the other one.
    #[inline(always)]
    pub(super) fn leave(&self, viewer_side: bool, error: Float8) -> Vec3x8 {
        let size = self.point.abs();
        let step = error + float8(2.0 * UNIT_ROUNDOFF) * (size.x + size.y + size.z);
        let step = if viewer_side { step } else { -step };
        self.n_g.mul_add(step, self.point)
    }
}
