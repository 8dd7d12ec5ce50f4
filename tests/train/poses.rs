//! Poses of cameras that are learnt.

use super::{Tiny, as_it_is, nothing_moves};
use crate::common::prelude::*;
use crate::common::program::json;
use ivv::internals::scene::capture::{Extent, half_bits};
use ivv::internals::train::Correction;

const CAMERAS: usize = 6;

/// Turns and shifts that have nothing in common: no mean, and no growth of the arrangement of `centers`.
fn bends(centers: &[DVec3], random: &mut Random) -> Vec<Correction> {
    let mut vector = |most: f64| DVec3::from_array(std::array::from_fn(|_| random.uniform(-most, most)));
    let mut bends: Vec<Correction> =
        centers.iter().map(|_| Correction { turn: vector(0.02), shift: vector(0.06) }).collect();
    let n = centers.len() as f64;
    let turn = bends.iter().map(|bend| bend.turn).sum::<DVec3>() / n;
    let shift = bends.iter().map(|bend| bend.shift).sum::<DVec3>() / n;
    let middle = centers.iter().sum::<DVec3>() / n;
    bends.iter_mut().for_each(|bend| (bend.turn, bend.shift) = (bend.turn - turn, bend.shift - shift));
    let along: f64 = bends.iter().zip(centers).map(|(bend, c)| bend.shift.dot(*c - middle)).sum();
    let spread: f64 = centers.iter().map(|c| (*c - middle).length_squared()).sum();
    bends.iter_mut().zip(centers).for_each(|(bend, c)| bend.shift -= (*c - middle) * (along / spread));
    bends
}

#[test]
#[ignore = "slow: 1,800 steps; those below learn the same poses beside a flow"]
fn poses_are_learnt_where_everything_else_is_known() {
    learns_poses(TermData::NONE);
}

/// What rests has no flow before a camera that rests, whatever its pose: priors that say otherwise say nothing of the pose.
#[test]
fn a_flow_that_no_pose_changes_moves_none() {
    learns_poses(TermData { flow: true, ..TermData::NONE });
}

fn learns_poses(data: TermData) {
    let _device = gpu();
    let mut random = Random::new(2);
    let mut color = || std::array::from_fn(|_| random.uniform(0.1, 0.9));
    let at = |k: usize| [0.7 * (k % 3) as f32 - 0.7, 0.6 * (k / 3 % 3) as f32 - 0.6, 0.5 * (k / 9) as f32 - 0.5];
    let splats = scene_of(&(0..27).map(|k| ball(at(k), 0.15, 0.9, color())).collect::<Vec<_>>());
    let mut renderer = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
    let poses: Vec<Pose> = (0..CAMERAS)
        .map(|k| {
            let (sin, cos) = (k as f64 / CAMERAS as f64 * std::f64::consts::TAU).sin_cos();
            Pose::look_at(DVec3::new(4.0 * cos, 0.5 * (k % 2) as f64, 4.0 * sin), DVec3::ZERO, DVec3::NEG_Y)
        })
        .collect();
    let centers: Vec<DVec3> = poses.iter().map(Pose::center).collect();
    let bends = bends(&centers, &mut Random::new(7));
    let byte = |x: f32| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    let images: Vec<(View, Picture)> = poses
        .iter()
        .zip(&bends)
        .map(|(pose, bend)| {
            let view = View { pose: *pose, ..camera(64, 48) };
            let (seen, _) = renderer.render(&view, Outputs::Color).unwrap();
            let words = seen.color.iter().map(|[r, g, b]| u32::from_le_bytes([byte(*r), byte(*g), byte(*b), 255]));
            // The capture says that the camera is elsewhere.
            let told = View { pose: pose.corrected(-bend.turn, -bend.shift), ..view };
            let told = View { flow_model: FlowModel::Displacement, ..told };
            let flow = vec![[half_bits(3.0), half_bits(0.0)]; if data.flow { 64 * 48 } else { 0 }];
            (told, Picture::new(64, 48, words.collect()).with_priors(Vec::new(), flow))
        })
        .collect();
    let lr = nothing_moves(Pace { steps: 0 });
    let density = Density { stop: 0.0, ..Density::default() };
    let config = Config { lr, density, sh_degree: 0, ..exact() };
    let extent = Extent { center: [0.0; 3], radius: 4.0 };
    let flow_model = FlowModel::Displacement;
    let learns_pose = centers.iter().copied().map(Some).collect();
    let pose_rate = Rate { start: 1e-3, end: 1e-5 };
    let setup = Setup { learns_pose, data, flow_model, pose_rate, ..Setup::plain(extent, 1.0) };
    let total = 300 * CAMERAS as u64;
    let mut trainer = Trainer::new(gpu().clone(), &splats, Constants::default(), config, total, setup).unwrap();
    for step in 0..total as usize {
        let (view, picture) = &images[step % CAMERAS];
        trainer.train(step % CAMERAS, view, picture).unwrap();
    }
    // What the cameras see. Turns and shifts by themselves trade for one another.
    let mut error = |view: &View, picture: &Picture| {
        let (seen, _) = renderer.render(view, Outputs::Color).unwrap();
        let truth = picture.pixels.iter().map(|word| word.to_le_bytes());
        let squares = seen.color.iter().zip(truth).flat_map(|(color, truth)| {
            (0..3).map(move |k| (f64::from(color[k]) - f64::from(truth[k]) / 255.0).powi(2))
        });
        (squares.sum::<f64>() / (3.0 * seen.color.len() as f64)).sqrt()
    };
    let found = trainer.poses().unwrap();
    assert_eq!(found.len(), CAMERAS);
    for (camera, found) in found {
        let (told, picture) = &images[camera];
        let (before, after) = (error(told, picture), error(&found.view(told), picture));
        assert!(before > 0.02 && after < 0.25 * before, "camera {camera}: colours are {after} off, {before} before");
    }
}

