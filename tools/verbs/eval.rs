//! `ivv eval`, and the scoring that `ivv train` shares with it.

use anyhow::Context;

use crate::behind::both;
use crate::device::DeviceArgs;
use crate::files::{make_folder, read_json, write_json};
use crate::progress::Progress;
use crate::screen::{alert, out};
use crate::shown::{Gaussians, Source};
use ivv::gpu::Gpu;
use ivv::scene::capture::Capture;
use ivv::scene::{Frame, Mapped, Splats};
use ivv::stage::{Outputs, Renderer};
use ivv::study::{Example, Report, strip};
use ivv::train::{
    Config, Evaluation, Log, METRICS_OF, Meter, OffsetFit, Run, SceneScores, SceneSize, Scores, Segments, Setup, Sight,
    ViewScores, evaluate, fit_offset, offset_pictures, spread,
};
use ivv::words::count;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Once};

/// Steps of the fit of a test camera's time offset.
const FIT_ITERATIONS: usize = 4;
/// Test views that a report shows at most.
const EXAMPLES: usize = 8;
/// Test views that an evaluation during the run shows.
const SHOWN: usize = 3;

/// Options of `ivv eval`.
#[derive(clap::Args)]
pub struct Args {
    /// The folder of a run of `ivv train`. Where it has not ended, its newest checkpoint is scored, into
    /// RUN/eval/step-STEP.
    run: PathBuf,
    /// Another scene to score, with the rendering constants that its file names and otherwise the usual ones; its scores go to
    /// RUN/eval/NAME, named as its folder, or as its file with the ending.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// The capture, if it has moved since the run.
    #[arg(long)]
    capture: Option<PathBuf>,
    /// Fits the time offset of every test camera to its own images, and gives the scores at these offsets too.
    #[arg(long)]
    fit_offsets: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

/// Everything about a run that its scores depend on, but for the scene.
#[derive(Clone, Copy)]
pub struct Scorer<'a> {
    pub gpu: &'a Arc<Gpu>,
    pub capture: &'a Capture,
    pub run: &'a Run,
    pub config: &'a Config,
}

