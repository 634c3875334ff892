//! Light that is sampled, against closed forms; and that samples converge as their pattern promises.
//!
//! Bounds: Owen-scrambled points err less than random ones, whose deviation each test says.

mod common;

use std::f64::consts::PI;
use std::sync::Arc;

use common::*;
use glam::DVec3;
use octray::film::{Picture, Window};
use octray::scene::*;
use octray::{Renderer, render::Engine};

fn render(scene: &Scene) -> Picture {
    Renderer::new(scene).expect("complete").render(&()).expect("a picture").picture
}

fn reds(picture: &Picture) -> Vec<f64> {
    picture.pixels.iter().map(|pixel| f64::from(pixel[0])).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn close(got: f64, want: f64, relative: f64, context: impl std::fmt::Debug) {
    assert!((got - want).abs() <= relative * want.abs(), "{context:?}: got {got}, want {want}");
}

fn area(emitter: Emitter, radiance: f64) -> Light {
    light(Source::Area { emitter, radiance: DVec3::splat(radiance), visible: false })
}

fn down(center: DVec3, half: f64) -> Emitter {
    let corner = |x: f64, z: f64| center + DVec3::new(x * half, 0.0, z * half);
    // Counter-clockwise seen from below.
    let corners = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    Emitter::Polygon(Polygon { corners, ..Polygon::default() })
}

/// A white floor seen straight from above, `width` wide; nothing of it is farther than that from the origin.
fn floor(lights: Vec<Light>, width: f64, pixels: u32, spp: u32) -> Scene {
    let mut scene = scene_of([plane(DVec3::ZERO, DVec3::Y)]);
    let up = DVec3::NEG_Z;
    scene.cameras = vec![Camera { up, ..orthographic(0.5 * DVec3::Y, DVec3::ZERO, width) }];
    (scene.materials[0], scene.lights, scene.image) = (gray(1.0), lights, image(pixels, pixels, spp));
    scene
}

fn picture(width: usize, height: usize, texel: impl Fn(usize, usize) -> f32) -> Backdrop {
    let texels: Vec<[f32; 3]> = (0..width * height).map(|k| [texel(k % width, k / width); 3]).collect();
    let image = ImageTexture {
        file: "sky.exr".into(),
        wrap: Wrap::Repeat,
        filter: TextureFilter::Bilinear,
        color_space: ColorSpace::Linear,
        width,
        height,
        texels: Arc::from(texels),
    };
    Backdrop::Image { image: Box::new(image), scale: 1.0, rotation: 30.0 }
}

fn under(backdrop: Backdrop) -> Background {
    Background { backdrop, ..Background::default() }
}

/// Both engines.
const ENGINES: [Engine; 2] = [Engine::Packet, Engine::Reference];

fn by(engine: Engine, scene: &Scene) -> Picture {
    Renderer::new(scene).expect("complete").engine(engine).render(&()).expect("a picture").picture
}

/// Radiance of a white floor is E/pi: under a disk of radius R at height h `L R^2/(R^2 + h^2)`, under a
/// sphere `L (r/d)^2`, which is what its cap gives whatever is drawn.
#[test]
fn a_disk_and_a_sphere_light_a_floor_as_they_must() {
    for engine in ENGINES {
        let disk = Emitter::Disk { center: 2.0 * DVec3::Y, normal: -3.0 * DVec3::Y, radius: 1.5 };
        let under_disk = mean(&reds(&by(engine, &floor(vec![area(disk, 4.0)], 1e-6, 16, 64))));
        // 16,384 points of a mild integrand.
        close(under_disk, 4.0 * 2.25 / (2.25 + 4.0), 1e-4, engine);
        let ball = Emitter::Sphere { center: 2.0 * DVec3::Y, radius: 1.5 };
        let under_ball = mean(&reds(&by(engine, &floor(vec![area(ball, 4.0)], 1e-6, 16, 64))));
        close(under_ball, 4.0 * (1.5f64 / 2.0).powi(2), 1e-4, engine);
        // Seen at 60 degrees from the normal the whole sphere still counts, with the cosine.
        let aside = Emitter::Sphere { center: DVec3::new(3f64.sqrt(), 1.0, 0.0), radius: 0.5 };
        let lit = mean(&reds(&by(engine, &floor(vec![area(aside, 4.0)], 1e-6, 16, 64))));
        close(lit, 4.0 * 0.0625 * 0.5, 1e-4, engine);
    }
}

/// Two parallel unit squares face to face: Howell's C-11 (Siegel and Howell, "Thermal radiation heat transfer").
#[test]
fn parallel_squares_have_their_form_factor() {
    for distance in [0.5f64, 1.0, 2.0] {
        let x = 1.0 / distance;
        let q = (1.0 + x * x).sqrt();
        let log = ((1.0 + x * x) * (1.0 + x * x) / (1.0 + 2.0 * x * x)).sqrt().ln();
        let factor = 2.0 / (PI * x * x) * (log + 2.0 * x * q * (x / q).atan() - 2.0 * x * x.atan());
        let light = area(down(distance * DVec3::Y, 0.5), 3.0);
        for engine in ENGINES {
            let mut scene = floor(vec![light.clone()], 1.0, 32, 64);
            // Below the light in any case.
            scene.cameras[0].eye = 0.25 * DVec3::Y;
            close(mean(&reds(&by(engine, &scene))), 3.0 * factor, 1e-3, (engine, distance));
        }
    }
}

/// A convex white body in a white sky is 1: exactly where scattered rays alone bring the sky; to the noise
/// of the weights where it is drawn too.
#[test]
fn the_furnace_is_white() {
    let mut scene =
        scene_of([sphere(DVec3::ZERO, 1.0), cuboid(DVec3::new(1.5, -1.0, -0.5), DVec3::new(2.5, 0.5, 0.5))]);
    (scene.materials[0], scene.image) = (gray(1.0), image(48, 32, 16));
    scene.cameras = vec![pinhole(DVec3::new(1.0, 1.0, 6.0), DVec3::new(0.8, 0.0, 0.0), 30.0)];
    scene.objects.truncate(1);
    scene.render.integrator = Integrator::Path;
    scene.background = under(Backdrop::Color(DVec3::ONE));
    for engine in ENGINES {
        assert!(reds(&by(engine, &scene)).iter().all(|red| (red - 1.0).abs() < 1e-6));
        scene.background = under(picture(16, 8, |_, _| 1.0));
        let noisy = reds(&by(engine, &scene));
        close(mean(&noisy), 1.0, 2e-3, engine);
        assert!(noisy.iter().all(|red| (red - 1.0).abs() < 0.5));
        scene.background = under(Backdrop::Color(DVec3::ONE));
    }
    // Ambient occlusion of a convex body: open everywhere.
    scene.render.integrator = Integrator::Ao;
    scene.background = under(Backdrop::Color(DVec3::ONE));
    assert!(reds(&render(&scene)).iter().all(|red| (red - 1.0).abs() < 1e-6));
}

/// Inside a white-ish sphere with a lamp in its middle every place gets `E0 = pi L (r/R)^2` from the lamp and the
/// share `albedo` of all of it again from each bounce.
#[test]
fn an_integrating_sphere_multiplies_its_light() {
    let (albedo, radius) = (0.6, 0.25);
    for (depth, spp) in [(1, 16), (2, 64), (4, 64), (40, 64)] {
        let lamp = Emitter::Sphere { center: DVec3::ZERO, radius };
        let mut scene = Scene { lights: vec![area(lamp, 5.0)], ..scene_of([sphere(DVec3::ZERO, 2.0)]) };
        (scene.materials[0], scene.image) = (gray(albedo), image(32, 32, spp));
        scene.cameras = vec![pinhole(DVec3::new(1.0, 0.5, 0.2), DVec3::ZERO, 90.0)];
        (scene.render.integrator, scene.render.max_depth) = (Integrator::Path, depth);
        let once = albedo * 5.0 * (radius / 2.0).powi(2);
        let want = once * (1.0 - albedo.powi(depth as i32)) / (1.0 - albedo);
        for engine in ENGINES {
            // Each bounce meets the lamp with a chance of 1.5 %: a deviation of some 1/500 with 65,536 samples.
            close(mean(&reds(&by(engine, &scene))), want, if depth == 1 { 1e-5 } else { 5e-3 }, (engine, depth));
        }
    }
}

/// A sky that is dark but for some texels, against the sum over a fine grid of directions.
#[test]
fn a_sky_lights_a_floor_as_its_integral_says() {
    let texel = |i: usize, j: usize| if (i, j) == (5, 2) { 200.0 } else { 0.25 * (1 + i % 3) as f32 };
    let backdrop = picture(24, 12, texel);
    let (mut sum, n) = (0.0, 1200);
    for (j, i) in (0..n / 2).flat_map(|j| (0..n).map(move |i| (j, i))) {
        let (b, a) = ((j as f64 + 0.5) * PI / n as f64, (i as f64 + 0.5) * 2.0 * PI / n as f64);
        // Turning the picture does not change what a level floor gets.
        let (u, v) = (a / (2.0 * PI), b / PI);
        let (x, y) = (u * 24.0 - 0.5, v * 12.0 - 0.5);
        let at = |i: f64, j: f64| f64::from(texel(i.rem_euclid(24.0) as usize, j.clamp(0.0, 11.0) as usize));
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let row = |j: f64| at(x.floor(), j) * (1.0 - fx) + at(x.floor() + 1.0, j) * fx;
        let radiance = row(y.floor()) * (1.0 - fy) + row(y.floor() + 1.0) * fy;
        sum += radiance * b.cos() * b.sin() * (PI / n as f64) * (2.0 * PI / n as f64);
    }
    for (engine, integrator) in ENGINES.into_iter().flat_map(|e| [(e, Integrator::Direct), (e, Integrator::Path)]) {
        let mut scene = Scene { background: under(backdrop.clone()), ..floor(vec![], 1e-6, 16, 64) };
        (scene.render.integrator, scene.render.max_depth) = (integrator, 2);
        close(mean(&reds(&by(engine, &scene))), sum / PI, 4e-3, (engine, integrator));
        scene.background.light = false;
        assert_eq!(mean(&reds(&by(engine, &scene))), 0.0, "{integrator:?}");
    }
}

/// At the foot of an endless wall half of the (weighed) hemisphere is open; within a reach less is closed.
#[test]
fn a_wall_closes_half_of_the_sky() {
    let mut scene = floor(vec![], 1e-6, 16, 64);
    scene.objects.push(object(plane(DVec3::new(1.0, 0.0, 0.0), DVec3::NEG_X), 0));
    scene.render.integrator = Integrator::Ao;
    for engine in ENGINES {
        scene.render.ao_distance = f64::INFINITY;
        close(mean(&reds(&by(engine, &scene))), 0.5, 2e-3, engine);
        scene.render.ao_distance = 0.99;
        assert_eq!(mean(&reds(&by(engine, &scene))), 1.0);
    }
}

/// Ambient light comes from the open half alone, and adds to lights whose shadows have nothing to do with it.
#[test]
fn a_wall_hides_half_of_the_ambient_light() {
    let mut scene = floor(vec![], 1e-6, 16, 64);
    scene.objects.push(object(plane(DVec3::new(1.0, 0.0, 0.0), DVec3::NEG_X), 0));
    scene.ambient = DVec3::splat(0.4);
    for (engine, integrator) in ENGINES.into_iter().flat_map(|e| [(e, Integrator::Direct), (e, Integrator::Path)]) {
        (scene.render.integrator, scene.render.max_depth) = (integrator, 1);
        (scene.render.ambient_occlusion, scene.render.ao_distance) = (false, f64::INFINITY);
        close(mean(&reds(&by(engine, &scene))), 0.4, 1e-6, (engine, integrator));
        scene.render.ambient_occlusion = true;
        close(mean(&reds(&by(engine, &scene))), 0.2, 2e-3, (engine, integrator));
        scene.render.ao_distance = 0.99;
        close(mean(&reds(&by(engine, &scene))), 0.4, 1e-6, (engine, integrator));
    }
}

/// Ambient occlusion is a path of two rays under a white sky.
#[test]
fn openness_is_what_a_white_sky_gives() {
    let mut scene = scene_of([sphere(DVec3::new(0.0, 1.0, 0.0), 1.0), plane(DVec3::ZERO, DVec3::Y)]);
    scene.cameras = vec![pinhole(DVec3::new(0.0, 3.0, 5.0), DVec3::new(0.0, 0.5, 0.0), 35.0)];
    (scene.background, scene.image) = (under(Backdrop::Color(DVec3::ONE)), image(48, 32, 4));
    let picture = |integrator| {
        let renderer = Renderer::new(&scene).expect("complete").integrator(integrator).max_depth(2);
        reds(&renderer.render(&()).expect("a picture").picture)
    };
    let (ao, path) = (picture(Integrator::Ao), picture(Integrator::Path));
    let off = ao.iter().zip(&path).filter(|(a, b)| (*a - *b).abs() > 1e-5).count();
    // Rays 1e-7 apart part at silhouettes.
    assert!(off <= 2 && mean(&ao) > 0.3 && mean(&ao) < 0.9, "{off} off, {}", mean(&ao));
}

/// A visible light is seen by the camera and in a mirror, at its radiance, from its lit side alone, and what is
/// behind it is not; a lamp in the plane of a ceiling is seen, and lights.
#[test]
fn lights_are_seen_from_their_lit_side() {
    let lamp =
        |visible| light(Source::Area { emitter: down(2.0 * DVec3::Y, 0.5), radiance: DVec3::splat(7.0), visible });
    let mut scene = scene_of([plane(2.0 * DVec3::Y, DVec3::NEG_Y), plane(DVec3::ZERO, DVec3::Y)]);
    scene.materials.push(material("mirror", Model::Mirror { reflectance: Paint::Color(DVec3::splat(0.5)) }));
    scene.objects[1].material = 1;
    scene.image = image(1, 1, 1);
    let up = DVec3::Z;
    let look = |eye: f64, target: f64| Camera { up, ..orthographic(eye * DVec3::Y, target * DVec3::Y, 1e-3) };
    for (engine, integrator) in ENGINES.into_iter().flat_map(|e| [(e, Integrator::Direct), (e, Integrator::Path)]) {
        scene.render.integrator = integrator;
        for (camera, visible, want) in [
            (look(1.0, 2.0), true, 7.0),
            (look(1.0, 0.0), true, 3.5),
            (look(1.0, 2.0), false, 0.0),
            (look(1.0, 0.0), false, 0.0),
        ] {
            (scene.cameras, scene.lights) = (vec![camera], vec![lamp(visible)]);
            assert_eq!(mean(&reds(&by(engine, &scene))), want, "{engine:?} {integrator:?} {visible}");
        }
    }
    // From above the unlit side is not there.
    scene.objects.clear();
    scene.background = under(Backdrop::Color(DVec3::splat(0.25)));
    (scene.cameras, scene.lights) = (vec![look(3.0, 0.0)], vec![lamp(true)]);
    ENGINES.iter().for_each(|engine| assert_eq!(mean(&reds(&by(*engine, &scene))), 0.25));
}

/// A lamp in the very plane of the ceiling lights the floor as one a little below does.
#[test]
fn a_ceiling_does_not_shade_its_own_lamp() {
    for height in [1.0, 3.7, 1e3] {
        let mut scene = floor(vec![area(down(height * DVec3::Y, 0.3 * height), 5.0)], 0.1 * height, 24, 4);
        scene.cameras[0].eye = 0.5 * height * DVec3::Y;
        let free = reds(&render(&scene));
        scene.objects.push(object(plane(height * DVec3::Y, DVec3::NEG_Y), 0));
        let hung = reds(&render(&scene));
        assert_eq!(free, hung, "{height}");
    }
}

/// Under a disk the integrand is smooth: 64 times the samples leave less than a twentieth of the error, where random
/// points would leave an eighth.
#[test]
fn errors_fall_at_the_pattern_s_rate() {
    let disk = Emitter::Disk { center: DVec3::new(0.7, 1.0, 0.2), normal: DVec3::NEG_Y, radius: 0.8 };
    let reference = mean(&reds(&render(&floor(vec![area(disk.clone(), 1.0)], 1e-6, 32, 4096))));
    let error = |spp| {
        let values = reds(&render(&floor(vec![area(disk.clone(), 1.0)], 1e-6, 32, spp)));
        (values.iter().map(|value| (value - reference).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
    };
    let (few, many) = (error(16), error(1024));
    assert!(many < few / 20.0 && few < 0.1, "{few} {many}");
}

/// Threads, crops and walks one by one give the same bits.
#[test]
fn paths_do_not_depend_on_threads_or_crops() {
    let mut scene = scene_of([sphere(DVec3::new(0.0, 1.0, 0.0), 1.0), plane(DVec3::ZERO, DVec3::Y)]);
    scene.materials.push(material("glass", Model::Dielectric { ior: 1.5, tint: Paint::Color(DVec3::ONE) }));
    scene.objects.push(object(sphere(DVec3::new(1.8, 0.7, 0.5), 0.7), 1));
    scene.lights = vec![area(down(DVec3::new(0.5, 4.0, 0.0), 0.7), 20.0)];
    scene.background = under(picture(16, 8, |i, j| 0.1 * (i + j) as f32));
    scene.cameras = vec![Camera {
        lens: Lens::ThinLens { vfov: 35.0, aperture: 0.1, focus: 5.0 },
        ..pinhole(DVec3::new(0.0, 3.0, 5.0), DVec3::new(0.5, 0.5, 0.0), 35.0)
    }];
    (scene.image, scene.render.integrator) = (image(80, 48, 4), Integrator::Path);
    let whole = Renderer::new(&scene).expect("complete");
    let all = whole.clone().threads(1).render(&()).expect("a picture").picture;
    let again = |renderer: Renderer| renderer.render(&()).expect("a picture").picture;
    assert_eq!(all.pixels, again(whole.clone().threads(3)).pixels);
    assert_eq!(all.pixels, again(whole.clone().engine(Engine::Single)).pixels);
    assert_eq!(all.pixels, again(whole.clone().skip(false)).pixels);
    let window = Window { x0: 17, y0: 9, x1: 50, y1: 37 };
    let part = again(whole.crop(window));
    for (index, pixel) in part.pixels.iter().enumerate() {
        let (x, y) = window.pixel(index);
        assert_eq!(all.get(x, y).as_ref(), Some(pixel));
    }
}

/// A ball in the half shadow of a lamp, before a plain background.
fn penumbra() -> Scene {
    let mut scene = scene_of([sphere(DVec3::new(0.0, 1.0, 0.0), 1.0), disk(DVec3::ZERO, DVec3::Y, 3.0, 0.0)]);
    scene.lights = vec![area(down(DVec3::new(1.5, 5.0, 1.0), 1.0), 8.0)];
    scene.background = under(Backdrop::Color(DVec3::splat(0.3)));
    scene.cameras = vec![pinhole(DVec3::new(0.0, 4.0, 9.0), DVec3::new(0.0, 0.5, 0.0), 50.0)];
    scene.image = image(128, 128, 8); // whole tiles: the level told is that of the pixels compared
    scene
}

/// The error told is that against a long run; each pixel is what as many samples for all make of it, and samples go where
/// the noise is; crops have the same bits.
#[test]
fn a_noise_level_is_reached_and_told_truly() {
    let scene = penumbra();
    let renderer = || Renderer::new(&scene).expect("complete");
    let long = renderer().spp(4096).seed(9).render(&()).expect("a picture").picture;
    for target in [0.012, 0.003] {
        let layers = Layers::default().with(Aov::Samples);
        let rendering = renderer().noise(Some(target)).layers(layers).render(&()).expect("a picture");
        let (picture, reached) = (&rendering.picture, rendering.stats.noise.expect("a noise level"));
        let real = octray::measure::compare(picture, &long).expect("one size").rel_mse.sqrt();
        assert!((real / reached.error - 1.0).abs() < 0.2, "{target}: {real} {reached:?}");
        assert!(reached.worst <= target && reached.short == 0 && reached.error < target, "{reached:?}");
        assert!(reached.samples > 8 * reached.pixels && reached.pixels == 128 * 128, "{reached:?}");

        let samples = picture.channel("samples.Y").and_then(|channel| channel.samples.floats()).expect("a layer");
        let mut sum = 0;
        for spp in (3..=12).map(|power| 1 << power) {
            let places: Vec<usize> = (0..samples.len()).filter(|i| samples[*i] == spp as f32).collect();
            sum += spp as u64 * places.len() as u64;
            if !places.is_empty() {
                let all = renderer().spp(spp).render(&()).expect("a picture").picture;
                assert!(places.iter().all(|i| all.pixels[*i] == picture.pixels[*i]), "{target} {spp}");
            }
        }
        assert_eq!(sum, reached.samples);
        assert!(samples.contains(&8.0) && samples.iter().any(|samples| *samples >= 16.0), "{target}");

        let window = Window { x0: 20, y0: 40, x1: 70, y1: 66 };
        let part = renderer().noise(Some(target)).crop(window).threads(1).render(&()).expect("a picture").picture;
        for (index, pixel) in part.pixels.iter().enumerate() {
            let (x, y) = window.pixel(index);
            assert_eq!(picture.get(x, y).as_ref(), Some(pixel), "{x} {y}");
        }
    }
}

/// At equal error fewer samples than as many for all.
#[test]
fn sampling_to_a_noise_level_takes_fewer_samples() {
    let mut scene = Scene::load("scenes/area_lights.toml").expect("a scene");
    scene.image = image(160, 100, 64);
    let renderer = || Renderer::new(&scene).expect("complete");
    let long = renderer().spp(2048).seed(9).render(&()).expect("a picture").picture;
    let error = |picture: &Picture| octray::measure::compare(picture, &long).expect("one size").rel_mse;
    let some = renderer().noise(Some(0.03)).render(&()).expect("a picture");
    let reached = some.stats.noise.expect("a noise level");
    let mean = reached.samples as f64 / reached.pixels as f64;
    let twice = renderer().spp((2.0 * mean) as u32).render(&()).expect("a picture");
    assert!(error(&some.picture) < error(&twice.picture), "{mean}");
}

/// Both engines stop at the same number of samples.
#[test]
fn both_engines_sample_to_the_same_noise() {
    let mut scene = penumbra();
    scene.image = image(64, 64, 8);
    let by = |engine| {
        let renderer = Renderer::new(&scene).expect("complete").engine(engine).noise(Some(0.03));
        renderer.render(&()).expect("a picture")
    };
    let (packet, reference) = (by(Engine::Packet), by(Engine::Reference));
    let samples = |rendering: &octray::Rendering| rendering.stats.noise.map(|reached| reached.samples);
    assert_eq!(samples(&packet), samples(&reference));
    close(mean(&reds(&packet.picture)), mean(&reds(&reference.picture)), 1e-4, "means");
}
