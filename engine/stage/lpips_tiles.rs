//! LPIPS of a picture whose features do not fit: tile by tile, each with as much around it as its features see.

use super::lpips_trunk::{Layer, Network};
use std::ops::Range;

/// Part of the maps of one depth that a tile compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Share {
    /// First column and row, in the tile's maps.
    pub first: [u32; 2],
    pub size: [u32; 2],
    /// Pixels of the maps of the whole picture.
    pub of: u32,
}

impl Share {
    pub fn whole(size: [u32; 2]) -> Self {
        Share { first: [0, 0], size, of: size[0] * size[1] }
    }

    pub fn pixels(&self) -> u32 {
        self.size[0] * self.size[1]
    }
}

/// A part of a picture whose features are, where they are compared, those of the whole picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Tile {
    pub first: [u32; 2],
    pub size: [u32; 2],
    /// By tap.
    pub shares: Vec<Share>,
}

struct Span {
    pixels: Range<u32>,
    /// The compared part of each tap, in the tile's maps.
    taps: Vec<Range<u32>>,
}

impl Network {
    /// The picture of `size` in `n` tiles across and down; none where it is too small for the trunk. Every place of every map is compared
    /// in one tile.
    pub fn tiles(&self, size: [u32; 2], n: [u32; 2]) -> Option<Vec<Tile>> {
        let full = self.sizes(size)?;
        let along = |axis: usize| {
            let full: Vec<u32> = full.iter().map(|size| size[axis]).collect();
            (0..n[axis]).map(|part| self.span(&full, part, n[axis])).collect::<Vec<_>>()
        };
        let (across, down) = (along(0), along(1));
        let tile = |y: &Span, x: &Span| {
            let taps = self.taps().zip(x.taps.iter().zip(&y.taps));
            let shares = taps.map(|(map, (x, y))| Share {
                first: [x.start, y.start],
                size: [x.len() as u32, y.len() as u32],
                of: full[map][0] * full[map][1],
            });
            let [first, size] = [[x.pixels.start, y.pixels.start], [x.pixels.len() as u32, y.pixels.len() as u32]];
            Tile { first, size, shares: shares.collect() }
        };
        Some(down.iter().flat_map(|y| across.iter().map(move |x| tile(y, x))).collect())
    }

    /// The maps that are compared, in their order.
    pub fn taps(&self) -> impl Iterator<Item = usize> {
        self.layers.iter().filter_map(|layer| match layer {
            Layer::Tap { of, .. } => Some(*of),
            Layer::Conv(_) | Layer::Pool { .. } => None,
        })
    }

    /// Pixels to a side of the picture for one place of the deepest maps.
    pub fn step(&self) -> u32 {
        self.strides().into_iter().max().unwrap_or(1)
    }

    /// Pixels of the picture to one of each set of maps, along a side.
    fn strides(&self) -> Vec<u32> {
        let mut strides = vec![1; self.channels.len()];
        for layer in &self.layers {
            match layer {
                Layer::Conv(conv) => strides[conv.to] = strides[conv.from] * conv.stride,
                Layer::Pool { from, to, .. } => strides[*to] = 2 * strides[*from],
                Layer::Tap { .. } => {}
            }
        }
        strides
    }

    /// Tile `part` of `n` along an axis on which the maps of the whole picture are as long as `full` says.
    fn span(&self, full: &[u32], part: u32, n: u32) -> Span {
        let strides = self.strides();
        // Tiles begin where one place of each map ends and another begins: their maps are parts of those of the whole picture.
        let step = self.step();
        let cut = |part: u32| (u64::from(full[0]) * u64::from(part) / u64::from(n)) as u32 / step * step;
        let own = |map: usize| {
            let end = if part + 1 == n { full[map] } else { (cut(part + 1) / strides[map]).min(full[map]) };
            (cut(part) / strides[map]).min(end)..end
        };
        let seen = self.seen(full, own);
        let (mut first, mut end) = (seen.start / step * step, seen.end);
        // At the picture's end the deepest maps may have nothing to compare, but must be there.
        while self.sizes([end - first; 2]).is_none() {
            (first, end) = (first.saturating_sub(step), if first == 0 { (end + step).min(full[0]) } else { end });
        }
        let taps = self.taps().map(|map| {
            let (own, before) = (own(map), first / strides[map]);
            own.start.saturating_sub(before)..own.end.saturating_sub(before)
        });
        Span { pixels: first..end, taps: taps.collect() }
    }

    /// Which pixels the places `own` of the taps see, on an axis as in [`Network::span`].
    fn seen(&self, full: &[u32], own: impl Fn(usize) -> Range<u32>) -> Range<u32> {
        let mut seen: Vec<Range<u32>> = vec![0..0; full.len()];
        let join = |all: &mut Range<u32>, more: Range<u32>| match (all.start < all.end, more.start < more.end) {
            (_, false) => {}
            (false, true) => *all = more,
            (true, true) => *all = all.start.min(more.start)..all.end.max(more.end),
        };
        for layer in self.layers.iter().rev() {
            let (from, to, kernel, stride, pad) = match layer {
                Layer::Conv(conv) => (conv.from, conv.to, conv.kernel, conv.stride, conv.pad),
                Layer::Pool { from, to, .. } => (*from, *to, 3, 2, 0),
                Layer::Tap { of, .. } => {
                    join(&mut seen[*of], own(*of));
                    continue;
                }
            };
            let places = seen[to].clone();
            if !places.is_empty() {
                // What lies outside is padding, of the tile as of the picture.
                let first = (stride * places.start).saturating_sub(pad);
                let end = (stride * (places.end - 1) + kernel).saturating_sub(pad);
                join(&mut seen[from], first..end.min(full[from]));
            }
        }
        seen[0].clone()
    }
}
