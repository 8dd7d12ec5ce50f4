//! Bindings of the kernels, generated from the shaders by `IVV_BLESS=1 cargo build --features shaders`: here the structs
//! that kernels share, then a file for each folder of `shaders-glsl` with a module for each kernel: its buffers by name
//! (`Args`), its push constants (`Push`), and what the device needs to know (`INFO`). Variants of a shader with the same
//! buffers as its first are a line each; a function named after the shader picks one.

mod adam;
mod batch;
mod bilateral;
mod blend;
mod clock;
pub mod constants;
mod cull;
mod density;
mod fisher;
mod loss;
mod lpips;
mod pose;
mod probe;
mod project;
mod scan;
mod screen;
mod sort;
mod tiles;

use bytemuck::{Pod, Zeroable};

pub use adam::*;
pub use batch::*;
pub use bilateral::*;
pub use blend::*;
pub use clock::*;
pub use cull::*;
pub use density::*;
pub use fisher::*;
pub use loss::*;
pub use lpips::*;
pub use pose::*;
pub use probe::*;
pub use project::*;
pub use scan::*;
pub use screen::*;
pub use sort::*;
pub use tiles::*;

/// One step of Adam: what the host computes in double precision.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct AdamParams {
    /// lr / c1; that of position at a pace of 1.
    pub position_opacity_rotation_scale: [f32; 4],
    pub t_scale_velocity_t_center_sh0: [f32; 4],
    /// 0 for a band that is not active yet.
    pub sh1_sh2_sh3: [f32; 4],
    pub beta1: f32,
    pub beta2: f32,
    pub inverse_c2: f32,
    pub eps: f32,
    /// floor of log tau.
    pub lowest_t_scale: f32,
    /// weight of the sum of the opacities in the loss.
    pub opacity_reg: f32,
    /// weight of the sum of the standard deviations, per scene unit.
    pub scale_reg: f32,
    /// number of the step, from 1.
    pub step: f32,
    /// 1 / the longest standard deviation whose pace is 1; 0: every pace is.
    pub inverse_size: f32,
}
const _: () = assert!(size_of::<AdamParams>() == 84);

/// The limits of the rules of pruning, which are functions below.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PruneLimits {
    /// the largest over the training times, below which a Gaussian goes.
    pub opacity: f32,
    /// log of the largest standard deviation, above which it goes.
    pub log_scale: f32,
    /// standard deviation towards a lens, in units of its depth before it, above which it goes.
    pub veil: f32,
}
const _: () = assert!(size_of::<PruneLimits>() == 12);

/// The report of a frame. `failed` holds FAILED_* bits; the numbers are the need, even if it did not fit.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Status {
    pub failed: u32,
    pub n_active: u32,
    pub n_visible: u32,
    pub n_intersections: u32,
    pub max_tile_list: u32,
    pub n_bad: u32,
    pub capacity_active: u32,
    pub capacity_intersections: u32,
}
const _: () = assert!(size_of::<Status>() == 32);

/// One view, or one horizontal strip of it. Lengths in scene units, image quantities in pixels.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ViewParams {
    /// rows of the world-to-camera rotation; w: the camera's centre, world, x.
    pub row0: [f32; 4],
    /// y.
    pub row1: [f32; 4],
    /// z.
    pub row2: [f32; 4],
    /// fx, fy, cx, cy.
    pub intrinsics: [f32; 4],
    /// range of x/z and y/z inside which the Jacobian follows the centre: u low, u high, v low, v high.
    pub clamp_uv: [f32; 4],
    /// rgb; w: flow_dt.
    pub background: [f32; 4],
    /// as row0 to row2, of the camera one frame on.
    pub next0: [f32; 4],
    pub next1: [f32; 4],
    pub next2: [f32; 4],
    /// t' of SPEC 2, the camera's offset included.
    pub time: f32,
    pub near: f32,
    pub blur: f32,
    pub alpha_min: f32,
    pub alpha_max: f32,
    pub t_min: f32,
    pub width: u32,
    pub height: u32,
    /// pixel row at which the strip begins, a multiple of TILE.
    pub first_row: u32,
    /// pixel rows in the strip.
    pub n_rows: u32,
    pub tiles_x: u32,
    /// tile rows in the strip.
    pub tiles_y: u32,
    /// FLOW_*.
    pub flow_model: u32,
    /// 1, or 0 where the cotangents of the depths must not reach the opacities.
    pub depth_to_alpha: f32,
    /// TILES_*, and EVERY_BLOCK or not.
    pub bounds: u32,
    /// low bits that a depth key lacks: DEPTH_SHIFT_*, or 0 for all bits of the depth.
    pub depth_shift: u32,
    /// a pixel whose transmittance has fallen below this is finished; 0 leaves it to t_min.
    pub t_cut: f32,
    /// to whole vec4.
    pub unused0: f32,
    pub unused1: f32,
    pub unused2: f32,
}
const _: () = assert!(size_of::<ViewParams>() == 224);

