//! Reading and writing whole files: bounded, atomic, with typed errors.

use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::{Error, Result};

/// Distinguishes the temporary files of threads that write to the same folder at once.
static NEXT_TEMPORARY: AtomicU64 = AtomicU64::new(0);

/// Writes a file so that `path` holds either its old content or all of the new one: `write` fills a temporary file beside it,
/// which is synchronised and renamed.
pub fn write_atomic(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    write_whole(path, |to| write(to).map_err(|fault| cannot_write(path, &fault)))
}

/// As [`write_atomic`], for bytes that `make` hands over; its own errors are passed on.
pub(crate) fn write_made(
    path: &Path,
    make: impl FnOnce(&mut dyn FnMut(&[u8]) -> Result<()>) -> Result<()>,
) -> Result<()> {
    write_whole(path, |to| make(&mut |bytes| to.write_all(bytes).map_err(|fault| cannot_write(path, &fault))))
}

fn write_whole(path: &Path, write: impl FnOnce(&mut dyn Write) -> Result<()>) -> Result<()> {
    let mut temporary = Temporary::beside(path, "")?;
    let mut buffered = BufWriter::new(&mut temporary.file);
    write(&mut buffered)?;
    buffered.flush().map_err(|fault| cannot_write(path, &fault))?;
    drop(buffered);
    temporary.keep()
}

/// A file that is being written, beside `path` under a name of its own. Dropped before [`Temporary::keep`], it is removed. It is
/// locked until then, so that [`remove_temporaries`] tells it from what a killed process left.
#[derive(Debug)]
pub struct Temporary {
    at: PathBuf,
    target: PathBuf,
    file: File,
}

impl Temporary {
    /// An empty file that will be `path`. Its name ends in `ending`, which is empty or begins with a dot. Anything but a regular file
    /// at `path`, such as a device or a pipe, is an error: its name would be taken away from it.
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

    pub fn path(&self) -> &Path {
        &self.at
    }

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
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    let parts = || {
        let (head, ending) = name.strip_prefix('.')?.rsplit_once(".tmp")?;
        let (pid, serial) = head.rsplit_once('.')?.1.split_once('-')?;
        Some((pid, serial, ending))
    };
    parts().is_some_and(|(pid, serial, ending)| {
        is_number(pid) && is_number(serial) && (ending.is_empty() || ending.starts_with('.') && ending.len() > 1)
    })
}

/// Removes what killed processes left in `folder`, and `depth` folders below it. What a process is writing now stays, and so does
/// what cannot be removed.
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

/// Removes a temporary file that no process has locked, if that can be told.
fn remove_abandoned(path: &Path) {
    // Network file systems lock nothing that is open for reading alone.
    if let Ok(file) = File::options().write(true).open(path)
        && is_abandoned(&file.try_lock())
    {
        let _ = fs::remove_file(path);
    }
}

/// Where files are not locked while they are written, or cannot be locked at all, an attempt says nothing.
fn is_abandoned(lock: &std::result::Result<(), fs::TryLockError>) -> bool {
    cfg!(unix) && lock.is_ok()
}

/// Makes the rename itself durable. Only Unix lets a folder be opened for that.
fn sync_folder(path: &Path) -> io::Result<()> {
    if cfg!(unix) { where_possible(File::open(folder_of(path))?.sync_all()) } else { Ok(()) }
}

pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Some file systems cannot synchronise a folder; what was renamed there is complete all the same.
fn where_possible(synced: io::Result<()>) -> io::Result<()> {
    synced.or_else(|fault| match fault.kind() {
        io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported => Ok(()),
        _ => Err(fault),
    })
}

pub(crate) fn cannot_write(path: &Path, fault: &io::Error) -> Error {
    let remedy = "check that the folder exists, is writable and not full";
    Error::data(path, "", format!("cannot be written: {fault}"), remedy)
}

pub(crate) fn make_folder(path: &Path) -> Result<()> {
    let remedy = "choose another folder with -o";
    fs::create_dir_all(path).map_err(|fault| Error::data(path, "", format!("cannot be made: {fault}"), remedy))
}

pub(crate) fn cannot_list(path: &Path, fault: &io::Error) -> Error {
    Error::data(path, "", format!("cannot be listed: {fault}"), "check the path and its permissions")
}

/// For serde: JSON is text, and not every path is.
pub(crate) fn as_text<S: serde::Serializer>(path: &Path, to: S) -> std::result::Result<S::Ok, S::Error> {
    to.collect_str(&path.display())
}

/// Only regular files are opened: a pipe would wait for a writer that may never come, and a device may never end.
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

pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open_file(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// [`io::ErrorKind::InvalidData`] where it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_file(path)?).map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8"))
}

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
