//! Every body against another way to find where a ray meets it.

use glam::{DMat3, DQuat, DVec3};
use proptest::prelude::*;

use super::*;
use crate::reference::Hit;

/// How far `x` is outside a closed body (negative: inside), by its definition; for an open one, how far
/// from its surface in the sense of its solid. Zero exactly on the surface.
fn outside(shape: &Shape, x: DVec3) -> f64 {
    let tube = |base: DVec3, apex: DVec3, r0: f64, r1: f64| {
        let (axis, length) = (apex - base).normalize_and_length();
        let height = (x - base).dot(axis);
        let radius = r0 + (r1 - r0) * height / length;
        let across = ((x - base) - axis * height).length();
        (across - radius).max(-height).max(height - length)
    };
    match shape {
        Shape::Sphere(s) => (x - s.center).length() - s.radius,
        Shape::Plane(p) => (x - p.point).dot(p.normal.normalize()),
        Shape::Disk(d) => (x - d.center).dot(d.normal.normalize()),
        Shape::Polygon(p) => (x - p.corners[0]).dot(p.normal()),
        Shape::Box(b) => {
            let (center, half) = (0.5 * (b.min + b.max), 0.5 * (b.max - b.min));
            let local = b.rotation.unwrap_or(DQuat::IDENTITY).inverse() * (x - center);
            (local.abs() - half).max_element()
        }
        Shape::Cylinder(c) => tube(c.base, c.apex, c.radius, c.radius),
        Shape::Cone(c) => tube(c.base, c.apex, c.radius, c.apex_radius),
    }
}

/// Whether a point of the surface's unlimited extension belongs to it: ends of open tubes, rims.
fn belongs(shape: &Shape, x: DVec3) -> bool {
    let on_side = |base: DVec3, apex: DVec3| {
        let (axis, length) = (apex - base).normalize_and_length();
        let height = (x - base).dot(axis);
        height > 1e-9 * length && height < length * (1.0 - 1e-9)
    };
    match shape {
        Shape::Disk(d) => (d.inner_radius..=d.radius).contains(&(x - d.center).length()),
        Shape::Polygon(p) => {
            // Known only for the L of `one_of_each`: a square without its upper right quarter.
            let (u, v) = (p.corners[1] - p.corners[0], p.corners[5] - p.corners[0]);
            let (a, b) = ((x - p.corners[0]).dot(u), (x - p.corners[0]).dot(v));
            let (a, b) = (a / u.length_squared(), b / v.length_squared());
            (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b) && (a <= 0.5 || b <= 0.5)
        }
        Shape::Cylinder(c) if !c.caps => on_side(c.base, c.apex),
        Shape::Cone(c) if !c.caps => on_side(c.base, c.apex),
        _ => true,
    }
}

/// First place on a ray by small steps and bisection, and whether it goes in there.
fn march(shape: &Shape, ray: &Ray, length: f64) -> Option<(f64, bool)> {
    let steps = 4000;
    let at = |t: f64| ray.origin + t * ray.dir;
    let mut before = outside(shape, ray.origin);
    for step in 1..=steps {
        let t = length * f64::from(step) / f64::from(steps);
        let here = outside(shape, at(t));
        if (before > 0.0) != (here > 0.0) {
            let (mut low, mut high) = (t - length / f64::from(steps), t);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if (outside(shape, at(middle)) > 0.0) == (before > 0.0) { low = middle } else { high = middle }
            }
            if belongs(shape, at(high)) {
                return Some((high, before > 0.0));
            }
        }
        before = here;
    }
    None
}

