//! Flow as a displacement, and depths that leave the opacities alone.

use super::check::{check_adjoint, cotangents, flat, smooth_cotangents, vjp};
use crate::adversary::slack;
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use ivv::internals::stage::{Capacity, Size, Target, Workspace};

/// [`view`], and a frame on turned by 0.05 about its y axis and shifted.
fn moving_view() -> View {
    let base = view();
    let turn = glam::DMat4::from_rotation_y(0.05) * glam::DMat4::from_translation(glam::DVec3::new(0.03, -0.02, 0.05));
    let old = glam::DMat4::from_cols_array_2d(&base.pose.rows()).transpose();
    let next = Pose::of_rows(&(turn * old).transpose().to_cols_array_2d());
    View { flow_model: FlowModel::Displacement, next_pose: Some(next), ..base }
}

#[test]
fn a_displacement_is_rendered_as_the_truth_and_has_its_adjoint() {
    let still = View { next_pose: None, ..moving_view() };
    for (name, view) in [("moving", moving_view()), ("still", still)] {
        let splats = scene(4, 60, 1);
        let truth = render_f64(&splats, &view, &Constants::default());
        let gpu = gpu();
        let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
        let (found, _) = renderer.render(&view, Outputs::All).unwrap();
        let linear = View { flow_model: FlowModel::Velocity, ..view.clone() };
        let (velocity, _) = renderer.render(&linear, Outputs::All).unwrap();
        let difference = |a: &[[f32; 2]], b: &dyn Fn(usize, usize) -> f64| {
            let pixels = (0..a.len()).filter(|i| !truth.near_discontinuity[*i]);
            pixels.flat_map(|i| [0, 1].map(|k| (f64::from(a[i][k]) - b(i, k)).powi(2))).sum::<f64>().sqrt()
        };
        let norm = difference(&found.flow, &|_, _| 0.0);
        let error = difference(&found.flow, &|i, k| truth.flow[i][k]);
        let from_velocity = difference(&velocity.flow, &|i, k| truth.flow[i][k]);
        assert!(norm > 1.0 && error <= 1e-5 * norm, "{name}: {error:e} of {norm}");
        assert!(from_velocity > 1e-3 * norm, "{name}: the two models are the same: {from_velocity:e}");
        assert_eq!((&found.color, &found.depth), (&velocity.color, &velocity.depth), "{name}");
        // Static Gaussians move in the picture when the camera does.
        check_adjoint(&splats, &view, &smooth_cotangents(6, &splats, &view), 1e-5, 9).unwrap();
    }
}

#[test]
fn to_first_order_a_displacement_is_the_velocity() {
    let splats = scene(4, 60, 0);
    let gpu = gpu();
    let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
    let mut relative = Vec::new();
    for flow_dt in [1e-2, 1e-3] {
        let view = View { flow_dt, time_offset: 0.0, ..view() };
        let (velocity, _) = renderer.render(&view, Outputs::All).unwrap();
        let view = View { flow_model: FlowModel::Displacement, ..view };
        let (displacement, _) = renderer.render(&view, Outputs::All).unwrap();
        let square = |a: &[[f32; 2]]| a.as_flattened().iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        let difference: Vec<[f32; 2]> =
            velocity.flow.iter().zip(&displacement.flow).map(|(a, b)| [a[0] - b[0], a[1] - b[1]]).collect();
        relative.push((square(&difference) / square(&velocity.flow)).sqrt());
    }
    assert!(relative[0] > 0.0 && relative[0] < 0.05, "{relative:?}");
    assert!(relative[1] < slack(2.5) * 0.2 * relative[0], "the difference is not of second order: {relative:?}");
}

#[test]
fn a_detached_depth_moves_places_and_no_opacities() {
    let (splats, view) = (scene(11, 80, 0), view());
    let only_depth = Frame {
        color: vec![[0.0; 3]; (view.intrinsics.width * view.intrinsics.height) as usize],
        alpha: vec![0.0; (view.intrinsics.width * view.intrinsics.height) as usize],
        flow: vec![[0.0; 2]; (view.intrinsics.width * view.intrinsics.height) as usize],
        ..cotangents(12, &view, |_| false)
    };
    let (attached, _) = vjp(&splats, &view, &only_depth);
    let gpu = gpu();
    let scene = SceneBuffers::upload(&gpu, &splats, &Constants::default(), Purpose::Gradient).unwrap();
    let (tiles_x, tiles_y) = Strip::whole(&view).tiles(&view);
    let n_pixels = view.intrinsics.width * view.intrinsics.height;
    let capacity = Capacity {
        active: scene.n,
        intersections: 1 << 14,
        tiles: tiles_x * tiles_y,
        pixels: n_pixels as usize,
        outputs: Outputs::All,
        purpose: Purpose::Gradient,
        sums: Sums::Slots,
        camera: false,
        idle: false,
        is_batched: false,
        depth_bits: 32,
    };
    let work = Workspace::new(&gpu, &scene, capacity).unwrap();
    let mut params = view_params(&view, &Constants::default(), scene.origin, Strip::whole(&view));
    params.depth_to_alpha = 0.0;
    gpu.write(&work.view, &[params]).unwrap();
    let backward = work.backward.as_ref().unwrap();
    let image1: Vec<[f32; 4]> =
        only_depth.depth.iter().zip(&only_depth.inverse_depth).map(|(d, i)| [*d, *i, 0.0, 0.0]).collect();
    gpu.write(&backward.d_image0, &vec![[0.0; 4]; n_pixels as usize]).unwrap();
    gpu.write(backward.d_image1.as_ref().unwrap(), &image1).unwrap();
    let mut rec = Recording::new();
    let size = Size { n_tiles: capacity.tiles, n_pixels, rounds: 1 };
    let lists = work.record_forward(&mut rec, &scene, size, |_| ());
    work.record_backward(&mut rec, &scene, &lists, size, &Target::Gradients);
    gpu.run(&rec).unwrap();
    let detached = scene.download(&gpu, backward.gradients.iter()).unwrap();
    assert!(flat(&attached, "opacity").iter().any(|x| *x != 0.0));
    assert!(detached.opacity.iter().all(|x| *x == 0.0), "{:?}", detached.opacity);
    assert!(detached.scale.as_flattened().iter().all(|x| *x == 0.0));
    let moved = detached.position.iter().filter(|p| **p != [0.0; 3]).count();
    assert!(moved > 20, "{moved} of {} centres have a gradient", splats.len());
}
