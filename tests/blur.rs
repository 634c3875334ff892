//! Motion blur: what moves is spread over the places where it is while the shutter is open.

mod common;

use common::*;
use glam::DVec3;
use octray::film::{Picture, Window};
use octray::render::{Engine, RenderError, moments};
use octray::scene::*;
use octray::{Renderer, Scene};

/// A ball of radius 1 seen from far along z, 10 pixels a unit, before nothing.
fn ball(center: DVec3, spp: u32) -> Scene {
    let mut scene = scene_of([sphere(center, 1.0)]);
    scene.cameras = vec![orthographic(DVec3::Z * 9.0, DVec3::ZERO, 4.0)];
    scene.image = image(80, 40, spp);
    scene.lights = vec![light(Source::Directional { direction: DVec3::NEG_Z, irradiance: DVec3::ONE })];
    scene.background.transparent = true;
    scene
}

fn blurred(scene: &Scene, next: &Scene, shutter: f64, engine: Engine) -> Picture {
    let spp = scene.image.as_ref().expect("a size").spp;
    let moments = moments(scene, next, shutter, spp);
    let renderer = Renderer::new(scene).expect("complete").engine(engine).moments(&moments);
    renderer.render(&()).expect("a picture").picture
}

fn alpha(picture: &Picture, x: i32, y: i32) -> f64 {
    f64::from(picture.get(x, y).expect("inside")[3])
}

/// Of the time that the shutter is open a ball covers a place for as long as its chord there is, over its speed.
#[test]
fn a_ball_covers_places_as_long_as_it_is_there() {
    let (from, to) = (ball(DVec3::NEG_X * 2.0, 128), ball(DVec3::X * 2.0, 128));
    for engine in [Engine::Packet, Engine::Reference] {
        let picture = blurred(&from, &to, 1.0, engine);
        for (x, y) in [(40, 20), (40, 12), (35, 17), (15, 20), (70, 25), (40, 2), (79, 20)] {
            let (u, v) = ((f64::from(x) + 0.5) / 10.0 - 4.0, (f64::from(y) + 0.5) / 10.0 - 2.0);
            let half = (1.0 - v * v).max(0.0).sqrt();
            let covered = ((u + half).min(2.0) - (u - half).max(-2.0)).max(0.0) / 4.0;
            // 32 moments, and an edge that is up to two pixels wide.
            assert!((alpha(&picture, x, y) - covered).abs() < 0.05, "{engine:?} {x} {y} {covered}");
        }
    }
    // Open for half the time it only comes half the way.
    let half = blurred(&from, &to, 0.5, Engine::Packet);
    assert!(alpha(&half, 25, 20) > 0.7 && alpha(&half, 55, 20) == 0.0);
}

/// A camera that goes left sees what one at rest sees of a ball that goes right.
#[test]
fn cameras_blur_as_what_they_see_does() {
    let (still, right) = (ball(DVec3::ZERO, 32), ball(DVec3::X, 32));
    let mut left = still.clone();
    (left.cameras[0].eye.x, left.cameras[0].target.x) = (-1.0, -1.0);
    let (ball, camera) = (blurred(&still, &right, 1.0, Engine::Packet), blurred(&still, &left, 1.0, Engine::Packet));
    let off = ball.pixels.iter().zip(&camera.pixels).filter(|(a, b)| (a[3] - b[3]).abs() > 1e-6).count();
    assert!(off < 5, "{off}");
    assert!(ball.pixels.iter().filter(|pixel| pixel[3] > 0.1 && pixel[3] < 0.9).count() > 100);
}

