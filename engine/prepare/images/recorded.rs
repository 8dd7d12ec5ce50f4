//! Footage as it was recorded: its size, its length, its rate.

use crate::error::{Error, Result};
use crate::prepare::fit::Part;
use crate::prepare::foreign::{decode_image, size_for};
use crate::prepare::source::{Footage, Source, SourceCamera};
use crate::prepare::video::{self, Video};

/// Footage that has been looked at.
pub(super) struct Recorded {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Of images, by the last of their numbers.
    pub n_frames: u32,
    pub video: Option<Video>,
}

impl Recorded {
    /// Looks at the footage of a camera.
    ///
    /// # Errors
    /// [`Error::Data`] where it cannot be read.
    pub fn look(camera: &SourceCamera, source: &Source) -> Result<Recorded> {
        match &camera.footage {
            Footage::Video(path) => {
                let video = video::probe(path)?;
                let size = (video.width, video.height);
                Ok(Recorded { size, n_frames: video.n_frames(), video: Some(video) })
            }
            Footage::Images(shots) => {
                let Some(last) = shots.iter().map(|shot| shot.frame).max() else {
                    let place = format!("camera `{}`", camera.name.escape_debug());
                    let remedy = "add its images, or remove the camera";
                    return Err(Error::data(&source.calibration, place, "has no image", remedy));
                };
                let lens = camera.lens.intrinsics;
                let size = size_for(&shots[0].image, (lens.width, lens.height))?;
                Ok(Recorded { size, n_frames: last + 1, video: None })
            }
        }
    }

    /// The first picture.
    pub fn first(&self, footage: &Footage) -> Result<Vec<[u8; 3]>> {
        let (width, height) = self.size;
        match (footage, &self.video) {
            (Footage::Video(path), Some(video)) => {
                let mut pixels = Vec::new();
                video::decode((path, video), &[0], Part::whole(self.size), self.size, 1, |_, rgb| {
                    pixels.extend_from_slice(rgb.as_chunks().0);
                    Ok(())
                })?;
                Ok(pixels)
            }
            (Footage::Video(_), None) => Ok(Vec::new()),
            (Footage::Images(shots), _) => {
                let image = decode_image(&shots[0].image, width, height)?.into_rgb8();
                Ok(image.as_raw().as_chunks().0.to_vec())
            }
        }
    }
}
