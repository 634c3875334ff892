//! `octray bench` and `octray bench gate`. No test here looks at how long anything took: the judgement of times is tested
//! on simulated clocks, in `measure::gate`.

mod command;

use command::{Room, binary};
use serde_json::Value;

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn bench_prints_every_kind_of_ray() {
    let room = Room::new();
    let (out, err) = room.texts("bench scene.toml -t 1", 0);
    for row in ["camera closest", "camera any", "camera closest own", "shadow any own", "bounce closest", "bounce any"]
    {
        assert!(out.lines().any(|line| line.starts_with(row)), "{row}\n{out}");
    }
    assert!(out.contains("Mrays/CPU s") && err.is_empty(), "{err}");
    let (out, _) = room.texts("bench scene.toml --rays bounce -t 2 --json", 0);
    let found = json(&out);
    assert_eq!((&found["schema"], &found["threads"]), (&Value::from(1), &Value::from(2)));
    let rays = found["rays"].as_array().unwrap();
    assert_eq!(rays.len(), 2);
    for (figure, query) in rays.iter().zip(["closest", "any"]) {
        assert_eq!((&figure["kind"], &figure["query"]), (&Value::from("bounce"), &Value::from(query)));
        assert!(figure["mrays_per_s"].as_f64().unwrap() > 0.0 && figure["spread"].is_f64(), "{figure}");
        assert!(figure["tests"]["sphere"].as_u64().unwrap() > 0 && figure["threads"] == 2, "{figure}");
    }
    assert!(rays[0]["hits"] == rays[1]["hits"] && rays[0]["rays"].as_u64().unwrap() < 48 * 32);
}

#[test]
fn bench_says_what_it_cannot_measure() {
    let room = Room::new();
    let dark: String = command::SCENE.replace(
        "type = \"point\"\nposition = [3, 5, 4]\nintensity",
        "type = \"directional\"\ndirection = [0, -1, 0]\nirradiance",
    );
    room.write("dark.toml", dark);
    let (out, err) = room.texts("bench dark.toml", 0);
    assert!(err.contains("no shadow rays") && !out.contains("shadow"), "{err}{out}");
    let (_, err) = room.texts("bench dark.toml --rays shadow", 3);
    assert!(err.contains("no light at a place"), "{err}");
    room.texts("bench", 2);
    room.texts("bench scene.toml --repeat 4", 2);
    room.texts("bench none.toml", 3);
}

#[test]
fn the_gate_passes_what_is_as_it_was_and_names_what_is_not() {
    let room = Room::new();
    room.texts("bench gate scene.toml --baseline b.json --write-baseline", 0);
    let (out, _) = room.texts("bench gate --baseline b.json", 0);
    assert!(out.starts_with("ok   scene.toml") && out.contains("work and error are those of the baseline"), "{out}");

    let text = std::fs::read_to_string(room.path("b.json")).unwrap();
    let mut other = json(&text);
    let of = &mut other["scenes"]["scene.toml"];
    let boxes = of["work"]["tests.sphere"].as_f64().unwrap();
    of["work"]["tests.sphere"] = Value::from(boxes + 8.0);
    room.write("work.json", other.to_string());
    let (out, _) = room.texts("bench gate scene.toml --baseline work.json", 1);
    assert!(
        out.starts_with("FAIL") && out.contains("work: tests.sphere changed from") && !out.contains("rays.camera"),
        "{out}"
    );

    let mut other = json(&text);
    other["scenes"]["scene.toml"]["error"]["picture.rel_rmse"] = Value::from(0.0);
    room.write("error.json", other.to_string());
    let (out, _) = room.texts("bench gate --baseline error.json --json", 1);
    let found = json(&out);
    let guilty = found["scenes"][0]["guilty"].as_array().unwrap();
    assert!(
        guilty.len() == 1 && guilty[0].as_str().unwrap().starts_with("error: picture.rel_rmse grew from 0e0"),
        "{out}"
    );
    assert_eq!(found["pass"], false);

    let (out, _) = room.texts("bench gate scene.toml --baseline b.json --spp 2", 1);
    assert!(out.contains("the baseline has it with"), "{out}");
}

#[test]
fn the_gate_says_what_is_wrong_with_its_input() {
    let room = Room::new();
    room.texts("bench gate scene.toml", 2);
    room.texts("bench gate --baseline b.json --write-baseline", 2);
    room.write("b.json", "{}");
    assert!(room.texts("bench gate --baseline b.json", 3).1.contains("--write-baseline"));
    room.write("b.json", r#"{"schema": 1, "simd": "abacus", "scenes": {}}"#);
    assert!(room.texts("bench gate --baseline b.json", 3).1.contains("abacus"));
    assert!(room.texts("bench gate scene.toml --against ./none", 2).1.contains("cannot be run"));
    assert!(room.texts("bench gate none.toml --against ./none", 3).1.contains("none.toml"));
}

/// A build that does more work, or draws another picture, than it should: a script around the real one.
#[cfg(unix)]
#[test]
fn another_build_is_judged_by_what_it_does() {
    use std::os::unix::fs::PermissionsExt;
    let room = Room::new();
    let wrapper = |name: &str, after: &str| {
        let text = format!("#!/bin/sh\n\"{}\" \"$@\" > out.txt || exit $?\n{after}\n", binary().display());
        room.write(name, text);
        std::fs::set_permissions(room.path(name), PermissionsExt::from_mode(0o755)).unwrap();
    };
    wrapper("same", "cat out.txt");
    let (out, _) = room.texts("bench gate scene.toml --against ./same --no-time", 0);
    assert!(out.contains("the picture is the same to the bit"), "{out}");
    // `--stats` has its file behind it; the counts of boxes there begin with a 9 now.
    let busy =
        "cat out.txt; while [ $# -gt 0 ]; do [ \"$1\" = --stats ] && sed -i 's/\"sphere\": /&9/' \"$2\"; shift; done";
    wrapper("busy", busy);
    let (out, _) = room.texts("bench gate scene.toml --against ./same --binary ./busy --no-time", 1);
    assert!(out.contains("work: tests.sphere changed from") && out.contains("against ./same"), "{out}");
    wrapper("wrong", "sed 's/\"different\": 0/\"different\": 3/' out.txt");
    let (out, _) = room.texts("bench gate scene.toml --against ./same --binary ./wrong --no-time", 1);
    assert!(out.contains("error: rays.camera.different grew from 0e0 to 3e0"), "{out}");
    let (out, _) = room.texts("bench gate scene.toml --against ./wrong --no-time", 0);
    assert!(out.starts_with("ok"), "{out}");
}
