//! Scenes and pictures at the size of the paper's; in the slow lane.

use crate::common::prelude::*;
use crate::common::random::view;

/// `n` small Gaussians of degree 3 in a box before [`large`].
fn crowd(n: usize) -> Splats {
    let mut random = Random::new(n as u64);
    let mut splats = Splats { n_static: n, ..Splats::new(3) };
    for i in 0..n {
        splats.position.push(random.vector(-2.0, 2.0));
        splats.rotation.push(random.vector(-1.0, 1.0));
        splats.scale.push(random.vector(-6.5, -5.0));
        splats.opacity.push(random.uniform(-2.0, 3.0) as f32);
        splats.sh.extend((0..16).map(|_| random.vector::<3>(-0.3, 0.5)));
        splats.source_row.push(i as u32);
    }
    splats
}

fn large(width: u32, height: u32) -> View {
    let f = f64::from(width) * 0.6;
    let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
    let mut view = View { intrinsics: Intrinsics { width, height, fx: f, fy: f, cx, cy }, ..view() };
    view.pose.translation.z = 5.0;
    view
}

#[test]
#[ignore = "slow: 2 million Gaussians"]
fn two_million_gaussians_at_2656_x_1494_fit_lavapipes_bindings_and_8_gib() {
    let gpu = gpu();
    let splats = crowd(2_000_000);
    let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
    drop(splats);
    let (frame, report) = renderer.render(&large(2656, 1494), Outputs::All).unwrap();
    assert!(report.visible > 1_900_000 && report.bad_gaussians == 0, "{report:?}");
    assert!(frame.color.as_flattened().iter().all(|x| x.is_finite()));
    assert!(frame.alpha.iter().filter(|alpha| **alpha > 0.5).count() > 500_000);
    assert!(gpu.device().memory().1 < 8 << 30, "peak of {} bytes", gpu.device().memory().1);
}

#[test]
#[ignore = "slow: 33 million pixels"]
fn pictures_of_8k_are_rendered_in_strips_that_join_without_a_seam() {
    let gpu = gpu();
    let splats = crowd(20_000);
    let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
    let (whole, report) = renderer.render(&large(7680, 4320), Outputs::Color).unwrap();
    let pixels_per_strip = gpu.caps().max_binding_bytes / 16;
    assert!(report.strips >= (7680 * 4320u64).div_ceil(pixels_per_strip), "{report:?}");
    // A quarter of the height, cut out by moving the principal point: other strips, the same pixels but for the
    // rounding of the moved coordinate.
    let mut cut = large(7680, 1080);
    (cut.intrinsics.fx, cut.intrinsics.fy, cut.intrinsics.cy) =
        (large(7680, 4320).intrinsics.fx, large(7680, 4320).intrinsics.fy, 2160.0 - 1616.0);
    let (part, _) = renderer.render(&cut, Outputs::Color).unwrap();
    let rows = &whole.color[1616 * 7680..(1616 + 1080) * 7680];
    let lit = part.color.iter().filter(|c| c.iter().sum::<f32>() > 1.5).count();
    let far = rows.iter().zip(&part.color).filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 0.02)).count();
    assert!(lit > 10_000 && far * 2000 < part.color.len(), "{far} pixels differ, {lit} are lit");
}
