//! Frames of the device against the independent float64 implementation.

use crate::common::golden::{CASES, load};
use crate::common::prelude::*;

/// Tensors of a frame, flat and row-major, with their channels per pixel.
fn tensors(frame: &Frame) -> [(&'static str, usize, Vec<f64>); 5] {
    let flat = |v: &[f32]| v.iter().map(|x| f64::from(*x)).collect();
    [
        ("color", 3, flat(frame.color.as_flattened())),
        ("alpha", 1, flat(&frame.alpha)),
        ("depth", 1, flat(&frame.depth)),
        ("inverse_depth", 1, flat(&frame.inverse_depth)),
        ("flow", 2, flat(frame.flow.as_flattened())),
    ]
}

#[test]
fn frames_match_the_golden_truth_to_1e_5_away_from_discontinuities_and_5e_4_over_all() {
    let gpu = gpu();
    for case in CASES {
        let Some(golden) = load(case) else { continue };
        let mut renderer = Renderer::new(gpu.clone(), &golden.splats, Constants::default()).unwrap();
        let (frame, report) = renderer.render(&golden.view, Outputs::All).unwrap();
        assert!(report.intersections > 0 && report.bad_gaussians == 0, "{case}: {report:?}");
        let band = render_f64(&golden.splats, &golden.view, &Constants::default()).near_discontinuity;
        let n_band = band.iter().filter(|near| **near).count();
        assert!(n_band * 5 < band.len(), "{case}: the band covers {n_band} of {} pixels", band.len());
        for (name, channels, found) in tensors(&frame) {
            let truth = &golden.outputs[name];
            let error = |keep: &dyn Fn(usize) -> bool| {
                let (mut difference, mut norm) = (0.0, 0.0);
                for (i, (a, b)) in found.iter().zip(truth).enumerate().filter(|(i, _)| keep(i / channels)) {
                    assert!(a.is_finite(), "{case}: {name}[{i}] is {a}");
                    difference += (a - b) * (a - b);
                    norm += b * b;
                }
                (difference.sqrt(), norm.sqrt())
            };
            let (all, norm) = error(&|_| true);
            if norm == 0.0 {
                assert_eq!((name, case, all), ("flow", "static-small", 0.0));
                continue;
            }
            let (away, norm_away) = error(&|pixel| !band[pixel]);
            assert!(norm_away > 0.5 * norm, "{case}: {name} is mostly in the band");
            assert!(away <= 1e-5 * norm_away, "{case}: {name} differs by {:e} away from the band", away / norm_away);
            assert!(all <= 5e-4 * norm, "{case}: {name} differs by {:e} over all", all / norm);
            eprintln!(
                "{case} {name}: {:.1e} away, {:.1e} over all, band {n_band}/{}",
                away / norm_away,
                all / norm,
                band.len()
            );
        }
    }
}
