//! What a ray sees that meets nothing.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec2, DVec3};

use super::texture::bilinear;
use crate::scene::{Backdrop, Wrap};

/// The radiance that comes from where `dir` points to.
pub fn radiance(backdrop: &Backdrop, dir: DVec3) -> DVec3 {
    match backdrop {
        Backdrop::Color(color) => *color,
        Backdrop::Gradient { top, bottom } => bottom.lerp(*top, 0.5 * (dir.normalize().y + 1.0)),
        Backdrop::Image { image, scale, rotation } => {
            *scale * bilinear(image, [Wrap::Repeat, Wrap::Clamp], place(dir, *rotation))
        }
    }
}

/// Texture coordinates of a direction in a picture that is turned by so many degrees.
pub fn place(dir: DVec3, rotation: f64) -> DVec2 {
    let d = DMat3::from_rotation_y(-rotation.to_radians()) * dir.normalize();
    let polar = d.x.hypot(d.z).atan2(d.y);
    DVec2::new(0.5 + d.x.atan2(-d.z) / TAU, polar / PI)
}

/// Whether it is a picture, which lights surfaces or does not.
pub fn is_picture(backdrop: &Backdrop) -> bool {
    matches!(backdrop, Backdrop::Image { .. })
}
