//! Nothing is judged that a review has not looked at: things that few cameras see, and things that are there for a moment.

use super::require::{BACKGROUND, cameras, config, look, shown};
use super::trainer;
use crate::common::prelude::*;
use ivv::internals::scene::SH_C0;
use ivv::internals::scene::capture::{Camera, Shot};
use ivv::internals::train::{Due, Review};

fn push(splats: &mut Splats, place: [f64; 3], deviation: f32, sh: [[f32; 3]; 4], motion: Option<Motion>) {
    splats.source_row.push(splats.len() as u32);
    splats.position.push(place.map(|x| x as f32));
    splats.rotation.push([1.0, 0.0, 0.0, 0.0]);
    splats.scale.push([deviation.ln(); 3]);
    splats.opacity.push(2.0);
    splats.sh.extend(sh);
    splats.motion.extend(motion);
    splats.n_static += usize::from(motion.is_none());
}

/// Colours that the background has not, and another from each side.
fn shining(random: &mut Random) -> [[f32; 3]; 4] {
    [random.vector(0.4, 0.8), random.vector(0.3, 0.6), random.vector(-0.6, -0.3), random.vector(0.3, 0.6)]
}

/// What a review makes of `begin` before the first step of a run on `capture`, and what is left.
fn reviewed(capture: &Capture, begin: &Splats, images: usize) -> (Review, Splats) {
    let required = Required { reviews: 1, grids_at: 0.3 };
    let config = Config { required, ..config() };
    let mut trainer = trainer(capture, &config, begin, 1000);
    let review = look(&mut trainer, capture, Due::Gaussians, images);
    let splats = trainer.splats().unwrap();
    assert_eq!((review.before, review.after), (begin.len(), splats.len()));
    (review, splats)
}

/// A camera for each 15 degrees of a circle of radius 2.4, which looks outward and sees 100 degrees, over six frames.
fn circle() -> Capture {
    const N: usize = 24;
    let mut capture = cameras();
    let camera = |k: usize| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / N as f64).sin_cos();
        let own = &capture.cameras[0];
        let fx = f64::from(own.intrinsics.width) / 2.0 / 50f64.to_radians().tan();
        let world_to_camera =
            Pose::of_rows(&[[cos, 0.0, -sin, 0.0], [0.0, 1.0, 0.0, 0.0], [sin, 0.0, cos, -2.4], [0.0, 0.0, 0.0, 1.0]]);
        let shots = (0..6).map(|frame| Shot { frame, ..Shot::default() }).collect();
        let (name, is_test) = (format!("cam{k:02}"), false);
        let (cx, cy) = (f64::from(own.intrinsics.width) / 2.0, f64::from(own.intrinsics.height) / 2.0);
        let intrinsics = Intrinsics { fx, fy: fx, cx, cy, ..own.intrinsics };
        Camera { name, is_test, is_photo: false, intrinsics, world_to_camera, shots }
    };
    (capture.n_frames, capture.cameras) = (6, (0..N).map(camera).collect());
    capture
}

#[test]
fn what_two_of_24_cameras_see_stays_with_all_that_they_see_of_it() {
    let _device = gpu();
    let (mut truth, mut random) = (Splats::new(1), Random::new(3));
    for k in 0..24 {
        let (sin, cos) = (std::f64::consts::TAU * (f64::from(k) + 0.5) / 24.0).sin_cos();
        // Only the two nearest lenses see it, from directions 66 degrees apart.
        for height in [-0.15, 0.15] {
            push(&mut truth, [3.0 * sin, height, 3.0 * cos], 0.03, shining(&mut random), None);
        }
    }
    let tiny = shown("require-two", circle(), &truth);
    let (review, _) = reviewed(&tiny.capture, &truth, 128);
    println!("{review:?}");
    assert_eq!((review.removed, review.merged, review.lost_bands), (0, 0, [0; 3]));

    // One picture in six is too few to see all of them in four; all are seen where the budget allows.
    let (few, splats) = reviewed(&tiny.capture, &truth, 24);
    println!("{few:?}");
    assert_eq!((few.removed, few.lost_bands, splats.len()), (0, [0; 3], 48));
    assert!(few.pictures == 24 && few.left > 10 && review.left <= 2 && review.pictures <= 128, "{few:?}");
    assert_eq!(review.unseen, 0);
}

#[test]
fn what_is_there_for_two_of_100_frames_is_judged_by_pictures_of_these() {
    let _device = gpu();
    const FRAMES: u32 = 100;
    let mut capture = cameras();
    capture.n_frames = FRAMES;
    for camera in &mut capture.cameras {
        camera.shots =
            (0..if camera.is_test { 0 } else { FRAMES }).map(|frame| Shot { frame, ..Shot::default() }).collect();
    }
    let places: Vec<[f64; 3]> =
        super::require::known(&capture, 0.0).position.into_iter().map(|place| place.map(f64::from)).collect();
    let moment = |k: usize, n: usize| {
        let t_center = (k as f32 + 0.5) / n as f32;
        Some(Motion { velocity: [0.0; 3], t_center, t_scale: (1.0 / FRAMES as f32).ln() })
    };
    let (mut truth, mut random) = (Splats::new(1), Random::new(3));
    let n = 50;
    for k in 0..n {
        push(&mut truth, places[k % places.len()], 0.25, shining(&mut random), moment(k, n));
    }
    let tiny = shown("require-moments", capture, &truth);
    // As many again behind them that look like the background: no picture needs them.
    let mut begin = truth.clone();
    let same = BACKGROUND.map(|c| ((f64::from(c) - 0.5) / SH_C0) as f32);
    for k in 0..n {
        let sh = [same, [0.0; 3], [0.0; 3], [0.0; 3]];
        let [x, y, _] = places[k % places.len()];
        push(&mut begin, [x, y, 6.0], 0.3, sh, moment(k, n));
    }
    let (review, splats) = reviewed(&tiny.capture, &begin, 256);
    let is_useless = |i: &usize| splats.sh[i * 4].iter().zip(same).all(|(a, b)| (a - b).abs() < 0.1);
    let useless = (0..splats.len()).filter(is_useless).count();
    let bands = (0..splats.len()).filter(|i| splats.degree_of(*i) > 0 && !is_useless(i)).count();
    println!("{useless} useless ones and {bands} bands of {n} are left: {review:?}");
    assert_eq!(splats.len() - useless, n, "all that is needed stays");
    assert!(useless <= 44, "{useless} of {n} useless ones are left");
    // A band that shines stays, since it was looked at or since it was not.
    assert_eq!(bands, n);
}
