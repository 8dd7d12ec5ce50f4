//! The device side of training: forward, loss, backward and Adam in one recording, one image a step.

use super::checkpoint::Checkpoint;
use super::config::Config;
use super::density::{self, Counts};
use super::schedule::{Rates, rates};
use crate::error::{Error, Result};
use crate::gpu::{Buf, Gpu, PassTime, Recording};
use crate::scene::capture::Picture;
use crate::scene::{Similarity, Splats, View};
use crate::settings::Constants;
use crate::stage::{
    Moments, Outputs, Photometric, Planes, Purpose, Room, SSIM_WEIGHT, SceneBuffers, Strip, Verdict, Workspace,
    view_params,
};
use std::sync::Arc;

/// A scene being trained: its Gaussians with their moments, on the device.
pub struct Trainer {
    gpu: Arc<Gpu>,
    constants: Constants,
    config: Config,
    total: u64,
    extent: f64,
    /// Normalised time between two frames.
    dt: f64,
    step: u64,
    scene: SceneBuffers,
    moments: Vec<GroupMoments>,
    work: Option<Workspace>,
    loss: Photometric,
    n_bad: Buf<u32>,
    // Gaussians that cannot be drawn, counted once per step; density control removes them.
    n_undrawable: Buf<u32>,
    room: Room,
    // Density statistics of a checkpoint, until there are buffers for them.
    resumed_stats: Option<Vec<[f32; 2]>>,
}

/// First and second moments of a group.
struct GroupMoments {
    first: Planes,
    second: Planes,
}

/// What one step did.
#[derive(Clone, Debug, serde::Serialize)]
pub struct StepReport {
    /// Number of the step, from 1.
    pub step: u64,
    /// Value of the loss.
    pub loss: f64,
    /// Mean absolute error of the colour.
    pub l1: f64,
    /// Structural similarity.
    pub ssim: f64,
    /// Gaussians.
    pub gaussians: u32,
    /// Gaussians that touch the picture.
    pub visible: u32,
    /// Pairs of a Gaussian and a tile.
    pub intersections: u32,
    /// Gradients that were not finite and changed nothing, since the start.
    pub bad_gradients: u32,
}

impl Trainer {
    /// Uploads `splats` for a run of `total` steps in a scene of radius `extent`, `dt` between frames.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] naming the buffer that does not fit.
    pub fn new(
        gpu: Arc<Gpu>,
        splats: &Splats,
        constants: Constants,
        config: Config,
        total: u64,
        extent: f64,
        dt: f64,
    ) -> Result<Self> {
        let scene = SceneBuffers::upload(&gpu, splats, constants.alpha_min)?;
        let zeros = zeros_like(splats);
        let moments = upload_moments(&gpu, &scene, &zeros, &zeros)?;
        let room = Room {
            active: scene.n.max(1),
            intersections: scene.n.saturating_mul(4).max(1 << 14),
            tiles: 1,
            pixels: 1,
            outputs: Outputs::Color,
            purpose: Purpose::Gradient,
        };
        Ok(Trainer {
            loss: Photometric::new(&gpu, 1)?,
            n_bad: gpu.upload("bad gradients", &[0u32])?,
            n_undrawable: gpu.upload("undrawable Gaussians", &[0u32])?,
            gpu,
            constants,
            config,
            total,
            extent,
            dt,
            step: 0,
            scene,
            moments,
            work: None,
            room,
            resumed_stats: None,
        })
    }

    /// Goes on from `checkpoint`; the steps that follow give the bits that they would have given without it.
    ///
    /// # Errors
    /// As [`Trainer::new`].
    pub fn resume(gpu: Arc<Gpu>, checkpoint: &Checkpoint, constants: Constants, extent: f64, dt: f64) -> Result<Self> {
        let Checkpoint { step, total, config, origin, params, first, second, stats, .. } = checkpoint;
        let mut trainer = Self::new(gpu, params, constants, config.clone(), *total, extent, dt)?;
        trainer.scene.origin = *origin;
        trainer.moments = upload_moments(&trainer.gpu, &trainer.scene, first, second)?;
        trainer.step = *step;
        trainer.resumed_stats = Some(stats.clone());
        Ok(trainer)
    }

