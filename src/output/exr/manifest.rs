//! The metadata of Cryptomattes: which name has which id, inside the file or beside it.
//!
//! Source: Psyop, "Cryptomatte specification", version 1.2.0: `cryptomatte/KEY/name`, `hash`, `conversion`, and
//! `manifest` or `manif_file`. A manifest is JSON, names in raw UTF-8: readers do not all know `\u` escapes.

use super::layout::Part;
use crate::film::Cryptomatte;

/// Manifests longer than this stand in a file of their own: long headers make compositors slow.
const MOST_BYTES: usize = 1 << 20;

const PREFIX: &str = "cryptomatte/";

/// A manifest and where it stands.
#[derive(Debug)]
pub(super) struct Manifest<'a> {
    matte: &'a Cryptomatte,
    json: String,
    /// The file that holds it, if the header does not.
    file: Option<String>,
}

/// Bytes that belong into a file beside the picture's, under this name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Beside {
    /// A name without a directory: `shot.0001.crypto_object.json`.
    pub name: String,
    /// What the file holds.
    pub bytes: Vec<u8>,
}

/// The manifests of a picture's Cryptomattes. `stem` is the name of its file without extension, after which files beside it are
/// named; without one, all stand inside.
pub(super) fn manifests<'a>(mattes: &'a [Cryptomatte], beside: bool, stem: Option<&str>) -> Vec<Manifest<'a>> {
    let one = |matte: &'a Cryptomatte| {
        let json = json(matte);
        let file = stem.filter(|_| beside || json.len() > MOST_BYTES);
        Manifest { matte, json, file: file.map(|stem| format!("{stem}.{}.json", matte.name)) }
    };
    mattes.iter().map(one).collect()
}

/// Whether an attribute of this name is of a Cryptomatte.
pub(in crate::output) fn is_about(name: &[u8]) -> bool {
    name.starts_with(PREFIX.as_bytes())
}

impl Manifest<'_> {
    /// Whether the channels of the part are what it names.
    pub fn is_of(&self, part: &Part) -> bool {
        let prefix = self.matte.name.as_str();
        let is_rank = |name: &str| {
            let rank = name.strip_prefix(prefix).and_then(|rest| rest.split_once('.'));
            rank.is_some_and(|(rank, _)| !rank.is_empty() && rank.bytes().all(|digit| digit.is_ascii_digit()))
        };
        part.channels.iter().any(|channel| is_rank(&channel.name))
    }

    pub fn attributes(&self) -> impl Iterator<Item = (String, String)> {
        let key = self.matte.key();
        let where_to = match &self.file {
            Some(file) => ("manif_file", file.clone()),
            None => ("manifest", self.json.clone()),
        };
        let all = [
            ("name", self.matte.name.clone()),
            ("hash", "MurmurHash3_32".to_owned()),
            ("conversion", "uint32_to_float32".to_owned()),
            where_to,
        ];
        all.into_iter().map(move |(name, value)| (format!("{PREFIX}{key}/{name}"), value))
    }

    pub fn beside(self) -> Option<Beside> {
        let name = self.file?;
        Some(Beside { name, bytes: self.json.into_bytes() })
    }
}

fn json(matte: &Cryptomatte) -> String {
    let mut json = String::from("{");
    for (index, (name, id)) in matte.manifest.iter().enumerate() {
        if index > 0 {
            json.push(',');
        }
        json.push_str(&quoted(name));
        json.push_str(&format!(":\"{id:08x}\""));
    }
    json.push('}');
    json
}

/// A JSON string in which only what must be is escaped: `"`, `\`, and control characters.
fn quoted(name: &str) -> String {
    // The crate escapes exactly these, and leaves all else as it is.
    serde_json::Value::from(name).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn manifests_are_raw_utf_8_with_eight_digits() {
        let manifest = [("ball \"a\\b\"\n", 1u32), ("равнина", 0x9623_5d9e), ("torus", 0xf19c_9e3d)];
        let manifest = manifest.map(|(name, id)| (name.to_owned(), id)).into();
        let json = json(&Cryptomatte { name: "crypto_object".into(), manifest });
        assert_eq!(json, r#"{"ball \"a\\b\"\n":"00000001","torus":"f19c9e3d","равнина":"96235d9e"}"#);
    }
}
