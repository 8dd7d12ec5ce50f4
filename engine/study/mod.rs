//! Studies: what finished runs tell, one by one and side by side.

mod ablation;
mod ablation_report;
mod compare;
mod curves;
mod report_picture;
mod run_report;
mod trade;
mod trade_report;

pub use ablation::{Arm, ArmResult, Base, Measure, STUDIES, Study, StudyResult};
pub use compare::{Entry, History, RunGroup, RunResult, RunTable};
pub use report_picture::{Example, strip};
pub use run_report::Report;
pub use trade::{
    Circumstances, Comparison, Effect, KNOB_SETTINGS, KernelError, Kind as TradeKind, Trade, TradeArm, TradeRun,
    trade_arms,
};
