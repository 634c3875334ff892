//! Spheres.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::{Hidden8, Part, Ray64, Surface8, Surface64, Surface64x8, VANISHED, nearer, roundings, unit};
use crate::lanes::{
    DVec3x8, ExactPacket, Float8, Hit8, LANES, Mask8, RayPacket, Vec3x8, difference_of_products, float8,
};
use crate::plan::{Owner, SpherePart};
use crate::scene::Visible;

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    f: Vec3x8,     // from the origin to the center
    r2: Float8,    // radius squared
    c: Float8,     // |f|^2 - r^2, of no use where that cancels
    near: Mask8,   // origins whose distance from the surface is small beside the radius
    bound: Float8, // error of the slack below, the rounding of the scene to f32 included
    slip: Float8,  // of places along a ray of length 1, likewise
}

impl Part for SpherePart {
    /// Center and radius.
    type Rows = (Vec3x8, Float8);
    type Face = Self::Rows;
    type Anchor = Anchor;

    fn row(&self) -> (DVec3, f64) {
        (self.center, self.radius)
    }

    #[inline(always)]
    fn bounds8((center, radius): &Self::Rows) -> (Vec3x8, Vec3x8) {
        let half = Vec3x8::new(*radius, *radius, *radius);
        (*center - half, *center + half)
    }

    #[inline(always)]
    fn anchor(rows: &Self::Rows, origin: &Vec3x8) -> Anchor {
        let (center, radius) = *rows;
        let f = center - *origin;
        let (ff, r2) = (f.dot(f), radius * radius);
        let c = ff - r2;
        // The center rounds with the scene, the origin with the camera by no more than both others do, f with the
        // subtraction, and the direction moves the ray by a rounding of f beside the center; 1-norms stand for lengths.
        let (from, to) = (center.abs().sum(), f.abs().sum());
        let reach = from + to;
        let far = roundings(6.0) * reach;
        let bound = roundings(24.0) * r2 + roundings(6.5) * radius * reach + far.mul_add(far, float8(VANISHED));
        // 14 of it for the closest approach; the nearer root takes as many again from c over z.
        let slip = roundings(28.0).mul_add(to, roundings(10.0) * from);
        Anchor { f, r2, c, near: Mask8::lt(c.abs(), r2), bound, slip }
    }

