//! `ivv profile`.

mod kernels;
mod replay;
#[cfg(feature = "shaders")]
mod shader_watch;

use crate::run::device::DeviceArgs;
use crate::run::files::{make_folder, write_json};
use crate::run::settings::SettingArgs;
use crate::run::source::Source;
use crate::ui::progress::{Progress, watch};
use crate::ui::screen::{out, print_json};
use crate::verbs::profile::replay::ReplayArgs;
use anyhow::Context;
use ivv::internals::files::write_atomic;
use ivv::internals::gpu::{Dispatch, Gpu};
use ivv::internals::profile::{
    Comparison, Heat, Moment, Overhead, Peaks, Profile, Recorded, Sample, Sweep, SweepOptions, trace, write_dispatch,
};
use ivv::internals::scene::capture::{Capture, FrameCache, PriorPlan, share_of_memory};
use ivv::internals::scene::read_views;
use ivv::internals::stage::{Outputs, Renderer};
use ivv::internals::train::{
    Checkpoint, Config, Run, Session, SessionOptions, Setup, TermData, reduced_order, training_order,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

#[derive(clap::Args)]
pub struct Args {
    /// A run of `ivv train` (its newest checkpoint; the folder is not changed), a capture (trained a little first), or, with --cameras,
    /// a scene.
    #[arg(required_unless_present_any = ["replay", "disassemble", "list", "compare", "sweep"])]
    subject: Option<PathBuf>,
    /// The folder for profile.json, profile.md, profile.html, roofline.svg and trace.json.
    #[arg(short, long, required_unless_present_any = ["replay", "disassemble", "list", "compare", "feed"])]
    output: Option<PathBuf>,
    /// Cameras to render a scene from: a cameras file.
    #[arg(long)]
    cameras: Option<PathBuf>,
    /// Steps or views to time pass by pass. As many more run without timing, to measure its cost.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..))]
    samples: u64,
    /// Steps of a capture, or views of a scene, to run before timing.
    #[arg(long, default_value_t = 100)]
    warm_up: u64,
    /// Only writes the first dispatch of this kernel, with its buffers, to OUTPUT/KERNEL.dispatch.
    #[arg(long, value_name = "KERNEL")]
    dump: Option<String>,
    /// Prints this kernel's SPIR-V and counts its instructions.
    #[arg(long, conflicts_with_all = ["subject", "replay", "list"])]
    disassemble: Option<String>,
    /// Prints each shader with its kernels, the variants of the shader.
    #[arg(long, conflicts_with = "subject")]
    list: bool,
    /// Compares two profiles, pass by pass: each a profile.json or its folder. Needs no device.
    #[arg(long, num_args = 2, value_names = ["A", "B"], conflicts_with_all = ["subject", "output", "replay", "disassemble", "list"])]
    compare: Vec<PathBuf>,
    /// Only decodes the training images of a capture, in the order of a run, to measure the image feed alone. Needs no device.
    #[arg(long, conflicts_with_all = ["cameras", "dump", "replay", "output"])]
    feed: bool,
    /// Times a step and a frame of made-up scenes against the length of the clip, cameras, pixels and Gaussians, up to this many
    /// Gaussians, and writes sweep.md, sweep.json and sweep.svg to OUTPUT.
    #[arg(long, num_args = 0..=1, default_missing_value = "300000", value_name = "GAUSSIANS",
        value_parser = clap::value_parser!(u64).range(1..), conflicts_with_all = ["subject", "cameras", "dump", "replay", "feed"])]
    sweep: Option<u64>,
    /// Most seconds of --sweep; sizes that would take longer are left out.
    #[arg(long, default_value_t = 240.0, requires = "sweep")]
    seconds: f64,
    #[command(flatten)]
    replay: ReplayArgs,
    /// Where the run's capture is now, if it has moved.
    #[arg(long)]
    capture: Option<PathBuf>,
    #[command(flatten)]
    settings: SettingArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    if args.list {
        return kernels::list(json);
    }
    if let Some(kernel) = &args.disassemble {
        return replay::disassemble(kernel, json);
    }
    if let [a, b] = args.compare.as_slice() {
        return compare(a, b, json);
    }
    if args.replay.file().is_some() {
        let gpu = args.device.open()?;
        return replay::run(&args.replay, &gpu, json);
    }
    if let (true, Some(subject)) = (args.feed, &args.subject) {
        return feed(args, &Capture::open(subject)?, json);
    }
    if let (Some(most), Some(output)) = (args.sweep, &args.output) {
        return sweep(args, most as usize, output, json);
    }
    let (Some(subject), Some(output)) = (&args.subject, &args.output) else {
        anyhow::bail!("give -o, the folder for the results")
    };
    if let Some(kernel) = &args.dump {
        kernels::named("--dump", kernel)?;
    }
    let config = args.settings.resolve()?;
    make_folder(output)?;
    let gpu = args.device.open()?;
    if args.cameras.is_some() || subject.is_file() {
        return scene(args, subject, output, &gpu, json);
    }
    training(args, config, subject, output, &gpu, json)
}

