//! The stretch of a line inside a convex body, cut out by one surface after the other.
//!
//! Cutting leaves no gaps: a line that passes through a rim or an edge leaves one surface's stretch
//! at the very number at which it enters the other's.

use super::line::{Line, Root, Roots};
use super::margin::ratio;

/// One end of a stretch.
#[derive(Debug, Clone, Copy)]
pub struct End {
    pub t: f64,
    /// The error of `t` that f32 cannot avoid.
    pub unit: f64,
    /// The surface it lies on.
    pub part: u8,
}

/// From `near` to `far`, both included; empty if `near.t > far.t`.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    pub near: End,
    pub far: End,
    /// Margin of the decisions that have no place on the line; negative: the body is missed.
    pub margin: f64,
    /// Of the arithmetic that is judged: the error of one rounding.
    pub u: f64,
}

/// A flat face seen from a line: the body is on the inner side.
#[derive(Debug, Clone, Copy)]
pub struct Face {
    /// From the line's origin to the face along the outward normal.
    pub distance: f64,
    /// Outward normal . direction.
    pub speed: f64,
    /// The f32 error of `distance`.
    pub distance_error: f64,
    /// The f32 error of `speed`.
    pub speed_error: f64,
    pub part: u8,
}

impl Span {
    /// The whole line.
    pub fn all(line: &Line) -> Span {
        let end = |t| End { t, unit: 0.0, part: 0 };
        Span { near: end(f64::NEG_INFINITY), far: end(f64::INFINITY), margin: f64::INFINITY, u: line.u }
    }

    /// Leaves what is behind a face.
    pub fn cut(&mut self, face: Face) {
        let Face { distance, speed, part, .. } = face;
        if speed == 0.0 {
            let margin = ratio(distance, face.distance_error);
            // Beside the face on the far side is a miss, however near; on the face is inside.
            self.margin = self.margin.min(if distance < 0.0 { margin.min(-f64::MIN_POSITIVE) } else { margin });
            return;
        }
        let t = distance / speed;
        let unit = (face.distance_error + t.abs() * face.speed_error) / speed.abs() + self.u * t.abs();
        let end = End { t, unit, part };
        // The first of equal ends stays, so that the lowest axis gives the normal.
        if speed < 0.0 && t > self.near.t {
            self.near = end;
        } else if speed > 0.0 && t < self.far.t {
            self.far = end;
        }
    }

    /// The ends as places of a closed body: in through the front, out through the back.
    pub fn roots(&self, line: &Line) -> Roots {
        let Span { near, far, .. } = *self;
        let hit = self.margin >= 0.0 && near.t <= far.t;
        if !hit && !line.judged {
            return [None, None];
        }
        let margin = self.margin.min(ratio(far.t - near.t, near.unit + far.unit));
        let root = |end: End, front| {
            let root = Root { t: end.t, hit, front, part: end.part, unit: end.unit, margin, facing: f64::INFINITY };
            end.t.is_finite().then_some(root)
        };
        [root(near, true), root(far, false)]
    }
}
