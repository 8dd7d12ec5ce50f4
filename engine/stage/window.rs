//! Windows of a clip: of the dynamic Gaussians only those that live near a view's time are on the device, so that neither its
//! memory nor the work of a frame grows with the length of the clip. Where Gaussians appear or disappear at once, a window begins,
//! so that a window has them or has them not.

use super::params::{Purpose, moment};
use super::scene::{SceneBuffers, far_origin, group_limit};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::{Splats, View};
use crate::settings::Constants;
use std::path::Path;
use std::sync::Arc;

/// Dynamic Gaussians that are never worth a window: to cull them costs less than to upload them again.
const FEW: usize = 1 << 14;
/// Most windows of a clip.
const MOST: u32 = 256;
/// Twice as many windows must leave at most this part of the Gaussians in the fullest one.
const LESS: f64 = 0.8;
/// By how much lives and windows are longer than they are, for the rounding of the kernels.
const MARGIN: f64 = 1e-4;

/// A clip on the host, and what of it is on the device.
pub(super) struct Windows {
    splats: Arc<Splats>,
    lives: Vec<Life>,
    /// Where windows end and the next ones begin, normalised time, ascending.
    borders: Vec<f64>,
    origin: [f64; 3],
    limit: usize,
    /// Static Gaussians that are never drawn.
    n_bad: u32,
    /// The window on the device: so many borders are before it.
    shown: Option<usize>,
}

/// When a dynamic Gaussian may be visible, normalised time.
#[derive(Clone, Copy)]
struct Life {
    first: f64,
    last: f64,
}

impl Windows {
    /// The windows of a clip, none of which is on the device yet; none where they would save too little.
    pub fn of(gpu: &Gpu, splats: &Arc<Splats>, constants: &Constants) -> Option<Self> {
        let lives = lives(splats, constants);
        let n = n_windows(&lives);
        let even = (0..=n).filter(|_| n > 1).map(|k| f64::from(k) / f64::from(n));
        let given = splats.span.as_flattened().iter().filter(|time| time.is_finite()).map(|time| f64::from(*time));
        let mut borders: Vec<f64> = even.chain(given).collect();
        borders.sort_unstable_by(f64::total_cmp);
        borders.dedup();
        let (origin, limit) = (far_origin(splats), group_limit(gpu, splats.sh_degree as usize, Purpose::Picture));
        let is_needed = n > 1 || !splats.span.is_empty();
        is_needed.then(|| Windows { splats: splats.clone(), lives, borders, origin, limit, n_bad: 0, shown: None })
    }

    /// A scene of the static Gaussians, which are in every window.
    ///
    /// # Errors
    /// [`OutOfMemory`](crate::Error::OutOfMemory) naming the buffer that does not fit.
    pub fn load_static(&mut self, gpu: &Gpu, constants: &Constants) -> Result<SceneBuffers> {
        let still = self.splats.kept(|i| i < self.splats.n_static);
        let scene = SceneBuffers::upload_around(gpu, &still, constants, self.limit, self.origin)?;
        self.n_bad = scene.n_bad;
        Ok(scene)
    }

    /// The window that `view` needs, unless it is on the device.
    pub fn wanted(&self, view: &View) -> Option<usize> {
        let time = moment(view);
        let at = self.borders.partition_point(|border| *border <= time);
        (self.shown != Some(at)).then_some(at)
    }

    /// Puts the window `at` in the place of the one in `scene`.
    ///
    /// # Errors
    /// As [`Windows::load_static`].
    pub fn load(&mut self, gpu: &Gpu, constants: &Constants, scene: &mut SceneBuffers, at: usize) -> Result<()> {
        self.shown = None;
        scene.clear_dynamic(self.n_bad);
        let dynamic = SceneBuffers::upload_around(gpu, &self.part(at), constants, self.limit, self.origin)?;
        scene.append_dynamic(gpu, dynamic)?;
        self.shown = Some(at);
        Ok(())
    }

    /// A scene of the whole clip.
    ///
    /// # Errors
    /// As [`Windows::load_static`]; [`Error::Data`](crate::Error::Data) where no scene is right for all times.
    pub fn load_whole(&self, gpu: &Gpu, constants: &Constants) -> Result<SceneBuffers> {
        let remedy = "give one of the segments that it was joined of";
        self.splats.refuse_spans(Path::new("the scene"), "what is asked of a scene as a whole", remedy)?;
        SceneBuffers::upload_around(gpu, &self.splats, constants, self.limit, self.origin)
    }

    /// The dynamic Gaussians that live in a window.
    fn part(&self, at: usize) -> Splats {
        let begin = at.checked_sub(1).map_or(f64::NEG_INFINITY, |before| self.borders[before]);
        let end = self.borders.get(at).copied().unwrap_or(f64::INFINITY);
        let n_static = self.splats.n_static;
        let lives = |i: &usize| {
            let Life { first, last } = self.lives[i - n_static];
            // A window begins wherever one appears or disappears, so it is there throughout or never.
            let is_there = self
                .splats
                .span
                .get(i - n_static)
                .is_none_or(|[from, to]| f64::from(*from) < end && f64::from(*to) > begin);
            is_there && first <= end + MARGIN && last >= begin - MARGIN
        };
        self.splats.in_order(&(n_static..self.splats.len()).filter(lives).collect::<Vec<_>>())
    }
}

/// When each dynamic Gaussian may be visible: `bound.comp` on the host, a little longer. One with a number that is not finite is
/// in every window, so that it is counted.
fn lives(splats: &Splats, constants: &Constants) -> Vec<Life> {
    let cut = f64::from(constants.alpha_min.max(constants.knobs.temporal_cut));
    let life = |(motion, opacity): (&crate::scene::Motion, &f32)| {
        let opacity = 1.0 / (1.0 + (-f64::from(*opacity)).exp());
        let (center, tau) = (f64::from(motion.t_center), f64::from(motion.t_scale).exp());
        let reach = tau * ((opacity / cut).ln() + MARGIN).max(0.0).sqrt() * (1.0 + MARGIN) + MARGIN;
        let (first, last) = (center - reach, center + reach);
        if constants.knobs.time_cull && first.is_finite() && last.is_finite() {
            Life { first, last }
        } else {
            Life { first: f64::NEG_INFINITY, last: f64::INFINITY }
        }
    };
    let mut lives: Vec<Life> = splats.motion.iter().zip(&splats.opacity[splats.n_static..]).map(life).collect();
    for (life, [from, to]) in lives.iter_mut().zip(&splats.span) {
        *life = Life { first: life.first.max(f64::from(*from)), last: life.last.min(f64::from(*to)) };
    }
    lives
}

/// How many windows a clip is cut into: twice as many as long as that leaves less in each.
fn n_windows(lives: &[Life]) -> u32 {
    if lives.len() < FEW {
        return 1;
    }
    let (mut n, mut most) = (1, lives.len());
    while n < MOST {
        let finer = fullest(lives, 2 * n);
        if finer as f64 > LESS * most as f64 {
            break;
        }
        (n, most) = (2 * n, finer);
    }
    n
}

/// Gaussians in the fullest of `n` windows.
fn fullest(lives: &[Life], n: u32) -> usize {
    let window = |time: f64| (time * f64::from(n)).floor().clamp(0.0, f64::from(n - 1)) as usize;
    let mut change = vec![0i64; n as usize + 1];
    for Life { first, last } in lives {
        change[window(*first)] += 1;
        change[window(*last) + 1] -= 1;
    }
    let running = change.iter().scan(0, |sum, step| {
        *sum += step;
        Some(*sum)
    });
    running.max().unwrap_or(0) as usize
}
