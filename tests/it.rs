//! All tests of the engine in one binary: one link, one Vulkan device.
mod common;
mod kernel;
mod render;
mod scene;
mod synth;
mod twin;
