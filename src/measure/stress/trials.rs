//! What is no family: rays that are none, packets of few rays, scenes in a mirror, rays that leave surfaces.

use glam::DVec3;
use serde::Serialize;

use super::dice::{Dice, toward};
use super::families::{self, scene_of};
use super::{engines, truth};
use crate::lanes::Ray;
use crate::reference::{Reference, Verdict};
use crate::scene::{Cone, Cuboid, Cylinder, Disk, Plane, Polygon, Scene, Shape, Sphere};
use crate::tracer::Tracer;

/// One of them.
#[derive(Debug, Clone, Serialize)]
pub struct Trial {
    /// What must hold.
    pub name: &'static str,
    /// Rays tried.
    pub rays: u64,
    /// Rays for which it does not.
    pub wrong: u64,
    /// The first of those, as bits of f32: origin, t_min, direction, t_max.
    pub worst: Option<[u32; 8]>,
}

/// Their names.
pub const NAMES: [&str; 5] = [
    "broken rays meet nothing",
    "live lanes do not matter",
    "mirrored and turned scenes",
    "spawned rays leave",
    "spawned rays are right",
];

/// Runs those that are wanted.
pub fn run(seed: u64, rays: usize, wanted: &dyn Fn(&str) -> bool) -> Vec<Trial> {
    let runs: [fn(&mut Dice, usize, &mut Trial); 5] = [broken, lanes, mirrored, leaving, spawned];
    let all = NAMES.into_iter().zip(runs).filter(|(name, _)| wanted(name));
    all.map(|(name, run)| {
        let mut trial = Trial { name, rays: 0, wrong: 0, worst: None };
        run(&mut Dice::new(seed, name), rays, &mut trial);
        trial
    })
    .collect()
}

impl Trial {
    fn note(&mut self, ray: &Ray, right: bool) {
        self.rays += 1;
        self.wrong += u64::from(!right);
        if !right && self.worst.is_none() {
            let ([x, y, z], [a, b, c]) = (ray.origin, ray.dir);
            self.worst = Some([x, y, z, ray.t_min, a, b, c, ray.t_max].map(f32::to_bits));
        }
    }
}

/// One scene with some of everything, and rays through it.
fn crowd(seed: u64, rays: usize) -> (Scene, Vec<Ray>) {
    let family = families::all().into_iter().find(|family| family.name == "crowd").expect("there is a crowd");
    family.sets(seed, 8 * rays).remove(0).cases.remove(0)
}

