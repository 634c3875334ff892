//! Batches: lists of jobs, what is left out the second time, progress, checkpoints, tiles, ground truth.

mod command;

use std::collections::BTreeMap;
use std::fs;

use command::{Room, scene};
use octray::film::Samples;
use octray::output;
use serde_json::Value;

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

const LIST: &str = r#"{"defaults": {"scene": "scene.toml", "resolution": [24, 16], "spp": 2}}
{"seed": 1}
{"seed": 2, "output": "two.png"}
{"camera": {"type": "pinhole", "eye": [0, 3, 6], "target": [0, 0, 0], "vfov": 30}}
"#;

#[test]
fn a_list_is_rendered_and_left_out_the_second_time() {
    let room = Room::new();
    room.write("jobs.jsonl", LIST);
    let (_, err) = room.texts("batch jobs.jsonl --out-dir out --no-date", 0);
    assert!(err.contains("3 of 3 pictures written"), "{err}");
    room.run("render scene.toml -o one.exr --resolution 24x16 --spp 2 --seed 1 --no-date -q").success();
    let read = |name: &str| fs::read(room.path(name)).unwrap();
    assert_eq!(read("out/scene.000001.exr"), read("one.exr"), "a picture is the same alone");
    let (_, err) = room.texts("batch jobs.jsonl --out-dir out --no-date", 0);
    assert!(err.contains("0 of 3 pictures written, 3 were there already"), "{err}");
    let whole = read("out/scene.000003.exr");
    fs::write(room.path("out/scene.000003.exr"), &whole[..whole.len() - 9]).unwrap();
    fs::remove_file(room.path("out/two.png")).unwrap();
    let (page, _) = room.texts("status out --json", 1);
    let status = json(&page);
    assert_eq!((status["whole"].as_u64(), status["missing"][0].as_str()), (Some(1), Some("two.png")));
    assert_eq!(status["changed"][0].as_str(), Some("scene.000003.exr"));
    let (_, err) = room.texts("batch jobs.jsonl --out-dir out --no-date", 0);
    assert!(err.contains("2 of 3 pictures written, 1 were there already"), "{err}");
    assert_eq!(read("out/scene.000003.exr"), whole);
    room.texts("status out", 0);
    let (_, err) = room.texts("batch jobs.jsonl --out-dir out --no-date --again", 0);
    assert!(err.contains("3 of 3 pictures written"), "{err}");
    room.write("bad.jsonl", "{\"scene\": \"scene.toml\"}\n{\"scen\": \"scene.toml\"}\n");
    let (_, err) = room.texts("batch bad.jsonl", 3);
    assert!(err.contains("bad.jsonl:2: unknown field `scen`"), "{err}");
}

#[test]
fn one_scene_that_fails_does_not_stop_the_others() {
    let room = Room::new();
    for name in ["a", "c"] {
        room.write(&format!("{name}.toml"), command::SCENE);
    }
    room.write("b.toml", command::SCENE.replace("radius = 1", "radius = -1"));
    let small = "--resolution 16x12 --spp 1";
    let (_, err) = room.texts(&format!("render a.toml b.toml c.toml --out-dir out {small}"), 1);
    assert!(err.contains("1 of 3 pictures failed: out/b.exr"), "{err}");
    assert!(err.contains("b.toml:27:10: sphere radius must be > 0, found -1"), "{err}");
    assert!(room.path("out/a.exr").exists() && room.path("out/c.exr").exists() && !room.path("out/b.exr").exists());
    let (_, err) = room.texts(&format!("render a.toml ./a.toml --out-dir out {small}"), 2);
    assert!(err.contains("would be the picture of two jobs, 1 and 2"), "{err}");
}

/// The picture counts with all of its layers, whoever says how large it is.
#[test]
fn more_memory_than_allowed_is_refused() {
    let room = Room::new();
    let ask = "render scene.toml -o one.exr --spp 1 -q --resolution 1000x1000";
    room.run(&format!("{ask} --max-memory 60M")).success();
    // Rows that are packed as they come take less than a picture that waits as a whole.
    room.run(&format!("{ask} -t 2 --aov all --max-memory 150M --stats s.json")).success();
    let stats = json(&fs::read_to_string(room.path("s.json")).unwrap());
    assert!(stats["memory"]["peak_bytes"].as_u64().is_some_and(|peak| peak < 150 << 20), "{stats}");
    for words in [
        " --max-memory 10M",
        " --max-memory 60M --aov all",
        " -t 2 --max-memory 150M --aov all --checkpoint c.part",
        " -t 2 --max-memory 150M --aov all --cost",
        " -t 2 --max-memory 150M --aov all --background transparent",
    ] {
        let (_, err) = room.texts(&format!("{ask}{words}"), 5);
        assert!(err.contains("MiB of memory are needed, and the limit is"), "{words}: {err}");
    }
}

