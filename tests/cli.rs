//! The command line: what each command prints and writes, and how it ends.

mod command;

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use command::{Room, binary, scene};
use octray::film::Picture;
use octray::output;
use serde_json::Value;

fn picture(path: &Path) -> Picture {
    output::read(path).unwrap()
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

fn names(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

// render

#[test]
fn render_writes_a_picture_named_after_the_scene_and_says_so() {
    let room = Room::new();
    let (out, err) = room.texts("render scene.toml", 0);
    assert!(out.is_empty() && err.contains("no -o given: the picture goes to scene.exr"), "{err}");
    assert!(err.contains("scene.exr: 48x32 pixels, 4 spp, ") && err.contains("Mrays/s"), "{err}");
    assert_eq!(room.outputs(), ["scene.exr"]);
    let picture = picture(&room.path("scene.exr"));
    assert_eq!((picture.display, picture.window.area()), ((48, 32), 48 * 32));
    assert!(picture.pixels.iter().any(|pixel| pixel[0] > 0.1));
}

#[test]
fn render_writes_every_format_and_depth() {
    let room = Room::new();
    for arguments in ["a.exr", "b.exr --float", "c.png", "d.png --bits 16", "e.PNG"] {
        let (_, err) = room.texts(&format!("render scene.toml -q -o {arguments}"), 0);
        assert!(err.is_empty(), "{err}");
    }
    let size = |name: &str| fs::metadata(room.path(name)).unwrap().len();
    assert!(size("b.exr") > size("a.exr") && size("d.png") > size("c.png"));
    assert_eq!(room.outputs(), ["a.exr", "b.exr", "c.png", "d.png", "e.PNG"]);
    let (eight, sixteen) = (picture(&room.path("c.png")), picture(&room.path("d.png")));
    assert_eq!(eight.display, sixteen.display);
}

#[test]
fn exr_goes_to_standard_output_as_well() {
    let room = Room::new();
    room.texts("render scene.toml --no-date -q -o a.exr", 0);
    let output = room.command("render scene.toml --no-date -o -").output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(output.stdout, fs::read(room.path("a.exr")).unwrap());
}

#[test]
fn a_crop_has_the_bits_of_the_whole_picture() {
    let room = Room::new();
    room.texts("render scene.toml -q --float -o whole.exr", 0);
    room.texts("render scene.toml -q --float -o part.exr --crop 10,5,31,20", 0);
    let (whole, part) = (picture(&room.path("whole.exr")), picture(&room.path("part.exr")));
    assert_eq!((part.display, part.window.width(), part.window.height()), ((48, 32), 21, 15));
    assert_eq!(whole.crop(part.window).unwrap(), part);
}

#[test]
fn equal_renders_are_equal_files_whatever_the_threads_and_the_engine() {
    let room = Room::new();
    let render = |name: &str, more: &str| {
        room.texts(&format!("render scene.toml -q --no-date --float -o {name} {more}"), 0);
        fs::read(room.path(name)).unwrap()
    };
    let first = render("a.exr", "-t 1");
    for more in ["-t 3", "--engine single", "--no-skip", "--seed 0 --max-depth 5 --spp 4 --integrator direct"] {
        assert_eq!(render("b.exr", more), first, "{more}");
    }
    assert_ne!(render("b.exr", "--seed 1"), first);
    assert_ne!(render("b.exr", "--max-depth 1"), first);
    let by_epoch = room.command("render scene.toml -q --float -o c.exr").env("SOURCE_DATE_EPOCH", "1").assert();
    by_epoch.success();
    assert_eq!(fs::read(room.path("c.exr")).unwrap(), first);
}

#[test]
fn the_reference_engine_renders_nearly_the_same() {
    let room = Room::new();
    room.texts("render scene.toml -q --float -o a.exr", 0);
    room.texts("render scene.toml -q --float -o b.exr --engine reference --stats b.json", 0);
    room.texts("compare a.exr b.exr --max-rmse 1e-3 --max-diff 0.05", 0);
    let stats = json(&fs::read_to_string(room.path("b.json")).unwrap());
    assert_eq!(stats["rays"]["camera"], 48 * 32 * 4);
    assert!(stats["hits"]["shadow"].is_null() && stats["hits"]["camera"].as_u64().unwrap() > 1000);
}

#[test]
fn stats_have_their_promised_names() {
    let room = Room::new();
    room.texts("render scene.toml -q -o a.exr -t 2 --stats a.json", 0);
    let stats = json(&fs::read_to_string(room.path("a.json")).unwrap());
    let top = "schema octray simd threads seconds cpu_seconds rays hits tests redecided tiles skipped memory";
    assert_eq!(names(&stats), top.split(' ').collect::<Vec<_>>());
    assert_eq!(names(&stats["seconds"]).join(" "), "load plan build trace shade write total");
    for kinds in ["rays", "hits"] {
        assert_eq!(names(&stats[kinds]).join(" "), "camera shadow reflection refraction bounce");
    }
    assert_eq!(names(&stats["tests"]).join(" "), "box sphere plane disk polygon cuboid cylinder cone");
    assert_eq!(names(&stats["tiles"]).join(" "), "total background");
    assert_eq!(names(&stats["memory"]).join(" "), "peak_bytes column_bytes tree_bytes");
    assert_eq!((&stats["schema"], &stats["threads"]), (&Value::from(1), &Value::from(2)));
    assert_eq!(stats["rays"]["camera"], 48 * 32 * 4);
    let count = |group: &str, name: &str| stats[group][name].as_u64().unwrap();
    assert!(count("rays", "reflection") > 0 && count("hits", "camera") < count("rays", "camera"));
    assert!(count("tests", "sphere") > 0 && count("tests", "plane") > 0 && count("tests", "cone") == 0);
    assert!(stats["skipped"].is_array() && stats["seconds"]["total"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_scene_without_an_image_takes_its_size_from_the_command() {
    let room = Room::new();
    let text = command::SCENE.replace("[image]\nwidth = 48\nheight = 32\nspp = 4\n", "");
    room.write("bare.toml", text);
    let (_, err) = room.texts("render bare.toml -o a.exr", 3);
    assert!(err.contains("say --resolution WxH"), "{err}");
    let (_, err) = room.texts("render bare.toml -o a.exr --resolution 6x4", 0);
    assert!(err.contains("6x4 pixels, 16 spp"), "{err}");
}

// Failures: the cause as exit code, one clear message, nothing left behind.

#[test]
fn outputs_that_cannot_be_written_are_refused_before_any_work() {
    let room = Room::new();
    fs::create_dir(room.path("folder.exr")).unwrap();
    // The scene does not exist either: that would be found out only later.
    for (arguments, code, message) in [
        ("render none.toml -o folder.exr", 4, "folder.exr: is a directory"),
        ("render none.toml -o new/", 4, "new/: is a directory"),
        ("render none.toml -o gone/a.exr", 4, "gone/a.exr: cannot be written: there is no directory"),
        ("render none.toml -o a.exr --stats gone/a.json", 4, "gone/a.json: cannot be written"),
        ("render none.toml -o a.jpg", 2, "should end in .exr or .png"),
        ("render none.toml -o a", 2, "should end in .exr or .png"),
        ("render none.toml -o a.exr --stats a.exr", 2, "both the picture and --stats"),
        ("render none.toml -o a.png --float", 2, "--float is for EXR"),
        ("render none.toml -o a.exr --bits 16", 2, "--bits is for PNG"),
        ("render none.toml -o a.exr --tonemap agx", 2, "--tonemap is for PNG"),
        ("query none.toml rays.npy -o gone/hits.npy", 4, "gone/hits.npy: cannot be written"),
        ("query none.toml rays.npy -o hits.txt", 2, "hits should go to a .npy file"),
        ("convert none.toml gone/b.toml", 4, "gone/b.toml: cannot be written"),
        ("compare a.exr b.exr --heatmap gone/h.png", 4, "gone/h.png: cannot be written"),
        ("compare a.exr b.exr --heatmap h.exr", 2, "a heat map should end in .png"),
        ("render scene.toml --frames 1-2 -o f.#.exr --tev 127.0.0.1:9", 2, "--tev shows a single picture, not 2"),
        ("man gone", 4, "cannot be written: there is no directory"),
    ] {
        let (out, err) = room.texts(arguments, code);
        assert!(err.contains(message) && err.lines().count() == 1 && out.is_empty(), "{arguments}\n{err}");
    }
    assert_eq!(room.outputs(), ["folder.exr"]);
}

#[test]
fn wrong_usage_says_what_would_be_right() {
    let room = Room::new();
    for (arguments, message) in [
        ("", "Usage: octray"),
        ("rendr scene.toml", "'render'"),
        ("render", "<SCENE>"),
        ("render scene.toml --resolution 640", "such as 640x480"),
        ("render scene.toml --resolution 65536x65536", "2^30"),
        ("render scene.toml --crop 1,2,3", "X0,Y0,X1,Y1"),
        ("render scene.toml --crop 40,0,60,9", "does not lie inside the picture of 48x32"),
        ("render scene.toml --crop -1,0,4,4", "does not lie inside the picture of 48x32"),
        ("render scene.toml --camera left", "no camera named \"left\""),
        ("render scene.toml --spp 0", "1..="),
        ("render scene.toml --max-depth 0", "1..="),
        ("render scene.toml --integrator radiosity", "possible values: direct, ao, path"),
        ("render scene.toml --engine gpu", "possible values: packet, single, reference"),
        ("render scene.toml -t many", "invalid value"),
        ("render scene.toml --seed -1", "invalid value '-1' for '--seed <N>'"),
        ("info", "<SCENE>"),
        ("compare a.exr b.exr --max-rmse -1", "0 or more"),
        ("convert scene.toml a.png", "octray render makes a picture"),
        ("convert scene.toml scene.toml", "the output should be another file"),
        ("convert a.exr a.toml", "should end in .exr or .png"),
        ("convert a.jpg a.png", "should end in .toml, .nff, .nff.gz, .exr or .png"),
        ("convert scene.toml b.toml --float", "are for pictures"),
        ("render scene.toml -o a.png --exposure x", "stops from -64 to 64"),
        ("render scene.toml -o a.png --white 0", "above 0"),
        ("render scene.toml --tev nonsense", "HOST:PORT, such as 127.0.0.1:14158"),
        ("completions cmd", "possible values: bash"),
    ] {
        let (out, err) = room.texts(arguments, 2);
        assert!(err.contains(message) && out.is_empty(), "octray {arguments}\n{err}");
    }
    assert!(room.outputs().is_empty(), "{:?}", room.outputs());
}

#[test]
fn every_mistake_of_a_scene_is_shown_where_it_is() {
    let room = Room::new();
    room.write("bad.toml", command::SCENE.replace("radius = 1", "radius = -1").replace("vfov = 40", "vfov = 400"));
    for command in ["render bad.toml -o a.exr", "info bad.toml", "check bad.toml", "convert bad.toml b.toml"] {
        let (out, err) = room.texts(command, 3);
        assert!(err.contains("bad.toml: 2 mistakes in the scene"), "{err}");
        for part in ["bad.toml:10:8", "vfov", "found 400", "bad.toml:27:10", "sphere radius must be > 0, found -1"] {
            assert!(err.contains(part), "{part} is missing from\n{err}");
        }
        assert!(out.is_empty() && !err.contains('\u{1b}'));
    }
    assert_eq!(room.outputs(), ["bad.toml"]);
    let (_, colored) = room.texts("info bad.toml --color always", 3);
    assert!(colored.contains('\u{1b}'));
}

#[test]
fn bad_inputs_of_every_kind_end_with_3() {
    let room = Room::new();
    room.texts("render scene.toml -q -o good.exr", 0);
    room.texts("render scene.toml -q -o good.png", 0);
    for name in ["good.exr", "good.png"] {
        let bytes = fs::read(room.path(name)).unwrap();
        room.write(&format!("cut-{name}"), &bytes[..bytes.len() / 2]);
    }
    room.write("empty.exr", "");
    room.write("text.exr", "not a picture");
    room.write("cut.nff", "v\nfrom 0 0");
    room.write("cut.nff.gz", [0x1f, 0x8b, 8, 0]);
    room.write("nan.toml", command::SCENE.replace("[0, 1, 0]\nradius", "[nan, 1, 0]\nradius"));
    room.write(
        "cloud.toml",
        format!("{}[[clouds]]\ntype = \"spheres\"\nfile = \"gone.npy\"\nmaterial = \"floor\"\n", command::SCENE),
    );
    for (arguments, message) in [
        ("render gone.toml -o a.exr", "gone.toml: cannot be read"),
        ("render .. -o a.exr", "must end in .toml, .nff or .nff.gz"),
        ("render cut.nff -o a.exr", "cut.nff:2:"),
        ("render cut.nff.gz -o a.exr", "cut.nff.gz: "),
        ("render nan.toml -o a.exr", "nan.toml:26:11: sphere center must be finite"),
        ("render cloud.toml -o a.exr", "gone.npy"),
        ("compare good.exr gone.exr", "gone.exr: cannot be read"),
        ("compare cut-good.exr good.exr", "cut-good.exr: is damaged"),
        ("compare good.exr cut-good.png", "cut-good.png: is damaged"),
        ("compare good.exr empty.exr", "empty.exr: "),
        ("compare good.exr text.exr", "text.exr: is neither an EXR nor a PNG file"),
        ("convert cut-good.exr a.png", "cut-good.exr: is damaged"),
        ("query scene.toml gone.npy -o a.npy", "gone.npy: a file of rays cannot be read"),
    ] {
        let (out, err) = room.texts(arguments, 3);
        assert!(err.contains(message) && out.is_empty(), "octray {arguments}\n{err}");
    }
    assert!(!room.outputs().iter().any(|name| name.starts_with("a.")), "{:?}", room.outputs());
}

#[test]
fn a_scene_without_a_camera_is_no_picture_but_can_be_looked_at() {
    let room = Room::new();
    let camera = "[camera]\ntype = \"pinhole\"\neye = [0, 1, 6]\ntarget = [0, 0.5, 0]\nvfov = 40\n";
    room.write("blind.toml", command::SCENE.replace(camera, ""));
    let (_, err) = room.texts("render blind.toml", 3);
    assert!(err.contains("the scene has no camera: add a [camera] table"), "{err}");
    let (out, _) = room.texts("info blind.toml", 0);
    assert!(out.contains("cameras     none"), "{out}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told() {
    let room = Room::new();
    let (_, err) = room.texts("render scene.toml -o /dev/full", 4);
    assert!(err.contains("/dev/full: cannot be written: No space left"), "{err}");
    let full = || Stdio::from(fs::OpenOptions::new().write(true).open("/dev/full").unwrap());
    for arguments in [&["info", "--schema"][..], &["render", "scene.toml", "-q", "-o", "-"]] {
        let mut command = Command::new(binary());
        command.args(arguments).current_dir(room.path(".")).stdout(full()).stderr(Stdio::piped());
        let output = command.output().unwrap();
        let err = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(4), "{err}");
        assert!(err.contains("standard output") && err.contains("cannot be written: No space left"), "{err}");
    }
}

/// What does not fit is refused with the forecast, not killed later. The limit on the address space
/// stands for a small machine.
#[cfg(target_os = "linux")]
#[test]
fn a_picture_that_does_not_fit_into_memory_ends_with_5() {
    let room = Room::new();
    let script = "ulimit -v 4000000 && exec \"$0\" render scene.toml -o a.exr --spp 1 --resolution 20000x20000 -t 2";
    let output = Command::new("sh").args(["-c", script]).arg(binary()).current_dir(room.path(".")).output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(5), "{err}");
    assert!(err.contains("a picture of 20000x20000 pixels needs about 4.5 GiB of memory, and "), "{err}");
    assert!(room.outputs().is_empty());
}

#[cfg(unix)]
#[test]
fn signals_end_a_render_at_once_and_leave_nothing() {
    for (signal, code) in [("-INT", 130), ("-TERM", 143)] {
        let room = Room::new();
        let mut command = Command::new(binary());
        let endless = ["render", "scene.toml", "-o", "a.exr", "--spp", "1000000", "--resolution", "4000x3000"];
        let child = command.args(endless).current_dir(room.path(".")).stderr(Stdio::piped()).spawn().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(700));
        let sent = std::time::Instant::now();
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let output = child.wait_with_output().unwrap();
        let err = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{err}");
        assert!(sent.elapsed().as_secs_f64() < 2.0, "{:?}", sent.elapsed());
        assert!(err.contains("stopped by SIG"), "{err}");
        assert!(room.outputs().is_empty(), "{:?}", room.outputs());
    }
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let mut command = Command::new(binary());
    let mut child = command.args(["info", "--schema"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stderr), (Some(0), Vec::new()));
}

// info

#[test]
fn info_tells_what_a_scene_holds() {
    let room = Room::new();
    let (out, err) = room.texts("info scene.toml", 0);
    for line in [
        "primitives  2: 1 plane, 1 sphere",
        "bounds      (-1, 0, -1) to (1, 2, 1)",
        "materials   0 floor: diffuse",
        "1 mirror: mirror",
        "lights      0: point",
        "cameras     pinhole, vfov 40, from (0, 1, 6) to (0, 0.5, 0)",
        "image       48x32, 4 spp, gaussian 1.5",
        "render      direct, depth 5, seed 0",
        "memory      columns ",
    ] {
        assert!(out.contains(line), "{line} is missing from\n{out}");
    }
    assert!(err.is_empty(), "{err}");
}

#[test]
fn info_as_json_lists_the_materials_by_index() {
    let room = Room::new();
    let info = json(&room.texts("info scene.toml --json", 0).0);
    assert_eq!((&info["schema"], &info["primitives"]["total"]), (&Value::from(1), &Value::from(2)));
    let materials: Vec<_> = info["materials"].as_array().unwrap().iter().map(|m| (&m["index"], &m["name"])).collect();
    let named = |index: i32, name: &str| (Value::from(index), Value::from(name));
    let expected = [named(0, "floor"), named(1, "mirror")];
    assert_eq!(materials, expected.iter().map(|(index, name)| (index, name)).collect::<Vec<_>>());
    assert_eq!(info["bounds"]["max"], serde_json::json!([1.0, 2.0, 1.0]));
}

#[test]
fn info_shows_warnings_and_reads_clouds_and_nff() {
    let room = Room::new();
    let info = json(&room.texts(&format!("info {} --json", scene("groups.toml")), 0).0);
    assert!(info["primitives"]["total"].as_u64().unwrap() > 100);
    let info = json(&room.texts(&format!("info {} --json", scene("nff/tetra_s3.nff")), 0).0);
    assert_eq!(info["primitives"]["polygon"], info["primitives"]["total"]);
    // A repeated corner is dropped with a warning on standard error and in the JSON.
    let polygon =
        "[[shapes]]\ntype = \"polygon\"\ncorners = [[0,0,0], [0,0,0], [1,0,0], [0,1,0]]\nmaterial = \"floor\"\n";
    room.write("warn.toml", format!("{}{polygon}", command::SCENE));
    let (out, err) = room.texts("info warn.toml --json", 0);
    assert!(err.contains("octray: warn.toml:") && err.contains("warning: "), "{err}");
    assert_eq!(json(&out)["warnings"].as_array().unwrap().len(), 1);
    assert!(room.texts("info warn.toml --json -q", 0).1.is_empty());
}

#[test]
fn the_schema_is_the_library_s() {
    let room = Room::new();
    let (out, _) = room.texts("info --schema", 0);
    assert_eq!(out, octray::scene::SCHEMA);
    assert!(json(&out)["properties"]["shapes"].is_object());
}

// check

#[test]
fn check_passes_and_says_what_it_compared() {
    let room = Room::new();
    let (out, _) = room.texts("check scene.toml -t 2", 0);
    assert!(out.contains("picture: 1536 of 1536 pixels compared") && out.contains("pass in "), "{out}");
    let report = json(&room.texts("check scene.toml --json --resolution 20x10", 0).0);
    assert_eq!((&report["pass"], &report["picture"]["pixels"]), (&Value::from(true), &Value::from(200)));
    assert_eq!(report["rays"]["camera"]["replayed"], 200);
    assert!(report["rays"]["reflection"]["different"].is_u64());
}

// compare

#[test]
fn compare_measures_and_holds_its_limits() {
    let room = Room::new();
    room.texts("render scene.toml -q --float -o a.exr", 0);
    room.texts("render scene.toml -q --float -o b.exr --seed 7", 0);
    let (out, err) = room.texts("compare a.exr a.exr --max-rmse 0 --max-diff 0 --min-psnr inf --min-ssim 1", 0);
    assert!(out.contains("RMSE                 0.0") && err.is_empty(), "{out}{err}");
    let found = json(&room.texts("compare a.exr b.exr --json", 0).0);
    let rmse = found["rmse"].as_f64().unwrap();
    assert!(rmse > 1e-6 && found["max"]["channel"].is_string() && found["different_share"].as_f64().unwrap() > 0.0);
    room.texts(&format!("compare a.exr b.exr --max-rmse {}", rmse * 1.001), 0);
    for limit in [&format!("--max-rmse {}", rmse * 0.999), "--max-diff 1e-9", "--min-psnr 200", "--min-ssim 1"] {
        let (out, err) = room.texts(&format!("compare a.exr b.exr {limit}"), 1);
        assert!(out.contains("PSNR") && err.lines().count() == 1, "{limit}: {err}");
    }
}

#[test]
fn compare_draws_where_pictures_differ() {
    let room = Room::new();
    room.texts("render scene.toml -q -o a.exr", 0);
    room.texts("render scene.toml -q -o b.png", 0);
    room.texts("compare a.exr b.png --heatmap h.png", 0);
    assert!(picture(&room.path("h.png")).display.1 > 32);
    room.texts("render scene.toml -q -o small.exr --resolution 24x16", 0);
    let (_, err) = room.texts("compare a.exr small.exr --heatmap h2.png", 3);
    assert!(err.contains("different sizes: 48x32 and 24x16") && !room.path("h2.png").exists(), "{err}");
}

// convert

#[test]
fn a_converted_scene_renders_to_the_same_bits() {
    let room = Room::new();
    for name in ["balls_s2.nff", "teapot_s12.nff.gz"] {
        let from = scene(&format!("nff/{name}"));
        room.texts(&format!("convert {from} b.toml"), 0);
        for (input, output) in [(from.as_str(), "a.exr"), ("b.toml", "b.exr")] {
            room.texts(&format!("render {input} -q --float --spp 1 --resolution 40x40 -o {output}"), 0);
        }
        room.texts("compare a.exr b.exr --max-diff 0", 0);
    }
}

#[test]
fn pictures_are_converted_by_extension() {
    let room = Room::new();
    room.texts("render scene.toml -q --float -o a.exr", 0);
    room.texts("convert a.exr a.png --bits 16", 0);
    room.texts("convert a.png b.exr --float", 0);
    room.texts("convert b.exr b.png --bits 16", 0);
    assert_eq!(picture(&room.path("a.png")).pixels, picture(&room.path("b.png")).pixels);
}

// The rest

#[test]
fn the_version_names_the_build() {
    let (out, _) = Room::new().texts("--version", 0);
    let simd = if cfg!(target_feature = "avx2") { "AVX" } else { "" };
    assert!(out.starts_with(&format!("octray {} (", env!("CARGO_PKG_VERSION"))) && out.contains(simd), "{out}");
    assert!(out.contains(if cfg!(debug_assertions) { "debug build" } else { "release build" }), "{out}");
}

#[test]
fn every_command_has_help_with_examples_a_page_and_completions() {
    let room = Room::new();
    for command in ["render", "info", "check", "compare", "query", "convert", "completions", "man"] {
        let (out, _) = room.texts(&format!("{command} --help"), 0);
        assert!(out.contains("Examples:") && out.contains(&format!("octray {command} ")), "{out}");
    }
    assert!(room.texts("--help", 0).0.contains("Exit codes: 0 done"));
    let (page, _) = room.texts("man", 0);
    assert!(page.contains(".TH octray 1"), "{page}");
    fs::create_dir(room.path("man1")).unwrap();
    room.texts("man man1", 0);
    for name in ["octray.1", "octray-render.1", "octray-query.1"] {
        assert!(fs::read_to_string(room.path("man1").join(name)).unwrap().contains(".SH"), "{name}");
    }
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(room.texts(&format!("completions {shell}"), 0).0.contains("max-depth"), "{shell}");
    }
}

#[test]
fn threads_come_from_slurm_where_nothing_is_said() {
    let room = Room::new();
    let threads = |arguments: &str| {
        let mut command = room.command(&format!("render scene.toml -q -o a.exr --stats a.json {arguments}"));
        command.env("SLURM_CPUS_PER_TASK", "3").assert().success();
        json(&fs::read_to_string(room.path("a.json")).unwrap())["threads"].as_u64().unwrap()
    };
    assert_eq!((threads(""), threads("-t 2")), (3, 2));
}

/// EXR and then PNG is the same picture as PNG at once: the same bytes from floats, codes within one from halves.
#[test]
fn a_png_is_the_same_by_way_of_an_exr() {
    let room = Room::new();
    for (render, options) in [
        ("", ""),
        ("", "--exposure 1.5 --tonemap agx"),
        ("", "--tonemap reinhard --white 4"),
        ("--background transparent", "--bits 16 --tonemap khronos"),
        ("--background transparent --overscan 7", ""),
        ("--background transparent --crop 3,2,40,30", ""),
    ] {
        room.texts(&format!("render scene.toml -q -o direct.png {render} {options}"), 0);
        room.texts(&format!("render scene.toml -q --float -o float.exr {render}"), 0);
        room.texts(&format!("convert float.exr float.png {options}"), 0);
        let [direct, float] = ["direct.png", "float.png"].map(|name| output::read(&room.path(name)).unwrap());
        assert!((direct.window, direct.pixels) == (float.window, float.pixels), "{render} {options}");
        // Also where the EXR leaves transparent edges out, and where a PNG does not say which part of a frame it is.
        room.texts("compare float.exr direct.png", 0);
        room.texts("compare direct.png float.exr", 0);
    }
    room.texts("render scene.toml -q -o half.exr", 0);
    room.texts("render scene.toml -q -o direct.png", 0);
    room.texts("convert half.exr half.png", 0);
    let codes = |name: &str| {
        let pixels = output::read(&room.path(name)).unwrap().pixels;
        pixels.into_iter().flatten().map(output::srgb::to_u8).collect::<Vec<_>>()
    };
    let (direct, half) = (codes("direct.png"), codes("half.png"));
    assert!(direct.iter().zip(&half).all(|(a, b)| a.abs_diff(*b) <= 1));
}

#[test]
fn crops_merge_to_the_bytes_of_the_whole() {
    let room = Room::new();
    for options in ["", "--float --compression zip"] {
        room.texts(&format!("render scene.toml -q --no-date -o whole.exr {options}"), 0);
        // One part with a date: what differs from run to run is left out of the joined file.
        room.texts("render scene.toml -q -o a.exr --crop 0,0,20,32 --float", 0);
        room.texts("render scene.toml -q --no-date -o b.exr --crop 18,0,48,32 --float -t 1", 0);
        if options.is_empty() {
            room.texts("convert a.exr half.exr", 0);
            fs::rename(room.path("half.exr"), room.path("a.exr")).unwrap();
            room.texts("render scene.toml -q --no-date -o b.exr --crop 18,0,48,32", 0);
        }
        room.texts(&format!("merge a.exr b.exr -q -o full.exr {options}"), 0);
        assert!(fs::read(room.path("full.exr")).unwrap() == fs::read(room.path("whole.exr")).unwrap(), "{options}");
    }
    let (_, err) = room.texts("merge a.exr -q -o x.exr", 3);
    assert!(err.contains("the pixel 20,0 is in none of the parts"), "{err}");
    room.texts("render scene.toml -q -o other.exr --crop 20,0,48,32 --seed 7 --float", 0);
    let (_, err) = room.texts("merge a.exr other.exr -q -o x.exr", 3);
    assert!(err.contains("other.exr: its render/sceneHash is"), "{err}");
    room.texts("render scene.toml -q -o quick.exr --crop 20,0,48,32 --float --no-certify", 0);
    let (_, err) = room.texts("merge a.exr quick.exr -q -o x.exr", 3);
    assert!(err.contains("quick.exr: its render/settings is --no-certify, that of a.exr missing"), "{err}");
    assert!(!room.outputs().contains(&"x.exr".to_owned()));
}

#[test]
fn a_merged_picture_keeps_its_primaries_and_missing_names_are_told() {
    let room = Room::new();
    let layers = "--spp 4 --aov variance,cryptomatte --crypto-sidecar --float";
    for (name, part) in [("full", ""), ("a", "--crop 0,0,20,32"), ("b", "--crop 20,0,48,32")] {
        room.texts(&format!("render scene.toml -q --no-date -o {name}.exr --color acescg {layers} {part}"), 0);
    }
    let whole = fs::read(room.path("full.exr")).unwrap();
    room.texts("merge a.exr b.exr -q -o full.exr --float --crypto-sidecar", 0);
    assert!(fs::read(room.path("full.exr")).unwrap() == whole);
    fs::remove_file(room.path("a.crypto_object.json")).unwrap();
    fs::write(room.path("b.crypto_material.json"), "[1").unwrap();
    let (_, err) = room.texts("merge a.exr b.exr -o full.exr", 0);
    for words in [
        "a.exr: the names of crypto_object are missing: its manifest a.crypto_object.json cannot be read",
        "b.exr: the names of crypto_material are missing: its manifest b.crypto_material.json is no list",
    ] {
        assert!(err.contains(words), "{err}");
    }
}

/// A file of nine colours by another program, whose frame begins elsewhere than at 0,0.
fn foreign(path: &Path, data: (i32, i32), display: ((i32, i32), (usize, usize))) {
    use exr::prelude::*;
    let channels = SpecificChannels::rgb(|at: Vec2<usize>| (at.x() as f32, at.y() as f32, 0.5f32));
    let attributes = LayerAttributes::named("beauty").with_position(Vec2(data.0, data.1));
    let layer = Layer::new((9, 5), attributes, Encoding::UNCOMPRESSED, channels);
    let frame = ImageAttributes::new(IntegerBounds::new(display.0, display.1));
    Image::empty(frame).with_layer(layer).write().to_file(path).unwrap();
}

fn windows(path: &Path) -> ([i32; 4], [i32; 4]) {
    let header = exr::meta::MetaData::read_from_file(path, true).unwrap().headers.remove(0);
    let corners = |window: exr::meta::attribute::IntegerBounds| {
        let (at, end) = (window.position, window.end());
        [at.x(), at.y(), end.x(), end.y()]
    };
    (corners(header.shared_attributes.display_window), corners(header.data_window()))
}

/// Windows of other programs' files are written again as they were, and say where pixels lie.
#[test]
fn frames_that_begin_elsewhere_stay_there() {
    let room = Room::new();
    foreign(&room.path("a.exr"), (12, -7), ((10, -5), (30, 20)));
    let kept = windows(&room.path("a.exr"));
    assert_eq!(kept, ([10, -5, 40, 15], [12, -7, 21, -2]));
    for compression in ["none", "zips", "zip", "piz", "dwab"] {
        room.texts(&format!("convert a.exr b.exr --compression {compression}"), 0);
        assert_eq!(windows(&room.path("b.exr")), kept, "{compression}");
        assert_eq!(
            output::read(&room.path("b.exr")).unwrap().window,
            output::read(&room.path("a.exr")).unwrap().window
        );
        room.texts("compare a.exr b.exr --max-diff 0.1", 0);
    }
    room.texts("convert a.exr b.png", 0);
    room.texts("compare a.exr b.png", 0);
    // The same pixels in another frame, and others in one that begins as far from them.
    foreign(&room.path("same.exr"), (12, -7), ((0, 0), (30, 20)));
    foreign(&room.path("moved.exr"), (2, -2), ((0, 0), (30, 20)));
    room.texts("compare a.exr same.exr --max-diff 0", 0);
    let (_, err) = room.texts("compare a.exr moved.exr", 3);
    assert!(err.contains("different parts of the frame"), "{err}");
    foreign(&room.path("whole.exr"), (10, -5), ((10, -5), (9, 5)));
    room.texts("merge whole.exr whole.exr -q -o joined.exr", 0);
    assert_eq!(windows(&room.path("joined.exr")), windows(&room.path("whole.exr")));
    foreign(&room.path("zero.exr"), (0, 0), ((0, 0), (9, 5)));
    let (_, err) = room.texts("merge whole.exr zero.exr -q -o x.exr", 3);
    assert!(err.contains("zero.exr: its frame begins at 0,0, that of whole.exr at 10,-5"), "{err}");
}

#[test]
fn a_header_says_whose_picture_it_is_and_which_part() {
    let room = Room::new();
    room.texts("render scene.toml -q -o a.exr --tiles 2x1 --tile 1 --owner Ada --comments two", 0);
    room.texts("render scene.toml -q -o b.exr --tiles 2x1 --tile 2 --shard 1/1 --owner Ada", 0);
    room.texts("render scene.toml -q -o c.exr --tiles 2x1 --tile 2 --no-date", 0);
    room.texts("merge a.exr b.exr -q -o full.exr --comments whole", 0);
    room.texts("convert full.exr again.exr --owner Grace", 0);
    let said = |name: &str| {
        let header = exr::meta::MetaData::read_from_file(room.path(name), true).unwrap().headers.remove(0);
        let own = header.own_attributes;
        let shard = output::read_all(&room.path(name)).unwrap().attributes.unwrap().text("render/shard");
        (own.owner.map(|text| text.to_string()), own.comments.map(|text| text.to_string()), shard)
    };
    let words = |owner: &str, comments: &str, shard: &str| {
        let given = |text: &str| (!text.is_empty()).then(|| text.to_owned());
        (given(owner), given(comments), given(shard))
    };
    assert_eq!(said("a.exr"), words("Ada", "two", "tile 1 of 2x1"));
    assert_eq!(said("b.exr"), words("Ada", "", "1/1, tile 2 of 2x1"));
    assert_eq!(said("c.exr"), words("", "", ""));
    assert_eq!(said("full.exr"), words("Ada", "whole", ""));
    assert_eq!(said("again.exr"), words("Grace", "whole", ""));
}

/// A header that can be read, but says what none can say again: that is no fault of the output.
#[test]
fn a_damaged_header_is_a_bad_input() {
    let room = Room::new();
    room.texts("render scene.toml -q -o a.exr --no-date", 0);
    let mut bytes = fs::read(room.path("a.exr")).unwrap();
    let name = b"framesPerSecond\0";
    let at = bytes.windows(name.len()).position(|part| part == name).unwrap();
    bytes[at + name.len() - 2] = 0;
    room.write("a.exr", bytes);
    for command in ["convert a.exr b.exr", "merge a.exr -o b.exr"] {
        let (_, err) = room.texts(command, 3);
        assert!(err.contains("a.exr: cannot be written as b.exr: "), "{err}");
    }
    room.texts("convert a.exr a.png", 0);
}

#[test]
fn layers_that_a_png_cannot_hold_are_told() {
    let room = Room::new();
    let (_, err) = room.texts("render scene.toml -o a.png --aov depth", 0);
    assert!(err.contains("a.png: a PNG holds the colours alone"), "{err}");
    let (_, err) = room.texts("render scene.toml -o a.exr --aov depth", 0);
    assert!(!err.contains("PNG"), "{err}");
}

#[test]
fn exr_options_are_for_exr_and_colour_is_of_two_kinds() {
    let room = Room::new();
    room.texts("render scene.toml -q -o a.exr --float --color acescg --color never --compression piz", 0);
    room.texts("render scene.toml -q -o b.exr --float", 0);
    room.texts("compare a.exr b.exr --max-diff 1e-5", 0);
    let (_, err) = room.texts("compare a.exr b.exr --color acescg", 2);
    assert!(err.contains("about EXR files"), "{err}");
    for option in
        ["--compression zip", "--multipart", "--depth-name Z", "--crypto-sidecar", "--owner me", "--color acescg"]
    {
        let (_, err) = room.texts(&format!("render scene.toml -o a.png {option}"), 2);
        assert!(err.contains("is for EXR"), "{err}");
    }
}
