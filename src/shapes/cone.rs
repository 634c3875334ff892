//! The mantles of cones and frusta. Their caps are disks of the same primitive.

use glam::{DVec2, DVec3};

use super::cylinder::{about_axis, ends_missed, of_mantle};
use super::disk::round_bounds;
use super::sphere::copysign;
use super::{Hidden8, Part, Ray64, Surface8, Surface64, VANISHED, VANISHING, roundings, unit};
use crate::lanes::{Float8, Hit8, Mask8, RayPacket, Vec3x8, difference_of_products, float8};
use crate::plan::{ConePart, Owner};
use crate::scene::Visible;

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    f: Vec3x8,     // from the origin to the tip
    error: Float8, // of f, the rounding of the scene included
    axis: Vec3x8,
    height: Float8,
    radius: Float8,
    slope: Float8,
}

impl Part for ConePart {
    /// Centre of the narrower end and the unit axis from there, height, radius there and growth per unit of height.
    type Rows = ([Vec3x8; 2], [Float8; 3]);
    type Face = Self::Rows;
    type Anchor = Anchor;

    fn row(&self) -> ([DVec3; 2], [f64; 3]) {
        let (tip, axis) = self.narrow_end();
        ([tip, axis], [self.height, self.narrow_radius(), self.growth()])
    }

    #[inline(always)]
    fn bounds8(([tip, axis], [height, radius, slope]): &Self::Rows) -> (Vec3x8, Vec3x8) {
        let (low, high) = round_bounds(*tip, *axis, *radius);
        let wide = height.mul_add(*slope, *radius);
        let (other_low, other_high) = round_bounds(axis.mul_add(*height, *tip), *axis, wide);
        (low.min(other_low), high.max(other_high))
    }

    #[inline(always)]
    fn anchor(rows: &Self::Rows, origin: &Vec3x8) -> Anchor {
        let ([tip, axis], [height, radius, slope]) = *rows;
        let f = tip - *origin;
        let error = roundings(5.0).mul_add((tip.abs() + f.abs()).sum(), float8(VANISHING));
        Anchor { f, error, axis, height, radius, slope }
    }