#[test]
fn shards_share_out_the_frames() {
    let room = Room::new();
    let small = "--frames 1-5 --resolution 16x12 --spp 1 -q --no-date";
    room.run(&format!("render scene.toml --out-dir whole {small}")).success();
    room.run(&format!("render scene.toml --out-dir out --shard 1/2 {small}")).success();
    assert!(room.path("out/scene.0005.exr").exists() && !room.path("out/scene.0004.exr").exists());
    room.run(&format!("render scene.toml --out-dir out --shard 2/2 {small}")).success();
    for frame in 1..=5 {
        let read = |dir: &str| fs::read(room.path(&format!("{dir}/scene.000{frame}.exr"))).unwrap();
        assert_eq!(read("out"), read("whole"));
    }
}

/// Every line is JSON of a known event; each frame begins and ends once; shares rise.
#[test]
fn progress_lines_are_strict() {
    let room = Room::new();
    let (out, err) = room.texts("render scene.toml --frames 1-4 --out-dir out --spp 1 --progress json", 0);
    assert!(err.is_empty(), "{err}");
    let lines: Vec<Value> = out.lines().map(json).collect();
    let mut count: BTreeMap<&str, usize> = BTreeMap::new();
    lines.iter().for_each(|line| *count.entry(line["event"].as_str().unwrap()).or_default() += 1);
    assert_eq!((count["start"], count["frame_start"], count["frame_done"], count["end"]), (1, 4, 4, 1));
    assert_eq!((lines[0]["event"].as_str(), lines[0]["frames"].as_u64()), (Some("start"), Some(4)));
    let last = lines.last().unwrap();
    assert_eq!((last["event"].as_str(), last["written"].as_u64()), (Some("end"), Some(4)));
    let shares = lines.iter().filter(|line| line["event"] == "progress").map(|line| line["done"].as_f64().unwrap());
    assert!(shares.clone().all(|share| (0.0..=1.0).contains(&share)) && shares.is_sorted());
    let (out, _) = room.texts("render scene.toml --frames 1-4 --out-dir out --spp 1 --progress openjd", 0);
    let known = |line: &str| {
        let share = line.strip_prefix("openjd_progress: ").and_then(|share| share.parse::<f64>().ok());
        share.is_some_and(|share| (0.0..=100.0).contains(&share)) || line.starts_with("openjd_status: ")
    };
    assert!(out.lines().all(known) && out.ends_with("openjd_progress: 100.0\n"), "{out}");
    room.texts("render scene.toml -o - --progress json", 2);
}

#[test]
fn tiles_are_the_picture() {
    let room = Room::new();
    let small = "--spp 2 -q --no-date";
    room.run(&format!("render scene.toml -o whole.exr {small}")).success();
    for tile in 1..=6 {
        room.run(&format!("render scene.toml -o t{tile}.exr --tiles 3x2 --tile {tile} {small}")).success();
    }
    room.run("merge t1.exr t2.exr t3.exr t4.exr t5.exr t6.exr -o joined.exr").success();
    let picture = |name: &str| output::read(&room.path(name)).unwrap();
    assert_eq!(picture("joined.exr").pixels, picture("whole.exr").pixels);
    room.texts("render scene.toml -o x.exr --tiles 3x2 --tile 7", 2);
}

/// A render that is stopped again and again ends with the bytes of one that was not, layers included.
#[cfg(unix)]
#[test]
fn a_checkpoint_goes_on_to_the_same_bytes() {
    use std::process::Command;
    let room = Room::new();
    let options = "--resolution 320x240 --spp 64 --no-date -q --aov depth,normal,ids,cryptomatte -t 1";
    room.run(&format!("render scene.toml -o whole.exr {options}")).success();
    let mut stops = 0;
    for _ in 0..200 {
        let arguments = format!("render scene.toml -o out.exr {options} --checkpoint c --checkpoint-every 0.02s");
        let mut child = Command::new(command::binary());
        let mut child = child.args(arguments.split(' ')).current_dir(room.path(".")).spawn().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(400));
        let _ = Command::new("kill")
            .args([if stops % 2 == 0 { "-TERM" } else { "-KILL" }, &child.id().to_string()])
            .status();
        let status = child.wait().unwrap();
        if status.success() {
            break;
        }
        stops += 1;
        if room.path("out.exr").exists() {
            // Stopped between its last step and its end: whole, and done again without harm.
            room.run(&arguments).success();
            break;
        }
    }
    assert!(stops >= 1, "it was never stopped");
    assert_eq!(fs::read(room.path("out.exr")).unwrap(), fs::read(room.path("whole.exr")).unwrap(), "{stops} stops");
    assert!(!room.path("c").exists(), "a finished picture needs no checkpoint");
    room.write("c", "something else");
    let (_, err) = room.texts(&format!("render scene.toml -o out.exr {options} --checkpoint c"), 3);
    assert!(err.contains("is no checkpoint"), "{err}");
}

