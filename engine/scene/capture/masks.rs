//! Masks beside the images of others' captures, as COLMAP, Postshot and LichtFeld Studio name them in `masks`. Black is left out.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::{CaptureBuilder, listed, read_size};

const FOLDERS: [&str; 2] = ["masks", "mask"];

/// Gives each image its mask of the same size: `masks/NAME.png` for `images/NAME`, with or without the image's ending, or
/// `NAME_mask.png`.
pub(super) fn find(folder: &Path, images: &Path, builder: &mut CaptureBuilder) {
    let Some(masks) = FOLDERS.map(|name| folder.join(name)).into_iter().find(|masks| masks.is_dir()) else { return };
    let mut by_name: HashMap<String, PathBuf> = HashMap::new();
    for file in listed(&masks, 3) {
        let name = file.with_extension("").to_string_lossy().to_lowercase();
        by_name.insert(name, masks.join(file));
    }
    let (mut n, mut n_unfit) = (0_usize, 0_usize);
    let mut shots: Vec<_> = builder.cameras.iter_mut().flat_map(|camera| &mut camera.shots).collect();
    let n_images = shots.len();
    for shot in shots.iter_mut().filter(|shot| shot.mask.is_none()) {
        let alone = || Path::new(shot.image.file_name().unwrap_or_default());
        let name = shot.image.strip_prefix(images).unwrap_or_else(|_| alone()).to_string_lossy().to_lowercase();
        let stem = Path::new(&name).with_extension("").to_string_lossy().into_owned();
        let tried = [name, format!("{stem}_mask"), stem];
        let Some(mask) = tried.iter().find_map(|name| by_name.get(name)) else { continue };
        match (read_size(mask), read_size(&shot.image)) {
            (Ok(of_mask), Ok(of_image)) if of_mask == of_image => {
                n += 1;
                shot.mask = Some(mask.clone());
            }
            (_, Ok(_)) => n_unfit += 1,
            // Without the image its mask is of no use.
            _ => {}
        }
    }
    let name = masks.file_name().unwrap_or_default().to_string_lossy();
    if n > 0 {
        let of = format!("{n} of {n_images}");
        builder.notes.push(format!("images that have a mask in {name}: {of}; what is black there is left out"));
    }
    if n_unfit > 0 {
        let unfit = format!("masks in {name} that are not of the size of their images");
        builder.notes.push(format!("{unfit}: {n_unfit}; they are not used"));
    }
}
