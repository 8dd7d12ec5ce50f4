//! What several test folders share.

pub mod device;
pub mod frames;
pub mod golden;
pub mod stages;

/// Where tests that write thousands of files do so: in memory, where there is such a place.
pub fn quick_folder() -> std::path::PathBuf {
    let memory = std::path::PathBuf::from("/dev/shm");
    if memory.is_dir() { memory } else { std::env::temp_dir() }
}

pub use ivv::extremes::{one, random};
