//! The options of all verbs that read a capture: `check`, `prepare`, `train`, `render`, `inspect` and `segments`.

use crate::run::files::word;
use crate::run::settings::contradiction;
use crate::ui::screen::{out, say};
use ivv::internals::prepare::{Recognised, recognise};
use ivv::internals::scene::capture::{Alpha, Capture, CaptureSettings, Fault, Frames, Report, check_capture};
use ivv::internals::train::Run;
use ivv::internals::words::count;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::str::FromStr;

const NAMED: usize = 3;

#[derive(clap::Args)]
pub struct CaptureArgs {
    /// Names of the test cameras, separated by commas. They replace those that the capture declares.
    #[arg(long, value_delimiter = ',')]
    test_cameras: Option<Vec<String>>,
    /// Takes every n-th image as a test image if the capture declares none; 0 for none.
    #[arg(long, default_value_t = CaptureSettings::default().test_every)]
    test_every: usize,
    /// Uses only the first N frames of the clip, or those from A up to, but not including, B, from 0; with S every S-th of them.
    #[arg(long, visible_alias = "frames", value_name = "N|A:B[:S]", value_parser = Frames::from_str)]
    max_frames: Option<Frames>,
    /// Names of cameras to leave out, separated by commas.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    exclude: Vec<String>,
    /// Leaves out images whose file is missing. Without it, each is a fault.
    #[arg(long)]
    skip_missing: bool,
    /// Number of the model in `sparse` of a plain COLMAP project. By default the one with the most images.
    #[arg(long, value_name = "N")]
    model: Option<u32>,
    /// Folder of the images, relative to the capture, if no file names it. Without `images` the largest of `images_2` to
    /// `images_8`.
    #[arg(long, default_value = "images")]
    images: PathBuf,
    /// Takes the folder with `_N` behind its name, as `images_4`: pictures of 1/N of the size.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    downscale: Option<u32>,
    /// Scales the calibration of each camera and axis to the size of its images. Without it, all images must have the same scale.
    #[arg(long)]
    rescale: bool,
    /// Also takes the foreground masks of Dynamic3DGaussians as masks.
    #[arg(long)]
    foreground_masks: bool,
    /// Meaning of the images' alpha: the background shows through it, or it is also the mask of the foreground.
    #[arg(long, value_parser = word::<Alpha>, default_value = "background", value_name = "background|mask")]
    alpha: Alpha,
}

impl CaptureArgs {
    pub fn settings(&self) -> CaptureSettings {
        CaptureSettings {
            test_cameras: self.test_cameras.clone(),
            test_every: self.test_every,
            frames: self.max_frames.unwrap_or_default(),
            exclude: self.exclude.clone(),
            model: self.model,
            skip_missing: self.skip_missing,
            images: self.images.clone(),
            downscale: self.downscale,
            rescale: self.rescale,
            foreground_masks: self.foreground_masks,
            alpha: self.alpha,
            ..CaptureSettings::default()
        }
    }

    /// The options for `settings`, without those of frames and test cameras.
    pub fn words(of: &CaptureSettings) -> Vec<OsString> {
        // All are named, so that nobody forgets a new one here. The last two have no option.
        let CaptureSettings {
            test_cameras: _,
            frames: _,
            test_every,
            exclude,
            model,
            skip_missing,
            foreground_masks,
            images,
            downscale,
            rescale,
            alpha,
            background: _,
            fps: _,
        } = of;
        let mut words = vec!["--test-every".into(), test_every.to_string().into(), "--images".into(), images.into()];
        let mut word =
            |name: &str, value: Option<String>| words.extend(value.map(|value| format!("{name}={value}").into()));
        word("--exclude", Some(exclude.join(",")).filter(|names| !names.is_empty()));
        word("--model", model.map(|model| model.to_string()));
        word("--downscale", downscale.map(|downscale| downscale.to_string()));
        word("--alpha", (*alpha == Alpha::Mask).then(|| "mask".to_owned()));
        let switches =
            [(skip_missing, "--skip-missing"), (rescale, "--rescale"), (foreground_masks, "--foreground-masks")];
        words.extend(switches.into_iter().filter(|(is_asked, _)| **is_asked).map(|(_, name)| name.into()));
        words
    }

    pub fn are_default(&self) -> bool {
        self.settings() == CaptureSettings::default()
    }

