//! The names behind Cryptomatte ids, from a header or the file that it names.
//!
//! What is missing or unsound leaves a Cryptomatte without names, which harms no pixel.

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

/// All Cryptomattes of a file, by their names.
pub(super) fn read(headers: &[Header], directory: &Path) -> Vec<Cryptomatte> {
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
    found.into_values().filter_map(|fields| fields.matte(directory)).collect()
}

#[derive(Default)]
struct Fields {
    name: Option<String>,
    manifest: Option<String>,
    file: Option<String>,
}

impl Fields {
    fn matte(self, directory: &Path) -> Option<Cryptomatte> {
        let beside = || read_beside(directory, self.file.as_deref()?);
        let json = self.manifest.clone().or_else(beside).unwrap_or_default();
        Some(Cryptomatte { manifest: names(&json), name: self.name? })
    }
}

/// A file that lies beside the picture or below: no other is opened.
fn read_beside(directory: &Path, name: &str) -> Option<String> {
    let path = Path::new(name);
    if !path.components().all(|part| matches!(part, Component::Normal(_))) {
        return None;
    }
    let file = File::open(directory.join(path)).ok()?;
    if !file.metadata().ok()?.is_file() {
        return None;
    }
    let mut text = String::new();
    file.take(MOST_BYTES).read_to_string(&mut text).ok()?;
    Some(text)
}

fn names(json: &str) -> BTreeMap<String, u32> {
    let names: BTreeMap<String, String> = serde_json::from_str(json).unwrap_or_default();
    names.into_iter().filter_map(|(name, id)| Some((name, u32::from_str_radix(&id, 16).ok()?))).collect()
}
