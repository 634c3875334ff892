//! The tree: building it, and camera, shadow and bounce rays through it, on one thread.
//!
//! The rays are those of `octray bench`. Before anything is timed a part of them is traced by the f64 reference, which
//! must agree, but for what it calls a tie.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use octray::measure::bench::{RaySet, ray_set};
use octray::reference::{self, Reference, Verdict};
use octray::render::Engine;
use octray::{Batch, Query, Ray, Scene, Tracer};

/// Spheres, polygons, and everything with mirrors.
const SCENES: [&str; 3] = ["nff/balls_s4.nff", "nff/tetra_s6.nff", "mixed.toml"];
/// Rays of each set that the reference looks at.
const PROVEN: usize = 200;

fn load(name: &str) -> Scene {
    Scene::load(format!("{}/scenes/{name}", env!("CARGO_MANIFEST_DIR"))).expect("a scene of the repository")
}

fn prove(query: &Query, reference: &Reference, rays: &[Ray]) {
    let some: Vec<Ray> = rays.iter().step_by(rays.len().div_ceil(PROVEN).max(1)).copied().collect();
    for (ray, hit) in some.iter().zip(query.closest(&some)) {
        let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
        let exact = reference::Ray { origin: wide(ray.origin), dir: wide(ray.dir), t_min, t_max };
        let verdict = reference.verdict(&exact, hit.map(|hit| hit.primitive as usize), hit.map(|hit| hit.t));
        assert!(!matches!(verdict, Verdict::Different { .. }), "{ray:?}: {verdict:?}");
    }
}

fn accel(c: &mut Criterion) {
    for name in SCENES {
        let scene = load(name);
        let mut group = c.benchmark_group(name.split(['/', '.']).rev().nth(1).unwrap_or(name));
        group.sample_size(10);
        group.throughput(Throughput::Elements(scene.primitive_count() as u64));
        group
            .bench_function("build", |b| b.iter(|| Tracer::new(black_box(&scene)).map(|tracer| tracer.tree().bytes())));
        let query = Query::new(&scene, Engine::Packet, 1).expect("a valid scene");
        let reference = Reference::new(&scene);
        for set in RaySet::ALL {
            let rays = ray_set(&scene, set).expect("a scene with a camera and a light");
            prove(&query, &reference, &rays);
            let batch = Batch::new(rays);
            let (mut found, mut dark) = (query.room(&batch), vec![0; batch.tiles()]);
            group.throughput(Throughput::Elements(batch.len() as u64));
            group.bench_function(BenchmarkId::new(set.name(), "closest"), |b| {
                b.iter(|| query.find_closest(black_box(&batch), &mut found));
            });
            group.bench_function(BenchmarkId::new(set.name(), "any"), |b| {
                b.iter(|| query.find_occluded(black_box(&batch), &mut dark));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, accel);
criterion_main!(benches);
