//! Pixels: direct light with mirror reflection and refraction, ambient occlusion, paths; ray by ray.
//!
//! Source: Whitted, "An improved illumination model for shaded display", Communications of the ACM
//! 23(6), 1980; what each material and light contributes is said in their doc comments.

use std::f64::consts::PI;
use std::ops::Range;

use glam::{DVec2, DVec3};

use super::emitter::arrive_from_sky;
use super::light::{Arrival, arrive};
use super::material::{Onward, Side, albedo, onward, reflectance};
use super::path::{scattered, share};
use super::{Hit, Ray, Reference, View, texture};
use crate::sample::dimension;
use crate::scene::{Integrator, Model, Paint, RenderSettings};

/// One pixel of the picture.
#[derive(Debug, Clone, Default)]
pub struct Pixel {
    /// Index of the first sample.
    pub first: u32,
    /// Linear Rec. 709 and alpha, premultiplied.
    pub rgba: [f64; 4],
    /// What the rays of all samples met, in no order that means anything: sort before comparing.
    pub events: Vec<Event>,
    /// How many rays were traced.
    pub rays: RayCounts,
    /// What each sample saw, by its index.
    pub samples: Vec<CameraSample>,
}

impl Pixel {
    /// Adds the next samples of the same pixel, which are this share of all.
    pub fn absorb(&mut self, more: Pixel, share: f64) {
        self.rgba.iter_mut().zip(more.rgba).for_each(|(sum, mean)| *sum += share * mean);
        self.rays.camera += more.rays.camera;
        self.rays.shadow += more.rays.shadow;
        self.rays.reflection += more.rays.reflection;
        self.rays.refraction += more.rays.refraction;
        self.rays.bounce += more.rays.bounce;
        self.events.extend(more.events);
        self.samples.extend(more.samples);
    }
}

/// One sample of a pixel: what layers beside the colour are made of.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CameraSample {
    /// Square of its distance from the pixel's centre, pixels.
    pub distance: f64,
    /// Linear Rec. 709.
    pub radiance: DVec3,
    /// What its camera ray met.
    pub first: Option<First>,
    /// The light that it met instead.
    pub light: Option<SeenLight>,
}

/// A light that a camera ray met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenLight {
    /// Its index.
    pub index: usize,
    /// On it, relative to the origin of the tracer.
    pub point: DVec3,
    /// Along the view axis.
    pub depth: f64,
}

/// What a camera ray met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct First {
    /// Index of the primitive.
    pub primitive: usize,
    /// Index of the material of the side that is seen.
    pub material: usize,
    /// On the surface, relative to the origin of the tracer.
    pub point: DVec3,
    /// Along the view axis.
    pub depth: f64,
    /// Shading normal on the side that is seen, unit.
    pub normal: DVec3,
    /// Reflectance, 0 to 1.
    pub albedo: DVec3,
    /// As the shape's doc comment says.
    pub uv: DVec2,
    /// How far the decision is from turning, in errors that f32 cannot avoid: [`Reference::margin`].
    pub margin: f64,
}

/// Rays by kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// From the eye.
    pub camera: u64,
    /// Toward lights.
    pub shadow: u64,
    /// Mirrored.
    pub reflection: u64,
    /// Into or out of a body.
    pub refraction: u64,
    /// Scattered.
    pub bounce: u64,
}

/// One decision on the way to a pixel, named so that two tracers can compare theirs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Event {
    /// Sample of the pixel.
    pub sample: u32,
    /// The ray: the camera ray is 1, the reflected child of `p` is `2 p`, the refracted one `2 p + 1`
    /// (modulo 2^32), a scattered one `2 p`. For lights and textures, the ray that met the surface.
    pub path: u32,
    /// What was decided.
    pub kind: EventKind,
    /// How: of a ray the primitive it met, or -1; of a light 1 where it shines on the place, 0 where it
    /// is hidden, faces away or gives nothing, 2 where the ray itself meets it; of a texture the cell it was read from.
    pub outcome: i64,
}

