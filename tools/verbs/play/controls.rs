//! How a person moves: a camera that turns about a point before it or about itself, and the clock of the clip. The laws are those
//! of the browser player.

use glam::{DMat3, DVec2, DVec3};
use ivv::scene::{Orbit, Splats, View, capture::camera_center};
use std::time::Instant;

/// Radians.
const TURN_PER_PIXEL: f64 = 0.005;
/// Radians per second.
const KEY_TURN: f64 = 1.2;
/// Sine of the steepest angle to the horizon.
const STEEPEST: f64 = 0.995;
/// How much more a picture of another shape may show in one direction, before it is cropped in the other.
const MOST_CROPPED: f64 = 1.35;

/// A camera on its way.
pub struct Navigator {
    /// What is kept of it: focal lengths, shape, background.
    view: View,
    /// World to camera: rows right, down, forward.
    rotation: DMat3,
    center: DVec3,
    up: DVec3,
    /// Of what the scene holds: its middle.
    middle: DVec3,
    /// Of what the scene holds: its standard deviation.
    radius: f64,
    /// Distance of what is looked at.
    pub reach: f64,
    /// Whether it turns about itself.
    pub is_flying: bool,
}

/// Where keys and pointer go: shifts right, down and forward, and turns right and down, each -1, 0 or 1.
#[derive(Clone, Copy, Default)]
pub struct Push {
    pub shift: DVec3,
    pub turn: DVec2,
    pub is_fast: bool,
}

impl Navigator {
    /// For `views` of `splats`; it starts at the first one, or where it sees all of the scene.
    pub fn new(views: &[View], splats: &Splats) -> Self {
        let places = || splats.position.iter().map(|p| DVec3::from(p.map(f64::from))).filter(|p| p.is_finite());
        let n = places().count().max(1) as f64;
        let orbit = Orbit::new(views);
        let mean = places().sum::<DVec3>() / n;
        let radius = (places().map(|p| p.distance_squared(mean)).sum::<f64>() / n).sqrt().max(1e-3);
        let middle = orbit.map_or(mean, |orbit| orbit.middle);
        let up = views.iter().map(|view| -DVec3::from_slice(&view.world_to_camera[1][..3])).sum::<DVec3>();
        let up = up.try_normalize().unwrap_or(-DVec3::Y);
        let home = views.first().cloned().unwrap_or_else(|| whole(middle, radius));
        let (rotation, center) = pose(&home);
        let mut rig =
            Navigator { view: home.clone(), rotation, center, up, middle, radius, reach: radius, is_flying: false };
        rig.go(&home);
        rig
    }

    /// Goes where `view` is.
    pub fn go(&mut self, view: &View) {
        (self.rotation, self.center) = pose(view);
        self.view = view.clone();
        let depth = self.forward().dot(self.middle - self.center);
        self.reach = if depth > 0.05 * self.radius { depth } else { self.radius };
    }

    /// Where it is, world.
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// Where it looks, a unit vector of the world.
    pub fn forward(&self) -> DVec3 {
        self.rotation.row(2)
    }

    /// What is above it, a unit vector of the world.
    pub fn above(&self) -> DVec3 {
        -self.rotation.row(1)
    }