    pub fn differ_from(&self, run: &Run) -> Vec<String> {
        let asked = self.settings();
        let names = |cameras: &[String]| cameras.iter().cloned().collect::<BTreeSet<_>>();
        let mut differ = Vec::new();
        if let Some(asked) = asked.test_cameras.as_ref().filter(|asked| names(asked) != names(&run.test_cameras)) {
            let (asked, has) = (asked.join(","), run.test_cameras.join(","));
            differ.push(contradiction("--test-cameras", has, asked));
        }
        let background = run.capture_settings.background;
        let of = |settings: &CaptureSettings| CaptureSettings { test_cameras: None, background, ..settings.clone() };
        if of(&asked) != of(&CaptureSettings::default()) && of(&asked) != of(&run.capture_settings) {
            differ.push("the options of how the capture is read: run.json has those of the run".to_owned());
        }
        differ
    }
}

/// Opens a capture, and prints the notes of the reader. The error of a source for `ivv prepare` says so.
pub fn open(path: &Path, settings: &CaptureSettings) -> ivv::Result<Capture> {
    let capture = match Capture::open_with(path, settings) {
        Ok(capture) if capture.path == path => capture,
        // A recording may contain a capture, for example of one of its frames.
        opened => unprepared(path).map_or(opened, |(_, fault)| Err(fault.into()))?,
    };
    capture.notes.iter().for_each(|note| say!("note: {note}"));
    Ok(capture)
}

/// The report of a capture. That of a source for `ivv prepare` says so.
pub fn check(path: &Path, settings: &CaptureSettings) -> Report {
    let mut report = check_capture(path, settings);
    let is_itself = report.n_faults == 0 && report.path == path;
    if let Some((what, fault)) = (!is_itself).then(|| unprepared(path)).flatten() {
        (report.format, report.n_faults, report.faults) = (what, 1, vec![fault]);
        if report.n_cameras > 0 {
            // It was read as something else.
            report.n_cameras = 0;
            report.notes.clear();
        }
    }
    report
}

/// The kind of a recording that is not a capture yet, and the fault that says so.
fn unprepared(path: &Path) -> Option<(String, Fault)> {
    let Recognised { what, source } = recognise(path)?;
    let fault = Fault {
        file: path.to_owned(),
        place: String::new(),
        reason: format!("expected a capture, found {what}"),
        remedy: format!(
            "run `ivv prepare {} -o CAPTURE`, which makes a capture of it, then use that",
            source.display()
        ),
    };
    Some((what, fault))
}

fn one_line(faults: &[&Fault]) -> String {
    let [first, _, ..] = faults else { return faults.iter().map(|fault| fault.to_string()).collect() };
    let place = |fault: &&Fault| match fault.place.as_str() {
        "" => fault.file.display().to_string(),
        place => format!("{} ({place})", fault.file.display()),
    };
    let named: Vec<String> = faults.iter().take(NAMED).map(place).collect();
    let more = if faults.len() > NAMED { ", ..." } else { "" };
    // Numbers in them may differ.
    let as_one = if faults.iter().all(|fault| fault.reason == first.reason) { ":" } else { ", as:" };
    format!("{} times{as_one} {}; {}: {}{more}", faults.len(), first.reason, first.remedy, named.join(", "))
}

pub fn print_report(report: &Report) {
    let format = if report.format.is_empty() { "unknown format" } else { &report.format };
    out!("{}: {format}", report.path.display());
    if report.n_cameras > 0 {
        print_contents(report);
    }
    for note in &report.notes {
        out!("note:    {note}");
    }
    for faults in report.grouped() {
        out!("fault:   {}", one_line(&faults));
    }
    let n_left_out = report.n_faults - report.faults.len() as u64;
    if n_left_out > 0 {
        out!("and {} more", count(n_left_out, "fault"));
    }
}

fn print_contents(report: &Report) {
    let n_tests = report.n_test_cameras;
    let for_testing = if n_tests > 0 { format!(", of which {n_tests} for testing") } else { String::new() };
    out!("cameras: {}{for_testing}", report.n_cameras);
    if report.n_photos > 0 {
        out!("photos:  {} of the static scene, taken at another time", report.n_photos);
    }
    out!("frames:  {}, {} per second", report.n_frames, report.fps);
    let mib = report.bytes_decoded as f64 / f64::from(1 << 20);
    let masks = [(report.n_masks, "a mask"), (report.n_foregrounds, "a foreground mask")];
    let parts = masks.into_iter().chain([(report.n_flows, "flow"), (report.n_depths, "depth")]);
    let with: String = parts.filter(|(n, _)| *n > 0).map(|(n, what)| format!(", {n} with {what}")).collect();
    out!("images:  {}{with}; {mib:.1} MiB decoded", report.n_images);
    if report.n_sounds > 0 {
        out!("sound:   {}", count(report.n_sounds as u64, "file"));
    }
    let per_frame = if report.has_frame_points { "; every frame has its own" } else { "" };
    if report.n_points > 0 || report.has_frame_points {
        out!("points:  {}{per_frame}", report.n_points);
    }
}
