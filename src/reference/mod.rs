//! The reference tracer: what every picture of octray means, in f64, ray by ray, body by body.
//!
//! It is the judge of the packet engine and made to be read: no tree, no packets, no skipping; every
//! ray asks every primitive. It sees the scene and the sampler and nothing else, and its formulas are
//! not the engine's, so that one mistake cannot hide in both. It answers for hits ([`Reference`]),
//! for pixels ([`Reference::pixel`]) and for what two tracers may disagree about ([`Verdict`]).
//!
//! | file | what it says |
//! |---|---|
//! | `sphere`, `plane`, `disk`, `polygon`, `cuboid`, `cylinder`, `cone` | one body each |
//! | `quadratic`, `span` | what round and what convex bodies have in common |
//! | `exact` | sums and products beyond f64, where those would cancel |
//! | `margin` | what f32 cannot decide |
//! | `camera`, `light`, `emitter`, `material`, `texture`, `background` | the doc comments of the scene, as formulas |
//! | `integrator`, `path` | pixels, samples, the tree of rays, one path of it |
//!
//! Far from the origin nothing is lost: positions are only ever used as differences.

mod background;
mod body;
mod camera;
mod cone;
mod cuboid;
mod cylinder;
mod disk;
mod emitter;
mod exact;
mod integrator;
mod light;
mod line;
mod margin;
mod material;
mod path;
mod plane;
mod polygon;
mod quadratic;
mod span;
mod sphere;
#[cfg(test)]
mod tests;
mod texture;

use glam::{DVec2, DVec3};

use self::body::Body;
use self::emitter::AreaLight;
use self::line::{Line, Root};
use self::margin::Found;
use crate::scene::{Background, Light, Material, Scene, Sky, Texture, Visible};

pub use self::camera::View;
pub use self::integrator::{CameraSample, Event, EventKind, First, Pixel, RayCounts, SeenLight};
pub use self::margin::{Place, TOLERANCE, U, U64, Verdict};

/// Places closer than this share of their `t` may be such as f64 cannot tell apart.
const CLOSE: f64 = 1e-5;

/// A scene ready to be traced.
#[derive(Debug, Clone)]
pub struct Reference {
    /// What was subtracted from all positions of the scene.
    origin: DVec3,
    /// By primitive index.
    placed: Vec<Placed>,
    materials: Vec<Material>,
    textures: Vec<Texture>,
    /// Relative to `origin`.
    lights: Vec<Light>,
    /// By light: those with an area.
    areas: Vec<Option<AreaLight>>,
    background: Background,
    /// The background as a light.
    sky: Option<Sky>,
    ambient: DVec3,
}

/// One primitive: its geometry and what covers it.
#[derive(Debug, Clone)]
struct Placed {
    body: Body,
    /// Index into the materials, of the front.
    material: usize,
    /// Factor on the material's colour.
    color: DVec3,
    visible: Visible,
}

/// The points `origin + t dir` for `t_min < t <= t_max`.
///
/// A ray whose direction is zero, or that holds a NaN, or whose origin or direction is infinite, meets nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Scene units, relative to the origin of the tracer.
    pub origin: DVec3,
    /// Of any length.
    pub dir: DVec3,
    /// In lengths of `dir`; not part of the ray.
    pub t_min: f64,
    /// In lengths of `dir`; part of the ray. May be infinite.
    pub t_max: f64,
}

/// Where a ray meets a primitive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// In lengths of the ray's direction.
    pub t: f64,
    /// Index of the primitive.
    pub primitive: usize,
    /// Index of the material of the side that was met.
    pub material: usize,
    /// Geometric, outward, unit: the front is the side it points to, whichever side was met.
    pub normal: DVec3,
    /// Interpolated where a polygon has normals, else the geometric one; unit, on the side of `normal`.
    pub shading_normal: DVec3,
    /// As the shape's doc comment says.
    pub uv: DVec2,
    /// Whether the front was met.
    pub front: bool,
    /// On the surface, relative to the origin of the tracer.
    pub point: DVec3,
    /// How far from `point` the numbers reach that it was computed from, scene units; what the
    /// rounding error of `point` is proportional to.
    pub reach: f64,
}

impl Reference {
    /// A tracer in the scene's own coordinates.
    pub fn new(scene: &Scene) -> Reference {
        Reference::relative_to(scene, DVec3::ZERO)
    }

