//! What must not change a picture, not by a bit: threads, order, crops, shards, engines, skipping, places.

mod common;

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use common::*;
use glam::{DVec2, DVec3};

use octray::batch::Tile;
use octray::film::{Picture, Window};
use octray::plan::{Skip, SkipSet};
use octray::render::{Engine, RenderError, Task};
use octray::scene::*;
use octray::{Progress, Renderer};

/// All kinds, mirrors, glass, a checker, smooth and textured polygons, a point, a spot and a distant light.
/// Every coordinate is a multiple of 2^-16, so that moves by whole numbers are exact in f64.
fn everything() -> Scene {
    let mut dice = Dice(2024);
    let checker = Checker { colors: [DVec3::new(0.9, 0.2, 0.1), DVec3::new(0.1, 0.3, 0.8)], scale: [3.0, 2.0] };
    let textures = vec![Texture { name: "squares".into(), kind: TextureKind::Checker(checker) }];
    let white = Paint::Color(DVec3::splat(0.9));
    let phong = Model::Phong { color: white, kd: 0.5, ks: 0.3, shine: 20.0, transmittance: 0.2, ior: 1.2 };
    let mut materials = vec![
        gray(0.7),
        material("squares", Model::Diffuse { albedo: Paint::Texture(0) }),
        material("mirror", Model::Mirror { reflectance: white }),
        material("glass", Model::Dielectric { ior: 1.5, tint: white }),
        material("plastic", phong),
        Material { visible: Visible::Front, ..gray(0.4) },
        Material { back: Some(1), ..gray(0.2) },
    ];
    materials[0].name = "clay".into();
    let mut objects = vec![object(plane(-4.0 * DVec3::Y, DVec3::Y), 1)];
    for i in 0..5 * MAKERS.len() {
        let (name, maker) = MAKERS[i % MAKERS.len()];
        if name != "plane" {
            let (center, scale) = (dice.in_cube(4.0), dice.between(0.3, 1.0));
            objects.push(object(maker(center, scale, turn(&mut dice)), i % materials.len()));
        }
    }
    for (i, object) in objects.iter_mut().enumerate() {
        let Shape::Polygon(polygon) = &mut object.shape else { continue };
        let count = polygon.corners.len();
        if i % 2 == 0 {
            polygon.normals = (0..count).map(|_| (polygon.normal() + dice.in_cube(0.3)).normalize()).collect();
        }
        if i % 3 == 0 {
            polygon.uvs = (0..count).map(|_| DVec2::new(dice.unit(), dice.unit())).collect();
        }
    }
    let (position, direction) = (DVec3::new(-5.0, 9.0, 6.0), DVec3::new(0.5, -1.0, -0.5));
    let spot = Source::Spot { position, direction, intensity: DVec3::splat(300.0), cone: 40.0, penumbra: 10.0 };
    let sun = Source::Directional { direction: DVec3::new(-1.0, -2.0, -0.5), irradiance: DVec3::splat(0.5) };
    let emitter = Emitter::Sphere { center: DVec3::new(2.0, 9.0, -3.0), radius: 1.0 };
    let lamp = Source::Area { emitter, radiance: DVec3::splat(5.0), visible: true };
    let backdrop = Backdrop::Gradient { top: DVec3::new(0.2, 0.4, 1.0), bottom: DVec3::splat(0.1) };
    let scene = Scene {
        objects,
        materials,
        textures,
        lights: vec![point_light(DVec3::new(3.0, 8.0, 7.0), 200.0), light(spot), light(sun), light(lamp)],
        cameras: vec![pinhole(DVec3::new(1.0, 2.0, 12.0), DVec3::ZERO, 45.0)],
        image: image(97, 71, 3),
        background: Background { backdrop, ..Background::default() },
        ambient: DVec3::splat(0.05),
        ..Scene::default()
    };
    mapped(scene, |point| (point * 65536.0).round() / 65536.0)
}

