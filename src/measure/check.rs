//! The packet engine against the reference: ray by ray, and picture by picture.
//!
//! Ray by ray, the rays that the engine traced are replayed in the reference as the exact numbers that
//! their bits are, but camera rays from the f64 that they were rounded from; a different answer is wrong unless
//! f64 could not have told (see [`Verdict`]). Picture by picture, the reference renders from its own
//! f64 rays with the same samples; pixels whose rays, shadow rays and texture cells all agree must have
//! the same colour up to rounding, and the others must be few. Behind mirrors and glass every bounce
//! multiplies rounding, so there the means must agree and few pixels may differ visibly.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::layers::{self, Eyes, LayerReport, Layers, PixelDifference};
use crate::film::Window;
use crate::integrate::{RayCounts, RayKind, Record};
use crate::lanes::Ray;
use crate::reference::{self, Event, EventKind, Reference, Verdict, View};
use crate::render::{Frame, RenderError, Renderer};
use crate::sample;
use crate::scene::Scene;
use crate::tracer::Tracer;

/// Bound on the relative RMSE of pixels whose rays agree, where nothing mirrors or refracts.
pub const MAX_REL_RMSE: f64 = 1e-5;
/// Bound on the share of pixels whose rays do not agree, where nothing mirrors or refracts; one pixel may always be such, as
/// of fewer than 10,000 that is more.
pub const MAX_EXCLUDED: f64 = 1e-4;
/// Bound on the relative difference of the means, where something does.
pub const MAX_MEAN_DIFFERENCE: f64 = 1e-4;
/// Pixels further off than this count as visibly different, where something does.
pub const VISIBLE: f64 = 1e-3;
/// Bound on their share.
pub const MAX_VISIBLE: f64 = 1e-2;

/// How much is checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckSettings {
    /// Samples per pixel. With 1 every pixel stands for one tree of rays, and its verdict is theirs.
    pub spp: u32,
    /// Seconds that the reference may take; where that is too short for all pixels, a seeded subset is drawn.
    pub seconds: f64,
    /// Chooses the subset.
    pub seed: u64,
    /// Differences to list, at most.
    pub listed: usize,
    /// Whether to keep what makes up [`Layers`].
    pub layers: bool,
    /// Whether the engine decides in f64 what f32 leaves open, as it should; for measuring what that is good for.
    pub certify: bool,
}

impl Default for CheckSettings {
    fn default() -> Self {
        CheckSettings { spp: 1, seconds: 60.0, seed: 0, listed: 10, layers: false, certify: true }
    }
}

/// What came of a check.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Version of these names.
    pub schema: u32,
    /// Whether all bounds hold.
    pub pass: bool,
    /// Why not, a sentence each.
    pub failures: Vec<String>,
    /// Replayed rays by kind.
    pub rays: RayReports,
    /// The two pictures.
    pub picture: PictureReport,
    /// Wrong answers, the first few.
    pub differences: Vec<Difference>,
    /// Ties, the first few.
    pub ties: Vec<Difference>,
    /// Percentiles of the layers, where they were asked for.
    pub layers: Option<LayerReport>,
    /// Wall time.
    pub seconds: f64,
}

/// Replayed rays by kind.
#[derive(Debug, Clone, Copy, Default, Serialize)]
#[allow(missing_docs)] // the kinds say it
pub struct RayReports {
    pub camera: RayReport,
    pub shadow: RayReport,
    pub reflection: RayReport,
    pub refraction: RayReport,
    pub bounce: RayReport,
}

/// Replayed rays of one kind.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct RayReport {
    /// Rays replayed.
    pub replayed: u64,
    /// Wrong answers.
    pub different: u64,
    /// Other answers that f64 cannot tell apart from the right one.
    pub ties: u64,
    /// Pairs that the engine decided again in f64, of all rays of the blocks that hold the pixels.
    pub redecided: u64,
}

/// The two pictures.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct PictureReport {
    /// Pixels of the picture.
    pub of: u64,
    /// Pixels compared.
    pub pixels: u64,
    /// Pixels whose rays, shadow rays or texture cells do not agree.
    pub excluded: u64,
    /// RMSE over the mean of the reference, over the other pixels.
    pub rel_rmse: f64,
    /// Difference of the means of all compared pixels over that of the reference.
    pub mean_difference: f64,
    /// Pixels off by more than [`VISIBLE`].
    pub visible: u64,
    /// Whether anything in use mirrors or refracts, which decides the bounds in force.
    pub scatters: bool,
}

