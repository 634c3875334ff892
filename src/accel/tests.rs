//! Both walks against asking every row.

use glam::DVec3;

use super::{PACKETS, Tile, Tree, Walk};
use crate::fixtures::{Dice, MAKERS, cuboid, disk, exact, gray, plane, polygon, ray, scene_of, sphere, turn};
use crate::lanes::{LANES, Ray};
use crate::plan::Plan;
use crate::scene::{Scene, Shape, Visible};
use crate::shapes::{RowRef, brute};
use crate::tracer::tile;

/// Rays that were compared, and those of them that met something.
#[derive(Debug, Default)]
struct Tally {
    hits: usize,
    misses: usize,
    dark: usize,
}

/// Compares both walks with the loop over all rows: row and bits of `t`, and for shadow rays yes or no.
fn compare(scene: &Scene, rays: &[Ray]) -> Tally {
    let plan = Plan::new(scene, DVec3::ZERO);
    let tree = Tree::new(plan.parts(), &plan.visible);
    let (stores, mut walk, mut tally) = (tree.stores(), Walk::default(), Tally::default());
    for chunk in rays.chunks(PACKETS * LANES) {
        let (mut seen, mut lit) = (tile(chunk), tile(chunk));
        let before = lit.packets.map(|rays| rays.live().bits());
        tree.closest_tiles(std::slice::from_mut(&mut seen), &mut walk);
        tree.occluded_tiles(std::slice::from_mut(&mut lit), &mut walk);
        for (i, ray) in chunk.iter().enumerate() {
            let (p, lane) = (i / LANES, i % LANES);
            let want = brute::closest(stores, ray, tree.culls).map(|(t, row)| (t.to_bits(), row));
            let met = |t: f32, row: RowRef| (row != RowRef::MISS).then_some((t.to_bits(), row));
            let (t, row) = tree.closest(ray, &mut walk);
            assert_eq!(met(t, row), want, "alone: {ray:?}");
            let t = seen.packets[p].t_max.to_array()[lane];
            assert_eq!(met(t, seen.hit(p, lane)), want, "in a tile: {ray:?}");
            let dark = brute::closest(stores, ray, false).is_some();
            let blocked = before[p] & !lit.packets[p].live().bits();
            assert_eq!(tree.occluded(ray, &mut walk), dark, "shadow, alone: {ray:?}");
            assert_eq!(blocked >> lane & 1 == 1, dark, "shadow, in a tile: {ray:?}");
            match want {
                Some(_) => tally.hits += 1,
                None => tally.misses += 1,
            }
            tally.dark += usize::from(dark);
        }
    }
    tally
}

/// Shapes of all kinds but planes in a cube of edge 20.
fn mixed(count: usize, dice: &mut Dice) -> Vec<Shape> {
    let bounded: Vec<_> = MAKERS.iter().filter(|(name, _)| *name != "plane").collect();
    (0..count)
        .map(|i| bounded[i % bounded.len()].1(dice.in_cube(10.0), dice.log_between(0.1, 3.0), turn(dice)))
        .collect()
}

/// Bundles of 64 rays: a narrow cone from one point, side by side, every which way, along the axes,
/// with both ends within the scene, and from the middle of it.
fn bundles(count: usize, dice: &mut Dice) -> Vec<Ray> {
    let mut rays = Vec::new();
    for bundle in 0..count {
        let (eye, target) = (dice.direction() * dice.log_between(5.0, 500.0), dice.in_cube(8.0));
        for _ in 0..PACKETS * LANES {
            let wobble = dice.in_cube(3.0);
            let toward = |origin: DVec3| ray(origin, target + wobble - origin);
            let axis = [DVec3::X, DVec3::Y, -DVec3::Z][dice.index(3)];
            rays.push(match bundle % 6 {
                0 => toward(eye),
                1 => ray(eye + wobble, target - eye),
                2 => ray(dice.in_cube(15.0), dice.direction()),
                3 => ray(dice.in_cube(10.0) - 20.0 * axis, axis),
                4 => Ray { t_min: 0.98, t_max: 1.01, ..toward(eye) },
                _ => ray(target * 0.1, dice.direction() + 3.0 * DVec3::ONE),
            });
        }
    }
    rays
}

