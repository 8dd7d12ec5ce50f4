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
    let temporary = temporary_beside(path)?;
    let outcome = fill(&temporary, write).and_then(|()| fs::rename(&temporary, path));
    if let Err(fault) = outcome {
        // The first fault is the one to report; a temporary that was never created cannot be removed either.
        let _ = fs::remove_file(&temporary);
        return Err(cannot_write(path, &fault));
    }
    sync_folder(path).map_err(|fault| cannot_write(path, &fault))
}

fn fill(temporary: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut buffered = BufWriter::new(File::create_new(temporary)?);
    write(&mut buffered)?;
    buffered.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
}

fn temporary_beside(path: &Path) -> Result<PathBuf> {
    let Some(name) = path.file_name() else {
        return Err(Error::data(path, "", "this names no file", "give a path that ends in a file name"));
    };
    let serial = NEXT_TEMPORARY.fetch_add(1, Ordering::Relaxed);
    let mut temporary = std::ffi::OsString::from(".");
    temporary.push(name);
    temporary.push(format!(".{}-{serial}.tmp", std::process::id()));
    Ok(path.with_file_name(temporary))
}

/// Makes the rename itself durable. Only Unix lets a folder be opened for that.
fn sync_folder(path: &Path) -> io::Result<()> {
    if !cfg!(unix) {
        return Ok(());
    }
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    File::open(folder)?.sync_all()
}

fn cannot_write(path: &Path, fault: &io::Error) -> Error {
    Error::data(
        path,
        "",
        format!("cannot be written: {fault}"),
        "check that the folder exists, is writable and not full",
    )
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
    let found = if kind.is_dir() { "a folder" } else { special(&kind) };
    Err(io::Error::new(io::ErrorKind::InvalidInput, format!("expected a regular file, found {found}")))
}

#[cfg(unix)]
fn special(kind: &fs::FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    match () {
        () if kind.is_fifo() => "a named pipe",
        () if kind.is_socket() => "a socket",
        () if kind.is_char_device() || kind.is_block_device() => "a device",
        () => "something else",
    }
}

#[cfg(not(unix))]
fn special(_: &fs::FileType) -> &'static str {
    "something else"
}

/// The bytes of a whole file.
///
/// # Errors
/// As [`open_file`].
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = open_file(path)?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of a whole file.
///
/// # Errors
/// As [`open_file`]; [`io::ErrorKind::InvalidData`] where it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_file(path)?).map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8"))
}

/// A whole file in memory.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    read_file(path).map_err(|fault| cannot_read(path, &fault))
}

/// The error of a file that cannot be opened or read.
pub(super) fn cannot_read(path: &Path, fault: &io::Error) -> Error {
    Error::data(path, "", format!("cannot be read: {fault}"), "check the path and its permissions")
}
