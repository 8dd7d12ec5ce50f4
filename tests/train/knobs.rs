//! What a run may be traded for: presets, and the settings that only training has.

use super::{Tiny, steady, test_psnr, train, trainer};
use crate::adversary::needs_roundings;
use crate::common::prelude::*;
use ivv::internals::scene::capture::{half_bits, half_value};
use ivv::internals::settings::{Culls, Knobs, TileBound};
use ivv::internals::train::{Preset, Resolution, merge};

fn preset(name: &str) -> Config {
    let mut settings = serde_json::to_value(exact()).unwrap();
    merge(&mut settings, &Preset::find(name).unwrap().settings);
    merge(&mut settings, &serde_json::json!({ "sh_degree": 1 }));
    serde_json::from_value(settings).unwrap()
}

#[test]
fn the_exact_preset_gives_the_bits_of_the_reference_through_rounds_of_density_control() {
    needs_roundings!("two kernels have the same bits");
    let tiny = Tiny::on_device("exact");
    let exact = preset("exact");
    // As a straightforward engine does: every Gaussian at every time, in every tile of its square, every pixel of a tile asked.
    let mut reference = exact.clone();
    reference.frame.culls = Culls { tile_bound: TileBound::Square, block_cull: false, time_cull: false };
    let mut begin = from_points(&tiny.capture.points, &tiny.capture, &exact);
    // Every third one shows in one frame alone; in the others its opacity is not far from 0, or 0.
    let short = begin.motion.iter_mut().step_by(3).zip([-3.0, -5.0].into_iter().cycle());
    short.for_each(|(motion, t_scale)| motion.t_scale = t_scale);
    assert!(begin.motion.len() > 100, "{} move", begin.motion.len());
    let [(fast, ..), (plain, ..)] = [exact, reference].map(|config| train(&tiny.capture, &config, &begin, 40));
    assert!(fast.len() > begin.len(), "density control adds Gaussians");
    assert_same_splats("without culls", &plain, &fast);
    let [fast, plain] = [fast, plain].map(|splats| {
        let file = tiny.folder.join("scene.ply");
        ivv::internals::formats::write_ply(&file, &splats).unwrap();
        std::fs::read(&file).unwrap()
    });
    assert!(!fast.is_empty());
    assert_same("the files", &plain, &fast);
}

#[test]
fn every_preset_learns_and_is_another_run() {
    let tiny = Tiny::on_device("presets");
    let begin = from_points(&tiny.capture.points, &tiny.capture, &preset("exact"));
    let mut all: Vec<Splats> = Vec::new();
    for name in ["exact", "balanced", "fast", "small"] {
        let (end, first, last) = train(&tiny.capture, &preset(name), &begin, 40);
        assert!(last < first, "{name}: loss {first:.3} at first, {last:.3} at last");
        all.push(end);
    }
    for (index, own) in all.iter().enumerate() {
        assert!(all[..index].iter().all(|other| other != own), "two presets are one");
    }
}

#[test]
fn moments_in_16_bits_train_as_well_as_in_32_and_to_other_bits() {
    let tiny = Tiny::on_device("moments");
    let config = |moment_bits| Config { sh_degree: 1, moment_bits, ..steady() };
    let begin = from_points(&tiny.capture.points, &tiny.capture, &config(32));
    let [half, whole] = [16, 32].map(|bits| train(&tiny.capture, &config(bits), &begin, 80).0);
    assert!(half != whole);
    let [begin, half, whole] = [&begin, &half, &whole].map(|splats| test_psnr(&tiny.capture, splats));
    assert!(
        half > begin + 1.0 && (half - whole).abs() < 0.3,
        "{half:.3} dB, {whole:.3} in 32 bits, {begin:.3} at first"
    );
}

/// Steps of `config` on one picture, with priors; the reports.
fn reports(tiny: &Tiny, config: &Config, begin: &Splats, steps: u64) -> Vec<ivv::internals::train::StepReport> {
    let mut trainer = trainer(&tiny.capture, config, begin, steps);
    let (camera, frame) = tiny.capture.training_frames()[0];
    let depth = [((camera, frame), [1.0, 0.1])].into();
    let picture = tiny.capture.picture_with(camera, frame, &PriorPlan { flow: true, depth }).unwrap();
    for _ in 0..steps {
        trainer.train(camera, &tiny.capture.view(camera, frame).unwrap(), &picture).unwrap();
    }
    trainer.finish().unwrap();
    trainer.take_reports()
}

#[test]
fn a_run_begins_on_reduced_pictures_and_ends_on_whole_ones() {
    let tiny = Tiny::on_device("coarse");
    let resolution = Resolution { reduction: 2, until: 0.5 };
    let config = Config { sh_degree: 0, resolution, ..exact() };
    let begin = from_points(&tiny.capture.points, &tiny.capture, &config);
    let coarse = reports(&tiny, &config, &begin, 8);
    let whole = reports(&tiny, &Config { resolution: exact().resolution, ..config.clone() }, &begin, 8);
    // Fewer tiles in the first half; errors in the units of whole pictures.
    let pairs: Vec<[u32; 2]> = coarse.iter().zip(&whole).map(|(c, w)| [c.intersections, w.intersections]).collect();
    assert!(pairs[..4].iter().all(|[coarse, whole]| coarse < whole) && pairs[4][0] > pairs[3][0], "{pairs:?}");
    let ratio = |value: fn(&ivv::internals::train::StepReport) -> Option<f64>| {
        value(&coarse[0]).unwrap() / value(&whole[0]).unwrap()
    };
    assert!((0.7..1.4).contains(&ratio(|r| r.term("flow"))) && (0.7..1.4).contains(&ratio(|r| r.term("depth"))));
    assert!((0.7..1.3).contains(&ratio(|r| r.term("l1"))));
}

