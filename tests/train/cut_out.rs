//! The first Gaussians of things that were cut out, on transparency.

use crate::common::prelude::*;
use image::{Rgba, RgbaImage};
use ivv::internals::train::{Initial, random_points};

const SIDE: u32 = 48;
const N_CAMERAS: usize = 24;

/// Where a ray meets the cube of sides 2 around the origin, and the colour there: stripes on a colour of each side.
fn hit(from: DVec3, ray: DVec3) -> Option<[u8; 3]> {
    let (a, b) = ((-1.0 - from) / ray, (1.0 - from) / ray);
    let (first, last) = (a.min(b).max_element(), a.max(b).min_element());
    (first > 0.0 && first < last).then(|| {
        let at = from + first * ray;
        let axis = (0..3).max_by(|i, j| at[*i].abs().total_cmp(&at[*j].abs())).unwrap();
        let stripe = (4.0 * (at[(axis + 1) % 3] + 1.0)) as u8 % 2;
        let mut color = [220, 220, 220];
        color[axis] = if at[axis] > 0.0 { 120 } else { 170 };
        color.map(|level| level - 40 * stripe)
    })
}

/// A cube before `N_CAMERAS` cameras at a distance, which it fills in the same way whatever that is; on transparency or, opaque, on
/// black. Its transforms.json is in the convention of NeRF's: x right, y up, z back.
fn cube(name: &str, distance: f64, transparent: bool) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cut-out").join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let focal = f64::from(SIDE) * distance / 6.0;
    let mut frames = Vec::new();
    for k in 0..N_CAMERAS {
        // By the golden angle: all over a sphere but its poles.
        let (turn, height) = (2.399_963 * k as f64, 0.8 - 1.4 * k as f64 / N_CAMERAS as f64);
        let around = (1.0 - height * height).sqrt();
        let center = distance * DVec3::new(around * turn.cos(), around * turn.sin(), height);
        let back = center.normalize();
        let right = DVec3::Z.cross(back).normalize();
        let axes = DMat3::from_cols(right, back.cross(right), back);
        let image = RgbaImage::from_fn(SIDE, SIDE, |x, y| {
            let at = |pixel: u32| f64::from(pixel) + 0.5 - f64::from(SIDE) / 2.0;
            let color = hit(center, axes * DVec3::new(at(x) / focal, -at(y) / focal, -1.0));
            let alpha = if color.is_some() || !transparent { 255 } else { 0 };
            let [r, g, b] = color.unwrap_or_default();
            Rgba([r, g, b, alpha])
        });
        image.save(folder.join(format!("{k}.png"))).unwrap();
        let [x, y, z] = [axes.x_axis, axes.y_axis, axes.z_axis].map(|axis| axis.to_array());
        let rows: Vec<[f64; 4]> = (0..3).map(|row| [x[row], y[row], z[row], center[row]]).collect();
        let matrix = [rows[0], rows[1], rows[2], [0.0, 0.0, 0.0, 1.0]];
        frames.push(serde_json::json!({ "file_path": format!("{k}.png"), "transform_matrix": matrix }));
    }
    let document = serde_json::json!({ "w": SIDE, "h": SIDE, "fl_x": focal, "frames": frames });
    std::fs::write(folder.join("transforms.json"), document.to_string()).unwrap();
    folder
}

/// The first Gaussians in the capture's own frame, and how many of them are within `reach` of the cube.
fn first(folder: &Path, init: Init, reach: f32) -> (Initial, Splats, usize) {
    let capture = Capture::open(folder).unwrap();
    let world = capture.normalisation();
    let config = Config { init, init_points: 2000, sh_degree: 0, ..exact() };
    let initial = initialise(&capture.transformed(&world), &config, &mut |_, _| {}).unwrap();
    let splats = world.inverse().splats(&initial.splats);
    let is_near = |at: &&[f32; 3]| at.iter().all(|x| x.abs() < 1.0 + reach);
    let n_near = splats.position.iter().filter(is_near).count();
    (initial, splats, n_near)
}

#[test]
fn nothing_begins_in_what_is_transparent() {
    let (initial, splats, n_near) = first(&cube("near", 6.0, true), Init::Auto, 0.25);
    assert!(splats.len() > 400, "{initial}");
    assert!(n_near as f64 > 0.9 * splats.len() as f64, "{n_near}; {initial}");
    // The background is black.
    let is_black = |sh: &&[f32; 3]| sh.iter().all(|c| 0.2821 * c + 0.5 < 0.2);
    let n_black = splats.sh.iter().filter(is_black).count();
    assert!(n_black * 50 < splats.len(), "{n_black} of {}", splats.len());
}

#[test]
fn long_lenses_begin_with_what_they_look_at() {
    let (initial, splats, n_near) = first(&cube("tele", 70.0, true), Init::Auto, 0.25);
    assert!(splats.len() > 400, "{initial}");
    assert!(n_near as f64 > 0.9 * splats.len() as f64, "{n_near} of {}; {initial}", splats.len());
}

#[test]
fn random_points_are_where_most_cameras_look() {
    let folder = cube("random", 70.0, false);
    let (initial, splats, n_near) = first(&folder, Init::Random, 4.0);
    assert_eq!(splats.len(), 2000, "{initial}");
    // In the ball of the cameras one of 3,000 would be.
    assert!(n_near > 600, "{n_near}");
    // The same seed, the same points.
    let capture = Capture::open(&folder).unwrap();
    let config = Config { init_points: 100, ..exact() };
    assert_eq!(random_points(&capture, &config), random_points(&capture, &config));
}