#[test]
fn bodies_agree_with_marching() {
    let (mut hits, mut misses, mut grazed, mut backs) = (0, 0, 0, 0);
    for shape in one_of_each(DVec3::new(1.0, -2.0, 0.5), 1.5) {
        let (tracer, mut dice) = (only(shape.clone()), Dice(7));
        for _ in 0..400 {
            let origin = DVec3::new(1.0, -2.0, 0.5) + dice.in_cube(4.0);
            let aim = DVec3::new(1.0, -2.0, 0.5) + dice.in_cube(1.5);
            let ray = ray(origin, (aim - origin).normalize());
            let want = march(&shape, &ray, 12.0);
            match (tracer.closest(&ray), want) {
                (Some(hit), Some((t, front))) if (hit.t - t).abs() < 1e-9 => {
                    assert_eq!(hit.front, front, "{shape:?} {ray:?}");
                    assert!((hit.normal.dot(ray.dir) < 0.0) == front, "{shape:?} {ray:?} {hit:?}");
                    assert!((hit.point - (origin + t * ray.dir)).length() < 1e-8);
                    (hits, backs) = (hits + 1, backs + usize::from(!front));
                }
                (None, None) => misses += 1,
                // What is thinner than a step is stepped over, and planes go on beyond the last one.
                (Some(hit), _) if hit.t > 12.0 => misses += 1,
                (Some(hit), _) if outside(&shape, hit.point + 2e-3 * ray.dir) > -3e-3 => grazed += 1,
                (got, want) => panic!("{shape:?} {ray:?}: {got:?}, marched {want:?}"),
            }
        }
    }
    assert!(hits > 2000 && misses > 500 && backs > 300 && grazed < 60, "{hits} {misses} {backs} {grazed}");
}

/// Hits lie on their surface to f64's last digits, for bodies thin, long, huge and far away.
#[test]
fn points_lie_on_their_surfaces() {
    let tube = |base: DVec3, apex: DVec3, radius: f64| Shape::Cylinder(Cylinder { base, apex, radius, caps: false });
    let mut cases: Vec<(Shape, f64)> = Vec::new();
    for scale in [1e-3, 1.0, 1e3, 1e6] {
        cases.extend(one_of_each(DVec3::new(3.0, 1.0, -2.0) * scale, scale).into_iter().map(|shape| (shape, scale)));
    }
    cases.extend(one_of_each(DVec3::new(1e7, -1e6, 3e6), 1.0).into_iter().map(|shape| (shape, 1.0)));
    cases.push((tube(DVec3::new(0.0, 0.0, -1e3), DVec3::new(1.0, 2.0, 1e3), 1e-4), 1e-4));
    let (mut hits, mut dice) = (0, Dice(3));
    for (shape, scale) in cases {
        let tracer = only(shape.clone());
        let middle = match &shape {
            Shape::Cylinder(c) => 0.5 * (c.base + c.apex),
            Shape::Cone(c) => 0.5 * (c.base + c.apex),
            Shape::Sphere(s) => s.center,
            Shape::Plane(p) => p.point,
            Shape::Disk(d) => d.center,
            Shape::Box(b) => 0.5 * (b.min + b.max),
            Shape::Polygon(p) => p.corners[0],
        };
        for _ in 0..300 {
            let origin = middle + dice.in_cube(1e3 * scale);
            let ray = ray(origin, dice.between(0.01, 100.0) * (middle + dice.in_cube(0.7 * scale) - origin));
            let Some(hit) = tracer.closest(&ray) else { continue };
            hits += 1;
            let reach = hit.point.abs().max_element() + hit.reach;
            assert!(outside(&shape, hit.point).abs() < 8.0 * f64::EPSILON * reach, "{shape:?} {ray:?} {hit:?}");
            let (on_ray, travelled) = (ray.origin + hit.t * ray.dir, hit.t * ray.dir.length());
            let slant = hit.normal.dot(ray.dir.normalize()).abs();
            let bound = 16.0 * f64::EPSILON * (reach + travelled) / slant;
            assert!((on_ray - hit.point).length() < bound, "{shape:?} {ray:?} {hit:?}");
            assert!((hit.normal.length() - 1.0).abs() < 1e-15);
        }
    }
    assert!(hits > 6000, "{hits}");
}