    /// What it sees in a picture of this size: all of its view, or, where the shapes differ much, most of it.
    pub fn view(&self, [width, height]: [u32; 2]) -> View {
        let [w, h] = [width, height].map(f64::from);
        let [old_w, old_h] = [self.view.width, self.view.height].map(f64::from);
        let (a, b) = (w / old_w, h / old_h);
        let zoom = a.max(b).min(MOST_CROPPED * a.min(b));
        let t = -(self.rotation * self.center);
        let row = |k: usize| self.rotation.row(k).extend(t[k]).to_array();
        View {
            width,
            height,
            fx: self.view.fx * zoom,
            fy: self.view.fy * zoom,
            cx: w / 2.0 + (self.view.cx - old_w / 2.0) * zoom,
            cy: h / 2.0 + (self.view.cy - old_h / 2.0) * zoom,
            world_to_camera: [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
            ..self.view.clone()
        }
    }

    /// Turns as a pointer says that was dragged by so many pixels: what is under it follows it.
    pub fn drag(&mut self, by: DVec2) {
        let angle = if self.is_flying { TURN_PER_PIXEL } else { -TURN_PER_PIXEL };
        self.turn(angle * self.sideways() * by.x, angle * by.y, self.is_flying);
    }

    /// Shifts so that what is looked at follows a pointer that was dragged by so many pixels of a picture of this size.
    pub fn pan(&mut self, by: DVec2, size: [u32; 2]) {
        let View { fx, fy, .. } = self.view(size);
        self.shift(DVec3::new(-by.x / fx, -by.y / fy, 0.0) * self.reach);
    }

    /// Comes closer to what is looked at: to so many times its distance.
    pub fn approach(&mut self, factor: f64) {
        let reach = (self.reach * factor).max(1e-4);
        self.shift(DVec3::Z * (self.reach - reach));
        if !self.is_flying {
            self.reach = reach;
        }
    }

    /// Moves for `seconds` as keys say.
    pub fn advance(&mut self, push: Push, seconds: f64) {
        self.shift(push.shift * self.reach * seconds * if push.is_fast { 1.6 } else { 0.5 });
        let turn = push.turn * KEY_TURN * seconds;
        self.turn(-self.sideways() * turn.x, -turn.y, true);
    }

    fn shift(&mut self, by: DVec3) {
        self.center += self.rotation.transpose() * by;
    }

    /// By `yaw` about up and `pitch` about the camera's x axis, radians.
    fn turn(&mut self, yaw: f64, pitch: f64, about_itself: bool) {
        let pivot = if about_itself { self.center } else { self.center + self.forward() * self.reach };
        let tilt = DMat3::from_axis_angle(self.rotation.row(0).normalize(), pitch);
        let [before, after] = [self.forward(), tilt * self.forward()].map(|axis| axis.dot(self.up).abs());
        let spin = DMat3::from_axis_angle(self.up, yaw);
        let spin = if after > STEEPEST && after > before { spin } else { spin * tilt };
        self.rotation *= spin.transpose();
        self.center = pivot + spin * (self.center - pivot);
    }

    /// 1 where it stands upright, -1 where it hangs: left stays left.
    fn sideways(&self) -> f64 {
        if self.above().dot(self.up) > 0.0 { 1.0 } else { -1.0 }
    }
}

fn pose(view: &View) -> (DMat3, DVec3) {
    let [x, y, z, _] = view.world_to_camera.map(|row| DVec3::from_slice(&row[..3]));
    (DMat3::from_cols(x, y, z).transpose(), camera_center(&view.world_to_camera).into())
}

/// A view of a ball, from before it.
fn whole(middle: DVec3, radius: f64) -> View {
    let focal = 360.0 / 25f64.to_radians().tan();
    let t = -middle + DVec3::Z * 3.0 * radius;
    View {
        name: "whole".to_owned(),
        width: 1280,
        height: 720,
        fx: focal,
        fy: focal,
        cx: 640.0,
        cy: 360.0,
        world_to_camera: [[1.0, 0.0, 0.0, t.x], [0.0, 1.0, 0.0, t.y], [0.0, 0.0, 1.0, t.z], [0.0, 0.0, 0.0, 1.0]],
        time: 0.0,
        time_offset: 0.0,
        flow_dt: 1.0,
        background: [0.0; 3],
        flow_model: Default::default(),
        next_world_to_camera: None,
    }
}

/// The time of a clip, which begins again at its end.
#[derive(Clone, Copy)]
pub struct Clock {
    /// Seconds; 0 of what does not change.
    pub length: f64,
    /// Seconds of the clip per second.
    pub speed: f64,
    pub is_playing: bool,
    /// Grows with every change that is no passing of time.
    pub version: u64,
    time: f64,
    since: Instant,
}

impl Clock {
    /// A clock that rests at `time`.
    pub fn new(length: f64, time: f64) -> Self {
        Clock {
            length,
            speed: 1.0,
            is_playing: false,
            version: 0,
            time: time.clamp(0.0, length),
            since: Instant::now(),
        }
    }

    /// Seconds of the clip at `now`.
    pub fn at(&self, now: Instant) -> f64 {
        let passed = if self.is_playing { now.saturating_duration_since(self.since).as_secs_f64() } else { 0.0 };
        let time = self.time + self.speed * passed;
        if time <= self.length || self.length <= 0.0 { time.min(self.length) } else { time.rem_euclid(self.length) }
    }

    /// Goes on from `time` at this speed, or rests there.
    pub fn set(&mut self, time: f64, is_playing: bool, speed: f64) {
        let (length, version) = (self.length, self.version + 1);
        *self = Clock { is_playing: is_playing && length > 0.0, speed, version, ..Clock::new(length, time) };
    }
}
