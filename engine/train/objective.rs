//! What a step minimises: the terms of SPEC 4, and what of the cameras is learnt beside the Gaussians.

use super::checkpoint::CameraState;
use super::config::Config;
use super::setup::Setup;
use crate::error::Result;
use crate::gpu::{Gpu, Recording, Slice};
use crate::scene::capture::Picture;
use crate::stage::{
    Backward, Blend, ClockStep, Clocks, Outputs, Photometric, PriorLoss, PriorWeights, SSIM_WEIGHT, Workspace,
};

/// Pixels that a term needs to be used: a mean over fewer would pull hard on them.
const LEAST_PIXELS: u32 = 64;

/// The terms of the loss, with their scratch, and the cameras' own parameters.
pub(super) struct Objective {
    config: Config,
    photometric: Photometric,
    priors: Option<PriorLoss>,
    clocks: Option<Clocks>,
    learns_offset: Vec<bool>,
    dt: f64,
}

/// What of one picture goes to the device.
pub(super) struct Target {
    size: [u32; 2],
    n_visible: u32,
    truth: Slice,
    /// Where the picture has priors that are used.
    priors: Option<(Slice, PriorWeights)>,
}

/// Where a step leaves the values of its terms.
pub(super) struct Sums {
    photometric: Slice,
    priors: Option<(Slice, PriorWeights)>,
}

/// Values of the terms of one picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Values {
    pub loss: f64,
    pub l1: f64,
    pub ssim: f64,
    pub mse: f64,
    pub depth: Option<f64>,
    pub flow: Option<f64>,
}

impl Objective {
    pub fn new(gpu: &Gpu, config: &Config, setup: &Setup) -> Result<Self> {
        let mut objective = Objective {
            config: config.clone(),
            photometric: Photometric::new(gpu, 1)?,
            priors: None,
            clocks: None,
            learns_offset: setup.learns_offset.clone(),
            dt: setup.dt,
        };
        if setup.has_priors {
            objective.priors = Some(PriorLoss::new(gpu, 1, config.loss.depth_space)?);
        }
        if !setup.learns_offset.is_empty() {
            let zeros = vec![[0.0; 4]; setup.learns_offset.len()];
            objective.clocks = Some(Clocks::new(gpu, &zeros, &setup.learns_offset)?);
        }
        Ok(objective)
    }

    /// What the pictures of a frame must hold.
    pub fn outputs(&self) -> Outputs {
        if self.priors.is_some() { Outputs::All } else { Outputs::Color }
    }

    /// Whether the camera's gradient is needed.
    pub fn wants_camera(&self) -> bool {
        self.clocks.is_some()
    }

    /// Room for pictures of `pixels` pixels.
    pub fn fit(&mut self, gpu: &Gpu, pixels: usize) -> Result<()> {
        self.photometric = Photometric::new(gpu, pixels)?;
        if self.priors.is_some() {
            self.priors = Some(PriorLoss::new(gpu, pixels, self.config.loss.depth_space)?);
        }
        Ok(())
    }

    /// Stages a picture.
    pub fn stage(&self, gpu: &Gpu, picture: &Picture) -> Result<Target> {
        let n_visible = picture.pixels.iter().filter(|word| **word >> 24 != 0).count().max(1) as u32;
        let loss = &self.config.loss;
        let used = |weight: f64, n: u32| if n >= LEAST_PIXELS { weight } else { 0.0 };
        let weights = PriorWeights {
            depth: used(loss.depth, picture.n_depth),
            flow: used(loss.flow, picture.n_flow),
            n_depth: picture.n_depth,
            n_flow: picture.n_flow,
        };
        let is_used = self.priors.is_some() && (weights.depth > 0.0 || weights.flow > 0.0);
        let priors = if is_used { Some((gpu.stage("staged priors", &picture.priors)?, weights)) } else { None };
        let truth = gpu.stage("staged truth", &picture.pixels)?;
        Ok(Target { size: [picture.width, picture.height], n_visible, truth, priors })
    }

    /// Appends the upload of `target` and the shift of the view by the clock of `camera`.
    pub fn record_upload(&self, rec: &mut Recording, work: &Workspace, target: &Target, camera: usize) {
        let n = (target.size[0] * target.size[1]) as usize;
        rec.copy(target.truth.clone(), self.photometric.truth.range(0, n).slice());
        if let (Some(loss), Some((staged, _))) = (&self.priors, &target.priors) {
            rec.copy(staged.clone(), loss.priors.range(0, n).slice());
        }
        if let Some(clocks) = &self.clocks {
            clocks.record_apply(rec, &work.view, camera as u32);
        }
    }

