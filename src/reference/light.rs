//! What a light gives to a point.

use glam::DVec3;

use super::Ray;
use crate::scene::{Falloff, Light, Source};

/// Light that arrives at a point if nothing is in the way.
#[derive(Debug, Clone, Copy)]
pub struct Arrival {
    /// Unit, toward the light.
    pub wi: DVec3,
    /// Irradiance on a plane that faces the light.
    pub irradiance: DVec3,
    /// With which `wi` was drawn, per steradian; infinite where it is the only one.
    pub density: f64,
    /// Where the light is; `None`: infinitely far.
    pub(super) position: Option<DVec3>,
}

/// A light in coordinates relative to `origin`; area lights stay as they are, see [`super::emitter`].
pub fn relative(light: &Light, origin: DVec3) -> Light {
    let mut light = light.clone();
    match &mut light.source {
        Source::Point { position, .. } | Source::Spot { position, .. } => *position -= origin,
        Source::Directional { .. } | Source::Area { .. } => {}
    }
    light
}

/// What a source without an area gives at `point`; `None` where it gives nothing: at the light itself,
/// outside a spot's cone.
pub fn arrive(source: &Source, point: DVec3) -> Option<Arrival> {
    let density = f64::INFINITY;
    let arrival = match *source {
        Source::Point { position, intensity, falloff } => {
            let (wi, distance) = (position - point).normalize_and_length();
            let irradiance = match falloff {
                Falloff::InverseSquare => intensity / (distance * distance),
                Falloff::None => intensity,
            };
            Arrival { wi, irradiance, density, position: Some(position) }
        }
        Source::Directional { direction, irradiance } => {
            Arrival { wi: -direction.normalize(), irradiance, density, position: None }
        }
        Source::Spot { position, direction, intensity, cone, penumbra } => {
            let (wi, distance) = (position - point).normalize_and_length();
            let share = spot_share(-wi, direction, cone, penumbra);
            Arrival { wi, irradiance: share * intensity / (distance * distance), density, position: Some(position) }
        }
        Source::Area { .. } => return None,
    };
    let gives = arrival.irradiance.is_finite() && arrival.irradiance != DVec3::ZERO;
    (gives && arrival.position != Some(point)).then_some(arrival)
}

/// The share of a spot's intensity that goes out along `dir`.
fn spot_share(dir: DVec3, axis: DVec3, cone: f64, penumbra: f64) -> f64 {
    let angle = axis.cross(dir).length().atan2(axis.dot(dir)).to_degrees();
    if angle >= cone {
        return 0.0;
    }
    if angle <= cone - penumbra {
        return 1.0;
    }
    let s = (cone - angle) / penumbra;
    s * s * (3.0 - 2.0 * s)
}

impl Arrival {
    /// The ray from `origin` to the light, short of it by some roundings.
    pub fn shadow_ray(&self, origin: DVec3) -> Ray {
        let (dir, t_max) = match self.position {
            Some(position) => (position - origin, 1.0 - 4.0 * f64::EPSILON),
            None => (self.wi, f64::INFINITY),
        };
        Ray { origin, dir, t_min: 0.0, t_max }
    }
}
