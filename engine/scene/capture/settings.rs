//! How a capture is read.

use super::frames::Frames;
use std::path::{Path, PathBuf};

/// The meaning of an image's alpha channel. Either way the background shows through where it is below 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Alpha {
    /// Opacity alone.
    #[default]
    Background,
    /// Also the foreground mask of images that have no other: pixels that are at least half opaque.
    Mask,
}

/// How a capture is read. The default suits every format.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CaptureSettings {
    /// Names of the test cameras; `None` takes those that the format declares.
    pub test_cameras: Option<Vec<String>>,
    /// Plain COLMAP and `transforms.json` declare no test images: every n-th of the sorted names is one; 0 for none.
    pub test_every: usize,
    /// Colour behind images that have an alpha channel, and of the views; in [0, 1].
    pub background: [f32; 3],
    /// Which frames of the clip are used. Where some between them are left out, flow, which leads to the next frame of the clip,
    /// is left out too.
    #[serde(alias = "max_frames")]
    pub frames: Frames,
    /// Frames per second of a capture that does not specify it.
    pub fps: f64,
    /// Leaves out images whose file is absent, with a note, where each is a fault otherwise.
    pub skip_missing: bool,
    /// Takes the foreground masks of Dynamic3DGaussians (`seg/`) as masks too. Off by default: they label motion, not
    /// validity, and a training that ignores the other pixels has no background.
    pub foreground_masks: bool,
    /// Names of cameras that are left out, as if the capture did not have them.
    pub exclude: Vec<String>,
    /// Which model of a plain COLMAP project is read, by its number in `sparse`; `None` takes that of the most images.
    pub model: Option<u32>,
    /// Folder of the images, relative to the capture, of a plain COLMAP project, a `transforms.json`, LLFF or OpenSfM. The default
    /// is where these formats have them. Of COLMAP and LLFF the largest of `images_2`, `images_4` and `images_8` is taken where
    /// there is no `images`, with a note.
    pub images: PathBuf,
    /// Takes the folder of images of 1/N of the size, `images_N`, instead.
    pub downscale: Option<u32>,
    /// Scales a camera's intrinsics, along each axis, to the size of its images where it differs from the calibration.
    /// Otherwise they are scaled, with a note, when the images of all cameras differ by one common factor, within rounding;
    /// any other difference is a fault.
    pub rescale: bool,
    /// The meaning of an image's alpha channel.
    pub alpha: Alpha,
}

impl Default for CaptureSettings {
    fn default() -> Self {
        CaptureSettings {
            test_cameras: None,
            test_every: 8,
            background: [0.0; 3],
            frames: Frames::default(),
            fps: 30.0,
            skip_missing: false,
            foreground_masks: false,
            exclude: Vec::new(),
            model: None,
            images: PathBuf::from("images"),
            downscale: None,
            rescale: false,
            alpha: Alpha::default(),
        }
    }
}

impl CaptureSettings {
    /// The folder of images, where it is not the default.
    pub(super) fn asked_images(&self) -> Option<&Path> {
        (self.images != CaptureSettings::default().images).then_some(self.images.as_path())
    }
}
