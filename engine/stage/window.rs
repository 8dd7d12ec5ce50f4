//! Windows of a clip: of the dynamic Gaussians only those that live near a view's time are on the device, so that neither its
//! memory nor the work of a frame grows with the length of the clip.

use super::blend::Purpose;
use super::params::moment;
use super::render::{Renderer, room_for};
use super::scene::{SceneBuffers, far_origin, group_limit};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::{Splats, View};
use crate::settings::Constants;
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
    /// Windows from time 0 to 1; there are as long ones before and after.
    n: u32,
    origin: [f64; 3],
    limit: usize,
    /// Static Gaussians that are never drawn.
    n_bad: u32,
    /// The window on the device.
    shown: Option<i64>,
}

/// When a dynamic Gaussian may be visible, normalised time.
#[derive(Clone, Copy)]
struct Life {
    first: f64,
    last: f64,
}

impl Renderer {
    /// As [`Renderer::new`], for a clip that may be longer than what the device holds. Where most dynamic Gaussians live for a
    /// small part of the clip, only those that live near the time of a view are uploaded, anew whenever that leaves their window:
    /// views in order of time are the fastest. Pictures are the same to the bit.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn of_clip(gpu: Arc<Gpu>, splats: Arc<Splats>, constants: Constants) -> Result<Self> {
        let constants = constants.knobs.on(constants);
        let lives = lives(&splats, &constants);
        let n = n_windows(&lives);
        if n == 1 {
            return Self::new(gpu, &splats, constants);
        }
        let (origin, limit) = (far_origin(&splats), group_limit(&gpu, splats.sh_degree as usize, Purpose::Picture));
        let still = splats.kept(|i| i < splats.n_static);
        let scene = SceneBuffers::upload_around(&gpu, &still, &constants, limit, origin)?;
        drop(still);
        let n_bad = scene.n_bad;
        let windows = Windows { splats, lives, n, origin, limit, n_bad, shown: None };
        Ok(Self::of_scene(gpu, scene, constants, Some(windows)))
    }

    /// Puts the Gaussians on the device that live near the time of `view`.
    pub(super) fn load_window(&mut self, view: &View) -> Result<()> {
        let Some(windows) = &mut self.windows else { return Ok(()) };
        let at = (moment(view) * f64::from(windows.n)).floor() as i64;
        if windows.shown == Some(at) {
            return Ok(());
        }
        // What pictures on their way still use goes with them.
        windows.shown = None;
        self.work = None;
        self.scene.clear_dynamic(windows.n_bad);
        let dynamic = windows.part(at);
        let dynamic = SceneBuffers::upload_around(&self.gpu, &dynamic, &self.constants, windows.limit, windows.origin)?;
        self.scene.append_dynamic(&self.gpu, dynamic)?;
        windows.shown = Some(at);
        self.room.active = room_for(&self.gpu, &self.scene);
        Ok(())
    }

    /// Puts all Gaussians on the device, for what is asked of the scene as a whole.
    pub(super) fn load_whole(&mut self) -> Result<()> {
        if let Some(Windows { splats, limit, origin, .. }) = &self.windows {
            self.scene = SceneBuffers::upload_around(&self.gpu, splats, &self.constants, *limit, *origin)?;
            (self.work, self.windows) = (None, None);
            self.room.active = room_for(&self.gpu, &self.scene);
        }
        Ok(())
    }
}

impl Windows {
    /// The dynamic Gaussians that live in a window.
    fn part(&self, at: i64) -> Splats {
        let border = |k: f64| k / f64::from(self.n);
        let (from, to) = (border(at as f64) - MARGIN, border(at as f64 + 1.0) + MARGIN);
        let n_static = self.splats.n_static;
        let lives = |i: &usize| self.lives[i - n_static].first <= to && self.lives[i - n_static].last >= from;
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
    splats.motion.iter().zip(&splats.opacity[splats.n_static..]).map(life).collect()
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
