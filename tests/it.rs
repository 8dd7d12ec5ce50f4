//! All tests of the engine in one binary: one link, one Vulkan device.
mod scene;