/// The scene with all its places, and no directions, sent through a function.
fn mapped(mut scene: Scene, f: impl Fn(DVec3) -> DVec3) -> Scene {
    for object in &mut scene.objects {
        match &mut object.shape {
            Shape::Sphere(sphere) => sphere.center = f(sphere.center),
            Shape::Plane(plane) => plane.point = f(plane.point),
            Shape::Disk(disk) => disk.center = f(disk.center),
            Shape::Polygon(polygon) => polygon.corners.iter_mut().for_each(|corner| *corner = f(*corner)),
            Shape::Box(cuboid) => (cuboid.min, cuboid.max) = (f(cuboid.min), f(cuboid.max)),
            Shape::Cylinder(cylinder) => (cylinder.base, cylinder.apex) = (f(cylinder.base), f(cylinder.apex)),
            Shape::Cone(cone) => (cone.base, cone.apex) = (f(cone.base), f(cone.apex)),
        }
    }
    for light in &mut scene.lights {
        match &mut light.source {
            Source::Point { position, .. } | Source::Spot { position, .. } => *position = f(*position),
            Source::Directional { .. } => {}
            Source::Area { emitter: Emitter::Sphere { center, .. } | Emitter::Disk { center, .. }, .. } => {
                *center = f(*center);
            }
            Source::Area { emitter: Emitter::Polygon(polygon), .. } => {
                polygon.corners.iter_mut().for_each(|corner| *corner = f(*corner));
            }
        }
    }
    for camera in &mut scene.cameras {
        (camera.eye, camera.target) = (f(camera.eye), f(camera.target));
    }
    scene
}

fn picture(renderer: &Renderer) -> Picture {
    renderer.render(&()).expect("a picture").picture
}

/// Pixels of one picture that have other bits in the other.
fn differing(a: &Picture, b: &Picture) -> Vec<(i32, i32)> {
    assert_eq!((a.display, a.window), (b.display, b.window));
    let bits = |pixel: &[f32; 4]| pixel.map(f32::to_bits);
    let unlike = (0..a.pixels.len()).filter(|i| bits(&a.pixels[*i]) != bits(&b.pixels[*i]));
    unlike.map(|i| a.window.pixel(i)).collect()
}

/// A picture that shows little would prove little.
fn is_rich(picture: &Picture) -> bool {
    let mut colors: Vec<_> = picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect();
    colors.sort_unstable();
    colors.dedup();
    colors.len() > picture.pixels.len() / 2
}

#[test]
fn threads_change_nothing() {
    let scene = everything();
    let renderer = Renderer::new(&scene).expect("complete");
    let one = picture(&renderer.clone().threads(1));
    assert!(is_rich(&one));
    for threads in [2, 7] {
        assert_eq!(differing(&one, &picture(&renderer.clone().threads(threads))), [], "{threads}");
    }
}

/// Blocks forward, backward and mixed up; and each tile of the picture by itself, in any order.
#[test]
fn the_order_of_blocks_and_shards_change_nothing() {
    let scene = everything();
    let renderer = Renderer::new(&scene).expect("complete").layers(Layers::default().with_named("all").expect("a set"));
    let whole = renderer.render(&()).expect("a picture").picture;
    let task = Task::new(&renderer).expect("a task");
    let mut orders: Vec<Vec<usize>> = vec![(0..task.blocks()).rev().collect()];
    let mut dice = Dice(5);
    for _ in 0..2 {
        let mut mixed: Vec<usize> = (0..task.blocks()).collect();
        (1..mixed.len()).rev().for_each(|i| mixed.swap(i, dice.index(i + 1)));
        orders.push(mixed);
    }
    assert!(task.blocks() > 4 && orders[1] != orders[2]);
    for order in orders {
        let mut unfinished = task.begin();
        let gathering = unfinished.open(&task);
        order.iter().for_each(|block| gathering.add(task.trace(*block, &|| false).expect("a block")));
        drop(gathering);
        let picture = task.finish(unfinished, 1, Instant::now()).picture;
        assert_eq!(differing(&whole, &picture), [], "{order:?}");
        assert!(picture.channels == whole.channels, "{order:?}");
    }
    let shard = |index| {
        let tile = Tile { columns: 3, rows: 2, index };
        renderer.clone().crop(tile.window((97, 71))).render(&()).expect("a picture").picture
    };
    let joined = Picture::join(&[4, 1, 6, 2, 5, 3].map(shard)).expect("all of it");
    assert_eq!(differing(&whole, &joined), []);
    assert!(joined.channels == whole.channels);
}

