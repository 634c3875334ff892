//! Many rays of a user's own, over the cores.

use glam::DVec3;
use rayon::ThreadPool;
use rayon::prelude::*;

use super::{Engine, RenderError, pool};
use crate::accel::Counts;
use crate::lanes::{Ray, UNIT_ROUNDOFF};
use crate::plan::validate;
use crate::reference::{self, Reference};
use crate::scene::Scene;
use crate::tracer::{Found, Hit, RayBatch, Room, TILE, Tracer};

/// Tiles a task: work for some hundred microseconds.
const CHUNK: usize = 64;
/// The same of rays that any hit ends: the more of them there are, the closer together are those that share a tile.
const MOST_CHUNK: usize = 512;
/// Tasks a thread, where there are rays enough.
const TASKS: usize = 8;

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
    Tracer(Box<Tracer<'s>>),
    Reference(Box<Reference>),
}

/// Rays in columns, ready to be traced again and again.
#[derive(Debug)]
pub struct Batch {
    rays: Vec<Ray>,
    columns: RayBatch,
}

/// What the rays of a batch met: place, primitive and normal.
#[derive(Debug)]
pub enum Answers {
    /// In columns.
    Tiles(Vec<Found>),
    /// From the reference.
    Reference(Vec<Option<Hit>>),
}

impl<'s> Query<'s> {
    /// Builds what the engine needs; 0 threads are as many as there are cores for this process.
    ///
    /// # Errors
    /// [`RenderError::Threads`], [`RenderError::Scene`].
    pub fn new(scene: &'s Scene, engine: Engine, threads: usize) -> Result<Self, RenderError> {
        let pool = pool(threads)?;
        let asked = pool.install(|| match engine {
            Engine::Packet => Tracer::new(scene).map(|tracer| Asked::Tracer(Box::new(tracer))),
            Engine::Single => Tracer::new(scene).map(|tracer| Asked::Tracer(Box::new(tracer.one_by_one(true)))),
            Engine::Reference => validate(scene).map(|()| Asked::Reference(Box::new(Reference::new(scene)))),
        });
        let asked = asked?;
        Ok(Query { asked, pool })
    }

    /// Threads in use.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Does something on its threads.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.pool.install(work)
    }

    /// The tracer behind it, unless that is the reference.
    pub fn tracer(&self) -> Option<&Tracer<'s>> {
        match &self.asked {
            Asked::Tracer(tracer) => Some(tracer),
            Asked::Reference(_) => None,
        }
    }

    /// What each ray meets first.
    pub fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        let batch = Batch::new(rays.to_vec());
        let mut answers = self.room(&batch);
        self.find_closest(&batch, &mut answers);
        self.hits(&batch, answers)
    }

    /// Whether each ray meets anything, either side of it.
    pub fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        let batch = Batch::new(rays.to_vec());
        let mut dark = vec![0; batch.tiles()];
        self.find_occluded(&batch, &mut dark);
        batch.unpack(&dark)
    }

    /// Room for what a batch meets.
    pub fn room(&self, batch: &Batch) -> Answers {
        match &self.asked {
            Asked::Tracer(_) => Answers::Tiles(vec![Found::default(); batch.tiles()]),
            Asked::Reference(_) => Answers::Reference(vec![None; batch.rays.len()]),
        }
    }

    /// Finds what each ray of a batch meets first, and tells the tests that took (none by the reference).
    pub fn find_closest(&self, batch: &Batch, answers: &mut Answers) -> Counts {
        self.pool.install(|| match (&self.asked, answers) {
            (Asked::Tracer(tracer), Answers::Tiles(found)) => {
                let tasks = found.par_chunks_mut(CHUNK).enumerate();
                let trace = |room: &mut Room, (i, found)| tracer.find_closest(&batch.columns, i * CHUNK, found, room);
                tasks.map_init(Room::default, trace).reduce(Counts::default, Counts::sum)
            }
            (Asked::Reference(reference), Answers::Reference(hits)) => {
                let tasks = hits.par_iter_mut().zip(&batch.rays);
                tasks.for_each(|(hit, ray)| *hit = reference.closest(&exact(ray)).map(rounded));
                Counts::default()
            }
            _ => unreachable!("room of this query's own"),
        })
    }

    /// Finds which rays of a batch meet anything, 64 a number, and tells the tests that took (none by the reference).
    pub fn find_occluded(&self, batch: &Batch, dark: &mut [u64]) -> Counts {
        self.pool.install(|| match &self.asked {
            Asked::Tracer(tracer) => {
                let chunk = (dark.len() / (TASKS * self.threads())).clamp(CHUNK, MOST_CHUNK);
                let tasks = dark.par_chunks_mut(chunk).enumerate();
                let trace = |room: &mut Room, (i, dark)| tracer.find_occluded(&batch.columns, i * chunk, dark, room);
                tasks.map_init(Room::default, trace).reduce(Counts::default, Counts::sum)
            }
            Asked::Reference(reference) => {
                let tasks = dark.par_iter_mut().zip(batch.rays.par_chunks(TILE));
                let bit = |(i, ray): (usize, &Ray)| u64::from(reference.occluded(&exact(ray))) << i;
                tasks.for_each(|(dark, rays)| *dark = rays.iter().enumerate().map(bit).sum());
                Counts::default()
            }
        })
    }

    /// What was found, in full.
    pub fn hits(&self, batch: &Batch, answers: Answers) -> Vec<Option<Hit>> {
        match (&self.asked, answers) {
            (Asked::Tracer(tracer), Answers::Tiles(found)) => self.pool.install(|| {
                let tiles = found.par_iter().enumerate();
                let mut hits: Vec<_> =
                    tiles.flat_map_iter(|(i, found)| tracer.hits(&batch.columns, i, found)).collect();
                hits.truncate(batch.rays.len());
                hits
            }),
            (_, Answers::Reference(hits)) => hits,
            _ => unreachable!("room of this query's own"),
        }
    }
}

impl Batch {
    /// Turns rays into columns.
    pub fn new(rays: Vec<Ray>) -> Self {
        let columns = RayBatch::new(&rays);
        Batch { rays, columns }
    }

    /// The rays.
    pub fn rays(&self) -> &[Ray] {
        &self.rays
    }

    /// How many rays.
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.rays.is_empty()
    }

    /// Tiles of 64 rays.
    pub fn tiles(&self) -> usize {
        self.columns.tiles()
    }

    /// The bits of [`Query::find_occluded`], one by one.
    pub fn unpack(&self, dark: &[u64]) -> Vec<bool> {
        (0..self.rays.len()).map(|i| dark[i / TILE] >> (i % TILE) & 1 == 1).collect()
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
