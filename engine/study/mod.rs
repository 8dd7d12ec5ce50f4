//! Studies: what finished runs tell, one by one and side by side.

mod ablation;
mod ablation_report;
mod compare;
mod curves;
mod frontier;
mod quality;
mod report_picture;
mod run_report;
mod studies;
mod trade;
mod trade_report;

pub use ablation::{Arm, ArmResult, Base, Measure, Study, StudyResult};
pub use compare::{Entry, History, RunGroup, RunResult, RunTable};
pub use frontier::{Frontier, PresetCurve, Reached, chart};
pub use quality::{Standing, standings};
pub use report_picture::{Example, strip};
pub use run_report::Report;
pub use studies::STUDIES;
pub use trade::{
    Circumstances, Comparison, Effect, KNOB_SETTINGS, KernelError, Kind as TradeKind, Trade, TradeArm, TradeRun,
    trade_arms,
};
