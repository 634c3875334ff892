//! Good scenes in TOML: every key arrives where it belongs, defaults are the documented ones, group
//! transforms do what they say, the schema and the reader know the same keys, and no text makes the
//! reader panic.

mod scene_files;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use glam::{DQuat, DVec2, DVec3, dvec2, dvec3};
use octray::scene::{
    Backdrop, Camera, CloudMaterial, CloudShapes, ColorSpace, Cone, Cuboid, Cylinder, Disk, Falloff, Filter,
    FilterKind, ImageSettings, Integrator, Lens, Light, Material, Model, Paint, Plane, RenderSettings, Rows, SCHEMA,
    Scene, Shape, Source, Sphere, TextureFilter, TextureKind, Visible, Wrap,
};
use proptest::prelude::*;
use serde_json::Value;

use scene_files::{floats, json, npy, npy_with_header};

/// Every key of the format but `include`, `[camera]` and the other forms of planes, boxes and turns.
const RICH: &str = r##"
format = 1

[image]
width = 64
height = 48
spp = 4
filter = "blackman-harris"
filter_radius = 2
aovs = []

[render]
integrator = "direct"
max_depth = 7
seed = 18446744073709551615

[[cameras]]
name = "front"
type = "pinhole"
eye = [0, 0, 8]
target = [0, 0.5, 0]
up = [0, 2, 0.5]
vfov = 45

[[cameras]]
name = "plan"
type = "orthographic"
eye = [0, 9, 0]
target = [0, 0, 0]
up = [0, 0, -1]
height = 6

[background]
image = "sky.exr"
scale = 0.5
rotation = 90
transparent = true

[ambient]
color = [0.1, 0.2, 0.3]

[textures.tiles]
type = "checker"
colors = [[0, 0, 0], [1, 1, 0.5]]
scale = [8, 4]

[textures.photo]
type = "image"
file = "photo.png"
wrap = "clamp"
filter = "nearest"
color_space = "linear"

[materials.clay]
type = "diffuse"
albedo = [0.8, 0.3, 0.2]
back = "glass"
one_sided = true

[materials.steel]
type = "mirror"
reflectance = { texture = "photo" }

[materials.glass]
type = "dielectric"
ior = 1.33
tint = [0.9, 1, 0.9]
one_sided = "back"

[materials.shiny]
type = "phong"
color = { texture = "tiles" }
kd = 0.7
ks = 0.2
shine = 30
transmittance = 0.1
ior = 1.1

[[lights]]
name = "bulb"
type = "point"
position = [5, 6, 8]
intensity = [350, 340, 330]
falloff = "none"
shadows = false

[[lights]]
type = "directional"
direction = [0, -2, 0]
irradiance = [1, 2, 3]

[[lights]]
type = "spot"
position = [0, 5, 0]
direction = [0, -1, 0]
intensity = [10, 10, 10]
cone = 30
penumbra = 5

[[groups]]
name = "table"
translate = [10, 0, 0]
rotation = { axis = [0, 3, 0], angle = 90 }
scale = 2

[[shapes]]
type = "sphere"
name = "ball"
center = [0, 0.5, 0]
radius = 0.5
material = "clay"

[[shapes]]
type = "plane"
normal = [0, 2, 0]
offset = -2
material = "shiny"

[[shapes]]
type = "disk"
center = [1, 2, 3]
normal = [0, 0, 1]
radius = 2
inner_radius = 0.5
material = "steel"

[[shapes]]
type = "polygon"
corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
uvs = [[0, 0], [1, 0], [1, 1]]
normals = [[0, 0, 1], [0, 0.1, 1], [0, 0, 1]]
material = "clay"

[[shapes]]
type = "box"
min = [-1, -1, -1]
max = [1, 2, 3]
rotation = { quaternion = [0, 0, 2, 2] }
material = "clay"

[[shapes]]
type = "cylinder"
base = [0, 0, 0]
apex = [0, 2, 0]
radius = 0.25
caps = false
material = "glass"

[[shapes]]
type = "cone"
base = [0, 0, 0]
apex = [0, 2, 0]
radius = 1
apex_radius = 0.5
caps = false
material = "glass"
group = "table"

[[clouds]]
type = "spheres"
file = "spheres.npy"
material = ["steel", "clay"]
materials = "which.npy"
colors = "colors.npy"
name = "dust"
"##;

