//! Cameras: where they stand, which are held out, how far their clocks and colours are off.

use super::math::{self, Stream, rotation, sin_cos};
use super::options::{Options, Rig};
use crate::random::Random;
use crate::scene::Intrinsics;
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::PI;

/// The centre of an inward rig's view, and its distance.
const TARGET: DVec3 = DVec3::new(0.05, 0.35, 0.4);
const RADIUS: f64 = 3.1;
/// Half of the arc that they stand on, radians.
const HALF_ARC: f64 = 55.0 / 180.0 * PI;
/// Middle of the hemisphere of an outward rig, and its radius.
const MIDDLE: DVec3 = DVec3::new(-0.1, -0.25, -1.5);
const HEMISPHERE: f64 = 0.25;
/// Azimuth from one camera of the hemisphere to the next, radians: the golden angle spreads them evenly.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// Cosine of the angle between the hemisphere's axis and the cameras at its rim.
const RIM: f64 = 0.1;
/// How far a moving rig goes over the clip, metres, how far it bobs, and by how much it turns, radians.
const WAY: DVec3 = DVec3::new(0.8, 0.0, 0.2);
const BOB: f64 = 0.05;
const TURN: f64 = 0.4;
/// Largest time offset before the mean is taken out, frames.
const MAX_OFFSET: f64 = 1.0;
/// Radius of the photographs' ring, distance between its heights, metres, and the width that a photograph shows at depth 1.
const PHOTO_RING: f64 = 0.6;
const PHOTO_HEIGHT: f64 = 0.35;
const PHOTO_FIELD: f64 = 1.6;

/// A pinhole camera, which rests or moves with its rig.
#[derive(Clone, Debug)]
pub(super) struct Camera {
    pub name: String,
    pub is_test: bool,
    pub intrinsics: Intrinsics,
    /// World to camera (x right, y down, z forward), of a moving camera in the middle of the clip. A [`Pose`](crate::scene::Pose) would
    /// change last bits.
    pub rotation: DMat3,
    /// World, of a moving camera in the middle of the clip.
    pub center: DVec3,
    /// Frames of the clip, of a camera that moves.
    pub way: Option<u32>,
    /// Its pictures of frame f are of time f + this; frames.
    pub time_offset: f64,
    /// Rows of the affine transform from true colours to the picture's.
    pub color: [[f64; 4]; 3],
    pub hood: bool,
}

impl Camera {
    /// Where it is at a time, frames.
    pub fn at(&self, time: f64) -> Camera {
        let Some(frames) = self.way else { return self.clone() };
        let (turn, shift) = path(time, frames);
        let center = moved(self.center, turn, shift);
        Camera { rotation: self.rotation * turn.transpose(), center, way: None, ..self.clone() }
    }

    pub fn center_at(&self, time: f64) -> DVec3 {
        self.way.map_or(self.center, |frames| {
            let (turn, shift) = path(time, frames);
            moved(self.center, turn, shift)
        })
    }

    pub fn of_frame(&self, frame: u32) -> Camera {
        self.at(f64::from(frame) + self.time_offset)
    }

    /// The ray through a point of the picture: direction in the world with depth 1, so that `t` along it is depth.
    pub fn ray(&self, at: DVec2) -> DVec3 {
        self.rotation.transpose() * self.intrinsics.ray(at)
    }

    /// The point in the picture and its depth; `None` behind the camera.
    pub fn project(&self, world: DVec3) -> Option<(DVec2, f64)> {
        let at = self.rotation * (world - self.center);
        (at.z > 0.01).then(|| (self.intrinsics.project(at), at.z))
    }

    /// (column, row) of every pixel, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let Intrinsics { width, height, .. } = self.intrinsics;
        (0..height).flat_map(move |row| (0..width).map(move |column| (column, row)))
    }

    pub fn is_hooded(&self, column: u32, row: u32) -> bool {
        let at = (DVec2::new(column.into(), row.into()) + 0.5) / self.intrinsics.size();
        self.hood && at.x + (1.0 - at.y) < 0.28
    }
}

/// The places of photographs by name: a ring in three heights, looking outward, two and two the same way to overlap.
pub(super) fn photographers(options: &Options, n: u32) -> Vec<Camera> {
    let mut random = math::random(options.seed, Stream::Photos, 0, 0);
    let photographer = |index: u32| {
        let mut jitter = |most: f64| random.uniform(-most, most);
        let mut way = |index: u32| {
            let (sin, cos) = sin_cos(2.0 * PI * f64::from(index) / f64::from(n) + jitter(0.05));
            DVec3::new(cos, 0.0, sin)
        };
        let height = DVec3::Y * (PHOTO_HEIGHT * (f64::from(index % 3) - 1.0));
        let center = MIDDLE + way(index) * PHOTO_RING + height;
        let target = center + way(index / 2 * 2) - 0.3 * height;
        pinhole(format!("photo{index:02}"), options, center, target, PHOTO_FIELD, &mut jitter)
    };
    (0..n).map(photographer).collect()
}

/// How a moving rig is turned about its middle at a time, and how far it is from there.
fn path(time: f64, frames: u32) -> (DMat3, DVec3) {
    let u = time / f64::from(frames);
    let (swing, _) = sin_cos(2.0 * PI * u);
    (rotation(DVec3::Y, TURN * (u - 0.5)), WAY * (u - 0.5) + DVec3::Y * (BOB * swing))
}

