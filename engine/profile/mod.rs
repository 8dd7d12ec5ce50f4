//! Where the time of a frame or a step goes, against what the device was measured to do; and single kernels, taken out and
//! run again on what they really worked on.

mod cards;
mod compare;
mod dump;
mod exponent;
mod lately;
mod limit;
mod page;
mod passes;
mod probe;
mod replay;
mod roofline;
mod sweep;
mod sweep_report;
mod trace;

pub use cards::{CARDS, Card, Figure};
pub use compare::{Change, Compared, Comparison, Other, Recorded};
pub use dump::{read_dispatch, write_dispatch};
pub use exponent::Exponent;
pub use lately::FrameTimes;
pub use limit::{Bound, Peaks};
pub use passes::{Line, Overhead, Profile, Sample};
pub use probe::{Prepared, Probe, WarmUp, dispatch_ns, dispatches};
pub use replay::{Difference, Replay, Replayed};
pub use sweep::{Course, Grows, Point, Sweep, SweepOptions};
pub use trace::{Moment, trace};