    /// Points at height `w` and distance `rho` from the axis with `rho = radius + slope w`, a quadratic in
    /// t from the ray's point nearest the narrower end; its discriminant from compensated products, its roots by
    /// quotient and product. Heights outside 0..height drop the mirror cone as well. Along the way the
    /// sign of `A t + B` says which side of the mantle a root meets.
    #[inline(always)]
    fn hit<'a, const CULL: bool, const CERTIFY: bool>(
        _: &Self::Rows,
        anchor: &Anchor,
        rays: &RayPacket,
        hidden: &Hidden8,
        _: impl Fn(usize) -> Option<&'a Self>,
    ) -> Hit8 {
        let Anchor { f, error, axis, height, radius, slope } = *anchor;
        let p = f.dot(rays.dir) * rays.inv_dd;
        let g = rays.dir.mul_add(p, -f); // from the tip to the nearest point
        let (gw, dw) = (g.dot(axis), rays.dir.dot(axis));
        let (gx, dx) = (axis.mul_add(-gw, g), axis.mul_add(-dw, rays.dir));
        let (rho, turn) = (slope.mul_add(gw, radius), slope * dw);
        let a = dx.dot(dx) - turn * turn;
        let b = dx.dot(gx) - turn * rho;
        let c = gx.dot(gx) - rho * rho;
        let disc = difference_of_products(b, b, a, c);
        let (speed2, size) = (turn.mul_add(turn, dx.dot(dx)), rho.mul_add(rho, gx.dot(gx)).sqrt());
        let mut bound = Float8::ZERO;
        let (mut length, mut moved) = (Float8::ZERO, Float8::ZERO);
        if CERTIFY {
            // Places are off by `moved`, directions by a rounding of their whole length.
            length = rays.inv_dd.sqrt();
            length = float8(1.0) / length;
            moved = error + roundings(8.0) * (g.abs().sum() + radius);
            let turned = roundings(8.0) * length;
            bound = speed2 * size * (float8(6.0).mul_add(moved, roundings(20.0) * size));
            bound += float8(6.0) * speed2.sqrt() * size * size * turned + float8(VANISHED);
        }
        // Where squares overflow or vanish all is open.
        let possible = if CERTIFY { !Mask8::lt(disc, -bound) } else { Mask8::ge(disc, Float8::ZERO) };
        if !possible.any() {
            return Hit8::none();
        }
        let root = copysign(disc.sqrt(), b);
        let z = -(b + root);
        let (t1, t2) = (z / a, c / z);
        let w = |t: Float8| t.mul_add(dw, gw);
        // A t^2 + 2 B t + C is off by what moves places times their distance from the axis, and t by that over half of
        // its change.
        let place = |t: Float8| {
            if !CERTIFY {
                return Float8::ZERO;
            }
            let reach = t.abs().mul_add(speed2.sqrt(), size);
            let way = t.abs().mul_add(length, g.abs().sum());
            let slip = roundings(13.0).mul_add(f.abs().sum(), error) / length;
            let change = (disc.abs() - bound).fast_max(Float8::ZERO).sqrt();
            reach * (moved + moved + roundings(20.0) * way) / change + slip + roundings(4.0) * t.abs()
        };
        let (e1, e2) = (place(t1), place(t2));
        let near_rim = |t: Float8, e: Float8| {
            let rim = dw.abs().mul_add(e, moved) + roundings(16.0) * height;
            Mask8::le(w(t).abs(), rim) | Mask8::le((w(t) - height).abs(), rim)
        };
        // A t + B is -root at t1 and +root at t2: negative where the ray goes in.
        let first_enters = !Mask8::sign(root);
        let ok = |t: Float8, e: Float8, enters: Mask8| {
            let (mut ok, open) = rays.reaches(p + t, e);
            let within = Mask8::ge(w(t), Float8::ZERO) & Mask8::le(w(t), height);
            let rim = if CERTIFY { near_rim(t, e) } else { Mask8::NONE };
            ok &= within | rim;
            if CULL {
                ok &= !((enters & hidden.front) | (!enters & hidden.back));
            }
            (ok, ok & (open | rim))
        };
        let ((ok1, open1), (ok2, open2)) = (ok(t1, e1, first_enters), ok(t2, e2, !first_enters));
        let far = float8(f32::INFINITY);
        let (u1, u2) = (ok1.select(t1, far), ok2.select(t2, far));
        let first = Mask8::le(u1, u2);
        let mut doubt = Mask8::NONE;
        if CERTIFY {
            // With a near 0 the one root is far away and of no certain sign.
            let vague = Mask8::le(a.abs(), speed2 * roundings(16.0) + roundings(32.0) * length * speed2.sqrt());
            let silhouette = possible & !Mask8::gt(disc.abs(), bound);
            let widest = slope.mul_add(height, radius);
            let half = (size + size + widest + widest + moved) / speed2.sqrt();
            let near_ray = !Mask8::le(p + half, rays.t_min) & !Mask8::gt(p - half, rays.t_max);
            doubt = ((silhouette & near_ray) | open1 | open2 | (vague & possible)) & rays.live();
        }
        let (t, error) = (p + first.select(u1, u2), first.select(e1, e2));
        Hit8 { t, error, mask: (ok1 | ok2) & !doubt, doubt }
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let quadratic = Quadratic::new(self, ray);
        let mut roots = quadratic.roots;
        roots.sort_by(f64::total_cmp);
        let keep = |s: &f64| {
            let enters = quadratic.a * s + quadratic.b < 0.0;
            let shown = visible == Visible::Both || enters == (visible == Visible::Front);
            shown && ray.accepts(quadratic.p + s) && (0.0..=self.height).contains(&quadratic.height(*s))
        };
        roots.into_iter().find(keep).filter(|_| quadratic.disc >= 0.0).map(|s| quadratic.p + s)
    }

    fn refine(&self, ray: &Ray64, t: f64, visible: Visible) -> Surface64 {
        let quadratic = Quadratic::new(self, ray);
        let Quadratic { p, g, roots, .. } = quadratic;
        let off = |t: f64| ends_missed(quadratic.height(t - p), self.height);
        let t = of_mantle(roots.map(|s| p + s), off, t, visible);
        // The root as it was before it was rounded to a place on the ray.
        let s = if p + roots[0] == t { roots[0] } else { roots[1] };
        let (tip, axis) = self.narrow_end();
        let from_tip = s * ray.dir + g;
        let w = from_tip.dot(axis);
        // At the tip there is no radial direction; the way out along the axis stands in for it.
        let radial = (from_tip - axis * w).try_normalize();
        let normal = (radial.unwrap_or(-axis) - axis * self.growth()).normalize();
        let rho = (self.narrow_radius() + self.growth() * w).max(0.0);
        Surface64 { t, point: tip + axis * w + radial.unwrap_or_default() * rho, normal }
    }

    #[inline(always)]
    fn face(rows: &Self::Rows) -> &Self::Rows {
        rows
    }

    fn surface(rows: &Self::Rows, rays: &RayPacket, t: Float8) -> Surface8 {
        let ([tip, axis], [height, radius, slope]) = *rows;
        let f = tip - rays.origin;
        let p = f.dot(rays.dir) * rays.inv_dd;
        let from_tip = rays.dir.mul_add(t - p, rays.dir.mul_add(p, -f));
        let w = from_tip.dot(axis);
        let radial = axis.mul_add(-w, from_tip);
        // At the tip there is no radial direction; the way out along the axis stands in for it.
        let at_tip = !Mask8::gt(radial.abs().sum(), Float8::ZERO);
        let radial = Vec3x8::select(at_tip, -axis, unit(radial));
        let normal = axis.mul_add(-slope, radial).normalize();
        let rho = slope.mul_add(w, radius).fast_max(Float8::ZERO);
        let point = radial.mul_add(at_tip.select(Float8::ZERO, rho), axis.mul_add(w, tip));
        let error = roundings(6.0) * (tip.abs().sum() + height + radius + rho);
        Surface8::sure(point, normal, error)
    }

    fn uv(&self, point: DVec3) -> DVec2 {
        about_axis(point - self.base, self.axis, self.height)
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        let a = self.axis;
        let half = DVec3::new(a.y.hypot(a.z), a.z.hypot(a.x), a.x.hypot(a.y));
        let (low, high) = (half * self.radius, half * self.apex_radius);
        ((self.base - low).min(self.apex - high), (self.base + low).max(self.apex + high))
    }

    fn owner(&self) -> Owner {
        self.owner
    }
}

