//! Rays that start on surfaces, and rays at the seams of closed meshes.

mod common;

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use common::{Dice, MAKERS, cuboid, is_closed, is_flat, polygon, ray, scene_of, sphere, turn};
use glam::DVec3;
use octray::reference::{self, Reference};
use octray::scene::Shape;
use octray::{Hit, Ray, Tracer};

/// Distance of the body from the origin in its own sizes, and its size.
const PLACES: [(f64, f64); 6] = [(0.0, 1e-3), (0.0, 1.0), (0.0, 1e5), (1e4, 1e-3), (1e2, 1.0), (1e4, 1e3)];

/// Calls `leave` with the body, its hit and a ray that leaves there in a random or grazing direction.
fn spawned(mut leave: impl FnMut(&str, &Shape, &Tracer, &Hit, Ray)) {
    for (away, scale) in PLACES {
        for (name, maker) in MAKERS {
            let mut dice = Dice(scale.to_bits() ^ away.to_bits());
            let center = away * scale * DVec3::new(0.9, -0.3, 0.6);
            for _ in 0..10 {
                let shape = maker(center, scale, turn(&mut dice));
                let scene = scene_of([shape.clone()]);
                let tracer = Tracer::new(&scene).expect("valid");
                for _ in 0..150 {
                    let origin = center + dice.in_cube(3.0 * scale);
                    let aim = center + dice.in_cube(scale);
                    let Some(hit) = tracer.closest_hit(&ray(origin, aim - origin)) else { continue };
                    let normal = DVec3::from_array(hit.normal.map(f64::from));
                    let mut dir = dice.direction();
                    if dice.index(2) == 0 {
                        dir -= (1.0 - dice.log_between(1e-5, 1e-1)) * dir.dot(normal) * normal;
                    }
                    leave(name, &shape, &tracer, &hit, hit.spawn(dir.as_vec3().to_array()));
                }
            }
        }
    }
}

/// The cosine of a ray that leaves a hit, exactly.
fn cosine(hit: &Hit, ray: &Ray) -> f64 {
    (0..3).map(|k| f64::from(hit.normal[k]) * f64::from(ray.dir[k])).sum()
}

/// f32 knows a normal to some 1e-7: a ray closer to the surface than this may as well go the other way.
const LEAST_COSINE: f64 = 1e-6;

#[test]
fn what_leaves_a_convex_body_never_meets_it_again() {
    let (mut left, mut grazing, mut met) = (HashMap::new(), 0, Vec::new());
    spawned(|name, shape, tracer, hit, ray| {
        let cosine = cosine(hit, &ray);
        let outward = cosine > LEAST_COSINE || (is_flat(shape) && cosine < -LEAST_COSINE);
        if outward {
            *left.entry(name.to_string()).or_insert(0) += 1;
            grazing += usize::from(cosine.abs() < 1e-2);
            if tracer.is_occluded(&ray) {
                met.push(format!("{shape:?} {hit:?} {ray:?}"));
            }
        }
    });
    assert!(met.is_empty(), "{} of {left:?}, such as {}", met.len(), met[0]);
    assert!(
        left.len() == MAKERS.len() && left.values().all(|count| *count > 700) && grazing > 5000,
        "{left:?} {grazing}"
    );
}

/// Whether the body reaches some errors further behind a hit and to its sides. Beside an edge that is nearer
/// than f32 can say where a ray starts, there is no inside to go to.
fn has_room(shape: &Shape, hit: &Hit) -> bool {
    let reference = Reference::new(&scene_of([shape.clone()]));
    let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let (normal, error) = (wide(hit.normal), f64::from(hit.error));
    let origin = wide(hit.point) - 8.0 * error * normal;
    let side = normal.any_orthonormal_vector();
    let across = normal.cross(side);
    let is_free = |dir: DVec3| {
        let ray = reference::Ray { origin, dir, t_min: 0.0, t_max: f64::INFINITY };
        reference.closest(&ray).is_some_and(|hit| !hit.front && hit.t > 16.0 * error)
    };
    [-normal, side, -side, across, -across].into_iter().all(is_free)
}

