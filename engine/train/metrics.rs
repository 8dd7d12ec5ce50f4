//! How well pictures match their truth.

use super::align::{aligned_mse, visible_pairs};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, Recording};
use crate::scene::capture::{Capture, Picture};
use crate::scene::{Frame, Splats, View};
use crate::stage::{Outputs, Photometric, Renderer};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What the scores mean, by name; written beside every set of them.
pub const METRICS: [(&str, &str); 5] = [
    ("psnr", "-10 log10 of the mean squared error, dB, over the three channels of the pixels that count"),
    ("psnr_aligned", "PSNR after the affine map of colours, one for each view, that brings it closest to the image"),
    (
        "psnr_foreground",
        "PSNR over what moves, where the capture has foreground masks; means are over views in which it shows",
    ),
    ("ssim", "as 3DGS: 11 x 11 Gaussian window, sigma 1.5, zero padding, C1 = 0.01^2, C2 = 0.03^2"),
    ("l1", "mean absolute error over the same values as PSNR"),
];

/// What holds for all of [`METRICS`].
pub const METRICS_OF: &str = "the rendered colour, clamped to [0, 1], not rounded to 8 bits, against the 8-bit image; \
                              no crop; means are over views";

/// Scores of one view, or means over several.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Scores {
    /// Peak signal-to-noise ratio of the clamped colour, dB, over visible pixels.
    pub psnr: f64,
    /// The same after the affine map of colours that brings the view closest to the image, dB.
    pub psnr_aligned: f64,
    /// The same over the pixels that a foreground mask marks, dB; none without such pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr_foreground: Option<f64>,
    /// Structural similarity of the clamped colour (SPEC 4's window, zero padding).
    pub ssim: f64,
    /// Mean absolute error.
    pub l1: f64,
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
    /// How well it matches.
    #[serde(flatten)]
    pub scores: Scores,
    /// Time of its rendering with the way back to the host, milliseconds.
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
    /// The evaluation of `views` after `step` steps; none when there is no view.
    pub fn new(step: u64, views: Vec<ViewScores>) -> Option<Self> {
        let mean = |score: fn(&Scores) -> f64| views.iter().map(|v| score(&v.scores)).sum::<f64>() / views.len() as f64;
        let foreground: Vec<f64> = views.iter().filter_map(|v| v.scores.psnr_foreground).collect();
        let mean = Scores {
            psnr: mean(|s| s.psnr),
            psnr_aligned: mean(|s| s.psnr_aligned),
            psnr_foreground: (!foreground.is_empty()).then(|| foreground.iter().sum::<f64>() / foreground.len() as f64),
            ssim: mean(|s| s.ssim),
            l1: mean(|s| s.l1),
        };
        (!views.is_empty()).then_some(Evaluation { step, mean, views })
    }

    /// The same for those views that `keeps` takes: (camera, frame).
    pub fn of(&self, keeps: impl Fn(&str, u32) -> bool) -> Option<Self> {
        let views = self.views.iter().filter(|v| keeps(&v.camera, v.frame)).cloned().collect();
        Evaluation::new(self.step, views)
    }

    /// Pictures per second: of the median time of a rendering.
    pub fn frames_per_second(&self) -> f64 {
        let mut times: Vec<f64> = self.views.iter().map(|v| v.render_ms).collect();
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).map_or(0.0, |ms| 1e3 / ms.max(1e-6))
    }

    /// At most `n` views that show how it went, as (index, why), by frame: the worst, the median and the best by PSNR,
    /// the rest evenly spread over the clip.
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

/// Scores of a scene with what they were bought with: `eval.json`.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SceneScores {
    /// The scene file.
    pub scene: PathBuf,
    /// Gaussians.
    pub gaussians: usize,
    /// Gaussians that move or fade.
    pub dynamic_gaussians: usize,
    /// Degree of the spherical harmonics.
    pub sh_degree: u32,
    /// Bytes of the scene as a PLY, without the header.
    pub bytes: u64,
    /// Pictures per second on the device: colour, read back to the host, one after the other.
    pub frames_per_second: f64,
    /// The device's name.
    pub device: String,
    /// Whether colours were rounded to 8 bits before they were scored.
    pub rounded_to_8_bits: bool,
    /// Definitions of the scores.
    pub metrics: BTreeMap<&'static str, &'static str>,
    /// What they are scores of.
    pub metrics_of: &'static str,
    /// The scores.
    #[serde(flatten)]
    pub evaluation: Evaluation,
    /// Means of the same views with each test camera's time offset fitted to its own images; none where offsets were not learnt.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_at_fitted_offsets: Option<Scores>,
}

impl SceneScores {
    /// Those of `scene`, which holds `splats`, rendered on `device`.
    pub fn new(scene: &Path, splats: &Splats, device: &str, evaluation: Evaluation) -> Self {
        let summary = splats.summary();
        SceneScores {
            scene: scene.to_owned(),
            gaussians: summary.n,
            dynamic_gaussians: summary.n_dynamic,
            sh_degree: summary.sh_degree,
            bytes: summary.ply_bytes,
            frames_per_second: evaluation.frames_per_second(),
            device: device.to_owned(),
            rounded_to_8_bits: false,
            metrics: METRICS.into(),
            metrics_of: METRICS_OF,
            evaluation,
            mean_at_fitted_offsets: None,
        }
    }
}

