//! What several test folders share.

pub mod device;
pub mod golden;
pub mod random;
