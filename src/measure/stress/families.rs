//! The families: scenes and rays that f32, or textbook formulas, are bad at.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::dice::{Dice, toward};
use crate::lanes::Ray;
use crate::scene::{
    Cone, Cuboid, Cylinder, Disk, Material, Model, Object, Paint, Plane, Polygon, Scene, Shape, Sphere, Visible,
};

/// Scenes of one family and one value of its parameter, and rays that are hard on them.
#[derive(Debug)]
pub struct Set {
    pub family: &'static str,
    pub parameter: String,
    pub cases: Vec<(Scene, Vec<Ray>)>,
}

/// Shapes, and what makes rays for them.
type Case = (Vec<Shape>, Box<dyn Fn(&mut Dice) -> Ray>);

/// What makes a case for a value of the family's parameter.
type Maker = fn(&mut Dice, f64) -> Case;

/// A family: its name, the values of its parameter, and what makes its cases.
pub struct Family {
    pub name: &'static str,
    values: Vec<f64>,
    make: Maker,
}

/// Sizes of whole scenes.
const SCALES: [f64; 12] = [1e-30, 1e-24, 1e-22, 1e-21, 1e-20, 1e-19, 1e-18, 1e-15, 1e-12, 1e9, 1e12, 5e14];

/// Scenes a set.
const SCENES: usize = 8;

impl Family {
    /// The sets of all values, with so many rays each.
    pub fn sets(&self, seed: u64, rays: usize) -> Vec<Set> {
        self.values.iter().map(|value| self.set(seed, *value, rays)).collect()
    }

    fn set(&self, seed: u64, value: f64, rays: usize) -> Set {
        let mut dice = Dice::new(seed ^ value.to_bits(), self.name);
        let case = |_| {
            let (shapes, aim) = (self.make)(&mut dice, value);
            let rays = (0..rays.div_ceil(SCENES)).map(|_| aim(&mut dice)).collect();
            (scene_of(shapes), rays)
        };
        let cases = (0..SCENES).map(case).collect();
        Set { family: self.name, parameter: format!("{value:.0e}"), cases }
    }
}

