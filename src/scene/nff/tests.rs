//! The set of scenes that SPD wrote, small files with one mistake each, and text that was torn up at random.

use std::path::Path;

use proptest::prelude::*;

use super::*;
use crate::scene::{Cone, Cylinder, Model, Paint, Polygon, Shape, Source as LightSource, Sphere, Visible};

const HEAD: &str = "v from 0 0 8 at 0 0 0 up 0 1 0 angle 45 hither 1 resolution 512 512\n";
const SURFACE: &str = "f 1 0.5 0.2 0.8 0.1 3 0 0\n";

fn parse(text: &str) -> Result<Scene, SceneErrors> {
    read(text, Path::new("a.nff"))
}

fn errors(text: &str) -> Vec<String> {
    parse(text).expect_err(text).iter().map(ToString::to_string).collect()
}

/// Objects by kind as the notes beside the set count them: spheres, cones and cylinders, polygons of one
/// and of two visible sides, lights.
#[test]
fn the_whole_set_is_read() {
    let table = [
        ("balls_s1_t13.nff.gz", [0, 0, 1, 20_280, 3]),
        ("balls_s1_t6.nff.gz", [0, 0, 1, 4320, 3]),
        ("balls_s2.nff", [91, 0, 1, 0, 3]),
        ("balls_s4.nff", [7381, 0, 1, 0, 3]),
        ("balls_s5.nff.gz", [66_430, 0, 1, 0, 3]),
        ("gears_s1.nff", [0, 0, 147, 0, 5]),
        ("gears_s2.nff", [0, 0, 1169, 0, 5]),
        ("gears_s4.nff.gz", [0, 0, 9345, 0, 5]),
        ("jacks_s3.nff", [438, 219, 0, 0, 1]),
        ("lattice_s12.nff.gz", [2197, 6084, 0, 0, 6]),
        ("mount_s4.nff", [4, 0, 512, 0, 1]),
        ("mount_s6.nff.gz", [4, 0, 8192, 0, 1]),
        ("mount_s8.nff.gz", [4, 0, 131_072, 0, 1]),
        ("rings_s2.nff", [150, 150, 1, 0, 3]),
        ("rings_s7.nff.gz", [4200, 4200, 1, 0, 3]),
        ("shells_s5.nff", [5761, 0, 0, 0, 1]),
        ("sombrero_s1.nff", [0, 0, 1922, 0, 1]),
        ("teapot_s12.nff.gz", [0, 0, 144, 9120, 2]),
        ("teapot_s4.nff", [0, 0, 16, 992, 2]),
        ("tetra_s3.nff", [0, 0, 64, 0, 1]),
        ("tetra_s6.nff", [0, 0, 4096, 0, 1]),
        ("tetra_s8.nff.gz", [0, 0, 65_536, 0, 1]),
        ("tree_s11.nff", [4095, 4095, 1, 0, 7]),
        ("tree_s5.nff", [63, 63, 1, 0, 7]),
    ];
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/nff");
    for (name, expected) in table {
        let scene = load(&folder.join(name)).unwrap_or_else(|errors| panic!("{errors}"));
        let mut counts = [0, 0, 0, 0, scene.lights.len()];
        for object in &scene.objects {
            let visible = scene.materials[object.material].visible;
            counts[match (&object.shape, visible) {
                (Shape::Sphere(_), _) => 0,
                (Shape::Cylinder(_) | Shape::Cone(_), _) => 1,
                (Shape::Polygon(polygon), Visible::Both) if !polygon.normals.is_empty() => 3,
                (Shape::Polygon(polygon), _) if polygon.normals.is_empty() => 2,
                (shape, visible) => panic!("{name}: {shape:?} {visible:?}"),
            }] += 1;
        }
        assert_eq!(counts, expected, "{name}");
        assert!(scene.warnings.is_empty(), "{name}: {}", scene.warnings[0]);
        let size = if name.starts_with("jacks") { 256 } else { 512 };
        assert_eq!(scene.image.map(|image| [image.width, image.height]), Some([size; 2]), "{name}");
    }
}

