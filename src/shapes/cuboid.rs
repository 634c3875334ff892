//! Axis-aligned boxes.

use glam::{DVec2, DVec3};

use super::{Hidden8, Part, Ray64, Surface8, Surface64, nearer, roundings};
use crate::lanes::{Float8, Hit8, LANES, Mask8, RayPacket, UNIT_ROUNDOFF, Vec3x8, float8};
use crate::plan::{BoxPart, Owner};
use crate::scene::Visible;

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    min: Vec3x8,
    max: Vec3x8,
    error: Vec3x8, // of both, by axis
}

impl Part for BoxPart {
    /// Lower and upper corner.
    type Rows = [Vec3x8; 2];
    type Face = Self::Rows;
    type Anchor = Anchor;

    fn row(&self) -> [DVec3; 2] {
        [self.min, self.max]
    }

    #[inline(always)]
    fn bounds8(rows: &Self::Rows) -> (Vec3x8, Vec3x8) {
        (rows[0], rows[1])
    }

    #[inline(always)]
    fn anchor(rows: &Self::Rows, origin: &Vec3x8) -> Anchor {
        let (min, max) = (rows[0] - *origin, rows[1] - *origin);
        // Corners round with the scene, origins with the camera by no more than corners and differences do, the difference
        // once; a quotient three times, the direction's rounding included.
        let corner = (rows[0].abs() + rows[1].abs()) * roundings(3.5);
        Anchor { min, max, error: corner + (min.abs() + max.abs()) * roundings(6.5) }
    }

    #[inline(always)]
    fn hit<'a, const CULL: bool, const CERTIFY: bool>(
        _: &Self::Rows,
        anchor: &Anchor,
        rays: &RayPacket,
        hidden: &Hidden8,
        _: impl Fn(usize) -> Option<&'a Self>,
    ) -> Hit8 {
        let Anchor { min, max, error } = *anchor;
        Stretch::new::<CERTIFY>(min, max, error, rays.dir, Float8::ZERO).first_of::<CULL, CERTIFY>(hidden, rays)
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let (entry, exit) = slabs64(self.min - ray.origin, self.max - ray.origin, ray.dir);
        (entry <= exit).then(|| ray.first(entry, exit, visible)).flatten()
    }

    fn refine(&self, ray: &Ray64, t: f64, visible: Visible) -> Surface64 {
        let (t, axis, upper) = face64(self.min - ray.origin, self.max - ray.origin, ray.dir, t, visible);
        let (mut point, mut normal) = (ray.at(t), DVec3::ZERO);
        point[axis] = if upper { self.max[axis] } else { self.min[axis] };
        normal[axis] = if upper { 1.0 } else { -1.0 };
        Surface64 { t, point, normal }
    }

    #[inline(always)]
    fn face(rows: &Self::Rows) -> &Self::Rows {
        rows
    }

    #[inline(always)]
    fn surface(rows: &[Vec3x8; 2], rays: &RayPacket, t: Float8) -> Surface8 {
        let Anchor { min, max, error } = Self::anchor(rows, &rays.origin);
        let face = Face::at(t, [min, max, error], rays.dir, Float8::ZERO);
        let [min, max] = *rows;
        let (point, normal) = face.put(min, max, rays.dir.mul_add(t, rays.origin));
        let reach = point.abs() + (min.abs() + max.abs());
        Surface8 { point, normal, error: roundings(2.0) * normal.abs().dot(reach), vague: face.vague }
    }

    fn uv(&self, point: DVec3) -> DVec2 {
        face_uv(self.min, self.max, point)
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        (self.min, self.max)
    }

    fn owner(&self) -> Owner {
        self.owner
    }
}

/// Where eight rays enter and leave eight boxes, and the bounds on both: `entry > exit` is a miss.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    entry: Float8,
    exit: Float8,
    /// Least and greatest place of the entry.
    entry_bounds: [Float8; 2],
    /// Least and greatest place of the exit.
    exit_bounds: [Float8; 2],
}