impl Scorer<'_> {
    /// Scores `splats` on `frames`, and shows a few of them; none when there is no frame, or masks hide all.
    pub fn some(
        &self,
        splats: &Splats,
        frames: &[(usize, u32)],
        step: u64,
    ) -> ivv::Result<Option<(Evaluation, Vec<Example>)>> {
        let mut renderer = Renderer::new(self.gpu.clone(), splats, self.run.constants)?;
        let mut meter = Meter::new(self.gpu.clone(), self.config)?;
        let sight = Sight::new(self.capture, self.config.background);
        let (shown, mut renders) = (spread(frames, SHOWN), Vec::new());
        let mut progress = Progress::passing("evaluation", frames.len());
        let evaluation = evaluate(&mut renderer, &mut meter, &sight, frames, step, |camera, frame, rendered| {
            if shown.contains(&(camera, frame)) {
                renders.push((camera, frame, rendered.clone()));
            }
            progress.step(&self.told(camera, frame));
            Ok(())
        })?;
        warn_of_lpips(&mut meter);
        let Some(evaluation) = evaluation else { return Ok(None) };
        let mut examples = Vec::new();
        for (camera, frame, render) in renders {
            let name = &self.capture.cameras[camera].name;
            let is_of = |scored: &&ViewScores| scored.camera == *name && scored.frame == frame;
            // A view that its mask hides has no scores.
            if let Some(scored) = evaluation.views.iter().find(is_of) {
                let truth = self.capture.picture(camera, frame)?;
                examples.push(Example { view: scored.view.clone(), why: "", scores: scored.scores, truth, render });
            }
        }
        Ok(Some((evaluation, examples)))
    }

    /// Writes what an evaluation during the run shows: a strip of `examples`, truth above rendering, and the report so far.
    pub fn progress(
        &self,
        (splats, evaluation, examples): (&Splats, Evaluation, &[Example]),
        (step, total): (u64, u64),
        log: &Log,
        output: &Path,
    ) -> ivv::Result<()> {
        let folder = output.join("renders").join("progress");
        make_folder(&folder)?;
        let write_strip = || strip(examples).write_png(&folder.join(format!("{step:08}.png")));
        let size = SceneSize::of(splats);
        let scores =
            SceneScores::new(&output.join("checkpoints"), size, &self.gpu.caps().name, self.near(), evaluation);
        let name = format!("{}, step {step} of {total}", name_of(output));
        let Scorer { run, config, .. } = self;
        let (scores, totals) = (Some(&scores), &serde_json::Value::Null);
        let report = Report { name: &name, run, config, totals, log, scores, examples };
        both(write_strip, || report.write(&output.join("report.html")))
    }

    /// Scores what `renderer` shows, which `scene` holds, on all test views, and once more at the time offsets `fits` by camera where there
    /// are any; writes eval.json and the renders into `output`. Returns the scores and some views for the report; none when
    /// there is no test view, or masks hide all.
    pub fn all(
        &self,
        (mut renderer, size): (Renderer, SceneSize),
        scene: &Path,
        fits: &BTreeMap<usize, OffsetFit>,
        step: u64,
        output: &Path,
    ) -> ivv::Result<(Option<SceneScores>, Vec<Example>)> {
        let frames = self.capture.test_frames();
        let mut progress = Progress::new("evaluation", frames.len());
        let write = |camera: usize, frame: u32, rendered: &Frame| {
            let folder = output.join("renders").join(&self.capture.cameras[camera].name);
            make_folder(&folder)?;
            rendered.write_png(&folder.join(format!("{frame:05}.png")))?;
            progress.step(&self.told(camera, frame));
            Ok(())
        };
        let sight = Sight::new(self.capture, self.config.background);
        let mut meter = Meter::new(self.gpu.clone(), self.config)?;
        let evaluation = evaluate(&mut renderer, &mut meter, &sight, &frames, step, write)?;
        warn_of_lpips(&mut meter);
        let Some(evaluation) = evaluation else { return Ok((None, Vec::new())) };
        let mut scores = SceneScores::new(scene, size, &self.gpu.caps().name, self.near(), evaluation);
        scores.lpips_trunk = meter.trunk().map(|trunk| trunk.to_string());
        scores.mean_at_fitted_offsets = self.at_offsets(fits, &mut renderer, &mut meter, &frames, step)?;
        scores.mean_at_seams_and_elsewhere = seams(output, &scores.evaluation)?;
        write_json(&output.join("eval.json"), &scores)?;
        let mut examples = Vec::new();
        let chosen = scores.evaluation.examples(EXAMPLES);
        let mut progress = Progress::new("views of the report", chosen.len());
        for (index, why) in chosen {
            let scored = &scores.evaluation.views[index];
            let name = |camera: usize| &self.capture.cameras[camera].name;
            let of = frames.iter().find(|(camera, frame)| *name(*camera) == scored.camera && *frame == scored.frame);
            let Some(&(camera, frame)) = of else { continue };
            let view = sight.view(camera, frame)?;
            let (render, _) = renderer.render(&view, Outputs::Color)?;
            let truth = self.capture.picture(camera, frame)?;
            progress.step(&view.name);
            examples.push(Example { view: view.name, why, scores: scored.scores, truth, render });
        }
        Ok((Some(scores), examples))
    }

    /// By test camera, its time offset fitted to its own images; empty where the run did not learn offsets.
    pub fn fitted_offsets(&self, splats: &Splats) -> ivv::Result<BTreeMap<usize, OffsetFit>> {
        let Scorer { gpu, capture, run, config } = self;
        let mut renderer = Renderer::new((*gpu).clone(), splats, run.constants)?;
        let learns = Setup::new(capture, config).learns_offset.contains(&true);
        let cameras = capture.cameras.iter().enumerate().filter(|(_, camera)| learns && camera.is_test);
        let cameras: Vec<usize> = cameras.map(|(index, _)| index).collect();
        if cameras.is_empty() {
            return Ok(BTreeMap::new());
        }
        let mut progress = Progress::new("time offsets of test cameras", cameras.len());
        let fit = |index: usize| {
            let pictures = offset_pictures(capture, config.background, index)?;
            let fit = fit_offset(&mut renderer, &pictures, 0.0, FIT_ITERATIONS)?;
            progress.step(&capture.cameras[index].name);
            Ok((index, fit))
        };
        cameras.into_iter().map(fit).collect()
    }

    fn near(&self) -> f32 {
        self.run.constants_of_capture().near
    }

    /// An image, as progress tells of it.
    fn told(&self, camera: usize, frame: u32) -> String {
        format!("{} frame {frame}", self.capture.cameras[camera].name)
    }

    fn at_offsets(
        &self,
        fits: &BTreeMap<usize, OffsetFit>,
        renderer: &mut Renderer,
        meter: &mut Meter,
        frames: &[(usize, u32)],
        step: u64,
    ) -> ivv::Result<Option<Scores>> {
        if fits.is_empty() {
            return Ok(None);
        }
        let offsets = fits.iter().map(|(camera, fit)| (*camera, fit.offset)).collect();
        let sight = Sight { offsets, ..Sight::new(self.capture, self.config.background) };
        let mut progress = Progress::new("evaluation at fitted offsets", frames.len());
        let scored = evaluate(renderer, meter, &sight, frames, step, |camera, frame, _| {
            progress.step(&self.told(camera, frame));
            Ok(())
        })?;
        Ok(scored.map(|evaluation| evaluation.mean))
    }

    /// Writes the report into `output`, with what `run_folder` tells of the training; returns its path.
    pub fn report(
        &self,
        scores: Option<&SceneScores>,
        examples: &[Example],
        run_folder: &Path,
        output: &Path,
    ) -> ivv::Result<PathBuf> {
        let name = name_of(output);
        // Reports of other scenes, and of a run that goes on, have folders of their own: the totals say nothing of those.
        let totals = if output == run_folder { totals(run_folder) } else { serde_json::Value::Null };
        let log = Log::open(run_folder, u64::MAX);
        let Scorer { run, config, .. } = self;
        let file = output.join("report.html");
        let mut progress = Progress::new("report", 1);
        Report { name: &name, run, config, totals: &totals, log: &log, scores, examples }.write(&file)?;
        progress.step("report.html");
        Ok(file)
    }
}

