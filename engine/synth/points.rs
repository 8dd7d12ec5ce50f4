//! Points as a triangulator would find them in one frame: noisy, some of them wrong, each with who saw it.

use super::cast::sees;
use super::math::{self, Stream, normal3};
use super::options::{Noise, Options};
use super::rig::Camera;
use super::world::{Hit, Snapshot, World};
use glam::{DVec2, DVec3};

pub(super) struct Errors {
    /// Standard deviation of a position along each axis, scene units.
    pub sd: f64,
    /// Part of the points that are outliers: moved towards a camera that saw them.
    pub outliers: f64,
}

impl Errors {
    pub fn of(noise: Noise) -> Self {
        match noise {
            Noise::None => Errors { sd: 0.0, outliers: 0.0 },
            Noise::Priors | Noise::All => Errors { sd: 0.004, outliers: 0.03 },
            Noise::Rough => Errors { sd: 0.03, outliers: 0.2 },
        }
    }
}

/// Range of an outlier's distance over its true distance.
const OUTLIER_DEPTHS: [f64; 2] = [0.4, 0.9];
/// Rays cast per point wanted; a dull scene gives fewer points.
const TRIES: u32 = 60;

#[derive(Clone, Debug)]
pub(super) struct Point {
    pub position: DVec3,
    pub rgb: [u8; 3],
    /// Indices of the training cameras that saw it, ascending; two or more.
    pub seen_by: Vec<usize>,
    pub outlier: bool,
}

/// The points of a frame, at the frame's true time. Test cameras take no part.
pub(super) fn points(world: &World, options: &Options, cameras: &[Camera], frame: u32) -> Vec<Point> {
    let now = world.at(f64::from(frame));
    let cameras: Vec<Camera> = cameras.iter().map(|camera| camera.of_frame(frame)).collect();
    let mut random = math::random(options.seed, Stream::Points, 0, frame);
    let training: Vec<usize> = (0..cameras.len()).filter(|&index| !cameras[index].is_test).collect();
    let noisy = options.noise != Noise::None;
    let errors = Errors::of(options.noise);
    let mut points = Vec::new();
    for _ in 0..u64::from(options.points) * u64::from(TRIES) {
        if points.len() == options.points as usize {
            break;
        }
        let index = training[random.bits() as usize % training.len()];
        let camera = &cameras[index];
        let (width, height) = (f64::from(camera.intrinsics.width), f64::from(camera.intrinsics.height));
        let at = DVec2::new(random.uniform(0.0, width), random.uniform(0.0, height));
        let direction = camera.ray(at);
        let Some(hit) = now.hit(camera.center, direction) else { continue };
        if random.uniform(0.0, 1.0) >= now.texture(&hit).detail() * weight(&now, &hit) {
            continue;
        }
        let mut seen_by: Vec<usize> =
            training.iter().copied().filter(|&other| sees(&now, &cameras[other], hit.at)).collect();
        let outlier = noisy && random.uniform(0.0, 1.0) < errors.outliers;
        let [low, high] = OUTLIER_DEPTHS;
        let position = if outlier {
            camera.center + (hit.at - camera.center) * random.uniform(low, high)
        } else if noisy {
            hit.at + normal3(&mut random) * errors.sd
        } else {
            hit.at
        };
        // With its noise, too, a point lies in the pictures that saw it.
        seen_by.retain(|&other| {
            cameras[other].project(position).is_some_and(|(at, _)| cameras[other].intrinsics.holds(at))
        });
        if seen_by.len() < 2 {
            continue;
        }
        let color = now.color(&hit, direction);
        let rgb = color.to_array().map(|c| (c * 255.0 + 0.5) as u8);
        points.push(Point { position, rgb, seen_by, outlier });
    }
    points
}

/// Walls and floor are large and dull; moving bodies have fewer points, since they are blurred.
fn weight(now: &Snapshot, hit: &Hit) -> f64 {
    match now.placed[hit.body].body.dynamic {
        true => 0.4,
        false if hit.body == 0 => 0.5,
        false => 1.0,
    }
}
