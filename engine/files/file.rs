//! Reading and writing whole files: bounded, atomic, with typed errors.

use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::{Error, Result};

/// Distinguishes the temporary files of threads that write to the same folder at once.
static NEXT_TEMPORARY: AtomicU64 = AtomicU64::new(0);

/// Writes a file so that `path` holds either its old content or all of the new one, whatever happens in between.
///
/// `write` fills a temporary file in the folder of `path`; that file is flushed, synchronised with the disk and renamed
/// to `path`, and the folder is synchronised. On failure the temporary file is removed.
///
/// # Errors
/// [`Error::Data`] naming `path` when the folder does not exist or cannot be written, or when `write` fails.
pub fn write_atomic(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let mut temporary = Temporary::beside(path, "")?;
    let fill = |file: &mut File| {
        let mut buffered = BufWriter::new(file);
        write(&mut buffered)?;
        buffered.flush()
    };
    fill(&mut temporary.file).map_err(|fault| cannot_write(path, &fault))?;
    temporary.keep()
}

/// As [`write_atomic`], for bytes that `make` hands over while it makes them; its own errors are passed on.
pub(crate) fn write_made(
    path: &Path,
    make: impl FnOnce(&mut dyn FnMut(&[u8]) -> Result<()>) -> Result<()>,
) -> Result<()> {
    let mut temporary = Temporary::beside(path, "")?;
    let mut buffered = BufWriter::new(&mut temporary.file);
    make(&mut |bytes| buffered.write_all(bytes).map_err(|fault| cannot_write(path, &fault)))?;
    buffered.flush().map_err(|fault| cannot_write(path, &fault))?;
    drop(buffered);
    temporary.keep()
}

/// A file that is being written, under a name of its own beside the one that it will have. One that is dropped before
/// [`Temporary::keep`] is removed.
///
/// It is locked as long as it is being written, so that [`remove_temporaries`] tells it from what a killed process left.
#[derive(Debug)]
pub struct Temporary {
    at: PathBuf,
    target: PathBuf,
    file: File,
}

impl Temporary {
    /// An empty file that will be `path`. Its name ends in `ending`, which is empty or begins with a dot.
    ///
    /// # Errors
    /// [`Error::Data`] naming `path` when it names no file, or something that is no file, such as a device or a pipe, whose name would
    /// be taken away from it; or when its folder cannot be written.
    pub fn beside(path: &Path, ending: &str) -> Result<Self> {
        let Some(name) = path.file_name() else {
            return Err(Error::data(path, "", "this names no file", "give a path that ends in a file name"));
        };
        if let Ok(kind) = fs::metadata(path).map(|there| there.file_type())
            && !kind.is_file()
        {
            let reason = format!("expected a regular file, or none, found {}", kind_of(&kind));
            return Err(Error::data(path, "", reason, "give the path of a file"));
        }
        loop {
            let serial = NEXT_TEMPORARY.fetch_add(1, Ordering::Relaxed);
            let mut temporary = std::ffi::OsString::from(".");
            temporary.push(name);
            temporary.push(format!(".{}-{serial}.tmp{ending}", std::process::id()));
            let temporary = path.with_file_name(temporary);
            match File::create_new(&temporary) {
                Ok(file) => {
                    // Elsewhere a lock would keep other programs from writing. A file system without locks does without.
                    let is_taken = cfg!(unix) && matches!(file.try_lock(), Err(fs::TryLockError::WouldBlock));
                    // Who removes temporary files here may have come between.
                    if !is_taken && temporary.try_exists().unwrap_or(true) {
                        return Ok(Temporary { at: temporary, target: path.to_owned(), file });
                    }
                }
                // A process with the same number was killed here: in a container all have the same.
                Err(fault) if fault.kind() == io::ErrorKind::AlreadyExists => {}
                Err(fault) => return Err(cannot_write(path, &fault)),
            }
        }
    }

    /// Where the file is.
    pub fn path(&self) -> &Path {
        &self.at
    }

    /// The open file.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Makes the file durable and gives it its name.
    pub fn keep(self) -> Result<()> {
        let kept = self.file.sync_all().and_then(|()| fs::rename(&self.at, &self.target));
        kept.and_then(|()| sync_folder(&self.target)).map_err(|fault| cannot_write(&self.target, &fault))
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // After a rename there is nothing to remove.
        let _ = fs::remove_file(&self.at);
    }
}

/// True if `name` is that of a [`Temporary`]: `.NAME.PID-SERIAL.tmp`, with or without an ending.
fn is_temporary(name: &str) -> bool {
    let parts = || {
        let (head, ending) = name.strip_prefix('.')?.rsplit_once(".tmp")?;
        let (pid, serial) = head.rsplit_once('.')?.1.split_once('-')?;
        let is_number = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
        let is_ending = ending.is_empty() || (ending.starts_with('.') && ending.len() > 1);
        Some(is_number(pid) && is_number(serial) && is_ending)
    };
    parts().unwrap_or(false)
}

/// Removes what killed processes left in `folder`, and `depth` folders below it, of files that they were writing. What a
/// process is writing now stays, and so does what cannot be removed: it does no harm.
///
/// # Errors
/// [`Error::Data`] naming a folder that cannot be listed.
pub fn remove_temporaries(folder: &Path, depth: usize) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(|fault| cannot_list(folder, &fault))?.flatten() {
        let Ok(kind) = entry.file_type() else { continue };
        if kind.is_dir() && depth > 0 {
            remove_temporaries(&entry.path(), depth - 1)?;
        } else if kind.is_file() && entry.file_name().to_str().is_some_and(is_temporary) {
            remove_abandoned(&entry.path());
        }
    }
    Ok(())
}

