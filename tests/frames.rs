//! Frames on the command line: names, failures, files of atoms without a scene.

mod command;

use command::{Room, scene};

#[test]
fn atoms_render_without_a_scene() {
    let room = Room::new();
    let file = |name: &str| scene(&format!("particles/{name}"));
    room.run(&format!("render {} --resolution 40x30 --spp 1", file("4hhb.pdb"))).success();
    room.run(&format!("render {} -o water.png --resolution 40x30 --spp 1 --style licorice", file("water.xyz.gz")))
        .success();
    assert_eq!(room.outputs(), ["4hhb.exr", "water.png"]);
    room.run(&format!("check {} --resolution 24x18 --seconds 5", file("aspirin.sdf"))).success();
    let (info, _) = room.texts(&format!("info {} --json", file("polymer.lammpstrj.gz")), 0);
    let info: serde_json::Value = serde_json::from_str(&info).unwrap();
    assert_eq!((info["frames"].as_u64(), info["primitives"]["sphere"].as_u64()), (Some(42), Some(1714)));
    let (_, error) = room.texts(&format!("render {} -o a.exr", file("bad/helium.xyz")), 3);
    assert!(error.contains("helium.xyz:7:1: there must be atom 5 of 8"), "{error}");
    let (_, error) = room.texts("render scene.toml --style licorice -o a.exr", 2);
    assert!(error.contains("are for files of atoms"), "{error}");
}

/// What `convert` writes of atoms renders to the same picture, from as many samples on as their own look takes.
#[test]
fn atoms_become_scenes() {
    let room = Room::new();
    let file = scene("particles/MOF-5.pdb");
    let options = "--style ball-and-stick";
    room.run(&format!("convert {file} mof.toml {options}")).success();
    for (input, output) in [(format!("{file} {options}"), "a.exr"), ("mof.toml".to_owned(), "b.exr")] {
        room.run(&format!("render {input} -o {output} --resolution 60x45 --spp 4 --no-date")).success();
    }
    let (report, _) = room.texts("compare a.exr b.exr --json", 0);
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["rmse"].as_f64(), Some(0.0), "{report}");
}

#[test]
fn frames_have_names_of_their_own() {
    let room = Room::new();
    let file = scene("particles/trajectory.xyz");
    let small = "--resolution 16x12 --spp 1 -q --no-date";
    room.run(&format!("render {file} --frames 1-2 --out-dir out {small}")).success();
    room.run(&format!("render {file} --frames 2 -o two.exr {small}")).success();
    room.run(&format!("render {file} --frames 2,1 -o f_##.png {small}")).success();
    assert_eq!(room.outputs(), ["f_01.png", "f_02.png", "out", "two.exr"]);
    let read = |name: &str| std::fs::read(room.path(name)).unwrap();
    assert_eq!(read("out/trajectory.0002.exr"), read("two.exr"), "a frame is the same alone");
    assert_ne!(read("out/trajectory.0001.exr"), read("two.exr"));
    let (_, error) = room.texts(&format!("render {file} --frames 1-2 -o a.exr {small}"), 2);
    assert!(error.contains("has no place for the number of the frame"), "{error}");
    let (_, error) = room.texts(&format!("render {file} --frames 1-2x0 -o a.#.exr {small}"), 2);
    assert!(error.contains("should be frames such as"), "{error}");
}

#[test]
fn a_frame_that_fails_does_not_stop_the_others() {
    let room = Room::new();
    let file = scene("particles/trajectory.xyz");
    let (_, error) = room.texts(&format!("render {file} --frames 1-3 --out-dir out --resolution 16x12 --spp 1"), 1);
    assert!(
        error.contains("has 2 frames: there is no frame 3")
            && error.contains("1 of 3 pictures failed: out/trajectory.0003.exr"),
        "{error}"
    );
    assert!(room.path("out/trajectory.0002.exr").exists() && !room.path("out/trajectory.0003.exr").exists());
}

#[test]
fn animated_scenes_render_as_they_are_at_their_frames() {
    let room = Room::new();
    let keyed = command::SCENE.replace("eye = [0, 1, 6]", "eye = { keys = [[1, [0, 1, 6]], [3, [0, 3, 8]]] }");
    room.write("keyed.toml", &keyed);
    room.write("two.toml", command::SCENE.replace("eye = [0, 1, 6]", "eye = [0, 2, 7]"));
    room.run("render keyed.toml --frames 1-3 -o keyed.#.exr --no-date").success();
    room.run("render two.toml -o two.exr --no-date").success();
    let (report, _) = room.texts("compare keyed.0002.exr two.exr --json", 0);
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["rmse"].as_f64(), Some(0.0), "{report}");
}
