//! What a ray sees that meets nothing.

use glam::DVec3;

use super::{ImageTexture, Sky};

/// The background of a scene.
#[derive(Debug, Clone)]
pub struct Background {
    /// What it shows.
    pub backdrop: Backdrop,
    /// A camera ray that misses has alpha 0 and adds nothing; secondary rays still see the backdrop.
    pub transparent: bool,
    /// Whether a picture is a light too, in the direct integrator and for the paths' sampling of lights; without
    /// it surfaces that scatter light get none from it.
    pub light: bool,
}

/// Radiance by direction, linear Rec. 709.
#[derive(Debug, Clone)]
pub enum Backdrop {
    /// The same everywhere.
    Color(DVec3),
    /// From `bottom` to `top`, linear in `(y/|d| + 1)/2` of the ray's direction `d`.
    Gradient {
        /// Radiance straight up.
        top: DVec3,
        /// Radiance straight down.
        bottom: DVec3,
    },
    /// A lat-long picture: u = 1/2 + atan2(x, -z)/2pi, v = acos(y)/pi of the unit direction, turned by
    /// `-rotation` about y first; v = 0 is the top row; looked up bilinearly, u wraps, v clamps.
    Image {
        /// The picture; its `wrap` and `filter` are not used.
        image: Box<ImageTexture>,
        /// Factor on its values, >= 0.
        scale: f64,
        /// Degrees, turns the picture about +y.
        rotation: f64,
    },
}

impl Default for Background {
    fn default() -> Self {
        Background { backdrop: Backdrop::default(), transparent: false, light: true }
    }
}

impl Background {
    /// The picture as a light, where it is one.
    pub fn sky(&self) -> Option<Sky> {
        match &self.backdrop {
            Backdrop::Image { image, .. } if self.light => Sky::new(image),
            Backdrop::Image { .. } | Backdrop::Color(_) | Backdrop::Gradient { .. } => None,
        }
    }
}

impl Default for Backdrop {
    fn default() -> Self {
        Backdrop::Color(DVec3::ZERO)
    }
}
