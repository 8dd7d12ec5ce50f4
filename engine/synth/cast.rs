//! One picture by casting rays, with the truth of each pixel.

use super::math::{self, Stream, normal3};
use super::options::{Noise, Options};
use super::rig::Camera;
use super::world::{Hit, Snapshot, World};
use glam::{DVec2, DVec3};

pub(super) const SENSOR_NOISE: f64 = 0.01;
const HOOD: DVec3 = DVec3::splat(0.06);

/// A camera's picture of one frame, row-major, top first.
#[derive(Default)]
pub(super) struct Picture {
    pub rgb: Vec<u8>,
    /// Of the surface at the pixel's centre, along the optical axis, scene units.
    pub depth: Vec<f64>,
    /// Displacement of the surface point at the pixel's centre until the next frame, pixels.
    pub flow: Vec<DVec2>,
    pub body: Vec<usize>,
    /// True if any ray of the pixel meets a body that moves.
    pub dynamic: Vec<bool>,
}

/// Casts the picture of `frame` by the `index`-th camera, at the time that its clock shifts the frame to.
pub(super) fn picture(world: &World, options: &Options, index: usize, camera: &Camera, frame: u32) -> Picture {
    let time = f64::from(frame) + camera.time_offset;
    let (now, next) = (world.at(time), world.at(time + 1.0));
    let (camera, then) = (&camera.at(time), camera.at(time + 1.0));
    let mut noise = math::random(options.seed, Stream::Sensor, index, frame);
    let mut picture = Picture::default();
    for (column, row) in camera.pixels() {
        let corner = DVec2::new(f64::from(column), f64::from(row));
        let center = corner + DVec2::splat(0.5);
        let direction = camera.ray(center);
        // The room is closed: every ray meets something, at worst its shell.
        let hit = now.hit(camera.center, direction);
        picture.depth.push(hit.as_ref().map_or(0.0, |hit| hit.t));
        picture.flow.push(hit.as_ref().map_or(DVec2::ZERO, |hit| flow(&now, &next, camera, &then, hit)));
        picture.body.push(hit.as_ref().map_or(0, |hit| hit.body));
        let (color, dynamic) = pixel(&now, camera, corner, options.samples);
        let seen = if camera.is_hooded(column, row) { HOOD } else { transformed(camera, color) };
        let sensor = if options.noise == Noise::All { normal3(&mut noise) * SENSOR_NOISE } else { DVec3::ZERO };
        picture.rgb.extend((seen + sensor).to_array().map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8));
        picture.dynamic.push(dynamic || hit.is_some_and(|hit| now.placed[hit.body].body.dynamic));
    }
    picture
}

/// True if the surface at each pixel's centre of the `index`-th camera is seen by a training camera at the same time.
pub(super) fn covisible(world: &World, cameras: &[Camera], index: usize, frame: u32) -> Vec<bool> {
    let now = world.at(f64::from(frame) + cameras[index].time_offset);
    let cameras: Vec<Camera> = cameras.iter().map(|camera| camera.of_frame(frame)).collect();
    let camera = &cameras[index];
    let seen = |column: u32, row: u32| {
        let direction = camera.ray(DVec2::new(f64::from(column), f64::from(row)) + 0.5);
        let point = now.hit(camera.center, direction).map(|hit| hit.at);
        point.is_some_and(|point| cameras.iter().any(|other| !other.is_test && sees(&now, other, point)))
    };
    camera.pixels().map(|(column, row)| seen(column, row)).collect()
}

/// True if a point of a surface is in a camera's picture and nothing is in front of it.
pub(super) fn sees(now: &Snapshot, camera: &Camera, point: DVec3) -> bool {
    camera.project(point).is_some_and(|(at, _)| camera.intrinsics.holds(at)) && now.sees(camera.center, point)
}

/// The mean colour of `samples` x `samples` rays, and whether any of them meets a body that moves.
fn pixel(now: &Snapshot, camera: &Camera, corner: DVec2, samples: u32) -> (DVec3, bool) {
    let (mut sum, mut dynamic) = (DVec3::ZERO, false);
    for (i, j) in (0..samples).flat_map(|j| (0..samples).map(move |i| (i, j))) {
        let part = (DVec2::new(f64::from(i), f64::from(j)) + 0.5) / f64::from(samples);
        let direction = camera.ray(corner + part);
        if let Some(hit) = now.hit(camera.center, direction) {
            sum += now.color(&hit, direction);
            dynamic |= now.placed[hit.body].body.dynamic;
        }
    }
    (sum / f64::from(samples * samples), dynamic)
}

/// The way of a surface point in the picture to the next frame.
fn flow(now: &Snapshot, next: &Snapshot, camera: &Camera, then: &Camera, hit: &Hit) -> DVec2 {
    let moved = &next.placed[hit.body];
    if !moved.body.dynamic && camera.center == then.center {
        return DVec2::ZERO;
    }
    // Both ends are projected, so that a body at rest has no flow from rounding.
    let here = camera.project(now.placed[hit.body].world(hit.local));
    let there = then.project(moved.world(hit.local));
    here.zip(there).map_or(DVec2::ZERO, |(here, there)| there.0 - here.0)
}

pub(super) fn transformed(camera: &Camera, color: DVec3) -> DVec3 {
    let row = |[r, g, b, shift]: [f64; 4]| DVec3::new(r, g, b).dot(color) + shift;
    DVec3::from_array(camera.color.map(row))
}
