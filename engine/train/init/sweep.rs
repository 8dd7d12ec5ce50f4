//! Surfaces from photo-consistency: each camera sweeps a fan of depths for the one at which its neighbours show the same
//! (plane sweep; Collins 1996), smoothed along the picture (semi-global matching; Hirschmüller 2008). What other
//! cameras' depths confirm is kept.

use super::eye::{Eye, Ground};
use super::points::{Found, median_color};
use crate::error::Result;
use crate::parallel::in_parallel;
use glam::Vec3;

/// Neighbours that each camera is compared with.
const NEIGHBOURS: usize = 6;
/// Angles between the rays of neighbours, radians: below the first depth is not told, above the last nothing looks alike.
const BEST_ANGLES: [f32; 2] = [0.08, 0.5];
/// Depths of a fan, evenly spaced in inverse depth from infinity on.
const DEPTHS: usize = 96;
/// Reduced pixels that the neighbours' pictures shift by from one depth to the next.
const SHIFT: f32 = 1.0;
/// Largest cost of a pixel at a depth, and what it costs when too few neighbours see it.
const MOST_COST: f32 = 0.3;
/// Cost of neighbouring pixels one step apart, and of those farther apart.
const STEP_COST: f32 = 0.03;
const JUMP_COST: f32 = 0.18;
/// Pixels of the window whose mean is taken out, on each side: exposure and white balance differ from camera to camera.
const WINDOW: usize = 5;
/// Weight of what is left of the colours themselves.
const COLOR_WEIGHT: f32 = 0.25;
/// Steps that another camera's depth may be off to confirm.
const TOLERANCE: f32 = 1.5;
/// Cameras that must confirm a depth.
const CONFIRMATIONS: usize = 1;

/// What is compared of a picture: log-colour without its mean around, and the colour relative to the picture's own.
struct Features(Vec<[f32; 6]>);

/// Inverse depth of each pixel, NaN where there is none, and the step between two.
struct Depths {
    inverse: Vec<f32>,
    step: f32,
}

/// Points of surfaces that stand still, by camera and then by pixel. `done` is called with each finished camera.
pub(super) fn sweep(eyes: &[Eye], threads: usize, mut done: impl FnMut()) -> Result<Vec<(Found, usize)>> {
    let features: Vec<Features> = eyes.iter().map(Features::new).collect();
    let neighbours: Vec<Vec<usize>> = (0..eyes.len()).map(|i| neighbours(eyes, i)).collect();
    let depths = in_parallel(
        eyes.len(),
        threads,
        |i| Ok(depths(eyes, &features, i, &neighbours[i])),
        |_| done(),
    )?;
    let confirmed = |i: usize| {
        let eye = &eyes[i];
        let depths = &depths;
        (0..eye.color.len()).filter_map(move |pixel| confirm(eyes, depths, i, pixel))
    };
    if std::env::var_os("IVV_DBG").is_some() {
        for i in 0..eyes.len() {
            let n = eyes[i].color.len();
            let told = depths[i].inverse.iter().filter(|d| **d > 0.0).count();
            let ok = confirmed(i).count();
            eprintln!("eye {i}: {n} pixels, {told} told, {ok} confirmed, neighbours {:?} step {}", neighbours[i], depths[i].step);
            let mut image = Vec::new();
            for p in 0..n {
                let d = depths[i].inverse[p];
                let c = confirm(eyes, &depths, i, p).is_some();
                let v = if d > 0.0 { (255.0 * (d / depths[i].step / DEPTHS as f32)) as u8 } else { 0 };
                let s = eyes[i].color[p].map(|c| (c * 255.0) as u8);
                image.extend([v, if c { v } else { 0 }, s[1]]);
            }
            let _ = std::fs::create_dir_all("/tmp/dbg");
            image::save_buffer(format!("/tmp/dbg/{i:02}.png"), &image, eyes[i].width as u32, eyes[i].height as u32, image::ColorType::Rgb8).unwrap();
        }
    }
    Ok((0..eyes.len()).flat_map(confirmed).collect())
}

