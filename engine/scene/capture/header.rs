//! Sizes of PNGs and JPEGs from their headers, with a check that they are whole, since decoders make a picture of half a file too; and
//! the decoders, with a limit of memory and guarded against panics.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use image::{ImageDecoder, ImageFormat, ImageReader, Limits};

use super::Fault;
use crate::files::open_file;

pub(super) const MAX_SIDE: u32 = 1 << 16;
/// Allocation of a decoder beyond its pixels, bytes.
pub(crate) const DECODER_SLACK: u64 = 64 << 20;
pub(crate) const BROKEN: &str = "make or copy the image again";
const PNG: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
const JPEG: [u8; 2] = [0xff, 0xd8];
/// The end of an image. It cannot be in the compressed data of a JPEG, and only by chance in that of a PNG.
const JPEG_END: &[u8] = &[0xff, 0xd9];
const PNG_END: &[u8] = b"IEND";
/// Last bytes of a file that may hold the end of its image; some programs append a little.
const TAIL_BYTES: u64 = 1024;

pub(super) fn fault(path: &Path, reason: impl Into<String>, remedy: &str) -> Fault {
    Fault { file: path.to_owned(), place: String::new(), reason: reason.into(), remedy: remedy.to_owned() }
}

pub(super) fn unreadable(path: &Path, cause: &io::Error) -> Fault {
    match cause.kind() {
        ErrorKind::NotFound => fault(path, "is missing", "add the image, or remove its camera or frame"),
        ErrorKind::UnexpectedEof => fault(path, "ends within its header", BROKEN),
        _ => fault(path, format!("cannot be read: {cause}"), "check the file and its permissions"),
    }
}

/// Width and height in pixels, neither of them 0, of a file that is not cut off.
pub(crate) fn read_size(path: &Path) -> Result<(u32, u32), Fault> {
    let failed = |cause: io::Error| unreadable(path, &cause);
    let file = open_file(path).map_err(failed)?;
    let n_bytes = file.metadata().map_err(failed)?.len();
    if n_bytes == 0 {
        return Err(fault(path, "has 0 bytes", BROKEN));
    }
    let mut from = BufReader::new(file);
    let mut start = [0; 2];
    from.read_exact(&mut start).map_err(failed)?;
    let (size, end) = if start == PNG[..2] {
        (png_size(&mut from).map(|size| size.map(Ok)), PNG_END)
    } else if start == JPEG {
        (jpeg_size(&mut from), JPEG_END)
    } else {
        return Err(other_kind(path));
    };
    let size = match size.map_err(failed)? {
        Some(Ok(size)) if size.0 > 0 && size.1 > 0 => size,
        Some(Err(unread)) => {
            let remedy = "convert the image to PNG, as with `ffmpeg -i IN OUT.png`";
            return Err(fault(path, format!("is {unread}, which is not read"), remedy));
        }
        _ => return Err(fault(path, "has a broken header", BROKEN)),
    };
    let of_image = from.stream_position().map_err(failed)?;
    let mut tail = Vec::new();
    let from_tail = from.seek(SeekFrom::Start(n_bytes.saturating_sub(TAIL_BYTES)));
    from_tail.and_then(|_| from.by_ref().take(TAIL_BYTES).read_to_end(&mut tail)).map_err(failed)?;
    // Telephones append a video to their photos.
    let is_whole = tail.windows(end.len()).any(|window| window == end)
        || end == JPEG_END
            && from.seek(SeekFrom::Start(of_image)).and_then(|_| jpeg_ends(&mut from)).map_err(failed)?;
    if is_whole { Ok(size) } else { Err(fault(path, "is cut off: the end of the image is missing", BROKEN)) }
}

/// The fault of a picture of a kind that is not read, named by its first bytes.
fn other_kind(path: &Path) -> Fault {
    let mut start = [0; 12];
    let is_read = open_file(path).is_ok_and(|mut file| file.read_exact(&mut start).is_ok());
    let kind = match &start {
        _ if !is_read => None,
        [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..] => Some("a TIFF, or a raw photo of that form"),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P'] => Some("a WebP"),
        [_, _, _, _, b'f', b't', b'y', b'p', b'a', b'v', b'i', ..] => Some("an AVIF"),
        [_, _, _, _, b'f', b't', b'y', b'p', ..] => Some("a HEIC"),
        [b'G', b'I', b'F', b'8', ..] => Some("a GIF"),
        [b'B', b'M', ..] => Some("a BMP"),
        [0x76, 0x2f, 0x31, 0x01, ..] => Some("an OpenEXR image"),
        _ => None,
    };
    let Some(kind) = kind else { return fault(path, "is neither a PNG nor a JPEG", "convert the image to PNG") };
    let remedy = "convert the images, as with `ffmpeg -i IN OUT.png`, beside them: a PNG of the same name is found too";
    fault(path, format!("is {kind}, neither a PNG nor a JPEG"), remedy)
}