/// The same shape turned and moved.
fn moved(shape: &Shape, turn: DQuat, shift: DVec3) -> Shape {
    let place = |x: DVec3| turn * x + shift;
    match shape.clone() {
        Shape::Sphere(s) => Shape::Sphere(Sphere { center: place(s.center), ..s }),
        Shape::Plane(p) => Shape::Plane(Plane { point: place(p.point), normal: turn * p.normal }),
        Shape::Disk(d) => Shape::Disk(Disk { center: place(d.center), normal: turn * d.normal, ..d }),
        Shape::Polygon(p) => polygon(p.corners.into_iter().map(place).collect()),
        Shape::Box(b) => {
            let (center, half) = (place(0.5 * (b.min + b.max)), 0.5 * (b.max - b.min));
            let rotation = Some(turn * b.rotation.unwrap_or(DQuat::IDENTITY));
            Shape::Box(Cuboid { min: center - half, max: center + half, rotation })
        }
        Shape::Cylinder(c) => Shape::Cylinder(Cylinder { base: place(c.base), apex: place(c.apex), ..c }),
        Shape::Cone(c) => Shape::Cone(Cone { base: place(c.base), apex: place(c.apex), ..c }),
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2000,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(8),
        ..ProptestConfig::default()
    })]

    /// Turning or moving scene and ray together changes nothing but the last digits.
    #[test]
    fn hits_do_not_depend_on_the_frame(
        seed in any::<u64>(),
        angle in -3.0..3.0f64,
        shift in prop::array::uniform3(-1e6..1e6f64),
        scale in 0.1..10.0f64,
    ) {
        let mut dice = Dice(seed);
        let (turn, shift) = (DQuat::from_axis_angle(dice.direction(), angle), DVec3::from_array(shift));
        for shape in one_of_each(DVec3::ZERO, 1.0) {
            let origin = dice.in_cube(3.0);
            let here = ray(origin, scale * (dice.in_cube(1.0) - origin));
            let there = ray(turn * here.origin + shift, turn * here.dir);
            let (a, b) = (only(shape.clone()).closest(&here), only(moved(&shape, turn, shift)).closest(&there));
            let slant = |hit: &Hit, ray: &Ray| hit.normal.dot(ray.dir.normalize()).abs();
            match (a, b) {
                // Grazing: where it is met depends on the last digits.
                (Some(a), Some(_)) if slant(&a, &here) < 1e-4 => {}
                (Some(a), Some(b)) => {
                    // Positions near 1e6 are known to some 1e-10; a slant magnifies that.
                    let bound = 1e-8 / slant(&a, &here);
                    prop_assert!((a.t - b.t).abs() * here.dir.length() < bound, "{:?} {:?}", a, b);
                    prop_assert_eq!(a.front, b.front);
                }
                (None, None) => {}
                (a, b) => {
                    // Only a silhouette or a rim may differ: the margin says so, in f32's errors.
                    let line = super::super::Line::new(&here, true).unwrap();
                    let tracer = only(shape.clone());
                    let roots = tracer.placed[0].body.roots(&line);
                    let margin = roots.iter().flatten().map(|root| root.margin.abs()).fold(f64::INFINITY, f64::min);
                    prop_assert!(margin < 1.0, "{:?} {:?} {:?} {}", shape, a, b, margin);
                }
            }
        }
    }
}

