//! What kernels must do at least, per unit of what they grow with: the analytic model behind their ideal limits
//! in profiles. Bytes are those of data that must come from memory or go there once, whatever the caches;
//! flops are float additions and multiplications, without those of addresses; loads that caches serve are not counted.

use super::table::{Count, Spec};
use serde::Serialize;

/// Work, in the units of a device's peaks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Bytes to and from memory.
    pub bytes: f64,
    /// Bytes that a copy command reads and writes.
    pub copied: f64,
    /// Bytes that a fill command writes.
    pub filled: f64,
    /// Scattered rows of 64 bytes read.
    pub rows: f64,
    /// Float additions and multiplications.
    pub flops: f64,
    /// Powers of two.
    pub exp2: f64,
    /// Shuffles, one per lane.
    pub shuffles: f64,
    /// Atomic additions of integers.
    pub atomics: f64,
    /// Atomic additions of floats.
    pub float_atomics: f64,
}

impl Cost {
    /// Adds `n` times `other`.
    pub fn add(&mut self, other: &Cost, n: f64) {
        self.bytes += n * other.bytes;
        self.copied += n * other.copied;
        self.filled += n * other.filled;
        self.rows += n * other.rows;
        self.flops += n * other.flops;
        self.exp2 += n * other.exp2;
        self.shuffles += n * other.shuffles;
        self.atomics += n * other.atomics;
        self.float_atomics += n * other.float_atomics;
    }
}

/// A share of a kernel's cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// What it grows with; without it, what the pass itself does.
    pub per: Option<Count>,
    /// Of one unit.
    pub cost: Cost,
}

fn own(bytes: f64, flops: f64) -> Term {
    Term { per: None, cost: Cost { bytes, flops, ..Cost::default() } }
}

fn per(count: Count, bytes: f64, flops: f64) -> Term {
    Term { per: Some(count), ..own(bytes, flops) }
}

/// Bytes of a Gaussian's parameters: geometry, the bands up to `degree`, motion.
fn parameter_bytes(degree: usize, is_dynamic: bool) -> f64 {
    let bands: f64 = [48.0, 64.0, 96.0].iter().take(degree).sum();
    64.0 + bands + if is_dynamic { 16.0 } else { 0.0 }
}

/// Flops of a colour of `degree`.
fn sh_flops(degree: usize) -> f64 {
    6.0 * ((degree + 1) * (degree + 1)) as f64 + [0.0, 15.0, 35.0, 80.0][degree.min(3)]
}