#[test]
fn blur_has_the_same_bits_whoever_traces_it() {
    let mut from = ball(DVec3::new(-0.5, 0.2, 0.3), 16);
    from.objects.push(object(plane(DVec3::NEG_Y, DVec3::Y), 0));
    from.layers = Aov::ALL.into_iter().filter(|aov| *aov != Aov::Cost).fold(Layers::default(), Layers::with);
    let mut to = from.clone();
    to.objects[0].shape = sphere(DVec3::new(0.5, 0.4, -0.3), 1.1);
    let moments = moments(&from, &to, 0.7, 16);
    let renderer = || Renderer::new(&from).expect("complete").next_frame(&to).moments(&moments);
    let bits = |picture: &Picture| picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect::<Vec<_>>();
    let whole = renderer().threads(1).render(&()).expect("a picture").picture;
    for other in [renderer().engine(Engine::Single), renderer().threads(3), renderer().skip(false)] {
        let other = other.render(&()).expect("a picture").picture;
        assert_eq!((bits(&other), &other.channels), (bits(&whole), &whole.channels));
    }
    let crop = Window { x0: 21, y0: 7, x1: 50, y1: 33 };
    let part = renderer().crop(crop).render(&()).expect("a picture").picture;
    for (x, y) in (0..crop.area()).map(|index| crop.pixel(index)) {
        assert_eq!(part.get(x, y), whole.get(x, y));
    }
    let reference = renderer().engine(Engine::Reference).render(&()).expect("a picture").picture;
    let off = |a: &[f32; 4], b: &[f32; 4]| (0..4).any(|k| (a[k] - b[k]).abs() > 1e-5);
    let different = whole.pixels.iter().zip(&reference.pixels).filter(|(a, b)| off(a, b)).count();
    assert!(different <= 3, "{different}");
    assert_eq!(whole.channels.len(), reference.channels.len());
}

#[test]
fn what_rests_does_not_blur() {
    let still = ball(DVec3::ZERO, 8);
    let plain = Renderer::new(&still).expect("complete").render(&()).expect("a picture").picture;
    let open = blurred(&still, &still, 1.0, Engine::Packet);
    let off = plain.pixels.iter().zip(&open.pixels).any(|(a, b)| (0..4).any(|k| (a[k] - b[k]).abs() > 1e-6));
    assert!(!off && alpha(&plain, 40, 20) == 1.0);
    let scenes = moments(&still, &still, 1.0, 4);
    let noisy = Renderer::new(&still).expect("complete").noise(Some(0.1)).moments(&scenes);
    assert_eq!(noisy.render(&()).expect_err("both"), RenderError::NoiseWithShutter);
}

/// The command line: a frame that is blurred says so in its header, is stale when the next one changes, and can be
/// rendered again from what it says.
#[test]
fn blurred_frames_know_where_they_go() {
    let room = tempfile::tempdir().expect("a directory");
    let file = |name: &str, text: &str| std::fs::write(room.path().join(name), text).expect("written");
    let scene = "[image]\nwidth = 40\nheight = 30\nspp = 4\n[camera]\ntype = \"orthographic\"\nheight = 6\neye = [0, 0, 9]\n\
                 target = [0, 0, 0]\n[materials.m]\ntype = \"diffuse\"\n[ambient]\ncolor = [1, 1, 1]\n\
                 [[clouds]]\ntype = \"spheres\"\nfile = \"p.#.csv\"\nmaterial = \"m\"\n";
    file("s.toml", scene);
    (1..4).for_each(|frame| file(&format!("p.{frame:04}.csv"), &format!("x,y,z,r\n{frame},0,0,0.5\n")));
    let octray = |words: &[&str]| {
        let mut command = assert_cmd::Command::cargo_bin("octray").expect("built");
        let output = command.current_dir(room.path()).args(words).output().expect("run");
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let render = ["render", "s.toml", "--frames", "1-2", "--out-dir", "out", "--shutter", "0.5", "--resume"];
    assert_eq!(octray(&render).0, Some(0));
    let verdict = octray(&["verify", "out/s.0001.exr", "s.toml"]);
    assert!(verdict.0 == Some(0) && verdict.1.contains("confirmed"), "{verdict:?}");
    let still = octray(&["render", "s.toml", "-o", "still.exr"]);
    assert_eq!(still.0, Some(0));
    assert_eq!(octray(&["compare", "still.exr", "out/s.0001.exr", "--max-rmse", "0.01"]).0, Some(1));
    let pictures =
        || ["out/s.0001.exr", "out/s.0002.exr"].map(|name| std::fs::read(room.path().join(name)).expect("there"));
    let before = pictures();
    assert_eq!(octray(&render).0, Some(0));
    assert!(before == pictures(), "nothing is stale");
    file("p.0003.csv", "x,y,z,r\n2.5,0,0,0.5\n");
    assert_eq!(octray(&render).0, Some(0));
    let after = pictures();
    assert!(before[0] == after[0] && before[1] != after[1], "only the second goes there");
}
