//! The mantles of cones and frusta. Their caps are disks of the same primitive.

use glam::{DVec2, DVec3};

use super::cylinder::about_axis;
use super::sphere::copysign;
use super::{Hidden8, Part, Ray64, Surface8, Surface64, nearer, roundings};
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
    type Anchor = Anchor;

    fn row(&self) -> ([DVec3; 2], [f64; 3]) {
        let (tip, axis) = self.narrow_end();
        ([tip, axis], [self.height, self.radius.min(self.apex_radius), self.slope().abs()])
    }

    #[inline(always)]
    fn anchor<'a>(rows: &Self::Rows, origin: &Vec3x8, _: impl Fn(usize) -> Option<&'a Self>) -> Anchor {
        let ([tip, axis], [height, radius, slope]) = *rows;
        let f = tip - *origin;
        let error = roundings(4.0) * (tip.abs() + f.abs()).sum();
        Anchor { f, error, axis, height, radius, slope }
    }

    /// Points at height `w` and distance `rho` from the axis with `rho = radius + slope w`, a quadratic in
    /// t from the ray's point nearest the narrower end; its discriminant from compensated products, its roots by
    /// quotient and product. Heights outside 0..height drop the mirror cone as well. Along the way the
    /// sign of `A t + B` says which side of the mantle a root meets.
    #[inline(always)]
    fn hit<const CULL: bool, const CERTIFY: bool>(anchor: &Anchor, rays: &RayPacket, hidden: &Hidden8) -> Hit8 {
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
            bound += float8(6.0) * speed2.sqrt() * size * size * turned;
        }
        let possible = Mask8::ge(disc, -bound);
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
            let silhouette = possible & Mask8::le(disc.abs(), bound);
            let widest = slope.mul_add(height, radius);
            let half = (size + size + widest + widest + moved) / speed2.sqrt();
            let near_ray = !Mask8::le(p + half, rays.t_min) & !Mask8::gt(p - half, rays.t_max);
            doubt = ((silhouette & near_ray) | open1 | open2 | (vague & possible)) & rays.live();
        }
        let (t, error) = (p + first.select(u1, u2), first.select(e1, e2));
        Hit8 { t, error, mask: (ok1 | ok2) & !doubt, doubt }
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let Quadratic { a, b, disc, mut roots } = Quadratic::new(self, ray);
        roots.sort_by(f64::total_cmp);
        let keep = |t: &f64| {
            let enters = a * t + b < 0.0;
            let shown = visible == Visible::Both || enters == (visible == Visible::Front);
            let w = (ray.at(*t) - self.base).dot(self.axis);
            shown && ray.accepts(*t) && (0.0..=self.height).contains(&w)
        };
        roots.into_iter().find(keep).filter(|_| disc >= 0.0)
    }

    fn refine(&self, ray: &Ray64, t: f64) -> Surface64 {
        let Quadratic { roots: [a, b], .. } = Quadratic::new(self, ray);
        let t = nearer(a, b, t);
        let from_base = ray.at(t) - self.base;
        let w = from_base.dot(self.axis);
        // At the tip there is no radial direction; the way out along the axis stands in for it.
        let radial = (from_base - self.axis * w).try_normalize();
        let normal = (radial.unwrap_or(-self.narrow_end().1) - self.axis * self.slope()).normalize();
        let rho = (self.radius + self.slope() * w).max(0.0);
        Surface64 { t, point: self.base + self.axis * w + radial.unwrap_or_default() * rho, normal }
    }

    fn surface(rows: &Self::Rows, rays: &RayPacket, t: Float8) -> Surface8 {
        let ([tip, axis], [height, radius, slope]) = *rows;
        let f = tip - rays.origin;
        let p = f.dot(rays.dir) * rays.inv_dd;
        let from_tip = rays.dir.mul_add(t - p, rays.dir.mul_add(p, -f));
        let w = from_tip.dot(axis);
        let radial = axis.mul_add(-w, from_tip);
        let length = radial.length();
        // At the tip there is no radial direction; the way out along the axis stands in for it.
        let at_tip = !Mask8::gt(length, Float8::ZERO);
        let radial = Vec3x8::select(at_tip, -axis, radial * (float8(1.0) / length));
        let normal = axis.mul_add(-slope, radial).normalize();
        let rho = slope.mul_add(w, radius).fast_max(Float8::ZERO);
        let point = radial.mul_add(at_tip.select(Float8::ZERO, rho), axis.mul_add(w, tip));
        let error = roundings(6.0) * (tip.abs().sum() + height + radius + rho);
        Surface8 { point, normal, error }
    }

    fn uv(&self, point: DVec3) -> DVec2 {
        about_axis(point - self.base, self.axis, self.height)
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        let a = self.axis;
        let half = DVec3::new(a.y.hypot(a.z), a.z.hypot(a.x), a.x.hypot(a.y));
        let apex = self.base + a * self.height;
        let (low, high) = (half * self.radius, half * self.apex_radius);
        ((self.base - low).min(apex - high), (self.base + low).max(apex + high))
    }

    fn owner(&self) -> Owner {
        self.owner
    }
}

/// `A t^2 + 2 B t + C = 0` in f64, from the point nearest the base, which is added back to the roots.
struct Quadratic {
    /// With `b`: `a t + b` is negative where a root at `t` enters.
    a: f64,
    b: f64,
    disc: f64,
    roots: [f64; 2],
}

impl Quadratic {
    fn new(part: &ConePart, ray: &Ray64) -> Self {
        let k = part.slope();
        let p = (part.base - ray.origin).dot(ray.dir) / ray.dir.length_squared();
        let g = ray.at(p) - part.base;
        let (gw, dw) = (g.dot(part.axis), ray.dir.dot(part.axis));
        let (gx, dx) = (g - part.axis * gw, ray.dir - part.axis * dw);
        let rho = part.radius + k * gw;
        let a = dx.length_squared() - (k * dw).powi(2);
        let b = dx.dot(gx) - k * dw * rho;
        let c = gx.length_squared() - rho * rho;
        let disc = b * b - a * c;
        let z = -(b + disc.max(0.0).sqrt().copysign(b));
        Quadratic { a, b: b - a * p, disc, roots: [p + z / a, p + c / z] }
    }
}
