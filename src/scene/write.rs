//! A scene as text: TOML that reads back as the same scene, to the last bit of every number.
//!
//! Defaults are left out where they are the usual case, all else is said. Shapes are written in world
//! coordinates, as they are kept; groups stay as names. Rows of clouds go to `.npy` files beside the
//! scene, in the precision that they have; textures are referred to by path.

mod cloud;
mod text;

use std::io::{self, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use self::text::{Table, color, number, paint, path, quoted, vector};
use super::{
    Backdrop, Camera, ColorSpace, Falloff, FilterKind, ImageTexture, Integrator, Lens, Light, Material, Model, Object,
    Scene, Shape, Source, Texture, TextureFilter, TextureKind, Visible, Wrap,
};

/// Writes a scene to `file` and its clouds beside it, as `NAME_cloud1.npy`, `NAME_cloud1_materials.npy`, ...
/// where NAME is that of `file`.
///
/// # Errors
/// What the file system says, and `Unsupported` for a scene that [`to_toml`] cannot write. No file is ever
/// left half-written; the scene itself is the last one to appear.
pub fn save(scene: &Scene, file: &Path) -> io::Result<()> {
    let text = to_toml(scene, file)?;
    for (i, cloud) in scene.clouds.iter().enumerate() {
        cloud::save(cloud, &CloudNames::new(file, i), folder(file))?;
    }
    replace(file, |out| out.write_all(text.as_bytes()))
}