#[test]
fn ssim_at_every_second_place_is_near_that_at_all() {
    let tiny = Tiny::on_device("stride");
    let whole = Config { sh_degree: 0, ..exact() };
    let mut config = whole.clone();
    config.loss.ssim_stride = 2;
    let begin = from_points(&tiny.capture.points, &tiny.capture, &config);
    let [found, whole] = [config, whole].map(|config| reports(&tiny, &config, &begin, 1));
    let of = |key| (found[0].term(key).unwrap(), whole[0].term(key).unwrap());
    let ((sampled, all), (l1, same)) = (of("ssim"), of("l1"));
    assert!((sampled - all).abs() < 0.1 && (l1 - same).abs() < 1e-6, "SSIM {sampled} for {all}");
}

#[test]
fn settings_that_cannot_be_are_told() {
    for (knobs, told) in [
        (Knobs { depth_bits: 8, ..Knobs::default() }, "frame.depth_bits"),
        (Knobs { t_cut: f32::NAN, ..Knobs::default() }, "frame.t_cut"),
        (Knobs { temporal_cut: 1.0, ..Knobs::default() }, "frame.temporal_cut"),
    ] {
        let fault = Config { frame: knobs, ..exact() }.check().unwrap_err();
        assert!(fault.contains(told), "{fault}");
    }
    for moment_bits in [0, 8, 31, 64] {
        assert!(Config { moment_bits, ..exact() }.check().unwrap_err().contains("moment_bits"));
    }
    let resolution = Resolution { reduction: 0, until: 0.5 };
    assert!(Config { resolution, ..exact() }.check().unwrap_err().contains("resolution"));
}

#[test]
fn a_reduced_picture_holds_the_means_of_what_counts() {
    let pixel = |r: u8, mask: u8| u32::from_le_bytes([r, 2 * r, 0, mask]);
    let none = f32::NAN;
    // Two blocks of four pixels and a column that fills none.
    let shown = [[10, 20, 3, 4, 90], [30, 41, 5, 6, 90]];
    let pixels = shown.as_flattened().iter().enumerate();
    let pixels = pixels.map(|(i, r)| pixel(*r, if i % 5 >= 2 || i == 6 { 0 } else { 255 })).collect();
    let depth = [[1.0, none, 7.0, 7.0, 9.0], [3.0, 8.0, 7.0, 7.0, 9.0]];
    let flow = [
        [[2.0, -4.0], [4.0, 0.0], [1.0; 2], [1.0; 2], [9.0; 2]],
        [[none, 0.0], [100.0; 2], [1.0; 2], [1.0; 2], [9.0; 2]],
    ];
    let plain = Picture::new(5, 2, pixels);
    let halves = |flow: &[f32; 2]| flow.map(half_bits);
    let picture = plain.clone().with_priors(
        depth.as_flattened().iter().copied().map(half_bits).collect(),
        flow.as_flattened().iter().map(halves).collect(),
    );
    // The fourth pixel is hidden, and so is the whole second block.
    assert_eq!((picture.n_visible, picture.n_depth, picture.n_flow), (3, 2, 2));
    let reduced = picture.reduced(2);
    assert_eq!((reduced.width, reduced.height), (2, 1));
    // (10 + 20 + 30) / 3.
    assert_eq!(reduced.pixels, [pixel(20, 255), 0]);
    assert_eq!((reduced.n_visible, reduced.n_depth, reduced.n_flow), (1, 1, 1));
    assert_eq!((reduced.depth[0], reduced.flow[0]), (half_bits(2.0), [1.5, -1.0].map(half_bits)));
    assert!(!half_value(reduced.depth[1]).is_finite() && !half_value(reduced.flow[1][0]).is_finite());
    // Each plane of priors alone, and none.
    let depths_alone = plain.clone().with_priors(picture.depth.clone(), Vec::new()).reduced(2);
    assert_eq!((&depths_alone.depth, depths_alone.flow.len(), depths_alone.n_flow), (&reduced.depth, 0, 0));
    let flows_alone = plain.clone().with_priors(Vec::new(), picture.flow.clone()).reduced(2);
    assert_eq!((&flows_alone.flow, flows_alone.depth.len(), flows_alone.n_depth), (&reduced.flow, 0, 0));
    assert_eq!(plain.reduced(2), Picture::new(2, 1, reduced.pixels));
    assert_eq!(picture.reduced(1).pixels.len(), 10);
}

#[test]
fn a_reduced_view_sees_the_same_through_larger_pixels() {
    let tiny = Tiny::new("view");
    let view = tiny.capture.view(0, 0).unwrap();
    let reduced = view.reduced(2);
    let at = |view: &View, x: f64, y: f64| {
        [(x - view.intrinsics.cx) / view.intrinsics.fx, (y - view.intrinsics.cy) / view.intrinsics.fy]
    };
    // The centre of a large pixel is where four small ones meet.
    let (large, small) = (at(&reduced, 5.5, 7.5), at(&view, 11.0, 15.0));
    assert!((0..2).all(|k| (large[k] - small[k]).abs() < 1e-12));
    assert_eq!(
        [reduced.intrinsics.width, reduced.intrinsics.height],
        [view.intrinsics.width / 2, view.intrinsics.height / 2]
    );
    assert_eq!(view.reduced(1), view);
}
