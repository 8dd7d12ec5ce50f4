//! The reference's Adam by its definition.

use ivv::internals::reference::{Adam, Dual};

#[test]
fn steps_along_one_gradient_are_the_rate_long_at_any_time() {
    for g in [1e-8, 1e-3, -1.0, 1e12] {
        let mut state = Adam::<f64>::default();
        for step in 1..=50 {
            let before = state.parameter;
            state = state.step(g, 0.01, step);
            let length = (before - state.parameter) * g.signum();
            // eps makes a step along 1e-8 shorter by 1e-7.
            assert!((length / 0.01 - 1.0).abs() < 1.1e-7, "step {step} along {g:e}: {length}");
        }
    }
}

#[test]
fn the_moments_are_the_decayed_means_of_gradients_and_squares() {
    let gradients = [0.5, -2.0, 0.25, 3.0];
    let state = gradients.iter().zip(1..).fold(Adam::<f64>::default(), |state, (g, step)| state.step(*g, 0.1, step));
    let mean = |beta: f64, power: i32| -> f64 {
        let weight = |k: usize| (1.0 - beta) * beta.powi(3 - k as i32);
        gradients.iter().enumerate().map(|(k, g)| weight(k) * g.powi(power)).sum()
    };
    let [beta1, beta2] = [0.9f32, 0.999].map(f64::from);
    assert!((state.first - mean(beta1, 1)).abs() < 1e-12 && (state.second - mean(beta2, 2)).abs() < 1e-12);
}

#[test]
fn no_gradient_a_bad_one_and_rate_0_leave_the_parameter_alone() {
    let still = Adam { parameter: 0.3, first: 0.0, second: 0.0 };
    assert_eq!(still.step(0.0, 0.01, 7), still);
    let state = Adam { parameter: 0.3, first: 0.1, second: 0.2 };
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(state.step(bad, 0.01, 7), state);
    }
    let frozen = state.step(1.0, 0.0, 7);
    assert!(frozen.parameter == 0.3 && frozen.first > 0.1 && frozen.second > 0.2);
    // In single precision the square of 1e30 is infinite, and so is the step's divisor.
    let far = Adam::<f32>::default().step(1e30, 0.01, 1);
    assert!(far.parameter == 0.0 && far.second == f32::INFINITY, "{far:?}");
    assert!(state.step(1.0, 0.01, 7).parameter != 0.3);
}

#[test]
fn a_step_can_be_differentiated_by_its_gradient() {
    let state = |h: f64| Adam { parameter: 0.3, first: 0.1, second: 0.2 }.step(0.5 + h, 0.01, 3).parameter;
    let start = Adam { parameter: 0.3, first: 0.1, second: 0.2 };
    let dual = |x: f64| Dual::new(x, 0.0);
    let found = Adam { parameter: dual(start.parameter), first: dual(start.first), second: dual(start.second) };
    let found = found.step(Dual::new(0.5, 1.0), 0.01, 3).parameter;
    let expected = (state(1e-6) - state(-1e-6)) / 2e-6;
    assert!(expected != 0.0 && (found.tangent - expected).abs() < 1e-8, "{found:?} for {expected}");
}