/// A directory with the files that scenes here name.
fn files() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: Vec<u8>| fs::write(dir.path().join(name), bytes).unwrap();
    write("spheres.npy", npy("<f4", "(3, 4)", &floats(&[0., 1., 2., 0.5, 3., 4., 5., 0.1, 6., 7., 8., 0.25])));
    write("which.npy", npy("|u1", "(3,)", &[1, 0, 1]));
    write("colors.npy", npy("<f4", "(3, 3)", &floats(&[1., 0., 0., 0., 1., 0., 0., 0., 0.5])));
    write("disks.npy", npy("<f4", "(1, 7)", &floats(&[1., 0., 0., 2., 1., 0., 0.])));
    write("boxes.csv", b"max_x,min_x,min_y,min_z,max_y,max_z\n2,1,0,0,2,4\n".to_vec());
    let fortran = "{'descr': '<f8', 'fortran_order': True, 'shape': (1, 4)}";
    write("one.npy", npy_with_header(fortran, &[0.1f64, 0.2, 0.3, 0.4].map(f64::to_le_bytes).concat()));
    // A square with a corner in the middle of an edge, and a triangle.
    write("corners.csv", b"x,y,z\n0,0,0\n1,0,0\n2,0,0\n2,2,0\n0,2,0\n5,0,0\n6,0,0\n5,1,0\n".to_vec());
    write("sizes.csv", b"size\n5\n3\n".to_vec());
    let photo = image::RgbImage::from_fn(2, 1, |x, _| image::Rgb([255, 51 * (x as u8 + 1), 0]));
    photo.save(dir.path().join("photo.png")).unwrap();
    let sky = image::Rgb32FImage::from_fn(2, 2, |x, y| image::Rgb([x as f32, y as f32, 7.5]));
    sky.save(dir.path().join("sky.exr")).unwrap();
    sky.save(dir.path().join("sky.hdr")).unwrap();
    photo.save(dir.path().join("photo.jpg")).unwrap();
    dir
}

fn read(text: &str) -> Scene {
    let dir = files();
    Scene::from_toml(text, dir.path()).unwrap_or_else(|errors| panic!("{}", errors.report(false)))
}

fn color(r: f64, g: f64, b: f64) -> Paint {
    Paint::Color(dvec3(r, g, b))
}

#[test]
fn every_key_arrives() {
    let scene = read(RICH);
    assert_eq!(scene.warnings, []);
    let filter = Filter { kind: FilterKind::BlackmanHarris, radius: 2.0 };
    assert_eq!(scene.image, Some(ImageSettings { width: 64, height: 48, spp: 4, filter }));
    assert_eq!(
        scene.render,
        RenderSettings { integrator: Integrator::Direct, max_depth: 7, seed: u64::MAX, ..RenderSettings::default() }
    );
    assert_eq!(
        scene.cameras,
        [
            Camera {
                name: Some("front".to_owned()),
                eye: dvec3(0., 0., 8.),
                target: dvec3(0., 0.5, 0.),
                up: dvec3(0., 2., 0.5),
                lens: Lens::Pinhole { vfov: 45.0 },
            },
            Camera {
                name: Some("plan".to_owned()),
                eye: dvec3(0., 9., 0.),
                target: DVec3::ZERO,
                up: dvec3(0., 0., -1.),
                lens: Lens::Orthographic { height: 6.0 },
            },
        ]
    );
    assert_eq!(scene.ambient, dvec3(0.1, 0.2, 0.3));
    assert_eq!(scene.groups, ["table"]);
    assert_eq!(
        scene.materials,
        [
            Material {
                name: "clay".to_owned(),
                model: Model::Diffuse { albedo: color(0.8, 0.3, 0.2) },
                back: Some(2),
                visible: Visible::Front,
            },
            Material {
                name: "steel".to_owned(),
                model: Model::Mirror { reflectance: Paint::Texture(1) },
                back: None,
                visible: Visible::Both,
            },
            Material {
                name: "glass".to_owned(),
                model: Model::Dielectric { ior: 1.33, tint: color(0.9, 1.0, 0.9) },
                back: None,
                visible: Visible::Back,
            },
            Material {
                name: "shiny".to_owned(),
                model: Model::Phong {
                    color: Paint::Texture(0),
                    kd: 0.7,
                    ks: 0.2,
                    shine: 30.0,
                    transmittance: 0.1,
                    ior: 1.1,
                },
                back: None,
                visible: Visible::Both,
            },
        ]
    );
    let light = |name: Option<&str>, shadows, source| Light { name: name.map(str::to_owned), shadows, source };
    assert_eq!(
        scene.lights,
        [
            light(
                Some("bulb"),
                false,
                Source::Point {
                    position: dvec3(5., 6., 8.),
                    intensity: dvec3(350., 340., 330.),
                    falloff: Falloff::None
                }
            ),
            light(None, true, Source::Directional { direction: dvec3(0., -2., 0.), irradiance: dvec3(1., 2., 3.) }),
            light(
                None,
                true,
                Source::Spot {
                    position: dvec3(0., 5., 0.),
                    direction: dvec3(0., -1., 0.),
                    intensity: DVec3::splat(10.0),
                    cone: 30.0,
                    penumbra: 5.0,
                }
            ),
        ]
    );
}

