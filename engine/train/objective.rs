//! What a step minimises: the terms of SPEC 4, and what of the cameras is learnt beside the Gaussians.

use super::checkpoint::CameraState;
use super::config::Config;
use super::setup::Setup;
use crate::error::{Error, Result};
use crate::gpu::{Buf, Gpu, Recording, Slice};
use crate::random::Keyed;
use crate::scene::capture::Picture;
use crate::stage::{
    Backward, Blend, ClockStep, Clocks, Compared, Cotangent, GridStep, Grids, Lpips, Outputs, Photometric, PriorLoss,
    PriorWeights, SSIM_WEIGHT, Structure, Workspace,
};
use std::path::Path;

/// Pixels that a term needs to be used: a mean over fewer would pull hard on them.
const LEAST_PIXELS: u32 = 64;
/// Purpose of the random numbers of a step that place the crop of LPIPS; density control has 1 and 2.
const CROP: u64 = 3;

/// The terms of the loss, with their scratch, and the cameras' own parameters.
pub(super) struct Objective {
    config: Config,
    photometric: Photometric,
    priors: Option<PriorLoss>,
    clocks: Option<Clocks>,
    learns_offset: Vec<bool>,
    graded: Option<Graded>,
    lpips: Option<Lpips>,
    dt: f64,
}

/// The cameras' bilateral grids, and pictures as they show them.
struct Graded {
    grids: Grids,
    /// By camera, its place among the grids.
    of_camera: Vec<Option<usize>>,
    /// Whether all cameras that are trained on have one.
    is_free: bool,
    /// By place, steps of this grid so far.
    steps: Vec<u64>,
    image: Buf<[f32; 4]>,
    d_image: Buf<[f32; 4]>,
}

impl Graded {
    /// By camera, whether it has one.
    fn has_grid(&self) -> Vec<bool> {
        self.of_camera.iter().map(Option::is_some).collect()
    }
}

/// What of one picture goes to the device.
pub(super) struct Truth {
    size: [u32; 2],
    n_visible: u32,
    truth: Slice,
    /// Where the picture has priors that are used.
    priors: Option<(Slice, PriorWeights)>,
    /// Place and step of the camera's grid.
    grid: Option<(usize, u64)>,
    /// Full pixels across one of this picture's.
    reduction: u32,
    /// Where SSIM is due.
    structure: Option<Structure>,
    /// Where LPIPS is due: origin and size of the crop.
    crop: Option<[[u32; 2]; 2]>,
}

/// Where a step leaves the values of its terms.
pub(super) struct Sums {
    photometric: Slice,
    priors: Option<(Slice, PriorWeights)>,
    lpips: Option<Slice>,
    variation: Option<Slice>,
}

/// Values of the terms of one picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Values {
    pub loss: f64,
    pub l1: f64,
    pub ssim: Option<f64>,
    pub mse: f64,
    pub depth: Option<f64>,
    pub flow: Option<f64>,
    pub lpips: Option<f64>,
    pub grid_variation: Option<f64>,
}

impl Objective {
    pub fn new(gpu: &Gpu, config: &Config, setup: &Setup) -> Result<Self> {
        let mut objective = Objective {
            config: config.clone(),
            photometric: Photometric::new(gpu, 1)?,
            priors: None,
            clocks: None,
            learns_offset: setup.learns_offset.clone(),
            graded: None,
            lpips: None,
            dt: setup.dt,
        };
        if let Some(weights) = config.loss.lpips_weights.as_ref().filter(|_| config.loss.lpips > 0.0) {
            objective.lpips = Some(Lpips::load(gpu, weights)?);
        }
        let n_grids = setup.has_grid.iter().filter(|has| **has).count();
        if n_grids > 0 {
            let mut place = 0..n_grids;
            objective.graded = Some(Graded {
                grids: Grids::new(gpu, n_grids)?,
                of_camera: setup.has_grid.iter().map(|has| if *has { place.next() } else { None }).collect(),
                is_free: n_grids == setup.n_trained,
                steps: vec![0; n_grids],
                image: gpu.alloc("image graded", 1)?,
                d_image: gpu.alloc("d image graded", 1)?,
            });
        }
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
        if let Some(graded) = &mut self.graded {
            graded.image = gpu.alloc("image graded", pixels)?;
            graded.d_image = gpu.alloc("d image graded", pixels)?;
        }
        if self.priors.is_some() {
            self.priors = Some(PriorLoss::new(gpu, pixels, self.config.loss.depth_space)?);
        }
        Ok(())
    }

