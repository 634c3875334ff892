//! What rays see that meet nothing.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::texture::bilinear;
use crate::lanes::{LANES, Vec3x8, float8};
use crate::scene::{Backdrop, ImageTexture, Wrap};

/// The backdrop in f32.
#[derive(Debug)]
pub enum Backdrop8<'s> {
    /// The same everywhere.
    Color(Vec3x8),
    /// Bottom and (top - bottom), by height.
    Gradient(Vec3x8, Vec3x8),
    /// A picture with its scale and rotation in radians.
    Image(&'s ImageTexture, f64, f64),
}

impl<'s> Backdrop8<'s> {
    /// Rounds the scene's.
    pub fn new(backdrop: &'s Backdrop) -> Self {
        let splat = |c: DVec3| Vec3x8::splat(c.as_vec3().to_array());
        match backdrop {
            Backdrop::Color(color) => Backdrop8::Color(splat(*color)),
            Backdrop::Gradient { top, bottom } => Backdrop8::Gradient(splat(*bottom), splat(*top - *bottom)),
            Backdrop::Image { image, scale, rotation } => Backdrop8::Image(image, *scale, rotation.to_radians()),
        }
    }

    /// Radiance from directions of any length; lanes that are not in `lanes` may hold anything.
    pub fn radiance(&self, dir: Vec3x8, lanes: u32) -> Vec3x8 {
        match self {
            Backdrop8::Color(color) => *color,
            Backdrop8::Gradient(bottom, rise) => {
                let height = (dir.y / dir.length()).mul_add(float8(0.5), float8(0.5));
                rise.mul_add(height, *bottom)
            }
            Backdrop8::Image(image, scale, rotation) => {
                let dirs = dir.to_arrays();
                Vec3x8::from_fn(|i| match lanes >> i & 1 {
                    0 => [0.0; 3],
                    _ => (look(image, DVec3::from_array(dirs[i].map(f64::from)), *rotation) * *scale).as_vec3().into(),
                })
            }
        }
    }
}

const _: () = assert!(LANES == 8);

fn look(image: &ImageTexture, dir: DVec3, rotation: f64) -> DVec3 {
    look_up(image, place(dir, rotation))
}

/// A lat-long picture by texture coordinates.
pub(super) fn look_up(image: &ImageTexture, uv: DVec2) -> DVec3 {
    bilinear(image, uv, [Wrap::Repeat, Wrap::Clamp])
}

/// Texture coordinates of a direction in a picture that is turned by `rotation` radians.
pub(super) fn place(dir: DVec3, rotation: f64) -> DVec2 {
    let d = about_y(dir.normalize(), -rotation);
    DVec2::new(0.5 + d.x.atan2(-d.z) / TAU, d.y.clamp(-1.0, 1.0).acos() / PI)
}

/// The other way round: the unit direction of texture coordinates.
pub(super) fn world_from_picture(uv: DVec2, rotation: f64) -> DVec3 {
    let ((sin_a, cos_a), (sin_b, cos_b)) = ((TAU * (uv.x - 0.5)).sin_cos(), (PI * uv.y).sin_cos());
    about_y(DVec3::new(sin_b * sin_a, cos_b, -sin_b * cos_a), rotation)
}

fn about_y(d: DVec3, angle: f64) -> DVec3 {
    let (sin, cos) = angle.sin_cos();
    DVec3::new(cos * d.x + sin * d.z, d.y, cos * d.z - sin * d.x)
}
