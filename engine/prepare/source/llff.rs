//! N3V (DyNeRF) and MeetRoom: `poses_bounds.npy` of LLFF and a video of each camera, in the order of their names.

use std::collections::BTreeMap;

use super::footage::{self, sequence_names, video_names};
use super::recording::{Place, Source, SourceCamera};
use crate::scene::capture::{Faults, is_capture, read_npy};
use crate::scene::undistort::{Distortion, Lens};
use crate::scene::{Intrinsics, Pose, rotation_of_rows};
use glam::DVec3;

const REMEDY: &str = "give the file that came with the videos, and all of them";

/// Whether it is a clip of cameras whose poses `poses_bounds.npy` has: so many videos, or folders of frames. The photographs of LLFF
/// and Mip-NeRF 360 have such a file too, the latter beside COLMAP's model, which says more; the film they were taken from may lie
/// there as well.
pub(super) fn is_n3v(place: Place) -> bool {
    let poses = place.folder.join("poses_bounds.npy");
    let n_clips = || {
        let sequences = sequence_names(place.footage).into_iter().filter(|name| name.starts_with("cam")).count();
        video_names(place.footage).len().max(sequences)
    };
    let n_rows = || read_npy(&poses).ok().and_then(|array| array.shape.first().copied());
    poses.is_file() && (n_rows() == Some(n_clips()) || !is_capture(place.folder))
}

/// A row is three rows of (down, right, back, centre, (height, width, focal length)), then two bounds of depth, which are not
/// needed.
pub(super) fn read(place: Place, faults: &mut Faults) -> Source {
    let calibration = place.folder.join("poses_bounds.npy");
    let mut source = Source { calibration: calibration.clone(), ..Source::default() };
    let Some(array) = faults.take(read_npy(&calibration)) else { return source };
    let &[n, 17] = array.shape.as_slice() else {
        let reason = format!("has the shape {:?}, cameras x 17 is needed", array.shape);
        faults.add(&calibration, "", reason, REMEDY);
        return source;
    };
    let mut names = footage::video_names(place.footage);
    if names.is_empty() {
        names = footage::sequence_names(place.footage);
        names.retain(|name| name.starts_with("cam"));
    }
    if names.len() != n {
        let reason = format!("describes {n} cameras, there are {} videos: {}", names.len(), names.join(", "));
        faults.add(&calibration, "", reason, REMEDY);
        return source;
    }
    for (row, (name, values)) in names.into_iter().zip(array.values.chunks_exact(17)).enumerate() {
        let column = |k: usize| DVec3::new(values[k], values[5 + k], values[10 + k]);
        let [height, width, focal] = column(4).to_array();
        let side = |side: f64| side.fract() == 0.0 && (1.0..=65_536.0).contains(&side);
        if !values.iter().all(|v| v.is_finite()) || !side(width) || !side(height) || focal <= 0.0 {
            faults.add(&calibration, format!("row {row}"), format!("is no camera: {:?}", &values[..15]), REMEDY);
            continue;
        }
        let (width, height) = (width as u32, height as u32);
        let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        let intrinsics = Intrinsics { width, height, fx: focal, fy: focal, cx, cy };
        let lens = Lens { intrinsics, distortion: Distortion::None };
        let rotation = rotation_of_rows([column(1), column(0), -column(2)]);
        let Some(footage) = footage::take(place.footage, &name, &calibration, faults) else { continue };
        let pose = Pose::at(column(3), rotation);
        source.cameras.push(SourceCamera { name, lens, pose, poses: BTreeMap::new(), footage, is_test: false });
    }
    source
}
