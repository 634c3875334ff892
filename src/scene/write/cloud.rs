//! Clouds: a table in the scene and arrays in files beside it.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

use npyz::{AutoSerialize, WriterBuilder};

use super::text::{Table, list, path, quoted, unsupported};
use crate::scene::{Cloud, CloudMaterial, CloudShapes, Object, Primitive, Rows, Scene};

/// The files of one cloud; which of them exist depends on the cloud.
#[derive(Debug)]
pub(super) struct Files {
    scene: PathBuf,
    stem: OsString,
}

impl Files {
    /// Of cloud `index` (from 0) of the scene in `scene`.
    pub fn new(scene: &Path, index: usize) -> io::Result<Self> {
        let no_name = || io::Error::new(io::ErrorKind::InvalidInput, format!("{} names no file", scene.display()));
        let mut stem = scene.file_stem().ok_or_else(no_name)?.to_owned();
        stem.push(format!("_cloud{}", index + 1));
        Ok(Files { scene: scene.to_owned(), stem })
    }

    fn file(&self, what: &str) -> PathBuf {
        let mut name = self.stem.clone();
        name.push(format!("{what}.npy"));
        self.scene.with_file_name(name)
    }

    fn named(&self, what: &str) -> io::Result<String> {
        path(&self.file(what), &self.scene)
    }
}

const ROWS: &str = "";
const SIZES: &str = "_sizes";
const COLORS: &str = "_colors";
const MATERIALS: &str = "_materials";

/// How many clouds, from the first one, are written as single shapes.
pub(super) fn written_singly(scene: &Scene) -> usize {
    let turned = |cloud: &Cloud| matches!(&cloud.shapes, CloudShapes::Boxes(_, Some(_)));
    scene.clouds.iter().rposition(turned).map_or(0, |last| last + 1)
}

/// The rows of a cloud as single shapes.
pub(super) fn objects(cloud: &Cloud) -> io::Result<impl Iterator<Item = Object>> {
    if cloud.colors.is_some() {
        let why = "a scene file has no key for the colours of a cloud with or before one of turned boxes";
        return Err(unsupported(why.to_owned()));
    }
    Ok((0..cloud.len()).map(|row| {
        let Primitive { shape, material, .. } = cloud.primitive(row);
        Object { shape: shape.into_owned(), material, name: cloud.name.clone(), group: cloud.group }
    }))
}

pub(super) fn table(scene: &Scene, cloud: &Cloud, files: &Files) -> io::Result<Table> {
    let kind = match &cloud.shapes {
        CloudShapes::Spheres(_) => "spheres",
        CloudShapes::Disks(_) => "disks",
        CloudShapes::Boxes(..) => "boxes",
        CloudShapes::Cylinders(..) => "cylinders",
        CloudShapes::Polygons { .. } => "polygons",
    };
    let mut table = Table::one_of("clouds").set("type", quoted(kind)).set("file", files.named(ROWS)?);
    if let CloudShapes::Polygons { .. } = &cloud.shapes {
        table = table.set("sizes", files.named(SIZES)?);
    }
    if let CloudShapes::Cylinders(_, false) = &cloud.shapes {
        table = table.set("caps", false);
    }
    table = match &cloud.material {
        CloudMaterial::One(material) => table.set("material", quoted(&scene.materials[*material].name)),
        CloudMaterial::Each(_) => {
            let names = list(scene.materials.iter().map(|material| quoted(&material.name)));
            table.set("material", names).set("materials", files.named(MATERIALS)?)
        }
    };
    if cloud.colors.is_some() {
        table = table.set("colors", files.named(COLORS)?);
    }
    let group = cloud.group.map(|group| quoted(&scene.groups[group]));
    Ok(table.set_some("name", cloud.name.as_deref().map(quoted)).set_some("group", group))
}

/// Writes all files of a cloud.
pub(super) fn save(cloud: &Cloud, files: &Files) -> io::Result<()> {
    match &cloud.shapes {
        CloudShapes::Spheres(rows) => save_rows(rows, files),
        CloudShapes::Disks(rows) => save_rows(rows, files),
        CloudShapes::Boxes(rows, _) => save_rows(rows, files),
        CloudShapes::Cylinders(rows, _) => save_rows(rows, files),
        CloudShapes::Polygons { corners, starts } => {
            let sizes: Vec<u32> = starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
            save_array(&files.file(SIZES), &[sizes.len()], &sizes)?;
            save_rows(corners, files)
        }
    }?;
    if let CloudMaterial::Each(materials) = &cloud.material {
        save_array(&files.file(MATERIALS), &[materials.len()], materials)?;
    }
    match &cloud.colors {
        Some(colors) => save_array(&files.file(COLORS), &[colors.len(), 3], colors.as_flattened()),
        None => Ok(()),
    }
}

fn save_rows<const N: usize>(rows: &Rows<N>, files: &Files) -> io::Result<()> {
    let (file, shape) = (files.file(ROWS), [rows.len(), N]);
    match rows {
        Rows::F32(rows) => save_array(&file, &shape, rows.as_flattened()),
        Rows::F64(rows) => save_array(&file, &shape, rows.as_flattened()),
    }
}

fn save_array<T: AutoSerialize + Copy>(file: &Path, shape: &[usize], values: &[T]) -> io::Result<()> {
    let shape: Vec<u64> = shape.iter().map(|&side| side as u64).collect();
    super::replace(file, |out| {
        let mut array = npyz::WriteOptions::new().default_dtype().shape(&shape).writer(out).begin_nd()?;
        array.extend(values.iter().copied())?;
        array.finish()
    })
}