/// A run on `capture`: the cameras whose poses are learnt just before they are judged and soon after, and what was said then.
fn judged(capture: &Capture, poses: PoseKind) -> ([usize; 2], Vec<(f64, bool)>) {
    let config = Config { sh_degree: 0, steps: 240, max_gaussians: 2_000, poses, ..exact() };
    let mut session = Session::begin(gpu().clone(), capture, config, as_it_is()).unwrap();
    while session.steps() < 71 {
        session.step().unwrap();
    }
    let before = session.trainer().poses().unwrap().len();
    while session.steps() < 80 {
        session.step().unwrap();
    }
    session.wait().unwrap();
    let said = session.take_events().into_iter().filter_map(|event| match event {
        Event::Poses { pixels, are_learnt } => Some((pixels, are_learnt)),
        _ => None,
    });
    let said = said.collect();
    ([before, session.trainer().poses().unwrap().len()], said)
}

#[test]
fn poses_that_show_what_the_calibration_shows_are_the_captures_again() {
    let tiny = Tiny::on_device("poses-judged");
    let capture = tiny.capture.clone().transformed(&tiny.capture.normalisation());
    let trained: Vec<usize> = (0..capture.cameras.len()).filter(|camera| !capture.cameras[*camera].is_test).collect();
    let centers: Vec<DVec3> = trained.iter().map(|camera| capture.cameras[*camera].world_to_camera.center()).collect();
    let mut bent = capture.clone();
    for (camera, bend) in trained.iter().zip(bends(&centers, &mut Random::new(5))) {
        let pose = &mut bent.cameras[*camera].world_to_camera;
        *pose = pose.corrected(bend.turn, bend.shift);
    }
    let n = trained.len();
    let (learnt, said) = judged(&capture, PoseKind::Auto);
    assert!(matches!(said[..], [(0.0..0.15, false)]) && learnt == [n, 0], "{said:?}, {learnt:?}");
    let (learnt, said) = judged(&bent, PoseKind::Auto);
    assert!(matches!(said[..], [(0.15.., true)]) && learnt == [n, n], "{said:?}, {learnt:?}");
    // A run that is made shorter than what was to come judges at once.
    let config = Config { sh_degree: 0, steps: 240, max_gaussians: 2_000, ..exact() };
    let mut session = Session::begin(gpu().clone(), &capture, config.clone(), as_it_is()).unwrap();
    while session.steps() < 60 {
        session.step().unwrap();
    }
    session.extend(config, 120).unwrap();
    session.step().unwrap();
    assert_eq!(session.trainer().poses().unwrap().len(), 0);
    // Who asks for either has it, whatever the images say.
    assert_eq!(judged(&bent, PoseKind::Given), ([0, 0], vec![]));
    assert_eq!(judged(&capture, PoseKind::Learnt), ([n, n], vec![]));
}

#[test]
fn a_run_that_is_made_much_longer_keeps_the_poses_that_it_has_learnt() {
    let tiny = Tiny::on_device("poses-longer");
    let capture = tiny.capture.clone().transformed(&tiny.capture.normalisation());
    let config = Config { sh_degree: 0, steps: 20, max_gaussians: 2_000, poses: PoseKind::Learnt, ..exact() };
    let options = as_it_is();
    let mut session = Session::begin(gpu().clone(), &capture, config.clone(), options).unwrap();
    while session.step().unwrap() {}
    let before = session.trainer().poses().unwrap();
    assert!(before.values().any(|pose| pose.turn.length() > 0.0));
    // Below the tenth of a run at which one of this length begins to learn them.
    session.extend(config, 400).unwrap();
    session.step().unwrap();
    session.wait().unwrap();
    assert_ne!(session.trainer().poses().unwrap(), before, "they are in use, and go on being learnt");
}

#[test]
fn a_run_tells_where_it_found_the_cameras_in_the_captures_own_world() {
    let tiny = Tiny::new("poses");
    let (capture, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let train =
        ["train", capture, "-o", run.to_str().unwrap(), "--steps", "60", "--sh-degree", "0", "--eval-every", "0"];
    let told = works(&[&train[..], &["--set", "poses=learnt"]].concat());
    let rows = json(&run.join("train.json"))["poses"].as_array().unwrap().clone();
    let views = read_views(&run.join("cameras.json")).unwrap();
    let trained: Vec<_> = tiny.capture.cameras.iter().enumerate().filter(|(_, camera)| !camera.is_test).collect();
    assert_eq!([rows.len(), views.len()], [trained.len(); 2]);
    for ((row, view), (index, camera)) in rows.iter().zip(&views).zip(trained) {
        let before = tiny.capture.view(index, camera.shots[0].frame).unwrap().pose;
        let turn = view.pose.rotation * before.rotation.transpose();
        let angle = glam::DQuat::from_mat3(&turn).to_scaled_axis().length().to_degrees();
        let shift = view.pose.center().distance(before.center());
        let number = |key: &str| row[key].as_f64().unwrap();
        assert!(number("turn_degrees") > 1e-4 && number("shift") > 1e-6, "{row}");
        assert!((angle - number("turn_degrees")).abs() < 1e-6 && (shift - number("shift")).abs() < 1e-9, "{row}");
        assert_eq!(row["camera"], camera.name);
    }
    assert!(told.contains(&format!("poses of {} cameras: turned by", rows.len())), "{told}");
}