#[test]
fn every_shape_arrives() {
    let scene = read(RICH);
    let shapes: Vec<_> = scene.objects.iter().map(|object| (&object.shape, object.material)).collect();
    let polygon = octray::scene::Polygon {
        corners: vec![DVec3::ZERO, DVec3::X, dvec3(1., 1., 0.)],
        uvs: vec![DVec2::ZERO, DVec2::X, dvec2(1., 1.)],
        normals: vec![DVec3::Z, dvec3(0., 0.1, 1.), DVec3::Z],
    };
    let half = 0.5f64.sqrt();
    assert_eq!(shapes[0], (&Shape::Sphere(Sphere { center: dvec3(0., 0.5, 0.), radius: 0.5 }), 0));
    // 2 y = -2: the normal counts as it is written.
    assert_eq!(shapes[1], (&Shape::Plane(Plane { point: dvec3(0., -1., 0.), normal: dvec3(0., 2., 0.) }), 3));
    let disk = Disk { center: dvec3(1., 2., 3.), normal: DVec3::Z, radius: 2.0, inner_radius: 0.5 };
    assert_eq!(shapes[2], (&Shape::Disk(disk), 1));
    assert_eq!(shapes[3], (&Shape::Polygon(polygon), 0));
    let Shape::Box(Cuboid { min, max, rotation: Some(turn) }) = shapes[4].0 else { panic!("{:?}", shapes[4]) };
    assert_eq!((*min, *max), (DVec3::NEG_ONE, dvec3(1., 2., 3.)));
    assert!(turn.abs_diff_eq(DQuat::from_xyzw(0., 0., half, half), 1e-15), "{turn}");
    let cylinder = Cylinder { base: DVec3::ZERO, apex: dvec3(0., 2., 0.), radius: 0.25, caps: false };
    assert_eq!(shapes[5], (&Shape::Cylinder(cylinder), 2));
    let cone = Cone { base: dvec3(10., 0., 0.), apex: dvec3(10., 4., 0.), radius: 2.0, apex_radius: 1.0, caps: false };
    assert_eq!(shapes[6], (&Shape::Cone(cone), 2));
    assert_eq!((scene.objects[6].group, scene.objects[0].group), (Some(0), None));
    let names: Vec<_> = [0, 1, 7, 9].map(|i| scene.primitive_name(i).unwrap()).into();
    assert_eq!(names, ["ball", "plane 1", "dust", "dust"]);
}

#[test]
fn pictures_arrive_as_linear_texels() {
    let scene = read(RICH);
    let Backdrop::Image { image, scale, rotation } = &scene.background.backdrop else { panic!() };
    assert_eq!((*scale, *rotation, scene.background.transparent), (0.5, 90.0, true));
    assert_eq!((image.width, image.height, image.color_space), (2, 2, ColorSpace::Linear));
    assert_eq!(image.texels[..], [[0., 0., 7.5], [1., 0., 7.5], [0., 1., 7.5], [1., 1., 7.5]]);
    let TextureKind::Image(photo) = &scene.textures[1].kind else { panic!() };
    assert_eq!((photo.wrap, photo.filter), (Wrap::Clamp, TextureFilter::Nearest));
    assert_eq!(photo.texels[..], [[1., 0.2, 0.], [1., 0.4, 0.]], "as they are");
    let TextureKind::Checker(tiles) = scene.textures[0].kind else { panic!() };
    assert_eq!((tiles.colors, tiles.scale), ([DVec3::ZERO, dvec3(1., 1., 0.5)], [8.0, 4.0]));

    let plain = read(
        "format = 1\n[textures.photo]\ntype = \"image\"\nfile = \"photo.png\"\n\
         [materials.m]\ntype = \"diffuse\"\nalbedo = { texture = \"photo\" }\n\
         [[shapes]]\ntype = \"plane\"\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n",
    );
    let TextureKind::Image(photo) = &plain.textures[0].kind else { panic!() };
    assert_eq!(
        (photo.wrap, photo.filter, photo.color_space),
        (Wrap::Repeat, TextureFilter::Bilinear, ColorSpace::Srgb)
    );
    // 0.2 on the curve of sRGB is ((0.2 + 0.055)/1.055)^2.4.
    assert!((photo.texels[0][1] - 0.033_104_766).abs() < 1e-8, "{:?}", photo.texels);
}

#[test]
fn clouds_arrive_row_by_row() {
    let scene = read(RICH);
    let cloud = &scene.clouds[0];
    let CloudShapes::Spheres(Rows::F32(rows)) = &cloud.shapes else { panic!("{:?}", cloud.shapes) };
    assert_eq!(rows[..], [[0., 1., 2., 0.5], [3., 4., 5., 0.1], [6., 7., 8., 0.25]]);
    let CloudMaterial::Each(materials) = &cloud.material else { panic!() };
    assert_eq!(materials[..], [0, 1, 0], "indices into the list steel, clay become those of the scene");
    assert_eq!(scene.primitive(8).unwrap().color, DVec3::Y);
    assert_eq!(scene.primitive_count(), 10);
}

