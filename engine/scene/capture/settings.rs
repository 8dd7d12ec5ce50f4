//! How a capture is read.

use super::Frames;
use std::path::{Path, PathBuf};

/// The meaning of an image's alpha channel. Either way the background shows through where it is below 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Alpha {
    /// Opacity alone.
    #[default]
    Background,
    /// Also the foreground mask of images that have no other: where it is at least half opaque.
    Mask,
}

/// How a capture is read. The default suits every format.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CaptureSettings {
    /// Names of the test cameras; `None` takes those that the format declares.
    pub test_cameras: Option<Vec<String>>,
    /// Where the format declares no test images, every n-th of the sorted names is one; 0 for none.
    pub test_every: usize,
    /// Colour behind images that have an alpha channel, and of the views; in [0, 1].
    pub background: [f32; 3],
    /// Which frames of the clip are used. Flow leads to the next frame of the clip: it is left out where that is.
    pub frames: Frames,
    /// Frames per second of a capture that does not specify it.
    pub fps: f64,
    /// Leaves out images whose file is absent, with a note, where each is a fault otherwise.
    pub skip_missing: bool,
    /// Takes the foreground masks of Dynamic3DGaussians (`seg/`) as masks too. A training that ignores the other pixels has no background.
    pub foreground_masks: bool,
    /// Names of cameras that are left out.
    pub exclude: Vec<String>,
    /// The number in `sparse` of the model of a plain COLMAP project; `None` takes that of the most images.
    pub model: Option<u32>,
    /// Folder of the images, relative to the capture, of a plain COLMAP project, a `transforms.json`, LLFF or OpenSfM. COLMAP and LLFF may
    /// have `images_2`, `images_4` or `images_8` in its place.
    pub images: PathBuf,
    /// Takes the folder of images of 1/N of the size, `images_N`, instead.
    pub downscale: Option<u32>,
    /// Scales each camera's intrinsics to the size of its images. Without it they are scaled, with a note, only when the images of all
    /// cameras differ by one factor, and any other difference is a fault.
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
    /// The folder of images, if it is not the default.
    pub(super) fn asked_images(&self) -> Option<&Path> {
        (self.images != CaptureSettings::default().images).then_some(self.images.as_path())
    }
}
