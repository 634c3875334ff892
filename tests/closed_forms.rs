//! Pictures whose every number is known beforehand.
//!
//! Bounds: f32 colours carry some 1e-7 of rounding, so 1e-5 of the value is exact for all ends here; where
//! a silhouette is sampled, the bound says how many samples its edge has.

mod common;

use std::f64::consts::{PI, TAU};

use common::*;
use glam::{DVec2, DVec3};
use octray::film::Picture;
use octray::scene::*;
use octray::{Renderer, Tracer};

fn render(scene: &Scene) -> Picture {
    Renderer::new(scene).expect("complete").render(&()).expect("a picture").picture
}

fn red(picture: &Picture, x: i32, y: i32) -> f64 {
    f64::from(picture.get(x, y).expect("inside")[0])
}

fn pixels(picture: &Picture) -> impl Iterator<Item = (i32, i32)> + use<> {
    let window = picture.window;
    (0..window.area()).map(move |i| window.pixel(i))
}

fn close(got: f64, want: f64, relative: f64, context: impl std::fmt::Debug) {
    assert!((got - want).abs() <= relative * want.abs().max(1e-3), "{context:?}: got {got}, want {want}");
}

fn silhouette(camera: Camera) -> f64 {
    let mut scene = scene_of([sphere(DVec3::ZERO, 1.0)]);
    scene.cameras = vec![camera];
    scene.image = image(200, 200, 16);
    scene.background.transparent = true;
    render(&scene).pixels.iter().map(|pixel| f64::from(pixel[3])).sum()
}

/// Some 500 pixels lie on the edge; 16 stratified samples leave each a deviation of 0.1, so the sum one
/// of 2.3 pixels of 15,000: the bound is four of these.
#[test]
fn a_spheres_silhouette_has_the_area_of_its_circle() {
    let eye = DVec3::new(1.0, 2.0, 4.0);
    let flat = silhouette(orthographic(eye, DVec3::ZERO, 2.9));
    close(flat, PI * (200.0f64 / 2.9).powi(2), 6e-4, "orthographic");
    // Seen from d, the rim lies at the angle whose sine is r/d.
    let tangent = (1.0 / eye.length()).asin().tan() / 16f64.to_radians().tan();
    let near = silhouette(pinhole(eye, DVec3::ZERO, 32.0));
    close(near, PI * (100.0 * tangent).powi(2), 6e-4, "pinhole");
}

