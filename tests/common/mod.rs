//! What several test folders share.

pub mod golden;
pub mod random;
