//! N3V (DyNeRF) and MeetRoom: `poses_bounds.npy` of LLFF and a video of each camera, in the order of their names.

use std::collections::BTreeMap;

use super::recording::{Place, Source, SourceCamera};
use super::{footage, opencv};
use crate::scene::capture::{Faults, read_npy};
use crate::scene::undistort::{Distortion, Lens};

const REMEDY: &str = "give the file that came with the videos, and all of them";

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
        let column = |k: usize| [values[k], values[5 + k], values[10 + k]];
        let [height, width, focal] = column(4);
        let side = |side: f64| side.fract() == 0.0 && (1.0..=65_536.0).contains(&side);
        if !values.iter().all(|v| v.is_finite()) || !side(width) || !side(height) || focal <= 0.0 {
            faults.add(&calibration, format!("row {row}"), format!("is no camera: {:?}", &values[..15]), REMEDY);
            continue;
        }
        let (width, height) = (width as u32, height as u32);
        let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        let lens = Lens { width, height, fx: focal, fy: focal, cx, cy, distortion: Distortion::None };
        let axes = [column(1), column(0), column(2).map(|v| -v)];
        let Some(footage) = footage::take(place.footage, &name, &calibration, faults) else { continue };
        let pose = opencv::pose_of_axes(axes, column(3));
        source.cameras.push(SourceCamera { name, lens, pose, poses: BTreeMap::new(), footage, is_test: false });
    }
    source
}
