//! Work that is left out: on scenes made so that there is much of it, pictures are the same to the bit without, with
//! it, and with all other work done.

mod common;

use common::*;
use std::sync::Arc;

use glam::DVec3;
use octray::Renderer;
use octray::film::Window;
use octray::plan::{Skip, SkipSet};
use octray::render::Stats;
use octray::scene::*;

/// Some shapes around the origin, up to three lights of any kind, a camera.
fn random(dice: &mut Dice, count: usize, spread: f64) -> Scene {
    let shape = |dice: &mut Dice| {
        let (center, scale) = (dice.in_cube(spread), dice.between(0.2, 1.2));
        let solid = ["sphere", "disk", "quad", "box", "turned box", "cylinder", "open cylinder", "frustum", "pentagon"];
        let name = solid[dice.index(solid.len())];
        let maker = MAKERS.iter().find(|maker| maker.0 == name).expect("known").1;
        maker(center, scale, turn(dice))
    };
    let mut scene = scene_of((0..count).map(|_| shape(dice)));
    scene.lights = (0..1 + dice.index(3))
        .map(|_| {
            let place = dice.direction() * dice.between(2.0, 12.0);
            match dice.index(3) {
                0 => point_light(place, 50.0),
                1 => light(Source::Directional { direction: -place, irradiance: DVec3::splat(0.8) }),
                _ => light(Source::Spot {
                    position: place,
                    direction: dice.in_cube(spread) - place,
                    intensity: DVec3::splat(90.0),
                    cone: dice.between(5.0, 60.0),
                    penumbra: 3.0,
                }),
            }
        })
        .collect();
    let eye = dice.direction() * dice.between(6.0, 15.0);
    let vfov = dice.between(10.0, 80.0);
    scene.cameras = vec![if dice.index(4) == 0 {
        orthographic(eye, dice.in_cube(1.0), dice.between(2.0, 12.0))
    } else {
        pinhole(eye, dice.in_cube(1.0), vfov)
    }];
    let kind = [FilterKind::Gaussian, FilterKind::Box][dice.index(2)];
    let filter = Filter { kind, radius: dice.between(0.5, 2.0) };
    scene.image = Some(ImageSettings { width: 61, height: 47, spp: [1, 3, 8][dice.index(3)], filter });
    scene.background = Background {
        backdrop: match dice.index(2) {
            0 => Backdrop::Color(DVec3::new(0.3, 0.1, 1.7)),
            _ => Backdrop::Gradient { top: DVec3::new(0.2, 0.4, 1.0), bottom: DVec3::splat(0.1) },
        },
        transparent: dice.index(5) == 0,
        light: true,
    };
    scene
}

/// With lights that have an area in place of every other one, often a sky, any lens, mirrors and glass, sometimes
/// seen from within a sphere.
fn lit_by_areas(dice: &mut Dice, mut scene: Scene) -> Scene {
    for light in &mut scene.lights {
        let (place, size) = (dice.direction() * dice.between(2.0, 9.0), dice.between(0.1, 1.5));
        let (right, up) = (DVec3::X * size, DVec3::Z * size);
        let corners = vec![place, place + right, place + right + up, place + up];
        let emitter = match dice.index(6) {
            0 => Emitter::Sphere { center: place, radius: size },
            1 => Emitter::Disk { center: place, normal: -place, radius: size },
            2 => Emitter::Polygon(Polygon { corners, ..Polygon::default() }),
            _ => continue,
        };
        let source = Source::Area { emitter, radiance: DVec3::splat(4.0), visible: dice.index(2) == 0 };
        *light = Light { name: None, shadows: dice.index(5) > 0, source };
    }
    if dice.index(3) == 0 {
        scene.background.backdrop = sky();
        scene.background.light = dice.index(3) > 0;
    }
    let (vfov, camera) = (dice.between(10.0, 80.0), &mut scene.cameras[0]);
    match dice.index(6) {
        0 => camera.lens = Lens::ThinLens { vfov, aperture: 0.3, focus: 7.0 },
        1 => camera.lens = Lens::Panoramic,
        _ => {}
    }
    if dice.index(4) == 0 {
        scene.objects.push(object(sphere(scene.cameras[0].eye + dice.in_cube(0.5), 2.0), 0));
    }
    let color = Paint::Color(DVec3::new(0.9, 0.8, 0.7));
    scene.materials.push(material("mirror", Model::Mirror { reflectance: color }));
    scene.materials.push(material("glass", Model::Dielectric { ior: 1.5, tint: Paint::Color(DVec3::ONE) }));
    if dice.index(4) == 0 {
        (scene.ambient, scene.render.ambient_occlusion) = (DVec3::new(0.2, 0.3, 0.4), dice.index(3) > 0);
    }
    if dice.index(2) == 0 {
        scene.objects.iter_mut().for_each(|object| object.material = dice.index(3));
    }
    scene
}

