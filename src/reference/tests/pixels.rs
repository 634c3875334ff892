//! Pictures that are known beforehand.

use std::f64::consts::PI;

use super::*;
use crate::reference::{EventKind, Pixel, RayCounts, View};

fn look(eye: DVec3, target: DVec3) -> Camera {
    let up = if (target - eye).normalize().y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
    Camera { name: None, eye, target, up, lens: Lens::Pinhole { vfov: 40.0 } }
}

fn view(tracer: &Reference, camera: &Camera, spp: u32, max_depth: u32) -> View {
    let image = ImageSettings { width: 32, height: 24, spp, filter: Filter::default() };
    tracer.view(camera, &image, &RenderSettings { max_depth, ..RenderSettings::default() })
}

fn shine(scene: &mut Scene, source: Source) {
    scene.lights.push(Light { name: None, shadows: true, source });
}

fn point(position: DVec3, intensity: f64, falloff: Falloff) -> Source {
    Source::Point { position, intensity: DVec3::splat(intensity), falloff }
}

fn with(model: Model) -> Material {
    Material { model, ..diffuse() }
}

fn all_pixels(tracer: &Reference, view: &View) -> Vec<Pixel> {
    (0..24).flat_map(|y| (0..32).map(move |x| (x, y))).map(|(x, y)| tracer.pixel(view, x, y)).collect()
}

/// A white sphere lit from its own centre looks the same everywhere: albedo/pi x intensity/r^2.
#[test]
fn a_uniformly_lit_white_room() {
    let mut scene = scene_of(vec![sphere(DVec3::new(1.0, 2.0, 3.0), 2.0)]);
    scene.materials[0].model = Model::Diffuse { albedo: Paint::Color(DVec3::ONE) };
    scene.ambient = DVec3::splat(0.25);
    shine(&mut scene, point(DVec3::new(1.0, 2.0, 3.0), 10.0, Falloff::InverseSquare));
    let tracer = Reference::new(&scene);
    let view = view(&tracer, &look(DVec3::new(1.5, 1.0, 3.0), DVec3::ZERO), 4, 5);
    for pixel in all_pixels(&tracer, &view) {
        assert!((pixel.rgba[0] - (2.5 / PI + 0.25)).abs() < 1e-14 && pixel.rgba[3] == 1.0, "{:?}", pixel.rgba);
        assert_eq!(pixel.rays, RayCounts { camera: 4, shadow: 4, reflection: 0, refraction: 0, bounce: 0 });
    }
}

/// A mirror at x = 0 shows what a camera behind it would see of the mirrored scene: here, its own.
#[test]
fn a_plane_mirror_shows_the_mirrored_scene() {
    let bodies = [(DVec3::new(3.0, 0.5, 0.2), 0.75), (DVec3::new(2.0, -0.5, -1.0), 0.5)];
    let build = |mirror: bool| {
        let flip = if mirror { DVec3::ONE } else { DVec3::new(-1.0, 1.0, 1.0) };
        let mut scene = scene_of(bodies.iter().map(|(center, radius)| sphere(*center * flip, *radius)).collect());
        shine(&mut scene, point(flip * DVec3::new(6.0, 5.0, 4.0), 3.0, Falloff::None));
        scene.background.backdrop = Backdrop::Gradient { top: DVec3::ONE, bottom: DVec3::ZERO };
        if mirror {
            let shape = Shape::Plane(Plane { point: DVec3::ZERO, normal: DVec3::X });
            scene.objects.push(Object { shape, material: 1, name: None, group: None });
            scene.materials.push(with(Model::Mirror { reflectance: Paint::Color(DVec3::new(0.5, 1.0, 1.0)) }));
        }
        Reference::new(&scene)
    };
    let (mirrored, plain) = (build(true), build(false));
    let camera = look(DVec3::new(5.0, 0.0, 4.0), DVec3::new(0.0, 0.0, 1.0));
    let [a, b] = [&mirrored, &plain].map(|tracer| all_pixels(tracer, &view(tracer, &camera, 1, 5)));
    let mut seen = 0;
    for (a, b) in a.iter().zip(&b) {
        if a.rays.reflection == 0 {
            continue; // a body in front of the mirror
        }
        seen += usize::from(b.events.iter().any(|event| event.kind == EventKind::Light(0)));
        assert!((a.rgba[0] - 0.5 * b.rgba[0]).abs() < 1e-13 && (a.rgba[1] - b.rgba[1]).abs() < 1e-13);
    }
    assert!(seen > 20, "{seen}");
}

