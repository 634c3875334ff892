//! Throughput by the kind of ray, measured the same way each time.
//!
//! Right answers first: some rays of every set are traced one by one as well, and must meet the same to the bit. Then
//! one pass to warm up, and the median of at least five more, by the wall clock and by the clocks of the threads.
//! Timed is what a tracer does: taking rays from columns, finding place, primitive and normal, and storing those (for
//! any hit: one bit). Not timed: making the rays and turning them into columns, textures and materials.

mod rays;

use std::time::Instant;

use rayon::prelude::*;
use thiserror::Error;

use self::rays::{CameraSet, Eight};
use crate::accel::Counts;
use crate::film::Window;
use crate::integrate::CameraRays;
use crate::lanes::{LANES, Ray};
use crate::render::{Answers, Batch, Engine, Query, RenderError, Renderer};
use crate::scene::Scene;
use crate::tracer::{Found, Hit, Room, TILE, Tracer};

/// Fewest repetitions.
pub const LEAST_REPEATS: u32 = 5;
/// A repetition traces at least so many rays, unless passes for about so many seconds, by the first one, trace fewer.
const LEAST_RAYS: usize = 1 << 20;
const ENOUGH_SECONDS: f64 = 0.5;
/// Rays of each set that are traced one by one first.
const PROVEN: usize = 1024;
/// Tiles a task of rays that are made in place.
const CHUNK: usize = 64;

/// The kinds of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RaySet {
    /// Through the pixels.
    Camera,
    /// To a light.
    Shadow,
    /// Off diffuse surfaces.
    Bounce,
}

/// What is asked of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// What it meets first.
    Closest,
    /// Whether it meets anything.
    Any,
}

/// How rays come to be traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Supply {
    /// From columns in memory, as any tracer could take them.
    Stored,
    /// As a renderer that knows where they come from does it: camera rays made in place, making them included;
    /// shadow rays from the light to the surface, so that all share an origin.
    Own,
}

/// What to measure.
#[derive(Debug, Clone)]
pub struct BenchSettings {
    /// Kinds of rays.
    pub sets: Vec<RaySet>,
    /// 0: one a core.
    pub threads: usize,
    /// Timed repetitions, at least [`LEAST_REPEATS`].
    pub repeats: u32,
    /// Another size of the picture.
    pub resolution: Option<(u32, u32)>,
}

/// One measurement.
#[derive(Debug, Clone)]
pub struct Throughput {
    /// Kind of rays.
    pub set: RaySet,
    /// What was asked.
    pub question: Question,
    /// Where the rays came from.
    pub supply: Supply,
    /// Threads used.
    pub threads: usize,
    /// Rays of the set.
    pub rays: usize,
    /// Rays that met something.
    pub hits: usize,
    /// Million rays a second, from the median.
    pub mrays_per_s: f64,
    /// Million rays a second of CPU time of all threads together, from the median, where the system has such clocks.
    pub mrays_per_cpu_s: Option<f64>,
    /// (Longest - shortest) over the median of the repetitions, of CPU time where that is known.
    pub spread: f64,
    /// Tests of one pass over all rays.
    pub tests: Counts,
}

/// Why nothing was measured.
#[derive(Debug, Error)]
pub enum BenchError {
    /// The scene cannot be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// No camera ray met anything, so there are no others.
    #[error("no camera ray meets anything, so there are no shadow or bounce rays to trace")]
    NothingMet,
    /// Shadow rays were asked for and there is nothing for them to go to.
    #[error("the scene has no light at a place (point or spot), so there are no shadow rays to trace")]
    NoLight,
    /// A ray that met something else when it was traced by itself: not worth timing.
    #[error("{set:?} ray {index} met something else when it was traced by itself: {bits:08x?}")]
    Wrong {
        /// Kind of the ray.
        set: RaySet,
        /// Its place in the set.
        index: usize,
        /// Origin, t_min, direction and t_max as bits.
        bits: [u32; 8],
    },
}

impl RaySet {
    /// All of them.
    pub const ALL: [RaySet; 3] = [RaySet::Camera, RaySet::Shadow, RaySet::Bounce];

    /// As in JSON.
    pub fn name(self) -> &'static str {
        match self {
            RaySet::Camera => "camera",
            RaySet::Shadow => "shadow",
            RaySet::Bounce => "bounce",
        }
    }
}

impl Question {
    /// As in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Question::Closest => "closest",
            Question::Any => "any",
        }
    }
}

