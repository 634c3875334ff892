//! The files behind a scene, and one hash over all of them: what tells whether a picture is stale.

use std::collections::{BTreeMap, HashMap};
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use ::toml::de::{DeTable, DeValue};
use sha2::{Digest, Sha256};

use super::pattern;

/// Deepest chain of includes, as the reader has it.
const DEEPEST: usize = 16;
/// Bytes that are read at a time.
const PART: usize = 1 << 16;

/// All files that a scene names at a frame, the scene file first, each once; those that are not there are left out.
///
/// Any text in a TOML file that is the name of a file counts, whatever its key: one too many makes a picture stale
/// too soon, one too few would never. Files that the named ones name (a scene's includes) follow the name.
pub fn files(scene: &Path, frame: i64) -> Vec<PathBuf> {
    let mut found = Vec::new();
    add(scene, frame, 0, &mut found);
    if found.iter().any(|path| looks_ahead(path)) {
        let mut next = Vec::new();
        add(scene, frame + 1, 0, &mut next);
        next.retain(|path| !found.contains(path));
        found.extend(next);
    }
    found
}

/// Whether a scene file asks for what depends on the next frame too: motion, or a shutter that is open for some time.
fn looks_ahead(path: &Path) -> bool {
    // Other files may be long, and this is asked once a frame.
    let Some(text) = is_scene(path).then(|| fs::read_to_string(path).ok()).flatten() else { return false };
    let (root, _) = DeTable::parse_recoverable(&text);
    let value = |table: &str, key: &str| match root.get_ref().get(table)?.get_ref() {
        DeValue::Table(table) => table.get(key).map(|value| value.get_ref().clone()),
        _ => None,
    };
    let mut layers = Vec::new();
    if let Some(names) = value("image", "aovs") {
        texts(&names, &mut layers);
    }
    value("render", "shutter").is_some() || layers.iter().any(|name| name == "motion" || name == "all")
}

fn is_scene(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

fn add(path: &Path, frame: i64, depth: usize, found: &mut Vec<PathBuf>) {
    if found.iter().any(|known| known == path) || !path.is_file() {
        return;
    }
    found.push(path.to_owned());
    if !is_scene(path) || depth >= DEEPEST {
        return;
    }
    let Ok(text) = fs::read_to_string(path) else { return };
    let (root, _) = DeTable::parse_recoverable(&text);
    let mut names = Vec::new();
    root.get_ref().values().for_each(|value| texts(value.get_ref(), &mut names));
    let folder = path.parent().unwrap_or(Path::new(""));
    for name in names {
        let literal = folder.join(&name);
        let at_frame = pattern::name(&name, frame).filter(|_| !literal.exists());
        add(&at_frame.map_or(literal, |name| folder.join(name)), frame, depth + 1, found);
    }
}

/// All texts of a value, in order.
fn texts(value: &DeValue<'_>, names: &mut Vec<String>) {
    match value {
        DeValue::String(text) if !text.is_empty() && !text.contains('\0') => names.push(text.to_string()),
        DeValue::Array(items) => items.iter().for_each(|item| texts(item.get_ref(), names)),
        DeValue::Table(table) => table.values().for_each(|item| texts(item.get_ref(), names)),
        _ => {}
    }
}

/// Hashes of files, each read once as long as its length and date stay.
#[derive(Debug, Default)]
pub struct Hashes {
    files: HashMap<PathBuf, (Stamp, [u8; 32])>,
    scenes: BTreeMap<(PathBuf, i64), (Stamps, String)>,
}

/// Length and date of a file.
type Stamp = (u64, Option<SystemTime>);
type Stamps = Vec<(PathBuf, Stamp)>;

impl Hashes {
    /// The SHA-256, in hexadecimal, of the SHA-256 of every file that a scene names at a frame, in their order.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn scene(&mut self, scene: &Path, frame: i64) -> io::Result<String> {
        let key = (scene.to_owned(), frame);
        if let Some((stamps, hash)) = self.scenes.get(&key)
            && stamps.iter().all(|(path, was)| stamp(path).is_ok_and(|now| now == *was))
        {
            return Ok(hash.clone());
        }
        let (mut all, mut stamps) = (Sha256::new(), Vec::new());
        let named = files(scene, frame);
        if named.is_empty() {
            return Err(io::ErrorKind::NotFound.into());
        }
        for path in named {
            all.update(self.file(&path)?);
            stamps.push((path.clone(), stamp(&path)?));
        }
        let hash = hex(&all.finalize());
        self.scenes.insert(key, (stamps, hash.clone()));
        Ok(hash)
    }

    /// Whether a scene was hashed before, at this frame.
    pub fn knows(&self, scene: &Path, frame: i64) -> bool {
        self.scenes.contains_key(&(scene.to_owned(), frame))
    }

    fn file(&mut self, path: &Path) -> io::Result<[u8; 32]> {
        let now = stamp(path)?;
        match self.files.get(path) {
            Some((was, hash)) if *was == now => Ok(*hash),
            _ => {
                let hash = sha256(&mut File::open(path)?)?;
                self.files.insert(path.to_owned(), (now, hash));
                Ok(hash)
            }
        }
    }
}

