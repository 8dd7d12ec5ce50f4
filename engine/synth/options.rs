//! How large a synthetic capture is, and what disturbs it.

use serde::Serialize;

/// Where the cameras stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Rig {
    /// On an arc of 110 degrees along the near side of the room, in two heights, looking at its middle.
    Inward,
    /// On a hemisphere 0.5 m wide, looking outward, in a larger room: what there is to see is 1 to 8 m away.
    Outward,
    /// As `Outward`, and the hemisphere moves on a path and turns.
    Moving,
}

/// Parts that noise disturbs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Noise {
    /// Nothing: points, flow, depth and keypoints are exact and no point is an outlier.
    None,
    /// Estimates from pictures: points (with outliers), flow, depth and keypoints.
    Priors,
    /// The same, with points as of a structure from motion that fits badly: 3 cm off, one in five an outlier.
    Rough,
    /// The priors, and the pictures themselves (sensor noise).
    All,
}

/// Everything that decides a synthetic capture; equal options give equal bytes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Options {
    /// Decides colours, textures, speeds, the small things of the layout, and all noise.
    pub seed: u64,
    /// Where the cameras stand.
    pub rig: Rig,
    /// Cameras in all, 3 to 99.
    pub cameras: u32,
    /// Held out: the first is central, the second peripheral, others lie between; at most `cameras - 2`.
    pub test_cameras: u32,
    /// Pixels, 16 to 8192.
    pub width: u32,
    /// Pixels, 16 to 8192.
    pub height: u32,
    /// Frames of the clip, 1 to 9999.
    pub frames: u32,
    /// Frames at the beginning in which nothing moves, 0 to `frames`; what moves does so later then.
    pub still_frames: u32,
    /// Frames per second, 1 to 1000.
    pub fps: u32,
    /// Rays per pixel and axis, 1 to 8; a pixel is the mean of their square.
    pub samples: u32,
    /// Triangulated points per frame, outliers included; at most 1,000,000.
    pub points: u32,
    /// What is disturbed by noise.
    pub noise: Noise,
    /// Each training camera's clock is off by its own part of a frame (mean 0); test cameras keep the true time.
    pub offsets: bool,
    /// Each training camera has its own affine colour transform (mean identity); test cameras keep the true colours.
    pub colors: bool,
    /// Every second training camera's lens hood covers a corner of its pictures, and masks say so.
    pub masks: bool,
    /// The calibration has each training camera turned by 0.2 degrees and shifted by 10 mm from where it is.
    pub bent: bool,
    /// Photographs of the room without what moves, 2 to 99: taken from around an outward rig's place, looking outward.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photos: Option<u32>,
}

/// Named options.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// For tests: 6 cameras (2 for test), 64 x 48, 8 frames.
    Tiny,
    /// For a first training run: 10 cameras (2 for test), 128 x 96, 12 frames.
    Small,
    /// `Small` with time offsets, colour transforms, sensor noise and masks.
    Hard,
    /// `Small` with 12 cameras that look outward.
    Outward,
    /// `Small` with 40 frames and time offsets: for the studies of `ivv bench`.
    Study,
    /// 20 cameras (3 for test), 480 x 360, 60 frames.
    Room,
}

impl Preset {
    /// Every preset, the smallest first.
    pub const ALL: [Preset; 6] =
        [Preset::Tiny, Preset::Small, Preset::Hard, Preset::Outward, Preset::Study, Preset::Room];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Preset::Tiny => "tiny",
            Preset::Small => "small",
            Preset::Hard => "hard",
            Preset::Outward => "outward",
            Preset::Study => "study",
            Preset::Room => "room",
        }
    }

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
    /// Every rig.
    pub const ALL: [Rig; 3] = [Rig::Inward, Rig::Outward, Rig::Moving];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Rig::Inward => "inward",
            Rig::Outward => "outward",
            Rig::Moving => "moving",
        }
    }
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
