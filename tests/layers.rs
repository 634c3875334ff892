//! Layers beside the colour: against closed forms, against the reference, in windows, and what they never hold.

mod common;

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use glam::DVec3;
use half::f16;
use octray::film::{Channel, Cryptomatte, Picture, Samples, Window};
use octray::render::{Engine, Rendering};
use octray::scene::{Aov, Layers, Shape};
use octray::{Renderer, Scene};

/// A red ball before a wall, a mirror, glass, textures, a cloud: something of everything.
const SCENE: &str = r#"
format = 1
[image]
width = 72
height = 50
spp = 6
[camera]
type = "pinhole"
eye = [0.5, 0.25, 8]
target = [0, 0, 0]
vfov = 40
[background]
color = [0.1, 0.2, 0.3]
[materials.red]
type = "diffuse"
albedo = [0.8, 0.1, 0.05]
[materials.chrome]
type = "mirror"
reflectance = [0.9, 0.8, 0.7]
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.gloss]
type = "phong"
color = [0.3, 0.9, 1.0]
kd = 0.6
ks = 0.7
shine = 20
[materials.squares]
type = "diffuse"
albedo = { texture = "squares" }
[textures.squares]
type = "checker"
colors = [[0.1, 0.1, 0.1], [0.9, 0.9, 0.9]]
scale = [8, 8]
[[lights]]
type = "point"
position = [5, 6, 8]
intensity = [300, 300, 300]
[[groups]]
name = "front"
[[shapes]]
type = "sphere"
name = "ball"
center = [-1.2, 0.3, 0]
radius = 1
material = "red"
group = "front"
[[shapes]]
type = "sphere"
name = "ball"
center = [1.1, 0.9, 0.3]
radius = 0.7
material = "chrome"
[[shapes]]
type = "sphere"
name = "lens"
center = [0.5, -0.9, 1.5]
radius = 0.6
material = "glass"
[[shapes]]
type = "polygon"
name = "wall"
corners = [[-3, -2, -2], [3, -2, -2], [3, 1.4, -2], [-3, 1.4, -2]]
material = "squares"
[[clouds]]
type = "spheres"
name = "dust"
file = "dust.csv"
material = "gloss"
group = "front"
"#;

fn scene() -> Scene {
    let room = tempfile::tempdir().unwrap();
    let row = |k: u32| format!("{},{},{},{}\n", f64::from(k % 7) * 0.8 - 2.6, f64::from(k / 7) * 0.7 - 1.9, 0.9, 0.16);
    let rows: String = (0..28).map(row).collect();
    std::fs::write(room.path().join("dust.csv"), format!("x,y,z,r\n{rows}")).unwrap();
    Scene::from_toml(SCENE, room.path()).unwrap()
}

fn everything() -> Layers {
    Layers::default().with_named("all").unwrap()
}

fn render<'s>(scene: &'s Scene, layers: Layers, set: impl FnOnce(Renderer<'s>) -> Renderer<'s>) -> Rendering {
    set(Renderer::new(scene).unwrap().layers(layers)).render(&()).unwrap()
}

fn floats<'p>(picture: &'p Picture, name: &str) -> Cow<'p, [f32]> {
    picture.channel(name).and_then(|channel| channel.samples.floats()).unwrap_or_else(|| panic!("{name}"))
}

fn ids<'p>(picture: &'p Picture, name: &str) -> &'p [u32] {
    match picture.channel(name) {
        Some(Channel { samples: Samples::Uint(ids), .. }) => ids,
        other => panic!("{name}: {other:?}"),
    }
}

/// Bits of all samples, so that equal means equal to the bit.
fn bits(picture: &Picture) -> Vec<(String, Vec<u32>)> {
    let color = ("RGBA".to_owned(), picture.pixels.iter().flatten().map(|x| x.to_bits()).collect());
    let channel = |channel: &Channel| {
        let samples = &channel.samples;
        (channel.name.clone(), (0..samples.len()).map(|i| samples.bits(i)).collect())
    };
    std::iter::once(color).chain(picture.channels.iter().map(channel)).collect()
}

