//! Scenes that are written and read again.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3};

use super::*;
use crate::scene::{
    Backdrop, Background, Camera, Checker, Cloud, CloudMaterial, CloudShapes, ColorSpace, Cone, Cuboid, Cylinder, Disk,
    Emitter, Falloff, Filter, FilterKind, ImageSettings, ImageTexture, Integrator, Lens, Light, Material, Model,
    Object, Paint, Plane, Polygon, RenderSettings, Rows, Shape, Source, Sphere, Texture, TextureFilter, TextureKind,
    Visible, Wrap, nff,
};

/// Numbers whose digits are many.
const THIRD: f64 = 1.0 / 3.0;
const ODD: DVec3 = DVec3::new(THIRD, -0.1, 1e-300);

fn object(shape: Shape, material: usize) -> Object {
    Object { shape, material, name: None, group: None }
}

fn shapes() -> Vec<Object> {
    let square = vec![DVec3::ZERO, DVec3::X * THIRD, DVec3::new(THIRD, 0.7, 0.0), DVec3::Y * 0.7];
    let mapped = Polygon {
        corners: square.clone(),
        uvs: vec![DVec2::new(THIRD, -0.0), DVec2::X, DVec2::ONE, DVec2::Y],
        normals: vec![ODD, DVec3::Z, DVec3::X, DVec3::Y],
    };
    let rotation = Some(DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.1));
    let (base, apex) = (DVec3::splat(0.1), DVec3::splat(0.7));
    let mut shapes = vec![
        object(Shape::Sphere(Sphere { center: ODD, radius: THIRD }), 0),
        object(Shape::Plane(Plane { point: ODD, normal: DVec3::new(0.0, THIRD, -2.0) }), 1),
        object(Shape::Disk(Disk { center: ODD, normal: DVec3::X * 3.0, radius: 0.3, inner_radius: 0.1 }), 2),
        object(Shape::Polygon(Polygon { corners: square, ..Polygon::default() }), 3),
        object(Shape::Polygon(mapped), 0),
        object(Shape::Box(Cuboid { min: base, max: apex, rotation: None }), 1),
        object(Shape::Box(Cuboid { min: base, max: apex, rotation }), 2),
        object(Shape::Cylinder(Cylinder { base, apex, radius: THIRD, caps: false }), 3),
        object(Shape::Cone(Cone { base, apex, radius: THIRD, apex_radius: 0.0, caps: true }), 0),
    ];
    shapes[0].name = Some("a \"ball\"".to_owned());
    shapes[1].group = Some(1);
    shapes
}

fn materials() -> Vec<Material> {
    let white = Paint::Color(DVec3::ONE);
    let phong = Model::Phong { color: white, kd: THIRD, ks: 0.2, shine: 1e5, transmittance: 0.1, ior: 0.0 };
    let material = |name: &str, model, back, visible| Material { name: name.to_owned(), model, back, visible };
    vec![
        material("clay", Model::Diffuse { albedo: Paint::Texture(0) }, Some(2), Visible::Both),
        material("two words", Model::Mirror { reflectance: white }, None, Visible::Front),
        material("glass", Model::Dielectric { ior: 1.0 + THIRD, tint: Paint::Texture(1) }, None, Visible::Both),
        material("f1_inside", phong, None, Visible::Back),
    ]
}

fn lights() -> Vec<Light> {
    let corners = vec![DVec3::ZERO, DVec3::X * THIRD, DVec3::new(THIRD, 0.7, 0.0), DVec3::Y * 0.7];
    let lamp = Polygon { corners, ..Polygon::default() };
    let (position, direction, intensity) = (ODD, DVec3::new(0.0, -3.0, THIRD), DVec3::new(1e4, THIRD, 0.0));
    let sources = [
        Source::Point { position, intensity, falloff: Falloff::None },
        Source::Point { position, intensity, falloff: Falloff::InverseSquare },
        Source::Directional { direction, irradiance: intensity },
        Source::Spot { position, direction, intensity, cone: 90.0 * THIRD, penumbra: 0.1 },
        Source::Area { emitter: Emitter::Sphere { center: ODD, radius: THIRD }, radiance: intensity, visible: true },
        Source::Area {
            emitter: Emitter::Disk { center: ODD, normal: direction, radius: THIRD },
            radiance: intensity,
            visible: false,
        },
        Source::Area { emitter: Emitter::Polygon(lamp), radiance: intensity, visible: true },
    ];
    let light = |source| Light { name: None, shadows: true, source };
    let mut lights: Vec<_> = sources.map(light).into();
    lights[1] = Light { name: Some("lamp".to_owned()), shadows: false, ..lights[1].clone() };
    lights
}