/// A bright square above the horizon.
fn sky() -> Backdrop {
    let texels: Vec<[f32; 3]> = (0..16 * 8).map(|i| if i % 16 < 3 && i < 48 { [9.0; 3] } else { [0.1; 3] }).collect();
    let image = ImageTexture {
        file: "sky.exr".into(),
        wrap: Wrap::Repeat,
        filter: TextureFilter::Bilinear,
        color_space: ColorSpace::Linear,
        width: 16,
        height: 8,
        texels: Arc::from(texels),
    };
    Backdrop::Image { image: Box::new(image), scale: 1.0, rotation: 30.0 }
}

/// Holds a picture against those that leave out less; what the first one left out.
fn unchanged(renderer: &Renderer, what: &str) -> Stats {
    let rendering = renderer.clone().render(&()).expect("a picture");
    let bits = |pixels: &[[f32; 4]]| pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect::<Vec<_>>();
    let plain = bits(&rendering.picture.pixels);
    let sets = Skip::names().filter_map(Skip::named).map(|skip| SkipSet::ALL.without(skip)).chain([SkipSet::NONE]);
    for set in sets {
        let other = renderer.clone().skips(set).render(&()).expect("a picture");
        let first = plain.iter().zip(bits(&other.picture.pixels)).position(|(a, b)| *a != b);
        let at = first.map(|index| rendering.picture.window.pixel(index));
        assert_eq!(at, None, "{what}, {set:?}: {:?}", rendering.stats.skipped);
    }
    rendering.stats
}

fn count(stats: &Stats, name: &str) -> u64 {
    stats.skipped.iter().find(|skipped| skipped.what == name).map_or(0, |skipped| skipped.count.unwrap_or(1))
}

#[test]
fn random_scenes_are_the_same_with_and_without() {
    let mut dice = Dice(77);
    let names = ["kinds", "tree", "background", "objects", "lights", "occlusion", "shadows", "bounces", "shading"];
    let mut found = names.map(|name| (name, 0));
    for round in 0..90 {
        let (few, spread) = (1 + dice.index(9), dice.between(1.0, 5.0));
        let mut scene = random(&mut dice, few, spread);
        if round % 4 == 0 {
            scene.objects.push(object(plane(DVec3::new(0.0, -3.0, 0.0), DVec3::new(0.1, 1.0, 0.0)), 0));
        }
        let mut renderer = Renderer::new(&scene).expect("complete").threads(1);
        if round % 3 == 0 {
            let (x0, y0) = (dice.index(50) as i32, dice.index(40) as i32);
            renderer = renderer.crop(Window { x0, y0, x1: x0 + 9, y1: y0 + 7 });
        }
        let stats = unchanged(&renderer, &format!("round {round}"));
        found.iter_mut().for_each(|(name, times)| *times += usize::from(count(&stats, name) > 0));
    }
    assert!(found.iter().all(|(_, times)| *times >= 5), "{found:?}");
}

#[test]
fn sampled_light_is_the_same_with_and_without() {
    let mut dice = Dice(1978);
    let names = ["tree", "background", "objects", "lights", "occlusion", "shadows"];
    let mut found = names.map(|name| (name, 0));
    for round in 0..150 {
        let (few, spread) = (1 + dice.index(9), dice.between(1.0, 5.0));
        let plain = random(&mut dice, few, spread);
        let scene = lit_by_areas(&mut dice, plain);
        let integrator = [Integrator::Direct, Integrator::Path, Integrator::Ao, Integrator::Direct][round % 4];
        let mut renderer = Renderer::new(&scene).expect("complete").threads(1).integrator(integrator).max_depth(4);
        if round % 3 > 0 {
            let (x0, y0) = (dice.index(50) as i32, dice.index(40) as i32);
            renderer = renderer.crop(Window { x0, y0, x1: x0 + 9, y1: y0 + 7 });
        }
        let stats = unchanged(&renderer, &format!("round {round}, {integrator:?}"));
        found.iter_mut().for_each(|(name, times)| *times += usize::from(count(&stats, name) > 0));
        let is_direct = integrator == Integrator::Direct;
        assert!(is_direct || count(&stats, "objects") == 0, "light from anywhere: {:?}", stats.skipped);
    }
    assert!(found.iter().all(|(_, times)| *times >= 5), "{found:?}");
}

