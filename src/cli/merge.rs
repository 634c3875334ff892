//! `octray merge`: crops of one frame to the frame.

use std::path::{Path, PathBuf};

use octray::film::Picture;
use octray::output::{self, Attributes, Contents, Description};

use super::Run;
use super::exit::{Exit, Failure};
use super::pictures::{self, Depth, Target};

const EXAMPLES: &str = "\
Examples:
  octray merge left.exr right.exr -o full.exr
  octray merge parts/*.exr -o full.exr --compression zip";

/// What parts of one frame have in common, beside windows and layers.
const COMMON: [&str; 5] = ["render/sceneHash", "render/seed", "render/spp", "render/frame", "render/settings"];

/// Arguments of `octray merge`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    long_about = "Join crops of one frame to the frame\n\n\
        Every pixel has to be in a part, and where parts overlap they have to agree to the bit. Scene hash, seed, \
        samples, frame and all other settings that say more than which pixels have to be the same. The result is, to \
        the byte, what one render with --no-date writes; without \
        --color its colours are those of the first part."
)]
pub struct Args {
    /// Crops, EXR
    #[arg(required = true)]
    parts: Vec<PathBuf>,
    /// Picture to write, .exr or .png; - is EXR to standard output
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    depth: Depth,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    let inputs: Vec<&Path> = args.parts.iter().map(PathBuf::as_path).collect();
    let target = Target::new(&args.output, &inputs, run)?;
    let mut options = args.depth.options(&target, run)?;
    let mut parts = Vec::new();
    for path in &args.parts {
        let part = output::read_as_stored(path)?;
        check(path, &part)?;
        parts.push(part);
    }
    compare(&args.parts, &parts)?;
    if text(&parts[0], COMMON[0]).is_none() {
        run.console.warn(&format!(
            "{}: says no {}: nothing shows that the parts are of one scene",
            args.parts[0].display(),
            COMMON[0]
        ));
    }
    options.exr.color = run.color_space.or(parts[0].storage.map(|storage| storage.color)).unwrap_or_default();
    let parts = pictures::ready(inputs.into_iter().zip(parts).collect(), (&target, &mut options), run)?;
    options.exr.float |= parts.iter().any(|part| part.float);
    let kept = parts[0].attributes.clone().map(|attributes| attributes.without_run());
    let pictures: Vec<Picture> = parts.into_iter().map(|part| part.picture).collect();
    let joined = Picture::join(&pictures).map_err(|error| {
        let failure = Failure::new(Exit::Input, &error);
        error.part().map_or(failure.message.clone(), |part| failure.of(&args.parts[part]).message)
    });
    let mut whole = joined.map_err(|message| Failure::new(Exit::Input, message))?;
    drop(pictures);
    // As a render of the whole frame does: with a background there is nothing to trim.
    let rendered = whole.trim();
    let scene = kept.as_ref().and_then(|kept| kept.text("render/scene"));
    let (owner, comments) = (args.depth.owner.clone(), args.depth.comments.clone());
    let description = Description { scene, kept, rendered, owner, comments, ..Description::default() };
    pictures::write((&args.parts[0], &whole), &target, options, description, run)?;
    Ok(Exit::Done)
}

/// Refuses a part whose samples are not those that were written.
fn check(path: &Path, part: &Contents) -> Result<(), Failure> {
    match &part.pixel_hash {
        Some(hash) if hash.stored != hash.found => {
            let text = format!("is damaged: its samples have the hash {}, its header says {}", hash.found, hash.stored);
            Err(Failure::new(Exit::Input, text).of(path))
        }
        _ => Ok(()),
    }
}

/// Refuses parts that are not of one render.
fn compare(paths: &[PathBuf], parts: &[Contents]) -> Result<(), Failure> {
    let origin = |part: &Contents| part.attributes.as_ref().map_or((0, 0), Attributes::origin);
    let (x0, y0) = origin(&parts[0]);
    for (path, part) in paths.iter().zip(parts) {
        let (x, y) = origin(part);
        if (x, y) != (x0, y0) {
            let text = format!("its frame begins at {x},{y}, that of {} at {x0},{y0}", paths[0].display());
            return Err(Failure::new(Exit::Input, text).of(path));
        }
    }
    for name in COMMON {
        let first = text(&parts[0], name);
        for (path, part) in paths.iter().zip(parts).skip(1) {
            let found = text(part, name);
            if found != first {
                let say = |value: Option<String>| value.unwrap_or_else(|| "missing".to_owned());
                let text = format!("its {name} is {}, that of {} {}", say(found), paths[0].display(), say(first));
                return Err(Failure::new(Exit::Input, text).of(path));
            }
        }
    }
    Ok(())
}

fn text(part: &Contents, name: &str) -> Option<String> {
    part.attributes.as_ref()?.text(name)
}
