//! Bytes under a name: written aside and renamed.
//!
//! A reader who finds the name finds a whole file: the bytes go to a hidden file in the same directory,
//! are flushed to the disk, and only then take the name. Two writers of one name both succeed, and the
//! last one stays.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::OutputError;

/// Bytes that are written between two questions whether to go on.
const PART: usize = 1 << 24;

/// Writes a file whole, or leaves its name as it was.
///
/// A new file gets the permissions of the process (0666 less its umask), a replaced one keeps its own. A symbolic
/// link stays, and the file behind it is replaced. What is no regular file (a pipe, `/dev/null`) is written to
/// in place, since renaming over it would remove it.
///
/// # Errors
/// [`OutputError::Directory`], [`OutputError::NoDirectory`] or [`OutputError::Io`].
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    write_while(path, bytes, || true)
}

/// As [`write()`], as long as the caller wants it: asked between parts, so that a long write can be given up. The
/// name is left as it was then.
///
/// # Errors
/// As [`write()`]; [`OutputError::Io`] of the kind `Interrupted` where it was given up.
pub fn write_while(path: &Path, bytes: &[u8], go_on: impl Fn() -> bool) -> Result<(), OutputError> {
    let io = |source| OutputError::Io { path: path.into(), source };
    let fill = |file: &mut dyn Write| {
        bytes.chunks(PART).try_for_each(|part| match go_on() {
            true => file.write_all(part),
            false => Err(std::io::ErrorKind::Interrupted.into()),
        })
    };
    match target(path)? {
        Target::Special(name) => {
            let mut file = OpenOptions::new().write(true).open(name).map_err(io)?;
            fill(&mut file).map_err(io)
        }
        Target::File { name, directory } => {
            let mut file = beside(&name, &directory).map_err(io)?;
            fill(&mut file).map_err(io)?;
            if let Ok(old) = fs::metadata(&name) {
                // A file system without permissions refuses this, and then there are none to keep.
                let _ = file.as_file().set_permissions(old.permissions());
            }
            file.as_file().sync_all().map_err(io)?;
            file.persist(&name).map(drop).map_err(|error| io(error.error))
        }
    }
}

/// Finds out, before hours of work, whether a file of this name could be written: same errors as [`write()`],
/// nothing is left behind.
///
/// # Errors
/// As [`write()`], except a disk that is full later on.
pub fn check(path: &Path) -> Result<(), OutputError> {
    let io = |source| OutputError::Io { path: path.into(), source };
    match target(path)? {
        Target::Special(_) => Ok(()),
        Target::File { name, directory } => beside(&name, &directory).map(drop).map_err(io),
    }
}

enum Target {
    /// A file, there already or not, and the directory it belongs to.
    File { name: PathBuf, directory: PathBuf },
    /// Something that must not be replaced by a file.
    Special(PathBuf),
}

/// What stands, or will stand, behind a name.
fn target(path: &Path) -> Result<Target, OutputError> {
    let name = path.canonicalize().unwrap_or_else(|_| path.into());
    let found = fs::metadata(&name);
    if name.file_name().is_none() || found.as_ref().is_ok_and(|found| found.is_dir()) || ends_in_slash(path) {
        return Err(OutputError::Directory { path: path.into() });
    }
    if found.is_ok_and(|found| !found.is_file()) {
        return Ok(Target::Special(name));
    }
    let directory = match name.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    };
    if !directory.is_dir() {
        return Err(OutputError::NoDirectory { path: path.into(), directory });
    }
    Ok(Target::File { name, directory })
}

/// "frames/" means a directory, though [`Path`] takes the slash for nothing.
fn ends_in_slash(path: &Path) -> bool {
    path.as_os_str().to_string_lossy().ends_with(std::path::is_separator)
}

