//! Code that verbs share: scenes, captures and training runs.

pub mod appearance;
pub mod background;
pub mod camera_poses;
pub mod capture;
pub mod clip;
pub mod constants;
pub mod device;
pub mod export_clip;
pub mod files;
#[cfg(feature = "mpi")]
mod mpi;
pub mod overwrite;
pub mod player;
pub mod ranks;
pub mod rescue;
pub mod review;
pub mod schedule;
pub mod scoring;
pub mod settings;
pub mod source;
pub mod subprocess;
pub mod time_offsets;
pub mod totals;
pub mod views;
pub mod workload;
