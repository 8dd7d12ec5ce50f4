//! A run as the library has it.

use super::{Tiny, as_it_is};
use crate::adversary::needs_roundings;
use crate::common::prelude::*;
use ivv::internals::train::{Average, DueEvents, Notice, Phase, training_order};
use std::cell::RefCell;

const STEPS: u64 = 30;

/// A run in which all is learnt and due that can be: poses, reviews, grids, a look at the time offsets.
fn config() -> Config {
    let required = Required { reviews: 2, grids_at: 0.2 };
    Config { sh_degree: 1, steps: STEPS, max_gaussians: 2_000, poses: PoseKind::Auto, required, ..exact() }
}

fn steps(event: &Event) -> Option<u64> {
    if let Event::Step(report) = event { Some(report.step) } else { None }
}

fn begin<'a>(tiny: &Tiny, options: SessionOptions<'a>) -> Session<'a> {
    Session::begin(gpu().clone(), &tiny.capture, config(), options).unwrap()
}

fn end(mut session: Session) -> (Splats, Vec<Event>) {
    while session.step().unwrap() {}
    let splats = session.finish().unwrap();
    (splats, session.take_events())
}

#[test]
fn a_session_does_what_is_due_wherever_it_is_resumed() {
    let tiny = Tiny::on_device("session");
    let noticed = RefCell::new(BTreeSet::new());
    let watch = |notice: Notice| {
        noticed.borrow_mut().insert(match notice {
            Notice::Work { phase, .. } => format!("{phase:?}"),
            Notice::Initialised(initial) => format!("first {}", !initial.splats.is_empty()),
            Notice::DepthPriors(_) => "depths".to_owned(),
            Notice::Planned(_) => "plan".to_owned(),
        });
    };
    let (whole, events) = end(begin(&tiny, SessionOptions { watch: Box::new(watch), ..SessionOptions::default() }));
    let phases = [Phase::Initialisation, Phase::DepthPriors, Phase::Review, Phase::OffsetErrors];
    let expected = phases.map(|phase| format!("{phase:?}")).into_iter();
    let expected: BTreeSet<String> = expected.chain(["first true", "depths", "plan"].map(str::to_owned)).collect();
    assert_eq!(noticed.into_inner(), expected);
    assert!(events.iter().filter_map(steps).eq(1..=STEPS), "every step once, in order");
    let reviews: Vec<u64> =
        events.iter().filter_map(|e| if let Event::Review(review) = e { Some(review.step) } else { None }).collect();
    assert_eq!(reviews, [6, 18, 24], "grids, and Gaussians twice");

    // Resumed right after a step after which something is due and has not been done.
    for at in [8, 9, 15, 16, 18, 28] {
        let mut first = begin(&tiny, SessionOptions::default());
        assert_eq!(first.constants().near, ivv::Constants::default().near);
        while first.steps() < at {
            first.step().unwrap();
        }
        let checkpoint = first.rescue().unwrap();
        let DueEvents { review, offsets, poses, .. } = checkpoint.due;
        assert_eq!((checkpoint.step, review, offsets, poses), (at, at == 18, at == 15, at == 9));
        drop(first);
        let folder = tiny.folder.join(format!("checkpoints-{at}"));
        checkpoint.write(&folder).unwrap();
        let checkpoint = Checkpoint::newest(&folder).unwrap().unwrap();
        let resumed = Session::resume(gpu().clone(), &tiny.capture, &checkpoint, SessionOptions::default()).unwrap();
        assert_same_splats(format_args!("resumed at {at}"), &end(resumed).0, &whole);
    }
}