/// One sphere straight ahead, one sample a pixel: every value is known.
#[test]
fn layers_are_what_geometry_says() {
    let text = r#"
        format = 1
        [image]
        width = 41
        height = 31
        spp = 1
        [camera]
        type = "pinhole"
        eye = [100, 0, 5]
        target = [100, 0, 0]
        vfov = 60
        [materials.clay]
        type = "diffuse"
        albedo = [0.5, 0.25, 0.125]
        [[shapes]]
        type = "sphere"
        center = [100, 0, 0]
        radius = 2
        material = "clay"
    "#;
    let scene = Scene::from_toml(text, Path::new(".")).unwrap();
    let Rendering { picture, names, .. } = render(&scene, everything(), |renderer| renderer);
    let (mut hits, scale) = (0, (30f64.to_radians()).tan());
    for index in 0..picture.window.area() {
        let (x, y) = picture.window.pixel(index);
        let across = (2.0 * (f64::from(x) + 0.5) - 41.0) / 31.0 * scale;
        let upward = (31.0 - 2.0 * (f64::from(y) + 0.5)) / 31.0 * scale;
        // |(across, upward, -1) t + (0, 0, 5)| = 2
        let a = across * across + upward * upward + 1.0;
        let root = 25.0 - a * 21.0;
        let at = |name: &str| f64::from(floats(&picture, name)[index]);
        let vector = |layer: &str| ["X", "Y", "Z"].map(|axis| at(&format!("{layer}.{axis}")));
        assert_eq!(at("samples.Y"), 1.0);
        if root < 0.0 {
            assert_eq!(at("depth.Z"), 1e10);
            assert_eq!((vector("P"), vector("N"), ids(&picture, "id.object")[index]), ([0.0; 3], [0.0; 3], 0));
            assert_eq!(at("crypto_object00.G"), 0.0);
            continue;
        }
        hits += 1;
        let t = (5.0 - root.sqrt()) / a;
        let normal = [across * t / 2.0, upward * t / 2.0, (5.0 - t) / 2.0];
        let point = [100.0 + 2.0 * normal[0], 2.0 * normal[1], 2.0 * normal[2]];
        let near = |got: f64, want: f64, bound: f64| assert!((got - want).abs() <= bound, "{x} {y}: {got} {want}");
        near(at("depth.Z"), t, 4e-6 * t);
        (0..3).for_each(|k| near(vector("P")[k], point[k], 2e-7 * point[k].abs().max(1.0)));
        // And what a half rounds off.
        (0..3).for_each(|k| near(vector("N")[k], normal[k], 3e-6 + normal[k].abs() * 2f64.powi(-11)));
        assert_eq!(["R", "G", "B"].map(|c| at(&format!("albedo.{c}"))), [0.5, 0.25, 0.125]);
        assert_eq!((ids(&picture, "id.object")[index], ids(&picture, "id.material")[index]), (1, 1));
        let id = Cryptomatte::id("sphere 0");
        assert_eq!((floats(&picture, "crypto_object00.R")[index].to_bits(), at("crypto_object00.G")), (id, 1.0));
        assert_eq!(floats(&picture, "crypto_asset00.R")[index].to_bits(), Cryptomatte::id("default"));
    }
    assert!(hits > 200, "{hits}");
    assert_eq!(names.object.into_iter().collect::<Vec<_>>(), [(1, "sphere 0".to_owned())]);
    assert_eq!(names.material[&1], "clay");
}

/// Two engines that share no formula: the same layers up to rounding, the same ids and coverages to the bit
/// but where a sample grazes an edge.
#[test]
fn both_engines_give_the_same_layers() {
    let scene = scene();
    for instances in [false, true] {
        let mut layers = everything();
        layers.instances = instances;
        let ours = render(&scene, layers, |renderer| renderer).picture;
        let single = render(&scene, layers, |renderer| renderer.engine(Engine::Single)).picture;
        assert_eq!(bits(&ours), bits(&single));
        let theirs = render(&scene, layers, |renderer| renderer.engine(Engine::Reference)).picture;
        assert!(alike(&ours, &theirs) > 100_000);
    }
}