/// Between two facing mirrors the depth limit alone ends the path; what is beyond it is black.
#[test]
fn depth_counts_from_one() {
    let plane = |x: f64| Shape::Plane(Plane { point: x * DVec3::X, normal: -x * DVec3::X });
    let mut scene = scene_of(vec![plane(1.0), plane(-1.0)]);
    scene.materials[0] = with(Model::Mirror { reflectance: Paint::Color(DVec3::ONE) });
    let tracer = Reference::new(&scene);
    let camera = look(DVec3::ZERO, DVec3::X);
    for depth in [1, 2, 5, 40, 1000] {
        let pixel = tracer.pixel(&view(&tracer, &camera, 1, depth), 16, 12);
        assert_eq!((pixel.rays.camera, pixel.rays.reflection), (1, u64::from(depth) - 1));
        assert_eq!(pixel.rgba, [0.0, 0.0, 0.0, 1.0]);
    }
}

/// Glass under a uniform sky: with enough depth what it shows is the sky, F + (1 - F).
#[test]
fn glass_keeps_the_energy_of_a_uniform_sky() {
    for front in [true, false] {
        let mut scene = scene_of(vec![Shape::Plane(Plane { point: DVec3::ZERO, normal: DVec3::Y })]);
        scene.materials[0] = with(Model::Dielectric { ior: 1.5, tint: Paint::Color(DVec3::ONE) });
        scene.background.backdrop = Backdrop::Color(DVec3::new(1.0, 2.0, 3.0));
        let tracer = Reference::new(&scene);
        let eye = if front { DVec3::new(0.0, 2.0, 3.0) } else { DVec3::new(0.0, -2.0, 3.0) };
        for pixel in all_pixels(&tracer, &view(&tracer, &look(eye, DVec3::ZERO), 2, 3)) {
            assert!((pixel.rgba[1] - 2.0).abs() < 1e-14, "{:?}", pixel.rgba);
            assert!(pixel.rays.reflection == 2 && (pixel.rays.refraction == 2) | !front);
        }
    }
}

/// A ray through the middle of a glass ball goes straight on; one at height b leaves it deflected by
/// 2 (asin b - asin(b/n)) towards the axis.
#[test]
fn a_glass_ball_deflects_as_geometry_says() {
    let glass = only(sphere(DVec3::ZERO, 1.0));
    for b in [0.0, 0.3, 0.9, 0.999] {
        let mut ray = ray(DVec3::new(-4.0, b, 0.0), DVec3::X);
        for ratio in [1.0 / 1.5, 1.5] {
            let hit = glass.closest(&ray).unwrap();
            let turn = if hit.front { 1.0 } else { -1.0 };
            let side = super::super::material::Side { n: turn * hit.normal, n_g: turn * hit.normal, dir: ray.dir };
            let dir = side.refraction(ratio).unwrap().dir;
            ray = self::ray(hit.spawn(dir), dir);
        }
        assert!(!glass.occluded(&ray));
        let angle = 2.0 * (b.asin() - (b / 1.5f64).asin());
        assert!((ray.dir.y + angle.sin()).abs() < 1e-12 && (ray.dir.x - angle.cos()).abs() < 1e-12, "{b}: {ray:?}");
    }
}

