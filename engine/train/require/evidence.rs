//! Evidence of the training pictures on each part of each Gaussian.

use crate::error::Result;
use crate::internals::train::Sight;
use crate::internals::train::require::look::{Album, Seen, Shot};
use crate::internals::train::scores::ColorMap;
use crate::random::Keyed;
use crate::recon::Progress;
use crate::scene::{Frame, Splats, View};
use crate::stage::{Census, Renderer, Response};

/// Sums over some of the training pictures, by Gaussian.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evidence {
    /// Fisher information along the step to each part's absence, in squared colours.
    pub information: Vec<Response>,
    /// Of half the squared error of the colours along the same steps.
    pub slope: Vec<Response>,
    /// Of the error of a colour.
    pub variance: f64,
    pub seen: Vec<Seen>,
    /// Colours of all training pictures, three to a pixel.
    pub n_values: f64,
    pub pictures: usize,
}

impl Evidence {
    /// Looks at `most` training pictures of `splats` at most, until all but `share` of the Gaussians have been seen
    /// enough. `key` chooses between pictures that show as much. Pictures of cameras that `has_grid` names are compared
    /// after the affine map of colours that fits them best.
    pub fn gather(
        renderer: &mut Renderer,
        splats: &Splats,
        sight: &Sight,
        has_grid: &[bool],
        (most, share): (usize, f64),
        key: &[u64],
        progress: &mut Progress,
    ) -> Result<Self> {
        let cameras = sight.capture.cameras.iter().filter(|camera| !camera.is_test);
        let census =
            renderer.census(&cameras.map(|camera| camera.world_to_camera.center().to_array()).collect::<Vec<_>>())?;
        let mut album = Album::new(splats, sight)?;
        let mut evidence = Evidence::default();
        let (mut squares, mut n_values) = (0.0, 0u64);
        let mut counted = vec![0.0; splats.len()];
        loop {
            let chosen = album.choose(share, most.saturating_sub(evidence.pictures), key)?;
            if chosen.is_empty() {
                break;
            }
            let total = evidence.pictures + chosen.len();
            for at in chosen {
                let Shot { camera, frame, .. } = album.shots[at];
                let random = Keyed::new(&[key, &[evidence.pictures as u64]].concat());
                let is_mapped = has_grid.get(camera).copied().unwrap_or(false);
                let (own_squares, own_values) = look(renderer, &census, sight, (camera, frame), is_mapped, random)?;
                (squares, n_values) = (squares + own_squares, n_values + own_values);
                let before = std::mem::replace(&mut counted, renderer.seen(&census)?);
                let shows: Vec<bool> = counted.iter().zip(before).map(|(now, before)| *now > before).collect();
                album.look(at, &shows)?;
                evidence.pictures += 1;
                progress(evidence.pictures, total);
            }
        }
        (evidence.information, evidence.slope) = renderer.counted(&census)?;
        evidence.variance = squares / n_values.max(1) as f64;
        evidence.n_values = n_values as f64 * album.shots.len() as f64 / evidence.pictures.max(1) as f64;
        evidence.seen = album.all_seen();
        Ok(evidence)
    }
}

/// Adds a picture to `census`; returns the sum of the squared errors of its colours, and their number.
fn look(
    renderer: &mut Renderer,
    census: &Census,
    sight: &Sight,
    (camera, frame): (usize, u32),
    is_mapped: bool,
    random: Keyed,
) -> Result<(f64, u64)> {
    let picture = sight.capture.picture(camera, frame)?;
    let view = sight.view(camera, frame)?;
    let (mut squares, mut n_values) = (0.0, 0);
    renderer.count(census, &view, &signs(&view, &picture.pixels, random), |mut seen| {
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
    Ok((squares, n_values))
}

/// A random sign for each colour of `view`, 0 where the mask in `truth` hides the pixel.
fn signs(view: &View, truth: &[u32], random: Keyed) -> Frame {
    let color = truth.iter().zip(0..).map(|(word, pixel)| {
        let bits = random.bits(pixel);
        let sign = |c: usize| if bits >> c & 1 == 0 { 1.0 } else { -1.0 };
        if word >> 24 == 0 { [0.0; 3] } else { std::array::from_fn(sign) }
    });
    let (width, height) = (view.intrinsics.width, view.intrinsics.height);
    Frame { width, height, color: color.collect(), alpha: vec![0.0; truth.len()], ..Frame::default() }
}
