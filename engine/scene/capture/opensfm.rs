//! OpenSfM's and ODM's `reconstruction.json`: normalised lenses, poses from world to camera as rotation vectors, points.

use std::collections::BTreeMap;
use std::path::Path;

use super::{CaptureBuilder, CaptureSettings, Faults, Named, Point, Wanted, check_place, flat, spelled, whole_side};
use crate::files::read_json;
use crate::scene::undistort::{Distortion, Lens};
use crate::scene::{Intrinsics, Pose};
use glam::{DMat3, DQuat, DVec3};

const FILE: &str = "reconstruction.json";
const REMEDY: &str = "correct the file, or export the reconstruction again";

#[derive(serde::Deserialize)]
struct Reconstruction {
    cameras: BTreeMap<String, Projection>,
    shots: BTreeMap<String, PosedShot>,
    #[serde(default)]
    points: BTreeMap<String, Track>,
}

/// A lens. Lengths are multiples of the picture's larger side, the principal point is counted from its middle.
#[derive(Default, serde::Deserialize)]
#[serde(default)]
struct Projection {
    projection_type: Option<String>,
    width: f64,
    height: f64,
    focal: Option<f64>,
    focal_x: Option<f64>,
    focal_y: Option<f64>,
    c_x: f64,
    c_y: f64,
    k1: f64,
    k2: f64,
    k3: f64,
    k4: f64,
    p1: f64,
    p2: f64,
}

#[derive(serde::Deserialize)]
struct PosedShot {
    rotation: [f64; 3],
    translation: [f64; 3],
    camera: String,
}

#[derive(serde::Deserialize)]
struct Track {
    color: [f64; 3],
    coordinates: [f64; 3],
}

pub(super) fn is_reconstruction(named: &Named) -> bool {
    file(&named.folder).is_some()
}

fn file(folder: &Path) -> Option<std::path::PathBuf> {
    [folder.join(FILE), folder.join("opensfm").join(FILE)].into_iter().find(|file| file.is_file())
}

pub(super) fn read(named: &Named, settings: &CaptureSettings, faults: &mut Faults) -> CaptureBuilder {
    let path = named.folder.as_path();
    let file = file(path).unwrap_or_else(|| path.join(FILE));
    let mut builder = CaptureBuilder::still(settings, file.clone());
    let parts = faults.take(read_json::<Vec<Reconstruction>>(&file, "reconstruction of OpenSfM", REMEDY));
    let Some(mut parts) = parts else { return builder };
    let sizes: Vec<String> = parts.iter().map(|part| part.shots.len().to_string()).collect();
    // The first of those that are as large.
    let largest = (0..parts.len()).max_by_key(|at| (parts[*at].shots.len(), std::cmp::Reverse(*at)));
    let Some(part) = largest.map(|at| parts.swap_remove(at)).filter(|part| !part.shots.is_empty()) else {
        faults.add(&file, "", "holds no shot", "reconstruct again");
        return builder;
    };
    if sizes.len() > 1 {
        let (n, listed) = (sizes.len(), sizes.join(", "));
        builder.notes.push(format!("the reconstruction has {n} parts, of {listed} images: the largest is taken"));
    }
    let (mut shots, mut wanted) = (Vec::new(), Vec::new());
    for (name, shot) in &part.shots {
        match spelled(name).and_then(|spelled| Ok((spelled, part.lens(shot)?))) {
            Ok((spelled, lens)) => {
                shots.push((flat(&spelled.path), lens, shot));
                wanted.push(Wanted::from(spelled));
            }
            Err(reason) => faults.add(&file, format!("shot `{}`", name.escape_debug()), reason, REMEDY),
        }
    }
    let images = path.join(&settings.images);
    let root = if settings.asked_images().is_some() { &images } else { path };
    let located = builder.locate(root, &images, &file, &wanted);
    for ((name, lens, shot), (image, _)) in shots.into_iter().zip(located) {
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::from(shot.rotation)));
        let pose = Pose { rotation, translation: DVec3::from(shot.translation) };
        builder.add_still(name, lens, pose, image, settings);
    }
    for (id, Track { color, coordinates }) in part.points {
        match check_place(coordinates) {
            Ok(()) => {
                let color = color.map(|level| level.clamp(0.0, 255.0).round() as u8);
                builder.points.push(Point { position: coordinates, color });
            }
            Err(reason) => faults.add(&file, format!("point `{}`", id.escape_debug()), reason, REMEDY),
        }
    }
    builder
}

impl Reconstruction {
    fn lens(&self, shot: &PosedShot) -> Result<Lens, String> {
        let name = shot.camera.escape_debug();
        let given =
            self.cameras.get(&shot.camera).ok_or_else(|| format!("was taken by `{name}`, which is not listed"))?;
        let &Projection { width, height, c_x, c_y, k1, k2, k3, k4, p1, p2, .. } = given;
        let (Some(columns), Some(rows)) = (whole_side(width), whole_side(height)) else {
            return Err(format!("has {width} x {height} pixels"));
        };
        let distortion = match given.projection_type.as_deref().unwrap_or("perspective") {
            "perspective" => Distortion::brown([k1, k2, 0.0, 0.0, 0.0, 0.0], [0.0; 2]),
            "brown" => Distortion::brown([k1, k2, k3, 0.0, 0.0, 0.0], [p1, p2]),
            "fisheye" => Distortion::Fisheye([k1, k2, 0.0, 0.0]),
            "fisheye_opencv" => Distortion::Fisheye([k1, k2, k3, k4]),
            kind => return Err(format!("has a {} lens, which is not undistorted here", kind.escape_debug())),
        };
        let side = width.max(height);
        let [Some(fx), Some(fy)] = [given.focal_x, given.focal_y].map(|focal| Some(focal.or(given.focal)? * side))
        else {
            return Err("has a lens without focal length".to_owned());
        };
        let (cx, cy) = (width / 2.0 + c_x * side, height / 2.0 + c_y * side);
        let intrinsics = Intrinsics { width: columns, height: rows, fx, fy, cx, cy };
        Ok(Lens { intrinsics, distortion })
    }
}