/// Every kernel, in the order of the table.
pub const ALL: &[&super::KernelInfo] = &[
    bound_static::INFO,
    bound_dynamic::INFO,
    live_blocks::INFO,
    cull_static::INFO,
    cull_dynamic::INFO,
    compact::INFO,
    prepare_active::INFO,
    project_static_sh0::INFO,
    project_static_sh1::INFO,
    project_static_sh2::INFO,
    project_static_sh3::INFO,
    project_dynamic_sh0::INFO,
    project_dynamic_sh1::INFO,
    project_dynamic_sh2::INFO,
    project_dynamic_sh3::INFO,
    scan_reduce::INFO,
    scan_reduce_gathered::INFO,
    scan_downsweep::INFO,
    scan_downsweep_gathered::INFO,
    sort_count::INFO,
    sort_scatter::INFO,
    sort_scatter_indexed::INFO,
    sort_exchange::INFO,
    sort_exchange_indexed::INFO,
    gather::INFO,
    emit::INFO,
    emit_slots::INFO,
    tile_ranges::INFO,
    tile_order::INFO,
    blend_fwd_p4::INFO,
    blend_fwd_p8::INFO,
    blend_fwd_color_p4::INFO,
    blend_fwd_color_p8::INFO,
    blend_fwd_train_p4::INFO,
    blend_fwd_train_p8::INFO,
    blend_fwd_train_color_p4::INFO,
    blend_fwd_train_color_p8::INFO,
    chunk_list::INFO,
    chunk_light::INFO,
    blend_merge::INFO,
    blend_merge_color::INFO,
    blend_merge_train::INFO,
    blend_merge_train_color::INFO,
    blend_bwd_p4::INFO,
    blend_bwd_p8::INFO,
    blend_bwd_color_p4::INFO,
    blend_bwd_color_p8::INFO,
    blend_bwd_fixed_p4::INFO,
    blend_bwd_fixed_p8::INFO,
    blend_bwd_fixed_color_p4::INFO,
    blend_bwd_fixed_color_p8::INFO,
    blend_bwd_fixed64_p4::INFO,
    blend_bwd_fixed64_p8::INFO,
    blend_bwd_fixed64_color_p4::INFO,
    blend_bwd_fixed64_color_p8::INFO,
    fixed_sums::INFO,
    project_bwd_static_sh0::INFO,
    project_bwd_static_sh1::INFO,
    project_bwd_static_sh2::INFO,
    project_bwd_static_sh3::INFO,
    project_bwd_dynamic_sh0::INFO,
    project_bwd_dynamic_sh1::INFO,
    project_bwd_dynamic_sh2::INFO,
    project_bwd_dynamic_sh3::INFO,
    project_bwd_adam_static_sh0::INFO,
    project_bwd_adam_static_sh0_m16::INFO,
    project_bwd_adam_static_sh1::INFO,
    project_bwd_adam_static_sh1_m16::INFO,
    project_bwd_adam_static_sh2::INFO,
    project_bwd_adam_static_sh2_m16::INFO,
    project_bwd_adam_static_sh3::INFO,
    project_bwd_adam_static_sh3_m16::INFO,
    project_bwd_adam_dynamic_sh0::INFO,
    project_bwd_adam_dynamic_sh0_m16::INFO,
    project_bwd_adam_dynamic_sh1::INFO,
    project_bwd_adam_dynamic_sh1_m16::INFO,
    project_bwd_adam_dynamic_sh2::INFO,
    project_bwd_adam_dynamic_sh2_m16::INFO,
    project_bwd_adam_dynamic_sh3::INFO,
    project_bwd_adam_dynamic_sh3_m16::INFO,
    fisher_static_sh0::INFO,
    fisher_static_sh1::INFO,
    fisher_static_sh2::INFO,
    fisher_static_sh3::INFO,
    fisher_dynamic_sh0::INFO,
    fisher_dynamic_sh1::INFO,
    fisher_dynamic_sh2::INFO,
    fisher_dynamic_sh3::INFO,
    camera_sum::INFO,
    camera_total::INFO,
    background_sum::INFO,
    ssim::INFO,
    ssim_s2::INFO,
    ssim_bwd::INFO,
    ssim_bwd_s2::INFO,
    loss_sum::INFO,
    loss_sum_report::INFO,
    prior_loss::INFO,
    clock_apply::INFO,
    clock_step::INFO,
    pose_apply::INFO,
    pose_step::INFO,
    lpips_input::INFO,
    lpips_conv::INFO,
    lpips_conv_w16::INFO,
    lpips_conv_w32::INFO,
    lpips_conv_w64::INFO,
    lpips_conv_bwd::INFO,
    lpips_conv_bwd_w16::INFO,
    lpips_conv_bwd_w32::INFO,
    lpips_conv_bwd_w64::INFO,
    lpips_pool::INFO,
    lpips_tap::INFO,
    lpips_tap_bwd::INFO,
    lpips_pool_bwd::INFO,
    lpips_input_bwd::INFO,
    bilateral_slice::INFO,
    bilateral_slice_bwd::INFO,
    bilateral_bwd::INFO,
    bilateral_grade::INFO,
    bilateral_grade_bwd::INFO,
    bilateral_sum::INFO,
    bilateral_adam::INFO,
    bilateral_adam_pooled::INFO,
    bilateral_gauge::INFO,
    adam_idle::INFO,
    adam_idle_m16::INFO,
    adam_catch_up::INFO,
    adam_catch_up_m16::INFO,
    batch_add::INFO,
    batch_step::INFO,
    batch_step_m16::INFO,
    batch_pack::INFO,
    batch_unpack::INFO,
    density_classify_static::INFO,
    density_classify_dynamic::INFO,
    density_choose::INFO,
    density_list::INFO,
    density_sample::INFO,
    density_relocate::INFO,
    density_gather::INFO,
    density_children::INFO,
    mcmc_noise::INFO,
    clear::INFO,
    show::INFO,
    probe_copy::INFO,
    probe_fma::INFO,
    probe_exp2::INFO,
    probe_shuffle::INFO,
    probe_gather::INFO,
    probe_atomic::INFO,
    probe_dispatch::INFO,
];