/// Whether a scene has a light that shadow rays can go to.
pub fn has_light(scene: &Scene) -> bool {
    rays::light_position(scene).is_some()
}

/// The rays of one kind, as they are traced for a scene: in the coordinates of the scene.
///
/// # Errors
/// No camera or image size; for shadow and bounce rays also [`BenchError::NothingMet`] and [`BenchError::NoLight`].
pub fn ray_set(scene: &Scene, set: RaySet) -> Result<Vec<Ray>, BenchError> {
    let renderer = Renderer::new(scene)?;
    let camera = CameraSet::new(renderer.view(), renderer.image());
    if set == RaySet::Camera {
        return Ok(camera.rays);
    }
    let hits = camera_hits(&Query::new(scene, Engine::Packet, 0)?, &camera)?;
    match set {
        RaySet::Shadow => {
            let light = rays::light_position(scene).ok_or(BenchError::NoLight)?;
            Ok(rays::shadow(&hits, &camera.rays, light))
        }
        RaySet::Camera | RaySet::Bounce => Ok(rays::bounce(&hits, &camera)),
    }
}

fn camera_hits(query: &Query, camera: &CameraSet) -> Result<Vec<Option<Hit>>, BenchError> {
    let hits = query.closest(&camera.rays);
    if hits.iter().all(Option::is_none) { Err(BenchError::NothingMet) } else { Ok(hits) }
}

/// Measures a scene; `tell` hears of each figure as it comes.
///
/// # Errors
/// [`BenchError`].
pub fn bench(
    scene: &Scene,
    settings: &BenchSettings,
    tell: &mut dyn FnMut(&Throughput),
) -> Result<Vec<Throughput>, BenchError> {
    let renderer = match settings.resolution {
        Some((width, height)) => Renderer::new(scene)?.resolution(width, height),
        None => Renderer::new(scene)?,
    };
    let query = Query::new(scene, Engine::Packet, settings.threads)?;
    let bench = Bench { query, repeats: settings.repeats.max(LEAST_REPEATS) };
    let camera = CameraSet::new(renderer.view(), renderer.image());
    let wants = |set| settings.sets.contains(&set);
    let mut figures = Vec::new();
    let mut add = |figure: Throughput| {
        tell(&figure);
        figures.push(figure);
    };
    if wants(RaySet::Camera) {
        bench.stored(RaySet::Camera, camera.rays.clone(), &mut add)?;
        add(bench.in_place(&renderer));
    }
    if !wants(RaySet::Shadow) && !wants(RaySet::Bounce) {
        return Ok(figures);
    }
    let hits = camera_hits(&bench.query, &camera)?;
    if wants(RaySet::Shadow) {
        let light = rays::light_position(scene).ok_or(BenchError::NoLight)?;
        let shadow = rays::shadow(&hits, &camera.rays, light);
        let own = rays::from_light(&shadow, light);
        bench.stored(RaySet::Shadow, shadow, &mut add)?;
        add(bench.any(RaySet::Shadow, Supply::Own, &Batch::new(own)));
    }
    if wants(RaySet::Bounce) {
        bench.stored(RaySet::Bounce, rays::bounce(&hits, &camera), &mut add)?;
    }
    Ok(figures)
}

struct Bench<'s> {
    query: Query<'s>,
    repeats: u32,
}