fn clouds() -> Vec<Cloud> {
    let cloud = |shapes| Cloud { shapes, material: CloudMaterial::One(1), colors: None, name: None, group: None };
    let corners = [[0.0, 0.0, 0.1], [1.0, 0.0, 0.1], [0.0, 1.0, 0.1]];
    let polygons = CloudShapes::Polygons { corners: Rows::F32([corners, corners].concat()), starts: vec![0, 3, 6] };
    let mut clouds = vec![
        cloud(CloudShapes::Spheres(Rows::F64(vec![[THIRD, 0.1, -0.2, 0.3], [1e-9, 2.0, 3.0, 4.0]]))),
        cloud(CloudShapes::Disks(Rows::F32(vec![[0.1, 0.2, 0.3, 0.4, 0.0, 0.0, 1.0]]))),
        cloud(CloudShapes::Boxes(Rows::F32(vec![[0.0, 0.0, 0.0, 0.1, 0.2, 0.3]]), None)),
        cloud(polygons),
        cloud(CloudShapes::Cylinders(Rows::F64(vec![[0.1, 0.2, 0.3, THIRD, 0.0, 1.0, 0.25]]), false)),
        cloud(CloudShapes::Cylinders(Rows::F32(vec![[0.1, 0.2, 0.3, 1.0, 0.0, 1.0, 0.25]]), true)),
    ];
    clouds[0].colors = Some(vec![[0.1, 0.2, 0.3], [1.0, 0.5, 0.25]]);
    clouds[0].material = CloudMaterial::Each(vec![3, 0]);
    clouds[1].name = Some("leaves".to_owned());
    clouds[3].group = Some(0);
    clouds
}

/// A scene with everything that a scene can hold; `picture` is a file of one texel.
fn everything(picture: &Path) -> Scene {
    let texture = |name: &str, kind| Texture { name: name.to_owned(), kind };
    let checker = Checker { colors: [ODD.abs(), DVec3::ONE], scale: [THIRD, 8.0] };
    let image = ImageTexture {
        file: picture.to_owned(),
        wrap: Wrap::Clamp,
        filter: TextureFilter::Nearest,
        color_space: ColorSpace::Linear,
        width: 1,
        height: 1,
        texels: Arc::new([[0.0; 3]]),
    };
    let camera = |name: &str, lens| Camera {
        name: Some(name.to_owned()),
        eye: ODD,
        target: DVec3::new(0.0, 0.0, -THIRD),
        up: DVec3::Y,
        lens,
    };
    Scene {
        image: Some(ImageSettings {
            width: 3,
            height: 2,
            spp: 7,
            filter: Filter { kind: FilterKind::BlackmanHarris, radius: 2.0 + THIRD },
        }),
        render: RenderSettings {
            integrator: Integrator::Ao,
            max_depth: 9,
            seed: 1 << 62,
            noise: Some(THIRD),
            ao_distance: 100.0 * THIRD,
            ambient_occlusion: true,
            shutter: THIRD,
        },
        cameras: vec![
            camera("front", Lens::Pinhole { vfov: 100.0 * THIRD }),
            camera("top", Lens::Orthographic { height: THIRD }),
            camera("lens", Lens::ThinLens { vfov: 100.0 * THIRD, aperture: 0.1, focus: 1e3 * THIRD }),
            camera("round", Lens::Panoramic),
        ],
        background: Background {
            backdrop: Backdrop::Gradient { top: ODD.abs(), bottom: DVec3::ONE },
            transparent: true,
            light: true,
        },
        ambient: DVec3::splat(THIRD),
        textures: vec![
            texture("squares", TextureKind::Checker(checker)),
            texture("picture", TextureKind::Image(image)),
        ],
        materials: materials(),
        lights: lights(),
        objects: shapes(),
        clouds: clouds(),
        groups: vec!["a".to_owned(), "b c".to_owned()],
        ..Scene::default()
    }
}

/// A black picture of one pixel.
fn one_texel(folder: &Path) -> PathBuf {
    let file = folder.join("texel.png");
    let mut png = png::Encoder::new(std::fs::File::create(&file).unwrap(), 1, 1);
    png.set_color(png::ColorType::Rgb);
    png.write_header().unwrap().write_image_data(&[0; 3]).unwrap();
    file
}

