//! Bytes under a name: written aside and renamed.
//!
//! A reader who finds the name finds a whole file: the bytes go to a hidden file in the same directory,
//! are flushed to the disk, and only then take the name. Two writers of one name both succeed, and the
//! last one stays.

use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::hash::{Hash, Hasher};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

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
    let aside = Aside::write(path, bytes, go_on)?;
    aside.flush()?;
    aside.take_name()
}

/// A file that is complete but has not taken its name yet. Dropped, it is removed.
///
/// Many files are made durable faster together than one by one: written, flushed as a group, renamed.
#[derive(Debug)]
pub struct Aside {
    /// As the user said it.
    path: PathBuf,
    /// The hidden file and the name that it is to take; `None` for what was written in place.
    file: Option<(NamedTempFile, PathBuf)>,
}

impl Aside {
    /// Writes the bytes beside the name, as long as the caller wants it.
    ///
    /// # Errors
    /// As [`write_while`].
    pub fn write(path: &Path, bytes: &[u8], go_on: impl Fn() -> bool) -> Result<Self, OutputError> {
        let io = |source| OutputError::Io { path: path.into(), source };
        let fill = |file: &mut dyn Write| {
            bytes.chunks(PART).try_for_each(|part| match go_on() {
                true => file.write_all(part),
                false => Err(std::io::ErrorKind::Interrupted.into()),
            })
        };
        let file = match target(path)? {
            Target::Special(name) => {
                let mut file = OpenOptions::new().write(true).open(name).map_err(io)?;
                fill(&mut file).map_err(io)?;
                None
            }
            Target::File { name, directory } => {
                let mut file = beside(&name, &directory).map_err(io)?;
                fill(&mut file).map_err(io)?;
                if let Ok(old) = fs::metadata(&name) {
                    // A file system without permissions refuses this, and then there are none to keep.
                    let _ = file.as_file().set_permissions(old.permissions());
                }
                Some((file, name))
            }
        };
        Ok(Aside { path: path.into(), file })
    }

    /// The name that the file is to take.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Has this file on the disk before it returns.
    ///
    /// # Errors
    /// [`OutputError::Io`].
    pub fn flush(&self) -> Result<(), OutputError> {
        let Some((file, _)) = &self.file else { return Ok(()) };
        file.as_file().sync_all().map_err(|source| OutputError::Io { path: self.path.clone(), source })
    }

    /// Has several files on the disk: where there are many of one file system, all that it has to write, in one go.
    ///
    /// # Errors
    /// For each file that may not be there.
    pub fn flush_all(files: &[Aside]) -> Vec<Result<(), OutputError>> {
        let flushed = files.len() >= TOGETHER && flush_systems(files);
        files.iter().map(|file| if flushed { Ok(()) } else { file.flush() }).collect()
    }

    /// Takes the name, in place of what had it.
    ///
    /// # Errors
    /// [`OutputError::Io`].
    pub fn take_name(mut self) -> Result<(), OutputError> {
        let Some((file, name)) = self.file.take() else { return Ok(()) };
        let hidden = file.path().to_owned();
        let done = file.persist(&name).map(drop).map_err(|error| error.error);
        forget(&hidden);
        done.map_err(|source| OutputError::Io { path: self.path.clone(), source })
    }
}

impl Drop for Aside {
    fn drop(&mut self) {
        if let Some((file, _)) = &self.file {
            forget(file.path());
        }
    }
}

/// Fewer files than this are flushed one by one.
const TOGETHER: usize = 8;

/// Flushes the file systems that files are on; `false` where the system cannot do that, or did not succeed.
#[cfg(target_os = "linux")]
fn flush_systems(files: &[Aside]) -> bool {
    use std::os::unix::fs::MetadataExt;
    let mut seen = Vec::new();
    files.iter().filter_map(|file| file.file.as_ref()).all(|(file, _)| {
        let Ok(device) = file.as_file().metadata().map(|found| found.dev()) else { return false };
        if seen.contains(&device) {
            return true;
        }
        seen.push(device);
        rustix::fs::syncfs(file.as_file()).is_ok()
    })
}

#[cfg(not(target_os = "linux"))]
fn flush_systems(_: &[Aside]) -> bool {
    false
}

/// Hidden files of this process that have not taken their names.
static HIDDEN: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn hidden() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    HIDDEN.lock().unwrap_or_else(PoisonError::into_inner)
}

fn forget(path: &Path) {
    hidden().remove(path);
}

/// Removes all hidden files of this process: for one that ends without unwinding. None can take its name afterwards.
pub fn abandon() {
    let mut hidden = hidden();
    while let Some(path) = hidden.pop_first() {
        let _ = fs::remove_file(path);
    }
}

