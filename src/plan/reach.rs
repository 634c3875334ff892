//! What can reach what: balls around primitives, between a light and where it falls, and before the camera. All of it
//! errs on the safe side by far more than f32 rounds.

use glam::DVec3;

use super::skips::{Skip, Skips};
use crate::scene::{Backdrop, Camera, Emitter, Integrator, Lens, Light, RenderSettings, Scene, Shape, Source};

/// Most primitives of which every pair is looked at.
const MOST_PAIRS: usize = 256;

/// Cosines below this are too close to the terminator for what is said about shadows in general.
pub const LEAST_COSINE: f32 = 1e-3;

/// A ball around a primitive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// World coordinates.
    pub center: DVec3,
    /// Scene units.
    pub radius: f64,
}

/// What a primitive is as seen from afar.
enum Body {
    Ball(Ball),
    /// A point and the unit normal.
    Plane(DVec3, DVec3),
}

impl Ball {
    /// Around a shape; planes have none.
    pub fn around(shape: &Shape) -> Option<Ball> {
        let mut balls = Vec::new();
        shape.balls(&mut balls);
        let low = balls.iter().fold(DVec3::INFINITY, |low, (center, radius)| low.min(center - *radius));
        let high = balls.iter().fold(DVec3::NEG_INFINITY, |high, (center, radius)| high.max(center + *radius));
        let center = 0.5 * (low + high);
        let radius = balls.iter().map(|(ball, radius)| (ball - center).length() + radius).fold(0.0, f64::max);
        (!balls.is_empty()).then_some(Ball { center, radius })
    }

    /// Room for all roundings between here and `origin`.
    fn slack(&self, origin: DVec3) -> f64 {
        2e-5 * ((self.center - origin).length() + self.radius)
    }
}

/// Whether a ball may stand between a light and some point of another ball.
fn stands_between(source: &Source, from: &Ball, to: &Ball, slack: f64) -> bool {
    let reach = from.radius + slack;
    match *source {
        Source::Directional { direction, .. } => {
            let (way, off) = (-direction.normalize(), from.center - to.center);
            let along = off.dot(way);
            let beside = if along > 0.0 { (off - way * along).length() } else { off.length() };
            beside <= reach + to.radius
        }
        Source::Point { position, .. } | Source::Spot { position, .. } => {
            // The light at s = 0, the ball at s = 1, and between them balls of radius s r: the distance to these is
            // convex in s, and least where its slope is zero.
            let (way, off) = (to.center - position, from.center - position);
            let distance = way.length();
            let sine = to.radius / distance;
            let least = if sine < 1.0 {
                let along = off.dot(way) / distance;
                let beside = (off - way * (along / distance)).length();
                ((along + beside * sine / (1.0 - sine * sine).sqrt()) / distance).clamp(0.0, 1.0)
            } else {
                1.0
            };
            (off - way * least).length() - to.radius * least <= reach
        }
        Source::Area { .. } => true,
    }
}

/// Whether a plane may stand between a light and some point of a ball.
fn plane_stands_between(source: &Source, (point, normal): (DVec3, DVec3), to: &Ball, slack: f64) -> bool {
    let height = normal.dot(to.center - point);
    let light = match *source {
        Source::Directional { direction, .. } => normal.dot(-direction.normalize()) * f64::INFINITY,
        Source::Point { position, .. } | Source::Spot { position, .. } => normal.dot(position - point),
        Source::Area { .. } => return true,
    };
    let side = light * height.signum();
    // NaN: the light comes along the plane.
    height.abs() <= to.radius + slack || side.is_nan() || side <= slack
}

/// Whether a surface whose front faces a light cannot shadow itself.
fn is_convex(shape: &Shape) -> bool {
    match shape {
        Shape::Sphere(_) | Shape::Plane(_) | Shape::Disk(_) | Shape::Polygon(_) | Shape::Box(_) => true,
        Shape::Cylinder(cylinder) => cylinder.caps,
        Shape::Cone(cone) => cone.caps,
    }
}

