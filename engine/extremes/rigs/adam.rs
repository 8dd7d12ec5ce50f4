//! A step of Adam from a view's cotangents, on the device, and the twin of every number.

use crate::error::Result;
use crate::extremes::random::{Random, scene, view};
use crate::gpu::generated::{AdamParams, Status};
use crate::gpu::{Gpu, Recording};
use crate::scene::{Frame, Splats, View};
use crate::settings::Constants;
use crate::stage::{
    Accumulation, AdamMode, Cull, Moments, Optimiser, Outputs, Purpose, Rates, Renderer, Room, SceneBuffers, Size,
    StepSettings, Strip, Target, Workspace, adam_params, view_params,
};
use crate::twin::Adam;
use std::sync::Arc;

/// A different rate for every kind of parameter.
pub fn rates() -> Rates {
    Rates {
        position: 1e-3,
        opacity: 2e-3,
        rotation: 3e-3,
        scale: 4e-3,
        t_scale: 5e-3,
        velocity: 6e-3,
        t_center: 7e-3,
        sh: [8e-3, 9e-3, 10e-3, 0.0],
    }
}

/// Parameters and moments of every Gaussian.
#[derive(Clone, PartialEq)]
pub struct Scene {
    /// Parameters.
    pub params: Splats,
    /// First moments.
    pub first: Splats,
    /// Second moments.
    pub second: Splats,
    /// Statistics; the last of each is the step of its last update.
    pub state: Vec<[f32; 4]>,
    /// Bits of each moment on the device.
    pub moment_bits: u32,
}

/// Every number of a scene with the twin's rate, its name and its Gaussian.
pub fn numbers(splats: &Splats, rates: &Rates) -> Vec<(f32, f64, &'static str, usize)> {
    let mut all = Vec::new();
    let k = splats.n_coefficients();
    for i in 0..splats.len() {
        all.extend(splats.position[i].map(|x| (x, rates.position, "position", i)));
        all.extend(splats.rotation[i].map(|x| (x, rates.rotation, "rotation", i)));
        all.extend(splats.scale[i].map(|x| (x, rates.scale, "scale", i)));
        all.push((splats.opacity[i], rates.opacity, "opacity", i));
        for c in 0..k {
            let band = c.isqrt();
            all.extend(splats.sh[i * k + c].map(|x| (x, rates.sh[band], "sh", i)));
        }
        if let Some(m) = i.checked_sub(splats.n_static).map(|at| splats.motion[at]) {
            all.extend(m.velocity.map(|x| (x, rates.velocity, "velocity", i)));
            all.push((m.t_center, rates.t_center, "t_center", i));
            all.push((m.t_scale, rates.t_scale, "t_scale", i));
        }
    }
    all
}

fn zeros_like(splats: &Splats) -> Splats {
    let mut zeros = splats.clone();
    zeros.position.iter_mut().for_each(|x| *x = [0.0; 3]);
    zeros.rotation.iter_mut().for_each(|x| *x = [0.0; 4]);
    zeros.scale.iter_mut().for_each(|x| *x = [0.0; 3]);
    zeros.opacity.iter_mut().for_each(|x| *x = 0.0);
    zeros.sh.iter_mut().for_each(|x| *x = [0.0; 3]);
    zeros.motion.iter_mut().for_each(|x| *x = bytemuck::Zeroable::zeroed());
    zeros
}

/// How a step is taken.
#[derive(Clone, Debug)]
pub struct Step {
    /// Its number, from 1.
    pub number: u64,
    /// What is done about Gaussians that are not seen.
    pub mode: AdamMode,
    /// The frame's faults: not 0 for a frame that will be replayed.
    pub failed: u32,
    /// Learning rates.
    pub rates: Rates,
    /// Floor of the log of tau.
    pub lowest_t_scale: f64,
}

impl Step {
    /// A dense step of that number, with a rate for every kind of parameter.
    pub fn dense(number: u64) -> Step {
        Step { number, mode: AdamMode::Dense, failed: 0, rates: rates(), lowest_t_scale: -50.0 }
    }
}