/// Removes hidden files that processes left in a directory that are no more, and tells how many.
///
/// A hidden file is called `.NAME.PROCESS.HOST-RANDOM.tmp`. Whether a process lives can be told on its own host alone; those
/// of others are left alone for a day.
pub fn sweep(directory: &Path) -> usize {
    let Ok(entries) = fs::read_dir(directory) else { return 0 };
    let names = entries.filter_map(|entry| entry.ok()).filter(is_left);
    names.filter(|entry| fs::remove_file(entry.path()).is_ok()).count()
}

fn is_left(entry: &fs::DirEntry) -> bool {
    let name = entry.file_name();
    let Some(parts) = name.to_str().and_then(|name| name.strip_prefix('.')?.strip_suffix(".tmp")) else { return false };
    let mut parts = parts.rsplit('.');
    let maker = parts.next().and_then(|random| random.split_once('-')).map(|(host, _)| host);
    let process = parts.next().and_then(|process| process.parse::<u32>().ok());
    let (Some(maker), Some(process), true) = (maker, process, parts.next().is_some()) else { return false };
    if maker == host() {
        return process != std::process::id() && !is_alive(process);
    }
    let age = entry.metadata().and_then(|found| found.modified()).ok().and_then(|date| date.elapsed().ok());
    maker.len() == host().len() && age.is_some_and(|age| age > DAY)
}

const DAY: Duration = Duration::from_secs(86_400);

#[cfg(unix)]
fn is_alive(process: u32) -> bool {
    use rustix::process::{Pid, test_kill_process};
    let pid = i32::try_from(process).ok().and_then(Pid::from_raw);
    pid.is_some_and(|pid| test_kill_process(pid) != Err(rustix::io::Errno::SRCH))
}

#[cfg(not(unix))]
fn is_alive(_: u32) -> bool {
    true // not known: left alone
}

/// A word for where process numbers mean the same: the name of the host and, in containers, its process namespace.
fn host() -> &'static str {
    static HOST: LazyLock<String> = LazyLock::new(|| {
        let name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        let space = fs::read_link("/proc/self/ns/pid").unwrap_or_default();
        let mut hash = std::hash::DefaultHasher::new();
        (name.trim(), space).hash(&mut hash);
        format!("{:06x}", hash.finish() & 0xff_ffff)
    });
    &HOST
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
        Target::File { name, directory } => {
            let file = beside(&name, &directory).map_err(io)?;
            forget(file.path());
            Ok(())
        }
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
    let prefix = format!(".{head}.{}.{}-", std::process::id(), host());
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666)); // less the umask, which the system takes off
    }
    let file = builder.tempfile_in(directory)?;
    hidden().insert(file.path().to_owned());
    Ok(file)
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

    /// A file of a process that is no more is swept, one of a process that lives and one of another host are not.
    #[cfg(unix)]
    #[test]
    fn what_dead_processes_left_is_swept() {
        let room = tempfile::tempdir().unwrap();
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let dead = child.id();
        child.wait().unwrap();
        let (host, own) = (host(), std::process::id());
        let gone = [format!(".a.exr.{dead}.{host}-x1.tmp"), format!(".b.c.png.{dead}.{host}-x2.tmp")];
        let mut kept = [
            format!(".a.exr.{own}.{host}-x3.tmp"),
            format!(".a.exr.1.{host}-x3.tmp"),
            format!(".a.exr.{dead}.ffffff0-x4.tmp"),
            format!(".a.exr.{dead}.000000-x5.tmp"),
            ".a.tmp".to_owned(),
            "a.exr".to_owned(),
        ];
        gone.iter().chain(&kept).for_each(|name| fs::write(room.path().join(name), b"x").unwrap());
        assert_eq!(sweep(room.path()), gone.len());
        kept.sort();
        assert_eq!(names(room.path()), kept);
    }

    #[test]
    fn a_group_is_flushed_and_renamed() {
        let room = tempfile::tempdir().unwrap();
        let files: Vec<Aside> = (0..TOGETHER + 1)
            .map(|i| Aside::write(&room.path().join(format!("{i}")), b"x", || true).unwrap())
            .collect();
        assert!(names(room.path()).iter().all(|name| name.starts_with('.')));
        assert!(Aside::flush_all(&files).iter().all(Result::is_ok));
        files.into_iter().for_each(|file| file.take_name().unwrap());
        assert_eq!(names(room.path()).len(), TOGETHER + 1);
        assert!(names(room.path()).iter().all(|name| name.len() == 1));
        drop(Aside::write(&room.path().join("a"), b"x", || true).unwrap());
        assert_eq!(names(room.path()).len(), TOGETHER + 1);
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
