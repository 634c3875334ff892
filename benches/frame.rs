//! Whole pictures: plan, tree, tracing and shading, as `octray render` does them before it writes.
//!
//! Each scene is checked against the f64 reference first.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use octray::measure::check::{CheckSettings, check};
use octray::{Renderer, Scene};

/// Scene, size, samples per pixel.
const PICTURES: [(&str, (u32, u32), u32); 4] = [
    ("fig5.toml", (640, 480), 1),
    ("fig5.toml", (640, 480), 16),
    ("mixed.toml", (320, 240), 4),
    ("nff/balls_s4.nff", (512, 512), 1),
];

fn frame(c: &mut Criterion) {
    for (name, (width, height), spp) in PICTURES {
        let path = format!("{}/scenes/{name}", env!("CARGO_MANIFEST_DIR"));
        let scene = Scene::load(path).expect("a scene of the repository");
        let mut small = scene.clone();
        small.image.iter_mut().for_each(|image| (image.width, image.height) = (32, 24));
        let report = check(&small, &CheckSettings { seconds: 5.0, ..CheckSettings::default() }).expect("a camera");
        assert!(report.pass, "{name}: {report}");

        let renderer = Renderer::new(&scene).expect("a camera").resolution(width, height).spp(spp);
        let mut group = c.benchmark_group("frame");
        group.sample_size(10).throughput(Throughput::Elements(u64::from(width * height * spp))); // camera rays
        let stem = name.split(['/', '.']).rev().nth(1).unwrap_or(name);
        group.bench_function(format!("{stem} {width}x{height}, {spp} spp"), |b| b.iter(|| renderer.render(&())));
        group.finish();
    }
}

criterion_group!(benches, frame);
criterion_main!(benches);
