//! Gradients of the camera's pose and of the background against differences of the truth.

use super::check::{smooth_cotangents, vjp};
use crate::common::prelude::*;
use crate::common::random::{scene, view};

tested! {
    "project/camera_sum.comp" by render_f64 in pose_and_background_gradients_are_the_differences_of_the_truth;
    "project/camera_total.comp" by render_f64 in pose_and_background_gradients_are_the_differences_of_the_truth;
    "blend/background_sum.comp" by render_f64 in pose_and_background_gradients_are_the_differences_of_the_truth;
}

/// `view` turned by `turn` (radians about its own axes) and shifted by `shift` along them.
fn moved(view: &View, turn: [f64; 3], shift: [f64; 3]) -> View {
    let rotation = glam::DMat3::from_quat(glam::DQuat::from_scaled_axis(turn.into()));
    let old = glam::DMat4::from_cols_array_2d(&view.pose.rows()).transpose();
    let new = glam::DMat4::from_mat3(rotation) * old;
    let mut pose = Pose::of_rows(&new.transpose().to_cols_array_2d());
    pose.translation += glam::DVec3::from(shift);
    View { pose, ..view.clone() }
}

fn objective(splats: &Splats, view: &View, cotangents: &Frame) -> f64 {
    let truth = render_f64(splats, view, &Constants::default());
    let part = |a: &[f32], b: &[f64]| a.iter().zip(b).map(|(a, b)| f64::from(*a) * b).sum::<f64>();
    part(cotangents.color.as_flattened(), truth.color.as_flattened())
        + part(&cotangents.alpha, &truth.alpha)
        + part(&cotangents.depth, &truth.depth)
        + part(&cotangents.inverse_depth, &truth.inverse_depth)
        + part(cotangents.flow.as_flattened(), truth.flow.as_flattened())
}

#[test]
fn pose_and_background_gradients_are_the_differences_of_the_truth() {
    for (seed, degree) in [(1, 0), (2, 3)] {
        let splats = scene(seed, 25, degree);
        // Turned and shifted, so that no axis is special.
        let view = moved(&view(), [0.2, -0.3, 0.4], [0.1, 0.2, -0.1]);
        let cotangents = smooth_cotangents(seed, &splats, &view);
        let (found, report) = vjp(&splats, &view, &cotangents);
        assert!(report.intersections > 0 && found.n_bad == 0);
        let h = 1e-6;
        let axis = |k: usize, h: f64| std::array::from_fn::<f64, 3, _>(|i| if i == k { h } else { 0.0 });
        let difference = |of: &dyn Fn(f64) -> View| {
            (objective(&splats, &of(h), &cotangents) - objective(&splats, &of(-h), &cotangents)) / (2.0 * h)
        };
        let turn: [f64; 3] = std::array::from_fn(|k| difference(&|h| moved(&view, axis(k, h), [0.0; 3])));
        let shift: [f64; 3] = std::array::from_fn(|k| difference(&|h| moved(&view, [0.0; 3], axis(k, h))));
        let norm = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        for (name, found, truth) in
            [("rotation", found.camera_rotation, turn), ("translation", found.camera_translation, shift)]
        {
            let error = norm(&std::array::from_fn(|k| found[k] - truth[k]));
            assert!(norm(&truth) > 0.1 && error <= 1e-4 * norm(&truth), "{name}: {found:?} for {truth:?}");
        }
        // Linear: the transmittance behind everything, weighted.
        let truth = render_f64(&splats, &view, &Constants::default());
        let background: [f64; 3] = std::array::from_fn(|k| {
            cotangents.color.iter().zip(&truth.alpha).map(|(c, a)| f64::from(c[k]) * (1.0 - a)).sum()
        });
        let error = norm(&std::array::from_fn(|k| found.background[k] - background[k]));
        assert!(norm(&background) > 0.1 && error <= 1e-5 * norm(&background), "{:?}", found.background);
    }
}