#[test]
fn every_statement_arrives() {
    let text =
        "b 0.1 0.2 0.3 # a comment; l 9 9 9\nv from 1 2 3\nat 0 0 1e-1 up 0 .5 0.\nangle 60 hither 0 resolution 300 200
        l 1 2 3 l 4 5 6 0.1 0.2 0.3
        f 1 0.5 0.25 0.8 0.2 30 0 0
        s +1 -2 3E0 4 s 1 2 3 -4
        c 0 0 0 2 0 0 5 2 c 0 0 0 -2 0 0 5 -1 c 0 0 0 1 0 0 1 0
        p 3 0 0 0 1 0 0 0 1 0
        pp 3 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 1 2
        f 1 1 1 0 0.1 30 0.9 1.5 s 0 0 0 1 s 0 0 0 -1";
    let scene = parse(text).unwrap_or_else(|errors| panic!("{errors}"));
    assert!(matches!(scene.background.backdrop, Backdrop::Color(color) if color == DVec3::new(0.1, 0.2, 0.3)));
    let camera = scene.camera(None).unwrap();
    assert_eq!([camera.eye, camera.target], [DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.0, 0.0, 0.1)]);
    assert_eq!(camera.up, DVec3::new(0.0, 0.5, 0.0));
    assert_eq!(scene.image.as_ref().map(|image| [image.width, image.height, image.spp]), Some([300, 200, 16]));

    let usual = DVec3::splat(2f64.sqrt() / 4.0);
    assert_eq!(scene.ambient, usual);
    let lights: Vec<_> = scene.lights.iter().map(|light| light.source.clone()).collect();
    let light =
        |position, intensity| LightSource::Point { position, intensity: PI * intensity, falloff: Falloff::None };
    let colored = light(DVec3::new(4.0, 5.0, 6.0), DVec3::new(0.1, 0.2, 0.3));
    assert_eq!(lights, [light(DVec3::new(1.0, 2.0, 3.0), usual), colored]);

    let objects: Vec<_> = scene.objects.iter().map(|o| (&o.shape, scene.materials[o.material].name.as_str())).collect();
    let sphere = |x, y, z, radius| Shape::Sphere(Sphere { center: DVec3::new(x, y, z), radius });
    let (base, apex, tip) = (DVec3::ZERO, DVec3::new(0.0, 0.0, 5.0), DVec3::Z);
    let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    let flat = Polygon { corners, ..Polygon::default() };
    let smooth = Polygon { normals: vec![DVec3::Z, DVec3::Z, DVec3::new(0.0, 1.0, 2.0)], ..flat.clone() };
    let expected = [
        (&sphere(1.0, -2.0, 3.0, 4.0), "f1"),
        (&sphere(1.0, 2.0, 3.0, 4.0), "f1_inside"),
        (&Shape::Cylinder(Cylinder { base, apex, radius: 2.0, caps: false }), "f1"),
        (&Shape::Cone(Cone { base, apex, radius: 2.0, apex_radius: 1.0, caps: false }), "f1_inside"),
        (&Shape::Cone(Cone { base, apex: tip, radius: 1.0, apex_radius: 0.0, caps: false }), "f1"),
        (&Shape::Polygon(flat), "f1"),
        (&Shape::Polygon(smooth), "f1_two_sided"),
        (&sphere(0.0, 0.0, 0.0, 1.0), "f2"),
        (&sphere(0.0, 0.0, 0.0, 1.0), "f2_inside"),
    ];
    assert_eq!(objects, expected);
    let names: Vec<_> = scene.materials.iter().map(|material| (material.name.as_str(), material.visible)).collect();
    let (front, back, both) = (Visible::Front, Visible::Back, Visible::Both);
    assert_eq!(names, [("f1", front), ("f1_inside", back), ("f1_two_sided", both), ("f2", both), ("f2_inside", back)]);
    let color = Paint::Color(DVec3::new(1.0, 0.5, 0.25));
    let phong = Model::Phong { color, kd: 0.8, ks: 0.2, shine: 30.0, transmittance: 0.0, ior: 0.0 };
    assert_eq!(scene.materials[0].model, phong);
}