/// Objects behind the camera, seen in a mirror before it, against the same objects beyond the mirror.
#[test]
fn a_plane_mirror_shows_the_mirrored_scene() {
    let flip = |v: DVec3| DVec3::new(v.x, v.y, -v.z);
    let mut dice = Dice(8);
    let (mut real, mut image_of) = (Vec::new(), Vec::new());
    for i in 0..60 {
        let center = DVec3::new(dice.between(-6.0, 6.0), dice.between(-5.0, 5.0), dice.between(9.0, 14.0));
        let half = DVec3::new(dice.unit(), dice.unit(), dice.unit()) * 0.5 + 0.2;
        let shape = |c: DVec3| match i % 3 {
            0 => sphere(c, half.x),
            1 => cuboid(c - half, c + half),
            _ => disk(c, DVec3::new(0.0, 1.0, 0.0), 2.0 * half.x, 0.3 * half.x),
        };
        real.push(shape(center));
        image_of.push(shape(flip(center)));
    }
    let light_at = DVec3::new(3.0, 7.0, 5.0);
    let backdrop = Background { backdrop: Backdrop::Color(DVec3::new(0.1, 0.2, 0.4)), ..Background::default() };
    let complete = |shapes: Vec<Shape>, light: DVec3| Scene {
        lights: vec![point_light(light, 300.0)],
        cameras: vec![pinhole(DVec3::new(0.3, 0.2, 6.0), DVec3::ZERO, 40.0)],
        image: image(160, 120, 1),
        background: backdrop.clone(),
        ..scene_of(shapes)
    };
    let mut mirrored = complete(real, light_at);
    mirrored.materials.push(material("mirror", Model::Mirror { reflectance: Paint::Color(DVec3::ONE) }));
    mirrored.objects.push(object(plane(DVec3::ZERO, DVec3::Z), 1));
    let (seen, direct) = (render(&mirrored), render(&complete(image_of, flip(light_at))));
    let (mut lit, mut off) = (0, 0);
    for (a, b) in seen.pixels.iter().zip(&direct.pixels) {
        let difference = (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
        lit += usize::from(b[0] > 0.15);
        off += usize::from(difference > 1e-4 * (1.0 + b[0]));
    }
    // Rays 1e-6 apart part at edges: a pixel or two of 19,200.
    assert!(lit > 1500 && off < 10, "{lit} lit, {off} off");
}

fn room() -> Scene {
    let mut scene = scene_of([cuboid(-3.0 * DVec3::ONE, 3.0 * DVec3::ONE), sphere(DVec3::new(-1.0, -1.5, -2.0), 0.7)]);
    scene.materials[0] = gray(0.8);
    scene.cameras = vec![pinhole(DVec3::new(0.5, 1.0, 2.5), DVec3::new(-0.5, -0.5, -3.0), 100.0)];
    scene.image = image(80, 60, 4);
    scene
}

#[test]
fn a_white_room_in_ambient_light_is_all_albedo_times_it() {
    let scene = Scene { ambient: DVec3::splat(0.5), ..room() };
    let picture = render(&scene);
    for (x, y) in pixels(&picture) {
        close(red(&picture, x, y), 0.4, 1e-6, (x, y));
    }
}

#[test]
fn a_room_in_distant_light_shows_the_cosine_of_each_wall() {
    let direction = DVec3::new(-0.3, -0.5, -0.9);
    let mut sun = light(Source::Directional { direction, irradiance: DVec3::splat(2.0) });
    sun.shadows = false;
    let mut scene = Scene { lights: vec![sun], ..room() };
    scene.objects.truncate(1);
    scene.image = image(80, 60, 1);
    let picture = render(&scene);
    let wi = -direction.normalize();
    let want: Vec<f64> = [-DVec3::X, DVec3::X, -DVec3::Y, DVec3::Y, DVec3::Z]
        .iter()
        .map(|n| 0.8 / PI * 2.0 * n.dot(wi).max(0.0))
        .collect();
    let mut seen = [0; 5];
    for (x, y) in pixels(&picture) {
        let got = red(&picture, x, y);
        let wall = want.iter().position(|want| (got - want).abs() <= 2e-6 * want);
        seen[wall.unwrap_or_else(|| panic!("{x} {y}: {got} is none of {want:?}"))] += 1;
    }
    // The dark walls look alike; the lit floor and back wall are large.
    assert!(seen.iter().filter(|count| **count > 300).count() >= 3, "{seen:?} {want:?}");
}

/// A floor seen from straight above: 10 units over 101 pixels.
fn floor(source: Source) -> Picture {
    let mut scene = scene_of([plane(DVec3::ZERO, DVec3::Y)]);
    let camera = orthographic(20.0 * DVec3::Y, DVec3::ZERO, 10.1);
    scene.cameras = vec![Camera { up: -DVec3::Z, ..camera }];
    scene.image = image(101, 101, 1);
    scene.lights = vec![light(source)];
    render(&scene)
}

/// The place on the floor under a pixel.
fn under((x, y): (i32, i32)) -> DVec3 {
    DVec3::new(f64::from(x - 50) * 0.1, 0.0, f64::from(y - 50) * 0.1)
}

#[test]
fn light_falls_with_the_square_of_distance_and_the_cosine() {
    let position = DVec3::new(1.0, 2.5, -0.5);
    for falloff in [Falloff::InverseSquare, Falloff::None] {
        let picture = floor(Source::Point { position, intensity: DVec3::splat(7.0), falloff });
        for pixel in pixels(&picture) {
            let way = position - under(pixel);
            let fall = if falloff == Falloff::None { 1.0 } else { 1.0 / way.length_squared() };
            let want = 0.5 / PI * 7.0 * fall * way.normalize().y;
            close(red(&picture, pixel.0, pixel.1), want, 1e-5, (pixel, falloff));
        }
    }
}

#[test]
fn a_spot_fades_between_its_cones() {
    let (position, direction) = (DVec3::new(0.5, 3.0, 0.0), DVec3::new(0.2, -1.0, 0.1));
    for (cone, penumbra) in [(30.0, 12.0), (40.0, 40.0), (25.0, 0.0), (90.0, 5.0)] {
        let picture = floor(Source::Spot { position, direction, intensity: DVec3::splat(5.0), cone, penumbra });
        let (mut full, mut partial, mut dark) = (0, 0, 0);
        for pixel in pixels(&picture) {
            let way = position - under(pixel);
            let angle = (-way).angle_between(direction).to_degrees();
            let edge = cone - angle;
            // Within 1e-4 degrees of a hard edge f32 may fall on either side.
            if penumbra == 0.0 && edge.abs() < 1e-4 {
                continue;
            }
            let s = if penumbra == 0.0 { f64::from(edge > 0.0) } else { (edge / penumbra).clamp(0.0, 1.0) };
            let share = s * s * (3.0 - 2.0 * s);
            let strength = 0.5 / PI * 5.0 * way.normalize().y / way.length_squared();
            let got = red(&picture, pixel.0, pixel.1);
            assert!((got - strength * share).abs() < 1e-5 * strength, "{pixel:?} {cone} {penumbra}: {got} {share}");
            match share {
                0.0 => dark += 1,
                1.0 => full += 1,
                _ => partial += 1,
            }
        }
        assert!(full + partial > 300 && (dark > 300 || cone == 90.0), "{full} {partial} {dark}");
        assert!((partial > 100) == (penumbra > 6.0), "{partial}");
    }
}

/// Unpolarised reflectance of a smooth surface by Fresnel; `ratio` is sin(inside)/sin(outside).
fn fresnel(cos_i: f64, ratio: f64) -> (f64, f64) {
    let sin_t = ratio * (1.0 - cos_i * cos_i).sqrt();
    if sin_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin_t * sin_t).sqrt();
    let s = (ratio * cos_i - cos_t) / (ratio * cos_i + cos_t);
    let p = (cos_i - ratio * cos_t) / (cos_i + ratio * cos_t);
    ((s * s + p * p) / 2.0, cos_t)
}

