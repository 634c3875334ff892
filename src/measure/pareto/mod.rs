//! Run time against error: a scene rendered in many ways, each measured against a converged picture.
//!
//! Errors are those of [`compare`]; the converged picture has another seed, so that it shares no sample with
//! what it judges. Seconds are CPU time of planning, building and tracing, all threads together, the best of up to three: on a
//! machine that others use as well, wall time says more about them. Wall time stands beside it. A point is on the *front* if
//! nothing else is both cheaper and nearer to the truth.

mod page;
mod tessellate;

use std::time::Instant;

pub use self::page::{csv, page};
pub use self::tessellate::{faces, tessellated, triangles};

use super::metrics::compare;
use crate::film::{Picture, Window};
use crate::render::{Engine, RenderError, Renderer};
use crate::scene::{Filter, FilterKind, Scene};

/// Cuts along an edge of the octahedron: about 1,000 and 10,000 triangles a sphere, as the paper has them.
const SIDES: [u32; 2] = [11, 35];
/// Bounds on the samples per pixel of a converged picture.
const CONVERGED: [u32; 2] = [64, 1 << 14];
/// A point has at most this part of the samples of the picture that it is compared with.
const PART: u32 = 16;

/// How a sweep is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParetoSettings {
    /// Seconds that a scene may take, about.
    pub seconds: f64,
    /// 0: one a core.
    pub threads: usize,
}

/// What came of a scene.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// Its name.
    pub name: String,
    /// The converged picture, with the scene's own filter.
    pub converged: Picture,
    /// Its samples per pixel.
    pub converged_spp: u32,
    /// Seconds that it took.
    pub converged_seconds: f64,
    /// Threads used.
    pub threads: usize,
    /// What was measured, series by series.
    pub points: Vec<Point>,
    /// What was left out and why.
    pub left_out: Vec<String>,
}

/// One way to render a scene.
#[derive(Debug, Clone)]
pub struct Point {
    /// Those that differ in their samples only have the same series.
    pub series: String,
    /// Who traced.
    pub engine: Engine,
    /// Whether what f32 leaves open was decided in f64.
    pub certified: bool,
    /// Pixel filter.
    pub filter: FilterKind,
    /// Triangles that each sphere was cut into.
    pub triangles: Option<usize>,
    /// Samples per pixel; to a noise level their mean, rounded.
    pub spp: u32,
    /// CPU time of all threads; wall time where the system does not tell.
    pub seconds: f64,
    /// Wall time.
    pub wall_seconds: f64,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// Mean squared error relative to the converged picture's squares.
    pub rel_mse: f64,
    /// Largest error of a sample of a pixel.
    pub max: f64,
    /// Whether nothing is both faster and nearer.
    pub front: bool,
}

/// What points of one series have in common.
struct Way<'a> {
    series: String,
    scene: &'a Scene,
    engine: Engine,
    certified: bool,
    filter: Filter,
    triangles: Option<usize>,
    /// Samples each tile to a noise level instead of so many samples.
    adaptive: bool,
}

/// The first noise level.
const COARSE: f64 = 0.1;

