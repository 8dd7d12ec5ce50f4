//! Progress: one line that rewrites itself on a terminal, a few plain lines otherwise; always on standard error.

use crate::ui::screen::{self, say};
use ivv::internals::train::{Notice, Phase, StepReport, Watch};
use ivv::internals::words::count;
use std::time::{Duration, Instant};

/// Least time between two lines on a terminal.
const QUICK: Duration = Duration::from_millis(200);
/// Work that takes this long has a line everywhere.
const LONG: Duration = Duration::from_secs(2);
/// Least time between two lines elsewhere; it grows with the run.
const SLOW: Duration = Duration::from_secs(5);
/// Seconds of steps before a rate is shown.
const LEAST_RATED: f64 = 0.2;

struct Pace {
    start: Instant,
    last: Option<Instant>,
    /// True if the bar is erased at the end, because another one continues.
    passes: bool,
}

impl Pace {
    fn new(passes: bool) -> Self {
        Pace { start: Instant::now(), last: None, passes }
    }

    /// True if a line is due. Where there is no terminal, after a twentieth of the time so far: some 75 lines an hour.
    fn is_due(&self) -> bool {
        let since = self.last.unwrap_or(self.start).elapsed();
        match self.last {
            None if screen::is_terminal() => true,
            _ if screen::is_terminal() => since >= QUICK,
            None => since >= LONG,
            Some(_) => since >= SLOW.max(self.start.elapsed() / 20),
        }
    }

    fn begin(&mut self, done: u64, total: u64, text: &str) {
        if screen::is_terminal() {
            self.show(done, total, text);
        }
    }

    fn show(&mut self, done: u64, total: u64, text: &str) {
        self.last = Some(Instant::now());
        if !screen::is_terminal() {
            return screen::passing_line(text);
        }
        screen::bar(done, total, text);
        if done >= total && !self.passes {
            screen::leave_bar();
        }
    }
}

impl Drop for Pace {
    /// Work that ends early leaves its last line.
    fn drop(&mut self) {
        if !self.passes {
            screen::leave_bar();
        }
    }
}

pub struct Progress {
    what: &'static str,
    total: usize,
    done: usize,
    pace: Pace,
}

impl Progress {
    /// `total` pieces called `what`; 0 if the first call of [`Progress::reach`] sets it.
    pub fn new(what: &'static str, total: usize) -> Self {
        Self::begin(what, total, false)
    }

    /// The same during a training, whose own bar continues after it.
    pub fn passing(what: &'static str, total: usize) -> Self {
        Self::begin(what, total, true)
    }

    fn begin(what: &'static str, total: usize, passes: bool) -> Self {
        let text = if total > 0 { format!("{what} 0/{total}") } else { what.to_owned() };
        let mut pace = Pace::new(passes);
        pace.begin(0, total.max(1) as u64, &text);
        Progress { what, total, done: 0, pace }
    }

    /// Counts one more piece, which `note` describes.
    pub fn step(&mut self, note: &str) {
        self.done += 1;
        // Short work has a last line only on a terminal.
        let has_last = screen::is_terminal() || self.pace.last.is_some() || self.pace.start.elapsed() >= LONG;
        if !(self.pace.is_due() || self.done == self.total && has_last) {
            return;
        }
        let seconds = self.pace.start.elapsed().as_secs_f64();
        let left = seconds / self.done as f64 * self.total.saturating_sub(self.done) as f64;
        let Progress { what, total, done, .. } = self;
        let line = format!("{what} {done}/{total}, {} left, {note}", clock(left));
        self.pace.show(self.done as u64, self.total as u64, &line);
    }

    /// Sets the count to `done` of `total` `things`. The clock starts again if `done` goes back.
    pub fn reach(&mut self, done: usize, total: usize, things: &str) {
        if done <= self.done {
            self.pace.start = Instant::now();
        }
        (self.done, self.total) = (done.saturating_sub(1), total);
        self.step(things);
    }
}

/// Shows the work of a session beside its steps.
pub fn watch() -> Watch<'static> {
    let mut shown: Option<(Phase, Progress)> = None;
    Box::new(move |notice| match notice {
        Notice::Work { phase, done, total } => {
            let (what, things) = match phase {
                Phase::Initialisation => ("initialisation", "frames, pictures or depths"),
                Phase::DepthPriors => ("depth priors", "frames"),
                Phase::Review => ("review of what is required", "pictures"),
                Phase::OffsetErrors => ("errors of time offsets", "cameras"),
            };
            let passes = matches!(phase, Phase::Review | Phase::OffsetErrors);
            let known = shown.take().filter(|(known, _)| *known == phase);
            let (_, progress) = shown.insert(known.unwrap_or_else(|| (phase, Progress::begin(what, 0, passes))));
            if total > 0 {
                progress.reach(done, total, things);
            }
        }
        Notice::Initialised(initial) => {
            shown = None;
            say!("initialised {initial}");
        }
        Notice::DepthPriors(summary) => {
            shown = None;
            say!("{summary}");
        }
        Notice::Planned(plan) => say!("{plan}"),
    })
}

