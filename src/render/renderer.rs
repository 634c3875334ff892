//! The order for a picture, and its way to the picture.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use rayon::ThreadPool;
use rayon::prelude::*;

use super::adaptive::Noise;
use super::block::Block;
use super::layers::channel_count;
use super::{Engine, IdNames, Progress, RenderError, Stats, Task};
use crate::film::{Picture, Window};
use crate::output::{self, Description, Losses, Options, OutputError};
use crate::plan::{Plan, Sight, SkipSet, validate};
use crate::scene::{Aov, Camera, ImageSettings, Integrator, Layers, RenderSettings, Scene, SceneSum};

/// Renders pictures of one scene.
///
/// ```no_run
/// use octray::{Renderer, Scene};
/// let scene = Scene::load("scenes/fig5.toml")?;
/// let rendering = Renderer::new(&scene)?.spp(64).render(&())?;
/// println!("{} camera rays", rendering.stats.rays.rays[0]);
/// rendering.write("fig5.exr")?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Renderer<'s> {
    pub(super) scene: &'s Scene,
    pub(super) camera: &'s Camera,
    pub(super) image: ImageSettings,
    pub(super) layers: Layers,
    pub(super) next: Option<&'s Scene>,
    pub(super) moments: &'s [Scene],
    pub(super) window: Option<Window>,
    pub(super) overscan: [u32; 2],
    pub(super) settings: RenderSettings,
    pub(super) threads: usize,
    pub(super) skips: SkipSet,
    pub(super) certify: bool,
    pub(super) engine: Engine,
}

/// A picture and how it came about.
#[derive(Debug, Clone)]
pub struct Rendering {
    /// The picture; without samples where its rows were passed on.
    pub picture: Picture,
    /// Work and time.
    pub stats: Stats,
    /// What the numbers in its id channels stand for.
    pub names: IdNames,
}

impl Rendering {
    /// Writes the picture, EXR (half) or PNG (8 bits) by the extension of `path`, aside and then renamed.
    ///
    /// # Errors
    /// An unknown extension, or a file that cannot be written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<Losses, OutputError> {
        output::write(path.as_ref(), &self.picture, Options::default(), &Description::default())
    }
}

impl<'s> Renderer<'s> {
    /// The scene's own settings and first camera.
    ///
    /// # Errors
    /// No camera or image size; a scene that was made by hand and breaks a rule.
    pub fn new(scene: &'s Scene) -> Result<Self, RenderError> {
        let camera = scene.camera(None);
        Renderer::seen_from(scene, camera.ok_or(RenderError::NoCamera)?)
    }

    /// The scene's own settings, seen from a camera that need not be one of the scene's.
    ///
    /// # Errors
    /// No image size; a scene that was made by hand and breaks a rule.
    pub fn seen_from(scene: &'s Scene, camera: &'s Camera) -> Result<Self, RenderError> {
        validate(scene)?;
        Ok(Renderer {
            scene,
            camera,
            image: scene.image.clone().ok_or(RenderError::NoImage)?,
            layers: scene.layers,
            next: None,
            moments: &[],
            window: None,
            overscan: [0; 2],
            settings: scene.render.clone(),
            threads: 0,
            skips: SkipSet::ALL,
            certify: true,
            engine: Engine::Packet,
        })
    }

    /// Another camera, by name.
    pub fn camera(mut self, name: &str) -> Result<Self, RenderError> {
        let known = || {
            let names: Vec<&str> = self.scene.cameras.iter().filter_map(|camera| camera.name.as_deref()).collect();
            if names.is_empty() { "none with a name".into() } else { names.join(", ") }
        };
        self.camera = self
            .scene
            .camera(Some(name))
            .ok_or_else(|| RenderError::UnknownCamera { name: name.into(), known: known() })?;
        Ok(self)
    }

    /// Samples per pixel, at least 1, and no noise level; a single one sits at the pixel's centre.
    pub fn spp(mut self, spp: u32) -> Self {
        self.image.spp = spp.max(1);
        self.settings.noise = None;
        self
    }