#[test]
fn defaults_are_the_documented_ones() {
    let scene = read(
        "format = 1\n[image]\nwidth = 2\nheight = 3\n[camera]\ntype = \"pinhole\"\neye = [1, 0, 0]\ntarget = [0, 0, 0]\nvfov = 9\n\
         [materials.a]\ntype = \"diffuse\"\n[materials.b]\ntype = \"mirror\"\n[materials.c]\ntype = \"dielectric\"\n\
         [materials.d]\ntype = \"phong\"\ncolor = [1, 1, 1]\nkd = 1\nks = 0\nshine = 1\n\
         [[lights]]\ntype = \"point\"\nposition = [0, 0, 0]\nintensity = [1, 1, 1]\n\
         [[groups]]\nname = \"still\"\n\
         [[shapes]]\ntype = \"disk\"\ncenter = [0, 0, 0]\nnormal = [0, 0, 1]\nradius = 1\nmaterial = \"a\"\ngroup = \"still\"\n\
         [[shapes]]\ntype = \"cone\"\nbase = [0, 0, 0]\napex = [0, 0, 1]\nradius = 1\nmaterial = \"a\"\n\
         [[shapes]]\ntype = \"box\"\ncenter = [1, 1, 1]\nsize = [2, 4, 6]\nmaterial = \"a\"\n\
         [[shapes]]\ntype = \"plane\"\npoint = [1, 2, 3]\nnormal = [0, 0, 5]\nmaterial = \"a\"\n",
    );
    assert_eq!(scene.image, Some(ImageSettings { width: 2, height: 3, spp: 16, filter: Filter::default() }));
    assert_eq!(
        scene.render,
        RenderSettings { integrator: Integrator::Direct, max_depth: 5, seed: 0, ..RenderSettings::default() }
    );
    assert_eq!((scene.cameras[0].name.as_deref(), scene.cameras[0].up), (None, DVec3::Y));
    assert!(matches!(scene.background.backdrop, Backdrop::Color(DVec3::ZERO)) && !scene.background.transparent);
    let models: Vec<_> = scene.materials.iter().map(|material| material.model).collect();
    assert_eq!(models[0], Model::Diffuse { albedo: color(0.8, 0.8, 0.8) });
    assert_eq!(models[1], Model::Mirror { reflectance: color(1.0, 1.0, 1.0) });
    assert_eq!(models[2], Model::Dielectric { ior: 1.5, tint: color(1.0, 1.0, 1.0) });
    assert!(matches!(models[3], Model::Phong { transmittance: 0.0, ior: 1.0, .. }));
    assert!(scene.materials.iter().all(|material| material.back.is_none() && material.visible == Visible::Both));
    let Source::Point { falloff, .. } = scene.lights[0].source else { panic!() };
    assert_eq!((falloff, scene.lights[0].shadows, &scene.lights[0].name), (Falloff::InverseSquare, true, &None));
    assert!(matches!(scene.objects[0].shape, Shape::Disk(Disk { inner_radius: 0.0, .. })));
    assert!(matches!(scene.objects[1].shape, Shape::Cone(Cone { apex_radius: 0.0, caps: true, .. })));
    let cuboid = Cuboid { min: dvec3(0., -1., -2.), max: dvec3(2., 3., 4.), rotation: None };
    assert_eq!(scene.objects[2].shape, Shape::Box(cuboid));
    assert_eq!(scene.objects[3].shape, Shape::Plane(Plane { point: dvec3(1., 2., 3.), normal: dvec3(0., 0., 5.) }));
    let boxed = read(
        "format = 1\n[image]\nwidth = 1\nheight = 1\nfilter = \"box\"\n[background]\ntop = [0, 0, 1]\nbottom = [1, 0, 0]\n",
    );
    assert_eq!(boxed.image.unwrap().filter, Filter { kind: FilterKind::Box, radius: 0.5 });
    assert!(matches!(boxed.background.backdrop, Backdrop::Gradient { top: DVec3::Z, bottom: DVec3::X }));
}

/// All shapes twice, plain and in a group: each point and normal must be the plain one, moved by hand.
#[test]
fn groups_scale_then_turn_then_move() {
    let group =
        "[[groups]]\nname = \"g\"\nscale = 2\nrotation = { axis = [0, 0, 1], angle = 90 }\ntranslate = [10, 20, 30]\n";
    let shapes = [
        "sphere\"\ncenter = [1, 2, 3]\nradius = 4",
        "plane\"\npoint = [1, 2, 3]\nnormal = [1, 0, 0]",
        "disk\"\ncenter = [1, 2, 3]\nnormal = [1, 0, 0]\nradius = 4\ninner_radius = 1",
        "polygon\"\ncorners = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]\nnormals = [[1, 0, 1], [0, 0, 1], [0, 0, 1]]",
        "box\"\nmin = [0, 0, 0]\nmax = [2, 4, 6]",
        "cylinder\"\nbase = [1, 2, 3]\napex = [4, 2, 3]\nradius = 4",
        "cone\"\nbase = [1, 2, 3]\napex = [4, 2, 3]\nradius = 4\napex_radius = 5",
    ];
    let list: String =
        shapes.map(|shape| format!("[[shapes]]\ntype = \"{shape}\nmaterial = \"a\"\ngroup = \"g\"\n")).concat();
    let clouds = "[[clouds]]\ntype = \"disks\"\nfile = \"disks.npy\"\nmaterial = \"a\"\ngroup = \"g\"\n\
                  [[clouds]]\ntype = \"boxes\"\nfile = \"boxes.csv\"\nmaterial = \"a\"\ngroup = \"g\"\n";
    let scene = read(&format!("format = 1\n{group}[materials.a]\ntype = \"mirror\"\n{list}{clouds}"));
    // (x, y, z) goes to (10 - 2 y, 20 + 2 x, 30 + 2 z).
    let moved = dvec3(6., 22., 36.);
    let near = |a: DVec3, b: DVec3| assert!(a.abs_diff_eq(b, 1e-13), "{a} is not {b}");
    let shape = |i: usize| scene.primitive(i).unwrap().shape.into_owned();
    let Shape::Sphere(sphere) = shape(0) else { panic!() };
    near(sphere.center, moved);
    assert_eq!(sphere.radius, 8.0);
    let Shape::Plane(plane) = shape(1) else { panic!() };
    near(plane.point, moved);
    near(plane.normal, DVec3::Y);
    let Shape::Disk(disk) = shape(2) else { panic!() };
    near(disk.center, moved);
    near(disk.normal, DVec3::Y);
    assert_eq!((disk.radius, disk.inner_radius), (8.0, 2.0));
    let Shape::Polygon(polygon) = shape(3) else { panic!() };
    near(polygon.corners[2], dvec3(8., 22., 30.));
    near(polygon.normals[0], dvec3(0., 1., 1.));
    let Shape::Box(cuboid) = shape(4) else { panic!() };
    // Its centre (1, 2, 3) goes along; the box itself is turned by its rotation.
    near((cuboid.min + cuboid.max) / 2.0, moved);
    near(cuboid.max - cuboid.min, dvec3(4., 8., 12.));
    near(cuboid.rotation.unwrap() * DVec3::X, DVec3::Y);
    let Shape::Cylinder(cylinder) = shape(5) else { panic!() };
    near(cylinder.apex, dvec3(6., 28., 36.));
    assert_eq!(cylinder.radius, 8.0);
    let Shape::Cone(cone) = shape(6) else { panic!() };
    near(cone.apex, dvec3(6., 28., 36.));
    assert_eq!((cone.radius, cone.apex_radius), (8.0, 10.0));
    let Shape::Disk(disk) = shape(7) else { panic!() };
    near(disk.center, dvec3(10., 22., 30.));
    near(disk.normal, DVec3::Y);
    let Shape::Box(cuboid) = shape(8) else { panic!() };
    near((cuboid.min + cuboid.max) / 2.0, dvec3(8., 23., 34.));
    near(cuboid.max - cuboid.min, dvec3(2., 4., 8.));
    near(cuboid.rotation.unwrap() * DVec3::X, DVec3::Y);
    assert!(matches!(&scene.clouds[0].shapes, CloudShapes::Disks(Rows::F64(_))));
}

