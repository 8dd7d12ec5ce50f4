//! Events that are due after a step, and those that a run of another length has missed.

use crate::internals::train::cameras::{offsets_judged_at, poses_are_missed, poses_judged_at};
use crate::internals::train::{Average, Config, Due, DueEvents, PoseKind, review_due};

impl DueEvents {
    /// Without density control, which is the trainer's.
    pub(super) fn after(config: &Config, step: u64, total: u64) -> Self {
        let due = review_due(config, step, total);
        DueEvents {
            density: false,
            grids: due == Some(Due::Grids),
            review: due == Some(Due::Gaussians),
            offsets: step > 0 && step == offsets_judged_at(config, total),
            poses: config.poses == PoseKind::Auto && step > 0 && step == poses_judged_at(config, total),
            average: Average::is_due(config, step, total),
        }
    }

    /// The events that are due when a run of `before` steps goes on after step `step` as one of `total`: those that such
    /// a run would have had by now, and this one has not.
    pub(super) fn extended(self, config: &Config, step: u64, before: u64, total: u64) -> Self {
        let n = |due: Due, total: u64| (1..=step).filter(|step| review_due(config, *step, total) == Some(due)).count();
        // One that is due has not been.
        let is_missed = |due, is_due| step < total && n(due, before) < n(due, total) + usize::from(is_due);
        DueEvents {
            grids: is_missed(Due::Grids, self.grids),
            review: is_missed(Due::Gaussians, self.review),
            offsets: self.offsets
                || (offsets_judged_at(config, total) <= step && step < offsets_judged_at(config, before)),
            poses: self.poses || (config.poses == PoseKind::Auto && poses_are_missed(config, step, before, total)),
            // The end is no longer near.
            average: false,
            density: self.density,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::DueEvents;
    use crate::internals::train::config::{Config, Density, Required, Strategy};

    /// The steps of `total` after which each event is due: grids, review, offsets, poses.
    fn looks(density: Density, total: u64) -> [Vec<u64>; 4] {
        let required = Required { reviews: 2, grids_at: 0.3 };
        let config = Config { density, required, ..Config::default() };
        let due = |is_due: fn(&DueEvents) -> bool| {
            (0..=total).filter(|step| is_due(&DueEvents::after(&config, *step, total))).collect()
        };
        [due(|after| after.grids), due(|after| after.review), due(|after| after.offsets), due(|after| after.poses)]
    }

    #[test]
    fn no_look_falls_into_the_dip_after_a_reset_of_the_opacities() {
        let resets = |reset_every: u64| Density { reset_every, ..Density::default() };
        let undisturbed = [vec![60], vec![120, 160], vec![100], vec![60]];
        assert_eq!(looks(resets(0), 200), undisturbed);
        // One, after step 60: up to step 80 the scene recovers.
        assert_eq!(looks(resets(60), 200), [vec![81], vec![120, 160], vec![100], vec![81]]);
        assert_eq!(looks(resets(99), 200), [vec![60], vec![133, 160], vec![133], vec![60]]);
        assert_eq!(looks(Density { strategy: Strategy::Mcmc, ..resets(60) }, 200), undisturbed);
        assert_eq!(looks(resets(59), 120), [vec![36], vec![79, 96], vec![79], vec![36]]);
        // As they come by default.
        assert_eq!(looks(resets(3000), 10_000), [vec![4001], vec![6000, 8000], vec![5000], vec![4001]]);
        // The run ends before the scene has recovered from the last one.
        assert_eq!(looks(Density { stop: 1.0, ..resets(60) }, 75)[1], [45, 60]);
    }

    #[test]
    fn a_run_of_another_length_owes_what_has_come_by_the_put_off_steps() {
        let config = Config { density: Density { reset_every: 59, ..Density::default() }, ..Config::default() };
        let owes =
            |step: u64, lengths: [u64; 2]| DueEvents::default().extended(&config, step, lengths[0], lengths[1]).offsets;
        // Due after step 79 of 120, and after step 50 of 100.
        assert_eq!([60, 78, 79].map(|step| owes(step, [120, 100])), [true, true, false]);
        assert_eq!([60, 78, 79].map(|step| owes(step, [200, 120])), [false, false, true]);
    }
}
