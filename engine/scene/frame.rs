//! A rendered view on the host (SPEC 3, outputs).

/// Everything one render gives, row-major, top first. None of the sums is normalised by alpha.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Blended colour with the background, `[H][W][3]`.
    pub color: Vec<[f32; 3]>,
    /// 1 - final transmittance, `[H][W]`.
    pub alpha: Vec<f32>,
    /// Sum of weight times camera depth, scene units, `[H][W]`.
    pub depth: Vec<f32>,
    /// Sum of weight over camera depth, 1 / scene units, `[H][W]`.
    pub inverse_depth: Vec<f32>,
    /// Sum of weight times projected velocity, pixels per `flow_dt`, `[H][W][2]`.
    pub flow: Vec<[f32; 2]>,
}
