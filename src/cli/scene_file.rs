//! Scenes for the commands: read, with everything that is wrong shown.

use std::path::Path;
use std::time::Instant;

use clap::Args;
use octray::Scene;
use octray::batch::memory;
use octray::scene::particles::Format;
use octray::scene::{Filter, Frames, ImageSettings, SceneErrors};

use super::Run;
use super::atoms::Atoms;
use super::exit::{Exit, Failure};
use super::system;

/// Samples per pixel of a scene without an image, as in scene files.
const SPP: u32 = 16;

/// A scene and how long it took to read.
pub struct Loaded {
    pub scene: Scene,
    pub seconds: f64,
}

/// Which moment of a scene is meant, and what atoms without a scene look like.
#[derive(Debug, Clone, Args)]
pub struct Moment {
    /// Frame of an animation or trajectory, from 1
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    frame: i64,
    #[command(flatten)]
    atoms: Atoms,
}

impl Moment {
    /// Reads the scene at this moment and shows its warnings; its picture has the size of `resolution`, if that is
    /// given.
    pub fn load(&self, path: &Path, resolution: Option<(u32, u32)>, run: &Run) -> Result<Loaded, Failure> {
        load(&mut frames(path, &self.atoms, resolution)?, path, self.frame, run)
    }
}

/// The frames of a scene file.
pub fn frames(path: &Path, atoms: &Atoms, resolution: Option<(u32, u32)>) -> Result<Frames, Failure> {
    check_look(path, atoms)?;
    Ok(Frames::new(path).look(atoms.look()).resolution(resolution))
}

/// Makes sure that what atoms look like is said of a file of atoms.
pub fn check_look(path: &Path, atoms: &Atoms) -> Result<(), Failure> {
    if atoms.is_given() && Format::of(path).is_none() {
        let text =
            "--style, --radius, --color-by, --bonds and --replicate are for files of atoms; a scene says it itself";
        return Err(Failure::new(Exit::Usage, text).of(path));
    }
    Ok(())
}

/// Reads a frame and shows its warnings.
pub fn load(frames: &mut Frames, path: &Path, frame: i64, run: &Run) -> Result<Loaded, Failure> {
    let start = Instant::now();
    let scene = frames.scene(frame).map_err(|errors| failure(path, &errors, run.console.color))?;
    for warning in &scene.warnings {
        run.console.note(&format!("octray: {warning}"));
    }
    Ok(Loaded { scene, seconds: start.elapsed().as_secs_f64() })
}

/// Makes sure that a tree can be built, and so many bytes more taken.
pub fn need_memory(scene: &Scene, more: u64, work: &str) -> Result<(), Failure> {
    system::need_memory(memory::to_build(scene).saturating_add(more), work)
}

/// Gives the picture another size, or a scene without a picture its first.
pub fn resize(scene: &mut Scene, resolution: Option<(u32, u32)>) {
    let Some((width, height)) = resolution else { return };
    let image = scene.image.take().unwrap_or(ImageSettings { width, height, spp: SPP, filter: Filter::default() });
    scene.image = Some(ImageSettings { width, height, ..image });
}

/// All errors with the lines they are in; where a file as a whole is wrong, one line.
pub fn failure(path: &Path, errors: &SceneErrors, color: bool) -> Failure {
    let lone = errors.iter().next().filter(|error| errors.len() == 1 && error.span.is_none());
    if let Some(error) = lone {
        return Failure::new(Exit::Input, error);
    }
    let count = match errors.len() {
        1 => "1 mistake".to_owned(),
        more => format!("{more} mistakes"),
    };
    let report = errors.report(color);
    Failure::new(Exit::Input, format!("{}: {count} in the scene\n{}", path.display(), report.trim_end()))
}