    /// Stages the picture of step `step`, which `camera` took and which was reduced by `reduction`.
    pub fn stage(&mut self, gpu: &Gpu, picture: &Picture, camera: usize, step: u64, reduction: u32) -> Result<Truth> {
        let n_visible = picture.pixels.iter().filter(|word| **word >> 24 != 0).count().max(1) as u32;
        let loss = &self.config.loss;
        let used = |weight: f64, n: u32| if n >= LEAST_PIXELS { weight } else { 0.0 };
        let weights = PriorWeights {
            depth: used(loss.depth, picture.n_depth),
            // Its unit is a pixel of the full picture.
            flow: f64::from(reduction) * used(loss.flow, picture.n_flow),
            n_depth: picture.n_depth,
            n_flow: picture.n_flow,
        };
        let is_used = self.priors.is_some() && (weights.depth > 0.0 || weights.flow > 0.0);
        let priors = if is_used { Some((gpu.stage("staged priors", &picture.priors)?, weights)) } else { None };
        let truth = gpu.stage("staged truth", &picture.pixels)?;
        let size = [picture.width, picture.height];
        let grid = self.graded.as_mut().and_then(|graded| {
            let place = graded.of_camera.get(camera).copied().flatten()?;
            graded.steps[place] += 1;
            Some((place, graded.steps[place]))
        });
        let times = loss.ssim_every as f32;
        let is_due = step.is_multiple_of(loss.ssim_every);
        let structure = is_due.then_some(Structure { stride: loss.ssim_stride, times });
        let crop = (self.lpips.is_some() && step.is_multiple_of(loss.lpips_every)).then(|| {
            let crop = size.map(|side| if loss.lpips_crop == 0 { side } else { side.min(loss.lpips_crop) });
            let random = Keyed::new(&[self.config.seed, step, CROP]);
            let place = |axis: usize| (random.bits(axis as u64) % u64::from(size[axis] - crop[axis] + 1)) as u32;
            [[place(0), place(1)], crop]
        });
        Ok(Truth { size, n_visible, truth, priors, grid, reduction, structure, crop })
    }