/// Nothing but the sphere around the eye stands between a light and its inside: from there its other side does.
#[test]
fn the_inside_of_a_sphere_lies_in_its_own_shadow() {
    let mut scene = scene_of([sphere(DVec3::ZERO, 3.0)]);
    scene.lights = vec![point_light(DVec3::new(0.0, 0.0, 9.0), 500.0)];
    scene.cameras = vec![pinhole(DVec3::ZERO, DVec3::NEG_Z, 60.0)];
    scene.image = image(16, 16, 1);
    let rendering = Renderer::new(&scene).expect("complete").render(&()).expect("a picture");
    assert!(rendering.picture.pixels.iter().all(|pixel| *pixel == [0.0, 0.0, 0.0, 1.0]));
    // From the outside it is lit.
    scene.cameras = vec![pinhole(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, 20.0)];
    let rendering = Renderer::new(&scene).expect("complete").render(&()).expect("a picture");
    assert!(rendering.picture.pixels.iter().all(|pixel| pixel[0] > 0.0));
}

/// Where no primitive can be seen and the backdrop is one colour an area light is seen all the same.
#[test]
fn lights_are_seen_beside_all_primitives() {
    let mut scene = scene_of([sphere(DVec3::ZERO, 0.2)]);
    let emitter = Emitter::Sphere { center: DVec3::new(2.0, 0.0, 0.0), radius: 0.5 };
    scene.lights = vec![light(Source::Area { emitter, radiance: DVec3::splat(7.0), visible: true })];
    scene.cameras = vec![orthographic(DVec3::new(0.0, 0.0, 9.0), DVec3::ZERO, 6.0)];
    scene.image = image(60, 60, 1);
    let renderer = Renderer::new(&scene).expect("complete");
    let stats = unchanged(&renderer, "a lamp");
    assert!(count(&stats, "background") > 3000, "{:?}", stats.skipped);
    let picture = renderer.render(&()).expect("a picture").picture;
    let lamp = picture.pixels.iter().filter(|pixel| **pixel == [7.0, 7.0, 7.0, 1.0]).count();
    // 10 pixels a unit: 25 pi.
    assert!((70..90).contains(&lamp), "{lamp}");
}

/// Far from the scene's own origin, where f32 is coarse, and with lights that are nearly in the surfaces.
#[test]
fn rounding_has_room() {
    let mut dice = Dice(4);
    let mut cast = 0;
    for round in 0..20 {
        let mut scene = scene_of((0..6).map(|k| sphere(DVec3::new(f64::from(k) * 2.0001 - 5.0, 0.0, 0.0), 1.0)));
        let height = [1.0, 1.0001, 1.01, 3.0][round % 4];
        scene.lights = vec![point_light(DVec3::new(dice.between(-5.0, 5.0), height, 0.0), 20.0)];
        scene.lights.push(light(Source::Directional { direction: -DVec3::X, irradiance: DVec3::ONE }));
        scene.cameras = vec![pinhole(DVec3::new(0.0, 3.0, dice.log_between(8.0, 4000.0)), DVec3::ZERO, 30.0)];
        scene.image = image(40, 40, 4);
        cast += unchanged(&Renderer::new(&scene).expect("complete").threads(1), &format!("round {round}")).rays.rays[1];
    }
    assert!(cast > 1000, "{cast}");
}