impl Stretch {
    /// For rays from the origin of `min` and `max`, which are known to `error` by axis; `turned` bounds what the
    /// coordinates of `dir` are off by beyond their own rounding.
    ///
    /// Source: Williams, Barrus, Morley and Shirley, "An efficient and robust ray-box intersection
    /// algorithm", Journal of Graphics Tools 10(1), 2005. A ray along a slab is inside everywhere or nowhere, its
    /// faces included.
    #[inline(always)]
    pub fn new<const CERTIFY: bool>(min: Vec3x8, max: Vec3x8, error: Vec3x8, dir: Vec3x8, turned: Float8) -> Self {
        let infinity = float8(f32::INFINITY);
        // A padding row is NaN, which minima may pass over: it ends before it begins.
        let exit = Mask8::le(min.x, max.x).select(infinity, -infinity);
        let mut all = Stretch { entry: -infinity, exit, entry_bounds: [-infinity; 2], exit_bounds: [exit; 2] };
        all.cut::<CERTIFY>(min.x, max.x, error.x, dir.x, turned);
        all.cut::<CERTIFY>(min.y, max.y, error.y, dir.y, turned);
        all.cut::<CERTIFY>(min.z, max.z, error.z, dir.z, turned);
        all
    }

    /// Leaves what is between two faces.
    #[inline(always)]
    fn cut<const CERTIFY: bool>(&mut self, lo: Float8, hi: Float8, error: Float8, d: Float8, turned: Float8) {
        let back = Mask8::sign(d);
        let infinity = float8(f32::INFINITY);
        let (mut near, mut far) = (back.select(hi, lo) / d, back.select(lo, hi) / d);
        let along = Mask8::le(d.abs(), Float8::ZERO);
        let inside = |slack: Float8| Mask8::le(lo - slack, Float8::ZERO) & Mask8::ge(hi + slack, Float8::ZERO);
        if along.any() {
            let within = inside(Float8::ZERO);
            near = along.select(within.select(-infinity, infinity), near);
            far = along.select(within.select(infinity, -infinity), far);
        }
        (self.entry, self.exit) = (near.fast_max(self.entry), far.fast_min(self.exit));
        if !CERTIFY {
            return;
        }
        let inv = float8(1.0) / (d.abs() - turned).fast_max(Float8::ZERO);
        let near_error = turned.mul_add(near.abs(), error) * inv;
        let far_error = turned.mul_add(far.abs(), error) * inv;
        let mut near = [near - near_error, near + near_error];
        let mut far = [far - far_error, far + far_error];
        // Where the direction may be along the slab, all there is to know is whether the origin is inside.
        let along = Mask8::le(d.abs(), turned);
        if along.any() {
            let (outer, inner) = (inside(error), inside(-error));
            let open = |mask: Mask8, yes: Float8, no: Float8, lane: Float8| along.select(mask.select(yes, no), lane);
            // Not along it for certain, the ray may leave the slab anywhere.
            let sure = inner & Mask8::le(turned, Float8::ZERO);
            let maybe = outer | Mask8::gt(turned, Float8::ZERO);
            near = [open(maybe, -infinity, infinity, near[0]), open(sure, -infinity, infinity, near[1])];
            far = [open(sure, infinity, -infinity, far[0]), open(maybe, infinity, -infinity, far[1])];
        }
        for k in 0..2 {
            self.entry_bounds[k] = near[k].fast_max(self.entry_bounds[k]);
            self.exit_bounds[k] = far[k].fast_min(self.exit_bounds[k]);
        }
    }

