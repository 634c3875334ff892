//! Where a camera must stand to see a whole scene.

use glam::{DVec2, DVec3};

use super::{Camera, CloudShapes, Lens, Rows, Scene, Shape};

/// Room around the scene: the picture is so much larger.
const MARGIN: f64 = 1.06;

/// Where a camera stands and what it looks at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// World coordinates.
    pub eye: DVec3,
    /// World coordinates.
    pub target: DVec3,
}

/// The way to the eye of a camera whose `up` is given: from the front, a little from the right and from above. The
/// front is +z, or -y where +z is up.
pub fn direction(up: DVec3) -> DVec3 {
    let up = up.normalize();
    let front = if up.z.abs() < 0.9 { DVec3::Z } else { DVec3::NEG_Y };
    let front = front.reject_from(up).normalize();
    (front + 0.3 * up.cross(front) + 0.25 * up).normalize()
}

/// A ball around everything but planes: centre and radius.
pub fn ball(scene: &Scene) -> (DVec3, f64) {
    around_all(scene).unwrap_or((DVec3::ZERO, 1.0))
}

/// Balls that hold a scene, one after the other: a million spheres are not copied for it.
fn each_ball(scene: &Scene, mut each: impl FnMut(DVec3, f64)) {
    let mut balls = Vec::new();
    scene.objects.iter().for_each(|object| bound(&object.shape, &mut balls));
    balls.drain(..).for_each(|(center, radius)| each(center, radius));
    for cloud in &scene.clouds {
        match &cloud.shapes {
            CloudShapes::Spheres(Rows::F64(rows)) => {
                rows.iter().for_each(|[x, y, z, radius]| each(DVec3::new(*x, *y, *z), *radius));
            }
            shapes => (0..shapes.len()).for_each(|row| {
                bound(&shapes.shape(row), &mut balls);
                balls.drain(..).for_each(|(center, radius)| each(center, radius));
            }),
        }
    }
}

fn around_all(scene: &Scene) -> Option<(DVec3, f64)> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    each_ball(scene, |center, radius| (low, high) = (low.min(center - radius), high.max(center + radius)));
    let (center, mut reach) = (0.5 * (low + high), 0f64);
    each_ball(scene, |ball, radius| reach = reach.max((ball - center).length() + radius));
    (low.x <= high.x).then_some((center, reach))
}

/// The view of everything but planes, as near as the lens and the shape of the picture (`aspect`: width over height)
/// allow; `around`: from a distance that is right for all directions.
pub fn view(scene: &Scene, camera: &Camera, aspect: f64, around: bool) -> View {
    let direction = direction(camera.up);
    let Some((center, radius)) = around_all(scene) else {
        return View { eye: direction, target: DVec3::ZERO };
    };
    let vfov = match camera.lens {
        Lens::Pinhole { vfov } | Lens::ThinLens { vfov, .. } => vfov,
        Lens::Orthographic { .. } | Lens::Panoramic => {
            return View { eye: center + 3.0 * radius * direction, target: center };
        }
    };
    let tan = (0.5 * vfov).to_radians().tan() / MARGIN;
    let tans = DVec2::new(tan * aspect, tan);
    if around {
        let distance = radius / tans.min_element().atan().sin();
        return View { eye: center + distance * direction, target: center };
    }
    let facing = Camera { eye: center + direction, target: center, ..camera.clone() };
    tight(scene, center, facing.axes(), tans)
}

/// The nearest place from which all balls are inside the four sides of the frustum.
///
/// A side with the half angle a holds a ball at (x, z) of radius r, z the way forward, if
/// `cos a (x - eye_x) - sin a (z - eye_z) + r <= 0`; the greatest of the two opposite sides over all balls are two
/// equations for the eye.
fn tight(scene: &Scene, center: DVec3, axes: (DVec3, DVec3, DVec3), tans: DVec2) -> View {
    let (right, up, forward) = axes;
    let sides = [(right, tans.x), (up, tans.y)].map(|(sideways, tan)| (sideways, tan.atan().sin_cos()));
    let mut most = [[f64::NEG_INFINITY; 2]; 2];
    each_ball(scene, |ball, radius| {
        let z = (ball - center).dot(forward);
        for ((sideways, (sin, cos)), [plus, minus]) in sides.iter().zip(&mut most) {
            let x = (ball - center).dot(*sideways);
            *plus = plus.max(cos * x - sin * z + radius);
            *minus = minus.max(-cos * x - sin * z + radius);
        }
    });
    let mut eye = DVec3::new(0.0, 0.0, f64::INFINITY);
    for (axis, ((_, (sin, cos)), [plus, minus])) in sides.into_iter().zip(most).enumerate() {
        eye[axis] = (plus - minus) / (2.0 * cos);
        eye.z = eye.z.min(-(plus + minus) / (2.0 * sin));
    }
    let sideways = center + eye.x * right + eye.y * up;
    View { eye: sideways + eye.z * forward, target: sideways }
}