/// Makes sure that two pictures have the same channels, but for some roundings and two pixels: how many samples those have.
fn alike(ours: &Picture, theirs: &Picture) -> usize {
    assert_eq!(ours.cryptomattes, theirs.cryptomattes);
    let names = |picture: &Picture| picture.channels.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(ours), names(theirs));
    let mut compared = 0;
    for (a, b) in ours.channels.iter().zip(&theirs.channels) {
        let different = match (&a.samples, &b.samples) {
            (Samples::Uint(a), Samples::Uint(b)) => a.iter().zip(b).filter(|(a, b)| a != b).count(),
            (Samples::Half(a), Samples::Half(b)) => {
                // What differs by so little is rounded to the same half or the next one; 0 has neighbours of both signs.
                let far = |(a, b): (&f16, &f16)| {
                    let apart = i32::from(a.to_bits()).abs_diff(i32::from(b.to_bits()));
                    apart > 1 && (a.to_f32() - b.to_f32()).abs() > 2e-5 * 0.05
                };
                a.iter().zip(b).filter(|pair| far(*pair)).count()
            }
            (Samples::Float(a), Samples::Float(b)) => {
                let far = |(a, b): (&f32, &f32)| a.to_bits() != b.to_bits() && (a - b).abs() > 2e-5 * b.abs().max(0.05);
                a.iter().zip(b).filter(|pair| far(*pair)).count()
            }
            other => panic!("{other:?}"),
        };
        assert!(different <= 2, "{}: {different} pixels", a.name);
        compared += a.samples.len();
    }
    compared
}

#[test]
fn the_beauty_is_the_same_with_and_without_layers() {
    let scene = scene();
    let plain = render(&scene, Layers::default(), |renderer| renderer).picture;
    assert_eq!(plain.channels, []);
    for layers in [everything().with(Aov::Cost), Layers::default().with(Aov::Cost)] {
        assert_eq!(render(&scene, layers, |renderer| renderer).picture.pixels, plain.pixels);
    }
}

/// The same bits in every channel, whatever part of the picture is rendered, and beyond its edges.
#[test]
fn crops_and_overscan_are_the_whole_to_the_bit() {
    let scene = scene();
    for spp in [1, 5, 16] {
        let layers = everything().with(Aov::Cost);
        let whole = render(&scene, layers, |renderer| renderer.spp(spp)).picture;
        let wide = render(&scene, layers, |renderer| renderer.spp(spp).overscan([9, 40])).picture;
        assert_eq!(wide.window, Window { x0: -9, y0: -40, x1: 81, y1: 90 });
        assert_eq!(bits(&wide.crop(whole.window).unwrap()), bits(&whole), "{spp}");
        for window in [(5, 3, 40, 45), (31, 31, 33, 33), (0, 0, 1, 1), (64, 0, 72, 50)] {
            let window = Window { x0: window.0, y0: window.1, x1: window.2, y1: window.3 };
            let part = render(&scene, layers, |renderer| renderer.spp(spp).crop(window).threads(1)).picture;
            let want = whole.crop(window).unwrap();
            assert_eq!(bits(&part), bits(&want), "{window} {spp}");
            assert_eq!(part.cryptomattes, want.cryptomattes, "{window} {spp}");
        }
        let far = Window { x0: -9, y0: -40, x1: 3, y1: 2 };
        let part = render(&scene, layers, |renderer| renderer.spp(spp).overscan([9, 40]).crop(far)).picture;
        assert_eq!(bits(&part), bits(&wide.crop(far).unwrap()));
    }
}

