//! Lights: sources at a point or infinitely far.

use glam::DVec3;

/// One light. At a surface point it gives a direction `wi` (unit, toward the light) and an irradiance
/// `E` on a plane that faces it; the materials say what they make of both.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// The user's name; may be absent.
    pub name: Option<String>,
    /// Whether anything casts a shadow in this light.
    pub shadows: bool,
    /// Kind and strength.
    pub source: Source,
}

/// Where light comes from. Colours are linear Rec. 709.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// `E = intensity / d^2`, or `E = intensity` without falloff, at distance `d`.
    Point {
        /// World coordinates.
        position: DVec3,
        /// W/sr.
        intensity: DVec3,
        /// Whether the strength falls with the distance.
        falloff: Falloff,
    },
    /// `wi = -direction`, `E = irradiance` everywhere.
    Directional {
        /// The way the light travels; not zero.
        direction: DVec3,
        /// W/m^2 on a plane that faces the light.
        irradiance: DVec3,
    },
    /// A point light times `smoothstep` of the angle from the axis: 1 within `cone - penumbra`, 0 from
    /// `cone` on, `s^2 (3 - 2 s)` with `s = (cone - angle)/penumbra` between. Falls with `d^2`.
    Spot {
        /// World coordinates.
        position: DVec3,
        /// The axis, away from the light; not zero.
        direction: DVec3,
        /// W/sr along the axis.
        intensity: DVec3,
        /// Half angle in degrees, 0 < cone <= 90.
        cone: f64,
        /// Degrees inside the cone, 0 <= penumbra <= cone.
        penumbra: f64,
    },
}

/// How the strength of a point light changes with distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Falloff {
    /// With the inverse square, as light does.
    #[default]
    InverseSquare,
    /// Not at all, as NFF has it.
    None,
}

impl Source {
    /// Whether it has no power.
    pub fn is_dark(&self) -> bool {
        match *self {
            Source::Point { intensity: power, .. } | Source::Spot { intensity: power, .. } => power == DVec3::ZERO,
            Source::Directional { irradiance, .. } => irradiance == DVec3::ZERO,
        }
    }
}
