//! Decoders of images, held to a limit of memory and kept from ending the program.

use std::io::{BufRead, BufReader};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use image::{ImageDecoder, ImageFormat, ImageReader, Limits};

use super::header::{BROKEN, fault, other_kind, unreadable};
use super::report::Fault;
use crate::files::open_file;

/// Largest width or height, pixels.
pub(super) const MAX_SIDE: u32 = 1 << 16;
/// What a decoder may allocate beyond its pixels, bytes.
pub(in crate::scene) const DECODER_SLACK: u64 = 64 << 20;

/// Third-party decoders have panicked on damaged images before; here that is a fault of the image.
pub(in crate::scene) fn guarded<T>(path: &Path, work: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    let broken = |_| Err(fault(path, "its decoder gave up", BROKEN));
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(broken)
}

/// The decoder of a PNG or JPEG, which allocates at most so many bytes.
pub(in crate::scene) fn decoder_of(path: &Path, max_bytes: u64) -> Result<impl ImageDecoder, Fault> {
    let failed = |cause: std::io::Error| unreadable(path, &cause);
    let mut file = BufReader::new(open_file(path).map_err(failed)?);
    let start = file.fill_buf().map_err(failed)?;
    let format = match image::guess_format(start) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
        _ => return Err(other_kind(path)),
    };
    // Looking at the start has not taken it.
    let mut reader = ImageReader::with_format(file, format);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(max_bytes);
    reader.limits(limits);
    reader.into_decoder().map_err(|cause| fault(path, format!("has a broken header: {cause}"), BROKEN))
}