/// On the plane at distance 1, the centres of the first and the last row are `2 tan(angle/2)` apart.
#[test]
fn the_angle_spans_the_centres_of_the_outer_rows() {
    for (angle, rows) in [(45.0, 512), (60.0, 2), (1.0, 65_536), (120.0, 37)] {
        let edges = 2.0 * (edge_angle(angle, rows).to_radians() / 2.0).tan();
        let centres = edges * f64::from(rows - 1) / f64::from(rows);
        let expected = 2.0 * (angle.to_radians() / 2.0).tan();
        assert!((centres / expected - 1.0).abs() < 1e-14, "{angle} {rows}: {centres} {expected}");
    }
    assert_eq!(edge_angle(30.0, 1), 30.0);
}

#[test]
fn what_is_absent_is_black() {
    let empty = parse("# nothing\n").unwrap();
    assert!(empty.cameras.is_empty() && empty.image.is_none() && empty.lights.is_empty());
    assert_eq!(empty.ambient, DVec3::ZERO);
    assert!(matches!(empty.background.backdrop, Backdrop::Color(DVec3::ZERO)));
}

#[test]
fn mistakes_are_told_by_place_rule_and_value() {
    let cases: [(&str, &[&str]); 28] = [
        ("s 0 0 0 0", &["3:9: sphere radius must not be 0, found `0`"]),
        ("s 0 0 0", &["3:8: `s` takes more numbers: x y z radius, found the end of the file"]),
        ("s 0 0 0 # radius\n\n", &["3:17: `s` takes more numbers: x y z radius, found the end of the file"]),
        ("s 0 0 0\ns 0 0 0 1", &["4:1: `s` takes more numbers: x y z radius, found `s`"]),
        ("s 0 0 0 1 5\ns 0 0 0 1", &["3:11: `s` in line 3 must end before this number, found `5`"]),
        (
            "s 0 zero 0 1e\ns 0 0 0 0",
            &[
                "3:5: `s` takes numbers: x y z radius, found `zero`",
                "3:12: `s` takes numbers: x y z radius, found `1e`",
                "4:9: sphere radius must not be 0, found `0`",
            ],
        ),
        ("s nan 0 0 1", &["3:3: a number must be finite and at most 1e15 in size, found `nan`"]),
        ("s 0 -inf 0 1", &["3:5: a number must be finite and at most 1e15 in size, found `-inf`"]),
        ("s 0 0 1e999 1", &["3:7: a number must be finite and at most 1e15 in size, found `1e999`"]),
        ("s 0 0 2e15 1", &["3:7: a number must be finite and at most 1e15 in size, found `2e15`"]),
        (
            "sphere 0 0 0 1\ns 0 0 0 1",
            &["3:1: a statement must start with a keyword: v b l f s c p pp, found `sphere`"],
        ),
        ("c 0 0 0 1 0 0 0 1", &["3:1: cylinder apex must differ from its base, found [0, 0, 0]"]),
        ("c 0 0 0 0 0 0 1 0", &["3:9: the radii of a cone must not both be 0, found `0`"]),
        ("c 0 0 0 1 0 0 1 -1", &["3:17: the radii of a cone must have one sign, found `-1`"]),
        ("f 1 -0.5 0 1 1 1 1 1", &["3:5: a colour must be >= 0, found `-0.5`"]),
        ("f 1 1 1 1 1 -1 1 -1", &["3:13: shine must be >= 0, found `-1`", "3:18: ior must be >= 0, found `-1`"]),
        ("l 0 0 0 1 1\ns 0 0 0 1", &["4:1: `l` takes more numbers: x y z, then red green blue or nothing, found `s`"]),
        ("b 1 1 1 b 1 1 1", &["3:9: a file must have one background, found `b`"]),
        (
            "p 2 0 0 0 1 0 0\ns 0 0 0 0",
            &[
                "3:3: a polygon must have a whole number of corners, 3 to 65535, found `2`",
                "4:9: sphere radius must not be 0, found `0`",
            ],
        ),
        ("p 4000000000 0 0 0", &["3:3: a polygon must have a whole number of corners, 3 to 65535, found `4000000000`"]),
        ("p 3.5 0 0 0", &["3:3: a polygon must have a whole number of corners, 3 to 65535, found `3.5`"]),
        ("p", &["3:2: a polygon must have a whole number of corners, 3 to 65535, found the end of the file"]),
        (
            "p 4 0 0 0 1 0 0 1 1 0\ns 0 0 0 1",
            &["4:1: `p` takes more numbers: a count, then x y z for each corner, found `s`"],
        ),
        ("p 3 0 0 0 1 0 0 1 1 0 0 1 0\ns 0 0 0 1", &["3:23: `p` in line 3 must end before this number, found `0`"]),
        (
            "p 4 0 0 0 1 0 0 1 1 1 0 1 0",
            &["3:1: polygon must be flat to 1e-4 of its size, found corner 0 (the first is 0) 0.204124 off its plane"],
        ),
        (
            "p 3 0 0 0 1 0 0 2 0 0",
            &["3:1: polygon must have an area, found none: its corners are in line or cancel out"],
        ),
        (
            "p 4 0 0 0 1 1 0 1 0 0 0 2 0",
            &[
                "3:1: polygon must not cross or touch itself, found the edges from corner 0 and from corner 2 meeting (the first is 0)",
            ],
        ),
        ("pp 3 0 0 0 0 0 0 1 0 0 0 0 1 0 1 0 0 0 1", &["3:12: a shading normal must not be zero, found `0`"]),
    ];
    for (body, expected) in cases {
        let expected: Vec<_> = expected.iter().map(|message| format!("a.nff:{message}")).collect();
        assert_eq!(errors(&format!("{HEAD}{SURFACE}{body}")), expected, "{body}");
    }
}

