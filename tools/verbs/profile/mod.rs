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
use crate::ui::screen::{answer, out, print_json};
use crate::verbs::profile::replay::ReplayArgs;
use anyhow::Context;
use ivv::internals::files::write_atomic;
use ivv::internals::gpu::{Dispatch, Gpu};
use ivv::internals::profile::{
    Comparison, Moment, Overhead, Peaks, Profile, Recorded, Sample, Sweep, SweepOptions, WarmUp, trace, write_dispatch,
};
use ivv::internals::scene::capture::{Capture, FrameCache, PriorPlan, share_of_memory};
use ivv::internals::scene::read_views;
use ivv::internals::stage::{FrameReport, Outputs, Renderer};
use ivv::internals::train::{
    Checkpoint, Config, Run, Session, SessionOptions, Setup, TermData, reduced_order, training_order,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

#[derive(clap::Args)]
pub struct Args {
    /// A run (its newest checkpoint; the folder is not changed), a capture (trained a little first), or, with --cameras, a scene.
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
    /// Times a step and a frame of made-up scenes of up to GAUSSIANS Gaussians, and writes sweep.md, sweep.json and sweep.svg.
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
    if let Some(file) = &args.replay.replay {
        return replay::run(&args.replay, file, &*args.device.open()?, json);
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
    let job = Job { args, subject, output, gpu: args.device.open()?, json };
    if args.cameras.is_some() || subject.is_file() { job.scene() } else { job.training(config) }
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
    let (pixels, bytes) = (pixels / n_first.max(1), bytes / n_first.max(1));
    let (later, hits) = (f64::from(again) / rest, stats.n_hits);
    if json {
        let report = serde_json::json!({
            "images": n_first, "mean_pixels": pixels, "mean_bytes": bytes, "threads": threads, "images_per_second": per_second,
            "decode_ms": decode_ms, "peak_bytes": first.peak_bytes, "later_images": again, "later_images_per_second": later,
            "hits": hits,
        });
        return print_json(&report);
    }
    out!("{n_first} images of {pixels} pixels, {bytes} bytes, on {threads} threads");
    out!("first epoch:  {per_second:.0} images/s, {decode_ms:.1} ms each in a thread");
    if again > 0 {
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

/// A profile of `subject`, into the folder `output`.
struct Job<'a> {
    args: &'a Args,
    subject: &'a Path,
    output: &'a Path,
    gpu: Arc<Gpu>,
    json: bool,
}

#[derive(Default)]
struct Measurement {
    samples: Vec<Sample>,
    moments: Vec<Moment>,
    /// Milliseconds of the host's clock, with timestamps and without.
    timed: Vec<f64>,
    plain: Vec<f64>,
}

impl Job<'_> {
    /// Writes what was `measured` of views or steps, as `sample` calls them.
    fn write(&self, sample: &'static str, peaks: Peaks, measured: &Measurement) -> anyhow::Result<()> {
        let Measurement { samples, moments, timed, plain } = measured;
        let name = self.subject.file_name().unwrap_or(self.subject.as_os_str()).to_string_lossy().into_owned();
        let caps = self.gpu.caps();
        let profile = Profile::new(name, sample, caps, peaks, samples, Overhead::new(timed, plain));
        write_json(&self.output.join("profile.json"), &profile)?;
        write_json(&self.output.join("trace.json"), &trace(&caps.name, moments))?;
        let page = self.output.join("profile.html");
        write_atomic(&page, |to| to.write_all(profile.html().as_bytes()))?;
        write_atomic(&self.output.join("profile.md"), |to| to.write_all(profile.markdown().as_bytes()))?;
        write_atomic(&self.output.join("roofline.svg"), |to| to.write_all(profile.roofline().as_bytes()))?;
        if self.json {
            return print_json(&profile);
        }
        out!("{}", profile.terminal().trim_end());
        out!("{}", page.display());
        Ok(())
    }

    fn write_dump(&self, dispatch: Option<Dispatch>, kernel: &str) -> anyhow::Result<()> {
        let none = || format!("no pass here runs the kernel {kernel}{}", kernels::like(kernel));
        let file = self.output.join(format!("{kernel}.dispatch"));
        write_dispatch(&file, &dispatch.with_context(none)?, &self.gpu)?;
        let path = file.to_string_lossy();
        answer(self.json, &serde_json::json!({ "path": path, "kernel": kernel }), &path);
        Ok(())
    }

    fn scene(&self) -> anyhow::Result<()> {
        let Job { args, subject, gpu, .. } = self;
        anyhow::ensure!(
            args.settings.resolve()? == Config::default(),
            "a scene is drawn without the settings of a training; leave their flags out, or profile a capture with them"
        );
        let views = read_views(args.cameras.as_deref().context("give --cameras to profile a scene")?)?;
        let first = views.first().context("the cameras file has no view; add one")?;
        let source = Source::open(subject)?;
        let splats = source.scene()?.splats;
        let renderer = || Renderer::new(gpu.clone(), &splats, source.look.constants);
        if let Some(kernel) = &args.dump {
            return self.write_dump(renderer()?.dump(first, Outputs::Color, kernel)?, kernel);
        }
        // The device alone, before its memory fills.
        let peaks = Peaks::measure(gpu)?;
        let mut renderer = renderer()?;
        let mut measured = Measurement::default();
        let mut progress = Progress::new("profile", args.samples as usize);
        // Kernels are compiled at their first dispatch, and lists grow to their size.
        for view in views.iter().cycle().take((args.warm_up as usize).clamp(1, views.len())) {
            renderer.draw(view, Outputs::Color)?;
        }
        let start = Instant::now();
        let mut heat = WarmUp::new(gpu)?;
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
            let FrameReport { passes, counters, barriers, .. } = report;
            measured.samples.push(Sample { passes, counters, barriers });
            progress.step("views");
        }
        self.write("view", peaks, &measured)
    }

    fn training(&self, config: Config) -> anyhow::Result<()> {
        let Job { args, subject, gpu, .. } = self;
        // The device alone, before its memory fills.
        let peaks = if args.dump.is_none() { Peaks::measure(gpu)? } else { Peaks::default() };
        let run = if Run::file(subject).is_file() { Some(Run::read(subject)?) } else { None };
        let warm_up = if run.is_some() { 2 } else { args.warm_up };
        let steps = warm_up + 2 * args.samples;
        let capture = match &run {
            Some(run) => run.open_capture(args.capture.as_deref())?,
            None => Capture::open(subject)?,
        };
        let mut session = match &run {
            Some(run) => self.resumed(run, &capture, steps)?,
            None => {
                let total = config.total(capture.training_frames().len() as u64).max(steps);
                let options = SessionOptions { total: Some(total), watch: watch(), ..SessionOptions::default() };
                Session::begin(gpu.clone(), &capture, config, options)?
            }
        };
        let mut measured = Measurement::default();
        let mut progress = Progress::new("profile", steps as usize);
        let start = Instant::now();
        let mut heat = WarmUp::new(gpu)?;
        for _ in 0..warm_up {
            session.step()?;
            progress.step("steps");
        }
        if let Some(kernel) = &args.dump {
            return self.write_dump(session.dump(kernel)?, kernel);
        }
        for number in 0..2 * args.samples {
            // Work that is due after the last step does not count for the next one.
            session.wait()?;
            session.settle()?;
            heat.before(gpu)?;
            if number % 2 == 0 {
                let before = session.seconds();
                session.step()?;
                session.wait()?;
                measured.plain.push(1e3 * (session.seconds() - before));
            } else {
                let Some(step) = session.profile()? else { break };
                measured.timed.push(1e3 * step.host.iter().map(|(.., seconds)| seconds).sum::<f64>());
                for (name, begun, seconds) in step.host {
                    let passes = if name == "submit and wait" { step.times.clone() } else { Vec::new() };
                    let begin = (begun - start).as_secs_f64();
                    measured.moments.push(Moment { name: name.to_owned(), begin, seconds, passes });
                }
                measured.samples.push(Sample { passes: step.passes, counters: step.counters, barriers: step.barriers });
            }
            progress.step("steps");
        }
        self.write("step", peaks, &measured)
    }

    /// The session of `run` as its newest checkpoint left it, with at least `steps` to go.
    fn resumed(&self, run: &Run, capture: &Capture, steps: u64) -> anyhow::Result<Session<'static>> {
        let checkpoint = Checkpoint::newest(&self.subject.join("checkpoints"))?;
        let mut checkpoint =
            checkpoint.context("the run has no checkpoint yet; train it longer, or profile its capture")?;
        let differ = self.args.settings.contradictions(&checkpoint.config)?;
        anyhow::ensure!(
            differ.is_empty(),
            "a run is profiled with its own settings, and other flags contradict them: {}; leave these flags out, or profile its \
             capture with them",
            differ.join("; ")
        );
        checkpoint.total = checkpoint.total.max(checkpoint.step + steps);
        let options = SessionOptions { constants: run.constants, watch: watch(), ..SessionOptions::default() };
        Ok(Session::resume(self.gpu.clone(), capture, &checkpoint, options)?)
    }
}
