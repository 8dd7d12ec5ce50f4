//! Frames of videos as pictures for COLMAP.

use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::fit::Part;
use super::settings::{JPEG_QUALITY, Progress};
use super::video::{self, Selection};
use crate::error::Result;
use crate::files::write_atomic;

/// Writes frames of a video to `folder`, by their names, unless they are there.
pub(super) fn take(
    folder: &Path,
    path: &Path,
    select: Selection,
    threads: usize,
    name: impl Fn(u32) -> String,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<()> {
    let file = |frame: u32| folder.join(name(frame));
    if (0..select.n).all(|frame| file(frame).is_file()) {
        return Ok(());
    }
    let video = video::probe(path)?;
    let size @ (width, height) = (video.width, video.height);
    video::decode((path, &video), select, Part::whole(size), size, threads, |frame, rgb| {
        write_atomic(&file(frame), |to| {
            let encoder = JpegEncoder::new_with_quality(to, JPEG_QUALITY);
            encoder.write_image(rgb, width, height, ExtendedColorType::Rgb8).map_err(std::io::Error::other)
        })?;
        let (done, total) = (frame as usize + 1, select.n as usize);
        progress(Progress { stage: "frames", done, total, piece: &name(frame) });
        Ok(())
    })
}
