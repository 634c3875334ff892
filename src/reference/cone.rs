//! Cones and frusta, open or with caps; cylinders are those of slope 0.

use glam::{DVec2, DVec3};

use super::exact;
use super::line::{Line, Root, Roots, Surface, turns};
use super::margin::{TOLERANCE, ratio};
use super::quadratic::Quadratic;
use super::span::{End, Face, Span};
use crate::scene;

/// The points whose distance from the axis is `radius + slope x height`, for heights 0 to `length`.
#[derive(Debug, Clone)]
pub struct Cone {
    base: DVec3,
    apex: DVec3,
    /// Unit, from base to apex.
    axis: DVec3,
    length: f64,
    /// At the base.
    radius: f64,
    apex_radius: f64,
    /// Change of the radius per unit of height.
    slope: f64,
    caps: bool,
}

/// Parts of the surface.
const SIDE: u8 = 0;
const BASE: u8 = 1;
const APEX: u8 = 2;

/// A line in terms of the axis.
struct Relative {
    /// From the line's origin to the base.
    f: DVec3,
    /// Heights: of the base above the origin, of the direction.
    f_axial: f64,
    d_axial: f64,
    /// Base and direction across the axis, turned by a quarter: a cross product does both at once.
    g: DVec3,
    e: DVec3,
    /// The radius that belongs to the height at `t` is `p + q t`.
    p: f64,
    q: f64,
    /// The f32 error that storing the body and subtracting the origin leave in a position.
    stored: f64,
}

impl Cone {
    pub fn new(cone: &scene::Cone, origin: DVec3) -> Cone {
        let scene::Cone { radius, apex_radius, caps, .. } = *cone;
        let (axis, length) = (cone.apex - cone.base).normalize_and_length();
        let slope = (apex_radius - radius) / length;
        let (base, apex) = (cone.base - origin, cone.apex - origin);
        Cone { base, apex, axis, length, radius, apex_radius, slope, caps }
    }

    fn relative(&self, line: &Line) -> Relative {
        let w = self.axis;
        let f = self.base - line.origin;
        let f_axial = exact::dot(w.to_array(), f.to_array());
        let d_axial = exact::dot(w.to_array(), line.dir.to_array());
        let anchors = line.anchor_error(self.base).length().max(line.anchor_error(self.apex).length());
        Relative {
            f,
            f_axial,
            d_axial,
            g: exact::cross(w, f),
            e: exact::cross(w, line.dir),
            p: (-self.slope).mul_add(f_axial, self.radius),
            q: self.slope * d_axial,
            stored: anchors + line.stored(self.radius).max(line.stored(self.apex_radius)),
        }
    }

    /// The f32 error of a position at `t`.
    fn error(&self, rel: &Relative, line: &Line, t: f64) -> f64 {
        let radius = self.radius.max(self.apex_radius);
        line.u * (rel.f.length() + self.length + radius + t.abs() * line.dir.length()) + rel.stored
    }

    /// An end on the side, with the unit `error / |n.d|`; at a silhouette, where n.d vanishes, that is
    /// cut off at the half chord which the error alone can open.
    fn side(&self, rel: &Relative, line: &Line, equation: &Quadratic, t: f64) -> End {
        if !t.is_finite() {
            return End { t, unit: 0.0, part: SIDE };
        }
        let error = self.error(rel, line, t);
        let radius = (rel.p + rel.q * t).abs();
        let n_d = ratio(equation.half_width(), radius * 1f64.hypot(self.slope));
        let silhouette = ratio((2.0 * radius * error).sqrt() + error, rel.e.length());
        End { t, unit: ratio(error, n_d).min(silhouette) + line.u * t.abs(), part: SIDE }
    }

    pub fn roots(&self, line: &Line) -> Roots {
        let rel = self.relative(line);
        let equation = Quadratic::new(rel.g, DVec3::ZERO, rel.e, rel.p, rel.q);
        let Some((mut enter, mut leave)) = equation.crossings() else {
            return if line.judged { self.near_miss(&rel, line, &equation) } else { [None, None] };
        };
        if equation.a < 0.0 && self.caps {
            // The line runs in both halves of the double cone; ours is the one of positive radii.
            if rel.q > 0.0 {
                leave = f64::INFINITY;
            } else {
                enter = f64::NEG_INFINITY;
            }
        }
        let [near, far] = [enter, leave].map(|t| self.side(&rel, line, &equation, t));
        if !self.caps {
            return self.open(&rel, line, near, far, equation.a < 0.0);
        }
        let mut span = Span { near, far, margin: f64::INFINITY, u: line.u };
        for face in self.faces(&rel, line) {
            span.cut(face);
        }
        span.roots(line)
    }