impl Scene {
    /// `params` before their first step.
    pub fn new(params: &Splats) -> Self {
        let zeros = zeros_like(params);
        let state = vec![[0.0; 4]; params.len()];
        Scene { params: params.clone(), first: zeros.clone(), second: zeros, state, moment_bits: 32 }
    }

    /// The buffers and the optimiser.
    ///
    /// # Errors
    /// Those of the device.
    pub fn upload(&self, gpu: &Gpu, mode: AdamMode, sums: &[[f32; 4]]) -> Result<(SceneBuffers, Optimiser)> {
        let scene = SceneBuffers::upload(gpu, &self.params, &Constants::default(), Purpose::Training)?;
        let moments = Moments::upload(gpu, &scene, &self.first, &self.second, self.moment_bits)?;
        let state = scene
            .groups
            .iter()
            .map(|g| gpu.upload("state", &self.state[g.start..g.start + g.n as usize]))
            .collect::<Result<_>>()?;
        let optimiser = Optimiser::new(gpu, moments, state, mode, sums)?;
        Ok((scene, optimiser))
    }

    /// What the device has.
    ///
    /// # Errors
    /// Those of the device.
    pub fn download(gpu: &Gpu, scene: &SceneBuffers, optimiser: &Optimiser) -> Result<Scene> {
        let (first, second) = optimiser.moments.download(gpu, scene)?;
        let params = scene.download(gpu, scene.groups.iter().map(|g| &g.params))?;
        let state: Vec<Vec<[f32; 4]>> = optimiser.state.iter().map(|s| gpu.read(s)).collect::<Result<_>>()?;
        Ok(Scene { params, first, second, state: state.concat(), moment_bits: optimiser.moments.bits })
    }

    /// One step along the cotangents `d_color` of the colour seen by `view`, and how many gradients were bad.
    ///
    /// # Errors
    /// Those of the device.
    pub fn step(&self, gpu: &Gpu, view: &View, d_color: &[[f32; 3]], step: &Step) -> Result<(Scene, u32)> {
        let (scene, optimiser) = self.upload(gpu, step.mode, &[[0.0; 4]])?;
        let settings = StepSettings { lowest_t_scale: step.lowest_t_scale, ..StepSettings::default() };
        gpu.write(&optimiser.params, &[adam_params(&step.rates, &settings, step.number, 1)])?;
        let strip = Strip::whole(view);
        let (tiles_x, tiles_y) = strip.tiles(view);
        let n_pixels = view.width * view.height;
        let room = Room {
            active: scene.n.max(1),
            intersections: 1 << 16,
            tiles: tiles_x * tiles_y,
            pixels: n_pixels as usize,
            outputs: Outputs::All,
            purpose: Purpose::Training,
            accumulation: Accumulation::Slots,
            camera: false,
            depth_bits: 32,
        };
        let work = Workspace::new(gpu, &scene, room)?;
        gpu.write(&work.view, &[view_params(view, &Constants::default(), scene.origin, strip)])?;
        gpu.write(&work.status, &[Status { failed: step.failed, ..Status::default() }])?;
        let Some(backward) = &work.backward else { return Ok((self.clone(), 0)) };
        let image0: Vec<[f32; 4]> = d_color.iter().map(|[r, g, b]| [*r, *g, *b, 0.0]).collect();
        gpu.write(&backward.d_image0, &image0)?;
        if let Some(d_image1) = &backward.d_image1 {
            gpu.write(d_image1, &vec![[0.0; 4]; n_pixels as usize])?;
        }
        let mut rec = Recording::new();
        let size = Size { n_tiles: room.tiles, n_pixels, rounds: 1 };
        let lists = work.record_forward(&mut rec, &scene, size, |_| ());
        work.record_backward(&mut rec, &scene, &lists, size, &Target::Step(&optimiser));
        optimiser.record_idle(&mut rec, &scene, &work.cull, &work.status);
        gpu.run(&rec)?;
        Ok((Scene::download(gpu, &scene, &optimiser)?, gpu.read(&optimiser.n_bad)?[0]))
    }

