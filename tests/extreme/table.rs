//! The table, and what happens to each case. N1 is in `poison`, N8 to N10, N26 and N28 are in `tests/render`.

use super::{exposure, places, shapes, times, worlds};
use crate::common::frames::{Tolerance, compare, render_with};
use ivv::Constants;
use ivv::scene::{Frame, Splats, View};
use ivv::stage::FrameReport;
use ivv::twin::render_f64;

/// A scene, a view, and what to expect.
pub struct Case {
    pub name: String,
    pub splats: Splats,
    pub view: View,
    pub constants: Constants,
    /// What the truth is made from, where it is not the scene itself.
    pub truth: Option<Splats>,
    pub tolerance: Tolerance,
    /// Gaussians that must be counted as bad.
    pub n_bad: u64,
    /// Whether the truth must show something.
    pub seen: bool,
    /// Whatever else must hold.
    pub check: Check,
}

/// A check of its own on a frame.
pub type Check = Box<dyn Fn(&Frame, &FrameReport) -> Result<(), String>>;

impl Case {
    /// A case that must look like the truth, with the default constants and tolerance.
    pub fn new(name: impl Into<String>, splats: Splats, view: View) -> Case {
        Case {
            name: name.into(),
            splats,
            view,
            constants: Constants::default(),
            truth: None,
            tolerance: Tolerance::default(),
            n_bad: 0,
            seen: true,
            check: Box::new(|_, _| Ok(())),
        }
    }

    fn run(&self) -> Result<(), String> {
        let (frame, report) = render_with(&self.splats, &self.view, self.constants);
        let truth = render_f64(self.truth.as_ref().unwrap_or(&self.splats), &self.view, &self.constants);
        let seen = truth.alpha.iter().any(|alpha| *alpha > 0.0);
        if seen != self.seen {
            return Err(format!("the truth shows {}", if seen { "something" } else { "nothing" }));
        }
        if report.bad_gaussians != self.n_bad {
            return Err(format!("{} bad Gaussians, not {}", report.bad_gaussians, self.n_bad));
        }
        compare(&frame, &truth, &self.tolerance)?;
        (self.check)(&frame, &report)
    }
}

/// Runs all of a row's cases and reports every one that fails.
pub fn run(row: &str, cases: Vec<Case>) {
    assert!(!cases.is_empty());
    let faults: Vec<String> =
        cases.iter().filter_map(|case| case.run().err().map(|fault| format!("{}: {fault}", case.name))).collect();
    assert!(faults.is_empty(), "{row}: {} of {} cases fail\n{}", faults.len(), cases.len(), faults.join("\n"));
}

/// Each row is a test of that name, made of the cases that the function gives.
macro_rules! table {
    ($($row:ident: $cases:path,)*) => {
        $(
            #[test]
            fn $row() {
                run(stringify!($row), $cases());
            }
        )*
    };
}

table! {
    n02_log_scales_from_minus_30_to_40: shapes::scales,
    n03_needles_of_any_length: shapes::needles,
    n04_quaternions_of_any_length: shapes::quaternions,
    n05_depths_from_the_near_plane_to_a_million: places::depths,
    n06_centres_on_borders_and_far_outside: places::centres,
    n07_opacities_at_the_thresholds: exposure::opacities,
    n11_times_of_any_distance: times::distances,
    n12_time_scales_from_1e_8_to_infinity: times::time_scales,
    n13_clips_far_from_time_zero: times::origins,
    n14_velocities_from_zero_to_a_thousand: times::velocities,
    n15_worlds_far_from_the_origin: worlds::offsets,
    n16_worlds_of_any_scale: worlds::sizes,
    n17_fields_of_view_from_1_to_179_degrees: places::fields_of_view,
    n18_images_of_any_size: places::image_sizes,
    n19_colours_of_any_degree_below_0_and_above_1: exposure::colors,
}
