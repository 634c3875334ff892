//! What a ray sees that meets nothing.

use glam::DVec3;

use super::ImageTexture;

/// The background of a scene.
#[derive(Debug, Clone, Default)]
pub struct Background {
    /// What it shows.
    pub backdrop: Backdrop,
    /// A camera ray that misses has alpha 0 and adds nothing; secondary rays still see the backdrop.
    pub transparent: bool,
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

impl Default for Backdrop {
    fn default() -> Self {
        Backdrop::Color(DVec3::ZERO)
    }
}