/// A ray that the two tracers do not agree on.
#[derive(Debug, Clone, Serialize)]
pub struct Difference {
    /// Why it was traced.
    pub kind: &'static str,
    /// Pixel and sample.
    pub at: (i32, i32, u32),
    /// Origin, t_min, direction, t_max as bits of f32.
    pub bits: [u32; 8],
    /// What the engine met; for shadow rays 0 stands for something.
    pub got: Option<u32>,
    /// What the reference met.
    pub expected: Option<usize>,
    /// Where the engine met it.
    pub t: f32,
    /// Where the reference met it.
    pub expected_t: Option<f64>,
}

/// Checks a scene.
///
/// # Errors
/// As [`Renderer::new`].
pub fn check(scene: &Scene, settings: &CheckSettings) -> Result<Report, RenderError> {
    check_layers(scene, settings).map(|(report, _)| report)
}

/// Checks a scene and keeps the pictures; without `settings.layers` they are empty.
///
/// # Errors
/// As [`check`].
pub fn check_layers(scene: &Scene, settings: &CheckSettings) -> Result<(Report, Layers), RenderError> {
    let start = Instant::now();
    let renderer = Renderer::new(scene)?.spp(settings.spp).skip(false).certify(settings.certify);
    let frame = Frame::prepare(&renderer);
    let reference = Reference::relative_to(scene, frame.origin());
    let image = renderer.image();
    let view = reference.view(renderer.view(), image, &scene.render);
    let tracer = Tracer::relative_to(scene, frame.origin())?;
    let eyes = settings.layers.then_some(Eyes { tracer: &tracer, reference: &reference });
    let judge = Judge { frame: &frame, reference: &reference, view: &view, eyes };
    let window = Window::full((image.width, image.height));
    let pixels = judge.choose(window, settings);
    let tallies = pixels.par_iter().map(|(block, pixels)| judge.block(*block, pixels, settings.listed));
    let tally = tallies.reduce(Tally::default, |a, b| a.with(b, settings.listed));
    let pictures = layers::pictures(&tally.seen, (image.width, image.height));
    let report = tally.report(window.area() as u64, frame.scatters(), settings.layers, start.elapsed());
    Ok((report, pictures))
}

struct Judge<'a, 's> {
    frame: &'a Frame<'s>,
    reference: &'a Reference,
    view: &'a View,
    /// Where layers are wanted.
    eyes: Option<Eyes<'a, 's>>,
}

/// Pixels to look at, by block.
type Chosen = Vec<(Window, Vec<(i32, i32)>)>;

impl Judge<'_, '_> {
    /// All pixels, or as many in a seeded order as the time allows, judged by the first ones.
    fn choose(&self, window: Window, settings: &CheckSettings) -> Chosen {
        let blocks = self.frame.blocks(window);
        let mut order: Vec<(u32, (i32, i32))> = (0..window.area())
            .map(|index| window.pixel(index))
            .map(|(x, y)| (sample::pixel_key(settings.seed, x, y), (x, y)))
            .collect();
        order.sort_unstable();
        let trial = Instant::now();
        let mut tried = 0;
        while tried < order.len() && (tried < 4 || trial.elapsed() < Duration::from_millis(300)) {
            let (x, y) = order[tried].1;
            self.block(Window { x0: x, y0: y, x1: x + 1, y1: y + 1 }, &[(x, y)], 0);
            tried += 1;
        }
        let each = trial.elapsed().as_secs_f64() / tried as f64;
        // The first pixels were tried one by one; side by side they are slower, so not all of the time is planned for.
        let affordable = 0.6 * settings.seconds * rayon::current_num_threads() as f64 / each;
        order.truncate((affordable as usize).max(16));
        let mut chosen: HashMap<(i32, i32), Vec<(i32, i32)>> = HashMap::new();
        let corner = |x: i32, y: i32| {
            let holds = |block: &&Window| block.index(x, y).is_some();
            blocks.iter().find(holds).map(|block| (block.x0, block.y0))
        };
        let mut corners: HashMap<(i32, i32), (i32, i32)> = HashMap::new();
        for (_, (x, y)) in order {
            let cell = (x.div_euclid(32), y.div_euclid(32));
            let at = *corners.entry(cell).or_insert_with(|| corner(x, y).unwrap_or((x, y)));
            chosen.entry(at).or_default().push((x, y));
        }
        let of = |block: Window| chosen.remove(&(block.x0, block.y0)).map(|pixels| (block, pixels));
        blocks.into_iter().filter_map(of).collect()
    }

