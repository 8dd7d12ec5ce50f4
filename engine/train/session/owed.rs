//! What is due after a step, and what a run of another length owes.

use crate::train::average::Average;
use crate::train::cameras::{offsets_judged_at, poses_are_missed, poses_judged_at};
use crate::train::checkpoint::Owed;
use crate::train::config::{Config, PoseKind};
use crate::train::require::{Due, review_due};

impl Owed {
    /// After step `step` of `total`, beside density control, which the trainer sees to. Time offsets that the images do not tell are
    /// frozen once the scene has formed.
    pub(super) fn after(config: &Config, step: u64, total: u64) -> Self {
        let due = review_due(config, step, total);
        Owed {
            density: false,
            grids: due == Some(Due::Grids),
            review: due == Some(Due::Gaussians),
            offsets: step > 0 && step == offsets_judged_at(total),
            poses: config.poses == PoseKind::Auto && step > 0 && step == poses_judged_at(total),
            average: Average::is_due(config, step, total),
        }
    }

    /// Of a run of `before` steps that after step `step` goes on as one of `total`: what would have come by now in a run of that length,
    /// and has not.
    pub(super) fn extended(self, config: &Config, step: u64, [before, total]: [u64; 2]) -> Self {
        let n = |due: Due, total: u64| (1..=step).filter(|step| review_due(config, *step, total) == Some(due)).count();
        // One that is owed has not been.
        let is_missed = |due, is_owed| step < total && n(due, before) < n(due, total) + usize::from(is_owed);
        Owed {
            grids: is_missed(Due::Grids, self.grids),
            review: is_missed(Due::Gaussians, self.review),
            offsets: self.offsets || (offsets_judged_at(total) <= step && step < offsets_judged_at(before)),
            poses: self.poses || (config.poses == PoseKind::Auto && poses_are_missed(step, before, total)),
            // What was near the end is so no more.
            average: false,
            density: self.density,
        }
    }
}
