//! The names behind Cryptomatte ids, from a header or the file that it names.
//!
//! What is missing or unsound leaves a Cryptomatte without names, which harms no pixel, and is told.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path};

use exr::meta::attribute::AttributeValue;
use exr::meta::header::Header;

use crate::film::Cryptomatte;
use crate::output::exr::is_about_mattes;

/// Bytes of the largest manifest that is read beside a picture: some ten million names.
const MOST_BYTES: u64 = 1 << 30;

/// All Cryptomattes of a file, by their names; what is wrong with their manifests is added to `faults`.
pub(super) fn read(headers: &[Header], directory: &Path, faults: &mut Vec<String>) -> Vec<Cryptomatte> {
    let mut found: BTreeMap<String, Fields> = BTreeMap::new();
    for (name, value) in headers.iter().flat_map(|header| &header.own_attributes.other) {
        let (AttributeValue::Text(value), true) = (value, is_about_mattes(name.as_slice())) else { continue };
        let name = String::from_utf8_lossy(name.as_slice()).into_owned();
        let Some((key, field)) = name.rsplit_once('/') else { continue };
        let fields = found.entry(key.to_owned()).or_default();
        let value = Some(String::from_utf8_lossy(value.as_slice()).into_owned());
        match field {
            "name" => fields.name = value,
            "manifest" => fields.manifest = value,
            "manif_file" => fields.file = value,
            _ => {}
        }
    }
    let mut matte = |fields: Fields| {
        let name = fields.name.clone()?;
        let manifest = fields.names(directory).unwrap_or_else(|fault| {
            faults.push(format!("the names of {name} are missing: {fault}"));
            BTreeMap::new()
        });
        Some(Cryptomatte { name, manifest })
    };
    found.into_values().filter_map(&mut matte).collect()
}

#[derive(Default)]
struct Fields {
    name: Option<String>,
    manifest: Option<String>,
    file: Option<String>,
}

impl Fields {
    fn names(self, directory: &Path) -> Result<BTreeMap<String, u32>, String> {
        if let Some(json) = &self.manifest {
            return names(json).ok_or_else(|| "the manifest in its header is no list of names and ids".to_owned());
        }
        let Some(file) = &self.file else { return Err("it has no manifest".to_owned()) };
        let json = read_beside(directory, file).map_err(|why| format!("its manifest {file} {why}"))?;
        names(&json).ok_or_else(|| format!("its manifest {file} is no list of names and ids"))
    }
}

/// A file that lies beside the picture or below: no other is opened.
fn read_beside(directory: &Path, name: &str) -> Result<String, String> {
    let path = Path::new(name);
    if !path.components().all(|part| matches!(part, Component::Normal(_))) {
        return Err("does not lie beside it".to_owned());
    }
    let read = || {
        let file = File::open(directory.join(path))?;
        if !file.metadata()?.is_file() {
            return Err(std::io::Error::other("it is no regular file"));
        }
        let mut text = String::new();
        file.take(MOST_BYTES).read_to_string(&mut text)?;
        Ok(text)
    };
    read().map_err(|error| format!("cannot be read: {error}"))
}

fn names(json: &str) -> Option<BTreeMap<String, u32>> {
    let names: BTreeMap<String, String> = serde_json::from_str(json).ok()?;
    names.into_iter().map(|(name, id)| Some((name, u32::from_str_radix(&id, 16).ok()?))).collect()
}
