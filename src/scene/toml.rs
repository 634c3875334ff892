//! Scenes in TOML: octray's own format.
//!
//! A load goes through three steps: [`files`] reads and parses a file and those it includes, the modules
//! of each part of the format read their tables of all files in merge order, and what is left over is
//! reported. Parts go by name first (groups, textures, materials), so that a name may be used before
//! the line that gives it. All mistakes of all files come back together.

mod clouds;
mod files;
mod groups;
mod keyed;
mod lights;
mod looks;
mod names;
mod particles;
mod settings;
mod shapes;
mod table;
mod values;

use std::path::Path;

use self::files::Texts;
use self::groups::Transform;
use self::names::Names;
use self::table::{Context, Item, Table};
use self::values::NamedFile;
use crate::scene::frames::{Draft, OpenCamera, Store};
use crate::scene::{Object, Part, Scene, SceneErrors, Shape, Track};

/// Keys of single parts that a scene keeps in another form: what is in lists or tables, and what has two forms.
const CHANGED: &[&str] = &["corners", "uvs", "normals", "colors", "axis", "angle", "quaternion", "offset", "size"];

/// Reads a scene file and all that it names at a frame.
///
/// # Errors
/// Every rule that any of the files breaks.
pub(super) fn load(path: &Path, frame: i64, store: &mut Store) -> Result<Draft, SceneErrors> {
    read(frame, store, |texts| texts.load(path))
}

/// Reads a scene from text; its relative paths start at `base_dir`.
///
/// # Errors
/// As [`load`]; places in the text are in a file named `<text>`.
pub(super) fn from_text(text: &str, base_dir: &Path) -> Result<Draft, SceneErrors> {
    read(1, &mut Store::default(), |texts| texts.add(Path::new("<text>"), base_dir, text))
}

fn read(frame: i64, store: &mut Store, start: impl FnOnce(&mut Texts)) -> Result<Draft, SceneErrors> {
    let mut texts = Texts::new(frame);
    start(&mut texts);
    let files = texts.parse();
    let roots = files.iter().map(|file| Context { file, log: &texts.log }.root());
    let draft = Reader::new(roots.collect(), store).draft();
    drop(files);
    let (errors, warnings) = texts.log.into_parts();
    let Draft { scene, cameras } = draft;
    if errors.is_empty() { Ok(Draft { scene: Scene { warnings, ..scene }, cameras }) } else { Err(errors) }
}

/// What is known of a scene while its files are read.
struct Reader<'a, 's> {
    /// The top-level tables in merge order.
    roots: Vec<Table<'a>>,
    materials: Names,
    textures: Names,
    groups: Names,
    transforms: Vec<Transform>,
    store: &'s mut Store,
    scene: Scene,
    /// Pictures of textures that are decoded when it is known which of them are shown.
    pictures: Vec<(usize, Item<'a>, NamedFile)>,
    /// Cameras that are placed when all of the scene is known.
    cameras: Vec<OpenCamera>,
}

impl<'a, 's> Reader<'a, 's> {
    fn new(roots: Vec<Table<'a>>, store: &'s mut Store) -> Self {
        Reader {
            roots,
            materials: Names::new("material"),
            textures: Names::new("texture"),
            groups: Names::new("group"),
            transforms: Vec::new(),
            store,
            scene: Scene::default(),
            pictures: Vec::new(),
            cameras: Vec::new(),
        }
    }

    /// The scene, which counts only if nothing was noted in the log.
    fn draft(mut self) -> Draft {
        for root in &self.roots {
            read_format(root);
            root.has("include");
        }
        self.read_settings();
        self.read_groups();
        self.read_looks();
        self.read_lights();
        self.read_shapes();
        self.read_clouds();
        self.read_pictures();
        for root in std::mem::take(&mut self.roots) {
            root.finish();
        }
        self.scene.groups = self.groups.into_list();
        Draft { scene: self.scene, cameras: self.cameras }
    }

    /// Ends the reading of a part: the values over time since the last one are its own, if it keeps them as they are
    /// written.
    fn claim(&mut self, part: Option<Part>) {
        let tracks = self.roots.first().map(|root| root.context.log.take_tracks()).unwrap_or_default();
        self.scene.tracks.extend(tracks.into_iter().map(|track| {
            let is_box = matches!(part, Some(Part::Shape(last)) if self.scene.objects.get(last).is_some_and(is_box));
            let changed = CHANGED.contains(&track.key) || is_box && track.key == "center";
            Track { part: part.filter(|_| !changed), ..track }
        }));
    }

    /// The tables of `[[key]]` of all files.
    fn tables(&self, key: &'static str, what: &'static str) -> Vec<Table<'a>> {
        self.roots.iter().flat_map(|root| root.tables(key, what)).collect()
    }

    /// The table `[key]`, which one file alone may give.
    fn single(&self, key: &'static str) -> Option<Table<'a>> {
        let items: Vec<Item<'a>> = self.roots.iter().filter_map(|root| root.item(key)).collect();
        let (first, rest) = items.split_first()?;
        for item in rest {
            let help = format!("the first one is at {}", first.context.place(&first.span));
            item.context.fail_with_help(&item.span, format!("[{key}] is given twice"), help);
        }
        first.table()
    }

    /// The group that a shape or cloud names, with its transform.
    fn group(&self, table: &Table<'a>) -> Option<(Option<usize>, Transform)> {
        let group = table.maybe("group", |item| self.groups.find(item))?;
        let transform = group.and_then(|group| self.transforms.get(group)).copied();
        Some((group, transform.unwrap_or_default()))
    }
}

fn is_box(object: &Object) -> bool {
    matches!(object.shape, Shape::Box(_))
}

/// The format that this version reads is 1, which a file without the key has.
fn read_format(root: &Table<'_>) {
    let Some(item) = root.item("format") else { return };
    if item.value.as_integer().is_none_or(|format| format.as_str() != "1") {
        item.wrong::<()>("must be 1, the only one that this version reads");
    }
}

impl<'a> Context<'a> {
    fn root(self) -> Table<'a> {
        let mut root = Table::new(self, "a scene file", &self.file.root, 0..0);
        root.owner = "";
        root
    }
}