    /// Everything that [`Trainer::resume`] needs; its `world` is the caller's to set.
    ///
    /// # Errors
    /// [`Error::DeviceLost`].
    pub fn checkpoint(&self) -> Result<Checkpoint> {
        let (first, second) = self.download_moments()?;
        Ok(Checkpoint {
            step: self.step,
            total: self.total,
            config: self.config.clone(),
            world: Similarity::default(),
            origin: self.scene.origin,
            params: self.scene.download(&self.gpu, self.scene.groups.iter().map(|g| &g.params))?,
            first,
            second,
            stats: self.stats()?,
        })
    }

    /// First and second moments, by parameter.
    fn download_moments(&self) -> Result<(Splats, Splats)> {
        let download =
            |planes: fn(&GroupMoments) -> &Planes| self.scene.download(&self.gpu, self.moments.iter().map(planes));
        Ok((download(|m| &m.first)?, download(|m| &m.second)?))
    }

    /// Density statistics, per Gaussian.
    fn stats(&self) -> Result<Vec<[f32; 2]>> {
        if let Some(stats) = &self.resumed_stats {
            return Ok(stats.clone());
        }
        let Some(backward) = self.work.as_ref().and_then(|work| work.backward.as_ref()) else {
            return Ok(vec![[0.0; 2]; self.scene.n as usize]);
        };
        let mut stats = Vec::with_capacity(self.scene.n as usize);
        for (group, buffer) in self.scene.groups.iter().zip(&backward.stats) {
            stats.extend_from_slice(&self.gpu.read(buffer)?[..group.n as usize]);
        }
        Ok(stats)
    }

    /// Begins with room for so few intersections; the first step that needs more is replayed.
    pub fn limit_intersections(&mut self, n: u32) {
        self.room.intersections = n.max(1);
    }

    /// Steps done.
    pub fn step(&self) -> u64 {
        self.step
    }

    /// Gaussians.
    pub fn n_gaussians(&self) -> u32 {
        self.scene.n
    }

    /// The Gaussians as they are now, in the frame of the views it is trained on.
    pub fn splats(&self) -> Result<Splats> {
        let mut splats = self.scene.download(&self.gpu, self.scene.groups.iter().map(|g| &g.params))?;
        let origin = self.scene.origin;
        for p in &mut splats.position {
            *p = std::array::from_fn(|k| (f64::from(p[k]) + origin[k]) as f32);
        }
        Ok(splats)
    }

    /// One step on `picture`, seen by `view`: nothing moves when it fails.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] when the picture's lists do not fit the device, [`Error::DeviceLost`].
    pub fn train(&mut self, view: &View, picture: &Picture) -> Result<StepReport> {
        self.train_with(view, picture, false).map(|(report, _)| report)
    }

    /// As [`Trainer::train`], with the time of every pass.
    ///
    /// # Errors
    /// As [`Trainer::train`].
    pub fn profile(&mut self, view: &View, picture: &Picture) -> Result<(StepReport, Vec<PassTime>)> {
        self.train_with(view, picture, true)
    }