    /// The first of entry and exit that lies on the ray and is not hidden.
    #[inline(always)]
    pub fn first_of<const CULL: bool, const CERTIFY: bool>(&self, hidden: &Hidden8, rays: &RayPacket) -> Hit8 {
        let Stretch { entry, exit, entry_bounds, exit_bounds } = *self;
        let met = Mask8::le(entry, exit);
        if !CERTIFY {
            let (mut entry_ok, mut exit_ok) = (rays.accepts(entry), rays.accepts(exit));
            if CULL {
                entry_ok &= !hidden.front;
                exit_ok &= !hidden.back;
            }
            let (t, mask) = (entry_ok.select(entry, exit), met & (entry_ok | exit_ok));
            return Hit8 { t, error: Float8::ZERO, mask, doubt: Mask8::NONE };
        }
        let possible = !Mask8::gt(entry_bounds[0], exit_bounds[1]) & rays.live();
        if !possible.any() {
            return Hit8::none();
        }
        let on = |[low, high]: [Float8; 2]| possible & Mask8::gt(high, rays.t_min) & Mask8::le(low, rays.t_max);
        let (mut entry_ok, mut exit_ok) = (on(entry_bounds), on(exit_bounds));
        if CULL {
            entry_ok &= !hidden.front;
            exit_ok &= !hidden.back;
        }
        let any = entry_ok | exit_ok;
        let low = entry_ok.select(entry_bounds[0], exit_bounds[0]);
        let high = entry_ok.select(entry_bounds[1], exit_bounds[1]);
        let t = entry_ok.select(entry, exit);
        let error = (high - t).fast_max(t - low) * float8(1.0 + 4.0 * UNIT_ROUNDOFF);
        let sure = Mask8::le(entry_bounds[1], exit_bounds[0]) & met & Mask8::gt(low, rays.t_min);
        Hit8 { t, error, mask: any & sure, doubt: any & !sure }
    }
}

/// Entry and exit of one ray in f64: `entry > exit` is a miss.
pub(super) fn slabs64(min: DVec3, max: DVec3, dir: DVec3) -> (f64, f64) {
    let (mut entry, mut exit) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        if dir[k] == 0.0 {
            if min[k] > 0.0 || max[k] < 0.0 {
                return (f64::INFINITY, f64::NEG_INFINITY);
            }
            continue;
        }
        let (a, b) = (min[k] / dir[k], max[k] / dir[k]);
        entry = entry.max(a.min(b));
        exit = exit.min(a.max(b));
    }
    (entry, exit)
}

/// The face that was met, in each lane one of six.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    /// Lanes in which it lies across an axis.
    across: [Mask8; 3],
    /// Lanes in which it is the upper one of its axis, by axis.
    upper: [Mask8; 3],
    /// Lanes in which it may as well be another one.
    pub vague: Mask8,
}

impl Face {
    /// The face that gave `t`: as for [`Stretch::new`] entry or exit, whichever is nearer, and of equal ones the lowest
    /// axis. Which face a point is nearest to would not tell: it may lie on two, or beyond the far one of a thin box.
    #[inline(always)]
    pub fn at(t: Float8, [min, max, error]: [Vec3x8; 3], dir: Vec3x8, turned: Float8) -> Self {
        let axes = [(min.x, max.x, error.x, dir.x), (min.y, max.y, error.y, dir.y), (min.z, max.z, error.z, dir.z)];
        let (mut entry, mut exit) = (End::NONE, End::NONE);
        let mut vague = Mask8::NONE;
        for (k, (lo, hi, error, d)) in axes.into_iter().enumerate() {
            let (back, along) = (Mask8::sign(d), Mask8::le(d.abs(), turned));
            let never = float8(f32::NEG_INFINITY);
            let near = along.select(never, back.select(hi, lo) / d);
            let far = along.select(never, -back.select(lo, hi) / d);
            let inv = along.select(Float8::ZERO, float8(1.0) / (d.abs() - turned));
            let off = |place: Float8| along.select(Float8::ZERO, turned.mul_add(place.abs(), error) * inv);
            entry.take(k, near, off(near));
            exit.take(k, far, off(far));
            vague |= along & Mask8::gt(turned, Float8::ZERO);
        }
        let leaves = Mask8::lt((t + exit.last).abs(), (t - entry.last).abs());
        let one_of = |a: Mask8, b: Mask8| (leaves & a) | (!leaves & b);
        // A box that is thinner than that: entry or exit.
        let thin = !Mask8::gt(-exit.last - entry.last, float8(2.0) * (entry.error + exit.error));
        vague |= thin | one_of(exit.vague(), entry.vague());
        let across = std::array::from_fn(|k| one_of(exit.axes[k], entry.axes[k]));
        let upper = [dir.x, dir.y, dir.z].map(|d| one_of(!Mask8::sign(d), Mask8::sign(d)));
        Face { across, upper, vague }
    }

