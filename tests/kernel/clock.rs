//! The cameras' time offsets on the device, against their reference. Their gauge and bound: row N27 of `tests/conformance`.

use crate::common::prelude::*;
use ivv::internals::reference::{Clock, ClockRule, clock_step};
use ivv::internals::stage::{OFFSET_BOUND, TimeOffsets};
use ivv_conformance::fixtures::clocks::on_device;

tested! {
    "clock/clock_apply.comp" by Camera in a_clock_shifts_the_view_by_its_offset_in_frames;
    "clock/clock_step.comp" by clock_step in offsets_are_the_references_for_any_number_of_cameras;
}

#[test]
fn offsets_are_the_references_for_any_number_of_cameras() {
    let rule = ClockRule { rate: 1e-2, regulariser: 1e-2, bound: OFFSET_BOUND };
    let dt = 1.0 / 24.0;
    for n in [1, 2, 5, 63, 64, 65, 200] {
        let mut random = Random::new(n as u64);
        let mut clocks: Vec<Clock> = (0..n)
            .map(|k| Clock { offset: random.uniform(-1.0, 1.0), is_free: n == 1 || k % 4 != 1, ..Clock::default() })
            .map(|c| Clock { offset: f64::from(c.offset as f32), ..c })
            .collect();
        let steps: Vec<(usize, f32)> =
            (0..40).map(|_| (random.bits() as usize % n, random.uniform(-3.0, 3.0) as f32)).collect();
        let found = on_device(&gpu(), &clocks, &steps, &rule, dt, |_| false).unwrap();
        let start = clocks.clone();
        for (i, (camera, gradient)) in steps.iter().enumerate() {
            clock_step(&mut clocks, *camera, dt * f64::from(*gradient), &rule, i as i32 + 1);
            for (k, (found, truth)) in found[i].iter().zip(&clocks).enumerate() {
                let difference = (found - truth.offset).abs();
                // A step is the rate at most, in any direction, and has the relative error of a square root.
                assert!(difference <= 1e-5, "{n} cameras, step {i}, camera {k}: {found} for {}", truth.offset);
                assert!(truth.is_free || *found == start[k].offset, "a clock that is not learnt moved");
            }
        }
        let moved = found[39].iter().zip(&start).any(|(a, b)| (a - b.offset).abs() > 1e-2);
        assert!(moved || n == 1, "{n}: nothing moved");
    }
}

#[test]
fn a_failed_frame_or_a_gradient_that_is_not_finite_moves_nothing() {
    let rule = ClockRule { rate: 1e-2, regulariser: 0.0, bound: OFFSET_BOUND };
    let start: Vec<Clock> =
        [0.5, -0.25, -0.25].map(|offset| Clock { offset, is_free: true, ..Clock::default() }).to_vec();
    let steps = [(0, 1.0), (1, f32::NAN), (2, f32::INFINITY), (1, 1.0)];
    let found = on_device(&gpu(), &start, &steps, &rule, 1.0, |i| i == 0).unwrap();
    for (i, offsets) in found[..3].iter().enumerate() {
        assert_eq!(offsets, &[0.5, -0.25, -0.25], "step {i}");
    }
    assert!(found[3][1] < -0.25 && found[3][0] > 0.5, "{:?}", found[3]);
}

#[test]
fn a_clock_shifts_the_view_by_its_offset_in_frames() {
    let gpu = gpu();
    let view = crate::common::random::view();
    let params = view_params(&view, &Constants::default(), [0.0; 3], Strip::whole(&view));
    let clocks = TimeOffsets::new(&gpu, &[[0.5, 0.0, 0.0, 0.0], [-1.25, 9.0, 9.0, 9.0]], &[true, false]).unwrap();
    for (camera, offset) in [(0, 0.5), (1, -1.25)] {
        let buffer = gpu.upload("view", &[params]).unwrap();
        let mut rec = Recording::new();
        clocks.record_apply(&mut rec, &buffer, camera);
        gpu.run(&rec).unwrap();
        let shifted = gpu.read(&buffer).unwrap()[0];
        let (time, flow_dt) = (f64::from(params.time), f64::from(params.background[3]));
        let truth = Camera::<f64> { time, flow_dt, ..Camera::new(&view) }.shifted_time(offset);
        assert!((f64::from(shifted.time) - truth).abs() <= 1e-7 && shifted.time != params.time, "{}", shifted.time);
        assert_eq!(bytemuck::bytes_of(&shifted)[..128], bytemuck::bytes_of(&params)[..128], "the rest is left alone");
    }
}
