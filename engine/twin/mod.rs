//! Float64 truth and exact twins of the integer kernels, on the CPU. No SIMD, no threads, no cleverness.
//!
//! Written to be read beside SPEC 3. The float parts are written once over [`Real`]: `f64` is the truth, `f32` shows
//! what the same formula loses on the device, [`Dual`] gives exact directional derivatives.

mod adam;
mod bilateral;
mod blend;
mod clock;
mod cull;
mod density;
mod dual;
mod fisher;
mod input;
mod jvp;
mod lpips;
mod math;
mod prior;
mod probe;
mod project;
mod real;
mod scan;
mod sh;
mod show;
mod sort;
mod ssim;
mod tiles;

pub use adam::{Adam, rounded_moment};
pub use bilateral::{BilateralGrid, centred};
pub use blend::{Outputs, render, render_f64};
pub use clock::{Clock, ClockRule, clock_step};
pub use cull::visible;
pub use density::{Density, Descendant, Descent, Kind, normals, random_bits, shared_opacity};
pub use dual::Dual;
pub use fisher::responses;
pub use input::{Camera, Gaussian, Params, Rules, Temporal};
pub use jvp::{Tangent, jvp, jvp_of};
pub use lpips::lpips;
pub use prior::{depth_loss, flow_loss};
pub use probe::{exp2_solution, fma_sum, scattered_rows, turned_lane};
pub use project::{Footprint, Projected, footprint, power, project};
pub use real::Real;
pub use scan::{Scan, exclusive_scan};
pub use sh::{basis, color, half_value};
pub use show::{laid_over, shown};
pub use sort::{DIGITS, block_histograms, float_key, radix_sort};
pub use ssim::{Photometry, photometric, ssim_map};
pub use tiles::{TILE, columns, ranges, row_span, tiles, tiles_truth};
