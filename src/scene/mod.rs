//! What the user wrote: every quantity in f64, every thing by name or index, in world coordinates.
//!
//! This room answers for the data of a scene, for reading it ([`Scene::load`]) and for
//! the rules that a valid scene keeps. It leaves to others what a render makes of it: both tracers,
//! the packet engine and the reference, start from the same [`Scene`] and share nothing else but
//! the sampler. Group transforms are applied when a scene is read, so all geometry here is in world
//! coordinates. What each part means for the picture is said beside its type, once, for both.

mod animation;
mod background;
mod between;
mod camera;
mod cloud;
pub mod cloud_file;
pub mod error;
mod fit;
mod frames;
mod hash;
mod image;
pub mod inputs;
mod layers;
mod light;
mod material;
mod motion;
pub mod nff;
mod objects;
pub mod particles;
pub mod pattern;
pub(crate) mod picture_file;
pub mod rules;
mod shape;
mod sky;
pub(crate) mod split;
mod texture;
mod toml;
pub mod write;

use std::borrow::Cow;
use std::path::Path;

use glam::DVec3;

pub use self::animation::{Interpolation, Part, Track};
pub use self::background::{Backdrop, Background};
pub use self::camera::{Camera, Lens};
pub use self::cloud::{Cloud, CloudMaterial, CloudShapes, Rows};
pub use self::error::{Place, SceneError, SceneErrors, Warning};
pub(crate) use self::fit::bound as bounding_balls;
pub use self::frames::Frames;
pub use self::hash::SceneSum;
pub use self::image::{Filter, FilterKind, FilterTable, ImageSettings, Integrator, RenderSettings};
pub use self::layers::{Aov, Layers, UnknownAov};
pub use self::light::{Emitter, Falloff, Light, Patches, Source, frame};
pub use self::material::{Material, Model, Paint, Visible};
pub use self::motion::carried;
pub use self::objects::Objects;
pub use self::shape::{Cone, Cuboid, Cylinder, Disk, Plane, Polygon, Shape, Sphere, basis};
pub use self::sky::Sky;
pub use self::texture::{Checker, ColorSpace, ImageTexture, Texel, Texture, TextureFilter, TextureKind, Wrap};

/// A whole scene: geometry, materials, lights, cameras and the settings of its picture.
///
/// A value made by a reader keeps all rules of the format; one made by hand is checked by
/// the plan before anything is traced.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Size, samples and filter of the picture; absent where a scene is only queried.
    pub image: Option<ImageSettings>,
    /// Layers beside the colour.
    pub layers: Layers,
    /// Integrator, depth and seed.
    pub render: RenderSettings,
    /// All cameras in file order; the first is the default one. May be empty.
    pub cameras: Vec<Camera>,
    /// What a ray sees that meets nothing.
    pub background: Background,
    /// Ambient light, linear Rec. 709: each hit adds (its material's diffuse albedo) x this.
    pub ambient: DVec3,
    /// Textures, by the index that [`Paint::Texture`] holds.
    pub textures: Vec<Texture>,
    /// Materials in order of appearance: the material index of hits and of AOVs.
    pub materials: Vec<Material>,
    /// Lights in file order.
    pub lights: Vec<Light>,
    /// Single shapes in file order: primitives `0..objects.len()`.
    pub objects: Vec<Object>,
    /// Clouds in file order; their rows follow the objects in the numbering of primitives.
    pub clouds: Vec<Cloud>,
    /// Names of the groups; an object or cloud refers to one by index.
    pub groups: Vec<String>,
    /// Values over time: what the file said of those that this scene has at one frame.
    pub tracks: Vec<Track>,
    /// What the reader mended or left out.
    pub warnings: Vec<Warning>,
}

/// One shape with its material: a primitive of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Geometry, world coordinates.
    pub shape: Shape,
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// What the user called it; `None` reads as "sphere 17", kind and primitive index.
    pub name: Option<String>,
    /// Index into [`Scene::groups`].
    pub group: Option<usize>,
}

/// One primitive of a scene, whichever way it was written.
#[derive(Debug, Clone)]
pub struct Primitive<'a> {
    /// Geometry, world coordinates, f64; made on the fly for rows of a cloud.
    pub shape: Cow<'a, Shape>,
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// Factor on the material's colour (white but in clouds with `colors`).
    pub color: DVec3,
}

/// The JSON Schema (draft 2020-12) of scene files, by which editors complete and check them.
pub const SCHEMA: &str = include_str!("schema.json");

impl Scene {
    /// Reads a scene file, its kind by its extension: `.toml` with all files that it names, `.nff`, `.nff.gz`, or a
    /// file of atoms ([`particles::Format`]), which gets a camera, lights and a background. What is animated is read
    /// at frame 1.
    ///
    /// # Errors
    /// All mistakes of all files; each with its place.
    pub fn load(path: impl AsRef<Path>) -> Result<Scene, SceneErrors> {
        Scene::load_frame(path, 1)
    }

