//! Training: Gaussians fitted to the images of a capture, one image a step (SPEC 4 and 6).

mod average;
mod backdrop;
mod base;
mod cameras;
mod checkpoint;
mod config;
mod density;
mod depth;
mod first;
mod folder;
mod images;
mod lenses;
mod objective;
mod offsets;
mod plan;
mod preset;
mod ranks;
mod require;
mod schedule;
mod scores;
mod session;
mod settings_check;
mod setup;
mod terms;
mod trainer;

pub use crate::recon::{Init, Initial, PointCounts};
pub use average::Average;
pub use base::Base;
pub use cameras::Correction;
pub use checkpoint::{CameraState, Checkpoint, DueEvents, StepCapacity};
pub use config::{
    Config, Density, GridKind, LearningRates, Loss, Pace, PoseKind, PresetId, Rate, Required, Resolution, Round,
    Strategy, all_settings,
};
pub use density::{density_round, noise, regularisers};
pub use depth::{DepthFit, DepthFits, DepthSummary, Unfit, fit_depths};
pub use first::{first_gaussians, from_points, initialise, random_points};
pub use folder::{CaptureSummary, Changes, Fingerprint, Fingerprints, Joined, Kind, Log, Run, RunLock, Segments};
pub use images::{reduced_order, training_order};
pub use offsets::{Agreement, OffsetFit, OffsetImages, fit_offset, learnt_offsets, offset_pictures};
pub use plan::{BoundBy, Class, ImageMemory, Limits, Need, Plan, Workload};
pub use preset::{PRESETS, Preset, merge};
pub use ranks::{Ranks, Shared, any};
pub use require::{Due, Evidence, GridCheck, Review, Seen, merge_resting, review, review_due};
pub use schedule::rates;
pub use scores::{
    Evaluation, Fall, METRICS_OF, Meter, SceneScores, SceneSize, Scores, Sight, ViewScores, evaluate, psnr, spread,
};
pub use session::{Event, Notice, Phase, Priors, Session, SessionOptions, Watch};
pub use settings_check::{check_name, check_settings, default_of};
pub use setup::Setup;
pub use terms::{Logged, TermData, logged};
pub use trainer::{ProfiledStep, StepReport, Trainer};