    /// Samples each tile of 64 x 64 pixels until its estimated relative error is no larger: each cell of 8 x 8 pixels with
    /// 8, 16, 32 ... up to 4,096 samples, most where they help most. Each pixel has the bits that it would have with as
    /// many samples for all, in any crop. `None`, or nothing above 0: as many samples for all.
    pub fn noise(mut self, target: Option<f64>) -> Self {
        self.settings.noise = target.filter(|target| *target > 0.0);
        self
    }

    /// Pixels of the whole picture.
    pub fn resolution(mut self, width: u32, height: u32) -> Self {
        (self.image.width, self.image.height) = (width, height);
        self
    }

    /// Layers beside the colour, in place of the scene's.
    pub fn layers(mut self, layers: Layers) -> Self {
        self.layers = layers;
        self
    }

    /// The scene at the next frame, which the motion layer leads to; without one nothing moves.
    pub fn next_frame(mut self, next: &'s Scene) -> Self {
        self.next = Some(next);
        self
    }

    /// Lets ambient light reach everything, open or not.
    pub fn flat_ambient(mut self) -> Self {
        self.settings.ambient_occlusion = false;
        self
    }

    /// How long the shutter is open, as a share of the time to the next frame; what [`moments`](Renderer::moments) the
    /// picture is of is another matter.
    pub fn shutter(mut self, share: f64) -> Self {
        self.settings.shutter = share;
        self
    }

    /// The scene at [moments](super::moments()) while the shutter is open: the samples of each pixel are shared out over
    /// them, in order. Layers, too, are of what those samples see. Without any the picture is of one moment.
    pub fn moments(mut self, moments: &'s [Scene]) -> Self {
        self.moments = moments;
        self
    }

    /// Pixels beyond the picture, so many on the left and right side and so many above and below: for compositing.
    pub fn overscan(mut self, pixels: [u32; 2]) -> Self {
        self.overscan = pixels;
        self
    }

    /// Only the pixels of a window: the same bits as in the whole picture.
    pub fn crop(mut self, window: Window) -> Self {
        self.window = Some(window);
        self
    }

    /// Longest chain of rays, the camera ray being 1.
    pub fn max_depth(mut self, depth: u32) -> Self {
        self.settings.max_depth = depth;
        self
    }

    /// How radiance is found.
    pub fn integrator(mut self, integrator: Integrator) -> Self {
        self.settings.integrator = integrator;
        self
    }

    /// The scene.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// All settings of how radiance is found.
    pub fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// Chooses the sample pattern.
    pub fn seed(mut self, seed: u64) -> Self {
        self.settings.seed = seed;
        self
    }

    /// Threads to use; 0: as many as there are cores for this process.
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// With `false`, does all the work, needed or not; the picture is the same to the bit.
    pub fn skip(self, skip: bool) -> Self {
        self.skips(if skip { SkipSet::ALL } else { SkipSet::NONE })
    }

    /// Which kinds of work may be left out where they are not needed; the picture is the same to the bit.
    pub fn skips(mut self, skips: SkipSet) -> Self {
        self.skips = skips;
        self
    }

    /// With `false`, f32 alone decides what rays meet, wrongly at times: for measuring what certainty costs.
    pub fn certify(mut self, certify: bool) -> Self {
        self.certify = certify;
        self
    }

    /// Which tracer finds the hits.
    pub fn engine(mut self, engine: Engine) -> Self {
        self.engine = engine;
        self
    }

    /// The settings in force.
    pub fn image(&self) -> &ImageSettings {
        &self.image
    }

    /// The layers in force.
    pub fn aovs(&self) -> Layers {
        self.layers
    }

    /// How many channels the layers in force have.
    pub fn channel_count(&self) -> usize {
        channel_count(self.layers)
    }

