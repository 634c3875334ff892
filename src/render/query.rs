//! Many rays of a user's own, over the cores.

use glam::DVec3;
use rayon::ThreadPool;
use rayon::prelude::*;

use super::{Engine, RenderError, pool};
use crate::lanes::{Ray, UNIT_ROUNDOFF};
use crate::plan::validate;
use crate::reference::{self, Reference};
use crate::scene::Scene;
use crate::tracer::{Hit, Tracer};

/// Rays a task: whole tiles, and work for some hundred microseconds.
const CHUNK: usize = 4096;

/// A scene ready to be asked what rays meet, with threads of its own. Rays are in the coordinates of
/// the scene; answers come in the order of the rays and do not depend on the number of threads.
#[derive(Debug)]
pub struct Query<'s> {
    asked: Asked<'s>,
    pool: ThreadPool,
}

/// Who answers.
#[derive(Debug)]
enum Asked<'s> {
    Packet(Tracer<'s>),
    Single(Tracer<'s>),
    Reference(Box<Reference>),
}

impl<'s> Query<'s> {
    /// Builds what the engine needs; 0 threads are as many as there are cores for this process.
    ///
    /// # Errors
    /// [`RenderError::Threads`], [`RenderError::Scene`].
    pub fn new(scene: &'s Scene, engine: Engine, threads: usize) -> Result<Self, RenderError> {
        let pool = pool(threads)?;
        let asked = pool.install(|| match engine {
            Engine::Packet => Tracer::new(scene).map(Asked::Packet),
            Engine::Single => Tracer::new(scene).map(Asked::Single),
            Engine::Reference => validate(scene).map(|()| Asked::Reference(Box::new(Reference::new(scene)))),
        });
        let asked = asked?;
        Ok(Query { asked, pool })
    }

    /// Threads in use.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// The tracer behind it, unless that is the reference.
    pub fn tracer(&self) -> Option<&Tracer<'s>> {
        match &self.asked {
            Asked::Packet(tracer) | Asked::Single(tracer) => Some(tracer),
            Asked::Reference(_) => None,
        }
    }

    /// What each ray meets first.
    pub fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        self.each_chunk(rays, None, |rays| match &self.asked {
            Asked::Packet(tracer) => tracer.closest_hits(rays),
            Asked::Single(tracer) => rays.iter().map(|ray| tracer.closest_hit(ray)).collect(),
            Asked::Reference(tracer) => rays.iter().map(|ray| tracer.closest(&exact(ray)).map(rounded)).collect(),
        })
    }

    /// Whether each ray meets anything, either side of it.
    pub fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        self.each_chunk(rays, false, |rays| match &self.asked {
            Asked::Packet(tracer) => tracer.occluded(rays),
            Asked::Single(tracer) => rays.iter().map(|ray| tracer.is_occluded(ray)).collect(),
            Asked::Reference(tracer) => rays.iter().map(|ray| tracer.occluded(&exact(ray))).collect(),
        })
    }

    fn each_chunk<T: Copy + Send>(&self, rays: &[Ray], none: T, trace: impl Fn(&[Ray]) -> Vec<T> + Sync) -> Vec<T> {
        let mut answers = vec![none; rays.len()];
        let tasks = answers.par_chunks_mut(CHUNK).zip(rays.par_chunks(CHUNK));
        self.pool.install(|| tasks.for_each(|(answers, rays)| answers.copy_from_slice(&trace(rays))));
        answers
    }
}

/// The exact numbers that the bits of a ray are.
fn exact(ray: &Ray) -> reference::Ray {
    let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let (origin, dir) = (wide(ray.origin), wide(ray.dir));
    reference::Ray { origin, dir, t_min: f64::from(ray.t_min), t_max: f64::from(ray.t_max) }
}

/// A hit in f32, whose point is off by no more than its rounding.
fn rounded(hit: reference::Hit) -> Hit {
    let point = hit.point.as_vec3().to_array();
    Hit {
        t: hit.t as f32,
        primitive: hit.primitive as u32,
        material: hit.material as u32,
        normal: hit.normal.as_vec3().to_array(),
        uv: hit.uv.as_vec2().to_array(),
        front: hit.front,
        point,
        error: 2.0 * UNIT_ROUNDOFF * point.iter().map(|x| x.abs()).sum::<f32>(),
    }
}
