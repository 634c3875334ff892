//! What leaving out work saves: each kind on a scene where it shows, with and without.
//!
//! `cargo bench --bench skips [-- PAIRS]` prints a Markdown table. Both renders of a pair, planning, tree and picture
//! included, run one after the other on one thread; CPU milliseconds, the median of each, and of the pairs' ratios. Before
//! the clock starts both pictures are compared: they must be the same to the bit.

use std::path::Path;
use std::time::Duration;

use glam::DVec3;
use octray::film::Window;
use octray::plan::{Skip, SkipSet};
use octray::scene::*;
use octray::{Renderer, Scene};

/// A kind of work, and a picture that does without.
type Row = (&'static str, &'static str, fn() -> Picture);

/// A row a kind.
const ROWS: &[Row] = &[
    ("kinds", "`fig5.toml`", || picture(file("fig5.toml"))),
    ("tree", "one sphere", || picture(spheres(1, 1.0))),
    ("background", "2,000 spheres in the middle third", || picture(spheres(2_000, 0.3))),
    ("objects", "100,000 spheres, a crop of 64x64 pixels", || cropped(picture(spheres(100_000, 1.0)))),
    ("lights", "100 spheres, 16 spots of which 12 look away", || picture(spots(spheres(100, 1.0)))),
    ("occlusion", "`fig5.toml`", || picture(file("fig5.toml"))),
    ("shadows", "2,000 spheres, 8 lights all around", || picture(lights(spheres(2_000, 1.0)))),
    ("bounces", "`fig5.toml`", || picture(file("fig5.toml"))),
    ("shading", "`fig5.toml`", || picture(file("fig5.toml"))),
    ("layers", "`fig5.toml`", || picture(file("fig5.toml"))),
];

/// What is rendered.
struct Picture {
    scene: Scene,
    crop: Option<Window>,
}

fn main() {
    // cargo adds --bench.
    let arg = std::env::args().skip(1).find(|arg| !arg.starts_with("--"));
    let pairs: usize = arg.map_or(9, |text| text.parse().expect("a number of pairs"));
    println!("| left out | scene | with it, ms | left out, ms | saved |\n|---|---|---|---|---|");
    for (name, what, make) in ROWS {
        let (picture, skip) = (make(), Skip::named(name).expect("a kind of work"));
        let (all, without) = (SkipSet::ALL, SkipSet::ALL.without(skip));
        assert!(picture.render(all).1 == picture.render(without).1, "{name}: other bits");
        let mut times: Vec<[f64; 2]> = Vec::new();
        for _ in 0..pairs {
            times.push([picture.render(without).0, picture.render(all).0]);
        }
        let (with, left) = (median(times.iter().map(|pair| pair[0])), median(times.iter().map(|pair| pair[1])));
        let share = median(times.iter().map(|[with, left]| 1.0 - left / with));
        println!("| {name} | {what} | {with:.1} | {left:.1} | {:.0} % |", 100.0 * share);
    }
}

impl Picture {
    /// CPU milliseconds of this process, and the pixels as bits.
    fn render(&self, skips: SkipSet) -> (f64, Vec<[u32; 4]>) {
        let before = cpu_time();
        let mut renderer = Renderer::new(&self.scene).expect("complete").threads(1).skips(skips);
        if let Some(crop) = self.crop {
            renderer = renderer.crop(crop);
        }
        let rendering = renderer.render(&()).expect("a picture");
        let time = (cpu_time() - before).as_secs_f64() * 1e3;
        (time, rendering.picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect())
    }
}

fn cpu_time() -> Duration {
    let spent = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::new(spent.tv_sec as u64, spent.tv_nsec as u32)
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn file(name: &str) -> Scene {
    Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)).expect("a scene of the project")
}

fn picture(scene: Scene) -> Picture {
    Picture { scene, crop: None }
}

fn cropped(picture: Picture) -> Picture {
    Picture { crop: Some(Window { x0: 224, y0: 224, x1: 288, y1: 288 }), ..picture }
}

/// Spheres in a ball of this share of the picture's height, one point light.
fn spheres(count: u32, share: f64) -> Scene {
    let radius = share * 0.6 / f64::from(count).cbrt();
    let place = |i: u32| {
        // A Fibonacci lattice of directions, at radii that fill the ball evenly.
        let (k, n) = (f64::from(i) + 0.5, f64::from(count));
        let (height, angle) = (1.0 - 2.0 * k / n, 2.399_963_229_728_653 * k);
        let level = (1.0 - height * height).sqrt();
        let at = (f64::from(i.wrapping_mul(0x9e37_79b9)) / 4_294_967_296.0).cbrt() * share;
        DVec3::new(level * angle.cos(), height, level * angle.sin()) * at
    };
    let shape = |i| Shape::Sphere(Sphere { center: if count == 1 { DVec3::ZERO } else { place(i) }, radius });
    let model = Model::Diffuse { albedo: Paint::Color(DVec3::new(0.7, 0.5, 0.3)) };
    let lens = Lens::Pinhole { vfov: 2.0 * 0.28f64.atan().to_degrees() };
    Scene {
        objects: (0..count).map(|i| Object { shape: shape(i), material: 0, name: None, group: None }).collect(),
        materials: vec![Material { name: "clay".into(), model, back: None, visible: Visible::Both }],
        lights: vec![point(DVec3::new(2.0, 3.0, 2.0))],
        cameras: vec![Camera { name: None, eye: DVec3::Z * 4.0, target: DVec3::ZERO, up: DVec3::Y, lens }],
        image: Some(ImageSettings { width: 512, height: 512, spp: 16, filter: Filter::default() }),
        ..Scene::default()
    }
}

fn point(position: DVec3) -> Light {
    let source = Source::Point { position, intensity: DVec3::splat(20.0), falloff: Falloff::InverseSquare };
    Light { name: None, shadows: true, source }
}

/// With eight lights at the corners of a cube.
fn lights(scene: Scene) -> Scene {
    let corner = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * 6.0 - 3.0;
    Scene { lights: (0..8).map(corner).map(point).collect(), ..scene }
}

/// With sixteen spots around, of which every fourth looks at the middle.
fn spots(scene: Scene) -> Scene {
    let spot = |i: u32| {
        let angle = f64::from(i) * std::f64::consts::TAU / 16.0;
        let position = DVec3::new(3.0 * angle.cos(), 2.0, 3.0 * angle.sin());
        let direction = if i.is_multiple_of(4) { -position } else { position };
        let source = Source::Spot { position, direction, intensity: DVec3::splat(20.0), cone: 30.0, penumbra: 5.0 };
        Light { name: None, shadows: true, source }
    };
    Scene { lights: (0..16).map(spot).collect(), ..scene }
}