/// All families.
pub fn all() -> Vec<Family> {
    let family = |name, values: Vec<f64>, make: Maker| Family { name, values, make };
    let mut moved = decades(3, 7);
    moved.insert(0, 0.0);
    vec![
        family("sphere from far", decades(1, 6), |dice, v| {
            let (c, r) = (dice.in_cube(1.0), dice.between(0.5, 2.0));
            (vec![sphere(c, r)], Box::new(move |dice| toward(c + dice.direction() * v * r, c + dice.in_cube(1.1 * r))))
        }),
        family("ground sphere", decades(3, 7), |dice, v| {
            let height = dice.between(0.5, 8.0);
            let eye = DVec3::new(0.0, height, 0.0);
            let aim = move |dice: &mut Dice| {
                let way = dice.log_between(0.1, 0.3 * v.sqrt() * height.sqrt());
                toward(eye, DVec3::new(0.6 * way, 0.0, 0.8 * way) + dice.in_cube(0.05 * way))
            };
            (vec![sphere(DVec3::new(0.0, -v, 0.0), v)], Box::new(aim))
        }),
        family("sphere silhouette", decades(-7, -1), |dice, v| {
            let (c, r) = (dice.in_cube(1.0), dice.between(0.5, 2.0));
            (vec![sphere(c, r)], Box::new(move |dice| beside(c, r * (1.0 + dice.sign() * v), 5.0 * r, dice)))
        }),
        family("tiny sphere", decades(-6, -3), |dice, v| {
            let c = dice.direction() * dice.log_between(1.0, 1e3);
            (vec![sphere(c, v)], Box::new(move |dice| toward(dice.in_cube(0.1), c + dice.in_cube(1.1 * v))))
        }),
        family("sphere moved", moved.clone(), |dice, v| {
            let (c, r) = (dice.direction() * v, dice.between(0.5, 2.0));
            let aim = move |dice: &mut Dice| toward(c + dice.direction() * dice.between(2.5, 9.0), c + dice.in_cube(r));
            (vec![sphere(c, r)], Box::new(aim))
        }),
        family("inside sphere", decades(-6, -1), |dice, v| {
            let (c, r) = (dice.in_cube(1.0), dice.between(0.5, 2.0));
            let aim = move |dice: &mut Dice| {
                let origin = c + dice.direction() * r * (1.0 - v);
                toward(origin, origin + dice.direction())
            };
            (vec![sphere(c, r)], Box::new(aim))
        }),
        family("plane", decades(-7, 0), |dice, v| {
            let (point, n) = (dice.in_cube(1.0), dice.direction());
            (vec![plane(point, n)], Box::new(move |dice| at_angle(point + across(n, dice), n, v, dice)))
        }),
        family("plane moved", moved.clone(), |dice, v| {
            let (point, n) = (dice.direction() * v, dice.direction());
            (vec![plane(point, n)], Box::new(move |dice| at_angle(point + across(n, dice), n, 0.7, dice)))
        }),
        family("disk rim", decades(-6, -1), |dice, v| {
            let (c, n, r) = (dice.in_cube(1.0), dice.direction(), dice.between(0.5, 2.0));
            let inner = if dice.index(2) == 0 { 0.0 } else { 0.5 * r };
            let aim = move |dice: &mut Dice| {
                let rim = if inner > 0.0 && dice.index(2) == 0 { inner } else { r };
                let out = across(n, dice).normalize() * rim * (1.0 + dice.sign() * v);
                toward(c + dice.direction() * 4.0 * r, c + out)
            };
            (vec![disk(c, n, r, inner)], Box::new(aim))
        }),
        family("disk grazing", decades(-7, -1), |dice, v| {
            let (c, n) = (dice.in_cube(1.0), dice.direction());
            (vec![disk(c, n, 1.5, 0.0)], Box::new(move |dice| at_angle(c + 0.9 * across(n, dice), n, v, dice)))
        }),
        family("disk moved", moved.clone(), |dice, v| {
            let (c, n) = (dice.direction() * v, dice.direction());
            (
                vec![disk(c, n, 1.0, 0.3)],
                Box::new(move |dice| toward(c + dice.direction() * 5.0, c + dice.in_cube(0.8))),
            )
        }),
        family("triangle sliver", decades(1, 6), |dice, v| {
            let (c, q) = (dice.in_cube(1.0), dice.turn());
            let corners = [(-1.0, 0.0), (1.0, 0.0), (0.3, 2.0 / v)].map(|(x, y)| c + q * DVec3::new(x, y, 0.0));
            let aim = move |dice: &mut Dice| {
                let at = DVec3::new(dice.between(-1.0, 1.0), dice.between(-0.5, 2.5) / v, 0.0);
                toward(c + q * (dice.direction() * 3.0 + DVec3::Z), c + q * at)
            };
            (vec![polygon(corners)], Box::new(aim))
        }),
        family("polygon moved", moved.clone(), |dice, v| {
            let (c, q, n) = (dice.direction() * v, dice.turn(), 3 + dice.index(10));
            (vec![ngon(c, q, n)], Box::new(move |dice| toward(c + dice.direction() * 5.0, c + dice.in_cube(1.0))))
        }),
        family("polygon lattice", moved.clone(), |dice, v| {
            let (c, n) = (DVec3::new(v, 2.0 * v, -v), 4 + dice.index(9));
            // Corners on a lattice and rays between points of it: at corners and along edges.
            let lattice = |dice: &mut Dice| DVec3::from_array([0; 3].map(|_| dice.index(9) as f64 / 4.0 - 1.0));
            let corner = move |k: usize| {
                let angle = k as f64 * TAU / n as f64;
                c + DVec3::new((4.0 * angle.cos()).round() / 4.0, (4.0 * angle.sin()).round() / 4.0, 0.0)
            };
            let mut corners: Vec<DVec3> = (0..n).map(corner).collect();
            corners.dedup();
            let aim = move |dice: &mut Dice| {
                toward(c + lattice(dice) + 3.0 * DVec3::Z, c + lattice(dice) * DVec3::new(1.0, 1.0, 0.0))
            };
            (vec![polygon(corners)], Box::new(aim))
        }),
        family("quad grazing", decades(-7, -1), |dice, v| {
            let (c, q) = (dice.in_cube(1.0), dice.turn());
            let aim = move |dice: &mut Dice| {
                let at = q * DVec3::new(dice.between(-0.8, 0.8), dice.between(-0.8, 0.8), 0.0);
                at_angle(c + at, q * DVec3::Z, v, dice)
            };
            (vec![ngon(c, q, 4)], Box::new(aim))
        }),
        family("mesh seams", moved.clone(), mesh_seams),
        family("box", vec![0.0], |dice, _| {
            let (c, half) = (dice.in_cube(1.0), DVec3::splat(0.1) + dice.in_cube(1.0).abs());
            (
                vec![cuboid(c - half, c + half)],
                Box::new(move |dice| toward(dice.direction() * 5.0, c + dice.in_cube(1.2) * half)),
            )
        }),
        family("box edge", decades(-9, -1), |dice, v| {
            let (c, half) = (dice.in_cube(1.0), DVec3::splat(0.1) + dice.in_cube(1.0).abs());
            let aim = move |dice: &mut Dice| {
                let mut at = DVec3::from_array([0; 3].map(|_| dice.sign()));
                at[dice.index(3)] = dice.between(-1.0, 1.0);
                toward(c + dice.direction() * 8.0, c + half * at * (1.0 + dice.sign() * v))
            };
            (vec![cuboid(c - half, c + half)], Box::new(aim))
        }),
        family("box thin", decades(-7, -1), |dice, v| {
            let (c, mut half) = (dice.in_cube(1.0), DVec3::splat(1.0));
            half[dice.index(3)] = v;
            (
                vec![cuboid(c - half, c + half)],
                Box::new(move |dice| toward(dice.direction() * 5.0, c + dice.in_cube(1.3))),
            )
        }),
        family("box along axes", vec![0.0, 1e5], |dice, v| {
            // Zeros of both signs, and numbers that make rays run in faces, edges and corners.
            let c = DVec3::splat(v) + DVec3::from_array([0; 3].map(|_| dice.index(5) as f64));
            let aim = move |dice: &mut Dice| {
                let mut dir = DVec3::from_array([0; 3].map(|_| dice.sign() * 0.0));
                dir[dice.index(3)] = dice.sign();
                if dice.index(2) == 0 {
                    dir[dice.index(3)] = dice.sign();
                }
                let at = c + DVec3::from_array([0; 3].map(|_| dice.index(5) as f64 / 2.0 - 1.0));
                let origin = at - 4.0 * dir;
                Ray::new(origin.as_vec3().to_array(), dir.as_vec3().to_array())
            };
            (vec![cuboid(c - 1.0, c + 1.0)], Box::new(aim))
        }),
        family("box turned, moved", moved.clone(), |dice, v| {
            let (c, half) = (dice.direction() * v, DVec3::new(0.5, 0.75, 1.0));
            let turned = Cuboid { min: c - half, max: c + half, rotation: Some(dice.turn()) };
            (vec![Shape::Box(turned)], Box::new(move |dice| toward(c + dice.direction() * 5.0, c + dice.in_cube(1.0))))
        }),
        family("cylinder", moved.clone(), |dice, v| {
            let (c, axis, caps) = (dice.direction() * v, dice.direction(), dice.index(2) == 0);
            let aim = move |dice: &mut Dice| toward(c + dice.direction() * 5.0, c + dice.in_cube(1.0));
            (vec![cone(c, axis, [0.5, 0.5], caps)], Box::new(aim))
        }),
        family("cylinder thin", decades(-6, -1), |dice, v| {
            let (c, axis, caps) = (dice.in_cube(1.0), dice.direction(), dice.index(2) == 0);
            let aim = move |dice: &mut Dice| {
                let at = c + axis * dice.between(-1.1, 1.1) + dice.in_cube(1.5 * v);
                toward(c + dice.direction() * 5.0, at)
            };
            (vec![cone(c, axis, [v, v], caps)], Box::new(aim))
        }),
        family("cylinder along axis", decades(-8, -1), |dice, v| {
            let (c, axis, caps) = (dice.in_cube(1.0), dice.direction(), dice.index(2) == 0);
            let aim = move |dice: &mut Dice| {
                let start = c - 4.0 * axis + dice.in_cube(0.6);
                toward(start, start + axis + v * dice.direction())
            };
            (vec![cone(c, axis, [0.5, 0.5], caps)], Box::new(aim))
        }),
        family("cone", moved.clone(), |dice, v| {
            let (c, axis, caps) = (dice.direction() * v, dice.direction(), dice.index(2) == 0);
            let radii = [[0.75, 0.0], [0.7, 0.3], [0.2, 0.9]][dice.index(3)];
            let aim = move |dice: &mut Dice| toward(c + dice.direction() * 5.0, c + dice.in_cube(1.0));
            (vec![cone(c, axis, radii, caps)], Box::new(aim))
        }),
        family("cone generator", decades(-9, -1), |dice, v| {
            let (c, axis) = (dice.in_cube(1.0), dice.direction());
            let side = axis.any_orthonormal_vector();
            // From a place beside one generator along it: the quadratic all but loses its square.
            let aim = move |dice: &mut Dice| {
                let along = (2.0 * axis - 0.7 * side).normalize();
                let start = c - axis + 0.7 * side - 3.0 * along + dice.in_cube(0.3);
                toward(start, start + along + v * dice.direction())
            };
            (vec![cone(c, axis, [0.7, 0.0], dice.index(2) == 0)], Box::new(aim))
        }),
        family("cone tip", decades(-8, -1), |dice, v| {
            let (c, axis) = (dice.in_cube(1.0), dice.direction());
            let aim = move |dice: &mut Dice| toward(c + dice.direction() * 4.0, c + axis + dice.in_cube(v));
            (vec![cone(c, axis, [0.7, 0.0], dice.index(2) == 0)], Box::new(aim))
        }),
        family("scale", SCALES.to_vec(), |dice, v| {
            let kind = dice.index(7);
            let q = dice.turn();
            let shape = match kind {
                6 => disk(DVec3::ZERO, q * DVec3::Z, v, 0.4 * v),
                _ => any_shape(kind, DVec3::ZERO, v, q),
            };
            let aim = move |dice: &mut Dice| {
                let ray = toward(dice.direction() * 4.0 * v, dice.in_cube(0.8 * v));
                // Directions as long as the way, and such of length 1.
                match dice.index(2) {
                    0 => ray,
                    _ => {
                        let unit = DVec3::from_array(ray.dir.map(f64::from)).normalize();
                        Ray { dir: unit.as_vec3().to_array(), ..ray }
                    }
                }
            };
            (vec![shape], Box::new(aim))
        }),
        family("coincident", vec![1.0], |dice, _| {
            let (c, q) = (dice.in_cube(1.0), dice.turn());
            let (n, x) = (q * DVec3::Z, q * DVec3::X);
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            let square = |s: f64| polygon(corners.map(|(a, b)| c + q * DVec3::new(s * a, s * b, 0.0)));
            let shapes =
                vec![square(1.0), disk(c, n, 0.9, 0.0), plane(c + 0.3 * x, n), square(0.7), disk(c, -n, 1.2, 0.2)];
            (shapes, Box::new(move |dice| toward(c + dice.direction() * 5.0, c + dice.in_cube(1.0))))
        }),
        family("nested", decades(-12, -3), |dice, v| {
            let (kind, q) = (dice.index(6), dice.turn());
            let shapes = [1, 3, 0, 2].map(|i| any_shape(kind, DVec3::new(0.1, 0.2, 0.3), 1.0 + v * f64::from(i), q));
            (shapes.to_vec(), Box::new(move |dice| toward(dice.direction() * 5.0, dice.in_cube(0.8))))
        }),
        family("crowd", vec![100.0], |dice, v| {
            let some = (0..v as usize).map(|i| {
                let (c, s, q) = (dice.in_cube(6.0), dice.log_between(0.05, 2.0), dice.turn());
                any_shape(i % 6, c, s, q)
            });
            let mut shapes: Vec<Shape> = some.collect();
            shapes.push(plane(DVec3::new(0.0, -6.0, 0.0), DVec3::Y));
            (shapes, Box::new(move |dice| toward(dice.in_cube(8.0), dice.in_cube(8.0))))
        }),
    ]
}

