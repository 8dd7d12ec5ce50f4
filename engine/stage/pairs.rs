//! Pairs of a pixel and an intersection that a blend evaluates, counted on the host from what the frame left on the
//! device: the kernel itself counts nothing, so that it costs nothing.

use super::params::{TILE, TILE_PIXELS};
use super::project::SPLAT_PLANES;
use crate::gpu::generated::ViewParams;

/// Pairs of a tile's pixels and its list that are walked at most; larger frames are sampled.
const WALKED: f64 = 4e6;

/// The lists of a strip and the shape of the blocks that walk them.
pub(super) struct Blocks {
    pub view: ViewParams,
    pub lanes: u32,
    pub pixels_per_lane: u32,
    /// Four vec4 each, see `include/splat.glsl`.
    pub splats: Vec<[f32; 4]>,
    pub ids: Vec<u32>,
    /// First entry of each tile, and one past its last.
    pub first: Vec<u32>,
    pub last: Vec<u32>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pairs {
    /// The block is hit and the pixel is not finished.
    pub evaluated: f64,
    pub added: f64,
    /// Pixels that a splat finished.
    pub finished: f64,
}

impl Blocks {
    /// Those of all tiles, estimated where they are many.
    pub fn pairs(&self) -> Pairs {
        let length = |tile: usize| u64::from(self.last[tile].saturating_sub(self.first[tile]));
        let mut tiles: Vec<usize> = (0..self.first.len()).filter(|tile| length(*tile) > 0).collect();
        tiles.sort_by_key(|tile| std::cmp::Reverse(length(*tile)));
        let total: u64 = tiles.iter().map(|tile| length(*tile)).sum();
        let stride = (total as f64 * f64::from(TILE_PIXELS) / WALKED).ceil().max(1.0) as usize;
        // Of each run of tiles of similar length, the one in the middle.
        let sample: Vec<usize> = tiles.iter().copied().skip(stride / 2).step_by(stride).collect();
        let sampled: u64 = sample.iter().map(|tile| length(*tile)).sum();
        let mut sum = Pairs::default();
        for &tile in &sample {
            self.walk(tile, &mut sum);
        }
        let (by_entry, by_tile) =
            (total as f64 / sampled.max(1) as f64, tiles.len() as f64 / sample.len().max(1) as f64);
        Pairs { evaluated: sum.evaluated * by_entry, added: sum.added * by_entry, finished: sum.finished * by_tile }
    }

    /// As `blend_fwd.comp` does.
    fn walk(&self, tile: usize, sum: &mut Pairs) {
        let columns = self.lanes.min(TILE);
        let rows = self.lanes / columns * self.pixels_per_lane;
        let first = [tile as u32 % self.view.tiles_x * TILE, tile as u32 / self.view.tiles_x * TILE];
        for y in (0..TILE).step_by(rows as usize) {
            for x in (0..TILE).step_by(columns as usize) {
                self.walk_block(tile, [first[0] + x, first[1] + y], [columns, rows], sum);
            }
        }
    }

    fn walk_block(&self, tile: usize, [x, y]: [u32; 2], [columns, rows]: [u32; 2], sum: &mut Pairs) {
        let view = &self.view;
        let (inside_x, inside_y) = (view.width.saturating_sub(x).min(columns), view.n_rows.saturating_sub(y).min(rows));
        let center = |x: u32, y: u32| [x as f32 + 0.5, (view.first_row + y) as f32 + 0.5];
        let (corner, end) = (center(x, y), center(x + columns - 1, y + rows - 1));
        // What each pixel still lets through; 0 once it is finished.
        let mut open: Vec<([f32; 2], f32)> = (0..inside_x * inside_y)
            .map(|at| (center(x + at % inside_x.max(1), y + at / inside_x.max(1)), 1.0))
            .collect();
        for &id in &self.ids[self.first[tile] as usize..self.last[tile] as usize] {
            if open.is_empty() {
                break;
            }
            let at = SPLAT_PLANES * id as usize;
            let [s0, s1, _, s3] = [0, 1, 2, 3].map(|plane| self.splats[at + plane]);
            if !touches([s0[0], s0[1]], [s3[1], s3[2], s3[3]], corner, end) {
                continue;
            }
            sum.evaluated += open.len() as f64;
            let n_open = open.len();
            open.retain_mut(|(pixel, transmittance)| {
                let (dx, dy) = (pixel[0] - s0[0], pixel[1] - s0[1]);
                let (u, w) = (s0[2] * dx + s0[3] * dy, s1[0] * dx + s1[1] * dy);
                let alpha = s1[2] * (-(u * u + w * w)).exp2();
                if alpha < view.alpha_min {
                    return true;
                }
                let next = *transmittance * (1.0 - alpha.min(view.alpha_max));
                if next < view.t_min {
                    return false;
                }
                *transmittance = next;
                sum.added += 1.0;
                next >= view.t_cut
            });
            sum.finished += (n_open - open.len()) as f64;
        }
    }
}

/// True if the ellipse (slope, chord, reach_y) about `xy` may touch the pixel centres from `corner` to `end`: the shaders' `touches_block`.
fn touches(xy: [f32; 2], [slope, chord, reach_y]: [f32; 3], corner: [f32; 2], end: [f32; 2]) -> bool {
    let margin_y = 1e-3 + 1e-6 * xy[1].abs();
    let low = (corner[1] - xy[1] - margin_y).max(-reach_y);
    let high = (end[1] - xy[1] + margin_y).min(reach_y);
    if low > high {
        return false;
    }
    let tilt = slope * reach_y;
    let reach_x = tilt.hypot(chord);
    let tip = reach_y * (tilt / reach_x);
    let half = |d: f32| chord * (1.0 - (d / reach_y).powi(2)).max(0.0).sqrt();
    let (right_at, left_at) = (tip.max(low).min(high), (-tip).max(low).min(high));
    let margin_x = 1e-3 + 1e-6 * (xy[0].abs() + reach_x);
    let right = xy[0] + slope * right_at + half(right_at) + margin_x;
    let left = xy[0] + slope * left_at - half(left_at) - margin_x;
    left <= right && right >= corner[0] && left <= end[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(t_cut: f32) -> Pairs {
        let view = ViewParams {
            width: 1,
            height: 1,
            n_rows: 1,
            tiles_x: 1,
            alpha_min: 1.0 / 255.0,
            alpha_max: 0.99,
            t_min: 1e-4,
            t_cut,
            ..ViewParams::default()
        };
        // At the pixel, with M = 0, so that alpha is the opacity; ten pixels wide and high.
        let splat = [[0.5, 0.5, 0.0, 0.0], [0.0, 0.0, 0.5, 1.0], [0.0; 4], [0.0, 0.0, 10.0, 10.0]];
        let blocks = Blocks {
            view,
            lanes: 8,
            pixels_per_lane: 8,
            splats: splat.to_vec(),
            ids: vec![0; 30],
            first: vec![0],
            last: vec![30],
        };
        blocks.pairs()
    }

    #[test]
    fn a_pixel_is_walked_to_where_the_kernel_ends_it() {
        // 0.5^13 is the last above t_min: the splat after it is evaluated and not added.
        assert_eq!(pairs(0.0), Pairs { evaluated: 14.0, added: 13.0, finished: 1.0 });
        // 0.5^7 is the first below t_cut: the splat that leaves so little is added.
        assert_eq!(pairs(0.01), Pairs { evaluated: 7.0, added: 7.0, finished: 1.0 });
    }
}