#[test]
fn both_walks_meet_what_a_loop_over_everything_meets() {
    for count in [0, 1, 7, 8, 9, 1000] {
        let mut dice = Dice(count as u64);
        let scene = scene_of(mixed(count, &mut dice));
        let tally = compare(&scene, &bundles(60, &mut dice));
        // Of 3,840 rays each; one of 1,000 is met by most, a lone small one by few.
        let least = match count {
            0 => 0,
            1 => 1,
            2..10 => 15,
            _ => 1500,
        };
        assert!(tally.hits >= least && tally.misses > 50 && tally.dark == tally.hits, "{count}: {tally:?}");
        assert!(count > 0 || tally.hits == 0);
    }
}

#[test]
fn both_walks_agree_where_sides_are_hidden_and_planes_lie_about() {
    let mut dice = Dice(77);
    let mut shapes = mixed(100, &mut dice);
    for normal in [DVec3::Y, DVec3::new(1.0, 0.5, -0.25), -DVec3::Z] {
        shapes.insert(dice.index(shapes.len()), plane(-6.0 * normal, normal));
    }
    let mut scene = scene_of(shapes);
    for visible in [Visible::Front, Visible::Back] {
        scene.materials.push(crate::scene::Material { visible, ..gray(0.5) });
    }
    for (i, object) in scene.objects.iter_mut().enumerate() {
        object.material = i % 3;
    }
    let tally = compare(&scene, &bundles(60, &mut dice));
    assert!(tally.hits > 2000 && tally.misses > 50 && tally.dark > tally.hits, "{tally:?}");
}

/// Boxes and squares with whole-numbered corners, and rays in their very faces and edges, whose directions
/// are zero of either sign on the other axes.
#[test]
fn rays_in_faces_and_edges_touch_in_every_walk() {
    let mut dice = Dice(5);
    let mut shapes = Vec::new();
    for _ in 0..40 {
        let corner = DVec3::from_array([0; 3].map(|_| dice.index(9) as f64 - 4.0));
        shapes.push(cuboid(corner, corner + DVec3::ONE));
        let (x, y) = (DVec3::X, DVec3::Y);
        shapes.push(polygon([corner, corner + x, corner + x + y, corner + y]));
        shapes.push(disk(corner, DVec3::Z, 1.0, 0.0));
    }
    let scene = scene_of(shapes);
    let mut rays = Vec::new();
    let mut corner = [0.0; 3];
    for case in 0..64 * 150 {
        if case % 64 == 0 {
            corner = [0; 3].map(|_| dice.index(9) as f32 - 5.0);
        }
        let (axis, sign) = (case / 64 % 3, if case / 192 % 2 == 0 { 1.0 } else { -1.0 });
        // Close enough together for a tile to go as one.
        let mut origin = corner.map(|x| x + dice.index(3) as f32);
        let mut dir = [0; 3].map(|_| if dice.index(2) == 0 { 0.0f32 } else { -0.0 });
        origin[axis] = -8.0 * sign;
        dir[axis] = sign;
        rays.push(Ray::new(origin, dir));
    }
    let tally = compare(&scene, &rays);
    assert!(tally.hits > 1000 && tally.misses > 1000, "{tally:?}");
}

#[test]
fn rays_that_begin_behind_their_origin_are_met_there() {
    let mut dice = Dice(9);
    let scene = scene_of(mixed(200, &mut dice));
    // The scene lies behind most of them.
    let back = |ray: Ray| Ray { t_min: -1e3, t_max: 0.5, dir: ray.dir.map(|d| -d), ..ray };
    let rays: Vec<Ray> = bundles(60, &mut dice).into_iter().map(back).collect();
    let tally = compare(&scene, &rays);
    assert!(tally.hits > 1000, "{tally:?}");
}

