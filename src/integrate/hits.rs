//! Hits made ready for light: normals, materials and colours, in f64 where rays go on from them.

use glam::DVec3;

use super::direct::Direct;
use super::record::Record;
use super::wave::{Wave, lanes};
use crate::lanes::{Float8, LANES, Mask8, UNIT_ROUNDOFF, Vec3x8, float8};
use crate::plan::Owner;
use crate::shade::{Bsdf8, Facing, attributes};
use crate::shapes::{Ray64, Surface8};

/// Eight hits, made ready for light.
#[derive(Debug)]
pub struct Shaded {
    pub packet: usize,
    pub hit: u32,
    pub front: Mask8,
    pub point: Vec3x8,
    pub error: Float8,
    /// Unit, toward the viewer.
    pub wo: Vec3x8,
    /// Geometric and shading normal on the viewer's side.
    pub n_g: Vec3x8,
    pub n_s: Vec3x8,
    /// Lanes whose shading normal is interpolated.
    pub smooth: Mask8,
    pub bsdf: Bsdf8,
    /// In f64, where rays may go on.
    pub exact: Option<Box<[Exact; LANES]>>,
}

/// One hit in f64, as rays go on from it.
#[derive(Debug, Clone, Copy)]
pub struct Exact {
    pub point: DVec3,
    pub facing: Facing,
    pub material: u32,
}

impl Default for Exact {
    fn default() -> Self {
        let facing = Facing { dir: DVec3::NEG_Z, n_s: DVec3::Z, n_g: DVec3::Z, front: true };
        Exact { point: DVec3::ZERO, facing, material: 0 }
    }
}

impl Direct<'_> {
    /// What the lights and the rays that go on need of the hits of a packet.
    pub(super) fn shade<R: Record>(&self, wave: &Wave, p: usize, hit: u32, record: &mut R) -> Shaded {
        let (rays, stores) = (&wave.tile.packets[p], self.tree.stores());
        let (mut surface, owners) = stores.surface::<false>(wave.tile.hits[p], rays, rays.t_max);
        let exact = self.refine(wave, p, hit, &mut surface);
        let front = Mask8::sign(surface.normal.dot(rays.dir));
        let n_g = Vec3x8::select(front, surface.normal, -surface.normal);
        let any = hit.trailing_zeros() as usize;
        let fronts = front.bits();
        let side = |i: usize| self.plan.side_material(owners[i].material, fronts >> i & 1 == 1);
        let materials = std::array::from_fn(|i| side(if hit >> i & 1 == 1 { i } else { any }));
        let mut shaded = Shaded {
            packet: p,
            hit,
            front,
            point: surface.point,
            error: surface.error,
            wo: -rays.dir.normalize(),
            n_g,
            n_s: n_g,
            smooth: Mask8::NONE,
            bsdf: self.materials.gather(materials),
            exact,
        };
        if let Some(exact) = &mut shaded.exact {
            lanes(hit).for_each(|i| exact[i].material = materials[i]);
        }
        self.add_colors((wave, p), &owners, &materials, &mut shaded, record);
        self.add_normals(&owners, &mut shaded);
        shaded
    }

    /// Colours from textures and clouds.
    fn add_colors<R: Record>(
        &self,
        (wave, p): (&Wave, usize),
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
                let uv = attributes::uv(self.plan, self.tree.stores(), wave.tile.hit(p, i), owners[i], point);
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
                if let Some(exact) = &mut shaded.exact {
                    exact[i].facing.n_s = turned;
                }
            }
        }
        shaded.n_s = Vec3x8::from_fn(|i| normals[i]);
        shaded.smooth = Mask8::from_bits(smooth);
    }

    /// The hits of a packet again in f64, rounded into `surface`.
    fn refine(&self, wave: &Wave, p: usize, hit: u32, surface: &mut Surface8) -> Option<Box<[Exact; LANES]>> {
        let rays = &wave.exact.as_ref()?[p];
        let t = wave.tile.packets[p].t_max.to_array();
        let (mut points, mut normals) = (surface.point.to_arrays(), surface.normal.to_arrays());
        let mut exact = Box::new([Exact::default(); LANES]);
        for i in lanes(hit) {
            let (origin, dir) = rays.lane(i);
            let ray = Ray64 { origin, dir, t_min: 0.0, t_max: f64::INFINITY };
            let found = self.tree.stores().refine(wave.tile.hit(p, i), &ray, f64::from(t[i]))?;
            (points[i], normals[i]) = (found.point.as_vec3().to_array(), found.normal.as_vec3().to_array());
            let front = found.normal.dot(dir) < 0.0;
            let n_g = if front { found.normal } else { -found.normal };
            let facing = Facing { dir: dir.normalize(), n_s: n_g, n_g, front };
            exact[i] = Exact { point: found.point, facing, material: 0 };
        }
        surface.point = Vec3x8::from_fn(|i| points[i]);
        surface.normal = Vec3x8::from_fn(|i| normals[i]);
        Some(exact)
    }
}

impl Shaded {
    /// The hit points moved off the surface, to the viewer's side or the other one.
    #[inline(always)]
    pub(super) fn leave(&self, viewer_side: bool, error: Float8) -> Vec3x8 {
        let size = self.point.abs();
        let step = error + float8(2.0 * UNIT_ROUNDOFF) * (size.x + size.y + size.z);
        let step = if viewer_side { step } else { -step };
        self.n_g.mul_add(step, self.point)
    }
}
