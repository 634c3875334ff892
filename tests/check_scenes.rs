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

/// What f32 is bad at: spheres far larger than what stands on them, and the insides of tips.
#[test]
fn the_engine_agrees_with_the_reference_where_f32_is_bad() {
    let view = "[image]\nwidth = 96\nheight = 72\n[background]\ncolor = [0.4, 0.5, 0.6]\n\
        [materials.clay]\ntype = \"diffuse\"\n[materials.mirror]\ntype = \"mirror\"\n";
    let ground = |radius: f64| {
        format!(
            "{view}[camera]\ntype = \"pinhole\"\neye = [0, 1, 4]\ntarget = [0, 0.6, 0]\nvfov = 50\n\
            [[lights]]\ntype = \"point\"\nposition = [3, 5, 2]\nintensity = [90, 90, 90]\n\
            [[shapes]]\ntype = \"sphere\"\ncenter = [0, -{radius}, 0]\nradius = {radius}\nmaterial = \"clay\"\n\
            [[shapes]]\ntype = \"sphere\"\ncenter = [0, 0.7, 0]\nradius = 0.7\nmaterial = \"clay\"\n"
        )
    };
    let tip = |apex_radius: f64| {
        format!(
            "{view}[render]\nmax_depth = 12\n[camera]\ntype = \"pinhole\"\neye = [0, 0.5, 0]\ntarget = [0, 0.7, -0.1]\n\
            vfov = 100\n[[lights]]\ntype = \"point\"\nposition = [0.1, 0, 0]\nintensity = [3, 3, 3]\n\
            [[shapes]]\ntype = \"cone\"\nbase = [0, -1, 0]\napex = [0, 1, 0]\nradius = 1\n\
            apex_radius = {apex_radius}\nmaterial = \"mirror\"\n"
        )
    };
    // From a million radii, through a lens as long and by parallel rays: coordinates are those of what is seen.
    let far = |camera: &str| {
        format!(
            "{view}[camera]\neye = [30, 40, 1e6]\ntarget = [0, 0, 0]\n{camera}\n\
            [[lights]]\ntype = \"directional\"\ndirection = [-1, -1, -2]\nirradiance = [3, 3, 3]\n\
            [[lights]]\ntype = \"point\"\nposition = [-3, 3, 3]\nintensity = [12, 6, 3]\n\
            [[shapes]]\ntype = \"sphere\"\ncenter = [0.1, 0.05, 0]\nradius = 1\nmaterial = \"clay\"\n\
            [[shapes]]\ntype = \"sphere\"\ncenter = [1.3, 0.6, 0.2]\nradius = 0.5\nmaterial = \"mirror\"\n\
            [[shapes]]\ntype = \"box\"\nmin = [-2, -1.2, -1]\nmax = [2, -1, 1]\nmaterial = \"clay\"\n\
            [[shapes]]\ntype = \"cone\"\nbase = [-1.4, -1, 0.5]\napex = [-1.4, 0.2, 0.5]\nradius = 0.3\nmaterial = \"clay\"\n"
        )
    };
    let far = ["type = \"pinhole\"\nvfov = 0.0002", "type = \"orthographic\"\nheight = 3.2"].map(far);
    // Specks: what f32 rounds a center by is as much as shows in a normal.
    let specks = (0..300).map(|i| {
        let (x, y) = (0.026 * f64::from(i % 20) - 0.25, 0.026 * f64::from(i / 20) - 0.18);
        format!(
            "[[shapes]]\ntype = \"sphere\"\ncenter = [{x}, {y}, {}]\nradius = 0.012\nmaterial = \"clay\"\n",
            0.01 * x
        )
    });
    let dust = format!(
        "{view}[camera]\ntype = \"pinhole\"\neye = [7, 11, 29]\ntarget = [0, 0, 0]\nvfov = 0.8\n\
        [[lights]]\ntype = \"point\"\nposition = [30, 5, 20]\nintensity = [4000, 4000, 4000]\n{}",
        specks.collect::<String>()
    );
    // All round, with a row of pixels that looks along the floor.
    let around = format!(
        "{}[camera]\ntype = \"panoramic\"\neye = [0, 1.2, 0]\ntarget = [0, 1.2, -1]\n\
        [[lights]]\ntype = \"point\"\nposition = [3, 5, 2]\nintensity = [90, 90, 90]\n\
        [[shapes]]\ntype = \"plane\"\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"clay\"\n",
        view.replace("height = 72", "height = 83")
    );
    let cases = [1e3, 1e5, 1e7].map(ground).into_iter().chain([0.0, 1e-4].map(tip)).chain(far).chain([dust, around]);
    let check = |(index, text): (usize, String)| {
        let scene = Scene::from_toml(&text, Path::new(".")).unwrap_or_else(|errors| panic!("{errors}"));
        failure(Path::new(&format!("case {index}")), &scene, 5000)
    };
    let failures: Vec<String> = cases.enumerate().filter_map(check).collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
