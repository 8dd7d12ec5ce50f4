//! What lies over the picture: the time bar, and a graph of the frames' times with the slowest passes.

use font8x8::legacy::BASIC_LEGACY;
use ivv::report::statistics::{mean, quantile};
use ivv::stage::FrameReport;
use std::collections::VecDeque;

/// Height of the time bar and of the graph, and the margin, in points.
const BAR: usize = 22;
const GRAPH: usize = 118;
const MARGIN: usize = 8;
/// Frames in the graph, and the time at its top, milliseconds: two frames of 30 a second.
const FRAMES: usize = 240;
const TOP_MS: f64 = 66.7;
/// Passes that are named.
const PASSES: usize = 8;
const SHADE: u32 = word([8, 10, 14], 170);
const TEXT: u32 = word([235, 235, 235], 255);
const FAINT: u32 = word([150, 155, 165], 255);
const TRACK: u32 = word([90, 96, 110], 220);
const DONE: u32 = word([90, 170, 255], 255);
const SLOW: u32 = word([255, 140, 70], 255);

const fn word([r, g, b]: [u8; 3], alpha: u8) -> u32 {
    u32::from_le_bytes([r, g, b, alpha])
}

/// What frames took, lately.
#[derive(Default)]
pub struct Frames {
    /// Milliseconds that the engine took for each.
    ms: VecDeque<f64>,
    /// Milliseconds from each to the next.
    between: VecDeque<f64>,
    report: FrameReport,
    /// Mean milliseconds of passes over the last frames, by name.
    passes: Vec<(String, f64)>,
}

impl Frames {
    /// Adds a frame that took so long, so long after the one before.
    pub fn add(&mut self, ms: f64, between: Option<f64>, report: FrameReport) {
        for (all, new) in [(&mut self.ms, Some(ms)), (&mut self.between, between)] {
            all.extend(new);
            all.drain(..all.len().saturating_sub(FRAMES));
        }
        self.passes.iter_mut().for_each(|(_, ms)| *ms *= 0.9);
        for time in &report.times {
            let share = 0.1e-6 * time.ns;
            match self.passes.iter_mut().find(|(name, _)| *name == time.label) {
                Some((_, ms)) => *ms += share,
                // The first of its kind is its own mean.
                None => self.passes.push((time.label.clone(), 10.0 * share)),
            }
        }
        self.passes.retain(|(_, ms)| *ms > 1e-4);
        self.report = report;
    }

    fn numbers(&self) -> String {
        let ms: Vec<f64> = self.ms.iter().copied().collect();
        let q = |q| if ms.is_empty() { 0.0 } else { quantile(&ms, q) };
        let mean = mean(self.between.iter().copied()).unwrap_or(0.0);
        let FrameReport { active, gaussians, intersections, .. } = self.report;
        format!(
            "{:.0} fps  engine {:.1} ms, 95% {:.1}  {active} of {gaussians} active, {intersections} intersections",
            if mean > 0.0 { 1e3 / mean } else { 0.0 },
            q(0.5),
            q(0.95)
        )
    }
}

/// What the time bar tells.
pub struct Bar<'a> {
    pub seconds: f64,
    pub length: f64,
    pub is_playing: bool,
    pub text: &'a str,
}

/// Words of rows of the window.
struct Canvas {
    words: Vec<u32>,
    width: usize,
    /// Pixels of a point.
    scale: usize,
}

impl Canvas {
    /// Fills from `x`, `y` on; what is outside is cut.
    fn fill(&mut self, [x, y]: [usize; 2], [width, height]: [usize; 2], word: u32) {
        let (from, to) = (x.min(self.width), (x + width).min(self.width));
        for row in self.words.chunks_mut(self.width).skip(y).take(height) {
            row[from..to].fill(word);
        }
    }

