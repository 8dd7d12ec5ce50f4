//! A camera that a person moves, as in the browser player: it turns about a point before it or about itself.

use glam::{DMat3, DVec2, DVec3};

use super::orbit::{Orbit, upright};
use super::{Intrinsics, Pose, Splats, View};
use crate::report::statistics::median_high;

const TURN_PER_PIXEL: f64 = 0.005;
const KEY_TURN: f64 = 1.2;
/// Parts of the distance of what it looks at per second, slow and fast.
const KEY_SHIFT: [f64; 2] = [0.5, 1.6];
/// Sine of the steepest angle to the horizon.
const STEEPEST: f64 = 0.995;
/// Part of the scene's size below which its middle is too near to be what it looks at.
const TOO_NEAR: f64 = 0.05;
/// Gaussians at most whose places give the scene's extent.
const MOST_PLACES: usize = 100_000;

/// A camera on its way.
#[derive(Clone, Debug)]
pub struct Navigator {
    view: View,
    /// World to camera: rows right, down, forward.
    rotation: DMat3,
    center: DVec3,
    up: DVec3,
    middle: DVec3,
    radius: f64,
    /// Distance of what it looks at, scene units.
    pub reach: f64,
    /// It turns about itself instead of what it looks at.
    pub is_flying: bool,
}

/// Where keys push: shifts right, down and forward, and turns right and down, each from -1 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Push {
    pub shift: DVec3,
    pub turn: DVec2,
    /// Shifts are about three times as fast.
    pub is_fast: bool,
}

/// Middle and size of where Gaussians are: medians, which a backdrop hardly changes.
fn extent(splats: &Splats) -> (DVec3, f64) {
    let each = splats.position.len().div_ceil(MOST_PLACES).max(1);
    let places: Vec<DVec3> =
        splats.position.iter().map(|p| DVec3::from(p.map(f64::from))).filter(|p| p.is_finite()).step_by(each).collect();
    let along = |axis: usize| median_high(places.iter().map(|place| place[axis])).unwrap_or_default();
    let middle = DVec3::new(along(0), along(1), along(2));
    let radius = median_high(places.iter().map(|place| place.distance(middle))).unwrap_or_default();
    (middle, radius.max(1e-3))
}

impl Navigator {
    /// For `views` of `splats`: upright as they are on average, at the first of them, or where it sees all of the scene. It looks at the
    /// middle of what the views look at, or of the scene where they do not look at one place.
    pub fn new(views: &[View], splats: &Splats) -> Self {
        let (center, radius) = extent(splats);
        let middle = Orbit::new(views).map_or(center, |orbit| orbit.middle);
        let up = upright(views).unwrap_or(DVec3::NEG_Y);
        let whole = || {
            let eye = middle - 3.0 * radius * DVec3::Z;
            View::look_at(eye.into(), middle.into(), DVec3::NEG_Y.into(), Intrinsics::of_fov(1280, 720, 50.0))
        };
        let view = views.first().cloned().unwrap_or_else(whole);
        let (rotation, center, is_flying) = (DMat3::IDENTITY, DVec3::ZERO, false);
        let mut made = Navigator { view: view.clone(), rotation, center, up, middle, radius, reach: radius, is_flying };
        made.go(&view);
        made
    }

    /// Goes where `view` is, and looks at what is as far as the middle of the scene, if that is before it.
    pub fn go(&mut self, view: &View) {
        let pose = view.pose;
        (self.rotation, self.center) = (pose.rotation, pose.center());
        self.view = view.clone();
        let depth = self.forward().dot(self.middle - self.center);
        self.reach = if depth > TOO_NEAR * self.radius { depth } else { self.radius };
    }

    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// A unit vector of the world, as [`Navigator::above`].
    pub fn forward(&self) -> DVec3 {
        self.rotation.row(2)
    }

    pub fn above(&self) -> DVec3 {
        -self.rotation.row(1)
    }

    /// In a picture of this size, see [`View::fitted`].
    pub fn view(&self, size: [u32; 2]) -> View {
        View { pose: Pose::at(self.center, self.rotation), ..self.view.fitted(size) }
    }

    /// Turns so that the scene follows a pointer that was dragged by so many pixels.
    pub fn drag(&mut self, by: DVec2) {
        let angle = if self.is_flying { TURN_PER_PIXEL } else { -TURN_PER_PIXEL };
        self.turn(angle * self.sideways() * by.x, angle * by.y, self.is_flying);
    }

    /// Shifts so that what it looks at follows a pointer that was dragged by so many pixels of a picture of this size.
    pub fn pan(&mut self, by: DVec2, size: [u32; 2]) {
        let focal = self.view.intrinsics.fitted(size).focal();
        self.shift((-by / focal).extend(0.0) * self.reach);
    }

    /// Moves to `factor` times the distance of what it looks at; in flight, that moves on too.
    pub fn approach(&mut self, factor: f64) {
        let reach = (self.reach * factor).max(1e-4);
        self.shift(DVec3::Z * (self.reach - reach));
        if !self.is_flying {
            self.reach = reach;
        }
    }

    /// Moves for `seconds` as keys push; turns are about itself.
    pub fn advance(&mut self, push: Push, seconds: f64) {
        self.shift(push.shift * self.reach * seconds * KEY_SHIFT[usize::from(push.is_fast)]);
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
