//! `ivv render --bench`: frames per second.

use crate::interrupt::Stop;
use crate::progress::Progress;
use crate::screen::out;
use ivv::profile::quantile;
use ivv::scene::View;
use ivv::stage::{Outputs, Renderer};
use std::time::Instant;

/// What frames took.
#[derive(serde::Serialize)]
pub struct Rate {
    /// Of the mean time.
    frames_per_second: f64,
    /// Half of the frames took less, 95 and 99 in 100; milliseconds.
    median_ms: f64,
    p95_ms: f64,
    p99_ms: f64,
}

/// What rendering views over and over took.
#[derive(serde::Serialize)]
pub struct Bench {
    /// Frames of each kind.
    frames: usize,
    /// Of frames that stay on the device.
    drawn: Rate,
    /// Of frames that are read back to the host.
    read_back: Rate,
}

impl Rate {
    fn of(seconds: &[f64]) -> Self {
        let ms = |q: f64| 1e3 * quantile(seconds, q);
        let mean = seconds.iter().sum::<f64>() / seconds.len() as f64;
        Rate { frames_per_second: 1.0 / mean, median_ms: ms(0.5), p95_ms: ms(0.95), p99_ms: ms(0.99) }
    }
}

impl Bench {
    /// Renders `views`, at least one, in turn for so many seconds and at least once each; every other frame is read back.
    pub fn new(
        renderer: &mut Renderer,
        views: &[View],
        outputs: Outputs,
        seconds: f64,
        stop: &Stop,
    ) -> ivv::Result<Self> {
        // Kernels are compiled at their first dispatch, and lists grow to their size.
        for view in views {
            renderer.draw(view, outputs)?;
        }
        let (mut drawn, mut read_back) = (Vec::new(), Vec::new());
        let mut progress = Progress::passing("bench", views.len());
        let begun = Instant::now();
        while drawn.len() < views.len() || (begun.elapsed().as_secs_f64() < seconds && !stop.is_asked()) {
            let view = &views[drawn.len() % views.len()];
            let at = Instant::now();
            renderer.draw(view, outputs)?;
            drawn.push(at.elapsed().as_secs_f64());
            let at = Instant::now();
            renderer.render(view, outputs)?;
            read_back.push(at.elapsed().as_secs_f64());
            progress.reach(drawn.len(), drawn.len().max(views.len()), "frames");
        }
        Ok(Bench { frames: drawn.len(), drawn: Rate::of(&drawn), read_back: Rate::of(&read_back) })
    }

    /// Prints it as a table.
    pub fn print(&self) {
        out!("{:<22} {:>9} {:>10} {:>9} {:>9}", "", "frames/s", "median, ms", "95 %", "99 %");
        for (name, rate) in [("stays on the device", &self.drawn), ("read back to the host", &self.read_back)] {
            let Rate { frames_per_second, median_ms, p95_ms, p99_ms } = rate;
            out!("{name:<22} {frames_per_second:>9.1} {median_ms:>10.2} {p95_ms:>9.2} {p99_ms:>9.2}");
        }
    }
}
