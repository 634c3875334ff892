//! How directions and light change at a surface: the formulas of [`scene::Model`](crate::scene::Model).

use std::f64::consts::PI;

use glam::DVec3;

use crate::scene::Model;

/// The side of a surface that a viewer sees.
#[derive(Debug, Clone, Copy)]
pub struct Side {
    /// Unit shading normal, toward the viewer's side of the surface.
    pub n: DVec3,
    /// Unit geometric normal, toward the viewer.
    pub n_g: DVec3,
    /// The ray that arrived; of any length.
    pub dir: DVec3,
}

/// How a ray goes on into a body.
#[derive(Debug, Clone, Copy)]
pub struct Refraction {
    /// Unit.
    pub dir: DVec3,
    /// Fresnel's share of what is reflected instead, unpolarised.
    pub reflected: f64,
}

impl Side {
    /// The mirror direction, as long as the one that arrived.
    pub fn reflection(&self) -> DVec3 {
        let Side { n, n_g, dir } = *self;
        let r = dir - 2.0 * dir.dot(n) * n;
        let height = r.dot(n_g);
        if height > 0.0 { r } else { r - height * n_g + 1e-3 * dir.length() * n_g }
    }

    /// Snell's law with `ratio` = index on this side over index on the other; `None`: total reflection.
    ///
    /// An interpolated normal may turn away from the viewer; the law takes its other end then.
    pub fn refraction(&self, ratio: f64) -> Option<Refraction> {
        let dir = self.dir.normalize();
        let n = if dir.dot(self.n) > 0.0 { -self.n } else { self.n };
        let cos_in = -dir.dot(n);
        let sin_out = ratio * dir.cross(n).length();
        if sin_out >= 1.0 {
            return None;
        }
        let cos_out = ((1.0 - sin_out) * (1.0 + sin_out)).sqrt();
        let across = (ratio * cos_in - cos_out) / (ratio * cos_in + cos_out);
        let parallel = (cos_in - ratio * cos_out) / (cos_in + ratio * cos_out);
        let dir = ratio * dir + (ratio * cos_in - cos_out) * n;
        Some(Refraction { dir, reflected: 0.5 * (across * across + parallel * parallel) })
    }

    /// Whether light from `wi` falls on this side, by both normals.
    pub fn faces(&self, wi: DVec3) -> bool {
        self.n.dot(wi) > 0.0 && self.n_g.dot(wi) > 0.0
    }

    /// Radiance toward the viewer per irradiance from `wi`, for a side that faces it; `color` is the
    /// material's paint here.
    /// `diffuse` is a factor on what is scattered evenly.
    pub fn scatter(&self, model: &Model, color: DVec3, wi: DVec3, diffuse: f64) -> DVec3 {
        let cosine = diffuse * self.n.dot(wi) * self.terminator(wi);
        match *model {
            Model::Diffuse { .. } => color * (cosine / PI),
            Model::Phong { kd, ks, shine, .. } => {
                let r = 2.0 * self.n.dot(wi) * self.n - wi;
                let highlight = r.dot(-self.dir.normalize()).max(0.0).powf(shine);
                (kd * cosine * color + ks * highlight) / PI
            }
            Model::Mirror { .. } | Model::Dielectric { .. } => DVec3::ZERO,
        }
    }

    /// The factor on the light's cosine that softens the terminator of interpolated normals: 1 where
    /// both normals are the same.
    pub fn terminator(&self, wi: DVec3) -> f64 {
        if self.n == self.n_g {
            return 1.0;
        }
        let x = (self.n_g.dot(wi) / (self.n.dot(wi) * self.n.dot(self.n_g))).clamp(0.0, 1.0);
        x * (1.0 + x * (1.0 - x))
    }
}

/// The share of ambient light that a material throws back.
pub fn albedo(model: &Model, color: DVec3) -> DVec3 {
    match *model {
        Model::Diffuse { .. } => color,
        Model::Phong { kd, .. } => kd * color,
        Model::Mirror { .. } | Model::Dielectric { .. } => DVec3::ZERO,
    }
}

/// The share of light that comes back, by channel: what the albedo layer holds.
pub fn reflectance(model: &Model, color: DVec3) -> DVec3 {
    let all = match *model {
        Model::Diffuse { .. } | Model::Mirror { .. } | Model::Dielectric { .. } => color,
        Model::Phong { kd, ks, .. } => kd * color + DVec3::splat(ks),
    };
    all.clamp(DVec3::ZERO, DVec3::ONE)
}

/// What becomes of the radiance along the two rays that go on from a hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Onward {
    /// Factor on the reflected radiance; `None`: no such ray.
    pub reflected: Option<DVec3>,
    /// Factor on the refracted radiance and its direction.
    pub refracted: Option<(DVec3, DVec3)>,
}

