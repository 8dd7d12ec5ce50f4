//! Pictures without cameras: what a source holds of them.

use std::collections::HashSet;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};

use image::{DynamicImage, ExtendedColorType};

use super::foreign::{Kind, converted, counts, decode_image, is_deep, kind, read_size, readable, remedy};
use super::images::take_over;
use super::program::{FFMPEG, FFPROBE};
use super::settings::ImageFormat;
use super::source::footage::{has_video, is_video};
use crate::error::{Error, Result};
use crate::files::{cannot_list, make_folder};
use crate::parallel::in_parallel;
use crate::scene::capture::{is_image, unread_poses};

pub(super) enum Pictures {
    /// A folder of photos of something that stands still.
    Photos(PathBuf),
    /// A video of something that stands still, by a camera that moves.
    Video(PathBuf),
    /// A folder of videos of the same moment, by cameras that stand still.
    Videos(PathBuf),
}

impl Pictures {
    /// The pictures of a path without calibration; nothing where it holds neither photos nor videos.
    pub fn at(path: &Path) -> Option<Pictures> {
        if is_video(path) {
            return Some(Pictures::Video(path.to_owned()));
        }
        if has_video(path) {
            return Some(Pictures::Videos(path.to_owned()));
        }
        let holds_photos = |folder: &Path| {
            let files = fs::read_dir(folder).into_iter().flatten().flatten();
            files.map(|file| file.path()).filter(|file| kind(file) != Kind::Other && file.is_file()).nth(1).is_some()
        };
        [path.to_owned(), path.join("images")].into_iter().find(|folder| holds_photos(folder)).map(Pictures::Photos)
    }

    pub fn name(&self) -> &'static str {
        match self {
            Pictures::Photos(_) => "photos",
            Pictures::Video(_) => "a video",
            Pictures::Videos(_) => "a folder of videos",
        }
    }

    pub fn notes(&self, source: &Path) -> Result<Vec<String>> {
        let mut notes = unread_poses(source);
        if let Pictures::Photos(folder) = self {
            notes.extend(Photos::of(folder)?.notes());
        }
        Ok(notes)
    }
}

/// Names of the pictures of a folder that are read as they are, sorted.
pub(super) fn images(folder: &Path) -> Result<Vec<OsString>> {
    let files = listed(folder)?.into_iter().filter(|file| is_image(file));
    Ok(files.filter_map(|file| file.file_name().map(OsStr::to_owned)).collect())
}

fn listed(folder: &Path) -> Result<Vec<PathBuf>> {
    let files = fs::read_dir(folder).map_err(|fault| cannot_list(folder, &fault))?.flatten();
    let mut files: Vec<PathBuf> = files.map(|file| file.path()).filter(|file| file.is_file()).collect();
    files.sort();
    Ok(files)
}

pub(super) struct Photos {
    folder: PathBuf,
    pub files: Vec<PathBuf>,
    /// Those that cannot be read, and that have no other form.
    pub unread: Vec<PathBuf>,
    /// By what name COLMAP knows each.
    pub names: Vec<OsString>,
    /// True if COLMAP could not read some of them, or their names, as they are: then it is given copies of all.
    pub are_copied: bool,
}

impl Photos {
    pub fn of(folder: &Path) -> Result<Photos> {
        let mut all = listed(folder)?;
        all.retain(|file| kind(file) != Kind::Other);
        if all.iter().any(|file| kind(file) == Kind::Converted) {
            [FFMPEG, FFPROBE].iter().try_for_each(|program| program.require(folder))?;
        }
        // Cameras write some pictures in two forms.
        let own: HashSet<OsString> = all
            .iter()
            .filter(|file| kind(file) == Kind::Own)
            .filter_map(|file| file.file_stem().map(OsStr::to_owned))
            .collect();
        all.retain(|file| kind(file) == Kind::Own || file.file_stem().is_none_or(|stem| !own.contains(stem)));
        let (files, unread) = readable(all);
        let are_copied = files.iter().any(|file| kind(file) != Kind::Own || is_deep(file) || !is_plain(file));
        let mut names: Vec<OsString> = Vec::new();
        for file in &files {
            let mut name =
                if are_copied { plain(file).into() } else { file.file_name().unwrap_or_default().to_owned() };
            while names.contains(&name) {
                name = format!("_{}", name.to_string_lossy()).into();
            }
            names.push(name);
        }
        Ok(Photos { folder: folder.to_owned(), files, unread, names, are_copied })
    }

    pub fn require(&self, least: usize) -> Result<()> {
        if self.files.len() >= least {
            return Ok(());
        }
        let bad = |reason: String, remedy: String| Err(Error::data(&self.folder, "", reason, remedy));
        if !self.unread.is_empty() {
            return bad(format!("holds {}, which are not read here", counts(&self.unread)), remedy(&self.unread));
        }
        let reason = format!("has {} pictures, at least {least} are needed", self.files.len());
        bad(reason, "give more pictures that overlap".to_owned())
    }

    pub fn notes(&self) -> Vec<String> {
        let unread = (!self.unread.is_empty()).then(|| {
            format!(
                "{} are left out, since the installed ffmpeg does not read them: {}",
                counts(&self.unread),
                remedy(&self.unread)
            )
        });
        let deep = self.files.iter().filter(|file| is_deep(file)).count();
        let deep = (deep > 0)
            .then(|| format!("{deep} pictures of 16 bits a colour are kept with 8, since COLMAP reads no others"));
        unread.into_iter().chain(converted(&self.files)).chain(deep).collect()
    }

    pub fn copy(&self, to: &Path, threads: usize, tell: &(dyn Fn(usize, &str) + Sync)) -> Result<()> {
        make_folder(to)?;
        let one = |index: usize| {
            let (from, to) = (&self.files[index], to.join(&self.names[index]));
            if to.is_file() {
                return Ok(());
            }
            if kind(from) == Kind::Own && !is_deep(from) {
                take_over(from, &to)?;
            } else {
                let (width, height) = read_size(from)?;
                write_png(&decode_image(from, width, height)?, &to)?;
            }
            tell(self.files.len(), &self.names[index].to_string_lossy());
            Ok(())
        };
        in_parallel(self.files.len(), threads, one, |_| {}).map(|_| ())
    }
}

fn write_png(image: &DynamicImage, to: &Path) -> Result<()> {
    let (width, height) = (image.width(), image.height());
    let (bytes, kind) = if image.color().has_alpha() {
        (image.to_rgba8().into_raw(), ExtendedColorType::Rgba8)
    } else {
        (image.to_rgb8().into_raw(), ExtendedColorType::Rgb8)
    };
    ImageFormat::Png.write(to, &bytes, (width, height), kind)
}

/// True if COLMAP's lists of names, which have a line for each, can hold a file's name.
fn is_plain(file: &Path) -> bool {
    file.file_name().and_then(OsStr::to_str).is_some_and(|name| name == name.trim() && !name.contains(char::is_control))
}

/// A name that such lists hold, and that ends as what [`Photos::copy`] writes.
fn plain(file: &Path) -> String {
    let file = if kind(file) == Kind::Converted { file.with_extension("png") } else { file.to_owned() };
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    name.trim().replace(char::is_control, "_")
}