/// By light: the primitives that nothing can put in its shadow, `None` where there are none or it was not looked.
pub fn unshadowed(scene: &Scene, needed: &[bool], origin: DVec3, skips: &mut Skips) -> Vec<Option<Vec<bool>>> {
    let count = scene.primitive_count();
    if count > MOST_PAIRS {
        return vec![None; scene.lights.len()];
    }
    let shapes: Vec<Shape> = scene.primitives().map(|primitive| primitive.shape.into_owned()).collect();
    let body = |shape: &Shape| match (shape, Ball::around(shape)) {
        (Shape::Plane(plane), _) => Some(Body::Plane(plane.point, plane.normal.normalize())),
        (_, ball) => ball.map(Body::Ball),
    };
    let bodies: Vec<Option<Body>> = shapes.iter().map(body).collect();
    let is_free = |light: &Light, index: usize| {
        let Some(Body::Ball(to)) = &bodies[index] else { return count == 1 && is_convex(&shapes[index]) };
        let place = match light.source {
            Source::Point { position, .. } | Source::Spot { position, .. } => (position - origin).length(),
            Source::Directional { .. } => 0.0,
            // Its shadow rays go to all of it.
            Source::Area { .. } => return false,
        };
        let slack = to.slack(origin) + 2e-5 * place;
        let clear = |body: &Option<Body>| match body {
            Some(Body::Ball(from)) => !stands_between(&light.source, from, to, slack + from.slack(origin)),
            Some(Body::Plane(point, normal)) => !plane_stands_between(&light.source, (*point, *normal), to, slack),
            None => false,
        };
        is_convex(&shapes[index]) && bodies.iter().enumerate().all(|(other, body)| other == index || clear(body))
    };
    let of_light = |(light, needed): (&Light, &bool)| {
        let free: Vec<bool> = (0..count).map(|index| *needed && light.shadows && is_free(light, index)).collect();
        free.contains(&true).then_some(free)
    };
    let unshadowed: Vec<Option<Vec<bool>>> = scene.lights.iter().zip(needed).map(of_light).collect();
    let free: usize = unshadowed.iter().flatten().flatten().filter(|free| **free).count();
    let pairs = count * scene.lights.len();
    let why = || format!("nothing can stand between light and primitive in {free} of {pairs} pairs of them");
    skips.decide(Skip::Occlusion, 0, (free > 0).then(why));
    unshadowed
}

/// Whether anything lies where a light shines: in a spot's cone, before something flat.
pub fn meets_anything(source: &Source, scene: &Scene) -> bool {
    let is_met = |may_meet: &dyn Fn(Ball) -> bool| {
        scene.primitives().any(|primitive| Ball::around(&primitive.shape).is_none_or(may_meet))
    };
    match source {
        Source::Point { .. } | Source::Directional { .. } => true,
        Source::Spot { position, direction, cone, .. } => {
            let axis = direction.normalize();
            is_met(&|ball| {
                let way = ball.center - position;
                let distance = way.length();
                let half = (ball.radius / distance).min(1.0).asin();
                ball.radius >= distance || axis.angle_between(way) <= cone.to_radians() + half + 1e-3
            })
        }
        Source::Area { emitter, .. } => {
            let (point, normal) = match emitter {
                Emitter::Sphere { .. } => return true,
                Emitter::Disk { center, normal, .. } => (*center, normal.normalize()),
                Emitter::Polygon(polygon) => (polygon.corners[0], polygon.normal()),
            };
            is_met(&|ball| normal.dot(ball.center - point) > -(1.001 * ball.radius + ball.slack(point)))
        }
    }
}

/// A camera and the pixels that are asked of it.
#[derive(Debug, Clone, Copy)]
pub struct Sight<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Width and height of the whole picture in pixels.
    pub display: (u32, u32),
    /// x0, y0, x1, y1 of the pixels, the last ones excluded.
    pub window: [i32; 4],
    /// How far rays are from the centres of their pixels, at most, in pixels.
    pub reach: f64,
    /// What is made of what it sees.
    pub settings: &'a RenderSettings,
}

/// The sides of what a camera sees: points with `normal . (point - eye) <= 0` for all of them.
struct Frustum {
    eye: DVec3,
    forward: DVec3,
    /// Along the middle, one unit forward.
    middle: DVec3,
    sides: [DVec3; 4],
}

impl Frustum {
    fn new(sight: &Sight) -> Option<Frustum> {
        let Lens::Pinhole { vfov } = sight.camera.lens else { return None };
        let (right, up, forward) = sight.camera.axes();
        let (width, height) = (f64::from(sight.display.0), f64::from(sight.display.1));
        let scale = (vfov.to_radians() / 2.0).tan() * 2.0 / height;
        let [x0, y0, x1, y1] = sight.window.map(f64::from);
        let margin = sight.reach + 1.0;
        let x = [x0 - margin, x1 + margin].map(|x| (x - width / 2.0) * scale);
        let y = [y0 - margin, y1 + margin].map(|y| (height / 2.0 - y) * scale);
        let sides = [-right + forward * x[0], right - forward * x[1], up - forward * y[0], -up + forward * y[1]];
        let middle = forward + right * (0.5 * (x[0] + x[1])) + up * (0.5 * (y[0] + y[1]));
        Some(Frustum { eye: sight.camera.eye, forward, middle, sides: sides.map(DVec3::normalize) })
    }

