//! What several test folders share.

pub mod device;
pub mod frames;
pub mod golden;
pub mod stages;

pub use ivv::extremes::{one, random};