    fn text(&mut self, [x, y]: [usize; 2], text: &str, word: u32) {
        let scale = self.scale;
        for (k, letter) in text.chars().enumerate() {
            let rows = BASIC_LEGACY.get(letter as usize).unwrap_or(&BASIC_LEGACY['?' as usize]);
            for (row, bits) in rows.iter().enumerate() {
                for column in (0..8).filter(|column| bits >> column & 1 == 1) {
                    self.fill([x + (8 * k + column) * scale, y + row * scale], [scale; 2], word);
                }
            }
        }
    }
}

/// Height of the time bar, pixels, where a point has so many.
pub fn bar_height(scale: usize) -> usize {
    BAR * scale
}

/// Where the track of the time bar is in a window of this width, pixels: its ends.
pub fn track(width: usize, scale: usize) -> [usize; 2] {
    [(MARGIN + 8 * 16) * scale, width.saturating_sub(MARGIN * scale)].map(|x| x.min(width))
}

/// The overlay of a window of this size: words of whole rows, to lie over its last ones.
pub fn draw([width, height]: [usize; 2], scale: usize, bar: Option<&Bar>, frames: Option<&Frames>) -> Vec<u32> {
    let bar_rows = if bar.is_some() { bar_height(scale) } else { 0 };
    let rows = (bar_rows + if frames.is_some() { GRAPH * scale } else { 0 }).min(height);
    let mut canvas = Canvas { words: vec![SHADE; width * rows], width, scale };
    if let Some(frames) = frames {
        graph(&mut canvas, frames);
    }
    if let Some(bar) = bar {
        let top = rows.saturating_sub(bar_rows);
        let [from, to] = track(width, scale);
        let clock = format!("{} {:5.2} / {:.2}", if bar.is_playing { '>' } else { '=' }, bar.seconds, bar.length);
        canvas.text([MARGIN * scale, top + 4 * scale], &clock, TEXT);
        canvas.text([from, top + 2 * scale], bar.text, FAINT);
        let share = if bar.length > 0.0 { (bar.seconds / bar.length).clamp(0.0, 1.0) } else { 0.0 };
        let (y, full) = (top + 13 * scale, to.saturating_sub(from));
        let done = (share * full as f64) as usize;
        canvas.fill([from, y], [full, 4 * scale], TRACK);
        canvas.fill([from, y], [done, 4 * scale], DONE);
        canvas.fill([from + done, y.saturating_sub(2 * scale)], [2 * scale, 8 * scale], TEXT);
    }
    canvas.words
}

/// The graph at the top of the canvas.
fn graph(canvas: &mut Canvas, frames: &Frames) {
    let scale = canvas.scale;
    let (left, top, floor) = (MARGIN * scale, 18 * scale, (GRAPH - 6) * scale);
    canvas.text([left, 5 * scale], &frames.numbers(), TEXT);
    let tall = |ms: f64| ((ms / TOP_MS).min(1.0) * (floor - top) as f64).ceil() as usize;
    for (k, ms) in frames.ms.iter().enumerate() {
        let color = if *ms > 1e3 / 30.0 { SLOW } else { DONE };
        canvas.fill([left + k * scale, floor - tall(*ms)], [scale, tall(*ms)], color);
    }
    for rate in [60.0, 30.0] {
        let y = floor - tall(1e3 / rate);
        canvas.fill([left, y], [FRAMES * scale, 1], FAINT);
        canvas.text([left + (FRAMES + 3) * scale, y.saturating_sub(3 * scale)], &format!("{rate}"), FAINT);
    }
    let mut slowest: Vec<&(String, f64)> = frames.passes.iter().collect();
    slowest.sort_by(|a, b| b.1.total_cmp(&a.1));
    let x = left + (FRAMES + 30) * scale;
    for (k, (name, ms)) in slowest.into_iter().take(PASSES).enumerate() {
        canvas.text([x, top + 11 * k * scale], &format!("{ms:7.2} ms {name}"), TEXT);
    }
}