#[test]
fn what_enters_a_closed_body_meets_its_far_side() {
    let (mut entered, mut cramped) = (0, 0);
    spawned(|_, shape, tracer, hit, ray| {
        if !is_closed(shape) || cosine(hit, &ray) > -0.1 {
            return;
        }
        if !has_room(shape, hit) {
            cramped += 1;
            return;
        }
        entered += 1;
        let out = tracer.closest_hit(&ray).unwrap_or_else(|| panic!("lost in {shape:?}: {hit:?} {ray:?}"));
        let apart = (0..3).map(|k| (out.normal[k] - hit.normal[k]).abs()).sum::<f32>();
        assert!(!out.front && apart > 1e-3, "{shape:?}: {hit:?} {ray:?} {out:?}");
    });
    assert!(entered > 5000 && cramped < entered / 4, "{entered} {cramped}");
}

/// A closed surface of polygons that share their corners.
struct Mesh {
    corners: Vec<DVec3>,
    faces: Vec<Vec<usize>>,
}

impl Mesh {
    /// Triangles at the poles, quads between.
    fn globe(rings: usize, segments: usize) -> Mesh {
        let mut corners = vec![DVec3::Y, -DVec3::Y];
        for ring in 1..rings {
            for segment in 0..segments {
                let (polar, azimuth) = (PI * ring as f64 / rings as f64, TAU * segment as f64 / segments as f64);
                corners.push(DVec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin()));
            }
        }
        let at = |ring: usize, segment: usize| 2 + (ring - 1) * segments + segment % segments;
        let mut faces = Vec::new();
        for s in 0..segments {
            faces.push(vec![0, at(1, s + 1), at(1, s)]);
            faces.push(vec![1, at(rings - 1, s), at(rings - 1, s + 1)]);
            faces.extend((1..rings - 1).map(|r| vec![at(r, s), at(r, s + 1), at(r + 1, s + 1), at(r + 1, s)]));
        }
        Mesh { corners, faces }
    }

    /// The quads as triangles.
    fn triangulated(self) -> Mesh {
        let fan = |face: Vec<usize>| {
            (1..face.len() - 1).map(move |k| vec![face[0], face[k], face[k + 1]]).collect::<Vec<_>>()
        };
        Mesh { faces: self.faces.into_iter().flat_map(fan).collect(), ..self }
    }

    /// Two n-gons and n squares.
    fn prism(sides: usize) -> Mesh {
        let corner = |k: usize, z: f64| {
            let angle = TAU * (k % sides) as f64 / sides as f64;
            DVec3::new(angle.cos(), angle.sin(), z)
        };
        let corners = (0..2 * sides).map(|k| corner(k, if k < sides { -0.5 } else { 0.5 })).collect();
        let side = |k: usize| vec![k, (k + 1) % sides, sides + (k + 1) % sides, sides + k];
        let ends = [(0..sides).rev().collect(), (sides..2 * sides).collect()];
        Mesh { corners, faces: (0..sides).map(side).chain(ends).collect() }
    }

    fn moved(self, by: DVec3) -> Mesh {
        Mesh { corners: self.corners.into_iter().map(|corner| corner + by).collect(), ..self }
    }

    fn shapes(&self) -> Vec<Shape> {
        self.faces.iter().map(|face| polygon(face.iter().map(|k| self.corners[*k]))).collect()
    }
}

