//! Pictures that are confirmed, and the commands that make errors visible, as a user meets them.

mod command;

use std::path::Path;
use std::process::Command;

use command::clay;
use serde_json::Value;

/// Runs octray in a folder: its exit code, and what it says.
fn octray(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_octray")).args(args).current_dir(folder).output().expect("octray");
    let text = String::from_utf8_lossy(&output.stdout).to_string() + &String::from_utf8_lossy(&output.stderr);
    (output.status.code().unwrap_or(-1), text)
}

/// What stands on standard output; warnings come after it.
fn json_of(text: &str) -> Option<Value> {
    serde_json::Deserializer::from_str(text).into_iter().next()?.ok()
}

/// A folder with copies of scenes.
fn folder(scenes: &[&str]) -> tempfile::TempDir {
    let room = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(room.path().join("textures")).expect("a folder");
    for name in scenes.iter().chain(&["textures/uv.png"]) {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        let name = name.strip_prefix("particles/").unwrap_or(name);
        std::fs::copy(from, room.path().join(name)).expect("a copy");
    }
    room
}

/// Renders with these words, and confirms it with nothing but the file.
fn confirm(folder: &Path, words: &str) {
    let words: Vec<&str> = words.split(' ').collect();
    let (code, text) = octray(folder, &[&["render"], &words[..], &["-o", "a.exr", "-q"]].concat());
    assert_eq!(code, 0, "{words:?} {text}");
    let (code, text) = octray(folder, &["verify", "a.exr", "-t", "1"]);
    assert!(code == 0 && text.contains("a.exr: confirmed: rendering"), "{words:?} {code} {text}");
}

#[test]
fn pictures_of_all_settings_are_confirmed_by_their_headers_alone() {
    let room = folder(&["fig5.toml", "mixed.toml", "thin_lens.toml", "particles/aspirin.sdf"]);
    let all = [
        "fig5.toml --resolution 64x48",
        "fig5.toml --resolution 64x48 --spp 3 --seed 18446744073709551615 --float",
        "fig5.toml --resolution 64x48 --crop 11,7,50,41 --compression none",
        "fig5.toml --resolution 64x48 --overscan 10% --depth-name Z --aov depth,normal",
        "mixed.toml --resolution 48x48 --spp 2 --aov all --cost --multipart --crypto-ranks 4 --instances each",
        "mixed.toml --resolution 48x32 --integrator path --max-depth 3 --spp 2 --compression dwaa",
        "mixed.toml --resolution 48x32 --background transparent --color acescg --engine reference --spp 1",
        "thin_lens.toml --resolution 64x48 --noise 0.2 --aov samples,variance --no-certify",
        "aspirin.sdf --resolution 64x48 --spp 1 --style licorice --radius 0.5 --tiles 2x2 --tile 3",
    ];
    all.iter().for_each(|words| confirm(room.path(), words));
    // The parts of a picture give the header of the whole.
    for (name, crop) in [("l.exr", "0,0,30,48"), ("r.exr", "30,0,64,48")] {
        let args = ["render", "fig5.toml", "-o", name, "--resolution", "64x48", "--spp", "2", "--crop", crop, "-q"];
        assert_eq!(octray(room.path(), &args).0, 0);
    }
    assert_eq!(octray(room.path(), &["merge", "l.exr", "r.exr", "-o", "m.exr"]).0, 0);
    assert_eq!(octray(room.path(), &["verify", "m.exr"]).0, 0);
}

#[test]
fn frames_and_cameras_are_confirmed() {
    let room = tempfile::tempdir().expect("a folder");
    let camera = |name: &str, eye: &str| {
        format!("[[cameras]]\nname = \"{name}\"\ntype = \"pinhole\"\neye = {eye}\ntarget = [0, 0, 0]\nvfov = 45\n")
    };
    let cameras = camera("front side", "[0, 0, 8]") + &camera("top", "[0, 8, 1]");
    let turning = "{ keys = [[1, [-1, 0, 0]], [3, [1, 0, 0]]] }";
    let scene = clay("width = 32, height = 24, spp = 2", &cameras, ("[5, 6, 8]", 350.0), &[turning]);
    std::fs::write(room.path().join("turn.toml"), scene).expect("a file");
    let args =
        ["render", "turn.toml", "--out-dir", "out", "--frames", "1-3", "--camera", "all", "--aov", "motion", "-q"];
    let (code, text) = octray(room.path(), &args);
    assert_eq!(code, 0, "{text}");
    let files: Vec<_> = std::fs::read_dir(room.path().join("out")).expect("a folder").flatten().collect();
    let mut seen = 0;
    for file in files.iter().filter(|file| file.path().extension().is_some_and(|ending| ending == "exr")) {
        let (code, text) = octray(room.path(), &["verify", file.path().to_str().expect("a name"), "-q"]);
        assert!(code == 0 && text.contains("confirmed"), "{code} {text}");
        seen += 1;
    }
    assert_eq!(seen, 6);
}