/// Powers of ten.
fn decades(from: i32, to: i32) -> Vec<f64> {
    (from..=to).map(|e| 10f64.powi(e)).collect()
}

/// Shapes in one gray material.
pub fn scene_of(shapes: Vec<Shape>) -> Scene {
    let model = Model::Diffuse { albedo: Paint::Color(DVec3::splat(0.5)) };
    let clay = Material { name: "clay".into(), model, back: None, visible: Visible::Both };
    let object = |shape| Object { shape, material: 0, name: None, group: None };
    Scene { objects: shapes.into_iter().map(object).collect(), materials: vec![clay], ..Scene::default() }
}

/// A solid cut into triangles that share corners; rays from inside and outside at corners, along and across edges.
fn mesh_seams(dice: &mut Dice, v: f64) -> Case {
    let (c, q) = (dice.direction() * v, dice.turn());
    let points = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z].map(|p| c + q * p);
    let faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)];
    let shapes = faces.map(|(i, j, k)| polygon([points[i], points[j], points[k]])).to_vec();
    let aim = move |dice: &mut Dice| {
        let (i, j, k) = faces[dice.index(8)];
        let share = [0.0, 0.5, dice.between(0.0, 1.0)][dice.index(3)];
        let mut at = points[i].lerp(points[j], share);
        if dice.index(4) == 0 {
            at = at.lerp(points[k], dice.log_between(1e-9, 1e-3));
        }
        let origin = if dice.index(2) == 0 { c + dice.in_cube(0.2) } else { c + dice.direction() * 3.0 };
        toward(origin, at)
    };
    (shapes, Box::new(aim))
}

