//! One picture of a batch: what is rendered, how, and where it goes.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::{LayerChoice, WindowChoice};
use crate::output::{self, Description, Format, description};
use crate::plan::SkipSet;
use crate::render::{Engine, RenderError, Renderer, Stats};
use crate::scene::particles::{self, Look};
use crate::scene::{Aov, Camera, Integrator, Scene};

/// One picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// The scene file, of any kind that [`Scene::load`] reads.
    pub scene: PathBuf,
    /// What atoms look like where the scene is a file of atoms.
    pub look: Look,
    /// Where it is seen from.
    pub view: View,
    /// The frame; `None` is the first one of a scene that is not meant as an animation.
    pub frame: Option<i64>,
    /// How it is rendered.
    pub settings: Settings,
    /// The file to write.
    pub output: PathBuf,
    /// Its format.
    pub format: Format,
}

/// The camera of a picture.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum View {
    /// The scene's first one.
    #[default]
    First,
    /// One of the scene's, by its name.
    Named(String),
    /// One that the scene does not have.
    Given(Box<Camera>),
}

/// How a picture is rendered; `None` is as the scene says.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Settings {
    /// Pixels of the whole picture.
    pub resolution: Option<(u32, u32)>,
    /// The pixels to render.
    pub windows: WindowChoice,
    /// Layers beside the colour.
    pub layers: LayerChoice,
    /// Rays that meet nothing are transparent.
    pub transparent: bool,
    /// Samples per pixel.
    pub spp: Option<u32>,
    /// Relative error of each tile at which sampling stops.
    pub noise: Option<f64>,
    /// How long the shutter is open, as a share of the time to the next frame.
    pub shutter: Option<f64>,
    /// Seed of the sample pattern.
    pub seed: Option<u64>,
    /// Longest chain of rays.
    pub max_depth: Option<u32>,
    /// How light is found.
    pub integrator: Option<Integrator>,
    /// Who finds what rays meet.
    pub engine: Engine,
    /// What may be left out where it is not needed.
    pub skips: SkipSet,
    /// Let f32 alone decide what rays meet, for measuring what certainty costs.
    pub uncertified: bool,
    /// How samples are stored.
    pub options: output::Options,
    /// Who owns the picture, for an EXR.
    pub owner: Option<String>,
    /// Any words, for an EXR.
    pub comments: Option<String>,
    /// Leave out of the file what differs from run to run.
    pub undated: bool,
}

/// A part of a list, the others being rendered elsewhere: entries `index`, `index + of`, ... counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// From 1 to `of`.
    pub index: u32,
    /// How many parts there are.
    pub of: u32,
}

/// Samples per pixel from which on the look of atoms without a scene has ambient occlusion: fewer rays show noise alone.
const FEWEST: u32 = 4;

impl Job {
    /// The frame of the scene.
    pub fn frame(&self) -> i64 {
        self.frame.unwrap_or(1)
    }

    /// The renderer of this job's picture.
    ///
    /// # Errors
    /// What the scene lacks: a camera, an image, a camera of that name.
    pub fn renderer<'s>(&'s self, scene: &'s Scene) -> Result<Renderer<'s>, RenderError> {
        let settings = &self.settings;
        let mut renderer = match &self.view {
            View::First => Renderer::new(scene)?,
            View::Named(name) => Renderer::new(scene)?.camera(name)?,
            View::Given(camera) => Renderer::seen_from(scene, camera)?,
        };
        renderer = renderer.skips(settings.skips).certify(!settings.uncertified).engine(settings.engine);
        if let Some((width, height)) = settings.resolution {
            renderer = renderer.resolution(width, height);
        }
        if let Some(spp) = settings.spp {
            renderer = renderer.spp(spp);
        }
        if settings.noise.is_some() {
            renderer = renderer.noise(settings.noise);
        }
        if particles::Format::of(&self.scene).is_some() && renderer.image().spp < FEWEST {
            renderer = renderer.flat_ambient();
        }
        if let Some(shutter) = settings.shutter {
            renderer = renderer.shutter(shutter);
        }
        if let Some(depth) = settings.max_depth {
            renderer = renderer.max_depth(depth);
        }
        if let Some(seed) = settings.seed {
            renderer = renderer.seed(seed);
        }
        if let Some(integrator) = settings.integrator {
            renderer = renderer.integrator(integrator);
        }
        // Names that are none were refused when the job was made.
        let layers = settings.layers.layers(scene).unwrap_or(scene.layers);
        Ok(settings.windows.apply(renderer).layers(layers))
    }