    /// Appends the terms on the frame that was rendered, and the cotangents of its pictures.
    pub fn record_loss(&self, rec: &mut Recording, blend: &Blend, backward: &Backward, target: &Target) {
        self.photometric.record(rec, &blend.image0, &backward.d_image0, target.size, target.n_visible);
        if let (Some(loss), Some(image1), Some(d_image1)) = (&self.priors, &blend.image1, &backward.d_image1) {
            let n = target.size[0] * target.size[1];
            match &target.priors {
                Some((_, weights)) => loss.record(rec, image1, &self.photometric.truth, d_image1, n, weights),
                None => rec.fill(d_image1.range(0, n as usize).slice(), 0),
            }
        }
    }

    /// Appends step `step` of the cameras' own parameters, after the backward pass.
    pub fn record_step(&self, rec: &mut Recording, work: &Workspace, camera: usize, step: u64, total: u64) {
        let (Some(clocks), Some(backward)) = (&self.clocks, &work.backward) else { return };
        let at = ClockStep {
            camera: camera as u32,
            dt: self.dt,
            rate: self.config.lr.offset.at((step - 1) as f64 / total.max(1) as f64),
            regulariser: self.config.loss.offset,
            step,
        };
        clocks.record_step(rec, &backward.d_camera, &work.status, &at);
    }

    /// Appends copies of the terms' sums to where the host can read them.
    pub fn record_report(&self, rec: &mut Recording, gpu: &Gpu, target: &Target) -> Result<Sums> {
        let photometric = gpu.readback::<[f32; 4]>("loss of a step", 1)?;
        rec.copy(self.photometric.sums.slice(), photometric.clone());
        let mut sums = Sums { photometric, priors: None };
        if let (Some(loss), Some((_, weights))) = (&self.priors, &target.priors) {
            let slice = gpu.readback::<[f32; 4]>("prior losses of a step", 1)?;
            rec.copy(loss.sums.slice(), slice.clone());
            sums.priors = Some((slice, *weights));
        }
        Ok(sums)
    }

    /// The values of a step that has ended.
    pub fn values(&self, gpu: &Gpu, target: &Target, sums: &Sums) -> Result<Values> {
        let read = |slice: &Slice| -> Result<[f32; 4]> { Ok(gpu.peek(slice)?.first().copied().unwrap_or_default()) };
        let [ssim, l1, mse] = Photometric::values(read(&sums.photometric)?, target.n_visible);
        let weight = f64::from(SSIM_WEIGHT);
        let mut values =
            Values { loss: (1.0 - weight) * l1 + weight * (1.0 - ssim), l1, ssim, mse, ..Values::default() };
        if let Some((slice, weights)) = &sums.priors {
            let [depth, flow] = PriorLoss::values(read(slice)?, weights);
            values.depth = (weights.depth > 0.0).then_some(depth);
            values.flow = (weights.flow > 0.0).then_some(flow);
            values.loss += weights.depth * depth + weights.flow * flow;
        }
        Ok(values)
    }

    /// Ends the learning of the offsets of those cameras that `freeze` names: they are 0 from now on, and the mean of the
    /// others is again.
    pub fn freeze(&mut self, gpu: &Gpu, freeze: &[bool]) -> Result<()> {
        let Some(clocks) = &self.clocks else { return Ok(()) };
        let mut state = gpu.read(&clocks.state)?;
        for ((clock, learns), freeze) in state.iter_mut().zip(&mut self.learns_offset).zip(freeze) {
            if *learns && *freeze {
                (*clock, *learns) = ([0.0; 4], false);
            }
        }
        let free = || self.learns_offset.iter().enumerate().filter(|(_, learns)| **learns).map(|(camera, _)| camera);
        let mean = free().map(|k| f64::from(state[k][0])).sum::<f64>() / free().count().max(1) as f64;
        free().for_each(|k| state[k][0] = (f64::from(state[k][0]) - mean) as f32);
        self.clocks = Some(Clocks::new(gpu, &state, &self.learns_offset)?);
        Ok(())
    }

    /// The cameras' own parameters; empty where none are learnt.
    pub fn state(&self, gpu: &Gpu) -> Result<CameraState> {
        let clocks = self.clocks.as_ref().map_or(Ok(Vec::new()), |clocks| gpu.read(&clocks.state))?;
        Ok(CameraState { clocks, learns_offset: self.learns_offset.clone() })
    }

    /// Goes on with the cameras' parameters of `state`.
    pub fn restore(&mut self, gpu: &Gpu, state: &CameraState) -> Result<()> {
        self.learns_offset = state.learns_offset.clone();
        self.clocks = None;
        if !state.clocks.is_empty() {
            self.clocks = Some(Clocks::new(gpu, &state.clocks, &state.learns_offset)?);
        }
        Ok(())
    }
}