fn any_shape(kind: usize, c: DVec3, s: f64, q: DQuat) -> Shape {
    match kind {
        0 => sphere(c, s),
        1 => {
            let half = s * DVec3::new(0.5, 0.75, 1.0);
            cuboid(c - half, c + half)
        }
        2 => {
            let half = s * DVec3::new(0.5, 0.75, 1.0);
            Shape::Box(Cuboid { min: c - half, max: c + half, rotation: Some(q) })
        }
        3 => {
            let corners = (0..5).map(|k| {
                let angle = f64::from(k) * TAU / 5.0;
                c + s * (q * DVec3::new(angle.cos(), angle.sin(), 0.0))
            });
            Shape::Polygon(Polygon { corners: corners.collect(), ..Polygon::default() })
        }
        4 => {
            let half = s * (q * DVec3::Z);
            Shape::Cylinder(Cylinder { base: c - half, apex: c + half, radius: 0.5 * s, caps: true })
        }
        _ => {
            let half = s * (q * DVec3::X);
            Shape::Cone(Cone { base: c - half, apex: c + half, radius: 0.8 * s, apex_radius: 0.2 * s, caps: true })
        }
    }
}

fn sphere(center: DVec3, radius: f64) -> Shape {
    Shape::Sphere(Sphere { center, radius })
}