/// Coverages are shares of samples: they sum to alpha, fall from rank to rank, and their ids are in the manifest.
#[test]
fn mattes_cover_what_is_seen() {
    let mut scene = scene();
    scene.background.transparent = true;
    let mut layers = everything();
    (layers.instances, layers.ranks) = (true, 12);
    let picture = render(&scene, layers, |renderer| renderer.spp(24)).picture;
    assert_eq!(
        picture.cryptomattes.iter().map(|m| &*m.name).collect::<Vec<_>>(),
        ["crypto_object", "crypto_material", "crypto_asset"]
    );
    for matte in &picture.cryptomattes {
        let rank = |rank: usize| {
            let suffixes = if rank.is_multiple_of(2) { ["R", "G"] } else { ["B", "A"] };
            suffixes.map(|suffix| floats(&picture, &format!("{}{:02}.{suffix}", matte.name, rank / 2)))
        };
        let ranks: Vec<_> = (0..12).map(rank).collect();
        let known: Vec<u32> = matte.manifest.values().copied().collect();
        let mut shared = 0;
        for (index, pixel) in picture.pixels.iter().enumerate() {
            let pairs = ranks.iter().map(|[ids, shares]| (ids[index].to_bits(), shares[index]));
            let pairs: Vec<_> = pairs.filter(|(_, share)| *share > 0.0).collect();
            let sum: f64 = pairs.iter().map(|(_, share)| f64::from(*share)).sum();
            assert!((sum - f64::from(pixel[3])).abs() < 1e-6, "{}: {sum} {}", matte.name, pixel[3]);
            assert!(pairs.windows(2).all(|two| (two[0].1, two[1].0) > (two[1].1, two[0].0)), "{pairs:?}");
            assert!(pairs.iter().all(|(id, _)| known.contains(id)));
            shared += usize::from(pairs.len() > 1);
        }
        assert!(shared > 50, "{}", matte.name);
    }
    let names = |index: usize| picture.cryptomattes[index].manifest.keys().map(String::as_str).collect::<Vec<_>>();
    assert_eq!(names(2), ["default", "front"]);
    assert_eq!(names(1), ["chrome", "glass", "gloss", "red", "squares"]);
    assert!(names(0).contains(&"dust:17") && names(0).contains(&"ball") && !names(0).contains(&"dust"));
}

/// Lights that are seen are objects of their own: they have coverage, numbers, depth and place, in both engines.
#[test]
fn lights_that_are_seen_have_ids() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/area_lights.toml");
    let mut scene = Scene::load(&path).unwrap();
    scene.background.transparent = true;
    for spp in [1, 5, 16] {
        let all = everything();
        let ours = render(&scene, all, |renderer| renderer.resolution(96, 60).spp(spp));
        let theirs = render(&scene, all, |renderer| renderer.resolution(96, 60).spp(spp).engine(Engine::Reference));
        // The light itself is noise, the same in both but for roundings that a variance may magnify.
        let only = |mut picture: Picture| {
            picture.channels.retain(|channel| channel.layer() != "variance");
            picture
        };
        let (ours, theirs) = ((only(ours.picture), ours.names), (only(theirs.picture), theirs.names));
        assert!(alike(&ours.0, &theirs.0) > 100_000 && ours.1 == theirs.1, "{spp}");
        let (picture, names) = ours;
        let named = |table: &std::collections::BTreeMap<u32, String>, name: &str| table.values().any(|n| n == name);
        for name in ["bulb", "spot", "panel"] {
            assert!(picture.cryptomattes[..2].iter().all(|matte| matte.manifest.contains_key(name)), "{name}");
            assert!(named(&names.object, name) && named(&names.material, name), "{name}");
        }
        let lit = |name: &str| *names.object.iter().find(|(_, n)| *n == name).unwrap().0;
        let (depth, objects) = (floats(&picture, "depth.Z"), ids(&picture, "id.object"));
        let place = ["P.X", "P.Y", "P.Z"].map(|name| floats(&picture, name));
        for (index, pixel) in picture.pixels.iter().enumerate() {
            let shares = (0..6).map(|rank| format!("crypto_object{:02}.{}", rank / 2, ["G", "A"][rank % 2]));
            let sum: f32 = shares.map(|name| floats(&picture, &name)[index]).sum();
            assert!((sum - pixel[3]).abs() < 1e-6, "{sum} {}", pixel[3]);
            assert_eq!(objects[index] == 0, depth[index] == 1e10);
            if objects[index] == lit("bulb") {
                let off = [place[0][index] + 2.6, place[1][index] - 2.6, place[2][index] - 0.4];
                assert!((off.iter().map(|x| x * x).sum::<f32>().sqrt() - 0.3).abs() < 1e-4, "{off:?}");
            }
        }
    }
}