fn stamp(path: &Path) -> io::Result<Stamp> {
    let found = fs::metadata(path)?;
    Ok((found.len(), found.modified().ok()))
}

/// The SHA-256 of all bytes of a stream.
pub fn sha256(bytes: &mut impl Read) -> io::Result<[u8; 32]> {
    let (mut hash, mut part) = (Sha256::new(), vec![0; PART]);
    loop {
        match bytes.read(&mut part) {
            Ok(0) => return Ok(hash.finalize().into()),
            Ok(count) => hash.update(&part[..count]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// Two lower-case digits a byte.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The hash changes with every file that is named, and with nothing else.
    #[test]
    fn every_file_that_a_scene_names_is_in_the_hash() {
        let room = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(room.path().join(name), text).unwrap();
        write("base.toml", "[textures.t]\ntype = \"image\"\nfile = \"a.png\"\n");
        let clouds = "[[clouds]]\nfile = \"p.##.npy\"\nradius = { file = \"r.csv\" }\n";
        write("s.toml", &format!("include = [\"base.toml\"]\n{clouds}"));
        ["a.png", "p.01.npy", "p.02.npy", "r.csv", "other.csv"].iter().for_each(|name| write(name, name));
        let scene = room.path().join("s.toml");
        let names = |frame| -> Vec<String> {
            let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
            files(&scene, frame).iter().map(name).collect()
        };
        assert_eq!(names(1), ["s.toml", "base.toml", "a.png", "p.01.npy", "r.csv"]);
        assert_eq!(names(3), ["s.toml", "base.toml", "a.png", "r.csv"]);
        let mut hashes = Hashes::default();
        let mut last = hashes.scene(&scene, 1).unwrap();
        let second = hashes.scene(&scene, 2).unwrap();
        assert!(last.len() == 64 && last != second);
        for name in ["base.toml", "a.png", "p.01.npy", "r.csv", "s.toml"] {
            let longer = fs::read_to_string(room.path().join(name)).unwrap() + "\n";
            write(name, &longer);
            let now = hashes.scene(&scene, 1).unwrap();
            assert_ne!(now, last, "{name}");
            last = now;
        }
        let shutter = fs::read_to_string(&scene).unwrap() + "[render]\nshutter = 0.5\n";
        write("s.toml", &shutter);
        assert_eq!(names(1), ["s.toml", "base.toml", "a.png", "p.01.npy", "r.csv", "p.02.npy"]);
        last = hashes.scene(&scene, 1).unwrap();
        write("other.csv", "x");
        assert_eq!(hashes.scene(&scene, 1).unwrap(), last);
        assert!(hashes.scene(&room.path().join("gone.toml"), 1).is_err());
    }

    /// The vector of FIPS 180-4 for "abc".
    #[test]
    fn hashes_are_sha_256() {
        let abc = hex(&sha256(&mut b"abc".as_slice()).unwrap());
        assert_eq!(abc, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }
}
