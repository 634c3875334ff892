//! How pictures are rendered: words that `render` and `batch` share.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use clap::{Args, ValueEnum};
use octray::batch::{Job, View};
use octray::output::Format;
use octray::plan::{Skip, SkipSet};
use octray::render::Engine;
use octray::scene::Integrator;

use super::Run;
use super::args::{self, EngineName};
use super::atoms::Atoms;
use super::exit::Failure;
use super::layers::{LayerArgs, Windows};
use super::pictures::{Depth, Target};

/// Settings of pictures.
#[derive(Debug, Clone, Args)]
pub struct Settings {
    /// Pixels of the whole picture [default: as in the scene]
    #[arg(long, value_name = "WxH", value_parser = args::resolution)]
    resolution: Option<(u32, u32)>,
    #[command(flatten)]
    windows: Windows,
    #[command(flatten)]
    layers: LayerArgs,
    /// Let rays that meet nothing be transparent: alpha 0, and no more pixels in an EXR than those that show something
    #[arg(long, value_name = "KIND", value_parser = ["transparent"])]
    background: Option<String>,
    /// Samples per pixel [default: as in the scene]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: Option<u32>,
    /// Sample each tile of 64 x 64 pixels until its estimated relative error is below T, such as 0.02 (of the mean square;
    /// values below 0.1 count as 0.1), with 8 to 4096 samples a pixel, most where they help most [default: as in the scene]
    #[arg(long, value_name = "T", value_parser = noise, conflicts_with = "spp", allow_negative_numbers = true)]
    noise: Option<f64>,
    /// Blur what moves: how long the shutter is open, from 0 to 1 of the time to the next frame [default: as in the scene]
    #[arg(long, value_name = "S", value_parser = shutter, allow_negative_numbers = true)]
    shutter: Option<f64>,
    /// How light is found [default: as in the scene]
    #[arg(long, value_enum, value_name = "NAME")]
    integrator: Option<IntegratorName>,
    /// Longest chain of rays, the camera ray being 1 [default: as in the scene]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    max_depth: Option<u32>,
    /// Who finds what rays meet
    #[arg(long, value_enum, value_name = "NAME", default_value_t)]
    engine: EngineName,
    /// Seed of the sample pattern [default: as in the scene]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Do all the work, needed or not, or that of some kinds (as `octray info` names them): the same picture to the bit
    #[arg(long, value_name = "NAME,...", num_args = 0..=1, require_equals = true, value_delimiter = ',',
        default_missing_value = "all", value_parser = skip_names())]
    no_skip: Vec<String>,
    /// Let f32 alone decide what rays meet, wrongly at times: to measure what certainty costs
    #[arg(long)]
    no_certify: bool,
    #[command(flatten)]
    depth: Depth,
    /// Leave out of the file what differs from run to run (date, seconds, threads); so does SOURCE_DATE_EPOCH
    #[arg(long)]
    no_date: bool,
    #[command(flatten)]
    pub atoms: Atoms,
}

/// A relative error.
fn noise(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| *number > 0.0 && number.is_finite());
    number.ok_or_else(|| format!("must be a number greater than 0 such as 0.02, found {text:?}"))
}

/// A part of the time to the next frame.
fn shutter(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| (0.0..=1.0).contains(number));
    number.ok_or_else(|| format!("must be a number from 0 to 1 such as 0.5, found {text:?}"))
}

/// Integrators by their names in scene files.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum IntegratorName {
    /// Direct light with mirror reflection and refraction
    Direct,
    /// Ambient occlusion: how open each place is, times its albedo
    Ao,
    /// All light, what surfaces throw on each other too
    Path,
}

impl From<IntegratorName> for Integrator {
    fn from(name: IntegratorName) -> Integrator {
        match name {
            IntegratorName::Direct => Integrator::Direct,
            IntegratorName::Ao => Integrator::Ao,
            IntegratorName::Path => Integrator::Path,
        }
    }
}

/// Kinds of work that may be left out, and all of them.
fn skip_names() -> PossibleValuesParser {
    PossibleValuesParser::new(std::iter::once("all").chain(Skip::names()))
}

impl Settings {
    /// A job with these settings and nothing else; its output must be [set](Settings::aim).
    ///
    /// # Errors
    /// Layers that do not exist.
    pub fn job(&self, scene: PathBuf) -> Result<Job, Failure> {
        let settings = octray::batch::Settings {
            resolution: self.resolution,
            windows: self.windows.choice()?,
            layers: self.layers.choice()?,
            transparent: self.background.is_some(),
            spp: self.spp,
            noise: self.noise,
            shutter: self.shutter,
            seed: self.seed,
            max_depth: self.max_depth,
            integrator: self.integrator.map(Integrator::from),
            engine: Engine::from(self.engine),
            skips: self.skips(),
            uncertified: self.no_certify,
            options: Default::default(),
            owner: self.depth.owner.clone(),
            comments: self.depth.comments.clone(),
            undated: self.no_date || std::env::var_os("SOURCE_DATE_EPOCH").is_some(),
        };
        let (output, format) = (PathBuf::new(), Format::Exr);
        Ok(Job { scene, look: self.atoms.look(), view: View::First, frame: None, settings, output, format })
    }

    /// What may be left out.
    fn skips(&self) -> SkipSet {
        let without = |set: SkipSet, name: &String| Skip::named(name).map_or(SkipSet::NONE, |skip| set.without(skip));
        self.no_skip.iter().fold(SkipSet::ALL, without)
    }

    /// Sends a job to a target, whose format must be the one that the options are for.
    pub fn aim(&self, job: &mut Job, target: &Target, run: &Run) -> Result<(), Failure> {
        job.settings.options = self.depth.options(target, run)?;
        match target {
            Target::File(path, format) => (job.output, job.format) = (path.clone(), *format),
            Target::Stdout => (job.output, job.format) = (PathBuf::from("-"), Format::Exr),
        }
        Ok(())
    }
}