    /// The camera in force.
    pub fn view(&self) -> &'s Camera {
        self.camera
    }

    /// The longest chain of rays in force.
    pub fn depth(&self) -> u32 {
        self.settings.max_depth
    }

    /// The seed in force.
    pub fn pattern(&self) -> u64 {
        self.settings.seed
    }

    /// A hash of the scene and of all settings that decide about colour: equal hashes, equal pixels. In hexadecimal.
    pub fn scene_hash(&self) -> String {
        self.hash_after(&self.scene.sum())
    }

    /// The same where the scene was hashed before.
    pub fn hash_after(&self, scene: &SceneSum) -> String {
        let settings = (self.image(), self.view(), self.settings(), self.engine == Engine::Reference);
        scene.hash(&format!("{settings:?}"))
    }

    /// What this render does and what it leaves out.
    pub fn plan(&self) -> Plan<'s> {
        let mut plan = Plan::seen_from(self.skips, self.scene, self.camera, self.image.height);
        let display = (self.image.width, self.image.height);
        plan.leave_out_layers(self.layers);
        let full = Window::full(display).grown(self.overscan);
        // What a pixel costs must not depend on a crop.
        let window = self.window.filter(|_| !self.layers.has(Aov::Cost)).unwrap_or(full);
        // Whole squares are sampled to a noise level, and for costs.
        let is_whole = self.settings.noise.is_some() || self.layers.has(Aov::Cost);
        let Window { x0, y0, x1, y1 } = if is_whole { Block::hull(window) } else { window };
        let window = [x0, y0, x1, y1];
        plan.look(&Sight { camera: self.camera, display, window, reach: self.reach(), settings: &self.settings });
        plan
    }

    /// How far camera rays are from the centres of their pixels, at most.
    pub(super) fn reach(&self) -> f64 {
        if self.image.spp == 1 && self.settings.noise.is_none() { 0.0 } else { self.image.filter.radius }
    }

    /// Renders the picture.
    pub fn render(&self, progress: &dyn Progress) -> Result<Rendering, RenderError> {
        self.checked_window()?;
        let pool = pool(self.threads)?;
        let threads = pool.current_num_threads();
        pool.install(|| {
            let task = Task::new(self)?;
            let (start, done, stop) = (Instant::now(), AtomicU64::new(0), AtomicBool::new(false));
            let stopped = || {
                let now = stop.load(Ordering::Relaxed) || progress.cancelled();
                stop.store(now, Ordering::Relaxed);
                now
            };
            let mut picture = task.begin();
            let gathering = picture.open(&task);
            let trace = |block| {
                if stopped() {
                    return None;
                }
                let traced = task.trace(block, &stopped)?;
                gathering.show(&traced, |shown| progress.block(shown));
                gathering.add(traced);
                let samples = task.samples(block);
                progress.advance(done.fetch_add(samples, Ordering::Relaxed) + samples, task.total());
                Some(())
            };
            let traced: Option<()> = (0..task.blocks()).into_par_iter().map(trace).collect();
            drop(gathering);
            traced.ok_or(RenderError::Cancelled)?;
            Ok(task.finish(picture, threads, start))
        })
    }

    /// The pixels that are rendered.
    ///
    /// # Errors
    /// [`RenderError::BadWindow`].
    pub fn window(&self) -> Result<Window, RenderError> {
        self.checked_window()
    }

    pub(super) fn noise_level(&self) -> Option<Noise> {
        self.settings.noise.map(|target| Noise { target })
    }

    pub(super) fn checked_window(&self) -> Result<Window, RenderError> {
        let display = (self.image.width, self.image.height);
        let full = Window::full(display).grown(self.overscan);
        let window = self.window.unwrap_or(full);
        match window.area() > 0 && full.holds(&window) {
            true => Ok(window),
            false => Err(RenderError::BadWindow { window, width: display.0, height: display.1 }),
        }
    }
}

/// So many threads; 0: as many as there are cores for this process.
pub(crate) fn pool(threads: usize) -> Result<ThreadPool, RenderError> {
    let threads = match threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| RenderError::Threads(error.to_string()))
}
