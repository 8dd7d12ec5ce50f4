//! The terms of the loss and the cameras' own parameters inside a training.

use super::{Tiny, as_it_is, nothing_moves, trainer};
use crate::common::prelude::*;
use ivv::internals::scene::capture::Extent;
use ivv::internals::train::{Agreement, Loss, fit_offset, logged};
use ivv_conformance::fixtures::lpips::{TRUNKS, narrow, save};

/// What a step dispatches, by section, and how often.
fn dispatches(tiny: &Tiny, config: &Config) -> std::collections::BTreeMap<String, usize> {
    let begin = from_points(&tiny.capture.points, &tiny.capture, config);
    let mut trainer = trainer(&tiny.capture, config, &begin, 100);
    let (camera, frame) = tiny.capture.training_frames()[0];
    let plan = PriorPlan { flow: true, depth: [((camera, frame), [1.0, 0.1])].into() };
    let picture = tiny.capture.picture_with(camera, frame, &plan).unwrap();
    let view = tiny.capture.view(camera, frame).unwrap();
    let mut counts = std::collections::BTreeMap::new();
    for pass in trainer.profile(camera, &view, &picture).unwrap().times {
        let section = pass.label.split('/').next().unwrap_or_default().to_owned();
        *counts.entry(section).or_default() += 1;
    }
    counts
}

fn grids_from_the_start() -> Required {
    Required { grids_at: 0.0, ..Required::default() }
}

#[test]
fn a_term_that_is_off_dispatches_nothing() {
    let tiny = Tiny::on_device("terms");
    let off = Config {
        sh_degree: 0,
        offsets: false,
        poses: PoseKind::Given,
        grids: GridKind::None,
        loss: Loss { depth: 0.0, flow: 0.0, ..exact().loss },
        ..exact()
    };
    let least = dispatches(&tiny, &off);
    assert!(least["blend bwd"] > 0 && least["loss"] == 2, "{least:?}");
    for (added, config) in [
        (vec!["priors"], Config { loss: Loss { depth: 1.0, ..off.loss.clone() }, ..off.clone() }),
        (vec!["priors"], Config { loss: Loss { flow: 1.0, ..off.loss.clone() }, ..off.clone() }),
        (vec!["clock", "camera bwd"], Config { offsets: true, ..off.clone() }),
        (vec!["camera bwd"], Config { poses: PoseKind::Auto, ..off.clone() }),
        (vec!["bilateral"], Config { grids: GridKind::Bilateral, required: grids_from_the_start(), ..off.clone() }),
    ] {
        let found = dispatches(&tiny, &config);
        for (section, n) in &found {
            let is_new = added.contains(&section.as_str());
            // Uploads and readbacks are copies.
            let is_copy = ["upload", "report"].contains(&section.as_str());
            assert!(is_new || is_copy || least.get(section) == Some(n), "{added:?}: {section} has {n}, {least:?}");
        }
        assert!(added.iter().all(|section| found.contains_key(*section) && !least.contains_key(*section)), "{found:?}");
    }
}

/// The keys of a step in train.jsonl beside those of the terms.
const NOT_TERMS: [&str; 8] =
    ["step", "loss", "gaussians", "active", "visible", "intersections", "bad_gradients", "density"];

