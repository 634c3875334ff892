//! Who is asked.

use glam::DVec3;
use serde::Serialize;

use crate::accel::Walk;
use crate::lanes::Ray;
use crate::reference::{self, Reference};
use crate::scene::Scene;
use crate::tracer::{Hit, Tracer};

/// A way to find what a ray meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Engine {
    /// Kernels alone, without decisions in f64: not judged, there to compare with.
    F32,
    /// Eight rays at a time.
    Packet,
    /// One ray at a time.
    Single,
    /// The scalar f64 tracer.
    Reference,
}

impl Engine {
    /// All of them.
    pub const ALL: [Engine; 4] = [Engine::F32, Engine::Packet, Engine::Single, Engine::Reference];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Engine::F32 => "f32",
            Engine::Packet => "packet",
            Engine::Single => "single",
            Engine::Reference => "reference",
        }
    }
}

/// What an engine says of a ray that meets something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    pub t: f64,
    pub primitive: usize,
    pub normal: Option<DVec3>,
}

/// An engine with a scene.
pub enum Asked<'s> {
    F32(Tracer<'s>),
    Packet(Tracer<'s>),
    Single(Tracer<'s>),
    Reference(Box<Reference>),
}

impl<'s> Asked<'s> {
    pub fn new(engine: Engine, scene: &'s Scene) -> Self {
        let tracer = || Tracer::new(scene).expect("families make valid scenes");
        match engine {
            Engine::F32 => Asked::F32(tracer().certify(false)),
            Engine::Packet => Asked::Packet(tracer()),
            Engine::Single => Asked::Single(tracer()),
            Engine::Reference => Asked::Reference(Box::new(Reference::new(scene))),
        }
    }

    pub fn closest(&self, rays: &[Ray]) -> Vec<Option<Answer>> {
        match self {
            Asked::F32(tracer) => rays.iter().map(|ray| kernels_alone(tracer, ray)).collect(),
            Asked::Packet(tracer) => tracer.closest_hits(rays).into_iter().map(|hit| hit.map(answer)).collect(),
            Asked::Single(tracer) => rays.iter().map(|ray| tracer.closest_hit(ray).map(answer)).collect(),
            Asked::Reference(reference) => rays.iter().map(|ray| of_reference(reference, ray)).collect(),
        }
    }
}

fn answer(hit: Hit) -> Answer {
    let normal = Some(DVec3::from_array(hit.normal.map(f64::from)));
    Answer { t: f64::from(hit.t), primitive: hit.primitive as usize, normal }
}

fn kernels_alone(tracer: &Tracer, ray: &Ray) -> Option<Answer> {
    let (t, row) = tracer.tree().closest(ray, &mut Walk::default());
    let owner = tracer.tree().stores().owner(row.kind()?, row.row());
    Some(Answer { t: f64::from(t), primitive: owner.primitive as usize, normal: None })
}

fn of_reference(reference: &Reference, ray: &Ray) -> Option<Answer> {
    let hit = reference.closest(&exact(ray))?;
    // Rounded as the others are.
    Some(Answer { t: f64::from(hit.t as f32), primitive: hit.primitive, normal: Some(hit.normal) })
}

/// The exact numbers that the bits of a ray are.
pub fn exact(ray: &Ray) -> reference::Ray {
    let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
    reference::Ray { origin: wide(ray.origin), dir: wide(ray.dir), t_min, t_max }
}