impl Shape {
    /// Adds balls (centre, radius) whose convex hull holds the shape; planes have none.
    pub fn balls(&self, balls: &mut Vec<(DVec3, f64)>) {
        bound(self, balls);
    }
}

/// Balls that hold a shape; planes have none.
pub fn bound(shape: &Shape, balls: &mut Vec<(DVec3, f64)>) {
    match shape {
        Shape::Sphere(sphere) => balls.push((sphere.center, sphere.radius)),
        Shape::Plane(_) => {}
        Shape::Disk(disk) => balls.push((disk.center, disk.radius)),
        Shape::Polygon(polygon) => balls.extend(polygon.corners.iter().map(|corner| (*corner, 0.0))),
        Shape::Box(cuboid) => {
            let (center, half) = (0.5 * (cuboid.min + cuboid.max), 0.5 * (cuboid.max - cuboid.min));
            let turned = |corner: DVec3| cuboid.rotation.map_or(corner, |rotation| rotation * corner);
            for corner in 0..8 {
                let sign = |bit: u32| if corner >> bit & 1 == 0 { 1.0 } else { -1.0 };
                balls.push((center + turned(half * DVec3::new(sign(0), sign(1), sign(2))), 0.0));
            }
        }
        Shape::Cylinder(cylinder) => balls.extend([(cylinder.base, cylinder.radius), (cylinder.apex, cylinder.radius)]),
        Shape::Cone(cone) => balls.extend([(cone.base, cone.radius), (cone.apex, cone.apex_radius)]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Cloud, CloudMaterial};

    /// Every ball is inside the picture, and on each pair of opposite sides or the other one some ball touches.
    #[test]
    fn everything_is_in_the_picture_and_nothing_could_be_nearer() {
        let rows = vec![[5.0, 1.0, -2.0, 0.5], [-3.0, 0.2, 4.0, 2.0], [0.0, 6.0, 0.0, 0.1], [1.0, -2.0, 9.0, 1.0]];
        let shapes = CloudShapes::Spheres(Rows::F64(rows.clone()));
        let cloud = Cloud { shapes, material: CloudMaterial::One(0), colors: None, name: None, group: None };
        let scene = Scene { clouds: vec![cloud], ..Scene::default() };
        for (vfov, aspect, up) in [(30.0, 1.5, DVec3::Y), (80.0, 0.3, DVec3::new(0.2, 0.1, 2.0)), (10.0, 1.0, DVec3::X)]
        {
            let lens = Lens::Pinhole { vfov };
            let camera = Camera { name: None, eye: DVec3::ZERO, target: DVec3::X, up, lens };
            for around in [false, true] {
                let View { eye, target } = view(&scene, &camera, aspect, around);
                let (right, true_up, forward) = Camera { eye, target, ..camera.clone() }.axes();
                let tan = 0.5f64 * vfov.to_radians();
                let mut most = f64::NEG_INFINITY;
                for (axis, tan) in [(right, tan.tan() * aspect), (true_up, tan.tan())] {
                    let (sin, cos) = (tan / MARGIN).atan().sin_cos();
                    for [x, y, z, radius] in &rows {
                        let ball = DVec3::new(*x, *y, *z) - eye;
                        let beyond = cos * ball.dot(axis).abs() - sin * ball.dot(forward) + radius;
                        assert!(beyond < 1e-9, "{beyond} {around}");
                        most = most.max(beyond);
                    }
                }
                assert!(around || most > -1e-9, "{most}");
            }
        }
    }
}