#[test]
fn a_step_logs_the_terms_that_are_on_and_its_loss_is_their_weighted_sum() {
    let tiny = Tiny::on_device("logged");
    let loss = Loss { depth: 0.7, flow: 0.3, ..exact().loss };
    let all = Config { sh_degree: 0, loss, required: grids_from_the_start(), ..exact() };
    let without = Config { grids: GridKind::None, loss: Loss { depth: 0.0, ..all.loss.clone() }, ..all.clone() };
    for (config, keys) in [
        (all, vec!["depth", "flow", "grid_variation", "l1", "psnr", "ssim"]),
        (without, vec!["flow", "l1", "psnr", "ssim"]),
    ] {
        let begin = from_points(&tiny.capture.points, &tiny.capture, &config);
        let first = Some(begin);
        let options = SessionOptions { first, total: Some(6), ..as_it_is() };
        let mut session = Session::begin(gpu().clone(), &tiny.capture, config.clone(), options).unwrap();
        while session.step().unwrap() {}
        session.wait().unwrap();
        let mut met: BTreeSet<String> = BTreeSet::new();
        for event in session.take_events() {
            let Event::Step(report) = event else { continue };
            let line = serde_json::to_value(&report).unwrap();
            let has: Vec<&str> = line.as_object().unwrap().keys().map(String::as_str).collect();
            let terms: Vec<&str> = has.iter().copied().filter(|key| !NOT_TERMS.contains(key)).collect();
            assert!(terms.iter().all(|key| keys.contains(key)), "{terms:?}");
            assert!(NOT_TERMS.iter().all(|key| has.contains(key)), "{has:?}");
            let of = |key: &str| report.term(key).unwrap_or(0.0);
            let Loss { depth, flow, .. } = config.loss;
            let colors = 0.8 * of("l1") + 0.2 * (1.0 - of("ssim"));
            let sum = colors + depth * of("depth") + flow * of("flow") + 10.0 * of("grid_variation");
            assert!((report.loss - sum).abs() < 1e-6 * sum, "{} for {sum}", report.loss);
            assert!(terms.iter().all(|key| logged().any(|logged| logged.key == *key)));
            met.extend(terms.iter().map(|key| (*key).to_owned()));
        }
        // Few pixels of an image may have flow.
        assert_eq!(met.iter().collect::<Vec<_>>(), keys);
    }
}

#[test]
fn what_is_on_is_the_same_to_the_priors_the_plan_and_the_setup() {
    let tiny = Tiny::on_device("decided");
    let mut of_test_cameras = tiny.capture.clone();
    let mut bare = tiny.capture.clone();
    for capture in [&mut of_test_cameras, &mut bare] {
        let cameras = capture.cameras.iter_mut().filter(|camera| !camera.is_test);
        for shot in cameras.flat_map(|camera| &mut camera.shots) {
            shot.depth = None;
        }
    }
    for shot in bare.cameras.iter_mut().flat_map(|camera| &mut camera.shots) {
        shot.flow = None;
    }
    let has_depth = |capture: &Capture| capture.cameras.iter().any(|c| c.shots.iter().any(|s| s.depth.is_some()));
    assert!(has_depth(&of_test_cameras), "depth of test cameras alone is none to train on");
    let weights = |depth, flow| Loss { depth, flow, ..exact().loss };
    for (capture, loss, depth, flow) in [
        (&tiny.capture, weights(1.0, 1.0), true, true),
        (&tiny.capture, weights(0.0, 1.0), false, true),
        (&tiny.capture, weights(0.0, 0.0), false, false),
        (&of_test_cameras, weights(1.0, 1.0), false, true),
        (&bare, weights(1.0, 1.0), false, false),
    ] {
        let config = Config { sh_degree: 0, loss, ..exact() };
        assert_eq!(Setup::new(capture, &config).data, TermData { depth, flow });
        let first = Some(from_points(&capture.points, capture, &config));
        let options = SessionOptions { first, total: Some(1), ..as_it_is() };
        let session = Session::begin(gpu().clone(), capture, config, options).unwrap();
        let priors = session.priors();
        assert_eq!((priors.depth.is_some(), priors.plan.flow), (depth, flow));
        let has_buffers = session.plan().begin.buffers.iter().any(|(name, ..)| *name == "image depth flow");
        assert_eq!(has_buffers, depth || flow);
    }
}

