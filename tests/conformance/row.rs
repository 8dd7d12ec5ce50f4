//! A row of the table, where it runs, and what comes of it.

use super::frames::{Compared, Tolerance, compare};
use anyhow::{Result, ensure};
use ivv::Constants;
use ivv::internals::gpu::Gpu;
use ivv::internals::reference::Outputs as Truth;
use ivv::internals::scene::{Frame, Splats, View};
use ivv::internals::stage::{FrameReport, Gradients, Outputs, Renderer};
use std::fmt::Display;
use std::ops::Deref;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

pub type Lent<'a> = Box<dyn Deref<Target = Arc<Gpu>> + 'a>;

pub struct Bench<'a> {
    /// Gives the device. Cases take it for as short as they can: another thread may have it while this one works out the
    /// truth.
    pub lend: &'a dyn Fn() -> Lent<'a>,
    /// True if cases run that take minutes on a CPU.
    pub slow: bool,
}

impl Bench<'_> {
    pub fn gpu(&self) -> Lent<'_> {
        (self.lend)()
    }

    /// All outputs, by a fresh renderer with the default constants.
    pub fn render(&self, splats: &Splats, view: &View) -> ivv::Result<(Frame, FrameReport)> {
        self.render_with(splats, view, Constants::default())
    }

    pub fn render_with(&self, splats: &Splats, view: &View, constants: Constants) -> ivv::Result<(Frame, FrameReport)> {
        let gpu = self.gpu();
        Renderer::new(Arc::clone(&gpu), splats, constants)?.render(view, Outputs::All)
    }

    /// Gradients of the sum of `cotangents` times outputs.
    pub fn vjp(&self, splats: &Splats, view: &View, cotangents: &Frame) -> ivv::Result<(Gradients, FrameReport)> {
        let gpu = self.gpu();
        Renderer::new(Arc::clone(&gpu), splats, Constants::default())?.vjp(view, cotangents)
    }
}

#[derive(Clone, Debug, Default)]
pub struct Tally {
    pub cases: usize,
    /// The error that is nearest to its bound.
    pub worst: Option<Compared>,
    pub faults: Vec<String>,
    pub not_run: Vec<String>,
    case: String,
}

impl Tally {
    /// Runs a case; what it returns as an error is a fault, and the next case runs all the same.
    pub fn case(&mut self, name: impl Display, check: impl FnOnce(&mut Tally) -> Result<()>) {
        self.case = name.to_string();
        self.cases += 1;
        if let Err(fault) = check(self) {
            self.faults.push(format!("{}: {fault:#}", self.case));
        }
    }

    /// Notes an error of the case, which has to be within `bound`. NaN never is.
    pub fn within(&mut self, what: &str, error: f64, bound: f64) -> Result<()> {
        if self.worst.is_none_or(|worst| error * worst.allowed > worst.error * bound) {
            self.worst = Some(Compared { error, allowed: bound });
        }
        ensure!(error <= bound, "{what} is off by {error:.1e}, {bound:.1e} is allowed");
        Ok(())
    }

    pub(super) fn frame(&mut self, frame: &Frame, truth: &Truth<f64>, tolerance: &Tolerance) -> Result<()> {
        let worst = compare(frame, truth, tolerance)?;
        self.within("a frame", worst.error, worst.allowed)
    }

    pub fn leave_out(&mut self, what: impl Display) {
        self.not_run.push(what.to_string());
    }

    pub fn verdict(&self) -> &'static str {
        match (self.faults.is_empty(), self.cases) {
            (false, _) => "FAILED",
            (true, 0) => "not run",
            (true, _) => "passed",
        }
    }
}

#[derive(Clone, Copy)]
pub struct Row {
    /// `n` and its number, two digits.
    pub name: &'static str,
    pub what: &'static str,
    pub expected: &'static str,
    /// The bounds, and why where they are not the study's.
    pub bound: &'static str,
    /// Runs the cases. An error is a fault of the row as a whole.
    pub(super) cases: fn(&Bench, &mut Tally) -> Result<()>,
}

impl Row {
    /// Runs the row's cases. A panic, an error of the device and a message of the validation layer are faults like any
    /// other.
    pub fn run(&self, bench: &Bench) -> Tally {
        let mut tally = Tally::default();
        let spoken = |bench: &Bench| bench.gpu().device().validation().messages();
        let before = spoken(bench).len();
        let done = catch_unwind(AssertUnwindSafe(|| (self.cases)(bench, &mut tally)));
        match done {
            Ok(Ok(())) => {}
            Ok(Err(fault)) => tally.faults.push(format!("{fault:#}")),
            Err(panic) => {
                let text = panic.downcast_ref::<String>().map(String::as_str);
                let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("of unknown cause");
                tally.faults.push(format!("{}: a panic: {text}", tally.case));
            }
        }
        let messages = spoken(bench).into_iter().skip(before);
        tally.faults.extend(messages.map(|message| format!("the validation layer: {message}")));
        if tally.cases == 0 && tally.not_run.is_empty() && tally.faults.is_empty() {
            tally.faults.push("no case ran".into());
        }
        tally
    }
}
