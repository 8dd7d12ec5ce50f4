//! `ivv render`.

use crate::Interrupted;
use crate::progress::Progress;
use anyhow::Context;
use ivv::Constants;
use ivv::gpu::{Gpu, Options};
use ivv::scene::{Frame, View, read_scene, read_views};
use ivv::stage::{FrameReport, Outputs, PassReport, Renderer};
use ivv::vk::{Caps, DeviceChoice, DeviceKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Cost of a dispatch with its barrier on lavapipe, nanoseconds (research, kernels.md 1.2).
const DISPATCH_NS: f64 = 14_000.0;

/// Options of `ivv render`.
#[derive(clap::Args)]
pub struct Args {
    /// A scene file: 3DGS or compressed PLY, .splat, .spz, or the folder or meta.json of a SOG.
    #[arg(long)]
    scene: PathBuf,
    /// Cameras, JSON (SPEC 9).
    #[arg(long)]
    cameras: PathBuf,
    /// The folder for the pictures.
    #[arg(short, long)]
    output: PathBuf,
    /// What to write: png (colour), exr (all outputs as named channels), safetensors (all outputs).
    #[arg(long, value_delimiter = ',', default_value = "png")]
    format: Vec<Format>,
    /// Print the time of every pass, its share and its fraction of the ideal-limit model.
    #[arg(long)]
    profile: bool,
    /// The device: an index or part of a name from `ivv devices`.
    #[arg(long)]
    device: Option<String>,
    #[command(flatten)]
    constants: ConstantArgs,
}

/// The rendering constants of SPEC 3 as options.
#[derive(clap::Args)]
pub struct ConstantArgs {
    /// A Gaussian contributes to a pixel when its alpha there is at least this.
    #[arg(long, default_value_t = Constants::default().alpha_min)]
    alpha_min: f32,
    /// Alpha is clamped to this.
    #[arg(long, default_value_t = Constants::default().alpha_max)]
    alpha_max: f32,
    /// A pixel is finished when the next Gaussian would bring its transmittance below this.
    #[arg(long, default_value_t = Constants::default().t_min)]
    t_min: f32,
    /// Variance added to the projected covariance, square pixels.
    #[arg(long, default_value_t = Constants::default().blur)]
    blur: f32,
    /// Gaussians at most this far before the camera are dropped, scene units.
    #[arg(long, default_value_t = Constants::default().near)]
    near: f32,
}

impl ConstantArgs {
    /// The constants, each in the range in which SPEC 3 makes sense.
    pub fn checked(&self) -> anyhow::Result<Constants> {
        let Self { alpha_min, alpha_max, t_min, blur, near } = *self;
        let checks = [
            (alpha_min > 0.0 && alpha_min < 1.0, "--alpha-min must lie between 0 and 1"),
            (alpha_max >= alpha_min && alpha_max < 1.0, "--alpha-max must lie between --alpha-min and 1"),
            ((0.0..1.0).contains(&t_min), "--t-min must be at least 0 and below 1"),
            (blur > 0.0 && blur.is_finite(), "--blur must be positive"),
            (near > 0.0 && near.is_finite(), "--near must be positive"),
        ];
        for (holds, message) in checks {
            anyhow::ensure!(holds, message);
        }
        Ok(Constants { alpha_min, alpha_max, t_min, blur, near })
    }
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    Png,
    Exr,
    Safetensors,
}

impl Format {
    fn write(self, frame: &Frame, folder: &Path, view: &View) -> ivv::Result<()> {
        match self {
            Format::Png => frame.write_png(&folder.join(format!("{}.png", view.name))),
            Format::Exr => frame.write_exr(&folder.join(format!("{}.exr", view.name))),
            Format::Safetensors => frame.write_safetensors(&folder.join(format!("{}.safetensors", view.name))),
        }
    }
}

#[derive(serde::Serialize)]
struct ViewReport {
    name: String,
    width: u32,
    height: u32,
    seconds: f64,
    #[serde(flatten)]
    frame: FrameReport,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let constants = args.constants.checked()?;
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).context("no handler for Ctrl-C")?;
    let views = read_views(&args.cameras)?;
    let splats = read_scene(&args.scene)?;
    std::fs::create_dir_all(&args.output).map_err(|e| {
        ivv::Error::data(&args.output, "", format!("cannot be made: {e}"), "choose another folder with -o")
    })?;
    let choice = DeviceChoice {
        device: args.device.clone(),
        pipeline_cache: cache_folder().map(|folder| folder.join("pipelines.bin")),
        ..DeviceChoice::default()
    };
    let gpu = Arc::new(Gpu::open(&Options { device: choice, ..Options::default() })?);
    eprintln!("device: {} ({})", gpu.caps().name, gpu.chosen_because());
    let mut renderer = Renderer::new(gpu.clone(), &splats, constants)?;
    drop(splats);

    let outputs = if args.format.iter().all(|f| *f == Format::Png) { Outputs::Color } else { Outputs::All };
    let mut progress = Progress::new("view", views.len());
    let mut reports = Vec::new();
    for view in &views {
        if stop.load(Ordering::Relaxed) {
            return Err(Interrupted("the files written so far are complete").into());
        }
        if args.profile && reports.is_empty() {
            // Kernels are compiled at their first dispatch, and lists grow to their size.
            renderer.render(view, outputs)?;
        }
        let start = Instant::now();
        let (frame, report) =
            if args.profile { renderer.profile(view, outputs)? } else { renderer.render(view, outputs)? };
        let seconds = start.elapsed().as_secs_f64();
        check_finite(&frame, view)?;
        for format in &args.format {
            format.write(&frame, &args.output, view)?;
        }
        progress.step(&format!(
            "{}, {} Gaussians, {} intersections, {:.1} ms",
            view.name,
            report.gaussians,
            report.intersections,
            1e3 * seconds
        ));
        reports.push(ViewReport {
            name: view.name.clone(),
            width: view.width,
            height: view.height,
            seconds,
            frame: report,
        });
    }
    let bad = reports.iter().map(|r| r.frame.bad_gaussians).max().unwrap_or(0);
    if bad > 0 {
        eprintln!("ivv: {bad} Gaussians have parameters that are not finite; they were not drawn");
    }
    let profile = args.profile.then(|| merge(&reports));
    let peak_bytes = gpu.device().memory().1;
    if json {
        let caps = gpu.caps();
        let report = serde_json::json!({
            "device": caps, "constants": constants, "views": reports, "profile": profile, "peak_bytes": peak_bytes,
        });
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else if let Some(profile) = &profile {
        print_profile(profile, gpu.caps(), &reports);
        println!("peak of device buffers: {:.1} MiB", peak_bytes as f64 / f64::from(1 << 20));
    }
    Ok(())
}

/// SPEC 10: a picture with a value that is not finite is an error, not a picture.
fn check_finite(frame: &Frame, view: &View) -> ivv::Result<()> {
    let values = frame.color.as_flattened().iter().chain(&frame.alpha).chain(&frame.depth);
    let values = values.chain(&frame.inverse_depth).chain(frame.flow.as_flattened());
    let count = values.filter(|v| !v.is_finite()).count() as u64;
    if count > 0 {
        return Err(ivv::Error::NonFinite { what: format!("view `{}`", view.name), count });
    }
    Ok(())
}

/// `$XDG_CACHE_HOME/ivv` or `~/.cache/ivv`.
pub fn cache_folder() -> Option<PathBuf> {
    let cache = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    cache.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cache"))).map(|c| c.join("ivv"))
}

/// The profiles of all views, added up by label.
fn merge(reports: &[ViewReport]) -> Vec<PassReport> {
    let mut sum: Vec<PassReport> = Vec::new();
    for pass in reports.iter().flat_map(|r| &r.frame.passes) {
        match sum.iter_mut().find(|line| line.label == pass.label) {
            Some(line) => {
                line.dispatches += pass.dispatches;
                line.ns += pass.ns;
                line.units += pass.units;
                line.limit_ns += pass.limit_ns;
            }
            None => sum.push(pass.clone()),
        }
    }
    sum
}

fn print_profile(profile: &[PassReport], caps: &Caps, reports: &[ViewReport]) {
    let total: f64 = profile.iter().map(|line| line.ns).sum();
    let views = reports.len().max(1) as f64;
    let mean = |f: fn(&FrameReport) -> u64| reports.iter().map(|r| f(&r.frame)).sum::<u64>() as f64 / views;
    println!(
        "per view: {:.0} active, {:.0} visible, {:.0} intersections, {:.0} tiles",
        mean(|f| f.active),
        mean(|f| f.visible),
        mean(|f| f.intersections),
        mean(|f| f.tiles)
    );
    // The unit costs are lavapipe's; for other devices there is no measured model yet, and none is printed.
    let cores = (caps.kind == DeviceKind::Cpu).then(cpu_threads);
    let limit_of = |line: &PassReport, cores: f64| line.limit_ns / cores + DISPATCH_NS * line.dispatches as f64;
    println!("{:<40} {:>6} {:>10} {:>7} {:>12} {:>9}", "pass", "calls", "ms/view", "share", "units/view", "of limit");
    let row = |label: &str, calls: u64, ns: f64, units: u64, limit: Option<f64>| {
        let of_limit = limit.map_or("-".to_owned(), |limit| format!("{:.0} %", 100.0 * limit / ns.max(1.0)));
        println!(
            "{label:<40} {:>6} {:>10.3} {:>6.1}% {:>12.0} {of_limit:>9}",
            calls as f64 / views,
            ns / 1e6 / views,
            100.0 * ns / total,
            units as f64 / views,
        );
    };
    for line in profile {
        row(&line.label, line.dispatches, line.ns, line.units, cores.map(|c| limit_of(line, c)));
    }
    let calls = profile.iter().map(|line| line.dispatches).sum();
    let limit = cores.map(|c| profile.iter().map(|line| limit_of(line, c)).sum());
    row("frame", calls, total, 0, limit);
}

/// Threads that a CPU driver works with.
fn cpu_threads() -> f64 {
    let asked = std::env::var("LP_NUM_THREADS").ok().and_then(|n| n.parse::<usize>().ok()).filter(|n| *n > 0);
    asked.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, std::num::NonZero::get)) as f64
}