#[test]
fn needless_corners_go_with_a_warning() {
    let scene = read(
        "format = 1\n[materials.a]\ntype = \"mirror\"\n\
         [[shapes]]\ntype = \"polygon\"\ncorners = [[0, 0, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 2, 0]]\nmaterial = \"a\"\n\
         [[clouds]]\ntype = \"polygons\"\nfile = \"corners.csv\"\nsizes = \"sizes.csv\"\nmaterial = \"a\"\n\
         [[clouds]]\ntype = \"spheres\"\nfile = \"one.npy\"\nmaterial = \"a\"\n",
    );
    let Shape::Polygon(polygon) = &scene.objects[0].shape else { panic!() };
    assert_eq!(polygon.corners, [DVec3::ZERO, dvec3(2., 0., 0.), dvec3(2., 2., 0.)]);
    let corners = |i: usize| match scene.primitive(i).unwrap().shape.into_owned() {
        Shape::Polygon(polygon) => polygon.corners,
        other => panic!("{other:?}"),
    };
    assert_eq!(corners(1), [DVec3::ZERO, dvec3(2., 0., 0.), dvec3(2., 2., 0.), dvec3(0., 2., 0.)]);
    assert_eq!(corners(2), [dvec3(5., 0., 0.), dvec3(6., 0., 0.), dvec3(5., 1., 0.)]);
    let warnings: Vec<_> = scene.warnings.iter().map(ToString::to_string).collect();
    assert_eq!(
        warnings,
        [
            "<text>:6:11: warning: polygon corners 0, 2 repeated or in line with both neighbours are dropped",
            "<text>:10:8: warning: corners repeated or in line with both neighbours are dropped; rows that have some: 1, \
             the first is row 0",
        ]
    );
    let Shape::Sphere(sphere) = scene.primitive(3).unwrap().shape.into_owned() else { panic!() };
    assert_eq!(sphere, Sphere { center: dvec3(0.1, 0.2, 0.3), radius: 0.4 }, "one row is in any order");
}

#[test]
fn included_files_come_first() {
    let dir = tempfile::tempdir().unwrap();
    let ball = |material: &str, x: i32| {
        format!("[[shapes]]\ntype = \"sphere\"\ncenter = [{x}, 0, 0]\nradius = 1\nmaterial = \"{material}\"\n")
    };
    fs::create_dir(dir.path().join("parts")).unwrap();
    let write = |name: &str, text: String| fs::write(dir.path().join(name), text).unwrap();
    write("parts/deep.toml", format!("format = 1\n[materials.deep]\ntype = \"mirror\"\n{}", ball("top", 1)));
    let texture = "[textures.t]\ntype = \"image\"\nfile = \"dot.png\"\n";
    write(
        "parts/mid.toml",
        format!("format = 1\ninclude = [\"deep.toml\"]\n{texture}[materials.mid]\ntype = \"mirror\"\n"),
    );
    let main = "format = 1\ninclude = [\"parts/mid.toml\"]\n[materials.top]\ntype = \"mirror\"\n[materials.end]\ntype = \"mirror\"\n";
    write("main.toml", format!("{main}{}", ball("mid", 2)));
    fs::copy("tests/bad_scenes/parts/dot.png", dir.path().join("parts/dot.png")).unwrap();
    let scene = Scene::load(dir.path().join("main.toml")).unwrap();
    let names: Vec<_> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["deep", "mid", "top", "end"]);
    let materials: Vec<_> = scene.objects.iter().map(|object| object.material).collect();
    assert_eq!(materials, [2, 1], "a name of the including file serves the included one");
}

