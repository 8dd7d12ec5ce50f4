//! Reports of finished runs, one by one and side by side, and the studies of `ivv bench`.

mod bench;
mod curves;
mod measure;
mod plan;
mod report_picture;
mod run_report;
mod runs;

pub use bench::{Bench, BenchRun, RunOf};
pub use measure::Measure;
pub use plan::{Arm, Base, Study};
pub use report_picture::{Example, strip};
pub use run_report::Report;
pub use runs::{Entry, History, RunResult, differences};