/// Kinds of [`Event`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventKind {
    /// A ray from the eye.
    Camera,
    /// A mirrored ray.
    Reflection,
    /// A refracted ray.
    Refraction,
    /// A scattered ray.
    Bounce,
    /// A light, by its index, at a surface that scatters light; the sky comes after the last, then ambient light.
    Light(u32),
    /// A texture, by its index, of the surface that the ray met. The cell is 0 or 1 in a checker, the
    /// number of the (upper left) texel in a picture, row by row.
    Texture(u32),
}

/// A ray still to be traced.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub ray: Ray,
    pub kind: EventKind,
    pub depth: u32,
    pub path: u32,
    /// Share of its radiance that reaches the pixel.
    pub weight: DVec3,
    /// With which its direction was drawn, per steradian; infinite where it is the only one.
    pub density: f64,
}

impl Step {
    /// A ray that goes on from where this one met something; `weight` is all of it.
    pub fn next(&self, kind: EventKind, path: u32, weight: DVec3, origin: DVec3, dir: DVec3, density: f64) -> Step {
        let ray = Ray { origin, dir, t_min: 0.0, t_max: f64::INFINITY };
        Step { ray, kind, depth: self.depth + 1, path, weight, density }
    }
}

impl Reference {
    /// One pixel, counted in the display window from its upper left corner.
    ///
    /// All samples weigh the same; they are summed in the order of their indices.
    pub fn pixel(&self, view: &View, x: i32, y: i32) -> Pixel {
        self.samples(view, x, y, 0..view.spp)
    }

    /// Some samples of a pixel.
    pub fn samples(&self, view: &View, x: i32, y: i32, samples: Range<u32>) -> Pixel {
        let mut pixel = Pixel { first: samples.start, ..Pixel::default() };
        let count = samples.len() as f64;
        for sample in samples {
            let distance = view.distance(x, y, sample);
            pixel.samples.push(CameraSample { distance, ..CameraSample::default() });
            let (key, settings) = (view.key(x, y), &view.settings);
            let mut walk = Walk { tracer: self, view, key, sample, settings, pixel: &mut pixel };
            let (radiance, alpha) = walk.radiance(view.sample(x, y, sample));
            pixel.samples[(sample - pixel.first) as usize].radiance = radiance;
            for (sum, value) in pixel.rgba.iter_mut().zip([radiance.x, radiance.y, radiance.z, alpha]) {
                *sum += value;
            }
        }
        pixel.rgba = pixel.rgba.map(|sum| sum / count);
        pixel
    }
}

/// One sample of a pixel in the making.
pub(super) struct Walk<'a> {
    pub tracer: &'a Reference,
    view: &'a View,
    /// Of the pixel's sample patterns.
    pub key: u32,
    pub sample: u32,
    settings: &'a RenderSettings,
    pixel: &'a mut Pixel,
}

