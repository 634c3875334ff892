//! Scene files over time: what is the same in all frames is read once, and one frame after the other.

use std::collections::HashMap;
use std::hash::Hash;
use std::path::{Path, PathBuf};

use super::particles::{self, Columns, Format, Look, Trajectory};
use super::picture_file::Picture;
use super::{ColorSpace, Filter, ImageSettings, Scene, SceneError, SceneErrors, fit, nff, toml};

/// Samples per pixel of a scene that says no picture, as in scene files.
const SPP: u32 = 16;

/// A scene file that is read at one frame after the other. Frames count from 1, and those before the first key of
/// an animated value have that key's value.
///
/// ```no_run
/// use octray::scene::Frames;
///
/// let mut frames = Frames::new("turntable.toml");
/// for frame in 1..=120 {
///     let scene = frames.scene(frame)?;
/// }
/// # Ok::<(), octray::scene::SceneErrors>(())
/// ```
pub struct Frames {
    path: PathBuf,
    look: Look,
    resolution: Option<(u32, u32)>,
    store: Store,
    /// Where cameras without a place stand, once the first frame has been seen.
    views: Option<Vec<fit::View>>,
}

/// What a load may keep for the next one.
#[derive(Default)]
pub(super) struct Store {
    /// Pictures by file and the way they are read.
    pub pictures: Kept<(PathBuf, Option<ColorSpace>), Option<Picture>>,
    /// Trajectories by cloud, file and what is wanted of it.
    pub trajectories: Kept<(usize, PathBuf, Columns, bool), Trajectory>,
}

/// Things by name, of which those that a load did not ask for are dropped after it.
pub(super) struct Kept<K, V> {
    now: HashMap<K, V>,
    before: HashMap<K, V>,
}

/// A scene as a reader gives it, with cameras that still want a place.
pub(super) struct Draft {
    pub scene: Scene,
    pub cameras: Vec<OpenCamera>,
}

/// A camera that is to be placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OpenCamera {
    /// Index into the cameras of the scene.
    pub index: usize,
    /// Whether it has no eye and no target: it is to see everything.
    pub framed: bool,
    /// Degrees by which it is turned about its `up` through its target.
    pub orbit: Option<f64>,
}

impl<K, V> Default for Kept<K, V> {
    fn default() -> Self {
        Kept { now: HashMap::new(), before: HashMap::new() }
    }
}

impl<K: Hash + Eq, V> Kept<K, V> {
    /// Begins another load.
    fn turn(&mut self) {
        self.before = std::mem::take(&mut self.now);
    }

    /// The value of a key, kept from the load before or made now.
    pub fn get<E>(&mut self, key: K, make: impl FnOnce() -> Result<V, E>) -> Result<&mut V, E> {
        use std::collections::hash_map::Entry;
        match self.now.entry(key) {
            Entry::Occupied(entry) => Ok(entry.into_mut()),
            Entry::Vacant(entry) => {
                let value = self.before.remove(entry.key()).map_or_else(make, Ok)?;
                Ok(entry.insert(value))
            }
        }
    }
}

impl Frames {
    /// A file of any kind that [`Scene::load`] reads. Nothing is read yet.
    pub fn new(path: impl AsRef<Path>) -> Self {
        Frames {
            path: path.as_ref().to_owned(),
            look: Look::default(),
            resolution: None,
            store: Store::default(),
            views: None,
        }
    }

    /// What atoms look like that come from a file of atoms alone; scene files say it themselves.
    pub fn look(mut self, look: Look) -> Self {
        self.look = look;
        self
    }

    /// Another size of the picture, or the first one of a scene that says none; cameras that are placed so that they see everything need to know it.
    pub fn resolution(mut self, resolution: Option<(u32, u32)>) -> Self {
        self.resolution = resolution;
        self
    }

    /// The scene at a frame.
    ///
    /// # Errors
    /// All mistakes of all files; each with its place.
    pub fn scene(&mut self, frame: i64) -> Result<Scene, SceneErrors> {
        let Draft { mut scene, cameras } = self.read(frame)?;
        self.place(&mut scene, &cameras, frame)?;
        Ok(scene)
    }

    /// How many frames a file of atoms has: it is read to its end. `None` for other files.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn count(&mut self) -> Result<Option<u64>, SceneErrors> {
        let Some(format) = Format::of(&self.path) else { return Ok(None) };
        let trajectory = Trajectory::open(&self.path, format, Columns::default(), false);
        let count = trajectory.and_then(|mut trajectory| trajectory.count());
        count.map(Some).map_err(|error| SceneErrors::from(*error))
    }

    fn read(&mut self, frame: i64) -> Result<Draft, SceneErrors> {
        self.store.pictures.turn();
        self.store.trajectories.turn();
        let path = self.path.as_path();
        let mut draft = if let Some(format) = Format::of(path) {
            particles::scene::read(path, format, &self.look, frame, &mut self.store)?
        } else {
            let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
            match extension.as_deref() {
                Some("toml") => toml::load(path, frame, &mut self.store)?,
                Some("nff" | "gz") => Draft { scene: nff::load(path)?, cameras: Vec::new() },
                _ => {
                    let rule = format!(
                        "a scene file must end in .toml, .nff or .nff.gz, or as atoms do: {}",
                        Format::endings()
                    );
                    return Err(SceneError::of_file(path, rule, "").into());
                }
            }
        };
        if let Some((width, height)) = self.resolution {
            let first = ImageSettings { width, height, spp: SPP, filter: Filter::default() };
            let image = draft.scene.image.take().unwrap_or(first);
            draft.scene.image = Some(ImageSettings { width, height, ..image });
        }
        Ok(draft)
    }

    /// Puts cameras without a place where they see all of the first frame, then turns those that orbit.
    fn place(&mut self, scene: &mut Scene, cameras: &[OpenCamera], frame: i64) -> Result<(), SceneErrors> {
        if self.views.is_none() && cameras.iter().any(|camera| camera.framed) {
            self.views = Some(match frame {
                1 => views(scene, cameras, self.resolution),
                _ => {
                    let first = self.read(1)?;
                    views(&first.scene, &first.cameras, self.resolution)
                }
            });
        }
        settle(scene, cameras, self.views.as_deref().unwrap_or_default());
        Ok(())
    }
}

impl Draft {
    /// The scene, for one that is read at its first frame alone.
    pub fn finish(mut self) -> Scene {
        let views = views(&self.scene, &self.cameras, None);
        settle(&mut self.scene, &self.cameras, &views);
        self.scene
    }
}

/// The views of all framed cameras in order.
fn views(scene: &Scene, cameras: &[OpenCamera], resolution: Option<(u32, u32)>) -> Vec<fit::View> {
    let size = resolution.or(scene.image.as_ref().map(|image| (image.width, image.height)));
    let aspect = size.map_or(4.0 / 3.0, |(width, height)| f64::from(width) / f64::from(height));
    let framed = cameras.iter().filter(|camera| camera.framed);
    framed.map(|open| fit::view(scene, &scene.cameras[open.index], aspect, open.orbit.is_some())).collect()
}

fn settle(scene: &mut Scene, cameras: &[OpenCamera], views: &[fit::View]) {
    let mut views = views.iter();
    for open in cameras {
        let camera = &mut scene.cameras[open.index];
        if let Some(view) = open.framed.then(|| views.next()).flatten() {
            (camera.eye, camera.target) = (view.eye, view.target);
        }
        if let Some(angle) = open.orbit {
            camera.eye = camera.orbited(angle);
        }
    }
}
