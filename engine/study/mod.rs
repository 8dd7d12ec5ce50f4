//! Studies: what finished runs tell, one by one and side by side.

mod ablation;
mod compare;
mod report_picture;
mod run_report;
mod trade;

pub use ablation::{Arm, ArmResult, Base, Estimate, Measure, STUDIES, Study, StudyResult};
pub use compare::{Entry, History, RunGroup, RunResult, RunTable};
pub use report_picture::{Example, strip};
pub use run_report::Report;
pub use trade::{
    Circumstances, Comparison, KNOB_SETTINGS, KernelError, Kind as TradeKind, Spread, Trade, TradeArm, TradeRun,
    Verdict, is_equivalent, trade_arms,
};
