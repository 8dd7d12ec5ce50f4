//! Gaussians to begin with: from a capture's points, or from its cameras and pictures alone.

mod eye;
mod hull;
mod points;
mod sweep;

pub use points::{from_points, random_points};

use super::config::{Config, Init};
use super::random::permutation;
use crate::error::{Error, Result};
use crate::parallel::in_parallel;
use crate::scene::capture::{Camera, Capture, Point, Pose, TRAINING_RADIUS};
use crate::scene::{Motion, Splats};
use eye::{Eye, Seen};
use glam::{Mat3, Vec3};
use hull::Cube;
use points::Found;
use std::collections::HashMap;

/// Longest side of the pictures that silhouettes are taken from, pixels.
const HULL_SIDE: usize = 320;
/// Longest side of the pictures that depths are swept in, pixels.
const SWEEP_SIDE: usize = 128;
/// Cameras that take part, evenly chosen.
const MOST_CAMERAS: usize = 32;
/// Pixels that are decoded for hulls; at least four frames are.
/// Purposes of random numbers.
const STILL: u64 = 0x7374_696c_6c00;
const MOVING: u64 = 0x6d6f_7669_6e67;
const HULL_PIXELS: u64 = 1 << 28;

/// The first Gaussians and how they came about.
#[derive(Clone, Debug)]
pub struct Beginning {
    /// The Gaussians.
    pub splats: Splats,
    /// Where they come from; never [`Init::Auto`].
    pub from: Init,
    /// Why, and what was looked at.
    pub because: String,
}

/// Makes the first Gaussians of `capture`, which is in the frame of training, as `config.init` says. `progress` is called
/// as (pieces done, pieces in all).
///
/// # Errors
/// [`Error::Data`] when the capture has not what `config.init` asks for, or an image does not decode.
pub fn begin(capture: &Capture, config: &Config, progress: &mut dyn FnMut(usize, usize)) -> Result<Beginning> {
    let lacks = |what: &str| {
        let remedy = "choose another `init`: auto, points, hull, frustum or random";
        Err(Error::data(&capture.path, "setting `init`", format!("the capture has no {what}"), remedy))
    };
    let from = match config.init {
        Init::Auto if !capture.points.is_empty() => Init::Points,
        Init::Auto if has_foreground(capture) => Init::Hull,
        Init::Auto => Init::Frustum,
        Init::Points if capture.points.is_empty() => return lacks("points"),
        Init::Hull if !has_foreground(capture) => return lacks("foreground masks"),
        asked => asked,
    };
    let at = |points: &[Point], because: &str| {
        let splats = from_points(points, capture, config);
        Ok(Beginning { splats, from, because: because.to_owned() })
    };
    match from {
        Init::Points => at(&capture.points, "the capture has points"),
        Init::Random => at(&random_points(capture, config), "asked for"),
        _ => from_pictures(capture, config, from, progress),
    }
}

fn has_foreground(capture: &Capture) -> bool {
    let training = capture.cameras.iter().filter(|camera| !camera.is_test);
    training.flat_map(|camera| &camera.shots).any(|shot| shot.foreground.is_some())
}

