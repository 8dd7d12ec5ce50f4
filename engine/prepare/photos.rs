//! Photographs of the static scene, taken at another time than the clip (`ivv prepare --static`): a capture of one frame inside the
//! clip's. Without cameras, COLMAP places both together, so that photographs tie cameras together; else they share the source's world.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use super::pictures::{Photos, Pictures};
use super::program::COLMAP;
use super::settings::{PrepareSettings, Triangulate};
use super::source::Source;
use crate::error::{Error, Result};
use crate::files::{make_folder, write_atomic};
use crate::scene::capture::{CaptureSettings, Frames, PHOTOS, is_capture};

/// Photographs that COLMAP places together with the cameras.
#[derive(Default)]
pub(super) struct Together {
    /// Below the folder of all pictures, with its name, as COLMAP knows them.
    pub names: Vec<OsString>,
    pub notes: Vec<String>,
}

pub(super) fn check(settings: &PrepareSettings, pictures: Option<&Pictures>) -> Result<()> {
    let Some(photos) = &settings.photos else { return Ok(()) };
    let bad = |reason: &str, remedy: &str| Err(Error::data(photos, "--static", reason, remedy));
    match pictures {
        Some(Pictures::Videos(_)) => match Pictures::at(photos) {
            Some(Pictures::Photos(_)) if !is_capture(photos) => Ok(()),
            _ => bad(
                "is no folder of photographs without cameras, as the videos are without them",
                "give a folder with two photographs or more",
            ),
        },
        Some(_) => {
            bad("is for the videos of a rig; this source is photographs itself", "put all of them into one folder")
        }
        None if is_capture(photos) => Ok(()),
        None => bad(
            "has no cameras, and the source has some: the photographs must be in the same world",
            "give a COLMAP project or another capture of them in the world of the source, or videos without calibration as the source",
        ),
    }
}

impl Together {
    pub fn take(settings: &PrepareSettings, images: &Path) -> Result<Together> {
        let Some(Pictures::Photos(from)) = settings.photos.as_deref().and_then(Pictures::at) else {
            return Ok(Together::default());
        };
        let photos = Photos::of(&from)?;
        photos.copy(&images.join(PHOTOS), settings.threads, &|_, _| {})?;
        let names = photos.names.iter().map(|name| Path::new(PHOTOS).join(name).into_os_string()).collect();
        Ok(Together { names, notes: photos.notes() })
    }

    pub fn has(&self, name: &Path) -> bool {
        self.names.iter().any(|own| Path::new(own) == name)
    }

    /// Splits `model` into one of the `cameras` and one of the photographs, in folders beside it; the model itself without photographs.
    pub fn split(&self, model: &Path, cameras: &[OsString], about: &Path) -> Result<(PathBuf, Option<PathBuf>)> {
        if self.names.is_empty() {
            return Ok((model.to_owned(), None));
        }
        let without = |others: &[OsString], name: &str| -> Result<PathBuf> {
            let (list, to) = (model.with_file_name(format!("{name}.txt")), model.with_file_name(name));
            let text = others.iter().map(|name| name.to_string_lossy() + "\n").collect::<String>();
            write_atomic(&list, |to| to.write_all(text.as_bytes()))?;
            make_folder(&to)?;
            let paths = [("--input_path", model), ("--output_path", &to), ("--image_names_path", &list)];
            let paths = paths.iter().flat_map(|(name, path)| [OsStr::new(name), path.as_os_str()]);
            COLMAP.run([OsStr::new("image_deleter")].into_iter().chain(paths), about)?;
            Ok(to)
        };
        Ok((without(&self.names, "of-cameras")?, Some(without(cameras, "of-photos")?)))
    }
}

/// How the photographs of `settings`, or those that the source came with, are prepared; nothing where there are none.
pub(super) fn settings_of(settings: &PrepareSettings, source: &Source) -> Option<PrepareSettings> {
    let from = settings.photos.clone().or_else(|| source.photos.clone())?;
    // COLMAP's project has its pictures elsewhere.
    let is_own = from.starts_with(&settings.output);
    let asked = &settings.capture;
    let images = if is_own { asked.images.clone() } else { CaptureSettings::default().images };
    Some(PrepareSettings {
        scale: settings.scale,
        format: settings.format,
        triangulate: Some(Triangulate::None),
        capture: CaptureSettings {
            images,
            test_every: 0,
            skip_missing: asked.skip_missing,
            rescale: asked.rescale,
            alpha: asked.alpha,
            ..CaptureSettings::default()
        },
        force: settings.force,
        threads: settings.threads,
        frames: Frames::default(),
        ..PrepareSettings::new(&from, &settings.output.join(PHOTOS))
    })
}
