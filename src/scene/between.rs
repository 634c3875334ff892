//! A scene between two of its frames: what moves goes straight from the one to the other, cameras round their targets.
//!
//! Shapes, lights, cameras and rows of clouds are the same by index and kind; what has no counterpart stays as it is in
//! the first frame, and so do colours and all else that is no place.

use glam::{DQuat, DVec3};

use super::{Camera, Cloud, CloudShapes, Cuboid, Emitter, Lens, Light, Polygon, Rows, Scene, Shape, Source};

/// Rows of a cloud from which on one that jumps is taken for one that left a periodic cell on one side and entered it on
/// the other.
const CROWD: usize = 16;
/// Share of the cloud's extent that is a jump.
const JUMP: f64 = 0.45;

impl Scene {
    /// The scene at `share` (0 to 1) of the way from this frame to the next one.
    pub fn between(&self, next: &Scene, share: f64) -> Scene {
        let mut scene = self.clone();
        for (camera, to) in scene.cameras.iter_mut().zip(&next.cameras) {
            *camera = camera.between(to, share);
        }
        for (light, to) in scene.lights.iter_mut().zip(&next.lights) {
            *light = Light { source: source(&light.source, &to.source, share), ..light.clone() };
        }
        for (object, to) in scene.objects.iter_mut().zip(&next.objects) {
            object.shape = shape(&object.shape, &to.shape, share);
        }
        for (cloud, to) in scene.clouds.iter_mut().zip(&next.clouds) {
            move_rows(cloud, to, share);
        }
        scene
    }
}

impl Camera {
    /// Turned about its target and moved with it.
    fn between(&self, to: &Camera, share: f64) -> Camera {
        if self == to {
            return self.clone();
        }
        let (off, to_off) = (self.eye - self.target, to.eye - to.target);
        let turn = DQuat::IDENTITY.slerp(DQuat::from_rotation_arc(off.normalize(), to_off.normalize()), share);
        let target = self.target.lerp(to.target, share);
        let eye = target + turn * off * (mix(off.length(), to_off.length(), share) / off.length());
        let lens = match (self.lens, to.lens) {
            (Lens::Pinhole { vfov: a }, Lens::Pinhole { vfov: b }) => Lens::Pinhole { vfov: mix(a, b, share) },
            (Lens::Orthographic { height: a }, Lens::Orthographic { height: b }) => {
                Lens::Orthographic { height: mix(a, b, share) }
            }
            (Lens::ThinLens { vfov: a, aperture, focus }, Lens::ThinLens { vfov: b, aperture: r, focus: f }) => {
                Lens::ThinLens {
                    vfov: mix(a, b, share),
                    aperture: mix(aperture, r, share),
                    focus: mix(focus, f, share),
                }
            }
            (lens, _) => lens,
        };
        Camera { eye, target, up: direction(self.up, to.up, share), lens, ..self.clone() }
    }
}

fn mix(a: f64, b: f64, share: f64) -> f64 {
    a + share * (b - a)
}

/// From one direction to another; where they are opposite, the first one.
fn direction(a: DVec3, b: DVec3, share: f64) -> DVec3 {
    let way = a.normalize().lerp(b.normalize(), share);
    if a == b || way.length() < 1e-6 { a } else { way }
}

fn shape(from: &Shape, to: &Shape, share: f64) -> Shape {
    let point = |a: DVec3, b: DVec3| a.lerp(b, share);
    let mut moved = from.clone();
    match (&mut moved, to) {
        (Shape::Sphere(a), Shape::Sphere(b)) => {
            (a.center, a.radius) = (point(a.center, b.center), mix(a.radius, b.radius, share));
        }
        (Shape::Plane(a), Shape::Plane(b)) => {
            (a.point, a.normal) = (point(a.point, b.point), direction(a.normal, b.normal, share));
        }
        (Shape::Disk(a), Shape::Disk(b)) => {
            (a.center, a.normal) = (point(a.center, b.center), direction(a.normal, b.normal, share));
            a.radius = mix(a.radius, b.radius, share);
            a.inner_radius = mix(a.inner_radius, b.inner_radius, share);
        }
        (Shape::Polygon(a), Shape::Polygon(b)) => polygon(a, b, share),
        (Shape::Box(a), Shape::Box(b)) => *a = cuboid(a, b, share),
        (Shape::Cylinder(a), Shape::Cylinder(b)) => {
            (a.base, a.apex, a.radius) = (point(a.base, b.base), point(a.apex, b.apex), mix(a.radius, b.radius, share));
        }
        (Shape::Cone(a), Shape::Cone(b)) => {
            (a.base, a.apex, a.radius) = (point(a.base, b.base), point(a.apex, b.apex), mix(a.radius, b.radius, share));
            a.apex_radius = mix(a.apex_radius, b.apex_radius, share);
        }
        _ => {}
    }
    moved
}

fn polygon(a: &mut Polygon, b: &Polygon, share: f64) {
    if a.corners.len() == b.corners.len() {
        a.corners.iter_mut().zip(&b.corners).for_each(|(a, b)| *a = a.lerp(*b, share));
    }
    if a.normals.len() == b.normals.len() {
        a.normals.iter_mut().zip(&b.normals).for_each(|(a, b)| *a = direction(*a, *b, share));
    }
}

fn cuboid(a: &Cuboid, b: &Cuboid, share: f64) -> Cuboid {
    let turn = |rotation: Option<DQuat>| rotation.unwrap_or(DQuat::IDENTITY).normalize();
    let rotation = match (a.rotation, b.rotation) {
        (None, None) => None,
        (from, to) => Some(turn(from).slerp(turn(to), share)),
    };
    Cuboid { min: a.min.lerp(b.min, share), max: a.max.lerp(b.max, share), rotation }
}