/// Gaussians that move across the pictures of [`camera`], and how the pictures of two cameras at six times look, whose
/// clocks are off by `offsets`.
fn moving_scene(offsets: [f64; 2]) -> (Splats, Vec<(usize, View, Picture)>) {
    let mut all = Vec::new();
    for i in 0..6 {
        let at = f64::from(i) - 2.5;
        let color = [0.9, 0.1 + 0.15 * f64::from(i), 0.2];
        let velocity = [2.4, 1.2 - 0.3 * i as f32, 0.3];
        let motion = Some(Motion { velocity, t_center: 0.5, t_scale: 0.2 });
        all.push(One { motion, ..ball([-0.5 + 0.2 * at as f32, 0.3 * at as f32, 4.0], 0.15, 0.9, color) });
    }
    let splats = scene_of(&all);
    let mut renderer = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
    let mut pictures = Vec::new();
    for frame in 0..6 {
        for (index, offset) in offsets.into_iter().enumerate() {
            let mut view = View { time: f64::from(frame) / 8.0, ..camera(48, 40) };
            view.pose.translation.x = 0.4 * index as f64;
            let (seen, _) = renderer.render(&View { time_offset: offset, ..view.clone() }, Outputs::Color).unwrap();
            let byte = |x: f32| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
            let words = seen.color.iter().map(|[r, g, b]| u32::from_le_bytes([byte(*r), byte(*g), byte(*b), 255]));
            let pixels: Vec<u32> = words.collect();
            assert!(pixels.iter().any(|word| word & 0xff > 100), "an empty picture");
            pictures.push((index, view, Picture::new(48, 40, pixels)));
        }
    }
    (splats, pictures)
}

#[test]
fn offsets_are_learnt_where_everything_else_is_known() {
    let _device = gpu();
    const STEPS: u64 = 480;
    let truth = [0.4, -0.4];
    let (splats, pictures) = moving_scene(truth);
    // The Gaussians stay those of the pictures.
    let density = Density { stop: 0.0, ..Density::default() };
    let config = Config { lr: nothing_moves(Pace::default()), sh_degree: 0, average: 0.0, density, ..exact() };
    let extent = Extent { center: [0.0; 3], radius: 4.0 };
    let setup = Setup { learns_offset: vec![true, true], ..Setup::plain(extent, 1.0 / 8.0) };
    let mut trainer = Trainer::new(gpu().clone(), &splats, Constants::default(), config, STEPS, setup).unwrap();
    for step in 0..STEPS as usize {
        let (camera, view, picture) = &pictures[step % pictures.len()];
        trainer.train(*camera, view, picture).unwrap();
    }
    let (found, learns) = trainer.offsets().unwrap();
    assert_eq!(learns, [true, true]);
    for (found, truth) in found.iter().zip(truth) {
        assert!((found - truth).abs() < 0.03, "{found} for {truth}");
    }
    trainer.freeze_offsets(&[true, false]).unwrap();
    let (frozen, learns) = trainer.offsets().unwrap();
    assert_eq!((frozen, learns), (vec![0.0, 0.0], vec![false, true]), "one offset alone is all gauge");
}

#[test]
fn an_image_of_which_hardly_anything_is_shown_moves_nothing() {
    let _device = gpu();
    let (splats, pictures) = moving_scene([0.0; 2]);
    let (camera, view, picture) = &pictures[0];
    // What covers most is hidden last.
    let mut order: Vec<usize> = (0..picture.pixels.len()).collect();
    order.sort_by_key(|pixel| std::cmp::Reverse(picture.pixels[*pixel] & 0xff));
    let step_on = |n_visible: usize| {
        let mut pixels = vec![0; order.len()];
        order[..n_visible].iter().for_each(|pixel| pixels[*pixel] = 0xff00_0000);
        let setup = Setup::plain(Extent { center: [0.0; 3], radius: 4.0 }, 1.0 / 8.0);
        let config = Config { sh_degree: 0, ..exact() };
        let mut trainer = Trainer::new(gpu().clone(), &splats, Constants::default(), config, 100, setup).unwrap();
        let before = trainer.checkpoint().unwrap();
        trainer.train(*camera, view, &Picture::new(48, 40, pixels)).unwrap();
        let after = trainer.checkpoint().unwrap();
        let report = trainer.take_reports().remove(0);
        let is_pulled = after.state.iter().any(|[pull, ..]| *pull > 0.0);
        let logged = ["psnr", "ssim", "l1"].map(|key| report.term(key).is_some());
        (before.params != after.params, is_pulled, logged)
    };
    assert_eq!(step_on(20), (false, false, [false; 3]));
    assert_eq!(step_on(63), (false, false, [false; 3]));
    assert_eq!(step_on(64), (true, true, [true; 3]));
}

