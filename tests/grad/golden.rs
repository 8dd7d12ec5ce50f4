//! Gradients against the independent float64 implementation.

use crate::common::golden::{CASES, Golden, load};
use crate::common::prelude::*;

fn cotangents(golden: &Golden) -> Frame {
    let flat = |name: &str| golden.cotangents[name].iter().map(|x| *x as f32).collect::<Vec<f32>>();
    Frame {
        width: golden.view.intrinsics.width,
        height: golden.view.intrinsics.height,
        color: flat("color").as_chunks().0.to_vec(),
        alpha: flat("alpha"),
        depth: flat("depth"),
        inverse_depth: flat("inverse_depth"),
        flow: flat("flow").as_chunks().0.to_vec(),
    }
}

/// The gradients that the scene's parameters have, flat: a static scene has no temporal ones.
fn groups(d: &Gradients, is_dynamic: bool) -> Vec<(&'static str, Vec<f64>)> {
    let flat = |v: &[f32]| v.iter().map(|x| f64::from(*x)).collect::<Vec<f64>>();
    let p = &d.params;
    let mut all = vec![
        ("position", flat(p.position.as_flattened())),
        ("rotation", flat(p.rotation.as_flattened())),
        ("scale", flat(p.scale.as_flattened())),
        ("opacity", flat(&p.opacity)),
        ("sh", flat(p.sh.as_flattened())),
    ];
    if is_dynamic {
        all.extend([
            ("velocity", p.motion.iter().flat_map(|m| m.velocity).map(f64::from).collect()),
            ("t_center", p.motion.iter().map(|m| f64::from(m.t_center)).collect()),
            ("t_scale", p.motion.iter().map(|m| f64::from(m.t_scale)).collect()),
            ("time_offset", vec![d.time_offset]),
        ]);
    }
    all
}

#[test]
fn gradients_match_the_golden_truth_to_1e_4_with_a_cosine_of_0_99999() {
    let gpu = gpu();
    for (case, mode) in CASES.iter().flat_map(|case| Sums::ALL.map(|mode| (*case, mode))) {
        let Some(golden) = load(case) else { continue };
        let mut renderer = Renderer::new(gpu.clone(), &golden.splats, Constants::default()).unwrap();
        if let Err(reason) = renderer.accumulate(mode) {
            crate::common::notes::skip(format!("{case}: {reason}"));
            continue;
        }
        let (found, report) = renderer.vjp(&golden.view, &cotangents(&golden)).unwrap();
        assert!(report.intersections > 0 && found.n_bad == 0, "{case}, {mode:?}: {report:?}");
        for (name, found) in groups(&found, golden.splats.n_static < golden.splats.len()) {
            let truth = &golden.gradients[name];
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let norm = dot(truth, truth).sqrt();
            assert!(norm > 0.0 && found.len() == truth.len(), "{case}: {name} has no gradient to compare");
            let difference: Vec<f64> = found.iter().zip(truth).map(|(a, b)| a - b).collect();
            let error = dot(&difference, &difference).sqrt() / norm;
            let cosine = dot(&found, truth) / (norm * dot(&found, &found).sqrt());
            eprintln!("{case} {mode:?} {name}: {error:.1e}, 1 - cosine {:.1e}", 1.0 - cosine);
            assert!(error <= 1e-4, "{case}, {mode:?}: d_{name} differs by {error:e}");
            assert!(cosine >= 0.99999, "{case}, {mode:?}: d_{name} has cosine {cosine}");
        }
    }
}
