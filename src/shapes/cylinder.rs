//! The mantles of cylinders. Their caps are disks of the same primitive.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::disk::round_bounds;
use super::sphere::copysign;
use super::{Hidden8, Part, Ray64, Surface8, Surface64, VANISHING, nearer, roundings, unit};
use crate::lanes::{Float8, Hit8, Mask8, RayPacket, UNIT_ROUNDOFF, Vec3x8, float8};
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
    slip: Float8,  // of places along a ray of length 1
}

impl Part for CylinderPart {
    /// Base and unit axis, height and radius.
    type Rows = ([Vec3x8; 2], [Float8; 2]);
    type Face = Self::Rows;
    type Anchor = Anchor;

    fn row(&self) -> ([DVec3; 2], [f64; 2]) {
        ([self.base, self.axis], [self.height, self.radius])
    }

    #[inline(always)]
    fn bounds8(([base, axis], [height, radius]): &Self::Rows) -> (Vec3x8, Vec3x8) {
        let (low, high) = round_bounds(*base, *axis, *radius);
        let (other_low, other_high) = round_bounds(axis.mul_add(*height, *base), *axis, *radius);
        (low.min(other_low), high.max(other_high))
    }

    #[inline(always)]
    fn anchor(rows: &Self::Rows, origin: &Vec3x8) -> Anchor {
        let ([base, axis], [height, radius]) = *rows;
        let f = base - *origin;
        let error = roundings(7.0).mul_add((base.abs() + f.abs()).sum() + height, float8(VANISHING));
        let slip = roundings(13.0).mul_add(f.abs().sum(), error);
        Anchor { f, axis, height, r2: radius * radius, error, slip }
    }

