//! Materials: what a surface makes of light.
//!
//! At a hit with unit shading normal `n` on the viewer's side, `wo` toward the viewer, and lights
//! that give `wi`, `E` and visibility, the radiance of the direct integrator is
//! `ambient x albedo + sum over lights + reflected and refracted radiance`, with the terms below.
//! A light counts only if `n . wi > 0` and `n_g . wi > 0` (geometric normal on the viewer's side) and
//! nothing lies between; everything casts a full shadow, glass as well.
//!
//! Reflection is about `n`: `d - 2 (d . n) n`. Where interpolated normals send it below the surface
//! (`r . n_g <= 0`), it is bent back: `r - (r . n_g) n_g` is moved up by 1e-3 |d| along `n_g`.
//! Refraction is by Snell's law with `n`, total reflection included; the ratio is 1 to `ior` on the
//! front and `ior` to 1 on the back. `n` is the interpolated normal turned to the side of `n_g`; where
//! it faces away from the viewer all the same, Snell and Fresnel take `-n`. With interpolated normals
//! the light's cosine is multiplied by `g(x) = x (1 + x (1 - x))`, where x is
//! `(n_g . wi) / ((n . wi) (n . n_g))` held in 0..1: Chiang, Li and Burley, "Taming the shadow terminator", SIGGRAPH 2019 talks.

use glam::DVec3;

/// A named material.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// The user's name.
    pub name: String,
    /// What it does with light.
    pub model: Model,
    /// Index of the material of the back side; `None`: the same.
    pub back: Option<usize>,
    /// Which side camera and secondary rays see. Shadow rays meet both.
    pub visible: Visible,
}

/// The sides of a surface that rays meet, shadow rays apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Visible {
    /// Both sides.
    #[default]
    Both,
    /// The front alone: `one_sided = true`.
    Front,
    /// The back alone: `one_sided = "back"` (NFF's negative radius).
    Back,
}

/// What a surface does with light. Every [`Paint`] is linear Rec. 709.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Model {
    /// Each light gives `albedo/pi x E x (n . wi)`.
    Diffuse {
        /// Reflected share of light, >= 0.
        albedo: Paint,
    },
    /// `reflectance x (radiance along the mirror direction)`; no light directly.
    Mirror {
        /// Factor on what is reflected.
        reflectance: Paint,
    },
    /// Fresnel's `F x reflected + (1 - F) x tint x refracted` (unpolarised); total reflection: `F = 1`.
    Dielectric {
        /// Refractive index inside over outside, > 0.
        ior: f64,
        /// Factor on what is refracted.
        tint: Paint,
    },
    /// NFF's `f`. Each light gives `E/pi x (kd x color x (n . wi) + ks x max(0, r . wo)^shine)` with `r`
    /// the mirror image of `wi` about `n`; its albedo is `kd x color`; it adds `ks x reflected` if
    /// `ks > 0` or `transmittance > 0`, and `transmittance x refracted` if `transmittance > 0`; where
    /// refraction is total, the reflected share is `ks + transmittance`.
    Phong {
        /// Colour of the diffuse term.
        color: Paint,
        /// Diffuse weight, >= 0.
        kd: f64,
        /// Weight of highlight and reflection, >= 0.
        ks: f64,
        /// Exponent of the highlight, >= 0.
        shine: f64,
        /// Refracted share, >= 0.
        transmittance: f64,
        /// Refractive index; 0 reads as 1.
        ior: f64,
    },
}

/// A colour, or a texture that gives one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Paint {
    /// Linear Rec. 709, >= 0.
    Color(DVec3),
    /// Index into [`Scene::textures`](super::Scene::textures).
    Texture(usize),
}

impl Model {
    /// The one colour of this material, which clouds with `colors` multiply.
    pub fn paint(&self) -> Paint {
        match *self {
            Model::Diffuse { albedo } => albedo,
            Model::Mirror { reflectance } => reflectance,
            Model::Dielectric { tint, .. } => tint,
            Model::Phong { color, .. } => color,
        }
    }

    /// Whether lights shine on it directly.
    pub fn is_lit(&self) -> bool {
        match self {
            Model::Diffuse { .. } | Model::Phong { .. } => true,
            Model::Mirror { .. } | Model::Dielectric { .. } => false,
        }
    }

    /// Whether rays go on from here.
    pub fn scatters(&self) -> bool {
        match *self {
            Model::Diffuse { .. } => false,
            Model::Mirror { .. } | Model::Dielectric { .. } => true,
            Model::Phong { ks, transmittance, .. } => ks > 0.0 || transmittance > 0.0,
        }
    }
}
