//! `octray check`: is the picture right?

use std::path::PathBuf;

use octray::measure::check::{CheckSettings, check_layers};
use octray::measure::heatmap;
use octray::output::{self, Format, png};

use super::Run;
use super::args::{self, Threads};
use super::exit::{Exit, Failure};
use super::pictures;
use super::scene_file::{self, Moment};

const EXAMPLES: &str = "\
Examples:
  octray check fig5.toml                           every ray, or as many as a minute allows
  octray check fig5.toml --seconds 5 --json        a quick look, for a machine
  octray check fig5.toml --spp 16 --resolution 64x48";

/// Arguments of `octray check`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    long_about = "Check the engine against the f64 reference on a scene\n\n\
        Ray by ray: every ray that the engine traced is traced again by the reference, as the exact numbers that \
        its bits are (camera rays from the f64 that they were rounded from), and must meet the same primitive; only \
        what f64 cannot tell apart is a tie. Picture by picture: the reference renders the scene by \
        itself, and the colours must agree. Ends with 1 where they do not."
)]
pub struct Args {
    /// Scene file (.toml, .nff, .nff.gz), or atoms (.xyz, .lammpstrj, .data, .pdb, .sdf, ... or with .gz)
    scene: PathBuf,
    /// Seconds that the reference may take; where that is too short, a part of the pixels is drawn
    #[arg(long, value_name = "S", default_value = "60", value_parser = args::limit)]
    seconds: f64,
    /// Samples per pixel
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: u32,
    /// Pixels of the whole picture [default: as in the scene]
    #[arg(long, value_name = "WxH", value_parser = args::resolution)]
    resolution: Option<(u32, u32)>,
    /// Seed of the choice of pixels
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Write the differences as layers: radiance, both pictures, depth (and in ulps), normal angle, wrong object
    #[arg(long, value_name = "FILE.exr")]
    layers: Option<PathBuf>,
    /// Write a picture of the differences, with a scale
    #[arg(long, value_name = "FILE.png")]
    heatmap: Option<PathBuf>,
    /// Check an engine that lets f32 alone decide: to see what certainty is good for
    #[arg(long)]
    no_certify: bool,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    moment: Moment,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    run.warn_of_build();
    for (path, format, ending) in [(&args.layers, Format::Exr, ".exr"), (&args.heatmap, Format::Png, ".png")] {
        let Some(path) = path else { continue };
        if Format::of(path) != Some(format) {
            return Err(Failure::new(Exit::Usage, format!("{}: this should end in {ending}", path.display())));
        }
        run.check_output(path, &[&args.scene])?;
    }
    let mut scene = args.moment.load(&args.scene, args.resolution, run)?.scene;
    scene_file::resize(&mut scene, args.resolution);
    scene_file::need_memory(&scene, 0, "the check of this scene")?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads.count()).build();
    let pool = pool.map_err(|error| Failure::new(Exit::Limit, format!("cannot start threads: {error}")))?;
    let settings = CheckSettings {
        spp: args.spp,
        seconds: args.seconds,
        seed: args.seed,
        certify: !args.no_certify,
        layers: args.layers.is_some() || args.heatmap.is_some(),
        ..CheckSettings::default()
    };
    let (report, layers) = pool.install(|| check_layers(&scene, &settings))?;
    if let Some(path) = &args.layers {
        let options = output::Options {
            exr: output::Storage { float: true, ..output::Storage::default() },
            ..output::Options::default()
        };
        output::write(path, &layers.differences, options, &output::Description::default())?;
    }
    if let Some(path) = &args.heatmap {
        let title = format!("engine - reference, {}", args.scene.display());
        let bytes = png::encode_raster(&heatmap(&layers.engine, &layers.reference)?, &title);
        let bytes = bytes.map_err(|error| Failure::new(Exit::Output, error).of(path))?;
        pictures::write_bytes(path, &bytes, run)?;
    }
    if args.json {
        let json = serde_json::to_value(&report).map_err(|error| Failure::new(Exit::Limit, error))?;
        run.console.print_json(&json)?;
    } else {
        run.console.print(&format!("{report}\n"))?;
    }
    Ok(if report.pass { Exit::Done } else { Exit::No })
}
