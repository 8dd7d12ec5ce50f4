// The one list of kernels: included by build.rs, by the engine and by the tests. A row is a family: a shader and the choices that its
// kernels differ in. All that is known of a kernel but its code is here: definitions, truth, cost.

#[path = "axes.rs"]
mod axes;
#[path = "family.rs"]
mod family;

use axes::*;
pub use family::{Cost, Count, Family, Spec, Term};
use family::{ROW, blending, own, per};
use std::collections::HashMap;
use std::sync::LazyLock;

/// The truth of the backward projection: of gradients, of a step, of a step with rounded moments.
fn stepping(spec: &Spec) -> &'static str {
    match (spec.is("ADAM"), spec.is("MOMENTS_16")) {
        (false, _) => "jvp::jvp",
        (true, false) => "adam::Adam",
        (true, true) => "adam::rounded_moment",
    }
}

/// A round of a sort: key and value read and written, or the key alone read; and the counts of its block.
fn scattering(spec: &Spec) -> Vec<Term> {
    vec![own(spec.either("INDEXED", 12.5, 16.5), 0.0)]
}

/// All families.
#[rustfmt::skip]
pub static FAMILIES: &[Family] = &[
    Family { file: "cull/bound.comp", reference: |_| "tiles::tiles_truth", axes: &[POPULATION], count: Count::Gaussians,
        cost: Some(|s| vec![own(64.0 + 1.25 * s.motion(), 60.0)]), ..ROW },
    Family { file: "cull/live_blocks.comp", reference: |_| "cull::visible", count: Count::Gaussians,
        // Of those that do not live, which are most, bits and count; of the others their place in the list.
        cost: Some(|_| vec![own(28.0 / 128.0, 2.0 / 128.0)]), ..ROW },
    Family { file: "cull/cull.comp", reference: |_| "tiles::tiles_truth", axes: &[POPULATION], count: Count::Live,
        cost: Some(|s| vec![own(16.0 + 1.25 * s.motion() + 0.125, 40.0)]), ..ROW },
    Family { file: "cull/compact.comp", reference: |_| "scan::exclusive_scan", count: Count::Live,
        cost: Some(|_| vec![own(0.125 + 4.0 / 128.0, 0.0), per(Count::Active, 4.0, 0.0)]), ..ROW },
    Family { file: "cull/prepare_active.comp", reference: |_| "scan::exclusive_scan", ..ROW },
    Family { file: "project/project.comp", reference: |_| "project::project", axes: &[POPULATION, DEGREE], count: Count::Active,
        cost: Some(|s| vec![
            per(Count::Active, 48.0 + s.motion() + 4.0 + 76.0, 260.0),
            per(Count::Visible, 16.0 + s.bands(), s.sh_flops()),
        ]), ..ROW },
    Family { file: "scan/scan_reduce.comp", reference: |_| "scan::exclusive_scan", axes: &[GATHERED], ..ROW },
    Family { file: "scan/scan_downsweep.comp", reference: |_| "scan::exclusive_scan", axes: &[GATHERED], ..ROW },
    // Of a key and round. With 24 bits of depth, 13 of tiles, and slots: 3 * 21 - 4 and 2 * 21 - 4 bytes.
    Family { file: "sort/sort_count.comp", reference: |_| "sort::radix_sort", count: Count::Active, cost: Some(|_| vec![own(4.5, 0.0)]), ..ROW },
    Family { file: "sort/sort_scatter.comp", reference: |_| "sort::radix_sort", count: Count::Active, axes: &[CARRIED],
        cost: Some(scattering), ..ROW },
    Family { file: "sort/sort_exchange.comp", reference: |_| "sort::radix_sort", count: Count::Active, axes: &[CARRIED],
        cost: Some(scattering), ..ROW },
    Family { file: "tiles/gather.comp", reference: |_| "scan::exclusive_scan", count: Count::Active, cost: Some(|_| vec![own(12.0, 0.0)]), ..ROW },
    Family { file: "tiles/emit.comp", reference: |_| "tiles::tiles_truth", count: Count::Intersections, axes: &[SLOTS],
        cost: Some(|s| vec![per(Count::Active, 44.0 + s.either("SLOTS", 4.0, 0.0), 40.0), own(8.0, 0.0)]), ..ROW },
    Family { file: "tiles/tile_ranges.comp", reference: |_| "tiles::ranges", count: Count::Tiles, cost: Some(|_| vec![own(16.0, 0.0)]), ..ROW },
    Family { file: "tiles/tile_order.comp", reference: |_| "tiles::ranges", count: Count::Tiles, cost: Some(|_| vec![own(12.0, 0.0)]), ..ROW },
    Family { file: "blend/blend_fwd.comp", reference: |_| "blend::render_f64", axes: &[TRAINING, OUTPUTS, PIXELS], count: Count::Intersections,
        cost: Some(|s| {
            let pixels = 16.0 + s.either("FULL", 16.0, 0.0) + s.either("TRAIN", 8.0, 0.0);
            // Of each entry that hits a block, x, y, four of M, opacity and the colour are handed around; FULL: four more.
            blending(s, Cost::of(4.0, 0.0), pixels, s.either("FULL", 14.0, 10.0), s.either("FULL", 16.0, 8.0))
        }), ..ROW },
    // For GPUs. How many chunks there are is not counted, so their time is no model's.
    Family { file: "blend/chunk_list.comp", reference: |_| "blend::render_f64", ..ROW },
    Family { file: "blend/chunk_light.comp", reference: |_| "blend::render_f64", ..ROW },
    Family { file: "blend/blend_merge.comp", reference: |_| "blend::render_f64", axes: &[TRAINING, OUTPUTS], ..ROW },
    Family { file: "blend/blend_bwd.comp", reference: |_| "jvp::jvp", axes: &[ACCUMULATION, OUTPUTS, PIXELS], count: Count::Intersections,
        cost: Some(|s| {
            let listed = match s.value("ACCUMULATE") {
                0 => Cost::of(4.0 + 4.0 + 48.0, 0.0),
                1 => Cost { atomics: 24.0, ..Cost::of(4.0, 0.0) },
                // Of 64 bits each; the peak is that of 32.
                _ => Cost { atomics: 12.0, ..Cost::of(4.0, 0.0) },
            };
            let pixels = 8.0 + 16.0 + s.either("FULL", 16.0, 0.0);
            // As forward, and the sums over the lanes: 16 shuffles transpose and add twelve numbers.
            blending(s, listed, pixels, 16.0 + s.either("FULL", 14.0, 10.0), s.either("FULL", 62.0, 46.0))
        }), ..ROW },
    Family { file: "blend/fixed_sums.comp", reference: |_| "jvp::jvp", count: Count::Active, cost: Some(|_| vec![own(104.0 + 48.0, 24.0)]), ..ROW },
    Family { file: "project/project_bwd.comp", reference: stepping, axes: &[STEPS, POPULATION, DEGREE, MOMENTS],
        same: |choice| {
            // Without the optimiser there are no moments.
            if choice[0] == 0 {
                choice[3] = 0;
            }
        },
        count: Count::Active,
        cost: Some(|s| {
            let each = 64.0 + s.bands() + s.motion();
            // Adam reads and writes parameter and both moments, which may share a word; without it the gradient is written.
            let stepped = s.either("MOMENTS_16", 4.0, 6.0) * each + 32.0;
            let (moved, steps) = if s.is("ADAM") { (stepped, 3.0 * each) } else { (2.0 * each, 0.0) };
            vec![
                own(4.0 + 64.0 + 8.0, 0.0),
                per(Count::Intersections, 48.0, 12.0),
                per(Count::Visible, moved, 700.0 + 2.0 * s.sh_flops() + steps),
            ]
        }) },
    Family { file: "fisher/fisher.comp", reference: |_| "fisher::responses", axes: &[POPULATION, DEGREE], count: Count::Gaussians,
        cost: Some(|s| {
            // Position, opacity and times, their gradients and the colour's; the bands and theirs; sums there and back.
            let bands = s.bands();
            vec![own(32.0 + 16.0 + 16.0 + 2.0 * s.motion() + 2.0 * bands + 96.0 + 48.0, 60.0 + bands / 2.0)]
        }), ..ROW },
    Family { file: "project/camera_sum.comp", reference: |_| "blend::render_f64", count: Count::Active, cost: Some(|_| vec![own(32.0, 8.0)]), ..ROW },
    Family { file: "project/camera_total.comp", reference: |_| "blend::render_f64", ..ROW },
    Family { file: "blend/background_sum.comp", reference: |_| "blend::render_f64", count: Count::Pixels,
        cost: Some(|_| vec![own(24.0, 6.0)]), ..ROW },
    // Eleven taps of four moments of three channels along either axis; of three partial derivatives of three channels on the way back.
    Family { file: "loss/ssim.comp", reference: |_| "ssim::photometric", axes: &[STRIDE], count: Count::Pixels,
        cost: Some(|s| {
            let places = s.either("STRIDE", 0.25, 1.0);
            vec![own(20.0 + places * 36.0, places * (2.0 * 2.0 * 11.0 * 12.0 + 3.0 * 40.0))]
        }), ..ROW },
    Family { file: "loss/ssim_bwd.comp", reference: |_| "ssim::photometric", axes: &[STRIDE], count: Count::Pixels,
        cost: Some(|s| {
            let places = s.either("STRIDE", 0.25, 1.0);
            vec![own(places * 36.0 + 20.0 + 16.0, places * 2.0 * 2.0 * 11.0 * 9.0 + 3.0 * 10.0)]
        }), ..ROW },
    Family { file: "loss/loss_sum.comp", reference: |_| "ssim::photometric", axes: &[REPORTED], ..ROW },
    Family { file: "loss/prior_loss.comp", reference: |_| "prior::depth_loss", count: Count::Pixels,
        cost: Some(|_| vec![own(16.0 + 6.0 + 16.0, 20.0)]), ..ROW },
    Family { file: "clock/clock_apply.comp", reference: |_| "input::Camera", ..ROW },
    Family { file: "clock/clock_step.comp", reference: |_| "clock::clock_step", ..ROW },
    Family { file: "pose/pose_apply.comp", reference: |_| "pose::corrected", ..ROW },
    Family { file: "pose/pose_step.comp", reference: |_| "pose::pose_step", ..ROW },
    // Recorded: pixels of the crop, multiply-adds of a convolution, vec4 of a map that is pooled or compared.
    Family { file: "lpips/lpips_input.comp", reference: |_| "lpips::lpips", count: Count::Recorded,
        cost: Some(|_| vec![own(20.0 + 32.0, 12.0)]), ..ROW },
    // Of a multiply-add; the maps are small beside them.
    Family { file: "lpips/lpips_conv.comp", reference: |_| "lpips::lpips", axes: &[DIRECTION, LANES], count: Count::Recorded,
        cost: Some(|_| vec![own(0.0, 2.0)]), ..ROW },
    Family { file: "lpips/lpips_pool.comp", reference: |_| "lpips::lpips", count: Count::Recorded,
        cost: Some(|_| vec![own(4.0 * 16.0 + 16.0 + 4.0, 0.0)]), ..ROW },
    Family { file: "lpips/lpips_tap.comp", reference: |_| "lpips::lpips", axes: &[DIRECTION], count: Count::Recorded,
        cost: Some(|s| vec![own(s.either("BACKWARD", 48.0, 32.0), s.either("BACKWARD", 60.0, 28.0))]), ..ROW },
    Family { file: "lpips/lpips_pool_bwd.comp", reference: |_| "lpips::lpips", count: Count::Recorded,
        cost: Some(|_| vec![own(16.0 + 5.0 + 16.0, 4.0)]), ..ROW },
    Family { file: "lpips/lpips_input_bwd.comp", reference: |_| "lpips::lpips", count: Count::Recorded,
        cost: Some(|_| vec![own(12.0 + 16.0 + 16.0, 6.0)]), ..ROW },
    // Twelve numbers between eight cells, and the map.
    Family { file: "bilateral/bilateral_slice.comp", reference: |_| "bilateral::BilateralGrid", axes: &[DIRECTION], count: Count::Pixels,
        cost: Some(|s| vec![own(s.either("BACKWARD", 48.0, 32.0), s.either("BACKWARD", 420.0, 216.0))]), ..ROW },
    Family { file: "bilateral/bilateral_bwd.comp", reference: |_| "bilateral::BilateralGrid", count: Count::Pixels,
        cost: Some(|_| vec![own(32.0, 216.0)]), ..ROW },
    // What the three above do, for GPUs.
    Family { file: "bilateral/bilateral_grade.comp", reference: |_| "bilateral::BilateralGrid", axes: &[DIRECTION], count: Count::Pixels,
        cost: Some(|s| vec![own(s.either("BACKWARD", 48.0, 32.0), s.either("BACKWARD", 636.0, 216.0))]), ..ROW },
    // Per dispatch: the 24,576 numbers of a grid, with variation, gradient, moments; four parts around each.
    Family { file: "bilateral/bilateral_sum.comp", reference: |_| "bilateral::BilateralGrid",
        cost: Some(|_| vec![own(6.0 * 98_304.0, 22.0 * 24_576.0)]), ..ROW },
    Family { file: "bilateral/bilateral_adam.comp", axes: &[POOLED],
        reference: |s| if s.is("POOLED") { "bilateral::pooled" } else { "adam::Adam" },
        cost: Some(|s| vec![own(7.0 * 98_304.0, s.either("POOLED", 13.0, 12.0) * 24_576.0)]), ..ROW },
    // Recorded: cameras.
    Family { file: "bilateral/bilateral_gauge.comp", reference: |_| "bilateral::centred", count: Count::Recorded,
        cost: Some(|_| vec![own(2.0 * 98_304.0, 2.0 * 24_576.0)]), ..ROW },
    // Times the vec4 of a Gaussian: parameter and both moments, read and written.
    Family { file: "adam/adam_idle.comp", reference: |s| if s.is("MOMENTS_16") { "adam::rounded_moment" } else { "adam::Adam" }, axes: &[MOMENTS], count: Count::Idle,
        cost: Some(|s| vec![own(s.either("MOMENTS_16", 64.0, 96.0), 48.0)]), ..ROW },
    Family { file: "adam/adam_catch_up.comp", reference: |s| if s.is("MOMENTS_16") { "adam::rounded_moment" } else { "adam::Adam" }, axes: &[MOMENTS], count: Count::Active,
        cost: Some(|s| vec![own(s.either("MOMENTS_16", 64.0, 96.0), 48.0)]), ..ROW },
    // Times the vec4 of a Gaussian: its gradient read, two words of each sum read and written.
    Family { file: "batch/batch_add.comp", reference: |_| "batch::batch_sum", count: Count::Active, cost: Some(|_| vec![own(80.0, 8.0)]), ..ROW },
    // Times the vec4 of a Gaussian: as adam_idle, and its sums read and written.
    Family { file: "batch/batch_step.comp", reference: |s| if s.is("MOMENTS_16") { "adam::rounded_moment" } else { "adam::Adam" }, axes: &[MOMENTS], count: Count::Gaussians,
        cost: Some(|s| vec![own(s.either("MOMENTS_16", 128.0, 160.0), 56.0)]), ..ROW },
    // Recorded: vec4 of all rows, each of them four sums read and written.
    Family { file: "batch/batch_pack.comp", reference: |_| "batch::batch_place", count: Count::Recorded, cost: Some(|_| vec![own(64.0, 0.0)]), ..ROW },
    Family { file: "batch/batch_unpack.comp", reference: |_| "batch::batch_place", count: Count::Recorded,
        cost: Some(|_| vec![own(64.0, 0.0)]), ..ROW },
    Family { file: "density/density_classify.comp", reference: |_| "density::Density", axes: &[POPULATION], count: Count::Gaussians,
        cost: None, ..ROW },
    Family { file: "density/density_choose.comp", reference: |_| "density::Density", count: Count::Gaussians, cost: None, ..ROW },
    Family { file: "density/density_list.comp", reference: |_| "density::Density", count: Count::Gaussians, cost: None, ..ROW },
    Family { file: "density/density_sample.comp", reference: |_| "density::Density", count: Count::Gaussians, cost: None, ..ROW },
    Family { file: "density/density_relocate.comp", reference: |_| "density::Density", count: Count::Gaussians, cost: None, ..ROW },
    Family { file: "density/density_gather.comp", reference: |_| "density::Density", count: Count::Gaussians, cost: None, ..ROW },
    Family { file: "density/density_children.comp", reference: |_| "density::Density", count: Count::Gaussians, cost: None, ..ROW },
    Family { file: "density/mcmc_noise.comp", reference: |_| "density::normals", count: Count::Gaussians,
        cost: Some(|_| vec![own(48.0 + 12.0, 120.0)]), ..ROW },
    // Lenses of a rig: 32 of them, 20 operations each.
    Family { file: "density/clear.comp", reference: |_| "clearing::cleared", count: Count::Gaussians,
        cost: Some(|_| vec![own(16.0, 32.0 * 20.0)]), ..ROW },
    // Its overlay is a few rows.
    Family { file: "screen/show.comp", reference: |_| "show::shown", count: Count::Pixels, cost: Some(|_| vec![own(32.0 + 4.0, 12.0)]), ..ROW },
    // They measure what the limits of the others are made of, so they have none.
    Family { file: "probe/probe_copy.comp", reference: |_| "", count: Count::Recorded, cost: None, ..ROW },
    Family { file: "probe/probe_fma.comp", reference: |_| "probe::fma_sum", count: Count::Recorded, cost: None, ..ROW },
    Family { file: "probe/probe_exp2.comp", reference: |_| "probe::exp2_solution", count: Count::Recorded, cost: None, ..ROW },
    Family { file: "probe/probe_shuffle.comp", reference: |_| "probe::turned_lane", count: Count::Recorded, cost: None, ..ROW },
    Family { file: "probe/probe_gather.comp", reference: |_| "probe::scattered_rows", count: Count::Recorded, cost: None, ..ROW },
    Family { file: "probe/probe_atomic.comp", reference: |_| "probe::scattered_rows", count: Count::Recorded, cost: None, ..ROW },
    Family { file: "probe/probe_dispatch.comp", reference: |_| "", cost: None, ..ROW },
];

/// All kernels.
pub static KERNELS: LazyLock<Vec<Spec>> = LazyLock::new(|| FAMILIES.iter().flat_map(Family::kernels).collect());

/// A kernel by its name.
pub fn kernel(name: &str) -> Option<&'static Spec> {
    static BY_NAME: LazyLock<HashMap<&str, &Spec>> =
        LazyLock::new(|| KERNELS.iter().map(|spec| (spec.name.as_str(), spec)).collect());
    BY_NAME.get(name).copied()
}
