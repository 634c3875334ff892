//! `octray query`: rays from a file, hits to a file, as NumPy reads them.

mod command;

use std::fs;

use command::Room;
use octray::render::Engine;
use octray::{Query, Ray, Scene, Tracer};

/// The header that `numpy.save` gives to a structured array of this type, but for the padding.
const HIT: &str = "{'descr': [('t', '<f4'), ('primitive', '<i4'), ('material', '<i4'), ('normal', '<f4', (3,)), \
    ('uv', '<f4', (2,)), ('front', '|b1')], 'fortran_order': False, 'shape': (";

/// One record of a file of hits.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Record {
    t: f32,
    primitive: i32,
    material: i32,
    normal: [f32; 3],
    uv: [f32; 2],
    front: bool,
}

const MISS: Record =
    Record { t: f32::INFINITY, primitive: -1, material: -1, normal: [0.0; 3], uv: [0.0; 2], front: false };

/// Version 1.0 of the format, as NumPy writes it.
fn npy(descr: &str, shape: &str, order: &str, data: &[u8]) -> Vec<u8> {
    let text = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
    let length = (text.len() + 11).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend_from_slice(&(length as u16).to_le_bytes());
    bytes.extend_from_slice(format!("{text:<width$}\n", width = length - 1).as_bytes());
    bytes.extend_from_slice(data);
    bytes
}

fn rays_file(rays: &[Ray]) -> Vec<u8> {
    let numbers = rays.iter().flat_map(|ray| {
        let ([x, y, z], [dx, dy, dz]) = (ray.origin, ray.dir);
        [x, y, z, ray.t_min, dx, dy, dz, ray.t_max].map(f32::to_le_bytes)
    });
    npy("<f4", &format!("({}, 8)", rays.len()), "False", &numbers.flatten().collect::<Vec<_>>())
}

/// The text of a header and the data behind it.
fn open(room: &Room, name: &str) -> (String, Vec<u8>) {
    let bytes = fs::read(room.path(name)).unwrap();
    assert_eq!(bytes[..8], *b"\x93NUMPY\x01\x00");
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert_eq!((start % 64, bytes[start - 1]), (0, b'\n'));
    (String::from_utf8(bytes[10..start].to_vec()).unwrap(), bytes[start..].to_vec())
}

fn hits(room: &Room, name: &str) -> Vec<Record> {
    let (header, data) = open(room, name);
    let count = data.len() / 33;
    assert_eq!(header.trim_end(), format!("{HIT}{count},), }}"));
    assert_eq!(data.len(), 33 * count);
    data.chunks(33)
        .map(|bytes| {
            let word = |i: usize| [bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]];
            let float = |i: usize| f32::from_le_bytes(word(i));
            let int = |i: usize| i32::from_le_bytes(word(i));
            assert!(bytes[32] < 2);
            let (normal, uv) = ([float(3), float(4), float(5)], [float(6), float(7)]);
            Record { t: float(0), primitive: int(1), material: int(2), normal, uv, front: bytes[32] == 1 }
        })
        .collect()
}

/// A fan of rays from the eye of the scene, with hits on both shapes and misses.
fn fan() -> Vec<Ray> {
    let ray = |i: usize| {
        let (x, y) = ((i % 37) as f32 / 18.0 - 1.0, (i / 37) as f32 / 18.0 - 1.0);
        Ray { origin: [0.0, 1.0, 6.0], t_min: 0.0, dir: [0.6 * x, 0.4 * y, -1.0], t_max: f32::INFINITY }
    };
    (0..37 * 37).map(ray).collect()
}

