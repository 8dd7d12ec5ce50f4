//! Names in a capture's files. An attacker may have written them: none may lead out of the capture.

use std::path::{Path, PathBuf};

const MAX_BYTES: usize = 4096;
const EXTENSIONS: [&str; 3] = ["png", "jpg", "jpeg"];

/// Refuses a name that is not plainly one of a file below its folder.
pub(crate) fn relative(name: &str) -> Result<(), String> {
    let spelled = spelled(name)?;
    let refuse = |why: &str| Err(refused(name, why));
    if spelled.has_backslash {
        refuse("has a backslash")
    } else if name.split('/').any(|part| part == "..") {
        refuse("has `..`, which leads out of the capture")
    } else if spelled.leads_out {
        refuse("is absolute, or begins with a drive")
    } else {
        Ok(())
    }
}

fn refused(name: &str, why: &str) -> String {
    let start: String = name.chars().take(80).collect();
    format!("the name `{}` {why}", start.escape_debug())
}

/// A name as a file spells it, without what leads out of the capture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spelled {
    pub path: PathBuf,
    pub has_backslash: bool,
    /// It was absolute, began with a drive, or had a `..` that leads out of its folder.
    pub leads_out: bool,
}

/// The path that `name` spells below the capture, with Windows' separators read as `/`; or why it is refused.
pub(crate) fn spelled(name: &str) -> Result<Spelled, String> {
    let refuse = |why: &str| Err(refused(name, why));
    if name.len() > MAX_BYTES {
        return refuse(&format!("has {} bytes, at most {MAX_BYTES} are allowed", name.len()));
    }
    if name.chars().any(char::is_control) {
        return refuse("has a control character");
    }
    let has_backslash = name.contains('\\');
    let slashed = name.replace('\\', "/");
    let has_drive = slashed.as_bytes().get(1) == Some(&b':') && slashed.as_bytes()[0].is_ascii_alphabetic();
    let rest = if has_drive { &slashed[2..] } else { &slashed };
    let mut leads_out = has_drive || rest.starts_with('/');
    let mut path = PathBuf::new();
    for part in rest.split('/') {
        match part {
            "" | "." => {}
            ".." => leads_out |= !path.pop(),
            part => path.push(part),
        }
    }
    if path.as_os_str().is_empty() { refuse("is empty") } else { Ok(Spelled { path, has_backslash, leads_out }) }
}

/// The key that sorts names as people count: numbers by their value, the rest as text, leading zeros last.
pub(crate) fn by_number(name: &str) -> (Vec<(String, usize, String)>, String) {
    let (mut parts, mut rest) = (Vec::new(), name);
    while !rest.is_empty() {
        let (text, other) = rest.split_at(rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len()));
        let (digits, after) = other.split_at(other.find(|c: char| !c.is_ascii_digit()).unwrap_or(other.len()));
        // A digit stands for all of them where text is compared with it.
        let text = if digits.is_empty() { text.to_owned() } else { format!("{text}0") };
        let number = digits.trim_start_matches('0');
        parts.push((text, number.len(), number.to_owned()));
        rest = after;
    }
    (parts, name.to_owned())
}

/// A relative path as a name for files: without the extension of an image, with `_` for the separators.
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

/// True if a file's name begins with a dot: macOS writes such beside files on foreign drives.
pub(crate) fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."))
}

/// As [`is_image`], or an image of a kind that is not read.
pub(super) fn is_picture(path: &Path) -> bool {
    const OTHERS: [&str; 12] =
        ["tif", "tiff", "webp", "heic", "heif", "avif", "bmp", "exr", "gif", "jxl", "dng", "ppm"];
    is_image(path) || ends_in(path, &OTHERS)
}

/// True for an image that is read, by its extension, and is not hidden.
pub(crate) fn is_image(path: &Path) -> bool {
    ends_in(path, &EXTENSIONS)
}

fn ends_in(path: &Path, extensions: &[&str]) -> bool {
    let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    !is_hidden(path) && extension.is_some_and(|e| extensions.contains(&e.as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_nowhere_but_below_the_capture() {
        let below = |name: &str| spelled(name).map(|found| (found.path, found.has_backslash, found.leads_out));
        for (name, path, has_backslash, leads_out) in [
            ("./images//a.png", "images/a.png", false, false),
            ("images\\a b.png", "images/a b.png", true, false),
            ("C:\\Users\\x\\a.png", "Users/x/a.png", true, true),
            ("C:a.png", "a.png", false, true),
            ("\\\\server\\share\\a.png", "server/share/a.png", true, true),
            ("/etc/passwd", "etc/passwd", false, true),
            ("../../images/a.png", "images/a.png", false, true),
            ("x/../a.png", "a.png", false, false),
            ("x/../../a.png", "a.png", false, true),
        ] {
            assert_eq!(below(name), Ok((PathBuf::from(path), has_backslash, leads_out)), "{name}");
        }
        for (name, says) in
            [("", "is empty"), ("..", "is empty"), ("C:\\", "is empty"), ("a\u{1}", "control character")]
        {
            assert!(below(name).unwrap_err().contains(says), "{name}");
        }
        assert!(below(&"x".repeat(5000)).unwrap_err().contains("at most 4096"));
    }

    #[test]
    fn numbers_sort_as_numbers() {
        let mut names: Vec<PathBuf> =
            ["cam_10", "cam_2", "cam_02", "a/2", "a/10", "cam", "cam_1x", "cam_1", "99999999999999999999", "é2"]
                .map(PathBuf::from)
                .into();
        names.sort_by_cached_key(|path| by_number(&path.to_string_lossy()));
        let expected =
            ["99999999999999999999", "a/2", "a/10", "cam", "cam_1", "cam_1x", "cam_02", "cam_2", "cam_10", "é2"];
        assert_eq!(names, expected.map(PathBuf::from));
    }
}