    /// Whether, by its own settings, its picture depends on the next frame as well.
    pub fn looks_ahead(&self) -> bool {
        let settings = &self.settings;
        let moves = settings.layers.aovs.iter().any(|name| name == Aov::Motion.name() || name == "all");
        moves || settings.shutter.is_some_and(|shutter| shutter > 0.0)
    }

    /// What its file says of where it comes from.
    pub fn description(
        &self,
        renderer: &Renderer,
        stats: &Stats,
        scene_hash: Option<String>,
        shard: Option<String>,
    ) -> Description {
        let parts: Vec<String> =
            shard.into_iter().chain(self.settings.windows.tile.map(|tile| tile.to_string())).collect();
        let run = description::Run {
            date: SystemTime::now(),
            seconds: stats.plan_seconds + stats.build_seconds + stats.trace_seconds,
            threads: u32::try_from(stats.threads).unwrap_or(u32::MAX),
            rays: Some(stats.rays.rays.iter().sum::<u64>().to_string()),
            shard: (!parts.is_empty()).then(|| parts.join(", ")),
        };
        Description {
            scene: self.scene.file_name().map(|name| name.to_string_lossy().into_owned()),
            scene_hash,
            settings: Some(self.words(renderer)).filter(|words| !words.is_empty()),
            camera: Some(renderer.view().clone()),
            spp: Some(renderer.image().spp),
            seed: Some(renderer.pattern()),
            file_stem: output::stem(&self.output),
            frame: i32::try_from(self.frame()).ok(),
            owner: self.settings.owner.clone(),
            comments: self.settings.comments.clone(),
            run: (!self.settings.undated).then_some(run),
            ..Description::default()
        }
    }
}

/// As messages name it: its output.
impl fmt::Display for Job {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.output.as_os_str() == "-" {
            true => f.write_str("standard output"),
            false => write!(f, "{}", self.output.display()),
        }
    }
}

impl Shard {
    /// Whether an entry of a list, counted from 0, belongs to it.
    pub fn holds(&self, entry: usize) -> bool {
        entry % self.of as usize == self.index as usize - 1
    }
}

/// "2/8".
impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

/// A scene's file name without what says its kind: `water` of `water.xyz.gz`.
pub fn stem(scene: &Path) -> String {
    let name = scene.file_name().unwrap_or_default().to_string_lossy();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    let kind = [".toml", ".nff"].iter().any(|ending| name.to_lowercase().ends_with(ending));
    let known = kind || particles::Format::of(scene).is_some();
    let stem = if known { name.rsplit_once('.').map(|(stem, _)| stem) } else { None };
    stem.unwrap_or(name).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stems_are_names_without_their_kind() {
        let names = ["scenes/fig5.toml", "balls.nff.gz", "../a.b.nff", "odd", "water.xyz.gz", "a.txt"];
        assert_eq!(names.map(|name| stem(Path::new(name))), ["fig5", "balls", "a.b", "odd", "water", "a.txt"]);
    }

    #[test]
    fn shards_share_a_list_out() {
        let shards: Vec<Shard> = (1..=3).map(|index| Shard { index, of: 3 }).collect();
        for entry in 0..20 {
            assert_eq!(shards.iter().filter(|shard| shard.holds(entry)).count(), 1);
        }
        assert_eq!((shards[1].holds(1), shards[1].holds(2), shards[1].to_string()), (true, false, "2/3".into()));
    }
}