impl Walk<'_> {
    /// Radiance and alpha of a camera ray. A ray beyond the depth limit is black.
    fn radiance(&mut self, camera: Ray) -> (DVec3, f64) {
        let (mut radiance, mut alpha) = (DVec3::ZERO, 1.0);
        let (kind, density) = (EventKind::Camera, f64::INFINITY);
        let mut steps = vec![Step { ray: camera, kind, depth: 1, path: 1, weight: DVec3::ONE, density }];
        while let Some(step) = steps.pop() {
            if step.depth > self.settings.max_depth {
                continue;
            }
            let hit = self.trace(&step);
            let far = hit.as_ref().map_or(f64::INFINITY, |hit| hit.t);
            if step.kind == EventKind::Bounce {
                radiance += step.weight * self.scattered_light(&step, far);
            } else if let Some((index, t, seen)) = self.light_seen(&step, far) {
                if step.depth == 1 {
                    let (point, depth) = (step.ray.origin + t * step.ray.dir, t * self.view.depth_scale(step.ray.dir));
                    self.pixel.samples[(self.sample - self.pixel.first) as usize].light =
                        Some(SeenLight { index, point, depth });
                }
                self.event(&step, EventKind::Light(index as u32), 2);
                radiance += step.weight * seen;
                continue;
            }
            radiance += step.weight
                * match &hit {
                    Some(hit) => self.scatter(&step, hit, &mut steps),
                    None if step.depth == 1 && self.tracer.background.transparent => {
                        alpha = 0.0;
                        DVec3::ZERO
                    }
                    None => self.background(&step),
                };
        }
        (radiance, alpha)
    }

    fn trace(&mut self, step: &Step) -> Option<Hit> {
        let rays = &mut self.pixel.rays;
        match step.kind {
            EventKind::Camera => rays.camera += 1,
            EventKind::Reflection => rays.reflection += 1,
            EventKind::Refraction => rays.refraction += 1,
            EventKind::Bounce => rays.bounce += 1,
            EventKind::Light(_) | EventKind::Texture(_) => {}
        }
        let hit = self.tracer.closest(&step.ray);
        let outcome = hit.as_ref().map_or(-1, |hit| hit.primitive as i64);
        self.event(step, step.kind, outcome);
        hit
    }

    fn event(&mut self, step: &Step, kind: EventKind, outcome: i64) {
        self.pixel.events.push(Event { sample: self.sample, path: step.path, kind, outcome });
    }

    /// Radiance of a hit from ambient light and lights; what reflection and refraction add is left
    /// to the steps that it appends.
    fn scatter(&mut self, step: &Step, hit: &Hit, steps: &mut Vec<Step>) -> DVec3 {
        let Some(material) = self.tracer.materials.get(hit.material) else { return DVec3::ZERO };
        let color = self.color(step, hit, &material.model);
        let turn = if hit.front { 1.0 } else { -1.0 };
        let side = Side { n: turn * hit.shading_normal, n_g: turn * hit.normal, dir: step.ray.dir };
        if step.depth == 1 {
            self.pixel.samples[(self.sample - self.pixel.first) as usize].first = Some(First {
                primitive: hit.primitive,
                material: hit.material,
                point: hit.point,
                depth: hit.t * self.view.depth_scale(step.ray.dir),
                normal: side.n,
                albedo: reflectance(&material.model, color),
                uv: hit.uv,
                margin: self.tracer.margin(&step.ray, hit.primitive, hit.t).unwrap_or(0.0),
            });
        }
        let onward = onward(&material.model, color, &side, hit.front);
        match self.settings.integrator {
            Integrator::Path => self.take_one(step, hit, &side, (&material.model, color), &onward, steps),
            Integrator::Direct | Integrator::Ao => take_all(step, hit, &side, &onward, steps),
        }
        match material.model {
            Model::Mirror { .. } | Model::Dielectric { .. } => DVec3::ZERO,
            Model::Diffuse { .. } | Model::Phong { .. } if self.settings.integrator == Integrator::Ao => {
                let number = self.tracer.lights.len();
                self.openness(step, hit, &side, (number, dimension::SCATTER)) * albedo(&material.model, color)
            }
            Model::Diffuse { .. } | Model::Phong { .. } => {
                let ambient = self.ambient(step, hit, &side) * albedo(&material.model, color);
                ambient + self.lights(step, hit, &side, &material.model, color)
            }
        }
    }

    /// Light from all lights, the sky among them.
    fn lights(&mut self, step: &Step, hit: &Hit, side: &Side, model: &Model, color: DVec3) -> DVec3 {
        let tracer = self.tracer;
        let mut sum = DVec3::ZERO;
        for (i, light) in tracer.lights.iter().enumerate() {
            let place = self.pair(step.depth, dimension::LIGHTS + i as u32);
            let arrival = match &tracer.areas[i] {
                Some(area) => area.arrive(hit.point, place),
                None => arrive(&light.source, hit.point),
            };
            sum += self.light(step, hit, side, (i, light.shadows), arrival, (model, color));
        }
        if let Some(sky) = &tracer.sky {
            let i = tracer.lights.len();
            let place = self.pair(step.depth, dimension::LIGHTS + i as u32);
            let arrival = arrive_from_sky(sky, &tracer.background, place);
            sum += self.light(step, hit, side, (i, true), arrival, (model, color));
        }
        sum
    }

    /// Ambient light at a place. As a light it has the number after that of the sky.
    fn ambient(&mut self, step: &Step, hit: &Hit, side: &Side) -> DVec3 {
        let (ambient, number) = (self.tracer.ambient, self.tracer.lights.len() + 1);
        if ambient == DVec3::ZERO || !self.settings.ambient_occlusion {
            return ambient;
        }
        ambient * self.openness(step, hit, side, (number, dimension::OPENNESS))
    }

    /// 1 where a scattered ray meets nothing near, else 0.
    fn openness(&mut self, step: &Step, hit: &Hit, side: &Side, (number, dimension): (usize, u32)) -> f64 {
        let dir = scattered(side.n, self.pair(step.depth, dimension));
        let t_max = self.settings.ao_distance;
        let open = side.faces(dir) && {
            self.pixel.rays.shadow += 1;
            !self.tracer.occluded(&Ray { origin: hit.spawn(dir), dir, t_min: 0.0, t_max })
        };
        self.event(step, EventKind::Light(number as u32), i64::from(open));
        if open { side.terminator(dir) } else { 0.0 }
    }

    /// The material's colour at a hit.
    fn color(&mut self, step: &Step, hit: &Hit, model: &Model) -> DVec3 {
        let paint = match model.paint() {
            Paint::Color(color) => color,
            Paint::Texture(index) => match self.tracer.textures.get(index) {
                None => DVec3::ZERO,
                Some(texture) => {
                    let (color, cell) = texture::lookup(&texture.kind, hit.uv);
                    self.event(step, EventKind::Texture(index as u32), cell);
                    color
                }
            },
        };
        paint * self.tracer.placed[hit.primitive].color
    }

    /// Radiance from one light; zero where it does not shine.
    ///
    /// One shadow ray is traced for each light that the surface faces and that gives anything there,
    /// unless it casts no shadows.
    fn light(
        &mut self,
        step: &Step,
        hit: &Hit,
        side: &Side,
        (index, shadows): (usize, bool),
        arrival: Option<Arrival>,
        (model, color): (&Model, DVec3),
    ) -> DVec3 {
        let gives = |arrival: &Arrival| arrival.irradiance != DVec3::ZERO && side.faces(arrival.wi);
        let lit = arrival.filter(gives).filter(|arrival| {
            if !shadows {
                return true;
            }
            self.pixel.rays.shadow += 1;
            !self.tracer.occluded(&arrival.shadow_ray(hit.spawn(arrival.wi)))
        });
        self.event(step, EventKind::Light(index as u32), i64::from(lit.is_some()));
        let path = self.settings.integrator == Integrator::Path && step.depth < self.settings.max_depth;
        lit.map_or(DVec3::ZERO, |arrival| {
            // What shades nothing is left to the lights alone.
            let weighed = path && shadows;
            let weight = if weighed { share(arrival.density, side.n.dot(arrival.wi) / PI) } else { 1.0 };
            arrival.irradiance * side.scatter(model, color, arrival.wi, weight)
        })
    }
}

/// Adds the reflected and the refracted ray.
fn take_all(step: &Step, hit: &Hit, side: &Side, onward: &Onward, steps: &mut Vec<Step>) {
    let mut go_on = |kind, path: u32, weight: DVec3, dir| {
        steps.push(step.next(kind, path, step.weight * weight, hit.spawn(dir), dir, f64::INFINITY));
    };
    let child = step.path.wrapping_mul(2);
    if let Some(weight) = onward.reflected {
        go_on(EventKind::Reflection, child, weight, side.reflection());
    }
    if let Some((weight, dir)) = onward.refracted {
        go_on(EventKind::Refraction, child.wrapping_add(1), weight, dir);
    }
}
