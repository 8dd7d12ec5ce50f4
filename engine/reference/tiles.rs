//! Which 16 x 16 tiles a projected Gaussian touches, and where each tile's part of the sorted list lies.

use super::input::Rules;
use super::math::dot;
use super::project::Projected;
use super::real::Real;

/// Side of a tile, pixels.
pub const TILE: u32 = 16;

/// The x range, in pixels relative to the image, of the ellipse `|m d|^2 / 2 <= level` within the rows
/// `band = [top, bottom]` (pixel centres, y), or `None` when the ellipse misses the band.
///
/// With p and q the columns of m, `|m d|^2 = |p|^2 (dx + (p.q / |p|^2) dy)^2 + (det m / |p|)^2 dy^2`, so at height dy
/// the ellipse spans `dx = k dy -+ sqrt(2 level - (det m / |p|)^2 dy^2) / |p|`, k = -p.q / |p|^2. The right end is
/// concave in dy with its maximum at `dy* = -(p.q / |q|) sqrt(2 level) / |det m|`, the left end mirrors it; clamping
/// +-dy* to the band gives the extreme points. One column of m has a zero and det m is a product, so nothing cancels.
///
/// Margins for f32, in which the blending decides: `slack` (pixels) widens the band and the result, the result gets 1e-6
/// of the ellipse's reach besides, and `level` grows by 4e-6 (1 + level), without which the square root could lose
/// sqrt(eps) of a half width at the very tip.
/// An ellipse too large for the squares of m spans the whole row.
pub fn row_span<R: Real>(xy: [R; 2], m: [[R; 2]; 2], level: R, band: [R; 2], slack: R) -> Option<[R; 2]> {
    let level = level + R::from_f64(4e-6) * (R::one() + level);
    let bright = level >= R::zero();
    if !bright {
        return None;
    }
    let (p, q) = ([m[0][0], m[1][0]], [m[0][1], m[1][1]]);
    let (pp, qq, pq) = (dot(p, p), dot(q, q), dot(p, q));
    let det = (m[0][0] * m[1][1] - m[0][1] * m[1][0]).abs();
    let least = R::from_f64(1e-30);
    let squares_hold = pp > least && qq > least && det > least;
    if !squares_hold {
        let everywhere = R::from_f64(1e30);
        return Some([-everywhere, everywhere]);
    }
    let radius = (R::from_f64(2.0) * level).sqrt();
    let (root_pp, root_qq) = (pp.sqrt(), qq.sqrt());
    let reach_y = radius * root_pp / det;
    let low = (band[0] - slack - xy[1]).max(-reach_y);
    let high = (band[1] + slack - xy[1]).min(reach_y);
    let meets = low <= high;
    if !meets {
        return None;
    }
    let reach_x = radius * root_qq / det;
    let turn = -(pq / qq) * reach_x;
    let half_width = |dy: R| {
        let w = det / root_pp * dy;
        (radius * radius - w * w).max(R::zero()).sqrt() / root_pp
    };
    let slope = -(pq / pp);
    let right_dy = turn.max(low).min(high);
    let left_dy = (-turn).max(low).min(high);
    let slack = slack + R::from_f64(1e-6) * reach_x;
    Some([
        xy[0] + slope * left_dy - half_width(left_dy) - slack,
        xy[0] + slope * right_dy + half_width(right_dy) + slack,
    ])
}

/// First and last tile column with a pixel centre in the x range `span`, or `None`, in an image `width` pixels wide.
pub fn columns<R: Real>(span: [R; 2], width: u32) -> Option<[u32; 2]> {
    let (tile, half) = (f64::from(TILE), 0.5);
    let [left, right] = span.map(R::to_f64);
    if !(right >= half && left <= f64::from(width) - half) {
        return None;
    }
    let last_column = f64::from(width.div_ceil(TILE) - 1);
    // Clamped before the conversion: a cast of a large number is the driver's choice on a device.
    let first = ((left - (tile - half)) / tile).ceil().clamp(0.0, last_column);
    let last = ((right - half) / tile).floor().clamp(0.0, last_column);
    (first <= last).then_some([first as u32, last as u32])
}

/// The tiles (row-major index) that `splat` may touch, by scan line, ascending. `slack` as in [`row_span`].
pub fn tiles<R: Real>(splat: &Projected<R>, rules: &Rules<R>, size: [u32; 2], slack: R) -> Vec<u32> {
    let level = (splat.opacity / rules.alpha_min).ln();
    let n_columns = size[0].div_ceil(TILE);
    let mut found = Vec::new();
    for row in 0..size[1].div_ceil(TILE) {
        let bottom = (TILE * (row + 1)).min(size[1]);
        let band = [f64::from(TILE * row) + 0.5, f64::from(bottom) - 0.5].map(R::from_f64);
        let span = row_span(splat.xy, splat.m, level, band, slack);
        if let Some([first, last]) = span.and_then(|span| columns(span, size[0])) {
            found.extend((first..=last).map(|column| row * n_columns + column));
        }
    }
    found
}

/// The tiles that hold a pixel where `splat` has alpha >= alpha_min, by looking at every pixel; ascending.
pub fn tiles_truth<R: Real>(splat: &Projected<R>, rules: &Rules<R>, size: [u32; 2]) -> Vec<u32> {
    let n_columns = size[0].div_ceil(TILE);
    let mut touched = vec![false; (n_columns * size[1].div_ceil(TILE)) as usize];
    for y in 0..size[1] {
        for x in 0..size[0] {
            let centre = [x, y].map(|v| R::from_f64(f64::from(v) + 0.5));
            let tile = (y / TILE * n_columns + x / TILE) as usize;
            touched[tile] |= splat.alpha_at(centre, rules) >= rules.alpha_min;
        }
    }
    (0..).zip(touched).filter(|(_, touched)| *touched).map(|(tile, _)| tile).collect()
}

/// Begin and end of each tile's run in the sorted list of tile indices; begin == end for an empty tile. Empty tiles
/// are [0, 0]. Every index must be below `n_tiles`.
pub fn ranges(sorted_tiles: &[u32], n_tiles: usize) -> Vec<[u32; 2]> {
    let mut ranges = vec![[0, 0]; n_tiles];
    for (i, &tile) in (0u32..).zip(sorted_tiles) {
        let range = &mut ranges[tile as usize];
        if range[1] == 0 {
            range[0] = i;
        }
        range[1] = i + 1;
    }
    ranges
}
