//! Only what a scene requires: on scenes of Gaussians whose every part is known, seen by a capture's own cameras.

use super::{Tiny, trainer};
use crate::common::prelude::*;
use ivv::internals::scene::capture::{Camera, Shot};
use ivv::internals::stage::Response;
use ivv::internals::train::{Due, Evidence, Review, Seen, merge_resting, psnr, review, review_due};

/// So that noise is not clamped.
pub const BACKGROUND: [f32; 3] = [0.4; 3];

/// A capture whose pictures show Gaussians; its folder goes with it.
pub struct Shown {
    folder: PathBuf,
    pub capture: Capture,
}

impl Drop for Shown {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// The cameras and points of a capture of eight frames.
pub fn cameras() -> Capture {
    static CAMERAS: OnceLock<Capture> = OnceLock::new();
    CAMERAS.get_or_init(|| Tiny::of_frames("require-cameras", 8).capture.clone()).clone()
}

/// The cameras and points of a capture of eight frames, with pictures that show `truth`, a little noisy.
fn capture_of(name: &str, truth: impl Fn(&Capture) -> Splats) -> (Shown, Splats) {
    let capture = cameras();
    let truth = truth(&capture);
    (shown(name, capture, &truth), truth)
}

/// `capture` with pictures that show `truth`, a little noisy.
pub fn shown(name: &str, mut capture: Capture, truth: &Splats) -> Shown {
    let folder = std::env::temp_dir().join(format!("ivv-train-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut renderer = Renderer::new(gpu().clone(), truth, Constants::default()).unwrap();
    let mut random = Random::new(5);
    for (camera, frame) in [capture.training_frames(), capture.test_frames()].concat() {
        let view = View { background: BACKGROUND, ..capture.view(camera, frame).unwrap() };
        let (mut picture, _) = renderer.render(&view, Outputs::Color).unwrap();
        let noise = |x: &mut f32| *x += 0.02 * random.uniform(-1.0, 1.0) as f32;
        picture.color.as_flattened_mut().iter_mut().for_each(noise);
        let image = folder.join(format!("{camera}-{frame}.png"));
        picture.write_png(&image).unwrap();
        let shot = capture.cameras[camera].shots.iter_mut().find(|shot| shot.frame == frame).unwrap();
        *shot = Shot { frame, image, ..Shot::default() };
    }
    Shown { folder, capture }
}

/// Gaussians where the capture's points are, far enough from each other to be told apart: every fourth moves if
/// there is a speed, scene units per clip; every third has a first band.
pub fn known(capture: &Capture, speed: f32) -> Splats {
    let mut random = Random::new(11);
    let mut chosen: Vec<[f64; 3]> = Vec::new();
    for point in &capture.points {
        let apart = |q: &[f64; 3]| (0..3).map(|k| (q[k] - point.position[k]).powi(2)).sum::<f64>() > 0.25;
        if chosen.iter().all(apart) {
            chosen.push(point.position);
        }
    }
    let n_static = if speed > 0.0 { chosen.len() - chosen.len() / 4 } else { chosen.len() };
    let mut splats = Splats { n_static, ..Splats::new(1) };
    for (i, place) in chosen.iter().enumerate() {
        splats.position.push(place.map(|x| x as f32));
        splats.rotation.push([1.0, 0.0, 0.0, 0.0]);
        splats.scale.push([(0.15f32).ln(); 3]);
        splats.opacity.push(2.0);
        splats.sh.push(random.vector(0.0, 1.5));
        for _ in 0..3 {
            splats.sh.push(if i % 3 == 0 { random.vector(-1.0, 1.0) } else { [0.0; 3] });
        }
        if i >= n_static {
            let way: [f32; 3] = random.vector(-1.0, 1.0);
            let length = way.iter().map(|x| x * x).sum::<f32>().sqrt().max(0.1);
            splats.motion.push(Motion { velocity: way.map(|x| speed * x / length), t_center: 0.5, t_scale: 1.5 });
        }
        splats.source_row.push(i as u32);
    }
    splats
}

/// `truth` with all that can be modelled: every Gaussian moves a little and fades a little, and has a first band.
fn everything(truth: &Splats) -> Splats {
    let mut random = Random::new(17);
    let motion = (0..truth.len()).map(|i| match i.checked_sub(truth.n_static) {
        Some(at) => truth.motion[at],
        None => Motion { velocity: random.vector(-0.03, 0.03), t_center: 0.5, t_scale: 0.7 },
    });
    let motion = motion.collect();
    let mut all = Splats { n_static: 0, motion, ..truth.clone() };
    all.sh.as_flattened_mut().iter_mut().for_each(|x| *x += random.uniform(-0.03, 0.03) as f32);
    all
}

pub fn config() -> Config {
    let loss = ivv::internals::train::Loss { depth: 0.0, flow: 0.0, ..Default::default() };
    let density = ivv::internals::train::Density { stop: 0.0, ..Default::default() };
    let required = Required { reviews: 1, grids_at: 0.3 };
    // The truth lets the background through.
    let vary_background = false;
    Config { sh_degree: 1, background: BACKGROUND, vary_background, loss, density, required, ..super::steady() }
}

pub fn look(trainer: &mut Trainer, capture: &Capture, due: Due, images: usize) -> Review {
    review(trainer, &gpu(), capture, Constants::default(), due, images, &mut |_, _| {}).unwrap()
}

/// Trains `steps` steps from `begin`, reviews, and trains as many again.
fn reviewed(capture: &Capture, begin: &Splats, steps: u64) -> (Review, Trainer) {
    let config = config();
    let mut trainer = trainer(capture, &config, begin, 2 * steps);
    super::drive(&mut trainer, capture, config.seed, steps);
    (look(&mut trainer, capture, Due::Gaussians, 40), trainer)
}

/// Index in `truth` of the Gaussian that each of `found` is, by where they are in the middle of the clip.
fn names(found: &Splats, truth: &Splats) -> Vec<usize> {
    let middle = |s: &Splats, i: usize| -> [f32; 3] {
        let at = i.checked_sub(s.n_static).map(|at| s.motion[at]);
        std::array::from_fn(|k| s.position[i][k] + at.map_or(0.0, |m| m.velocity[k] * (0.5 - m.t_center)))
    };
    let distance = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>();
    let nearest = |i: usize| {
        let far = |j: &usize| distance(middle(found, i), middle(truth, *j));
        (0..truth.len()).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap()
    };
    (0..found.len()).map(nearest).collect()
}

#[test]
fn what_moves_and_what_shines_is_told_from_what_does_not() {
    let _device = gpu();
    let (tiny, truth) = capture_of("require", |capture| known(capture, 1.2));
    let (n, n_moving) = (truth.len(), truth.motion.len());
    assert!(n_moving >= 8 && n > 30, "{n_moving} of {n} move");
    let (review, mut trainer) = reviewed(&tiny.capture, &everything(&truth), 40);
    let splats = trainer.splats().unwrap();
    assert!(review.noise > 0.005 && review.noise < 0.05, "{review:?}");
    assert_eq!((review.before, review.after), (n, splats.len()));
    let names = names(&splats, &truth);
    let moves = |i: usize| i >= truth.n_static;
    let found = names.iter().enumerate().filter(|(at, _)| *at >= splats.n_static);
    let right = found.clone().filter(|(_, i)| moves(**i)).count();
    let n_found = found.count();
    let there = names.iter().filter(|i| moves(**i)).count();
    println!("{n} Gaussians, {n_moving} move; {n_found} found, {right} of them rightly, of {there} left; {review:?}");
    assert!(right as f64 >= 0.99 * n_found as f64 && right as f64 >= 0.99 * there as f64 && there + 2 >= n_moving);
    // A band that is there and pays stays; one that is not goes.
    let shines = |i: usize| i.is_multiple_of(3);
    let bands = names.iter().enumerate().filter(|(at, _)| splats.degree_of(*at) > 0);
    let (kept, rightly) = bands.fold((0, 0), |(n, right), (_, i)| (n + 1, right + usize::from(shines(*i))));
    let shining = names.iter().filter(|i| shines(**i)).count();
    println!("{kept} bands kept, {rightly} of them rightly, of {shining}");
    assert!(rightly as f64 >= 0.95 * f64::from(kept) && rightly as f64 >= 0.8 * shining as f64);
}

#[test]
fn a_scene_that_stands_still_ends_without_a_dynamic_gaussian_and_without_a_grid() {
    let _device = gpu();
    let (tiny, truth) = capture_of("require-still", |capture| known(capture, 0.0));
    let (first, mut trainer) = reviewed(&tiny.capture, &everything(&truth), 40);
    super::drive(&mut trainer, &tiny.capture, config().seed, 60);
    let again = look(&mut trainer, &tiny.capture, Due::Gaussians, 40);
    let splats = trainer.splats().unwrap();
    assert!(splats.len() + 2 >= truth.len() && splats.motion.is_empty(), "{first:?} {again:?}");
    let grids = look(&mut trainer, &tiny.capture, Due::Grids, 40);
    assert!(grids.grids.len() == 4 && grids.grids.iter().all(|check| !check.is_needed), "{grids:?}");
    // Nothing moves, so no picture tells any offset.
    let mut renderer = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
    let pictures = ivv::internals::train::offset_pictures(&tiny.capture, BACKGROUND, 0).unwrap();
    assert!(!ivv::internals::train::fit_offset(&mut renderer, &pictures, 0.0, 0).unwrap().is_identifiable());
}

#[test]
fn one_camera_of_another_exposure_gets_the_only_grid() {
    let _device = gpu();
    let (tiny, truth) = capture_of("require-grid", |capture| known(capture, 0.0));
    let odd = tiny.capture.training_frames()[0].0;
    for shot in &tiny.capture.cameras[odd].shots {
        let picture = image::open(&shot.image).unwrap().to_rgb8();
        let brighter = image::ImageBuffer::from_fn(picture.width(), picture.height(), |x, y| {
            image::Rgb(picture.get_pixel(x, y).0.map(|level| (0.8 * f64::from(level)).round() as u8))
        });
        brighter.save(&shot.image).unwrap();
    }
    let config = config();
    let setup = Setup::new(&tiny.capture, &config);
    assert!(setup.has_grid.is_empty(), "grids come when they are needed");
    let mut trainer = Trainer::new(gpu().clone(), &truth, Constants::default(), config.clone(), 100, setup).unwrap();
    super::drive(&mut trainer, &tiny.capture, config.seed, 8);
    let found = look(&mut trainer, &tiny.capture, Due::Grids, 40);
    let name = &tiny.capture.cameras[odd].name;
    let needing: Vec<&String> = found.grids.iter().filter(|check| check.is_needed).map(|check| &check.camera).collect();
    assert_eq!(needing, [name], "{found:?}");
    // The grid is learnt from then on, and a checkpoint knows whose it is.
    super::drive(&mut trainer, &tiny.capture, config.seed, 30);
    let state = trainer.checkpoint().unwrap().cameras;
    assert_eq!((state.grids.len(), state.has_grid.iter().filter(|has| **has).count()), (1, 1));
    assert!(state.has_grid[odd] && state.grids[0].identity_deviation() > 1e-3);
}

#[test]
fn what_moves_and_was_taken_for_static_begins_to_move() {
    wakes("require-wake", cameras());
}

/// Photographs show what rests at no moment of the clip.
#[test]
fn what_moves_begins_to_move_beside_photographs_too() {
    let mut capture = cameras();
    let filming: Vec<Camera> = capture.cameras.iter().filter(|camera| !camera.is_test).cloned().collect();
    for camera in filming {
        let name = format!("photo of {}", camera.name);
        let shots = vec![Shot { frame: 0, ..Shot::default() }];
        capture.cameras.push(Camera { name, is_photo: true, shots, ..camera });
    }
    assert!(capture.has_photos());
    wakes("require-wake-photos", capture);
}

fn wakes(name: &str, capture: Capture) {
    let _device = gpu();
    let truth = known(&capture, 0.5);
    let tiny = shown(name, capture, &truth);
    // So slow that a static Gaussian overlaps with what it shows.
    let still = Splats { n_static: truth.len(), motion: Vec::new(), ..truth.clone() };
    let (review, mut trainer) = reviewed(&tiny.capture, &still, 20);
    let splats = trainer.splats().unwrap();
    let names = names(&splats, &truth);
    let woken: Vec<usize> = (splats.n_static..splats.len()).map(|at| names[at]).collect();
    let right = woken.iter().filter(|i| **i >= truth.n_static).count();
    println!("{} begin to move, {right} rightly, of {}; {review:?}", woken.len(), truth.motion.len());
    assert!(right + 1 >= woken.len() && right + 1 >= truth.motion.len());
}

#[test]
fn in_a_capture_of_one_moment_nothing_begins_to_move() {
    let _device = gpu();
    let mut capture = cameras();
    capture.n_frames = 1;
    capture.cameras.iter_mut().for_each(|camera| camera.shots.truncate(1));
    let truth = known(&capture, 0.0);
    let tiny = shown("require-moment", capture, &truth);
    // Not yet where they belong, as in a short run.
    let mut begin = truth.clone();
    begin.position.iter_mut().step_by(4).for_each(|at| at[0] += 0.05);
    let (review, mut trainer) = reviewed(&tiny.capture, &begin, 2);
    assert!(trainer.splats().unwrap().motion.is_empty(), "{review:?}");
}

#[test]
fn what_was_dropped_brings_nothing_when_it_is_given_back() {
    let _device = gpu();
    let (tiny, truth) = capture_of("require-back", |capture| known(capture, 1.2));
    let (_, mut trainer) = reviewed(&tiny.capture, &everything(&truth), 40);
    super::drive(&mut trainer, &tiny.capture, config().seed, 72);
    let required = trainer.splats().unwrap();
    // Everything again, at its null values, for one more epoch; beside it the same epoch without.
    let n = required.len();
    let at_rest = Motion { velocity: [0.0; 3], t_center: 0.5, t_scale: 2.0 };
    let motion = (0..n).map(|i| i.checked_sub(required.n_static).map_or(at_rest, |at| required.motion[at]));
    let back = Splats { n_static: 0, motion: motion.collect(), degree: Vec::new(), ..required.clone() };
    let after_an_epoch = |splats: &Splats| {
        let config = Config { required: Required::default(), grids: GridKind::None, ..config() };
        let mut trainer = super::trainer(&tiny.capture, &config, splats, 1000);
        super::drive(&mut trainer, &tiny.capture, config.seed, 32);
        test_psnr(&tiny.capture, &trainer.splats().unwrap())
    };
    let (with, without) = (after_an_epoch(&back), after_an_epoch(&required));
    println!("{with:.3} dB with everything, {without:.3} dB with what is required");
    assert!(without > 30.0 && with < without + 0.05);
}

fn test_psnr(capture: &Capture, splats: &Splats) -> f64 {
    let mut renderer = Renderer::new(gpu().clone(), splats, Constants::default()).unwrap();
    let psnrs = capture.test_frames().into_iter().map(|(camera, frame)| {
        let view = View { background: BACKGROUND, ..capture.view(camera, frame).unwrap() };
        let (seen, _) = renderer.render(&view, Outputs::Color).unwrap();
        let truth = capture.picture(camera, frame).unwrap();
        let errors = seen.color.iter().zip(&truth.pixels).flat_map(|(color, word)| {
            let truth = word.to_le_bytes();
            (0..3).map(move |c| (f64::from(color[c]) - f64::from(truth[c]) / 255.0).powi(2))
        });
        psnr(errors.sum::<f64>() / (3.0 * truth.pixels.len() as f64))
    });
    let all: Vec<f64> = psnrs.collect();
    all.iter().sum::<f64>() / all.len() as f64
}

#[test]
fn cameras_have_their_turn_though_gaussians_are_looked_at_after_the_same_step() {
    let due_of = |reviews: u32, grids_at: f64| -> Vec<(u64, Due)> {
        let required = Required { reviews, grids_at };
        let config = Config { grids: GridKind::Affine, required, ..exact() };
        (0..=10).filter_map(|step| Some((step, review_due(&config, step, 10)?))).collect()
    };
    let due = |grids_at: f64| due_of(2, grids_at);
    let reviews = [(6, Due::Gaussians), (8, Due::Gaussians)];
    assert_eq!(due(0.6), [reviews[0], (7, Due::Grids), reviews[1]]);
    assert_eq!(due(0.001), [(1, Due::Grids), reviews[0], reviews[1]]);
    // All have one from the start.
    assert_eq!(due(0.0), reviews);
    // More than there are steps.
    assert_eq!(due_of(u32::MAX, 0.0), [reviews[0], (7, Due::Gaussians), reviews[1]]);
}

/// Dynamic Gaussians at rest at one place, each around its time, with a colour of their own where `colors` says so.
fn chain(colors: [f32; 5]) -> (Splats, Evidence) {
    let n = colors.len();
    let splats = Splats {
        position: (0..n).map(|i| [0.01 * i as f32, 0.0, 2.0]).collect(),
        rotation: vec![[1.0, 0.0, 0.0, 0.0]; n],
        scale: vec![[-2.0, -2.1, -2.2]; n],
        opacity: vec![1.0; n],
        sh: colors.map(|c| [c, 0.2, 0.1]).to_vec(),
        motion: (0..n)
            .map(|i| Motion { velocity: [0.01, 0.0, 0.0], t_center: 0.1 + 0.2 * i as f32, t_scale: -2.0 })
            .collect(),
        source_row: (0..n as u32).collect(),
        ..Splats::new(0)
    };
    let seen = Response { whole: 40.0, color: 120.0, seen: 9.0, ..Response::default() };
    let evidence = Evidence {
        information: vec![seen; n],
        slope: vec![Response::default(); n],
        variance: 1e-3,
        seen: vec![
            Seen { pictures: 9, telling: 24.0, lenses: 4, frames: 5, by_all: true, is_hidden: false, scale: 1.0 };
            n
        ],
        n_values: 1e6,
        pictures: 2,
    };
    (splats, evidence)
}

#[test]
fn gaussians_that_show_one_resting_thing_one_after_the_other_become_one() {
    let (mut splats, mut evidence) = chain([0.5; 5]);
    let mut gone = vec![false; 5];
    assert_eq!(merge_resting(&mut splats, &mut evidence, 1.0, &mut gone), 4);
    assert_eq!(gone, [false, true, true, true, true]);
    // From the beginning of the first to the end of the last.
    let (tau, motion) = ((-2.0f32).exp(), splats.motion[0]);
    assert!((motion.t_center - 0.5).abs() < 1e-5 && (motion.t_scale.exp() - (0.4 + tau)).abs() < 1e-5, "{motion:?}");
    assert!(motion.velocity == [0.0; 3] && (splats.position[0][0] - 0.02).abs() < 5e-3, "{:?}", splats.position[0]);
    // One that goes anyway takes none with it.
    let (mut splats, mut evidence) = chain([0.5; 5]);
    let mut gone = [true, false, false, true, false];
    assert_eq!(merge_resting(&mut splats, &mut evidence, 1.0, &mut gone), 1);
    assert_eq!(gone, [true, false, true, true, false]);
    // Another colour, which the pictures know well, stays apart, and so does what is only near.
    let (mut splats, mut evidence) = chain([0.5, 0.5, 2.5, 0.5, 0.5]);
    splats.position[4] = [0.3, 0.0, 2.0];
    let mut gone = vec![false; 5];
    merge_resting(&mut splats, &mut evidence, 1.0, &mut gone);
    assert_eq!(gone, [false, true, false, false, false]);
    // What moves fast does not rest.
    let (mut splats, mut evidence) = chain([0.5; 5]);
    splats.motion.iter_mut().for_each(|motion| motion.velocity = [2.0, 0.0, 0.0]);
    assert_eq!(merge_resting(&mut splats, &mut evidence, 1.0, &mut [false; 5]), 0);
}