/// A floor lit by each kind of light, with a ball that shades a known place of it.
#[test]
fn lights_and_shadows() {
    let floor = Shape::Plane(Plane { point: DVec3::ZERO, normal: DVec3::Y });
    let radiance = |source, shadows, at: DVec3| {
        let mut scene = scene_of(vec![floor.clone(), sphere(DVec3::new(0.0, 2.0, 0.0), 0.5)]);
        scene.lights.push(Light { name: None, shadows, source });
        let tracer = Reference::new(&scene);
        let camera = Camera { lens: Lens::Orthographic { height: 1e-6 }, ..look(at + DVec3::new(0.0, 1.0, 1.0), at) };
        let pixel = tracer.pixel(&view(&tracer, &camera, 1, 5), 16, 12);
        (pixel.rgba[0] * PI / 0.5, pixel.rays.shadow)
    };
    let close = |(value, rays): (f64, u64), want: f64, want_rays| {
        assert!((value - want).abs() < 1e-6 && rays == want_rays, "{value} {rays}, not {want} {want_rays}");
    };
    let (here, there) = (DVec3::ZERO, DVec3::new(3.0, 0.0, 0.0));
    let lamp = |falloff| point(DVec3::new(0.0, 4.0, 0.0), 8.0, falloff);
    close(radiance(lamp(Falloff::InverseSquare), true, here), 0.0, 1);
    close(radiance(lamp(Falloff::InverseSquare), false, here), 0.5, 0);
    close(radiance(lamp(Falloff::InverseSquare), true, there), 8.0 / 25.0 * 0.8, 1);
    close(radiance(lamp(Falloff::None), true, there), 8.0 * 0.8, 1);
    close(radiance(point(DVec3::new(0.0, -4.0, 0.0), 8.0, Falloff::None), true, there), 0.0, 0);
    let sun = Source::Directional { direction: DVec3::new(0.0, -2.0, 0.0), irradiance: DVec3::splat(3.0) };
    close(radiance(sun.clone(), true, here), 0.0, 1);
    close(radiance(sun, true, there), 3.0, 1);
    // The place is at atan(3/4) = 36.87 degrees from the axis.
    let spot = |cone, penumbra| {
        let (position, direction) = (DVec3::new(0.0, 4.0, 0.0), -5.0 * DVec3::Y);
        Source::Spot { position, direction, intensity: DVec3::splat(8.0), cone, penumbra }
    };
    let (full, angle) = (8.0 / 25.0 * 0.8, 0.75f64.atan().to_degrees());
    close(radiance(spot(40.0, 0.0), true, there), full, 1);
    close(radiance(spot(36.0, 0.0), true, there), 0.0, 0);
    close(radiance(spot(angle + 5.0, 10.0), true, there), 0.5 * full, 1);
    let s: f64 = 0.25;
    close(radiance(spot(angle + 2.0, 8.0), true, there), s * s * (3.0 - 2.0 * s) * full, 1);
}

