//! Disks and rings: a plane with a bound on the distance from its centre. The caps of cylinders and
//! cones are disks too.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::plane::{Crossing, flat_surface, flat_surface64, height_error, shows, side_hidden};
use super::{Hidden8, Part, Ray64, Surface8, Surface64, VANISHING, roundings};
use crate::lanes::{Float8, Hit8, Mask8, RayPacket, Vec3x8, float8};
use crate::plan::{DiskPart, Owner};
use crate::scene::{Visible, basis};

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    f: Vec3x8,      // from the origin to the center
    height: Float8, // n . f
    error: Float8,  // of the height
    normal: Vec3x8,
    radius: Float8,
    inner: Float8,
    reach: Float8, // sum of the magnitudes whose rounding moves the plane and the center
}

impl Part for DiskPart {
    /// Center and unit normal, radius and inner radius.
    type Rows = ([Vec3x8; 2], [Float8; 2]);
    type Face = [Vec3x8; 2];
    type Anchor = Anchor;

    fn row(&self) -> ([DVec3; 2], [f64; 2]) {
        ([self.center, self.normal], [self.radius, self.inner])
    }

    #[inline(always)]
    fn bounds8(([center, normal], [radius, _]): &Self::Rows) -> (Vec3x8, Vec3x8) {
        round_bounds(*center, *normal, *radius)
    }

    #[inline(always)]
    fn anchor(rows: &Self::Rows, origin: &Vec3x8) -> Anchor {
        let ([center, normal], [radius, inner]) = *rows;
        let f = center - *origin;
        let reach = (center.abs() + f.abs()).sum();
        Anchor { f, height: normal.dot(f), error: height_error(normal, center, f), normal, radius, inner, reach }
    }

    /// The plane of equation (6), then (7) and (8) of the paper with the vector from the centre formed as
    /// `t dir - f`, so that nothing large cancels: Kucherov, Morgun and Golenkovskaya, 2016, section IV B.
    #[inline(always)]
    fn hit<'a, const CULL: bool, const CERTIFY: bool>(
        _: &Self::Rows,
        anchor: &Anchor,
        rays: &RayPacket,
        hidden: &Hidden8,
        _: impl Fn(usize) -> Option<&'a Self>,
    ) -> Hit8 {
        let nd = anchor.normal.dot(rays.dir);
        let length = rays.dir.abs().sum(); // no shorter than the direction
        let crossing = Crossing::new::<CERTIFY>(anchor.height, anchor.error, nd, length);
        let (mut on_ray, mut open) = crossing.on::<CERTIFY>(rays);
        if CULL {
            on_ray &= !side_hidden(nd, hidden) | open;
        }
        if !on_ray.any() {
            return Hit8::none();
        }
        let x = rays.dir.mul_add(crossing.t, -anchor.f);
        let rho2 = x.dot(x);
        let inside = Mask8::le(rho2, anchor.radius * anchor.radius) & Mask8::ge(rho2, anchor.inner * anchor.inner);
        let mut doubt = Mask8::NONE;
        if CERTIFY {
            // The error of t moves x along the ray; the rest is what center, origin and direction round by.
            let shift = crossing.error.mul_add(length, roundings(5.0).mul_add(anchor.reach, float8(VANISHING)));
            let near_rim = |r: Float8| {
                let shift = roundings(8.0).mul_add(r, shift);
                Mask8::le((rho2 - r * r).abs(), shift * (r + r + shift) * Float8::splat(1.25))
            };
            let hole = Mask8::gt(anchor.inner, Float8::ZERO);
            doubt = near_rim(anchor.radius);
            if hole.any() {
                doubt |= near_rim(anchor.inner) & hole;
            }
            doubt &= on_ray;
            // Beside the plane nothing is known; past the start it is open only what may be inside.
            open &= inside | doubt | crossing.beside;
            doubt |= open;
        }
        Hit8 { t: crossing.t, error: crossing.error, mask: ((on_ray & inside) | doubt) & !open, doubt }
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let f = self.center - ray.origin;
        let nd = self.normal.dot(ray.dir);
        let t = self.normal.dot(f) / nd;
        if !(t.is_finite() && ray.accepts(t) && shows(nd, visible)) {
            return None;
        }
        let rho = (t * ray.dir - f).length();
        let bound = 8.0 * f64::EPSILON * (f.length() * (1.0 + ray.dir.length() / nd.abs()) + self.radius);
        (rho <= self.radius + bound && rho >= self.inner - bound).then_some(t)
    }

    fn refine(&self, ray: &Ray64, _: f64, _: Visible) -> Surface64 {
        flat_surface64(self.center, self.normal, ray)
    }

    #[inline(always)]
    fn face((face, _): &Self::Rows) -> &[Vec3x8; 2] {
        face
    }

    #[inline(always)]
    fn surface([center, normal]: &Self::Face, rays: &RayPacket, t: Float8) -> Surface8 {
        flat_surface(*center, *normal, rays, t)
    }

    /// In the basis of the normal; a cap's u is its solid's, about the solid's axis.
    fn uv(&self, point: DVec3) -> DVec2 {
        let (x, y) = basis(self.normal);
        let d = point - self.center;
        let azimuth = d.dot(y).atan2(d.dot(x)) / TAU;
        DVec2::new(azimuth - azimuth.floor(), d.length() / self.radius)
    }

    /// Half extent along an axis: r sqrt(n_j^2 + n_k^2) of the other two axes.
    fn bounds(&self) -> (DVec3, DVec3) {
        let n = self.normal;
        let half = DVec3::new(n.y.hypot(n.z), n.z.hypot(n.x), n.x.hypot(n.y)) * self.radius;
        (self.center - half, self.center + half)
    }

    fn owner(&self) -> Owner {
        self.owner
    }
}

/// Bounds of eight disks: half their size along an axis is that of the normal across it.
#[inline(always)]
pub(super) fn round_bounds(center: Vec3x8, normal: Vec3x8, radius: Float8) -> (Vec3x8, Vec3x8) {
    let n2 = normal.scale(normal);
    let half = Vec3x8::new((n2.y + n2.z).sqrt(), (n2.z + n2.x).sqrt(), (n2.x + n2.y).sqrt()) * radius;
    (center - half, center + half)
}
