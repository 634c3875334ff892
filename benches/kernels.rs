//! Every primitive's kernel: eight rays against one, one ray against a block of eight, and the f64 reference.
//!
//! All three answer the same 64 questions, eight rays by eight primitives, and must find the same hits before they are
//! timed. Throughput is (ray, primitive) pairs.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DQuat, DVec3};
use octray::lanes::{LANES, Ray, RayPacket};
use octray::plan::{Kind, Plan};
use octray::reference::{self, Reference};
use octray::scene::*;
use octray::shapes::{Hidden8, Part, Store, Stores, Visit};

/// Eight rays against one row after the other: hits.
struct Packet<'a>(&'a RayPacket);

impl Visit for Packet<'_> {
    type Output = u32;
    #[inline(never)]
    fn visit<P: Part>(self, store: &Store<P>) -> u32 {
        let rays = self.0;
        let hit = |row: usize| {
            let rows = store.splat(row);
            let anchor = P::anchor(&rows, &rays.origin);
            let hit = P::hit::<false, true>(&rows, &anchor, rays, &Hidden8::NONE, |_| store.part(row));
            assert!(!hit.doubt.any());
            hit.mask.bits().count_ones()
        };
        (0..LANES).map(hit).sum()
    }
}

/// One ray after the other against eight rows: hits.
struct Block<'a>(&'a [RayPacket; LANES]);

impl Visit for Block<'_> {
    type Output = u32;
    #[inline(never)]
    fn visit<P: Part>(self, store: &Store<P>) -> u32 {
        let hit = |ray: &RayPacket| {
            let anchor = P::anchor(store.block(0), &ray.origin);
            let hit = P::hit::<false, true>(store.block(0), &anchor, ray, &Hidden8::NONE, |lane| store.part(lane));
            assert!(!hit.doubt.any());
            hit.mask.bits().count_ones()
        };
        self.0.iter().map(hit).sum()
    }
}

/// Eight primitives of a kind side by side, of which each of the rays below meets some.
fn scene(kind: Kind) -> Scene {
    let mut scene = Scene::default();
    let model = Model::Diffuse { albedo: Paint::Color(DVec3::splat(0.5)) };
    scene.materials.push(Material { name: "gray".into(), model, back: None, visible: Visible::Both });
    for i in 0..LANES {
        let at = DVec3::new(f64::from(i as u32) * 0.25 - 0.875, 0.03125, -4.0 - 0.125 * i as f64);
        let object = Object { shape: shape(kind, at), material: 0, name: None, group: None };
        scene.objects.push(object);
    }
    scene
}

fn shape(kind: Kind, at: DVec3) -> Shape {
    let (axis, normal, radius) = (DVec3::new(0.25, 0.5, 0.125), DVec3::new(0.25, 0.125, 1.0), 0.5);
    let polygon = |corners: usize| {
        let corner = |i: usize| {
            let angle = std::f64::consts::TAU * (i as f64 + 0.2) / corners as f64;
            at + radius * DVec3::new(angle.cos(), angle.sin(), 0.0)
        };
        Shape::Polygon(Polygon { corners: (0..corners).map(corner).collect(), ..Polygon::default() })
    };
    let cuboid =
        |rotation| Shape::Box(Cuboid { min: at - DVec3::splat(0.375), max: at + DVec3::splat(0.375), rotation });
    match kind {
        Kind::Sphere => Shape::Sphere(Sphere { center: at, radius }),
        Kind::Plane => Shape::Plane(Plane { point: at, normal }),
        Kind::Disk => Shape::Disk(Disk { center: at, normal, radius, inner_radius: 0.0 }),
        Kind::Triangle => polygon(3),
        Kind::Quad => polygon(4),
        Kind::Octagon => polygon(8),
        Kind::Box => cuboid(None),
        Kind::TurnedBox => cuboid(Some(DQuat::from_axis_angle(axis.normalize(), 0.5))),
        Kind::Cylinder => Shape::Cylinder(Cylinder { base: at - axis, apex: at + axis, radius: 0.25, caps: true }),
        Kind::Cone => {
            let (base, apex) = (at - axis, at + axis);
            Shape::Cone(Cone { base, apex, radius: 0.375, apex_radius: 0.125, caps: true })
        }
    }
}

fn rays() -> [Ray; LANES] {
    std::array::from_fn(|i| {
        let x = i as f32 / 16.0 - 0.21875;
        Ray::new([0.0, 0.0, 0.25], [x, 0.0078125 * (i as f32 - 3.0), -1.0])
    })
}

fn exact(ray: &Ray) -> reference::Ray {
    let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
    reference::Ray { origin: wide(ray.origin), dir: wide(ray.dir), t_min, t_max }
}

fn kernels(c: &mut Criterion) {
    for kind in Kind::ALL {
        let scene = scene(kind);
        let plan = Plan::new(&scene, DVec3::ZERO);
        // As they come, eight a block: a tree would order and group them its own way.
        let (stores, rays) = (&Stores::new(plan.parts(), None, &plan.visible), rays());
        let (packet, singles) = (RayPacket::gather(&rays), rays.map(|ray| RayPacket::splat(&ray)));
        let alone: Vec<Reference> = (0..LANES)
            .map(|i| Reference::new(&Scene { objects: vec![scene.objects[i].clone()], ..scene.clone() }))
            .collect();
        let exact = rays.map(|ray| exact(&ray));
        let by_reference = || {
            let hits = alone.iter().flat_map(|one| exact.iter().map(|ray| u32::from(one.occluded(ray))));
            hits.sum::<u32>()
        };
        // Only right answers are timed.
        let want = by_reference();
        assert!((8..=64).contains(&want), "{}: {want} hits", kind.name());
        assert_eq!(stores.visit(kind, Packet(&packet)), want, "{}", kind.name());
        assert_eq!(stores.visit(kind, Block(&singles)), want, "{}", kind.name());

        let mut group = c.benchmark_group(kind.name());
        group.throughput(Throughput::Elements((LANES * LANES) as u64));
        group.bench_function("packet", |b| b.iter(|| black_box(stores).visit(kind, Packet(black_box(&packet)))));
        group.bench_function("block", |b| b.iter(|| black_box(stores).visit(kind, Block(black_box(&singles)))));
        group.bench_function("reference", |b| b.iter(|| black_box(by_reference())));
        group.finish();
    }
}

criterion_group!(benches, kernels);
criterion_main!(benches);