#[test]
fn of_coincident_primitives_the_first_one_wins_everywhere() {
    let mut dice = Dice(11);
    let once = mixed(40, &mut dice);
    let (distinct, times) = (once.len(), 5);
    let shapes: Vec<Shape> = once.iter().cycle().take(distinct * times).cloned().collect();
    let scene = scene_of(shapes);
    let rays = bundles(90, &mut dice);
    // A flat one seen edge-on may have its rounded `t` so far before its own box that the next copy's box is
    // left out: which copy wins is open there.
    let tracer = crate::Tracer::new(&scene).expect("valid");
    let edge_on = |ray: &Ray| {
        let cos = |hit: crate::Hit| {
            let (normal, dir) = (DVec3::from_array(hit.normal.map(f64::from)), exact(ray).dir);
            normal.dot(dir.normalize()).abs()
        };
        tracer.closest_hit(ray).is_some_and(|hit| cos(hit) < 0.01)
    };
    let rays: Vec<Ray> = rays.into_iter().filter(|ray| !edge_on(ray)).collect();
    assert!(compare(&scene, &rays).hits > 300);
    let met: Vec<_> = tracer.closest_hits(&rays).into_iter().flatten().collect();
    assert!(met.len() > 300 && met.iter().all(|hit| (hit.primitive as usize) < distinct));
}

/// Shapes of different kinds that meet in the very same places: a square as a polygon, as two triangles
/// and as the face of a box; a disk as itself and as a cap.
#[test]
fn coincident_faces_of_different_kinds_go_to_the_lowest_index() {
    let (x, y) = (2.0 * DVec3::X, 2.0 * DVec3::Y);
    let square = polygon([DVec3::ZERO, x, x + y, y]);
    let halves = [polygon([DVec3::ZERO, x, x + y]), polygon([DVec3::ZERO, x + y, y])];
    let solid = cuboid(DVec3::new(0.0, 0.0, -2.0), DVec3::new(2.0, 2.0, 0.0));
    let floor = plane(DVec3::ZERO, DVec3::Z);
    let mut rays = Vec::new();
    for i in 0..64 * 9 {
        let (a, b) = (f64::from(i % 24) / 16.0 + 0.25, f64::from(i / 24) / 16.0 + 0.25);
        rays.push(ray(DVec3::new(a, b, 4.0), -DVec3::Z));
    }
    let [first, second] = halves;
    let mut shapes = vec![square, first, second, solid, floor];
    for _ in 0..5 {
        shapes.rotate_left(1);
        let scene = scene_of(shapes.clone());
        compare(&scene, &rays);
        let tracer = crate::Tracer::new(&scene).expect("valid");
        for (ray, hit) in rays.iter().zip(tracer.closest_hits(&rays)) {
            let hit = hit.expect("the floor is everywhere");
            assert_eq!(hit.t, 4.0, "{ray:?}");
            let half = |shape: &Shape| matches!(shape, Shape::Polygon(p) if p.corners.len() == 3);
            let whole = shapes.iter().position(|shape| !half(shape)).expect("three of them");
            assert!(hit.primitive as usize <= whole, "{ray:?} {hit:?}");
        }
    }
}

#[test]
fn ten_thousand_times_the_same_sphere_is_a_scene() {
    let scene = scene_of(vec![sphere(DVec3::new(0.5, 0.0, -3.0), 1.0); 10_000]);
    let tracer = crate::Tracer::new(&scene).expect("valid");
    let rays: Vec<Ray> = (0..64).map(|i| ray(DVec3::ZERO, DVec3::new(f64::from(i) / 64.0, 0.1, -1.0))).collect();
    let hits: Vec<_> = tracer.closest_hits(&rays).into_iter().flatten().collect();
    assert!(hits.len() > 20 && hits.iter().all(|hit| hit.primitive == 0), "{hits:?}");
    assert_eq!(tracer.closest_hit(&rays[0]).map(|hit| hit.primitive), Some(0));
}