/// Takes every image as soon as it is decoded.
fn feed(args: &Args, capture: &Capture, json: bool) -> anyhow::Result<()> {
    let config = args.settings.resolve()?;
    let frames = capture.training_frames();
    let total = config.total(frames.len() as u64);
    let order = training_order(&frames, config.seed, 0, total);
    let asked = reduced_order(&order, &config, 0, total);
    let threads = ivv::internals::parallel::threads();
    let n_first = frames.len().min(total as usize);
    let begun = Instant::now();
    // Depths as they are in their files: fits to points only scale them.
    let TermData { depth, flow } = Setup::new(capture, &config).data;
    let depth = frames.iter().filter(|_| depth).map(|image| (*image, [1.0, 0.0])).collect();
    let mut cache = FrameCache::new(capture, asked, &PriorPlan { flow, depth }, share_of_memory(), threads)?;
    // Until every image is decoded once. Later ones come from memory if they fit.
    let mut progress = Progress::new("feed", n_first);
    let (mut pixels, mut bytes) = (0, 0);
    for _ in 0..n_first {
        let Some(picture) = cache.next_picture() else { break };
        let picture = picture?;
        pixels += picture.pixels.len();
        bytes += picture.bytes();
        progress.step("images");
    }
    let seconds = begun.elapsed().as_secs_f64();
    let first = cache.stats();
    let mut again = 0;
    let begun = Instant::now();
    while let Some(picture) = cache.next_picture() {
        picture?;
        again += 1;
    }
    let (rest, stats) = (begun.elapsed().as_secs_f64(), cache.stats());
    let per_second = n_first as f64 / seconds;
    let decode_ms = 1e3 * stats.decoding.as_secs_f64() / stats.n_decoded.max(1) as f64;
    if json {
        let report = serde_json::json!({
            "images": n_first, "mean_pixels": pixels / n_first.max(1), "mean_bytes": bytes / n_first.max(1), "threads": threads,
            "images_per_second": per_second, "decode_ms": decode_ms, "peak_bytes": first.peak_bytes,
            "later_images": again, "later_images_per_second": f64::from(again) / rest, "hits": stats.n_hits,
        });
        return print_json(&report);
    }
    let mean = |sum: usize| sum / n_first.max(1);
    out!("{n_first} images of {} pixels, {} bytes, on {threads} threads", mean(pixels), mean(bytes));
    out!("first epoch:  {per_second:.0} images/s, {decode_ms:.1} ms each in a thread");
    if again > 0 {
        let (later, hits) = (f64::from(again) / rest, stats.n_hits);
        out!("later epochs: {later:.0} images/s; {hits} of {again} were in memory");
    }
    out!("memory: {:.0} MiB at most", stats.peak_bytes as f64 / f64::from(1 << 20));
    Ok(())
}

fn compare(a: &Path, b: &Path, json: bool) -> anyhow::Result<()> {
    let compared = Comparison::new((a, &Recorded::read(a)?), (b, &Recorded::read(b)?));
    if json {
        print_json(&compared)?;
    } else {
        out!("{}", compared.terminal().trim_end());
    }
    Ok(())
}