/// Each kind of work with a scene where it is left out, and how much of it.
#[test]
fn what_is_left_out_is_counted() {
    let mut scene = scene_of([sphere(DVec3::ZERO, 1.0), sphere(DVec3::new(6.0, 0.0, 0.0), 1.0)]);
    scene.lights = vec![point_light(DVec3::new(0.0, 9.0, 3.0), 60.0), point_light(DVec3::Y * 5.0, 0.0)];
    let away = Source::Spot {
        position: DVec3::new(0.0, 9.0, 0.0),
        direction: DVec3::Y,
        intensity: DVec3::ONE,
        cone: 20.0,
        penumbra: 0.0,
    };
    scene.lights.push(light(away));
    scene.cameras = vec![pinhole(DVec3::new(0.0, 0.0, 10.0), DVec3::ZERO, 20.0)];
    scene.image = image(64, 64, 4);
    scene.background.backdrop = Backdrop::Color(DVec3::splat(0.25));
    let stats = unchanged(&Renderer::new(&scene).expect("complete").threads(1), "two spheres");
    assert_eq!((count(&stats, "lights"), count(&stats, "objects"), count(&stats, "tree")), (2, 1, 1));
    assert_eq!(count(&stats, "kinds"), 9);
    let traced = stats.rays.rays[0];
    assert_eq!(count(&stats, "background") + traced, 64 * 64 * 4);
    // The near face of the box around the sphere is 40.3 pixels wide, in cells of four pixels: 48 x 48.
    assert_eq!(traced, 48 * 48 * 4);
    let (shadow, free, dark) = (stats.rays.rays[1], count(&stats, "occlusion"), count(&stats, "shadows"));
    assert_eq!(shadow + free + dark, stats.rays.hits[0]);
    assert!(free > 100 * shadow.max(1) && dark > 500, "{shadow} {free} {dark}");
}

/// A lamp whose lit side nothing lies before gives nothing and is seen all the same; from the surfaces that face away from
/// one that shines, no shadow rays are cast.
#[test]
fn lamps_that_shine_away_and_surfaces_that_face_away_cast_no_shadow_rays() {
    let mut scene = scene_of([sphere(DVec3::ZERO, 1.0)]);
    let lamp = |height: f64, normal: DVec3| {
        let emitter = Emitter::Disk { center: DVec3::new(0.0, height, 0.0), normal, radius: 0.5 };
        light(Source::Area { emitter, radiance: DVec3::splat(7.0), visible: true })
    };
    scene.cameras = vec![pinhole(DVec3::new(0.0, 0.0, 9.0), DVec3::ZERO, 40.0)];
    scene.image = image(80, 80, 4);
    scene.lights = vec![lamp(2.0, DVec3::Y), lamp(1.1, DVec3::new(0.0, 1.0, 0.02))];
    let away = unchanged(&Renderer::new(&scene).expect("complete").threads(1), "away");
    assert_eq!((count(&away, "lights"), away.rays.rays[1]), (2, 0));
    scene.lights = vec![lamp(2.0, DVec3::NEG_Y)];
    let toward = unchanged(&Renderer::new(&scene).expect("complete").threads(1), "toward");
    assert_eq!(toward.rays.rays[1] + count(&toward, "shadows"), toward.rays.hits[0]);
    let (dark, cast) = (count(&toward, "shadows"), toward.rays.rays[1]);
    // Some 2 x 12^2 pi samples, of which those that see the lamp lie above 60 degrees of latitude.
    assert!(count(&toward, "lights") == 0 && dark > 1000 && cast > 50, "{dark} {cast}");
}

/// The picture of a texture is not decoded unless a primitive shows it: its head alone must be sound.
#[test]
fn pictures_that_nothing_shows_are_not_decoded() {
    let room = tempfile::tempdir().expect("a directory");
    let uv = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/textures/uv.png")).expect("a picture");
    std::fs::write(room.path().join("cut.png"), &uv[..uv.len() / 2]).expect("written");
    let scene = |color: &str| {
        let text = format!(
            "[textures.cut]\ntype = \"image\"\nfile = \"cut.png\"\n[materials.m]\ntype = \"diffuse\"\nalbedo = {color}\n\
             [[shapes]]\ntype = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n"
        );
        Scene::from_toml(&text, room.path())
    };
    let unused = scene("[1, 1, 1]").expect("nothing shows it");
    let TextureKind::Image(image) = &unused.textures[0].kind else { panic!("a picture") };
    assert_eq!((image.width, image.height, image.texels.len()), (128, 128, 0));
    let used = scene("{ texture = \"cut\" }").expect_err("half a picture").to_string();
    assert!(used.contains("<text>:3:8") && used.contains("cut.png must be a sound PNG"), "{used}");
}
