//! What several test folders share.

pub mod device;
pub mod frames;
pub mod golden;
pub mod one;
pub mod random;
pub mod stages;
