//! Light that is sampled: from surfaces that shine and from a picture all round.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec2, DVec3};

use super::body::Body;
use super::light::Arrival;
use super::line::Line;
use super::{Ray, background};
use crate::scene::{self, Backdrop, Background, Emitter, Light, Patches, Sky, Source};

/// A light counts as nearer than a surface that is nearer by no more than this share, about the error of f32:
/// so a lamp on a ceiling is seen, whichever way both are rounded.
pub const NEARER: f64 = 1.0 / 262_144.0;

/// An area light, relative to an origin.
#[derive(Debug, Clone)]
pub struct AreaLight {
    body: Body,
    points: Points,
    pub radiance: DVec3,
    pub visible: bool,
}

/// What its points are drawn from.
#[derive(Debug, Clone)]
enum Points {
    Sphere { center: DVec3, radius: f64 },
    Disk { center: DVec3, normal: DVec3, radius: f64 },
    Polygon { patches: Patches, normal: DVec3 },
}

impl AreaLight {
    /// An area light of the scene; `None` for lights of other kinds.
    pub fn new(light: &Light, origin: DVec3) -> Option<AreaLight> {
        let Source::Area { emitter, radiance, visible } = &light.source else { return None };
        let points = match emitter {
            Emitter::Sphere { center, radius } => Points::Sphere { center: *center - origin, radius: *radius },
            Emitter::Disk { center, normal, radius } => {
                Points::Disk { center: *center - origin, normal: normal.normalize(), radius: *radius }
            }
            Emitter::Polygon(polygon) => {
                let mut moved = polygon.clone();
                moved.corners.iter_mut().for_each(|corner| *corner -= origin);
                Points::Polygon { patches: Patches::new(&moved), normal: polygon.normal() }
            }
        };
        let body = Body::new(&emitter.shape(), origin);
        Some(AreaLight { body, points, radiance: *radiance, visible: *visible })
    }

    /// What arrives at `point` from the place (u, v); `None` where that does not face it.
    pub fn arrive(&self, point: DVec3, [u, v]: [f64; 2]) -> Option<Arrival> {
        let turn = DVec2::from_angle(TAU * v);
        match &self.points {
            Points::Sphere { center, radius } => {
                let (w, distance) = (*center - point).normalize_and_length();
                let cap = cap(*radius, distance)?;
                let (e1, e2) = scene::frame(w);
                let sin2 = u * cap * (2.0 - u * cap);
                let wi = (1.0 - u * cap) * w + sin2.sqrt() * (turn.x * e1 + turn.y * e2);
                let half_chord = (radius * radius - distance * distance * sin2).max(0.0).sqrt();
                let place = point + wi * (distance * (1.0 - u * cap) - half_chord);
                let position = lifted(place, (place - center).normalize(), point);
                let density = (TAU * cap).recip();
                Some(Arrival { wi, irradiance: self.radiance / density, density, position: Some(position) })
            }
            Points::Disk { center, normal, radius } => {
                let (e1, e2) = scene::basis(*normal);
                let place = *center + radius * u.sqrt() * (turn.x * e1 + turn.y * e2);
                self.arrive_from(point, place, *normal, PI * radius * radius)
            }
            Points::Polygon { patches, normal } => self.arrive_from(point, patches.point(u, v), *normal, patches.area),
        }
    }

    fn arrive_from(&self, point: DVec3, place: DVec3, normal: DVec3, area: f64) -> Option<Arrival> {
        let (wi, distance) = (place - point).normalize_and_length();
        let density = distance * distance / (area * -normal.dot(wi));
        let faces = density > 0.0 && density.is_finite();
        let position = Some(lifted(place, normal, point));
        faces.then_some(Arrival { wi, irradiance: self.radiance / density, density, position })
    }

    /// Where a ray meets the lit side, no farther than `t_max`, and the density per steradian with which its
    /// origin draws this direction.
    pub fn meet(&self, ray: &Ray, t_max: f64) -> Option<(f64, f64)> {
        let line = Line::new(&Ray { t_max, ..*ray }, false)?;
        let roots = self.body.roots(&line);
        let root = roots.into_iter().flatten().find(|root| root.hit && root.front && line.holds(root.t))?;
        let t = root.t * line.scale;
        let way = t * ray.dir;
        let flat = |normal: DVec3, area: f64| way.length_squared() / (area * -normal.dot(way.normalize()));
        let density = match &self.points {
            Points::Sphere { center, radius } => (TAU * cap(*radius, (*center - ray.origin).length())?).recip(),
            Points::Disk { normal, radius, .. } => flat(*normal, PI * radius * radius),
            Points::Polygon { patches, normal } => flat(*normal, patches.area),
        };
        Some((t, density))
    }
}

/// 1 - cos of the half angle under which a sphere is seen; `None` from within.
fn cap(radius: f64, distance: f64) -> Option<f64> {
    let sin = radius / distance;
    (sin < 1.0).then(|| sin * sin / (1.0 + ((1.0 - sin) * (1.0 + sin)).sqrt()))
}

/// A point of a light a little off its surface, by some roundings of what it was computed from: what stands
/// there with the light does not shade it.
fn lifted(place: DVec3, normal: DVec3, from: DVec3) -> DVec3 {
    let size = place.abs().max_element() + (place - from).abs().max_element();
    place + normal * (64.0 * f64::EPSILON * size)
}

/// What arrives from the sky at (u, v).
pub fn arrive_from_sky(sky: &Sky, background: &Background, [u, v]: [f64; 2]) -> Option<Arrival> {
    let uv = sky.sample(u, v);
    let Backdrop::Image { rotation, .. } = &background.backdrop else { return None };
    let (azimuth, polar) = (TAU * (uv.x - 0.5), PI * uv.y);
    let look = DVec3::new(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos());
    let wi = DMat3::from_rotation_y(rotation.to_radians()) * look;
    let density = sky.density(uv);
    let irradiance = background::radiance(&background.backdrop, wi) / density;
    (irradiance != DVec3::ZERO).then_some(Arrival { wi, irradiance, density, position: None })
}

/// The density with which the sky draws a direction, per steradian.
pub fn sky_density(sky: &Sky, background: &Background, dir: DVec3) -> f64 {
    match &background.backdrop {
        Backdrop::Image { rotation, .. } => sky.density(background::place(dir, *rotation)),
        Backdrop::Color(_) | Backdrop::Gradient { .. } => 0.0,
    }
}