/// The cameras that see most of what camera `i` sees, at a fair angle.
fn neighbours(eyes: &[Eye], i: usize) -> Vec<usize> {
    let eye = &eyes[i];
    // Along a coarse grid of rays, from a tenth of the training radius to ten of it.
    let pixels = (0..6).flat_map(|y| (0..8).map(move |x| (2 * y + 1) * eye.height / 12 * eye.width + (2 * x + 1) * eye.width / 16));
    let samples: Vec<Vec3> = pixels
        .flat_map(|pixel| (0..12).map(move |k| eye.center + eye.ray(pixel) * 0.3 * 1.5f32.powi(k)))
        .collect();
    let score = |other: &Eye| {
        let weight = |at: &Vec3| {
            if other.sees(*at).is_none() {
                return 0.0;
            }
            let angle = (*at - eye.center).angle_between(*at - other.center);
            (angle / BEST_ANGLES[0]).min(BEST_ANGLES[1] / angle.max(1e-6)).min(1.0).powi(2)
        };
        samples.iter().map(weight).sum::<f32>()
    };
    let mut scored: Vec<(f32, usize)> = (0..eyes.len()).filter(|j| *j != i).map(|j| (score(&eyes[j]), j)).collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    scored.into_iter().filter(|(score, _)| *score > 0.0).take(NEIGHBOURS).map(|(_, j)| j).collect()
}

impl Features {
    fn new(eye: &Eye) -> Self {
        let Eye { width, height, color, ground, .. } = eye;
        let log = |c: f32| (c + 0.02).ln();
        // Sums from the first pixel on, of log-colours and of counts.
        let stride = width + 1;
        let mut sums = vec![[0f64; 4]; stride * (height + 1)];
        for (y, x) in (0..*height).flat_map(|y| (0..*width).map(move |x| (y, x))) {
            let pixel = y * width + x;
            let counts = f64::from(ground[pixel] == Ground::Still);
            let value = [0, 1, 2].map(|c| counts * f64::from(log(color[pixel][c])));
            let [left, up, both] = [(y + 1, x), (y, x + 1), (y, x)].map(|(y, x)| sums[y * stride + x]);
            for (k, value) in value.into_iter().chain([counts]).enumerate() {
                sums[(y + 1) * stride + x + 1][k] = value + left[k] + up[k] - both[k];
            }
        }
        let mean = |y0: usize, y1: usize, x0: usize, x1: usize| -> [f32; 3] {
            let at = |y: usize, x: usize, k: usize| sums[y * stride + x][k];
            let sum = |k: usize| at(y1, x1, k) + at(y0, x0, k) - at(y0, x1, k) - at(y1, x0, k);
            std::array::from_fn(|k| (sum(k) / sum(3).max(1.0)) as f32)
        };
        let all = mean(0, *height, 0, *width);
        let feature = |pixel: usize| {
            let (y, x) = (pixel / width, pixel % width);
            let around = mean(
                y.saturating_sub(WINDOW),
                (y + WINDOW + 1).min(*height),
                x.saturating_sub(WINDOW),
                (x + WINDOW + 1).min(*width),
            );
            let own = color[pixel].map(log);
            std::array::from_fn(|k| if k < 3 { own[k] - around[k] } else { COLOR_WEIGHT * (own[k - 3] - all[k - 3]) })
        };
        Features((0..width * height).map(feature).collect())
    }
}

