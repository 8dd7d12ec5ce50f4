//! Depth priors: each image's is fitted to the capture's points.

mod fit;
mod line;

pub use fit::{DepthFits, DepthSummary, fit_depths};
pub use line::{DepthFit, Unfit};
