//! `octray convert`: scenes to scenes, pictures to pictures, by extension.

use std::path::{Path, PathBuf};

use octray::output::{self, Description, Format};
use octray::scene::{particles, write};

use super::Run;
use super::exit::{Exit, Failure};
use super::pictures::{self, Depth, Target};
use super::scene_file::Moment;

const EXAMPLES: &str = "\
Examples:
  octray convert balls.nff.gz balls.toml           a scene that renders to the same bits
  octray convert protein.pdb protein.toml          a scene to go on with
  octray convert fig5.exr fig5.png --bits 16       a picture to look at
  octray convert fig5.png fig5.exr";

/// Arguments of `octray convert`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Scene (.toml, .nff, .nff.gz), atoms (.xyz, .lammpstrj, .data, .pdb, .sdf, ... or with .gz) or picture (.exr, .png)
    input: PathBuf,
    /// Scene (.toml; its clouds go to .npy files beside it) or picture (.exr, .png)
    output: PathBuf,
    #[command(flatten)]
    depth: Depth,
    #[command(flatten)]
    moment: Moment,
}

/// What a file is by its name.
#[derive(Debug, PartialEq, Eq)]
enum Kind {
    Toml,
    Nff,
    Atoms,
    Picture,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    let (input, output) = (&args.input, &args.output);
    let usage = |path: &Path, text: &str| Failure::new(Exit::Usage, text).of(path);
    match (kind(input), kind(output)) {
        (None, _) => Err(usage(
            input,
            "unknown kind of file: should end in .toml, .nff, .nff.gz, .exr or .png, or as atoms do: .xyz, .lammpstrj, .data, .pdb, .sdf, ...",
        )),
        (Some(Kind::Picture), Some(Kind::Picture)) => convert_picture(args, run),
        (Some(Kind::Toml | Kind::Nff | Kind::Atoms), Some(Kind::Toml)) => convert_scene(args, run),
        (Some(Kind::Picture), _) => Err(usage(output, "a picture becomes a picture: should end in .exr or .png")),
        (_, Some(Kind::Picture)) => {
            Err(usage(output, "a scene becomes a scene (.toml); octray render makes a picture"))
        }
        _ => Err(usage(output, "a scene becomes a scene: should end in .toml")),
    }
}

fn kind(path: &Path) -> Option<Kind> {
    let name = path.file_name()?.to_string_lossy().to_lowercase();
    if name.ends_with(".toml") {
        Some(Kind::Toml)
    } else if name.ends_with(".nff") || name.ends_with(".nff.gz") {
        Some(Kind::Nff)
    } else if particles::Format::of(path).is_some() {
        Some(Kind::Atoms)
    } else {
        Format::of(path).map(|_| Kind::Picture)
    }
}

fn convert_scene(args: &Args, run: &Run) -> Result<Exit, Failure> {
    if args.depth.is_given() {
        return Err(Failure::new(Exit::Usage, "--float, --bits and their like are for pictures, not for scenes"));
    }
    run.check_output(&args.output, &[&args.input])?;
    let scene = args.moment.load(&args.input, None, run)?.scene;
    let still = scene.tracks.iter().filter(|track| track.part.is_none()).count();
    if still > 0 {
        let text =
            "of groups and what they move, of points in lists or of clouds are written as they are at this frame";
        run.console.warn(&format!("{}: {still} values over time {text}", args.output.display()));
    }
    let saved = run.signals.undisturbed(|| write::save(&scene, &args.output));
    saved.map_err(|error| Failure::output(&args.output, &error))?;
    Ok(Exit::Done)
}

fn convert_picture(args: &Args, run: &Run) -> Result<Exit, Failure> {
    let target = Target::new(&args.output, &[&args.input], run)?;
    let mut options = args.depth.options(&target, run)?;
    let found = vec![(args.input.as_path(), output::read_as_stored(&args.input)?)];
    let Some(found) = pictures::ready(found, (&target, &mut options), run)?.pop() else { return Ok(Exit::Done) };
    // What the header says of the scene is the title of a PNG, as it is of one that is rendered.
    let scene = found.attributes.as_ref().and_then(|attributes| attributes.text("render/scene"));
    let rendered = found.attributes.as_ref().and_then(|attributes| attributes.rendered(&found.picture));
    // A PNG has no window beside its own: the edges that an EXR leaves out are there again.
    let picture = match rendered.filter(|_| target.format() == Format::Png) {
        Some(window) => found.picture.colors_in(window),
        None => found.picture,
    };
    let (owner, comments) = (args.depth.owner.clone(), args.depth.comments.clone());
    let kept = found.attributes;
    let description = Description { scene, kept, rendered, owner, comments, ..Description::default() };
    pictures::write((&args.input, &picture), &target, options, description, run)?;
    Ok(Exit::Done)
}