    /// Traces a block with the engine and judges some of its pixels.
    fn block(&self, block: Window, pixels: &[(i32, i32)], listed: usize) -> Tally {
        let mut tape = Tape { wanted: pixels.iter().map(|pixel| (*pixel, Vec::new())).collect(), slots: Vec::new() };
        let (values, counts) = self.frame.trace_block(block, &mut tape);
        let mut tally = Tally { counts, ..Tally::default() };
        for (&(x, y), notes) in &tape.wanted {
            self.replay(notes, (x, y), listed, &mut tally);
            let value = block.index(x, y).map_or([0.0; 4], |index| values[index]);
            self.compare(notes, (x, y), value, &mut tally);
        }
        tally
    }

    fn replay(&self, notes: &[Note], (x, y): (i32, i32), listed: usize, tally: &mut Tally) {
        for note in notes {
            let Some(cast) = &note.cast else { continue };
            let ray = exact(&cast.ray);
            let verdict = self.verdict(cast, &ray, (x, y, note.event.sample));
            let report = tally.rays.of(cast.kind);
            report.replayed += 1;
            match verdict {
                Verdict::Same => {}
                Verdict::Tie => {
                    report.ties += 1;
                    if tally.ties.len() < listed {
                        tally.ties.push(difference(cast, (x, y, note.event.sample), None, None));
                    }
                }
                Verdict::Different { expected, expected_t } => {
                    report.different += 1;
                    if tally.differences.len() < listed {
                        let at = (x, y, note.event.sample);
                        tally.differences.push(difference(cast, at, expected, expected_t));
                    }
                }
            }
        }
    }

    /// Camera rays are judged by the reference's own, which f32 rounds; all others are the numbers of their bits. Where
    /// the primitive is right, `t` must be what f32 can do.
    fn verdict(&self, cast: &Cast, ray: &reference::Ray, (x, y, sample): (i32, i32, u32)) -> Verdict {
        let met = cast.met.map(|primitive| primitive as usize);
        let exact = match cast.kind {
            RayKind::Shadow => return self.reference.verdict_occluded_exact(ray, met.is_some()),
            RayKind::Camera => self.reference.verdict_exact(&self.view.sample(x, y, sample), met),
            RayKind::Reflection | RayKind::Refraction | RayKind::Bounce => self.reference.verdict_exact(ray, met),
        };
        match (exact, self.reference.verdict(ray, met, met.map(|_| cast.t))) {
            (Verdict::Same, Verdict::Different { expected, expected_t }) => Verdict::Different { expected, expected_t },
            _ => exact,
        }
    }

    fn compare(&self, notes: &[Note], (x, y): (i32, i32), got: [f32; 4], tally: &mut Tally) {
        let want = self.reference.pixel(self.view, x, y);
        let mut mine: Vec<Event> = notes.iter().map(|note| note.event).filter(says_something).collect();
        let mut theirs: Vec<Event> = want.events.into_iter().filter(says_something).collect();
        mine.sort_unstable();
        theirs.sort_unstable();
        if let Some(eyes) = &self.eyes {
            let first = |note: &&Note| note.event.sample == 0 && note.event.kind == EventKind::Camera;
            let cast = notes.iter().find(first).and_then(|note| note.cast.as_ref());
            tally.seen.push(eyes.see((x, y), (got, want.rgba), cast, &self.view.sample(x, y, 0)));
        }
        let color = |rgba: [f64; 4]| DVec3::new(rgba[0], rgba[1], rgba[2]);
        let (got, want) = (color(got.map(f64::from)), color(want.rgba));
        let difference = got - want;
        tally.pixels += 1;
        tally.sums += DVec3::new(got.element_sum(), want.element_sum(), 0.0);
        tally.visible += u64::from(difference.abs().max_element() > VISIBLE);
        if mine == theirs {
            tally.squares += difference.length_squared();
        } else {
            tally.excluded += 1;
        }
    }
}

/// A light that does not shine on a place is the same as one that nobody asked.
fn says_something(event: &Event) -> bool {
    !(matches!(event.kind, EventKind::Light(_)) && event.outcome == 0)
}

pub(super) fn exact(ray: &Ray) -> reference::Ray {
    let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
    reference::Ray { origin: wide(ray.origin), dir: wide(ray.dir), t_min, t_max }
}

fn difference(cast: &Cast, at: (i32, i32, u32), expected: Option<usize>, expected_t: Option<f64>) -> Difference {
    let (kind, bits, got, t) = (cast.kind.name(), bits(&cast.ray), cast.met, cast.t);
    Difference { kind, at, bits, got, expected, t, expected_t }
}

