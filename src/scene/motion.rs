//! Where points go from one frame to the next: with the shapes that they lie on, and on the picture.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::{Camera, Cuboid, Lens, Scene, Shape};

/// The place of a point of the scene in another frame of it, where the primitive that it lies on may have moved.
/// Primitives are the same by index and kind; a point on anything else stays.
pub fn carried(from: &Scene, to: &Scene, primitive: usize, point: DVec3) -> DVec3 {
    let (before, after) = (from.primitive(primitive), to.primitive(primitive));
    match (before, after) {
        (Some(before), Some(after)) if before.shape == after.shape => None,
        (Some(before), Some(after)) => along(&before.shape, &after.shape, point).filter(|point| point.is_finite()),
        _ => None,
    }
    .unwrap_or(point)
}

/// The place of a point of a shape on what the shape has become; `None` where that is of another kind.
fn along(from: &Shape, to: &Shape, point: DVec3) -> Option<DVec3> {
    Some(match (from, to) {
        (Shape::Sphere(a), Shape::Sphere(b)) => b.center + (point - a.center) * (b.radius / a.radius),
        (Shape::Plane(a), Shape::Plane(b)) => b.point + turn(a.normal, b.normal) * (point - a.point),
        (Shape::Disk(a), Shape::Disk(b)) => {
            b.center + turn(a.normal, b.normal) * (point - a.center) * (b.radius / a.radius)
        }
        (Shape::Polygon(a), Shape::Polygon(b)) => {
            let frame = |corners: &[DVec3], normal: DVec3| {
                let edge = corners[1] - corners[0];
                let x = edge.normalize();
                DMat3::from_cols(x, normal.cross(x), normal) * edge.length()
            };
            let (a, b) = ((a.corners[0], frame(&a.corners, a.normal())), (b.corners[0], frame(&b.corners, b.normal())));
            b.0 + b.1 * (a.1.inverse() * (point - a.0))
        }
        (Shape::Box(a), Shape::Box(b)) => {
            let parts = |cuboid: &Cuboid| {
                let half = (cuboid.max - cuboid.min) / 2.0;
                (cuboid.min + half, half, cuboid.rotation.unwrap_or(DQuat::IDENTITY))
            };
            let ((center, half, rotation), (to_center, to_half, to_rotation)) = (parts(a), parts(b));
            to_center + to_rotation * (rotation.inverse() * (point - center) / half * to_half)
        }
        (Shape::Cylinder(a), Shape::Cylinder(b)) => {
            mantle([a.base, a.apex], [a.radius; 2], [b.base, b.apex], [b.radius; 2], point)
        }
        (Shape::Cone(a), Shape::Cone(b)) => {
            let radii = ([a.radius, a.apex_radius], [b.radius, b.apex_radius]);
            mantle([a.base, a.apex], radii.0, [b.base, b.apex], radii.1, point)
        }
        _ => return None,
    })
}

/// Keeps the share of the height, and the direction and share of the radius.
fn mantle(from: [DVec3; 2], radii: [f64; 2], to: [DVec3; 2], to_radii: [f64; 2], point: DVec3) -> DVec3 {
    let (axis, to_axis) = (from[1] - from[0], to[1] - to[0]);
    let share = (point - from[0]).dot(axis) / axis.length_squared();
    let radius = |radii: [f64; 2]| radii[0] + share * (radii[1] - radii[0]);
    let off = point - (from[0] + axis * share);
    let scale = if radius(radii) > 0.0 { radius(to_radii) / radius(radii) } else { 0.0 };
    to[0] + to_axis * share + turn(axis, to_axis) * off * scale
}

/// The shortest turn between two directions of any length.
fn turn(from: DVec3, to: DVec3) -> DQuat {
    DQuat::from_rotation_arc(from.normalize(), to.normalize())
}

impl Camera {
    /// The point of the picture (see [`Lens`]) that shows a point of the world; `None` for one that is not before
    /// the camera. A thin lens shows it where its middle does.
    pub fn project(&self, display: (u32, u32), point: DVec3) -> Option<DVec2> {
        let (width, height) = (f64::from(display.0), f64::from(display.1));
        let (right, up, forward) = self.axes();
        let way = point - self.eye;
        let (x, y, z) = (way.dot(right), way.dot(up), way.dot(forward));
        let plane = |sx: f64, sy: f64| DVec2::new(sx * height + width, height - sy * height) / 2.0;
        match self.lens {
            Lens::Pinhole { vfov } | Lens::ThinLens { vfov, .. } => {
                let scale = z * (vfov.to_radians() / 2.0).tan();
                (z > 0.0).then(|| plane(x / scale, y / scale))
            }
            Lens::Orthographic { height } => Some(plane(2.0 * x / height, 2.0 * y / height)),
            Lens::Panoramic => {
                let (azimuth, polar) = (x.atan2(z), (y / way.length()).clamp(-1.0, 1.0).acos());
                (way != DVec3::ZERO).then(|| DVec2::new((azimuth / TAU + 0.5) * width, polar / PI * height))
            }
        }
    }

