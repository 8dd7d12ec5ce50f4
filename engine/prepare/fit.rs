//! Pictures of another size than their calibration: scaled, in bars, or cut.

use crate::error::Result;
use crate::scene::Intrinsics;
use crate::scene::undistort::Lens;

/// Columns or rows that an encoder may have cut off at the right or the bottom: less than a block of a video.
const MAX_CUT: u32 = 15;
/// Bars around a picture are darker in the mean, of 255.
const BLACK: u64 = 16;

/// The part of recorded pictures that is used, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crop {
    pub x: u32,
    pub y: u32,
    pub width: u32,
    pub height: u32,
}

impl Crop {
    pub fn whole((width, height): (u32, u32)) -> Self {
        Crop { x: 0, y: 0, width, height }
    }
}

/// The lens and the part of pictures of another size than the calibration's, and a note: pictures that were scaled, scaled into a frame
/// with black bars, or cut by a codec at the right or the bottom. `first` gives the first picture.
pub(super) fn fitted(
    lens: &Lens,
    size: (u32, u32),
    first: impl FnOnce() -> Result<Vec<[u8; 3]>>,
) -> Result<Option<(Lens, Crop, Option<String>)>> {
    let ((width, height), Intrinsics { width: w, height: h, .. }) = (size, lens.intrinsics);
    if (w, h) == (width, height) {
        return Ok(Some((*lens, Crop::whole(size), None)));
    }
    let sizes = format!("the pictures are {width} x {height}, the calibration is for {w} x {h}");
    let [width_f, height_f, w_f, h_f] = [width, height, w, h].map(f64::from);
    let scale = (width_f / w_f).min(height_f / h_f);
    let (inner_width, inner_height) = ((w_f * scale).round() as u32, (h_f * scale).round() as u32);
    let (across, down) = (width.saturating_sub(inner_width), height.saturating_sub(inner_height));
    // Rounding the scaled size may have moved either side by a pixel.
    if across <= 1 && down <= 1 {
        return Ok(Some((lens.resized(width, height), Crop::whole(size), Some(format!("{sizes}: it is scaled")))));
    }
    let part = Crop { x: across / 2, y: down / 2, width: inner_width, height: inner_height };
    let row = |y: u32| (y as usize * width as usize)..((y + 1) as usize * width as usize);
    let picture = first()?;
    let bars = (0..height).flat_map(|y| {
        let inside = (part.y..part.y + part.height).contains(&y);
        let sides = picture[row(y)].iter().zip(0_u32..);
        sides.filter(move |(_, x)| !inside || !(part.x..part.x + part.width).contains(x)).map(|(pixel, _)| pixel)
    });
    let (n, sum) =
        bars.fold((0_u64, 0_u64), |(n, sum), pixel| (n + 3, sum + pixel.iter().map(|v| u64::from(*v)).sum::<u64>()));
    if n > 0 && sum < BLACK * n {
        let note = format!("{sizes}: taken as scaled to {inner_width} x {inner_height} between black bars");
        return Ok(Some((lens.resized(inner_width, inner_height), part, Some(note))));
    }
    let cut = |calibrated: u32, found: u32| calibrated >= found && calibrated - found <= MAX_CUT;
    if (w == width && cut(h, height)) || (h == height && cut(w, width)) {
        let note = format!("{sizes}: taken as cut off at the right or the bottom");
        let intrinsics = Intrinsics { width, height, ..lens.intrinsics };
        return Ok(Some((Lens { intrinsics, ..*lens }, Crop::whole(size), Some(note))));
    }
    Ok(None)
}
