//! Decisions of the engine against exact geometry on the f64 scene, where f32 cannot tell.

mod common;

use common::{Dice, MAKERS, cuboid, exact, image, pinhole, polygon, ray, scene_of, sphere, turn};
use glam::DVec3;
use octray::measure::check::{CheckSettings, check};
use octray::reference::{Reference, Verdict};
use octray::scene::{Scene, Shape};
use octray::{Ray, Tracer};

/// Wrong answers and ties of closest hits and of occlusion, together and one by one, with and without certainty.
fn wrong(scene: &Scene, rays: &[Ray], certify: bool) -> (usize, usize) {
    let tracer = Tracer::new(scene).expect("valid").certify(certify);
    let reference = Reference::new(scene);
    let (mut wrong, mut ties) = (0, 0);
    let (hits, dark) = (tracer.closest_hits(rays), tracer.occluded(rays));
    for ((ray, hit), dark) in rays.iter().zip(hits).zip(dark) {
        let met = hit.map(|hit| hit.primitive as usize);
        let alone = tracer.closest_hit(ray).map(|hit| hit.primitive as usize);
        assert_eq!((met, dark), (alone, tracer.is_occluded(ray)), "{certify} {ray:?} {:?}", scene.objects);
        for verdict in [reference.verdict_exact(&exact(ray), met), reference.verdict_occluded_exact(&exact(ray), dark)]
        {
            match verdict {
                Verdict::Same => {}
                Verdict::Tie => ties += 1,
                Verdict::Different { .. } => wrong += 1,
            }
        }
    }
    (wrong, ties)
}

/// Directions from `origin` between hitting and missing something, closer than f32 can say.
fn silhouettes(scene: &Scene, origin: DVec3, spread: f64, count: usize, dice: &mut Dice) -> Vec<Ray> {
    let reference = Reference::new(scene);
    let met = |dir: DVec3| reference.occluded(&exact(&ray(origin, dir)));
    let mut rays = Vec::new();
    let mut tries = 0;
    while rays.len() < count && tries < 50 * count {
        tries += 1;
        let mut aims = [0; 2].map(|_| dice.in_cube(spread) - origin);
        if met(aims[0]) == met(aims[1]) {
            continue;
        }
        let first = met(aims[0]);
        for _ in 0..40 {
            let middle = aims[0].midpoint(aims[1]);
            aims[usize::from(met(middle) != first)] = middle;
        }
        rays.extend(aims.map(|aim| ray(origin, aim)));
    }
    rays
}

#[test]
fn silhouettes_of_every_shape_are_those_of_the_scene_in_f64() {
    let mut lost = Vec::new();
    for (name, maker) in MAKERS {
        let mut dice = Dice(name.len() as u64);
        let (mut missed, mut seen, mut rays_in_all) = (0, 0, 0);
        for distance in [1.5, 40.0, 3000.0] {
            // Numbers that f32 does not hold.
            let shapes: Vec<Shape> =
                (0..5).map(|_| maker(dice.in_cube(1.2), dice.between(0.3, 0.9), turn(&mut dice))).collect();
            let scene = scene_of(shapes);
            let origin = (dice.direction() * distance).as_vec3().as_dvec3();
            let rays = silhouettes(&scene, origin, 1.5, 300, &mut dice);
            let (wrong_now, ties) = wrong(&scene, &rays, true);
            if wrong_now > 0 || ties * 20 > rays.len() {
                lost.push(format!("{name} at {distance}: {wrong_now} wrong, {ties} ties of {}", rays.len()));
            }
            missed += wrong(&scene, &rays, false).0;
            seen += usize::from(rays.len() > 100);
            rays_in_all += rays.len();
        }
        // Without f64 some of these are wrong, or the test would show nothing.
        assert!(name == "plane" || (missed > 0 && seen > 0), "{name}: {missed} of {rays_in_all}");
    }
    assert!(lost.is_empty(), "{}", lost.join("\n"));
}

