//! Quality against time: what each preset reaches in how many seconds, and which of them nobody beats.

use crate::report::statistics::{mean, range};
use crate::report::{Axis, Chart, Mark, Panel, Row, Series, Table};
use std::fmt::Write;

/// PSNR by which one preset beats another, dB.
const BEATS: f64 = 0.05;
/// How many times as large a scene must be to count as larger.
const BYTES: f64 = 1.02;
/// Size of a plot, in units of the picture; then the room left of the axes, above, right and below.
const PANEL: [f64; 2] = [420.0, 300.0];
const MARGIN: [f64; 4] = [56.0, 30.0, 14.0, 44.0];
/// Seconds that are written on an axis.
const TICKS: [f64; 14] = [1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 3600.0, 7200.0, 36000.0];

/// A run.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Reached {
    /// Seed.
    pub seed: u64,
    /// Length of the run.
    pub steps: u64,
    /// From the start of the program to the written scene.
    pub seconds: f64,
    /// Mean PSNR of the test views, dB.
    pub psnr: f64,
    /// Their mean LPIPS, where there were weights.
    pub lpips: Option<f64>,
    /// Gaussians at the end.
    pub gaussians: u64,
    /// Bytes of the numbers of the scene.
    pub bytes: u64,
}

/// What a preset reaches on a capture.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PresetCurve {
    /// Its name.
    pub preset: String,
    /// By length of the run, the shortest first; each by seed.
    pub lengths: Vec<Vec<Reached>>,
}

/// What is reached after some time, means over the seeds.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct After {
    /// dB.
    pub psnr: f64,
    /// LPIPS, where there were weights.
    pub lpips: Option<f64>,
    /// Bytes of the numbers of the scene.
    pub bytes: f64,
}

impl PresetCurve {
    /// Mean seconds of the runs of each length, and what they reach.
    fn means(&self) -> Vec<(f64, After)> {
        let of = |runs: &Vec<Reached>| {
            let over = |value: fn(&Reached) -> f64| mean(runs.iter().map(value)).unwrap_or(f64::NAN);
            let lpips: Option<Vec<f64>> = runs.iter().map(|run| run.lpips).collect();
            let after = After { psnr: over(|r| r.psnr), lpips: lpips.and_then(mean), bytes: over(|r| r.bytes as f64) };
            (over(|r| r.seconds), after)
        };
        self.lengths.iter().filter(|runs| !runs.is_empty()).map(of).collect()
    }

    /// What a run reaches that takes `seconds`: between the two lengths about it, linear in the logarithm of the time. None before
    /// the end of the shortest run and after that of the longest.
    pub fn after(&self, seconds: f64) -> Option<After> {
        let means = self.means();
        let pair = means.windows(2).find(|pair| pair[0].0 <= seconds && seconds <= pair[1].0)?;
        let [(t0, a), (t1, b)] = [pair[0], pair[1]];
        let way = if t1 > t0 { (seconds / t0).ln() / (t1 / t0).ln() } else { 0.0 };
        let between = |a: f64, b: f64| a + way * (b - a);
        Some(After {
            psnr: between(a.psnr, b.psnr),
            lpips: a.lpips.zip(b.lpips).map(|(a, b)| between(a, b)),
            bytes: between(a.bytes, b.bytes),
        })
    }
}

/// What presets reach on one capture.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Frontier {
    /// The name of the capture.
    pub capture: String,
    /// Seconds of training that are asked about.
    pub times: Vec<f64>,
    /// By preset.
    pub curves: Vec<PresetCurve>,
}

impl Frontier {
    /// Whether no other preset beats preset `index` after some time: with a smaller scene that is no worse, or with a better one that
    /// is no larger. Differences of 2 % in bytes and of 0.05 dB do not count. What was not measured is not on the front.
    pub fn is_on_front(&self, index: usize, time: f64) -> bool {
        let Some(own) = self.curves[index].after(time) else { return false };
        let others = self.curves.iter().enumerate().filter(|(other, _)| *other != index);
        let beats = |other: After| {
            let is_smaller = other.psnr >= own.psnr && other.bytes * BYTES < own.bytes;
            is_smaller || (other.psnr > own.psnr + BEATS && other.bytes <= own.bytes * BYTES)
        };
        !others.filter_map(|(_, curve)| curve.after(time)).any(beats)
    }

