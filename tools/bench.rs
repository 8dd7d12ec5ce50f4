//! `ivv render --bench`: frames per second.

use crate::interrupt::Stop;
use crate::progress::Progress;
use crate::screen::out;
use ivv::report::statistics::{mean, median, quantile};
use ivv::scene::{Splats, View};
use ivv::stage::{Destination, Outputs, Renderer};
use std::collections::BTreeMap;
use std::time::Instant;

/// The distance of two eyes, by that of the middle of the scene: 6 cm at 2.4 m.
const EYES: f64 = 1.0 / 40.0;
/// What is measured: in JSON, and in the table.
const KINDS: [(&str, &str); 4] = [
    ("drawn", "stays on the device"),
    ("read_back", "read back to the host"),
    ("stereo", "two eyes, shared"),
    ("two_views", "two eyes, apart"),
];

/// What frames, or pairs of them for two eyes, took.
#[derive(serde::Serialize)]
struct Rate {
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

impl Bench {
    /// Renders `views`, at least one, of `splats` in turn for so many seconds and at least once each, the kinds by turns.
    pub fn new(
        renderer: &mut Renderer,
        splats: &Splats,
        views: &[View],
        outputs: Outputs,
        seconds: f64,
        stop: &Stop,
    ) -> ivv::Result<Self> {
        let middle = middle(splats);
        let eyes: Vec<[View; 2]> = views.iter().map(|view| eyes(view, middle)).collect();
        // Kernels are compiled at their first dispatch, and lists grow to their size.
        for [first, second] in &eyes {
            renderer.stereo([first, second], outputs, Destination::Device)?;
        }
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
            for [first, second] in &eyes {
                let last = Instant::now();
                renderer.stereo([first, second], outputs, Destination::Device)?;
                times[2].push(last.elapsed().as_secs_f64());
                let last = Instant::now();
                let pictures = [first, second].map(|eye| renderer.begin(eye, outputs, Destination::Device));
                for picture in pictures {
                    renderer.end(picture?)?;
                }
                times[3].push(last.elapsed().as_secs_f64());
            }
            progress.reach(times[0].len(), times[0].len(), "frames");
        }
        let rates = KINDS.iter().zip(&times).map(|((kind, _), times)| (*kind, Rate::of(times))).collect();
        Ok(Bench { frames: times[0].len(), rates })
    }

    /// Prints it as a table.
    pub fn print(&self) {
        out!("{:<22} {:>9} {:>10} {:>9} {:>9}", "", "frames/s", "median, ms", "95 %", "99 %");
        for (kind, name) in KINDS {
            let Some(Rate { frames_per_second, median_ms, p95_ms, p99_ms }) = self.rates.get(kind) else { continue };
            out!("{name:<22} {frames_per_second:>9.1} {median_ms:>10.2} {p95_ms:>9.2} {p99_ms:>9.2}");
        }
    }
}

/// The median of the Gaussians' places, by axis.
fn middle(splats: &Splats) -> [f64; 3] {
    std::array::from_fn(|axis| {
        let along: Vec<f64> = splats.position.iter().map(|p| f64::from(p[axis])).filter(|x| x.is_finite()).collect();
        if along.is_empty() { 0.0 } else { median(&along) }
    })
}

/// Two eyes beside each other where `view` looks from, as far apart as suits a scene with this middle.
fn eyes(view: &View, middle: [f64; 3]) -> [View; 2] {
    let m = view.pose.rows();
    let along = |row: &[f64; 4]| row[3] + (0..3).map(|axis| row[axis] * middle[axis]).sum::<f64>();
    let distance = m[..3].iter().map(|row| along(row).powi(2)).sum::<f64>().sqrt();
    [0.5, -0.5].map(|side| {
        let mut eye = view.clone();
        eye.pose.translation.x += side * EYES * distance;
        eye
    })
}
