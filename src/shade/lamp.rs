//! Lights with an area and the sky, eight points at a time: each point draws a direction of its own. How is
//! said in [`Emitter`] and [`Sky`].

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::background::{look_up, place, world_from_picture};
use crate::lanes::{Float8, LANES, Mask8, UNIT_ROUNDOFF, Vec3x8, float8};
use crate::plan::Plan;
use crate::sample;
use crate::scene::{self, Backdrop, Emitter, ImageTexture, Patches, Sky, Source};

/// What eight points draw of a light.
#[derive(Debug, Clone, Copy)]
pub struct Drawn {
    /// Unit, toward the light.
    pub wi: Vec3x8,
    /// `E/pi`; 0 where the light does not face the point.
    pub strength: Vec3x8,
    /// With which `wi` is drawn, per steradian.
    pub density: Float8,
    /// Where shadow rays end, a little off the light; `None`: infinitely far.
    pub target: Option<Vec3x8>,
}

/// An area light in f32, relative to the plan's origin.
#[derive(Debug, Clone)]
pub struct AreaLight {
    /// Number of the light in the scene.
    pub index: usize,
    /// Whether anything casts a shadow in it.
    pub shadows: bool,
    /// Whether camera, mirrors and glass see it.
    pub visible: bool,
    /// W/sr/m^2.
    pub radiance: [f32; 3],
    over_pi: [f32; 3],
    points: Points,
}

#[derive(Debug, Clone)]
enum Points {
    Sphere {
        center: DVec3,
        radius: f64,
    },
    /// Axes as long as the radius.
    Disk {
        center: [f32; 3],
        axes: [[f32; 3]; 2],
        normal: DVec3,
        area: f64,
    },
    Parallelogram {
        corner: [f32; 3],
        edges: [[f32; 3]; 2],
        normal: DVec3,
        area: f64,
    },
    Polygon {
        patches: Patches,
        normal: DVec3,
    },
}

impl AreaLight {
    /// All of a plan.
    pub fn of(plan: &Plan) -> Vec<AreaLight> {
        let lights = plan.scene.lights.iter().enumerate();
        let area = |(index, light): (usize, &scene::Light)| {
            let Source::Area { emitter, radiance, visible } = &light.source else { return None };
            let (over_pi, radiance) = (single(*radiance / PI), single(*radiance));
            let points = Points::new(emitter, plan.origin);
            Some(AreaLight { index, shadows: light.shadows, visible: *visible, radiance, over_pi, points })
        };
        lights.filter_map(area).collect()
    }

    /// What the points draw by their pairs of fractions of 2^32.
    #[inline(always)]
    pub fn draw(&self, point: Vec3x8, bits: [[u32; LANES]; 2]) -> Drawn {
        match &self.points {
            Points::Sphere { center, radius } => {
                self.draw_cap(point, Vec3x8::splat(single(*center)), *radius as f32, units(bits))
            }
            Points::Disk { center, axes, normal, area } => {
                let [u, v] = units(bits);
                let (sin, cos) = (v * float8(TAU as f32)).sin_cos();
                let r = u.sqrt();
                let place = Vec3x8::splat(axes[1]).mul_add(r * sin, Vec3x8::splat(*center));
                self.draw_place(point, Vec3x8::splat(axes[0]).mul_add(r * cos, place), *normal, *area)
            }
            Points::Parallelogram { corner, edges, normal, area } => {
                let [u, v] = units(bits);
                let place = Vec3x8::splat(edges[1]).mul_add(v, Vec3x8::splat(*corner));
                self.draw_place(point, Vec3x8::splat(edges[0]).mul_add(u, place), *normal, *area)
            }
            Points::Polygon { patches, normal } => {
                let [u, v] = bits.map(|bits| bits.map(sample::unit));
                let place = Vec3x8::from_fn(|i| single(patches.point(u[i], v[i])));
                self.draw_place(point, place, *normal, patches.area)
            }
        }
    }

