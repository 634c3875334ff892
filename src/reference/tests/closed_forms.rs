//! Answers that are known without a tracer.

use super::*;

/// Relative error of the first hit's `t`.
fn error(shape: Shape, ray: &Ray, t: f64) -> f64 {
    only(shape).closest(ray).map_or(f64::INFINITY, |hit| (hit.t - t).abs() / t)
}

#[test]
fn spheres_far_and_near() {
    for radii in [1e1, 1e3, 1e6] {
        let origin = DVec3::new(0.0, 0.5, radii);
        // Along -z, half a radius off the axis, directions of any length.
        for length in [1e-30, 1.0, 1e30, 1e200] {
            let t = (radii - 0.75f64.sqrt()) / length;
            assert!(error(sphere(DVec3::ZERO, 1.0), &ray(origin, -length * DVec3::Z), t) < 1e-15, "{radii} {length}");
        }
    }
    // From the centre it is a radius to everywhere.
    let mut dice = Dice(1);
    for _ in 0..1000 {
        assert!(error(sphere(DVec3::ONE, 3.0), &ray(DVec3::ONE, dice.direction()), 3.0) < 1e-15);
    }
}

/// Eye at height h over a sphere of radius R: straight down it is h; toward the horizon at angle a below
/// the horizontal, t = 2 h (R + h/2) / (b + sqrt(b^2 - 2 h R - h^2)) with b = (R + h) sin a.
#[test]
fn ground_spheres_are_not_blurred_by_their_size() {
    for (radius, height) in [(1e3, 0.5), (1e5, 1.7), (1e7, 1.7), (1e7, 8.0)] {
        let ground = sphere(DVec3::new(0.0, -radius, 0.0), radius);
        let eye = DVec3::new(0.0, height, 0.0);
        assert!(error(ground.clone(), &ray(eye, -DVec3::Y), height) < 1e-15);
        for slope in [1.0, 0.1, 0.05] {
            let dir = DVec3::new(1.0, -slope, 0.0);
            let (b, c) = ((radius + height) * slope, height * (2.0 * radius + height));
            let disc = b * b - dir.length_squared() * c;
            let found = error(ground.clone(), &ray(eye, dir), c / (b + disc.sqrt()));
            assert!(found < 1e-13, "{radius} {height} {slope}: {found:e}");
        }
    }
}

#[test]
fn silhouette_of_a_sphere_has_its_area() {
    let (tracer, mut dice, rays) = (only(sphere(DVec3::new(0.5, -0.25, 0.0), 1.0)), Dice(11), 1_000_000);
    let hit = |x, y| usize::from(tracer.occluded(&ray(DVec3::new(x, y, 9.0), -DVec3::Z)));
    let hits: usize = (0..rays).map(|_| hit(dice.between(-2.0, 2.0), dice.between(-2.0, 2.0))).sum();
    let area = 16.0 * hits as f64 / f64::from(rays);
    // Four standard errors of a share of pi/16.
    assert!((area - std::f64::consts::PI).abs() < 4.0 * 16.0 * (0.196 * 0.804 / f64::from(rays)).sqrt(), "{area}");
}

#[test]
fn concave_polygons_have_their_area_from_both_sides() {
    // A grid whose points miss all edges: each stands for its cell.
    let tracer = only(polygon(letter_l()));
    for (z, front) in [(1.0, true), (-1.0, false)] {
        let mut hits = 0;
        for k in 0..300 * 300 {
            let (x, y) = (f64::from(k % 300) / 100.0 - 0.495, f64::from(k / 300) / 100.0 - 0.495);
            let hit = tracer.closest(&ray(DVec3::new(x, y, z), DVec3::new(0.0, 0.0, -z)));
            hits += usize::from(hit.is_some());
            assert!(hit.is_none_or(|hit| hit.front == front && hit.normal == DVec3::Z && hit.t == 1.0));
        }
        assert_eq!(hits, 30_000);
    }
}

/// Closed sets: what touches an edge or a corner meets it.
#[test]
fn touching_counts() {
    let down = |x, y| ray(DVec3::new(x, y, 3.0), -DVec3::Z);
    let bodies = [
        polygon(letter_l()),
        Shape::Box(Cuboid { min: DVec3::new(0.0, 0.0, -1.0), max: DVec3::new(2.0, 2.0, 0.0), rotation: None }),
    ];
    for body in bodies {
        let tracer = only(body);
        for (x, y) in [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (2.0, 0.5), (0.5, 2.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)] {
            assert_eq!(tracer.closest(&down(x, y)).map(|hit| hit.t), Some(3.0), "{x} {y}");
        }
        assert!(tracer.closest(&down(-1e-15, 1.0)).is_none() && tracer.closest(&down(1.0, -1e-15)).is_none());
    }
    let ring = only(Shape::Disk(Disk { center: DVec3::ZERO, normal: DVec3::Z, radius: 2.0, inner_radius: 1.0 }));
    let met = [0.5, 1.0, 1.5, 2.0, 2.5].map(|x| ring.occluded(&down(x, 0.0)));
    assert_eq!(met, [false, true, true, true, false]);
    assert_eq!(only(sphere(DVec3::ZERO, 2.0)).closest(&down(2.0, 0.0)).map(|hit| hit.t), Some(3.0));
    let tube = only(Shape::Cylinder(Cylinder { base: -DVec3::Y, apex: DVec3::Y, radius: 1.0, caps: false }));
    assert!(
        tube.occluded(&down(1.0, 0.5)) && tube.occluded(&down(0.0, 1.0)) && !tube.occluded(&down(0.0, 1.0 + 1e-15))
    );
}