    /// PSNR, or LPIPS, by preset and time; the rows of a table.
    fn rows(&self, cell: impl Fn(usize, f64) -> Option<String>) -> Vec<Vec<String>> {
        let row = |(index, curve): (usize, &PresetCurve)| {
            let cells = self.times.iter().map(|time| cell(index, *time).unwrap_or_else(|| "-".to_owned()));
            [curve.preset.clone()].into_iter().chain(cells).collect()
        };
        self.curves.iter().enumerate().map(row).collect()
    }

    /// The tables of the capture, in Markdown.
    pub fn markdown(&self) -> String {
        let heads: Vec<String> =
            [String::new()].into_iter().chain(self.times.iter().map(|t| format!("{t} s"))).collect();
        let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
        let after = |index: usize, time: f64| self.curves[index].after(time);
        let mut text = format!("## {}\n\nPSNR, dB; with a star where no preset beats it.\n\n", self.capture);
        let psnr = |index: usize, time: f64| {
            let star = if self.is_on_front(index, time) { " *" } else { "" };
            after(index, time).map(|a| format!("{:.2}{star}", a.psnr))
        };
        text += &Table::new(&heads, self.rows(psnr)).markdown();
        if self.curves.iter().any(|curve| curve.means().iter().any(|(_, a)| a.lpips.is_some())) {
            text += "\nLPIPS.\n\n";
            let lpips = |index: usize, time: f64| after(index, time)?.lpips.map(|l| format!("{l:.4}"));
            text += &Table::new(&heads, self.rows(lpips)).markdown();
        }
        text += "\nMiB of the scene.\n\n";
        let bytes = |index: usize, time: f64| after(index, time).map(|a| format!("{:.1}", a.bytes / 1_048_576.0));
        text += &Table::new(&heads, self.rows(bytes)).markdown();
        let never: Vec<&str> = (0..self.curves.len())
            .filter(|index| !self.times.iter().any(|time| self.is_on_front(*index, *time)))
            .map(|index| self.curves[index].preset.as_str())
            .collect();
        if !never.is_empty() {
            let _ = write!(text, "\nBeaten, or not measured, at every one of these times: {}.\n", never.join(", "));
        }
        text
    }
}

/// The plots of all captures: a row each, PSNR and, where there is one, LPIPS over the seconds of a run.
pub fn chart(frontiers: &[Frontier]) -> Chart {
    let legend = frontiers.first().map_or(Vec::new(), |f| f.curves.iter().map(|c| c.preset.clone()).collect());
    let row = |frontier: &Frontier| {
        let panels = [
            panel(frontier, "PSNR, dB", |run| Some(run.psnr)),
            panel(frontier, "LPIPS, lower is better", |run| run.lpips),
        ];
        Row { heading: frontier.capture.clone(), panels: panels.into_iter().flatten().collect() }
    };
    Chart { panel: PANEL, legend, rows: frontiers.iter().map(row).collect() }
}