/// Numbers and vectors of all parts by keys.
const KEYED: &str = r##"
format = 1
[image]
width = 64
height = 48
spp = { keys = [[1, 1], [3, 4]] }
[camera]
type = "pinhole"
vfov = { keys = [[1, 20], [11, 40]], interpolation = "linear" }
eye = { keys = [[1, [0, 0, 8]], [11, [8, 0, 0]], [21, [0, 0, -8]]], interpolation = "smooth" }
target = [0, 0, 0]
[background]
top = { keys = [[1, [0, 0, 0]], [11, [1, 0.5, 0]]] }
bottom = [0, 0, 0]
[materials.a]
type = "diffuse"
albedo = { keys = [[1, [1, 0, 0]], [6, [0, 1, 0]]], interpolation = "step" }
[materials.b]
type = "mirror"
[[lights]]
type = "point"
position = { keys = [[1, [0, 0, 0]], [11, [0, 10, 0]]] }
intensity = [1, 1, 1]
[[groups]]
name = "g"
rotation = { axis = [0, 0, 1], angle = { keys = [[1, 0], [11, 360]] } }
translate = { keys = [[1, [0, 0, 0]], [2, [1, 0, 0]]] }
[[shapes]]
type = "sphere"
center = [2, 0, 0]
radius = { keys = [[-5, 1], [5, 2]] }
material = "a"
group = "g"
[[shapes]]
type = "polygon"
corners = [[0, 0, 0], { keys = [[1, [1, 0, 0]], [11, [3, 0, 0]]] }, [0, 1, 0]]
material = "b"
"##;

#[test]
fn values_follow_their_keys() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("keyed.toml");
    fs::write(&path, KEYED).unwrap();
    let at = |frame| Scene::load_frame(&path, frame).unwrap_or_else(|errors| panic!("{}", errors.report(false)));
    let scene = at(6);
    assert_eq!(scene.image.unwrap().spp, 4);
    assert_eq!(scene.cameras[0].lens, Lens::Pinhole { vfov: 30.0 });
    let Backdrop::Gradient { top, .. } = scene.background.backdrop else { panic!() };
    assert_eq!(top, dvec3(0.5, 0.25, 0.0));
    assert_eq!(scene.materials[0].model, Model::Diffuse { albedo: color(0.0, 1.0, 0.0) });
    let Source::Point { position, .. } = scene.lights[0].source else { panic!() };
    assert_eq!(position, dvec3(0.0, 5.0, 0.0));
    // (2, 0, 0) half around z, then one along x.
    let Shape::Sphere(sphere) = &scene.objects[0].shape else { panic!() };
    assert!(sphere.center.abs_diff_eq(dvec3(-1.0, 0.0, 0.0), 1e-12), "{sphere:?}");
    assert_eq!(sphere.radius, 2.0);
    let Shape::Polygon(polygon) = &scene.objects[1].shape else { panic!() };
    assert_eq!(polygon.corners[1], dvec3(2.0, 0.0, 0.0));
    assert_eq!(at(2).image.unwrap().spp, 3, "2.5 rounded");
    assert_eq!(at(5).materials[0].model, Model::Diffuse { albedo: color(1.0, 0.0, 0.0) });
    assert_eq!((at(-9).cameras[0].eye, at(99).cameras[0].eye), (dvec3(0.0, 0.0, 8.0), dvec3(0.0, 0.0, -8.0)));
    assert_eq!(at(11).cameras[0].eye, dvec3(8.0, 0.0, 0.0));
}

/// A turntable keeps its distance and its height, and sees the same as the first frame where it has gone around.
#[test]
fn cameras_orbit_what_they_look_at() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("turn.toml");
    let ball = "[materials.a]\ntype = \"mirror\"\n[[shapes]]\ntype = \"sphere\"\ncenter = [1, 2, 3]\nradius = 2\nmaterial = \"a\"\n";
    let orbit = "orbit = { keys = [[1, 0], [5, 360]] }";
    fs::write(
        &path,
        format!("[camera]\ntype = \"pinhole\"\nvfov = 60\neye = [4, 1, 0]\ntarget = [1, 0, 0]\n{orbit}\n{ball}"),
    )
    .unwrap();
    let eye = |frame| Scene::load_frame(&path, frame).unwrap().cameras[0].eye;
    assert_eq!((eye(1), eye(5)), (dvec3(4.0, 1.0, 0.0), dvec3(4.0, 1.0, 0.0)));
    assert!(eye(2).abs_diff_eq(dvec3(1.0, 1.0, -3.0), 1e-14), "a quarter to the right: {}", eye(2));
    // Without eye and target the whole scene is in the picture, from all sides at the same distance.
    fs::write(&path, format!("[camera]\ntype = \"pinhole\"\nvfov = 60\n{orbit}\n{ball}")).unwrap();
    for frame in 1..5 {
        let camera = Scene::load_frame(&path, frame).unwrap().cameras[0].clone();
        assert!(camera.target.abs_diff_eq(dvec3(1.0, 2.0, 3.0), 1e-14));
        let distance = (camera.eye - camera.target).length();
        assert!((4.0..4.3).contains(&distance), "2/sin(30 degrees) and some room: {distance}");
    }
}