#[test]
fn boxes_at_corners_and_edges() {
    let cuboid = |rotation| only(Shape::Box(Cuboid { min: -DVec3::ONE, max: DVec3::ONE, rotation }));
    let turn = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4);
    // Corner-on along the diagonal: x wins the tie; the way through is 2 sqrt(3).
    let ray_in = ray(DVec3::splat(2.0), -DVec3::ONE);
    let hit = cuboid(None).closest(&ray_in).unwrap();
    assert_eq!((hit.t, hit.normal, hit.front), (1.0, DVec3::X, true));
    // From inside, out through the nearest face.
    let hit = cuboid(None).closest(&ray(DVec3::new(0.5, 0.0, 0.25), DVec3::new(1.0, 0.5, -0.25))).unwrap();
    assert_eq!((hit.t, hit.normal, hit.front), (0.5, DVec3::X, false));
    // Turned by 45 degrees, an edge looks along x.
    let hit = cuboid(Some(turn)).closest(&ray(DVec3::new(5.0, 0.0, 0.0), -DVec3::X)).unwrap();
    assert!((hit.t - (5.0 - 2f64.sqrt())).abs() < 1e-15 && (hit.normal.x - 0.5f64.sqrt()).abs() < 1e-15);
    // A ray within a face, both zeros of both signs.
    for zero in [0.0, -0.0] {
        assert_eq!(
            cuboid(None).closest(&ray(DVec3::new(3.0, 1.0, 0.5), DVec3::new(-1.0, zero, zero))).map(|hit| hit.t),
            Some(2.0)
        );
    }
}

#[test]
fn cones_along_their_axis_and_their_generators() {
    let full = Cone { base: DVec3::ZERO, apex: 2.0 * DVec3::Y, radius: 1.0, apex_radius: 0.0, caps: true };
    let cone = only(Shape::Cone(full));
    // Down the axis: the tip, then the base.
    let down = ray(5.0 * DVec3::Y, -DVec3::Y);
    assert_eq!(cone.closest(&down).map(|hit| (hit.t, hit.front)), Some((3.0, true)));
    let from_inside = cone.closest(&ray(DVec3::Y, -DVec3::Y)).unwrap();
    assert_eq!((from_inside.t, from_inside.normal, from_inside.front), (1.0, -DVec3::Y, false));
    // Parallel to a generator, from inside: one root is infinitely far.
    let along = DVec3::new(-1.0, 2.0, 0.0);
    let hit = cone.closest(&ray(DVec3::new(0.25, -1.0, 0.0), along)).unwrap();
    assert!(hit.t == 0.5 && hit.normal == -DVec3::Y && hit.front, "{hit:?}");
    let hit = cone.closest(&ray(DVec3::new(-0.25, 0.5, 0.0), along)).unwrap();
    // x = -0.25 - t meets the other side's x = -(1 - y/2) = -0.75 + t, and no tip or mirror image of it.
    assert!((hit.t - 0.25).abs() < 1e-15 && !hit.front, "{hit:?}");
    // The mirrored half above the tip is not part of it.
    assert!(cone.closest(&ray(DVec3::new(-5.0, 3.0, 0.0), DVec3::X)).is_none());
    // The surface of the cone r = 1 - y/2 at height 1 has radius 1/2 and the normal (2, 1)/sqrt 5.
    let hit = cone.closest(&ray(DVec3::new(9.0, 1.0, 0.0), -DVec3::X)).unwrap();
    assert_eq!(hit.t, 8.5);
    assert!((hit.normal - DVec3::new(2.0, 1.0, 0.0).normalize()).length() < 1e-15);
}