fn broken(dice: &mut Dice, rays: usize, trial: &mut Trial) {
    let (scene, good) = crowd(dice.index(1 << 30) as u64, rays);
    let tracer = Tracer::new(&scene).expect("valid");
    let mut mixed = good.clone();
    for (i, ray) in mixed.iter_mut().enumerate().filter(|(i, _)| i % 3 == 1) {
        let axis = dice.index(3);
        match i / 3 % 8 {
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
    let (hits, dark, alone) = (tracer.closest_hits(&mixed), tracer.occluded(&mixed), tracer.closest_hits(&good));
    for (i, ray) in mixed.iter().enumerate() {
        let right = match i % 3 == 1 {
            true => hits[i].is_none() && !dark[i] && tracer.closest_hit(ray).is_none() && !tracer.is_occluded(ray),
            false => hits[i] == alone[i],
        };
        trial.note(ray, right);
    }
}

/// The same bits alone, in company of any number, and beside rays that are none.
fn lanes(dice: &mut Dice, rays: usize, trial: &mut Trial) {
    let (scene, good) = crowd(dice.index(1 << 30) as u64, rays);
    let tracer = Tracer::new(&scene).expect("valid");
    let dead = Ray { origin: [f32::NAN; 3], t_min: f32::NAN, dir: [f32::NAN; 3], t_max: f32::NAN };
    for live in 1..=8 {
        for some in good.chunks(live) {
            let mut eight = [dead; 8];
            let first = dice.index(9 - some.len());
            eight[first..first + some.len()].copy_from_slice(some);
            let hits = tracer.closest_hits(&eight);
            for (lane, ray) in some.iter().enumerate() {
                trial.note(ray, hits[first + lane] == tracer.closest_hit(ray));
            }
        }
    }
}

/// Axes exchanged and turned round: the same primitives at the same places.
fn mirrored(dice: &mut Dice, rays: usize, trial: &mut Trial) {
    for _ in 0..6 {
        let (scene, good) = crowd(dice.index(1 << 30) as u64, rays / 2);
        let (first, signs) = (dice.index(3), [0; 3].map(|_| dice.sign()));
        let swap = dice.index(2) == 1;
        let order = if swap { [first, (first + 2) % 3, (first + 1) % 3] } else { [0, 1, 2].map(|k| (first + k) % 3) };
        let turn = |v: DVec3| DVec3::from_array([0, 1, 2].map(|k| signs[k] * v[order[k]]));
        let ray = |ray: &Ray| {
            let wide = |v: [f32; 3]| turn(DVec3::from_array(v.map(f64::from))).as_vec3().to_array();
            Ray { origin: wide(ray.origin), dir: wide(ray.dir), ..*ray }
        };
        let kept: Vec<Shape> = scene
            .objects
            .iter()
            .map(|object| object.shape.clone())
            .filter(|shape| moved(shape, &turn).is_some())
            .collect();
        let other = scene_of(kept.iter().filter_map(|shape| moved(shape, &turn)).collect());
        let scene = scene_of(kept);
        let (one, two) = (Tracer::new(&scene).expect("valid"), Tracer::new(&other).expect("valid"));
        let turned: Vec<Ray> = good.iter().map(ray).collect();
        for ((ray, a), b) in good.iter().zip(one.closest_hits(&good)).zip(two.closest_hits(&turned)) {
            let same = match (a, b) {
                (None, None) => true,
                (Some(a), Some(b)) => a.primitive == b.primitive && (a.t.next_down()..=a.t.next_up()).contains(&b.t),
                _ => false,
            };
            trial.note(ray, same);
        }
    }
}

/// A shape with its axes exchanged; `None` where that cannot be said exactly.
fn moved(shape: &Shape, turn: &dyn Fn(DVec3) -> DVec3) -> Option<Shape> {
    Some(match shape.clone() {
        Shape::Sphere(s) => Shape::Sphere(Sphere { center: turn(s.center), ..s }),
        Shape::Plane(p) => Shape::Plane(Plane { point: turn(p.point), normal: turn(p.normal) }),
        Shape::Disk(d) => Shape::Disk(Disk { center: turn(d.center), normal: turn(d.normal), ..d }),
        Shape::Polygon(p) => Shape::Polygon(Polygon { corners: p.corners.into_iter().map(turn).collect(), ..p }),
        Shape::Box(Cuboid { rotation: Some(_), .. }) => return None,
        Shape::Box(b) => {
            let (a, c) = (turn(b.min), turn(b.max));
            Shape::Box(Cuboid { min: a.min(c), max: a.max(c), rotation: None })
        }
        Shape::Cylinder(c) => Shape::Cylinder(Cylinder { base: turn(c.base), apex: turn(c.apex), ..c }),
        Shape::Cone(c) => Shape::Cone(Cone { base: turn(c.base), apex: turn(c.apex), ..c }),
    })
}

/// Calls with rays that leave hits on closed convex bodies outwards: scene, body that was hit, ray.
fn outward(dice: &mut Dice, rays: usize, mut each: impl FnMut(&Tracer, &Scene, usize, Ray)) {
    for away in [0.0, 1e3, 1e6] {
        let (mut scene, good) = crowd(dice.index(1 << 30) as u64, rays);
        let shift = DVec3::new(away, -away, 0.5 * away);
        scene.objects.iter_mut().for_each(|object| shift_shape(&mut object.shape, shift));
        let tracer = Tracer::new(&scene).expect("valid");
        for ray in good {
            let origin = DVec3::from_array(ray.origin.map(f64::from)) + shift;
            let ray = toward(origin, origin + DVec3::from_array(ray.dir.map(f64::from)));
            let Some(hit) = tracer.closest_hit(&ray) else { continue };
            let normal = DVec3::from_array(hit.normal.map(f64::from));
            let mut dir = dice.direction();
            if dice.index(2) == 0 {
                dir -= (1.0 - dice.log_between(1e-5, 1e-1)) * dir.dot(normal) * normal;
            }
            let dir = if dir.dot(normal) < 0.0 { dir - 2.0 * dir.dot(normal) * normal } else { dir };
            let dir = dir.as_vec3();
            if dir.as_dvec3().dot(normal) > 1e-6 {
                each(&tracer, &scene, hit.primitive as usize, hit.spawn(dir.to_array()));
            }
        }
    }
}

fn shift_shape(shape: &mut Shape, by: DVec3) {
    match shape {
        Shape::Sphere(s) => s.center += by,
        Shape::Plane(p) => p.point += by,
        Shape::Disk(d) => d.center += by,
        Shape::Polygon(p) => p.corners.iter_mut().for_each(|corner| *corner += by),
        Shape::Box(b) => (b.min, b.max) = (b.min + by, b.max + by),
        Shape::Cylinder(c) => (c.base, c.apex) = (c.base + by, c.apex + by),
        Shape::Cone(c) => (c.base, c.apex) = (c.base + by, c.apex + by),
    }
}

fn leaving(dice: &mut Dice, rays: usize, trial: &mut Trial) {
    outward(dice, rays, |tracer, _, primitive, ray| {
        let again = tracer.closest_hit(&ray).is_some_and(|hit| hit.primitive as usize == primitive);
        trial.note(&ray, !again);
    });
}

/// As the numbers that their bits are.
fn spawned(dice: &mut Dice, rays: usize, trial: &mut Trial) {
    outward(dice, rays / 4, |tracer, scene, _, ray| {
        let met = tracer.closest_hit(&ray).map(|hit| hit.primitive as usize);
        let truth = truth::closest(scene, &ray).map(|truth| truth.primitive);
        let tie = || Reference::new(scene).verdict_exact(&engines::exact(&ray), truth) == Verdict::Tie;
        trial.note(&ray, met == truth || tie());
    });
}
