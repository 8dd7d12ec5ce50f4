//! Evaluations, the log and the best checkpoint.

use super::{Tiny, scores_of};
use crate::common::prelude::*;
use ivv::internals::stage::Trunk;
use ivv::internals::train::{Evaluation, Kind, Log, Meter, Sight, ViewScores, evaluate, psnr, spread};
use ivv_conformance::fixtures::lpips::{narrow, save};
use serde_json::json;

fn view(name: &str, psnr: f64) -> ViewScores {
    ViewScores { view: name.to_owned(), camera: name.to_owned(), frame: 0, scores: scores_of(psnr), render_ms: psnr }
}

#[test]
fn an_evaluation_is_the_mean_of_its_views_and_of_none_there_is_none() {
    let views: Vec<ViewScores> = [20.0, 30.0, 25.0].into_iter().zip(["a", "b", "c"]).map(|(p, n)| view(n, p)).collect();
    let all = Evaluation::new(7, views).unwrap();
    assert_eq!((all.step, all.mean.psnr, all.mean.ssim), (7, 25.0, 0.5));
    assert_eq!(all.of(|camera, _| camera != "b").unwrap().mean.psnr, 22.5);
    assert_eq!(all.of(|_, frame| frame > 0), None);
    assert_eq!(all.frames_per_second(), 40.0, "of the median time");
    assert!(psnr(f64::NAN).is_nan() && psnr(0.0) == 120.0 && psnr(0.01) == 20.0);
}

#[test]
fn examples_are_the_extremes_and_an_even_spread() {
    let scores = [5.0, 9.0, 1.0, 4.0, 3.0, 2.0, 8.0, 7.0, 6.0, 0.0, 10.0];
    let all = Evaluation::new(1, scores.iter().map(|p| view("v", *p)).collect()).unwrap();
    let chosen = all.examples(8);
    assert_eq!(chosen.len(), 8);
    assert!(chosen.is_sorted() && chosen.windows(2).all(|pair| pair[0].0 < pair[1].0), "by frame, each once");
    for expected in [(9, "worst"), (0, "median"), (10, "best")] {
        assert!(chosen.contains(&expected), "{expected:?} of {chosen:?}");
    }
    let few = Evaluation::new(1, vec![view("v", 1.0), view("w", 2.0)]).unwrap();
    assert_eq!(few.examples(8), [(0, "worst"), (1, "best")]);
    let frames: Vec<(usize, u32)> = (0..100).map(|i| (i, 0)).collect();
    let some: Vec<usize> = spread(&frames, 4).into_iter().map(|f| f.0).collect();
    assert_eq!(some, [12, 37, 62, 87]);
    assert_eq!((spread(&frames[..3], 16).len(), spread::<(usize, u32)>(&[], 16).len()), (3, 0));
}

/// Of the scene that a run on `tiny` begins with.
fn renderer_and_meter(tiny: &Tiny) -> (Renderer, Meter) {
    let config = Config { sh_degree: 0, ..exact() };
    let splats = from_points(&tiny.capture.points, &tiny.capture, &config);
    let renderer = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
    (renderer, Meter::new(gpu().clone(), &config).unwrap())
}

#[test]
fn a_picture_that_is_not_finite_has_no_score() {
    let tiny = Tiny::on_device("not-finite");
    let (mut renderer, mut meter) = renderer_and_meter(&tiny);
    let frames = tiny.capture.test_frames();
    let mut score = |background| {
        evaluate(&mut renderer, &mut meter, &Sight::new(&tiny.capture, background), &frames, 1, |_, _, _| Ok(()))
    };
    assert!(score([0.0; 3]).unwrap().unwrap().mean.psnr > 5.0);
    assert_eq!(score([f32::NAN, 0.0, 0.0]).unwrap_err().exit_code(), 6);
}

#[test]
fn flicker_is_of_a_camera_that_stays_and_of_successive_frames() {
    let tiny = Tiny::on_device("flicker");
    let (mut renderer, mut meter) = renderer_and_meter(&tiny);
    let (camera, first) = tiny.capture.test_frames()[0];
    let mut flickers = |frames: &[u32]| -> Vec<Option<(f64, f64)>> {
        let frames: Vec<(usize, u32)> = frames.iter().map(|frame| (camera, *frame)).collect();
        let sight = Sight::new(&tiny.capture, [0.0; 3]);
        let all = evaluate(&mut renderer, &mut meter, &sight, &frames, 1, |_, _, _| Ok(())).unwrap().unwrap();
        all.views.iter().map(|view| view.scores.flicker.zip(view.scores.flicker_true)).collect()
    };
    let [None, Some((rendered, truth))] = flickers(&[first, first + 1])[..] else { panic!("none of the first alone") };
    assert!((0.0..0.5).contains(&rendered) && (0.0..0.02).contains(&truth), "{rendered} {truth}");
    assert_eq!(flickers(&[first + 1, first]), [None, None], "frames that do not follow on one another");
}

