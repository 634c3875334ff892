//! Scenes for the commands: read, with everything that is wrong shown.

use std::path::Path;
use std::time::Instant;

use octray::Scene;
use octray::scene::{Filter, ImageSettings, SceneErrors};

use super::Run;
use super::exit::{Exit, Failure};
use super::system;

/// Memory that a build takes for each primitive on top of the scene, in bytes: parts, boxes, tree and columns
/// together at their most (measured on a million spheres and on a million triangles, rounded up).
const BUILD_BYTES: u64 = 800;
/// Samples per pixel of a scene without an image, as in scene files.
const SPP: u32 = 16;

/// A scene and how long it took to read.
pub struct Loaded {
    pub scene: Scene,
    pub seconds: f64,
}

/// Reads a scene and shows its warnings.
pub fn load(path: &Path, run: &Run) -> Result<Loaded, Failure> {
    let start = Instant::now();
    let scene = Scene::load(path).map_err(|errors| failure(path, &errors, run.console.color))?;
    for warning in &scene.warnings {
        run.console.note(&format!("octray: {warning}"));
    }
    Ok(Loaded { scene, seconds: start.elapsed().as_secs_f64() })
}

/// Makes sure that a tree can be built.
pub fn need_memory(scene: &Scene, more: u64, work: &str) -> Result<(), Failure> {
    let build = BUILD_BYTES.saturating_mul(scene.primitive_count() as u64);
    system::need_memory(build.saturating_add(more), work)
}

/// Gives the picture another size, or a scene without a picture its first.
pub fn resize(scene: &mut Scene, resolution: Option<(u32, u32)>) {
    let Some((width, height)) = resolution else { return };
    let image = scene.image.take().unwrap_or(ImageSettings { width, height, spp: SPP, filter: Filter::default() });
    scene.image = Some(ImageSettings { width, height, ..image });
}

/// All errors with the lines they are in.
fn failure(path: &Path, errors: &SceneErrors, color: bool) -> Failure {
    let count = match errors.len() {
        1 => "1 mistake".to_owned(),
        more => format!("{more} mistakes"),
    };
    let report = errors.report(color);
    Failure::new(Exit::Input, format!("{}: {count} in the scene\n{}", path.display(), report.trim_end()))
}
