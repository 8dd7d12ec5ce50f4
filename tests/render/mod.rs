//! Whole frames on the device.

mod clip;
mod golden;
mod invariants;
mod knobs;
mod large;
mod parts;
mod stereo;
