//! Cameras, and what they see.

use crate::common::prelude::*;
use ivv::internals::scene::undistort::Lens;
use ivv::internals::sound::keypoints::{Mouth, Mouths};
use ivv::internals::sound::rig::{Rig, RigCamera};
use ivv::internals::sound::triangulate::Sight;

pub fn normal(random: &mut Random) -> f64 {
    let (u, v) = (random.uniform(0.0, 1.0), random.uniform(0.0, std::f64::consts::TAU));
    (-2.0 * (1.0 - u).ln()).sqrt() * v.cos()
}

/// `n` cameras on an arc of 120 degrees about `(0, 0, 3)`, 3 units from it, looking there.
pub fn rig(n: usize, fps: f64, n_frames: u32) -> Rig {
    let intrinsics = Intrinsics { width: 1280, height: 720, fx: 1000.0, fy: 990.0, cx: 630.0, cy: 370.0 };
    let lens = Lens { intrinsics, distortion: Distortion::None };
    let camera = |index: usize| {
        let angle = (index as f64 / (n - 1) as f64 - 0.5) * 120_f64.to_radians();
        let center = DVec3::new(3.0 * angle.sin(), 0.2 * (index % 2) as f64, 3.0 - 3.0 * angle.cos());
        let forward = (DVec3::new(0.0, 0.0, 3.0) - center).normalize();
        let right = DVec3::Y.cross(forward).normalize();
        let rotation = DMat3::from_cols(right, forward.cross(right), forward).transpose();
        let pose = Pose { rotation, translation: -(rotation * center) };
        RigCamera::new(&format!("cam{index:02}"), lens, &[(0, pose)]).unwrap()
    };
    Rig { cameras: (0..n).map(camera).collect(), fps, n_frames }
}

pub fn pixel(camera: &RigCamera, point: DVec3) -> DVec2 {
    let local = camera.pose(0.0).to_camera(point);
    assert!(local.z > 0.0);
    let Intrinsics { fx, fy, cx, cy, .. } = camera.lens.intrinsics;
    local.truncate() / local.z * DVec2::new(fx, fy) + DVec2::new(cx, cy)
}

/// What each camera sees of `point` with noise of `sigma` pixels; exactly, and believed to a pixel, where it is 0.
pub fn sights(rig: &Rig, point: DVec3, sigma: f64, random: &mut Random) -> Vec<Sight> {
    let sight = |(index, camera): (usize, &RigCamera)| {
        let noise = DVec2::new(normal(random), normal(random)) * sigma;
        let (pose, focal) = (camera.pose(0.0), camera.lens.intrinsics.focal());
        let at = camera.plane(pixel(camera, point) + noise).unwrap();
        let sigma = if sigma > 0.0 { sigma } else { 1.0 };
        Sight { camera: index, pose, focal, at, sigma, weight: 1.0 }
    };
    rig.cameras.iter().enumerate().map(sight).collect()
}

/// The mouths that each camera sees, with noise of a pixel; `place` gives them by the time in frames and the camera.
pub fn mouths(rig: &Rig, seed: u64, place: impl Fn(f64, usize) -> Vec<DVec3>) -> Vec<Mouths> {
    let mut random = Random::new(seed);
    let mut of = |index: usize, camera: &RigCamera| {
        let mut mouths = Mouths::default();
        for frame in 0..rig.n_frames {
            for point in place(f64::from(frame) + camera.offset, index) {
                let at = pixel(camera, point) + DVec2::new(normal(&mut random), normal(&mut random));
                let width = 0.05 * camera.lens.intrinsics.fx / camera.pose(0.0).to_camera(point).z;
                let mouth = Mouth { at, sigma: 1.0, weight: 0.9, width, opening: Some(0.1), approx: false };
                mouths.frames.entry(frame).or_default().push(mouth);
            }
        }
        mouths
    };
    rig.cameras.iter().enumerate().map(|(index, camera)| of(index, camera)).collect()
}
