//! Width and height from the first bytes of a PNG or JPEG, for which decoders of JPEG read the whole file; and from the
//! last bytes whether it is whole, because they make a picture of half a file too.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use super::report::Fault;
use crate::files::open_file;

pub(in crate::scene) const BROKEN: &str = "make or copy the image again";
const PNG: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
const JPEG: [u8; 2] = [0xff, 0xd8];
/// What ends the image; neither can stand in compressed data of a JPEG, and of a PNG only by chance.
const JPEG_END: &[u8] = &[0xff, 0xd9];
const PNG_END: &[u8] = b"IEND";
/// Bytes at the end of the file in which its image's end is looked for first; some programs append a little.
const TAIL_BYTES: u64 = 1024;

pub(super) fn fault(path: &Path, reason: impl Into<String>, remedy: &str) -> Fault {
    Fault { file: path.to_owned(), place: String::new(), reason: reason.into(), remedy: remedy.to_owned() }
}

/// The fault of an image that cannot be opened or read.
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
        (png_size(&mut from), PNG_END)
    } else if start == JPEG {
        (jpeg_size(&mut from), JPEG_END)
    } else {
        return Err(fault(path, "is neither a PNG nor a JPEG", "convert the image to PNG"));
    };
    let Some((width, height)) = size.map_err(failed)?.filter(|(width, height)| *width > 0 && *height > 0) else {
        return Err(fault(path, "has a broken header", BROKEN));
    };
    let of_image = from.stream_position().map_err(failed)?;
    let mut tail = Vec::new();
    let from_tail = from.seek(SeekFrom::Start(n_bytes.saturating_sub(TAIL_BYTES)));
    from_tail.and_then(|_| from.by_ref().take(TAIL_BYTES).read_to_end(&mut tail)).map_err(failed)?;
    if tail.windows(end.len()).any(|window| window == end) {
        return Ok((width, height));
    }
    // Telephones append a video to their photos.
    if end == JPEG_END && from.seek(SeekFrom::Start(of_image)).and_then(|_| jpeg_ends(&mut from)).map_err(failed)? {
        return Ok((width, height));
    }
    Err(fault(path, "is cut off: the end of the image is missing", BROKEN))
}

/// Whether the end of a JPEG comes after its frame header; that of a thumbnail comes before.
fn jpeg_ends(from: &mut BufReader<File>) -> io::Result<bool> {
    while from.skip_until(JPEG_END[0])? > 0 {
        if from.fill_buf()?.first() == Some(&JPEG_END[1]) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Whether the header of a PNG says that it has an alpha channel; no JPEG has one.
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
fn jpeg_size(from: &mut BufReader<File>) -> io::Result<Option<(u32, u32)>> {
    loop {
        let [0xff, mut marker] = read(from)? else { return Ok(None) };
        while marker == 0xff {
            [marker] = read(from)?;
        }
        match marker {
            // SOF0 to SOF15 but for DHT, JPG and DAC: length, precision, height, width.
            0xc0..=0xcf if ![0xc4, 0xc8, 0xcc].contains(&marker) => {
                let [_, _, _, a, b, c, d] = read(from)?;
                return Ok(Some((u16::from_be_bytes([c, d]).into(), u16::from_be_bytes([a, b]).into())));
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