#[test]
fn files_may_be_one_a_frame() {
    let dir = files();
    fs::copy(dir.path().join("photo.png"), dir.path().join("photo.0007.png")).unwrap();
    fs::write(dir.path().join("p.0007.csv"), "x,y,z,r\n7,0,0,1\n").unwrap();
    let path = dir.path().join("a.toml");
    let text = "[textures.t]\ntype = \"image\"\nfile = \"photo.#.png\"\n[materials.a]\ntype = \"diffuse\"\nalbedo = { texture = \"t\" }\n\
                [[clouds]]\ntype = \"spheres\"\nmaterial = \"a\"\nfile = \"p.%04d.csv\"\n";
    fs::write(&path, text).unwrap();
    let scene = Scene::load_frame(&path, 7).unwrap();
    assert_eq!(scene.clouds[0].shapes.len(), 1);
    let errors = Scene::load_frame(&path, 8).unwrap_err().to_string();
    assert!(
        errors.contains("a.toml:3:8: photo.0008.png cannot be read")
            && errors.contains("a.toml:10:8: p.0008.csv cannot be read"),
        "{errors}"
    );
    // A file of this very name is meant where there is one.
    fs::write(dir.path().join("p.%04d.csv"), "x,y,z,r\n1,0,0,1\n2,0,0,1\n").unwrap();
    assert_eq!(Scene::load_frame(&path, 7).unwrap().clouds[0].shapes.len(), 2);
}

#[test]
fn clouds_of_cylinders_arrive() {
    let dir = files();
    fs::write(dir.path().join("c.csv"), "base_x,base_y,base_z,apex_x,apex_y,apex_z,r\n1,2,3,4,5,6,0.5\n").unwrap();
    let cloud = |caps: &str| {
        let text = format!(
            "[materials.a]\ntype = \"mirror\"\n[[clouds]]\ntype = \"cylinders\"\nmaterial = \"a\"\nfile = \"c.csv\"\n{caps}"
        );
        Scene::from_toml(&text, dir.path()).unwrap().primitive(0).unwrap().shape.into_owned()
    };
    let cylinder = Cylinder { base: dvec3(1., 2., 3.), apex: dvec3(4., 5., 6.), radius: 0.5, caps: true };
    assert_eq!(cloud(""), Shape::Cylinder(cylinder));
    assert_eq!(cloud("caps = false\n"), Shape::Cylinder(Cylinder { caps: false, ..cylinder }));
}

/// The definitions that a schema node allows: its own, or each of its `oneOf`.
fn choices<'s>(schema: &'s Value, node: &'s Value) -> Vec<&'s Value> {
    let follow = |node: &'s Value| match node["$ref"].as_str() {
        Some(path) => schema.pointer(&path[1..]).unwrap(),
        None => node,
    };
    let node = follow(node);
    match node["oneOf"].as_array() {
        Some(list) if node["properties"].is_null() => list.iter().map(follow).collect(),
        _ => vec![node],
    }
}

/// The keys that the reader says a table has, asked by giving it a key that none has.
fn keys_by_reader(text: &str) -> Vec<String> {
    let errors = Scene::from_toml(text, Path::new("")).unwrap_err();
    let help = errors.iter().find(|error| error.rule.contains("no_such_key")).and_then(|error| error.help.clone());
    let help = help.unwrap_or_else(|| panic!("the key was not noticed in\n{text}\n{errors}"));
    let mut keys: Vec<_> = help.strip_prefix("its keys: ").unwrap().split(", ").map(str::to_owned).collect();
    keys.sort();
    keys.dedup();
    keys
}

#[test]
fn the_schema_and_the_reader_know_the_same_keys() {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let mut tables = BTreeMap::new();
    tables.insert("no_such_key = 1".to_owned(), &schema);
    for (name, node) in schema["properties"].as_object().unwrap() {
        let (header, choices) = match (&node["items"], &node["additionalProperties"]) {
            (Value::Null, Value::Null) => (format!("[{name}]"), choices(&schema, node)),
            (Value::Null, each) if node["$ref"].is_null() && each.is_object() => {
                (format!("[{name}.x]"), choices(&schema, each))
            }
            (items, _) => (format!("[[{name}]]"), choices(&schema, items)),
        };
        for choice in choices.into_iter().filter(|choice| choice["properties"].is_object()) {
            let kind = choice["properties"]["type"]["const"].as_str();
            let kind = kind.map_or(String::new(), |kind| format!("type = \"{kind}\"\n"));
            tables.insert(format!("{header}\n{kind}no_such_key = 1\n"), choice);
        }
    }
    let shape = "[[shapes]]\ntype = \"box\"\nrotation = { no_such_key = 1 }\n".to_owned();
    tables.insert(shape, &schema["$defs"]["rotation"]);
    let paint = "[materials.x]\ntype = \"mirror\"\nreflectance = { no_such_key = 1 }\n".to_owned();
    tables.insert(paint, &schema["$defs"]["textured"]);
    let keyed = "[render]\nseed = { keys = [[1, 1]], no_such_key = 1 }\n".to_owned();
    tables.insert(keyed, &schema["$defs"]["keyed_number"]);
    for (key, node) in [("radius", "radius_column"), ("color", "color_column")] {
        let text = format!("[[clouds]]\ntype = \"particles\"\n{key} = {{ no_such_key = 1 }}\n");
        tables.insert(text, &schema["$defs"][node]);
    }
    for (text, node) in &tables {
        let mut by_schema: Vec<_> = node["properties"].as_object().unwrap().keys().cloned().collect();
        by_schema.sort();
        assert_eq!(keys_by_reader(text), by_schema, "{text}");
    }
    assert_eq!(tables.len(), 44, "{:?}", tables.keys());
}

