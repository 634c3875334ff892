//! How the cost grows with the work: time and tests against the number of spheres (1e2 to 1e7), time against pixels.
//!
//! `cargo bench --bench scaling [-- MOST_SPHERES [FOLDER]]` prints two Markdown tables with the slopes (1: twice the work,
//! twice the time) and writes them as plots, SVG, to FOLDER (target/scaling). The spheres of every scene cover the same
//! share of the picture: their radii shrink as their number grows.

use std::path::PathBuf;
use std::time::Instant;

use glam::DVec3;
use octray::measure::bench::{BenchSettings, Question, RaySet, Supply, Throughput, bench};
use octray::measure::plot::{Chart, Series};
use octray::scene::*;
use octray::{Renderer, Tracer};

/// Rays of a kind: the name in the table, and which figure it is.
const KINDS: [(&str, RaySet, Question); 3] = [
    ("camera", RaySet::Camera, Question::Closest),
    ("shadow", RaySet::Shadow, Question::Any),
    ("bounce", RaySet::Bounce, Question::Closest),
];

fn main() {
    // cargo adds --bench.
    let mut args = std::env::args().skip(1).filter(|arg| !arg.starts_with("--"));
    let most: f64 = args.next().map_or(1e7, |text| text.parse().expect("a number of spheres"));
    let folder = args.next().map_or_else(|| PathBuf::from("target/scaling"), PathBuf::from);
    std::fs::create_dir_all(&folder).expect("a folder to write to");
    let write = |name: &str, svg: String| std::fs::write(folder.join(name), svg).expect("a file to write");
    write("spheres.svg", by_spheres(most).svg());
    write("pixels.svg", by_pixels().svg());
    println!("\nplots: {}", folder.display());
}

fn by_spheres(most: f64) -> Chart {
    let counts = (4..).map(|step| 10f64.powf(f64::from(step) / 2.0)).take_while(|count| *count <= most * 1.01);
    print!("| spheres | build ns/sphere | tree and columns bytes/sphere |");
    KINDS.iter().for_each(|(name, ..)| print!(" {name} ns/ray | tests/ray |"));
    println!("\n|---|---|---|{}", "---|---|".repeat(KINDS.len()));
    let mut lines: Vec<Vec<(f64, f64)>> = vec![Vec::new(); 1 + 2 * KINDS.len()];
    for count in counts {
        let count = count.round();
        let scene = spheres(count as usize, 256);
        let start = Instant::now();
        let tracer = Tracer::new(&scene).expect("a valid scene");
        let build = start.elapsed().as_secs_f64();
        let bytes = tracer.tree().stores().column_bytes() + tracer.tree().bytes();
        drop(tracer);
        let settings = BenchSettings { sets: RaySet::ALL.to_vec(), threads: 1, repeats: 5, resolution: None };
        let figures = bench(&scene, &settings, &mut |_| ()).expect("something to meet");
        let (each, size) = (build * 1e9 / count, bytes as f64 / count);
        print!("| {count:.0} | {each:.0} | {size:.0} |");
        lines[0].push((count, each));
        for (k, (_, set, question)) in KINDS.iter().enumerate() {
            let is = |f: &&Throughput| (f.set, f.question, f.supply) == (*set, *question, Supply::Stored);
            let figure = figures.iter().find(is).expect("was measured");
            let cost = 1e3 / figure.mrays_per_cpu_s.unwrap_or(figure.mrays_per_s);
            let tests = (figure.tests.boxes + figure.tests.kinds.iter().sum::<u64>()) as f64 / figure.rays as f64;
            print!(" {cost:.1} | {tests:.1} |");
            lines[1 + 2 * k].push((count, cost));
            lines[2 + 2 * k].push((count, tests));
        }
        println!();
    }
    let kinds = KINDS.iter().flat_map(|(name, ..)| [(*name).to_owned(), format!("{name}, tests")]);
    let names = std::iter::once("build, a sphere".to_owned()).chain(kinds);
    chart("Time and tests against spheres", "spheres", "ns per sphere or ray, tests per ray", names.zip(lines))
}

fn by_pixels() -> Chart {
    println!("\n| pixels | 1,000 spheres, s | 100,000 spheres, s |");
    println!("|---|---|---|");
    let scenes = [spheres(1_000, 256), spheres(100_000, 256)];
    let mut lines = vec![Vec::new(); 2];
    for side in [128, 256, 512, 1024, 2048] {
        let seconds = |scene: &Scene| {
            let renderer = Renderer::new(scene).expect("a camera").resolution(side, side).spp(1).threads(1);
            let times = (0..5).map(|_| renderer.render(&()).expect("a picture").stats.trace_seconds);
            times.fold(f64::INFINITY, f64::min)
        };
        let pixels = f64::from(side * side);
        let times = [seconds(&scenes[0]), seconds(&scenes[1])];
        times.iter().zip(&mut lines).for_each(|(time, line)| line.push((pixels, *time)));
        println!("| {pixels:.0} | {:.4} | {:.4} |", times[0], times[1]);
    }
    let names = ["1,000 spheres", "100,000 spheres"].into_iter().map(str::to_owned);
    chart("Time against pixels (tracing, 1 spp, 1 thread)", "pixels", "seconds", names.zip(lines))
}

fn chart(title: &str, x: &str, y: &str, lines: impl Iterator<Item = (String, Vec<(f64, f64)>)>) -> Chart {
    let mut chart = Chart::new(title, x, y);
    for (name, points) in lines {
        let slope = slope(&points);
        println!("slope of {name}: {slope:.3}");
        chart.series.push(Series::line(format!("{name}, slope {slope:.2}"), points));
    }
    chart
}

/// Of the logarithms, by least squares.
fn slope(points: &[(f64, f64)]) -> f64 {
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let mean = |f: fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / logs.len() as f64;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (up, down) =
        logs.iter().fold((0.0, 0.0), |(up, down), p| (up + (p.0 - x) * (p.1 - y), down + (p.0 - x).powi(2)));
    up / down
}

/// So many spheres in a cube, of such radii that they cover the same share of the picture.
fn spheres(count: usize, side: u32) -> Scene {
    let mut state = 1u64;
    let mut unit = || {
        // SplitMix64: Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 40) as f32 / (1 << 24) as f32
    };
    let radius = 0.3 / (count as f32).sqrt();
    let rows = (0..count).map(|_| [unit(), unit(), unit(), radius * (0.5 + unit())]).collect();
    let mut scene = Scene::default();
    let model = Model::Diffuse { albedo: Paint::Color(DVec3::splat(0.7)) };
    scene.materials.push(Material { name: "gray".into(), model, back: None, visible: Visible::Both });
    let shapes = CloudShapes::Spheres(Rows::F32(rows));
    scene.clouds.push(Cloud { shapes, material: CloudMaterial::One(0), colors: None, name: None, group: None });
    let (position, intensity) = (DVec3::new(2.5, 3.0, 1.5), DVec3::splat(10.0));
    let source = Source::Point { position, intensity, falloff: Falloff::InverseSquare };
    scene.lights.push(Light { name: None, shadows: true, source });
    let (eye, target) = (DVec3::new(1.9, 1.5, 2.2), DVec3::splat(0.5));
    let lens = Lens::Pinhole { vfov: 38.0 };
    scene.cameras.push(Camera { name: None, eye, target, up: DVec3::Y, lens });
    scene.image = Some(ImageSettings { width: side, height: side, spp: 1, filter: Filter::default() });
    scene
}