    /// Shapes: eight lanes throughout. Units: `t` counts lengths of `dir`, which need not be 1.
    ///
    /// Source: Haines, Günther and Akenine-Möller, "Precision improvements for ray/sphere
    /// intersection", Ray Tracing Gems, 2019, chapter 7: the distance from the line to the centre is
    /// measured before it is squared, so that nothing cancels far away, and the second root comes
    /// from the product of both. Close to a surface that is large beside the distance, that distance
    /// says only who passes by for certain; for the others the discriminant is formed from compensated
    /// products instead.
    #[inline(always)]
    fn hit<'a, const CULL: bool, const CERTIFY: bool>(
        _: &Self::Rows,
        anchor: &Anchor,
        rays: &RayPacket,
        hidden: &Hidden8,
        part: impl Fn(usize) -> Option<&'a Self>,
    ) -> Hit8 {
        let Anchor { f, r2, mut c, near, bound, slip } = *anchor;
        let fd = f.dot(rays.dir);
        let p = fd * rays.inv_dd;
        let perp = rays.dir.mul_add(-p, f); // from the closest approach to the center
        let mut slack = r2 - perp.dot(perp); // < 0 outside the silhouette, 0 when touching
        // Where squares overflow there is no slack, and all is open.
        let mut possible = !Mask8::lt(slack, -bound);
        if !possible.any() {
            return Hit8::none();
        }
        let mut close = near & possible;
        let bound = if CERTIFY { bound } else { Float8::ZERO };
        if close.any() {
            // Rays that begin outside and go away from the center, as those do that have left this very sphere.
            let slip = roundings(10.0) * (rays.origin.abs() + f.abs()).sum() * rays.dir.abs().sum();
            let away = Mask8::gt(c, bound) & Mask8::lt(fd, -slip) & Mask8::ge(rays.t_min, Float8::ZERO);
            let away = close & away;
            (possible, close) = (possible & !away, close & !away);
            slack = away.select(float8(f32::NEG_INFINITY), slack);
        }
        if close.any() {
            c = near_products(close, c, &rays.origin, part);
            let dd = rays.dir.dot(rays.dir);
            slack = close.select(difference_of_products(fd, fd, dd, c) * rays.inv_dd, slack);
        }
        if close.any() || !CERTIFY {
            possible = if CERTIFY { !Mask8::lt(slack, -bound) } else { Mask8::ge(slack, Float8::ZERO) };
        }
        let dd = rays.dir.dot(rays.dir);
        let s = (slack * dd).sqrt(); // NaN outside, and NaN fails every comparison
        let z = fd + copysign(s, fd);
        let (a, b) = (z * rays.inv_dd, c / z);
        let (entry, exit) = (a.fast_min(b), a.fast_max(b));
        let (mut entry_error, mut exit_error) = (Float8::ZERO, Float8::ZERO);
        let mut edge = Float8::ZERO;
        if CERTIFY {
            edge = slip * rays.inv_dd.sqrt();
            let error = a.abs().mul_add(roundings(8.0), bound / s + edge);
            (entry_error, exit_error) = (error, error);
            if close.any() {
                // Here c is as good as its own rounding, and so is the smaller root, whose sign is certain.
                let lift = roundings(2.0) * f.abs().sum() * rays.origin.abs().sum();
                let small = b.abs() * (error / a.abs() + roundings(4.0)) + lift / z.abs();
                let small = close.select(small.fast_min(error), error);
                let first = Mask8::lt(a, b);
                (entry_error, exit_error) = (first.select(error, small), first.select(small, error));
            }
        }
        let (mut entry_ok, mut entry_open) = rays.reaches(entry, entry_error);
        let (mut exit_ok, exit_open) = rays.reaches(exit, exit_error);
        if CULL {
            entry_ok &= !hidden.front;
            entry_open &= !hidden.front;
            exit_ok &= !hidden.back;
        }
        let (t, error) = (entry_ok.select(entry, exit), entry_ok.select(entry_error, exit_error));
        let mask = entry_ok | exit_ok;
        if !CERTIFY {
            return Hit8 { t, error, mask, doubt: Mask8::NONE };
        }
        let mut doubt = entry_open | (exit_ok & !entry_ok & exit_open);
        let silhouette = possible & !Mask8::gt(slack, bound);
        if silhouette.any() {
            // No root lies further from p.
            let half = ((slack.abs() + bound) * rays.inv_dd).sqrt() + edge;
            let near_ray = !Mask8::le(p + half, rays.t_min) & !Mask8::gt(p - half, rays.t_max) & rays.live();
            doubt = (doubt & !silhouette) | (silhouette & near_ray);
        }
        Hit8 { t, error, mask: mask & !doubt & !silhouette, doubt }
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let f = self.center - ray.origin;
        let (disc, [a, b]) = roots(self, ray);
        let reach = self.radius * (self.radius + f.length());
        let bound = 8.0 * f64::EPSILON * ray.dir.length_squared() * reach;
        (disc >= -bound).then(|| ray.first(a.min(b), a.max(b), visible)).flatten()
    }

    fn refine(&self, ray: &Ray64, t: f64, visible: Visible) -> Surface64 {
        let (_, [a, b]) = roots(self, ray);
        let t = nearer(a, b, t, visible);
        let normal = (t * ray.dir - (self.center - ray.origin)).normalize();
        Surface64 { t, point: self.center + normal * self.radius, normal }
    }

    /// The formulas of `roots` and `refine`, operation by operation.
    fn refine8(parts: &[Option<(&Self, Visible)>; LANES], rays: &ExactPacket, t: &[f32; LANES]) -> Surface64x8 {
        let (mut center, mut radius, mut visible) = (DVec3x8::default(), [1.0; LANES], [Visible::Both; LANES]);
        for (lane, part) in parts.iter().enumerate() {
            let Some((part, side)) = part else { continue };
            (0..3).for_each(|k| center[k][lane] = part.center[k]);
            (radius[lane], visible[lane]) = (part.radius, *side);
        }
        let mut found = Surface64x8::default();
        for i in 0..LANES {
            let f: [f64; 3] = std::array::from_fn(|k| center[k][i] - rays.origin[k][i]);
            let d: [f64; 3] = std::array::from_fn(|k| rays.dir[k][i]);
            let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let across: [f64; 3] = std::array::from_fn(|k| {
                let (k, l) = ((k + 1) % 3, (k + 2) % 3);
                f[k] * d[l] - d[k] * f[l]
            });
            let (fd, dd, r) = (dot(&f, &d), dot(&d, &d), radius[i]);
            let disc = r * r * dd - dot(&across, &across);
            let z = fd + disc.max(0.0).sqrt().copysign(fd);
            let distance = dot(&f, &f).sqrt();
            let (a, b) = (z / dd, (distance - r) * (distance + r) / z);
            let t = nearer(a, b, f64::from(t[i]), visible[i]);
            let n: [f64; 3] = std::array::from_fn(|k| t * d[k] - f[k]);
            let scale = 1.0 / dot(&n, &n).sqrt();
            for k in 0..3 {
                found.normal[k][i] = n[k] * scale;
                found.point[k][i] = center[k][i] + n[k] * scale * r;
            }
        }
        found
    }

    #[inline(always)]
    fn face(rows: &Self::Rows) -> &Self::Rows {
        rows
    }

    /// From the decomposition that the kernel uses, never from (origin + t dir) - center.
    #[inline(always)]
    fn surface(rows: &Self::Rows, rays: &RayPacket, t: Float8) -> Surface8 {
        let (center, radius) = *rows;
        let f = center - rays.origin;
        let p = f.dot(rays.dir) * rays.inv_dd;
        let perp = rays.dir.mul_add(-p, f);
        let normal = unit(rays.dir.mul_add(t - p, -perp));
        let by_center = roundings(6.0) * (center.abs().sum() + radius);
        let way = (rays.dir * t).abs().sum();
        let by_ray = roundings(6.0) * (rays.origin.abs().sum() + way + way);
        // A sphere that is large beside the ray has a center too far away to start from.
        let along = Mask8::lt(by_ray, by_center);
        let point = normal.mul_add(radius, center);
        let point = Vec3x8::select(along, rays.dir.mul_add(t, rays.origin), point);
        Surface8::sure(point, normal, along.select(by_ray, by_center))
    }

    fn uv(&self, point: DVec3) -> DVec2 {
        let n = (point - self.center).normalize();
        let azimuth = n.z.atan2(n.x) / TAU;
        DVec2::new(azimuth - azimuth.floor(), n.y.clamp(-1.0, 1.0).acos() / PI)
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        (self.center - self.radius, self.center + self.radius)
    }

    fn owner(&self) -> Owner {
        self.owner
    }
}

