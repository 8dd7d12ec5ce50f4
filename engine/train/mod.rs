//! Training: Gaussians fitted to the images of a capture, one image a step (SPEC 4 and 6).

mod align;
mod average;
mod backdrop;
mod base;
mod cameras;
mod checkpoint;
mod config;
mod density;
mod depth_cache;
mod depth_fit;
mod depth_line;
mod fall;
mod fingerprints;
mod flicker;
mod images;
mod init;
mod judge;
mod lenses;
mod lock;
mod log;
mod metrics;
mod objective;
mod offsets;
mod pinhole;
mod plan;
mod poses;
mod preset;
mod ranks;
mod require;
mod run;
mod schedule;
mod segments;
mod session;
mod settings_check;
mod setup;
mod terms;
mod trainer;

pub use align::ColorMap;
pub use average::Average;
pub use base::Base;
pub use checkpoint::{CameraState, Checkpoint, Owed, StepRoom};
pub use config::{
    Config, Density, GridKind, Init, LearningRates, Loss, Pace, PoseKind, PresetId, Rate, Required, Resolution, Round,
    Strategy, all_settings,
};
pub use density::{density_round, noise, regularisers};
pub use depth_fit::{DepthFits, DepthSummary, fit_depths};
pub use depth_line::{DepthFit, Unfit};
pub use fall::Fall;
pub use fingerprints::{Changes, Fingerprint, Fingerprints};
pub use init::{Initial, PointCounts, from_points, initialise, random_points};
pub use lock::RunLock;
pub use log::{Kind, Log};
pub use metrics::{
    Evaluation, METRICS_OF, Meter, SceneScores, SceneSize, Scores, Sight, ViewScores, evaluate, psnr, spread,
};
pub use offsets::{Agreement, OffsetFit, fit_offset, learnt_offsets, offset_pictures};
pub use plan::{BoundBy, Class, ImageMemory, Limits, Need, Plan, Workload};
pub use poses::Correction;
pub use preset::{PRESETS, Preset, merge};
pub use ranks::{Ranks, Shared, any};
pub use require::{Due, Evidence, GridCheck, Review, Seen, merge_resting, review, review_due};
pub use run::{CaptureSummary, Run};
pub use schedule::rates;
pub use segments::{Joined, Segments};
pub use session::{Event, Notice, Phase, Priors, Session, SessionOptions, Watch, reduced_order, training_order};
pub use settings_check::{check_name, check_settings, default_of};
pub use setup::Setup;
pub use terms::{Logged, TermData, logged};
pub use trainer::{ProfiledStep, StepReport, Trainer};
