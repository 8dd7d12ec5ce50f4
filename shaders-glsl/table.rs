// The one list of kernels: included by build.rs, by the engine and by the tests.

/// What one unit of a kernel's work is counted in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count {
    /// Gaussians of the scene.
    Gaussians,
    /// Active Gaussians: in the view's time and frustum.
    Active,
    /// The other Gaussians.
    Idle,
    /// Pairs of a Gaussian and a tile.
    Intersections,
    /// Tiles of the picture.
    Tiles,
    /// Pixels of the picture.
    Pixels,
    /// Gaussians that touch a tile.
    Visible,
    /// Pairs of a pixel and an intersection that a blend evaluates: the block of pixels is hit and not finished.
    Evaluated,
    /// Those of them that add to their pixel.
    Added,
    /// One per dispatch.
    Dispatches,
    /// What the recording says of the pass: see the comment at the row.
    Recorded,
}

/// A kernel.
pub struct Spec {
    /// Stem of everything that belongs to it.
    pub name: &'static str,
    /// Its shader, below `shaders-glsl`.
    pub file: &'static str,
    /// Preprocessor definitions that make this variant.
    pub defines: &'static [(&'static str, &'static str)],
    /// Its truth on the CPU.
    pub twin: &'static str,
    /// What its time grows with.
    pub count: Count,
    /// The ideal-limit model on one core of a CPU driver: nanoseconds per unit.
    pub limit_ns: f64,
}

const fn spec(
    name: &'static str,
    file: &'static str,
    defines: &'static [(&'static str, &'static str)],
    twin: &'static str,
    count: Count,
    limit_ns: f64,
) -> Spec {
    Spec { name, file, defines, twin, count, limit_ns }
}

const D: (&str, &str) = ("DYNAMIC", "1");
const SH0: (&str, &str) = ("SH_DEGREE", "0");
const SH1: (&str, &str) = ("SH_DEGREE", "1");
const SH2: (&str, &str) = ("SH_DEGREE", "2");
const SH3: (&str, &str) = ("SH_DEGREE", "3");
const FULL: (&str, &str) = ("FULL", "1");
const TRAIN: (&str, &str) = ("TRAIN", "1");
const FLOAT: (&str, &str) = ("ACCUMULATE", "1");
const FIXED: (&str, &str) = ("ACCUMULATE", "2");
const SWAP: (&str, &str) = ("ACCUMULATE", "3");
const ADAM: (&str, &str) = ("ADAM", "1");
const BACKWARD: (&str, &str) = ("BACKWARD", "1");
const P4: (&str, &str) = ("PIXELS", "4");
const HALF: (&str, &str) = ("SH_HALF", "1");
const M16: (&str, &str) = ("MOMENTS_16", "1");
const S2: (&str, &str) = ("STRIDE", "2u");
const P8: (&str, &str) = ("PIXELS", "8");

