//! Speed against accuracy as tables and as a picture.

use super::trade::{
    Circumstances, Comparison, Effect, KernelError, Kind, MARGIN_DB, QUALITY_GAP_DB, Trade, TradeArm, WORST_MARGIN_DB,
};
use crate::report::statistics::{Estimate, Spread};
use crate::report::{Anchor, Axis, Chart, Look, Mark, Note, Panel, Series, Table};
use crate::words::count;
use std::fmt::Write;

/// Width and height of the picture.
const SIZE: [f64; 2] = [770.0, 460.0];
/// Room left of its axes, above, right and below.
const MARGIN: [f64; 4] = [70.0, 30.0, 80.0, 40.0];
/// Ticks of its horizontal axis.
const SPEEDS: [f64; 12] = [0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0];
const HEADS: [&str; 12] = [
    "",
    "speed",
    "to quality",
    "PSNR, dB",
    "difference, dB",
    "worst frame, dB",
    "",
    "SSIM",
    "flicker",
    "flow, px",
    "offsets, frames",
    "MiB",
];

impl Trade {
    /// The tables in Markdown.
    pub fn markdown(&self) -> String {
        let Circumstances { device, driver, date, shaders, kernels: _, capture, steps, seeds } = &self.at;
        let mut text = format!(
            "# What settings buy\n\n{device}, {driver}, {date}; shaders {shaders}. `{capture}`, {steps} steps, {}. The hash \
             is of the shaders' SPIR-V: where it is no longer that of the kernels, these are numbers of older ones.\n\n\
             Blocks of steps of all settings were run in turn in one process. *Speed*: how many times as fast a step is as with \
             `exact`, over whole runs, median (lowest to highest seed). *To quality*: how many times sooner a run reaches the \
             final PSNR of `exact` minus {QUALITY_GAP_DB} dB; in brackets with how many seeds. Differences are to `exact`, \
             paired by seed, with Student's interval of 95 %. *Equivalent*: two one-sided tests at 5 % put it within \
             {MARGIN_DB} dB, and the worst frame within {WORST_MARGIN_DB} dB. Scores are of the test views, rendered exactly.\n",
            count(seeds.len(), "seed")
        );
        for (kind, title) in [
            (Kind::Preset, "Presets"),
            (Kind::Single, "One setting changed from `exact`"),
            (Kind::Without, "A preset but for one setting"),
        ] {
            let of_kind = self.arms.iter().enumerate().filter(|(_, arm)| arm.kind == kind);
            let rows: Vec<Vec<String>> = of_kind.map(|(index, arm)| row(arm, &self.comparison(index))).collect();
            if !rows.is_empty() {
                let _ = write!(text, "\n## {title}\n\n{}", Table::new(&HEADS, rows).markdown());
            }
        }
        if !self.kernel_errors.is_empty() {
            let error = |error: &KernelError| {
                let KernelError { name, max, p999, psnr } = error;
                vec![
                    name.clone(),
                    format!("{max:.4}"),
                    format!("{p999:.4}"),
                    format!("{psnr:.1}"),
                    error.class().to_owned(),
                ]
            };
            let heads = ["", "largest", "99.9 % below", "PSNR, dB", "class"];
            let table = Table::new(&heads, self.kernel_errors.iter().map(error));
            let _ = write!(
                text,
                "\n## Error of a rendering\n\nOf the scene that `exact` ends with, one test view, against the twin in double \
                 precision; levels of 255.\n\n{}",
                table.markdown()
            );
        }
        text
    }

    /// Speed against PSNR of every arm as a picture; arms that no other beats in both are joined.
    pub fn svg(&self) -> String {
        let points: Vec<(&TradeArm, f64, Estimate)> = (0..self.arms.len())
            .filter_map(|index| {
                let Comparison { speed, psnr_gain, .. } = self.comparison(index);
                Some((&self.arms[index], speed?.median, psnr_gain?))
            })
            .collect();
        let kinds = [Kind::Preset, Kind::Single, Kind::Without];
        let x = Axis::log("speed of a step, times that of exact", points.iter().map(|p| p.1), 2.0, &SPEEDS);
        let y = Axis::around("", points.iter().map(|p| p.2.mean), 0.2).with_ticks(8);
        let [low, high] = y.ends();
        let mark = |(arm, speed, gain): &(&TradeArm, f64, Estimate)| {
            let half = gain.half_width.filter(|_| arm.kind == Kind::Preset && arm.name != "exact");
            Mark {
                at: [*speed, gain.mean],
                range: half.map(|half| [gain.mean - half, gain.mean + half].map(|end| end.clamp(low, high))),
                radius: 5.0,
                title: format!("{}: {speed:.2} times, {:+.2} dB", arm.name, gain.mean),
            }
        };
        let of_kind = |(index, kind): (usize, &Kind)| {
            let marks = points.iter().filter(|(arm, ..)| arm.kind == *kind).map(mark).collect();
            Series { colour: Some(index), is_joined: false, marks }
        };
        let mut front: Vec<Mark> = points.iter().filter(|point| !is_beaten(point, &points)).map(mark).collect();
        front.sort_by(|a, b| a.at[0].total_cmp(&b.at[0]));
        front.iter_mut().for_each(|mark| (mark.range, mark.radius) = (None, 0.0));
        let front = Series { colour: None, is_joined: true, marks: front };
        let panel = Panel {
            title: "PSNR difference from exact, dB; bars: 95 %".to_owned(),
            margin: MARGIN,
            notes: names(&points, &x, &y),
            series: [front].into_iter().chain(kinds.iter().enumerate().map(of_kind)).collect(),
            list: Vec::new(),
            x,
            y,
        };
        Chart::of(panel, SIZE).with_legend(&["presets", "one setting changed", "a preset but for one setting"]).svg()
    }
}

