//! What the training pictures say of each part of each Gaussian.

use crate::error::Result;
use crate::scene::capture::camera_center;
use crate::scene::{Frame, View};
use crate::stage::{Renderer, Response};
use crate::train::align::ColorMap;
use crate::train::metrics::Sight;
use crate::train::random::{Random, permutation};

/// Sums over some of the training pictures, by Gaussian.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evidence {
    /// Fisher information along the step to each part's absence, in squared colours.
    pub information: Vec<Response>,
    /// Slope of half the squared error of the colours along the same steps.
    pub slope: Vec<Response>,
    /// Of the error of a colour: what noise and the model's faults leave.
    pub variance: f64,
    /// Training pictures per picture that was looked at.
    pub scale: f64,
    /// Colours of all training pictures, three to a pixel.
    pub n_values: f64,
    /// Normalised times of the pictures that were looked at.
    pub times: Vec<f64>,
}

impl Evidence {
    /// Looks at `n` random training pictures, at all if there are fewer; `key` chooses them and makes the random signs. Pictures of cameras that `has_grid`
    /// names are compared after the affine map of colours that fits them best.
    ///
    /// # Errors
    /// Those of the renderer and of the capture's pictures.
    pub fn gather(renderer: &mut Renderer, sight: &Sight, has_grid: &[bool], n: usize, key: &[u64]) -> Result<Self> {
        let training = sight.capture.training_frames();
        let chosen = permutation(training.len(), key).into_iter().take(n.max(1)).map(|at| training[at]);
        let cameras = sight.capture.cameras.iter().filter(|camera| !camera.is_test);
        let census =
            renderer.census(&cameras.map(|camera| camera_center(&camera.world_to_camera)).collect::<Vec<_>>())?;
        let mut evidence = Evidence::default();
        let (mut squares, mut n_values) = (0.0, 0u64);
        for (index, (camera, frame)) in chosen.enumerate() {
            let picture = sight.capture.picture(camera, frame)?;
            let view = sight.view(camera, frame)?;
            let random = Random::new(&[key, &[index as u64]].concat());
            let is_mapped = has_grid.get(camera).copied().unwrap_or(false);
            renderer.count(&census, &view, &signs(&view, &picture.pixels, random), |mut seen| {
                if is_mapped {
                    seen.color = ColorMap::of_view(&seen, &picture).aligned(&seen);
                }
                for (color, word) in seen.color.iter_mut().zip(&picture.pixels) {
                    let [r, g, b, mask] = word.to_le_bytes();
                    let truth = [r, g, b].map(|level| f32::from(level) / 255.0);
                    *color = if mask == 0 { [0.0; 3] } else { std::array::from_fn(|c| color[c] - truth[c]) };
                    squares += color.iter().map(|e| f64::from(*e).powi(2)).sum::<f64>();
                    n_values += if mask == 0 { 0 } else { 3 };
                }
                seen.alpha.fill(0.0);
                seen
            })?;
            evidence.times.push(view.time + view.time_offset * view.flow_dt);
        }
        (evidence.information, evidence.slope) = renderer.counted(&census)?;
        evidence.variance = squares / n_values.max(1) as f64;
        evidence.scale = training.len() as f64 / evidence.times.len().max(1) as f64;
        evidence.n_values = n_values as f64 * evidence.scale;
        Ok(evidence)
    }
}

/// Cotangents of the colours of `view`: a random sign each, 0 where the mask in `truth` hides the pixel.
fn signs(view: &View, truth: &[u32], random: Random) -> Frame {
    let color = truth.iter().zip(0..).map(|(word, pixel)| {
        let bits = random.bits(pixel);
        let sign = |c: usize| if bits >> c & 1 == 0 { 1.0 } else { -1.0 };
        if word >> 24 == 0 { [0.0; 3] } else { std::array::from_fn(sign) }
    });
    let (width, height) = (view.width, view.height);
    Frame { width, height, color: color.collect(), alpha: vec![0.0; truth.len()], ..Frame::default() }
}
