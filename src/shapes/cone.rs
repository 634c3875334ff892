//! The mantles of cones and frusta. Their caps are disks of the same primitive.

use glam::{DVec2, DVec3};

use super::cylinder::about_axis;
use super::sphere::copysign;
use super::{Hidden8, Ray64, Sides, Store, Surface8, Surface64, column_of, nearer, roundings};
use crate::lanes::{Column, Column3, Float8, Hit8, LANES, Mask8, RayPacket, Vec3x8, difference_of_products, float8};
use crate::plan::{ConePart, Owner};
use crate::scene::Visible;

/// All cones of a render.
#[derive(Debug)]
pub struct Cones {
    tip: Column3,   // centre of the narrower end, scene units
    axis: Column3,  // unit, from there to the wider end
    height: Column, // scene units, > 0
    radius: Column, // at the narrower end, scene units, >= 0
    slope: Column,  // growth of the radius per unit of height, > 0
    sides: Sides,
    parts: Vec<ConePart>,
}

/// Eight rows.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    tip: Vec3x8,
    axis: Vec3x8,
    height: Float8,
    radius: Float8,
    slope: Float8,
    hidden: Hidden8,
}

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    f: Vec3x8,     // from the origin to the tip
    error: Float8, // of f, the rounding of the scene included
    axis: Vec3x8,
    height: Float8,
    radius: Float8,
    slope: Float8,
    hidden: Hidden8,
}

impl Store for Cones {
    type Part = ConePart;
    type Row = Row;
    type Anchor = Anchor;

    fn new(parts: Vec<ConePart>, sides: Sides) -> Self {
        let tip = Column3::new(parts.iter().map(|part| part.narrow_end().0));
        let axis = Column3::new(parts.iter().map(|part| part.narrow_end().1));
        let height = column_of(&parts, |part| part.height);
        let radius = column_of(&parts, |part| part.radius.min(part.apex_radius));
        let slope = column_of(&parts, |part| part.slope().abs());
        Cones { tip, axis, height, radius, slope, sides, parts }
    }

    fn parts(&self) -> &[ConePart] {
        &self.parts
    }

    #[inline(always)]
    fn splat(&self, i: usize) -> Row {
        let (tip, axis, height) = (self.tip.splat(i), self.axis.splat(i), self.height.splat(i));
        Row { tip, axis, height, radius: self.radius.splat(i), slope: self.slope.splat(i), hidden: self.sides.splat(i) }
    }

    #[inline(always)]
    fn block(&self, i: usize) -> Row {
        let (tip, axis, height) = (self.tip.block(i), self.axis.block(i), self.height.block(i));
        Row { tip, axis, height, radius: self.radius.block(i), slope: self.slope.block(i), hidden: self.sides.block(i) }
    }

    fn gather(&self, rows: [u32; LANES]) -> Row {
        let hidden = self.sides.lanes(|lane| rows[lane] as usize);
        let (tip, axis, height) = (self.tip.gather(rows), self.axis.gather(rows), self.height.gather(rows));
        Row { tip, axis, height, radius: self.radius.gather(rows), slope: self.slope.gather(rows), hidden }
    }

    #[inline(always)]
    fn anchor(row: &Row, origin: &Vec3x8) -> Anchor {
        let Row { tip, axis, height, radius, slope, hidden } = *row;
        let f = tip - *origin;
        let reach = tip.abs() + f.abs();
        let error = roundings(4.0) * (reach.x + reach.y + reach.z);
        Anchor { f, error, axis, height, radius, slope, hidden }
    }