/// Renders a scene in many ways; `tell` hears of each as it is done.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`].
pub fn sweep(
    name: &str,
    scene: &Scene,
    settings: &ParetoSettings,
    tell: &mut dyn FnMut(&Point),
) -> Result<Sweep, RenderError> {
    let image = Renderer::new(scene)?.image().clone();
    let (engine, filter) = (Engine::Packet, image.filter);
    let own = Way { series: "packet".into(), scene, engine, certified: true, filter, triangles: None, adaptive: false };
    let mut left_out = Vec::new();
    let (converged, converged_spp, converged_seconds, threads) = own.converge(0.25 * settings.seconds, settings)?;
    let against = |converged: &Picture, spp: u32| (converged.clone(), spp / PART);
    let mut work = Work { settings, points: Vec::new(), tell };
    work.series(&own, &against(&converged, converged_spp), 0.2)?;
    let adaptive = Way { series: "to a noise level".into(), adaptive: true, ..own.clone() };
    work.series(&adaptive, &against(&converged, converged_spp), 0.12)?;
    let single = Way { series: "single rays".into(), engine: Engine::Single, ..own.clone() };
    work.series(&single, &against(&converged, converged_spp), 0.08)?;

    let bold = Way { series: "not certified".into(), certified: false, ..own.clone() };
    work.series(&bold, &against(&converged, converged_spp), 0.08)?;

    let reference = Way { series: "f64 reference".into(), engine: Engine::Reference, ..own.clone() };
    let guess = reference.guess_reference(settings)?;
    match guess < 0.15 * settings.seconds {
        true => work.series(&reference, &against(&converged, converged_spp), 0.1)?,
        false => left_out.push(format!("the f64 reference: it would take about {guess:.0} s a sample per pixel")),
    }
    for side in SIDES {
        let count = triangles(side);
        let Some(cut) = tessellated(scene, side) else {
            left_out.push(format!("spheres as {count} triangles: no spheres, textures on them, or too many triangles"));
            continue;
        };
        let series = format!("spheres as {count} triangles");
        let way = Way { series, scene: &cut, triangles: Some(count), ..own.clone() };
        work.series(&way, &against(&converged, converged_spp), 0.08)?;
    }
    for (kind, radius) in [(FilterKind::Box, 0.5), (FilterKind::Gaussian, 1.5), (FilterKind::BlackmanHarris, 1.5)] {
        if kind == image.filter.kind {
            continue;
        }
        let way =
            Way { series: format!("{} filter", filter_name(kind)), filter: Filter { kind, radius }, ..own.clone() };
        let (converged, spp, ..) = way.converge(0.1 * settings.seconds, settings)?;
        work.series(&way, &(converged, spp / PART), 0.06)?;
    }
    let mut points = work.points;
    mark_front(&mut points);
    let name = name.to_owned();
    Ok(Sweep { name, converged, converged_spp, converged_seconds, threads, points, left_out })
}

impl Clone for Way<'_> {
    fn clone(&self) -> Self {
        Way { series: self.series.clone(), ..*self }
    }
}

impl Way<'_> {
    fn renderer<'s>(&self, scene: &'s Scene, spp: u32, settings: &ParetoSettings) -> Result<Renderer<'s>, RenderError> {
        let renderer = Renderer::new(scene)?.engine(self.engine).certify(self.certified).threads(settings.threads);
        // Half the noise where twice as many samples would give about that much less.
        let level = self.adaptive.then(|| COARSE / f64::from(spp).sqrt());
        Ok(renderer.spp(spp).noise(level))
    }

    fn filtered(&self) -> Scene {
        let mut scene = self.scene.clone();
        scene.image.iter_mut().for_each(|image| image.filter = self.filter);
        scene
    }

    /// A picture of as many samples as some seconds allow: it, its samples per pixel, its seconds, and the threads used.
    fn converge(&self, seconds: f64, settings: &ParetoSettings) -> Result<(Picture, u32, f64, usize), RenderError> {
        let scene = self.filtered();
        let start = Instant::now();
        self.renderer(&scene, 8, settings)?.render(&())?;
        let affordable = 8.0 * seconds / start.elapsed().as_secs_f64();
        let spp = (affordable as u32).clamp(CONVERGED[0], CONVERGED[1]);
        let start = Instant::now();
        let renderer = self.renderer(&scene, spp, settings)?;
        // Other samples than those of the points, or both would have the same errors.
        let seed = renderer.pattern().wrapping_add(0x5eed);
        let rendering = renderer.seed(seed).render(&())?;
        Ok((rendering.picture, spp, start.elapsed().as_secs_f64(), rendering.stats.threads))
    }

    /// Seconds that the reference takes for a sample per pixel, judged by a part of the picture.
    fn guess_reference(&self, settings: &ParetoSettings) -> Result<f64, RenderError> {
        let renderer = self.renderer(self.scene, 1, settings)?;
        let (width, height) = (renderer.image().width as i32, renderer.image().height as i32);
        let (x, y) = (width / 2, height / 2);
        let part = Window { x0: (x - 8).max(0), y0: (y - 2).max(0), x1: (x + 8).min(width), y1: (y + 2).min(height) };
        let start = Instant::now();
        renderer.crop(part).render(&())?;
        Ok(start.elapsed().as_secs_f64() * f64::from(width) * f64::from(height) / part.area() as f64)
    }
}

