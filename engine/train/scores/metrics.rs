//! Scores of pictures against their truth.

use super::align::Errors;
use super::flicker;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, Recording};
use crate::internals::train::{Config, Correction};
use crate::parallel::{in_parallel, threads};
use crate::report::statistics::{mean, median_high};
use crate::scene::capture::{Capture, Picture};
use crate::scene::{Frame, Parts, Splats, Summary, View};
use crate::stage::{Compared, Lpips, Outputs, Photometric, Pictures, Renderer, Shown, Trunk, record_totals};
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

const AHEAD: usize = 8;

/// Definitions of the scores, by name; written beside every set of them.
const METRICS: [(&str, &str); 9] = [
    ("psnr", "-10 log10 of the mean squared error, dB, over the three channels of the pixels that count"),
    ("psnr_aligned", "PSNR after the affine map of colours, one for each view, that brings it closest to the image"),
    (
        "psnr_foreground",
        "PSNR over what moves, where the capture has foreground masks; means are over views in which it shows",
    ),
    (
        "psnr_covisible",
        "PSNR over what a training camera sees too, where the capture has co-visibility masks; what no training picture shows is \
         anyone's guess",
    ),
    ("ssim", "as 3DGS: 11 x 11 Gaussian window, sigma 1.5, zero padding, C1 = 0.01^2, C2 = 0.03^2"),
    (
        "lpips",
        "LPIPS v0.1 of the whole view, where the run has weights for it, of colours in [-1, 1], as it is made for; hidden pixels equal \
         the image",
    ),
    (
        "lpips_unscaled",
        "the same of colours in [0, 1], which its network is not made for: as the published tables of STG, Ex4DGS and 4DGaussians \
         have it",
    ),
    ("l1", "mean absolute error over the same values as PSNR"),
    (
        "flicker",
        "mean absolute change of the colour, 0 to 1, since the frame before, of pixels that rest: no foreground mask marks them, and \
         the image changed by at most 2/255 on average over 5 x 5 pixels about them; flicker_true is the image's own, its noise. \
         Of cameras that stay where they are",
    ),
];

pub const METRICS_OF: &str = "the rendered colour, clamped to [0, 1], not rounded to 8 bits, against the 8-bit image; \
                              no crop; means are over views that their masks do not hide";

/// Scores of one view, or means over several; errors are of the clamped colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Scores {
    /// dB, over visible pixels.
    pub psnr: f64,
    /// After the affine map of colours that brings the view closest to the image.
    pub psnr_aligned: f64,
    /// Over the pixels that a foreground mask marks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr_foreground: Option<f64>,
    /// Over the pixels that a co-visibility mask marks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr_covisible: Option<f64>,
    /// With SPEC 4's window and zero padding.
    pub ssim: f64,
    /// Mean absolute error.
    pub l1: f64,
    /// None without weights, or of a view that is too small for them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lpips: Option<f64>,
    /// Of colours in [0, 1], to compare with tables that have it so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lpips_unscaled: Option<f64>,
    /// Mean absolute change since the frame before, where nothing moves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flicker: Option<f64>,
    /// Of the image: its noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flicker_true: Option<f64>,
}

/// Scores of a named view.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ViewScores {
    /// Name of the view.
    pub view: String,
    /// Name of its camera.
    pub camera: String,
    /// Its frame in the clip.
    pub frame: u32,
    /// Its scores.
    #[serde(flatten)]
    pub scores: Scores,
    /// With the way back to the host.
    pub render_ms: f64,
}

/// Scores of several views after a number of steps.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Evaluation {
    /// Steps done.
    pub step: u64,
    /// Means over the views.
    #[serde(flatten)]
    pub mean: Scores,
    /// By frame, then by camera; at least one.
    pub views: Vec<ViewScores>,
}

impl Evaluation {
    /// None without a view.
    pub fn new(step: u64, views: Vec<ViewScores>) -> Option<Self> {
        let all = |score: fn(&Scores) -> f64| mean(views.iter().map(|v| score(&v.scores))).unwrap_or(f64::NAN);
        // The mean over the views that have it.
        let some = |score: fn(&Scores) -> Option<f64>| mean(views.iter().filter_map(|v| score(&v.scores)));
        let mean = Scores {
            psnr: all(|s| s.psnr),
            psnr_aligned: all(|s| s.psnr_aligned),
            psnr_foreground: some(|s| s.psnr_foreground),
            psnr_covisible: some(|s| s.psnr_covisible),
            ssim: all(|s| s.ssim),
            l1: all(|s| s.l1),
            lpips: some(|s| s.lpips),
            lpips_unscaled: some(|s| s.lpips_unscaled),
            flicker: some(|s| s.flicker),
            flicker_true: some(|s| s.flicker_true),
        };
        (!views.is_empty()).then_some(Evaluation { step, mean, views })
    }

