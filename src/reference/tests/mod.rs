//! Tests of the whole tracer: against closed forms, against another way to find a root, against itself.

mod bodies;
mod closed_forms;
mod pixels;
mod spawning;
mod verdicts;

use glam::{DQuat, DVec3};

use super::{Ray, Reference};
use crate::scene::*;

/// SplitMix64: numbers that look random and are the same in every run.
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    fn in_cube(&mut self, half: f64) -> DVec3 {
        DVec3::new(self.between(-half, half), self.between(-half, half), self.between(-half, half))
    }

    fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.in_cube(1.0);
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

fn ray(origin: DVec3, dir: DVec3) -> Ray {
    Ray { origin, dir, t_min: 0.0, t_max: f64::INFINITY }
}

fn diffuse() -> Material {
    let albedo = Paint::Color(DVec3::splat(0.5));
    Material { name: "clay".into(), model: Model::Diffuse { albedo }, back: None, visible: Visible::Both }
}

/// A scene of shapes in one material.
fn scene_of(shapes: Vec<Shape>) -> Scene {
    let objects = shapes.into_iter().map(|shape| Object { shape, material: 0, name: None, group: None });
    Scene { objects: objects.collect(), materials: vec![diffuse()], ..Scene::default() }
}

fn only(shape: Shape) -> Reference {
    Reference::new(&scene_of(vec![shape]))
}

fn sphere(center: DVec3, radius: f64) -> Shape {
    Shape::Sphere(Sphere { center, radius })
}

fn polygon(corners: Vec<DVec3>) -> Shape {
    Shape::Polygon(Polygon { corners, ..Polygon::default() })
}

/// An L of area 3 in the plane z = 0, front toward +z.
fn letter_l() -> Vec<DVec3> {
    let outline = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)];
    outline.map(|(x, y)| DVec3::new(f64::from(x), f64::from(y), 0.0)).to_vec()
}

/// One of each kind and variant, all within 2 of `center` times `scale`.
fn one_of_each(center: DVec3, scale: f64) -> Vec<Shape> {
    let at = |x: f64, y: f64, z: f64| center + scale * DVec3::new(x, y, z);
    let turned = Some(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7));
    let cuboid = |rotation| Shape::Box(Cuboid { min: at(-0.5, -0.75, -1.0), max: at(0.5, 1.0, 0.25), rotation });
    let (base, apex, radius) = (at(-0.5, -0.5, 0.25), at(0.5, 0.75, -0.5), 0.5 * scale);
    let cone = |apex_radius, caps| Shape::Cone(Cone { base, apex, radius, apex_radius: apex_radius * scale, caps });
    let disk = |inner_radius| {
        Shape::Disk(Disk {
            center,
            normal: DVec3::new(1.0, -2.0, 0.5),
            radius: scale,
            inner_radius: inner_radius * scale,
        })
    };
    vec![
        sphere(at(0.25, 0.5, -0.125), scale),
        Shape::Plane(Plane { point: at(0.0, 0.25, 0.0), normal: DVec3::new(0.25, 1.0, 0.5) }),
        disk(0.0),
        disk(0.5),
        polygon(letter_l().into_iter().map(|corner| center + scale * (corner - DVec3::ONE)).collect()),
        cuboid(None),
        cuboid(turned),
        Shape::Cylinder(Cylinder { base, apex, radius, caps: true }),
        Shape::Cylinder(Cylinder { base, apex, radius, caps: false }),
        cone(0.0, true),
        cone(0.25, true),
        cone(0.0, false),
        cone(0.75, false),
    ]
}