#[test]
fn crops_are_pieces_of_the_whole() {
    let scene = everything();
    let renderer = Renderer::new(&scene).expect("complete");
    let whole = picture(&renderer);
    let window = |x0, y0, x1, y1| Window { x0, y0, x1, y1 };
    for window in [window(0, 0, 97, 1), window(13, 7, 50, 64), window(96, 70, 97, 71), window(31, 31, 34, 34)] {
        let crop = picture(&renderer.clone().crop(window));
        assert_eq!(differing(&crop, &whole.crop(window).expect("inside")), [], "{window}");
    }
    let outside = renderer.crop(window(90, 0, 98, 5)).render(&());
    assert!(matches!(outside, Err(RenderError::BadWindow { .. })));
}

#[test]
fn engines_and_skipping_change_nothing_at_any_number_of_samples() {
    let scene = everything();
    for spp in [1, 3, 16, 70] {
        let window = Window { x0: 20, y0: 10, x1: 20 + 640 / spp as i32, y1: 60 };
        let window = Window { x1: window.x1.min(97), ..window };
        let renderer = Renderer::new(&scene).expect("complete").spp(spp).crop(window);
        let plain = picture(&renderer);
        assert_eq!(differing(&plain, &picture(&renderer.clone().engine(Engine::Single))), [], "single, {spp}");
        assert_eq!(differing(&plain, &picture(&renderer.clone().skip(false))), [], "no skip, {spp}");
        let both = renderer.engine(Engine::Single).skip(false);
        assert_eq!(differing(&plain, &picture(&both)), [], "both, {spp}");
    }
}

/// Each kind of work by itself, on a scene that needs most of it, and on scenes made so that it is left out.
#[test]
fn no_kind_of_work_left_out_changes_anything() {
    let everything = everything();
    let mut plain = everything.clone();
    for object in &mut plain.objects {
        object.material = [0, 5, 6][object.material % 3];
    }
    let mut mirrors = everything.clone();
    mirrors.objects.iter_mut().for_each(|object| object.material = 2 + object.material % 2);
    let mut dark = everything.clone();
    dark.lights.push(point_light(DVec3::Y, 0.0));
    let expected = [("bounces", &plain), ("shading", &plain), ("textures", &mirrors), ("lights", &mirrors)];
    let expected = expected.into_iter().chain([("lights", &dark), ("shadows", &plain)]);
    for (name, scene) in expected {
        let skip = Skip::named(name).expect("a kind");
        let renderer = Renderer::new(scene).expect("complete").threads(1);
        let rendering = renderer.render(&()).expect("a picture");
        let skipped = rendering.stats.skipped.iter().find(|skipped| skipped.what == name);
        assert!(skipped.is_some_and(|skipped| skipped.count != Some(0)), "{name}: {:?}", rendering.stats.skipped);
        let all = renderer.clone().skips(SkipSet::ALL.without(skip)).render(&()).expect("a picture");
        assert!(all.stats.skipped.iter().all(|skipped| skipped.what != name));
        for other in [all.picture, picture(&renderer.skip(false))] {
            assert_eq!(differing(&rendering.picture, &other), [], "{name}");
        }
    }
    let renderer = Renderer::new(&everything).expect("complete");
    let all = picture(&renderer);
    for skip in Skip::names().filter_map(Skip::named) {
        assert_eq!(differing(&all, &picture(&renderer.clone().skips(SkipSet::ALL.without(skip)))), [], "{skip:?}");
    }
}

