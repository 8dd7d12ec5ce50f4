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

/// `AdamParams` of the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct AdamParams {
    /// `rates0` of the shader.
    pub rates0: [f32; 4],
    /// `rates1` of the shader.
    pub rates1: [f32; 4],
    /// `rates2` of the shader.
    pub rates2: [f32; 4],
    /// `beta1` of the shader.
    pub beta1: f32,
    /// `beta2` of the shader.
    pub beta2: f32,
    /// `inverse_c2` of the shader.
    pub inverse_c2: f32,
    /// `eps` of the shader.
    pub eps: f32,
    /// `lowest_t_scale` of the shader.
    pub lowest_t_scale: f32,
    /// `opacity_reg` of the shader.
    pub opacity_reg: f32,
    /// `scale_reg` of the shader.
    pub scale_reg: f32,
    /// `step` of the shader.
    pub step: f32,
    /// `inverse_size` of the shader.
    pub inverse_size: f32,
}
const _: () = {
    assert!(size_of::<AdamParams>() == 84);
    assert!(std::mem::offset_of!(AdamParams, rates0) == 0);
    assert!(std::mem::offset_of!(AdamParams, rates1) == 16);
    assert!(std::mem::offset_of!(AdamParams, rates2) == 32);
    assert!(std::mem::offset_of!(AdamParams, beta1) == 48);
    assert!(std::mem::offset_of!(AdamParams, beta2) == 52);
    assert!(std::mem::offset_of!(AdamParams, inverse_c2) == 56);
    assert!(std::mem::offset_of!(AdamParams, eps) == 60);
    assert!(std::mem::offset_of!(AdamParams, lowest_t_scale) == 64);
    assert!(std::mem::offset_of!(AdamParams, opacity_reg) == 68);
    assert!(std::mem::offset_of!(AdamParams, scale_reg) == 72);
    assert!(std::mem::offset_of!(AdamParams, step) == 76);
    assert!(std::mem::offset_of!(AdamParams, inverse_size) == 80);
};

/// `Status` of the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Status {
    /// `failed` of the shader.
    pub failed: u32,
    /// `n_active` of the shader.
    pub n_active: u32,
    /// `n_visible` of the shader.
    pub n_visible: u32,
    /// `n_intersections` of the shader.
    pub n_intersections: u32,
    /// `max_tile_list` of the shader.
    pub max_tile_list: u32,
    /// `n_bad` of the shader.
    pub n_bad: u32,
    /// `capacity_active` of the shader.
    pub capacity_active: u32,
    /// `capacity_intersections` of the shader.
    pub capacity_intersections: u32,
}
const _: () = {
    assert!(size_of::<Status>() == 32);
    assert!(std::mem::offset_of!(Status, failed) == 0);
    assert!(std::mem::offset_of!(Status, n_active) == 4);
    assert!(std::mem::offset_of!(Status, n_visible) == 8);
    assert!(std::mem::offset_of!(Status, n_intersections) == 12);
    assert!(std::mem::offset_of!(Status, max_tile_list) == 16);
    assert!(std::mem::offset_of!(Status, n_bad) == 20);
    assert!(std::mem::offset_of!(Status, capacity_active) == 24);
    assert!(std::mem::offset_of!(Status, capacity_intersections) == 28);
};

/// `ViewParams` of the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ViewParams {
    /// `row0` of the shader.
    pub row0: [f32; 4],
    /// `row1` of the shader.
    pub row1: [f32; 4],
    /// `row2` of the shader.
    pub row2: [f32; 4],
    /// `intrinsics` of the shader.
    pub intrinsics: [f32; 4],
    /// `clamp_uv` of the shader.
    pub clamp_uv: [f32; 4],
    /// `background` of the shader.
    pub background: [f32; 4],
    /// `next0` of the shader.
    pub next0: [f32; 4],
    /// `next1` of the shader.
    pub next1: [f32; 4],
    /// `next2` of the shader.
    pub next2: [f32; 4],
    /// `time` of the shader.
    pub time: f32,
    /// `near` of the shader.
    pub near: f32,
    /// `blur` of the shader.
    pub blur: f32,
    /// `alpha_min` of the shader.
    pub alpha_min: f32,
    /// `alpha_max` of the shader.
    pub alpha_max: f32,
    /// `t_min` of the shader.
    pub t_min: f32,
    /// `width` of the shader.
    pub width: u32,
    /// `height` of the shader.
    pub height: u32,
    /// `first_row` of the shader.
    pub first_row: u32,
    /// `n_rows` of the shader.
    pub n_rows: u32,
    /// `tiles_x` of the shader.
    pub tiles_x: u32,
    /// `tiles_y` of the shader.
    pub tiles_y: u32,
    /// `flow_model` of the shader.
    pub flow_model: u32,
    /// `depth_to_alpha` of the shader.
    pub depth_to_alpha: f32,
    /// `bounds` of the shader.
    pub bounds: u32,
    /// `depth_shift` of the shader.
    pub depth_shift: u32,
    /// `t_cut` of the shader.
    pub t_cut: f32,
    /// `unused0` of the shader.
    pub unused0: f32,
    /// `unused1` of the shader.
    pub unused1: f32,
    /// `unused2` of the shader.
    pub unused2: f32,
}
const _: () = {
    assert!(size_of::<ViewParams>() == 224);
    assert!(std::mem::offset_of!(ViewParams, row0) == 0);
    assert!(std::mem::offset_of!(ViewParams, row1) == 16);
    assert!(std::mem::offset_of!(ViewParams, row2) == 32);
    assert!(std::mem::offset_of!(ViewParams, intrinsics) == 48);
    assert!(std::mem::offset_of!(ViewParams, clamp_uv) == 64);
    assert!(std::mem::offset_of!(ViewParams, background) == 80);
    assert!(std::mem::offset_of!(ViewParams, next0) == 96);
    assert!(std::mem::offset_of!(ViewParams, next1) == 112);
    assert!(std::mem::offset_of!(ViewParams, next2) == 128);
    assert!(std::mem::offset_of!(ViewParams, time) == 144);
    assert!(std::mem::offset_of!(ViewParams, near) == 148);
    assert!(std::mem::offset_of!(ViewParams, blur) == 152);
    assert!(std::mem::offset_of!(ViewParams, alpha_min) == 156);
    assert!(std::mem::offset_of!(ViewParams, alpha_max) == 160);
    assert!(std::mem::offset_of!(ViewParams, t_min) == 164);
    assert!(std::mem::offset_of!(ViewParams, width) == 168);
    assert!(std::mem::offset_of!(ViewParams, height) == 172);
    assert!(std::mem::offset_of!(ViewParams, first_row) == 176);
    assert!(std::mem::offset_of!(ViewParams, n_rows) == 180);
    assert!(std::mem::offset_of!(ViewParams, tiles_x) == 184);
    assert!(std::mem::offset_of!(ViewParams, tiles_y) == 188);
    assert!(std::mem::offset_of!(ViewParams, flow_model) == 192);
    assert!(std::mem::offset_of!(ViewParams, depth_to_alpha) == 196);
    assert!(std::mem::offset_of!(ViewParams, bounds) == 200);
    assert!(std::mem::offset_of!(ViewParams, depth_shift) == 204);
    assert!(std::mem::offset_of!(ViewParams, t_cut) == 208);
    assert!(std::mem::offset_of!(ViewParams, unused0) == 212);
    assert!(std::mem::offset_of!(ViewParams, unused1) == 216);
    assert!(std::mem::offset_of!(ViewParams, unused2) == 220);
};

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