    /// Appends the upload of `target` and the shift of the view by the clock of `camera`.
    pub fn record_upload(&self, rec: &mut Recording, work: &Workspace, target: &Truth, camera: usize) {
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
    ///
    /// # Errors
    /// Those of [`Lpips::record`].
    pub fn record_loss(
        &mut self,
        gpu: &Gpu,
        rec: &mut Recording,
        blend: &Blend,
        backward: &Backward,
        target: &Truth,
    ) -> Result<()> {
        let (rendered, d_rendered) = (&blend.image0, &backward.d_image0);
        let grid = self.graded.as_mut().zip(target.grid);
        if let Some((graded, (place, _))) = grid {
            graded.grids.fit(gpu, target.size[1])?;
            graded.grids.record_slice(rec, place, rendered, &graded.image, target.size);
        }
        let graded = self.graded.as_ref().zip(target.grid);
        let (image, d_image) = graded.map_or((rendered, d_rendered), |(graded, _)| (&graded.image, &graded.d_image));
        self.photometric.record(rec, image, d_image, target.size, target.n_visible, target.structure);
        if let (Some(lpips), Some([origin, crop])) = (&mut self.lpips, target.crop) {
            let compared = Compared { image, truth: &self.photometric.truth, size: target.size, origin, crop };
            let weight = self.config.loss.lpips * self.config.loss.lpips_every as f64;
            lpips.record(gpu, rec, &compared, Some(Cotangent { d_image, weight: weight as f32 }))?;
        }
        if let Some((graded, (place, _))) = graded {
            graded.grids.record_backward(rec, place, rendered, d_image, d_rendered, target.size);
        }
        if let (Some(loss), Some(image1), Some(d_image1)) = (&self.priors, &blend.image1, &backward.d_image1) {
            let n = target.size[0] * target.size[1];
            match &target.priors {
                Some((_, weights)) => loss.record(rec, image1, &self.photometric.truth, d_image1, n, weights),
                None => rec.fill(d_image1.range(0, n as usize).slice(), 0),
            }
        }
        Ok(())
    }

    /// Appends step `step` of the cameras' own parameters, after the backward pass.
    pub fn record_step(
        &self,
        rec: &mut Recording,
        work: &Workspace,
        target: &Truth,
        camera: usize,
        step: u64,
        total: u64,
    ) {
        let done = (step - 1) as f64 / total.max(1) as f64;
        if let (Some(graded), Some((place, camera_step))) = (&self.graded, target.grid) {
            let (rate, tv_weight) = (self.config.lr.grid.at(done), self.config.loss.grid_variation);
            let at = GridStep { step, is_free: graded.is_free, camera_step, rate, tv_weight };
            graded.grids.record_step(rec, place, &at, &work.status);
        }
        let (Some(clocks), Some(backward)) = (&self.clocks, &work.backward) else { return };
        let at = ClockStep {
            camera: camera as u32,
            dt: self.dt,
            rate: self.config.lr.offset.at(done) * self.config.lr.pace.at(done, total),
            regulariser: self.config.loss.offset,
            step,
        };
        clocks.record_step(rec, &backward.d_camera, &work.status, &at);
    }

    /// Appends copies of the terms' sums to where the host can read them.
    pub fn record_report(&self, rec: &mut Recording, gpu: &Gpu, target: &Truth) -> Result<Sums> {
        let photometric = gpu.readback::<[f32; 4]>("loss of a step", 1)?;
        rec.copy(self.photometric.sums.slice(), photometric.clone());
        let mut sums = Sums { photometric, priors: None, lpips: None, variation: None };
        if let (Some(loss), Some((_, weights))) = (&self.priors, &target.priors) {
            let slice = gpu.readback::<[f32; 4]>("prior losses of a step", 1)?;
            rec.copy(loss.sums.slice(), slice.clone());
            sums.priors = Some((slice, *weights));
        }
        if let (Some(lpips), Some(_)) = (&self.lpips, target.crop) {
            let slice = gpu.readback::<f32>("LPIPS of a step", 1)?;
            rec.copy(lpips.value.slice(), slice.clone());
            sums.lpips = Some(slice);
        }
        if let (Some(graded), Some(_)) = (&self.graded, target.grid) {
            let slice = gpu.readback::<[f32; 4]>("variation of a step", 1)?;
            rec.copy(graded.grids.tv.slice(), slice.clone());
            sums.variation = Some(slice);
        }
        Ok(sums)
    }

    /// The values of a step that has ended.
    pub fn values(&self, gpu: &Gpu, target: &Truth, sums: &Sums) -> Result<Values> {
        let read = |slice: &Slice| -> Result<[f32; 4]> { Ok(gpu.peek(slice)?.first().copied().unwrap_or_default()) };
        let structure = target.structure.unwrap_or(Structure::WHOLE);
        let [ssim, l1, mse] = Photometric::values(read(&sums.photometric)?, target.n_visible, target.size, structure);
        let weight = f64::from(SSIM_WEIGHT);
        let ssim = target.structure.map(|_| ssim);
        let loss = (1.0 - weight) * l1 + ssim.map_or(0.0, |ssim| weight * (1.0 - ssim));
        let mut values = Values { loss, l1, ssim, mse, ..Values::default() };
        if let Some((slice, weights)) = &sums.priors {
            let [depth, flow] = PriorLoss::values(read(slice)?, weights);
            values.depth = (weights.depth > 0.0).then_some(depth);
            values.flow = (weights.flow > 0.0).then_some(flow * f64::from(target.reduction));
            values.loss += weights.depth * depth + weights.flow * flow;
        }
        let loss = &self.config.loss;
        if let Some(slice) = &sums.lpips {
            let value = gpu.peek::<f32>(slice)?.first().copied().map_or(0.0, f64::from);
            values.lpips = Some(value);
            values.loss += loss.lpips * value;
        }
        if let Some(slice) = &sums.variation {
            let value = f64::from(read(slice)?[0]);
            values.grid_variation = Some(value);
            values.loss += loss.grid_variation * value;
        }
        Ok(values)
    }

    /// Ends the learning of the offsets of those cameras that `freeze` names: they are 0 from now on, and the mean of the
    /// others is again.
    pub fn freeze(&mut self, gpu: &Gpu, freeze: &[bool]) -> Result<()> {
        let Some(clocks) = &self.clocks else { return Ok(()) };
        let mut state = gpu.read(&clocks.state)?;
        let mut learns_offset = self.learns_offset.clone();
        for ((clock, learns), freeze) in state.iter_mut().zip(&mut learns_offset).zip(freeze) {
            if *learns && *freeze {
                (*clock, *learns) = ([0.0; 4], false);
            }
        }
        let free = || learns_offset.iter().enumerate().filter(|(_, learns)| **learns).map(|(camera, _)| camera);
        let mean = free().map(|k| f64::from(state[k][0])).sum::<f64>() / free().count().max(1) as f64;
        free().for_each(|k| state[k][0] = (f64::from(state[k][0]) - mean) as f32);
        self.clocks = Some(Clocks::new(gpu, &state, &learns_offset)?);
        self.learns_offset = learns_offset;
        Ok(())
    }

    /// The cameras' own parameters; empty where none are learnt.
    pub fn state(&self, gpu: &Gpu) -> Result<CameraState> {
        let clocks = self.clocks.as_ref().map_or(Ok(Vec::new()), |clocks| gpu.read(&clocks.state))?;
        let grids = self.graded.as_ref().map_or(Ok(Vec::new()), |graded| graded.grids.download(gpu))?;
        let grid_steps = self.graded.as_ref().map_or(Vec::new(), |graded| graded.steps.clone());
        let has_grid = self.graded.as_ref().map_or(Vec::new(), |graded| graded.has_grid());
        Ok(CameraState { clocks, learns_offset: self.learns_offset.clone(), grids, grid_steps, has_grid })
    }

    /// Goes on with the cameras' parameters of `state`.
    pub fn restore(&mut self, gpu: &Gpu, state: &CameraState) -> Result<()> {
        self.learns_offset = state.learns_offset.clone();
        self.clocks = None;
        if !state.clocks.is_empty() {
            self.clocks = Some(Clocks::new(gpu, &state.clocks, &state.learns_offset)?);
        }
        let n_grids = self.graded.as_ref().map_or(0, |graded| graded.steps.len());
        if n_grids != state.grids.len() {
            let reason = format!("has bilateral grids of {} cameras, the run of {n_grids}", state.grids.len());
            let remedy = "go on with the capture and the test cameras that the run began with";
            return Err(Error::data(Path::new("checkpoint"), "cameras", reason, remedy));
        }
        if let Some(graded) = &mut self.graded {
            graded.grids = Grids::upload(gpu, &state.grids)?;
            graded.steps = state.grid_steps.clone();
        }
        Ok(())
    }
}