    fn train_with(&mut self, view: &View, picture: &Picture, timed: bool) -> Result<(StepReport, Vec<PassTime>)> {
        let strip = Strip::whole(view);
        let (tiles_x, tiles_y) = strip.tiles(view);
        let n_tiles = tiles_x * tiles_y;
        let n_pixels = picture.pixels.len();
        self.room.tiles = self.room.tiles.max(n_tiles);
        if self.room.pixels < n_pixels {
            self.room.pixels = n_pixels;
            self.loss = Photometric::new(&self.gpu, n_pixels)?;
        }
        let n_visible = picture.pixels.iter().filter(|word| **word >> 24 != 0).count().max(1) as u32;
        self.gpu.write(&self.loss.truth, &picture.pixels)?;
        let background = View { background: self.config.background, ..view.clone() };
        let params = view_params(&background, &self.constants, self.scene.origin, strip);
        let rates = rates(&self.config, self.step + 1, self.total, self.extent);
        let mut rounds = 1;
        loop {
            let work = match self.work.take() {
                Some(work) if work.room == self.room => work,
                // The old buffers go before the new ones come; the statistics in them stay.
                old => {
                    self.work = old;
                    let stats = self.stats()?;
                    self.work = None;
                    self.resumed_stats = None;
                    self.new_workspace(&stats)?
                }
            };
            self.gpu.write(&work.view, &[params])?;
            let rec = self.record(&work, [view.width, view.height], n_tiles, rounds, n_visible, &rates);
            let times = if timed {
                self.gpu.run_timed(&rec)?
            } else {
                self.gpu.run(&rec)?;
                Vec::new()
            };
            let status = self.gpu.read(&work.status)?.first().copied().unwrap_or_default();
            let verdict = work.verdict(&self.gpu, &status, rounds);
            self.work = Some(work);
            match verdict {
                Verdict::Complete => {}
                Verdict::Replay(room, new_rounds) => {
                    (self.room, rounds) = (room, new_rounds);
                    continue;
                }
                Verdict::TooMuch { what, needed, limit } => {
                    return Err(Error::OutOfMemory {
                        what: format!("training view `{}`: {what}", view.name),
                        needed: u64::from(needed),
                        limit: u64::from(limit),
                        remedy: "train on smaller pictures, lower --max-gaussians, or choose another device".to_owned(),
                    });
                }
            }
            self.step += 1;
            let sums = self.gpu.read(&self.loss.sums)?.first().copied().unwrap_or_default();
            let (ssim, l1) = Photometric::values(sums, n_visible);
            let weight = f64::from(SSIM_WEIGHT);
            let report = StepReport {
                step: self.step,
                loss: (1.0 - weight) * l1 + weight * (1.0 - ssim),
                l1,
                ssim,
                gaussians: self.scene.n,
                visible: status.n_visible,
                intersections: status.n_intersections,
                bad_gradients: self.gpu.read(&self.n_bad)?.first().copied().unwrap_or(0),
            };
            return Ok((report, times));
        }
    }

    /// A workspace for the room at hand that goes on from `stats`.
    fn new_workspace(&self, stats: &[[f32; 2]]) -> Result<Workspace> {
        let work = Workspace::new(&self.gpu, &self.scene, self.room)?;
        if let Some(backward) = &work.backward {
            for (group, buffer) in self.scene.groups.iter().zip(&backward.stats) {
                self.gpu.write(buffer, &stats[group.start..group.start + group.n as usize])?;
            }
        }
        Ok(work)
    }

    fn record(
        &self,
        work: &Workspace,
        size: [u32; 2],
        n_tiles: u32,
        rounds: u32,
        n_visible: u32,
        rates: &Rates,
    ) -> Recording {
        let mut rec = Recording::new();
        let lists = work.record_forward(&mut rec, &self.scene, n_tiles, rounds);
        if let Some(backward) = &work.backward {
            self.loss.record(&mut rec, &work.blend.image0, &backward.d_image0, size, n_visible);
            work.record_backward(&mut rec, &self.scene, &lists, n_tiles, rounds);
            rec.stage("adam");
            for (index, (group, moments)) in self.scene.groups.iter().zip(&self.moments).enumerate() {
                rec.group(Some(index));
                // tau stays above half a frame.
                let lowest = (0.5 * self.dt).ln() as f32;
                let plane_rates = plane_rates(rates, group.degree(), group.params.motion.is_some());
                let buffers = group.params.buffers().zip(backward.gradients[index].buffers());
                let moments = moments.first.buffers().zip(moments.second.buffers());
                for (((parameter, gradient), (first, second)), rates) in buffers.zip(moments).zip(plane_rates) {
                    let lowest = if rates.len() == 3 { lowest } else { f32::MIN };
                    let moments = Moments { first: first.clone(), second: second.clone() };
                    let step = self.step + 1;
                    moments.record(&mut rec, parameter, gradient, &rates, lowest, step, &work.status, &self.n_bad);
                }
            }
            rec.group(None);
            self.scene.record_bounds(&mut rec, self.constants.alpha_min, &self.n_undrawable);
        }
        rec
    }