#[test]
fn rays_that_are_none_meet_nothing() {
    let tracer = Reference::new(&scene_of(one_of_each(DVec3::ZERO, 1.0)));
    let good = ray(DVec3::new(0.1, 0.2, 0.3), DVec3::X);
    assert!(tracer.occluded(&good));
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for axis in DVec3::AXES {
            let wrong = [Ray { origin: good.origin + bad * axis, ..good }, Ray { dir: good.dir + bad * axis, ..good }];
            assert!(wrong.iter().all(|ray| tracer.closest(ray).is_none() && !tracer.occluded(ray)), "{wrong:?}");
        }
    }
    let nan = f64::NAN;
    for ray in [
        Ray { dir: DVec3::ZERO, ..good },
        Ray { t_min: nan, ..good },
        Ray { t_max: nan, ..good },
        Ray { t_max: 0.0, ..good },
    ] {
        assert!(tracer.closest(&ray).is_none() && !tracer.occluded(&ray), "{ray:?}");
    }
}

/// Scenes made by hand may hold what no reader lets through.
#[test]
fn bodies_without_extent_are_never_met() {
    let mut dice = Dice(4);
    for count in 0..3 {
        let flat = only(polygon(letter_l()[..count].to_vec()));
        let inverted = only(Shape::Box(Cuboid { min: DVec3::ONE, max: -DVec3::ONE, rotation: None }));
        for _ in 0..100 {
            let ray = ray(3.0 * dice.direction(), dice.direction());
            assert!(!flat.occluded(&ray) && !inverted.occluded(&ray));
            assert_eq!(flat.verdict(&ray, None, None), crate::reference::Verdict::Same);
        }
    }
}

#[test]
fn intervals_are_open_below_and_closed_above() {
    let tracer = only(sphere(DVec3::ZERO, 1.0));
    let t =
        |t_min, t_max| tracer.closest(&Ray { t_min, t_max, ..ray(3.0 * DVec3::X, -0.5 * DVec3::X) }).map(|hit| hit.t);
    assert_eq!(
        [t(0.0, 3.9), t(0.0, 4.0), t(4.0, 9.0), t(4.0, 7.9), t(-1.0, 5.0), t(8.0, 9.0)],
        [None, Some(4.0), Some(8.0), None, Some(4.0), None]
    );
}

#[test]
fn sides_may_be_invisible_but_cast_shadows() {
    let mut scene = scene_of(vec![sphere(DVec3::ZERO, 1.0)]);
    scene.materials.push(Material { back: Some(0), ..diffuse() });
    let look = ray(3.0 * DVec3::X, -DVec3::X);
    for (visible, back, t, front, material) in [
        (Visible::Both, Some(1), 2.0, true, 0),
        (Visible::Front, Some(1), 2.0, true, 0),
        (Visible::Back, Some(1), 4.0, false, 1),
        (Visible::Back, None, 4.0, false, 0),
    ] {
        scene.materials[0] = Material { visible, back, ..diffuse() };
        let tracer = Reference::new(&scene);
        let hit = tracer.closest(&look).unwrap();
        assert_eq!((hit.t, hit.front, hit.material, hit.normal.x > 0.0), (t, front, material, front));
        assert!(tracer.occluded(&Ray { t_max: 3.0, ..look }));
    }
}

#[test]
fn of_equal_places_the_lowest_index_wins() {
    let twice = scene_of(vec![sphere(DVec3::ZERO, 1.0), sphere(DVec3::ZERO, 2.0), sphere(DVec3::ZERO, 2.0)]);
    assert_eq!(Reference::new(&twice).closest(&ray(3.0 * DVec3::X, -DVec3::X)).map(|hit| hit.primitive), Some(1));
}

/// No ray slips between polygons that share an edge or a corner, however it is aimed at them.
#[test]
fn meshes_do_not_leak() {
    let mut dice = Dice(21);
    let shift = DVec3::new(1e6 + 0.1, -3e5 - 0.3, 0.7);
    let points: Vec<DVec3> = (0..12 * 12)
        .map(|k| DVec3::new(f64::from(k % 12), f64::from(k / 12), 0.0) + 0.3 * dice.in_cube(1.0) + shift)
        .collect();
    let mut triangles = Vec::new();
    for k in (0..11 * 11).map(|k| k / 11 * 12 + k % 11) {
        triangles.push(polygon(vec![points[k], points[k + 1], points[k + 13]]));
        triangles.push(polygon(vec![points[k], points[k + 13], points[k + 12]]));
    }
    let tracer = Reference::new(&scene_of(triangles));
    for _ in 0..4000 {
        let k = 13 + 12 * (dice.next() % 9) as usize + (dice.next() % 9) as usize;
        let other = k + [1, 12, 13][(dice.next() % 3) as usize];
        let aim = points[k].lerp(points[other], [0.0, 0.5, dice.unit()][(dice.next() % 3) as usize]);
        let origin = shift + DVec3::new(dice.between(2.0, 9.0), dice.between(2.0, 9.0), dice.between(3.0, 30.0));
        assert!(tracer.occluded(&ray(origin, aim - origin)), "{origin} {aim}");
    }
}
