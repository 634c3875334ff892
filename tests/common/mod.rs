//! What tests share: dice, one shape of each kind, small scenes.
#![allow(dead_code)] // no test needs all of it

use glam::{DQuat, DVec3};
use octray::scene::*;
use octray::{Ray, reference};

/// SplitMix64: numbers that look random and are the same in every run.
pub struct Dice(pub u64);

impl Dice {
    /// 64 bits.
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// A number in 0..1.
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Evenly spread over the orders of magnitude.
    pub fn log_between(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    pub fn index(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    pub fn in_cube(&mut self, half: f64) -> DVec3 {
        DVec3::new(self.between(-half, half), self.between(-half, half), self.between(-half, half))
    }

    /// Of unit length.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.in_cube(1.0);
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

/// The ray whose bits are nearest.
pub fn ray(origin: DVec3, dir: DVec3) -> Ray {
    Ray::new(origin.as_vec3().to_array(), dir.as_vec3().to_array())
}

/// The exact numbers that the bits of a ray are.
pub fn exact(ray: &Ray) -> reference::Ray {
    let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
    reference::Ray { origin: wide(ray.origin), dir: wide(ray.dir), t_min, t_max }
}

/// All that counts of a hit, as bits.
pub fn bits(hit: Option<octray::Hit>) -> Option<(u32, u32, u32, [u32; 9])> {
    hit.map(|hit| {
        let ([a, b, c], [x, y, z], [u, v]) = (hit.normal, hit.point, hit.uv);
        let floats = [a, b, c, x, y, z, u, v, hit.error].map(f32::to_bits);
        (hit.t.to_bits(), hit.primitive, hit.material << 1 | u32::from(hit.front), floats)
    })
}

pub fn material(name: &str, model: Model) -> Material {
    Material { name: name.into(), model, back: None, visible: Visible::Both }
}

pub fn gray(albedo: f64) -> Material {
    material("gray", Model::Diffuse { albedo: Paint::Color(DVec3::splat(albedo)) })
}

pub fn object(shape: Shape, material: usize) -> Object {
    Object { shape, material, name: None, group: None }
}

/// Shapes in one gray material.
pub fn scene_of(shapes: impl IntoIterator<Item = Shape>) -> Scene {
    let objects = shapes.into_iter().map(|shape| object(shape, 0)).collect();
    Scene { objects, materials: vec![gray(0.5)], ..Scene::default() }
}

pub fn sphere(center: DVec3, radius: f64) -> Shape {
    Shape::Sphere(Sphere { center, radius })
}

pub fn plane(point: DVec3, normal: DVec3) -> Shape {
    Shape::Plane(Plane { point, normal })
}

pub fn disk(center: DVec3, normal: DVec3, radius: f64, inner_radius: f64) -> Shape {
    Shape::Disk(Disk { center, normal, radius, inner_radius })
}

pub fn polygon(corners: impl IntoIterator<Item = DVec3>) -> Shape {
    Shape::Polygon(Polygon { corners: corners.into_iter().collect(), ..Polygon::default() })
}

pub fn cuboid(min: DVec3, max: DVec3) -> Shape {
    Shape::Box(Cuboid { min, max, rotation: None })
}

/// Turns a shape's description into a shape that is somewhere: at a place, of a size, in a direction.
pub type Maker = fn(center: DVec3, scale: f64, turn: DQuat) -> Shape;

/// Every kernel, and every variant that takes another way through one. All within 2 scales of the centre.
pub const MAKERS: [(&str, Maker); 17] = [
    ("sphere", |c, s, _| sphere(c, s)),
    ("plane", |c, _, q| plane(c, q * DVec3::Z)),
    ("disk", |c, s, q| disk(c, q * DVec3::X, s, 0.0)),
    ("ring", |c, s, q| disk(c, q * DVec3::Y, s, 0.6 * s)),
    ("triangle", |c, s, q| ngon(c, s, q, 3)),
    ("quad", |c, s, q| ngon(c, s, q, 4)),
    ("pentagon", |c, s, q| ngon(c, s, q, 5)),
    ("octagon", |c, s, q| ngon(c, s, q, 8)),
    ("13-gon", |c, s, q| ngon(c, s, q, 13)),
    ("letter L", |c, s, q| polygon(letter_l().map(|corner| c + s * (q * (corner - DVec3::new(0.75, 0.75, 0.0)))))),
    ("box", |c, s, q| {
        // The turn gives the proportions.
        let half = s * (DVec3::splat(0.25) + 0.75 * DVec3::new(q.x, q.y, q.z).abs());
        cuboid(c - half, c + half)
    }),
    ("turned box", |c, s, q| {
        let half = s * DVec3::new(0.5, 0.75, 1.0);
        Shape::Box(Cuboid { min: c - half, max: c + half, rotation: Some(q) })
    }),
    ("open cylinder", |c, s, q| cylinder(c, s, q, false)),
    ("cylinder", |c, s, q| cylinder(c, s, q, true)),
    ("open cone", |c, s, q| cone(c, s, q, [0.75, 0.0], false)),
    ("frustum", |c, s, q| cone(c, s, q, [0.75, 0.25], true)),
    ("open frustum that widens", |c, s, q| cone(c, s, q, [0.25, 1.0], false)),
];

fn ngon(center: DVec3, scale: f64, turn: DQuat, corners: u32) -> Shape {
    let corner = |k| {
        let angle = f64::from(k) * std::f64::consts::TAU / f64::from(corners);
        center + scale * (turn * DVec3::new(angle.cos(), angle.sin(), 0.0))
    };
    polygon((0..corners).map(corner))
}

/// An L of area 3 in the plane z = 0.
fn letter_l() -> [DVec3; 6] {
    [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)].map(|(x, y)| DVec3::new(f64::from(x), f64::from(y), 0.0))
}

fn cylinder(center: DVec3, scale: f64, turn: DQuat, caps: bool) -> Shape {
    let half = scale * (turn * DVec3::Z);
    Shape::Cylinder(Cylinder { base: center - half, apex: center + half, radius: 0.5 * scale, caps })
}

fn cone(center: DVec3, scale: f64, turn: DQuat, radii: [f64; 2], caps: bool) -> Shape {
    let half = scale * (turn * DVec3::X);
    let [radius, apex_radius] = radii.map(|radius| radius * scale);
    Shape::Cone(Cone { base: center - half, apex: center + half, radius, apex_radius, caps })
}

/// Whether a shape is a convex solid with a closed surface.
pub fn is_closed(shape: &Shape) -> bool {
    match shape {
        Shape::Sphere(_) | Shape::Box(_) => true,
        Shape::Cylinder(cylinder) => cylinder.caps,
        Shape::Cone(cone) => cone.caps,
        Shape::Plane(_) | Shape::Disk(_) | Shape::Polygon(_) => false,
    }
}

/// Whether a shape lies in a plane.
pub fn is_flat(shape: &Shape) -> bool {
    matches!(shape, Shape::Plane(_) | Shape::Disk(_) | Shape::Polygon(_))
}

pub fn turn(dice: &mut Dice) -> DQuat {
    DQuat::from_axis_angle(dice.direction(), dice.between(0.0, 6.0))
}

/// Looks at the origin's neighbourhood from `eye`.
pub fn pinhole(eye: DVec3, target: DVec3, vfov: f64) -> Camera {
    Camera { name: None, eye, target, up: DVec3::Y, lens: Lens::Pinhole { vfov } }
}

pub fn orthographic(eye: DVec3, target: DVec3, height: f64) -> Camera {
    Camera { name: None, eye, target, up: DVec3::Y, lens: Lens::Orthographic { height } }
}

pub fn image(width: u32, height: u32, spp: u32) -> Option<ImageSettings> {
    Some(ImageSettings { width, height, spp, filter: Filter { kind: FilterKind::Box, radius: 0.5 } })
}

pub fn light(source: Source) -> Light {
    Light { name: None, shadows: true, source }
}

pub fn point_light(position: DVec3, intensity: f64) -> Light {
    light(Source::Point { position, intensity: DVec3::splat(intensity), falloff: Falloff::InverseSquare })
}
