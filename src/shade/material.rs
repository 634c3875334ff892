//! Materials of eight hits as one set of numbers, whatever their kinds.

use glam::DVec2;

use super::texture;
use crate::lanes::{Float8, LANES, Mask8, Vec3x8, float8};
use crate::scene::{Model, Paint, Scene};

/// All materials in f32: material `i` is row `i`.
#[derive(Debug)]
pub struct MaterialTable(Vec<Row>);

/// One material: every model is a choice of these numbers.
#[derive(Debug, Clone, Copy)]
struct Row {
    color: [f32; 3],
    texture: Option<u32>,
    diffuse: f32,       // share of the colour that is the albedo
    specular: f32,      // weight of highlight and of Phong's reflection
    shine: f32,         // exponent of the highlight
    mirror: f32,        // 1: reflects the colour
    dielectric: f32,    // 1: reflects by Fresnel, refracts the colour
    transmittance: f32, // weight of Phong's refraction
    ior: f32,
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
    /// 1: reflects the colour.
    pub mirror: Float8,
    /// 1: reflects by Fresnel, refracts the colour.
    pub dielectric: Float8,
    /// Weight of Phong's refraction.
    pub transmittance: Float8,
    /// Refractive index, inside over outside.
    pub ior: Float8,
}

impl MaterialTable {
    /// Rounds the scene's.
    pub fn new(scene: &Scene) -> Self {
        let row = |model: &Model| {
            let (color, texture) = match model.paint() {
                Paint::Color(color) => (color.as_vec3().to_array(), None),
                Paint::Texture(index) => ([1.0; 3], Some(index as u32)),
            };
            let zero = Row {
                color,
                texture,
                diffuse: 0.0,
                specular: 0.0,
                shine: 0.0,
                mirror: 0.0,
                dielectric: 0.0,
                transmittance: 0.0,
                ior: 1.0,
            };
            match *model {
                Model::Diffuse { .. } => Row { diffuse: 1.0, ..zero },
                Model::Mirror { .. } => Row { mirror: 1.0, ..zero },
                Model::Dielectric { ior, .. } => Row { dielectric: 1.0, ior: ior as f32, ..zero },
                Model::Phong { kd, ks, shine, transmittance, ior, .. } => Row {
                    diffuse: kd as f32,
                    specular: ks as f32,
                    shine: shine as f32,
                    transmittance: transmittance as f32,
                    ior: if ior == 0.0 { 1.0 } else { ior as f32 },
                    ..zero
                },
            }
        };
        MaterialTable(scene.materials.iter().map(|material| row(&material.model)).collect())
    }

    /// Gathers the materials of eight hits; lanes that are not in `lanes` may hold anything.
    #[inline(always)]
    pub fn gather(&self, materials: [u32; LANES]) -> Bsdf8 {
        if materials.iter().all(|material| *material == materials[0]) {
            return Bsdf8::splat(&self.0[materials[0] as usize]);
        }
        let rows = materials.map(|material| &self.0[material as usize]);
        let column = |f: fn(&Row) -> f32| Float8::from(rows.map(f));
        Bsdf8 {
            color: Vec3x8::from_fn(|i| rows[i].color),
            diffuse: column(|row| row.diffuse),
            specular: column(|row| row.specular),
            shine: column(|row| row.shine),
            mirror: column(|row| row.mirror),
            dielectric: column(|row| row.dielectric),
            transmittance: column(|row| row.transmittance),
            ior: column(|row| row.ior),
        }
    }

    /// Whether a material has a texture.
    #[inline(always)]
    pub fn is_textured(&self, material: u32) -> bool {
        self.0[material as usize].texture.is_some()
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
    fn splat(row: &Row) -> Self {
        Bsdf8 {
            color: Vec3x8::splat(row.color),
            diffuse: float8(row.diffuse),
            specular: float8(row.specular),
            shine: float8(row.shine),
            mirror: float8(row.mirror),
            dielectric: float8(row.dielectric),
            transmittance: float8(row.transmittance),
            ior: float8(row.ior),
        }
    }

    /// Lanes whose light comes from lights directly, for some part.
    #[inline(always)]
    pub fn is_lit(&self) -> Mask8 {
        Mask8::gt(self.diffuse + self.specular, Float8::ZERO)
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

    /// Reflected and refracted shares of what comes along both ways, given the cosine on the viewer's
    /// side, the ratio of indices (viewer's over other) and whether reflection is total.
    #[inline(always)]
    pub fn scatter(&self, cos_i: Float8, cos_t: Float8, ratio: Float8, total: Mask8) -> (Vec3x8, Vec3x8) {
        let one = float8(1.0);
        let fresnel = total.select(one, fresnel(cos_i, cos_t, ratio));
        let passes = one - fresnel;
        let lost = total.select(self.transmittance, Float8::ZERO);
        let reflected = self.dielectric.mul_add(fresnel, self.specular + lost);
        let reflected = self.color.mul_add(self.mirror, Vec3x8::new(reflected, reflected, reflected));
        let through = total.select(Float8::ZERO, self.transmittance);
        let refracted = self.color.mul_add(self.dielectric * passes, Vec3x8::new(through, through, through));
        (reflected, refracted)
    }
}

/// Unpolarised reflectance of a dielectric for `ratio` = index on the viewer's side over the other.
///
/// Source: Born and Wolf, Principles of Optics, 7th edition, 1999, section 1.5.2.
#[inline(always)]
fn fresnel(cos_i: Float8, cos_t: Float8, ratio: Float8) -> Float8 {
    let parallel = (cos_i - ratio * cos_t) / (cos_i + ratio * cos_t);
    let perpendicular = (ratio * cos_i - cos_t) / (ratio * cos_i + cos_t);
    (parallel * parallel + perpendicular * perpendicular) * float8(0.5)
}

fn power(base: Float8, exponent: Float8) -> Float8 {
    let (base, exponent) = (base.to_array(), exponent.to_array());
    Float8::from(std::array::from_fn::<f32, LANES, _>(|i| base[i].powf(exponent[i])))
}