struct Work<'a> {
    settings: &'a ParetoSettings,
    points: Vec<Point>,
    tell: &'a mut dyn FnMut(&Point),
}

impl Work<'_> {
    /// One point after the other with twice the samples, for this share of all seconds and up to so many samples.
    fn series(&mut self, way: &Way, (converged, most): &(Picture, u32), share: f64) -> Result<(), RenderError> {
        let (scene, start) = (way.filtered(), Instant::now());
        let mut spp = 1;
        loop {
            let point = self.point(way, &scene, spp, converged)?;
            (self.tell)(&point);
            let seconds = point.wall_seconds;
            self.points.push(point);
            spp *= 2;
            let left = share * self.settings.seconds - start.elapsed().as_secs_f64();
            // The next one takes about twice as long, and is rendered up to three times.
            if spp > *most || 2.0 * seconds > left {
                return Ok(());
            }
        }
    }

    fn point(&self, way: &Way, scene: &Scene, spp: u32, converged: &Picture) -> Result<Point, RenderError> {
        let renderer = way.renderer(scene, spp, self.settings)?;
        let once = || {
            let (start, cpu) = (Instant::now(), cpu_seconds());
            let rendering = renderer.render(&())?;
            let wall = start.elapsed().as_secs_f64();
            let cpu = cpu_seconds().zip(cpu).map_or(wall, |(after, before)| after - before);
            let mean = rendering.stats.noise.map(|reached| reached.samples as f64 / reached.pixels.max(1) as f64);
            Ok::<_, RenderError>((cpu, wall, rendering.picture, mean))
        };
        let (mut seconds, mut wall_seconds, picture, mean) = once()?;
        for _ in 0..2 {
            if wall_seconds < 0.02 * self.settings.seconds {
                let (cpu, wall, ..) = once()?;
                (seconds, wall_seconds) = (seconds.min(cpu), wall_seconds.min(wall));
            }
        }
        let Way { series, engine, certified, filter, triangles, .. } = way;
        let (series, filter) = (series.clone(), filter.kind);
        let point = Point {
            series,
            engine: *engine,
            certified: *certified,
            filter,
            triangles: *triangles,
            spp: mean.map_or(spp, |mean| mean.round() as u32),
            seconds,
            wall_seconds,
            rmse: f64::NAN,
            rel_mse: f64::NAN,
            max: f64::NAN,
            front: false,
        };
        Ok(match compare(&picture, converged) {
            Ok(found) => Point { rmse: found.rmse, rel_mse: found.rel_mse, max: found.max.value, ..point },
            Err(_) => point,
        })
    }
}

/// CPU seconds that this process spent so far.
#[cfg(unix)]
fn cpu_seconds() -> Option<f64> {
    let spent = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(spent.tv_sec as f64 + spent.tv_nsec as f64 * 1e-9)
}

/// CPU seconds that this process spent so far: not known here.
#[cfg(not(unix))]
fn cpu_seconds() -> Option<f64> {
    None
}