/// Whether another arm is as fast and as good, and better in one of the two.
fn is_beaten((_, speed, gain): &(&TradeArm, f64, Estimate), all: &[(&TradeArm, f64, Estimate)]) -> bool {
    let better = |other: &(&TradeArm, f64, Estimate)| other.1 >= *speed && other.2.mean >= gain.mean;
    all.iter().any(|other| better(other) && (other.1, other.2.mean) != (*speed, gain.mean))
}

/// The names of the presets: each above its point, or below where another is in the way.
fn names(points: &[(&TradeArm, f64, Estimate)], x: &Axis, y: &Axis) -> Vec<Note> {
    let [left, top, right, bottom] = MARGIN;
    let (width, height) = (SIZE[0] - left - right, SIZE[1] - top - bottom);
    let mut taken: Vec<[f64; 2]> = Vec::new();
    let presets = points.iter().filter(|(arm, ..)| arm.kind == Kind::Preset);
    let name = |(arm, speed, gain): &(&TradeArm, f64, Estimate)| {
        let place = [width * x.part(*speed), height * y.part(gain.mean)];
        let is_hit = taken.iter().any(|[x, y]| (x - place[0]).abs() < 90.0 && (y - place[1]).abs() < 20.0);
        taken.push(place);
        Note {
            at: [*speed, gain.mean],
            shift: [9.0, if is_hit { 20.0 } else { -8.0 }],
            anchor: Anchor::Start,
            look: Look::Name(0),
            text: arm.name.clone(),
        }
    };
    presets.map(name).collect()
}

fn row(arm: &TradeArm, compared: &Comparison) -> Vec<String> {
    let times = |spread: &Option<Spread>| {
        spread.map_or("-".to_owned(), |s| format!("{:.2} ({:.2} to {:.2})", s.median, s.low, s.high))
    };
    let to_quality =
        compared.quality_speed.map_or("-".to_owned(), |s| format!("{:.2} ({})", s.median, compared.n_reached));
    let of = |estimate: &Option<Estimate>, decimals: usize, scale: f64| {
        estimate.map_or("-".to_owned(), |e| format!("{:.decimals$}", scale * e.mean))
    };
    let difference = |estimate: &Option<Estimate>| match (arm.name.as_str(), estimate) {
        ("exact", _) | (_, None) => String::new(),
        (_, Some(estimate)) => estimate.signed(2),
    };
    let effect = compared.effect.filter(|_| arm.name != "exact").map_or("", Effect::words);
    vec![
        arm.name.clone(),
        times(&compared.speed),
        to_quality,
        of(&compared.psnr, 2, 1.0),
        difference(&compared.psnr_gain),
        difference(&compared.worst_gain),
        effect.to_owned(),
        of(&compared.ssim, 4, 1.0),
        of(&compared.flicker, 2, 1.0),
        of(&compared.flow_error, 3, 1.0),
        of(&compared.offset_error, 3, 1.0),
        of(&compared.device_bytes, 1, 1.0 / f64::from(1 << 20)),
    ]
}

#[cfg(test)]
mod tests {
    use crate::study::trade::tests::trade;

    #[test]
    fn tables_and_picture_hold_every_arm_and_where_it_was_measured() {
        let found = trade([[-1.0, -1.1, -0.9], [0.3, -0.4, 0.2]]);
        let (table, svg) = (found.markdown(), found.svg());
        for told in [
            "a device, a driver 1.2, 2026-11-21; shaders 0123",
            "| fast | 4.00 (4.00 to 4.00) | - | 24.00 | -1.00 +- 0.25 |",
            "not distinguishable",
            "| exact |",
            "| 1.50 |",
        ] {
            assert!(table.contains(told), "{told}:\n{table}");
        }
        assert!(table.contains("| fast | 63.7500 |") && table.contains("below 40 dB"), "{table}");
        assert_eq!(svg.matches("<circle").count(), 3);
        assert!(svg.contains(">fast</text>") && svg.contains("loss.ssim_stride=2: 1.25 times"));
    }
}