    /// One round of density control, if it is due after the step done last.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] naming the buffer that does not fit.
    pub fn control_density(&mut self) -> Result<Option<Counts>> {
        let density = &self.config.density;
        let resets = self.step.is_multiple_of(density.reset_every) && self.step < self.total / 2;
        let due = density.is_due(self.step, self.total);
        if !due && !resets {
            return Ok(None);
        }
        let stats = self.stats()?;
        let (first, second) = self.download_moments()?;
        let splats = self.splats()?;
        self.work = None;
        self.resumed_stats = None;
        let (mut grown, origins, counts) = density::round(&splats, &stats, &self.config, self.step, self.extent);
        if grown.is_empty() {
            return Err(Error::NonFinite { what: "every Gaussian was pruned; the scene".to_owned(), count: 0 });
        }
        if resets {
            let ceiling = (density.reset_to / (1.0 - density.reset_to)).ln();
            grown.opacity.iter_mut().for_each(|o| *o = o.min(ceiling));
        }
        let (first, second) =
            (density::inherit(&first, &origins, grown.n_static), density::inherit(&second, &origins, grown.n_static));
        self.scene = SceneBuffers::upload(&self.gpu, &grown, self.constants.alpha_min)?;
        self.moments = upload_moments(&self.gpu, &self.scene, &first, &second)?;
        self.room.active = self.scene.n.max(1);
        Ok(Some(counts))
    }
}

/// Zeros in the shapes of `splats`.
fn zeros_like(splats: &Splats) -> Splats {
    let n = splats.len();
    Splats {
        n_static: splats.n_static,
        position: vec![[0.0; 3]; n],
        rotation: vec![[0.0; 4]; n],
        scale: vec![[0.0; 3]; n],
        opacity: vec![0.0; n],
        sh: vec![[0.0; 3]; splats.sh.len()],
        motion: vec![bytemuck::Zeroable::zeroed(); splats.motion.len()],
        source_row: splats.source_row.clone(),
        ..Splats::new(splats.sh_degree)
    }
}

fn upload_moments(gpu: &Gpu, scene: &SceneBuffers, first: &Splats, second: &Splats) -> Result<Vec<GroupMoments>> {
    let upload = |from: &Splats, start: usize, n: u32| Planes::upload(gpu, from, start, n as usize, [0.0; 3]);
    scene
        .groups
        .iter()
        .map(|g| Ok(GroupMoments { first: upload(first, g.start, g.n)?, second: upload(second, g.start, g.n)? }))
        .collect()
}

/// Learning rates of each buffer of [`Planes::buffers`], by plane and component.
fn plane_rates(rates: &Rates, degree: usize, dynamic: bool) -> Vec<Vec<[f32; 4]>> {
    let r = |x: f64| x as f32;
    let (p, s) = (r(rates.position), r(rates.scale));
    let t_scale = if dynamic { r(rates.t_scale) } else { 0.0 };
    let sh = rates.sh.map(r);
    let mut all = vec![
        vec![[p, p, p, r(rates.opacity)], [r(rates.rotation); 4], [s, s, s, t_scale]],
        vec![[sh[0], sh[0], sh[0], 0.0]],
    ];
    for (band, planes) in [(1, 3), (2, 4), (3, 6)].into_iter().take(degree) {
        all.push(vec![[sh[band]; 4]; planes]);
    }
    if dynamic {
        let v = r(rates.velocity);
        all.push(vec![[v, v, v, r(rates.t_center)]]);
    }
    all
}