#[test]
fn mistakes_of_the_whole_file_are_told_once() {
    let bare = "the first object must stand after its surface, an `f` statement, found `s`";
    assert_eq!(errors("s 0 0 0 1 s 0 0 0 1"), [format!("a.nff:1:1: {bare}")]);
    let garbage = "an NFF file must start with a keyword: v b l f s c p pp, found `format`";
    assert_eq!(errors("format = 1\n[image]\nwidth = 3"), [format!("a.nff:1:1: {garbage}")]);
    let second = format!("{HEAD}{HEAD}");
    assert_eq!(errors(&second), ["a.nff:2:1: a file must have one view, found `v`"]);
}

#[test]
fn corners_in_line_are_dropped_with_a_warning() {
    let text = format!("{SURFACE}\npp 5 0 0 0 0 0 1 1 0 0 0 0 2 2 0 0 0 0 3 2 2 0 0 0 4 0 2 0 0 0 5");
    let scene = parse(&text).unwrap();
    let Shape::Polygon(polygon) = &scene.objects[0].shape else { panic!("{:?}", scene.objects[0]) };
    assert_eq!(polygon.normals, [1.0, 3.0, 4.0, 5.0].map(|z| DVec3::Z * z));
    let warning = "a.nff:3:1: warning: polygon corner 1 repeated or in line with both neighbours is dropped";
    assert_eq!(scene.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(), [warning]);
}

