//! From images to cameras.

use std::collections::HashMap;

use super::entry::Entry;
use crate::scene::Intrinsics;
use crate::scene::capture::builder::CaptureBuilder;
use crate::scene::capture::camera::Camera;

/// Images of one place, lens and part at different frames are one camera.
pub(super) fn group(entries: Vec<Entry>, builder: &mut CaptureBuilder) {
    let cameras = &mut builder.cameras;
    let mut known: HashMap<(Vec<u64>, bool), usize> = HashMap::new();
    for Entry { camera, distortion, shot, .. } in entries {
        let Intrinsics { width, height, fx, fy, cx, cy } = camera.intrinsics;
        let (pose, lens) = (camera.world_to_camera.rows(), [fx, fy, cx, cy, width.into(), height.into()]);
        let numbers = pose.as_flattened().iter().chain(&lens);
        let key = (numbers.map(|v| v.to_bits()).collect(), camera.is_test);
        let at = known.get(&key).copied();
        match at.filter(|&at| cameras[at].shots.iter().all(|other| other.frame != shot.frame)) {
            Some(at) => cameras[at].shots.push(shot),
            None => {
                known.insert(key, cameras.len());
                builder.distorted.insert(camera.name.clone(), distortion);
                cameras.push(Camera { shots: vec![shot], ..camera });
            }
        }
    }
}
