//! Whole frames against the float64 truth, at sizes around a tile and in strips.

use crate::adversary::slack;
use crate::common::frames::{Tolerance, compare, pixels, render_with};
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use crate::common::stages::Fixture;

tested! {
    "blend/blend_fwd.comp" by render_f64 in frames_of_random_scenes_are_those_of_float64;
}

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
fn frames_of_wild_scenes_are_those_of_float64() {
    for seed in 0..6 {
        let (splats, view) = (wild_scene(seed, 200), view());
        let (frame, report) = render(&splats, &view);
        assert!(report.intersections > 100 && report.bad_gaussians == 0, "seed {seed}: {report:?}");
        let truth = render_f64(&splats, &view, &Constants::default());
        let tolerance = Tolerance { n_band: 0.3, ..Tolerance::default() };
        compare(&frame, &truth, &tolerance).unwrap_or_else(|fault| panic!("seed {seed}: {fault}"));
    }
}

#[test]
fn frames_with_other_constants_are_those_of_float64() {
    let usual = Constants::default();
    let all = [
        Constants { alpha_min: 1e-4, ..usual },
        Constants { alpha_min: 0.05, ..usual },
        Constants { alpha_max: 0.8, ..usual },
        Constants { alpha_max: 0.9999, ..usual },
        Constants { t_min: 0.1, ..usual },
        Constants { t_min: 1e-8, ..usual },
        Constants { blur: 0.0, ..usual },
        Constants { blur: 0.05, ..usual },
        Constants { blur: 4.0, ..usual },
        Constants { near: 4.0, ..usual },
    ];
    let (mut splats, view) = (scene(8, 150, 0), view());
    splats.opacity.iter_mut().for_each(|o| *o += 3.0);
    let usual = render(&splats, &view).0;
    for constants in all {
        let (frame, _) = render_with(&splats, &view, constants);
        assert!(pixels(&frame) != pixels(&usual), "{constants:?} changes nothing");
        let truth = render_f64(&splats, &view, &constants);
        compare(&frame, &truth, &Tolerance::default()).unwrap_or_else(|fault| panic!("{constants:?}: {fault}"));
    }
}

#[test]
fn frames_of_any_size_are_those_of_float64() {
    for (width, height) in [(1, 1), (1, 17), (15, 17), (16, 16), (17, 16), (33, 47), (1, 100), (100, 1)] {
        let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        let view = View { intrinsics: Intrinsics { width, height, cx, cy, ..view().intrinsics }, ..view() };
        let splats = scene(77, 120, 1);
        let (frame, report) = render(&splats, &view);
        assert!(report.intersections > 0, "{width} x {height}: nothing to see");
        let truth = render_f64(&splats, &view, &Constants::default());
        let n_seen = truth.alpha.iter().filter(|alpha| **alpha > 0.1).count();
        assert!(4 * n_seen > truth.alpha.len(), "{width} x {height}: the image is nearly empty");
        let what = format!("{width} x {height}");
        let tolerance = Tolerance { away: slack(2.0) * 1e-5, ..Tolerance::default() };
        compare(&frame, &truth, &tolerance).unwrap_or_else(|fault| panic!("{what}: {fault}"));
    }
}

#[test]
fn strips_of_any_height_show_the_same_bits_as_the_whole() {
    let splats = scene(5, 150, 1);
    for view in [view(), camera(40, 70)] {
        let view = View { pose: self::view().pose, ..view };
        let whole = pixels(&render(&splats, &view).0);
        assert!(whole.iter().filter(|p| p[3] > 0.1).count() > whole.len() / 2, "the image is nearly empty");
        let fixture = Fixture::new(&splats, &view);
        for rows in [16, 32, 48] {
            let mut first_row = 0;
            while first_row < view.intrinsics.height {
                let strip = Strip { first_row, n_rows: rows.min(view.intrinsics.height - first_row) };
                let (image0, image1) = fixture.blend(&view, strip);
                let expected = &whole[(first_row * view.intrinsics.width) as usize..][..image0.len()];
                let both = image0.iter().zip(&image1);
                let found: Vec<[f32; 8]> =
                    both.map(|(a, b)| std::array::from_fn(|k| if k < 4 { a[k] } else { b[k - 4] })).collect();
                assert_same(format_args!("{strip:?}"), &found, expected);
                first_row += strip.n_rows;
            }
        }
    }
}
