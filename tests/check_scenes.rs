//! Every scene of the project, the packet engine against the reference.

use std::path::{Path, PathBuf};

use octray::Scene;
use octray::measure::check::{CheckSettings, check};
use octray::scene::nff;

/// Wall time for the reference, by scene.
const SECONDS: f64 = 1.5;

fn scenes(folder: &str, endings: &[&str]) -> Vec<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(folder);
    let entries = std::fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().to_string();
    let mut paths: Vec<PathBuf> = entries.filter(|path| endings.iter().any(|end| name(path).ends_with(end))).collect();
    paths.sort();
    paths
}

/// Checks a scene and says what failed; `least`: rays that must have been replayed.
fn failure(path: &Path, scene: &Scene, least: u64) -> Option<String> {
    let settings = CheckSettings { seconds: SECONDS, ..CheckSettings::default() };
    let report = check(scene, &settings).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let replayed: u64 = report.rays.by_kind().iter().map(|(_, rays)| rays.replayed).sum();
    let enough = replayed >= least && report.picture.pixels >= 16;
    (!report.pass || !enough).then(|| format!("{}: {replayed} rays\n{report}", path.display()))
}

#[test]
fn the_engine_agrees_with_the_reference_on_every_toml_scene() {
    let paths = scenes("scenes", &[".toml"]);
    assert!(paths.len() >= 10, "{paths:?}");
    let load = |path: &PathBuf| Scene::load(path).unwrap_or_else(|errors| panic!("{errors}"));
    let failures: Vec<String> = paths.iter().filter_map(|path| failure(path, &load(path), 1000)).collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn the_engine_agrees_with_the_reference_on_every_nff_scene() {
    let paths = scenes("scenes/nff", &[".nff", ".nff.gz"]);
    assert!(paths.len() >= 20, "{paths:?}");
    let load = |path: &PathBuf| nff::load(path).unwrap_or_else(|errors| panic!("{errors}"));
    // The largest have hundreds of thousands of primitives: the reference asks all of them for each ray.
    let failures: Vec<String> = paths.iter().filter_map(|path| failure(path, &load(path), 16)).collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