#[test]
fn what_is_not_as_it_was_is_not_confirmed() {
    let room = folder(&["fig5.toml", "mixed.toml"]);
    let at = room.path();
    let render = ["render", "fig5.toml", "-o", "a.exr", "--resolution", "64x48", "--compression", "none", "-q"];
    assert_eq!(octray(at, &render).0, 0);
    let json = |args: &[&str]| {
        let (code, text) = octray(at, args);
        (code, json_of(&text).unwrap_or_else(|| panic!("{code} {text}")))
    };
    let (code, value) = json(&["verify", "a.exr", "--json"]);
    assert!(code == 0 && value["pass"] == true && value["different_pixels"] == 0, "{value}");
    assert!(value["stored"] == value["rendered"] && value["stored"].as_str().expect("a hash").len() == 64, "{value}");

    // One bit of one sample: the file contradicts itself.
    let mut bytes = std::fs::read(at.join("a.exr")).expect("a file");
    let last = bytes.len() - 40;
    bytes[last] ^= 1;
    std::fs::write(at.join("b.exr"), &bytes).expect("a file");
    let (code, value) = json(&["verify", "b.exr", "--file-only", "--json"]);
    assert!(code == 1 && value["pass"] == false && value["stored"] != value["found"], "{value}");
    assert_eq!(octray(at, &["verify", "a.exr", "--file-only"]).0, 0);

    // Samples and hash that fit each other, and not the scene: another render with this one's header.
    let brighter = octray::output::read_all(&at.join("a.exr")).expect("a picture");
    let mut picture = brighter.picture.clone();
    picture.pixels[100][0] += 1.0;
    let exr = octray::output::Storage { compression: octray::output::Compression::None, ..Default::default() };
    let options = octray::output::Options { exr, ..Default::default() };
    let description = octray::output::Description { kept: brighter.attributes, ..Default::default() };
    octray::output::write(&at.join("c.exr"), &picture, options, &description).expect("a file");
    let (code, value) = json(&["verify", "c.exr", "--json"]);
    assert!(code == 1 && value["stored"] == value["found"] && value["different_pixels"] == 1, "{value}");

    // Another scene, and the same one changed.
    assert_eq!(octray(at, &["verify", "a.exr", "mixed.toml"]).0, 1);
    let changed = std::fs::read_to_string(at.join("fig5.toml")).expect("a scene") + "\n[render]\nmax_depth = 3\n";
    std::fs::write(at.join("fig5.toml"), changed).expect("a file");
    let (code, text) = octray(at, &["verify", "a.exr"]);
    assert!(code == 1 && text.contains("have the hash") && text.contains("the scene has changed"), "{code} {text}");

    std::fs::remove_file(at.join("fig5.toml")).expect("it was there");
    let (code, text) = octray(at, &["verify", "a.exr"]);
    assert!(code == 3 && text.contains("its scene fig5.toml is neither beside it"), "{code} {text}");
    assert_eq!(octray(at, &["render", "mixed.toml", "-o", "d.png", "--resolution", "16x16", "-q"]).0, 0);
    let (code, text) = octray(at, &["verify", "d.png"]);
    assert!(code == 3 && text.contains("states no hash of its samples"), "{code} {text}");
}