/// Two scenes are one, whichever files they came from: `{:?}` tells every bit of an f64 but a NaN's.
fn assert_same(read: &Scene, written: &Scene) {
    macro_rules! same {
        ($($part:ident)*) => { $(assert_eq!(format!("{:?}", read.$part), format!("{:?}", written.$part));)* };
    }
    same!(image render cameras background ambient textures materials lights groups clouds);
    assert_eq!(read.objects.len(), written.objects.len());
    for (read, written) in read.objects.iter().zip(&written.objects) {
        assert_eq!(format!("{read:?}"), format!("{written:?}"));
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn every_part_of_a_scene_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let scene = everything(&one_texel(folder.path()));
    let file = folder.path().join("all.toml");
    save(&scene, &file).unwrap();
    let read = Scene::load(file.as_path()).unwrap_or_else(|errors| panic!("{errors}"));
    assert_same(&read, &scene);
    let expected = [
        "all.toml",
        "all_cloud1.npy",
        "all_cloud1_colors.npy",
        "all_cloud1_materials.npy",
        "all_cloud2.npy",
        "all_cloud3.npy",
        "all_cloud4.npy",
        "all_cloud4_sizes.npy",
        "all_cloud5.npy",
        "all_cloud6.npy",
        "texel.png",
    ];
    assert_eq!(names(folder.path()), expected, "and nothing else is left");
}

/// Values over time are read again at every frame as they were.
#[test]
fn values_over_time_come_back() {
    let text = "[image]\nwidth = 4\nheight = 4\nspp = { keys = [[1, 1], [3, 4]] }\n\
        [camera]\ntype = \"pinhole\"\nvfov = { keys = [[1, 20], [9, 40]] }\neye = [4, 1, 0.5]\ntarget = [1, 0, 0]\n\
        orbit = { keys = [[1, 30], [9, 390]] }\n\
        [background]\ncolor = { keys = [[1, [0, 0, 0]], [9, [1, 0.5, 0]]], interpolation = \"smooth\" }\n\
        [ambient]\ncolor = { keys = [[1, [0, 0, 0]], [9, [1, 0.5, 0]]], interpolation = \"step\" }\n\
        [materials.a]\ntype = \"diffuse\"\nalbedo = { keys = [[1, [1, 0, 0]], [6, [0, 1, 0]]] }\n\
        [[groups]]\nname = \"g\"\ntranslate = { keys = [[1, [0, 0, 0]], [2, [1, 0, 0]]] }\n\
        [[lights]]\ntype = \"point\"\nposition = { keys = [[1, [0, 0, 0]], [9, [0, 10, 0]]] }\nintensity = [1, 1, 1]\n\
        [[shapes]]\ntype = \"sphere\"\ncenter = [2, 0, 0]\nradius = { keys = [[-5, 1], [5, 2]] }\nmaterial = \"a\"\n\
        [[shapes]]\ntype = \"box\"\ncenter = { keys = [[1, [0, 0, 0]], [2, [1, 0, 0]]] }\nsize = [1, 1, 1]\nmaterial = \"a\"\n";
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["a.toml", "b.toml"].map(|name| folder.path().join(name));
    std::fs::write(&first, text).unwrap();
    let scene = Scene::load_frame(&first, 1).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(scene.tracks.iter().filter(|track| track.part.is_none()).count(), 2, "the group and the box");
    save(&scene, &second).unwrap();
    for frame in [1, 2, 4, 9] {
        let [mut want, got] = [&first, &second].map(|file| Scene::load_frame(file, frame).unwrap());
        want.objects[1] = got.objects[1].clone();
        let eyes = [&mut want, &mut got.clone()].map(|scene| std::mem::take(&mut scene.cameras[0].eye));
        assert!(eyes[0].abs_diff_eq(eyes[1], 1e-14), "{eyes:?}: turned there and back");
        want.cameras[0].eye = got.cameras[0].eye;
        assert_same(&got, &want);
    }
}

/// The scenes of each kind of shape that NFF has, as `octray convert` writes them.
#[test]
fn nff_comes_back_as_toml() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/nff");
    for name in ["balls_s2.nff", "gears_s1.nff", "jacks_s3.nff", "mount_s4.nff", "teapot_s4.nff", "tree_s5.nff"] {
        let scene = nff::load(&scenes.join(name)).unwrap();
        let text = to_toml(&scene, Path::new("out.toml")).unwrap();
        let read = Scene::from_toml(&text, Path::new(".")).unwrap_or_else(|errors| panic!("{name}: {errors}"));
        assert_same(&read, &scene);
    }
}

