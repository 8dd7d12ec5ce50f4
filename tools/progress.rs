//! Progress: one line that rewrites itself on a terminal, plain lines otherwise; always on standard error.

use ivv::train::StepReport;
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// Cells of the bar.
const BAR: usize = 24;

/// Where progress is shown.
struct Screen {
    terminal: bool,
    last: Option<Instant>,
    /// Whether the cursor stands behind an unfinished line.
    open: bool,
}

impl Screen {
    fn new() -> Self {
        Screen { terminal: std::io::stderr().is_terminal(), last: None, open: false }
    }

    /// Whether at least that long has passed since the last line, by the kind of the screen.
    fn is_due(&self, terminal: Duration, plain: Duration) -> bool {
        let pause = if self.terminal { terminal } else { plain };
        self.last.is_none_or(|last| last.elapsed() >= pause)
    }

    /// Shows that `done` of `total` is done.
    fn show(&mut self, done: u64, total: u64, text: &str) {
        self.last = Some(Instant::now());
        let mut out = std::io::stderr().lock();
        // A closed standard error must not end the work.
        let _ = if self.terminal {
            let filled = (done * BAR as u64 / total.max(1)) as usize;
            let (full, empty) = ("█".repeat(filled.min(BAR)), "░".repeat(BAR.saturating_sub(filled)));
            self.open = done != total;
            let end = if self.open { "" } else { "\n" };
            // Without wrapping, so that a narrow terminal cuts the line and still rewrites it.
            write!(out, "\r\x1b[2K\x1b[?7l{full}{empty} {text}\x1b[?7h{end}")
        } else {
            writeln!(out, "{text}")
        };
        let _ = out.flush();
    }

    /// A line that stays.
    fn say(&mut self, text: &str) {
        let clear = if self.open { "\r\x1b[2K" } else { "" };
        self.open = false;
        eprintln!("{clear}{text}");
    }
}

impl Drop for Screen {
    /// Work that ends early leaves its last line.
    fn drop(&mut self) {
        if self.open {
            eprintln!();
        }
    }
}

/// Counts finished pieces of work.
pub struct Progress {
    what: &'static str,
    total: usize,
    done: usize,
    start: Instant,
    screen: Screen,
}

impl Progress {
    /// `total` pieces called `what`.
    pub fn new(what: &'static str, total: usize) -> Self {
        Progress { what, total, done: 0, start: Instant::now(), screen: Screen::new() }
    }

    /// One more piece is done; `note` says something about it.
    pub fn step(&mut self, note: &str) {
        self.done += 1;
        let seconds = self.start.elapsed().as_secs_f64();
        let left = seconds / self.done as f64 * (self.total - self.done) as f64;
        let Progress { what, total, done, .. } = self;
        let line = format!("{what} {done}/{total}, {left:.0} s left: {note}");
        self.screen.show(self.done as u64, self.total as u64, &line);
    }

    /// `done` of `total` things called `things` are done: so many pieces of this progress as that makes. It begins anew with
    /// the first of other things.
    pub fn reach(&mut self, done: usize, total: usize, things: &str) {
        if done == 1 && self.done == self.total {
            (self.done, self.start) = (0, Instant::now());
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
    screen: Screen,
}

impl Steps {
    /// A run of `total` steps of which `before` were done by an earlier process.
    pub fn new(total: u64, before: u64) -> Self {
        Steps { total, before, psnr: None, screen: Screen::new() }
    }

    /// A line that stays.
    pub fn note(&mut self, text: &str) {
        self.screen.say(text);
    }

    /// After a step, `seconds` of stepping into this process; at most five lines a second on a terminal and one in five
    /// seconds elsewhere.
    pub fn show(&mut self, report: &StepReport, seconds: f64) {
        let is_last = report.step == self.total;
        if !is_last && !self.screen.is_due(Duration::from_millis(200), Duration::from_secs(5)) {
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
        self.screen.show(report.step, self.total, &line);
    }

    /// After an evaluation.
    pub fn scored(&mut self, step: u64, psnr: f64, ssim: f64, n_views: usize) {
        self.psnr = Some(psnr);
        self.screen.say(&format!("after {step} steps: PSNR {psnr:.2} dB, SSIM {ssim:.4} of {n_views} test images"));
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
    screen: Screen,
}

impl Pieces {
    /// Nothing is done yet.
    pub fn new() -> Self {
        Pieces { stage: "", screen: Screen::new() }
    }

    /// After a piece; at most five lines a second on a terminal and one in five seconds elsewhere, and the last of a stage.
    pub fn show(&mut self, progress: &ivv::prepare::Progress) {
        let ivv::prepare::Progress { stage, done, total, piece } = *progress;
        let begins = stage != self.stage;
        self.stage = stage;
        if begins || done == total || self.screen.is_due(Duration::from_millis(200), Duration::from_secs(5)) {
            self.screen.show(done as u64, total as u64, &format!("{stage} {done}/{total}: {piece}"));
        }
    }
}