#[test]
fn the_schema_accepts_good_scenes() {
    let validator = jsonschema::validator_for(&serde_json::from_str(SCHEMA).unwrap()).unwrap();
    // JSON numbers end at 2^63 in this TOML reader.
    let rich = RICH.replace("18446744073709551615", "7");
    let other = "format = 1\n[camera]\ntype = \"pinhole\"\neye = [1, 0, 0]\ntarget = [0, 0, 0]\nvfov = 9\n\
        [background]\ntop = [0, 0, 1]\nbottom = [1, 0, 0]\n[materials.a]\ntype = \"diffuse\"\n\
        [[shapes]]\ntype = \"plane\"\npoint = [1, 2, 3]\nnormal = [0, 0, 5]\nmaterial = \"a\"\n\
        [[shapes]]\ntype = \"box\"\ncenter = [1, 1, 1]\nsize = [2, 4, 6]\nrotation = { axis = [0, 1, 0], angle = 30 }\nmaterial = \"a\"\n\
        [[clouds]]\ntype = \"polygons\"\nfile = \"corners.csv\"\nsizes = \"sizes.csv\"\nmaterial = \"a\"\n";
    for text in [rich.as_str(), other, KEYED] {
        read(text);
        let scene = json(text).unwrap();
        let errors: Vec<_> =
            validator.iter_errors(&scene).map(|error| format!("{}: {error}", error.instance_path)).collect();
        assert_eq!(errors, [""; 0]);
    }
}

/// What mutations cut, copy and put in.
const PIECES: &[&str] = &[
    "",
    "\n",
    "=",
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "\"",
    "'",
    "\"\"\"",
    ",",
    ".",
    "-1",
    "0",
    "1e999",
    "nan",
    "inf",
    "true",
    "99999999999999999999999999999999999999999",
    "0xffffffffffffffffffffffffffffffffffff",
    "\u{0}",
    "é",
    "type",
    "sphere",
    "center",
    "include = [\"x\"]",
    "[[[[[[[[[[[[[[[[",
    "1979-05-27",
    "\\u0000",
    "#",
    "group",
    "material",
    "a.b.c.d.e = 1",
];

const FILES: &[&str] =
    &["spheres.npy", "which.npy", "colors.npy", "boxes.csv", "photo.png", "photo.jpg", "sky.exr", "sky.hdr"];

/// Textures and a cloud from files that the rich scene does not name.
const MORE: &str = r#"
[[clouds]]
type = "boxes"
file = "boxes.csv"
material = "clay"

[textures.jpeg]
type = "image"
file = "photo.jpg"

[textures.hdr]
type = "image"
file = "sky.hdr"

"#;

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn any_text_is_read_or_refused(text in "\\PC*|[\\[\\]{}=\"a-z0-9.,\\n -]{0,200}") {
        if let Err(errors) = Scene::from_toml(&text, Path::new("no such directory")) {
            prop_assert!(!errors.to_string().is_empty() && !errors.report(false).is_empty());
        }
    }

    #[test]
    fn any_change_of_a_scene_is_read_or_refused(
        edits in prop::collection::vec((any::<prop::sample::Index>(), 0..12usize, prop::sample::select(PIECES)), 1..6)
    ) {
        let mut text: Vec<char> = RICH.chars().collect();
        for (at, cut, piece) in edits {
            let at = at.index(text.len());
            let end = (at + cut).min(text.len());
            text.splice(at..end, piece.chars());
        }
        let text: String = text.into_iter().collect();
        if let Err(errors) = Scene::from_toml(&text, Path::new("no such directory")) {
            prop_assert!(!errors.to_string().is_empty() && !errors.report(true).is_empty());
            for error in errors.iter() {
                prop_assert!(error.place.line >= 1 && error.place.column >= 1, "{error}");
            }
        }
    }

    #[test]
    fn any_change_of_an_array_or_picture_is_read_or_refused(
        file in prop::sample::select(FILES),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let dir = files();
        let path = dir.path().join(file);
        let mut bytes = fs::read(&path).unwrap();
        for (at, byte) in edits {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        fs::write(&path, bytes).unwrap();
        let scene = RICH.replace("[textures.tiles]", &format!("{MORE}[textures.tiles]"));
        if let Err(errors) = Scene::from_toml(&scene, dir.path()) {
            prop_assert!(errors.to_string().contains(file), "{errors}");
        }
    }
}
