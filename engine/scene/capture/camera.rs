//! Cameras of a capture and their images; points, and how far all of it reaches.

use std::path::PathBuf;

use crate::report::statistics::median_high;
use crate::scene::view::PHOTO_TIME;
use crate::scene::{Intrinsics, Pose, View};
use glam::DVec3;

/// Largest magnitude of a coordinate, scene units; beyond it distances overflow single precision.
pub(super) const MAX_COORDINATE: f64 = 1e9;

/// One image of a camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shot {
    /// Frame of the clip.
    pub frame: u32,
    /// PNG or JPEG.
    pub image: PathBuf,
    /// PNG of the camera's size; pixels of value 0 are to be ignored.
    pub mask: Option<PathBuf>,
    /// PNG of the camera's size; pixels of at least 128 show something that moves. The image itself with [`Alpha::Mask`](super::Alpha::Mask).
    pub foreground: Option<PathBuf>,
    /// PNG of a test camera's size; a training camera sees pixels of at least 128 too (co-visibility, Gao et al. 2022).
    pub covisible: Option<PathBuf>,
    /// Optical flow to the next frame, for [`read_flow`](crate::scene::prior::read_flow).
    pub flow: Option<PathBuf>,
    /// Monocular depth, for [`read_depth`](crate::scene::prior::read_depth).
    pub depth: Option<PathBuf>,
    /// The pose at this frame when the camera moves.
    pub world_to_camera: Option<Pose>,
}

impl Shot {
    #[doc(hidden)]
    pub fn pictures(&self) -> impl Iterator<Item = &PathBuf> {
        [Some(&self.image), self.mask.as_ref(), self.foreground.as_ref(), self.covisible.as_ref()].into_iter().flatten()
    }
}

/// A pinhole camera and its images.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Camera {
    /// Unique; fit as a file name.
    pub name: String,
    /// The same at all times.
    pub intrinsics: Intrinsics,
    /// The pose of every shot that has none of its own.
    pub world_to_camera: Pose,
    /// Kept for testing: no image of it is trained on.
    pub is_test: bool,
    /// A photograph of the static scene, taken at another time than the clip; its only shot is of frame 0.
    pub is_photo: bool,
    /// By frame; a frame may be absent (every camera of a monocular clip has one).
    pub shots: Vec<Shot>,
}

impl Camera {
    /// The shot of a frame, if there is one.
    pub fn shot(&self, frame: u32) -> Option<&Shot> {
        self.shots.binary_search_by_key(&frame, |shot| shot.frame).ok().map(|index| &self.shots[index])
    }

    #[doc(hidden)]
    pub fn films(&self) -> bool {
        !self.is_test && !self.is_photo
    }

    #[doc(hidden)]
    pub fn moves(&self) -> bool {
        self.shots.iter().any(|shot| shot.world_to_camera.is_some())
    }

    /// The pose at a frame; of a moving camera without a shot there, that of its nearest earlier shot.
    pub fn pose(&self, frame: u32) -> &Pose {
        let index = self.shots.partition_point(|shot| shot.frame <= frame);
        let shot = index.checked_sub(1).and_then(|index| self.shots.get(index));
        shot.and_then(|shot| shot.world_to_camera.as_ref()).unwrap_or(&self.world_to_camera)
    }

    pub(super) fn poses_mut(&mut self) -> impl Iterator<Item = &mut Pose> {
        let moving = self.shots.iter_mut().filter_map(|shot| shot.world_to_camera.as_mut());
        moving.chain([&mut self.world_to_camera])
    }

    pub(super) fn view(&self, frame: u32, n_frames: u32, pose: &Pose, background: [f32; 3]) -> View {
        let name = if n_frames == 1 { self.name.clone() } else { format!("{}_{frame:05}", self.name) };
        let n_frames = f64::from(n_frames.max(1));
        let next = self.pose(frame + 1);
        View {
            name,
            intrinsics: self.intrinsics,
            pose: *pose,
            time: if self.is_photo { PHOTO_TIME } else { f64::from(frame) / n_frames },
            flow_dt: 1.0 / n_frames,
            background,
            next_pose: (next != pose).then_some(*next),
            ..View::default()
        }
    }
}

/// The correction of a camera that an earlier run learnt.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Delay of its pictures, seconds.
    pub offset: f64,
    /// Turn about the axes of the capture's world, radians.
    pub turn: [f64; 3],
    /// Shift along those axes, the capture's units.
    pub shift: [f64; 3],
}

/// A point of a sparse reconstruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// World, scene units.
    pub position: [f64; 3],
    /// Red, green, blue.
    pub color: [u8; 3],
}

/// Where the cameras are, without those of photographs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Mean of the training cameras' centres, world.
    pub center: [f64; 3],
    /// 1.1 times the largest distance of a training camera from `center`, scene units (3DGS's extent). Where the median distance of the
    /// points is more than three times that, the radius goes over to it; from four times on, and where cameras coincide, it is the median.
    pub radius: f64,
}

/// Median distance of the points over the radius of the cameras: up to the first the cameras are the measure, from the second the points.
const MEASURED_BY: [f64; 2] = [3.0, 4.0];

/// Refuses a place that is not finite or too far away.
pub(super) fn check_place(at: [f64; 3]) -> Result<(), String> {
    let is_near = at.iter().all(|v| v.is_finite() && v.abs() <= MAX_COORDINATE);
    is_near.then_some(()).ok_or_else(|| format!("is at {at:?}, not finite or beyond {MAX_COORDINATE}"))
}

pub(super) fn extent(cameras: &[Camera], points: &[Point]) -> Extent {
    let all_test = cameras.iter().all(|camera| camera.is_test);
    let used = cameras.iter().filter(|camera| !camera.is_photo && (all_test || !camera.is_test));
    let poses = used.flat_map(|camera| camera.shots.iter().map(|shot| camera.pose(shot.frame)));
    let centers: Vec<DVec3> = poses.map(Pose::center).collect();
    let center = centers.iter().sum::<DVec3>() / centers.len().max(1) as f64;
    let radius = 1.1 * centers.iter().map(|at| at.distance(center)).fold(0.0, f64::max);
    let size = center.abs().max_element().max(1.0);
    let distances = points.iter().map(|point| DVec3::from(point.position).distance(center));
    let median = median_high(distances.filter(|distance| *distance > 0.0));
    let [from, to] = MEASURED_BY;
    // From `radius`, where the median distance is the first of these, to that distance, where it is the second.
    let steep = |median: f64| radius + (to - 1.0) / (to - from) * (median - from * radius);
    let radius = match median {
        // The scene of a rig that is small beside it is not measured by the rig.
        Some(median) if radius > 1e-9 * size => radius.max(median.min(steep(median))),
        None if radius > 1e-9 * size => radius,
        _ => median.unwrap_or(1.0),
    };
    Extent { center: center.to_array(), radius }
}