/// One million units away, where f32 has steps of an eighth, along each axis.
#[test]
fn places_change_nothing() {
    let scene = everything();
    let here = picture(&Renderer::new(&scene).expect("complete"));
    let far = f64::from(1 << 20);
    for by in [far * DVec3::X, -far * DVec3::Y, far * DVec3::Z, far * DVec3::new(-1.0, 1.0, 1.0)] {
        let moved = mapped(scene.clone(), |point| point + by);
        assert_eq!(mapped(moved.clone(), |point| point - by).objects, scene.objects, "the move is exact");
        let there = picture(&Renderer::new(&moved).expect("complete"));
        let unlike = differing(&here, &there);
        assert!(unlike.is_empty(), "{by}: {} pixels, such as {:?}", unlike.len(), unlike[0]);
    }
}

/// The same through a lens so long that coordinates are relative to what is seen.
#[test]
fn places_change_nothing_from_afar() {
    let mut scene = everything();
    scene.objects.retain(|object| !matches!(object.shape, Shape::Plane(_)));
    let camera = &mut scene.cameras[0];
    let far = f64::from(1 << 16);
    camera.eye += far * (camera.eye - camera.target);
    camera.lens = Lens::Pinhole { vfov: 40.0 / far };
    let here = picture(&Renderer::new(&scene).expect("complete"));
    for by in [f64::from(1 << 20) * DVec3::X, f64::from(1 << 20) * DVec3::new(-1.0, 1.0, 1.0)] {
        let moved = mapped(scene.clone(), |point| point + by);
        assert_eq!(mapped(moved.clone(), |point| point - by).objects, scene.objects, "the move is exact");
        assert_eq!(differing(&here, &picture(&Renderer::new(&moved).expect("complete"))), [], "{by}");
    }
    assert!(here.pixels.iter().filter(|pixel| pixel[0] > 0.0).count() > 500);
}

/// Stops after a while, and remembers how much was done.
struct Impatient {
    limit: u64,
    done: AtomicU64,
}

impl Progress for Impatient {
    fn advance(&self, done: u64, total: u64) {
        assert!(done <= total);
        self.done.fetch_max(done, Ordering::Relaxed);
    }
    fn cancelled(&self) -> bool {
        self.done.load(Ordering::Relaxed) >= self.limit
    }
}

#[test]
fn a_cancelled_render_says_so_and_an_uncancelled_one_finishes() {
    let scene = everything();
    let renderer = Renderer::new(&scene).expect("complete");
    for (limit, stops) in [(0, true), (2000, true), (u64::MAX, false)] {
        let progress = Impatient { limit, done: AtomicU64::new(0) };
        let outcome = renderer.render(&progress);
        let done = progress.done.load(Ordering::Relaxed);
        match outcome {
            Err(error) => assert!(stops && error == RenderError::Cancelled && done < 97 * 71 * 3, "{limit}: {error}"),
            Ok(_) => assert!(!stops && done == 97 * 71 * 3, "{limit}: {done}"),
        }
    }
}

/// Between two mirrors a chain of rays ends at the depth limit alone: a thousand deep it needs no more stack.
#[test]
fn long_chains_of_rays_end_at_the_depth_limit() {
    let text = "[image]\nwidth = 16\nheight = 16\nspp = 1\n[render]\nmax_depth = 1000\n\
        [camera]\ntype = \"pinhole\"\neye = [0, 0, 0]\ntarget = [0, 0, 1]\nvfov = 1\n\
        [materials.mirror]\ntype = \"mirror\"\nreflectance = [1, 1, 1]\n\
        [[shapes]]\ntype = \"plane\"\npoint = [0, 0, 1]\nnormal = [0, 0, -1]\nmaterial = \"mirror\"\n\
        [[shapes]]\ntype = \"plane\"\npoint = [0, 0, -1]\nnormal = [0, 0, 1]\nmaterial = \"mirror\"\n";
    let scene = Scene::from_toml(text, std::path::Path::new(".")).unwrap_or_else(|errors| panic!("{errors}"));
    let rendering = Renderer::new(&scene).expect("complete").render(&()).expect("a picture");
    assert_eq!(rendering.stats.rays.rays, [256, 0, 256 * 999, 0, 0]);
}
