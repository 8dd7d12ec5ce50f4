//! Training: Gaussians fitted to the images of a capture, one image a step (SPEC 4 and 6).

mod align;
mod checkpoint;
mod config;
mod density;
mod init;
mod log;
mod metrics;
mod plan;
mod random;
mod report;
mod report_picture;
mod report_plot;
mod run;
mod schedule;
mod trainer;

pub use align::ColorMap;
pub use checkpoint::Checkpoint;
pub use config::{Config, Density, Init, LearningRates, Rate, Strategy};
pub use density::{density_round, noise, regularisers};
pub use init::{Initial, from_points, initialise, random_points};
pub use log::{Kind, Log};
pub use metrics::{Evaluation, METRICS, METRICS_OF, SceneScores, Scores, ViewScores, evaluate, psnr, scores, spread};
pub use plan::{BoundBy, Class, INTERSECTIONS_PER_GAUSSIAN, Limits, Need, Plan, Workload};
pub use random::{Random, permutation};
pub use report::{Example, Report};
pub use run::{CaptureSummary, Run};
pub use schedule::rates;
pub use trainer::{StepReport, Trainer};
