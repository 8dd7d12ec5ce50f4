//! Frames of videos as pictures for COLMAP.

use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::fit::Part;
use super::settings::{JPEG_QUALITY, Progress};
use super::video::{self, Video};
use crate::error::Result;
use crate::files::write_atomic;

/// Writes pictures of a video, by their numbers in it, to `folder`, each by the name of its place among them, unless they are there.
///
/// # Errors
/// Those of decoding and writing.
pub(super) fn take(
    folder: &Path,
    (path, video): (&Path, &Video),
    pictures: &[usize],
    threads: usize,
    name: impl Fn(u32) -> String,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<()> {
    let n = pictures.len();
    let file = |place: u32| folder.join(name(place));
    if (0..n as u32).all(|place| file(place).is_file()) {
        return Ok(());
    }
    let size @ (width, height) = (video.width, video.height);
    video::decode((path, video), pictures, Part::whole(size), size, threads, |place, rgb| {
        write_atomic(&file(place as u32), |to| {
            let encoder = JpegEncoder::new_with_quality(to, JPEG_QUALITY);
            encoder.write_image(rgb, width, height, ExtendedColorType::Rgb8).map_err(std::io::Error::other)
        })?;
        progress(Progress { stage: "frames", done: place + 1, total: n, piece: &name(place as u32) });
        Ok(())
    })
}