/// The difference of a `t` from the exact one, in ulps of f32.
pub(super) fn ulps(t: f32, exact: f64) -> f64 {
    let near = (exact as f32).abs();
    (f64::from(t) - exact) / (f64::from(near.next_up()) - f64::from(near))
}

pub(super) fn bits(ray: &Ray) -> [u32; 8] {
    let ([x, y, z], [a, b, c]) = (ray.origin, ray.dir);
    [x, y, z, ray.t_min, a, b, c, ray.t_max].map(f32::to_bits)
}

/// What the engine did for some pixels.
pub(super) struct Tape {
    wanted: HashMap<(i32, i32), Vec<Note>>,
    /// By slot of the tile in hand.
    slots: Vec<(i32, i32, u32)>,
}

/// One decision of the engine, and the ray behind it.
pub(super) struct Note {
    pub event: Event,
    pub cast: Option<Cast>,
}

pub(super) struct Cast {
    pub kind: RayKind,
    pub ray: Ray,
    pub met: Option<u32>,
    pub t: f32,
}

impl Tape {
    /// For what is done for some pixels.
    pub fn of(pixels: impl IntoIterator<Item = (i32, i32)>) -> Self {
        Tape { wanted: pixels.into_iter().map(|pixel| (pixel, Vec::new())).collect(), slots: Default::default() }
    }

    /// What was done for one of them.
    pub fn take(&mut self, pixel: (i32, i32)) -> Vec<Note> {
        self.wanted.remove(&pixel).unwrap_or_default()
    }

    fn note(&mut self, slot: usize, path: u32, kind: EventKind, outcome: i64, cast: Option<Cast>) {
        let Some(&(x, y, sample)) = self.slots.get(slot) else { return };
        if let Some(notes) = self.wanted.get_mut(&(x, y)) {
            notes.push(Note { event: Event { sample, path, kind, outcome }, cast });
        }
    }
}

impl Record for Tape {
    const ON: bool = true;

    fn tile(&mut self, first: usize, samples: &mut dyn Iterator<Item = (i32, i32, u32)>) {
        self.slots.truncate(first);
        self.slots.extend(samples);
    }

    fn ray(&mut self, kind: RayKind, ray: Ray, met: Option<u32>, t: f32, slot: usize, path: u32) {
        let event = match kind {
            RayKind::Camera | RayKind::Shadow => EventKind::Camera,
            RayKind::Reflection => EventKind::Reflection,
            RayKind::Refraction => EventKind::Refraction,
            RayKind::Bounce => EventKind::Bounce,
        };
        self.note(slot, path, event, met.map_or(-1, i64::from), Some(Cast { kind, ray, met, t }));
    }

    fn shadow(&mut self, light: usize, ray: Ray, dark: bool, slot: usize, path: u32) {
        let cast = Cast { kind: RayKind::Shadow, ray, met: dark.then_some(0), t: ray.t_max };
        self.note(slot, path, EventKind::Light(light as u32), i64::from(!dark), Some(cast));
    }

    fn lit(&mut self, light: usize, slot: usize, path: u32) {
        self.note(slot, path, EventKind::Light(light as u32), 1, None);
    }

    fn seen(&mut self, light: usize, slot: usize, path: u32) {
        self.note(slot, path, EventKind::Light(light as u32), 2, None);
    }

    fn texture(&mut self, texture: usize, cell: i64, slot: usize, path: u32) {
        self.note(slot, path, EventKind::Texture(texture as u32), cell, None);
    }
}

/// Sums over pixels.
#[derive(Default)]
struct Tally {
    rays: RayReports,
    counts: RayCounts,
    pixels: u64,
    excluded: u64,
    visible: u64,
    squares: f64,
    /// Engine, reference.
    sums: DVec3,
    differences: Vec<Difference>,
    ties: Vec<Difference>,
    seen: Vec<PixelDifference>,
}

impl RayReports {
    fn of(&mut self, kind: RayKind) -> &mut RayReport {
        match kind {
            RayKind::Camera => &mut self.camera,
            RayKind::Shadow => &mut self.shadow,
            RayKind::Reflection => &mut self.reflection,
            RayKind::Refraction => &mut self.refraction,
            RayKind::Bounce => &mut self.bounce,
        }
    }