/// Sweeps camera `i` against its neighbours.
fn depths(eyes: &[Eye], features: &[Features], i: usize, neighbours: &[usize]) -> Depths {
    let eye = &eyes[i];
    // The median distance to the neighbours decides how far a step of inverse depth shifts their pictures.
    let mut baselines: Vec<f32> = neighbours.iter().map(|j| eye.center.distance(eyes[*j].center)).collect();
    baselines.sort_by(f32::total_cmp);
    let baseline = baselines.get(baselines.len() / 2).copied().unwrap_or(0.0).max(1e-6);
    let step = SHIFT / (baseline * eye.focal.x);
    let n = eye.color.len();
    let mut costs = vec![MOST_COST; n * DEPTHS];
    for pixel in (0..n).filter(|pixel| eye.ground[*pixel] == Ground::Still) {
        let (ray, own) = (eye.ray(pixel), &features[i].0[pixel]);
        for (depth, cost) in costs[pixel * DEPTHS..][..DEPTHS].iter_mut().enumerate() {
            let at = eye.center + ray / (step * (depth as f32 + 0.5));
            let mut differences = [f32::INFINITY; NEIGHBOURS];
            let mut n_seen = 0;
            for &j in neighbours {
                let Some((there, _)) = eyes[j].sees(at) else { continue };
                if eyes[j].ground[there] == Ground::Still {
                    let other = &features[j].0[there];
                    let difference: f32 = own.iter().zip(other).map(|(a, b)| (a - b).abs()).sum();
                    differences[n_seen] = difference.min(MOST_COST);
                    n_seen += 1;
                }
            }
            // The better half: others may be hidden from the point.
            if n_seen >= 2 {
                differences[..n_seen].sort_unstable_by(f32::total_cmp);
                let half = n_seen.div_ceil(2).max(2);
                *cost = differences[..half].iter().sum::<f32>() / half as f32;
            }
        }
    }
    let smooth = smoothed(&costs, eye.width, eye.height);
    let inverse = (0..n).map(|pixel| {
        let (own, total) = (&costs[pixel * DEPTHS..][..DEPTHS], &smooth[pixel * DEPTHS..][..DEPTHS]);
        let best = (0..DEPTHS).min_by(|a, b| total[*a].total_cmp(&total[*b])).unwrap_or(0);
        let is_told = eye.ground[pixel] == Ground::Still && own[best] < 0.98 * MOST_COST && best > 0 && best + 1 < DEPTHS;
        if !is_told {
            return f32::NAN;
        }
        // The lowest point of the parabola through the three costs.
        let (before, after) = (total[best - 1] - total[best], total[best + 1] - total[best]);
        let shift = 0.5 * (before - after) / (before + after).max(1e-6);
        step * (best as f32 + 0.5 + shift)
    });
    Depths { inverse: inverse.collect(), step }
}

/// The sum over four paths through the picture of the least cost up to each pixel and depth.
fn smoothed(costs: &[f32], width: usize, height: usize) -> Vec<f32> {
    let mut total = vec![0.0; costs.len()];
    let mut path = |pixels: &mut dyn Iterator<Item = usize>| {
        let mut last = [0.0f32; DEPTHS];
        let mut is_first = true;
        for pixel in pixels {
            let own = &costs[pixel * DEPTHS..][..DEPTHS];
            let least = if is_first { 0.0 } else { last.iter().copied().fold(f32::INFINITY, f32::min) };
            let mut now = [0.0f32; DEPTHS];
            for d in 0..DEPTHS {
                let beside = last[d.saturating_sub(1)].min(last[(d + 1).min(DEPTHS - 1)]) + STEP_COST;
                let before = if is_first { 0.0 } else { last[d].min(beside).min(least + JUMP_COST) - least };
                now[d] = own[d] + before;
                total[pixel * DEPTHS + d] += now[d];
            }
            (last, is_first) = (now, false);
        }
    };
    for y in 0..height {
        path(&mut (0..width).map(|x| y * width + x));
        path(&mut (0..width).rev().map(|x| y * width + x));
    }
    for x in 0..width {
        path(&mut (0..height).map(|y| y * width + x));
        path(&mut (0..height).rev().map(|y| y * width + x));
    }
    total
}

/// The point of a pixel, if other cameras' depths confirm it and few see through it.
fn confirm(eyes: &[Eye], depths: &[Depths], i: usize, pixel: usize) -> Option<(Found, usize)> {
    let (eye, inverse) = (&eyes[i], depths[i].inverse[pixel]);
    if !(inverse > 0.0) {
        return None;
    }
    let position = eye.center + eye.ray(pixel) / inverse;
    let mut colors = vec![eye.color[pixel]];
    let mut n_through = 0;
    for (other, there) in eyes.iter().zip(depths).enumerate().filter(|(j, _)| *j != i).map(|(_, both)| both) {
        let Some((at, depth)) = other.sees(position) else { continue };
        let off = (1.0 / depth - there.inverse[at]) / there.step;
        if off.abs() <= TOLERANCE {
            colors.push(other.color[at]);
        }
        // Positive: it sees something farther away.
        n_through += usize::from(off > 2.0 * TOLERANCE);
    }
    if { let k: usize = std::env::var("IVV_K").map_or(1, |s| s.parse().unwrap()); colors.len() <= k || n_through >= colors.len() } {
        return None;
    }
    let n = colors.len();
    Some((Found { position: position.as_dvec3().to_array(), color: median_color(colors)? }, n))
}