    /// The sphere's test in the plane across the axis, from the ray's point nearest the base, where the
    /// numbers are as small as the cylinder: then the axial part is dropped, and added back for heights.
    ///
    /// Source: after Haines, Günther and Akenine-Möller, Ray Tracing Gems, 2019, chapter 7.
    #[inline(always)]
    fn hit<'a, const CULL: bool, const CERTIFY: bool>(
        _: &Self::Rows,
        anchor: &Anchor,
        rays: &RayPacket,
        hidden: &Hidden8,
        _: impl Fn(usize) -> Option<&'a Self>,
    ) -> Hit8 {
        let Anchor { f, axis, height, r2, error, slip } = *anchor;
        let p = f.dot(rays.dir) * rays.inv_dd;
        let q = rays.dir.mul_add(-p, f);
        let (da, qa) = (rays.dir.dot(axis), q.dot(axis));
        let (d2, q2) = (axis.mul_add(-da, rays.dir), axis.mul_add(-qa, q));
        let (qd, dd, qq) = (q2.dot(d2), d2.dot(d2), q2.dot(q2));
        let perp = d2.mul_add(-(qd / dd), q2);
        let slack = r2 - perp.dot(perp);
        let mut bound = Float8::ZERO;
        let mut across = Float8::ZERO; // error of a place across the axis
        if CERTIFY {
            // What is left of the direction across the axis is off by roundings of the whole of it, which turns it.
            let turned = roundings(8.0) * (qq / (dd * rays.inv_dd)).sqrt();
            across = error + turned + roundings(8.0) * q.abs().sum();
            let radius = r2.sqrt();
            bound = (radius + radius + across).mul_add(across, roundings(24.0) * r2);
        }
        // A ray along the axis is across it nowhere: all is open.
        let possible = !Mask8::lt(slack, -bound);
        if !possible.any() {
            return Hit8::none();
        }
        let s = (slack * dd).sqrt();
        let z = qd + copysign(s, qd);
        let (a, b) = (z / dd, (qq - r2) / z);
        let (entry, exit) = (a.fast_min(b), a.fast_max(b));
        let w = |t: Float8| t.mul_add(da, -qa);
        let within = |t: Float8| Mask8::ge(w(t), Float8::ZERO) & Mask8::le(w(t), height);
        let mut place = Float8::ZERO;
        let mut rim = Float8::ZERO;
        if CERTIFY {
            let (inv_len, size) = (rays.inv_dd.sqrt(), qq.sqrt() + r2.sqrt());
            let product = size * (across + across + roundings(6.0) * size) / z.abs();
            place = bound / s + product + (across + roundings(6.0) * size) / dd.sqrt() + slip * inv_len;
            place = a.abs().mul_add(roundings(10.0), place);
            rim = da.abs().mul_add(place, error) + roundings(16.0) * height + roundings(8.0) * q.abs().sum();
        }
        let reaches = |t: Float8| {
            let (met, open) = rays.reaches(p + t, place);
            let near_rim = Mask8::le(w(t).abs(), rim) | Mask8::le((w(t) - height).abs(), rim);
            if CERTIFY {
                ((within(t) | near_rim) & met, (open | near_rim) & (within(t) | near_rim) & met)
            } else {
                (within(t) & met, Mask8::NONE)
            }
        };
        let ((mut entry_ok, mut entry_open), (mut exit_ok, mut exit_open)) = (reaches(entry), reaches(exit));
        if CULL {
            entry_ok &= !hidden.front;
            entry_open &= !hidden.front;
            exit_ok &= !hidden.back;
            exit_open &= !hidden.back;
        }
        let t = p + entry_ok.select(entry, exit);
        let mut doubt = Mask8::NONE;
        if CERTIFY {
            let silhouette = !Mask8::gt(slack, bound) & possible;
            let half = ((bound + slack.abs()) / dd).sqrt() + place;
            let near_ray = !Mask8::le(p + qd / dd + half, rays.t_min) & !Mask8::gt(p + qd / dd - half, rays.t_max);
            // Whatever is open at one end may be the first hit, or leave the other end that.
            doubt = ((silhouette & near_ray) | entry_open | exit_open) & rays.live();
        }
        Hit8 { t, error: place, mask: (entry_ok | exit_ok) & possible & !doubt, doubt }
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let (disc, [a, b]) = roots(self, ray);
        let keep = |t: &f64| {
            let w = (*t * ray.dir - (self.base - ray.origin)).dot(self.axis);
            (0.0..=self.height).contains(&w) && ray.accepts(*t)
        };
        let entry = Some(a.min(b)).filter(keep).filter(|_| visible != Visible::Back);
        let first = entry.or_else(|| Some(a.max(b)).filter(keep).filter(|_| visible != Visible::Front));
        first.filter(|_| disc >= 0.0)
    }

    fn refine(&self, ray: &Ray64, t: f64, visible: Visible) -> Surface64 {
        let f = self.base - ray.origin;
        let (_, [a, b]) = roots(self, ray);
        let off = |t: f64| ends_missed((t * ray.dir - f).dot(self.axis), self.height);
        let t = of_mantle([a, b], off, t, visible);
        let from_base = t * ray.dir - f;
        let w = from_base.dot(self.axis);
        let normal = (from_base - self.axis * w).normalize();
        Surface64 { t, point: self.base + self.axis * w + normal * self.radius, normal }
    }

    #[inline(always)]
    fn face(rows: &Self::Rows) -> &Self::Rows {
        rows
    }

    fn surface(rows: &Self::Rows, rays: &RayPacket, t: Float8) -> Surface8 {
        let ([base, axis], [height, radius]) = *rows;
        let f = base - rays.origin;
        let p = f.dot(rays.dir) * rays.inv_dd;
        let from_base = rays.dir.mul_add(t - p, rays.dir.mul_add(p, -f));
        let w = from_base.dot(axis);
        let normal = unit(axis.mul_add(-w, from_base));
        let point = normal.mul_add(radius, axis.mul_add(w, base));
        let error = roundings(6.0) * (base.abs().sum() + height + radius);
        Surface8::sure(point, normal, error)
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

/// How far a height is beyond the ends of a mantle.
pub(super) fn ends_missed(w: f64, height: f64) -> f64 {
    (-w).max(w - height).max(0.0)
}

/// The root near `t` that was met: [`nearer`], unless one of two is that much further beyond the ends of the mantle.
pub(super) fn of_mantle([a, b]: [f64; 2], off: impl Fn(f64) -> f64, t: f64, visible: Visible) -> f64 {
    let t = nearer(a, b, t, visible);
    let other = if t == a { b } else { a };
    let close = (other - t).abs() <= 16.0 * f64::from(UNIT_ROUNDOFF) * t.abs();
    if close && off(other) < off(t) { other } else { t }
}

/// u = azimuth/2pi in the basis of the axis, v = share of the height.
pub(super) fn about_axis(from_base: DVec3, axis: DVec3, height: f64) -> DVec2 {
    let (x, y) = basis(axis);
    let azimuth = from_base.dot(y).atan2(from_base.dot(x)) / TAU;
    DVec2::new(azimuth - azimuth.floor(), from_base.dot(axis) / height)
}
