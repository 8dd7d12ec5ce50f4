//! ivv: immersive volumetric video. Dynamic scenes as spatio-temporal 3D Gaussians, rendered in Vulkan compute.
//!
//! The map of the engine is `engine/ARCHITECTURE.md`. A picture takes four steps:
//! read a [`scene::Splats`] and [`scene::View`]s, open a [`gpu::Gpu`], upload with [`stage::Renderer::new`],
//! and call [`stage::Renderer::render`]. A training is a [`train::Session`] on a [`scene::capture::Capture`]. Both, and how a
//! kernel is timed, are in `tools/examples`, in some thirty lines each.
#![deny(unsafe_code)]
#![warn(missing_docs)]

pub mod error;
pub mod extremes;
pub mod files;
pub mod formats;
pub mod gpu;
pub mod parallel;
pub mod prepare;
pub mod profile;
pub mod random;
#[doc(hidden)]
#[allow(missing_docs)]
pub mod report;
pub mod scene;
pub mod settings;
pub mod sound;
pub mod stage;
pub mod study;
pub mod synth;
pub mod train;
pub mod twin;
pub mod video;
pub mod vk;
pub mod words;

pub use error::{Error, Result};
pub use settings::{Constants, Culls, Knobs, TileBound};
