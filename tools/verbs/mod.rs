//! The verbs of the command line, one file or folder each.

pub mod bench;
pub mod check;
pub mod debug;
pub mod devices;
pub mod eval;
pub mod export;
pub mod inspect;
pub mod prepare;
pub mod profile;
pub mod render;
pub mod segments;
pub mod serve;
pub mod sound;
pub mod synth;
pub mod train;