    /// Reads a scene file at a frame; [`Frames`] reads several of one file, and common parts once.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn load_frame(path: impl AsRef<Path>, frame: i64) -> Result<Scene, SceneErrors> {
        Frames::new(path).scene(frame)
    }

    /// Reads a scene in TOML; its relative paths start at `base_dir`.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn from_toml(text: &str, base_dir: &Path) -> Result<Scene, SceneErrors> {
        toml::from_text(text, base_dir).map(frames::Draft::finish)
    }

    /// How many primitives the scene has: objects, then the rows of each cloud.
    pub fn primitive_count(&self) -> usize {
        self.objects.len() + self.clouds.iter().map(Cloud::len).sum::<usize>()
    }

    /// The primitive of an index, or `None` past the last one.
    pub fn primitive(&self, index: usize) -> Option<Primitive<'_>> {
        if let Some(object) = self.objects.get(index) {
            return Some(object.primitive());
        }
        let mut row = index - self.objects.len();
        for cloud in &self.clouds {
            if row < cloud.len() {
                return Some(cloud.primitive(row));
            }
            row -= cloud.len();
        }
        None
    }

    /// All primitives in the order of their indices.
    pub fn primitives(&self) -> impl Iterator<Item = Primitive<'_>> {
        let objects = self.objects.iter().map(Object::primitive);
        let rows = self.clouds.iter().flat_map(|cloud| (0..cloud.len()).map(move |row| cloud.primitive(row)));
        objects.chain(rows)
    }

    /// The clouds, each with the index of its first primitive.
    pub fn clouds_from(&self) -> impl Iterator<Item = (usize, &Cloud)> {
        self.clouds.iter().scan(self.objects.len(), |next, cloud| {
            let first = *next;
            *next += cloud.len();
            Some((first, cloud))
        })
    }

    /// The name of a primitive: the user's, the cloud's, or its kind and index ("sphere 17").
    pub fn primitive_name(&self, index: usize) -> Option<String> {
        let primitive = self.primitive(index)?;
        let given = match self.objects.get(index) {
            Some(object) => object.name.clone(),
            None => self.cloud_of(index).and_then(|cloud| cloud.name.clone()),
        };
        Some(given.unwrap_or_else(|| format!("{} {index}", primitive.shape.kind())))
    }

    /// Factor on the colour of a primitive's material: white but in clouds with `colors`.
    pub fn color_factor(&self, index: usize) -> DVec3 {
        let Some(mut row) = index.checked_sub(self.objects.len()) else { return DVec3::ONE };
        for cloud in &self.clouds {
            if row < cloud.len() {
                return cloud.color(row);
            }
            row -= cloud.len();
        }
        DVec3::ONE
    }

    /// The camera of a name, or the first one where no name is given.
    pub fn camera(&self, name: Option<&str>) -> Option<&Camera> {
        match name {
            None => self.cameras.first(),
            Some(name) => self.cameras.iter().find(|camera| camera.name.as_deref() == Some(name)),
        }
    }

    /// Materials that some primitive shows, their backs among them, in order.
    pub fn used_materials(&self) -> Vec<usize> {
        let mut used = vec![false; self.materials.len()];
        self.objects.iter().for_each(|object| used[object.material] = true);
        for cloud in &self.clouds {
            match &cloud.material {
                CloudMaterial::One(material) => used[*material] = true,
                CloudMaterial::Each(materials) => materials.iter().for_each(|material| used[*material as usize] = true),
            }
        }
        let backs: Vec<usize> = (0..used.len()).filter(|i| used[*i]).filter_map(|i| self.materials[i].back).collect();
        backs.into_iter().for_each(|back| used[back] = true);
        (0..used.len()).filter(|i| used[*i]).collect()
    }

    /// By texture: whether some primitive shows it.
    pub fn used_textures(&self) -> Vec<bool> {
        let mut used = vec![false; self.textures.len()];
        for material in self.used_materials() {
            if let Paint::Texture(index) = self.materials[material].model.paint() {
                used[index] = true;
            }
        }
        used
    }

    fn cloud_of(&self, index: usize) -> Option<&Cloud> {
        let mut row = index.checked_sub(self.objects.len())?;
        self.clouds.iter().find(|cloud| {
            let inside = row < cloud.len();
            row = row.wrapping_sub(cloud.len());
            inside
        })
    }
}

impl Object {
    pub(crate) fn primitive(&self) -> Primitive<'_> {
        Primitive { shape: Cow::Borrowed(&self.shape), material: self.material, color: DVec3::ONE }
    }
}