/// Every scene of the project, read, written and read again: the same primitives of the same materials.
#[test]
fn the_scenes_of_the_project_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut count = 0;
    for name in names(&scenes).iter().filter(|name| name.ends_with(".toml")) {
        let scene = Scene::load(scenes.join(name).as_path()).unwrap_or_else(|errors| panic!("{errors}"));
        assert!(scene.warnings.is_empty(), "{name}: {}", scene.warnings[0]);
        let file = folder.path().join(name);
        save(&scene, &file).unwrap_or_else(|error| panic!("{name}: {error}"));
        let read = Scene::load(file.as_path()).unwrap_or_else(|errors| panic!("{errors}"));
        let primitives = |scene: &Scene| scene.primitives().map(|it| format!("{it:?}")).collect::<Vec<_>>();
        assert_eq!(primitives(&read), primitives(&scene), "{name}");
        assert_same(
            &Scene { objects: Vec::new(), clouds: Vec::new(), ..read },
            &Scene { objects: Vec::new(), clouds: Vec::new(), ..scene },
        );
        count += 1;
    }
    assert!(count >= 11, "{count} scenes");
}

#[test]
fn turned_boxes_are_written_one_by_one_with_all_before_them() {
    let turn = DQuat::from_axis_angle(DVec3::Y, 0.5);
    let mut clouds = clouds();
    clouds[0].colors = None;
    let CloudShapes::Boxes(_, turned) = &mut clouds[2].shapes else { panic!("the third cloud is of boxes") };
    *turned = Some(turn);
    let scene = Scene {
        textures: everything(Path::new("a.png")).textures,
        materials: materials(),
        clouds,
        groups: vec!["a".to_owned()],
        ..Scene::default()
    };
    let text = to_toml(&scene, Path::new("a.toml")).unwrap();
    let table = text.parse::<toml::Table>().unwrap();
    let kinds: Vec<_> =
        table["shapes"].as_array().unwrap().iter().map(|shape| shape["type"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["sphere", "sphere", "disk", "box"]);
    assert_eq!(table["shapes"][3]["rotation"]["quaternion"][1].as_float(), Some(turn.y));
    assert_eq!(table["clouds"].as_array().map(Vec::len), Some(3));
}

#[test]
fn what_cannot_be_written_is_said_before_anything_is() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("all.toml");
    let fails = |change: &dyn Fn(&mut Scene), kind| {
        let mut scene = everything(Path::new("a.png"));
        change(&mut scene);
        assert_eq!(save(&scene, &file).map_err(|error| error.kind()), Err(kind));
        assert_eq!(names(folder.path()), Vec::<String>::new());
    };
    let turned = |scene: &mut Scene| {
        let CloudShapes::Boxes(_, turned) = &mut scene.clouds[2].shapes else { panic!("the third cloud is of boxes") };
        *turned = Some(DQuat::from_rotation_x(1.0));
    };
    fails(&turned, io::ErrorKind::Unsupported);
    let invalid = io::ErrorKind::InvalidInput;
    fails(&|scene| scene.textures.truncate(1), invalid);
    fails(&|scene| scene.materials.truncate(1), invalid);
    fails(&|scene| scene.groups.truncate(1), invalid);
    fails(&|scene| scene.groups[1] = "a".to_owned(), invalid);
    fails(&|scene| scene.materials[1].name = "clay".to_owned(), invalid);
    fails(&|scene| scene.cameras[1].name = None, invalid);
    fails(&|scene| scene.clouds[0].material = CloudMaterial::Each(vec![0]), invalid);
    fails(&|scene| scene.clouds[0].colors = Some(vec![[1.0; 3]; 3]), invalid);
    let starts = |scene: &mut Scene, all: &[u32]| {
        let CloudShapes::Polygons { starts, .. } = &mut scene.clouds[3].shapes else {
            panic!("the fourth one is of polygons")
        };
        *starts = all.to_vec();
    };
    for all in [&[0, 7][..], &[1, 6], &[0, 4, 3, 6], &[]] {
        fails(&|scene| starts(scene, all), invalid);
    }
}

#[test]
fn a_file_that_cannot_be_written_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let scene = Scene::default();
    assert!(save(&scene, &folder.path().join("missing/all.toml")).is_err());
    assert!(save(&scene, folder.path()).is_err(), "a folder stands in the way");
    assert_eq!(names(folder.path()), Vec::<String>::new());
}