/// Sheets that are closer to each other than f32 can say, in the order of their distance and in the other one.
#[test]
fn of_two_surfaces_the_nearer_one_is_met_however_near_the_other() {
    let mut dice = Dice(7);
    let (mut missed, mut tried) = (0, 0);
    for gap in [1e-5, 1e-6, 1e-7, 3e-8, 1e-9, 1e-11] {
        for kind in 0..4 {
            let turn = turn(&mut dice);
            let layer = |i: usize| {
                let h = 0.3 + gap * [3.0, 0.0, 1.0, 2.0, 4.0][i];
                let at = |x: f64, y: f64| turn * DVec3::new(x, y, h);
                match kind {
                    0 => polygon([at(-2.0, -2.0), at(2.0, -2.0), at(2.0, 2.0), at(-2.0, 2.0)]),
                    1 => sphere(turn * DVec3::new(0.1, 0.2, 0.3), 1.0 + h),
                    2 => cuboid(DVec3::new(-2.0, -2.0, h - 2.0), DVec3::new(2.0, 2.0, h)),
                    _ => common::disk(turn * DVec3::new(0.3, 0.2, h), turn * DVec3::Z, 2.5, 0.0),
                }
            };
            let scene = scene_of((0..5).map(layer));
            let rays: Vec<Ray> = (0..400)
                .map(|_| {
                    let origin = dice.direction() * dice.between(4.0, 9.0);
                    ray(origin, dice.in_cube(1.5) - origin.as_vec3().as_dvec3())
                })
                .collect();
            let (now, ties) = wrong(&scene, &rays, true);
            assert_eq!((now, ties), (0, 0), "kind {kind}, gap {gap}");
            missed += wrong(&scene, &rays, false).0;
            tried += rays.len();
        }
    }
    assert!(missed > 300, "{missed} of {tried}");
}

/// A box on a plane and one beside it in the same places: what f64 cannot tell apart goes to the lowest index.
#[test]
fn coincident_surfaces_go_to_the_lowest_index_from_everywhere() {
    let mut dice = Dice(9);
    for _ in 0..20 {
        let turn = turn(&mut dice);
        let (point, height) = (dice.in_cube(1.0), dice.between(0.1, 1.0));
        let at = |x: f64, y: f64| point + turn * DVec3::new(x, y, 0.0);
        let square = |s: f64| polygon([at(-s, -s), at(s, -s), at(s, s), at(-s, s)]);
        let half = DVec3::new(0.7, 0.6, height / 2.0);
        let center = point + turn * DVec3::new(0.0, 0.0, half.z);
        let crate_on_it =
            Shape::Box(octray::scene::Cuboid { min: center - half, max: center + half, rotation: Some(turn) });
        let floor = common::plane(point, turn * DVec3::Z);
        let scene = scene_of([square(0.5), crate_on_it, floor, square(1.0)]);
        let tracer = Tracer::new(&scene).expect("valid");
        let rays: Vec<Ray> = (0..300)
            .map(|_| {
                // From below, where all of them lie in one plane.
                let origin = point
                    + turn * DVec3::new(dice.between(-3.0, 3.0), dice.between(-3.0, 3.0), dice.between(-4.0, -0.2));
                ray(origin, at(dice.between(-0.5, 0.5), dice.between(-0.5, 0.5)) - origin)
            })
            .collect();
        let reference = Reference::new(&scene);
        let first = |met: Option<octray::Hit>| met.map(|hit| hit.primitive as usize);
        for (ray, hit) in rays.iter().zip(tracer.closest_hits(&rays)) {
            let met = first(hit);
            assert_eq!(met, reference.closest(&exact(ray)).map(|hit| hit.primitive), "{ray:?}");
            assert_eq!(met, Some(0), "{ray:?}");
        }
    }
}

