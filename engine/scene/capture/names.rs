//! Names that come from a capture's files: an attacker may have written them, so none may lead out of the capture.

use std::path::{Component, Path, PathBuf};

/// Longest name, bytes.
const MAX_BYTES: usize = 4096;
/// Extensions of images, as they are tried.
const EXTENSIONS: [&str; 3] = ["png", "jpg", "jpeg"];

/// The relative path that `name` spells, without `.` components; or why it is refused.
pub(crate) fn relative(name: &str) -> Result<PathBuf, String> {
    let refuse = |why: &str| {
        let start: String = name.chars().take(80).collect();
        Err(format!("the name `{}` {why}", start.escape_debug()))
    };
    if name.len() > MAX_BYTES {
        return refuse(&format!("has {} bytes, at most {MAX_BYTES} are allowed", name.len()));
    }
    if name.contains('\\') || name.chars().any(char::is_control) {
        return refuse("has a backslash or a control character");
    }
    // A drive (`C:x`) is an absolute path on Windows only; a capture must mean the same everywhere.
    if name.as_bytes().get(1) == Some(&b':') {
        return refuse("begins with a drive");
    }
    let mut path = PathBuf::new();
    for component in Path::new(name).components() {
        match component {
            Component::Normal(part) => path.push(part),
            Component::CurDir => {}
            Component::ParentDir => return refuse("has `..`, which leads out of the capture"),
            Component::RootDir | Component::Prefix(_) => return refuse("is absolute"),
        }
    }
    if path.as_os_str().is_empty() { refuse("is empty") } else { Ok(path) }
}

/// A name for output files from a relative path: without the extension of an image, `_` for the separators.
pub(super) fn flat(path: &Path) -> String {
    let path = if is_image(path) { path.with_extension("") } else { path.to_owned() };
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    parts.join("_")
}

/// `stem` with the first image extension for which a file exists; with `.png` when no such file exists.
pub(super) fn with_image_extension(stem: &Path) -> PathBuf {
    let with = |extension: &str| {
        let mut name = stem.as_os_str().to_owned();
        name.push(".");
        name.push(extension);
        PathBuf::from(name)
    };
    EXTENSIONS.into_iter().map(with).find(|path| path.exists()).unwrap_or_else(|| with(EXTENSIONS[0]))
}

/// Whether a file's name begins with a dot: macOS writes such beside files on foreign drives.
pub(crate) fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."))
}

/// Whether the path ends in the extension of an image, and is not hidden.
pub(crate) fn is_image(path: &Path) -> bool {
    if is_hidden(path) {
        return false;
    }
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    extension.and_then(|e| e.into_string().ok()).is_some_and(|e| EXTENSIONS.contains(&e.as_str()))
}
