//! Adam on the device against its twin in double precision (N24).

use crate::common::device::gpu;
use crate::common::random::Random;
use ivv::gpu::Recording;
use ivv::gpu::generated::Status;
use ivv::stage::Moments;
use ivv::twin::Adam;

/// Error of a step, in units of the rate or of the step, where that is longer.
const ALLOWED: f64 = 1e-6;

const GUARD: [f32; 4] = [-7.5; 4];

/// A parameter buffer and its moments, as the host sees them.
#[derive(Clone, Debug)]
struct State {
    parameter: Vec<[f32; 4]>,
    first: Vec<[f32; 4]>,
    second: Vec<[f32; 4]>,
}

impl State {
    /// `parameter` before its first step.
    fn new(parameter: Vec<[f32; 4]>) -> Self {
        let zeros = vec![[0.0; 4]; parameter.len()];
        State { parameter, first: zeros.clone(), second: zeros }
    }

    /// Every number as bits.
    fn bits(&self) -> [Vec<u32>; 3] {
        [&self.parameter, &self.first, &self.second].map(|v| v.as_flattened().iter().map(|x| x.to_bits()).collect())
    }

    /// The state of one number in the twin's precision.
    fn twin(&self, i: usize, k: usize) -> Adam<f64> {
        let [parameter, first, second] = [&self.parameter, &self.first, &self.second].map(|v| f64::from(v[i][k]));
        Adam { parameter, first, second }
    }

    /// One step on the device, and how many vec4 it counted as bad.
    fn step(&self, gradient: &[[f32; 4]], rates: &[[f32; 4]], step: u64, failed: u32) -> (State, u32) {
        let gpu = gpu();
        let n = self.parameter.len();
        let with_guard = |v: &[[f32; 4]]| v.iter().copied().chain([GUARD]).collect::<Vec<_>>();
        let guarded = gpu.upload("parameter", &with_guard(&self.parameter)).unwrap();
        let parameter = guarded.range(0, n);
        let moments = Moments::new(&gpu, &guarded).unwrap();
        gpu.write(&moments.first, &with_guard(&self.first)).unwrap();
        gpu.write(&moments.second, &with_guard(&self.second)).unwrap();
        let gradient = gpu.upload("gradient", gradient).unwrap();
        let status = gpu.upload("status", &[Status { failed, ..Status::default() }]).unwrap();
        let n_bad = gpu.upload("bad", &[0u32]).unwrap();
        let mut rec = Recording::new();
        moments.record(&mut rec, &parameter, &gradient, rates, f32::MIN, step, &status, &n_bad);
        gpu.run(&rec).unwrap();
        let [parameter, first, second] = [&guarded, &moments.first, &moments.second].map(|buffer| {
            let mut items = gpu.read(buffer).unwrap();
            assert_eq!(items.pop(), Some(GUARD), "the number past the end was overwritten");
            items
        });
        (State { parameter, first, second }, gpu.read(&n_bad).unwrap()[0])
    }
}

