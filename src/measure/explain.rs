//! One sample of a pixel, ray by ray: what the engine met, in f32, and what the reference makes of the same ray.

use std::fmt;

use glam::DVec3;
use serde::Serialize;

use super::check::{Cast, Note, Tape, bits, exact, ulps};
use crate::film::Window;
use crate::integrate::RayKind;
use crate::reference::{EventKind, Place, Reference, Verdict, View};
use crate::render::{Frame, RenderError, Renderer};
use crate::scene::{Backdrop, Scene};

/// The rays of one sample, as a tree, and what they add up to.
#[derive(Debug, Clone, Serialize)]
pub struct Explanation {
    /// Version of these names.
    pub schema: u32,
    /// Column and row.
    pub pixel: [i32; 2],
    /// Which of the pixel's samples.
    pub sample: u32,
    /// Red, green, blue, alpha of the whole pixel, by the engine.
    pub engine: [f32; 4],
    /// The same of the reference.
    pub reference: [f64; 4],
    /// What each light, the ambient light and the background give to this sample, by the reference.
    pub shares: Vec<Share>,
    /// Rays that look for what is there, in the order of their paths.
    pub rays: Vec<RayNote>,
}

/// A part of a sample's radiance.
#[derive(Debug, Clone, Serialize)]
pub struct Share {
    /// Whose it is.
    pub of: String,
    /// Red, green, blue.
    pub radiance: [f64; 3],
}

/// One ray.
#[derive(Debug, Clone, Serialize)]
pub struct RayNote {
    /// 1 for the camera ray; of path p the ray mirrored is 2p, the one refracted 2p + 1.
    pub path: u32,
    /// Why it was traced.
    pub kind: &'static str,
    /// Origin, t_min, direction, t_max as the engine traced them, relative to the camera.
    pub ray: [f32; 8],
    /// The same as bits.
    pub bits: [u32; 8],
    /// What the engine met.
    pub met: Option<u32>,
    /// What that is.
    pub what: Option<String>,
    /// Where the engine met it, found again in f64 as for hits that are told; rounded once.
    pub t: Option<f32>,
    /// The same by the f32 kernel alone.
    pub kernel_t: Option<f32>,
    /// What the reference meets along the same ray (a camera ray before it was rounded), and where.
    pub expected: Option<usize>,
    /// Where.
    pub expected_t: Option<f64>,
    /// Difference of both in ulps of f32.
    pub ulps: Option<f64>,
    /// Geometric normal, outward.
    pub normal: Option<[f64; 3]>,
    /// Whether the front was met.
    pub front: Option<bool>,
    /// How far the decision that this primitive is met is from turning, in errors that f32 cannot avoid; below 8 no f32
    /// kernel could tell, and the engine decided in f64.
    pub margin: Option<f64>,
    /// The error of t that f32 cannot avoid.
    pub unit: Option<f64>,
    /// The next primitive on the ray.
    pub runner_up: Option<RunnerUp>,
    /// same, tie, different.
    pub verdict: &'static str,
    /// Lights that were asked for at the hit.
    pub lights: Vec<LightNote>,
}

/// The second best.
#[derive(Debug, Clone, Serialize)]
pub struct RunnerUp {
    /// Its index.
    pub primitive: usize,
    /// What it is.
    pub what: String,
    /// Where.
    pub t: f64,
    /// Distance from the first, in the errors of both.
    pub margin: f64,
}

/// A light at a hit.
#[derive(Debug, Clone, Serialize)]
pub struct LightNote {
    /// Its index.
    pub light: u32,
    /// Whether it shines there.
    pub lit: bool,
    /// The closest thing in its way, by the reference.
    pub blocker: Option<usize>,
    /// How that compares with the engine: same, tie, different.
    pub verdict: &'static str,
}

/// Explains a sample of a pixel, or says how many there are of what there is none.
///
/// # Errors
/// As [`Renderer::new`]; a pixel or sample that does not exist.
pub fn explain(scene: &Scene, (x, y): (i32, i32), sample: u32) -> Result<Explanation, RenderError> {
    let renderer = Renderer::new(scene)?.skip(false);
    let image = renderer.image();
    let (width, height) = (image.width, image.height);
    let window = Window { x0: x, y0: y, x1: x.saturating_add(1), y1: y.saturating_add(1) };
    if !Window::full((width, height)).holds(&window) {
        return Err(RenderError::BadWindow { window, width, height });
    }
    let frame = Frame::prepare(&renderer);
    let mut tape = Tape::of([(x, y)]);
    let (values, _) = frame.trace_block(window, &mut tape);
    let notes: Vec<Note> = tape.take((x, y)).into_iter().filter(|note| note.event.sample == sample).collect();
    let reference = Reference::relative_to(scene, frame.origin());
    let view = reference.view(renderer.view(), image, &scene.render);
    let teller = Teller { scene, frame: &frame, reference: &reference, view: &view, pixel: (x, y), sample };
    Ok(Explanation {
        schema: 1,
        pixel: [x, y],
        sample,
        engine: values[0],
        reference: reference.pixel(&view, x, y).rgba,
        shares: teller.shares(&renderer, frame.origin()),
        rays: teller.rays(&notes),
    })
}