/// From under water and from above it: Snell's window, total reflection around it, Fresnel everywhere.
#[test]
fn a_surface_of_glass_reflects_and_refracts_as_fresnel_and_snell_say() {
    let (top, bottom) = (DVec3::new(3.0, 0.0, 0.0), DVec3::new(1.0, 0.0, 0.0));
    let sky = |y: f64| 1.0 + 2.0 * (y + 1.0) / 2.0;
    for (eye, ratio) in [(-DVec3::Y, 1.5), (DVec3::Y, 1.0 / 1.5)] {
        let glass = material("glass", Model::Dielectric { ior: 1.5, tint: Paint::Color(DVec3::splat(0.9)) });
        let mut scene = Scene { materials: vec![glass], ..scene_of([plane(DVec3::ZERO, DVec3::Y)]) };
        let camera = pinhole(eye, DVec3::ZERO, 140.0);
        scene.cameras = vec![Camera { up: DVec3::Z, ..camera.clone() }];
        scene.image = image(91, 91, 1);
        scene.background.backdrop = Backdrop::Gradient { top, bottom };
        let picture = render(&scene);
        let (right, up, forward) = scene.cameras[0].axes();
        let scale = 70f64.to_radians().tan() / 91.0;
        let (mut total, mut through) = (0, 0);
        for (x, y) in pixels(&picture) {
            let (sx, sy) = (2.0 * f64::from(x) + 1.0 - 91.0, 91.0 - 2.0 * f64::from(y) - 1.0);
            let dir = (forward + scale * (right * sx + up * sy)).normalize();
            let cos_i = dir.y.abs();
            let (share, cos_t) = fresnel(cos_i, ratio);
            let mut want = share * sky(-dir.y);
            if share < 1.0 {
                want += (1.0 - share) * 0.9 * sky(cos_t.copysign(dir.y));
                through += 1;
            } else {
                total += 1;
            }
            // Close to the critical angle the refracted direction turns by the square root of a rounding.
            let tolerance = if share < 1.0 && cos_t < 0.05 { 1e-3 } else { 2e-5 };
            close(red(&picture, x, y), want, tolerance, (x, y, eye));
        }
        assert!(through > 500 && (total > 500) == (ratio > 1.0), "{through} {total}");
    }
}