fn sweep(args: &Args, most_gaussians: usize, output: &Path, json: bool) -> anyhow::Result<()> {
    anyhow::ensure!(args.seconds > 0.0, "--seconds: expected how long it may take, above 0, found {}", args.seconds);
    let adam = args.settings.resolve()?.adam;
    make_folder(output)?;
    let gpu = args.device.open()?;
    let options = SweepOptions { most_gaussians, seconds: args.seconds, adam, ..SweepOptions::default() };
    let mut progress = Progress::new("sweep", options.points());
    let sweep = Sweep::measure(&gpu, &options, &mut || progress.step("sizes"))?;
    write_json(&output.join("sweep.json"), &sweep)?;
    for (file, text) in [("sweep.md", sweep.markdown()), ("sweep.svg", sweep.svg())] {
        write_atomic(&output.join(file), |to| to.write_all(text.as_bytes()))?;
    }
    if json {
        return print_json(&sweep);
    }
    out!("{}", sweep.terminal().trim_end());
    out!("{}", output.join("sweep.svg").display());
    Ok(())
}

struct Measurement {
    sample: &'static str,
    samples: Vec<Sample>,
    moments: Vec<Moment>,
    /// Milliseconds of the host's clock, with timestamps and without.
    timed: Vec<f64>,
    plain: Vec<f64>,
}

impl Measurement {
    fn new(sample: &'static str) -> Self {
        Measurement { sample, samples: Vec::new(), moments: Vec::new(), timed: Vec::new(), plain: Vec::new() }
    }

    fn write(self, gpu: &Gpu, peaks: Peaks, subject: &Path, output: &Path, json: bool) -> anyhow::Result<()> {
        let overhead = Overhead::new(&self.timed, &self.plain);
        let name = subject.file_name().unwrap_or(subject.as_os_str()).to_string_lossy().into_owned();
        let profile = Profile::new(name, self.sample, gpu.caps(), peaks, &self.samples, overhead);
        write_json(&output.join("profile.json"), &profile)?;
        write_json(&output.join("trace.json"), &trace(&gpu.caps().name, &self.moments))?;
        for (file, text) in
            [("profile.html", profile.html()), ("profile.md", profile.markdown()), ("roofline.svg", profile.roofline())]
        {
            write_atomic(&output.join(file), |to| to.write_all(text.as_bytes()))?;
        }
        if json {
            return print_json(&profile);
        }
        out!("{}", profile.terminal().trim_end());
        out!("{}", output.join("profile.html").display());
        Ok(())
    }
}

fn write_dump(dispatch: Option<Dispatch>, kernel: &str, output: &Path, gpu: &Gpu, json: bool) -> anyhow::Result<()> {
    let dispatch =
        dispatch.with_context(|| format!("no pass here runs the kernel {kernel}{}", kernels::like(kernel)))?;
    let file = output.join(format!("{kernel}.dispatch"));
    write_dispatch(&file, &dispatch, gpu)?;
    if json {
        out!("{}", serde_json::json!({ "path": file.to_string_lossy(), "kernel": kernel }));
    } else {
        out!("{}", file.display());
    }
    Ok(())
}

fn scene(args: &Args, subject: &Path, output: &Path, gpu: &Arc<Gpu>, json: bool) -> anyhow::Result<()> {
    anyhow::ensure!(
        args.settings.resolve()? == Config::default(),
        "a scene is drawn without the settings of a training; leave their flags out, or profile a capture with them"
    );
    let views = read_views(args.cameras.as_deref().context("give --cameras to profile a scene")?)?;
    let source = Source::open(subject)?;
    let splats = source.scene()?.splats;
    let peaks = if args.dump.is_none() { Some(Peaks::measure(gpu)?) } else { None };
    let mut renderer = Renderer::new(gpu.clone(), &splats, source.look.constants)?;
    let Some(first) = views.first() else { anyhow::bail!("the cameras file has no view; add one") };
    let Some(peaks) = peaks else {
        let kernel = args.dump.as_deref().unwrap_or_default();
        return write_dump(renderer.dump(first, Outputs::Color, kernel)?, kernel, output, gpu, json);
    };
    let mut measured = Measurement::new("view");
    let mut progress = Progress::new("profile", args.samples as usize);
    // Kernels are compiled at their first dispatch, and lists grow to their size.
    for view in views.iter().cycle().take((args.warm_up as usize).clamp(1, views.len())) {
        renderer.draw(view, Outputs::Color)?;
    }
    let start = Instant::now();
    let mut heat = Heat::new(gpu)?;
    for view in views.iter().cycle().take(args.samples as usize) {
        heat.before(gpu)?;
        let begun = Instant::now();
        renderer.draw(view, Outputs::Color)?;
        measured.plain.push(1e3 * begun.elapsed().as_secs_f64());
        heat.before(gpu)?;
        let begun = Instant::now();
        let report = renderer.profile(view, Outputs::Color)?;
        let seconds = begun.elapsed().as_secs_f64() - report.counting_s;
        measured.timed.push(1e3 * seconds);
        let begin = (begun - start).as_secs_f64();
        measured.moments.push(Moment { name: view.name.clone(), begin, seconds, passes: report.times });
        measured.samples.push(Sample { passes: report.passes, counters: report.counters, barriers: report.barriers });
        progress.step("views");
    }
    measured.write(gpu, peaks, subject, output, json)
}