/// The rays that go on from a hit of the front or the back.
pub fn onward(model: &Model, color: DVec3, side: &Side, front: bool) -> Onward {
    let refraction = |ior: f64| side.refraction(if front { 1.0 / ior } else { ior });
    match *model {
        Model::Diffuse { .. } => Onward { reflected: None, refracted: None },
        Model::Mirror { .. } => Onward { reflected: Some(color), refracted: None },
        Model::Dielectric { ior, .. } => match refraction(ior) {
            None => Onward { reflected: Some(DVec3::ONE), refracted: None },
            Some(Refraction { dir, reflected }) => {
                Onward { reflected: Some(DVec3::splat(reflected)), refracted: Some(((1.0 - reflected) * color, dir)) }
            }
        },
        Model::Phong { ks, transmittance, ior, .. } if transmittance > 0.0 => {
            match refraction(if ior == 0.0 { 1.0 } else { ior }) {
                None => Onward { reflected: Some(DVec3::splat(ks + transmittance)), refracted: None },
                Some(Refraction { dir, .. }) => {
                    Onward { reflected: Some(DVec3::splat(ks)), refracted: Some((DVec3::splat(transmittance), dir)) }
                }
            }
        }
        Model::Phong { ks, .. } => Onward { reflected: (ks > 0.0).then_some(DVec3::splat(ks)), refracted: None },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Paint;

    const GLASS: Model = Model::Dielectric { ior: 1.5, tint: Paint::Color(DVec3::ONE) };

    /// A ray that comes down on the plane y = 0 at `angle` from the vertical.
    fn side(angle: f64) -> Side {
        let dir = 3.0 * DVec3::new(angle.sin(), -angle.cos(), 0.0);
        Side { n: DVec3::Y, n_g: DVec3::Y, dir }
    }

    #[test]
    fn refraction_keeps_snells_law() {
        for degrees in 0..90 {
            let angle = f64::from(degrees).to_radians();
            let Some(Refraction { dir, .. }) = side(angle).refraction(1.0 / 1.5) else { panic!("total at {degrees}") };
            assert!((dir.length() - 1.0).abs() < 1e-15);
            assert!((1.5 * dir.x - angle.sin()).abs() < 1e-15 && dir.y < 0.0 && dir.z == 0.0, "{degrees}: {dir}");
        }
    }

    #[test]
    fn total_reflection_begins_at_the_critical_angle() {
        let critical = (1.0f64 / 1.5).asin();
        assert!(side(critical - 1e-9).refraction(1.5).is_some());
        assert!(side(critical + 1e-9).refraction(1.5).is_none());
        let onward = onward(&GLASS, DVec3::splat(0.5), &side(critical + 0.1), false);
        assert_eq!(onward, Onward { reflected: Some(DVec3::ONE), refracted: None });
        let phong = |ks, transmittance| {
            let color = Paint::Color(DVec3::ONE);
            Model::Phong { color, kd: 0.0, ks, shine: 1.0, transmittance, ior: 1.5 }
        };
        let total = super::onward(&phong(0.25, 0.5), DVec3::ONE, &side(critical + 0.1), false);
        assert_eq!(total, Onward { reflected: Some(DVec3::splat(0.75)), refracted: None });
        let none = super::onward(&phong(0.0, 0.0), DVec3::ONE, &side(0.3), true);
        assert_eq!(none, Onward { reflected: None, refracted: None });
        let both = super::onward(&phong(0.0, 0.5), DVec3::ONE, &side(0.3), true);
        assert!(both.reflected == Some(DVec3::ZERO) && both.refracted.is_some());
    }

    #[test]
    fn fresnel_at_normal_incidence() {
        for n in [1.0, 1.33, 1.5, 2.4] {
            let expected: f64 = (n - 1.0) / (n + 1.0);
            for ratio in [n, 1.0 / n] {
                let found = side(0.0).refraction(ratio).map(|refraction| refraction.reflected);
                assert!(found.is_some_and(|found| (found - expected * expected).abs() < 1e-15), "{n}: {found:?}");
            }
        }
    }

    /// Both ways through the same surface the same share is reflected; at Brewster's angle the
    /// polarisation in the plane of incidence is not reflected at all.
    #[test]
    fn fresnel_is_reciprocal_and_knows_brewster() {
        for degrees in 1..89 {
            let angle = f64::from(degrees).to_radians();
            let into = side(angle).refraction(1.0 / 1.5).unwrap();
            let out = side(into.dir.x.asin()).refraction(1.5).unwrap();
            assert!((into.reflected - out.reflected).abs() < 1e-12, "{degrees}");
        }
        let brewster = 1.5f64.atan();
        let expected = 0.5 * ((1.0 - 2.25) / (1.0 + 2.25f64)).powi(2);
        assert!((side(brewster).refraction(1.0 / 1.5).unwrap().reflected - expected).abs() < 1e-15);
    }

    #[test]
    fn glass_neither_makes_nor_loses_light() {
        for degrees in 0..90 {
            let onward = onward(&GLASS, DVec3::ONE, &side(f64::from(degrees).to_radians()), true);
            let (Some(reflected), Some((refracted, _))) = (onward.reflected, onward.refracted) else { panic!() };
            assert!((reflected + refracted - DVec3::ONE).length() < 1e-15);
            assert!(reflected.min_element() >= 0.0 && refracted.min_element() >= 0.0);
        }
    }

    #[test]
    fn reflections_stay_above_the_surface() {
        let n = DVec3::new(-0.6, 0.8, 0.0);
        let bent = Side { n, n_g: DVec3::Y, dir: DVec3::new(1.0, -0.1, 0.0) };
        let plain = bent.dir - 2.0 * bent.dir.dot(n) * n;
        assert!(plain.y > 0.0 && (bent.reflection() - plain).length() == 0.0);
        let low = Side { n: -DVec3::new(-0.6, 0.1, 0.0).normalize(), n_g: DVec3::Y, dir: DVec3::new(-1.0, -0.1, 0.0) };
        let steep = Side { n, n_g: DVec3::Y, dir: DVec3::new(-1.0, -0.1, 0.0) };
        for side in [low, steep] {
            assert!(side.reflection().y >= 1e-3 * side.dir.length() * (1.0 - 1e-12), "{side:?}");
        }
    }
}