/// NFF's surface under one light: diffuse, highlight, ambient, reflection and transmission add up.
#[test]
fn phong_adds_its_terms() {
    let mut scene = scene_of(vec![Shape::Plane(Plane { point: DVec3::ZERO, normal: DVec3::Y })]);
    let color = Paint::Color(DVec3::new(0.5, 0.25, 1.0));
    scene.materials[0] = with(Model::Phong { color, kd: 0.6, ks: 0.3, shine: 7.0, transmittance: 0.2, ior: 0.0 });
    scene.ambient = DVec3::splat(0.1);
    scene.background.backdrop = Backdrop::Gradient { top: DVec3::ONE, bottom: DVec3::splat(0.5) };
    shine(&mut scene, Source::Directional { direction: DVec3::new(0.0, -1.0, 0.0), irradiance: DVec3::splat(2.0) });
    let tracer = Reference::new(&scene);
    // From straight down to a slant of 3 in 5: the mirror direction of the light is +y.
    let camera = Camera { lens: Lens::Orthographic { height: 1e-9 }, ..look(DVec3::new(4.0, 3.0, 0.0), DVec3::ZERO) };
    let pixel = tracer.pixel(&view(&tracer, &camera, 1, 2), 16, 12);
    let (sky, below) = (0.5 + 0.5 * 0.8, 0.5 + 0.5 * 0.2);
    for (value, color) in pixel.rgba.into_iter().zip([0.5, 0.25, 1.0]) {
        let lit = 2.0 / PI * (0.6 * color + 0.3 * 0.6f64.powi(7));
        let want = lit + 0.1 * 0.6 * color + 0.3 * sky + 0.2 * below;
        assert!((value - want).abs() < 1e-7, "{value} {want}");
    }
    assert_eq!(pixel.rays, RayCounts { camera: 1, shadow: 1, reflection: 1, refraction: 1, bounce: 0 });
    let mut events = pixel.events;
    events.sort();
    let told: Vec<_> = events.iter().map(|event| (event.path, event.kind, event.outcome)).collect();
    let want = [
        (1, EventKind::Camera, 0),
        (1, EventKind::Light(0), 1),
        (2, EventKind::Reflection, -1),
        (3, EventKind::Refraction, -1),
    ];
    assert_eq!(told, want);
}

/// A cloud's colours multiply textures, textures tell their cells, misses of a transparent background
/// count for nothing.
#[test]
fn textures_clouds_and_transparency() {
    let rows = Rows::F64(vec![[0.0, 0.0, 0.0, 1.0]]);
    let checker = Checker { colors: [DVec3::ONE, DVec3::ZERO], scale: [4.0, 4.0] };
    let cloud = Cloud {
        shapes: CloudShapes::Spheres(rows),
        material: CloudMaterial::One(0),
        colors: Some(vec![[0.5, 1.0, 0.25]]),
        name: None,
        group: None,
    };
    let mut scene = Scene { clouds: vec![cloud], ambient: DVec3::ONE, materials: vec![diffuse()], ..Scene::default() };
    scene.materials[0].model = Model::Diffuse { albedo: Paint::Texture(0) };
    scene.textures.push(Texture { name: "squares".into(), kind: TextureKind::Checker(checker) });
    scene.background.transparent = true;
    let tracer = Reference::new(&scene);
    let pixels = all_pixels(&tracer, &view(&tracer, &look(4.0 * DVec3::Z, DVec3::ZERO), 1, 5));
    let (mut white, mut black, mut clear) = (0, 0, 0);
    for pixel in pixels {
        let cell = pixel.events.iter().find(|event| event.kind == EventKind::Texture(0)).map(|event| event.outcome);
        match cell {
            Some(0) => assert!(
                pixel.rgba == [0.5, 1.0, 0.25, 1.0] && {
                    white += 1;
                    true
                }
            ),
            Some(_) => assert!(
                pixel.rgba == [0.0, 0.0, 0.0, 1.0] && {
                    black += 1;
                    true
                }
            ),
            None => assert!(
                pixel.rgba == [0.0; 4] && {
                    clear += 1;
                    true
                }
            ),
        }
    }
    assert!(white > 50 && black > 50 && clear > 50, "{white} {black} {clear}");
}

