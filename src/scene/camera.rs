//! Cameras: where the picture is taken from.

use glam::{DQuat, DVec3};

/// A camera looks from `eye` to `target`. Its view axis is `forward = unit(target - eye)`, its image
/// axes are `right = unit(forward x up)` and `true_up = right x forward`.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// What `--camera` calls it; `None` for a lone `[camera]`.
    pub name: Option<String>,
    /// World coordinates.
    pub eye: DVec3,
    /// World coordinates, differs from `eye`.
    pub target: DVec3,
    /// Not parallel to the view.
    pub up: DVec3,
    /// How a point of the picture becomes a ray.
    pub lens: Lens,
}

/// With (x, y) a point of the picture in pixels (x right, y down, the outer corner of the first pixel
/// at 0, 0), W x H its size, sx = (2x - W)/H and sy = (H - 2y)/H:
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lens {
    /// origin `eye`, direction `forward + tan(vfov/2) (sx right + sy true_up)`.
    /// The angle, in degrees, spans the outer edges of the top and bottom pixels.
    Pinhole {
        /// Degrees, 0 < vfov < 180.
        vfov: f64,
    },
    /// origin `eye + height/2 (sx right + sy true_up)`, direction `forward`.
    Orthographic {
        /// Scene units from the lower to the upper edge of the picture, > 0.
        height: f64,
    },
    /// As a pinhole, but the ray through (x, y) starts at `lens = eye + aperture (r cos a right + r sin a true_up)`
    /// and goes to where the pinhole's ray meets the plane at `focus`: with (u, v) of the sample's pair
    /// [`dimension::LENS`](crate::sample::dimension::LENS), `r = sqrt(u)` and `a = 2 pi v`.
    ThinLens {
        /// Degrees, 0 < vfov < 180.
        vfov: f64,
        /// Radius of the lens, scene units, > 0.
        aperture: f64,
        /// Distance of the plane that is sharp, along the view axis, scene units, > 0.
        focus: f64,
    },
    /// Everything round the eye, lat-long: origin `eye`, direction
    /// `sin b (sin a right + cos a forward) + cos b true_up` with `a = 2 pi (x/W - 1/2)` and `b = pi y/H`.
    Panoramic,
}

impl Camera {
    /// The eye after a turn of so many degrees about `up` through the target, counter-clockwise seen from above.
    pub fn orbited(&self, degrees: f64) -> DVec3 {
        let angle = degrees.rem_euclid(360.0).to_radians();
        let turn = DQuat::from_axis_angle(self.up.normalize(), angle);
        if angle == 0.0 { self.eye } else { self.target + turn * (self.eye - self.target) }
    }

    /// What depth is counted along; none for a panorama, where it is the distance from the eye.
    pub fn view_axis(&self) -> Option<DVec3> {
        match self.lens {
            Lens::Pinhole { .. } | Lens::Orthographic { .. } | Lens::ThinLens { .. } => Some(self.axes().2),
            Lens::Panoramic => None,
        }
    }

    /// `(right, true_up, forward)`, each of unit length.
    pub fn axes(&self) -> (DVec3, DVec3, DVec3) {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        (right, right.cross(forward), forward)
    }
}