fn training(
    args: &Args,
    config: Config,
    subject: &Path,
    output: &Path,
    gpu: &Arc<Gpu>,
    json: bool,
) -> anyhow::Result<()> {
    // The device alone, before its memory fills.
    let peaks = if args.dump.is_none() { Some(Peaks::measure(gpu)?) } else { None };
    let is_run = Run::file(subject).is_file();
    let warm_up = if is_run { 2 } else { args.warm_up };
    let steps = warm_up + 2 * args.samples;
    let capture =
        if is_run { Run::read(subject)?.open_capture(args.capture.as_deref())? } else { Capture::open(subject)? };
    let mut session = if is_run {
        resumed(args, subject, &capture, gpu, steps)?
    } else {
        let total = config.total(capture.training_frames().len() as u64).max(steps);
        let options = SessionOptions { total: Some(total), watch: watch(), ..SessionOptions::default() };
        Session::begin(gpu.clone(), &capture, config, options)?
    };
    let mut measured = Measurement::new("step");
    let mut progress = Progress::new("profile", steps as usize);
    let start = Instant::now();
    let mut heat = Heat::new(gpu)?;
    for step in 0..steps {
        if step >= warm_up && args.dump.is_none() {
            // Work that is due after the last step does not count for the next one.
            session.wait()?;
            session.settle()?;
            heat.before(gpu)?;
        }
        match (step.checked_sub(warm_up), &args.dump) {
            (None, _) => drop(session.step()?),
            (Some(_), Some(kernel)) => return write_dump(session.dump(kernel)?, kernel, output, gpu, json),
            (Some(number), None) if number % 2 == 0 => {
                let before = session.seconds();
                session.step()?;
                session.wait()?;
                measured.plain.push(1e3 * (session.seconds() - before));
            }
            (Some(_), None) => {
                let Some(step) = session.profile()? else { break };
                measured.timed.push(1e3 * step.host.iter().map(|(.., seconds)| seconds).sum::<f64>());
                for (name, begun, seconds) in step.host {
                    let passes = if name == "submit and wait" { step.times.clone() } else { Vec::new() };
                    let begin = (begun - start).as_secs_f64();
                    measured.moments.push(Moment { name: name.to_owned(), begin, seconds, passes });
                }
                measured.samples.push(Sample { passes: step.passes, counters: step.counters, barriers: step.barriers });
            }
        }
        progress.step("steps");
    }
    measured.write(gpu, peaks.unwrap_or_default(), subject, output, json)
}

/// The run in `folder` as its newest checkpoint left it, with at least `steps` to go.
fn resumed(
    args: &Args,
    folder: &Path,
    capture: &Capture,
    gpu: &Arc<Gpu>,
    steps: u64,
) -> anyhow::Result<Session<'static>> {
    let checkpoint = Checkpoint::newest(&folder.join("checkpoints"))?;
    let mut checkpoint =
        checkpoint.context("the run has no checkpoint yet; train it longer, or profile its capture")?;
    let differ = args.settings.contradictions(&checkpoint.config)?;
    anyhow::ensure!(
        differ.is_empty(),
        "a run is profiled with its own settings, and other flags contradict them: {}; leave these flags out, or profile its \
         capture with them",
        differ.join("; ")
    );
    checkpoint.total = checkpoint.total.max(checkpoint.step + steps);
    let constants = Run::read(folder)?.constants;
    let options = SessionOptions { constants, watch: watch(), ..SessionOptions::default() };
    Ok(Session::resume(gpu.clone(), capture, &checkpoint, options)?)
}
