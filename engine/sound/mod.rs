//! The sound field: from a microphone's recording and the places of sources to what a head hears on its way.
//!
//! What it does, its formats, its limits and its measured trade of speed for accuracy: `engine/sound/README.md`.

pub mod align;
pub mod ambix;
pub mod bench;
pub mod fir;
pub mod geometry;
pub mod hrtf;
pub mod hull;
pub mod loudness;
pub mod metrics;
pub mod pose;
pub mod render;
mod sadie;
pub mod scene_file;
pub mod simulate;
pub mod sinc;
mod sofa;
pub mod source_track;
pub mod spectrum;
pub mod sphere;
pub mod wav;
pub mod wola;

/// Samples per second of everything inside the sound field.
pub const FS: u32 = 48_000;