/// Says how many test images of `run` are images that it trained on, too.
pub fn warn_of_shared_pictures(run: &Run) {
    let n = run.fingerprints.as_ref().map_or(0, |all| all.n_shared(&run.test_cameras));
    if n > 0 {
        alert!(
            "warning: {} of another camera as well, file by file, so that the scores are not of views that were held out; \
             name other cameras with --test-cameras",
            if n == 1 { "1 test image is an image".to_owned() } else { format!("{n} test images are images") }
        );
    }
}

/// Says, once in a process, why a view has no LPIPS although there are weights for it.
fn warn_of_lpips(meter: &mut Meter) {
    static WARNS: Once = Once::new();
    if let Some(fault) = meter.take_fault_of_lpips() {
        WARNS.call_once(|| alert!("warning: a test view has no LPIPS, and others may have none either: {fault}"));
    }
}

/// Means of the views at the seams of the plan in `folder`, and of the others; none where there is no plan, or no view of either.
fn seams(folder: &Path, evaluation: &Evaluation) -> ivv::Result<Option<[Scores; 2]>> {
    if !Segments::file(folder).is_file() {
        return Ok(None);
    }
    let segments = Segments::read(folder)?;
    let mean = |at_seam: bool| Some(evaluation.of(|_, frame| segments.is_at_seam(frame) == at_seam)?.mean);
    Ok(mean(true).zip(mean(false)).map(|(at, elsewhere)| [at, elsewhere]))
}

/// What the report calls the run in `output`.
fn name_of(output: &Path) -> String {
    let path = std::path::absolute(output).unwrap_or_else(|_| output.to_owned());
    path.file_name().map_or("run".into(), |name| name.to_string_lossy()).into_owned()
}

/// `train.json` of a run; null where it is absent: a run that was copied without it still has scores.
fn totals(run_folder: &Path) -> serde_json::Value {
    read_json(&run_folder.join("train.json"), "").unwrap_or_default()
}