#[test]
fn hits_are_what_geometry_says() {
    let room = Room::new();
    let ray = |origin, dir| Ray { origin, t_min: 0.0, dir, t_max: f32::INFINITY };
    let rays = [
        ray([0.0, 1.0, 6.0], [0.0, 0.0, -1.0]), // the sphere, head on
        ray([0.0, 1.0, 6.0], [0.0, 0.0, -2.0]), // t counts lengths of the direction
        ray([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),  // from inside: its back
        ray([5.0, 4.0, 0.0], [0.0, -1.0, 0.0]), // the floor
        ray([5.0, -4.0, 0.0], [0.0, 1.0, 0.0]), // the floor from below
        ray([0.0, 3.0, 6.0], [0.0, 0.0, 1.0]),  // nothing
        Ray { t_max: 4.5, ..ray([0.0, 1.0, 6.0], [0.0, 0.0, -1.0]) }, // ends before the sphere
        Ray { t_max: 5.0, ..ray([0.0, 1.0, 6.0], [0.0, 0.0, -1.0]) }, // ends on it: closed
        Ray { t_min: 5.0, ..ray([0.0, 1.0, 6.0], [0.0, 0.0, -1.0]) }, // begins on it: open, so its back
        ray([0.0, 1.0, 6.0], [0.0, 0.0, 0.0]),  // no direction
        ray([f32::NAN, 1.0, 6.0], [0.0, 0.0, -1.0]), // no place
    ];
    room.write("rays.npy", rays_file(&rays));
    let up = Record { t: 4.0, primitive: 0, material: 0, normal: [0.0, 1.0, 0.0], uv: [0.0; 2], front: true };
    let head_on = Record { t: 5.0, primitive: 1, material: 1, normal: [0.0, 0.0, 1.0], uv: [0.25, 0.5], front: true };
    let expected = [
        head_on,
        Record { t: 2.5, ..head_on },
        Record { t: 1.0, front: false, ..head_on },
        up,
        Record { front: false, ..up },
        MISS,
        MISS,
        head_on,
        Record { t: 7.0, normal: [0.0, 0.0, -1.0], uv: [0.75, 0.5], front: false, ..head_on },
        MISS,
        MISS,
    ];
    for engine in ["packet", "single", "reference"] {
        room.texts(&format!("query scene.toml rays.npy -o hits.npy --engine {engine}"), 0);
        for (i, (found, expected)) in hits(&room, "hits.npy").into_iter().zip(expected).enumerate() {
            // The floor's uv are in scene units along axes of its own; they are tested with the plane.
            let uv = if expected.primitive == 0 { found.uv } else { expected.uv };
            assert_eq!(found, Record { uv, ..expected }, "{engine}, ray {i}");
        }
        room.texts(&format!("query scene.toml rays.npy -o any.npy --any --engine {engine}"), 0);
        let (header, answers) = open(&room, "any.npy");
        assert_eq!(header.trim_end(), "{'descr': '|b1', 'fortran_order': False, 'shape': (11,), }");
        assert_eq!(answers, expected.map(|hit| u8::from(hit.primitive >= 0)), "{engine}");
    }
}

#[test]
fn files_hold_what_the_library_answers_whatever_the_threads() {
    let room = Room::new();
    let (scene, rays) = (Scene::load(room.path("scene.toml")).unwrap(), fan());
    room.write("rays.npy", rays_file(&rays));
    let tracer = Tracer::new(&scene).expect("valid");
    let expected: Vec<_> = tracer.closest_hits(&rays).into_iter().map(|hit| hit.map_or(MISS, record)).collect();
    let met = expected.iter().filter(|hit| hit.primitive >= 0).count();
    assert!(met > 300 && rays.len() - met > 300, "{met}");
    for arguments in ["-t 1", "-t 3", "--engine single -t 2", "--repeat 3"] {
        let (out, err) = room.texts(&format!("query scene.toml rays.npy -o hits.npy {arguments}"), 0);
        assert!(out.is_empty() && err.contains(&format!("hits.npy: {met} of 1369 rays met something")), "{err}");
        assert_eq!(hits(&room, "hits.npy"), expected, "{arguments}");
    }
    for engine in [Engine::Packet, Engine::Single, Engine::Reference] {
        let query = Query::new(&scene, engine, 2).unwrap();
        let primitives: Vec<_> = query.closest(&rays).iter().map(|hit| hit.map(|hit| hit.primitive)).collect();
        let wanted: Vec<_> = expected.iter().map(|hit| u32::try_from(hit.primitive).ok()).collect();
        assert_eq!(primitives, wanted, "{engine:?}");
        assert_eq!(query.occluded(&rays), wanted.iter().map(Option::is_some).collect::<Vec<_>>(), "{engine:?}");
    }
}

fn record(hit: octray::Hit) -> Record {
    let (primitive, material) = (hit.primitive as i32, hit.material as i32);
    Record { t: hit.t, primitive, material, normal: hit.normal, uv: hit.uv, front: hit.front }
}

#[test]
fn a_scene_without_camera_and_image_can_be_asked() {
    let room = Room::new();
    room.write(
        "bare.toml",
        "format = 1\n[materials.a]\ntype = \"diffuse\"\n[[shapes]]\ntype = \"sphere\"\ncenter = [0, 1, 0]\n\
            radius = 1\nmaterial = \"a\"\n",
    );
    room.write("rays.npy", rays_file(&fan()));
    room.texts("query bare.toml rays.npy -o hits.npy -q", 0);
    assert!(hits(&room, "hits.npy").iter().any(|hit| hit.primitive == 0));
}

#[test]
fn no_rays_are_no_hits() {
    let room = Room::new();
    room.write("rays.npy", rays_file(&[]));
    room.texts("query scene.toml rays.npy -o hits.npy", 0);
    assert!(hits(&room, "hits.npy").is_empty());
}

#[test]
fn stats_tell_rays_and_times() {
    let room = Room::new();
    room.write("rays.npy", rays_file(&fan()));
    room.texts("query scene.toml rays.npy -o hits.npy --stats q.json -t 2 --repeat 2", 0);
    let stats: serde_json::Value = serde_json::from_str(&fs::read_to_string(room.path("q.json")).unwrap()).unwrap();
    assert_eq!((&stats["schema"], &stats["threads"], &stats["query"]["rays"]), (&1.into(), &2.into(), &1369.into()));
    assert!(stats["query"]["trace_seconds"].as_f64().unwrap() > 0.0);
    assert!(stats["query"].get("trace_cpu_seconds").is_some() && stats["memory"]["column_bytes"].as_u64().unwrap() > 0);
}

#[test]
fn other_files_are_no_rays() {
    let room = Room::new();
    let floats = vec![0; 2 * 8 * 4];
    let bad = [
        ("double.npy", npy("<f8", "(2, 8)", "False", &[0; 128]), "rays must be float32 (\"<f4\"), found float64"),
        ("int.npy", npy("<i4", "(2, 8)", "False", &floats), "found \"<i4\""),
        ("big.npy", npy(">f4", "(2, 8)", "False", &floats), "found \">f4\""),
        ("seven.npy", npy("<f4", "(2, 7)", "False", &[0; 56]), "an array of N x 8 numbers, found the shape (2, 7)"),
        ("flat.npy", npy("<f4", "(16,)", "False", &floats), "found the shape (16)"),
        ("fortran.npy", npy("<f4", "(2, 8)", "True", &floats), "must be in C order"),
        ("cut.npy", npy("<f4", "(2, 8)", "False", &floats[..40]), "found"),
        ("huge.npy", npy("<f4", "(4611686018427387904, 8)", "False", &floats), "found"),
        ("text.npy", b"0 0 0 0 0 0 1 9".to_vec(), "must be a .npy file"),
        ("empty.npy", Vec::new(), "a file of rays "),
        ("rays.csv", b"0,0,0\n".to_vec(), "rays must be in a .npy file of float32, N x 8"),
    ];
    for (name, bytes, message) in bad {
        room.write(name, bytes);
        let (out, err) = room.texts(&format!("query scene.toml {name} -o hits.npy"), 3);
        assert!(err.contains(&format!("{name}: ")) && err.contains(message), "{name}\n{err}");
        assert!(out.is_empty() && err.lines().count() == 1 && !room.path("hits.npy").exists(), "{err}");
    }
}
