//! The lenses and their inverse, against round trips and against COLMAP's own pictures.

use crate::common::prelude::*;
use image::ImageReader;
use ivv::internals::scene::undistort::{Lens, Undistortion};

const SIZE: (u32, u32) = (64, 48);

fn lens(focal: f64, distortion: Distortion) -> Lens {
    let intrinsics = Intrinsics { width: SIZE.0, height: SIZE.1, fx: focal, fy: 1.02 * focal, cx: 31.25, cy: 24.5 };
    Lens { intrinsics, distortion }
}

/// COLMAP's models that distort, with parameters of real cameras.
fn models() -> [(&'static str, Lens); 9] {
    let brown = |radial, tangential| Distortion::brown(radial, tangential);
    [
        ("SIMPLE_RADIAL", lens(50.0, brown([-0.08, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 2]))),
        ("RADIAL", lens(50.0, brown([0.17, -0.23, 0.0, 0.0, 0.0, 0.0], [0.0; 2]))),
        ("OPENCV", lens(45.0, brown([-0.046, 0.14, 0.0, 0.0, 0.0, 0.0], [6e-4, 7e-4]))),
        ("FULL_OPENCV", lens(45.0, brown([-0.33, 0.046, 0.067, 0.02, -0.01, 0.003], [-4e-3, 4e-3]))),
        ("OPENCV_FISHEYE", lens(28.0, Distortion::Fisheye([0.05, -0.02, 0.004, -0.001]))),
        ("DIVISION", lens(45.0, Distortion::Division(-0.12))),
        ("DIVISION", lens(60.0, Distortion::Division(0.1))),
        ("EUCM", lens(40.0, Distortion::Unified { alpha: 0.6, beta: 1.1 })),
        ("FOV", lens(40.0, Distortion::FieldOfView(0.9))),
    ]
}

#[test]
fn every_model_goes_there_and_back() {
    for (name, lens) in models() {
        assert_eq!(lens.distortion.model(), name);
        let reach = lens.reach();
        let (mut n, mut moved) = (0, 0.0_f64);
        for row in 0..=SIZE.1 {
            for column in 0..=SIZE.0 {
                let at = [f64::from(column), f64::from(row)];
                let plane = lens.plane(at, reach).unwrap_or_else(|| panic!("{name}: {at:?} has no ray"));
                let back = lens.pixel(plane, reach).unwrap();
                assert!((0..2).all(|k| (back[k] - at[k]).abs() < 1e-6), "{name}: {at:?} comes back as {back:?}");
                let straight = [
                    plane[0] * lens.intrinsics.fx + lens.intrinsics.cx,
                    plane[1] * lens.intrinsics.fy + lens.intrinsics.cy,
                ];
                moved = moved.max((straight[0] - at[0]).hypot(straight[1] - at[1]));
                n += 1;
            }
        }
        assert!(n == 65 * 49 && moved > 0.2, "{name}: moves by {moved} at most");
    }
}

/// COLMAP 4's own formulas, for a point at (x, y, 1), in units of the focal length.
#[test]
fn lenses_of_colmap_4_are_as_it_has_them() {
    let (x, y) = (0.4_f64, -0.3_f64);
    let r = x.hypot(y);
    let k = -0.12;
    let division = 2.0 / (1.0 + (1.0 - 4.0 * r * r * k).sqrt());
    let (alpha, beta) = (0.6, 1.1);
    let unified = 1.0 / (alpha * (beta * r * r + 1.0).sqrt() + (1.0 - alpha));
    let omega = 0.9_f64;
    let field = (r * 2.0 * (omega / 2.0).tan()).atan() / (r * omega);
    for (distortion, scale) in [
        (Distortion::Division(k), division),
        (Distortion::Unified { alpha, beta }, unified),
        (Distortion::FieldOfView(omega), field),
    ] {
        let lens = lens(50.0, distortion);
        let [u, v] = lens.pixel([x, y], lens.reach()).unwrap();
        assert!(
            (u - (31.25 + 50.0 * x * scale)).abs() < 1e-9 && (v - (24.5 + 51.0 * y * scale)).abs() < 1e-9,
            "{distortion:?}"
        );
        assert_eq!(lens.fault(), None);
        // Its middle is where a pinhole has it.
        assert_eq!(lens.pixel([0.0, 0.0], lens.reach()), Some([31.25, 24.5]));
    }
    assert!(
        lens(50.0, Distortion::Unified { alpha: 1.5, beta: 1.0 })
            .fault()
            .unwrap()
            .contains("alpha = 1.5, expected 0 to 1")
    );
    assert!(lens(50.0, Distortion::Unified { alpha: 0.5, beta: -1.0 }).fault().unwrap().contains("beta = -1.0"));
    assert!(lens(50.0, Distortion::FieldOfView(4.0)).fault().unwrap().contains("omega = 4.0"));
}

#[test]
fn what_a_lens_folds_or_bends_beyond_ninety_degrees_is_nothing() {
    // r (1 - 0.5 r^2) rises up to r^2 = 2/3, where it is 0.544.
    let folding = lens(50.0, Distortion::brown([-0.5, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 2]));
    let reach = folding.reach();
    assert!((reach - (2.0_f64 / 3.0).sqrt()).abs() < 0.006, "{reach}");
    let at = |r: f64| [folding.intrinsics.cx + r * folding.intrinsics.fx, folding.intrinsics.cy];
    assert!(folding.plane(at(0.54), reach).is_some() && folding.plane(at(0.55), reach).is_none());
    assert!(folding.pixel([0.8, 0.0], reach).is_some() && folding.pixel([0.9, 0.0], reach).is_none());
    // The plain angle: 90 degrees at a radius of pi / 2 focal lengths.
    let fisheye = lens(18.0, Distortion::Fisheye([0.0; 4]));
    let reach = fisheye.reach();
    let at = |angle: f64| [fisheye.intrinsics.cx + angle.to_radians() * fisheye.intrinsics.fx, fisheye.intrinsics.cy];
    let plane = fisheye.plane(at(60.0), reach).unwrap();
    assert!((plane[0] - 60_f64.to_radians().tan()).abs() < 1e-9);
    for angle in [90.0, 91.0, 120.0, 179.0] {
        assert_eq!(fisheye.plane(at(angle), reach), None, "{angle} degrees");
    }
    // A flow that leads there has no end in the pinhole.
    let undistortion = Undistortion::new(fisheye, fisheye.pinhole().unwrap());
    let away = vec![[1e3_f32, 0.0]; (SIZE.0 * SIZE.1) as usize];
    assert!(undistortion.flow(&away).iter().all(|v| v[0] > 1e9));
}

#[test]
fn the_pinhole_holds_no_black_pixel_and_no_more_than_it_must_lose() {
    for (name, lens) in models() {
        let pinhole = lens.pinhole().unwrap();
        assert_eq!(
            (pinhole.distortion, pinhole.intrinsics.fx, pinhole.intrinsics.fy),
            (Distortion::None, lens.intrinsics.fx, lens.intrinsics.fy)
        );
        let undistortion = Undistortion::new(lens, pinhole);
        assert_eq!(undistortion.validity(), None, "{name}");
        let white = vec![[255_u8; 3]; (SIZE.0 * SIZE.1) as usize];
        let made = undistortion.image(&white);
        assert_eq!(made.len() as u32, pinhole.intrinsics.width * pinhole.intrinsics.height);
        assert!(made.iter().all(|pixel| *pixel == [255; 3]), "{name}");
        // One pixel farther on any side would look past the border somewhere.
        let (w, h) = (f64::from(pinhole.intrinsics.width), f64::from(pinhole.intrinsics.height));
        let outside = |at: [f64; 2]| {
            undistortion.source_of(at).is_none_or(|[x, y]| {
                !(0.5..=f64::from(SIZE.0) - 0.5).contains(&x) || !(0.5..=f64::from(SIZE.1) - 0.5).contains(&y)
            })
        };
        let side = |n: u32| (0..4 * n).map(|i| 0.25 * f64::from(i) + 0.5);
        let grown = f64::from(pinhole.intrinsics.width) > 2.0 * f64::from(SIZE.0) - 3.0;
        assert!(grown || side(pinhole.intrinsics.height).any(|y| outside([-0.6, y])), "{name}: left");
        assert!(grown || side(pinhole.intrinsics.height).any(|y| outside([w + 0.6, y])), "{name}: right");
        assert!(grown || side(pinhole.intrinsics.width).any(|x| outside([x, -0.6])), "{name}: top");
        assert!(grown || side(pinhole.intrinsics.width).any(|x| outside([x, h + 0.6])), "{name}: bottom");
    }
    let pinhole = lens(50.0, Distortion::None);
    assert_eq!(pinhole.pinhole(), Some(pinhole));
}

#[test]
fn pixels_outside_are_masked_and_masks_are_not_mixed() {
    let source = models()[0].1;
    // A target that shows more than the source.
    let Intrinsics { fx, fy, .. } = source.intrinsics;
    let wide = Intrinsics { fx: fx / 2.0, fy: fy / 2.0, ..source.intrinsics };
    let target = Lens { intrinsics: wide, distortion: Distortion::None };
    let undistortion = Undistortion::new(source, target);
    let validity = undistortion.validity().unwrap();
    let n_valid = validity.iter().filter(|v| **v == 255).count();
    assert!(n_valid > 400 && n_valid < validity.len() - 400, "{n_valid} of {}", validity.len());
    let checks: Vec<u8> = (0..SIZE.0 * SIZE.1).map(|i| if (i / 7) % 2 == 0 { 40 } else { 200 }).collect();
    let mask = undistortion.mask(&checks);
    assert!(mask.contains(&40) && mask.contains(&200) && mask.iter().all(|v| [0, 40, 200].contains(v)));
    assert!(mask.iter().zip(&validity).all(|(mask, valid)| (*mask > 0) == (*valid > 0)));
    let depth: Vec<f32> = checks.iter().map(|v| f32::from(*v)).collect();
    let depth = undistortion.depth(&depth);
    assert!(depth.iter().zip(&mask).all(|(z, mask)| if *mask == 0 { z.is_nan() } else { *z == f32::from(*mask) }));
}

#[test]
fn rims_keep_the_colour_of_what_is_opaque() {
    for (name, lens) in models() {
        let opaque = |i: u32| i % SIZE.0 < SIZE.0 / 4;
        let part: Vec<[u8; 4]> =
            (0..SIZE.0 * SIZE.1).map(|i| if opaque(i) { [200, 100, 50, 255] } else { [0; 4] }).collect();
        let made = Undistortion::new(lens, lens.pinhole().unwrap()).image(&part);
        let n_rim = made.iter().filter(|pixel| (17..255).contains(&pixel[3])).count();
        assert!(n_rim > 10, "{name}: {n_rim}");
        for pixel in made.iter().filter(|pixel| pixel[3] > 16) {
            assert_eq!(pixel[..3], [200, 100, 50], "{name}: {pixel:?}");
        }
        assert!(made.contains(&[0; 4]), "{name}");
    }
}

/// A camera moves along its axis by a tenth of the depth of a plane in front of it: the flow of the distorted picture, by the
/// lens, must become that of the pinhole.
#[test]
fn both_ends_of_a_flow_are_undistorted() {
    for (name, lens) in models() {
        let reach = lens.reach();
        let pinhole = lens.pinhole().unwrap();
        let undistortion = Undistortion::new(lens, pinhole);
        let factor = 1.0 / 0.97;
        let flow: Vec<[f32; 2]> = (0..SIZE.0 * SIZE.1)
            .map(|i| {
                let at = [f64::from(i % SIZE.0) + 0.5, f64::from(i / SIZE.0) + 0.5];
                let [x, y] = lens.plane(at, reach).unwrap();
                let end = lens.pixel([x * factor, y * factor], reach).unwrap();
                [(end[0] - at[0]) as f32, (end[1] - at[1]) as f32]
            })
            .collect();
        let mut worst = 0.0_f64;
        let mut largest = 0.0_f64;
        for (i, found) in (0_u32..).zip(undistortion.flow(&flow)) {
            let at = [f64::from(i % pinhole.intrinsics.width) + 0.5, f64::from(i / pinhole.intrinsics.width) + 0.5];
            let expected =
                [(at[0] - pinhole.intrinsics.cx) * (factor - 1.0), (at[1] - pinhole.intrinsics.cy) * (factor - 1.0)];
            worst = worst.max((0..2).map(|k| (f64::from(found[k]) - expected[k]).abs()).fold(0.0, f64::max));
            largest = largest.max(expected[0].hypot(expected[1]));
        }
        // Bilinear interpolation of the flow of a 64-pixel picture; without the lens the ends would miss by far more.
        assert!(largest > 0.7 && worst < 0.012, "{name}: {worst} px of flows up to {largest} px");
    }
    // One unknown neighbour makes a flow unknown.
    let lens = models()[2].1;
    let undistortion = Undistortion::new(lens, lens.pinhole().unwrap());
    let mut flow = vec![[0.0_f32; 2]; (SIZE.0 * SIZE.1) as usize];
    flow[24 * SIZE.0 as usize + 30] = [1e10; 2];
    let n_unknown = undistortion.flow(&flow).iter().filter(|v| v[0] > 1e9).count();
    assert!((1..=9).contains(&n_unknown), "{n_unknown}");
}

fn rgb(path: &std::path::Path) -> (u32, Vec<[u8; 3]>) {
    let image = ImageReader::open(path).unwrap().decode().unwrap().into_rgb8();
    (image.width(), image.as_raw().as_chunks::<3>().0.to_vec())
}

#[test]
fn colmap_undistorts_a_simple_radial_picture_to_the_same() {
    let Some(path) = shared("data/colmap_simple_radial_7img") else { return };
    let dense = Capture::open(path.join("dense")).unwrap();
    let bytes = std::fs::read(path.join("sparse/0/cameras.bin")).unwrap();
    let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let u64_at = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as u32;
    let f64_at = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    // Id, model 2, width, height, f, cx, cy, k; as many as images.
    let mut lenses = std::collections::HashMap::new();
    for index in 0..7 {
        let at = 8 + index * 56;
        assert_eq!(u32_at(at + 4), 2);
        let (width, height) = (u64_at(at + 8), u64_at(at + 16));
        let [f, cx, cy, k] = [24, 32, 40, 48].map(|offset| f64_at(at + offset));
        let distortion = Distortion::brown([k, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 2]);
        let intrinsics = Intrinsics { width, height, fx: f, fy: f, cx, cy };
        lenses.insert(f.to_bits(), Lens { intrinsics, distortion });
    }
    let mut worst = f64::INFINITY;
    // Pictures of 1280 x 720 are slow where nothing is optimised.
    for camera in dense.cameras.iter().take(if cfg!(debug_assertions) { 1 } else { 7 }) {
        let lens = lenses[&camera.intrinsics.fx.to_bits()];
        let Intrinsics { width, height, .. } = camera.intrinsics;
        let target = Lens { intrinsics: camera.intrinsics, distortion: Distortion::None };
        // COLMAP keeps the principal point where it was in proportion: its rectangle is a part of ours.
        let ours = lens.pinhole().unwrap().intrinsics;
        let more = (ours.width as i64 - i64::from(width), ours.height as i64 - i64::from(height));
        assert!((-2..60).contains(&more.0) && (-2..60).contains(&more.1), "{ours:?} beside {width} x {height}");
        let name = camera.shots[0].image.file_name().unwrap().to_owned();
        let (_, distorted) = rgb(&path.join("images").join(&name));
        let (found_width, expected) = rgb(&camera.shots[0].image);
        assert_eq!(found_width, width);
        let made = Undistortion::new(lens, target).image(&distorted);
        let square = |(a, b): (&[u8; 3], &[u8; 3])| (0..3).map(|k| f64::from(a[k].abs_diff(b[k])).powi(2)).sum::<f64>();
        let mse = made.iter().zip(&expected).map(square).sum::<f64>() / (3 * made.len()) as f64;
        let psnr = 10.0 * (255.0_f64.powi(2) / mse).log10();
        let plain = distorted.iter().zip(&expected).map(square).sum::<f64>() / (3 * expected.len()) as f64;
        eprintln!("{}: {psnr:.2} dB", name.display());
        assert!(plain > 20.0 * mse, "undistortion changes too little to be tested: {plain}, {mse}");
        worst = worst.min(psnr);
    }
    // Both pictures are JPEG, so they cannot be the same.
    assert!(worst > 42.0, "{worst} dB");
}