/// Small things far away, and boxes with many edges: what f32 makes of a camera ray often sees another one.
#[test]
fn camera_rays_see_what_those_in_f64_see() {
    let mut dice = Dice(11);
    let mut shapes: Vec<Shape> = (0..60).map(|_| sphere(dice.in_cube(0.04), dice.log_between(1e-4, 3e-3))).collect();
    shapes.extend((0..30).map(|_| {
        let (c, half) = (dice.in_cube(0.04), DVec3::splat(3e-4) + dice.in_cube(2e-3).abs());
        cuboid(c - half, c + half)
    }));
    for (_, maker) in MAKERS.iter().filter(|(name, _)| *name != "plane") {
        shapes.extend((0..4).map(|_| maker(dice.in_cube(0.04), dice.between(3e-4, 3e-3), turn(&mut dice))));
    }
    let mut scene = scene_of(shapes);
    scene.image = image(320, 240, 1);
    scene.cameras = vec![pinhole(DVec3::new(130.1, 40.2, 200.3), DVec3::ZERO, 0.02)];
    let report = |scene: &Scene, certify, spp| {
        let settings = CheckSettings { certify, spp, seconds: 8.0, ..CheckSettings::default() };
        check(scene, &settings).expect("a report")
    };
    let (on, off) = (report(&scene, true, 1), report(&scene, false, 1));
    assert_eq!((on.rays.camera.different, on.rays.camera.ties), (0, 0), "{on}");
    assert!(on.rays.camera.replayed > 5_000 && on.rays.camera.redecided > 0, "{on}");
    assert!(off.rays.camera.different > 0, "{off}");
    scene.cameras = vec![common::orthographic(DVec3::new(130.1, 40.2, 200.3), DVec3::ZERO, 0.09)];
    let on = report(&scene, true, 2);
    assert_eq!((on.rays.camera.different, on.rays.camera.ties), (0, 0), "{on}");
}

#[test]
fn the_place_of_a_hit_is_within_one_ulp() {
    let mut met = 0;
    for (name, maker) in MAKERS {
        let mut dice = Dice(13);
        for (away, scale) in [(0.0, 1.0), (300.0, 0.7), (1e4, 3.0)] {
            let center = DVec3::new(0.6, -0.64, 0.48) * away;
            let scene = scene_of([maker(center, scale, turn(&mut dice)), object_far(center)]);
            let (tracer, reference) = (Tracer::new(&scene).expect("valid"), Reference::new(&scene));
            for _ in 0..400 {
                let origin = center + dice.direction() * dice.log_between(1.0, 1e5) * scale;
                let ray = ray(origin, center + dice.in_cube(scale) - origin);
                let (Some(hit), Some(want)) = (tracer.closest_hit(&ray), reference.closest(&exact(&ray))) else {
                    continue;
                };
                let t = want.t as f32;
                assert!((t.next_down()..=t.next_up()).contains(&hit.t), "{name}: {} for {}, {ray:?}", hit.t, want.t);
                met += 1;
            }
        }
    }
    assert!(met > 5000, "{met}");
}

/// Polygons that are cut into parts, and as little flat as the rules allow: all parts lie in the plane of the whole one.
#[test]
fn parts_of_a_polygon_share_its_plane() {
    let (mut dice, mut met) = (Dice(17), 0);
    for corners in [6, 30] {
        for _ in 0..8 {
            let turn = turn(&mut dice);
            let corner = |k: usize| {
                let (angle, radius) = (k as f64 * std::f64::consts::TAU / corners as f64, [1.0, 0.4][k % 2]);
                turn * DVec3::new(radius * angle.cos(), radius * angle.sin(), 4e-5 * [1.0, -1.0, 0.3][k % 3])
            };
            let scene = scene_of([polygon((0..corners).map(corner))]);
            let (tracer, reference) = (Tracer::new(&scene).expect("valid"), Reference::new(&scene));
            for _ in 0..300 {
                let origin = turn * (DVec3::new(0.0, 0.0, 5.0) + dice.in_cube(2.0));
                let ray = ray(origin, dice.in_cube(0.5) - origin);
                let (Some(hit), Some(want)) = (tracer.closest_hit(&ray), reference.closest(&exact(&ray))) else {
                    continue;
                };
                let t = want.t as f32;
                assert!((t.next_down()..=t.next_up()).contains(&hit.t), "{} for {}, {ray:?}", hit.t, want.t);
                met += 1;
            }
        }
    }
    assert!(met > 1000, "{met}");
}

fn object_far(center: DVec3) -> Shape {
    sphere(center + DVec3::new(0.0, 30.0, 0.0), 1.0)
}
