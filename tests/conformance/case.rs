//! A scene and a view beside what the reference makes of them.

use super::prelude::*;
use ivv::internals::stage::FrameReport;

pub(super) struct Case<'a> {
    pub name: String,
    pub splats: Splats,
    pub view: View,
    pub constants: Constants,
    /// The scene of the truth, where it is another.
    pub truth: Option<Splats>,
    pub tolerance: Tolerance,
    /// Gaussians that must be counted as bad.
    pub n_bad: u64,
    pub check: Check<'a>,
}

type Check<'a> = Box<dyn Fn(&Frame, &FrameReport) -> Result<()> + 'a>;

impl<'a> Case<'a> {
    /// It must look like the truth, with the default constants and tolerance.
    pub fn new(name: impl Into<String>, splats: Splats, view: View) -> Case<'a> {
        Case {
            name: name.into(),
            splats,
            view,
            constants: Constants::default(),
            truth: None,
            tolerance: Tolerance::default(),
            n_bad: 0,
            check: Box::new(|_, _| Ok(())),
        }
    }

    pub fn tolerance(self, tolerance: Tolerance) -> Self {
        Case { tolerance, ..self }
    }

    /// Adds a check of the frame.
    pub fn check(self, check: impl Fn(&Frame, &FrameReport) -> Result<()> + 'a) -> Self {
        Case { check: Box::new(check), ..self }
    }

    pub fn run(self, bench: &Bench, tally: &mut Tally) {
        tally.case(&self.name, |tally| {
            let (frame, report) = bench.render_with(&self.splats, &self.view, self.constants)?;
            let truth = render_f64(self.truth.as_ref().unwrap_or(&self.splats), &self.view, &self.constants);
            ensure!(truth.alpha.iter().any(|alpha| *alpha > 0.0), "the truth shows nothing");
            ensure!(report.bad_gaussians == self.n_bad, "{} bad Gaussians, not {}", report.bad_gaussians, self.n_bad);
            tally.frame(&frame, &truth, &self.tolerance)?;
            (self.check)(&frame, &report)
        });
    }
}
