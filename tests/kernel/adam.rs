//! Adam on the device against its twin in double precision (N24).

use crate::common::device::{Watched, gpu};
use crate::common::random::{Random, scene, view};
use ivv::Constants;
use ivv::gpu::Recording;
use ivv::gpu::generated::Status;
use ivv::scene::{Frame, Splats, View};
use ivv::stage::{
    Accumulation, AdamMode, Optimiser, Outputs, Planes, Purpose, Rates, Renderer, Room, SceneBuffers, StepSettings,
    Strip, Target, Workspace, adam_params, lazy_sums, view_params,
};
use ivv::twin::Adam;

/// Error of a step, in units of the rate or of the step, where that is longer.
const ALLOWED: f64 = 1e-6;

/// A different rate for every kind of parameter.
fn rates() -> Rates {
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
struct Scene {
    params: Splats,
    first: Splats,
    second: Splats,
    state: Vec<[f32; 4]>,
}

/// Every number of a scene with the twin's rate, its name and its Gaussian.
fn numbers(splats: &Splats, rates: &Rates) -> Vec<(f32, f64, &'static str, usize)> {
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

impl Scene {
    /// `params` before their first step.
    fn new(params: &Splats) -> Self {
        let zeros = zeros_like(params);
        Scene { params: params.clone(), first: zeros.clone(), second: zeros, state: vec![[0.0; 4]; params.len()] }
    }

    fn upload(&self, gpu: &Watched, mode: AdamMode, sums: &[[f32; 4]]) -> (SceneBuffers, Optimiser) {
        let scene = SceneBuffers::upload(gpu, &self.params, &Constants::default(), Purpose::Training).unwrap();
        let groups = || scene.groups.iter();
        let moments = groups()
            .map(|g| Planes::upload_moments(gpu, &self.first, &self.second, g.start, g.n as usize).unwrap())
            .collect();
        let state =
            groups().map(|g| gpu.upload("state", &self.state[g.start..g.start + g.n as usize]).unwrap()).collect();
        let optimiser = Optimiser::new(gpu, moments, state, mode, sums).unwrap();
        (scene, optimiser)
    }

    fn download(gpu: &Watched, scene: &SceneBuffers, optimiser: &Optimiser) -> Scene {
        let (first, second) = scene.download_moments(gpu, &optimiser.moments).unwrap();
        let params = scene.download(gpu, scene.groups.iter().map(|g| &g.params)).unwrap();
        let state = optimiser.state.iter().flat_map(|s| gpu.read(s).unwrap()).collect();
        Scene { params, first, second, state }
    }

    /// One step of `mode` along the cotangents `d_color` of the colour seen by `view`, and how many gradients were bad.
    fn step(&self, view: &View, d_color: &[[f32; 3]], step: u64, mode: AdamMode, failed: u32) -> (Scene, u32) {
        let gpu = gpu();
        let (scene, optimiser) = self.upload(&gpu, mode, &[[0.0; 4]]);
        let params = adam_params(&rates(), &StepSettings { lowest_t_scale: -50.0, ..StepSettings::default() }, step, 1);
        gpu.write(&optimiser.params, &[params]).unwrap();
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
        let work = Workspace::new(&gpu, &scene, room).unwrap();
        gpu.write(&work.view, &[view_params(view, &Constants::default(), scene.origin, strip)]).unwrap();
        gpu.write(&work.status, &[Status { failed, ..Status::default() }]).unwrap();
        let backward = work.backward.as_ref().unwrap();
        let image0: Vec<[f32; 4]> = d_color.iter().map(|[r, g, b]| [*r, *g, *b, 0.0]).collect();
        gpu.write(&backward.d_image0, &image0).unwrap();
        gpu.write(backward.d_image1.as_ref().unwrap(), &vec![[0.0; 4]; n_pixels as usize]).unwrap();
        let mut rec = Recording::new();
        let lists = work.record_forward(&mut rec, &scene, room.tiles, 1, |_| ());
        work.record_backward(&mut rec, &scene, &lists, room.tiles, n_pixels, 1, &Target::Step(&optimiser));
        optimiser.record_idle(&mut rec, &scene, &work.cull, &work.status);
        gpu.run(&rec).unwrap();
        (Scene::download(&gpu, &scene, &optimiser), gpu.read(&optimiser.n_bad).unwrap()[0])
    }

    /// The twin of every number.
    fn twins(&self) -> Vec<Adam<f64>> {
        let [parameter, first, second] = [&self.params, &self.first, &self.second].map(|s| numbers(s, &rates()));
        let both = parameter.iter().zip(&first).zip(&second);
        both.map(|((p, m), v)| Adam { parameter: f64::from(p.0), first: f64::from(m.0), second: f64::from(v.0) })
            .collect()
    }
}

/// Cotangents of colour: `size` times numbers in [-1, 1).
fn cotangents(view: &View, seed: u64, size: f32) -> Vec<[f32; 3]> {
    let mut random = Random::new(seed);
    (0..view.width * view.height).map(|_| random.vector(-1.0, 1.0).map(|x: f32| x * size)).collect()
}

/// The gradients that the device gives for `d_color`.
fn gradients(params: &Splats, view: &View, d_color: &[[f32; 3]]) -> Splats {
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
    let gpu = gpu();
    Renderer::new(gpu.clone(), params, Constants::default()).unwrap().vjp(view, &frame).unwrap().0.params
}

/// A scene some of which the view does not see, with random moments.
fn half_seen(seed: u64, degree: u32) -> Scene {
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

#[test]
fn a_step_of_every_parameter_seen_or_not_is_the_twins() {
    let view = view();
    for degree in 0..=3 {
        let scene = half_seen(u64::from(degree), degree);
        let d_color = cotangents(&view, 5, 1e-3);
        let gradient = numbers(&gradients(&scene.params, &view, &d_color), &rates());
        assert!(gradient.iter().filter(|g| g.0 != 0.0).count() > gradient.len() / 3, "too little has a gradient");
        for step in [1, 2, 1000] {
            let (found, n_bad) = scene.step(&view, &d_color, step, AdamMode::Dense, 0);
            assert_eq!(n_bad, 0);
            let (found, mut n_moved) = (found.twins(), 0);
            for ((twin, found), (g, rate, name, i)) in scene.twins().into_iter().zip(found).zip(&gradient) {
                let truth = twin.step(f64::from(*g), *rate, step);
                // The parameter's last bit, and the error of the step.
                let allowed = ALLOWED * (truth.parameter - twin.parameter).abs().max(*rate)
                    + 1.2e-7 * twin.parameter.abs().max(truth.parameter.abs());
                let close = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b.abs() + 1.2e-38;
                assert!((found.parameter - truth.parameter).abs() <= allowed, "{name} of {i}: {found:?} for {truth:?}");
                assert!(close(found.first, truth.first) && close(found.second, truth.second), "{name} of {i}");
                n_moved += usize::from(found.parameter != twin.parameter);
            }
            assert!(n_moved > gradient.len() / 3, "{n_moved} of {} moved", gradient.len());
        }
    }
}

#[test]
fn sparse_and_lazy_steps_leave_what_is_not_seen_alone_and_give_the_rest_the_dense_steps_bits() {
    let view = view();
    let scene = half_seen(9, 1);
    let d_color = cotangents(&view, 6, 1e-3);
    let (dense, _) = scene.step(&view, &d_color, 7, AdamMode::Dense, 0);
    let bits = |s: &Scene| numbers(&s.params, &rates()).iter().map(|x| x.0.to_bits()).collect::<Vec<_>>();
    let (before, dense_bits) = (bits(&scene), bits(&dense));
    for mode in [AdamMode::Sparse, AdamMode::Lazy] {
        let (found, _) = scene.step(&view, &d_color, 7, mode, 0);
        let (mut n_seen, mut n_not) = (0, 0);
        for (at, number) in numbers(&found.params, &rates()).iter().enumerate() {
            let is_seen = found.state[number.3][3] == 7.0;
            let expected = if is_seen { dense_bits[at] } else { before[at] };
            assert_eq!(number.0.to_bits(), expected, "{} of {}", number.2, number.3);
            *(if is_seen { &mut n_seen } else { &mut n_not }) += 1;
        }
        assert!(n_seen > 100 && n_not > 100);
    }
}

#[test]
fn n24_gradients_of_any_size_give_the_twins_steps() {
    let view = view();
    let scene = Scene::new(&scene(3, 20, 0));
    for size in [0.0f32, 1e-45, 1e-38, 1e-20, 1e-10, 1.0, 1e10, 1e19] {
        let d_color = cotangents(&view, 1, size);
        let gradient = numbers(&gradients(&scene.params, &view, &d_color), &rates());
        let (found, n_bad) = scene.step(&view, &d_color, 1, AdamMode::Dense, 0);
        assert_eq!(n_bad, 0, "{size:e}");
        for ((twin, found), (g, rate, name, i)) in scene.twins().into_iter().zip(found.twins()).zip(&gradient) {
            let truth = twin.step(f64::from(*g), *rate, 1);
            // Squares beyond f32 give no step; those below it are lost, and with them the measure of the step. The first
            // step's correction undoes the factor of the second moment.
            let square = f64::from(*g).powi(2);
            let allowed = 1e-6 * rate + 1.2e-7 * truth.parameter.abs();
            if *g == 0.0 || square > 1.001 * f64::from(f32::MAX) {
                assert_eq!(found.parameter, twin.parameter, "{name} of {i} with {g:e}");
            } else if square > 1e-34 && square < 0.999 * f64::from(f32::MAX) {
                assert!((found.parameter - truth.parameter).abs() <= allowed, "{name} of {i} with {g:e}: {found:?}");
            }
            assert!(found.parameter.is_finite() && !found.first.is_nan() && !found.second.is_nan());
        }
    }
}

#[test]
fn n24_a_gradient_that_is_not_finite_moves_nothing_of_its_gaussian_and_is_counted() {
    let view = view();
    let scene = half_seen(4, 1);
    let mut d_color = cotangents(&view, 2, 1e-3);
    let (good, _) = scene.step(&view, &d_color, 3, AdamMode::Dense, 0);
    // One pixel, so that only those over it are hurt.
    d_color[(28 * view.width + 40) as usize] = [f32::NAN, 0.0, 0.0];
    let (found, n_bad) = scene.step(&view, &d_color, 3, AdamMode::Dense, 0);
    assert!(n_bad > 0 && (n_bad as usize) < scene.params.len() / 2, "{n_bad}");
    let mut hurt = std::collections::BTreeSet::new();
    let all = [&scene.params, &good.params, &found.params].map(|s| numbers(s, &rates()));
    for ((before, good), found) in all[0].iter().zip(&all[1]).zip(&all[2]) {
        assert!(found.0.is_finite());
        let is_kept = found.0.to_bits() == before.0.to_bits();
        assert!(is_kept || found.0.to_bits() == good.0.to_bits(), "{} of {}", before.2, before.3);
        if is_kept && good.0.to_bits() != before.0.to_bits() {
            hurt.insert(before.3);
        }
    }
    assert_eq!(hurt.len(), n_bad as usize);
}

#[test]
fn a_failed_frame_moves_nothing() {
    let view = view();
    let scene = half_seen(5, 2);
    let d_color = cotangents(&view, 2, 1e-3);
    for failed in [1, 2, 1 << 31] {
        let (found, n_bad) = scene.step(&view, &d_color, 1, AdamMode::Dense, failed);
        assert!(found == scene && n_bad == 0);
    }
    assert!(scene.step(&view, &d_color, 1, AdamMode::Dense, 0).0 != scene, "nor does one that did not fail");
}

#[test]
fn lazy_steps_catch_up_with_the_twins_to_2e_5_of_the_way() {
    let gpu = gpu();
    let mut scene = half_seen(11, 2);
    let total = 2000;
    // Position decays as over a run; the second band joins on the way.
    let of = |step: u64| Rates {
        position: 1e-3 * 0.998f64.powf(step as f64),
        sh: [8e-3, 9e-3, if step > 720 { 10e-3 } else { 0.0 }, 0.0],
        ..rates()
    };
    scene.first.sh.iter_mut().for_each(|c| *c = [0.3, -0.2, 0.1]);
    scene.second.sh.iter_mut().for_each(|c| *c = [0.2; 3]);
    for (from, k) in [(0u64, 1u64), (700, 1), (700, 2), (700, 10), (700, 40), (1000, 1000)] {
        scene.state.iter_mut().for_each(|s| s[3] = from as f32);
        let (buffers, optimiser) = scene.upload(&gpu, AdamMode::Lazy, &lazy_sums(of, total));
        let settings = StepSettings { lowest_t_scale: -50.0, ..StepSettings::default() };
        gpu.write(&optimiser.params, &[adam_params(&of(from + k), &settings, from + k, 1)]).unwrap();
        let status = gpu.upload("status", &[Status::default()]).unwrap();
        let mut rec = Recording::new();
        optimiser.record_catch_up_all(&mut rec, &buffers, &status, from + k);
        gpu.run(&rec).unwrap();
        let found = Scene::download(&gpu, &buffers, &optimiser);
        assert!(found.state.iter().all(|s| s[3] == (from + k) as f32));
        let mut truths = scene.twins();
        for step in from + 1..=from + k {
            for (truth, number) in truths.iter_mut().zip(numbers(&scene.params, &of(step))) {
                *truth = truth.step(0.0, number.1, step);
            }
        }
        let mut n_moved = 0;
        for (at, ((twin, found), truth)) in scene.twins().into_iter().zip(found.twins()).zip(truths).enumerate() {
            let way = (truth.parameter - twin.parameter).abs();
            let allowed = 2e-5 * way.max(1e-4) + 1.2e-7 * twin.parameter.abs().max(truth.parameter.abs());
            assert!((found.parameter - truth.parameter).abs() <= allowed, "{at} after {k}: {found:?} for {truth:?}");
            let close = |a: f64, b: f64| (a - b).abs() <= 1e-5 * b.abs() + 1.2e-38;
            assert!(close(found.first, truth.first) && close(found.second, truth.second), "{at} after {k}");
            n_moved += usize::from(way > 0.0);
        }
        assert!(n_moved > 300, "{n_moved}");
    }
}

#[test]
fn t_center_moves_by_steps_that_are_far_below_its_last_bit() {
    let gpu = gpu();
    let mut params = scene(2, 10, 0);
    params.motion.iter_mut().for_each(|m| m.t_center = 0.75);
    let mut scene = Scene::new(&params);
    // The moments of a gradient that never changes.
    scene.first.motion.iter_mut().for_each(|m| m.t_center = 1.0);
    scene.second.motion.iter_mut().for_each(|m| m.t_center = 1.0);
    let (buffers, optimiser) = scene.upload(&gpu, AdamMode::Dense, &[[0.0; 4]]);
    // Seen by a camera that looks away.
    let cull = ivv::stage::Cull::new(&gpu, &buffers, 10, true).unwrap();
    let mut away = view();
    away.world_to_camera[2][3] = -1e3;
    let away = view_params(&away, &Constants::default(), buffers.origin, Strip::whole(&away));
    let away = gpu.upload("view", &[away]).unwrap();
    let status = gpu.upload("status", &[Status::default()]).unwrap();
    let rate = 1e-9;
    let mut params = adam_params(&Rates { t_center: rate, ..Rates::default() }, &StepSettings::default(), 1_000_000, 1);
    // No decay: the same step again and again.
    (params.beta1, params.beta2) = (1.0, 1.0);
    gpu.write(&optimiser.params, &[params]).unwrap();
    for _ in 0..1000 {
        let mut rec = Recording::new();
        cull.record(&mut rec, &buffers, &away, &status);
        optimiser.record_idle(&mut rec, &buffers, &cull, &status);
        gpu.run(&rec).unwrap();
    }
    let found = Scene::download(&gpu, &buffers, &optimiser);
    assert!(0.75f32 - rate as f32 == 0.75, "one step alone is lost");
    for (motion, state) in found.params.motion.iter().zip(&found.state[found.params.n_static..]) {
        let exact = f64::from(motion.t_center) - f64::from(state[2]);
        assert!((exact - (0.75 - 1000.0 * rate)).abs() < 1e-3 * 1000.0 * rate, "{exact}");
    }
}