/// A plot of one quantity of a run over its seconds: a mark for the mean of each length, with the range of the seeds.
fn panel(frontier: &Frontier, title: &str, value: impl Fn(&Reached) -> Option<f64>) -> Option<Panel> {
    let marks = |curve: &PresetCurve| {
        let mark = |runs: &Vec<Reached>| {
            let values: Vec<f64> = runs.iter().filter_map(&value).collect();
            let (seconds, own) = (mean(runs.iter().map(|run| run.seconds))?, mean(values.iter().copied())?);
            let title = format!("{}, {} steps, {seconds:.0} s: {own:.4}", curve.preset, runs.first()?.steps);
            Some(Mark { at: [seconds, own], range: Some(range(values)), radius: 3.0, title })
        };
        curve.lengths.iter().filter_map(mark).collect::<Vec<Mark>>()
    };
    let series: Vec<Series> = frontier
        .curves
        .iter()
        .enumerate()
        .map(|(index, curve)| Series { colour: Some(index), is_joined: true, marks: marks(curve) })
        .collect();
    let all = || series.iter().flat_map(|s| &s.marks);
    all().next()?;
    Some(Panel {
        title: title.to_owned(),
        margin: MARGIN,
        x: Axis::log("seconds of training", all().map(|mark| mark.at[0]), 2.0, &TICKS),
        y: Axis::around("", all().filter_map(|mark| mark.range).flatten(), 1e-3),
        series: series.clone(),
        notes: Vec::new(),
        list: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(preset: &str, points: &[(f64, f64, u64)]) -> PresetCurve {
        let runs = |(index, &(seconds, psnr, bytes)): (usize, &(f64, f64, u64))| {
            let run = |seed: u64, off: f64| Reached {
                seed,
                steps: 100 << index,
                seconds,
                psnr: psnr + off,
                lpips: (preset != "b").then_some(0.5 - 0.01 * psnr),
                gaussians: bytes / 100,
                bytes,
            };
            vec![run(1, 0.5), run(2, -0.5)]
        };
        PresetCurve { preset: preset.to_owned(), lengths: points.iter().enumerate().map(runs).collect() }
    }

    fn frontier() -> Frontier {
        let curves = vec![
            curve("a", &[(10.0, 20.0, 1000), (40.0, 24.0, 2000), (160.0, 30.0, 4000)]),
            curve("b", &[(5.0, 21.0, 1000), (40.0, 23.0, 2000)]),
            curve("c", &[(10.0, 19.0, 500), (40.0, 22.0, 900), (160.0, 24.0, 4100)]),
        ];
        Frontier { capture: "room".to_owned(), times: vec![10.0, 20.0, 100.0], curves }
    }

    #[test]
    fn between_two_lengths_quality_is_linear_in_the_logarithm_of_the_time() {
        let a = &frontier().curves[0];
        let after = a.after(20.0).unwrap();
        assert!((after.psnr - 22.0).abs() < 1e-12 && (after.bytes - 1500.0).abs() < 1e-9);
        assert!((after.lpips.unwrap() - 0.28).abs() < 1e-12);
        assert_eq!(a.after(10.0).unwrap().psnr, 20.0);
        assert_eq!(a.after(160.0).unwrap().psnr, 30.0);
        assert_eq!((a.after(9.9), a.after(161.0)), (None, None));
        assert_eq!(PresetCurve { preset: String::new(), lengths: vec![Vec::new()] }.after(1.0), None);
    }

    #[test]
    fn nobody_beats_the_best_nor_the_smallest_and_what_was_not_measured_is_not_on_the_front() {
        let frontier = frontier();
        let on = |time: f64| [0, 1, 2].map(|index| frontier.is_on_front(index, time));
        // At 10 s b has 21.7 dB and more bytes than a; c is smaller than both.
        assert_eq!(on(10.0), [true, true, true]);
        // At 100 s b ended, and c has become as large as a and worse.
        assert_eq!(on(100.0), [true, false, true]);
        assert_eq!(on(159.0), [true, false, false]);
        assert_eq!(on(1000.0), [false, false, false]);
    }

    #[test]
    fn the_tables_tell_what_was_measured() {
        let text = frontier().markdown();
        assert!(text.contains("| a | 20.00 * | 22.00 * | 27.97 * |"), "{text}");
        assert!(text.contains("| b | 21.67 * | 22.33 * | - |"), "{text}");
        assert!(text.contains("| b | - | - | - |"), "no LPIPS of b: {text}");
        assert!(!text.contains("Beaten"), "{text}");
        let late = Frontier { times: vec![159.0], ..frontier() };
        assert!(late.markdown().contains("at every one of these times: b, c."), "{}", late.markdown());
        let svg = chart(&[late]).svg();
        assert!(svg.contains("PSNR, dB") && svg.contains("room") && svg.contains("a, 400 steps, 160 s: 30.0000"));
    }
}
