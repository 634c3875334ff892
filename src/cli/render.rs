//! `octray render`: scenes to pictures.

use std::path::{Path, PathBuf};

use octray::batch::frames::{self, FrameList};
use octray::batch::{Job, Sources, View, names};

use super::Run;
use super::exit::{Exit, Failure};
use super::jobs::{self, List, Running};
use super::scene_file;
use super::settings::Settings;

const EXAMPLES: &str = "\
Examples:
  octray render fig5.toml                                    writes fig5.exr here
  octray render fig5.toml -o fig5.png --bits 16              a picture to look at
  octray render fig5.toml -o draft.png --resolution 320x240 --spp 1
  octray render fig5.toml -o part.exr --crop 100,100,200,200 --stats part.json
  octray render fig5.toml -o slow.exr --engine reference     by the f64 reference
  octray render protein.pdb -o protein.png                   atoms, without a scene
  octray render water.xyz.gz --frames 1-100 --out-dir out    out/water.0001.exr and so on
  octray render a.toml b.toml --camera all --out-dir out     out/a.front.exr and so on
  octray render turn.toml --frames 1-100 --out-dir out --resume --shard 2/4
  octray render fig5.toml -o - -q | oiiotool - -o fig5.tif   EXR to standard output";

/// Arguments of `octray render`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Scene files (.toml, .nff, .nff.gz), or atoms (.xyz, .lammpstrj, .data, .pdb, .sdf, ... or with .gz)
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    /// Picture to write, .exr or .png; - is EXR to standard output; #### stands for the frame's number [default: the
    /// scene's name with .exr, here]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Directory for the pictures, made where it is missing: the scene's name with .exr, before it the camera's and the
    /// frame's number where there are several
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    out_dir: Option<PathBuf>,
    /// Names of pictures in --out-dir; {scene}, {camera}, {job} and #### stand for what differs
    #[arg(long, value_name = "PATTERN", requires = "out_dir")]
    name: Option<String>,
    /// Frames of an animation or trajectory: 1-100, 1-100x2 (every second one), 1,5,10-20 [default: 1]
    #[arg(long, value_name = "LIST", value_parser = frames::list, allow_hyphen_values = true)]
    frames: Option<FrameList>,
    /// Camera of the scene, by its name; several with commas, or all [default: the first one]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    camera: Vec<String>,
    #[command(flatten)]
    settings: Settings,
    #[command(flatten)]
    running: Running,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    run.warn_of_build();
    args.running.threads.rule();
    for scene in &args.scenes {
        scene_file::check_look(scene, &args.settings.atoms)?;
    }
    let mut jobs = args.jobs(run)?;
    let many = jobs.len() > 1;
    let pattern = args.pattern()?;
    let inputs: Vec<&Path> = args.scenes.iter().map(PathBuf::as_path).collect();
    let frames = args.frames.as_ref().is_some_and(|list| list.0.len() > 1);
    for (index, job) in jobs.iter_mut().enumerate() {
        let name = names::name(&pattern, job, index + 1, frames).map_err(|text| Failure::new(Exit::Usage, text))?;
        let target = jobs::target(&name, &inputs, many, run)?;
        args.settings.aim(job, &target, run)?;
    }
    if let ([job], None, None) = (jobs.as_slice(), &args.output, &args.out_dir) {
        run.console.note(&format!("octray: no -o given: the picture goes to {job}"));
    }
    let list = List { jobs, many, ledger: many && args.out_dir.is_some(), resume: args.running.resume };
    jobs::run(list, &args.running, &Sources::default(), run)
}

impl Args {
    /// Scenes, their frames, their cameras; without names yet.
    fn jobs(&self, run: &Run) -> Result<Vec<Job>, Failure> {
        let mut jobs = Vec::new();
        for scene in &self.scenes {
            let views = self.views(scene, run)?;
            let frames = self
                .frames
                .as_ref()
                .map_or_else(|| vec![None], |list| list.0.iter().map(|frame| Some(*frame)).collect());
            let plain = self.settings.job(scene.clone())?;
            for frame in frames {
                let job = |view: &View| Job { frame, view: view.clone(), ..plain.clone() };
                jobs.extend(views.iter().map(job));
            }
        }
        Ok(jobs)
    }

    fn views(&self, scene: &Path, run: &Run) -> Result<Vec<View>, Failure> {
        let names = match self.camera.as_slice() {
            [] => return Ok(vec![View::First]),
            [all] if all == "all" => {
                // A scene that cannot be read fails as a job, beside the others.
                let mut frames = scene_file::frames(scene, &self.settings.atoms, None)?;
                let read = scene_file::load(&mut frames, scene, 1, &run.hushed());
                let cameras = read.map(|loaded| loaded.scene.cameras).unwrap_or_default();
                let names: Vec<String> = cameras.into_iter().filter_map(|camera| camera.name).collect();
                if names.is_empty() {
                    return Ok(vec![View::First]);
                }
                names
            }
            names => names.to_vec(),
        };
        Ok(names.into_iter().map(View::Named).collect())
    }

    /// The names of the pictures.
    fn pattern(&self) -> Result<String, Failure> {
        let text = |path: &Path| path.to_string_lossy().into_owned();
        if let Some(output) = &self.output {
            return Ok(text(output));
        }
        let cameras = if self.camera.len() > 1 || self.camera == ["all"] { ".{camera}" } else { "" };
        let name = |number| format!("{{scene}}{cameras}{number}.exr");
        let Some(folder) = &self.out_dir else {
            return Ok(name("")); // without a place for the number: several frames are refused
        };
        let number = if self.frames.is_some() { ".####" } else { "" };
        let name = self.name.clone().unwrap_or_else(|| name(number));
        let file = folder.join(name);
        let parent = file.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent).map_err(|error| Failure::output(parent, &error))?;
        Ok(text(&file))
    }
}