    /// All kinds by name.
    pub fn by_kind(&self) -> [(&'static str, RayReport); 5] {
        let mut all = *self;
        RayKind::ALL.map(|kind| (kind.name(), *all.of(kind)))
    }
}

impl Tally {
    fn with(mut self, mut other: Tally, listed: usize) -> Tally {
        for kind in RayKind::ALL {
            let (sum, part) = (self.rays.of(kind), *other.rays.of(kind));
            sum.replayed += part.replayed;
            sum.different += part.different;
            sum.ties += part.ties;
        }
        self.counts.add(&other.counts);
        self.pixels += other.pixels;
        self.excluded += other.excluded;
        self.visible += other.visible;
        self.squares += other.squares;
        self.sums += other.sums;
        self.differences.append(&mut other.differences);
        self.differences.truncate(listed);
        self.ties.append(&mut other.ties);
        self.ties.truncate(listed);
        self.seen.append(&mut other.seen);
        self
    }

    fn report(mut self, of: u64, scatters: bool, layers: bool, time: Duration) -> Report {
        for kind in RayKind::ALL {
            self.rays.of(kind).redecided = self.counts.redecided[kind as usize];
        }
        let [got, want] = [self.sums.x, self.sums.y];
        let over = |x: f64, y: f64| if x == 0.0 { 0.0 } else { x / y };
        let kept = (self.pixels - self.excluded) as f64;
        let mean = want / (3.0 * self.pixels as f64);
        let picture = PictureReport {
            of,
            pixels: self.pixels,
            excluded: self.excluded,
            rel_rmse: over((self.squares / (3.0 * kept.max(1.0))).sqrt(), mean),
            mean_difference: over((got - want).abs(), want),
            visible: self.visible,
            scatters,
        };
        let failures = failures(&self.rays, &picture);
        let (rays, differences, ties) = (self.rays, self.differences, self.ties);
        let layers = layers.then(|| layers::figures(&self.seen));
        let (pass, seconds) = (failures.is_empty(), time.as_secs_f64());
        Report { schema: 1, pass, failures, rays, picture, differences, ties, layers, seconds }
    }
}

fn failures(rays: &RayReports, picture: &PictureReport) -> Vec<String> {
    let mut failures = Vec::new();
    for (kind, report) in rays.by_kind() {
        if report.different > 0 {
            failures.push(format!("{} of {} {kind} rays met something else", report.different, report.replayed));
        }
    }
    let share = |count: u64| count as f64 / picture.pixels.max(1) as f64;
    let mut bound = |what: &str, value: f64, most: f64| {
        // A NaN is past every bound.
        if value.is_nan() || value > most {
            failures.push(format!("{what} is {value:.3e}, past the bound of {most:.0e}"));
        }
    };
    if picture.scatters {
        bound("the difference of the means", picture.mean_difference, MAX_MEAN_DIFFERENCE);
        bound("the share of pixels off by more than 1e-3", share(picture.visible), MAX_VISIBLE);
    } else {
        bound("the relative RMSE", picture.rel_rmse, MAX_REL_RMSE);
        let beyond_one = if picture.excluded > 1 { share(picture.excluded) } else { 0.0 };
        bound("the share of pixels whose rays do not agree", beyond_one, MAX_EXCLUDED);
    }
    failures
}

/// A table for people.
impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "{:<11} {:>10} {:>10} {:>8} {:>11}", "rays", "replayed", "different", "ties", "redecided")?;
        for (kind, ray) in self.rays.by_kind() {
            if ray.replayed > 0 {
                let RayReport { replayed, different, ties, redecided } = ray;
                writeln!(f, "{kind:<11} {replayed:>10} {different:>10} {ties:>8} {redecided:>11}")?;
            }
        }
        let picture = &self.picture;
        writeln!(f, "picture: {} of {} pixels compared, {} set aside", picture.pixels, picture.of, picture.excluded)?;
        writeln!(f, "  relative RMSE of the others {:.2e}", picture.rel_rmse)?;
        writeln!(f, "  relative difference of the means {:.2e}", picture.mean_difference)?;
        writeln!(f, "  pixels off by more than {VISIBLE:.0e}: {}", picture.visible)?;
        if let Some(layers) = &self.layers {
            writeln!(f, "{layers}")?;
        }
        for difference in &self.differences {
            let Difference { kind, at, bits, got, expected, t, expected_t } = difference;
            writeln!(
                f,
                "  {kind} ray at {at:?}: met {got:?} at {t}, expected {expected:?} at {expected_t:?}; {bits:08x?}"
            )?;
        }
        match self.pass {
            true => write!(f, "pass in {:.1} s", self.seconds),
            false => write!(f, "FAIL in {:.1} s: {}", self.seconds, self.failures.join("; ")),
        }
    }
}
