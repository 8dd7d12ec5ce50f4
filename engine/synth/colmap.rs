//! The calibration as COLMAP writes it in text, and the points of single frames.

use super::files;
use super::math::{self, Stream};
use super::options::{Noise, Options};
use super::points::Point;
use super::rig::Camera;
use crate::error::Result;
use crate::scene::{self, Intrinsics, Pose, SeenPoint, quaternion};
use glam::{DVec2, DVec3};
use std::fmt::Write as _;
use std::path::Path;

/// Standard deviation of the points' places in the pictures, pixels.
pub(super) const OBSERVATION_NOISE: f64 = 0.3;
/// Of a bent rig's cameras: degrees, metres. A real calibration of webcams that were taken for simultaneous is 10 to 14 mm off.
const BENT_TURN: f64 = 0.2;
const BENT_SHIFT: f64 = 0.01;
/// The frame whose pictures stand for their cameras.
pub(super) const REFERENCE_FRAME: u32 = 0;

struct Observation {
    at: DVec2,
    point: usize,
}

/// An image of the model: one for each camera, of a camera that moves one for each frame.
struct Image {
    camera: usize,
    frame: u32,
    posed: Camera,
    stated: Pose,
}

/// The contents of the files, in their order. Cameras and images count from 1, as COLMAP's do.
struct Model<'a> {
    cameras: &'a [Camera],
    images: Vec<Image>,
    points: &'a [Point],
    observations: Vec<Vec<Observation>>,
    /// By point: (image, index among the image's observations).
    tracks: Vec<Vec<(usize, usize)>>,
    /// By point: mean distance between observations and projections, pixels.
    errors: Vec<f64>,
}

/// Writes cameras.txt, images.txt and points3D.txt to `folder`. `points` are of the reference frame.
pub(super) fn write(folder: &Path, options: &Options, cameras: &[Camera], points: &[Point]) -> Result<()> {
    let model = Model::new(options, cameras, points);
    files::bytes(&folder.join("cameras.txt"), model.cameras_text().as_bytes())?;
    files::bytes(&folder.join("images.txt"), model.images_text().as_bytes())?;
    files::bytes(&folder.join("points3D.txt"), model.points_text().as_bytes())
}

/// Writes the points of a frame with those that saw each, in the numbers of COLMAP's cameras.
pub(super) fn write_points(path: &Path, points: &[Point]) -> Result<()> {
    let seen = |point: &Point| SeenPoint {
        position: point.position.to_array(),
        rgb: point.rgb,
        camera_ids: point.seen_by.iter().map(|&index| id(index)).collect(),
    };
    scene::write_points(path, &points.iter().map(seen).collect::<Vec<_>>())
}

fn id(index: usize) -> u32 {
    index as u32 + 1
}

impl Image {
    fn name(&self) -> String {
        format!("{}/{:05}.png", self.posed.name, self.frame)
    }
}

impl<'a> Model<'a> {
    fn new(options: &Options, cameras: &'a [Camera], points: &'a [Point]) -> Self {
        let mut random = math::random(options.seed, Stream::Observations, 0, REFERENCE_FRAME);
        let spread = if options.noise == Noise::None { 0.0 } else { OBSERVATION_NOISE };
        let frames = |camera: &Camera| camera.way.map_or(REFERENCE_FRAME..REFERENCE_FRAME + 1, |frames| 0..frames);
        let of_camera = |(index, camera): (usize, &'a Camera)| {
            let bend = bend(options, index, camera);
            let image = move |frame: u32| {
                let posed = camera.of_frame(frame);
                let pose = Pose::at(posed.center, posed.rotation);
                let stated = bend.map_or(pose, |[turn, shift]| pose.corrected(turn, shift));
                Image { camera: index, frame, posed, stated }
            };
            frames(camera).map(image)
        };
        let images: Vec<Image> = cameras.iter().enumerate().flat_map(of_camera).collect();
        let reference: Vec<usize> = (0..images.len()).filter(|i| images[*i].frame == REFERENCE_FRAME).collect();
        let mut observations: Vec<Vec<Observation>> = images.iter().map(|_| Vec::new()).collect();
        let (mut tracks, mut errors) = (Vec::new(), Vec::new());
        for (point, seen) in points.iter().enumerate() {
            let (mut track, mut error) = (Vec::new(), 0.0);
            for &index in &seen.seen_by {
                let image = reference[index];
                let camera = &images[image].posed;
                let step = DVec2::new(random.nearly_normal(), random.nearly_normal()) * spread;
                // A point is noted only for cameras that it projects into.
                let Some((exact, _)) = camera.project(seen.position) else { continue };
                let at = (exact + step).clamp(DVec2::ZERO, camera.intrinsics.size());
                track.push((image, observations[image].len()));
                observations[image].push(Observation { at, point });
                error += (at - exact).length();
            }
            errors.push(error / track.len() as f64);
            tracks.push(track);
        }
        Model { cameras, images, points, observations, tracks, errors }
    }

    fn cameras_text(&self) -> String {
        let mut text = String::from("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n");
        for (index, camera) in self.cameras.iter().enumerate() {
            let Intrinsics { width, height, fx, fy, cx, cy } = camera.intrinsics;
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{} PINHOLE {width} {height} {fx} {fy} {cx} {cy}", id(index));
        }
        text
    }

    fn images_text(&self) -> String {
        let mut text =
            String::from("# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# X, Y, POINT3D_ID, ...\n");
        for (index, image) in self.images.iter().enumerate() {
            let ([w, x, y, z], t) = (quaternion(&image.stated.rotation), image.stated.translation);
            let ([x_t, y_t, z_t], name) = (t.to_array(), image.name());
            let (own, camera) = (id(index), id(image.camera));
            let _ = writeln!(text, "{own} {w} {x} {y} {z} {x_t} {y_t} {z_t} {camera} {name}");
            let seen = self.observations[index].iter();
            let seen: Vec<_> = seen.map(|o| format!("{} {} {}", o.at.x, o.at.y, id(o.point))).collect();
            let _ = writeln!(text, "{}", seen.join(" "));
        }
        text
    }

    fn points_text(&self) -> String {
        let mut text = String::from("# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n");
        for (index, point) in self.points.iter().enumerate() {
            let ([x, y, z], [r, g, b]) = (point.position.to_array(), point.rgb);
            let _ = write!(text, "{} {x} {y} {z} {r} {g} {b} {}", id(index), self.errors[index]);
            for &(image, observation) in &self.tracks[index] {
                let _ = write!(text, " {} {observation}", id(image));
            }
            text.push('\n');
        }
        text
    }
}

/// By what turn, radians, and shift, metres, the calibration is wrong about a camera; none where it is right.
fn bend(options: &Options, index: usize, camera: &Camera) -> Option<[DVec3; 2]> {
    if !options.bent || camera.is_test {
        return None;
    }
    let mut random = math::random(options.seed, Stream::Bends, index, REFERENCE_FRAME);
    let mut along = |length: f64| math::normal3(&mut random).normalize_or(DVec3::X) * length;
    Some([along(BENT_TURN.to_radians()), along(BENT_SHIFT)])
}