/// The sums of explain are those of the picture, and its words those of the engine and the reference.
#[test]
fn a_pixel_is_explained() {
    let room = folder(&["mixed.toml"]);
    let at = room.path();
    let (code, text) = octray(at, &["explain", "mixed.toml", "160", "150"]);
    for word in ["camera ray", "met primitive", "f64: primitive", "margin", "light 0", "reference, f64"] {
        assert!(code == 0 && text.contains(word), "{word}: {code} {text}");
    }
    let args = ["render", "mixed.toml", "-o", "a.exr", "--resolution", "64x48", "--spp", "1", "--float", "-q"];
    assert_eq!(octray(at, &args).0, 0);
    let picture = octray::output::read(&at.join("a.exr")).expect("a picture");
    let (mut tried, mut kinds) = (0, std::collections::BTreeSet::new());
    for (x, y) in [(3, 2), (20, 30), (32, 30), (40, 36), (50, 20), (12, 40), (32, 24)] {
        let (x, y) = (x.to_string(), y.to_string());
        let spp1 = ["explain", "one.toml", &x, &y, "--resolution", "64x48", "--json"];
        let scene = std::fs::read_to_string(at.join("mixed.toml")).expect("a scene");
        std::fs::write(at.join("one.toml"), scene.replace("height = 240", "height = 240\nspp = 1")).expect("a file");
        let (code, text) = octray(at, &spp1);
        let json: Value = json_of(&text).unwrap_or_else(|| panic!("{code} {text}"));
        let rays = json["rays"].as_array().expect("rays");
        assert!(code == 0 && rays[0]["path"] == 1 && rays.iter().all(|ray| ray["verdict"] == "same"), "{text}");
        let near = |ray: &Value| ray["ulps"].as_f64().is_none_or(|ulps| ulps.abs() <= 1.0);
        assert!(rays.iter().all(near) && rays[0]["kernel_t"].is_number() == rays[0]["t"].is_number(), "{text}");
        kinds.extend(rays.iter().map(|ray| ray["kind"].to_string()));
        // The box filter of one sample is that sample: what is shared out is the pixel.
        let shares = json["shares"].as_array().expect("shares");
        let at = y.parse::<usize>().expect("a row") * 64 + x.parse::<usize>().expect("a column");
        for k in 0..3 {
            let sum: f64 = shares.iter().map(|share| share["radiance"][k].as_f64().expect("a number")).sum();
            let want = f64::from(picture.pixels[at][k]);
            assert!((sum - want).abs() <= 1e-4 * want.max(0.01), "{x} {y}: {sum} {want} {text}");
        }
        tried += 1;
    }
    assert!(tried == 7 && kinds.len() >= 2, "{kinds:?}");
    let (code, text) = octray(at, &["explain", "mixed.toml", "99999", "0"]);
    assert!(code == 2 && text.contains("99999"), "{code} {text}");
    assert_eq!(octray(at, &["explain", "mixed.toml", "0", "0", "--sample", "4096"]).0, 2);
}

/// Layers hold what the report says, and what f32 alone gets wrong shows in both and in the heat map.
#[test]
fn check_writes_layers_and_a_heat_map_that_show_what_is_wrong() {
    let room = folder(&["fig5.toml"]);
    let at = room.path();
    // Two spheres one behind the other by less than f32 tells from so far away, the farther one first.
    let camera = "[camera]\ntype = \"pinhole\"\neye = [0, 0, 100000]\ntarget = [0, 0, 0]\nvfov = 0.002\n";
    let spheres = ["[0.3, 0.2, 0.099]", "[0.3, 0.2, 0.1]"];
    let far = clay("width = 64, height = 48, spp = 1", camera, ("[5, 6, 99999]", 1e10), &spheres);
    std::fs::write(at.join("far.toml"), far).expect("a file");
    let layers = |scene: &str, more: &[&str]| {
        let args = ["check", scene, "--resolution", "64x48", "--layers", "d.exr", "--heatmap", "d.png", "--json"];
        let (code, text) = octray(at, &[&args, more].concat());
        let json: Value = json_of(&text).unwrap_or_else(|| panic!("{code} {text}"));
        let picture = octray::output::read(&at.join("d.exr")).expect("an EXR");
        let channel = |name: &str| {
            let found = picture.channels.iter().find(|channel| channel.name == name);
            let samples = found.unwrap_or_else(|| panic!("no {name}")).samples.clone();
            samples.floats().expect("floats").to_vec()
        };
        for name in ["depth.Z", "depth.ulps", "normal.degrees", "wrong.Y", "engine.R", "reference.R"] {
            assert_eq!(channel(name).len(), 64 * 48, "{name}");
        }
        let wrong = channel("wrong.Y").iter().filter(|wrong| **wrong > 0.0).count() as u64;
        assert_eq!(json["layers"]["wrong_object"].as_u64(), Some(wrong), "{text}");
        let ulps = channel("depth.ulps").iter().fold(0.0f32, |most, ulps| most.max(ulps.abs()));
        (code, json, wrong, ulps, std::fs::read(at.join("d.png")).expect("a heat map"))
    };
    let (code, json, wrong, ulps, calm) = layers("fig5.toml", &[]);
    assert!(code == 0 && wrong == 0 && ulps <= 256.0, "{json}");
    assert!(json["layers"]["depth_ulps"]["count"].as_u64().expect("a count") > 500, "{json}");
    let (code, json, wrong, _, _) = layers("far.toml", &[]);
    assert!(code == 0 && wrong == 0, "{json}");
    let (code, json, wrong, _, wild) = layers("far.toml", &["--no-certify"]);
    assert!(code == 1 && wrong > 50 && wild != calm, "{json}");
    assert_eq!(octray(at, &["check", "fig5.toml", "--layers", "d.png"]).0, 2);
    assert_eq!(octray(at, &["check", "fig5.toml", "--heatmap", "d.exr"]).0, 2);
}
