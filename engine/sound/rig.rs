//! The cameras of a capture as the localiser needs them: lenses, poses, clocks; no image is read.

use std::path::Path;

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::path::Convention;
use super::pose::{HeadPose, PoseTrack};
use crate::error::{Error, Result};
use crate::files::read_json;
use crate::scene::Pose;
use crate::scene::capture::{Camera, CaptureSettings, Faults, camera_place, describe};
use crate::scene::undistort::Lens;

/// A camera with its clock.
#[derive(Clone, Debug)]
pub struct RigCamera {
    pub name: String,
    /// Distortion included.
    pub lens: Lens,
    /// By frame, from world to camera, and the centre; a camera that stands still has one.
    poses: Vec<(f64, DQuat, DVec3)>,
    /// Its picture of frame f is of frame f + this.
    pub offset: f64,
    reach: f64,
}

impl RigCamera {
    /// A camera with its poses by frame, at least one; `None` without.
    pub fn new(name: &str, lens: Lens, poses: &[(u32, Pose)]) -> Option<RigCamera> {
        let pose = |(frame, pose): &(u32, Pose)| (f64::from(*frame), DQuat::from_mat3(&pose.rotation), pose.center());
        let poses: Vec<_> = poses.iter().map(pose).collect();
        let reach = lens.reach();
        (!poses.is_empty()).then(|| RigCamera { name: name.to_owned(), lens, poses, offset: 0.0, reach })
    }

    /// Where it is at a frame of its own clock: between two poses it turns evenly and its centre moves along a line.
    pub fn pose(&self, frame: f64) -> Pose {
        let next = self.poses.partition_point(|(at, ..)| *at <= frame).min(self.poses.len() - 1);
        let (from, to) = (self.poses[next.saturating_sub(1)], self.poses[next]);
        let part = if to.0 > from.0 { ((frame - from.0) / (to.0 - from.0)).clamp(0.0, 1.0) } else { 0.0 };
        Pose::at(from.2.lerp(to.2, part), DMat3::from_quat(from.1.slerp(to.1, part)))
    }

    /// The camera as a head, or as a microphone, in the clip's time.
    pub fn head(&self, fps: f64) -> Result<PoseTrack> {
        let pose = |(frame, rotation, center): &(f64, DQuat, DVec3)| HeadPose {
            t: (frame + self.offset) / fps,
            p: *center,
            q: rotation.inverse() * Convention::OpenCv.of_head(),
        };
        PoseTrack::new(self.poses.iter().map(pose).collect())
    }

    /// The point of the plane at distance 1 that a pixel shows.
    pub fn plane(&self, pixel: DVec2) -> Option<DVec2> {
        self.lens.plane(pixel.to_array(), self.reach).map(DVec2::from_array)
    }
}

#[derive(Clone, Debug)]
pub struct Rig {
    /// Training and test cameras.
    pub cameras: Vec<RigCamera>,
    pub fps: f64,
    pub n_frames: u32,
}

/// A row of `offsets.json`.
#[derive(serde::Deserialize)]
struct Offset {
    camera: String,
    offset: f64,
}

impl Rig {
    /// Reads the calibration of a capture in any known format. Keypoints are of the pictures as they were taken, distortion included.
    pub fn open(path: &Path) -> Result<Rig> {
        Self::open_with(path, &CaptureSettings::default())
    }

    pub fn open_with(path: &Path, settings: &CaptureSettings) -> Result<Rig> {
        let mut faults = Faults::default();
        let mut described = describe(path, settings, &mut faults);
        if let Some((_, builder)) = &mut described {
            builder.cut(path, settings.frames, &mut faults);
        }
        if let Some(error) = faults.first() {
            return Err(error);
        }
        let remedy = "give a capture folder; `ivv prepare` makes one";
        let (_, builder) = described.ok_or_else(|| Error::data(path, "", "not a recognised capture", remedy))?;
        let bad = |place: String, reason: String| {
            Err(Error::data(&builder.calibration, place, reason, "`ivv check` lists all faults of the capture"))
        };
        if !(builder.fps.is_finite() && builder.fps > 0.0) || builder.n_frames == 0 {
            return bad(String::new(), format!("has {} frames, {} a second", builder.n_frames, builder.fps));
        }
        for camera in &builder.cameras {
            let shots = camera.shots.iter().filter_map(|shot| shot.world_to_camera.as_ref());
            let is_finite = |pose: &Pose| pose.rotation.is_finite() && pose.translation.is_finite();
            let all_finite = shots.chain([&camera.world_to_camera]).all(is_finite);
            let not_finite = || (!all_finite).then(|| "has a pose that is not finite".to_owned());
            if let Some(reason) = builder.lens(camera).fault().or_else(not_finite) {
                return bad(camera_place(&camera.name), reason);
            }
        }
        let camera = |camera: &Camera| {
            let moving: Vec<(u32, Pose)> =
                camera.shots.iter().filter_map(|shot| Some((shot.frame, shot.world_to_camera?))).collect();
            let poses = if moving.is_empty() { vec![(0, camera.world_to_camera)] } else { moving };
            RigCamera::new(&camera.name, builder.lens(camera), &poses)
        };
        let cameras = builder.cameras.iter().filter_map(camera).collect();
        Ok(Rig { cameras, fps: builder.fps, n_frames: builder.n_frames })
    }

    /// Up: the mean of the cameras' upper sides at the beginning; minus y where they have none in common.
    pub fn up(&self) -> DVec3 {
        let sum: DVec3 = self.cameras.iter().map(|camera| -camera.pose(0.0).down()).sum();
        sum.try_normalize().unwrap_or(DVec3::NEG_Y)
    }

    /// Takes the clocks from the `offsets.json` that `ivv train` writes; a camera that it does not name keeps the true time.
    pub fn read_offsets(&mut self, path: &Path) -> Result<()> {
        let remedy = "give the offsets.json of a run on this capture";
        let rows: Vec<Offset> = read_json(path, "list of offsets", remedy)?;
        let mut has_found = false;
        for camera in &mut self.cameras {
            if let Some(row) = rows.iter().find(|row| row.camera == camera.name) {
                camera.offset = row.offset;
                has_found = true;
            }
        }
        if has_found { Ok(()) } else { Err(Error::data(path, "", "names no camera of the capture", remedy)) }
    }
}