/// Counts and boxes are those of the id layer; a sphere that nothing hides has a share of 1.
#[test]
fn annotations_are_what_the_ids_show() {
    let room = Room::new();
    let file = scene("fig5.toml");
    room.run(&format!("render {file} -o a.exr --resolution 160x120 --spp 1 --aov ids --annotations -q")).success();
    room.run(&format!("render {file} -o b.exr --resolution 160x120 --spp 1 --annotations -q")).success();
    let page = json(&fs::read_to_string(room.path("a.json")).unwrap());
    assert_eq!(page["annotations"], json(&fs::read_to_string(room.path("b.json")).unwrap())["annotations"]);
    assert!(output::read(&room.path("b.exr")).unwrap().channel("id.object").is_none());
    let picture = output::read(&room.path("a.exr")).unwrap();
    let Samples::Uint(ids) = &picture.channel("id.object").unwrap().samples else { panic!("ids are whole numbers") };
    let mut counts: BTreeMap<u64, u64> = BTreeMap::new();
    ids.iter().filter(|id| **id > 0).for_each(|id| *counts.entry(u64::from(*id)).or_default() += 1);
    let list = page["annotations"].as_array().unwrap();
    assert!(list.len() > 5 && list.len() == counts.len());
    let mut whole = 0;
    for one in list {
        let id = one["id"].as_u64().unwrap();
        assert_eq!(one["area"].as_u64(), Some(counts[&id]));
        let bounds: Vec<i64> = one["bbox"].as_array().unwrap().iter().map(|x| x.as_i64().unwrap()).collect();
        let places =
            (0..ids.len()).filter(|place| u64::from(ids[*place]) == id).map(|place| picture.window.pixel(place));
        let (xs, ys): (Vec<i64>, Vec<i64>) = places.map(|(x, y)| (i64::from(x), i64::from(y))).unzip();
        let (x, y) = (*xs.iter().min().unwrap(), *ys.iter().min().unwrap());
        assert_eq!(bounds, [x, y, xs.iter().max().unwrap() - x + 1, ys.iter().max().unwrap() - y + 1]);
        let share = one["visible_share"].as_f64().unwrap();
        assert!(share > 0.0 && share <= 1.0, "{one}");
        whole += usize::from(share == 1.0);
    }
    assert!(whole >= 2, "{whole} of {} are seen whole", list.len());
    let k = &page["camera"]["intrinsics"];
    assert_eq!((k[0][2].as_f64(), k[1][2].as_f64()), (Some(80.0), Some(60.0)));
    // A part of the picture, and more than the picture, have the same objects whole.
    let shares = |name: &str| -> BTreeMap<u64, f64> {
        let page = json(&fs::read_to_string(room.path(name)).unwrap());
        let list = page["annotations"].as_array().unwrap();
        list.iter().map(|one| (one["id"].as_u64().unwrap(), one["visible_share"].as_f64().unwrap())).collect()
    };
    let all = shares("a.json");
    for (name, option) in [("c", "--crop 40,30,120,90"), ("d", "--overscan 20")] {
        room.run(&format!("render {file} -o {name}.exr --resolution 160x120 --spp 1 --annotations -q {option}"))
            .success();
        let part = shares(&format!("{name}.json"));
        let whole = part.iter().filter(|(id, share)| all.get(id) == Some(&1.0) && **share == 1.0).count();
        let hidden = part.iter().filter(|(id, share)| all.get(id) != Some(&1.0) && **share < 1.0).count();
        assert!(whole >= 1 && hidden >= 1, "{name}: {part:?} of {all:?}");
    }
}

#[test]
fn a_script_for_slurm_is_sound_shell() {
    let room = Room::new();
    room.run("farm slurm scene.toml --frames 1-10,20 --shards 3 -o a.sh --mem 2G -- --spp 4").success();
    room.run("farm slurm scene.toml --tiles 2x2 -o b.sh").success();
    for name in ["a.sh", "b.sh"] {
        let sound = std::process::Command::new("sh").arg("-n").arg(room.path(name)).status().unwrap();
        assert!(sound.success(), "{name}");
    }
    let text = fs::read_to_string(room.path("a.sh")).unwrap();
    for part in ["#SBATCH --array=1-3\n", "#SBATCH --mem=2G\n", "--frames 1-10,20", "--spp 4", "afterany"] {
        assert!(text.contains(part), "{part} is missing from\n{text}");
    }
    room.texts("farm slurm gone.toml --frames 1", 3);
    room.texts("farm slurm scene.toml", 2);
}