#[test]
fn a_view_is_checked_part_by_part() {
    let view = |from: &str, up: &str, angle: &str, size: &str| {
        format!("v\nfrom {from}\nat 0 0 0\nup {up}\nangle {angle}\nhither 1\nresolution {size}")
    };
    let good = ["0 0 8", "0 1 0", "45", "512 512"];
    let cases = [
        (["0 0 0", "0 1 0", "45", "512 512"], "1:1: camera target must differ from its eye, found [0, 0, 0]"),
        (["0 0 8", "0 0 -3", "45", "512 512"], "1:1: camera up must not be parallel to the view, found [0, 0, -3]"),
        (["0 0 8", "0 0 0", "45", "512 512"], "1:1: camera up must not be zero, found [0, 0, 0]"),
        (["0 0 8", "0 1 0", "180", "512 512"], "5:7: the view's angle must be between 0 and 180 degrees, found `180`"),
        (["0 0 8", "0 1 0", "0", "512 512"], "5:7: the view's angle must be between 0 and 180 degrees, found `0`"),
        (
            good.map(|part| part.trim_end_matches(" 512")),
            "7:15: `v` takes more numbers: from x y z, at x y z, up x y z, angle a, hither h, resolution w h, found the end of the file",
        ),
        (
            ["0 0 8", "0 1 0", "45", "0 512"],
            "7:12: a resolution must be whole numbers of pixels, 1 to 65536, found `0`",
        ),
        (
            ["0 0 8", "0 1 0", "45", "512 1.5"],
            "7:16: a resolution must be whole numbers of pixels, 1 to 65536, found `1.5`",
        ),
        (["0 0 8", "0 1 0", "45", "65536 65536"], "7:12: a picture must have at most 2^30 pixels, found `65536`"),
        (
            ["0 0 8 up 1 0 0", "0 1 0", "45", "512 512"],
            "2:12: a view must go on with `at` (from x y z, at x y z, up x y z, angle a, hither h, resolution w h), found `up`",
        ),
        (
            ["0 0", "0 1 0", "45", "512 512"],
            "3:1: `v` takes more numbers: from x y z, at x y z, up x y z, angle a, hither h, resolution w h, found `at`",
        ),
    ];
    for ([from, up, angle, size], expected) in cases {
        assert_eq!(errors(&view(from, up, angle, size)), [format!("a.nff:{expected}")]);
    }
    let [from, up, angle, size] = good;
    assert!(parse(&view(from, up, angle, size)).is_ok());
}

proptest! {
    /// Cut, doubled and overwritten anywhere, a file gives a scene or errors, and every error a place in it.
    #[test]
    fn torn_text_never_panics(cut in 0usize..600, length in 0usize..80, patch in "[ a-z0-9#.+\\-\\n\u{e9}]{0,12}", twice: bool) {
        let text = format!("b 0 0 0\n{HEAD}l 1 2 3 l 1 2 3 1 1 1\n{SURFACE}s 1 2 3 4\nc 0 0 0 2 0 0 5 1 # open\np 4 0 0 0 1 0 0 1 1 0 0 1 0
            pp 3 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1\nf 1 1 1 0.1 0.2 100 0.9 1.5 s 0 0 0 -1 c 0 0 0 1 1 1 1 1");
        prop_assert!(parse(&text).is_ok());
        let (start, end) = (cut.min(text.len()), (cut + length).min(text.len()));
        let tail = if twice { &text[start..] } else { &text[end..] };
        let torn = format!("{}{patch}{tail}", &text[..start]);
        match parse(&torn) {
            Ok(scene) => prop_assert!(scene.objects.iter().all(|object| object.material < scene.materials.len())),
            Err(errors) => {
                let lines = torn.lines().count().max(1);
                prop_assert!(!errors.is_empty() && errors.iter().all(|error| (1..=lines).contains(&error.place.line)), "{errors}");
            }
        }
    }

    #[test]
    fn any_text_is_read_without_panic(text in "\\PC{0,200}") {
        let _ = parse(&text);
    }
}