    /// How far a point of the picture moves: pixels right and up. Round a panorama, the shorter way.
    pub fn motion(&self, display: (u32, u32), before: DVec2, after: DVec2) -> DVec2 {
        let mut way = after - before;
        if self.lens == Lens::Panoramic {
            let width = f64::from(display.0);
            way.x -= (way.x / width).round() * width;
        }
        DVec2::new(way.x, -way.y)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Cone, Cylinder, Disk, Polygon, Sphere};
    use super::*;

    /// What a turn and a move do to a shape, they do to the points on it.
    #[test]
    fn points_go_with_their_shapes() {
        // About the axes of revolution of disks and mantles nothing can be told apart, so they are turned across.
        let rotation = DQuat::from_rotation_y(0.7);
        let moved = |point: DVec3| rotation * point + DVec3::new(1.0, -2.0, 0.5);
        let (a, b, c) = (DVec3::new(1.0, 0.0, 2.0), DVec3::new(0.0, 0.0, -1.0), DVec3::new(0.3, 2.0, 1.0));
        let sphere = |center| Shape::Sphere(Sphere { center, radius: 2.0 });
        let cylinder = |base, apex| Shape::Cylinder(Cylinder { base, apex, radius: 0.5, caps: true });
        let cone = |base, apex| Shape::Cone(Cone { base, apex, radius: 1.0, apex_radius: 0.25, caps: true });
        let polygon = |corners: [DVec3; 3]| Shape::Polygon(Polygon { corners: corners.to_vec(), ..Polygon::default() });
        let disk = |center, normal| Shape::Disk(Disk { center, normal, radius: 1.0, inner_radius: 0.0 });
        let cuboid = |rotation, shift: DVec3| {
            Shape::Box(Cuboid { min: shift - DVec3::ONE, max: shift + DVec3::ONE, rotation: Some(rotation) })
        };
        let (x, z) = (DVec3::X, DVec3::Z);
        let pairs = [
            (cylinder(a, a + x), cylinder(moved(a), moved(a + x))),
            (cone(a, a + z), cone(moved(a), moved(a + z))),
            (polygon([a, b, c]), polygon([moved(a), moved(b), moved(c)])),
            (disk(a, z), disk(moved(a), rotation * z)),
            (cuboid(DQuat::IDENTITY, a), cuboid(rotation, moved(a))),
        ];
        for (from, to) in pairs {
            let point = a + DVec3::new(0.3, 0.1, 0.2);
            let got = along(&from, &to, point).unwrap();
            assert!((got - moved(point)).length() < 1e-12, "{from:?}: {got} {}", moved(point));
        }
        let grown = along(&sphere(a), &Shape::Sphere(Sphere { center: b, radius: 4.0 }), a + 2.0 * x);
        assert_eq!(grown, Some(b + 4.0 * x));
        assert_eq!(along(&sphere(a), &disk(a, z), a), None);
    }

    #[test]
    fn a_point_is_shown_where_its_ray_goes() {
        let lenses = [
            Lens::Pinhole { vfov: 50.0 },
            Lens::Orthographic { height: 3.0 },
            Lens::ThinLens { vfov: 50.0, aperture: 0.1, focus: 3.0 },
            Lens::Panoramic,
        ];
        for lens in lenses {
            let (eye, target) = (DVec3::new(3.0, -2.0, 5.0), DVec3::new(-1.0, 0.5, 0.25));
            let camera = Camera { name: None, eye, target, up: DVec3::Y, lens };
            let middle = camera.project((64, 48), target).unwrap();
            assert!((middle - DVec2::new(32.0, 24.0)).length() < 1e-9, "{lens:?}");
            let (right, up, _) = camera.axes();
            let off = camera.project((64, 48), target + 0.1 * right + 0.2 * up).unwrap();
            let motion = camera.motion((64, 48), middle, off);
            assert!(motion.x > 0.1 && motion.y > motion.x, "{lens:?} {motion}");
        }
        let panorama = Camera {
            lens: Lens::Panoramic,
            ..Camera { name: None, eye: DVec3::ZERO, target: DVec3::Z, up: DVec3::Y, lens: lenses[0] }
        };
        let round = panorama.motion((64, 32), DVec2::new(63.0, 9.0), DVec2::new(1.0, 9.0));
        assert_eq!(round, DVec2::new(2.0, 0.0));
    }
}
