//! Surfaces from photo-consistency: each camera sweeps a fan of depths for the one at which its neighbours show the
//! same (plane sweep; Collins 1996), smoothed along the picture (semi-global matching; Hirschmüller 2008).

use super::eye::{Ground, ViewBuffers};
use crate::error::Result;
use crate::parallel::in_parallel;
use crate::report::statistics::median_high;
use crate::scene::capture::TRAINING_RADIUS;
use glam::{Vec3, Vec3A};

const NEIGHBOURS: usize = 10;
/// Angles between the rays of good neighbours, radians: less does not determine the depth, at more nothing looks alike.
const GOOD_ANGLES: [f32; 2] = [0.08, 0.5];
/// Depths of a fan, evenly spaced in inverse depth, about a pixel of the neighbours' pictures apart.
const DEPTHS: usize = 96;
/// Largest cost of a pixel at a depth, and what it costs where fewer than two neighbours see it.
const MOST_COST: f32 = 0.3;
/// Cost of a step of depth between neighbouring pixels, and of a jump.
const STEP_COST: f32 = 0.03;
const JUMP_COST: f32 = 0.18;
/// Half of the window whose mean is taken out: exposure and white balance differ from camera to camera.
const WINDOW: usize = 5;
/// Weight of the colours relative to those of the whole picture.
const COLOR_WEIGHT: f32 = 0.25;

pub(super) struct Depths {
    /// One over the depth of each pixel; NaN where none was found.
    pub inverse: Vec<f32>,
    /// Between two planes of the fan.
    pub step: f32,
}

/// The features of a pixel: log-colour without the mean around it, and relative to the whole picture.
type Feature = [Vec3A; 2];

/// The depths of static surfaces, by camera. `done` is called after each of them.
pub(super) fn sweep(eyes: &[ViewBuffers], threads: usize, mut done: impl FnMut()) -> Result<Vec<Depths>> {
    let features: Vec<Vec<Feature>> = eyes.iter().map(features).collect();
    let sweep = |i: usize| Ok(depths(eyes, &features, i));
    in_parallel(eyes.len(), threads, sweep, |_| done())
}

/// The cameras that share most of the view of camera `i`, at a good angle.
fn neighbours(eyes: &[ViewBuffers], i: usize) -> Vec<usize> {
    let eye = &eyes[i];
    // Rays of a coarse grid; depths from a tenth of the training radius to about ten of it.
    let middle = |part: usize, n: usize, size: usize| (2 * part + 1) * size / (2 * n);
    let pixels = (0..6).flat_map(|y| (0..8).map(move |x| (x, y)));
    let pixels = pixels.map(|(x, y)| middle(y, 6, eye.height) * eye.width + middle(x, 8, eye.width));
    let depths: [f32; 12] = std::array::from_fn(|k| 0.1 * TRAINING_RADIUS as f32 * 1.5f32.powi(k as i32));
    let samples: Vec<Vec3> = pixels.flat_map(|pixel| depths.map(|depth| eye.center + eye.ray(pixel) * depth)).collect();
    let weight = |other: &ViewBuffers, at: Vec3| {
        if other.sees(at).is_none() {
            return 0.0;
        }
        let angle = (at - eye.center).angle_between(at - other.center);
        (angle / GOOD_ANGLES[0]).min(GOOD_ANGLES[1] / angle.max(1e-6)).min(1.0).powi(2)
    };
    let score = |other: &ViewBuffers| samples.iter().map(|at| weight(other, *at)).sum::<f32>();
    let mut scored: Vec<(f32, usize)> = (0..eyes.len()).filter(|j| *j != i).map(|j| (score(&eyes[j]), j)).collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    scored.into_iter().filter(|(score, _)| *score > 0.0).take(NEIGHBOURS).map(|(_, j)| j).collect()
}

/// The features of every pixel; their means are over static pixels.
fn features(eye: &ViewBuffers) -> Vec<Feature> {
    let ViewBuffers { width, height, color, ground, .. } = eye;
    let log = |c: f32| (c + 0.02).ln();
    // Log-colours and counts, summed from the first pixel on: one row and one column more.
    let stride = width + 1;
    let mut sums = vec![[0f64; 4]; stride * (height + 1)];
    for pixel in 0..width * height {
        let (y, x) = (pixel / width, pixel % width);
        let counts = f64::from(ground[pixel] == Ground::Still);
        let [r, g, b] = color[pixel].map(|c| counts * f64::from(log(c)));
        let [left, up, both] = [(y + 1, x), (y, x + 1), (y, x)].map(|(y, x)| sums[y * stride + x]);
        let value = [r, g, b, counts];
        sums[(y + 1) * stride + x + 1] = std::array::from_fn(|k| value[k] + left[k] + up[k] - both[k]);
    }
    let mean = |[y0, y1]: [usize; 2], [x0, x1]: [usize; 2]| -> [f32; 3] {
        let at = |y: usize, x: usize, k: usize| sums[y * stride + x][k];
        let sum = |k: usize| at(y1, x1, k) + at(y0, x0, k) - at(y0, x1, k) - at(y1, x0, k);
        std::array::from_fn(|k| (sum(k) / sum(3).max(1.0)) as f32)
    };
    let whole = Vec3A::from(mean([0, *height], [0, *width]));
    let window = |at: usize, size: usize| [at.saturating_sub(WINDOW), (at + WINDOW + 1).min(size)];
    let feature = |pixel: usize| {
        let own = Vec3A::from(color[pixel].map(log));
        let around = Vec3A::from(mean(window(pixel / width, *height), window(pixel % width, *width)));
        [own - around, COLOR_WEIGHT * (own - whole)]
    };
    (0..width * height).map(feature).collect()
}

