//! `truth.json`: the values that a capture hides.

use super::options::{Noise, Options};
use super::rig::Camera;
use super::shape::Shape;
use super::world::{Body, World};
use super::{cast, colmap, points, priors, sound};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// All hidden values. A moving microphone has a place at each frame and one more. `outliers` has by frame the rows of `points/<frame>.ply`.
pub(super) fn truth(world: &World, options: &Options, cameras: &[Camera], outliers: &[Vec<u32>]) -> Value {
    let by_camera = |value: &dyn Fn(usize, &Camera) -> Value| -> BTreeMap<String, Value> {
        cameras.iter().enumerate().map(|(index, camera)| (camera.name.clone(), value(index, camera))).collect()
    };
    let affine = |index: usize| -> Vec<(f64, f64)> {
        (0..options.frames).map(|frame| priors::depth_affine(options, index, frame)).collect()
    };
    let noisy = |sd: f64| if options.noise == Noise::None { 0.0 } else { sd };
    let points = points::Errors::of(options.noise);
    let mouth: Vec<[f64; 3]> =
        (0..=options.frames).map(|frame| sound::mouth(world, f64::from(frame)).to_array()).collect();
    json!({
        "seed": options.seed,
        "time_offsets_frames": by_camera(&|_, camera| json!(camera.time_offset)),
        "color_transforms": by_camera(&|_, camera| json!(camera.color)),
        "depth_scale_shift": by_camera(&|index, _| json!(affine(index))),
        "noise": {
            "points_sd": points.sd,
            "points_outlier_fraction": points.outliers,
            "observations_sd_px": noisy(colmap::OBSERVATION_NOISE),
            "flow_sd_px": noisy(priors::FLOW_NOISE),
            "flow_relative_sd": noisy(priors::FLOW_RELATIVE_NOISE),
            "inverse_depth_relative_sd": noisy(priors::DEPTH_NOISE),
            "inverse_depth_smooth_relative_max": noisy(priors::DEPTH_SMOOTH_NOISE),
            "keypoints_sd_px": noisy(sound::KEYPOINT_NOISE),
            "sensor_sd": if options.noise == Noise::All { cast::SENSOR_NOISE } else { 0.0 },
        },
        "point_outliers": outliers,
        "source": {
            "body": world.bodies[world.head].name,
            "position": mouth,
            "speed_of_sound": sound::SPEED_OF_SOUND,
            "gain_at_unit_distance": sound::GAIN,
            "sample_rate": sound::RATE,
        },
        "microphones": by_camera(&|_, camera| match camera.way {
            None => json!(camera.center.to_array()),
            Some(frames) => {
                json!((0..=frames).map(|frame| camera.of_frame(frame).center.to_array()).collect::<Vec<_>>())
            }
        }),
        "bodies": world.bodies.iter().map(|body| describe(world, body)).collect::<Vec<_>>(),
    })
}

/// A body (a capsule's segment is along its y axis), of a moving one with its 3 x 4 pose (body to world) at each frame and one more.
fn describe(world: &World, body: &Body) -> Value {
    let pose = |frame: u32| {
        let (rotation, at) = body.motion.pose(world.moving_time(f64::from(frame)));
        let row = |axis: usize| [rotation.x_axis[axis], rotation.y_axis[axis], rotation.z_axis[axis], at[axis]];
        [row(0), row(1), row(2)]
    };
    let last = if body.dynamic { world.frames } else { 0 };
    let poses: Vec<_> = (0..=last).map(pose).collect();
    let shape = match body.shape {
        Shape::Block(half) => json!({ "kind": "block", "half_sides": half.to_array() }),
        Shape::Room(half) => json!({ "kind": "room", "half_sides": half.to_array() }),
        Shape::Sphere(radius) => json!({ "kind": "sphere", "radius": radius }),
        Shape::Capsule { half, radius } => json!({ "kind": "capsule", "half_length": half, "radius": radius }),
    };
    let frames = f64::from(world.frames);
    let (from, to) = body.life;
    json!({
        "name": body.name,
        "shape": shape,
        "dynamic": body.dynamic,
        "exists_from_frame": from.is_finite().then_some(from * frames),
        "exists_to_frame": to.is_finite().then_some(to * frames),
        "pose": poses,
    })
}