fn moved(center: DVec3, turn: DMat3, shift: DVec3) -> DVec3 {
    MIDDLE + turn * (center - MIDDLE) + shift
}

pub(super) fn rig(options: &Options) -> Vec<Camera> {
    let mut random = math::random(options.seed, Stream::Rig, 0, 0);
    let tests = test_indices(options);
    let mut cameras: Vec<Camera> = (0..options.cameras).map(|index| camera(options, index, &mut random)).collect();
    for index in tests {
        cameras[index as usize].is_test = true;
    }
    let training: Vec<usize> = (0..cameras.len()).filter(|&i| !cameras[i].is_test).collect();
    if options.offsets {
        let mut random = math::random(options.seed, Stream::TimeOffsets, 0, 0);
        let drawn: Vec<f64> = training.iter().map(|_| random.uniform(-MAX_OFFSET, MAX_OFFSET)).collect();
        for (&index, offset) in training.iter().zip(without_mean(&drawn)) {
            cameras[index].time_offset = offset;
        }
    }
    if options.colors {
        set_colors(&mut cameras, &training, options.seed);
    }
    for (rank, &index) in training.iter().enumerate() {
        cameras[index].hood = options.masks && rank % 2 == 1;
    }
    cameras
}

fn camera(options: &Options, index: u32, random: &mut Random) -> Camera {
    let part = f64::from(index) / f64::from(options.cameras - 1);
    let mut jitter = |most: f64| random.uniform(-most, most);
    let high = index.is_multiple_of(2);
    let (center, target, field) = match options.rig {
        Rig::Inward => {
            let (sin, cos) = sin_cos((2.0 * part - 1.0) * HALF_ARC + jitter(0.03));
            let height = if high { -0.5 } else { 0.15 } + jitter(0.06);
            let center = DVec3::new(TARGET.x + RADIUS * sin, height, TARGET.z - RADIUS * cos);
            (center, TARGET + DVec3::new(jitter(0.1), jitter(0.05), 0.0), 1.22)
        }
        Rig::Outward | Rig::Moving => {
            // From the pole, which looks where most happens, to the rim.
            let z = 1.0 - (f64::from(index) + 0.5) / f64::from(options.cameras) * (1.0 - RIM);
            let (sin, cos) = sin_cos(GOLDEN_ANGLE * f64::from(index) + jitter(0.05));
            let way = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
            let center = MIDDLE + way * HEMISPHERE;
            (center, center + way + DVec3::new(jitter(0.04), jitter(0.04), 0.0), 2.0)
        }
    };
    Camera {
        way: (options.rig == Rig::Moving).then_some(options.frames),
        ..pinhole(format!("cam{index:02}"), options, center, target, field, &mut jitter)
    }
}

/// A camera at rest, with the true clock and colours, at a place with a target and the width of what is seen at depth 1.
fn pinhole(
    name: String,
    options: &Options,
    center: DVec3,
    target: DVec3,
    field: f64,
    jitter: &mut dyn FnMut(f64) -> f64,
) -> Camera {
    let forward = (target - center).normalize();
    // Near the vertical there is no right of its own.
    let up = if forward.y.abs() < 0.95 { DVec3::Y } else { DVec3::Z };
    let right = up.cross(forward).normalize();
    let down = forward.cross(right);
    let (width, height) = (f64::from(options.width), f64::from(options.height));
    let focal = width / field * (1.0 + jitter(0.02));
    Camera {
        name,
        is_test: false,
        intrinsics: Intrinsics {
            width: options.width,
            height: options.height,
            fx: focal,
            fy: focal * (1.0 + jitter(0.003)),
            cx: width * (0.5 + jitter(0.01)),
            cy: height * (0.5 + jitter(0.01)),
        },
        rotation: DMat3::from_cols(right, down, forward).transpose(),
        center,
        way: None,
        time_offset: 0.0,
        color: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        hood: false,
    }
}

/// The middle of the row, its end, then evenly between those taken.
fn test_indices(options: &Options) -> Vec<u32> {
    let last = options.cameras - 1;
    let mut order = vec![options.cameras / 2, last];
    let mut pieces = 4;
    while order.len() < options.test_cameras as usize {
        for index in (0..pieces).map(|i| last * i / pieces) {
            if !order.contains(&index) {
                order.push(index);
            }
        }
        pieces *= 2;
    }
    order.truncate(options.test_cameras as usize);
    order
}

/// Gains, a little mixing and shifts; their mean over the training cameras is the identity.
fn set_colors(cameras: &mut [Camera], training: &[usize], seed: u64) {
    let mut random = math::random(seed, Stream::Colors, 0, 0);
    for row in 0..3 {
        for column in 0..4 {
            let most = match column {
                3 => 0.03,
                _ if column == row => 0.14,
                _ => 0.025,
            };
            let drawn: Vec<f64> = training.iter().map(|_| random.uniform(-most, most)).collect();
            for (&index, shift) in training.iter().zip(without_mean(&drawn)) {
                cameras[index].color[row][column] += shift;
            }
        }
    }
}

fn without_mean(values: &[f64]) -> impl Iterator<Item = f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(move |value| value - mean)
}
