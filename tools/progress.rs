//! Progress: one line that rewrites itself on a terminal, a few plain lines otherwise; always on standard error.

use crate::screen;
use ivv::train::StepReport;
use ivv::words::count;
use std::time::{Duration, Instant};

/// Between two lines on a terminal.
const QUICK: Duration = Duration::from_millis(200);
/// Between two lines elsewhere, at least; longer and longer in a long run.
const SLOW: Duration = Duration::from_secs(5);

/// When lines of progress are due.
struct Pace {
    start: Instant,
    last: Option<Instant>,
}

impl Pace {
    fn new() -> Self {
        Pace { start: Instant::now(), last: None }
    }

    /// Whether it is time for a line. Elsewhere than on a terminal that is after a twentieth of the time so far, which makes
    /// some 75 lines of an hour.
    fn is_due(&self) -> bool {
        let since = self.last.unwrap_or(self.start).elapsed();
        match self.last {
            None if screen::is_terminal() => true,
            _ if screen::is_terminal() => since >= QUICK,
            _ => since >= SLOW.max(self.start.elapsed() / 20),
        }
    }

    /// Shows that `done` of `total` is done.
    fn show(&mut self, done: u64, total: u64, text: &str) {
        self.last = Some(Instant::now());
        if screen::is_terminal() {
            screen::bar(done, total, text);
        } else {
            screen::message(text);
        }
    }
}

impl Drop for Pace {
    /// Work that ends early leaves its last line.
    fn drop(&mut self) {
        screen::leave_bar();
    }
}

/// Counts finished pieces of work.
pub struct Progress {
    what: &'static str,
    total: usize,
    done: usize,
    pace: Pace,
}

impl Progress {
    /// `total` pieces called `what`.
    pub fn new(what: &'static str, total: usize) -> Self {
        Progress { what, total, done: 0, pace: Pace::new() }
    }

    /// One more piece is done; `note` says something about it. Work that is soon done has no line but on a terminal.
    pub fn step(&mut self, note: &str) {
        self.done += 1;
        let is_last = self.done == self.total && (screen::is_terminal() || self.pace.last.is_some());
        if !is_last && !self.pace.is_due() {
            return;
        }
        let seconds = self.pace.start.elapsed().as_secs_f64();
        let left = seconds / self.done as f64 * self.total.saturating_sub(self.done) as f64;
        let Progress { what, total, done, .. } = self;
        let line = format!("{what} {done}/{total}, {} left, {note}", clock(left));
        self.pace.show(self.done as u64, self.total as u64, &line);
    }

    /// `done` of `total` things called `things` are done: so many pieces of this progress as that makes. It begins anew with
    /// the first of other things.
    pub fn reach(&mut self, done: usize, total: usize, things: &str) {
        if done == 1 && self.done == self.total {
            self.done = 0;
            self.pace = Pace::new();
        }
        while self.done < self.total && (self.done + 1) * total <= done * self.total {
            self.step(&format!("{done} of {total} {things}"));
        }
    }
}

/// Progress of a training run.
pub struct Steps {
    total: u64,
    /// Steps done before this process.
    before: u64,
    psnr: Option<f64>,
    pace: Pace,
}

impl Steps {
    /// A run of `total` steps of which `before` were done by an earlier process.
    pub fn new(total: u64, before: u64) -> Self {
        Steps { total, before, psnr: None, pace: Pace::new() }
    }

    /// After a step, `seconds` of stepping into this process, if a line is due.
    pub fn show(&mut self, report: &StepReport, seconds: f64) {
        if report.step != self.total && !self.pace.is_due() {
            return;
        }
        let rate = report.step.saturating_sub(self.before) as f64 / seconds.max(1e-9);
        let left = self.total.saturating_sub(report.step) as f64 / rate.max(1e-9);
        let psnr = self.psnr.map_or(String::new(), |psnr| format!("test {psnr:.2} dB, "));
        let line = format!(
            "step {}/{}, {rate:.1} it/s, {} left, loss {:.4}, {:.2} dB, {psnr}{} Gaussians, {} live, {} intersections",
            report.step,
            self.total,
            clock(left),
            report.loss,
            report.psnr,
            report.gaussians,
            report.active,
            report.intersections
        );
        self.pace.show(report.step, self.total, &line);
    }

    /// After an evaluation.
    pub fn scored(&mut self, step: u64, psnr: f64, ssim: f64, n_views: usize) {
        self.psnr = Some(psnr);
        let images = count(n_views, "test image");
        screen::message(&format!("after {}: PSNR {psnr:.2} dB, SSIM {ssim:.4} on {images}", count(step, "step")));
    }
}

/// Seconds as hours, minutes and seconds.
fn clock(seconds: f64) -> String {
    let s = seconds.round() as u64;
    if s < 3600 {
        format!("{}:{:02}", s / 60, s % 60)
    } else {
        format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
    }
}

/// Progress of work in stages of many pieces.
pub struct Pieces {
    stage: &'static str,
    pace: Pace,
}

impl Pieces {
    /// Nothing is done yet.
    pub fn new() -> Self {
        Pieces { stage: "", pace: Pace::new() }
    }

    /// After a piece, if a line is due; the first and the last of a stage always are.
    pub fn show(&mut self, progress: &ivv::prepare::Progress) {
        let ivv::prepare::Progress { stage, done, total, piece } = *progress;
        let begins = stage != self.stage;
        self.stage = stage;
        if begins || done == total || self.pace.is_due() {
            self.pace.show(done as u64, total as u64, &format!("{stage} {done}/{total}: {piece}"));
        }
    }
}