fn from_pictures(
    capture: &Capture,
    config: &Config,
    from: Init,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Beginning> {
    let cameras = cameras(capture);
    let frames = if from == Init::Hull { hull_frames(capture, &cameras) } else { Vec::new() };
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let n_pieces = (frames.len() + 2) * cameras.len();
    let mut n_done = 0;
    let mut done = || {
        n_done += 1;
        progress(n_done, n_pieces);
    };
    // The pictures of a frame, reduced for hulls and for sweeps.
    let mut eyes_at = |frame: u32| -> Result<(Vec<Eye>, Vec<Eye>)> {
        let reduced = |i: usize| {
            let (camera, own) = cameras[i];
            let seen = Seen::read(capture, camera, own.unwrap_or(frame))?;
            Ok((Eye::new(&seen, HULL_SIDE), Eye::new(&seen, SWEEP_SIDE)))
        };
        Ok(in_parallel(cameras.len(), threads, reduced, |_| done())?.into_iter().unzip())
    };
    let radius = capture.extent().radius;
    let budget = config.init_points;
    let mut splats = Splats::new(config.sh_degree);
    let (_, small) = eyes_at(capture.reference_frame)?;
    let mut still = sweep::sweep(&small, threads, || ())?;
    let lenses = lenses(capture);
    still.retain(|found| !lenses.iter().any(|lens| is_before(lens, found.0.position)));
    let n_found = still.len();
    let centers: Vec<[f64; 3]> = lenses.iter().map(|m| std::array::from_fn(|k| -(0..3).map(|r| m[r][k] * m[r][3]).sum::<f64>())).collect();
    let n_still = if from == Init::Hull { budget - budget / 2 } else { budget };
    let still = thinned(still, n_still);
    let is_static = from == Init::Hull || capture.n_frames == 1;
    points::append(&mut splats, &still, radius, config.init_opacity, (!is_static).then_some(points::THROUGHOUT), &centers);
    let mut cell = 0.0;
    for &frame in &frames {
        let (eyes, _) = eyes_at(frame)?;
        let key = [config.seed, MOVING, u64::from(frame)];
        let (moving, side) = hull::surface(&eyes, cube(&small), budget / 2 / frames.len(), &key);
        cell = side;
        let stride = capture.n_frames as f64 / frames.len() as f64;
        let n_frames = f64::from(capture.n_frames);
        let tau = config.init_tau.max(config.init_tau_stride * stride) / n_frames;
        let motion = Motion { velocity: [0.0; 3], t_center: frame as f32 / n_frames as f32, t_scale: tau.ln() as f32 };
        points::append(&mut splats, &moving, radius, config.init_opacity, Some(motion), &centers);
    }
    let because = format!("{n_found} found, {} still, {} moving in {} frames, cell {cell}", still.len(), splats.len() - still.len(), frames.len());
    Ok(Beginning { splats, from, because })
}

/// At most `most` of `found`, evenly spread: the one that most cameras confirm in each cell of a grid, whose cells grow with
/// the distance from the middle of the cameras.
fn thinned(found: Vec<(Found, usize)>, most: usize) -> Vec<Found> {
    let best = |side: f64| {
        let mut cells: HashMap<[i64; 4], usize> = HashMap::new();
        for (index, (Found { position, .. }, n)) in found.iter().enumerate() {
            let distance = position.iter().map(|x| x * x).sum::<f64>().sqrt();
            let shell = (distance / TRAINING_RADIUS).log2().ceil().max(0.0);
            let [x, y, z] = position.map(|x| (x / (side * shell.exp2())).floor() as i64);
            let held = cells.entry([x, y, z, shell as i64]).or_insert(index);
            if found[*held].1 < *n {
                *held = index;
            }
        }
        let mut kept: Vec<usize> = cells.into_values().collect();
        kept.sort_unstable();
        kept
    };
    let (mut low, mut high) = (0.0, TRAINING_RADIUS);
    for _ in 0..12 {
        let middle = 0.5 * (low + high);
        if best(middle).len() > most { low = middle } else { high = middle }
    }
    best(high).into_iter().map(|i| found[i].0).collect()
}

/// The training cameras that take part, each with its own frame where no frame is seen by all of them: a monocular clip.
fn cameras(capture: &Capture) -> Vec<(usize, Option<u32>)> {
    let training = capture.cameras.iter().enumerate().filter(|(_, camera)| !camera.is_test && !camera.shots.is_empty());
    let all: Vec<_> = training.map(|(index, camera)| (index, camera.shot(capture.reference_frame).is_none().then(|| camera.shots[0].frame))).collect();
    let n = all.len();
    let n_used = n.min(MOST_CAMERAS);
    (0..n_used).map(|i| all[i * n / n_used]).collect()
}

fn lenses(capture: &Capture) -> Vec<Pose> {
    let poses = |camera: &Camera| camera.shots.iter().map(|shot| *camera.pose(shot.frame)).collect::<Vec<_>>();
    let mut all: Vec<Pose> = capture.cameras.iter().flat_map(|camera| if camera.shots.iter().any(|s| s.world_to_camera.is_some()) { poses(camera) } else { vec![camera.world_to_camera] }).collect();
    all.dedup();
    all
}

/// Whether a point is so near before a lens that a Gaussian there fills the picture.
fn is_before(world_to_camera: &Pose, at: [f64; 3]) -> bool {
    let [x, y, z] = [0, 1, 2].map(|row| (0..3).map(|k| world_to_camera[row][k] * at[k]).sum::<f64>() + world_to_camera[row][3]);
    z > 0.0 && x * x + y * y + z * z < (0.1 * TRAINING_RADIUS).powi(2)
}

/// The frames whose hulls are taken, evenly spaced.
fn hull_frames(capture: &Capture, cameras: &[(usize, Option<u32>)]) -> Vec<u32> {
    let pixels = |i: usize| u64::from(capture.cameras[i].width) * u64::from(capture.cameras[i].height);
    let per_frame: u64 = cameras.iter().map(|(camera, _)| pixels(*camera)).sum();
    let n = (HULL_PIXELS / per_frame.max(1)).clamp(4, 1 << 16) as u32;
    let n = n.min(capture.n_frames);
    let n = std::env::var("IVV_NF").map_or(n, |s| s.parse().unwrap());
    (0..n).map(|i| (2 * i + 1) * capture.n_frames / (2 * n)).collect()
}

/// Around the point nearest to all optical axes, as far as the cameras are from it and half again.
fn cube(eyes: &[Eye]) -> Cube {
    let (mut across, mut sum) = (Mat3::ZERO, Vec3::ZERO);
    for eye in eyes {
        let axis = eye.axis();
        // Takes out what lies along the axis.
        let flat = Mat3::IDENTITY - Mat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        across += flat;
        sum += flat * eye.center;
    }
    let center = across.inverse() * sum;
    let mut distances: Vec<f32> = eyes.iter().map(|eye| eye.center.distance(center)).collect();
    distances.sort_by(f32::total_cmp);
    Cube { center, half: 1.5 * distances[distances.len() / 2] }
}