    /// The visible cap of a sphere.
    #[inline(always)]
    fn draw_cap(&self, point: Vec3x8, center: Vec3x8, radius: f32, [u, v]: [Float8; 2]) -> Drawn {
        let (one, r2) = (float8(1.0), float8(radius * radius));
        let f = center - point;
        let d2 = f.length_squared();
        let distance = d2.sqrt();
        let sin2 = r2 / d2;
        let outside = Mask8::lt(sin2, one);
        let cap = outside.select(sin2 / (one + (one - sin2).fast_max(Float8::ZERO).sqrt()), Float8::ZERO);
        let w = f * (one / distance);
        let (e1, e2) = frame(w);
        let (sin, cos) = (v * float8(TAU as f32)).sin_cos();
        let (rise, sin2) = (one - u * cap, u * cap * (float8(2.0) - u * cap));
        let side = sin2.sqrt();
        let wi = e2.mul_add(side * sin, e1.mul_add(side * cos, w * rise));
        let half_chord = (r2 - d2 * sin2).fast_max(Float8::ZERO).sqrt();
        let place = wi.mul_add(distance * rise - half_chord, point);
        Drawn {
            wi,
            strength: Vec3x8::splat(self.over_pi) * (float8(TAU as f32) * cap),
            density: one / (float8(TAU as f32) * cap),
            target: Some(lifted(place, (place - center).normalize(), f)),
        }
    }

    /// A place on something flat.
    #[inline(always)]
    fn draw_place(&self, point: Vec3x8, place: Vec3x8, normal: DVec3, area: f64) -> Drawn {
        let normal = Vec3x8::splat(single(normal));
        let way = place - point;
        let d2 = way.length_squared();
        let wi = way * (float8(1.0) / d2.sqrt());
        let facing = -normal.dot(wi) * float8(area as f32);
        let lit = Mask8::gt(facing, Float8::ZERO) & Mask8::gt(d2, Float8::ZERO);
        let angle = lit.select(facing / d2, Float8::ZERO);
        Drawn {
            wi,
            strength: Vec3x8::splat(self.over_pi) * angle,
            density: float8(1.0) / angle,
            target: Some(lifted(place, normal, way)),
        }
    }

    /// The density with which a point draws the direction of `way`, which leads from it to the lit side.
    pub fn density(&self, point: DVec3, way: DVec3) -> f64 {
        let flat = |normal: &DVec3, area: f64| way.length_squared() / (area * -normal.dot(way.normalize()));
        match &self.points {
            Points::Sphere { center, radius } => {
                let sin2 = radius * radius / (*center - point).length_squared();
                (1.0 + (1.0 - sin2).max(0.0).sqrt()) / (TAU * sin2)
            }
            Points::Disk { normal, area, .. } | Points::Parallelogram { normal, area, .. } => flat(normal, *area),
            Points::Polygon { patches, normal } => flat(normal, patches.area),
        }
    }
}

impl Points {
    fn new(emitter: &Emitter, origin: DVec3) -> Self {
        match emitter {
            Emitter::Sphere { center, radius } => Points::Sphere { center: *center - origin, radius: *radius },
            Emitter::Disk { center, normal, radius } => {
                let normal = normal.normalize();
                let (x, y) = scene::basis(normal);
                let axes = [x, y].map(|axis| single(axis * *radius));
                Points::Disk { center: single(*center - origin), axes, normal, area: PI * radius * radius }
            }
            Emitter::Polygon(polygon) => {
                let normal = polygon.normal();
                let mut moved = polygon.clone();
                moved.corners.iter_mut().for_each(|corner| *corner -= origin);
                let patches = Patches::new(&moved);
                match patches.parallelogram().map(|sides| sides.map(single)) {
                    Some([corner, a, b]) => Points::Parallelogram { corner, edges: [a, b], normal, area: patches.area },
                    None => Points::Polygon { patches, normal },
                }
            }
        }
    }
}

