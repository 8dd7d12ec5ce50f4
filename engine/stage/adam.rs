//! Adam on the device, beside the projection's adjoint, which takes the steps of what the frame saw.

use super::cull::{ARGS_FIRST_GROUP, indirect};
use super::workspace::APART;
use super::{Cull, Moments, SceneBuffers};
use crate::error::Result;
use crate::gpu::generated::{self, AdamParams, Status, ViewParams, adam_catch_up, adam_idle};
use crate::gpu::{Buf, Gpu, Grid, PlaneSlices, Recording};

// SPEC 6; EPS keeps a step finite where no gradient has been.
pub const BETA1: f64 = 0.9;
pub const BETA2: f64 = 0.999;
pub(super) const EPS: f32 = 1e-15;

/// Which Gaussians take a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AdamMode {
    /// All of them: those that were not seen go on along what is left of their first moment.
    #[default]
    Dense,
    /// Those in view; before that they catch up with the steps that they missed. As dense, but for the rounding and for
    /// Gaussians that would have drifted into view unseen. The regularisers of MCMC act on those in view alone.
    Lazy,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rates {
    /// Scene units.
    pub position: f64,
    /// Longest standard deviation, scene units, of a Gaussian whose position has the rate `position`; that of others is in proportion,
    /// from a quarter to sixteen times. 0: all have the same.
    pub reference_size: f64,
    pub opacity: f64,
    pub rotation: f64,
    pub scale: f64,
    pub t_scale: f64,
    pub velocity: f64,
    pub t_center: f64,
    /// Of SH bands 0 to 3; 0 for a band that is not active yet.
    pub sh: [f64; 4],
}

