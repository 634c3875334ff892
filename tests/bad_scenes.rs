//! Every rule of the scene format has a scene that breaks it: `tests/bad_scenes/RULE.toml` says in
//! `# expect:` lines which errors it must get, to the line, the column and the letter, and in
//! `# schema:` whether the JSON Schema sees the mistake too. What needs broken binary files is below.

mod scene_files;

use std::fs;
use std::path::{Path, PathBuf};

use octray::scene::{SCHEMA, Scene};

use scene_files::{floats, json, npy, npy_with_header};

fn scenes() -> Vec<PathBuf> {
    let entries = fs::read_dir("tests/bad_scenes").unwrap().map(|entry| entry.unwrap().path());
    let mut scenes: Vec<_> = entries.filter(|path| path.extension().is_some_and(|end| end == "toml")).collect();
    scenes.sort();
    scenes
}

fn header<'a>(text: &'a str, key: &str) -> Vec<&'a str> {
    text.lines().filter_map(|line| line.strip_prefix("# ")?.strip_prefix(key)?.strip_prefix(": ")).collect()
}

/// Each error as `line:column: message`, with its file in front if that is not the scene itself.
fn errors(path: &Path) -> Vec<String> {
    let Err(errors) = Scene::load(path) else { return vec!["none".to_owned()] };
    let report = errors.report(false);
    let line = |error: &octray::scene::SceneError| {
        assert!(report.contains(&error.message()), "{} is not in\n{report}", error.message());
        let place = &error.place;
        let file = match place.path.strip_prefix("tests/bad_scenes") {
            Ok(file) if place.path != path => format!("{}:", file.display()),
            _ => String::new(),
        };
        format!("{file}{}:{}: {}", place.line, place.column, error.message())
    };
    errors.iter().map(line).collect()
}

