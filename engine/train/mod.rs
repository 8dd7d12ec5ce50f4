//! Training: Gaussians fitted to the images of a capture, one image a step (SPEC 4 and 6).

mod checkpoint;
mod config;
mod density;
mod init;
mod metrics;
mod plan;
mod random;
mod schedule;
mod trainer;

pub use checkpoint::Checkpoint;
pub use config::{Config, Density, Init};
pub use init::{Initial, from_points, initialise, random_points};
pub use metrics::{Scores, psnr, scores};
pub use plan::{BoundBy, Class, INTERSECTIONS_PER_GAUSSIAN, Limits, Need, Plan, Workload};
pub use random::{Random, permutation};
pub use schedule::{Rates, rates};
pub use trainer::{StepReport, Trainer};