/// A bright disk behind a slab, seen at a slant: its image moves by d sin a (1 - cos a / (n cos b)).
#[test]
fn a_glass_slab_shifts_what_is_behind_it() {
    let angle = 50f64.to_radians();
    let view = DVec3::new(angle.sin(), 0.0, -angle.cos());
    let (thick, ior) = (0.8, 1.5);
    let centroid = |slab: bool| {
        let mut scene = scene_of([disk(3.0 * view, view, 0.4, 0.0)]);
        scene.materials.push(material("glass", Model::Dielectric { ior, tint: Paint::Color(DVec3::ONE) }));
        if slab {
            let half = DVec3::new(50.0, 50.0, thick / 2.0);
            scene.objects.push(object(cuboid(-half, half), 1));
        }
        scene.ambient = DVec3::ONE;
        scene.cameras = vec![orthographic(-6.0 * view, DVec3::ZERO, 3.0)];
        scene.image = image(240, 240, 4);
        // In, across, out: what is reflected within goes no further.
        scene.render.max_depth = 3;
        let picture = render(&scene);
        let (mut weight, mut sum) = (0.0, DVec2::ZERO);
        for (x, y) in pixels(&picture) {
            let value = red(&picture, x, y);
            weight += value;
            sum += value * DVec2::new(f64::from(x), f64::from(y));
        }
        (weight, sum / weight)
    };
    let ((plain, from), (dimmed, to)) = (centroid(false), centroid(true));
    let cos_b = (1.0 - (angle.sin() / ior).powi(2)).sqrt();
    let shift = thick * angle.sin() * (1.0 - angle.cos() / (ior * cos_b)) * 80.0;
    // Pixels of an 80th; the centroid of 3,200 of them is good to a hundredth.
    assert!(((to - from).x.abs() - shift).abs() < 0.03 && (to - from).y.abs() < 0.03, "{from} {to} {shift}");
    let (share, _) = fresnel(angle.cos(), 1.0 / ior);
    close(dimmed / plain, (1.0 - share).powi(2), 2e-3, "both faces reflect a share");
}

#[test]
fn a_transparent_background_is_clear_before_the_camera_and_there_for_mirrors() {
    let mut scene = scene_of([sphere(DVec3::ZERO, 1.0)]);
    scene.materials[0] = material("mirror", Model::Mirror { reflectance: Paint::Color(DVec3::splat(0.5)) });
    scene.background =
        Background { backdrop: Backdrop::Color(DVec3::new(1.0, 2.0, 4.0)), transparent: true, light: true };
    scene.cameras = vec![pinhole(5.0 * DVec3::Z, DVec3::ZERO, 40.0)];
    scene.image = image(31, 31, 1);
    let picture = render(&scene);
    assert_eq!(picture.get(0, 0), Some([0.0; 4]));
    assert_eq!(picture.get(15, 15), Some([0.5, 1.0, 2.0, 1.0]));
    let at_edges = picture.pixels.iter().filter(|pixel| pixel[3] != 0.0 && pixel[3] != 1.0).count();
    assert_eq!(at_edges, 0, "one sample is in or out");
    scene.background.transparent = false;
    let picture = render(&scene);
    assert_eq!(picture.get(0, 0), Some([1.0, 2.0, 4.0, 1.0]));
    scene.background.transparent = true;
    scene.image = image(31, 31, 64);
    let partial =
        render(&scene).pixels.into_iter().filter(|pixel| pixel[3] > 0.0 && pixel[3] < 1.0).collect::<Vec<_>>();
    assert!(
        partial.len() > 20
            && partial.iter().all(|[r, _, b, a]| (r - 0.5 * a).abs() < 1e-6 && (b - 2.0 * a).abs() < 1e-6)
    );
}