    /// Points at height `w` and distance `rho` from the axis with `rho = radius + slope w`, a quadratic in
    /// t from the ray's point nearest the narrower end; its discriminant from compensated products, its roots by
    /// quotient and product. Heights outside 0..height drop the mirror cone as well. Along the way the
    /// sign of `A t + B` says which side of the mantle a root meets.
    #[inline(always)]
    fn hit<const CULL: bool>(anchor: &Anchor, rays: &RayPacket) -> Hit8 {
        let Anchor { f, error, axis, height, radius, slope, hidden } = *anchor;
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
        let bound = speed2 * size * float8(6.0).mul_add(error, roundings(20.0) * size);
        let possible = Mask8::ge(disc, -bound);
        if !possible.any() {
            return Hit8::none();
        }
        let root = copysign(disc.sqrt(), b);
        let z = -(b + root);
        let (t1, t2) = (z / a, c / z);
        // Within this of its ends a mantle may or may not be met.
        let rim = float8(2.0).mul_add(error, roundings(16.0) * (size + height))
            + (dw.abs() * bound) / (speed2 * root.abs()).fast_max(float8(f32::MIN_POSITIVE));
        let at_rim = |t: Float8| {
            let w = t.mul_add(dw, gw);
            rays.accepts(p + t) & (Mask8::le(w.abs(), rim) | Mask8::le((w - height).abs(), rim))
        };
        let silhouette = Mask8::le(disc.abs(), bound) & Mask8::gt(p + size / speed2.sqrt(), rays.t_min);
        let doubt = silhouette | at_rim(t1) | at_rim(t2);
        // A t + B is -root at t1 and +root at t2: negative where the ray goes in.
        let first_enters = !Mask8::sign(root);
        let ok = |t: Float8, enters: Mask8| {
            let w = t.mul_add(dw, gw);
            let mut ok = rays.accepts(p + t) & Mask8::ge(w, Float8::ZERO) & Mask8::le(w, height);
            if CULL {
                ok &= !((enters & hidden.front) | (!enters & hidden.back));
            }
            ok
        };
        let (ok1, ok2) = (ok(t1, first_enters), ok(t2, !first_enters));
        let far = float8(f32::INFINITY);
        let t = p + ok1.select(t1, far).fast_min(ok2.select(t2, far));
        Hit8 { t, mask: (ok1 | ok2) & !doubt, doubt }
    }

    fn decide(part: &ConePart, ray: &Ray64, visible: Visible) -> Option<f64> {
        let Quadratic { a, b, disc, mut roots } = Quadratic::new(part, ray);
        roots.sort_by(f64::total_cmp);
        let keep = |t: &f64| {
            let enters = a * t + b < 0.0;
            let shown = visible == Visible::Both || enters == (visible == Visible::Front);
            let w = (ray.at(*t) - part.base).dot(part.axis);
            shown && ray.accepts(*t) && (0.0..=part.height).contains(&w)
        };
        roots.into_iter().find(keep).filter(|_| disc >= 0.0)
    }

    fn refine(part: &ConePart, ray: &Ray64, t: f64) -> Surface64 {
        let Quadratic { roots: [a, b], .. } = Quadratic::new(part, ray);
        let t = nearer(a, b, t);
        let from_base = ray.at(t) - part.base;
        let w = from_base.dot(part.axis);
        // At the tip there is no radial direction; the way out along the axis stands in for it.
        let radial = (from_base - part.axis * w).try_normalize();
        let normal = (radial.unwrap_or(-part.narrow_end().1) - part.axis * part.slope()).normalize();
        let rho = (part.radius + part.slope() * w).max(0.0);
        Surface64 { t, point: part.base + part.axis * w + radial.unwrap_or_default() * rho, normal }
    }

    fn surface(row: &Row, rays: &RayPacket, t: Float8) -> Surface8 {
        let f = row.tip - rays.origin;
        let p = f.dot(rays.dir) * rays.inv_dd;
        let from_tip = rays.dir.mul_add(t - p, rays.dir.mul_add(p, -f));
        let w = from_tip.dot(row.axis);
        let radial = row.axis.mul_add(-w, from_tip);
        let length = radial.length();
        // At the tip there is no radial direction; the way out along the axis stands in for it.
        let at_tip = !Mask8::gt(length, Float8::ZERO);
        let radial = Vec3x8::select(at_tip, -row.axis, radial * (float8(1.0) / length));
        let normal = row.axis.mul_add(-row.slope, radial).normalize();
        let rho = row.slope.mul_add(w, row.radius).fast_max(Float8::ZERO);
        let point = radial.mul_add(at_tip.select(Float8::ZERO, rho), row.axis.mul_add(w, row.tip));
        let reach = row.tip.abs();
        let size = row.height + row.radius + rho;
        let error = roundings(6.0) * (reach.x + reach.y + reach.z + size);
        Surface8 { point, normal, error }
    }

    fn uv(part: &ConePart, point: DVec3) -> DVec2 {
        about_axis(point - part.base, part.axis, part.height)
    }

    fn bounds(part: &ConePart) -> (DVec3, DVec3) {
        let a = part.axis;
        let half = DVec3::new(a.y.hypot(a.z), a.z.hypot(a.x), a.x.hypot(a.y));
        let apex = part.base + a * part.height;
        let (low, high) = (half * part.radius, half * part.apex_radius);
        ((part.base - low).min(apex - high), (part.base + low).max(apex + high))
    }

    fn owner(part: &ConePart) -> Owner {
        part.owner
    }

    fn sides(&self) -> &Sides {
        &self.sides
    }

    fn column_bytes(&self) -> usize {
        let scalars = [&self.height, &self.radius, &self.slope];
        self.tip.bytes() + self.axis.bytes() + scalars.iter().map(|column| column.bytes()).sum::<usize>()
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