/// In tiles with good ones, too, they meet nothing and disturb nobody.
#[test]
fn broken_rays_meet_nothing_in_any_company() {
    let mut dice = Dice(3);
    let scene = scene_of(mixed(50, &mut dice).into_iter().chain([plane(-9.0 * DVec3::Y, DVec3::Y)]));
    let tracer = crate::Tracer::new(&scene).expect("valid");
    let mut rays = bundles(12, &mut dice);
    let broken = |i: usize| i % 5 == 2;
    for (i, ray) in rays.iter_mut().enumerate().filter(|(i, _)| broken(*i)) {
        let axis = i % 3;
        match i / 5 % 8 {
            0 => ray.dir = [0.0; 3],
            1 => ray.dir = [-0.0, 0.0, -0.0],
            2 => ray.dir[axis] = f32::NAN,
            3 => ray.dir[axis] = f32::INFINITY,
            4 => ray.origin[axis] = f32::NEG_INFINITY,
            5 => ray.origin[axis] = f32::NAN,
            6 => ray.t_min = f32::NAN,
            _ => ray.t_max = f32::NAN,
        }
    }
    let (hits, dark) = (tracer.closest_hits(&rays), tracer.occluded(&rays));
    let mut met = 0;
    for (i, ray) in rays.iter().enumerate() {
        let alone = tracer.closest_hit(ray);
        assert_eq!(crate::fixtures::bits(hits[i]), crate::fixtures::bits(alone), "{ray:?}");
        assert_eq!((dark[i], tracer.is_occluded(ray)), (alone.is_some(), alone.is_some()), "{ray:?}");
        assert!(!broken(i) || alone.is_none(), "{ray:?}");
        met += usize::from(alone.is_some());
    }
    assert!(met > 200, "{met}");
}

/// Shadow rays in no order, from one light, to one light, and along one direction; every tenth ray is broken.
#[test]
fn rays_that_are_regrouped_meet_what_they_meet_in_their_own_tiles() {
    let mut dice = Dice(5);
    let scene = scene_of(mixed(100, &mut dice));
    let plan = Plan::new(&scene, DVec3::ZERO);
    let tree = Tree::new(plan.parts(), &plan.visible);
    let (light, mut walk) = (DVec3::new(3.0, -40.0, 25.0), Walk::default());
    let aims: [&dyn Fn(DVec3) -> Ray; 3] = [
        &|point| Ray { t_max: 0.999, ..ray(light, point - light) },
        &|point| Ray { t_max: 0.999, ..ray(point, light - point) },
        &|point| ray(point, light),
    ];
    for (i, aim) in aims.into_iter().enumerate() {
        let mut rays: Vec<Ray> = (0..100 * PACKETS * LANES + 13).map(|_| aim(dice.in_cube(3.0))).collect();
        rays.iter_mut().step_by(10).for_each(|ray| ray.dir[1] = f32::NAN);
        let mut tiles: Vec<_> = rays.chunks(PACKETS * LANES).map(tile).collect();
        let mut alone = tiles.clone();
        tree.occluded_tiles(&mut tiles, &mut walk);
        let together = std::mem::take(&mut walk.counts).boxes;
        alone.iter_mut().for_each(|tile| tree.occluded_tiles(std::slice::from_mut(tile), &mut walk));
        let apart = std::mem::take(&mut walk.counts).boxes;
        let live = |tiles: &[Tile]| -> Vec<u32> {
            tiles.iter().flat_map(|tile| tile.packets.map(|rays| rays.live().bits())).collect()
        };
        assert_eq!(live(&tiles), live(&alone));
        let bright: u32 = live(&tiles).iter().map(|live| live.count_ones()).sum();
        assert!(bright > 100 && bright < 5700, "{bright} of 5,772 rays");
        assert!(together * 10 < apart * 9, "{i}: {together} tests of boxes against {apart}");
    }
}
