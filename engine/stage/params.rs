//! The parameters of a picture, and its view as the kernels see it: computed in f64, narrowed once.

use crate::gpu::generated::ViewParams;
pub use crate::gpu::generated::constants::types::TILE;
use crate::gpu::generated::constants::types::{
    DEPTH_SHIFT_16, DEPTH_SHIFT_24, EVERY_BLOCK, FLOW_DISPLACEMENT, FLOW_VELOCITY, TILES_ELLIPSE, TILES_RECTANGLE,
    TILES_SQUARE,
};
use crate::scene::{FlowModel, Intrinsics, Pose, View};
use crate::settings::{Constants, Knobs, TileBound};
use crate::vk::DeviceKind;

pub(super) const TILE_PIXELS: u32 = TILE * TILE;

/// The outputs that a picture needs; the rest is neither computed nor read back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outputs {
    /// Colour and alpha.
    Color,
    /// Colour, alpha, depth, inverse depth and flow.
    All,
}

/// The nearest near plane that goes with short depth keys, scene units: those of 24 bits tell depths apart up to 2^32 times as far
/// (`depth_key` of `project.comp`), which lets them reach 1e5 units.
const NEAREST_OF_SHORT_KEYS: f32 = 1e5 / 4_294_967_296.0;

/// `constants` with these `knobs`, and with what they leave to the device. Depth keys have 24 bits on a GPU, which spares a round of
/// their sort, but all on a CPU driver and where the near plane is so near that 24 do not reach far.
pub fn constants_on(kind: DeviceKind, knobs: Knobs, constants: Constants) -> Constants {
    let short_ones_reach = constants.near >= NEAREST_OF_SHORT_KEYS;
    let of_device = if kind == DeviceKind::Cpu || !short_ones_reach { u32::BITS } else { 24 };
    let depth_bits = if knobs.depth_bits == 0 { of_device } else { knobs.depth_bits };
    if depth_bits < u32::BITS && !short_ones_reach {
        tracing::warn!(
            "depth keys of {depth_bits} bits do not reach far with a near plane of {:e}: what is behind may cover what is \
             in front; use 32 bits, or a near plane of at least {NEAREST_OF_SHORT_KEYS:e}",
            constants.near
        );
    }
    Knobs { depth_bits, ..knobs }.on(constants)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A picture, without a backward pass.
    Picture,
    /// A picture and its gradients: every pixel keeps its final transmittance and last entry.
    Gradient,
    Training,
}

/// A horizontal band of a picture, whole tile rows high. Every pixel's value is independent of the strips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strip {
    /// First pixel row, a multiple of `TILE`.
    pub first_row: u32,
    pub n_rows: u32,
}

impl Strip {
    pub fn whole(view: &View) -> Self {
        Strip { first_row: 0, n_rows: view.intrinsics.height }
    }

    pub fn tiles(&self, view: &View) -> (u32, u32) {
        (view.intrinsics.width.div_ceil(TILE), self.n_rows.div_ceil(TILE))
    }
}

pub(super) fn moment(view: &View) -> f64 {
    view.time + view.time_offset * view.flow_dt
}

/// Parameters of `strip` of `view` for a scene whose positions were shifted by `-origin`.
pub fn view_params(view: &View, constants: &Constants, origin: [f64; 3], strip: Strip) -> ViewParams {
    let rows = |pose: &Pose| -> [[f32; 4]; 3] {
        let (m, center) = (pose.rows(), pose.center());
        std::array::from_fn(|r| [m[r][0] as f32, m[r][1] as f32, m[r][2] as f32, (center[r] - origin[r]) as f32])
    };
    let [row0, row1, row2] = rows(&view.pose);
    let [next0, next1, next2] = rows(view.next_pose.as_ref().unwrap_or(&view.pose));
    // SPEC 3: the Jacobian follows the centre up to 30 % of half the field of view beyond the picture's edge.
    let clamp = |f: f64, c: f64, size: f64| {
        let half = size / (2.0 * f);
        (-(c / f + 0.3 * half), (size - c) / f + 0.3 * half)
    };
    let Intrinsics { fx, fy, cx, cy, width, height, .. } = view.intrinsics;
    let (u_low, u_high) = clamp(fx, cx, f64::from(width));
    let (v_low, v_high) = clamp(fy, cy, f64::from(height));
    let (tiles_x, tiles_y) = strip.tiles(view);
    let [r, g, b] = view.background;
    let knobs = &constants.knobs;
    let tiles = match knobs.culls.tile_bound {
        TileBound::Ellipse => TILES_ELLIPSE,
        TileBound::Rectangle => TILES_RECTANGLE,
        TileBound::Square => TILES_SQUARE,
    };
    let bounds = if knobs.culls.block_cull { tiles } else { tiles | EVERY_BLOCK };
    ViewParams {
        row0,
        row1,
        row2,
        intrinsics: [fx, fy, cx, cy].map(|x| x as f32),
        clamp_uv: [u_low, u_high, v_low, v_high].map(|x| x as f32),
        background: [r, g, b, view.flow_dt as f32],
        next0,
        next1,
        next2,
        time: moment(view) as f32,
        near: constants.near,
        blur: constants.blur,
        alpha_min: constants.alpha_min,
        alpha_max: constants.alpha_max,
        t_min: constants.t_min,
        width,
        height,
        first_row: strip.first_row,
        n_rows: strip.n_rows,
        tiles_x,
        tiles_y,
        flow_model: match view.flow_model {
            FlowModel::Velocity => FLOW_VELOCITY,
            FlowModel::Displacement => FLOW_DISPLACEMENT,
        },
        depth_to_alpha: 1.0,
        bounds,
        depth_shift: match knobs.depth_bits {
            24 => DEPTH_SHIFT_24,
            16 => DEPTH_SHIFT_16,
            _ => 0,
        },
        t_cut: knobs.t_cut,
        unused0: 0.0,
        unused1: 0.0,
        unused2: 0.0,
    }
}
