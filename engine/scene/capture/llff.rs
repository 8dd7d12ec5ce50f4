//! LLFF's photographs: `poses_bounds.npy` with a row for each image of a folder `images`, in their order.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use super::{CaptureBuilder, CaptureSettings, Faults, Named, flat, images_folder, images_of, whole_side};
use crate::error::{Error, Result};
use crate::files::npy::read_npy;
use crate::scene::pose::rotation_of_rows;
use crate::scene::undistort::{Distortion, Lens};
use crate::scene::{Intrinsics, Pose};
use glam::DVec3;

const REMEDY: &str = "give the file that came with the images, and all of them";
/// Numbers of a row: three rows of (down, right, back, centre, (height, width, focal length)), then two bounds of depth.
const N_COLUMNS: usize = 17;

/// True if the poses are those of photographs: there are images, and not the videos or folders of frames of a clip.
pub(super) fn is_static(named: &Named) -> bool {
    let folder = &named.folder;
    let has_images = || !images_of(&images_folder(folder, &CaptureSettings::default())).is_empty();
    folder.join("poses_bounds.npy").is_file() && has_images()
}

pub(super) fn read(named: &Named, settings: &CaptureSettings, faults: &mut Faults) -> CaptureBuilder {
    let path = named.folder.as_path();
    let calibration = path.join("poses_bounds.npy");
    let mut builder = CaptureBuilder::still(settings, calibration.clone());
    let Some(rows) = faults.take(read_rows(&calibration, REMEDY)) else { return builder };
    let images = images_folder(path, settings);
    let names = images_of(&images);
    let n = rows.len();
    let at = images.strip_prefix(path).unwrap_or(&images).display().to_string();
    if names.len() != n {
        let reason = format!("describes {n} images, there are {} in {at}", names.len());
        let remedy = "only their order tells which row is whose: give all images, or name their folder with --images";
        faults.add(&calibration, "", reason, remedy);
        return builder;
    }
    if images != path.join(&settings.images) && settings.downscale.is_none() {
        builder.notes.push(format!("there is no folder {}: {at} is taken", settings.images.display()));
    }
    let names = ordered(names, &rows, &mut builder.notes);
    for (index, (name, values)) in names.iter().zip(rows).enumerate() {
        match camera_of_row(&values) {
            Ok((intrinsics, pose)) => {
                let lens = Lens { intrinsics, distortion: Distortion::None };
                builder.add_still(flat(name), lens, pose, images.join(name), settings);
            }
            Err(reason) => faults.add(&calibration, format!("row {index}"), reason, REMEDY),
        }
    }
    builder
}

fn column(values: &[f64], k: usize) -> DVec3 {
    DVec3::new(values[k], values[5 + k], values[10 + k])
}

pub(crate) fn read_rows(path: &Path, remedy: &str) -> Result<Vec<Vec<f64>>> {
    let array = read_npy(path)?;
    match array.shape.as_slice() {
        &[_, N_COLUMNS] => Ok(array.values.chunks_exact(N_COLUMNS).map(<[f64]>::to_vec).collect()),
        shape => {
            let reason = format!("has the shape {shape:?}, cameras x {N_COLUMNS} is needed");
            Err(Error::data(path, "", reason, remedy))
        }
    }
}

pub(crate) fn camera_of_row(values: &[f64]) -> std::result::Result<(Intrinsics, Pose), String> {
    let [height, width, focal] = column(values, 4).to_array();
    let (Some(columns), Some(rows), true) =
        (whole_side(width), whole_side(height), values.iter().all(|v| v.is_finite()) && focal > 0.0)
    else {
        return Err(format!("is no camera: {:?}", &values[..15]));
    };
    let intrinsics =
        Intrinsics { width: columns, height: rows, fx: focal, fy: focal, cx: width / 2.0, cy: height / 2.0 };
    let rotation = rotation_of_rows([column(values, 1), column(values, 0), -column(values, 2)]);
    Ok((intrinsics, Pose::at(column(values, 3), rotation)))
}

/// The images in the order of the rows. Writers sort by number or as text; where these differ, neighbours should be near in space.
fn ordered(by_number: Vec<PathBuf>, rows: &[Vec<f64>], notes: &mut Vec<String>) -> Vec<PathBuf> {
    let mut by_text = by_number.clone();
    by_text.sort();
    let Some(at) = by_number.iter().zip(&by_text).position(|(a, b)| a != b) else { return by_number };
    // Along the images by their numbers, for either order of the rows.
    let way = |order: &[PathBuf]| {
        let row = |name: &PathBuf| order.iter().position(|other| other == name).map(|row| column(&rows[row], 3));
        let places: Vec<DVec3> = by_number.iter().filter_map(row).collect();
        places.windows(2).map(|pair| pair[0].distance(pair[1])).sum::<f64>()
    };
    let is_by_text = way(&by_text).partial_cmp(&way(&by_number)) == Some(Ordering::Less);
    let (taken, other) = if is_by_text { ("text", "numbers") } else { ("numbers", "text") };
    let show = |name: &Path| name.display().to_string();
    notes.push(format!(
        "the order of images by their numbers ({} at {at}) is not that by their text ({}): rows are taken in that of their {taken}, \
         which makes a shorter way along the cameras than that of their {other}",
        show(&by_number[at]),
        show(&by_text[at])
    ));
    if is_by_text { by_text } else { by_number }
}