/// A hidden file in the directory, which removes itself unless it is renamed.
fn beside(name: &Path, directory: &Path) -> std::io::Result<NamedTempFile> {
    // The name may be as long as the system allows, so only the head of it goes into the hidden one.
    let head: String = name.file_name().unwrap_or_default().to_string_lossy().chars().take(40).collect();
    let prefix = format!(".{head}.");
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666)); // less the umask, which the system takes off
    }
    builder.tempfile_in(directory)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(directory: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_written_file_is_whole_and_alone() {
        let room = tempfile::tempdir().unwrap();
        let path = room.path().join("a.exr");
        write(&path, b"first").unwrap();
        write(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(names(room.path()), ["a.exr"]);
        check(&path).unwrap();
        check(&room.path().join("b.exr")).unwrap();
        assert_eq!(names(room.path()), ["a.exr"]);
    }

    #[test]
    fn a_write_that_is_given_up_leaves_nothing() {
        let room = tempfile::tempdir().unwrap();
        let (path, asked) = (room.path().join("a.exr"), std::cell::Cell::new(0));
        write(&path, b"old").unwrap();
        let once = || asked.replace(asked.get() + 1) == 0;
        let error = write_while(&path, &vec![0; PART + 1], once).unwrap_err();
        assert!(matches!(error, OutputError::Io { source, .. } if source.kind() == std::io::ErrorKind::Interrupted));
        assert_eq!((asked.get(), names(room.path())), (2, vec!["a.exr".to_owned()]));
        assert_eq!(fs::read(&path).unwrap(), b"old");
    }

    #[test]
    fn a_long_name_can_be_written() {
        let room = tempfile::tempdir().unwrap();
        let path = room.path().join(format!("{}.exr", "ä".repeat(120)));
        write(&path, b"x").unwrap();
        assert_eq!(names(room.path()).len(), 1);
    }

    #[test]
    fn a_directory_as_name_is_refused() {
        let room = tempfile::tempdir().unwrap();
        let slash = PathBuf::from(format!("{}/", room.path().join("new").display()));
        for path in [room.path(), Path::new("/"), Path::new(".."), &slash] {
            let error = write(path, b"x").unwrap_err();
            assert!(matches!(error, OutputError::Directory { .. }), "{error}");
            assert!(error.to_string().starts_with(&path.display().to_string()), "{error}");
            assert!(check(path).is_err());
        }
        assert!(names(room.path()).is_empty());
    }

    #[test]
    fn a_missing_directory_is_named() {
        let room = tempfile::tempdir().unwrap();
        let error = write(&room.path().join("none/a.exr"), b"x").unwrap_err();
        assert!(error.to_string().contains(&format!("no directory {}", room.path().join("none").display())), "{error}");
        fs::write(room.path().join("file"), b"x").unwrap();
        assert!(matches!(write(&room.path().join("file/a"), b"x"), Err(OutputError::NoDirectory { .. })));
        assert_eq!(names(room.path()), ["file"]);
    }

    #[cfg(unix)]
    #[test]
    fn permissions_are_the_users() {
        use std::os::unix::fs::PermissionsExt;
        let room = tempfile::tempdir().unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        let (plain, ours) = (room.path().join("plain"), room.path().join("ours"));
        fs::write(&plain, b"x").unwrap();
        write(&ours, b"x").unwrap();
        assert_eq!(mode(&ours), mode(&plain));
        fs::set_permissions(&ours, fs::Permissions::from_mode(0o640)).unwrap();
        write(&ours, b"y").unwrap();
        assert_eq!(mode(&ours), 0o640);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link() {
        let room = tempfile::tempdir().unwrap();
        let (file, link) = (room.path().join("file"), room.path().join("link"));
        fs::write(&file, b"old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
    }

    /// The device that is always full stands for a full disk; renaming over it would remove it.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_is_written_in_place_and_a_full_one_says_so() {
        use std::os::unix::fs::FileTypeExt;
        let full = Path::new("/dev/full");
        let error = write(full, b"x").unwrap_err();
        assert!(error.to_string().starts_with("/dev/full: cannot be written: No space left"), "{error}");
        assert!(fs::metadata(full).unwrap().file_type().is_char_device());
        write(Path::new("/dev/null"), b"x").unwrap();
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    }

    #[cfg(unix)]
    #[test]
    fn a_read_only_directory_is_refused() {
        use std::os::unix::fs::PermissionsExt;
        let room = tempfile::tempdir().unwrap();
        fs::set_permissions(room.path(), fs::Permissions::from_mode(0o555)).unwrap();
        if fs::write(room.path().join("probe"), b"x").is_ok() {
            return; // root may write everywhere, and then there is nothing to refuse
        }
        let error = write(&room.path().join("a.exr"), b"x").unwrap_err();
        assert!(matches!(error, OutputError::Io { .. }), "{error}");
        assert!(check(&room.path().join("a.exr")).is_err());
        assert!(names(room.path()).is_empty());
    }
}