#[test]
fn an_image_that_is_too_small_for_lpips_is_trained_on_without_it() {
    let _device = gpu();
    let folder = Folder::new("train-small-lpips");
    let (splats, _) = moving_scene([0.0; 2]);
    for (trunk, smallest) in TRUNKS {
        let file = folder.file("weights.safetensors");
        save(&file, &narrow(3, trunk)).unwrap();
        let loss = Loss { lpips_weights: Some(file), ..exact().loss };
        let config = Config { sh_degree: 0, loss, ..exact() };
        let setup = Setup::plain(Extent { center: [0.0; 3], radius: 4.0 }, 1.0 / 8.0);
        let mut trainer = Trainer::new(gpu().clone(), &splats, Constants::default(), config, 100, setup).unwrap();
        for height in [smallest - 1, smallest] {
            let pixels = vec![0xff00_0000; (40 * height) as usize];
            trainer.train(0, &camera(40, height), &Picture::new(40, height, pixels)).unwrap();
        }
        trainer.finish().unwrap();
        let has_lpips: Vec<bool> = trainer.take_reports().iter().map(|report| report.term("lpips").is_some()).collect();
        assert_eq!(has_lpips, [false, true], "{trunk}");
    }
}

#[test]
fn a_fit_finds_the_offset_and_knows_when_there_is_nothing_to_find() {
    let _device = gpu();
    let truth = 0.7;
    let (splats, pictures) = moving_scene([truth, 0.0]);
    let own: Vec<(View, Picture)> =
        pictures.into_iter().filter(|(camera, ..)| *camera == 0).map(|(_, view, picture)| (view, picture)).collect();
    let mut renderer = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
    let fit = fit_offset(&mut renderer, &own, 0.0, 6).unwrap();
    assert!((fit.offset - truth).abs() < 0.01 && fit.standard_error < 0.01 && fit.is_identifiable(), "{fit:?}");
    let wrong = fit_offset(&mut renderer, &own, 0.0, 0).unwrap();
    assert!(wrong.offset == 0.0 && wrong.standard_error > fit.standard_error, "{wrong:?}");
    // A scene that stands still looks the same at any time.
    let mut still = splats;
    still.motion.clear();
    still.n_static = still.len();
    let mut renderer = Renderer::new(gpu().clone(), &still, Constants::default()).unwrap();
    let nothing = fit_offset(&mut renderer, &own, 0.0, 6).unwrap();
    assert!(nothing.offset == 0.0 && nothing.standard_error == f64::INFINITY && !nothing.is_identifiable());
}

#[test]
fn agreement_of_offsets_is_their_error_and_their_correlation() {
    // Twice the truth and a quarter more: all of one mind, and wrong by the root mean square of (0.25, 1.25).
    let agreement = Agreement::of(&[(0.25, 0.0), (2.25, 1.0)]).unwrap();
    assert!((agreement.rms_error - (0.5 * (0.0625 + 1.5625_f64)).sqrt()).abs() < 1e-15);
    assert!((agreement.correlation.unwrap() - 1.0).abs() < 1e-15);
    // Centred: (1, -1, 0) and (1, 1, -2): nothing in common.
    let agreement = Agreement::of(&[(2.0, 3.0), (0.0, 3.0), (1.0, 0.0)]).unwrap();
    assert!(agreement.correlation.unwrap().abs() < 1e-15 && agreement.rms_error > 1.0);
    // Three quarters of the sum of squares in common: (2, -1, -1) and (1, 0, -1).
    let agreement = Agreement::of(&[(2.0, 1.0), (-1.0, 0.0), (-1.0, -1.0)]).unwrap();
    assert!((agreement.correlation.unwrap() - 0.75_f64.sqrt()).abs() < 1e-15);
    assert_eq!(Agreement::of(&[(1.0, 0.5)]), Some(Agreement { rms_error: 0.5, correlation: None }));
    assert_eq!(Agreement::of(&[]), None);
}
