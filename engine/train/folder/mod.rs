//! The folder of a run, and that of a clip in segments.

mod fingerprints;
mod lock;
mod log;
mod run;
mod segments;

pub use fingerprints::{Changes, Fingerprint, Fingerprints};
pub use lock::RunLock;
pub use log::{Kind, Log};
pub use run::{CaptureSummary, Run};
pub use segments::{Joined, Segments};
