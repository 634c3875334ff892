//! The mantles of cylinders. Their caps are disks of the same primitive.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::sphere::copysign;
use super::{Hidden8, Part, Ray64, Surface8, Surface64, nearer, roundings};
use crate::lanes::{Float8, Hit8, Mask8, RayPacket, Vec3x8, float8};
use crate::plan::{CylinderPart, Owner};
use crate::scene::{Visible, basis};

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    f: Vec3x8, // from the origin to the base
    axis: Vec3x8,
    height: Float8,
    r2: Float8,
    error: Float8, // of f, the rounding of the scene included
    bound: Float8, // of the slack below
}

impl Part for CylinderPart {
    /// Base and unit axis, height and radius.
    type Rows = ([Vec3x8; 2], [Float8; 2]);
    type Anchor = Anchor;

    fn row(&self) -> ([DVec3; 2], [f64; 2]) {
        ([self.base, self.axis], [self.height, self.radius])
    }

    #[inline(always)]
    fn anchor<'a>(rows: &Self::Rows, origin: &Vec3x8, _: impl Fn(usize) -> Option<&'a Self>) -> Anchor {
        let ([base, axis], [height, radius]) = *rows;
        let f = base - *origin;
        let error = roundings(6.0) * ((base.abs() + f.abs()).sum() + height);
        let r2 = radius * radius;
        let bound = (radius + radius).mul_add(error, error * error) + roundings(24.0) * r2;
        Anchor { f, axis, height, r2, error, bound }
    }

    /// The sphere's test in the plane across the axis, from the ray's point nearest the base, where the
    /// numbers are as small as the cylinder: then the axial part is dropped, and added back for heights.
    ///
    /// Source: after Haines, Günther and Akenine-Möller, Ray Tracing Gems, 2019, chapter 7.
    #[inline(always)]
    fn hit<const CULL: bool>(anchor: &Anchor, rays: &RayPacket, hidden: &Hidden8) -> Hit8 {
        let Anchor { f, axis, height, r2, error, bound } = *anchor;
        let p = f.dot(rays.dir) * rays.inv_dd;
        let q = rays.dir.mul_add(-p, f);
        let (da, qa) = (rays.dir.dot(axis), q.dot(axis));
        let (d2, q2) = (axis.mul_add(-da, rays.dir), axis.mul_add(-qa, q));
        let (qd, dd) = (q2.dot(d2), d2.dot(d2));
        let perp = d2.mul_add(-(qd / dd), q2);
        let slack = r2 - perp.dot(perp);
        if !Mask8::ge(slack, -bound).any() {
            return Hit8::none();
        }
        let s = (slack * dd).sqrt();
        let z = qd + copysign(s, qd);
        let (a, b) = (z / dd, (q2.dot(q2) - r2) / z);
        let (entry, exit) = (a.fast_min(b), a.fast_max(b));
        let within = |t: Float8| {
            let w = t.mul_add(da, -qa);
            Mask8::ge(w, Float8::ZERO) & Mask8::le(w, height)
        };
        // Within this of its ends a mantle may or may not be met.
        let rim = error + roundings(16.0) * height + (da.abs() * bound) / s.fast_max(float8(f32::MIN_POSITIVE));
        let at_rim = |t: Float8| {
            let w = t.mul_add(da, -qa);
            rays.accepts(p + t) & (Mask8::le(w.abs(), rim) | Mask8::le((w - height).abs(), rim))
        };
        let middle = qd / dd;
        let silhouette = Mask8::le(slack.abs(), bound) & Mask8::gt(p + middle + (bound / dd).sqrt(), rays.t_min);
        let doubt = silhouette | at_rim(entry) | at_rim(exit);
        let mut entry_ok = rays.accepts(p + entry) & within(entry);
        let mut exit_ok = rays.accepts(p + exit) & within(exit);
        if CULL {
            entry_ok &= !hidden.front;
            exit_ok &= !hidden.back;
        }
        Hit8 { t: entry_ok.select(p + entry, p + exit), mask: (entry_ok | exit_ok) & !doubt, doubt }
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let (disc, [a, b]) = roots(self, ray);
        let keep = |t: &f64| {
            let w = (ray.at(*t) - self.base).dot(self.axis);
            (0.0..=self.height).contains(&w) && ray.accepts(*t)
        };
        let entry = Some(a.min(b)).filter(keep).filter(|_| visible != Visible::Back);
        let first = entry.or_else(|| Some(a.max(b)).filter(keep).filter(|_| visible != Visible::Front));
        first.filter(|_| disc >= 0.0)
    }

    fn refine(&self, ray: &Ray64, t: f64) -> Surface64 {
        let (_, [a, b]) = roots(self, ray);
        let t = nearer(a, b, t);
        let from_base = ray.at(t) - self.base;
        let w = from_base.dot(self.axis);
        let normal = (from_base - self.axis * w).normalize();
        Surface64 { t, point: self.base + self.axis * w + normal * self.radius, normal }
    }

    fn surface(rows: &Self::Rows, rays: &RayPacket, t: Float8) -> Surface8 {
        let ([base, axis], [height, radius]) = *rows;
        let f = base - rays.origin;
        let p = f.dot(rays.dir) * rays.inv_dd;
        let from_base = rays.dir.mul_add(t - p, rays.dir.mul_add(p, -f));
        let w = from_base.dot(axis);
        let normal = axis.mul_add(-w, from_base).normalize();
        let point = normal.mul_add(radius, axis.mul_add(w, base));
        let error = roundings(6.0) * (base.abs().sum() + height + radius);
        Surface8 { point, normal, error }
    }

    fn uv(&self, point: DVec3) -> DVec2 {
        about_axis(point - self.base, self.axis, self.height)
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        let a = self.axis;
        let half = DVec3::new(a.y.hypot(a.z), a.z.hypot(a.x), a.x.hypot(a.y)) * self.radius;
        let apex = self.base + a * self.height;
        (self.base.min(apex) - half, self.base.max(apex) + half)
    }

    fn owner(&self) -> Owner {
        self.owner
    }
}

/// The sphere's quadratic across the axis: its discriminant, and both roots (of a tangent where it is
/// negative).
fn roots(part: &CylinderPart, ray: &Ray64) -> (f64, [f64; 2]) {
    let across = |v: DVec3| v - part.axis * v.dot(part.axis);
    let (f, d) = (across(part.base - ray.origin), across(ray.dir));
    let (fd, dd) = (f.dot(d), d.length_squared());
    let disc = part.radius * part.radius * dd - f.cross(d).length_squared();
    let z = fd + disc.max(0.0).sqrt().copysign(fd);
    (disc, [z / dd, (f.length() - part.radius) * (f.length() + part.radius) / z])
}

/// u = azimuth/2pi in the basis of the axis, v = share of the height.
pub(super) fn about_axis(from_base: DVec3, axis: DVec3, height: f64) -> DVec2 {
    let (x, y) = basis(axis);
    let azimuth = from_base.dot(y).atan2(from_base.dot(x)) / TAU;
    DVec2::new(azimuth - azimuth.floor(), from_base.dot(axis) / height)
}