/// The variance layer against the scatter of the same pixels under other seeds.
#[test]
fn variance_is_that_of_the_mean() {
    let scene = scene();
    let layers = Layers::default().with(Aov::Variance);
    let runs: Vec<Picture> =
        (0..24).map(|seed| render(&scene, layers, |renderer| renderer.spp(16).seed(seed)).picture).collect();
    let (mut estimate, mut scatter) = (0.0, 0.0);
    for index in 0..runs[0].pixels.len() {
        let values: Vec<f64> = runs.iter().map(|run| f64::from(run.pixels[index][0])).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        scatter += values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64;
        let said: f64 = runs.iter().map(|run| f64::from(floats(run, "variance.R")[index])).sum();
        estimate += said / runs.len() as f64;
    }
    let ratio = estimate / scatter;
    assert!((1.0..3.0).contains(&ratio), "{ratio}");
}

/// A ball that moves, a camera that turns: pixels go where the next frame shows the same place.
#[test]
fn motion_leads_to_the_next_frame() {
    let now = scene();
    let mut next = now.clone();
    next.cameras[0].eye.x += 0.5;
    match &mut next.objects[0].shape {
        Shape::Sphere(ball) => (ball.center.y, ball.radius) = (0.6, 1.2),
        other => panic!("{other:?}"),
    }
    let mut layers = everything();
    layers.instances = true;
    let still = render(&now, layers, |renderer| renderer.next_frame(&now)).picture;
    assert!(["forward.u", "forward.v"].iter().all(|name| floats(&still, name).iter().all(|x| *x == 0.0)));
    let ours = render(&now, layers, |renderer| renderer.next_frame(&next).spp(1)).picture;
    let theirs = render(&now, layers, |renderer| renderer.next_frame(&next).spp(1).engine(Engine::Reference)).picture;
    let (u, v) = (floats(&ours, "forward.u"), floats(&ours, "forward.v"));
    let far = |name: &str| {
        let (ours, theirs) = (floats(&ours, name), floats(&theirs, name));
        ours.iter().zip(&*theirs).filter(|(a, b)| (*a - *b).abs() > 1e-3).count()
    };
    assert!(far("forward.u") + far("forward.v") <= 2);
    // The ball's own points, from its first place and size to the second.
    let (camera, moved) = (&now.cameras[0], &next.cameras[0]);
    let (first, second) = (DVec3::new(-1.2, 0.3, 0.0), DVec3::new(-1.2, 0.6, 0.0));
    let mut compared = 0;
    for index in (0..ours.window.area()).filter(|index| ids(&ours, "id.object")[*index] == 1) {
        let point = DVec3::from_array(["P.X", "P.Y", "P.Z"].map(|name| f64::from(floats(&ours, name)[index])));
        let before = camera.project((72, 50), point).unwrap();
        let after = moved.project((72, 50), second + (point - first) * 1.2).unwrap();
        assert!((f64::from(u[index]) - (after.x - before.x)).abs() < 1e-3, "{} {}", u[index], after.x - before.x);
        assert!((f64::from(v[index]) + (after.y - before.y)).abs() < 1e-3, "{} {}", v[index], after.y - before.y);
        compared += usize::from(v[index] > 0.0);
    }
    assert!(compared > 50, "up is positive: {compared}");
}

fn shipped() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let files = std::fs::read_dir(root).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    files
}

