//! The scores of a run: during it, at its end, and afterwards.

use crate::run::background::in_parallel;
use crate::run::files::{make_folder, totals, write_json};
use crate::ui::progress::Progress;
use crate::ui::screen::alert;
use ivv::internals::gpu::Gpu;
use ivv::internals::scene::capture::Capture;
use ivv::internals::scene::{Frame, Splats};
use ivv::internals::stage::{Outputs, Renderer};
use ivv::internals::study::{Example, Report, strip};
use ivv::internals::train::{
    Config, Evaluation, Log, Meter, OffsetFit, Run, SceneScores, SceneSize, Scores, Segments, Setup, Sight, ViewScores,
    evaluate, fit_offset, offset_pictures, spread,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Once};

/// Iterations of the fit of a test camera's time offset.
const FIT_ITERATIONS: usize = 4;
const EXAMPLES: usize = 8;
/// Test views in the report of an evaluation during the run.
const SHOWN: usize = 3;

/// All that the scores of a run depend on, except the scene.
#[derive(Clone, Copy)]
pub struct Scorer<'a> {
    pub gpu: &'a Arc<Gpu>,
    pub capture: &'a Capture,
    pub run: &'a Run,
    pub config: &'a Config,
}

pub struct SampleScores {
    pub evaluation: Evaluation,
    pub examples: Vec<Example>,
}