    fn sees(&self, ball: &Ball) -> bool {
        let off = ball.center - self.eye;
        let radius = ball.radius + ball.slack(self.eye);
        off.dot(self.forward) >= -radius && self.sides.iter().all(|side| side.dot(off) <= radius)
    }
}

/// Everything that is seen lies within `radius` of the way from one end to the other.
struct Seen {
    ends: [DVec3; 2],
    radius: f64,
}

impl Seen {
    fn of(frustum: &Frustum, balls: impl Iterator<Item = Ball>) -> Option<Seen> {
        let (mut near, mut far, mut radius) = (f64::INFINITY, 0.0f64, 0.0f64);
        for ball in balls.filter(|ball| frustum.sees(ball)) {
            let off = ball.center - frustum.eye;
            let depth = off.dot(frustum.forward).max(0.0);
            (near, far) = (near.min(depth), far.max(depth));
            radius = radius.max((off - frustum.middle * depth).length() + ball.radius + 2.0 * ball.slack(frustum.eye));
        }
        let at = |depth: f64| frustum.eye + frustum.middle * depth;
        (near <= far).then(|| Seen { ends: [at(near), at(far)], radius })
    }

    /// Whether a ball may throw a shadow on it.
    fn may_be_shadowed(&self, source: &Source, ball: &Ball) -> bool {
        let light = match source {
            Source::Point { position, .. } | Source::Spot { position, .. } => Ball { center: *position, radius: 0.0 },
            Source::Area { emitter, .. } => match Ball::around(&emitter.shape()) {
                Some(light) => light,
                None => return true,
            },
            Source::Directional { direction, .. } => {
                // Seen along the light all of it is flat.
                let way = direction.normalize();
                let flat = |point: DVec3| (point - ball.center).reject_from_normalized(way);
                let (a, b) = (flat(self.ends[0]), flat(self.ends[1]));
                return distance_to_triangle(DVec3::ZERO, a, b, b) <= self.radius + ball.radius;
            }
        };
        // A way from a light to what is seen is nowhere further from the triangle than at its ends.
        let [start, end] = self.ends;
        let radius = self.radius.max(light.radius) + light.slack(start) + ball.radius;
        distance_to_triangle(ball.center, light.center, start, end) <= radius * (1.0 + 1e-9)
    }
}

