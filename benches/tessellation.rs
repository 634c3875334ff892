//! One sphere as it is, and as about 1,000 and 10,000 triangles: what tessellating costs and what it gets wrong.
//!
//! The claim comes from Kucherov, Morgun and Golenkovskaya, "A visualization of 3D images by back ray tracing: the
//! geometric approach", 2016: an analytic sphere beats one of 1,000 or 10,000 triangles. Each is asked the same 512 x 512
//! camera rays, with the tree and without it (every packet of eight rays against every row). Prints a Markdown table.

use std::time::Instant;

use glam::DVec3;
use octray::lanes::{Float8, LANES, Ray, RayPacket};
use octray::measure::bench::{RaySet, ray_set};
use octray::measure::pareto::faces;
use octray::plan::Kind;
use octray::render::Engine;
use octray::scene::*;
use octray::shapes::{Hidden8, Part, Store, Visit};
use octray::{Batch, Hit, Query};

/// Passes over all rays; the median counts.
const PASSES: usize = 5;
/// Rays that are traced without the tree: every so many packets.
const STRIDE: usize = 16;

fn main() {
    let analytic = scene(vec![Shape::Sphere(Sphere { center: DVec3::ZERO, radius: 1.0 })]);
    let rays = ray_set(&analytic, RaySet::Camera).expect("a camera");
    println!(
        "| sphere as | tree | ns/ray | primitive tests/ray | box tests/ray | columns and tree | \
        wrong pixels of the disk | silhouette off by, largest | normal off by, mean | largest |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let truth = Query::new(&analytic, Engine::Packet, 1).expect("a valid scene").closest(&rays);
    row("itself", &analytic, &rays, &truth);
    for side in [11, 35] {
        let polygon = |corners: [DVec3; 3]| Polygon { corners: corners.into(), ..Polygon::default() };
        let triangles: Vec<Shape> = faces(side).map(|corners| Shape::Polygon(polygon(corners))).collect();
        row(&format!("{} triangles", triangles.len()), &scene(triangles), &rays, &truth);
    }
}

fn scene(shapes: Vec<Shape>) -> Scene {
    let mut scene = Scene::default();
    let model = Model::Diffuse { albedo: Paint::Color(DVec3::splat(0.5)) };
    scene.materials.push(Material { name: "gray".into(), model, back: None, visible: Visible::Both });
    scene.objects = shapes.into_iter().map(|shape| Object { shape, material: 0, name: None, group: None }).collect();
    let lens = Lens::Pinhole { vfov: 32.0 };
    scene.cameras.push(Camera { name: None, eye: DVec3::new(1.0, 2.0, 3.5), target: DVec3::ZERO, up: DVec3::Y, lens });
    scene.image = Some(ImageSettings { width: 512, height: 512, spp: 1, filter: Filter::default() });
    scene
}

/// Two lines of the table: with the tree and without.
fn row(name: &str, scene: &Scene, rays: &[Ray], truth: &[Option<Hit>]) {
    let query = Query::new(scene, Engine::Packet, 1).expect("a valid scene");
    let batch = Batch::new(rays.to_vec());
    let mut found = query.room(&batch);
    let mut counts = query.find_closest(&batch, &mut found); // warms up
    let seconds = median(|| counts = query.find_closest(&batch, &mut found));
    let hits = query.hits(&batch, found);
    let by_ray = |count: u64| count as f64 / rays.len() as f64;
    let tests =
        |counts: &octray::accel::Counts| by_ray(Kind::ALL.iter().map(|kind| counts.kinds[*kind as usize]).sum());
    let tree = query.tracer().expect("the packet engine").tree();
    let bytes = tree.stores().column_bytes() + tree.bytes();
    let errors = Errors::new(rays, &hits, truth);
    line(name, "yes", seconds / rays.len() as f64, tests(&counts), by_ray(counts.boxes), bytes, &errors.cells());

    let kind = Kind::ALL.into_iter().find(|kind| tree.stores().blocks(*kind) > 0).expect("a primitive");
    let packets: Vec<(usize, RayPacket)> =
        rays.chunks(LANES).map(RayPacket::gather).enumerate().step_by(STRIDE).collect();
    let brute = || tree.stores().visit(kind, Brute(&packets));
    // The same answers, up to rays through an edge, which only the tree's leaves settle by the rule for ties; places of
    // hits are from f64, those of the kernel from f32.
    let differ = |a: f32, b: f32| a != b && (a - b).abs() > 1e-5 * b.abs();
    let different =
        brute().into_iter().filter(|(at, t)| (0..LANES).any(|i| differ(t.as_array()[i], place(&hits[at * LANES + i]))));
    assert!(different.count() * 100 <= packets.len(), "{name}");
    let seconds = median(|| drop(std::hint::black_box(brute())));
    let each = seconds / (packets.len() * LANES) as f64;
    let bytes = tree.stores().column_bytes();
    line(name, "no", each, scene.objects.len() as f64, 0.0, bytes, &errors.cells());
}

fn line(name: &str, tree: &str, seconds: f64, tests: f64, boxes: f64, bytes: usize, errors: &str) {
    let kib = bytes as f64 / 1024.0;
    println!("| {name} | {tree} | {:.2} | {tests:.1} | {boxes:.1} | {kib:.1} KiB | {errors} |", seconds * 1e9);
}

/// Packets against every row, with their places among all: where each ray meets the nearest.
struct Brute<'a>(&'a [(usize, RayPacket)]);