    /// The planes of both caps.
    fn faces(&self, rel: &Relative, line: &Line) -> [Face; 2] {
        let apex = exact::dot(self.axis.to_array(), (self.apex - line.origin).to_array());
        let speed_error = line.u * (self.axis * line.dir).abs().element_sum();
        let face = |distance, speed, part| Face {
            distance,
            speed,
            distance_error: self.error(rel, line, 0.0),
            speed_error,
            part,
        };
        [face(-rel.f_axial, -rel.d_axial, BASE), face(apex, rel.d_axial, APEX)]
    }

    /// The side alone: both crossings count where their height is that of the body.
    fn open(&self, rel: &Relative, line: &Line, near: End, far: End, steep: bool) -> Roots {
        let chord = if steep { f64::INFINITY } else { ratio(far.t - near.t, near.unit + far.unit) };
        let root = |end: End, front| {
            let height = end.t.mul_add(rel.d_axial, -rel.f_axial);
            let hit = end.t.is_finite() && 0.0 <= height && height <= self.length;
            if !end.t.is_finite() || !(hit || line.judged) {
                return None;
            }
            let error = self.error(rel, line, end.t) + end.unit * rel.d_axial.abs();
            let margin = chord.min(ratio(height.min(self.length - height), error));
            Some(Root { t: end.t, hit, front, part: SIDE, unit: end.unit, margin, facing: f64::INFINITY })
        };
        [root(near, true), root(far, false)]
    }

    /// A line that stays outside: how nearly, where it is nearest between the ends of the body.
    fn near_miss(&self, rel: &Relative, line: &Line, equation: &Quadratic) -> Roots {
        let mut span = Span::all(line);
        for face in self.faces(rel, line) {
            span.cut(face);
        }
        let first = span.near.t - TOLERANCE * span.near.unit;
        let last = span.far.t + TOLERANCE * span.far.unit;
        let middle = if equation.a > 0.0 { equation.b / equation.a } else { 0.0 };
        let t = middle.min(last).max(first);
        let error = self.error(rel, line, t);
        let gap = (rel.p + rel.q * t).abs() - exact::along(t, rel.e, rel.g).length();
        // What is outside stays so, whatever the rounding of the gap itself.
        let margin = span.margin.min(ratio(gap, error)).min(-f64::MIN_POSITIVE);
        let unit = ratio((2.0 * self.radius.max(self.apex_radius) * error).sqrt() + error, rel.e.length());
        let root = Root { t, hit: false, front: true, part: SIDE, unit, margin, facing: 0.0 };
        [t.is_finite().then_some(root), None]
    }

    pub fn surface(&self, line: &Line, root: &Root) -> Surface {
        let w = self.axis;
        let anchor = if root.part == APEX { self.apex } else { self.base };
        let (f, low) = exact::difference(anchor, line.origin);
        let x = exact::along(root.t, line.dir, f) - low;
        let reach = self.length + self.radius.max(self.apex_radius);
        let across = x - w * x.dot(w);
        if root.part != SIDE {
            let (normal, radius) = if root.part == APEX { (w, self.apex_radius) } else { (-w, self.radius) };
            let (u, v) = scene::basis(normal);
            let out = ratio(across.length(), radius).min(1.0);
            let uv = DVec2::new(turns(across.dot(v), across.dot(u)), out);
            return Surface::flat(anchor + across, normal, uv, reach);
        }
        let height = x.dot(w).clamp(0.0, self.length);
        // At the tip there is no side to point to; the axis is the mean of all.
        let radial = across.normalize_or_zero();
        let normal = (radial - self.slope * w).normalize_or(w);
        let point = self.base + height * w + (self.radius + self.slope * height).max(0.0) * radial;
        let (u, v) = scene::basis(w);
        let uv = DVec2::new(turns(radial.dot(v), radial.dot(u)), height / self.length);
        Surface::flat(point, normal, uv, reach)
    }
}
