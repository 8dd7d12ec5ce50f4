//! What lies over the picture: the time bar, and a graph of the frames' times with the slowest passes.

use font8x8::legacy::BASIC_LEGACY;
use ivv::internals::profile::FrameTimes;
use ivv::internals::stage::FrameReport;

/// Height of the time bar and of the graph, and the margin, in points.
const BAR: usize = 22;
const GRAPH: usize = 118;
const MARGIN: usize = 8;
/// The time at the graph's top, milliseconds: two frames of 30 a second.
const TOP_MS: f64 = 66.7;
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

/// Words of whole rows, to lie over the last ones of a window of this size. The time bar has a part that is over, a clock of at most
/// 15 letters, and a text.
pub fn draw(
    [width, height]: [usize; 2],
    scale: usize,
    bar: Option<(f64, [&str; 2])>,
    lately: Option<&FrameTimes>,
) -> Vec<u32> {
    let bar_rows = if bar.is_some() { bar_height(scale) } else { 0 };
    let rows = (bar_rows + if lately.is_some() { GRAPH * scale } else { 0 }).min(height);
    let mut canvas = Canvas { words: vec![SHADE; width * rows], width, scale };
    if let Some(lately) = lately {
        graph(&mut canvas, lately);
    }
    if let Some((over, [clock, text])) = bar {
        let top = rows.saturating_sub(bar_rows);
        let [from, to] = track(width, scale);
        canvas.text([MARGIN * scale, top + 4 * scale], clock, TEXT);
        canvas.text([from, top + 2 * scale], text, FAINT);
        let (y, full) = (top + 13 * scale, to.saturating_sub(from));
        let done = (over.clamp(0.0, 1.0) * full as f64) as usize;
        canvas.fill([from, y], [full, 4 * scale], TRACK);
        canvas.fill([from, y], [done, 4 * scale], DONE);
        canvas.fill([from + done, y.saturating_sub(2 * scale)], [2 * scale, 8 * scale], TEXT);
    }
    canvas.words
}

fn graph(canvas: &mut Canvas, lately: &FrameTimes) {
    let scale = canvas.scale;
    let (left, top, floor) = (MARGIN * scale, 18 * scale, (GRAPH - 6) * scale);
    let FrameReport { active, gaussians, intersections, .. } = lately.report;
    let [usual, slow] = [0.5, 0.95].map(|q| lately.quantile(q));
    let rate = lately.rate();
    let numbers = format!(
        "{rate:.0} fps  engine {usual:.1} ms, 95% {slow:.1}  {active} of {gaussians} active, {intersections} intersections"
    );
    canvas.text([left, 5 * scale], &numbers, TEXT);
    let tall = |ms: f64| ((ms / TOP_MS).min(1.0) * (floor - top) as f64).ceil() as usize;
    for (k, ms) in lately.ms.iter().enumerate() {
        let color = if *ms > 1e3 / 30.0 { SLOW } else { DONE };
        canvas.fill([left + k * scale, floor - tall(*ms)], [scale, tall(*ms)], color);
    }
    for rate in [60.0, 30.0] {
        let y = floor - tall(1e3 / rate);
        canvas.fill([left, y], [FrameTimes::FRAMES * scale, 1], FAINT);
        canvas.text([left + (FrameTimes::FRAMES + 3) * scale, y.saturating_sub(3 * scale)], &format!("{rate}"), FAINT);
    }
    let x = left + (FrameTimes::FRAMES + 30) * scale;
    for (k, (name, ms)) in lately.slowest(PASSES).into_iter().enumerate() {
        canvas.text([x, top + 11 * k * scale], &format!("{ms:7.2} ms {name}"), TEXT);
    }
}