impl Visit for Brute<'_> {
    type Output = Vec<(usize, Float8)>;
    #[inline(never)]
    fn visit<P: Part>(self, store: &Store<P>) -> Self::Output {
        let met = self.0.iter().map(|(at, rays)| {
            let mut rays = *rays;
            for row in (0..store.blocks() * LANES).filter(|row| store.part(*row).is_some()) {
                let rows = store.splat(row);
                let anchor = P::anchor(&rows, &rays.origin);
                let hit = P::hit::<false, true>(&rows, &anchor, &rays, &Hidden8::NONE, |_| store.part(row));
                rays.t_max = hit.mask.select(hit.t.fast_min(rays.t_max), rays.t_max);
            }
            (*at, rays.t_max)
        });
        met.collect()
    }
}

fn place(hit: &Option<Hit>) -> f32 {
    hit.map_or(f32::INFINITY, |hit| hit.t)
}

/// How far hits are from the truth, for a unit sphere at the origin.
struct Errors {
    /// Pixels that hit or miss and should not, as a share of those that hit.
    wrong: f64,
    /// Largest distance of such a ray from the silhouette, in radii.
    silhouette: f64,
    /// Degrees.
    normal: (f64, f64),
}

impl Errors {
    fn new(rays: &[Ray], hits: &[Option<Hit>], truth: &[Option<Hit>]) -> Self {
        let (mut wrong, mut silhouette, mut angles) = (0, 0f64, Vec::new());
        for ((ray, hit), right) in rays.iter().zip(hits).zip(truth) {
            match (hit, right) {
                (Some(hit), Some(right)) => angles.push(angle(hit.normal, right.normal)),
                (None, None) => {}
                _ => {
                    wrong += 1;
                    silhouette = silhouette.max((1.0 - distance(ray)).abs());
                }
            }
        }
        let largest = angles.iter().copied().fold(0.0, f64::max);
        let mean = angles.iter().sum::<f64>() / angles.len().max(1) as f64;
        let disk = truth.iter().flatten().count();
        Errors { wrong: wrong as f64 / disk as f64, silhouette, normal: (mean, largest) }
    }

    fn cells(&self) -> String {
        let Errors { wrong, silhouette, normal: (mean, largest) } = self;
        format!("{:.3} % | {silhouette:.2e} radii | {mean:.3}° | {largest:.3}°", 100.0 * wrong)
    }
}

/// Of the line of a ray from the origin.
fn distance(ray: &Ray) -> f64 {
    let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let (origin, dir) = (wide(ray.origin), wide(ray.dir));
    origin.cross(dir).length() / dir.length()
}

/// Degrees between two unit vectors; either side of a surface is as good.
fn angle(a: [f32; 3], b: [f32; 3]) -> f64 {
    let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let (a, b) = (wide(a), wide(b));
    a.cross(b).length().atan2(a.dot(b).abs()).to_degrees()
}

/// Median seconds of some passes.
fn median(mut pass: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..PASSES)
        .map(|_| {
            let start = Instant::now();
            pass();
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[PASSES / 2]
}