    /// Of the views that `keeps` takes by camera and frame.
    pub fn of(&self, keeps: impl Fn(&str, u32) -> bool) -> Option<Self> {
        let views = self.views.iter().filter(|v| keeps(&v.camera, v.frame)).cloned().collect();
        Evaluation::new(self.step, views)
    }

    /// By the median time of a rendering.
    pub fn frames_per_second(&self) -> f64 {
        median_high(self.views.iter().map(|v| v.render_ms)).map_or(0.0, |ms| 1e3 / ms.max(1e-6))
    }

    /// At most `n` views to show, as (index, why), by frame: the worst, the median and the best by PSNR, the rest
    /// evenly spread over the clip.
    pub fn examples(&self, n: usize) -> Vec<(usize, &'static str)> {
        let mut by_psnr: Vec<usize> = (0..self.views.len()).collect();
        by_psnr.sort_by(|&a, &b| self.views[a].scores.psnr.total_cmp(&self.views[b].scores.psnr));
        let last = self.views.len().saturating_sub(1);
        let ranks = [(0, "worst"), (last, "best"), (last / 2, "median")];
        let ranked = ranks.into_iter().filter_map(|(at, why)| Some((*by_psnr.get(at)?, why)));
        let spread = (0..n).map(|k| (k * last / n.saturating_sub(1).max(1), ""));
        let mut chosen: Vec<(usize, &str)> = Vec::new();
        for (index, why) in ranked.chain(spread) {
            if chosen.len() < n && index <= last && chosen.iter().all(|(other, _)| *other != index) {
                chosen.push((index, why));
            }
        }
        chosen.sort_unstable();
        chosen
    }
}

/// Scores of a scene with its size and speed: `eval.json`.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SceneScores {
    #[serde(serialize_with = "crate::files::as_text")]
    pub scene: PathBuf,
    pub gaussians: usize,
    /// Gaussians that move or fade.
    pub dynamic_gaussians: usize,
    pub sh_degree: u32,
    /// [`crate::scene::Summary::parameter_bytes`].
    pub bytes: u64,
    /// On the device: colour, without the time in which pictures are read back.
    pub frames_per_second: f64,
    pub device: String,
    /// Depth up to which nothing was drawn, the capture's units.
    pub near: f32,
    pub rounded_to_8_bits: bool,
    pub metrics: BTreeMap<&'static str, &'static str>,
    pub metrics_of: &'static str,
    /// The trunk whose features LPIPS compares; none without weights.
    pub lpips_trunk: Option<String>,
    #[serde(flatten)]
    pub evaluation: Evaluation,
    /// With each test camera's time offset fitted to its own images; none if offsets were not learnt.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_at_fitted_offsets: Option<Scores>,
    /// For a clip in segments ([`Segments::is_at_seam`](crate::internals::train::Segments::is_at_seam)).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_at_seams_and_elsewhere: Option<[Scores; 2]>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SceneSize {
    gaussians: usize,
    dynamic_gaussians: usize,
    sh_degree: u32,
    bytes: u64,
}

impl SceneSize {
    pub fn of(splats: &Splats) -> Self {
        let Summary { n, n_dynamic, sh_degree, parameter_bytes, .. } = splats.summary();
        SceneSize { gaussians: n, dynamic_gaussians: n_dynamic, sh_degree, bytes: parameter_bytes }
    }

    /// Reads the parts one after the other.
    pub fn of_parts(clip: &mut dyn Parts) -> Result<Self> {
        let mut all = Self::of(&clip.still()?.by_degree());
        for index in 0..clip.parts().len() {
            let part = Self::of(&clip.part(index)?.by_degree());
            all.gaussians += part.gaussians;
            all.dynamic_gaussians += part.dynamic_gaussians;
            all.bytes += part.bytes;
        }
        Ok(all)
    }
}

impl SceneScores {
    /// Of a scene rendered on `device` from depth `near` of the capture's frame on.
    pub fn new(scene: &Path, size: SceneSize, device: &str, near: f32, evaluation: Evaluation) -> Self {
        let SceneSize { gaussians, dynamic_gaussians, sh_degree, bytes } = size;
        SceneScores {
            scene: scene.to_owned(),
            gaussians,
            dynamic_gaussians,
            sh_degree,
            bytes,
            frames_per_second: evaluation.frames_per_second(),
            device: device.to_owned(),
            near,
            rounded_to_8_bits: false,
            metrics: METRICS.into(),
            metrics_of: METRICS_OF,
            lpips_trunk: None,
            evaluation,
            mean_at_fitted_offsets: None,
            mean_at_seams_and_elsewhere: None,
        }
    }
}

