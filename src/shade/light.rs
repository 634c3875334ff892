//! Lights without an area, eight points at a time.

use glam::DVec3;

use crate::lanes::{Float8, Mask8, Vec3x8, float8};
use crate::plan::Plan;
use crate::scene::{Falloff, Source};

/// All lights without an area that are asked, in f32, relative to the plan's origin, each with its index in the scene.
#[derive(Debug)]
pub struct LightTable(Vec<(usize, Illumination)>);

/// One light.
#[derive(Debug, Clone, Copy)]
pub struct Illumination {
    /// Where it comes from.
    pub toward: Toward,
    /// Whether anything casts a shadow in it.
    pub shadows: bool,
    strength: [f32; 3], // intensity or irradiance over pi
    square: bool,       // falls with the distance squared
    cone: Option<Cone>,
}

/// Where light comes from.
#[derive(Debug, Clone, Copy)]
pub enum Toward {
    /// A point.
    Point([f32; 3]),
    /// A direction, unit, toward the light.
    Direction([f32; 3]),
}

/// The cone of a spot.
#[derive(Debug, Clone, Copy)]
struct Cone {
    axis: [f32; 3], // unit, away from the light
    angle: f32,     // radians
    penumbra: f32,  // radians
}

impl LightTable {
    /// Rounds the plan's.
    pub fn new(plan: &Plan) -> Self {
        let light = |(index, light): (usize, &crate::scene::Light)| {
            let over_pi = |color: DVec3| (color / std::f64::consts::PI).as_vec3().to_array();
            let place = |position: DVec3| Toward::Point((position - plan.origin).as_vec3().to_array());
            let (toward, strength, square, cone) = match light.source {
                Source::Point { position, intensity, falloff } => {
                    (place(position), over_pi(intensity), falloff == Falloff::InverseSquare, None)
                }
                Source::Directional { direction, irradiance } => {
                    let toward = (-direction.normalize()).as_vec3().to_array();
                    (Toward::Direction(toward), over_pi(irradiance), false, None)
                }
                Source::Spot { position, direction, intensity, cone, penumbra } => {
                    let axis = direction.normalize().as_vec3().to_array();
                    let (angle, penumbra) = (cone.to_radians() as f32, penumbra.to_radians() as f32);
                    (place(position), over_pi(intensity), true, Some(Cone { axis, angle, penumbra }))
                }
                Source::Area { .. } => return None,
            };
            Some((index, Illumination { toward, shadows: light.shadows, strength, square, cone }))
        };
        let asked = plan.scene.lights.iter().enumerate().filter(|(index, _)| plan.lights[*index]);
        LightTable(asked.filter_map(light).collect())
    }

    /// The lights in file order.
    pub fn iter(&self) -> impl Iterator<Item = &(usize, Illumination)> {
        self.0.iter()
    }
}

impl Illumination {
    /// Unit directions toward the light from eight points, and `E/pi` there.
    #[inline(always)]
    pub fn sample(&self, point: Vec3x8) -> (Vec3x8, Vec3x8) {
        let strength = Vec3x8::splat(self.strength);
        match self.toward {
            Toward::Direction(wi) => (Vec3x8::splat(wi), strength),
            Toward::Point(position) => {
                let to_light = Vec3x8::splat(position) - point;
                let d2 = to_light.length_squared();
                let wi = to_light * (float8(1.0) / d2.sqrt());
                let mut fall = if self.square { float8(1.0) / d2 } else { float8(1.0) };
                if let Some(cone) = &self.cone {
                    fall *= cone.share(wi);
                }
                (wi, strength * fall)
            }
        }
    }
}

impl Cone {
    /// The angle from the axis by its tangent, which is exact near the axis as well.
    fn share(&self, wi: Vec3x8) -> Float8 {
        let axis = Vec3x8::splat(self.axis);
        let angle = axis.cross(wi).length().atan2(-axis.dot(wi));
        let edge = float8(self.angle) - angle;
        if self.penumbra == 0.0 {
            return Mask8::gt(edge, Float8::ZERO).select(float8(1.0), Float8::ZERO);
        }
        let s = (edge / float8(self.penumbra)).fast_max(Float8::ZERO).fast_min(float8(1.0));
        s * s * (float8(3.0) - s - s)
    }
}