/// The picture of the background as a light.
#[derive(Debug)]
pub struct SkyLight<'s> {
    sky: Sky,
    image: &'s ImageTexture,
    scale: f64,
    rotation: f64, // radians
}

impl<'s> SkyLight<'s> {
    /// That of a plan, if it has one.
    pub fn of(plan: &Plan<'s>) -> Option<Self> {
        let background = &plan.scene.background;
        let Backdrop::Image { image, scale, rotation } = &background.backdrop else { return None };
        Some(SkyLight { sky: background.sky()?, image, scale: *scale, rotation: rotation.to_radians() })
    }

    /// What eight pairs of fractions of 2^32 draw, wherever the point.
    pub fn draw(&self, bits: [[u32; LANES]; 2]) -> Drawn {
        let [u, v] = bits.map(|bits| bits.map(sample::unit));
        let places: [DVec2; LANES] = std::array::from_fn(|i| self.sky.sample(u[i], v[i]));
        let density = places.map(|uv| self.sky.density(uv));
        let strength = |i: usize| single(look_up(self.image, places[i]) * (self.scale / (PI * density[i])));
        Drawn {
            wi: Vec3x8::from_fn(|i| single(world_from_picture(places[i], self.rotation))),
            strength: Vec3x8::from_fn(strength),
            density: Float8::from(density.map(|density| density as f32)),
            target: None,
        }
    }

    /// The density with which a direction is drawn, per steradian.
    pub fn density(&self, dir: DVec3) -> f64 {
        self.sky.density(place(dir, self.rotation))
    }
}

/// Eight directions in which surfaces scatter evenly, weighed with the cosine: points of the unit sphere (`z = 1 - 2u`,
/// azimuth `2 pi v`) added to the normals.
#[inline(always)]
pub fn scattered(n: Vec3x8, bits: [[u32; LANES]; 2]) -> Vec3x8 {
    let [u, v] = units(bits);
    let (sin, cos) = (v * float8(TAU as f32)).sin_cos();
    // 1 - z^2 for z = 1 - 2u.
    let ring = (float8(4.0) * u * (float8(1.0) - u)).sqrt();
    let way = n + Vec3x8::new(ring * cos, ring * sin, float8(1.0) - u - u);
    let length = way.length();
    Vec3x8::select(Mask8::gt(length, Float8::ZERO), way * (float8(1.0) / length), n)
}

#[inline(always)]
fn units([u, v]: [[u32; LANES]; 2]) -> [Float8; 2] {
    [unit(u), unit(v)]
}

/// Fractions of 2^32 as numbers below 1.
#[inline(always)]
fn unit(bits: [u32; LANES]) -> Float8 {
    const BELOW_ONE: f32 = 1.0 - UNIT_ROUNDOFF;
    let number = |i: usize| (bits[i] as f32 + 0.5) * (1.0 / 4_294_967_296.0);
    Float8::from(std::array::from_fn::<f32, LANES, _>(number)).fast_min(float8(BELOW_ONE))
}

/// See [`scene::frame`].
#[inline(always)]
fn frame(w: Vec3x8) -> (Vec3x8, Vec3x8) {
    let (one, zero) = (float8(1.0), Float8::ZERO);
    let sign = Mask8::lt(w.z, float8(-0.7)).select(zero - one, one);
    let a = -(one / (sign + w.z));
    let b = w.x * w.y * a;
    let first = Vec3x8::new(one + sign * w.x * w.x * a, sign * b, -(sign * w.x));
    (first, Vec3x8::new(b, sign + w.y * w.y * a, -w.y))
}

/// A place of a light a little off its surface: what stands there with it does not shade it.
#[inline(always)]
fn lifted(place: Vec3x8, normal: Vec3x8, way: Vec3x8) -> Vec3x8 {
    let size = place.abs().sum() + way.abs().sum();
    normal.mul_add(size * float8(8.0 * UNIT_ROUNDOFF), place)
}

fn single(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}