/// The distance of a point from a triangle, which may be flat.
fn distance_to_triangle(point: DVec3, a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let normal = (b - a).cross(c - a);
    let inside = |a: DVec3, b: DVec3| normal.cross(b - a).dot(point - a) >= 0.0;
    if normal.length_squared() > 0.0 && inside(a, b) && inside(b, c) && inside(c, a) {
        return normal.normalize().dot(point - a).abs();
    }
    let to_edge = |a: DVec3, b: DVec3| {
        let (edge, off) = (b - a, point - a);
        let length = edge.length_squared();
        let s = if length > 0.0 { (off.dot(edge) / length).clamp(0.0, 1.0) } else { 0.0 };
        (off - edge * s).length()
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

/// Whether a surface gets light from nowhere but the scene's lights.
fn has_direct_light_only(scene: &Scene, settings: &RenderSettings) -> bool {
    let looks_around = settings.ambient_occlusion && scene.ambient != DVec3::ZERO;
    let sky = scene.background.light && matches!(scene.background.backdrop, Backdrop::Image { .. });
    settings.integrator == Integrator::Direct && !sky && !looks_around
}

/// By primitive: whether it can be seen, or throw a shadow on what is. `None` where that leaves out less than a
/// quarter, by a sample of them, or cannot be told.
pub fn needed(scene: &Scene, lights: &[bool], sight: &Sight, skips: &mut Skips) -> Option<Vec<bool>> {
    let is_asked = skips.allows(Skip::Objects) && has_direct_light_only(scene, sight.settings);
    let frustum = Frustum::new(sight).filter(|_| is_asked)?;
    let count = scene.primitive_count();
    let step = (count / 1000).max(1);
    let ball = |index: usize| scene.primitive(index).and_then(|primitive| Ball::around(&primitive.shape));
    let some: Vec<usize> = (0..count).step_by(step).collect();
    let beside = some.iter().filter(|index| ball(**index).is_some_and(|ball| !frustum.sees(&ball))).count();
    let has_planes = scene.objects.iter().any(|object| matches!(object.shape, Shape::Plane(_)));
    let casts = |(light, needed): (&Light, &bool)| *needed && light.shadows;
    let casting: Vec<&Source> = scene
        .lights
        .iter()
        .zip(lights)
        .filter(|entry| casts((entry.0, entry.1)))
        .map(|entry| &entry.0.source)
        .collect();
    if beside * 4 < some.len() || (has_planes && !casting.is_empty()) {
        return None;
    }
    let balls: Vec<Option<Ball>> = scene.primitives().map(|primitive| Ball::around(&primitive.shape)).collect();
    let seen = Seen::of(&frustum, balls.iter().flatten().copied());
    let keep = |ball: &Option<Ball>| {
        ball.is_none_or(|ball| {
            let shadows = |seen: &Seen| casting.iter().any(|source| seen.may_be_shadowed(source, &ball));
            frustum.sees(&ball) || seen.as_ref().is_some_and(shadows)
        })
    };
    let needed: Vec<bool> = balls.iter().map(keep).collect();
    let left = needed.iter().filter(|needed| !**needed).count();
    let why = || format!("{left} of {count} primitives are neither in the picture nor between it and a light");
    skips.decide(Skip::Objects, left as u64, (left > 0).then(why));
    (left > 0).then_some(needed)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIGHT: Source = Source::Point {
        position: DVec3::new(0.0, 10.0, 0.0),
        intensity: DVec3::ONE,
        falloff: crate::scene::Falloff::None,
    };
    const SUN: Source = Source::Directional { direction: DVec3::NEG_Y, irradiance: DVec3::ONE };

    fn ball(x: f64, y: f64, radius: f64) -> Ball {
        Ball { center: DVec3::new(x, y, 0.0), radius }
    }

    #[test]
    fn what_stands_between_is_told_from_what_does_not() {
        for source in [LIGHT, SUN] {
            let to = ball(0.0, 0.0, 1.0);
            assert!(stands_between(&source, &ball(0.5, 5.0, 0.1), &to, 0.0));
            assert!(!stands_between(&source, &ball(1.5, 5.0, 0.1), &to, 0.0));
            assert!(!stands_between(&source, &ball(0.0, -5.0, 0.1), &to, 0.0), "behind");
            assert!(stands_between(&source, &ball(1.5, 0.0, 0.5), &to, 0.0), "touching");
        }
        assert!(!stands_between(&LIGHT, &ball(0.5, 8.0, 0.1), &ball(0.0, 0.0, 1.0), 0.0), "beside the cone");
        assert!(stands_between(&SUN, &ball(0.5, 80.0, 0.1), &ball(0.0, 0.0, 1.0), 0.0));
        let floor = (DVec3::new(0.0, -2.0, 0.0), DVec3::Y);
        assert!(!plane_stands_between(&LIGHT, floor, &ball(0.0, 0.0, 1.0), 0.0));
        assert!(plane_stands_between(&LIGHT, floor, &ball(0.0, -4.0, 1.0), 0.0));
        assert!(plane_stands_between(&LIGHT, floor, &ball(0.0, -1.0, 1.0), 1e-6), "resting on it");
    }

    #[test]
    fn distances_to_triangles_are_those_of_their_nearest_points() {
        let [a, b, c] = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(0.0, 4.0, 0.0)];
        for (point, distance) in [
            (DVec3::new(1.0, 1.0, 3.0), 3.0),
            (DVec3::new(-3.0, 1.0, 0.0), 3.0),
            (DVec3::new(4.0, 4.0, 0.0), 8f64.sqrt()),
            (DVec3::new(7.0, -4.0, 0.0), 5.0),
        ] {
            for [a, b, c] in [[a, b, c], [b, a, c], [c, b, a]] {
                assert!((distance_to_triangle(point, a, b, c) - distance).abs() < 1e-12, "{point}");
            }
        }
        assert!((distance_to_triangle(DVec3::new(0.0, 5.0, 0.0), a, b, b) - 5.0).abs() < 1e-12);
    }
}