/// Where on each primitive a point has which uv, written down from the scene format by hand.
#[test]
fn every_primitive_has_the_uv_that_the_format_says() {
    let down = |x: f64, z: f64| ray(DVec3::new(x, 9.0, z), -DVec3::Y);
    let along_x = |y: f64, z: f64| ray(DVec3::new(-9.0, y, z), DVec3::X);
    // By Duff's formula with n = (0, 1, 0): a = -1, b = 0.
    let (x, y) = (DVec3::X, -DVec3::Z);
    let at = |p: DVec3, axes: (DVec3, DVec3)| DVec2::new(p.dot(axes.0), p.dot(axes.1));
    let turn = |v: DVec2| (v.y.atan2(v.x) / TAU).rem_euclid(1.0);
    let p = DVec3::new(0.5, 0.0, -0.25);
    let roof = p.with_y((1.0 - 0.3125f64).sqrt());
    let tower = |caps| Shape::Cylinder(Cylinder { base: -DVec3::Y, apex: 3.0 * DVec3::Y, radius: 1.0, caps });
    let quad = polygon([
        DVec3::new(1.0, 0.0, 1.0),
        DVec3::new(1.0, 0.0, -1.0),
        DVec3::new(-1.0, 0.0, -1.0),
        DVec3::new(-1.0, 0.0, 1.0),
    ]);
    let hat = Shape::Cone(Cone { base: DVec3::ZERO, apex: 2.0 * DVec3::Y, radius: 1.0, apex_radius: 0.0, caps: true });
    let side = DVec3::new(-(1.0f64 - 0.0625).sqrt(), 0.0, 0.25);
    let hat_side = DVec3::new(-(0.5625f64 - 0.0625).sqrt(), 0.0, 0.25);
    #[rustfmt::skip]
    let cases = [
        (sphere(DVec3::ZERO, 1.0), down(0.5, -0.25), DVec2::new((-0.25f64).atan2(0.5) / TAU + 1.0, roof.y.acos() / PI)),
        (sphere(DVec3::ZERO, 1.0), along_x(0.0, 0.0), DVec2::new(0.5, 0.5)),
        (sphere(DVec3::ZERO, 1.0), down(0.0, 0.25), DVec2::new(0.25, (0.25f64).asin() / PI)),
        (plane(DVec3::new(0.25, 0.0, 0.0), DVec3::Y), down(0.5, -0.25), at(p - 0.25 * DVec3::X, (x, y))),
        (disk(DVec3::ZERO, DVec3::Y, 2.0, 0.0), down(0.5, -0.25), DVec2::new(turn(at(p, (x, y))), p.length() / 2.0)),
        // From (1,0,1) along -z; across is n x edge with n = +y: y x -z = -x.
        (quad, down(0.5, -0.25), DVec2::new(1.25, 0.5)),
        // A y face has u along z and v along x; an x face u along y and v along z.
        (cuboid(DVec3::new(-1.0, -2.0, -1.0), DVec3::ONE), down(0.5, -0.25), DVec2::new(0.375, 0.75)),
        (cuboid(DVec3::new(-1.0, -2.0, -1.0), DVec3::ONE), along_x(0.25, -0.5), DVec2::new(0.75, 0.25)),
        (tower(false), along_x(0.0, 0.25), DVec2::new(turn(at(side, (x, y))), 0.25)),
        (hat, along_x(0.5, 0.25), DVec2::new(turn(at(hat_side, (x, y))), 0.25)),
    ];
    for (shape, ray, want) in cases {
        let scene = scene_of([shape.clone()]);
        let hit = Tracer::new(&scene).expect("valid").closest_hit(&ray).expect("aimed at it");
        let got = DVec2::new(f64::from(hit.uv[0]), f64::from(hit.uv[1]));
        assert!((got - want).length() < 1e-6, "{shape:?}: got {got}, want {want}");
        assert!(checker_shows(scene, &ray, want), "{shape:?} {want}");
    }
}