/// The terms of `kernel`'s cost. None of kernels outside a frame or a step: density control and the probes.
pub fn terms(kernel: &Spec) -> Option<Vec<Term>> {
    use Count::{Active, Added, Evaluated, Intersections, Pixels, Visible};
    let value = |name: &str| kernel.defines.iter().find(|(key, _)| *key == name).and_then(|(_, v)| v.parse().ok());
    let is = |name: &str| value(name).is_some_and(|v: usize| v != 0);
    let (degree, dynamic) = (value("SH_DEGREE").unwrap_or(0), is("DYNAMIC"));
    let motion = if dynamic { 16.0 } else { 0.0 };
    // Every lane takes part in a shuffle and has this many pixels.
    let per_pixel = 1.0 / value("PIXELS").unwrap_or(1) as f64;
    let stem = kernel.file.rsplit('/').next().unwrap_or_default().trim_end_matches(".comp");
    Some(match stem {
        "bound" => vec![own(64.0 + motion + motion / 4.0, 60.0)],
        "cull" => vec![own(16.0 + 1.25 * motion + 0.125, 40.0)],
        "compact" => vec![own(0.125 + 4.0 / 128.0, 0.0), per(Active, 4.0, 0.0)],
        "project" => vec![
            per(Active, 48.0 + motion + 4.0 + 76.0, 260.0),
            per(Visible, parameter_bytes(degree, false) - 48.0, sh_flops(degree)),
        ],
        "sort_count" => vec![own(4.5, 0.0)],
        "sort_scatter" => vec![own(16.5, 0.0)],
        "gather" => vec![own(12.0, 0.0)],
        "emit" => {
            let slots = if is("SLOTS") { 4.0 } else { 0.0 };
            vec![per(Active, 44.0 + slots, 40.0), own(8.0 + slots, 0.0)]
        }
        "tile_ranges" => vec![own(4.0, 0.0)],
        "tile_buckets" => vec![own(8.0, 0.0)],
        "tile_order" => vec![own(12.0, 0.0)],
        "blend_fwd" => {
            let (full, train) = (if is("FULL") { 16.0 } else { 0.0 }, if is("TRAIN") { 8.0 } else { 0.0 });
            // Of each entry that hits a block, x, y, four of M, opacity and the colour are handed around; FULL: four more.
            let shuffles = per_pixel * if is("FULL") { 14.0 } else { 10.0 };
            let mut evaluated = per(Evaluated, 0.0, 14.0);
            (evaluated.cost.exp2, evaluated.cost.shuffles) = (1.0, shuffles);
            let mut listed = per(Intersections, 4.0, 0.0);
            listed.cost.rows = 1.0;
            let added = per(Added, 0.0, if is("FULL") { 16.0 } else { 8.0 });
            vec![listed, per(Active, 64.0, 0.0), per(Pixels, 16.0 + full + train, 0.0), evaluated, added]
        }
        "blend_bwd" => {
            let full = if is("FULL") { 16.0 } else { 0.0 };
            // As forward, and the sums over the lanes: 16 shuffles transpose and add twelve numbers.
            let shuffles = per_pixel * (16.0 + if is("FULL") { 14.0 } else { 10.0 });
            let mut evaluated = per(Evaluated, 0.0, 14.0);
            (evaluated.cost.exp2, evaluated.cost.shuffles) = (1.0, shuffles);
            let mut listed = per(Intersections, 4.0, 0.0);
            listed.cost.rows = 1.0;
            match value("ACCUMULATE").unwrap_or(0) {
                0 => listed.cost.bytes += 4.0 + 48.0,
                1 => listed.cost.float_atomics = 12.0,
                2 => listed.cost.atomics = 24.0,
                _ => listed.cost.atomics = 12.0,
            }
            let added = per(Added, 0.0, if is("FULL") { 62.0 } else { 46.0 });
            vec![listed, per(Active, 64.0, 0.0), per(Pixels, 8.0 + 16.0 + full, 0.0), evaluated, added]
        }
        "fixed_sums" => vec![own(104.0 + 48.0, 24.0)],
        "project_bwd" => {
            let each = parameter_bytes(degree, dynamic);
            // Adam reads and writes parameter and both moments, which may share a word; without it the gradient is written.
            let stepped = (if is("MOMENTS_16") { 4.0 } else { 6.0 }) * each + 32.0;
            let (moved, steps) = if is("ADAM") { (stepped, 3.0 * each) } else { (2.0 * each, 0.0) };
            vec![
                own(4.0 + 64.0 + 8.0, 0.0),
                per(Intersections, 48.0, 12.0),
                per(Visible, moved, 700.0 + 2.0 * sh_flops(degree) + steps),
            ]
        }
        "fisher" => {
            // Position, opacity and times, their gradients and the colour's; the bands and theirs; sums there and back.
            let bands = parameter_bytes(degree, false) - 64.0;
            vec![own(32.0 + 16.0 + 16.0 + 2.0 * motion + 2.0 * bands + 96.0 + 48.0, 60.0 + bands / 2.0)]
        }
        "camera_sum" => vec![own(32.0, 8.0)],
        "background_sum" => vec![own(24.0, 6.0)],
        // Eleven taps of four moments of three channels; of three partial derivatives of three channels on the way back.
        "ssim_rows" => vec![own(20.0 + 48.0, 2.0 * 11.0 * 12.0)],
        "ssim_columns" => vec![own(48.0 + 20.0 + 48.0, 2.0 * 11.0 * 12.0 + 3.0 * 40.0)],
        "ssim_bwd_rows" => vec![own(48.0 + 48.0, 2.0 * 11.0 * 9.0)],
        "ssim_bwd_columns" => vec![own(48.0 + 20.0 + 16.0, 2.0 * 11.0 * 9.0 + 3.0 * 10.0)],
        "l1" => vec![own(20.0 + 16.0, 12.0)],
        // A dispatch per band: their mean over the three.
        "sh_half" => vec![own(208.0 / 3.0 * 1.5, 208.0 / 12.0)],
        // Its overlay is a few rows.
        "show" => vec![own(32.0 + 4.0, 12.0)],
        "prior_loss" => vec![own(16.0 + 8.0 + 16.0, 20.0)],
        "lpips_input" => vec![own(20.0 + 32.0, 12.0)],
        // Of a multiply-add; the maps are small beside them.
        "lpips_conv" => vec![own(0.0, 2.0)],
        "lpips_pool" => vec![own(4.0 * 16.0 + 16.0 + 4.0, 0.0)],
        "lpips_tap" => vec![own(if is("BACKWARD") { 48.0 } else { 32.0 }, if is("BACKWARD") { 60.0 } else { 28.0 })],
        "lpips_pool_bwd" => vec![own(16.0 + 5.0 + 16.0, 4.0)],
        "lpips_input_bwd" => vec![own(12.0 + 16.0 + 16.0, 6.0)],
        // Twelve numbers between eight cells, and the map.
        "bilateral_slice" => {
            vec![own(if is("BACKWARD") { 48.0 } else { 32.0 }, if is("BACKWARD") { 420.0 } else { 216.0 })]
        }
        "bilateral_bwd" => vec![own(32.0, 216.0)],
        // Per dispatch: the 24,576 numbers of a grid, with gradient, moments, variation; four parts around each; per camera.
        "bilateral_sum" => vec![own(5.0 * 98_304.0, 4.0 * 24_576.0)],
        "bilateral_adam" => vec![own(7.0 * 98_304.0, 30.0 * 24_576.0)],
        "bilateral_gauge" => vec![own(2.0 * 98_304.0, 2.0 * 24_576.0)],
        // Per vec4 of the buffer: parameter and both moments, read and written.
        "adam_idle" | "adam_catch_up" => vec![own(if is("MOMENTS_16") { 64.0 } else { 96.0 }, 48.0)],
        "mcmc_noise" => vec![own(48.0 + 12.0, 120.0)],
        // Theirs is the dispatch.
        "scan_reduce"
        | "scan_spine"
        | "scan_downsweep"
        | "prepare_active"
        | "prepare_intersections"
        | "camera_total"
        | "loss_sum"
        | "clock_apply"
        | "clock_step"
        | "lpips_sum" => vec![own(0.0, 0.0)],
        _ => return None,
    })
}
