//! The losses against priors of depth and flow on the device, against dual numbers. No error at all: row N20 of
//! `tests/conformance`.

use crate::common::prelude::*;
use ivv::internals::stage::DepthSpace;
use ivv_conformance::fixtures::priors::Case;

tested! {
    "loss/prior_loss.comp" by depth_loss in values_and_cotangents_are_those_of_dual_numbers;
}

const SPACES: [DepthSpace; 2] = [DepthSpace::Inverse, DepthSpace::Metric];

#[test]
fn values_and_cotangents_are_those_of_dual_numbers() {
    for n in [1, 2, 63, 64, 65, 1000] {
        for space in SPACES {
            let case = Case::random(5, n);
            let found = case.on_device(&gpu(), space).unwrap();
            let weights = case.weights();
            let mut random = Random::new(6);
            let w: Vec<[f32; 4]> = (0..n).map(|_| random.vector(-1.0, 1.0)).collect();
            let [depth, flow] = case.dual(space, &w);
            for (found, truth) in found.values.into_iter().zip([depth, flow]) {
                assert!((found - truth.value).abs() <= 1e-6 * truth.value, "{n}: {found} for {truth:?}");
            }
            let along = |a: &[f32; 4], b: &[f32; 4]| (0..4).map(|k| f64::from(a[k]) * f64::from(b[k])).sum::<f64>();
            let sum: f64 = found.d_image1.iter().zip(&w).map(|(d, w)| along(d, w)).sum();
            let truth = weights.depth * depth.tangent + weights.flow * flow.tangent;
            let norm = found.d_image1.iter().map(|d| along(d, d)).sum::<f64>().sqrt();
            assert!(n < 63 || norm > 0.0, "{n}: no cotangent");
            assert!((sum - truth).abs() <= 1e-6 * norm * (4.0 * n as f64).sqrt(), "{n}, {space:?}: {sum} for {truth}");
            for (i, d) in found.d_image1.iter().enumerate() {
                assert!(case.counts[i] || *d == [0.0; 4], "{n}: hidden pixel {i} has {d:?}");
                let other = if space == DepthSpace::Metric { d[1] } else { d[0] };
                assert!(d.iter().all(|x| x.is_finite()) && other == 0.0, "{n}: pixel {i} has {d:?}");
                assert!(case.depth[i].is_finite() || d[..2] == [0.0; 2], "{n}: pixel {i} has no prior of depth: {d:?}");
            }
        }
    }
}

#[test]
fn poison_in_the_picture_stays_in_its_pixel() {
    let mut case = Case::random(9, 200);
    case.counts.fill(true);
    case.image1[70] = [f32::NAN, f32::INFINITY, f32::NAN, f32::NEG_INFINITY];
    let found = case.on_device(&gpu(), DepthSpace::Inverse).unwrap();
    let others = found.d_image1.iter().enumerate().filter(|(i, _)| *i != 70);
    assert!(others.clone().all(|(_, d)| d.iter().all(|x| x.is_finite())));
    assert!(others.filter(|(_, d)| **d != [0.0; 4]).count() > 100);
}