/// A picture of four texels: its centres are themselves, between them it is linear, beyond them it wraps.
#[test]
fn pictures_are_looked_up_as_documented() {
    let texels = [0.0, 1.0, 2.0, 4.0].map(|x| [x; 3]);
    let look = |filter, wrap, u, v| {
        let image = ImageTexture {
            file: "four".into(),
            wrap,
            filter,
            color_space: ColorSpace::Linear,
            width: 2,
            height: 2,
            texels: texels.into(),
        };
        let (color, cell) = super::super::texture::lookup(&TextureKind::Image(image), glam::DVec2::new(u, v));
        (color.x, cell)
    };
    use TextureFilter::{Bilinear, Nearest};
    assert_eq!(look(Bilinear, Wrap::Repeat, 0.25, 0.25), (0.0, 0));
    assert_eq!(look(Bilinear, Wrap::Repeat, 0.75, 0.75), (4.0, 3));
    assert_eq!(look(Bilinear, Wrap::Repeat, 0.5, 0.5), (1.75, 0));
    assert_eq!(look(Bilinear, Wrap::Repeat, 0.0, 0.25), (0.5, 1));
    assert_eq!(look(Bilinear, Wrap::Clamp, 0.0, 0.25), (0.0, 0));
    assert_eq!(look(Bilinear, Wrap::Clamp, 9.0, 0.25), (1.0, 1));
    assert_eq!(look(Nearest, Wrap::Repeat, 1.6, -0.3), (4.0, 3));
    assert_eq!(look(Nearest, Wrap::Clamp, 1.6, -0.3), (1.0, 1));
    assert_eq!(look(Nearest, Wrap::Repeat, f64::NAN, f64::INFINITY), (0.0, 0));
}

/// The lat-long backdrop: its centre column looks to -z, u grows to the right, +y is the top row.
#[test]
fn the_sky_is_the_right_way_round() {
    let width = 64;
    let texels: Vec<Texel> = (0..32 * width).map(|k| [(k % width) as f32, (k / width) as f32, 0.0]).collect();
    let image = ImageTexture {
        file: "sky".into(),
        wrap: Wrap::Clamp,
        filter: TextureFilter::Nearest,
        color_space: ColorSpace::Linear,
        width,
        height: 32,
        texels: texels.into(),
    };
    let sky = |dir, rotation| {
        let backdrop = Backdrop::Image { image: Box::new(image.clone()), scale: 2.0, rotation };
        super::super::background::radiance(&backdrop, dir) / 2.0
    };
    let near = |a: DVec3, x: f64, y: f64| assert!((a - DVec3::new(x, y, 0.0)).length() < 1e-9, "{a} {x} {y}");
    near(sky(-DVec3::Z, 0.0), 31.5, 15.5);
    near(sky(5.0 * DVec3::X, 0.0), 47.5, 15.5);
    near(sky(-DVec3::X, 0.0), 15.5, 15.5);
    // Turning the picture by +90 degrees about +y brings what was at -z to -x.
    near(sky(-DVec3::X, 90.0), 31.5, 15.5);
    assert_eq!(sky(DVec3::Y, 0.0).y, 0.0);
    assert_eq!(sky(-DVec3::Y, 0.0).y, 31.0);
}

/// Far from the origin a scene looks the same, through a tracer relative to a place near it too.
#[test]
fn pictures_do_not_depend_on_the_origin() {
    let shift = DVec3::new(1e6, -2e6, 4e6);
    let build = |shift: DVec3| {
        let mut scene = scene_of(one_of_each(shift, 1.0));
        shine(&mut scene, point(shift + DVec3::new(4.0, 6.0, 5.0), 30.0, Falloff::InverseSquare));
        scene
    };
    let camera = |shift: DVec3| look(shift + DVec3::new(3.0, 2.5, 4.0), shift);
    let tracers = [
        Reference::new(&build(DVec3::ZERO)),
        Reference::new(&build(shift)),
        Reference::relative_to(&build(shift), shift),
    ];
    let cameras = [camera(DVec3::ZERO), camera(shift), camera(shift)];
    let [home, far, back] = [0, 1, 2].map(|i| all_pixels(&tracers[i], &view(&tracers[i], &cameras[i], 1, 5)));
    let events = |pixel: &Pixel| pixel.events.iter().map(|event| (event.kind, event.outcome)).collect::<Vec<_>>();
    for ((home, far), back) in home.iter().zip(&far).zip(&back) {
        assert_eq!(home.rgba, back.rgba);
        assert_eq!(events(home), events(far));
        assert!(home.rgba.iter().zip(far.rgba).all(|(a, b)| (a - b).abs() < 1e-7), "{:?} {:?}", home.rgba, far.rgba);
    }
}
