//! Where the time of a frame or a step goes, against what the device was measured to do; and single kernels, taken out and
//! run again on what they really worked on.

mod capture;
mod compare;
mod lately;
mod limit;
mod lines;
mod page;
mod probe;
mod replay;
mod roofline;
mod statistics;
mod trace;

pub use capture::{read_dispatch, write_dispatch};
pub use compare::{Compared, Comparison, Other, Recorded, Verdict};
pub use lately::Lately;
pub use limit::{Bound, Peaks};
pub use lines::{Line, Overhead, Profile, Sample};
pub use probe::{Prepared, Probe, dispatch_ns, dispatches};
pub use replay::{Difference, Replay, Replayed};
pub use statistics::{Ratio, mad, median, paired_ratio, quantile};
pub use trace::{Moment, trace};

impl Profile {
    /// The page: one HTML file that needs nothing else.
    pub fn html(&self) -> String {
        page::html(self)
    }

    /// The roofline, SVG.
    pub fn roofline(&self) -> String {
        roofline::svg(self)
    }

    /// The tables for a terminal, passes that take most time first.
    pub fn terminal(&self) -> String {
        page::terminal(self)
    }

    /// Peaks, counters and passes as Markdown.
    pub fn markdown(&self) -> String {
        page::markdown(self)
    }
}
