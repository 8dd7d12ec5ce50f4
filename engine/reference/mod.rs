//! Float64 truth and exact references of the integer kernels, on the CPU. No SIMD, no threads, no cleverness.
//!
//! Written to be read beside SPEC 3. The float parts are written once over [`Real`]: `f64` is the truth, `f32` shows
//! what the same formula loses on the device, [`Dual`] gives exact directional derivatives.

mod adam;
mod batch;
mod bilateral;
mod blend;
mod clearing;
mod clock;
mod cull;
mod density;
mod dual;
mod fisher;
mod input;
mod jvp;
mod lpips;
mod math;
mod pose;
mod prior;
mod probe;
mod project;
mod pull;
mod real;
mod scan;
mod sh;
mod show;
mod sort;
mod ssim;
mod tiles;

pub use adam::*;
pub use batch::*;
pub use bilateral::*;
pub use blend::*;
pub use clearing::*;
pub use clock::*;
pub use cull::*;
pub use density::*;
pub use dual::*;
pub use fisher::*;
pub use input::*;
pub use jvp::*;
pub use lpips::*;
pub use pose::*;
pub use prior::*;
pub use probe::*;
pub use project::*;
pub use pull::*;
pub use real::*;
pub use scan::*;
pub use sh::*;
pub use show::*;
pub use sort::*;
pub use ssim::*;
pub use tiles::*;