#[test]
fn every_bad_scene_gets_its_messages() {
    let mut wrong = String::new();
    for path in scenes() {
        let text = fs::read_to_string(&path).unwrap();
        let (want, got) = (header(&text, "expect"), errors(&path));
        if want != got {
            let got: String = got.iter().map(|line| format!("# expect: {line}\n")).collect();
            wrong += &format!("{} should start with\n{got}\n", path.display());
        }
    }
    assert!(scenes().len() > 100, "too few bad scenes: {}", scenes().len());
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn the_schema_sees_what_it_can() {
    let validator = jsonschema::validator_for(&serde_json::from_str(SCHEMA).unwrap()).unwrap();
    let (mut wrong, mut rejected) = (String::new(), 0);
    for path in scenes() {
        let text = fs::read_to_string(&path).unwrap();
        let verdict = match json(&text) {
            None => "not TOML",
            Some(scene) if validator.is_valid(&scene) => "accepts",
            Some(_) => "rejects",
        };
        rejected += usize::from(verdict == "rejects");
        if header(&text, "schema") != [verdict] {
            wrong += &format!("{}: the schema {verdict}\n", path.display());
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
    assert!(rejected > 80, "{rejected}");
}

/// Writes `files`, then the scene; gives back its errors without their places.
fn messages(files: &[(&str, Vec<u8>)], scene: &str) -> Vec<String> {
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        fs::write(dir.path().join(name), bytes).unwrap();
    }
    match Scene::from_toml(scene, dir.path()) {
        Ok(_) => Vec::new(),
        Err(errors) => errors.iter().map(|error| error.message()).collect(),
    }
}

fn cloud(kind: &str, more: &str) -> String {
    format!(
        "format = 1\n[materials.clay]\ntype = \"diffuse\"\n[[clouds]]\ntype = \"{kind}\"\nmaterial = \"clay\"\n{more}"
    )
}

#[test]
fn broken_arrays_get_their_messages() {
    let ones = floats(&[1.0; 8]);
    let deep = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {}2, 4{}}}", "(".repeat(20), ")".repeat(20));
    let mut long = npy("<f4", "(2, 4)", &ones);
    long[6] = 2;
    long[8..12].copy_from_slice(&[0xff; 4]);
    let cases: Vec<(Vec<u8>, &str)> = vec![
        (b"".to_vec(), "must be a .npy file, found other bytes at its start"),
        (b"x y z r\n1 2 3 4\n".to_vec(), "must be a .npy file, found other bytes at its start"),
        (
            npy("<f4", "(2, 4)", &ones)[..40].to_vec(),
            "must be a whole .npy file, found the end of the file in its header",
        ),
        (
            npy("<f4", "(2, 4)", &ones[..31]),
            "must be as long as its 2 rows of 16 bytes, found 31 bytes behind the header",
        ),
        (npy("<f4", "(1, 4)", &ones), "must be as long as its 1 rows of 16 bytes, found 32 bytes behind the header"),
        (
            npy("<f4", "(1000000000000, 4)", &ones),
            "must be as long as its 1000000000000 rows of 16 bytes, found 32 bytes behind the header",
        ),
        (
            npy("<f4", "(4611686018427387904, 4)", &ones),
            "must be a .npy file with a sound header, found one of no array",
        ),
        (npy("<f4", "(2, 3)", &ones), "must be an array of N x 4 numbers, found the shape (2, 3)"),
        (npy("<f4", "(8,)", &ones), "must be an array of N x 4 numbers, found the shape (8)"),
        (npy(">f4", "(2, 4)", &ones), "must hold little-endian float32 or float64 (\"<f4\" or \"<f8\"), found \">f4\""),
        (npy("<i8", "(1, 4)", &ones), "must hold little-endian float32 or float64 (\"<f4\" or \"<f8\"), found \"<i8\""),
        (npy_with_header(&deep, &ones), "must be a .npy file with a sound header, found one of no array"),
        (
            npy_with_header("{'descr': '<f4', 'fortran_order': True, 'shape': (2, 4)}", &ones),
            "must be in C order, found Fortran order",
        ),
        (
            npy_with_header("{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (8,)}", &ones),
            "must be a plain array, found a structured one",
        ),
        (long, "must have a header of at most 65536 bytes, found 4294967295"),
        (
            npy("<f4", "(2, 4)", &floats(&[0.0, 0.0, 0.0, 1.0, 0.0, f32::NAN, 0.0, 1.0])),
            "row 1: sphere center must be finite, found NaN",
        ),
        (
            npy("<f4", "(2, 4)", &floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 2e15, 0.0, 1.0])),
            "row 1: sphere center must be at most 1e15, found 1999999973982208",
        ),
        (npy("<f4", "(2, 4)", &floats(&[0.0; 8])), "row 0: sphere radius must be > 0, found 0"),
    ];
    for (bytes, want) in cases {
        let got = messages(&[("a.npy", bytes)], &cloud("spheres", "file = \"a.npy\"\n"));
        assert_eq!(got, [format!("a.npy {want}")]);
    }
}

#[test]
fn broken_indices_and_polygons_get_their_messages() {
    let triangle = npy("<f4", "(3, 3)", &floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]));
    let line = npy("<f4", "(3, 3)", &floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0]));
    let scene = cloud("polygons", "file = \"a.npy\"\nsizes = \"s.npy\"\n");
    let one = |corners: &Vec<u8>, sizes: Vec<u8>| messages(&[("a.npy", corners.clone()), ("s.npy", sizes)], &scene);
    assert_eq!(one(&triangle, npy("<u4", "(1,)", &3u32.to_le_bytes())), [""; 0]);
    let kinds = "s.npy must hold uint8, or little-endian uint16 or uint32 (\"|u1\", \"<u2\" or \"<u4\"), found \"<i8\"";
    assert_eq!(one(&triangle, npy("<i8", "(1,)", &3i64.to_le_bytes())), [kinds]);
    let many = "s.npy must sum up to the 3 corners of the cloud, found 4";
    assert_eq!(one(&triangle, npy("|u1", "(1,)", &[4])), [many]);
    let huge = "s.npy row 0: polygon must have 3 to 65535 corners, found 1000000";
    assert_eq!(one(&triangle, npy("<u4", "(1,)", &1_000_000u32.to_le_bytes())), [huge]);
    let flat = "a.npy row 0: polygon must have an area, found none: its corners are in line or cancel out";
    assert_eq!(one(&line, npy("|u1", "(1,)", &[3])), [flat]);
}