#[test]
fn a_mask_limits_a_score_to_what_it_marks() {
    let tiny = Tiny::on_device("masked-score");
    let (mut renderer, mut meter) = renderer_and_meter(&tiny);
    let frames = tiny.capture.test_frames()[..1].to_vec();
    let (camera, frame) = frames[0];
    let mut capture = tiny.capture.clone();
    let (width, height) = (capture.cameras[camera].intrinsics.width, capture.cameras[camera].intrinsics.height);
    let mut masked = |name: &str, is_bright: fn(u32) -> bool| {
        let file = tiny.folder.join(name);
        image::GrayImage::from_fn(width, height, |x, _| image::Luma([if is_bright(x) { 200 } else { 100 }]))
            .save(&file)
            .unwrap();
        let shot = capture.cameras[camera].shots.iter_mut().find(|shot| shot.frame == frame).unwrap();
        (shot.foreground, shot.covisible) = (None, Some(file));
        let sight = Sight::new(&capture, [0.0; 3]);
        let scores = evaluate(&mut renderer, &mut meter, &sight, &frames, 1, |_, _, _| Ok(())).unwrap().unwrap().mean;
        assert_eq!(scores.psnr_foreground, None);
        (scores.psnr, scores.psnr_covisible)
    };
    let (whole, even) = masked("even.png", |x| x % 3 == 0);
    let (_, odd) = masked("odd.png", |x| x % 3 != 0);
    assert_eq!(masked("none.png", |_| false), (whole, None));
    assert_eq!(masked("all.png", |_| true).1.map(|all| (all - whole).abs() < 1e-9), Some(true));
    // The errors of both parts are the whole picture's.
    let error = |psnr: f64| 10f64.powf(-psnr / 10.0);
    let n_even = f64::from(width.div_ceil(3)) / f64::from(width);
    let (even, odd) = (error(even.unwrap()), error(odd.unwrap()));
    assert!(even != odd && (n_even * even + (1.0 - n_even) * odd - error(whole)).abs() < 1e-9 * error(whole));
}

#[test]
fn a_view_that_its_mask_hides_has_no_scores_and_no_part_in_the_mean() {
    let tiny = Tiny::on_device("hidden-score");
    let (mut renderer, mut meter) = renderer_and_meter(&tiny);
    let mut score = |capture: &Capture, frames: &[(usize, u32)]| {
        evaluate(&mut renderer, &mut meter, &Sight::new(capture, [0.0; 3]), frames, 1, |_, _, _| Ok(())).unwrap()
    };
    let frames = tiny.capture.test_frames()[..2].to_vec();
    let shown = score(&tiny.capture, &frames[1..]).unwrap();
    let (mut capture, (camera, frame)) = (tiny.capture.clone(), frames[0]);
    let (width, height) = (capture.cameras[camera].intrinsics.width, capture.cameras[camera].intrinsics.height);
    let file = tiny.folder.join("hidden.png");
    image::GrayImage::new(width, height).save(&file).unwrap();
    capture.cameras[camera].shots.iter_mut().find(|shot| shot.frame == frame).unwrap().mask = Some(file);
    let both = score(&capture, &frames).unwrap();
    assert_eq!((both.mean, both.views.len()), (shown.mean, 1));
    assert_eq!(both.views[0].view, shown.views[0].view);
    assert_eq!(score(&capture, &frames[..1]), None);
}

#[test]
fn a_log_keeps_what_was_done_before_a_resumption_and_says_each_thing_once() {
    let tiny = Tiny::new("log");
    let mut log = Log::open(&tiny.folder, 0);
    for step in [10, 20, 30] {
        log.push(Kind::Step, &json!({ "step": step, "loss": 1.0 / f64::from(step) })).unwrap();
    }
    log.push(Kind::Evaluation, &json!({ "step": 30, "psnr": 20.5 })).unwrap();
    assert_eq!(log.push(Kind::Step, &json!({ "loss": 1.0 })).unwrap_err().exit_code(), 3);
    log.write().unwrap();
    std::fs::OpenOptions::new()
        .append(true)
        .open(tiny.folder.join("train.jsonl"))
        .and_then(|mut file| std::io::Write::write_all(&mut file, b"{\"step\": 31, \"ki"))
        .unwrap();
    let mut resumed = Log::open(&tiny.folder, 30);
    assert_eq!(resumed, log, "the cut line is dropped");
    resumed.push(Kind::Evaluation, &json!({ "step": 30, "psnr": 21.0 })).unwrap();
    assert_eq!(resumed.series(Kind::Evaluation, "psnr"), [[30.0, 21.0]]);
    assert_eq!(resumed.series(Kind::Step, "loss").len(), 3);
    assert_eq!(Log::open(&tiny.folder, 20).series(Kind::Step, "loss"), [[10.0, 0.1], [20.0, 0.05]]);
    assert_eq!(Log::open(&tiny.folder, 0).lines(Kind::Step).count(), 0);
}

