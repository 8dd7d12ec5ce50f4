//! The report of a run: one HTML file without scripts, other files or network.

use super::curves::{Curve, Plot};
use super::report_picture::{Example, GAIN, RAMP, triples};
use crate::error::{Error, Result};
use crate::files::write_atomic;
use crate::report::{Bar, Table, bars, escape, note, page, section};
use crate::settings::Constants;
use crate::train::{Config, Fall, Kind, Log, Logged, METRICS_OF, Run, SceneScores, Scores, logged};
use crate::words::count;
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;

pub struct Report<'a> {
    pub name: &'a str,
    pub run: &'a Run,
    pub config: &'a Config,
    /// `train.json`; null if the run has none.
    pub totals: &'a Value,
    pub log: &'a Log,
    /// None without test images.
    pub scores: Option<&'a SceneScores>,
    pub examples: &'a [Example],
}

impl Report<'_> {
    #[tracing::instrument(level = "info", name = "write report", skip_all)]
    pub fn write(&self, file: &Path) -> Result<()> {
        let html = self.html().map_err(|e| Error::data(file, "", format!("cannot be made: {e}"), "report this"))?;
        write_atomic(file, |to| to.write_all(html.as_bytes()))
    }

    fn html(&self) -> std::result::Result<String, Box<dyn std::error::Error>> {
        let mut body = section("Course", &format!("<div class=\"plots\">\n{}</div>\n", self.plots()));
        body += &self.views()?;
        body += &self.offsets();
        body += &section("Time and memory of a step", &self.time());
        body += &section("Settings", &self.settings()?);
        body += "<footer>\n";
        for (metric, definition) in self.scores.iter().flat_map(|scores| &scores.metrics) {
            writeln!(body, "<p>{}: {}.</p>", metric.to_uppercase().replace('_', " "), escape(definition))?;
        }
        writeln!(body, "<p>Scores are of {METRICS_OF}.</p>\n</footer>")?;
        Ok(page(self.name, &self.header(), &body))
    }

    fn header(&self) -> String {
        let held = &self.run.held;
        let [width, height] = held.largest_image;
        let mut page = note(&format!(
            "{}: {}, {}, {} and {} of up to {width} x {height}, {}",
            self.run.capture.display(),
            count(held.cameras, "camera"),
            count(held.frames, "frame"),
            count(held.training_images, "training image"),
            count(held.test_images, "test image"),
            count(held.points, "point")
        ));
        if self.config.loss.lacks_lpips_weights() {
            page += &note("LPIPS was off: the run had no weights for it.");
        }
        for line in self.log.lines(Kind::Fall) {
            if let Ok(fall) = serde_json::from_value::<Fall>(line.clone()) {
                page += &format!("<p class=\"warning\">Warning: {}.</p>\n", escape(&fall.to_string()));
            }
        }
        let mut tiles = Vec::new();
        match self.scores {
            Some(s) => {
                let mean = &s.evaluation.mean;
                let of = format!("{} test images; {:.2} aligned", s.evaluation.views.len(), mean.psnr_aligned);
                tiles.push(("PSNR", format!("{:.2} dB", mean.psnr), of));
                tiles.push(("SSIM", format!("{:.4}", mean.ssim), format!("L1 {:.4}", mean.l1)));
                if let Some((lpips, unscaled)) = mean.lpips.zip(mean.lpips_unscaled) {
                    tiles.push(("LPIPS", format!("{lpips:.4}"), format!("unscaled {unscaled:.4}")));
                }
                tiles.push(("Gaussians", s.gaussians.to_string(), format!("{} of them dynamic", s.dynamic_gaussians)));
                let size = format!("SH degree {}, {} bytes each", s.sh_degree, s.bytes / s.gaussians.max(1) as u64);
                tiles.push(("Scene", format!("{:.1} MiB", mib(s.bytes as f64)), size));
                let fps = format!("{:.1}", s.frames_per_second);
                tiles.push(("Frames per second", fps, "colour, on the device".to_owned()));
            }
            None => tiles.push(("Test images", "none".to_owned(), "nothing was scored".to_owned())),
        }
        let number = |key: &str| self.totals[key].as_f64();
        if let (Some(seconds), Some(step)) = (number("seconds_stepping"), number("seconds_per_step")) {
            let detail = format!("{:.0} steps of {:.1} ms", number("steps").unwrap_or(0.0), 1e3 * step);
            tiles.push(("Training", duration(seconds), detail));
        }
        if let Some(bytes) = number("peak_bytes") {
            let host = number("host_peak_bytes").map(|bytes| format!("; the process {:.0} MiB", mib(bytes)));
            let detail = format!("peak, evaluation included{}", host.unwrap_or_default());
            tiles.push(("Device memory", format!("{:.0} MiB", mib(bytes)), detail));
        }
        let tile = |(term, value, detail): (&str, String, String)| {
            let (value, detail) = (escape(&value), escape(&detail));
            format!("<div><dt>{term}</dt><dd>{value}<small>{detail}</small></dd></div>\n")
        };
        format!("{page}<dl class=\"tiles\">\n{}</dl>\n", tiles.into_iter().map(tile).collect::<String>())
    }

    fn plots(&self) -> String {
        let mut plots = String::new();
        let step = |name, key| Curve { name, points: self.log.series(Kind::Step, key) };
        let test = |name, key| Curve { name, points: self.log.series(Kind::Evaluation, key) };
        let plot = |id, title, from_zero, marked| Plot { id, title, from_zero, marked };
        let n = self.log.lines(Kind::Evaluation).last().and_then(|line| line["views"].as_array()).map_or(0, Vec::len);
        let of = if self.totals["backdrop"].as_u64() > Some(0) { ", without the backdrop" } else { "" };
        let psnr = format!("PSNR of the same {n} test images{of}, dB");
        plots += &plot("plot-psnr", &psnr, false, true).figure(&[test("PSNR", "psnr")]);
        plots += &plot("plot-loss", "Loss of training images", true, false).figure(&[step("loss", "loss")]);
        for Logged { key, plot: title, from_zero } in logged().filter(|logged| !logged.plot.is_empty()) {
            let curve = step(title, key);
            if !curve.points.is_empty() {
                let id = format!("plot-{key}");
                plots += &Plot { id: &id, title, from_zero: *from_zero, marked: false }.figure(&[curve]);
            }
        }
        let counts = [step("all", "gaussians"), step("live", "active")];
        plots += &plot("plot-gaussians", "Gaussians", true, false).figure(&counts);
        plots += &plot("plot-intersections", "Pairs of a Gaussian and a tile", true, false)
            .figure(&[step("pairs", "intersections")]);
        plots
    }

    fn views(&self) -> Result<String> {
        let Some(scores) = self.scores else { return Ok(String::new()) };
        let stops: Vec<String> = RAMP.iter().map(|[r, g, b]| format!("rgb({r},{g},{b})")).collect();
        let mut body = format!(
            "<p class=\"ramp\">Absolute error, mean of the channels, x {GAIN}: 0 \
             <i style=\"background: linear-gradient(to right, {})\"></i> {} and above; grey where the mask hides the \
             image.</p>\n<div class=\"views\">\n",
            stops.join(", "),
            1.0 / GAIN
        );
        for (example, urls) in self.examples.iter().zip(triples(self.examples)?) {
            let view = escape(&example.view);
            let Scores { psnr, ssim, .. } = example.scores;
            let why = if example.why.is_empty() { String::new() } else { format!(", the {}", example.why) };
            // Magnified pixels stay pixels.
            let small = if example.truth.width < 300 { " small" } else { "" };
            body += &format!(
                "<figure class=\"view\"><figcaption>{view}{why} \
                 <span>PSNR {psnr:.2} dB, SSIM {ssim:.4}</span></figcaption>\n<div class=\"triple{small}\">\n"
            );
            for (what, url) in ["image", "rendering", "error"].into_iter().zip(urls) {
                body += &format!("<div><img alt=\"{what} of {view}\" src=\"{url}\"><small>{what}</small></div>\n");
            }
            body += "</div></figure>\n";
        }
        body += "</div>\n";
        let rows = scores.evaluation.views.iter().map(|v| (v.view.as_str(), &v.scores));
        let rows = rows.chain([("mean", &scores.evaluation.mean)]).map(|(view, s)| {
            let [psnr, aligned] = [s.psnr, s.psnr_aligned].map(|psnr| format!("{psnr:.3}"));
            let [lpips, unscaled] =
                [s.lpips, s.lpips_unscaled].map(|lpips| lpips.map_or("-".to_owned(), |lpips| format!("{lpips:.4}")));
            vec![view.to_owned(), psnr, aligned, format!("{:.4}", s.ssim), lpips, unscaled, format!("{:.5}", s.l1)]
        });
        let heads = ["view", "PSNR, dB", "aligned", "SSIM", "LPIPS", "LPIPS unscaled", "L1"];
        body += &Table::new(&heads, rows).folded("Scores of every view");
        Ok(section("Test views", &body))
    }

    fn offsets(&self) -> String {
        let rows = self.totals["offsets"].as_array().map_or(&[][..], Vec::as_slice);
        if rows.is_empty() {
            return String::new();
        }
        let mut told = String::new();
        if let Some(error) = self.totals["offset_error"].as_f64() {
            let correlation = self.totals["offset_correlation"].as_f64();
            let correlation =
                correlation.map_or(String::new(), |r| format!("; their correlation with the truth is {r:.3}"));
            told = format!("<p>Those learnt are {error:.3} frames off (root mean square){correlation}.</p>\n");
        }
        let rows = rows.iter().map(|row| {
            let frames = |key: &str| row[key].as_f64().map_or("-".to_owned(), |x| format!("{x:.3}"));
            let text = |key: &str| row[key].as_str().unwrap_or_default().to_owned();
            vec![text("camera"), frames("offset"), frames("standard_error"), frames("truth"), text("how")]
        });
        let table = Table::new(&["camera", "offset", "+-", "true", "how"], rows);
        let head = "Frames; +- is of the camera's own pictures, and doubled for what the scene takes up of a clock";
        section("Time offsets of the cameras", &(told + &table.folded(head)))
    }

    fn time(&self) -> String {
        let profile = &self.totals["profile"];
        let passes = profile["passes"].as_array().map_or(&[][..], Vec::as_slice);
        let mut sections: Vec<Bar> = Vec::new();
        for pass in passes {
            let label = pass["label"].as_str().unwrap_or_default();
            let section = label.split_once('/').map_or(label, |(section, _)| section);
            let ms = pass["ms"].as_f64().unwrap_or(0.0);
            match sections.iter_mut().find(|row| row.label == section) {
                Some(row) => row.ms += ms,
                None => sections.push(Bar { label: section.to_owned(), ms }),
            }
        }
        let mut told = String::new();
        if sections.is_empty() {
            told += &note("The device has no timestamps, or the run was not timed.");
        } else {
            let n = profile["steps"].as_array().map_or(0, Vec::len);
            let title = format!("Sections of a step, mean of {n} steps spread over the run");
            told += &bars("plot-sections", &title, &sections);
        }
        let rows = passes.iter().map(|pass| {
            let label = pass["label"].as_str().unwrap_or_default().to_owned();
            vec![label, pass["dispatches"].to_string(), format!("{:.3}", pass["ms"].as_f64().unwrap_or(0.0))]
        });
        told += &Table::new(&["pass", "dispatches", "ms"], rows).folded("Passes");
        let buffers = self.totals["bytes_by_buffer"].as_object().into_iter().flatten();
        let mut buffers: Vec<(&str, f64)> =
            buffers.map(|(name, n)| (name.as_str(), n.as_f64().unwrap_or(0.0))).collect();
        buffers.sort_by(|a, b| b.1.total_cmp(&a.1));
        let rows = buffers.into_iter().map(|(name, bytes)| vec![name.to_owned(), format!("{:.3}", mib(bytes))]);
        told + &Table::new(&["buffer", "MiB"], rows).folded("Device buffers")
    }

    fn settings(&self) -> serde_json::Result<String> {
        let mut rows = Vec::new();
        flatten("", &as_written(self.config)?, &as_written(&Config::default())?, &mut rows);
        flatten("render", &as_written(&self.run.constants)?, &as_written(&Constants::default())?, &mut rows);
        let is_changed: Vec<bool> = rows.iter().map(|(_, value, default)| value != default).collect();
        let shown = rows.into_iter().zip(&is_changed).map(|((key, value, default), is_changed)| {
            vec![key, value, if *is_changed { default } else { String::new() }]
        });
        let table = Table::new(&["setting", "value", "default"], shown).with_text(3);
        let rows = ["version", "revision"].map(|key| (key, &self.totals[key]));
        let device = [("device", "name"), ("driver", "driver"), ("Vulkan", "api"), ("subgroups of", "subgroup_size")];
        let device = device.map(|(what, key)| (what, &self.totals["device"][key]));
        let told = rows.into_iter().chain(device).filter(|(_, value)| !value.is_null());
        let told: Vec<String> =
            told.map(|(key, v)| format!("{key} {}", v.as_str().unwrap_or(&v.to_string()))).collect();
        Ok(table.html_marked(|row| is_changed[row]) + &note(&told.join(", ")))
    }
}

/// The shortest decimals that are the number.
fn as_written(value: &impl serde::Serialize) -> serde_json::Result<Value> {
    serde_json::from_str(&serde_json::to_string(value)?)
}

/// (Path, value, default) of every leaf.
fn flatten(path: &str, value: &Value, default: &Value, rows: &mut Vec<(String, String, String)>) {
    match value {
        Value::Object(fields) => {
            for (key, field) in fields {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                flatten(&path, field, &default[key], rows);
            }
        }
        leaf => rows.push((path.to_owned(), leaf.to_string(), default.to_string())),
    }
}

fn mib(bytes: f64) -> f64 {
    bytes / f64::from(1 << 20)
}

fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..60 => format!("{seconds:.1} s"),
        60..3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}
