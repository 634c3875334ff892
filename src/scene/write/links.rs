//! Whether every index in a scene leads somewhere and every name to one thing, so that all else may follow them.

use std::collections::HashSet;
use std::io;

use crate::scene::{Cloud, CloudMaterial, CloudShapes, Paint, Scene};

/// Fails with `InvalidInput` at the first index that leads nowhere, or name that leads to two things.
pub(super) fn check(scene: &Scene) -> io::Result<()> {
    unlike("material", scene.materials.iter().map(|material| material.name.as_str()))?;
    unlike("texture", scene.textures.iter().map(|texture| texture.name.as_str()))?;
    unlike("group", scene.groups.iter().map(String::as_str))?;
    if scene.cameras.len() > 1 {
        unlike("camera", scene.cameras.iter().map(|camera| camera.name.as_deref().unwrap_or_default()))?;
        if scene.cameras.iter().any(|camera| camera.name.is_none()) {
            return Err(invalid("where there are several cameras, each must have a name".to_owned()));
        }
    }
    let material = |index| within("material", index, scene.materials.len());
    let group = |index: Option<usize>| index.map_or(Ok(()), |index| within("group", index, scene.groups.len()));
    for named in &scene.materials {
        if let Paint::Texture(index) = named.model.paint() {
            within("texture", index, scene.textures.len())?;
        }
        named.back.map_or(Ok(()), material)?;
    }
    for object in &scene.objects {
        material(object.material)?;
        group(object.group)?;
    }
    for cloud in &scene.clouds {
        match &cloud.material {
            CloudMaterial::One(index) => material(*index)?,
            CloudMaterial::Each(all) => {
                rows("materials", cloud, all.len())?;
                all.iter().try_for_each(|index| material(*index as usize))?;
            }
        }
        cloud.colors.as_ref().map_or(Ok(()), |colors| rows("colours", cloud, colors.len()))?;
        group(cloud.group)?;
        corners(cloud)?;
    }
    Ok(())
}

fn unlike<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> io::Result<()> {
    let mut seen = HashSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(invalid(format!("the scene has two {what}s of the name {name:?}")));
        }
    }
    Ok(())
}

fn within(what: &str, index: usize, count: usize) -> io::Result<()> {
    if index < count { Ok(()) } else { Err(invalid(format!("the scene has no {what} {index}, only {count} of them"))) }
}

fn rows(what: &str, cloud: &Cloud, count: usize) -> io::Result<()> {
    let rows = cloud.len();
    if count == rows { Ok(()) } else { Err(invalid(format!("a cloud of {rows} rows has {count} {what}"))) }
}

/// Polygons take all corners, one after the other.
fn corners(cloud: &Cloud) -> io::Result<()> {
    let CloudShapes::Polygons { corners, starts } = &cloud.shapes else { return Ok(()) };
    let last = starts.last().map_or(0, |start| *start as usize);
    if starts.first().is_none_or(|start| *start == 0) && starts.is_sorted() && last == corners.len() {
        return Ok(());
    }
    Err(invalid(format!("a cloud of {} corners has polygons that do not start and end in them", corners.len())))
}

fn invalid(why: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, why)
}