fn depths(eyes: &[ViewBuffers], features: &[Vec<Feature>], i: usize) -> Depths {
    let eye = &eyes[i];
    let neighbours = neighbours(eyes, i);
    let baselines = neighbours.iter().map(|j| f64::from(eye.center.distance(eyes[*j].center)));
    let baseline = median_high(baselines).unwrap_or(0.0) as f32;
    let step = 1.0 / (baseline * eye.focal.x).max(1e-6);
    let n = eye.ground.len();
    let mut costs = vec![MOST_COST; n * DEPTHS];
    let others: Vec<(&ViewBuffers, &Vec<Feature>)> = neighbours.iter().map(|j| (&eyes[*j], &features[*j])).collect();
    for pixel in (0..n).filter(|pixel| eye.ground[*pixel] == Ground::Still) {
        let ray = eye.ray(pixel);
        let own = &features[i][pixel];
        let mut differences = [[MOST_COST; NEIGHBOURS]; DEPTHS];
        let mut n_seen = [0; DEPTHS];
        for (other, features) in &others {
            let trace = other.trace(eye.center, ray);
            for plane in 0..DEPTHS {
                let Some(there) = trace.pixel(inverse_depth(step, plane as f32)) else { continue };
                let difference = match other.ground[there] {
                    Ground::Still => {
                        let [a, b] = &features[there];
                        ((own[0] - *a).abs() + (own[1] - *b).abs()).element_sum().min(MOST_COST)
                    }
                    // This neighbour sees through the place.
                    Ground::Empty => MOST_COST,
                    Ground::Moving | Ground::Unknown => continue,
                };
                differences[plane][n_seen[plane]] = difference;
                n_seen[plane] += 1;
            }
        }
        let planes = costs[pixel * DEPTHS..][..DEPTHS].iter_mut().zip(&mut differences).zip(n_seen);
        for ((cost, differences), n_seen) in planes.filter(|(_, n_seen)| *n_seen >= 2) {
            // The better half: the point may be hidden from the others.
            differences[..n_seen].sort_unstable_by(f32::total_cmp);
            let half = n_seen.div_ceil(2).max(2);
            *cost = differences[..half].iter().sum::<f32>() / half as f32;
        }
    }
    let smooth = smoothed(&costs, eye.width, eye.height);
    let inverse = |pixel: usize| {
        let (own, total) = (&costs[pixel * DEPTHS..][..DEPTHS], &smooth[pixel * DEPTHS..][..DEPTHS]);
        let best = (0..DEPTHS).min_by(|a, b| total[*a].total_cmp(&total[*b])).unwrap_or(0);
        let is_inside = best > 0 && best + 1 < DEPTHS;
        if eye.ground[pixel] != Ground::Still || !is_inside || own[best] >= MOST_COST {
            return f32::NAN;
        }
        // The lowest point of the parabola through three costs.
        let (before, after) = (total[best - 1] - total[best], total[best + 1] - total[best]);
        inverse_depth(step, best as f32 + 0.5 * (before - after) / (before + after).max(1e-6))
    };
    Depths { inverse: (0..n).map(inverse).collect(), step }
}

/// The first plane is half a step from infinity.
fn inverse_depth(step: f32, plane: f32) -> f32 {
    step * (plane + 0.5)
}

/// For each pixel and plane the least cost of a path up to there, summed over paths from four sides.
fn smoothed(costs: &[f32], width: usize, height: usize) -> Vec<f32> {
    let mut total = vec![0.0; costs.len()];
    let mut walk = |path: &mut dyn Iterator<Item = usize>| {
        let mut last: Option<[f32; DEPTHS]> = None;
        for pixel in path {
            let at = pixel * DEPTHS;
            let mut now: [f32; DEPTHS] = std::array::from_fn(|d| costs[at + d]);
            if let Some(last) = last {
                let least = last.iter().copied().fold(f32::INFINITY, f32::min);
                for (d, now) in now.iter_mut().enumerate() {
                    let beside = last[d.saturating_sub(1)].min(last[(d + 1).min(DEPTHS - 1)]);
                    *now += last[d].min(beside + STEP_COST).min(least + JUMP_COST) - least;
                }
            }
            total[at..at + DEPTHS].iter_mut().zip(now).for_each(|(total, now)| *total += now);
            last = Some(now);
        }
    };
    for row in 0..height {
        let pixels = row * width..(row + 1) * width;
        walk(&mut pixels.clone());
        walk(&mut pixels.rev());
    }
    for column in 0..width {
        let pixels = (column..width * height).step_by(width);
        walk(&mut pixels.clone());
        walk(&mut pixels.rev());
    }
    total
}