/// Marks what nothing else beats in both time and RMSE.
fn mark_front(points: &mut [Point]) {
    let mut order: Vec<usize> = (0..points.len()).collect();
    let key = |point: &Point| (point.seconds, point.rmse);
    order.sort_by(|a, b| key(&points[*a]).partial_cmp(&key(&points[*b])).unwrap_or(std::cmp::Ordering::Equal));
    let mut best = f64::INFINITY;
    for i in order {
        points[i].front = points[i].rmse < best;
        best = best.min(points[i].rmse);
    }
}

/// As in scene files.
pub fn filter_name(kind: FilterKind) -> &'static str {
    match kind {
        FilterKind::Box => "box",
        FilterKind::Gaussian => "gaussian",
        FilterKind::BlackmanHarris => "blackman-harris",
    }
}

/// As on the command line.
pub fn engine_name(engine: Engine) -> &'static str {
    match engine {
        Engine::Packet => "packet",
        Engine::Single => "single",
        Engine::Reference => "reference",
    }
}

impl Sweep {
    /// The exponent by which RMSE falls with time along the packet series, by least squares of the logarithms; `None` where
    /// there are fewer than three points.
    pub fn rate(&self) -> Option<f64> {
        let own = self.points.iter().filter(|point| point.series == "packet" && point.rmse > 0.0);
        let logs: Vec<(f64, f64)> = own.map(|point| (point.seconds.ln(), point.rmse.ln())).collect();
        if logs.len() < 3 {
            return None;
        }
        let mean = |f: fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / logs.len() as f64;
        let (x, y) = (mean(|p| p.0), mean(|p| p.1));
        let up: f64 = logs.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
        Some(up / logs.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>())
    }

    /// Names of the series, in order.
    pub fn series(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for point in &self.points {
            if names.last() != Some(&point.series.as_str()) {
                names.push(&point.series);
            }
        }
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(seconds: f64, rmse: f64) -> Point {
        Point {
            series: "packet".into(),
            engine: Engine::Packet,
            certified: true,
            filter: FilterKind::Box,
            triangles: None,
            spp: 1,
            seconds,
            wall_seconds: seconds,
            rmse,
            rel_mse: rmse * rmse,
            max: rmse,
            front: false,
        }
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let mut points =
            [(2.0, 0.5), (1.0, 1.0), (3.0, 0.7), (4.0, 0.1), (1.0, 2.0), (5.0, f64::NAN)].map(|(s, e)| point(s, e));
        mark_front(&mut points);
        assert_eq!(points.map(|point| point.front), [true, true, false, true, false, false]);
    }

    #[test]
    fn a_sweep_of_a_small_scene_converges_and_can_be_shown() {
        let mut scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/fig5.toml")).unwrap();
        scene.image.iter_mut().for_each(|image| (image.width, image.height) = (24, 18));
        let settings = ParetoSettings { seconds: 0.5, threads: 1 };
        let mut told = 0;
        let found = sweep("<fig5>", &scene, &settings, &mut |_| told += 1).unwrap();
        assert!(told == found.points.len() && found.converged_spp >= 64);
        // The least of every series is always there: no clock decides that.
        for series in
            ["packet", "to a noise level", "single rays", "not certified", "spheres as 968 triangles", "box filter"]
        {
            assert!(found.series().contains(&series), "{:?}", found.series());
        }
        let first = |series: &str| found.points.iter().find(|point| point.series == series).unwrap();
        let (packet, single) = (first("packet"), first("single rays"));
        // Both engines draw the same bits.
        assert_eq!((packet.rmse, packet.max), (single.rmse, single.max));
        assert!(packet.rmse > 0.0 && found.points.iter().any(|point| point.front));
        let page = page(std::slice::from_ref(&found), "a machine");
        assert!(page.contains("&lt;fig5&gt;") && !page.contains("<fig5>") && page.contains("<svg"), "{page}");
        assert!(
            !page.contains("http://") || page.matches("http://").count() == page.matches("http://www.w3.org").count()
        );
        assert_eq!(csv(&[found]).lines().count(), told + 1);
    }
}
