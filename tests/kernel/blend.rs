//! Whole frames against the float64 truth, at sizes around a tile and in strips.

use crate::common::frames::{Tolerance, compare, pixels, render};
use crate::common::one::camera;
use crate::common::random::{scene, view};
use crate::common::stages::Rig;
use ivv::Constants;
use ivv::scene::View;
use ivv::stage::Strip;
use ivv::twin::render_f64;

#[test]
fn frames_of_random_scenes_are_those_of_float64() {
    for seed in 0..4 {
        let (splats, view) = (scene(seed, 150, (seed % 4) as u32), view());
        let (frame, report) = render(&splats, &view);
        assert!(report.intersections > 300 && report.bad_gaussians == 0, "seed {seed}: {report:?}");
        let truth = render_f64(&splats, &view, &Constants::default());
        compare(&frame, &truth, &Tolerance::default()).unwrap_or_else(|fault| panic!("seed {seed}: {fault}"));
    }
}

#[test]
fn frames_of_any_size_are_those_of_float64() {
    for (width, height) in [(1, 1), (1, 17), (15, 17), (16, 16), (17, 16), (33, 47), (1, 100), (100, 1)] {
        let center = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        let view = View { width, height, cx: center.0, cy: center.1, ..view() };
        let splats = scene(77, 120, 1);
        let (frame, report) = render(&splats, &view);
        assert!(report.intersections > 0, "{width} x {height}: nothing to see");
        let truth = render_f64(&splats, &view, &Constants::default());
        let n_seen = truth.alpha.iter().filter(|alpha| **alpha > 0.1).count();
        assert!(4 * n_seen > truth.alpha.len(), "{width} x {height}: the image is nearly empty");
        let what = format!("{width} x {height}");
        compare(&frame, &truth, &Tolerance::default()).unwrap_or_else(|fault| panic!("{what}: {fault}"));
    }
}

#[test]
fn strips_of_any_height_show_the_same_bits_as_the_whole() {
    let splats = scene(5, 150, 1);
    for view in [view(), camera(40, 70)] {
        let view = View { world_to_camera: self::view().world_to_camera, ..view };
        let whole = pixels(&render(&splats, &view).0);
        assert!(whole.iter().filter(|p| p[3] > 0.1).count() > whole.len() / 2, "the image is nearly empty");
        let rig = Rig::new(&splats, &view);
        for rows in [16, 32, 48] {
            let mut first_row = 0;
            while first_row < view.height {
                let strip = Strip { first_row, n_rows: rows.min(view.height - first_row) };
                let (image0, image1) = rig.blend(&view, strip);
                let expected = &whole[(first_row * view.width) as usize..][..image0.len()];
                for ((a, b), expected) in image0.iter().zip(&image1).zip(expected) {
                    let found = std::array::from_fn::<f32, 8, _>(|k| if k < 4 { a[k] } else { b[k - 4] });
                    assert_eq!(found.map(f32::to_bits), expected.map(f32::to_bits), "strip {strip:?}");
                }
                first_row += strip.n_rows;
            }
        }
    }
}
