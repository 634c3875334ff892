//! A ray made ready, and what a body answers to it.

use glam::{DVec2, DVec3};

use super::Ray;
use super::margin::U;

/// A ray that can meet something: finite, with a direction.
///
/// The direction is scaled by a power of two until its largest component is in 1..2, so that squares
/// neither overflow nor vanish; `t` counts lengths of the scaled direction. Nothing is rounded by that.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    pub origin: DVec3,
    pub dir: DVec3,
    /// Open end.
    pub t_min: f64,
    /// Closed end.
    pub t_max: f64,
    /// The ray's own `t` is this times ours.
    pub scale: f64,
    /// Whether units and margins are wanted; else bodies may leave out misses and both figures.
    pub judged: bool,
    /// The error of one rounding of the arithmetic that is judged.
    pub u: f64,
}

/// A place where a line meets, or nearly meets, the surface of a body.
#[derive(Debug, Clone, Copy)]
pub struct Root {
    pub t: f64,
    /// Whether it is met, in f64.
    pub hit: bool,
    /// Whether the line comes from the side that the normal points to.
    pub front: bool,
    /// Which part of the body: a face of a box, the side or a cap of a cone.
    pub part: u8,
    /// The error of `t` that f32 cannot avoid; may be infinite.
    pub unit: f64,
    /// How far the decision hit or miss is from turning, in its own f32 errors; negative for a miss.
    pub margin: f64,
    /// The same for `front`, >= 0.
    pub facing: f64,
}

/// All places of one body: none of our bodies has more than two.
pub type Roots = [Option<Root>; 2];

/// What is to be known of a body where it is hit.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    /// On the body.
    pub point: DVec3,
    /// Unit, outward.
    pub normal: DVec3,
    /// Unit, on the side of `normal`.
    pub shading_normal: DVec3,
    pub uv: DVec2,
    /// How far from `point` the numbers that it was made of reach, scene units: what its rounding
    /// error is relative to.
    pub reach: f64,
}

impl Line {
    /// `None` where the ray can meet nothing: no direction, or a number that is none.
    pub fn new(ray: &Ray, judged: bool) -> Option<Line> {
        let largest = ray.dir.abs().max_element();
        let finite = ray.origin.is_finite() && ray.dir.is_finite();
        if !finite || largest == 0.0 || ray.t_min.is_nan() || ray.t_max.is_nan() {
            return None;
        }
        let scale = power_below(largest);
        let dir = ray.dir * scale.recip();
        Some(Line {
            origin: ray.origin,
            dir,
            t_min: ray.t_min / scale.recip(),
            t_max: ray.t_max / scale.recip(),
            scale: scale.recip(),
            judged,
            u: U,
        })
    }

    /// The same, judged in an arithmetic of which one rounding is `u`.
    pub fn judged(ray: &Ray, u: f64) -> Option<Line> {
        Line::new(ray, true).map(|line| Line { u, ..line })
    }

    /// The error of storing `x`: f32 may hold it exactly, and of f64 that is not asked.
    pub fn stored(&self, x: f64) -> f64 {
        if self.u == U && f64::from(x as f32) == x { 0.0 } else { self.u * x.abs() }
    }

    /// Whether a place lies between the ends; never where `t` is not finite.
    pub fn holds(&self, t: f64) -> bool {
        self.t_min < t && t <= self.t_max && t.is_finite()
    }

    /// The error of `anchor - origin`, by component: of storing the anchor, and of subtracting.
    pub fn anchor_error(&self, anchor: DVec3) -> DVec3 {
        let difference = anchor - self.origin;
        DVec3::from_array(std::array::from_fn(|i| self.stored(anchor[i]) + self.stored(difference[i])))
    }
}

/// The power of two that makes `x / power` lie in 1..2, within 2^-1000..2^1000.
fn power_below(x: f64) -> f64 {
    let exponent = ((x.to_bits() >> 52) as i64 - 1023).clamp(-1000, 1000);
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

impl Surface {
    /// A surface whose shading normal is the geometric one.
    pub fn flat(point: DVec3, normal: DVec3, uv: DVec2, reach: f64) -> Surface {
        Surface { point, normal, shading_normal: normal, uv, reach }
    }
}

/// The angle of (x, y) in turns, 0 to 1.
pub fn turns(y: f64, x: f64) -> f64 {
    let turns = y.atan2(x) / std::f64::consts::TAU;
    if turns < 0.0 { turns + 1.0 } else { turns }
}
