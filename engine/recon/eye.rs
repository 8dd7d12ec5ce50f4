//! A training camera at one frame, with a reduced picture.

use crate::error::Result;
use crate::scene::capture::{Capture, Picture};
use crate::scene::{Pose, View};
use glam::{Mat3, Vec2, Vec3};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ground {
    /// A mask excludes it.
    Unknown,
    /// Static; all pixels if there is no foreground mask.
    Still,
    Moving,
    /// The picture is cut out and transparent there.
    Empty,
}

/// A picture with its foreground mask and, where it is cut out, its opaque pixels, decoded.
pub(super) struct Seen {
    view: View,
    picture: Picture,
    pub foreground: Option<Vec<bool>>,
    opaque: Option<Vec<bool>>,
}

impl Seen {
    /// Decodes the picture of `camera` at `frame`. The alpha of `cut_out` pictures says what is empty and, in a rig's
    /// clip without masks, what moves.
    pub fn read(capture: &Capture, camera: usize, frame: u32, cut_out: bool) -> Result<Self> {
        let opaque = if cut_out { capture.opaque(camera, frame)? } else { None };
        let foreground = capture.foreground(camera, frame)?;
        Ok(Seen {
            view: capture.view(camera, frame)?,
            picture: capture.picture(camera, frame)?,
            foreground: foreground.or_else(|| opaque.clone().filter(|_| capture.is_rig_clip())),
            opaque,
        })
    }
}

/// A pinhole camera with a reduced picture, in f32: the capture is in the frame of training.
pub(super) struct ViewBuffers {
    pub width: usize,
    pub height: usize,
    /// The lens, world.
    pub center: Vec3,
    pub focal: Vec2,
    principal: Vec2,
    /// World to camera.
    rotation: Mat3,
    /// Mean colour of each pixel, row by row, in [0, 1].
    pub color: Vec<[f32; 3]>,
    pub ground: Vec<Ground>,
}

#[derive(Clone, Copy)]
pub(super) struct Axis {
    pub center: Vec3,
    pub along: Vec3,
}

impl Axis {
    pub fn of(pose: &Pose) -> Self {
        Axis { center: pose.center().as_vec3(), along: pose.rotation.as_mat3().row(2) }
    }

    /// Depth of a point; negative behind the camera.
    pub fn depth(&self, world: Vec3) -> f32 {
        self.along.dot(world - self.center)
    }
}

/// The line on which a camera sees a ray.
pub(super) struct Trace<'a> {
    eye: &'a ViewBuffers,
    at: Vec3,
    along: Vec3,
}

impl Trace<'_> {
    /// The pixel that shows the ray's point of one over the depth `w`, above 0.
    pub fn pixel(&self, w: f32) -> Option<usize> {
        // The point times w, which is seen at the same place.
        let point = self.at + self.along * w;
        (point.z > 1e-6 * w)
            .then(|| point.truncate() / point.z * self.eye.focal + self.eye.principal)
            .and_then(|at| self.eye.pixel(at))
    }
}

/// The least whole number by which both sides are divided to be at most `longest` pixels.
fn block(width: usize, height: usize, longest: usize) -> usize {
    width.max(height).div_ceil(longest).max(1)
}

impl ViewBuffers {
    /// Reduces a picture by the least whole number that leaves at most `longest` pixels on each side.
    pub fn new(seen: &Seen, longest: usize) -> Self {
        let Seen { view, picture, foreground, opaque } = seen;
        let (full_width, full_height) = (picture.width as usize, picture.height as usize);
        let block = block(full_width, full_height, longest);
        let (width, height) = (full_width.div_ceil(block), full_height.div_ceil(block));
        let (mut color, mut ground) = (Vec::new(), Vec::new());
        let is_opaque = |at: usize| opaque.as_ref().is_none_or(|opaque| opaque[at]);
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
            let rows = row * block..((row + 1) * block).min(full_height);
            let columns = column * block..((column + 1) * block).min(full_width);
            let n_all = rows.len() * columns.len();
            let (mut sum, mut n_valid, mut n_shown, mut n_moving) = ([0.0; 3], 0, 0, 0);
            for at in rows.flat_map(|y| columns.clone().map(move |x| y * full_width + x)) {
                let [r, g, b, valid] = picture.pixels[at].to_le_bytes();
                n_valid += usize::from(valid > 0);
                if valid > 0 && is_opaque(at) {
                    n_shown += 1;
                    n_moving += usize::from(foreground.as_ref().is_some_and(|is_moving| is_moving[at]));
                    sum.iter_mut().zip([r, g, b]).for_each(|(sum, c)| *sum += f32::from(c));
                }
            }
            color.push(sum.map(|sum| sum / (255.0 * n_shown.max(1) as f32)));
            ground.push(match () {
                () if 2 * n_valid < n_all => Ground::Unknown,
                () if 2 * n_shown < n_valid => Ground::Empty,
                () if 2 * n_moving >= n_shown => Ground::Moving,
                () => Ground::Still,
            });
        }
        ViewBuffers { color, ground, ..ViewBuffers::blank(view, longest) }
    }

    /// The camera with a reduced picture without colours, all static.
    pub fn blank(view: &View, longest: usize) -> Self {
        let View { pose, intrinsics, .. } = view;
        let (full_width, full_height) = (intrinsics.width as usize, intrinsics.height as usize);
        let block = block(full_width, full_height, longest);
        let (width, height) = (full_width.div_ceil(block), full_height.div_ceil(block));
        ViewBuffers {
            width,
            height,
            center: pose.center().as_vec3(),
            focal: (intrinsics.focal() / block as f64).as_vec2(),
            principal: (intrinsics.principal() / block as f64).as_vec2(),
            rotation: pose.rotation.as_mat3(),
            color: Vec::new(),
            ground: vec![Ground::Still; width * height],
        }
    }

    /// Place in the picture, pixels, and depth; `None` behind the camera.
    pub fn project(&self, world: Vec3) -> Option<(Vec2, f32)> {
        let at = self.rotation * (world - self.center);
        (at.z > 1e-6).then(|| (at.truncate() / at.z * self.focal + self.principal, at.z))
    }

    pub fn pixel(&self, at: Vec2) -> Option<usize> {
        let is_inside = at.x >= 0.0 && at.y >= 0.0 && at.x < self.width as f32 && at.y < self.height as f32;
        is_inside.then(|| at.y as usize * self.width + at.x as usize)
    }

    pub fn sees(&self, world: Vec3) -> Option<(usize, f32)> {
        let (at, depth) = self.project(world)?;
        Some((self.pixel(at)?, depth))
    }

    /// Where this camera sees the points `from + ray / w` of a ray, by w.
    pub fn trace(&self, from: Vec3, ray: Vec3) -> Trace<'_> {
        Trace { eye: self, at: self.rotation * ray, along: self.rotation * (from - self.center) }
    }

    /// World direction through the middle of a pixel, of depth 1.
    pub fn ray(&self, pixel: usize) -> Vec3 {
        let at = Vec2::new((pixel % self.width) as f32 + 0.5, (pixel / self.width) as f32 + 0.5);
        self.rotation.transpose() * ((at - self.principal) / self.focal).extend(1.0)
    }

    pub fn axis(&self) -> Axis {
        Axis { center: self.center, along: self.rotation.row(2) }
    }
}