    /// One dense step with the numbers `params`, of Gaussians of which the camera sees none.
    ///
    /// # Errors
    /// Those of the device.
    pub fn unseen_step(&self, gpu: &Gpu, params: &AdamParams) -> Result<Scene> {
        let (scene, optimiser) = self.upload(gpu, AdamMode::Dense, &[[0.0; 4]])?;
        gpu.write(&optimiser.params, &[*params])?;
        let cull = Cull::new(gpu, &scene, scene.n, true)?;
        let mut away = view();
        away.world_to_camera[2][3] = -1e3;
        let away = view_params(&away, &Constants::default(), scene.origin, Strip::whole(&away));
        let (away, status) = (gpu.upload("view", &[away])?, gpu.upload("status", &[Status::default()])?);
        let mut rec = Recording::new();
        cull.record(&mut rec, &scene, &away, &status);
        optimiser.record_idle(&mut rec, &scene, &cull, &status);
        gpu.run(&rec)?;
        Scene::download(gpu, &scene, &optimiser)
    }

    /// The twin of every number.
    pub fn twins(&self) -> Vec<Adam<f64>> {
        let [parameter, first, second] = [&self.params, &self.first, &self.second].map(|s| numbers(s, &rates()));
        let both = parameter.iter().zip(&first).zip(&second);
        both.map(|((p, m), v)| Adam { parameter: f64::from(p.0), first: f64::from(m.0), second: f64::from(v.0) })
            .collect()
    }
}

/// Cotangents of colour: `size` times numbers in [-1, 1).
pub fn cotangents(view: &View, seed: u64, size: f32) -> Vec<[f32; 3]> {
    let mut random = Random::new(seed);
    (0..view.width * view.height).map(|_| random.vector(-1.0, 1.0).map(|x: f32| x * size)).collect()
}

/// The gradients that the device gives for `d_color`.
///
/// # Errors
/// Those of the device.
pub fn gradients(gpu: &Arc<Gpu>, params: &Splats, view: &View, d_color: &[[f32; 3]]) -> Result<Splats> {
    let n = d_color.len();
    let frame = Frame {
        width: view.width,
        height: view.height,
        color: d_color.to_vec(),
        alpha: vec![0.0; n],
        depth: vec![0.0; n],
        inverse_depth: vec![0.0; n],
        flow: vec![[0.0; 2]; n],
    };
    Ok(Renderer::new(Arc::clone(gpu), params, Constants::default())?.vjp(view, &frame)?.0.params)
}

/// A scene some of which the view does not see, with random moments.
pub fn half_seen(seed: u64, degree: u32) -> Scene {
    let mut params = scene(seed, 70, degree);
    for i in (0..params.len()).step_by(3) {
        params.position[i][2] = -9.0;
    }
    let mut scene = Scene::new(&params);
    let mut random = Random::new(seed + 1);
    let mut draw = |low: f64, high: f64| random.uniform(low, high) as f32;
    for i in 0..params.len() {
        scene.first.position[i] = [draw(-1.0, 1.0), draw(-1.0, 1.0), draw(-1.0, 1.0)];
        scene.second.position[i] = [draw(0.1, 1.0), draw(0.1, 1.0), draw(0.1, 1.0)];
        scene.first.opacity[i] = draw(-1.0, 1.0);
        scene.second.opacity[i] = draw(0.1, 1.0);
    }
    for i in 0..params.motion.len() {
        (scene.first.motion[i].t_center, scene.second.motion[i].t_center) = (draw(-1.0, 1.0), draw(0.1, 1.0));
        (scene.first.motion[i].t_scale, scene.second.motion[i].t_scale) = (draw(-1.0, 1.0), draw(0.1, 1.0));
    }
    scene
}
