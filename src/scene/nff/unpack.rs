//! NFF files on disk, plain or packed by gzip.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use crate::scene::{Scene, SceneError, SceneErrors};

/// Longest text that is read: a small packed file may hold far more than memory does.
const MOST_BYTES: u64 = 1 << 30;

/// Reads an NFF file, unpacked first where its name ends in `.gz`.
///
/// # Errors
/// A file that cannot be read or unpacked, or whose text is longer than 1 GiB; else those of [`super::read`].
pub fn load(path: &Path) -> Result<Scene, SceneErrors> {
    let packed = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
    let bytes =
        File::open(path).and_then(|file| if packed { unpack(file, MOST_BYTES) } else { bounded(file, MOST_BYTES) });
    // The format is ASCII, yet names in comments are not always: those bytes may read as anything.
    let bytes = bytes.map_err(|error| SceneError::of_file(path, "a scene file must be readable", error.to_string()))?;
    super::read(&String::from_utf8_lossy(&bytes), path)
}

/// The bytes that a gzip stream holds, at most `most` of them.
fn unpack(packed: impl Read, most: u64) -> io::Result<Vec<u8>> {
    bounded(MultiGzDecoder::new(BufReader::new(packed)), most).map_err(|error| match error.kind() {
        io::ErrorKind::UnexpectedEof => io::Error::new(error.kind(), "a gzip file that is cut short"),
        io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => {
            io::Error::new(error.kind(), format!("a broken gzip file ({error})"))
        }
        _ => error,
    })
}

fn bounded(source: impl Read, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    source.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, format!("more than {most} bytes of text")));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::{Compression, write::GzEncoder};

    use super::*;

    fn pack(bytes: &[u8]) -> Vec<u8> {
        let mut packer = GzEncoder::new(Vec::new(), Compression::default());
        packer.write_all(bytes).unwrap();
        packer.finish().unwrap()
    }

    #[test]
    fn packed_text_comes_back_whole() {
        let text = b"s 0 0 0 1\n".repeat(1000);
        assert_eq!(unpack(&pack(&text)[..], MOST_BYTES).unwrap(), text);
        let twice = [pack(b"s 0 "), pack(b"0 0 1")].concat();
        assert_eq!(unpack(&twice[..], MOST_BYTES).unwrap(), b"s 0 0 0 1");
    }

    #[test]
    fn broken_packing_is_one_clear_error() {
        let packed = pack(&b"s 0 0 0 1\n".repeat(1000));
        let message = |bytes: &[u8]| unpack(bytes, MOST_BYTES).unwrap_err().to_string();
        for length in [3, 12, packed.len() / 2, packed.len() - 1] {
            assert_eq!(message(&packed[..length]), "a gzip file that is cut short", "{length}");
        }
        assert!(message(b"s 0 0 0 1\n plain text").starts_with("a broken gzip file"));
    }

    #[test]
    fn a_bomb_is_stopped_at_the_bound() {
        let packed = pack(&vec![b' '; 1 << 20]);
        assert!(unpack(&packed[..], 1 << 20).is_ok());
        let error = unpack(&packed[..], (1 << 20) - 1).unwrap_err();
        assert_eq!(error.to_string(), "more than 1048575 bytes of text");
    }

    #[test]
    fn files_are_read_by_their_name() {
        let folder = tempfile::tempdir().unwrap();
        let (plain, packed) = (folder.path().join("a.nff"), folder.path().join("a.nff.gz"));
        let text = b"# by H\xe9l\xe8ne\nf 1 1 1 1 0 0 0 0 s 0 0 0 1";
        std::fs::write(&plain, text).unwrap();
        std::fs::write(&packed, pack(text)).unwrap();
        for path in [plain, packed] {
            assert_eq!(load(&path).unwrap().objects.len(), 1, "{}", path.display());
        }
        let missing = load(&folder.path().join("b.nff")).unwrap_err().to_string();
        assert!(missing.contains("b.nff: a scene file must be readable, found "), "{missing}");
        assert!(load(folder.path()).is_err());
    }
}
