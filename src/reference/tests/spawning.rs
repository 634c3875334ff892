//! Rays that start on a surface.

use super::*;

/// Of random rays that meet a body, a new one leaves each place in a random direction.
///
/// Calls `leave` with the tracer, the old hit and the new ray; says how many there were.
fn spawned(center: f64, scale: f64, mut leave: impl FnMut(&Shape, &Reference, &super::super::Hit, Ray)) -> usize {
    let center = center * DVec3::new(1.0, -0.3, 0.7);
    let mut count = 0;
    for shape in one_of_each(center, scale) {
        let (tracer, mut dice) = (only(shape.clone()), Dice(scale.to_bits()));
        for _ in 0..12_500 {
            let origin = center + dice.in_cube(4.0 * scale);
            let aim = center + dice.in_cube(scale);
            let Some(hit) = tracer.closest(&ray(origin, aim - origin)) else { continue };
            let dir = dice.direction();
            // Half of them nearly along the surface.
            let dir = if dice.unit() < 0.5 { dir } else { dir - 0.999_999 * dir.dot(hit.normal) * hit.normal };
            count += 1;
            leave(&shape, &tracer, &hit, ray(hit.spawn(dir), dir));
        }
    }
    count
}

const PLACES: [(f64, f64); 8] =
    [(0.0, 1e-3), (0.0, 1.0), (0.0, 1e3), (0.0, 1e6), (1e6, 1e-1), (1e6, 1.0), (-1e7, 1.0), (1e7, 1e3)];

/// A convex body left outward is never met again.
#[test]
fn leaving_outward_meets_nothing() {
    let (mut count, mut tried) = (0, 0);
    for (center, scale) in PLACES {
        count += spawned(center, scale, |shape, tracer, hit, ray| {
            let flat = matches!(shape, Shape::Plane(_) | Shape::Disk(_) | Shape::Polygon(_));
            if flat || hit.normal.dot(ray.dir) > 0.0 {
                assert!(!tracer.occluded(&ray), "{shape:?} {hit:?} {ray:?}");
                tried += 1;
            }
        });
    }
    assert!(count > 600_000 && tried > 390_000, "{count} {tried}");
}

/// A body entered is left again through its far side, not through the place of entry.
#[test]
fn going_inward_leaves_elsewhere() {
    let mut tried = 0;
    for (center, scale) in PLACES {
        spawned(center, scale, |shape, tracer, hit, ray| {
            let closed = match shape {
                Shape::Sphere(_) | Shape::Box(_) => true,
                Shape::Cylinder(cylinder) => cylinder.caps,
                Shape::Cone(cone) => cone.caps,
                Shape::Plane(_) | Shape::Disk(_) | Shape::Polygon(_) => false,
            };
            let steep = hit.normal.dot(ray.dir) < -0.1;
            if closed && steep {
                let out = tracer.closest(&ray).unwrap_or_else(|| panic!("{shape:?} {hit:?} {ray:?}"));
                assert!(!out.front && (out.normal - hit.normal).length() > 1e-4, "{shape:?} {hit:?} {ray:?} {out:?}");
                tried += 1;
            }
        });
    }
    assert!(tried > 60_000, "{tried}");
}

/// Beside a ground of a million units as well.
#[test]
fn huge_spheres_are_left_too() {
    for radius in [1e3, 1e7, 1e12] {
        let tracer = only(sphere(DVec3::new(0.0, -radius, 0.0), radius));
        let mut dice = Dice(9);
        for _ in 0..20_000 {
            let eye = DVec3::new(dice.between(-9.0, 9.0), dice.between(0.1, 9.0), dice.between(-9.0, 9.0));
            let Some(hit) = tracer.closest(&ray(eye, dice.direction())) else { continue };
            let dir = dice.direction();
            assert_eq!(tracer.occluded(&ray(hit.spawn(dir), dir)), hit.normal.dot(dir) < 0.0, "{hit:?} {dir}");
        }
    }
}