/// Whether a picture of one pixel along the ray has the colour of the checker's cell of this uv.
fn checker_shows(mut scene: Scene, ray: &octray::Ray, uv: DVec2) -> bool {
    let scale = [7.3, 5.9];
    let colors = [DVec3::splat(0.25), DVec3::splat(0.75)];
    scene.textures = vec![Texture { name: "squares".into(), kind: TextureKind::Checker(Checker { colors, scale }) }];
    scene.materials[0] = material("squares", Model::Diffuse { albedo: Paint::Texture(0) });
    scene.ambient = DVec3::ONE;
    let (eye, dir) = (exact(ray).origin, exact(ray).dir);
    let up = if dir.x == 0.0 { DVec3::X } else { DVec3::Y };
    scene.cameras = vec![Camera { up, ..pinhole(eye, eye + dir, 10.0) }];
    scene.image = image(1, 1, 1);
    let cell = ((uv.x * scale[0]).floor() + (uv.y * scale[1]).floor()).rem_euclid(2.0);
    red(&render(&scene), 0, 0) == if cell == 0.0 { 0.25 } else { 0.75 }
}

/// A constant stays what it is under every filter and number of samples.
#[test]
fn filters_keep_a_constant() {
    for kind in [FilterKind::Box, FilterKind::Gaussian, FilterKind::BlackmanHarris] {
        for spp in [1, 3, 16, 70] {
            let mut scene = room();
            scene.ambient = DVec3::splat(1.25);
            scene.image = image(12, 9, spp);
            scene.image.as_mut().expect("set").filter = Filter { kind, radius: 2.0 };
            for pixel in render(&scene).pixels {
                assert!((pixel[0] - 1.0).abs() <= 2.0 * f32::EPSILON && pixel[3] == 1.0, "{kind:?} {spp}: {pixel:?}");
            }
        }
    }
}

/// Across a straight edge a filtered picture is the filter's integral: the edge at 0 gives half, and
/// pixels further off than the radius see nothing of it.
#[test]
fn filters_spread_an_edge_by_their_integral() {
    for kind in [FilterKind::Box, FilterKind::Gaussian, FilterKind::BlackmanHarris] {
        let radius = 2.0;
        let mut scene = scene_of([cuboid(DVec3::new(0.0, -9.0, -1.0), DVec3::new(9.0, 9.0, 0.0))]);
        scene.ambient = DVec3::splat(2.0);
        scene.cameras = vec![orthographic(5.0 * DVec3::Z, DVec3::ZERO, 4.0)];
        scene.image = Some(ImageSettings { width: 8, height: 4, spp: 256, filter: Filter { kind, radius } });
        let picture = render(&scene);
        let integral = |from: f64| {
            let weight = |k: i32| kind.weight(f64::from(k) / 4000.0);
            let (mut above, mut all) = (0.0, 0.0);
            for k in -4000..4000 {
                all += weight(k);
                above += if f64::from(k) / 4000.0 >= from { weight(k) } else { 0.0 };
            }
            above / all
        };
        for x in 0..8 {
            // The pixel's centre lies (x - 3.5) right of the edge, which a sample passes at -(x - 3.5).
            let offset = (3.5 - f64::from(x)) / radius;
            let want = if offset.abs() >= 1.0 { f64::from(offset < 0.0) } else { integral(offset) };
            let got = (0..4).map(|y| red(&picture, x, y)).sum::<f64>() / 4.0;
            // 256 stratified samples put the edge within one of 256 columns.
            assert!((got - want).abs() < 6e-3, "{kind:?} {x}: {got} {want}");
        }
    }
}