impl Scorer<'_> {
    /// Scores `splats` on `frames`, with a few examples; `None` if there is no frame, or masks hide all.
    pub fn score_sample(
        &self,
        splats: &Splats,
        frames: &[(usize, u32)],
        step: u64,
    ) -> ivv::Result<Option<SampleScores>> {
        let mut renderer = Renderer::new(self.gpu.clone(), splats, self.run.constants)?;
        let mut meter = Meter::new(self.gpu.clone(), self.config)?;
        let sight = Sight::new(self.capture, self.config.background);
        let (shown, mut renders) = (spread(frames, SHOWN), Vec::new());
        let mut progress = Progress::passing("evaluation", frames.len());
        let evaluation = evaluate(&mut renderer, &mut meter, &sight, frames, step, |camera, frame, rendered| {
            if shown.contains(&(camera, frame)) {
                renders.push((camera, frame, rendered.clone()));
            }
            progress.step(&self.image_name(camera, frame));
            Ok(())
        })?;
        warn_of_lpips(&mut meter);
        let Some(evaluation) = evaluation else { return Ok(None) };
        let mut examples = Vec::new();
        for (camera, frame, render) in renders {
            let name = &self.capture.cameras[camera].name;
            let is_of = |scored: &&ViewScores| scored.camera == *name && scored.frame == frame;
            // A hidden view has no scores.
            if let Some(scored) = evaluation.views.iter().find(is_of) {
                let truth = self.capture.picture(camera, frame)?;
                examples.push(Example { view: scored.view.clone(), why: "", scores: scored.scores, truth, render });
            }
        }
        Ok(Some(SampleScores { evaluation, examples }))
    }

    /// Writes a strip of the examples of `sample`, truth above rendering, and the report after `step` of `total` steps.
    pub fn write_progress(
        &self,
        splats: &Splats,
        sample: SampleScores,
        step: u64,
        total: u64,
        log: &Log,
        output: &Path,
    ) -> ivv::Result<()> {
        let SampleScores { evaluation, examples } = sample;
        let folder = output.join("renders").join("progress");
        make_folder(&folder)?;
        let write_strip = || strip(&examples).write_png(folder.join(format!("{step:08}.png")));
        let Scorer { gpu, run, config, .. } = self;
        let (size, near) = (SceneSize::of(splats), run.constants_of_capture().near);
        let scores = SceneScores::new(&output.join("checkpoints"), size, &gpu.caps().name, near, evaluation);
        let name = format!("{}, step {step} of {total}", name_of(output));
        let (scores, totals) = (Some(&scores), &serde_json::Value::Null);
        let report = Report { name: &name, run, config, totals, log, scores, examples: &examples };
        in_parallel(write_strip, || report.write(&output.join("report.html")))
    }

    /// Scores the scene of `renderer`, from the file `scene`, on all test views, and again at the time offsets `fits` by camera.
    /// Writes eval.json and renders into `output`. No scores if there is no test view, or masks hide all.
    pub fn score_all(
        &self,
        mut renderer: Renderer,
        size: SceneSize,
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
            rendered.write_png(folder.join(format!("{frame:05}.png")))?;
            progress.step(&self.image_name(camera, frame));
            Ok(())
        };
        let sight = Sight::new(self.capture, self.config.background);
        let mut meter = Meter::new(self.gpu.clone(), self.config)?;
        let evaluation = evaluate(&mut renderer, &mut meter, &sight, &frames, step, write)?;
        warn_of_lpips(&mut meter);
        let Some(evaluation) = evaluation else { return Ok((None, Vec::new())) };
        let near = self.run.constants_of_capture().near;
        let mut scores = SceneScores::new(scene, size, &self.gpu.caps().name, near, evaluation);
        scores.lpips_trunk = meter.trunk().map(|trunk| trunk.to_string());
        if !fits.is_empty() {
            let offsets = fits.iter().map(|(camera, fit)| (*camera, fit.offset)).collect();
            let sight = Sight { offsets, ..Sight::new(self.capture, self.config.background) };
            let mut progress = Progress::new("evaluation at fitted offsets", frames.len());
            let evaluation = evaluate(&mut renderer, &mut meter, &sight, &frames, step, |camera, frame, _| {
                progress.step(&self.image_name(camera, frame));
                Ok(())
            })?;
            scores.mean_at_fitted_offsets = evaluation.map(|evaluation| evaluation.mean);
        }
        scores.mean_at_seams_and_elsewhere = seams(output, &scores.evaluation)?;
        write_json(&output.join("eval.json"), &scores)?;
        let mut examples = Vec::new();
        let chosen = scores.evaluation.examples(EXAMPLES);
        let mut progress = Progress::new("views of the report", chosen.len());
        for (index, why) in chosen {
            let ViewScores { camera, frame, scores, .. } = &scores.evaluation.views[index];
            let Some(at) = self.capture.cameras.iter().position(|other| other.name == *camera) else { continue };
            let view = sight.view(at, *frame)?;
            let (render, _) = renderer.render(&view, Outputs::Color)?;
            let truth = self.capture.picture(at, *frame)?;
            progress.step(&view.name);
            examples.push(Example { view: view.name, why, scores: *scores, truth, render });
        }
        Ok((Some(scores), examples))
    }

    /// The time offset of each test camera, fitted to its own images; empty if the run did not learn offsets.
    pub fn fitted_offsets(&self, splats: &Splats) -> ivv::Result<BTreeMap<usize, OffsetFit>> {
        let Scorer { gpu, capture, run, config } = self;
        let cameras = (0..capture.cameras.len()).filter(|index| capture.cameras[*index].is_test);
        let cameras: Vec<usize> = cameras.collect();
        if cameras.is_empty() || !Setup::new(capture, config).learns_offset.contains(&true) {
            return Ok(BTreeMap::new());
        }
        let mut renderer = Renderer::new((*gpu).clone(), splats, run.constants)?;
        let mut progress = Progress::new("time offsets of test cameras", cameras.len());
        let fit = |index: usize| {
            let pictures = offset_pictures(capture, config.background, index)?;
            let fit = fit_offset(&mut renderer, &pictures, 0.0, FIT_ITERATIONS)?;
            progress.step(&capture.cameras[index].name);
            Ok((index, fit))
        };
        cameras.into_iter().map(fit).collect()
    }

    fn image_name(&self, camera: usize, frame: u32) -> String {
        format!("{} frame {frame}", self.capture.cameras[camera].name)
    }

    /// Writes the report into `output`, with the training log of `run_folder`; returns its path.
    pub fn report(
        &self,
        scores: Option<&SceneScores>,
        examples: &[Example],
        run_folder: &Path,
        output: &Path,
    ) -> ivv::Result<PathBuf> {
        let (name, file, log) = (name_of(output), output.join("report.html"), Log::open(run_folder, u64::MAX));
        // Reports of other scenes and of unfinished runs have folders of their own; the totals are not theirs.
        let totals = if output == run_folder { totals(run_folder) } else { serde_json::Value::Null };
        let Scorer { run, config, .. } = self;
        let mut progress = Progress::new("report", 1);
        Report { name: &name, run, config, totals: &totals, log: &log, scores, examples }.write(&file)?;
        progress.step("report.html");
        Ok(file)
    }
}

/// Warns of test images of `run` that it also trains on.
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

/// Warns, once in a process, that a view has no LPIPS although there are weights.
fn warn_of_lpips(meter: &mut Meter) {
    static WARNS: Once = Once::new();
    if let Some(fault) = meter.take_fault_of_lpips() {
        WARNS.call_once(|| alert!("warning: a test view has no LPIPS, and others may have none either: {fault}"));
    }
}

/// Means of the views at the seams of the plan in `folder`, and of the others; `None` if there is no plan, or no view of either.
fn seams(folder: &Path, evaluation: &Evaluation) -> ivv::Result<Option<[Scores; 2]>> {
    if !Segments::file(folder).is_file() {
        return Ok(None);
    }
    let segments = Segments::read(folder)?;
    let mean = |at_seam: bool| Some(evaluation.of(|_, frame| segments.is_at_seam(frame) == at_seam)?.mean);
    Ok(mean(true).zip(mean(false)).map(|(at, elsewhere)| [at, elsewhere]))
}

fn name_of(output: &Path) -> String {
    let path = std::path::absolute(output).unwrap_or_else(|_| output.to_owned());
    path.file_name().map_or("run".into(), |name| name.to_string_lossy()).into_owned()
}