impl Bench<'_> {
    /// Rays from columns: both questions, after a look at the answers.
    fn stored(&self, set: RaySet, rays: Vec<Ray>, add: &mut dyn FnMut(Throughput)) -> Result<(), BenchError> {
        let batch = Batch::new(rays);
        self.prove(set, &batch)?;
        let mut answers = self.query.room(&batch);
        let (counts, times) = self.timed(batch.len(), || self.query.find_closest(&batch, &mut answers));
        let hits = self.query.hits(&batch, answers).iter().flatten().count();
        add(self.figure((set, Question::Closest, Supply::Stored), (batch.len(), hits), counts, &times));
        add(self.any(set, Supply::Stored, &batch));
        Ok(())
    }

    fn any(&self, set: RaySet, supply: Supply, batch: &Batch) -> Throughput {
        let mut dark = vec![0; batch.tiles()];
        let (counts, times) = self.timed(batch.len(), || self.query.find_occluded(batch, &mut dark));
        let hits = batch.unpack(&dark).into_iter().filter(|dark| *dark).count();
        self.figure((set, Question::Any, supply), (batch.len(), hits), counts, &times)
    }

    /// Camera rays, made where they are traced.
    fn in_place(&self, renderer: &Renderer) -> Throughput {
        let (width, height) = (renderer.image().width, renderer.image().height);
        let count = Window::full((width, height)).area();
        let generator = rays::generator(renderer.view(), renderer.image());
        let eights = rays::eights(renderer.image());
        let mut found = vec![Found::default(); eights.len().div_ceil(TILE / LANES)];
        let tracer = self.query.tracer();
        let trace = |room: &mut Room, (found, eights): (&mut [Found], &[Eight])| {
            tracer.map_or(Counts::default(), |tracer| camera_tiles(tracer, &generator, eights, found, room))
        };
        let once = || {
            self.query.install(|| {
                let tasks = found.par_chunks_mut(CHUNK).zip(eights.par_chunks(CHUNK * TILE / LANES));
                tasks.map_init(Room::default, trace).reduce(Counts::default, Counts::sum)
            })
        };
        let (counts, times) = self.timed(count, once);
        let hits = found.iter().map(Found::hits).sum();
        self.figure((RaySet::Camera, Question::Closest, Supply::Own), (count, hits), counts, &times)
    }

    /// Some rays of a set by themselves.
    fn prove(&self, set: RaySet, batch: &Batch) -> Result<(), BenchError> {
        let Some(tracer) = self.query.tracer() else { return Ok(()) };
        let mut answers: Answers = self.query.room(batch);
        self.query.find_closest(batch, &mut answers);
        let hits = self.query.hits(batch, answers);
        let mut dark = vec![0; batch.tiles()];
        self.query.find_occluded(batch, &mut dark);
        let dark = batch.unpack(&dark);
        let same = |index: &usize| {
            let ray = &batch.rays()[*index];
            let alone = tracer.closest_hit(ray);
            let key = |hit: &Option<Hit>| hit.map(|hit| (hit.t.to_bits(), hit.primitive));
            key(&alone) == key(&hits[*index]) && tracer.is_occluded(ray) == dark[*index]
        };
        let step = batch.len().div_ceil(PROVEN).max(1);
        match (0..batch.len()).step_by(step).find(|index| !same(index)) {
            None => Ok(()),
            Some(index) => Err(BenchError::Wrong { set, index, bits: bits(&batch.rays()[index]) }),
        }
    }

    /// Passes over a set, once before the clock starts; seconds a pass, by the wall and by the threads' clocks.
    fn timed(&self, rays: usize, mut once: impl FnMut() -> Counts) -> (Counts, Times) {
        let start = Instant::now();
        let counts = once();
        let in_time = (ENOUGH_SECONDS / start.elapsed().as_secs_f64()).ceil() as usize;
        let passes = LEAST_RAYS.div_ceil(rays.max(1)).min(in_time).max(1);
        let mut times = Times::default();
        for _ in 0..self.repeats {
            let (start, cpu) = (Instant::now(), self.cpu_seconds());
            for _ in 0..passes {
                once();
            }
            times.wall.push(start.elapsed().as_secs_f64() / passes as f64);
            let cpu = self.cpu_seconds().zip(cpu).map(|(after, before)| (after - before) / passes as f64);
            times.cpu.extend(cpu);
        }
        (counts, times)
    }

    /// CPU seconds that the threads at work spent so far.
    fn cpu_seconds(&self) -> Option<f64> {
        self.query.install(|| rayon::broadcast(|_| thread_seconds()).into_iter().sum())
    }

    fn figure(
        &self,
        (set, question, supply): (RaySet, Question, Supply),
        (rays, hits): (usize, usize),
        tests: Counts,
        times: &Times,
    ) -> Throughput {
        let millions = rays as f64 * 1e-6;
        let rate = |seconds: &[f64]| (!seconds.is_empty()).then(|| millions / median(seconds));
        let by = if times.cpu.is_empty() { &times.wall } else { &times.cpu };
        Throughput {
            set,
            question,
            supply,
            threads: self.query.threads(),
            rays,
            hits,
            mrays_per_s: rate(&times.wall).unwrap_or(0.0),
            mrays_per_cpu_s: rate(&times.cpu),
            spread: spread(by),
            tests,
        }
    }
}

/// Seconds a pass, by repetition.
#[derive(Debug, Default)]
struct Times {
    wall: Vec<f64>,
    /// Of all threads together; empty where it is not known.
    cpu: Vec<f64>,
}

