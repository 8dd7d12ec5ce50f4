//! How large a synthetic capture is, and what disturbs it.

use serde::{Deserialize, Serialize};

/// Where the cameras stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rig {
    /// On an arc of 110 degrees along the near side of the room, in two heights, looking at its middle.
    Inward,
    /// On a hemisphere 0.5 m wide, looking outward, in a larger room: what there is to see is 1 to 8 m away.
    Outward,
    /// As `Outward`, and the hemisphere moves on a path and turns.
    Moving,
}

/// The data that noise disturbs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Noise {
    /// Nothing.
    None,
    /// Estimates from pictures: points (with outliers), flow, depth and keypoints.
    Priors,
    /// The same, with points of a bad structure from motion: 3 cm off, one in five an outlier.
    Rough,
    /// The priors, and the pictures themselves (sensor noise).
    All,
}

/// Everything that decides a synthetic capture; equal options give equal bytes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Options {
    /// Of colours, textures, speeds, the small things of the layout, and all noise.
    pub seed: u64,
    pub rig: Rig,
    /// 3 to 99, with the test cameras.
    pub cameras: u32,
    /// The first is central, the second peripheral, others lie between; at most `cameras - 2`.
    pub test_cameras: u32,
    /// Pixels, 16 to 8192.
    pub width: u32,
    /// Pixels, 16 to 8192.
    pub height: u32,
    /// 1 to 9999.
    pub frames: u32,
    /// Frames at the beginning in which nothing moves, 0 to `frames`; all movements are that much later.
    pub still_frames: u32,
    /// 1 to 1000.
    pub fps: u32,
    /// Rays per pixel and axis, 1 to 8; a pixel is the mean of their square.
    pub samples: u32,
    /// Triangulated points per frame, with outliers; at most 1,000,000.
    pub points: u32,
    pub noise: Noise,
    /// The clock of each training camera is off by a part of a frame (mean 0).
    pub offsets: bool,
    /// Each training camera has its own affine colour transform (mean identity).
    pub colors: bool,
    /// The lens hood of every second training camera covers a corner of its pictures, which masks leave out.
    pub masks: bool,
    /// The calibration has each training camera turned by 0.2 degrees and shifted by 10 mm.
    pub bent: bool,
    /// Photographs of the room without moving things, 2 to 99, from around an outward rig's place.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photos: Option<u32>,
}

/// Named options.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// The size that tests use.
    Tiny,
    /// The size of a first training run.
    Small,
    /// `Small` with time offsets, colour transforms, sensor noise and masks.
    Hard,
    /// `Small` with 12 cameras that look outward.
    Outward,
    /// `Small` with 40 frames and time offsets: for the studies of `ivv bench`.
    Study,
    Room,
}

impl Preset {
    /// Its options. All but `Hard` and `Study` have true clocks, all but `Hard` true colours; the priors of all are noisy.
    pub fn options(self, seed: u64) -> Options {
        let small = Options {
            seed,
            rig: Rig::Inward,
            cameras: 10,
            test_cameras: 2,
            width: 128,
            height: 96,
            frames: 12,
            still_frames: 0,
            fps: 30,
            samples: 3,
            points: 600,
            noise: Noise::Priors,
            offsets: false,
            colors: false,
            masks: false,
            bent: false,
            photos: None,
        };
        match self {
            Preset::Tiny => Options { cameras: 6, width: 64, height: 48, frames: 8, points: 200, ..small },
            Preset::Small => small,
            Preset::Hard => Options { noise: Noise::All, offsets: true, colors: true, masks: true, ..small },
            Preset::Outward => Options { rig: Rig::Outward, cameras: 12, ..small },
            Preset::Study => Options { frames: 40, offsets: true, ..small },
            Preset::Room => {
                let (width, height, samples) = (480, 360, 2);
                Options { cameras: 20, test_cameras: 3, width, height, frames: 60, samples, points: 4000, ..small }
            }
        }
    }
}

impl Rig {
    pub const ALL: [Rig; 3] = [Rig::Inward, Rig::Outward, Rig::Moving];
}

impl Options {
    /// The first field that is out of its range: (its name, what it must be).
    pub(super) fn fault(&self) -> Option<(&'static str, String)> {
        let ranges = [
            ("cameras", self.cameras, 3, 99),
            ("test_cameras", self.test_cameras, 0, self.cameras.saturating_sub(2)),
            ("width", self.width, 16, 8192),
            ("height", self.height, 16, 8192),
            ("frames", self.frames, 1, 9999),
            ("still_frames", self.still_frames, 0, self.frames),
            ("fps", self.fps, 1, 1000),
            ("samples", self.samples, 1, 8),
            ("points", self.points, 0, 1_000_000),
            // A photograph alone shares no point with another.
            ("photos", self.photos.unwrap_or(2), 2, 99),
        ];
        let outside = ranges.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value));
        outside.map(|(name, value, low, high)| (name, format!("{value} is not in {low}..={high}")))
    }
}
