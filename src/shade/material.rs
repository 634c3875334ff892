//! Materials of eight hits as one set of numbers, whatever their kinds. How rays go on from them is in
//! [`Onward`].

use glam::DVec2;

use super::onward::Onward;
use super::texture;
use crate::lanes::{Float8, LANES, Mask8, Vec3x8, float8};
use crate::scene::{Model, Paint, Scene};

/// All materials in f32: material `i` is row `i`.
#[derive(Debug)]
pub struct MaterialTable(Vec<Row>);

/// One material.
#[derive(Debug, Clone, Copy)]
struct Row {
    color: [f32; 3],
    texture: Option<u32>,
    diffuse: f32,  // share of the colour that is the albedo
    specular: f32, // weight of the highlight
    shine: f32,    // exponent of the highlight
    onward: Onward,
}

impl Row {
    fn lit(&self) -> f32 {
        match self.onward {
            Onward::Mirror | Onward::Glass { .. } => 0.0,
            Onward::Nothing | Onward::Phong { .. } => 1.0,
        }
    }
}

/// The materials of eight hits. Flags are 0 or 1.
#[derive(Debug, Clone, Copy)]
pub struct Bsdf8 {
    /// The one colour of each material.
    pub color: Vec3x8,
    /// Share of the colour that is the albedo.
    pub diffuse: Float8,
    /// Weight of highlight and of Phong's reflection.
    pub specular: Float8,
    /// Exponent of the highlight.
    pub shine: Float8,
    /// 1 where lights shine directly: not on mirrors and glass.
    pub lit: Float8,
}

impl MaterialTable {
    /// Rounds the scene's.
    pub fn new(scene: &Scene) -> Self {
        let row = |model: &Model| {
            let (color, texture) = match model.paint() {
                Paint::Color(color) => (color.as_vec3().to_array(), None),
                Paint::Texture(index) => ([1.0; 3], Some(index as u32)),
            };
            let plain = Row { color, texture, diffuse: 0.0, specular: 0.0, shine: 0.0, onward: Onward::Nothing };
            match *model {
                Model::Diffuse { .. } => Row { diffuse: 1.0, ..plain },
                Model::Mirror { .. } => Row { onward: Onward::Mirror, ..plain },
                Model::Dielectric { ior, .. } => Row { onward: Onward::Glass { ior }, ..plain },
                Model::Phong { kd, ks, shine, transmittance, ior, .. } => Row {
                    diffuse: kd as f32,
                    specular: ks as f32,
                    shine: shine as f32,
                    onward: Onward::Phong { ks, transmittance, ior: if ior == 0.0 { 1.0 } else { ior } },
                    ..plain
                },
            }
        };
        MaterialTable(scene.materials.iter().map(|material| row(&material.model)).collect())
    }

    /// Gathers the materials of eight hits.
    #[inline(always)]
    pub fn gather(&self, materials: [u32; LANES], bsdf: &mut Bsdf8) {
        if materials == [materials[0]; LANES] {
            *bsdf = Bsdf8::splat(&self.0[materials[0] as usize]);
            return;
        }
        for (i, material) in materials.into_iter().enumerate() {
            let row = &self.0[material as usize];
            bsdf.color.set_lane(i, row.color);
            bsdf.diffuse.as_mut_array()[i] = row.diffuse;
            bsdf.specular.as_mut_array()[i] = row.specular;
            bsdf.shine.as_mut_array()[i] = row.shine;
            bsdf.lit.as_mut_array()[i] = row.lit();
        }
    }

    /// How rays go on from a material.
    pub fn onward(&self, material: u32) -> Onward {
        self.0[material as usize].onward
    }

    /// The texture of a material.
    pub fn texture(&self, material: u32) -> Option<usize> {
        self.0[material as usize].texture.map(|texture| texture as usize)
    }

    /// A texture's colour and cell.
    pub fn texel(&self, scene: &Scene, texture: usize, uv: DVec2) -> ([f32; 3], i64) {
        let (color, cell) = texture::lookup(&scene.textures[texture], uv);
        (color.as_vec3().to_array(), cell)
    }
}

impl Bsdf8 {
    /// Black.
    pub const NOTHING: Bsdf8 = Bsdf8 {
        color: Vec3x8::ZERO,
        diffuse: Float8::ZERO,
        specular: Float8::ZERO,
        shine: Float8::ZERO,
        lit: Float8::ZERO,
    };

    #[inline(always)]
    fn splat(row: &Row) -> Self {
        Bsdf8 {
            color: Vec3x8::splat(row.color),
            diffuse: float8(row.diffuse),
            specular: float8(row.specular),
            shine: float8(row.shine),
            lit: float8(row.lit()),
        }
    }

    /// The share of light that comes back, 0 to 1: the albedo and the highlight, the reflectance of mirrors, the
    /// tint of glass.
    #[inline(always)]
    pub fn reflectance(&self) -> Vec3x8 {
        let one = float8(1.0);
        let color = self.color * (self.diffuse + (one - self.lit));
        let channel = |x: Float8| (x + self.specular).fast_min(one).fast_max(Float8::ZERO);
        Vec3x8::new(channel(color.x), channel(color.y), channel(color.z))
    }

    /// `(n . wi)` and highlight of one light: what `E/pi` is multiplied with.
    #[inline(always)]
    pub fn response(&self, cos: Float8, highlight: impl FnOnce() -> Float8) -> Vec3x8 {
        let diffuse = self.color * (self.diffuse * cos);
        if !Mask8::gt(self.specular, Float8::ZERO).any() {
            return diffuse;
        }
        let gloss = self.specular * power(highlight().fast_max(Float8::ZERO), self.shine);
        diffuse + Vec3x8::new(gloss, gloss, gloss)
    }
}

fn power(base: Float8, exponent: Float8) -> Float8 {
    let (base, exponent) = (base.to_array(), exponent.to_array());
    Float8::from(std::array::from_fn::<f32, LANES, _>(|i| base[i].powf(exponent[i])))
}