pub struct TrainingProgress {
    total: u64,
    psnr: Option<f64>,
    /// The first step of this process, which compiles the kernels, and when it was done.
    first: Option<(u64, Instant)>,
    /// Images that are scored after the last step, and seconds for each, once known.
    images: usize,
    seconds_of_an_image: f64,
    pace: Pace,
}

impl TrainingProgress {
    /// A run of `total` steps of which `before` were done by an earlier process; it ends with the scores of `images`.
    pub fn new(total: u64, before: u64, images: usize) -> Self {
        let mut pace = Pace::new(false);
        if before < total {
            pace.begin(before, total, &format!("step {before}/{total}, compiling the kernels"));
        }
        TrainingProgress { total, psnr: None, first: None, images, seconds_of_an_image: 0.0, pace }
    }

    /// Shows a step, if a line is due. The time left includes the final scores, once an image was scored.
    pub fn show(&mut self, report: &StepReport) {
        let (first, since) = *self.first.get_or_insert_with(|| (report.step, Instant::now()));
        if report.step != self.total && !self.pace.is_due() {
            return;
        }
        let seconds = since.elapsed().as_secs_f64();
        let pace = if report.step > first && seconds >= LEAST_RATED {
            let rate = (report.step - first) as f64 / seconds;
            let left = self.total.saturating_sub(report.step) as f64 / rate;
            let left = left + self.images as f64 * self.seconds_of_an_image;
            format!("{rate:.1} it/s, {} left, ", clock(left))
        } else {
            String::new()
        };
        let own = report.term("psnr").map_or(String::new(), |psnr| format!("{psnr:.2} dB, "));
        let psnr = self.psnr.map_or(String::new(), |psnr| format!("test {psnr:.2} dB, "));
        let line = format!(
            "step {}/{}, {pace}loss {:.4}, {own}{psnr}{} Gaussians, {} live, {} intersections",
            report.step, self.total, report.loss, report.gaussians, report.active, report.intersections
        );
        self.pace.show(report.step, self.total, &line);
    }

    pub fn scored(&mut self, step: u64, psnr: f64, ssim: f64, n_views: usize, seconds: f64) {
        self.psnr = Some(psnr);
        self.seconds_of_an_image = seconds / n_views.max(1) as f64;
        let images = count(n_views, "test image");
        screen::message(&format!("after {}: PSNR {psnr:.2} dB, SSIM {ssim:.4} on {images}", count(step, "step")));
    }
}

/// Seconds as hours, minutes and seconds.
fn clock(seconds: f64) -> String {
    let s = seconds.round() as u64;
    let (hours, minutes, s) = (s / 3600, s / 60 % 60, s % 60);
    if hours == 0 { format!("{minutes}:{s:02}") } else { format!("{hours}:{minutes:02}:{s:02}") }
}

pub struct StageProgress {
    stage: &'static str,
    /// The count at the first report of the stage, and its time.
    first: (usize, Instant),
    pace: Pace,
}

impl StageProgress {
    pub fn new() -> Self {
        StageProgress { stage: "", first: (0, Instant::now()), pace: Pace::new(false) }
    }

    /// Shows a piece, if a line is due. The first and the last of a stage always are.
    pub fn show(&mut self, progress: &ivv::internals::prepare::Progress) {
        let ivv::internals::prepare::Progress { stage, done, total, piece } = *progress;
        if total == 0 {
            say!("{piece}");
            return;
        }
        let begins = stage != self.stage;
        if begins {
            (self.stage, self.first) = (stage, (done, Instant::now()));
        }
        if begins || done == total || self.pace.is_due() {
            let (before, since) = self.first;
            let left = (done > before && done < total).then(|| {
                let each = since.elapsed().as_secs_f64() / (done - before) as f64;
                format!(", {} left", clock(each * (total - done) as f64))
            });
            let line = format!("{stage} {done}/{total}{}: {piece}", left.unwrap_or_default());
            self.pace.show(done as u64, total as u64, &line);
        }
    }
}
