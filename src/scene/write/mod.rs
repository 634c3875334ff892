//! A scene as text: TOML that reads back as the same scene, to the last bit of every number.
//!
//! Shapes are written in world coordinates, as they are kept, so groups stay as names without a
//! transform. Rows of clouds go to `.npy` files beside the scene, in the precision they have; textures
//! are referred to by path. Keys whose value is the usual one are left out where that reads better.
//!
//! Values over time are written as keys, as the scene's tracks have them. Those of groups and of what is moved by
//! them, of points in lists and of clouds stay as they are at the frame for which the scene was read.
//!
//! A cloud of boxes that a group has turned has no key for its rotation. It is written as single boxes,
//! and so are the rows of all clouds before it, or the indices of primitives would change.

mod cloud;
mod links;
mod settings;
mod shape;
mod text;

use std::io::{self, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use self::text::Table;
use super::{Part, Scene};

/// Writes a scene to `file` and its clouds beside it, as `NAME_cloud1.npy`, `NAME_cloud1_materials.npy`,
/// ... where NAME is that of `file` without its ending.
///
/// # Errors
/// What the file system says, and those of [`to_toml`]. No file is ever left half-written; the scene
/// itself is the last one to appear.
pub fn save(scene: &Scene, file: &Path) -> io::Result<()> {
    let text = to_toml(scene, file)?;
    let single = cloud::written_singly(scene);
    for (i, cloud) in scene.clouds.iter().enumerate().skip(single) {
        cloud::save(cloud, &cloud::Files::new(file, i)?)?;
    }
    replace(file, |out| out.write_all(text.as_bytes()))
}

/// The text of a scene that is to stand in `file`, which decides the names of cloud files and of paths.
/// Nothing is written.
///
/// # Errors
/// `InvalidInput` for a scene made by hand whose indices lead nowhere or whose names are given twice. `Unsupported` for what scene
/// files cannot say: a path that is not Unicode, colours of rows that must be written as single shapes.
pub fn to_toml(scene: &Scene, file: &Path) -> io::Result<String> {
    links::check(scene)?;
    let mut text = "format = 1\n".to_owned();
    let mut add = |table: Table| text.push_str(&table.finish());
    settings::all(scene, file, &mut add)?;
    for (index, object) in scene.objects.iter().enumerate() {
        add(shape::object(scene, object).over_time(scene, Part::Shape(index)));
    }
    let single = cloud::written_singly(scene);
    for cloud in &scene.clouds[..single] {
        for object in cloud::objects(cloud)? {
            add(shape::object(scene, &object));
        }
    }
    for (i, cloud) in scene.clouds.iter().enumerate().skip(single) {
        add(cloud::table(scene, cloud, &cloud::Files::new(file, i)?)?);
    }
    Ok(text)
}

/// Writes a file aside and puts it in its place when it is complete.
fn replace(file: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let aside = NamedTempFile::new_in(text::folder(file))?;
    let mut out = io::BufWriter::new(&aside);
    write(&mut out)?;
    out.flush()?;
    drop(out);
    aside.persist(file)?;
    Ok(())
}

#[cfg(test)]
mod tests;