impl Rates {
    fn rows(&self) -> [[f64; 4]; 3] {
        let Rates { position, opacity, rotation, scale, t_scale, velocity, t_center, sh, .. } = *self;
        let [sh0, sh1, sh2, sh3] = sh;
        [[position, opacity, rotation, scale], [t_scale, velocity, t_center, sh0], [sh1, sh2, sh3, 0.0]]
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepSettings {
    /// Images that a step sees: the moments decay as in so many steps on one each.
    pub images: u32,
    /// Floor of log tau.
    pub lowest_t_scale: f64,
    /// Weight of the mean opacity in the loss.
    pub opacity_reg: f64,
    /// Weight of the mean standard deviation in the loss, per scene unit.
    pub scale_reg: f64,
}

impl Default for StepSettings {
    fn default() -> Self {
        StepSettings { images: 1, lowest_t_scale: 0.0, opacity_reg: 0.0, scale_reg: 0.0 }
    }
}

/// 1 - beta^step, of the decay that f32 holds: 1 - 0.999 is off by 1e-5 otherwise.
pub(super) fn correction(beta: f64, step: u64) -> f64 {
    1.0 - f64::from(beta as f32).powf(step as f64)
}

/// Step `step` (from 1) for `n` Gaussians.
pub fn adam_params(rates: &Rates, settings: &StepSettings, step: u64, n: u32) -> AdamParams {
    let [beta1, beta2] = [BETA1, BETA2].map(|beta| f64::from(beta as f32).powi(settings.images as i32));
    let factor = 1.0 / correction(beta1, step);
    let rows = rates.rows().map(|row| row.map(|rate| (rate * factor) as f32));
    let [position_opacity_rotation_scale, t_scale_velocity_t_center_sh0, sh1_sh2_sh3] = rows;
    // The gradients are sums over the images, so the regularisers are as well.
    let (n, images) = (f64::from(n.max(1)), f64::from(settings.images));
    AdamParams {
        position_opacity_rotation_scale,
        t_scale_velocity_t_center_sh0,
        sh1_sh2_sh3,
        beta1: beta1 as f32,
        beta2: beta2 as f32,
        inverse_c2: (1.0 / correction(beta2, step)) as f32,
        eps: EPS,
        lowest_t_scale: settings.lowest_t_scale as f32,
        opacity_reg: (images * settings.opacity_reg / n) as f32,
        scale_reg: (images * settings.scale_reg / (3.0 * n)) as f32,
        step: step as f32,
        inverse_size: if rates.reference_size > 0.0 { (1.0 / rates.reference_size) as f32 } else { 0.0 },
    }
}

pub const LAZY_BYTES: u64 = 3 * size_of::<[f32; 4]>() as u64;

/// For every step s from 0 to `total` the endless sum over j of lr sqrt(c2) / c1 (b1 / sqrt(b2))^j of step s + j, by kind of
/// parameter: what a Gaussian last updated at s still has to go, in units of m / sqrt(v). Three rows a step.
pub fn lazy_sums(rates: impl Fn(u64) -> Rates, total: u64) -> Vec<[f32; 4]> {
    let (beta1, beta2) = (f64::from(BETA1 as f32), f64::from(BETA2 as f32));
    let r = beta1 / beta2.sqrt();
    // 300 steps on, what is left is 1e-13.
    let mut sums = [[0.0; 4]; 3];
    let mut rows = vec![[0.0; 4]; 3 * (total as usize + 1)];
    for s in (0..=total + 300).rev() {
        if s <= total {
            rows[3 * s as usize..][..3].copy_from_slice(&sums.map(|row| row.map(|x| x as f32)));
        }
        if s == 0 {
            break;
        }
        let weight = correction(BETA2, s).sqrt() / correction(BETA1, s);
        let of_step = rates(s).rows();
        let sums = sums.as_flattened_mut().iter_mut();
        sums.zip(of_step.as_flattened()).for_each(|(sum, rate)| *sum = r * (*sum + weight * rate));
    }
    rows
}

/// State of every Gaussian of a group, see `Optimiser::state`.
pub type State = Buf<[f32; 4]>;

pub struct Optimiser {
    pub moments: Moments,
    /// By group: sum of the norms of the projected centre's gradient, in half pictures; frames it was seen in; what rounding has lost
    /// of t_center; step of the last update.
    pub state: Vec<State>,
    /// The inputs of the step at hand: `view`, and from word [`Optimiser::PARAMS_AT`] on `params`.
    pub inputs: Buf<u32>,
    pub view: Buf<ViewParams>,
    pub params: Buf<AdamParams>,
    /// Gaussians whose gradient was not finite and moved nothing, since the start.
    pub n_bad: Buf<u32>,
    pub mode: AdamMode,
    sums: Buf<[f32; 4]>,
}

impl Optimiser {
    pub const PARAMS_AT: usize = (size_of::<ViewParams>() / 4).next_multiple_of(APART);
    /// `sums` is [`lazy_sums`] of the run, for [`AdamMode::Lazy`] only.
    pub fn new(gpu: &Gpu, moments: Moments, state: Vec<State>, mode: AdamMode, sums: &[[f32; 4]]) -> Result<Self> {
        let n_params = size_of::<AdamParams>() / 4;
        let inputs = gpu.alloc("inputs of a step", Self::PARAMS_AT + n_params)?;
        Ok(Optimiser {
            moments,
            state,
            view: inputs.range(0, size_of::<ViewParams>() / 4).cast(),
            params: inputs.range(Self::PARAMS_AT, n_params).cast(),
            inputs,
            n_bad: gpu.upload("bad gradients", &[0u32])?,
            mode,
            sums: gpu.upload("adam sums", sums)?,
        })
    }

    /// The moments and the state of a group, as kernels take them.
    pub(super) fn of_group(&self, index: usize) -> (PlaneSlices, &State) {
        (self.moments.groups[index].slices(), &self.state[index])
    }

    /// Appends the steps of the Gaussians that the frame did not see, for [`AdamMode::Dense`]; goes after the backward pass.
    pub fn record_idle(&self, rec: &mut Recording, scene: &SceneBuffers, cull: &Cull, frame_status: &Buf<Status>) {
        if self.mode != AdamMode::Dense {
            return;
        }
        let (adam, Cull { ranges, idle_id, .. }) = (&self.params, cull);
        rec.section("adam");
        for (index, group) in scene.trained() {
            rec.group(Some(index));
            let (params, (moments, state)) = (group.params.slices(), self.of_group(index));
            let args = adam_idle::Args { frame_status, adam, ranges, idle_id, params, moments, state };
            let (n, first, (is_dynamic, degree)) = (group.n, group.first, group.kind());
            let push = adam_idle::Push { group: index as u32, n, first, is_dynamic, degree };
            let grid = indirect(&cull.args, ARGS_FIRST_GROUP + scene.groups.len() + index);
            rec.pass_variant(generated::adam_idle(self.moments.bits == 16), args, push, grid);
            rec.scale(group.n_planes());
        }
        rec.group(None);
    }

    /// Appends the steps that Gaussians missed up to step `until`, for [`AdamMode::Lazy`]: of those that `cull` found in view, between
    /// culling and projection, or of all.
    pub fn record_catch_up(
        &self,
        rec: &mut Recording,
        scene: &SceneBuffers,
        cull: Option<&Cull>,
        frame_status: &Buf<Status>,
        until: u64,
    ) {
        if self.mode != AdamMode::Lazy {
            return;
        }
        // Without a list the kernel reads neither it nor the ranges.
        let no_ranges = self.n_bad.cast();
        let (ranges, active_id) = cull.map_or((&no_ranges, &self.n_bad), |cull| (&cull.ranges, &cull.active_id));
        rec.section("adam");
        for (index, group) in scene.trained() {
            rec.group(Some(index));
            let grid = cull.map_or(Grid::Threads(group.n), |cull| indirect(&cull.args, ARGS_FIRST_GROUP + index));
            let (params, (moments, state)) = (group.params.slices(), self.of_group(index));
            let (adam, sums) = (&self.params, &self.sums);
            let args = adam_catch_up::Args { frame_status, adam, ranges, active_id, sums, params, moments, state };
            let (is_dynamic, degree) = group.kind();
            let push = adam_catch_up::Push {
                group: index as u32,
                first: group.first,
                n: group.n,
                all: u32::from(cull.is_none()),
                is_dynamic,
                degree,
                until: until as u32,
                log2_beta1: f64::from(BETA1 as f32).log2() as f32,
                log2_beta2: f64::from(BETA2 as f32).log2() as f32,
            };
            rec.pass_variant(generated::adam_catch_up(self.moments.bits == 16), args, push, grid);
            rec.scale(group.n_planes());
        }
        rec.group(None);
    }
}
