//! Pixels: direct light with mirror reflection and refraction, ray by ray.
//!
//! Source: Whitted, "An improved illumination model for shaded display", Communications of the ACM
//! 23(6), 1980; what each material and light contributes is said in their doc comments.

use glam::{DVec2, DVec3};

use super::light::arrive;
use super::material::{Onward, Side, albedo, onward, reflectance};
use super::{Hit, Ray, Reference, View, background, texture};
use crate::scene::{Light, Model, Paint};

/// One pixel of the picture.
#[derive(Debug, Clone, Default)]
pub struct Pixel {
    /// Linear Rec. 709 and alpha, premultiplied.
    pub rgba: [f64; 4],
    /// What the rays of all samples met, in no order that means anything: sort before comparing.
    pub events: Vec<Event>,
    /// How many rays were traced.
    pub rays: RayCounts,
    /// What each sample saw, by its index.
    pub samples: Vec<CameraSample>,
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
}

/// One decision on the way to a pixel, named so that two tracers can compare theirs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Event {
    /// Sample of the pixel.
    pub sample: u32,
    /// The ray: the camera ray is 1, the reflected child of `p` is `2 p`, the refracted one `2 p + 1`
    /// (modulo 2^32). For lights and textures, the ray that met the surface.
    pub path: u32,
    /// What was decided.
    pub kind: EventKind,
    /// How: of a ray the primitive it met, or -1; of a light 1 where it shines on the place, 0 where it
    /// is hidden, faces away or gives nothing; of a texture the cell it was read from.
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
    /// A light, by its index, at a surface that scatters light.
    Light(u32),
    /// A texture, by its index, of the surface that the ray met. The cell is 0 or 1 in a checker, the
    /// number of the (upper left) texel in a picture, row by row.
    Texture(u32),
}

/// A ray still to be traced.
#[derive(Debug, Clone, Copy)]
struct Step {
    ray: Ray,
    kind: EventKind,
    depth: u32,
    path: u32,
    /// Share of its radiance that reaches the pixel.
    weight: DVec3,
}

impl Reference {
    /// One pixel, counted in the display window from its upper left corner.
    ///
    /// All samples weigh the same; they are summed in the order of their indices.
    pub fn pixel(&self, view: &View, x: i32, y: i32) -> Pixel {
        let mut pixel = Pixel::default();
        for sample in 0..view.spp {
            let distance = view.distance(x, y, sample);
            pixel.samples.push(CameraSample { distance, ..CameraSample::default() });
            let mut walk = Walk { tracer: self, view, sample, max_depth: view.max_depth, pixel: &mut pixel };
            let (radiance, alpha) = walk.radiance(view.sample(x, y, sample));
            pixel.samples[sample as usize].radiance = radiance;
            for (sum, value) in pixel.rgba.iter_mut().zip([radiance.x, radiance.y, radiance.z, alpha]) {
                *sum += value;
            }
        }
        pixel.rgba = pixel.rgba.map(|sum| sum / f64::from(view.spp));
        pixel
    }
}

/// One sample of a pixel in the making.
struct Walk<'a> {
    tracer: &'a Reference,
    view: &'a View,
    sample: u32,
    max_depth: u32,
    pixel: &'a mut Pixel,
}

impl Walk<'_> {
    /// Radiance and alpha of a camera ray. A ray beyond the depth limit is black.
    fn radiance(&mut self, camera: Ray) -> (DVec3, f64) {
        let (mut radiance, mut alpha) = (DVec3::ZERO, 1.0);
        let mut steps = vec![Step { ray: camera, kind: EventKind::Camera, depth: 1, path: 1, weight: DVec3::ONE }];
        while let Some(step) = steps.pop() {
            if step.depth > self.max_depth {
                continue;
            }
            let hit = self.trace(&step);
            radiance += step.weight
                * match &hit {
                    Some(hit) => self.scatter(&step, hit, &mut steps),
                    None if step.depth == 1 && self.tracer.background.transparent => {
                        alpha = 0.0;
                        DVec3::ZERO
                    }
                    None => background::radiance(&self.tracer.background.backdrop, step.ray.dir),
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
            self.pixel.samples[self.sample as usize].first = Some(First {
                primitive: hit.primitive,
                material: hit.material,
                point: hit.point,
                depth: hit.t * self.view.depth_scale(step.ray.dir),
                normal: side.n,
                albedo: reflectance(&material.model, color),
                uv: hit.uv,
            });
        }
        let Onward { reflected, refracted } = onward(&material.model, color, &side, hit.front);
        let mut go_on = |kind, path: u32, weight: DVec3, dir| {
            let ray = Ray { origin: hit.spawn(dir), dir, t_min: 0.0, t_max: f64::INFINITY };
            steps.push(Step { ray, kind, depth: step.depth + 1, path, weight: step.weight * weight });
        };
        let child = step.path.wrapping_mul(2);
        if let Some(weight) = reflected {
            go_on(EventKind::Reflection, child, weight, side.reflection());
        }
        if let Some((weight, dir)) = refracted {
            go_on(EventKind::Refraction, child.wrapping_add(1), weight, dir);
        }
        match material.model {
            Model::Mirror { .. } | Model::Dielectric { .. } => DVec3::ZERO,
            Model::Diffuse { .. } | Model::Phong { .. } => {
                let ambient = self.tracer.ambient * albedo(&material.model, color);
                let tracer = self.tracer;
                let lights = tracer.lights.iter().enumerate();
                ambient
                    + lights
                        .map(|(i, light)| {
                            let (irradiance, wi) = self.light(step, hit, &side, i, light);
                            irradiance * side.scatter(&material.model, color, wi)
                        })
                        .sum::<DVec3>()
            }
        }
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

    /// Irradiance from one light and the direction to it; zero where it does not shine.
    ///
    /// One shadow ray is traced for each light that the surface faces and that gives anything there,
    /// unless it casts no shadows.
    fn light(&mut self, step: &Step, hit: &Hit, side: &Side, index: usize, light: &Light) -> (DVec3, DVec3) {
        let arrival = arrive(&light.source, hit.point).filter(|arrival| side.faces(arrival.wi));
        let lit = arrival.filter(|arrival| {
            if !light.shadows {
                return true;
            }
            self.pixel.rays.shadow += 1;
            !self.tracer.occluded(&arrival.shadow_ray(hit.spawn(arrival.wi)))
        });
        self.event(step, EventKind::Light(index as u32), i64::from(lit.is_some()));
        lit.map_or((DVec3::ZERO, side.n), |arrival| (arrival.irradiance, arrival.wi))
    }
}
