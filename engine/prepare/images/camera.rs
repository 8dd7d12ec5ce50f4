//! A camera of the capture: which part of what was recorded becomes which pictures.

use std::path::PathBuf;

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::prepare::fit::Crop;
use crate::prepare::foreign::{Kind, kind};
use crate::prepare::journal::stamps;
use crate::prepare::video::Video;
use crate::scene::Pose;
use crate::scene::capture::Shot;
use crate::scene::undistort::{Distortion, Lens};
use crate::video::chapters;

pub(in crate::internals::prepare) struct Camera {
    pub name: String,
    pub is_test: bool,
    /// First frame of the footage that is taken; of videos, of those that it has at the clip's rate.
    pub start: u32,
    pub pinhole: Lens,
    /// One, or one for each frame when the camera moves.
    pub poses: Vec<Pose>,
    pub(super) recorded: (u32, u32),
    pub(super) part: Crop,
    /// Of that part, scaled.
    pub lens: Lens,
    pub(super) material: Material,
    /// Of a video, by frame of the capture; none where it has none.
    pub(super) masks: Vec<PathBuf>,
}

pub(super) enum Material {
    /// With the number of the picture that each frame of the capture shows; none where the camera has none then.
    Video(Video, Vec<Option<usize>>),
    /// By frame of the capture; none where it has no image then.
    Images(Vec<Option<Shot>>),
}

impl Camera {
    pub fn is_as_recorded(&self) -> bool {
        let whole = (self.lens.intrinsics.width, self.lens.intrinsics.height) == self.recorded
            && self.part == Crop::whole(self.recorded);
        whole && self.lens.distortion == Distortion::None
    }

    /// The shot of a frame when its image is taken over as it is.
    pub(super) fn taken_over(&self, frame: u32) -> Option<&Shot> {
        match &self.material {
            Material::Images(shots) if self.is_as_recorded() => {
                shots.get(frame as usize)?.as_ref().filter(|shot| kind(&shot.image) == Kind::Own)
            }
            _ => None,
        }
    }

    pub fn has(&self, frame: u32) -> bool {
        match &self.material {
            Material::Video(_, pictures) => pictures.get(frame as usize).is_some_and(Option::is_some),
            Material::Images(shots) => shots.get(frame as usize).is_some_and(Option::is_some),
        }
    }

    /// The frame of its footage that a frame of the capture shows, `every` frames of the footage being one of the capture.
    pub fn source_frame(&self, frame: u32, every: u32) -> Option<u32> {
        match &self.material {
            Material::Video(_, pictures) => {
                pictures.get(frame as usize)?.and_then(|picture| u32::try_from(picture).ok())
            }
            Material::Images(_) => Some(self.start + frame * every),
        }
    }

    /// A place of the recorded pictures in the scaled part.
    pub fn scaled(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let Crop { x: left, y: top, width, height } = self.part;
        let scale = |side: u32, of: u32| f64::from(side) / f64::from(of);
        let (across, down) = (scale(self.lens.intrinsics.width, width), scale(self.lens.intrinsics.height, height));
        [(x - f64::from(left)) * across, (y - f64::from(top)) * down]
    }

    fn shots(&self) -> &[Option<Shot>] {
        match &self.material {
            Material::Video(..) => &[],
            Material::Images(shots) => shots,
        }
    }

    pub fn flow(&self, frame: u32) -> Option<&PathBuf> {
        self.shots().get(frame as usize)?.as_ref()?.flow.as_ref()
    }

    pub(super) fn priors(&self) -> impl Iterator<Item = &PathBuf> {
        self.shots().iter().flatten().flat_map(|shot| shot.flow.iter().chain(&shot.depth))
    }

    pub(super) fn stamp(&self, every: u32) -> Value {
        let footage = match &self.material {
            Material::Video(video, _) => stamps(chapters(&video.path)),
            Material::Images(shots) => stamps(shots.iter().flatten().flat_map(Shot::pictures)),
        };
        let mut stamp = json!({ "name": self.name, "lens": self.lens, "pinhole": self.pinhole, "footage": footage });
        if !self.masks.is_empty() {
            stamp["masks"] = stamps(&self.masks);
        }
        let Material::Video(video, pictures) = &self.material else { return stamp };
        // Noted where it is not what earlier versions did.
        if pictures.iter().enumerate().any(|(k, picture)| *picture != Some(self.start as usize + k * every as usize)) {
            let mut hash = Sha256::new();
            pictures.iter().for_each(|picture| hash.update(format!("{picture:?}\n")));
            stamp["pictures"] = json!(format!("{:x}", hash.finalize()));
        }
        if let Some(colour) = &video.colour {
            stamp["colour"] = json!(colour.filter);
        }
        if let Some(top_first) = video.top_first {
            stamp["top field first"] = json!(top_first);
        }
        stamp
    }
}