#[test]
fn a_session_gives_the_scene_that_the_command_line_writes() {
    needs_roundings!("the command line has the kernels as they are");
    let tiny = Tiny::on_device("session-command");
    let (path, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let file = tiny.folder.join("settings.json");
    std::fs::write(&file, serde_json::to_string(&config()).unwrap()).unwrap();
    works(&["train", path, "-o", text(&run), "--config", text(&file), "-q"]);
    let written = Checkpoint::newest(&run.join("checkpoints")).unwrap().unwrap();
    let run = ivv::internals::train::Run::read(&run).unwrap();
    let capture = run.open_capture(None).unwrap();
    let options = SessionOptions { constants: run.constants, ..SessionOptions::default() };
    let session = Session::begin(gpu().clone(), &capture, config(), options).unwrap();
    assert!(written.average.scene().is_some(), "the mean of the last scenes");
    assert_same_splats("the command line", &end(session).0, &written.splats());
}

#[test]
fn images_follow_one_another_by_epochs_from_any_step() {
    let frames: Vec<(usize, u32)> = (0..7).map(|k| (k, k as u32)).collect();
    let all = training_order(&frames, 3, 0, 25);
    assert_eq!(all.len(), 25);
    for epoch in all.chunks_exact(7) {
        assert_eq!(epoch.iter().collect::<BTreeSet<_>>().len(), 7, "each once");
    }
    assert_ne!(all[..7], all[7..14], "in another order");
    assert_ne!(all, training_order(&frames, 4, 0, 25));
    for done in [0, 1, 6, 7, 8, 24, 25] {
        assert_eq!(training_order(&frames, 3, done, 25), all[done as usize..], "after {done}");
    }
    assert!(training_order(&frames, 3, 30, 25).is_empty());
}

#[test]
fn a_run_lists_few_of_its_images_at_a_time_and_has_the_same_bits() {
    let gpu = gpu();
    let tiny = Tiny::new("listed");
    let config = Config { sh_degree: 0, steps: 26, max_gaussians: 300, init: Init::Points, ..exact() };
    let begin = |listed_images: u64, total: u64, batch: u32| {
        let config = Config { batch, ..config.clone() };
        let options = SessionOptions { listed_images, total: Some(total), ..SessionOptions::default() };
        Session::begin(gpu.clone(), &tiny.capture, config, options).unwrap()
    };
    for batch in [1, 2] {
        let run = |listed: u64| {
            let mut session = begin(listed, 26, batch);
            let mut steps = 0;
            while session.step().unwrap() {
                steps += 1;
            }
            (steps, session.finish().unwrap())
        };
        let all = run(u64::MAX);
        assert_eq!(all.0, 26);
        assert!(run(7) == all && run(1) == all, "batch {batch}");
    }
    // What a list of all its steps would take, no machine has.
    let mut endless = begin(SessionOptions::default().listed_images, 1 << 60, 1);
    assert!(endless.step().unwrap() && endless.step().unwrap());
    endless.wait().unwrap();
}

#[test]
fn a_run_ends_with_the_mean_of_its_last_scenes() {
    let tiny = Tiny::on_device("mean");
    let config = Config { sh_degree: 1, steps: 40, max_gaussians: 2_000, average: 0.25, ..exact() };
    let mut session = Session::begin(gpu().clone(), &tiny.capture, config.clone(), as_it_is()).unwrap();
    let (mut truth, mut last) = (Average::default(), None);
    while session.step().unwrap() {
        if session.steps() > 30 {
            let scene = session.trainer().splats().unwrap();
            truth.add(scene.clone());
            last = Some(scene);
        }
    }
    let (found, last) = (session.finish().unwrap(), last.unwrap());
    assert_eq!(truth.n, 10);
    assert_same_splats("the mean", &found, truth.scene().unwrap());
    assert!(found != last);
    let changed = |event: &Event| matches!(event, Event::Step(step) if step.density.is_some() && step.step > 30);
    assert!(!session.take_events().iter().any(changed), "the Gaussians stay the same");
    // What a checkpoint of the end has is what the run's scene has; one from before it has what was trained so far.
    let checkpoint = session.checkpoint().unwrap();
    let relative = Checkpoint { world: Similarity::default(), ..checkpoint };
    assert_same_splats("the checkpoint of the end", &relative.splats(), &found);
    assert!(Checkpoint { step: 39, ..relative }.splats() != found);
    // Steps that are added make the end another.
    session.extend(config, 80).unwrap();
    assert_same_splats("extended", &session.finish().unwrap(), &last);
}

#[test]
fn cameras_are_asked_once_whether_they_need_a_grid_unless_all_or_none_has_one() {
    let tiny = Tiny::on_device("asked");
    let (bilateral, affine, none) = (GridKind::Bilateral, GridKind::Affine, GridKind::None);
    for (grids, grids_at, asked_at) in
        [(bilateral, 0.5, Some(5)), (affine, 0.5, Some(5)), (bilateral, 0.0, None), (none, 0.5, None)]
    {
        let required = Required { grids_at, ..Required::default() };
        let config = Config { sh_degree: 0, steps: 10, grids, required, ..exact() };
        let session = Session::begin(gpu().clone(), &tiny.capture, config, as_it_is()).unwrap();
        let (_, events) = end(session);
        let asked =
            events.iter().filter_map(|event| if let Event::Review(review) = event { Some(review) } else { None });
        let asked: Vec<_> =
            asked.map(|review| (review.step, review.grids.len(), review.before - review.after)).collect();
        assert!(asked.iter().copied().eq(asked_at.map(|step| (step, 4, 0))), "{grids:?}, {grids_at}: {asked:?}");
        let first =
            events.iter().find_map(|event| if let Event::Step(step) = event { Some(step) } else { None }).unwrap();
        assert_eq!(
            first.term("grid_variation").is_some(),
            grids.is_some() && grids_at == 0.0,
            "from the start: {grids:?}, {grids_at}"
        );
    }
}

#[test]
fn a_run_that_is_made_shorter_makes_up_for_the_reviews_that_it_is_past() {
    let tiny = Tiny::on_device("shorter");
    let reviews = |required: &Required, [stop, total]: [u64; 2]| {
        let config = Config { sh_degree: 0, steps: 20, init: Init::Points, required: required.clone(), ..exact() };
        let mut session = Session::begin(gpu().clone(), &tiny.capture, config.clone(), as_it_is()).unwrap();
        while session.steps() < stop {
            session.step().unwrap();
        }
        session.settle().unwrap();
        session.extend(config, total).unwrap();
        let events = end(session).1;
        let of = |event: &Event| {
            if let Event::Review(review) = event { Some((review.step, review.grids.len())) } else { None }
        };
        events.iter().filter_map(of).collect::<Vec<_>>()
    };
    let two = Required { reviews: 2, grids_at: 0.0 };
    assert_eq!(reviews(&two, [10, 20]), [(12, 0), (16, 0)], "as it was");
    assert_eq!(reviews(&two, [10, 11]), [(10, 0)], "both are past");
    assert_eq!(reviews(&two, [10, 15]), [(10, 0), (12, 0)], "one is past");
    assert_eq!(reviews(&two, [10, 10]), [], "no step follows that could mend what is lost");
    let grids = Required { reviews: 0, grids_at: 0.5 };
    assert_eq!(reviews(&grids, [9, 20]), [(10, 4)]);
    assert_eq!(reviews(&grids, [9, 12]), [(9, 4)], "the cameras are asked late");
    let both = Required { grids_at: 0.3, ..two };
    assert_eq!(reviews(&both, [5, 16]), [(5, 4), (10, 0), (13, 0)], "of two kinds the one that is past");
    assert_eq!(reviews(&both, [5, 7]), [(5, 4), (5, 0), (6, 0)], "and both");
}

#[test]
fn a_capture_without_training_images_is_refused() {
    let mut tiny = Tiny::on_device("session-none");
    tiny.capture.cameras.iter_mut().for_each(|camera| camera.is_test = true);
    let refused = Session::begin(gpu().clone(), &tiny.capture, config(), as_it_is());
    let fault = refused.err().expect("there is nothing to train on");
    assert!(fault.exit_code() == 3 && fault.to_string().contains("has no training image"), "{fault}");
}

#[test]
fn a_step_of_a_full_run_has_so_many_passes_and_barriers() {
    let Some(gpu) = timed() else { return };
    let tiny = Tiny::new("passes");
    let required = Required { grids_at: 0.0, ..Required::default() };
    let config = Config { steps: 60, max_gaussians: 2_000, required, ..exact() };
    let mut session = Session::begin(gpu.clone(), &tiny.capture, config, as_it_is()).unwrap();
    // All terms of the loss, brightness grids, time offsets; Gaussians that move.
    let step = session.profile().unwrap().unwrap();
    let of = |part: &str| -> Vec<u64> {
        step.passes.iter().filter(|pass| pass.label.contains(part)).map(|pass| pass.dispatches).collect()
    };
    for part in ["ssim", "prior_loss", "bilateral_adam", "clock_step", "adam_idle", "project_dynamic_sh3"] {
        assert_eq!(of(part).len(), if part == "ssim" { 2 } else { 1 }, "{part}");
    }
    // A tile's blocks of pixels follow one another, as many as the width of subgroups makes them.
    let blocks = of("blend_bwd").iter().sum::<u64>() - 1;
    let n_passes = of("").iter().sum::<u64>() - blocks;
    // A GPU has a round of the depth sort less, goes back through a grid in one pass and adds up without slots; long lists in chunks
    // are three passes and a barrier more.
    let expected = if gpu.caps().kind == DeviceKind::Cpu { (45, 33) } else { (45, 34) };
    assert_eq!((n_passes, step.barriers as u64 - blocks), expected);
}
