//! `ivv render --bench`: frames per second.

use crate::ui::interrupt::Stop;
use crate::ui::progress::Progress;
use crate::ui::screen::print_table;
use ivv::report::statistics::{mean, quantile};
use ivv::scene::View;
use ivv::stage::{Destination, Outputs, Renderer};
use std::collections::BTreeMap;
use std::time::Instant;

/// Kinds of frames: their names in JSON and in the table.
const KINDS: [(&str, &str); 2] = [("drawn", "stays on the device"), ("read_back", "read back to the host")];

/// How fast frames of a kind are.
#[derive(serde::Serialize)]
struct Rate {
    /// From the mean time.
    frames_per_second: f64,
    /// Milliseconds: quantiles of the times of frames.
    median_ms: f64,
    p95_ms: f64,
    p99_ms: f64,
}

/// Frame rates of a scene.
#[derive(serde::Serialize)]
pub struct FrameRates {
    /// Frames of each kind.
    frames: usize,
    /// In the order of [`KINDS`].
    #[serde(flatten)]
    rates: BTreeMap<&'static str, Rate>,
}

impl Rate {
    fn of(seconds: &[f64]) -> Self {
        let ms = |q: f64| 1e3 * quantile(seconds, q);
        let mean = mean(seconds.iter().copied());
        Rate {
            frames_per_second: mean.map_or(f64::NAN, |mean| 1.0 / mean),
            median_ms: ms(0.5),
            p95_ms: ms(0.95),
            p99_ms: ms(0.99),
        }
    }
}

impl FrameRates {
    /// Renders `views`, at least one, in turn for `seconds` and at least once each; the kinds alternate.
    pub fn new(
        renderer: &mut Renderer,
        views: &[View],
        outputs: Outputs,
        seconds: f64,
        stop: &Stop,
    ) -> ivv::Result<Self> {
        // Kernels are compiled at their first dispatch, and lists grow to their size.
        renderer.stream(views.iter().cloned(), outputs, Destination::Device, |_, _, _| ivv::Result::Ok(true))?;
        let mut times: [Vec<f64>; KINDS.len()] = Default::default();
        let mut progress = Progress::passing("bench", views.len());
        let begun = Instant::now();
        while times[0].is_empty() || (begun.elapsed().as_secs_f64() < seconds && !stop.is_asked()) {
            for (kind, destination) in [Destination::Device, Destination::Host].into_iter().enumerate() {
                let mut last = Instant::now();
                renderer.stream(views.iter().cloned(), outputs, destination, |_, _, _| {
                    times[kind].push(last.elapsed().as_secs_f64());
                    last = Instant::now();
                    ivv::Result::Ok(true)
                })?;
            }
            progress.reach(times[0].len(), times[0].len(), "frames");
        }
        let rates = KINDS.iter().zip(&times).map(|((kind, _), times)| (*kind, Rate::of(times))).collect();
        Ok(FrameRates { frames: times[0].len(), rates })
    }

    /// Prints it as a table.
    pub fn print(&self) {
        let row = |(kind, name): (&str, &str)| {
            let Rate { frames_per_second, median_ms, p95_ms, p99_ms } = self.rates.get(kind)?;
            let times = [median_ms, p95_ms, p99_ms].map(|ms| format!("{ms:.2}"));
            Some([vec![name.to_owned(), format!("{frames_per_second:.1}")], times.to_vec()].concat())
        };
        print_table(&["", "frames/s", "median, ms", "95 %", "99 %"], KINDS.into_iter().filter_map(row));
    }
}
