//! Where the time of a frame or a step goes, against what the device was measured to do; and single kernels, taken out and
//! run again on what they really worked on. And, without running anything, what a driver's compiler makes of the kernels.

mod budget;
mod cards;
mod compare;
mod dump;
mod estimate;
mod exponent;
mod lately;
mod limit;
mod loops;
mod page;
mod passes;
mod probe;
mod replay;
mod roofline;
mod statistics;
mod sweep;
mod sweep_report;
mod trace;
mod waves;

pub use budget::{Budgets, Drift};
pub use cards::{CARDS, Card, Figure};
pub use compare::{Change, Compared, Comparison, Other, Recorded};
pub use dump::{read_dispatch, write_dispatch};
pub use estimate::{Estimate, Part, side_by_side};
pub use exponent::Exponent;
pub use lately::Lately;
pub use limit::{Bound, Peaks};
pub use passes::{Line, Overhead, Profile, Sample};
pub use probe::{Heat, Prepared, Probe, dispatch_ns, dispatches};
pub use replay::{Difference, Replay, Replayed};
pub use statistics::{Static, Statistics};
pub use sweep::{Course, Grows, Point, Sweep, SweepOptions};
pub use trace::{Moment, trace};
pub use waves::Chip;