#[test]
fn broken_pictures_get_their_messages() {
    let picture = |name: &str, bytes: Vec<u8>| {
        let shown = "[materials.m]\ntype = \"diffuse\"\nalbedo = { texture = \"wood\" }\n\
                     [[shapes]]\ntype = \"plane\"\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n";
        let scene = format!("format = 1\n[textures.wood]\ntype = \"image\"\nfile = \"{name}\"\n{shown}");
        messages(&[(name, bytes)], &scene)
    };
    let dot = fs::read("tests/bad_scenes/parts/dot.png").unwrap();
    assert_eq!(picture("dot.png", dot.clone()), [""; 0]);
    let start = "must be a sound PNG, JPEG, HDR or EXR picture: ";
    for bytes in [Vec::new(), b"wood".to_vec(), dot[..20].to_vec(), dot[..dot.len() - 20].to_vec()] {
        let got = picture("dot.png", bytes);
        assert!(got.len() == 1 && got[0].starts_with(&format!("dot.png {start}")), "{got:?}");
    }
    // The size in the header is believed by nobody: 2^31 - 1 pixels a side are not allocated.
    let mut vast = dot;
    vast[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    let crc = crc32(&vast[12..29]);
    vast[29..33].copy_from_slice(&crc.to_be_bytes());
    let got = picture("dot.png", vast);
    assert!(got.len() == 1 && (got[0].contains(start) || got[0].contains("2^27 pixels")), "{got:?}");
    let texel = |value: f32| {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        image::Rgb32FImage::from_pixel(2, 1, image::Rgb([value, 0.5, 0.5])).save(&path).unwrap();
        fs::read(path).unwrap()
    };
    assert_eq!(
        picture("a.exr", texel(f32::NAN)),
        ["a.exr must hold finite numbers, found [NaN, 0.5, 0.5] in column 0, row 0"]
    );
    assert_eq!(picture("a.exr", texel(-1.0)), [""; 0]);
}

/// The checksum of PNG chunks, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
}

#[test]
fn a_million_corners_are_one_error() {
    let corners = "[0, 0, 0],".repeat(1_000_000);
    let scene = format!(
        "format = 1\n[materials.clay]\ntype = \"diffuse\"\n[[shapes]]\ntype = \"polygon\"\nmaterial = \"clay\"\ncorners = [{corners}]\n"
    );
    assert_eq!(messages(&[], &scene), ["polygon must have 3 to 65535 corners, found 1000000"]);
}

#[test]
fn files_that_are_no_scenes_get_their_messages() {
    let load = |path: &str| Scene::load(path).unwrap_err().to_string();
    assert!(load("tests/none.toml").starts_with("tests/none.toml: cannot be read: "));
    assert_eq!(
        load("tests/bad_scenes.rs"),
        "tests/bad_scenes.rs: a scene file must end in .toml, .nff or .nff.gz, or as atoms do: .xyz, .extxyz, .lammpstrj, .dump, .lmp, .data, .pdb, .ent, .sdf, .mol"
    );
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.toml");
    fs::create_dir(&path).unwrap();
    let message = format!("{}: must be a file, not a directory or device", path.display());
    assert_eq!(Scene::load(&path).unwrap_err().to_string(), message);
}

#[test]
fn includes_have_a_depth() {
    let dir = tempfile::tempdir().unwrap();
    for i in 0..20 {
        let text = format!("format = 1\ninclude = [\"{}.toml\"]\n", i + 1);
        fs::write(dir.path().join(format!("{i}.toml")), text).unwrap();
    }
    let errors = Scene::load(dir.path().join("0.toml")).unwrap_err();
    assert_eq!(errors.len(), 1);
    assert!(errors.to_string().ends_with("16.toml is too much: includes go 16 files deep and name 1000 files at most"));
}
