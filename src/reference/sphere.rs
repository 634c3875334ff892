//! Spheres.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::exact;
use super::line::{Line, Root, Roots, Surface, turns};
use super::margin::ratio;
use super::quadratic::Quadratic;
use crate::scene;

/// `|x - center| = radius`.
#[derive(Debug, Clone)]
pub struct Sphere {
    center: DVec3,
    radius: f64,
}

impl Sphere {
    pub fn new(sphere: &scene::Sphere, origin: DVec3) -> Sphere {
        Sphere { center: sphere.center - origin, radius: sphere.radius }
    }

    /// `|f - t d|^2 = r^2` with f from the ray's origin to the centre.
    pub fn roots(&self, line: &Line) -> Roots {
        let (f, f_low) = exact::difference(self.center, line.origin);
        let equation = Quadratic::new(f, f_low, line.dir, self.radius, 0.0);
        let crossings = equation.crossings();
        if !line.judged {
            let root = |t, front| Root {
                t,
                hit: true,
                front,
                part: 0,
                unit: 0.0,
                margin: f64::INFINITY,
                facing: f64::INFINITY,
            };
            return crossings.map_or([None, None], |(near, far)| [Some(root(near, true)), Some(root(far, false))]);
        }
        let judge = Judge::new(self, line, f, &equation);
        match crossings {
            Some((near, far)) => {
                let near_cancels = equation.b >= 0.0;
                let root = |t, front, cancels| {
                    let unit = judge.unit(t, cancels);
                    Some(Root { t, hit: true, front, part: 0, unit, margin: judge.margin, facing: f64::INFINITY })
                };
                [root(near, true, near_cancels), root(far, false, !near_cancels)]
            }
            None => {
                let t = equation.b / equation.a;
                let unit = judge.unit(t, false);
                [Some(Root { t, hit: false, front: true, part: 0, unit, margin: judge.margin, facing: 0.0 }), None]
            }
        }
    }

    pub fn surface(&self, line: &Line, root: &Root) -> Surface {
        let (f, f_low) = exact::difference(self.center, line.origin);
        let normal = (exact::along(root.t, line.dir, f) - f_low).normalize();
        let azimuth = turns(normal.z, normal.x);
        // The polar angle by atan2: acos loses half its digits at the poles.
        let polar = normal.x.hypot(normal.z).atan2(normal.y);
        let point = self.center + self.radius * normal;
        Surface::flat(point, normal, DVec2::new(azimuth, polar / PI), self.radius)
    }
}

/// The attainable f32 errors of one line and one sphere: NUMERICS, section 2, with its letters.
struct Judge {
    /// Half the chord, not below what the uncertain discriminant could make of it.
    h: f64,
    /// Distance along the line from the origin to the closest approach.
    b: f64,
    /// `S |f_i d_i| / |d|`.
    b_terms: f64,
    /// The error of `r^2 - l^2`, in `u`.
    d: f64,
    /// The error that storing centre and radius leaves in `f.f - r^2`.
    stored: f64,
    dir: f64,
    margin: f64,
    /// The error of one rounding.
    u: f64,
}

impl Judge {
    fn new(sphere: &Sphere, line: &Line, f: DVec3, equation: &Quadratic) -> Judge {
        let (dir, distance, r) = (line.dir.length(), f.length(), sphere.radius);
        let e = line.anchor_error(sphere.center).length();
        let stored = 2.0 * (distance * e + r * line.stored(r));
        let u = line.u;
        let (b, b_terms) = (equation.b.abs() / dir, (f * line.dir).abs().element_sum() / dir);
        let l = f.cross(line.dir).length() / dir;
        let plain = b_terms * b + equation.c.abs() + stored / u;
        let lagrange = r * r + l * (distance + e / u) + stored / (2.0 * u) * (r / distance.max(r));
        let d = plain.min(lagrange);
        let slack = equation.discriminant / equation.a;
        let h = slack.max(0.0).sqrt().max((u * d).sqrt());
        Judge { h, b, b_terms, d, stored, dir, margin: ratio(slack, u * d), u }
    }

    /// The unit of a place `t`; `cancels`: it is the one that comes from `f.f - r^2`.
    fn unit(&self, t: f64, cancels: bool) -> f64 {
        let relative = self.u * (1.0 + ratio(self.b_terms + ratio(self.d, 2.0 * self.h), self.b + self.h));
        let from_c = ratio(self.stored, (self.b + self.h) * self.dir);
        t.abs() * relative + if cancels { from_c } else { 0.0 }
    }
}