/// What the scores of `scene` are called: as its folder, where all scenes of such folders have one name, else as its file, with the
/// ending: files of several formats may be of one scene. And the steps of the run of that folder, 0 where there is none.
fn own_name(scene: &Path) -> anyhow::Result<(OsString, u64)> {
    let path = std::fs::canonicalize(scene).with_context(|| format!("{}: cannot be found", scene.display()))?;
    let of_folder = path.file_name() == Some(OsStr::new("scene.ply"));
    let folder = if of_folder { path.parent() } else { path.is_dir().then_some(&*path) };
    let name = folder.map_or(path.file_name(), Path::file_name);
    let steps = folder.and_then(|folder| totals(folder)["steps"].as_u64());
    Ok((name.unwrap_or(OsStr::new("scene")).to_owned(), steps.unwrap_or(0)))
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let mut run = Run::read(&args.run)?;
    let config: Config = read_json(&args.run.join("config.json"), "give the folder of a run of `ivv train`")?;
    let (capture, changes) = run.compare_capture(args.capture.as_deref())?;
    let capture = run.in_training(capture);
    if !changes.is_empty() {
        alert!(
            "warning: {} is not what the run was trained on: {changes}. The scores are of what it is now",
            capture.path.display()
        );
    }
    warn_of_shared_pictures(&run);
    let source = Source::open(args.scene.as_ref().unwrap_or(&args.run))?;
    if args.scene.is_some() {
        // Score the picture that other viewers draw: they do not know the run's constants.
        run.constants = run.constants_of_training(source.look.constants);
    }
    let shown = source.seen()?;
    let (output, steps) = match (&args.scene, shown.unfinished) {
        (Some(scene), _) => {
            let (name, steps) = own_name(scene)?;
            (args.run.join("eval").join(name), steps)
        }
        (None, Some(step)) => (args.run.join("eval").join(format!("step-{step:08}")), step),
        (None, None) => (args.run.clone(), totals(&args.run)["steps"].as_u64().unwrap_or(0)),
    };
    make_folder(&output)?;
    let gpu = args.device.open()?;
    let scorer = Scorer { gpu: &gpu, capture: &capture, run: &run, config: &config };
    let step = shown.unfinished.unwrap_or(steps);
    let mut fits = BTreeMap::new();
    let seen = match shown.splats {
        Gaussians::Whole(splats) => {
            let splats = run.world.splats(&splats.by_degree());
            if args.fit_offsets {
                fits = scorer.fitted_offsets(&splats)?;
            }
            (Renderer::new(gpu.clone(), &splats, run.constants)?, SceneSize::of(&splats))
        }
        Gaussians::Parts(mut clip) => {
            anyhow::ensure!(
                !args.fit_offsets,
                "--fit-offsets: expected a scene that is always there, found a clip in parts; give a segment's folder"
            );
            let (size, world) = (SceneSize::of_parts(&mut *clip)?, run.world);
            let clip = Box::new(Mapped::new(clip, move |splats| world.splats(&splats)));
            (Renderer::of_parts(gpu.clone(), clip, run.constants)?, size)
        }
    };
    let (scores, examples) = scorer.all(seen, &shown.file, &fits, step, &output)?;
    let Some(scores) = scores else {
        let remedy = "train again with --test-cameras";
        return Err(ivv::Error::data(
            &Run::file(&args.run),
            "test_cameras",
            "no test camera has an image that shows anything",
            remedy,
        )
        .into());
    };
    let report = scorer.report(Some(&scores), &examples, &args.run, &output)?;
    if json {
        out!("{}", serde_json::to_string_pretty(&scores)?);
        return Ok(());
    }
    print(&scores);
    out!("{}", report.display());
    Ok(())
}

fn print(scores: &SceneScores) {
    let Evaluation { views, mean, .. } = &scores.evaluation;
    let width = views.iter().map(|v| v.view.chars().count()).fold(4, usize::max);
    out!(
        "{:<width$} {:>9} {:>9} {:>10} {:>9} {:>8} {:>8} {:>14} {:>8} {:>15}",
        "view",
        "PSNR, dB",
        "aligned",
        "foreground",
        "covisible",
        "SSIM",
        "LPIPS",
        "LPIPS unscaled",
        "L1",
        "flicker (true)"
    );
    let fitted = scores.mean_at_fitted_offsets.as_ref().map(|scores| ("mean at fitted time offsets", scores));
    let seams = scores
        .mean_at_seams_and_elsewhere
        .iter()
        .flat_map(|both| ["mean at seams", "mean elsewhere"].into_iter().zip(both));
    let means = [("mean", mean)].into_iter().chain(fitted).chain(seams);
    for (view, s) in views.iter().map(|v| (v.view.as_str(), &v.scores)).chain(means) {
        let [foreground, covisible] =
            [s.psnr_foreground, s.psnr_covisible].map(|psnr| psnr.map_or("-".to_owned(), |psnr| format!("{psnr:.3}")));
        let [lpips, unscaled] =
            [s.lpips, s.lpips_unscaled].map(|lpips| lpips.map_or("-".to_owned(), |lpips| format!("{lpips:.4}")));
        let flicker = s.flicker.zip(s.flicker_true);
        let flicker = flicker.map_or("-".to_owned(), |(own, truth)| format!("{own:.4} ({truth:.4})"));
        out!(
            "{view:<width$} {:>9.3} {:>9.3} {foreground:>10} {covisible:>9} {:>8.4} {lpips:>8} {unscaled:>14} {:>8.5} \
             {flicker:>15}",
            s.psnr,
            s.psnr_aligned,
            s.ssim,
            s.l1
        );
    }
    for (name, definition) in &scores.metrics {
        out!("{name}: {definition}");
    }
    match &scores.lpips_trunk {
        Some(trunk) => out!("LPIPS compares features of {trunk}"),
        None => out!("LPIPS is not measured: the run has no weights for it (`--set loss.lpips_weights=FILE`)"),
    }
    out!("of {METRICS_OF}");
    out!(
        "{} of SH degree {}, {} bytes; {:.1} frames per second on {}",
        count(scores.gaussians, "Gaussian"),
        scores.sh_degree,
        scores.bytes,
        scores.frames_per_second,
        scores.device
    );
}
