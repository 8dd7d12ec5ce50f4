//! Settings of the loss: weights and forms of its terms.

use crate::stage::DepthSpace;
use std::path::PathBuf;

/// The terms of the loss beside the photometric one, whose weight is 1 (SPEC 4). A term of weight 0, or without data,
/// costs nothing.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Loss {
    /// Weight of the mean error of the depth, where the capture has priors of it.
    pub depth: f64,
    /// The space in which depths are compared.
    pub depth_space: DepthSpace,
    /// Keeps the depth's error from changing opacities and shapes: it moves centres along the view alone.
    pub depth_detach_alpha: bool,
    /// Weight of the mean end-point error of the flow, pixels per frame.
    pub flow: f64,
    /// What the rendered flow is.
    pub flow_model: FlowChoice,
    /// Weight of the sum of the squared time offsets, frames.
    pub offset: f64,
    /// Weight of the total variation of the camera's bilateral grid.
    pub grid_variation: f64,
    /// SSIM in every n-th step alone, with n times the weight; the others have the absolute error.
    pub ssim_every: u64,
    /// SSIM at every pixel (1), or at every second of every second row with four times the weight (2).
    pub ssim_stride: u32,
    /// Weight of LPIPS, where there are [`Loss::lpips_weights`].
    pub lpips: f64,
    /// The weights of its trunk, as `tools/lpips_weights.py` writes them.
    pub lpips_weights: Option<PathBuf>,
    /// LPIPS of a square of this side alone, elsewhere in each step, pixels; 0 for the whole picture.
    pub lpips_crop: u32,
    /// LPIPS in every n-th step alone, with n times the weight.
    pub lpips_every: u64,
}

impl Default for Loss {
    fn default() -> Self {
        Loss {
            depth: 1.0,
            depth_space: DepthSpace::Inverse,
            depth_detach_alpha: false,
            flow: 0.1,
            flow_model: FlowChoice::Auto,
            offset: 1e-4,
            grid_variation: 10.0,
            ssim_every: 1,
            ssim_stride: 1,
            lpips: 0.1,
            lpips_weights: None,
            lpips_crop: 0,
            lpips_every: 1,
        }
    }
}

/// What the rendered flow is, see [`crate::scene::FlowModel`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FlowChoice {
    /// The displacement where a camera moves, whose flow the priors hold too; the velocity elsewhere.
    #[default]
    Auto,
    /// The projected velocity (paper).
    Velocity,
    /// The displacement, by the camera's motion too.
    Displacement,
}
