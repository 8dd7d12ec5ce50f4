//! Pictures of a distorting lens as those of a pinhole (SPEC 7): images, masks, depth and flow.

mod bounds;
mod lens;

pub use lens::{Distortion, Lens};

use crate::scene::Intrinsics;

/// Flow of at least this magnitude means unknown: Middlebury's mark in `.flo`.
const UNKNOWN_FLOW: f32 = 1e9;
const NO_FLOW: [f32; 2] = [1e10, 1e10];
/// The channel of an image that is alpha, where it has so many.
const ALPHA: usize = 3;
/// Less weight of a neighbour is rounding.
const LEAST_WEIGHT: f64 = 1e-6;

/// Resamples pictures of one lens for another of the same pose. All planes are row by row, top first.
#[derive(Clone, Copy, Debug)]
pub struct Undistortion {
    source: Lens,
    target: Lens,
    reach: f64,
}

impl Undistortion {
    /// `target` must be a pinhole, as [`Lens::pinhole`] gives it.
    pub fn new(source: Lens, target: Lens) -> Self {
        Undistortion { source, target, reach: source.reach() }
    }

    /// The place in the source, pixels, of a place in the target; `None` where the source does not show it.
    pub fn source_of(&self, at: [f64; 2]) -> Option<[f64; 2]> {
        let Intrinsics { fx, fy, cx, cy, .. } = self.target.intrinsics;
        let [x, y] = self.source.pixel([(at[0] - cx) / fx, (at[1] - cy) / fy], self.reach)?;
        let size = self.source.intrinsics.size();
        ((0.0..=size.x).contains(&x) && (0.0..=size.y).contains(&y)).then_some([x, y])
    }

    /// The place in the target, pixels, of a place in the source, which may lie beyond its borders; `None` where no pinhole shows it.
    pub fn target_of(&self, at: [f64; 2]) -> Option<[f64; 2]> {
        let Intrinsics { fx, fy, cx, cy, .. } = self.target.intrinsics;
        let [x, y] = self.source.plane(at, self.reach)?;
        Some([x * fx + cx, y * fy + cy])
    }

    /// An image of C channels, interpolated bilinearly between the stored values; 0 where the source shows nothing. A fourth channel is
    /// alpha, by which colours are weighted.
    pub fn image<const C: usize>(&self, pixels: &[[u8; C]]) -> Vec<[u8; C]> {
        let alpha = |at: usize| pixels[at].get(ALPHA).map_or(1.0, |alpha| f64::from(*alpha));
        self.each(|place| {
            let corners = self.corners(place);
            let opaque = corners.map(|(at, weight)| (at, weight * alpha(at)));
            // Without alpha the weights sum to 1, but for rounding.
            let total: f64 = if C > ALPHA { opaque.iter().map(|(_, weight)| weight).sum() } else { 1.0 };
            std::array::from_fn(|channel| {
                let (weights, total) = if channel == ALPHA { (&corners, 1.0) } else { (&opaque, total) };
                let sum: f64 = weights.iter().map(|&(at, weight)| weight * f64::from(pixels[at][channel])).sum();
                if total > 0.0 { (sum / total).round() as u8 } else { 0 }
            })
        })
        .into_iter()
        .map(|pixel| pixel.unwrap_or([0; C]))
        .collect()
    }

    /// A mask: the nearest pixel; 0 where the source shows nothing.
    pub fn mask(&self, pixels: &[u8]) -> Vec<u8> {
        self.each(|at| pixels[self.nearest(at)]).into_iter().map(Option::unwrap_or_default).collect()
    }

    /// Depth along the optical axis: the nearest pixel, because a mean across an edge is the depth of nothing; NaN where the source shows
    /// nothing.
    pub fn depth(&self, depth: &[f32]) -> Vec<f32> {
        self.each(|at| depth[self.nearest(at)]).into_iter().map(|z| z.unwrap_or(f32::NAN)).collect()
    }

    /// Optical flow, interpolated bilinearly; both of its ends are undistorted. Unknown (1e10) where one of the four neighbours is, or where
    /// a pinhole does not see an end.
    pub fn flow(&self, flow: &[[f32; 2]]) -> Vec<[f32; 2]> {
        let width = self.target.intrinsics.width;
        let moved = self.each(|[x, y]| {
            let mut end = [x, y];
            for (at, weight) in self.corners([x, y]) {
                if weight < LEAST_WEIGHT {
                    continue;
                }
                if !flow[at].iter().all(|v| v.abs() < UNKNOWN_FLOW) {
                    return None;
                }
                for axis in 0..2 {
                    end[axis] += weight * f64::from(flow[at][axis]);
                }
            }
            self.target_of(end)
        });
        let starts = (0_u32..).map(|index| [f64::from(index % width) + 0.5, f64::from(index / width) + 0.5]);
        let way = |end: [f64; 2], start: [f64; 2]| [(end[0] - start[0]) as f32, (end[1] - start[1]) as f32];
        moved.into_iter().zip(starts).map(|(end, start)| end.flatten().map_or(NO_FLOW, |end| way(end, start))).collect()
    }

    /// 255 where the source shows a pixel of the target and 0 elsewhere; `None` when it shows them all.
    pub fn validity(&self) -> Option<Vec<u8>> {
        let seen: Vec<u8> = self.each(|_| 255).into_iter().map(Option::unwrap_or_default).collect();
        seen.contains(&0).then_some(seen)
    }

    /// A value for each pixel of the target from its place in the source.
    fn each<T>(&self, value: impl Fn([f64; 2]) -> T) -> Vec<Option<T>> {
        let Intrinsics { width, height, .. } = self.target.intrinsics;
        let pixels =
            (0..height).flat_map(|row| (0..width).map(move |column| [column, row].map(|at| f64::from(at) + 0.5)));
        pixels.map(|at| self.source_of(at).map(&value)).collect()
    }

    /// The four pixels around a place of the source and their weights; at the border a pixel comes twice.
    fn corners(&self, [x, y]: [f64; 2]) -> [(usize, f64); 4] {
        let side = |at: f64, n: u32| {
            let at = (at - 0.5).clamp(0.0, f64::from(n - 1));
            let low = at as usize;
            (low, (low + 1).min(n as usize - 1), at - at.floor())
        };
        let (left, right, u) = side(x, self.source.intrinsics.width);
        let (top, bottom, v) = side(y, self.source.intrinsics.height);
        let width = self.source.intrinsics.width as usize;
        [
            (top * width + left, (1.0 - u) * (1.0 - v)),
            (top * width + right, u * (1.0 - v)),
            (bottom * width + left, (1.0 - u) * v),
            (bottom * width + right, u * v),
        ]
    }

    fn nearest(&self, [x, y]: [f64; 2]) -> usize {
        let (column, row) = ((x as usize).min(self.source.intrinsics.width as usize - 1), y as usize);
        row.min(self.source.intrinsics.height as usize - 1) * self.source.intrinsics.width as usize + column
    }
}
