//! All tests of the engine in one binary: one link, one Vulkan device.
mod capture;
mod common;
mod extreme;
mod faults;
mod fuzz;
mod grad;
mod kernel;
mod prepare;
mod profile;
mod render;
mod repo;
mod scene;
mod sound;
mod synth;
mod train;
mod twin;
mod video;