    /// Puts points on it; with its normal.
    #[inline(always)]
    pub fn put(&self, min: Vec3x8, max: Vec3x8, point: Vec3x8) -> (Vec3x8, Vec3x8) {
        let axis = |k: usize, lo: Float8, hi: Float8, x: Float8| {
            let (on, up) = (self.across[k], self.upper[k]);
            let normal = on.select(up.select(float8(1.0), float8(-1.0)), Float8::ZERO);
            (on.select(up.select(hi, lo), x), normal)
        };
        let x = axis(0, min.x, max.x, point.x);
        let y = axis(1, min.y, max.y, point.y);
        let z = axis(2, min.z, max.z, point.z);
        (Vec3x8::new(x.0, y.0, z.0), Vec3x8::new(x.1, y.1, z.1))
    }
}

/// The last of the places where a ray gets behind the faces that it meets from without.
struct End {
    last: Float8,
    error: Float8,
    /// The greatest that any other place may be.
    rival: Float8,
    axes: [Mask8; 3],
}

impl End {
    const NONE: End = {
        let never = Float8::new([f32::NEG_INFINITY; LANES]);
        End { last: never, error: Float8::ZERO, rival: never, axes: [Mask8::NONE; 3] }
    };

    #[inline(always)]
    fn take(&mut self, axis: usize, place: Float8, error: Float8) {
        let later = Mask8::gt(place, self.last);
        let (other, its_error) = (later.select(self.last, place), later.select(self.error, error));
        self.rival = self.rival.fast_max(other + its_error);
        self.last = later.select(place, self.last);
        self.error = later.select(error, self.error);
        self.axes.iter_mut().for_each(|mask| *mask &= !later);
        self.axes[axis] = later;
    }

    /// Lanes in which another place may be the last.
    #[inline(always)]
    fn vague(&self) -> Mask8 {
        !Mask8::lt(self.rival, self.last - self.error)
    }
}

/// [`Face`] of one ray in f64, and its `t`: the axis, and whether it is the upper one.
pub(super) fn face64(min: DVec3, max: DVec3, dir: DVec3, t: f64, visible: Visible) -> (f64, usize, bool) {
    let (entry, exit) = slabs64(min, max, dir);
    let t = nearer(entry, exit, t, visible);
    let leaves = t != entry || (entry == exit && visible == Visible::Back);
    let place = |k: usize| {
        let (a, b) = (min[k] / dir[k], max[k] / dir[k]);
        if leaves { a.max(b) } else { a.min(b) }
    };
    let axis = (0..3).find(|k| dir[*k] != 0.0 && place(*k) == t).unwrap_or(0);
    (t, axis, (dir[axis] > 0.0) == leaves)
}

/// 0 to 1 along the two axes after the face's own, in cyclic order.
pub(super) fn face_uv(min: DVec3, max: DVec3, point: DVec3) -> DVec2 {
    let gap = (point - min).abs().min((point - max).abs());
    let axis = (0..3).fold(0, |best, k| if gap[k] < gap[best] { k } else { best });
    let part = (point - min) / (max - min);
    DVec2::new(part[(axis + 1) % 3], part[(axis + 2) % 3])
}