/// `A s^2 + 2 B s + C = 0` in f64, where s counts from the point nearest the narrower end: beside a tip all is as small
/// as what is to be told apart.
struct Quadratic {
    /// Where on the ray that point is.
    p: f64,
    /// From the narrower end to that point.
    g: DVec3,
    /// The same along the axis, and the direction.
    along: [f64; 2],
    /// With `b`: `a s + b` is negative where a root at `s` enters.
    a: f64,
    b: f64,
    disc: f64,
    roots: [f64; 2],
}

impl Quadratic {
    fn new(part: &ConePart, ray: &Ray64) -> Self {
        let ((tip, axis), k, d) = (part.narrow_end(), part.growth(), ray.dir);
        let f = tip - ray.origin;
        let p = f.dot(d) / d.length_squared();
        let g = DVec3::new(p.mul_add(d.x, -f.x), p.mul_add(d.y, -f.y), p.mul_add(d.z, -f.z));
        let (gw, dw) = (g.dot(axis), d.dot(axis));
        let (gx, dx) = (g - axis * gw, d - axis * dw);
        let rho = part.narrow_radius() + k * gw;
        let a = dx.length_squared() - (k * dw).powi(2);
        let b = dx.dot(gx) - k * dw * rho;
        let c = gx.length_squared() - rho * rho;
        let disc = b * b - a * c;
        let z = -(b + disc.max(0.0).sqrt().copysign(b));
        Quadratic { p, g, along: [gw, dw], a, b, disc, roots: [z / a, c / z] }
    }

    /// The height above the narrower end.
    fn height(&self, s: f64) -> f64 {
        s.mul_add(self.along[1], self.along[0])
    }
}