#[test]
fn n24_steps_of_any_gradient_are_the_twins() {
    let rate = 0.01f32;
    let mut faults = Vec::new();
    for step in [1, 2, 1000] {
        for g in [0.0f32, 1e-45, 1e-38, 1e-20, 1e-10, 1e-3, 1.0, 1e10, 1e19] {
            for (m, v) in [(0.0, 0.0), (0.5, 0.25)] {
                // From 0, so that the parameter is the step and no bit of it is lost.
                let mut state = State::new(vec![[0.0; 4]]);
                (state.first, state.second) = (vec![[m; 4]], vec![[v; 4]]);
                let (found, n_bad) = state.step(&[[g, -g, g, -g]], &[[rate; 4]], step, 0);
                assert_eq!(n_bad, 0);
                for (k, signed) in [g, -g, g, -g].into_iter().enumerate() {
                    let truth = state.twin(0, k).step(f64::from(signed), f64::from(rate), step);
                    let found = found.twin(0, k);
                    // Denormals may be flushed.
                    let close = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b.abs() + 1.2e-38;
                    let error = (found.parameter - truth.parameter).abs() / truth.parameter.abs().max(f64::from(rate));
                    if error > ALLOWED || !close(found.first, truth.first) || !close(found.second, truth.second) {
                        faults.push(format!(
                            "g = {signed:e}, step {step}, m = {m}: {error:.1e}, {found:?} for {truth:?}"
                        ));
                    }
                }
            }
        }
    }
    assert!(faults.is_empty(), "{} steps differ\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn a_thousand_steps_along_noise_follow_the_twin() {
    let mut random = Random::new(1);
    let rate = 0.01f32;
    let mut state = State::new(vec![[0.0; 4]; 3]);
    let mut twins: Vec<Adam<f64>> = (0..12).map(|i| state.twin(i / 4, i % 4)).collect();
    for step in 1..=1000 {
        let g: Vec<[f32; 4]> = (0..3).map(|_| random.vector(-1.0, 1.5)).collect();
        (state, _) = state.step(&g, &[[rate; 4]], step, 0);
        for (twin, g) in twins.iter_mut().zip(g.as_flattened()) {
            *twin = twin.step(f64::from(*g), f64::from(rate), step);
        }
    }
    for (i, twin) in twins.iter().enumerate() {
        let found = state.twin(i / 4, i % 4).parameter;
        assert!(twin.parameter.abs() > 0.1, "the parameter stayed at {twin:?}");
        // A rounding of the parameter and the error of the step, a thousand times.
        let allowed = 1000.0 * (f64::from(f32::EPSILON) * twin.parameter.abs() + ALLOWED * f64::from(rate));
        assert!((found - twin.parameter).abs() <= allowed, "{found} for {twin:?}");
    }
}

#[test]
fn n24_a_gradient_whose_square_overflows_takes_no_step_and_leaves_no_nan() {
    for g in [1e30f32, -1e30, f32::MAX] {
        for step in [1, 1000] {
            let state = State::new(vec![[1.25; 4]]);
            let (found, n_bad) = state.step(&[[g; 4]], &[[0.01; 4]], step, 0);
            assert_eq!((found.parameter[0], n_bad), ([1.25; 4], 0), "{g:e}");
            assert!(found.first[0].iter().all(|m| m.is_finite() && m.signum() == g.signum()), "{found:?}");
            assert!(found.second[0].iter().all(|v| *v == f32::INFINITY), "{found:?}");
        }
    }
}

#[test]
fn n24_no_gradient_and_no_moments_keep_the_parameters_bits() {
    let parameter = vec![[0.0, -0.0, 1.175_494_4e-38, -1e38], [0.1, -0.3, f32::MAX, f32::MIN_POSITIVE]];
    let state = State::new(parameter);
    for step in [1, 2, 1000] {
        let (found, n_bad) = state.step(&[[0.0, -0.0, 0.0, -0.0]; 2], &[[0.01; 4]], step, 0);
        assert_eq!((found.bits()[0].clone(), n_bad), (state.bits()[0].clone(), 0));
        assert!([found.first, found.second].iter().flatten().flatten().all(|x| *x == 0.0));
    }
}

#[test]
fn n24_a_gradient_that_is_not_finite_changes_nothing_of_its_vec4_and_is_counted() {
    let mut random = Random::new(5);
    let mut state = State::new((0..70).map(|_| random.vector(-1.0, 1.0)).collect());
    state.first.iter_mut().for_each(|m| *m = random.vector(-1.0, 1.0));
    state.second.iter_mut().for_each(|v| *v = random.vector(0.0, 1.0));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut gradient = vec![[0.5; 4]; 70];
        for i in [0, 31, 69] {
            gradient[i][i % 4] = bad;
        }
        let (found, n_bad) = state.step(&gradient, &[[0.01; 4]], 3, 0);
        assert_eq!(n_bad, 3);
        for i in 0..70 {
            let same = |a: &State, b: &State| {
                (a.parameter[i], a.first[i], a.second[i]) == (b.parameter[i], b.first[i], b.second[i])
            };
            assert_eq!(same(&found, &state), [0, 31, 69].contains(&i), "number {i} with {bad}");
        }
    }
}

#[test]
fn n24_rate_0_keeps_a_component_s_bits_and_moves_its_moments() {
    let state = State::new(vec![[0.3, -0.0, f32::MIN_POSITIVE, 1e30]; 40]);
    let rates = [[0.0, 0.0, 0.0, 0.0], [0.01, 0.0, 0.01, 0.0]];
    let (found, _) = state.step(&vec![[1.0; 4]; 40], &rates, 1, 0);
    for (i, (found, before)) in found.parameter.iter().zip(&state.parameter).enumerate() {
        for k in 0..4 {
            let moves = rates[i / 32 % 2][k] != 0.0 && k != 3;
            assert_eq!(found[k].to_bits() != before[k].to_bits(), moves, "number {i}, component {k}");
        }
    }
    assert!(found.first.as_flattened().iter().chain(found.second.as_flattened()).all(|m| *m > 0.0));
}

#[test]
fn a_failed_frame_moves_nothing() {
    let state = State::new(vec![[0.5; 4]; 33]);
    for failed in [1, 2, 1 << 31] {
        let (found, n_bad) = state.step(&[[1.0; 4]; 33], &[[0.01; 4]], 1, failed);
        assert_eq!((found.bits(), n_bad), (state.bits(), 0));
    }
    let (found, _) = state.step(&[[1.0; 4]; 33], &[[0.01; 4]], 1, 0);
    assert!(found.parameter.iter().all(|x| *x != [0.5; 4]), "the frame that did not fail moved nothing either");
}

#[test]
fn each_plane_of_a_block_moves_at_its_own_rates() {
    for planes in [1usize, 3, 4, 6] {
        let rates: Vec<[f32; 4]> =
            (0..planes).map(|p| std::array::from_fn(|k| (1 + 4 * p + k) as f32 * 1e-3)).collect();
        for n_items in [32, 64, 96] {
            let n = n_items * planes;
            let (found, _) = State::new(vec![[0.0; 4]; n]).step(&vec![[1.0; 4]; n], &rates, 1, 0);
            for item in 0..n_items {
                for (p, rates) in rates.iter().enumerate() {
                    let found = found.parameter[(item / 32 * planes + p) * 32 + item % 32];
                    // The first step along a gradient is the rate itself, or nearly.
                    let right = (0..4).all(|k| (found[k] + rates[k]).abs() <= 1e-4 * rates[k]);
                    assert!(right, "item {item}, plane {p} of {planes}: {found:?} for {rates:?}");
                }
            }
        }
    }
}