    /// A tracer in coordinates relative to `origin`: rays given to it and points it returns are what
    /// is left after subtracting `origin`.
    pub fn relative_to(scene: &Scene, origin: DVec3) -> Reference {
        let placed = scene.primitives().map(|primitive| Placed {
            body: Body::new(&primitive.shape, origin),
            material: primitive.material,
            color: primitive.color,
            visible: scene.materials.get(primitive.material).map_or(Visible::Both, |material| material.visible),
        });
        Reference {
            origin,
            placed: placed.collect(),
            materials: scene.materials.clone(),
            textures: scene.textures.clone(),
            lights: scene.lights.iter().map(|light| light::relative(light, origin)).collect(),
            areas: scene.lights.iter().map(|light| AreaLight::new(light, origin)).collect(),
            background: scene.background.clone(),
            sky: scene.background.sky(),
            ambient: scene.ambient,
        }
    }

    /// The first visible place on a ray; of places that f64 cannot tell apart, the one of the lowest primitive.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let line = Line::new(ray, false)?;
        let (primitive, root) = self.first(&line, Placed::sees)?;
        let placed = &self.placed[primitive];
        let surface = placed.body.surface(&line, &root);
        Some(Hit {
            t: root.t * line.scale,
            primitive,
            material: self.material_of(placed, root.front),
            normal: surface.normal,
            shading_normal: surface.shading_normal,
            uv: surface.uv,
            front: root.front,
            point: surface.point,
            reach: surface.reach,
        })
    }

    /// Whether anything lies on a ray, whichever side of it is visible.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let Some(line) = Line::new(ray, false) else { return false };
        let blocks = |placed: &Placed| placed.body.roots(&line).iter().flatten().any(|root| root.counts(&line));
        self.placed.iter().any(blocks)
    }

    /// How many primitives there are.
    pub fn primitive_count(&self) -> usize {
        self.placed.len()
    }

    fn first(&self, line: &Line, sees: impl Fn(&Placed, bool) -> bool) -> Option<Found> {
        let mut first: Option<Found> = None;
        let mut near: Vec<Found> = Vec::new();
        for (primitive, placed) in self.placed.iter().enumerate() {
            for root in placed.body.roots(line).into_iter().flatten() {
                let close = first.is_none_or(|(_, best)| root.t <= best.t + CLOSE * best.t.abs());
                if !close || !root.counts(line) || !sees(placed, root.front) {
                    continue;
                }
                near.push((primitive, root));
                if first.is_none_or(|(_, best)| root.t < best.t) {
                    first = Some((primitive, root));
                }
            }
        }
        let best = first?;
        near.retain(|(_, root)| root.t <= best.1.t + CLOSE * best.1.t.abs());
        Some(if near.len() > 1 { self.lowest_tie(line, best, &near) } else { best })
    }

    /// The first primitive on a ray whose side is wanted, and its `t`.
    fn closest_of(&self, ray: &Ray, sees: impl Fn(&Placed, bool) -> bool) -> Option<(usize, f64)> {
        let line = Line::new(ray, false)?;
        self.first(&line, sees).map(|(primitive, root)| (primitive, root.t * line.scale))
    }

    fn material_of(&self, placed: &Placed, front: bool) -> usize {
        let back = self.materials.get(placed.material).and_then(|material| material.back);
        if front { placed.material } else { back.unwrap_or(placed.material) }
    }
}

impl Root {
    fn counts(&self, line: &Line) -> bool {
        self.hit && line.holds(self.t)
    }
}

impl Placed {
    fn sees(&self, front: bool) -> bool {
        match self.visible {
            Visible::Both => true,
            Visible::Front => front,
            Visible::Back => !front,
        }
    }
}

impl Hit {
    /// Where a ray starts that leaves this hit in direction `dir`: off the surface, along the
    /// geometric normal, on the side that `dir` goes to.
    ///
    /// The distance is what f64 may have lost in the point and loses again when the new ray is
    /// tested: some roundings of the largest number that went into either. There is no other epsilon.
    /// Source of the idea: Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th edition, 6.8.
    pub fn spawn(&self, dir: DVec3) -> DVec3 {
        let error = 16.0 * f64::EPSILON * (self.point.abs().max_element() + self.reach);
        self.point + self.normal * error.copysign(self.normal.dot(dir))
    }
}