#[test]
fn no_ray_leaks_through_a_seam() {
    let meshes: [fn() -> Mesh; 6] = [
        || Mesh::globe(7, 12),
        || Mesh::globe(8, 16).triangulated(),
        || Mesh::prism(4),
        || Mesh::prism(5),
        || Mesh::prism(8),
        || Mesh::prism(13),
    ];
    let mut aimed = 0;
    for by in [DVec3::ZERO, DVec3::new(1e4, -3e3, 7e3), 123.456 * DVec3::ONE] {
        for make in meshes {
            let mesh = make().moved(by);
            let scene = scene_of(mesh.shapes());
            let (tracer, mut dice) = (Tracer::new(&scene).expect("valid"), Dice(41));
            let mut rays = Vec::new();
            for case in 0..6000 {
                let origin = (by + if case % 3 == 0 { DVec3::ZERO } else { dice.in_cube(0.3) }).as_vec3().as_dvec3();
                let face = &mesh.faces[dice.index(mesh.faces.len())];
                let k = dice.index(face.len());
                let (a, b) = (mesh.corners[face[k]], mesh.corners[face[(k + 1) % face.len()]]);
                let target = match case % 4 {
                    0 => a,
                    1 => a.midpoint(b),
                    2 => a.lerp(b, dice.unit()),
                    _ => a.lerp(b, dice.unit()) + dice.direction() * dice.log_between(1e-9, 1e-3),
                };
                rays.push(ray(origin, target - origin));
            }
            for (ray, hit) in rays.iter().zip(tracer.closest_hits(&rays)) {
                assert!(hit.is_some(), "{} faces at {by}: {ray:?}", mesh.faces.len());
                assert!(tracer.closest_hit(ray).is_some() && tracer.is_occluded(ray), "{ray:?}");
            }
            aimed += rays.len();
        }
    }
    assert!(aimed > 100_000, "{aimed}");
}

/// Boxes thinner than f32 rounds, and spheres smaller than that: the near side is met, and told as the front.
#[test]
fn bodies_smaller_than_a_rounding_show_the_side_that_was_met() {
    let mut dice = Dice(7);
    let mut met = 0;
    for size in [1e-6, 1e-9, 1e-12] {
        for _ in 0..300 {
            let center = dice.in_cube(3.0);
            let mut half = DVec3::ONE;
            half[dice.index(3)] = size;
            let body = if dice.index(2) == 0 { cuboid(center - half, center + half) } else { sphere(center, size) };
            let scene = scene_of([body]);
            let tracer = Tracer::new(&scene).expect("valid");
            let origin = (center + 4.0 * dice.direction()).as_vec3().as_dvec3();
            let ray = ray(origin, center + dice.in_cube(0.4 * size) - origin);
            let (Some(hit), want) = (tracer.closest_hit(&ray), Reference::new(&scene).closest(&common::exact(&ray)))
            else {
                continue;
            };
            let want = want.expect("the reference meets it too");
            let normal = DVec3::from_array(hit.normal.map(f64::from));
            assert!(hit.front && want.front, "{size} {ray:?} {hit:?}");
            assert!((normal - want.normal).length() < 1e-5, "{size} {ray:?} {hit:?} {want:?}");
            met += 1;
        }
    }
    assert!(met > 300, "{met}");
}

/// The length of a direction is nothing but the unit of `t`.
#[test]
fn directions_may_be_of_any_length() {
    let mut dice = Dice(8);
    let mut met = 0;
    for (_, maker) in MAKERS {
        let scene = scene_of([maker(DVec3::ZERO, 1.0, turn(&mut dice))]);
        let tracer = Tracer::new(&scene).expect("valid");
        let mut aim = || {
            let origin = 4.0 * dice.direction();
            ray(origin, dice.in_cube(0.8) - origin)
        };
        let rays: Vec<Ray> = (0..64).map(|_| aim()).collect();
        for power in [-110, -70, -30, 25, 70, 110] {
            let factor = 2f32.powi(power);
            let scaled: Vec<Ray> = rays.iter().map(|ray| Ray { dir: ray.dir.map(|d| d * factor), ..*ray }).collect();
            let dark = tracer.occluded(&scaled);
            for (i, (a, b)) in tracer.closest_hits(&rays).iter().zip(tracer.closest_hits(&scaled)).enumerate() {
                assert_eq!(b, tracer.closest_hit(&scaled[i]));
                assert_eq!(b.is_some(), dark[i]);
                assert_eq!(b.map(|hit| Hit { t: hit.t * factor, ..hit }), *a, "{power} {:?}", rays[i]);
                met += usize::from(a.is_some());
            }
        }
    }
    assert!(met > 500, "{met}");
}