fn source(from: &Source, to: &Source, share: f64) -> Source {
    let mut moved = from.clone();
    match (&mut moved, to) {
        (Source::Point { position, .. }, Source::Point { position: b, .. }) => *position = position.lerp(*b, share),
        (Source::Directional { direction: a, .. }, Source::Directional { direction: b, .. }) => {
            *a = direction(*a, *b, share);
        }
        (Source::Spot { position, direction: a, .. }, Source::Spot { position: to, direction: b, .. }) => {
            (*position, *a) = (position.lerp(*to, share), direction(*a, *b, share));
        }
        (Source::Area { emitter: a, .. }, Source::Area { emitter: b, .. }) => match (&mut *a, b) {
            (Emitter::Sphere { center, radius }, Emitter::Sphere { center: b, radius: r }) => {
                (*center, *radius) = (center.lerp(*b, share), mix(*radius, *r, share));
            }
            (Emitter::Disk { center, normal, radius }, Emitter::Disk { center: b, normal: n, radius: r }) => {
                (*center, *normal) = (center.lerp(*b, share), direction(*normal, *n, share));
                *radius = mix(*radius, *r, share);
            }
            (Emitter::Polygon(a), Emitter::Polygon(b)) => polygon(a, b, share),
            _ => {}
        },
        _ => {}
    }
    moved
}

fn move_rows(cloud: &mut Cloud, to: &Cloud, share: f64) {
    if cloud.len() != to.len() {
        return;
    }
    match (&mut cloud.shapes, &to.shapes) {
        (CloudShapes::Spheres(a), CloudShapes::Spheres(b)) => rows(a, b, share),
        (CloudShapes::Disks(a), CloudShapes::Disks(b)) => rows(a, b, share),
        (CloudShapes::Boxes(a, turn), CloudShapes::Boxes(b, to)) => {
            rows(a, b, share);
            *turn = turn.zip(*to).map(|(turn, to)| turn.normalize().slerp(to.normalize(), share)).or(*turn);
        }
        (CloudShapes::Cylinders(a, _), CloudShapes::Cylinders(b, _)) => rows(a, b, share),
        (CloudShapes::Polygons { corners: a, starts }, CloudShapes::Polygons { corners: b, starts: same })
            if starts == same =>
        {
            rows(a, b, share);
        }
        _ => {}
    }
}

fn rows<const N: usize>(a: &mut Rows<N>, b: &Rows<N>, share: f64) {
    if a.len() != b.len() {
        return;
    }
    let jump = jump(a);
    let far = |a: &[f64; N], b: &[f64; N]| (0..3).any(|axis| (a[axis] - b[axis]).abs() > jump[axis]);
    for row in 0..a.len() {
        let (from, to) = (a.row(row), b.row(row));
        if from == to || far(&from, &to) {
            continue;
        }
        let moved: [f64; N] = std::array::from_fn(|k| mix(from[k], to[k], share));
        match a {
            Rows::F32(rows) => rows[row] = moved.map(|x| x as f32),
            Rows::F64(rows) => rows[row] = moved,
        }
    }
}

/// From which way on a row is taken to jump, by axis.
fn jump<const N: usize>(rows: &Rows<N>) -> [f64; 3] {
    if rows.len() < CROWD {
        return [f64::INFINITY; 3];
    }
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for row in (0..rows.len()).map(|row| rows.row(row)) {
        low = std::array::from_fn(|k| low[k].min(row[k]));
        high = std::array::from_fn(|k| high[k].max(row[k]));
    }
    std::array::from_fn(|k| if high[k] > low[k] { JUMP * (high[k] - low[k]) } else { f64::INFINITY })
}

#[cfg(test)]
mod tests {
    use super::super::{CloudMaterial, Sphere};
    use super::*;

    #[test]
    fn a_camera_on_its_orbit_stays_at_its_distance() {
        let lens = Lens::Pinhole { vfov: 40.0 };
        let from = Camera { name: None, eye: DVec3::new(3.0, 1.0, 2.0), target: DVec3::Y, up: DVec3::Y, lens };
        let to = Camera { eye: from.orbited(20.0), ..from.clone() };
        let half = from.between(&to, 0.5);
        assert!(((half.eye - half.target).length() - (from.eye - from.target).length()).abs() < 1e-12);
        assert!((half.eye - from.orbited(10.0)).length() < 1e-12, "at the height of its target: {}", half.eye);
        assert_eq!((from.between(&to, 0.0), from.between(&from, 0.7)), (from.clone(), from));
    }

    #[test]
    fn rows_go_straight_but_not_across_the_cell() {
        let place = |row: usize, moved: f64| [(row as f64 + moved).rem_euclid(20.0), 0.0, 0.0, 0.5];
        let cloud = |moved: f64| Cloud {
            shapes: CloudShapes::Spheres(Rows::F64((0..20).map(|row| place(row, moved)).collect())),
            material: CloudMaterial::One(0),
            colors: None,
            name: None,
            group: None,
        };
        let scene = |moved| Scene { clouds: vec![cloud(moved)], ..Scene::default() };
        let half = scene(0.0).between(&scene(1.5), 0.5);
        let x = |row: usize| match &half.clouds[0].primitive(row).shape.into_owned() {
            Shape::Sphere(Sphere { center, .. }) => center.x,
            other => panic!("{other:?}"),
        };
        assert_eq!((x(0), x(7), x(19)), (0.75, 7.75, 19.0));
    }
}