/// All kernels.
#[rustfmt::skip]
pub const KERNELS: &[Spec] = &[
    spec("bound_static", "cull/bound.comp", &[], "cull", Count::Gaussians, 25.0),
    spec("bound_dynamic", "cull/bound.comp", &[D], "cull", Count::Gaussians, 25.0),
    spec("cull_static", "cull/cull.comp", &[], "cull", Count::Gaussians, 25.0),
    spec("cull_dynamic", "cull/cull.comp", &[D], "cull", Count::Gaussians, 25.0),
    spec("compact", "cull/compact.comp", &[], "scan", Count::Gaussians, 5.0),
    spec("prepare_active", "cull/prepare_active.comp", &[], "scan", Count::Dispatches, 1000.0),
    spec("project_static_sh0", "project/project.comp", &[SH0], "project", Count::Active, 160.0),
    spec("project_static_sh1", "project/project.comp", &[SH1], "project", Count::Active, 175.0),
    spec("project_static_sh2", "project/project.comp", &[SH2], "project", Count::Active, 195.0),
    spec("project_static_sh3", "project/project.comp", &[SH3], "project", Count::Active, 230.0),
    spec("project_dynamic_sh0", "project/project.comp", &[D, SH0], "project", Count::Active, 160.0),
    spec("project_dynamic_sh1", "project/project.comp", &[D, SH1], "project", Count::Active, 175.0),
    spec("project_dynamic_sh2", "project/project.comp", &[D, SH2], "project", Count::Active, 195.0),
    spec("project_dynamic_sh3", "project/project.comp", &[D, SH3], "project", Count::Active, 230.0),
    spec("project_static_sh1_half", "project/project.comp", &[SH1, HALF], "project", Count::Active, 175.0),
    spec("project_static_sh2_half", "project/project.comp", &[SH2, HALF], "project", Count::Active, 195.0),
    spec("project_static_sh3_half", "project/project.comp", &[SH3, HALF], "project", Count::Active, 230.0),
    spec("project_dynamic_sh1_half", "project/project.comp", &[D, SH1, HALF], "project", Count::Active, 175.0),
    spec("project_dynamic_sh2_half", "project/project.comp", &[D, SH2, HALF], "project", Count::Active, 195.0),
    spec("project_dynamic_sh3_half", "project/project.comp", &[D, SH3, HALF], "project", Count::Active, 230.0),
    spec("sh_half", "project/sh_half.comp", &[], "project", Count::Gaussians, 60.0),
    spec("scan_reduce", "scan/scan_reduce.comp", &[], "scan", Count::Dispatches, 1000.0),
    spec("scan_spine", "scan/scan_spine.comp", &[], "scan", Count::Dispatches, 1000.0),
    spec("scan_downsweep", "scan/scan_downsweep.comp", &[], "scan", Count::Dispatches, 1000.0),
    spec("sort_count", "sort/sort_count.comp", &[], "sort", Count::Active, 12.0),
    spec("sort_scatter", "sort/sort_scatter.comp", &[("SUBGROUPS", "16")], "sort", Count::Active, 57.0),
    spec("sort_scatter_w32", "sort/sort_scatter.comp", &[("SUBGROUPS", "2")], "sort", Count::Active, 57.0),
    spec("gather", "tiles/gather.comp", &[], "scan", Count::Active, 5.0),
    spec("prepare_intersections", "tiles/prepare_intersections.comp", &[], "scan", Count::Dispatches, 1000.0),
    spec("emit", "tiles/emit.comp", &[], "tiles", Count::Intersections, 50.0),
    spec("emit_slots", "tiles/emit.comp", &[("SLOTS", "1")], "tiles", Count::Intersections, 55.0),
    spec("tile_ranges", "tiles/tile_ranges.comp", &[], "tiles", Count::Intersections, 5.0),
    spec("tile_buckets", "tiles/tile_buckets.comp", &[], "tiles", Count::Tiles, 20.0),
    spec("tile_order", "tiles/tile_order.comp", &[], "tiles", Count::Tiles, 20.0),
    spec("blend_fwd_p4", "blend/blend_fwd.comp", &[FULL, P4], "blend", Count::Intersections, 650.0),
    spec("blend_fwd_p8", "blend/blend_fwd.comp", &[FULL, P8], "blend", Count::Intersections, 650.0),
    spec("blend_fwd_color_p4", "blend/blend_fwd.comp", &[P4], "blend", Count::Intersections, 650.0),
    spec("blend_fwd_color_p8", "blend/blend_fwd.comp", &[P8], "blend", Count::Intersections, 650.0),
    spec("blend_fwd_train_p4", "blend/blend_fwd.comp", &[FULL, TRAIN, P4], "blend", Count::Intersections, 650.0),
    spec("blend_fwd_train_p8", "blend/blend_fwd.comp", &[FULL, TRAIN, P8], "blend", Count::Intersections, 650.0),
    spec("blend_fwd_train_color_p4", "blend/blend_fwd.comp", &[TRAIN, P4], "blend", Count::Intersections, 650.0),
    spec("blend_fwd_train_color_p8", "blend/blend_fwd.comp", &[TRAIN, P8], "blend", Count::Intersections, 650.0),
    spec("blend_bwd_p4", "blend/blend_bwd.comp", &[FULL, P4], "jvp", Count::Intersections, 730.0),
    spec("blend_bwd_p8", "blend/blend_bwd.comp", &[FULL, P8], "jvp", Count::Intersections, 730.0),
    spec("blend_bwd_color_p4", "blend/blend_bwd.comp", &[P4], "jvp", Count::Intersections, 730.0),
    spec("blend_bwd_color_p8", "blend/blend_bwd.comp", &[P8], "jvp", Count::Intersections, 730.0),
    spec("blend_bwd_float_p4", "blend/blend_bwd.comp", &[FULL, FLOAT, P4], "jvp", Count::Intersections, 1000.0),
    spec("blend_bwd_float_p8", "blend/blend_bwd.comp", &[FULL, FLOAT, P8], "jvp", Count::Intersections, 1000.0),
    spec("blend_bwd_float_color_p4", "blend/blend_bwd.comp", &[FLOAT, P4], "jvp", Count::Intersections, 1000.0),
    spec("blend_bwd_float_color_p8", "blend/blend_bwd.comp", &[FLOAT, P8], "jvp", Count::Intersections, 1000.0),
    spec("blend_bwd_fixed_p4", "blend/blend_bwd.comp", &[FULL, FIXED, P4], "jvp", Count::Intersections, 1000.0),
    spec("blend_bwd_fixed_p8", "blend/blend_bwd.comp", &[FULL, FIXED, P8], "jvp", Count::Intersections, 1000.0),
    spec("blend_bwd_fixed_color_p4", "blend/blend_bwd.comp", &[FIXED, P4], "jvp", Count::Intersections, 1000.0),
    spec("blend_bwd_fixed_color_p8", "blend/blend_bwd.comp", &[FIXED, P8], "jvp", Count::Intersections, 1000.0),
    spec("blend_bwd_swap_p4", "blend/blend_bwd.comp", &[FULL, SWAP, P4], "jvp", Count::Intersections, 1000.0),
    spec("blend_bwd_swap_p8", "blend/blend_bwd.comp", &[FULL, SWAP, P8], "jvp", Count::Intersections, 1000.0),
    spec("blend_bwd_swap_color_p4", "blend/blend_bwd.comp", &[SWAP, P4], "jvp", Count::Intersections, 1000.0),
    spec("blend_bwd_swap_color_p8", "blend/blend_bwd.comp", &[SWAP, P8], "jvp", Count::Intersections, 1000.0),
    spec("fixed_sums", "blend/fixed_sums.comp", &[], "jvp", Count::Active, 40.0),
    spec("project_bwd_static_sh0", "project/project_bwd.comp", &[SH0], "jvp", Count::Active, 320.0),
    spec("project_bwd_static_sh1", "project/project_bwd.comp", &[SH1], "jvp", Count::Active, 320.0),
    spec("project_bwd_static_sh2", "project/project_bwd.comp", &[SH2], "jvp", Count::Active, 320.0),
    spec("project_bwd_static_sh3", "project/project_bwd.comp", &[SH3], "jvp", Count::Active, 320.0),
    spec("project_bwd_dynamic_sh0", "project/project_bwd.comp", &[D, SH0], "jvp", Count::Active, 320.0),
    spec("project_bwd_dynamic_sh1", "project/project_bwd.comp", &[D, SH1], "jvp", Count::Active, 320.0),
    spec("project_bwd_dynamic_sh2", "project/project_bwd.comp", &[D, SH2], "jvp", Count::Active, 320.0),
    spec("project_bwd_dynamic_sh3", "project/project_bwd.comp", &[D, SH3], "jvp", Count::Active, 320.0),
    spec("project_bwd_adam_static_sh0", "project/project_bwd.comp", &[SH0, ADAM], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_static_sh1", "project/project_bwd.comp", &[SH1, ADAM], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_static_sh2", "project/project_bwd.comp", &[SH2, ADAM], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_static_sh3", "project/project_bwd.comp", &[SH3, ADAM], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_dynamic_sh0", "project/project_bwd.comp", &[D, SH0, ADAM], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_dynamic_sh1", "project/project_bwd.comp", &[D, SH1, ADAM], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_dynamic_sh2", "project/project_bwd.comp", &[D, SH2, ADAM], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_dynamic_sh3", "project/project_bwd.comp", &[D, SH3, ADAM], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_static_sh0_m16", "project/project_bwd.comp", &[SH0, ADAM, M16], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_static_sh1_m16", "project/project_bwd.comp", &[SH1, ADAM, M16], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_static_sh2_m16", "project/project_bwd.comp", &[SH2, ADAM, M16], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_static_sh3_m16", "project/project_bwd.comp", &[SH3, ADAM, M16], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_dynamic_sh0_m16", "project/project_bwd.comp", &[D, SH0, ADAM, M16], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_dynamic_sh1_m16", "project/project_bwd.comp", &[D, SH1, ADAM, M16], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_dynamic_sh2_m16", "project/project_bwd.comp", &[D, SH2, ADAM, M16], "adam", Count::Active, 850.0),
    spec("project_bwd_adam_dynamic_sh3_m16", "project/project_bwd.comp", &[D, SH3, ADAM, M16], "adam", Count::Active, 850.0),
    spec("fisher_static_sh0", "fisher/fisher.comp", &[SH0], "fisher", Count::Gaussians, 60.0),
    spec("fisher_static_sh1", "fisher/fisher.comp", &[SH1], "fisher", Count::Gaussians, 90.0),
    spec("fisher_static_sh2", "fisher/fisher.comp", &[SH2], "fisher", Count::Gaussians, 130.0),
    spec("fisher_static_sh3", "fisher/fisher.comp", &[SH3], "fisher", Count::Gaussians, 190.0),
    spec("fisher_dynamic_sh0", "fisher/fisher.comp", &[D, SH0], "fisher", Count::Gaussians, 70.0),
    spec("fisher_dynamic_sh1", "fisher/fisher.comp", &[D, SH1], "fisher", Count::Gaussians, 100.0),
    spec("fisher_dynamic_sh2", "fisher/fisher.comp", &[D, SH2], "fisher", Count::Gaussians, 140.0),
    spec("fisher_dynamic_sh3", "fisher/fisher.comp", &[D, SH3], "fisher", Count::Gaussians, 200.0),
    spec("camera_sum", "project/camera_sum.comp", &[], "jvp", Count::Active, 5.0),
    spec("camera_total", "project/camera_total.comp", &[], "jvp", Count::Dispatches, 1000.0),
    spec("background_sum", "blend/background_sum.comp", &[], "jvp", Count::Pixels, 5.0),
    spec("ssim_rows", "loss/ssim_rows.comp", &[], "ssim", Count::Pixels, 128.0),
    spec("ssim_rows_s2", "loss/ssim_rows.comp", &[S2], "ssim", Count::Pixels, 80.0),
    spec("ssim_columns", "loss/ssim_columns.comp", &[], "ssim", Count::Pixels, 243.0),
    spec("ssim_columns_s2", "loss/ssim_columns.comp", &[S2], "ssim", Count::Pixels, 75.0),
    spec("ssim_bwd_rows", "loss/ssim_bwd_rows.comp", &[], "ssim", Count::Pixels, 90.0),
    spec("ssim_bwd_rows_s2", "loss/ssim_bwd_rows.comp", &[S2], "ssim", Count::Pixels, 25.0),
    spec("ssim_bwd_columns", "loss/ssim_bwd_columns.comp", &[], "ssim", Count::Pixels, 90.0),
    spec("ssim_bwd_columns_s2", "loss/ssim_bwd_columns.comp", &[S2], "ssim", Count::Pixels, 50.0),
    spec("l1", "loss/l1.comp", &[], "ssim", Count::Pixels, 10.0),
    spec("loss_sum", "loss/loss_sum.comp", &[], "ssim", Count::Dispatches, 1000.0),
    spec("prior_loss", "loss/prior_loss.comp", &[], "prior", Count::Pixels, 40.0),
    spec("clock_apply", "clock/clock_apply.comp", &[], "clock", Count::Dispatches, 1000.0),
    spec("clock_step", "clock/clock_step.comp", &[], "clock", Count::Dispatches, 1000.0),
    // Recorded: pixels of the crop, multiply-adds of a convolution, vec4 of a map that is pooled or compared.
    spec("lpips_input", "lpips/lpips_input.comp", &[], "lpips", Count::Recorded, 30.0),
    spec("lpips_conv", "lpips/lpips_conv.comp", &[], "lpips", Count::Recorded, 0.53),
    spec("lpips_pool", "lpips/lpips_pool.comp", &[], "lpips", Count::Recorded, 60.0),
    spec("lpips_tap", "lpips/lpips_tap.comp", &[], "lpips", Count::Recorded, 20.0),
    spec("lpips_tap_bwd", "lpips/lpips_tap.comp", &[BACKWARD], "lpips", Count::Recorded, 40.0),
    spec("lpips_sum", "lpips/lpips_sum.comp", &[], "lpips", Count::Dispatches, 1000.0),
    spec("lpips_conv_bwd", "lpips/lpips_conv.comp", &[BACKWARD], "lpips", Count::Recorded, 0.53),
    spec("lpips_pool_bwd", "lpips/lpips_pool_bwd.comp", &[], "lpips", Count::Recorded, 60.0),
    spec("lpips_input_bwd", "lpips/lpips_input_bwd.comp", &[], "lpips", Count::Recorded, 30.0),
    spec("bilateral_slice", "bilateral/bilateral_slice.comp", &[], "bilateral", Count::Pixels, 15.0),
    spec("bilateral_slice_bwd", "bilateral/bilateral_slice.comp", &[("BACKWARD", "1")], "bilateral", Count::Pixels, 17.0),
    spec("bilateral_bwd", "bilateral/bilateral_bwd.comp", &[], "bilateral", Count::Pixels, 20.0),
    spec("bilateral_sum", "bilateral/bilateral_sum.comp", &[], "bilateral", Count::Dispatches, 580_000.0),
    spec("bilateral_adam", "bilateral/bilateral_adam.comp", &[], "bilateral", Count::Dispatches, 400_000.0),
    // Recorded: cameras.
    spec("bilateral_gauge", "bilateral/bilateral_gauge.comp", &[], "bilateral", Count::Recorded, 10_000.0),
    // Times the vec4 of the buffer.
    spec("adam_idle", "adam/adam_idle.comp", &[], "adam", Count::Idle, 33.0),
    spec("adam_catch_up", "adam/adam_catch_up.comp", &[], "adam", Count::Active, 33.0),
    spec("adam_idle_m16", "adam/adam_idle.comp", &[M16], "adam", Count::Idle, 33.0),
    spec("adam_catch_up_m16", "adam/adam_catch_up.comp", &[M16], "adam", Count::Active, 33.0),
    spec("density_classify_static", "density/density_classify.comp", &[], "density", Count::Gaussians, 40.0),
    spec("density_classify_dynamic", "density/density_classify.comp", &[D], "density", Count::Gaussians, 50.0),
    spec("density_choose", "density/density_choose.comp", &[], "density", Count::Gaussians, 10.0),
    spec("density_list", "density/density_list.comp", &[], "density", Count::Gaussians, 15.0),
    spec("density_sample", "density/density_sample.comp", &[], "density", Count::Gaussians, 120.0),
    spec("density_relocate", "density/density_relocate.comp", &[], "density", Count::Gaussians, 20.0),
    spec("density_gather", "density/density_gather.comp", &[], "density", Count::Gaussians, 60.0),
    spec("density_children", "density/density_children.comp", &[], "density", Count::Gaussians, 120.0),
    spec("mcmc_noise", "density/mcmc_noise.comp", &[], "density", Count::Gaussians, 80.0),
    spec("show", "screen/show.comp", &[], "show", Count::Pixels, 12.0),
    // They measure what the limits of the others are made of, so they have none.
    spec("probe_copy", "probe/probe_copy.comp", &[], "probe", Count::Recorded, 0.0),
    spec("probe_fma", "probe/probe_fma.comp", &[], "probe", Count::Recorded, 0.0),
    spec("probe_exp2", "probe/probe_exp2.comp", &[], "probe", Count::Recorded, 0.0),
    spec("probe_shuffle", "probe/probe_shuffle.comp", &[], "probe", Count::Recorded, 0.0),
    spec("probe_gather", "probe/probe_gather.comp", &[], "probe", Count::Recorded, 0.0),
    spec("probe_atomic", "probe/probe_atomic.comp", &[], "probe", Count::Recorded, 0.0),
    spec("probe_atomic_float", "probe/probe_atomic.comp", &[("FLOAT", "1")], "probe", Count::Recorded, 0.0),
    spec("probe_dispatch", "probe/probe_dispatch.comp", &[], "probe", Count::Dispatches, 0.0),
];