fn plane(point: DVec3, normal: DVec3) -> Shape {
    Shape::Plane(Plane { point, normal })
}

fn disk(center: DVec3, normal: DVec3, radius: f64, inner_radius: f64) -> Shape {
    Shape::Disk(Disk { center, normal, radius, inner_radius })
}

fn polygon(corners: impl IntoIterator<Item = DVec3>) -> Shape {
    Shape::Polygon(Polygon { corners: corners.into_iter().collect(), ..Polygon::default() })
}

fn ngon(c: DVec3, q: DQuat, n: usize) -> Shape {
    let corner = |k: usize| {
        let angle = k as f64 * TAU / n as f64;
        c + q * DVec3::new(angle.cos(), angle.sin(), 0.0)
    };
    polygon((0..n).map(corner))
}

fn cuboid(min: DVec3, max: DVec3) -> Shape {
    Shape::Box(Cuboid { min, max, rotation: None })
}

/// Of half length 1 about `c`; equal radii make a cylinder.
fn cone(c: DVec3, axis: DVec3, [radius, apex_radius]: [f64; 2], caps: bool) -> Shape {
    let (base, apex) = (c - axis, c + axis);
    match radius == apex_radius {
        true => Shape::Cylinder(Cylinder { base, apex, radius, caps }),
        false => Shape::Cone(Cone { base, apex, radius, apex_radius, caps }),
    }
}

/// A vector across `n`, of length 0 to 1.
fn across(n: DVec3, dice: &mut Dice) -> DVec3 {
    let v = dice.direction();
    (v - n * n.dot(v)).normalize_or(n.any_orthonormal_vector()) * dice.between(0.1, 1.0)
}

/// A ray at a surface point, at an angle of `angle` radians to the surface of normal `n`, from some lengths away.
fn at_angle(point: DVec3, n: DVec3, angle: f64, dice: &mut Dice) -> Ray {
    let along = across(n, dice).normalize();
    let way = (along * angle.cos() + n * (dice.sign() * angle.sin())) * dice.between(1.0, 6.0);
    toward(point - way, point)
}

/// A ray that passes a point at a distance, from `far` away.
fn beside(point: DVec3, distance: f64, far: f64, dice: &mut Dice) -> Ray {
    let dir = dice.direction();
    let at = point + across(dir, dice).normalize() * distance;
    toward(at - dir * far, at)
}