struct Teller<'a> {
    scene: &'a Scene,
    frame: &'a Frame<'a>,
    reference: &'a Reference,
    view: &'a View,
    pixel: (i32, i32),
    sample: u32,
}

impl Teller<'_> {
    fn rays(&self, notes: &[Note]) -> Vec<RayNote> {
        let casts = notes.iter().filter_map(|note| Some((note.event.path, note.cast.as_ref()?)));
        let seeing = casts.filter(|(_, cast)| cast.kind != RayKind::Shadow);
        let mut rays: Vec<RayNote> = seeing.map(|(path, cast)| self.ray(path, cast, notes)).collect();
        rays.sort_by_key(|ray| ray.path);
        rays
    }

    fn ray(&self, path: u32, cast: &Cast, notes: &[Note]) -> RayNote {
        let ray = match cast.kind {
            RayKind::Camera => self.view.sample(self.pixel.0, self.pixel.1, self.sample),
            _ => exact(&cast.ray),
        };
        let hit = self.reference.closest(&ray);
        let places = self.reference.places(&ray);
        let of = |primitive: usize| places.iter().find(|place| place.primitive == primitive);
        let first = cast.met.and_then(|met| of(met as usize));
        let second = places.iter().find(|place| place.hit && Some(place.primitive as u32) != cast.met);
        let ([a, b, c], [i, j, k]) = (cast.ray.origin, cast.ray.dir);
        let again = |met| self.frame.found_again(met, (ray.origin, ray.dir), f64::from(cast.t));
        let t = cast.met.map(|met| again(met).map_or(cast.t, |t| t as f32));
        let ulps = hit.filter(|hit| Some(hit.primitive as u32) == cast.met).zip(t).map(|(hit, t)| ulps(t, hit.t));
        RayNote {
            path,
            kind: cast.kind.name(),
            ray: [a, b, c, cast.ray.t_min, i, j, k, cast.ray.t_max],
            bits: bits(&cast.ray),
            met: cast.met,
            what: cast.met.map(|met| self.what(met as usize)),
            t,
            kernel_t: cast.met.map(|_| cast.t),
            expected: hit.map(|hit| hit.primitive),
            expected_t: hit.map(|hit| hit.t),
            ulps,
            normal: hit.map(|hit| hit.normal.to_array()),
            front: hit.map(|hit| hit.front),
            margin: first.map(|place| place.margin),
            unit: first.map(|place| place.unit),
            runner_up: second.map(|second| self.runner_up(first, second)),
            verdict: word(self.reference.verdict_exact(&ray, cast.met.map(|met| met as usize))),
            lights: notes.iter().filter(|note| note.event.path == path).filter_map(|note| self.light(note)).collect(),
        }
    }

    fn runner_up(&self, first: Option<&Place>, second: &Place) -> RunnerUp {
        let apart = first.map_or(f64::INFINITY, |first| (second.t - first.t) / (first.unit + second.unit));
        RunnerUp { primitive: second.primitive, what: self.what(second.primitive), t: second.t, margin: apart }
    }

    fn light(&self, note: &Note) -> Option<LightNote> {
        let EventKind::Light(light) = note.event.kind else { return None };
        let lit = note.event.outcome != 0;
        let Some(cast) = &note.cast else { return Some(LightNote { light, lit, blocker: None, verdict: "same" }) };
        let ray = exact(&cast.ray);
        let blocker = self.reference.places(&ray).into_iter().find(|place| place.hit).map(|place| place.primitive);
        Some(LightNote { light, lit, blocker, verdict: word(self.reference.verdict_occluded_exact(&ray, !lit)) })
    }

    /// A primitive in words: its kind, its name or number, its material.
    fn what(&self, index: usize) -> String {
        let Some(primitive) = self.scene.primitives().nth(index) else { return String::new() };
        let name = self.scene.objects.get(index).and_then(|object| object.name.as_deref());
        let material = self.scene.materials.get(primitive.material).map_or("", |material| &material.name);
        let kind = primitive.shape.kind();
        name.map_or(format!("{kind}, {material}"), |name| format!("{kind} \"{name}\", {material}"))
    }

    /// Radiance adds up over lights: each is asked alone.
    fn shares(&self, renderer: &Renderer, origin: DVec3) -> Vec<Share> {
        let mut dark = self.scene.clone();
        dark.lights.clear();
        dark.ambient = DVec3::ZERO;
        dark.background.backdrop = Backdrop::Color(DVec3::ZERO);
        let share = |of: String, scene: &Scene| {
            let reference = Reference::relative_to(scene, origin);
            let view = reference.view(renderer.view(), renderer.image(), &scene.render);
            let pixel = reference.pixel(&view, self.pixel.0, self.pixel.1);
            let sample = pixel.samples.get(self.sample as usize);
            Share { of, radiance: sample.map_or([0.0; 3], |sample| sample.radiance.to_array()) }
        };
        let mut shares: Vec<Share> = (0..self.scene.lights.len())
            .map(|i| {
                let light = &self.scene.lights[i];
                let name = light.name.as_ref().map_or(format!("light {i}"), |name| format!("light {i} \"{name}\""));
                share(name, &Scene { lights: vec![light.clone()], ..dark.clone() })
            })
            .collect();
        shares.push(share("ambient".into(), &Scene { ambient: self.scene.ambient, ..dark.clone() }));
        shares.push(share("background".into(), &Scene { background: self.scene.background.clone(), ..dark.clone() }));
        shares
    }
}

fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Same => "same",
        Verdict::Tie => "tie",
        Verdict::Different { .. } => "different",
    }
}

/// For people, a ray a paragraph, indented by depth.
impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y] = self.pixel;
        writeln!(f, "pixel {x},{y}, sample {}", self.sample)?;
        for ray in &self.rays {
            ray.write(f)?;
        }
        writeln!(f, "radiance of this sample by where it comes from")?;
        for Share { of, radiance: [r, g, b] } in &self.shares {
            writeln!(f, "  {of:<24} {r:>12.6} {g:>12.6} {b:>12.6}")?;
        }
        let ([r, g, b, a], [s, t, u, v]) = (self.engine, self.reference);
        writeln!(f, "the whole pixel\n  {:<24} {r:>12.6} {g:>12.6} {b:>12.6}  alpha {a}", "engine, f32")?;
        write!(f, "  {:<24} {s:>12.6} {t:>12.6} {u:>12.6}  alpha {v}", "reference, f64")
    }
}

impl RayNote {
    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let depth = (u32::BITS - self.path.leading_zeros()) as usize;
        let pad = "  ".repeat(depth.saturating_sub(1));
        let [x, y, z, _, a, b, c, _] = self.ray;
        writeln!(f, "{pad}{} ray (path {}) from ({x}, {y}, {z}) toward ({a}, {b}, {c})", self.kind, self.path)?;
        match (self.met, self.t, self.kernel_t) {
            (Some(met), Some(t), Some(kernel)) => {
                let what = self.what.as_deref().unwrap_or_default();
                writeln!(f, "{pad}  met primitive {met} ({what}) at t = {t} (f32 kernel: {kernel})")?;
            }
            _ => writeln!(f, "{pad}  met nothing")?,
        }
        match (self.expected, self.expected_t) {
            (Some(primitive), Some(t)) => {
                let ulps = self.ulps.map_or(String::new(), |ulps| format!(", {ulps:+.2} ulp apart"));
                writeln!(f, "{pad}  f64: primitive {primitive} at t = {t:.17}{ulps}; {}", self.verdict)?;
            }
            _ => writeln!(f, "{pad}  f64: nothing; {}", self.verdict)?,
        }
        if let (Some(margin), Some(unit), Some([i, j, k])) = (self.margin, self.unit, self.normal) {
            let side = if self.front == Some(true) { "front" } else { "back" };
            let near = if margin.abs() < 8.0 { " (decided in f64)" } else { "" };
            writeln!(
                f,
                "{pad}  {side}, normal ({i:.6}, {j:.6}, {k:.6}); margin {margin:.3e}{near}, unit of t {unit:.2e}"
            )?;
        }
        if let Some(RunnerUp { primitive, what, t, margin }) = &self.runner_up {
            writeln!(f, "{pad}  runner-up: primitive {primitive} ({what}) at t = {t:.9}, {margin:.3e} errors further")?;
        }
        for LightNote { light, lit, blocker, verdict } in &self.lights {
            let how = match (lit, blocker) {
                (true, _) => "shines on it".to_string(),
                (false, Some(primitive)) => format!("is hidden by primitive {primitive}"),
                (false, None) => "is hidden".to_string(),
            };
            writeln!(f, "{pad}  light {light} {how}; {verdict}")?;
        }
        Ok(())
    }
}
