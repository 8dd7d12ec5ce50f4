//! Stages of several kernels each, and the renderer that strings them together. A stage owns its scratch buffers and
//! appends passes to a recording; none of them waits for the device.

mod adam;
mod backward;
mod bilateral;
mod blend;
mod clock;
mod counters;
mod cull;
mod density;
mod fisher;
mod gradients;
mod losses;
mod lpips;
mod lpips_trunk;
mod pairs;
mod params;
mod priors;
mod project;
mod render;
mod scan;
mod scene;
mod sort;
mod tiles;
mod workspace;

pub use adam::{AdamMode, BETA1, BETA2, EPS, Optimiser, Rates, State, StepSettings, adam_params, lazy_sums};
pub use backward::{Accumulation, Backward, SLOT_PAIRS, Target};
pub use bilateral::{GRID_BYTES, GRID_NUMBERS, GRID_SIZE, GridState, GridStep, Grids};
pub use blend::{Blend, Outputs, Purpose};
pub use clock::{ClockStep, Clocks, OFFSET_BOUND};
pub use counters::{Counters, PassReport, add_passes};
pub use cull::Cull;
pub use density::{Choice, Counts, DensityRound, Grown, record_mcmc_noise};
pub use fisher::{Census, Response};
pub use gradients::Gradients;
pub use losses::{Photometric, SSIM_WEIGHT, Structure};
pub use lpips::{Compared, Cotangent, Lpips};
pub use lpips_trunk::Trunk;
pub use params::{Strip, view_params};
pub use priors::{DepthSpace, PriorLoss, PriorWeights};
pub use project::Projected;
pub use render::{FrameReport, Renderer};
pub use scan::Scan;
pub use scene::{Group, Planes, SceneBuffers, group_limit};
pub use sort::{Sort, SortGrids};
pub use tiles::{Lists, Tiles};
pub use workspace::{Room, Verdict, Workspace};