/// The documented uv of every shape at places where they are plain.
#[test]
fn uv_is_as_documented() {
    let uv = |shape: Shape, origin: DVec3, dir: DVec3| only(shape).closest(&ray(origin, dir)).unwrap().uv.to_array();
    let near = |a: [f64; 2], b: [f64; 2]| assert!((a[0] - b[0]).abs().max((a[1] - b[1]).abs()) < 1e-12, "{a:?} {b:?}");
    near(uv(sphere(DVec3::ZERO, 2.0), 5.0 * DVec3::Z, -DVec3::Z), [0.25, 0.5]);
    near(uv(sphere(DVec3::ZERO, 2.0), 5.0 * DVec3::NEG_Z, DVec3::Z), [0.75, 0.5]);
    near([0.0, uv(sphere(DVec3::ZERO, 2.0), 5.0 * DVec3::Y, -DVec3::Y)[1]], [0.0, 0.0]);
    let plane = Shape::Plane(Plane { point: DVec3::X, normal: 3.0 * DVec3::Z });
    near(uv(plane, DVec3::new(3.0, 7.0, 1.0), -DVec3::Z), [2.0, 7.0]);
    let disk = Shape::Disk(Disk { center: DVec3::ZERO, normal: DVec3::Z, radius: 2.0, inner_radius: 0.0 });
    near(uv(disk, DVec3::new(0.0, -1.0, 1.0), -DVec3::Z), [0.75, 0.5]);
    let cuboid = Shape::Box(Cuboid { min: DVec3::ZERO, max: DVec3::new(2.0, 4.0, 8.0), rotation: None });
    near(uv(cuboid.clone(), DVec3::new(5.0, 1.0, 2.0), -DVec3::X), [0.25, 0.25]);
    near(uv(cuboid.clone(), DVec3::new(0.5, 9.0, 2.0), -DVec3::Y), [0.25, 0.25]);
    near(uv(cuboid, DVec3::new(0.5, 3.0, 9.0), -DVec3::Z), [0.25, 0.75]);
    let tube = Cylinder { base: DVec3::ZERO, apex: 4.0 * DVec3::Z, radius: 1.0, caps: true };
    near(uv(Shape::Cylinder(tube), DVec3::new(0.0, 5.0, 1.0), -DVec3::Y), [0.25, 0.25]);
    near(uv(Shape::Cylinder(tube), DVec3::new(0.5, 0.0, 9.0), -DVec3::Z), [0.0, 0.5]);
    let cone =
        Shape::Cone(Cone { base: DVec3::ZERO, apex: 4.0 * DVec3::Z, radius: 2.0, apex_radius: 0.0, caps: false });
    near(uv(cone, DVec3::new(-5.0, 0.0, 1.0), DVec3::X), [0.5, 0.25]);
    near(uv(polygon(letter_l()), DVec3::new(0.5, 1.5, 1.0), -DVec3::Z), [0.5, 1.5]);
}

/// In a triangle mean value coordinates are the barycentric ones, in an L they still reproduce any
/// linear function, up to edges and corners.
#[test]
fn interpolation_reproduces_linear_functions() {
    let map = |x: DVec3| {
        (2.0 + DMat3::from_cols(DVec3::new(1.0, 3.0, 0.0), DVec3::new(-2.0, 0.5, 0.0), DVec3::ZERO) * x).truncate()
    };
    for corners in [letter_l(), letter_l()[..3].to_vec()] {
        let uvs = corners.iter().map(|corner| map(*corner)).collect();
        let normals = corners.iter().map(|corner| DVec3::new(0.1 * corner.x, 0.2 * corner.y, -1.0)).collect();
        let shape = Shape::Polygon(Polygon { corners: corners.clone(), uvs, normals });
        let (tracer, mut dice, mut hits) = (only(shape), Dice(5), 0);
        let random = (0..2000).map(|_| 1.0 + dice.in_cube(1.0)).collect::<Vec<_>>();
        let edges = corners.iter().zip(corners.iter().cycle().skip(1)).map(|(a, b)| 0.5 * (*a + *b));
        for x in random.into_iter().chain(edges).chain(corners.iter().copied()) {
            let Some(hit) = tracer.closest(&ray(x.with_z(2.0), -DVec3::Z)) else { continue };
            hits += 1;
            assert!((hit.uv - map(x.with_z(0.0))).length() < 1e-12, "{x} {hit:?}");
            // The normals point to the back and are turned to the geometric one's side.
            let normal = DVec3::new(-0.1 * x.x, -0.2 * x.y, 1.0).normalize();
            assert!((hit.shading_normal - normal).length() < 1e-12, "{x} {hit:?}");
        }
        assert!(hits > 450, "{hits}");
    }
}
