//! Choice of a project's model: COLMAP's mapper writes one for each part that it could not join to the others.

use std::path::{Path, PathBuf};

use super::bin::n_images as n_in_binary;
use super::raw::{STEMS, is_there};
use super::text::images as images_in_text;
use crate::error::{Error, Result};
use crate::scene::capture::named::{is_model, models};
use crate::scene::capture::{CaptureSettings, Faults};

fn n_images(folder: &Path) -> usize {
    match is_there(folder, STEMS[1]) {
        Some((file, true)) => n_in_binary(&file),
        Some((file, false)) => images_in_text(&file, &mut Faults::default()).0.len(),
        None => 0,
    }
}

/// The folder of a COLMAP model in a project: that of the most images in `sparse`, `sparse` itself or the project itself.
pub(crate) fn model_folder(path: &Path) -> Option<PathBuf> {
    chosen_model(path, &CaptureSettings::default()).ok().flatten().map(|(folder, _)| folder)
}

/// The model that the settings ask for, or else as [`model_folder`]; with a note where there are several.
pub(crate) fn chosen_model(path: &Path, settings: &CaptureSettings) -> Result<Option<(PathBuf, Option<String>)>> {
    let sparse = path.join("sparse");
    let models = models(&sparse);
    let name = |model: &Path| model.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if models.len() < 2 && settings.model.is_none() {
        let alone = models.into_iter().next();
        let found = alone.or_else(|| [sparse, path.to_owned()].into_iter().find(|folder| is_model(folder)));
        return Ok(found.map(|folder| (folder, None)));
    }
    let sizes: Vec<usize> = models.iter().map(|model| n_images(model)).collect();
    let listed: Vec<String> =
        models.iter().zip(&sizes).map(|(model, n)| format!("{} with {n} images", name(model))).collect();
    let listed = listed.join(", ");
    let taken = match settings.model {
        Some(asked) => models.iter().position(|model| name(model) == asked.to_string()).ok_or_else(|| {
            let reason = format!("there is no model {asked} in sparse");
            let remedy = if listed.is_empty() { "leave it out".to_owned() } else { format!("choose one of: {listed}") };
            Error::data(path, "--model", reason, remedy)
        })?,
        // The first of those that are as large.
        None => (0..models.len()).max_by_key(|at| (sizes[*at], std::cmp::Reverse(*at))).unwrap_or(0),
    };
    let note =
        format!("sparse has {} models: {listed}; taken: {} (--model chooses)", models.len(), name(&models[taken]));
    Ok(Some((models[taken].clone(), (models.len() > 1).then_some(note))))
}