/// At most `n` of `all`, evenly spread.
pub fn spread<T: Clone>(all: &[T], n: usize) -> Vec<T> {
    let n = n.min(all.len());
    (0..n).map(|k| all[(2 * k + 1) * all.len() / (2 * n)].clone()).collect()
}

/// How the views of a capture are rendered for scores.
#[derive(Clone)]
pub struct Sight<'a> {
    /// The capture.
    pub capture: &'a Capture,
    /// Colour behind the scene.
    pub background: [f32; 3],
    /// By camera, frames; 0 for the others.
    pub offsets: BTreeMap<usize, f64>,
    /// Learnt corrections of poses, by camera.
    pub poses: BTreeMap<usize, Correction>,
}

impl<'a> Sight<'a> {
    /// At the capture's own times and poses.
    pub fn new(capture: &'a Capture, background: [f32; 3]) -> Self {
        Sight { capture, background, offsets: BTreeMap::new(), poses: BTreeMap::new() }
    }

    /// The view of `camera` at `frame`.
    ///
    /// # Errors
    /// As [`Capture::view`].
    pub fn view(&self, camera: usize, frame: u32) -> Result<View> {
        let time_offset = self.offsets.get(&camera).copied().unwrap_or(0.0);
        let view = View { background: self.background, time_offset, ..self.capture.view(camera, frame)? };
        Ok(match self.poses.get(&camera) {
            Some(correction) => correction.view(&view),
            None => view,
        })
    }
}

/// Renders each (camera, frame) of `frames` as `sight` says, and scores it with `meter`; `seen` gets every picture with
/// its camera and frame. A view that its mask hides has no scores. [`Error::NonFinite`] if a colour is not finite.
///
/// # Errors
/// [`Error::NonFinite`] if a picture has a value that is not finite; those of the renderer, of the capture's pictures
/// and of `seen`.
#[tracing::instrument(level = "info", name = "evaluate", skip_all)]
pub fn evaluate(
    renderer: &mut Renderer,
    meter: &mut Meter,
    sight: &Sight,
    frames: &[(usize, u32)],
    step: u64,
    mut seen: impl FnMut(usize, u32, &Frame) -> Result<()>,
) -> Result<Option<Evaluation>> {
    let capture = sight.capture;
    let (mut views, mut truths) = (Vec::new(), VecDeque::new());
    // The picture before, by camera.
    let mut before = BTreeMap::new();
    let threads = threads().min(AHEAD);
    for (at, &(camera, frame)) in frames.iter().enumerate() {
        if at % threads == 0 {
            let next = &frames[at..frames.len().min(at + threads)];
            let read = |i: usize| {
                let (camera, frame) = next[i];
                let picture = capture.picture(camera, frame)?;
                Ok((picture, capture.foreground(camera, frame)?, capture.covisible(camera, frame)?))
            };
            truths.extend(in_parallel(next.len(), threads, read, |_| ())?);
        }
        let Some((picture, foreground, covisible)) = truths.pop_front() else { break };
        let view = sight.view(camera, frame)?;
        let begun = Instant::now();
        let (rendered, report) = renderer.render(&view, Outputs::Color)?;
        let render_ms = 1e3 * (begun.elapsed().as_secs_f64() - report.read_back_s);
        let n_bad = rendered.color.as_flattened().iter().filter(|c| !c.is_finite()).count() as u64;
        if n_bad > 0 {
            let remedy = "run `ivv inspect` on the scene, which tells how large its numbers are";
            return Err(Error::NonFinite { what: format!("view `{}`", view.name), count: n_bad, remedy });
        }
        let scores = meter.scores(&rendered, &picture)?;
        let within = |mask: &[bool]| psnr_of(&rendered, &picture, |pixel| mask[pixel]);
        let psnr_foreground = foreground.as_deref().and_then(within);
        let psnr_covisible = covisible.as_deref().and_then(within);
        let now = flicker::Instant::new(frame, view.pose, &rendered, picture, foreground);
        let flicker = before.get(&camera).and_then(|before| now.flicker_since(before));
        let (flicker, flicker_true) = (flicker.map(|f| f.rendered), flicker.map(|f| f.truth));
        before.insert(camera, now);
        seen(camera, frame, &rendered)?;
        if let Some(scores) = scores {
            let scores = Scores { psnr_foreground, psnr_covisible, flicker, flicker_true, ..scores };
            let camera = capture.cameras[camera].name.clone();
            views.push(ViewScores { view: view.name, camera, frame, scores, render_ms });
        }
    }
    Ok(Evaluation::new(step, views))
}