#[test]
fn the_best_checkpoint_outlives_the_last_three() {
    let tiny = Tiny::on_device("best");
    let gpu = gpu();
    let config = Config { sh_degree: 0, ..exact() };
    let splats = from_points(&tiny.capture.points[..20], &tiny.capture, &config);
    let setup = Setup::plain(tiny.capture.extent(), 0.25);
    let mut trainer = Trainer::new(gpu.clone(), &splats, Constants::default(), config, 100, setup).unwrap();
    let folder = tiny.folder.join("checkpoints");
    assert_eq!((Checkpoint::best(&folder).unwrap(), Checkpoint::any_in(&folder).unwrap()), (None, false));
    let mut checkpoint = trainer.checkpoint().unwrap();
    let psnrs = [18.0, 21.5, 21.25, 21.5, f64::NAN, 20.0];
    let mut kept = Vec::new();
    for (step, psnr) in (1..).zip(psnrs) {
        checkpoint.step = step;
        checkpoint.write(&folder).unwrap();
        Checkpoint::keep_best(&folder, step, psnr).unwrap();
        kept.push(Checkpoint::best(&folder).unwrap().map(|(step, _)| step));
    }
    assert_eq!(kept, [1, 2, 2, 2, 2, 2].map(Some));
    let names = || {
        let mut names: Vec<String> = std::fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    };
    let expected = ["00000004.ckpt", "00000005.ckpt", "00000006.ckpt", "best-00000002-21.5000dB.ckpt"];
    assert_eq!(names(), expected);
    assert_eq!(Checkpoint::best(&folder).unwrap(), Some((2, 21.5)));
    assert_eq!(Checkpoint::read(&folder.join(expected[3])).unwrap().step, 2);
    assert_eq!(Checkpoint::newest(&folder).unwrap().unwrap().step, 6);
    // When every later one is damaged, the best one serves.
    expected[..3].iter().for_each(|name| std::fs::write(folder.join(name), b"cut").unwrap());
    assert_eq!(Checkpoint::newest(&folder).unwrap().unwrap().step, 2);
    // A run that goes on from it has its score again, to the digits that the name has, and need not keep it again: its own
    // checkpoint is gone.
    Checkpoint::keep_best(&folder, 2, 21.500_04).unwrap();
    Checkpoint::remove_all(&folder).unwrap();
    assert_eq!(names(), Vec::<String>::new());
}

#[test]
fn a_view_that_lpips_cannot_take_has_none_and_the_reason_is_told_once() {
    let _device = gpu();
    let tiny = Tiny::of_frames("no-lpips", 2);
    let weights = tiny.folder.join("narrow.safetensors");
    save(&weights, &narrow(1, Trunk::SqueezeNet)).unwrap();
    let mut config = Config { sh_degree: 0, ..exact() };
    config.loss.lpips_weights = Some(weights);
    let mut meter = Meter::new(gpu().clone(), &config).unwrap();
    let mut scores = |width: u32, height: u32| {
        let n = (width * height) as usize;
        let picture =
            Picture::new(width, height, (0..n as u32).map(|i| 0xff00_0000 | (i * 77_777 % 0xff_ffff)).collect());
        let frame = Frame { width, height, color: vec![[0.5; 3]; n], ..Frame::default() };
        let scores = meter.scores(&frame, &picture).unwrap().unwrap();
        (scores.lpips, scores.lpips_unscaled, meter.take_fault_of_lpips().map(|fault| fault.to_string()))
    };
    let (lpips, unscaled, fault) = scores(40, 30);
    assert!(lpips.unwrap() > 0.0 && unscaled.unwrap() > 0.0 && lpips != unscaled && fault.is_none());
    let (lpips, unscaled, fault) = scores(12, 30);
    assert!(lpips.is_none() && unscaled.is_none() && fault.unwrap().contains("17x17"));
    assert!(scores(40, 30).0.is_some(), "the next view has one");
}