/// At most `n` of `frames`, evenly spread.
pub fn spread(frames: &[(usize, u32)], n: usize) -> Vec<(usize, u32)> {
    let n = n.min(frames.len());
    (0..n).map(|k| frames[(2 * k + 1) * frames.len() / (2 * n)]).collect()
}

/// Renders each (camera, frame) of `frames` over `background`, at the camera's time offset in `offsets` (frames, by camera;
/// 0 where it has none), and scores it; `seen` is handed every picture with its camera and frame. None when there is no
/// frame.
///
/// # Errors
/// [`Error::NonFinite`] when a picture has a value that is not finite; those of the renderer, of the capture's pictures
/// and of `seen`.
pub fn evaluate(
    renderer: &mut Renderer,
    capture: &Capture,
    background: [f32; 3],
    offsets: &BTreeMap<usize, f64>,
    frames: &[(usize, u32)],
    step: u64,
    mut seen: impl FnMut(usize, u32, &Frame) -> Result<()>,
) -> Result<Option<Evaluation>> {
    let gpu = renderer.gpu().clone();
    let mut views = Vec::new();
    for &(camera, frame) in frames {
        let time_offset = offsets.get(&camera).copied().unwrap_or(0.0);
        let view = View { background, time_offset, ..capture.view(camera, frame)? };
        let begun = Instant::now();
        let (rendered, _) = renderer.render(&view, Outputs::Color)?;
        let render_ms = 1e3 * begun.elapsed().as_secs_f64();
        let n_bad = rendered.color.as_flattened().iter().filter(|c| !c.is_finite()).count() as u64;
        if n_bad > 0 {
            return Err(Error::NonFinite { what: format!("view `{}`", view.name), count: n_bad });
        }
        let picture = capture.picture(camera, frame)?;
        let mut scores = scores(&gpu, &rendered, &picture)?;
        if let Some(foreground) = capture.foreground(camera, frame)? {
            scores.psnr_foreground = psnr_of(&rendered, &picture, |pixel| foreground[pixel]);
        }
        seen(camera, frame, &rendered)?;
        let camera = capture.cameras[camera].name.clone();
        views.push(ViewScores { view: view.name, camera, frame, scores, render_ms });
    }
    Ok(Evaluation::new(step, views))
}

/// Peak signal-to-noise ratio of a mean squared error of colours in [0, 1], dB.
pub fn psnr(mse: f64) -> f64 {
    // Not `max`, which would take NaN for the smallest error.
    -10.0 * if mse < 1e-12 { -12.0 } else { mse.log10() }
}

/// PSNR of the clamped colour over those visible pixels that `counts`; none where there are none.
fn psnr_of(frame: &Frame, picture: &Picture, counts: impl Fn(usize) -> bool) -> Option<f64> {
    let pixels = frame.color.iter().zip(&picture.pixels).enumerate();
    let errors = pixels.filter(|(pixel, (_, word))| **word >> 24 != 0 && counts(*pixel)).map(|(_, (color, word))| {
        let truth = word.to_le_bytes();
        (0..3).map(|c| (f64::from(color[c].clamp(0.0, 1.0)) - f64::from(truth[c]) / 255.0).powi(2)).sum::<f64>()
    });
    let (n, sum) = errors.fold((0_u64, 0.0), |(n, sum), error| (n + 1, sum + error));
    (n > 0).then(|| psnr(sum / (3 * n) as f64))
}

/// Scores of `frame` against `picture`, of the same size, but for those of the foreground.
pub fn scores(gpu: &Gpu, frame: &Frame, picture: &Picture) -> Result<Scores> {
    let clamped: Vec<[f32; 3]> = frame.color.iter().map(|c| c.map(|x| x.clamp(0.0, 1.0))).collect();
    let visible = visible_pairs(frame, picture);
    let squares: f64 = visible.iter().flat_map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).powi(2))).sum();
    let n_visible = visible.len().max(1) as u32;
    let image: Vec<[f32; 4]> = clamped.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect();
    let image = gpu.upload("scored image", &image)?;
    let d_image = gpu.alloc("scored cotangent", clamped.len())?;
    let loss = Photometric::new(gpu, clamped.len())?;
    gpu.write(&loss.truth, &picture.pixels)?;
    let mut rec = Recording::new();
    loss.record(&mut rec, &image, &d_image, [picture.width, picture.height], n_visible);
    gpu.run(&rec)?;
    let sums = gpu.read(&loss.sums)?.first().copied().unwrap_or_default();
    let [ssim, l1, _] = Photometric::values(sums, n_visible);
    // A picture that is hidden as a whole has no error.
    let psnr_aligned = if visible.is_empty() { psnr(0.0) } else { psnr(aligned_mse(&visible)) };
    Ok(Scores { psnr: psnr(squares / (3.0 * f64::from(n_visible))), psnr_aligned, psnr_foreground: None, ssim, l1 })
}
