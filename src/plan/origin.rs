//! Where f32 coordinates are relative to, and what camera rays round by there.
//!
//! Beside the eye nothing is lost near it, which is where most is seen. Through a lens so long that a pixel is as small as
//! what f32 rounds a place at that distance by, it is the other way round: coordinates are relative to what is seen, and
//! camera rays, whose hits are decided in f64 anyway, meet their surfaces in f64 ([`Plan::sharp`](super::Plan)).

use glam::DVec3;

use super::reach::Sight;
use crate::scene::{Camera, Lens, Scene, Shape, bounding_balls};

/// A pixel that covers less than this share of the distance is seen through a long lens: some thousand roundings.
const NARROW: f64 = 1e-4;
/// A sphere is a speck where the eye is so many times its radius away, counted along the normal: f32 rounds normals by as
/// many roundings, and by more the flatter a ray meets the sphere.
pub const SPECK: f64 = 128.0;
/// Rays that meet a sphere more flatly are few: the cosine.
const FLAT: f64 = 1.0 / 8.0;
/// A scene is far where the eye is away from its middle so many times its radius.
const FAR: f64 = 8.0;

/// Whether a pixel of a picture of so many rows covers so little of what is `distance` away that f32 shows.
pub fn is_narrow(camera: &Camera, rows: u32, distance: f64) -> bool {
    let rows = f64::from(rows);
    match camera.lens {
        Lens::Pinhole { vfov } | Lens::ThinLens { vfov, .. } => vfov.to_radians() / rows < NARROW,
        Lens::Orthographic { height } => height / rows < NARROW * distance,
        Lens::Panoramic => false,
    }
}

/// What coordinates are relative to in a picture of so many rows, and whether camera rays should meet surfaces in f64.
///
/// It is the eye, or a point of the scene, so that a scene that is moved keeps its coordinates to the bit.
pub fn origin(scene: &Scene, camera: &Camera, rows: u32) -> (DVec3, bool) {
    let eye = camera.eye;
    // Of a pinhole's the angle is enough to know that there is nothing to look for.
    if !is_narrow(camera, rows, f64::INFINITY) {
        return (eye, false);
    }
    let Some((middle, radius)) = extent(scene, eye) else { return (eye, is_narrow(camera, rows, 0.0)) };
    let distance = middle.length();
    let sharp = is_narrow(camera, rows, distance + radius);
    if !sharp || distance <= FAR * radius {
        return (eye, sharp);
    }
    let off = |point: DVec3| (point - eye - middle).length_squared();
    let points = scene.primitives().filter_map(|primitive| point_of(&primitive.shape));
    (points.min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(eye), true)
}

/// Whether any sphere is a speck seen from the eye, be it where rays meet it flatly.
pub fn has_specks(scene: &Scene, eye: DVec3) -> bool {
    scene.primitives().any(|primitive| match &*primitive.shape {
        Shape::Sphere(sphere) => (sphere.center - eye).length_squared() > (FLAT * SPECK * sphere.radius).powi(2),
        Shape::Plane(_) | Shape::Disk(_) | Shape::Polygon(_) => false,
        Shape::Box(_) | Shape::Cylinder(_) | Shape::Cone(_) => false,
    })
}

/// The middle of all that has bounds, relative to the eye, and how far it reaches from there, by the boxes of it.
fn extent(scene: &Scene, eye: DVec3) -> Option<(DVec3, f64)> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut balls = Vec::new();
    for primitive in scene.primitives() {
        balls.clear();
        bounding_balls(&primitive.shape, &mut balls);
        for (center, radius) in &balls {
            let place = *center - eye;
            (low, high) = (low.min(place - *radius), high.max(place + *radius));
        }
    }
    (low.x <= high.x).then(|| (0.5 * (low + high), 0.5 * (high - low).length()))
}

/// A point of a shape, as the scene says it; planes have none that is as good as another.
fn point_of(shape: &Shape) -> Option<DVec3> {
    match shape {
        Shape::Sphere(sphere) => Some(sphere.center),
        Shape::Plane(_) => None,
        Shape::Disk(disk) => Some(disk.center),
        Shape::Polygon(polygon) => polygon.corners.first().copied(),
        Shape::Box(cuboid) => Some(cuboid.min),
        Shape::Cylinder(cylinder) => Some(cylinder.base),
        Shape::Cone(cone) => Some(cone.base),
    }
}

/// The most that the coordinates of origins of camera rays are, relative to `origin`: what they round by in f32 is in
/// proportion to that.
pub fn origins(sight: &Sight, origin: DVec3) -> DVec3 {
    let Sight { camera, display: (width, height), window: [x0, y0, x1, y1], reach, .. } = *sight;
    let eye = (camera.eye - origin).abs();
    let (right, up, _) = camera.axes();
    match camera.lens {
        Lens::Pinhole { .. } | Lens::Panoramic => eye,
        Lens::ThinLens { aperture, .. } => eye + aperture * (right.abs() + up.abs()),
        Lens::Orthographic { height: size } => {
            let most = |from: i32, to: i32, pixels: u32| {
                let middle = 0.5 * f64::from(pixels);
                (f64::from(from) - middle).abs().max((f64::from(to) - middle).abs()) + reach
            };
            let pixel = size / f64::from(height);
            eye + pixel * (right.abs() * most(x0, x1, width) + up.abs() * most(y0, y1, height))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Object, Sphere};

    fn seen(eye: DVec3, lens: Lens) -> (DVec3, bool) {
        let sphere = |x: f64| Shape::Sphere(Sphere { center: DVec3::new(x, 0.1, 0.2), radius: 1.0 });
        let object = |shape| Object { shape, material: 0, name: None, group: None };
        let objects = [-3.0, 0.25, 3.0].map(sphere).map(object).to_vec();
        let camera = Camera { name: None, eye, target: DVec3::ZERO, up: DVec3::Y, lens };
        origin(&Scene { objects, ..Scene::default() }, &camera, 480)
    }

    #[test]
    fn long_lenses_have_what_they_see_for_an_origin() {
        let (near, far) = (DVec3::new(0.0, 0.0, 9.0), DVec3::new(0.0, 0.0, 1e6));
        assert_eq!(seen(near, Lens::Pinhole { vfov: 45.0 }), (near, false));
        assert_eq!(seen(far, Lens::Pinhole { vfov: 45.0 }), (far, false));
        assert_eq!(seen(near, Lens::Pinhole { vfov: 0.5 }), (near, true));
        assert_eq!(seen(near, Lens::Orthographic { height: 8.0 }), (near, false));
        assert_eq!(seen(far, Lens::Panoramic), (far, false));
        let middle = DVec3::new(0.25, 0.1, 0.2);
        assert_eq!(seen(far, Lens::Pinhole { vfov: 5e-4 }), (middle, true));
        assert_eq!(seen(far, Lens::Orthographic { height: 8.0 }), (middle, true));
    }
}