/// Of a mean squared error of colours in [0, 1], dB.
pub fn psnr(mse: f64) -> f64 {
    // Not `max`, which would take NaN for the smallest error.
    -10.0 * if mse < 1e-12 { -12.0 } else { mse.log10() }
}

/// Over those visible pixels that `counts`.
fn psnr_of(frame: &Frame, picture: &Picture, counts: impl Fn(usize) -> bool) -> Option<f64> {
    let pixels = frame.color.iter().zip(&picture.pixels).enumerate();
    let errors = pixels.filter(|(pixel, (_, word))| **word >> 24 != 0 && counts(*pixel)).map(|(_, (color, word))| {
        let truth = word.to_le_bytes();
        (0..3).map(|c| (f64::from(color[c].clamp(0.0, 1.0)) - f64::from(truth[c]) / 255.0).powi(2)).sum::<f64>()
    });
    let (n, sum) = errors.fold((0_u64, 0.0), |(n, sum), error| (n + 1, sum + error));
    (n > 0).then(|| psnr(sum / (3 * n) as f64))
}

/// Scores pictures.
pub struct Meter {
    gpu: Arc<Gpu>,
    lpips: Option<Lpips>,
    /// The reason for the first view without LPIPS, if there are weights.
    without_lpips: Option<Error>,
}

impl Meter {
    /// With LPIPS if `config` names its weights.
    ///
    /// # Errors
    /// As [`Lpips::load`].
    pub fn new(gpu: Arc<Gpu>, config: &Config) -> Result<Self> {
        let weights = config.loss.lpips_weights.as_ref();
        let lpips = weights.map(|weights| Lpips::load(&gpu, weights)).transpose()?;
        Ok(Meter { gpu, lpips, without_lpips: None })
    }

    /// The trunk of LPIPS, if there are weights.
    pub fn trunk(&self) -> Option<Trunk> {
        self.lpips.as_ref().map(Lpips::trunk)
    }

    /// Why the first view without LPIPS had none, if there are weights; once.
    pub fn take_fault_of_lpips(&mut self) -> Option<Error> {
        self.without_lpips.take()
    }

    /// Scores of `frame` against `picture`, without those of masks and of other frames; none if the mask hides all
    /// pixels. A view that is too small for LPIPS, or for which the device lacks memory, has no LPIPS.
    ///
    /// # Errors
    /// Those of the device.
    pub fn scores(&mut self, frame: &Frame, picture: &Picture) -> Result<Option<Scores>> {
        let gpu = &self.gpu;
        let errors = Errors::of_view(frame, picture);
        if errors.n == 0 {
            return Ok(None);
        }
        let n_visible = errors.n as u32;
        let with_alpha = |color: &[f32; 3]| {
            let [r, g, b] = color.map(|x| x.clamp(0.0, 1.0));
            [r, g, b, 1.0]
        };
        let image: Vec<[f32; 4]> = frame.color.iter().map(with_alpha).collect();
        let image = gpu.upload("scored image", &image)?;
        let d_image = gpu.alloc("scored cotangent", frame.color.len())?;
        let loss = Photometric::new(gpu, frame.color.len())?;
        let truth = gpu.upload("truth", &picture.pixels)?;
        let size = [picture.width, picture.height];
        let mut rec = Recording::new();
        let pictures = Pictures { image: &image, truth: &truth, d_image: &d_image, size, n_visible };
        let mut left = vec![loss.record(&mut rec, &pictures, 1)];
        let compared = Compared { image: &image, truth: &truth, size, origin: [0, 0], crop: size };
        let most_bytes = gpu.caps().max_binding_bytes;
        if let Some(lpips) = &mut self.lpips {
            let both = [Shown::Scaled, Shown::Unscaled];
            match both.map(|shown| lpips.record_score(gpu, &mut rec, &compared, shown, most_bytes)) {
                [Ok(scaled), Ok(unscaled)] => left.extend([scaled, unscaled]),
                [Err(fault), _] | [_, Err(fault)] => drop(self.without_lpips.get_or_insert(fault)),
            }
        }
        let totals = gpu.alloc("totals", left.len())?;
        record_totals(&mut rec, &left, &totals);
        gpu.run(&rec)?;
        let totals = gpu.read(&totals)?;
        let sums = totals.first().copied().unwrap_or_default();
        let [ssim, l1, _] = Photometric::values(sums, n_visible, size, 1);
        let [lpips, lpips_unscaled] = [1, 2].map(|at| totals.get(at).map(|[value, ..]| f64::from(*value)));
        let (psnr, psnr_aligned) = (psnr(errors.plain), psnr(errors.aligned));
        Ok(Some(Scores { psnr, psnr_aligned, ssim, l1, lpips, lpips_unscaled, ..Scores::default() }))
    }
}
