//! A camera of the capture: which part of what was recorded becomes which pictures.

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::prepare::fit::Part;
use crate::prepare::foreign::{Kind, kind};
use crate::prepare::journal::stamps;
use crate::prepare::video::Video;
use crate::scene::Pose;
use crate::scene::capture::Shot;
use crate::scene::undistort::{Distortion, Lens};
use crate::video::chapters;

/// A camera of the capture.
pub(in crate::prepare) struct Camera {
    pub name: String,
    pub is_test: bool,
    /// First frame of the footage that is taken.
    pub start: u32,
    /// Of the finished pictures.
    pub pinhole: Lens,
    /// One, or one for each frame when the camera moves.
    pub poses: Vec<Pose>,
    /// Of the pictures as they are recorded.
    pub(super) recorded: (u32, u32),
    /// What is taken of them.
    pub(super) part: Part,
    /// Of that part, scaled.
    pub lens: Lens,
    pub(super) material: Material,
    /// Of a video, by frame of the capture; none where it has none.
    pub(super) masks: Vec<PathBuf>,
}

/// What a camera's pictures are made from.
pub(super) enum Material {
    Video(PathBuf, Video),
    /// By frame of the capture.
    Images(Vec<Shot>),
}

impl Camera {
    /// Whether its pictures stay as they are.
    pub fn is_as_recorded(&self) -> bool {
        let whole = (self.lens.intrinsics.width, self.lens.intrinsics.height) == self.recorded
            && self.part == Part::whole(self.recorded);
        whole && self.lens.distortion == Distortion::None
    }

    /// The shot of a frame when its image is taken over as it is.
    pub(super) fn taken_over(&self, frame: u32) -> Option<&Shot> {
        match &self.material {
            Material::Images(shots) if self.is_as_recorded() => {
                shots.get(frame as usize).filter(|shot| kind(&shot.image) == Kind::Own)
            }
            _ => None,
        }
    }

    /// A place of the recorded pictures in the scaled part.
    pub fn scaled(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let Part { x: left, y: top, width, height } = self.part;
        let scale = |side: u32, of: u32| f64::from(side) / f64::from(of);
        let (across, down) = (scale(self.lens.intrinsics.width, width), scale(self.lens.intrinsics.height, height));
        [(x - f64::from(left)) * across, (y - f64::from(top)) * down]
    }

    /// What its pictures are made from, where those are images.
    fn shots(&self) -> &[Shot] {
        match &self.material {
            Material::Video(..) => &[],
            Material::Images(shots) => shots,
        }
    }

    /// The flow that comes along with its picture of a frame.
    pub fn flow(&self, frame: u32) -> Option<&PathBuf> {
        self.shots().get(frame as usize)?.flow.as_ref()
    }

    /// Flow and depth that come along with its pictures.
    pub(super) fn priors(&self) -> impl Iterator<Item = &PathBuf> {
        self.shots().iter().flat_map(|shot| shot.flow.iter().chain(&shot.depth))
    }

    /// What the camera's pictures are made from.
    pub(super) fn stamp(&self) -> Value {
        let footage = match &self.material {
            Material::Video(path, _) => stamps(chapters(path)),
            Material::Images(shots) => stamps(shots.iter().flat_map(Shot::pictures)),
        };
        let mut stamp = json!({ "name": self.name, "lens": self.lens, "pinhole": self.pinhole, "footage": footage });
        if !self.masks.is_empty() {
            stamp["masks"] = stamps(&self.masks);
        }
        stamp
    }
}