/// As [`read_size`], of a picture that is turned as its EXIF says if it fits its calibration only then.
pub(crate) fn size_for(path: &Path, calibrated: (u32, u32)) -> Result<(u32, u32), Fault> {
    let size = read_size(path)?;
    let fits = size != calibrated && (size.1, size.0) == calibrated && is_turned(path);
    Ok(if fits { calibrated } else { size })
}

/// True if a picture's EXIF says that its rows are shown as columns.
pub(super) fn is_turned(path: &Path) -> bool {
    use image::metadata::Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    let turn = guarded(path, || Ok(decoder_of(path, DECODER_SLACK)?.orientation()));
    matches!(turn, Ok(Ok(Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH)))
}

/// True if the end of a JPEG comes after its frame header; that of a thumbnail comes before.
fn jpeg_ends(from: &mut BufReader<File>) -> io::Result<bool> {
    while from.skip_until(JPEG_END[0])? > 0 {
        if from.fill_buf()?.first() == Some(&JPEG_END[1]) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// True if the header of a PNG says that it has an alpha channel; no JPEG has one.
pub(crate) fn has_alpha(path: &Path) -> bool {
    // The signature, then length and name of the first chunk, width, height, bits of a sample, kind of the colours.
    let mut start = [0; 26];
    let is_read = open_file(path).is_ok_and(|mut file| file.read_exact(&mut start).is_ok());
    is_read && start.starts_with(&PNG) && matches!(start[25], 4 | 6)
}

fn read<const N: usize>(from: &mut impl Read) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    from.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// After its first two bytes: the rest of the signature, the length and name of the first chunk, width, height.
fn png_size(from: &mut impl Read) -> io::Result<Option<(u32, u32)>> {
    let signature: [u8; 6] = read(from)?;
    let [_length, name] = [read::<4>(from)?, read(from)?];
    let [width, height] = [read(from)?, read(from)?].map(u32::from_be_bytes);
    Ok((signature == PNG[2..] && name == *b"IHDR").then_some((width, height)))
}

/// After the start marker: segments up to the frame header (ITU T.81, B.2.2).
fn jpeg_size(from: &mut BufReader<File>) -> io::Result<Option<Result<(u32, u32), &'static str>>> {
    loop {
        let [0xff, mut marker] = read(from)? else { return Ok(None) };
        while marker == 0xff {
            [marker] = read(from)?;
        }
        match marker {
            // SOF0 to SOF15 but for DHT, JPG and DAC: length, precision, height, width.
            0xc0..=0xcf if ![0xc4, 0xc8, 0xcc].contains(&marker) => {
                let [_, _, bits, a, b, c, d] = read(from)?;
                let size = (u16::from_be_bytes([c, d]).into(), u16::from_be_bytes([a, b]).into());
                return Ok(Some(match (marker, bits) {
                    (0xc0..=0xc2, 8) => Ok(size),
                    (0xc0..=0xc2, 12) => Err("a JPEG of 12 bits a sample"),
                    (0xc3 | 0xc7 | 0xcb | 0xcf, _) => Err("a lossless JPEG"),
                    (0xc9..=0xcf, _) => Err("an arithmetically coded JPEG"),
                    (0xc5..=0xc6, _) => Err("a hierarchical JPEG"),
                    _ => return Ok(None),
                }));
            }
            // Image data or its end before a frame header.
            0xd9 | 0xda => return Ok(None),
            // Markers without a segment.
            0x01 | 0xd0..=0xd8 => {}
            _ => {
                let Some(rest) = u16::from_be_bytes(read(from)?).checked_sub(2) else { return Ok(None) };
                from.seek_relative(rest.into())?;
            }
        }
    }
}

/// Third-party decoders have panicked on damaged images before; here that is a fault of the image.
pub(crate) fn guarded<T>(path: &Path, work: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err(fault(path, "its decoder gave up", BROKEN)))
}

/// The decoder of a PNG or JPEG, which allocates at most so many bytes.
pub(crate) fn decoder_of(path: &Path, max_bytes: u64) -> Result<impl ImageDecoder, Fault> {
    let failed = |cause: io::Error| unreadable(path, &cause);
    let mut file = BufReader::new(open_file(path).map_err(failed)?);
    let start = file.fill_buf().map_err(failed)?;
    let format = match image::guess_format(start) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
        _ => return Err(other_kind(path)),
    };
    let mut reader = ImageReader::with_format(file, format);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(max_bytes);
    reader.limits(limits);
    reader.into_decoder().map_err(|cause| fault(path, format!("has a broken header: {cause}"), BROKEN))
}

/// The side of a picture, if it is a whole number of 1 to [`MAX_SIDE`].
pub(crate) fn whole_side(side: f64) -> Option<u32> {
    (side.fract() == 0.0 && (1.0..=f64::from(MAX_SIDE)).contains(&side)).then_some(side as u32)
}