/// `|f|^2 - r^2` where both are nearly the same, from the scene's own f64: beside a large sphere what rounding
/// takes from the center and the radius is more than the height above it.
#[inline(never)]
fn near_products<'a>(
    near: Mask8,
    mut c: Float8,
    origin: &Vec3x8,
    part: impl Fn(usize) -> Option<&'a SpherePart>,
) -> Float8 {
    for lane in near.lanes() {
        let Some(SpherePart { center, radius, .. }) = part(lane) else { continue };
        let f = *center - DVec3::from_array(origin.lane(lane).map(f64::from));
        c.as_mut_array()[lane] = (f.length_squared() - radius * radius) as f32;
    }
    c
}

/// By Lagrange's identity: the discriminant `r^2 d.d - |f x d|^2`, and both roots (of a tangent where
/// it is negative).
fn roots(part: &SpherePart, ray: &Ray64) -> (f64, [f64; 2]) {
    let f = part.center - ray.origin;
    let (fd, dd) = (f.dot(ray.dir), ray.dir.length_squared());
    let disc = part.radius * part.radius * dd - f.cross(ray.dir).length_squared();
    let z = fd + disc.max(0.0).sqrt().copysign(fd);
    (disc, [z / dd, (f.length() - part.radius) * (f.length() + part.radius) / z])
}

/// `x` with the sign of `sign`; `x >= 0` or NaN.
#[inline(always)]
pub(super) fn copysign(x: Float8, sign: Float8) -> Float8 {
    Mask8::sign(sign).select(-x, x)
}