fn camera_tiles(
    tracer: &Tracer,
    generator: &CameraRays,
    eights: &[Eight],
    found: &mut [Found],
    room: &mut Room,
) -> Counts {
    let packets = |k: usize, p: usize| {
        let pixels = eights.get(k * (TILE / LANES) + p).map_or(&[][..], Vec::as_slice);
        generator.packet(&generator.exact(&rays::samples(generator, pixels)), pixels.len())
    };
    tracer.find_made(generator.common_origin(), packets, found, room)
}

/// CPU seconds that this thread spent so far.
#[cfg(unix)]
fn thread_seconds() -> Option<f64> {
    let spent = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Some(spent.tv_sec as f64 + spent.tv_nsec as f64 * 1e-9)
}

/// CPU seconds that this thread spent so far: not known here.
#[cfg(not(unix))]
fn thread_seconds() -> Option<f64> {
    None
}

fn bits(ray: &Ray) -> [u32; 8] {
    let ([x, y, z], [a, b, c]) = (ray.origin, ray.dir);
    [x, y, z, ray.t_min, a, b, c, ray.t_max].map(f32::to_bits)
}

/// The middle of some values, of an even number of them the mean of the two in the middle; 0 of none.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => 0.0,
        odd if odd % 2 == 1 => sorted[middle],
        _ => sorted[middle - 1].midpoint(sorted[middle]),
    }
}

/// How far apart values are, as a share of their median.
fn spread(values: &[f64]) -> f64 {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(0.0, f64::max);
    (most - least) / median(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(sets: &[RaySet]) -> BenchSettings {
        BenchSettings { sets: sets.to_vec(), threads: 2, repeats: 1, resolution: Some((52, 37)) }
    }

    #[test]
    fn every_kind_is_measured_and_the_counts_do_not_depend_on_threads() {
        let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/fig5.toml")).unwrap();
        let mut told = 0;
        let two = bench(&scene, &settings(&RaySet::ALL), &mut |_| told += 1).unwrap();
        let one = BenchSettings { threads: 1, ..settings(&RaySet::ALL) };
        let one = bench(&scene, &one, &mut |_| ()).unwrap();
        assert_eq!((two.len(), told), (8, 8));
        for (a, b) in two.iter().zip(&one) {
            assert_eq!((a.rays, a.hits, a.tests), (b.rays, b.hits, b.tests), "{a:?}");
            assert!(a.mrays_per_s > 0.0 && a.spread >= 0.0 && a.rays >= a.hits, "{a:?}");
        }
        let rays = |set, question, supply| {
            let is = |f: &&Throughput| (f.set, f.question, f.supply) == (set, question, supply);
            two.iter().find(is).map(|f| (f.rays, f.hits)).unwrap()
        };
        let (camera, own) = (RaySet::Camera, Supply::Own);
        assert_eq!(rays(camera, Question::Closest, Supply::Stored), rays(camera, Question::Any, Supply::Stored));
        assert_eq!(rays(camera, Question::Closest, Supply::Stored).0, 52 * 37);
        // Directions are not of unit length there, so a ray at a silhouette may decide otherwise.
        assert!(rays(camera, Question::Closest, own).1.abs_diff(rays(camera, Question::Any, Supply::Stored).1) < 3);
        let (shadow, met) = rays(RaySet::Shadow, Question::Any, Supply::Stored);
        assert!(shadow > 100 && met > 10 && rays(RaySet::Shadow, Question::Any, own).1.abs_diff(met) < 3);
        assert_eq!(
            rays(RaySet::Bounce, Question::Any, Supply::Stored).0,
            rays(camera, Question::Any, Supply::Stored).1
        );
    }

    #[test]
    fn what_cannot_be_measured_is_said() {
        let mut scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/sphere.toml")).unwrap();
        scene.lights.clear();
        let error = bench(&scene, &settings(&[RaySet::Shadow]), &mut |_| ()).unwrap_err();
        assert!(error.to_string().contains("no light"), "{error}");
        scene.objects.clear();
        scene.clouds.clear();
        let error = bench(&scene, &settings(&[RaySet::Bounce]), &mut |_| ()).unwrap_err();
        assert!(error.to_string().contains("no camera ray meets anything"), "{error}");
        scene.image = None;
        let resolution = Some((8, 8));
        assert!(bench(&scene, &BenchSettings { resolution, ..settings(&[]) }, &mut |_| ()).is_err());
    }

    #[test]
    fn medians_and_spreads() {
        assert_eq!((median(&[]), median(&[3.0, 1.0, 2.0]), median(&[4.0, 1.0])), (0.0, 2.0, 2.5));
        assert_eq!(spread(&[1.0, 2.0, 4.0]), 1.5);
    }
}
