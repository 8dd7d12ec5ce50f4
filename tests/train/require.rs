//! Only what a scene requires: on scenes of Gaussians whose every part is known, seen by a capture's own cameras.

use super::Tiny;
use crate::common::device::gpu;
use crate::common::random::Random;
use ivv::Constants;
use ivv::scene::capture::Capture;
use ivv::scene::{Motion, Splats, View};
use ivv::stage::{Outputs, Renderer};
use ivv::synth::{Options, Preset, write_capture};
use ivv::train::{Config, Due, Required, Review, Setup, Trainer, review};

/// So that noise is not clamped.
const BACKGROUND: [f32; 3] = [0.4; 3];

/// A capture of eight frames and five training cameras whose pictures show `truth`, with the noise of 8 bits and a half.
fn capture_of(name: &str, truth: impl Fn(&Capture) -> Splats) -> (Tiny, Splats) {
    let folder = std::env::temp_dir().join(format!("ivv-train-{name}-{}", std::process::id()));
    let options = Options { frames: 8, ..Preset::Tiny.options(7) };
    write_capture(&folder, &options, 2, &mut |_, _| {}).unwrap();
    let capture = Capture::open(&folder).unwrap();
    let truth = truth(&capture);
    let mut renderer = Renderer::new(gpu().clone(), &truth, Constants::default()).unwrap();
    let mut random = Random::new(5);
    for (camera, frame) in [capture.training_frames(), capture.test_frames()].concat() {
        let view = View { background: BACKGROUND, ..capture.view(camera, frame).unwrap() };
        let (mut picture, _) = renderer.render(&view, Outputs::Color).unwrap();
        let noise = |x: &mut f32| *x += 0.02 * random.uniform(-1.0, 1.0) as f32;
        picture.color.as_flattened_mut().iter_mut().for_each(noise);
        let shot = capture.cameras[camera].shot(frame).unwrap();
        picture.write_png(&shot.image).unwrap();
    }
    let capture = Capture::open(&folder).unwrap();
    (Tiny { folder, capture }, truth)
}

/// Gaussians where the capture's points are, far enough from each other to be told apart: every fourth moves, every third
/// of the others has a first band.
fn known(capture: &Capture, moves: bool) -> Splats {
    let mut random = Random::new(11);
    let mut chosen: Vec<[f64; 3]> = Vec::new();
    for point in &capture.points {
        let apart = |q: &[f64; 3]| (0..3).map(|k| (q[k] - point.position[k]).powi(2)).sum::<f64>() > 0.25;
        if chosen.iter().all(apart) {
            chosen.push(point.position);
        }
    }
    let n_static = if moves { chosen.len() - chosen.len() / 4 } else { chosen.len() };
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
            splats.motion.push(Motion { velocity: way.map(|x| 1.2 * x / length), t_center: 0.5, t_scale: 1.5 });
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

fn config() -> Config {
    let loss = ivv::train::Loss { depth: 0.0, flow: 0.0, ..Default::default() };
    let density = ivv::train::Density { stop: 0.0, ..Default::default() };
    let required = Required { reviews: 1, images: 40, ..Required::default() };
    Config { sh_degree: 1, background: BACKGROUND, loss, density, required, ..Config::default() }
}

/// Trains `steps` steps from `begin`, reviews, and trains as many again.
fn reviewed(capture: &Capture, begin: &Splats, steps: u64) -> (Review, Trainer) {
    let config = config();
    let setup = Setup::new(capture, &config);
    let mut trainer =
        Trainer::new(gpu().clone(), begin, Constants::default(), config.clone(), 2 * steps, setup).unwrap();
    super::drive(&mut trainer, capture, config.seed, steps);
    let review = review(&mut trainer, &gpu(), capture, Constants::default(), Due::Gaussians).unwrap();
    (review, trainer)
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
    let (tiny, truth) = capture_of("require", |capture| known(capture, true));
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
    assert!(review.grids.iter().all(|check| !check.is_needed) && review.grids.len() == 5, "{:?}", review.grids);
}
