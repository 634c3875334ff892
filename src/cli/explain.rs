//! `octray explain`: why is this pixel as it is?

use std::path::PathBuf;

use octray::measure::explain::explain;

use super::Run;
use super::args;
use super::exit::{Exit, Failure};
use super::scene_file::{self, Moment};

const EXAMPLES: &str = "\
Examples:
  octray explain fig5.toml 320 240                 the first sample of a pixel
  octray explain fig5.toml 320 240 --sample 3 --json";

/// Arguments of `octray explain`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    long_about = "Print the tree of rays of one sample of a pixel\n\n\
        For every ray: what the engine met and where, in f32; the same in f64 by the reference; how far the decision was \
        from turning, in errors that f32 cannot avoid (below 8 it was made in f64); the next primitive on the ray; the \
        lights that were asked. Then what each light gives."
)]
pub struct Args {
    /// Scene file (.toml, .nff, .nff.gz), or atoms
    scene: PathBuf,
    /// Column of the pixel, from the left
    x: i32,
    /// Row of the pixel, from the top
    y: i32,
    /// Which of the pixel's samples
    #[arg(long, value_name = "N", default_value_t = 0)]
    sample: u32,
    /// Pixels of the whole picture [default: as in the scene]
    #[arg(long, value_name = "WxH", value_parser = args::resolution)]
    resolution: Option<(u32, u32)>,
    #[command(flatten)]
    moment: Moment,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    let mut scene = args.moment.load(&args.scene, args.resolution, run)?.scene;
    scene_file::resize(&mut scene, args.resolution);
    scene_file::need_memory(&scene, 0, "the tree of this scene")?;
    let spp = scene.image.as_ref().map_or(1, |image| image.spp.max(1));
    if args.sample >= spp {
        let text = format!("--sample {}: a pixel of this scene has {spp} samples, 0 to {}", args.sample, spp - 1);
        return Err(Failure::new(Exit::Usage, text));
    }
    let explanation = explain(&scene, (args.x, args.y), args.sample)?;
    if args.json {
        let json = serde_json::to_value(&explanation).map_err(|error| Failure::new(Exit::Limit, error))?;
        run.console.print_json(&json)?;
    } else {
        run.console.print(&format!("{explanation}\n"))?;
    }
    Ok(Exit::Done)
}