/// Removes a temporary file that no process has locked. One of which that cannot be told stays.
fn remove_abandoned(path: &Path) {
    // Network file systems lock nothing that is open for reading alone.
    if let Ok(file) = File::options().write(true).open(path)
        && is_abandoned(&file.try_lock())
    {
        let _ = fs::remove_file(path);
    }
}

/// True if a temporary file belongs to nobody, by the outcome of an attempt to lock it. Where files are not locked while they
/// are written, or cannot be locked at all, that attempt says nothing.
fn is_abandoned(lock: &std::result::Result<(), fs::TryLockError>) -> bool {
    cfg!(unix) && lock.is_ok()
}

/// Makes the rename itself durable. Only Unix lets a folder be opened for that.
fn sync_folder(path: &Path) -> io::Result<()> {
    if !cfg!(unix) {
        return Ok(());
    }
    where_possible(File::open(folder_of(path))?.sync_all())
}

/// The folder that a file is in.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// The outcome of synchronising a folder. Some file systems do not offer that; what was renamed there is complete all the same.
fn where_possible(synced: io::Result<()>) -> io::Result<()> {
    synced.or_else(|fault| match fault.kind() {
        io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported => Ok(()),
        _ => Err(fault),
    })
}

fn cannot_write(path: &Path, fault: &io::Error) -> Error {
    Error::data(
        path,
        "",
        format!("cannot be written: {fault}"),
        "check that the folder exists, is writable and not full",
    )
}

/// Makes a folder that is absent.
pub(crate) fn make_folder(path: &Path) -> Result<()> {
    let remedy = "choose another folder with -o";
    fs::create_dir_all(path).map_err(|fault| Error::data(path, "", format!("cannot be made: {fault}"), remedy))
}

/// The error of a folder that cannot be listed.
pub(crate) fn cannot_list(path: &Path, fault: &io::Error) -> Error {
    Error::data(path, "", format!("cannot be listed: {fault}"), "check the path and its permissions")
}

/// A path for a reader: JSON is text, and not every name of a file is.
pub(crate) fn as_text<S: serde::Serializer>(path: &Path, to: S) -> std::result::Result<S::Ok, S::Error> {
    to.collect_str(&path.display())
}

/// Opens a file for reading. Only regular files are opened: a pipe would wait for a writer that may never come, and a
/// device may never end.
///
/// # Errors
/// Those of the system; [`io::ErrorKind::InvalidInput`], naming what is there, for anything but a regular file.
pub fn open_file(path: &Path) -> io::Result<File> {
    let kind = fs::metadata(path)?.file_type();
    if kind.is_file() {
        return File::open(path);
    }
    let found = kind_of(&kind);
    Err(io::Error::new(io::ErrorKind::InvalidInput, format!("expected a regular file, found {found}")))
}

#[cfg(unix)]
fn kind_of(kind: &fs::FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    match () {
        () if kind.is_dir() => "a folder",
        () if kind.is_fifo() => "a named pipe",
        () if kind.is_socket() => "a socket",
        () if kind.is_char_device() || kind.is_block_device() => "a device",
        () => "something else",
    }
}

#[cfg(not(unix))]
fn kind_of(kind: &fs::FileType) -> &'static str {
    if kind.is_dir() { "a folder" } else { "something else" }
}

/// The bytes of a whole file, as [`open_file`] opens it.
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = open_file(path)?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of a whole file; [`io::ErrorKind::InvalidData`] where it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_file(path)?).map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8"))
}

/// A whole file in memory.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    read_file(path).map_err(|fault| cannot_read(path, &fault))
}

/// Reads a JSON file that should be a `what`, such as "meta file".
pub(crate) fn read_json<T: serde::de::DeserializeOwned>(path: &Path, what: &str, remedy: &str) -> Result<T> {
    parse_json(path, &read_bytes(path)?, what, remedy)
}

/// As [`read_json`], of bytes that were read.
pub(crate) fn parse_json<T: serde::de::DeserializeOwned>(
    path: &Path,
    bytes: &[u8],
    what: &str,
    remedy: &str,
) -> Result<T> {
    serde_json::from_slice(bytes).map_err(|fault| {
        let place = format!("line {}, column {}", fault.line(), fault.column());
        Error::data(path, place, format!("is no {what}: {fault}"), remedy)
    })
}

/// The error of a file that cannot be opened or read.
pub fn cannot_read(path: &Path, fault: &io::Error) -> Error {
    Error::data(path, "", format!("cannot be read: {fault}"), "check the path and its permissions")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn what_may_be_being_written_stays() {
        assert!(is_abandoned(&Ok(())));
        assert!(!is_abandoned(&Err(fs::TryLockError::WouldBlock)));
        // As of a file system that has no locks.
        assert!(!is_abandoned(&Err(fs::TryLockError::Error(io::ErrorKind::Unsupported.into()))));
        let folder = std::env::temp_dir().join(format!("ivv-temporaries-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let left = folder.join(".scene.ply.1-0.tmp");
        fs::write(&left, "half").unwrap();
        let ours = Temporary::beside(&folder.join("scene.ply"), "").unwrap();
        remove_temporaries(&folder, 0).unwrap();
        let found = (left.exists(), ours.path().exists());
        drop(ours);
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(found, (false, true));
    }

    #[test]
    fn a_folder_that_cannot_be_synchronised_is_no_fault() {
        for kind in [io::ErrorKind::InvalidInput, io::ErrorKind::Unsupported] {
            assert!(where_possible(Err(kind.into())).is_ok(), "{kind}");
        }
        assert!(where_possible(Err(io::ErrorKind::StorageFull.into())).is_err());
    }
}