/// No NaN, no infinity and nothing negative where that has no meaning, on every shipped scene.
#[test]
fn layers_hold_nothing_that_spreads() {
    let mut layers = everything().with(Aov::Cost);
    layers.instances = true;
    let mut scenes = 0;
    for path in shipped() {
        let scene = Scene::load(&path).unwrap();
        if scene.image.is_none() {
            continue;
        }
        let picture = render(&scene, layers, |renderer| renderer.resolution(64, 48).spp(4)).picture;
        let sound = |x: &f32| x.is_finite();
        assert!(picture.pixels.iter().flatten().all(|x| x.is_finite() && *x >= 0.0), "{}", path.display());
        for channel in &picture.channels {
            let Some(samples) = channel.samples.floats() else { continue };
            // The bits of an id may be those of a negative float.
            let is_id = channel.name.starts_with("crypto") && channel.name.ends_with(['R', 'B']);
            let signed = is_id || ["P", "N", "uv", "forward"].contains(&channel.layer());
            assert!(samples.iter().all(|x| sound(x) && (signed || *x >= 0.0)), "{} {}", path.display(), channel.name);
        }
        assert!(floats(&picture, "depth.Z").iter().all(|depth| *depth > 0.0));
        scenes += 1;
    }
    assert!(scenes > 6, "{scenes}");
}

/// To a noise level layers are means of the samples that they are made of, however many those are.
#[test]
fn layers_to_a_noise_level_are_those_of_samples_enough() {
    let scene = scene();
    let layers = everything();
    let plain = render(&scene, layers, |renderer| renderer.spp(64)).picture;
    let noise = render(&scene, layers, |renderer| renderer.spp(16).noise(Some(0.02))).picture;
    let mut compared = 0;
    for (a, b) in plain.channels.iter().zip(&noise.channels).filter(|(a, _)| ["N", "albedo"].contains(&a.layer())) {
        let (Some(a), Some(b)) = (a.samples.floats(), b.samples.floats()) else { continue };
        let far = a.iter().zip(&*b).filter(|(a, b)| (*a - *b).abs() > 0.2).count();
        assert!(far * 10 < a.len(), "{far} of {}", a.len());
        compared += 1;
    }
    assert_eq!(compared, 6);
    let sum = |picture: &Picture| floats(picture, "crypto_object00.G").iter().sum::<f32>();
    assert!((sum(&noise) / sum(&plain) - 1.0).abs() < 0.02, "{} {}", sum(&noise), sum(&plain));
}

/// Margins are large in the middle of what is seen and fall toward its rims, below 8 where f64 had to decide: from far
/// away more of them. Both engines tell the same.
#[test]
fn margins_tell_what_f32_could_not() {
    let mut scene = scene();
    scene.objects.retain(|object| object.name.as_deref() == Some("ball"));
    scene.clouds.clear();
    let layers = Layers::default().with(Aov::Margin).with(Aov::Ids);
    let both = |scene: &Scene, slack: f32| {
        let [ours, theirs] = [Engine::Packet, Engine::Reference]
            .map(|engine| render(scene, layers, |renderer| renderer.spp(1).engine(engine)).picture);
        let (ours, theirs) = (floats(&ours, "margin.Y").to_vec(), floats(&theirs, "margin.Y").to_vec());
        // Far away coordinates are relative to other places, and so are their roundings.
        let close = |(a, b): (&f32, &f32)| (a - b).abs() <= slack * b.abs().max(8.0);
        assert!(ours.iter().zip(&theirs).all(close));
        ours
    };
    let seen = |margins: &[f32]| margins.iter().copied().filter(|margin| *margin < 1e10).collect::<Vec<_>>();
    let near = both(&scene, 1e-3);
    let ball = seen(&near);
    assert!(ball.len() > 100 && near.len() > ball.len() && near.contains(&1e10));
    let (least, most) = (ball.iter().copied().fold(f32::MAX, f32::min), ball.iter().copied().fold(0.0, f32::max));
    assert!(least > 8.0 && most > 1e5 && least < 0.2 * most, "{least} {most}");
    let camera = &mut scene.cameras[0];
    camera.eye = camera.target + (camera.eye - camera.target) * 1e5;
    camera.lens = octray::scene::Lens::Pinhole { vfov: 40.0 / 1e5 };
    let ball = seen(&both(&scene, 1.0));
    let open = ball.iter().filter(|margin| **margin < 8.0).count();
    assert!(ball.len() > 100 && open > 5 && open < ball.len(), "{open} of {}", ball.len());
}
