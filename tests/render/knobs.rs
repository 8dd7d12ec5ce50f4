//! What may be traded for time: exact knobs change no bit, the others what they say and no more.

use crate::common::device::as_gpu;
use crate::common::frames::{pixels, render_with};
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use ivv::internals::settings::{Culls, Knobs, TileBound};
use ivv::internals::stage::constants_on;

fn turned(splats: &Splats, view: &View, knobs: Knobs) -> (Frame, ivv::internals::stage::FrameReport) {
    render_with(splats, view, knobs.on(Constants::default()))
}

fn difference(a: &Frame, b: &Frame) -> f32 {
    let (a, b) = (pixels(a), pixels(b));
    let channels = a.iter().zip(&b).flat_map(|(a, b)| (0..4).map(|k| (a[k] - b[k]).abs()));
    channels.fold(0.0, f32::max)
}

#[test]
fn no_bound_of_tiles_or_blocks_changes_a_bit_or_who_is_seen() {
    for (name, splats) in [("usual", scene(3, 300, 1)), ("wild", wild_scene(5, 400))] {
        let (exact, own) = render(&splats, &view());
        let mut pairs = Vec::new();
        for tile_bound in [TileBound::Ellipse, TileBound::Rectangle, TileBound::Square] {
            for block_cull in [true, false] {
                let culls = Culls { tile_bound, block_cull, ..Culls::default() };
                let knobs = Knobs { culls, ..Knobs::default() };
                let (frame, report) = turned(&splats, &view(), knobs);
                assert_same_frame(format_args!("{name}: {knobs:?}"), &frame, &exact);
                assert_eq!((report.active, report.visible), (own.active, own.visible), "{name}: {knobs:?}");
                let culls = Culls { time_cull: false, ..culls };
                let (frame, at_all_times) = turned(&splats, &view(), Knobs { culls, ..knobs });
                assert_same_frame(format_args!("{name}: {knobs:?} at all times"), &frame, &exact);
                assert_eq!(at_all_times.visible, own.visible, "{name}: {knobs:?}");
                assert!(at_all_times.active > own.active + 10, "{name}: {} of {}", at_all_times.active, own.active);
                let listed = at_all_times.intersections > report.intersections;
                assert_eq!(listed, tile_bound == TileBound::Square, "{name}: {knobs:?}");
                pairs.push(report.intersections);
            }
        }
        let [ellipse, rectangle, square] = [pairs[0], pairs[2], pairs[4]];
        assert!(ellipse > 300 && rectangle > ellipse && square > rectangle, "{name}: {pairs:?} pairs");
    }
}

#[test]
fn short_depth_keys_tell_apart_what_they_say() {
    // One behind the other, so many steps of f32, the one behind first in the file: it comes first where keys are equal.
    let picture = |steps: u32, depth_bits: u32| {
        let z = |steps: u32| f32::from_bits(Constants::default().near.to_bits() + (0x041c << 16) + steps);
        let front = ball([0.0, 0.0, z(0)], 0.1, 0.9, [1.0, 0.0, 0.0]);
        let back = ball([0.0, 0.0, z(steps)], 0.1, 0.9, [0.0, 0.0, 1.0]);
        let knobs = Knobs { depth_bits, ..Knobs::default() };
        let (frame, report) = turned(&scene_of(&[back, front]), &camera(48, 32), knobs);
        assert_eq!(report.visible, 2);
        frame
    };
    for (depth_bits, told) in [(32, 1), (24, 16), (16, 2048)] {
        let right = picture(told, 32);
        assert_same_frame(format_args!("{depth_bits} bits"), &picture(told, depth_bits), &right);
        let swapped = difference(&picture(told - 1, depth_bits), &right);
        assert!(swapped > 0.1, "{depth_bits} bits tell {} steps apart: {swapped}", told - 1);
    }
    // A whole scene's picture, then, differs where neighbours in depth overlap, and little.
    let splats = scene(4, 300, 1);
    let (exact, _) = turned(&splats, &view(), Knobs { depth_bits: 32, ..Knobs::default() });
    let changed =
        |depth_bits| difference(&turned(&splats, &view(), Knobs { depth_bits, ..Knobs::default() }).0, &exact);
    assert!(changed(24) < 1e-3 && changed(16) < 0.2, "{} {}", changed(24), changed(16));
}

#[test]
fn a_short_depth_key_orders_everything_in_its_range_and_keeps_what_lies_beyond() {
    let splats = scene(6, 200, 0);
    let far =
        Splats { position: splats.position.iter().map(|[x, y, z]| [1e4 * x, 1e4 * y, 1e4 * z]).collect(), ..splats };
    let far = Splats { scale: far.scale.iter().map(|s| s.map(|s| s + 1e4f32.ln())).collect(), ..far };
    let (exact, own) = turned(&far, &view(), Knobs { depth_bits: 32, ..Knobs::default() });
    for (depth_bits, most) in [(24, 1e-3), (16, 1.0)] {
        let (frame, report) = turned(&far, &view(), Knobs { depth_bits, ..Knobs::default() });
        assert_eq!((report.visible, report.intersections), (own.visible, own.intersections));
        let error = difference(&frame, &exact);
        assert!(report.visible > 10 && error < most, "{depth_bits} bits: {error}");
        assert!(frame.alpha.iter().any(|alpha| *alpha > 0.1));
    }
}

#[test]
fn depth_keys_have_by_default_the_bits_of_the_device() {
    let of = |kind, depth_bits| {
        let knobs = Knobs { depth_bits, ..Knobs::default() };
        constants_on(kind, knobs, Constants::default()).knobs.depth_bits
    };
    assert_eq!(Knobs::default().depth_bits, 0);
    for (kind, bits) in [(DeviceKind::Cpu, 32), (DeviceKind::DiscreteGpu, 24), (DeviceKind::IntegratedGpu, 24)] {
        assert_eq!([0, 16, 24, 32].map(|asked| of(kind, asked)), [bits, 16, 24, 32], "{kind:?}");
    }
    // And a picture is made with them: of two Gaussians a step of 32 bits apart, the one behind first in the file.
    let z = |steps: u32| f32::from_bits(4.0f32.to_bits() + steps);
    let front = ball([0.0, 0.0, z(0)], 0.1, 0.9, [1.0, 0.0, 0.0]);
    let back = ball([0.0, 0.0, z(1)], 0.1, 0.9, [0.0, 0.0, 1.0]);
    let both = scene_of(&[back, front]);
    let picture = |depth_bits| {
        let knobs = Knobs { depth_bits, ..Knobs::default() };
        turned(&both, &camera(48, 32), knobs).0
    };
    assert!(difference(&picture(24), &picture(32)) > 0.0);
    let kind = gpu().caps().kind;
    assert_same_frame(format_args!("{kind:?}"), &picture(0), &picture(of(kind, 0)));
}

#[test]
fn a_near_plane_from_which_short_depth_keys_do_not_reach_far_takes_all_bits() {
    let bits_of = |kind, near| {
        let constants = Constants { near, ..Constants::default() };
        constants_on(kind, Knobs::default(), constants).knobs.depth_bits
    };
    for kind in [DeviceKind::DiscreteGpu, DeviceKind::IntegratedGpu] {
        assert_eq!([0.01, 1e-4, 1e-5, 1e-9].map(|near| bits_of(kind, near)), [24, 24, 32, 32], "{kind:?}");
    }
    assert_eq!(bits_of(DeviceKind::Cpu, 1e-9), 32);
    // The one behind first in the file, both farther than 24 bits reach: 4.29.
    let back = ball([0.0, 0.0, 6.0], 0.5, 0.9, [0.0, 0.0, 1.0]);
    let front = ball([0.0, 0.0, 5.0], 0.5, 0.9, [1.0, 0.0, 0.0]);
    let both = scene_of(&[back, front]);
    let gpu = as_gpu();
    let middle = |depth_bits| {
        let constants = Constants { near: 1e-9, ..Constants::default() };
        let constants = Knobs { depth_bits, ..Knobs::default() }.on(constants);
        let mut renderer = Renderer::new(gpu.clone(), &both, constants).unwrap();
        renderer.render(&camera(48, 32), Outputs::All).unwrap().0.color[16 * 48 + 24]
    };
    let ([red, _, blue], [wrong_red, _, wrong_blue]) = (middle(0), middle(24));
    assert!(red > 0.8 && blue < 0.2, "the nearer one is red: {red} {blue}");
    assert!(wrong_blue > 0.8 && wrong_red < 0.2, "24 bits cannot tell them apart: {wrong_red} {wrong_blue}");
}

#[test]
fn a_cut_of_alpha_is_a_higher_alpha_min() {
    let splats = scene(8, 300, 1);
    let alpha_cut = 4.0 / 255.0;
    let (frame, report) = turned(&splats, &view(), Knobs { alpha_cut, ..Knobs::default() });
    let (raised, _) = render_with(&splats, &view(), Constants { alpha_min: alpha_cut, ..Constants::default() });
    assert_same_frame("a higher alpha_min", &frame, &raised);
    let (exact, own) = render(&splats, &view());
    assert!(report.intersections < own.intersections && difference(&frame, &exact) > 1e-3);
    let (below, _) = turned(&splats, &view(), Knobs { alpha_cut: 1e-3, ..Knobs::default() });
    assert_same_frame("a cut below alpha_min cuts nothing", &below, &exact);
}

#[test]
fn a_cut_of_transmittance_leaves_out_less_than_itself() {
    let splats = scene(9, 900, 1);
    let constants = Constants { t_min: 0.0, ..Constants::default() };
    let (exact, _) = render_with(&splats, &view(), constants);
    let largest = exact.color.as_flattened().iter().fold(1.0, |m: f32, x| m.max(*x));
    let mut changed = Vec::new();
    for t_cut in [1e-3, 1e-2, 1e-1] {
        let knobs = Knobs { t_cut, ..Knobs::default() };
        let (frame, _) = render_with(&splats, &view(), knobs.on(constants));
        let error = difference(&frame, &exact);
        assert!(error <= t_cut * 4.0 * largest, "{error} for a cut at {t_cut}");
        changed.push(error);
    }
    assert!(changed[2] > changed[1] && changed[2] > 1e-3, "{changed:?}");
}

#[test]
fn a_temporal_cut_leaves_out_those_that_are_faint_then_and_no_others() {
    let splats = scene(10, 300, 1);
    let temporal_cut = 0.1;
    let (frame, report) = turned(&splats, &view(), Knobs { temporal_cut, ..Knobs::default() });
    let (exact, own) = render(&splats, &view());
    assert!(report.active < own.active && report.active > 0 && difference(&frame, &exact) > 1e-4);
    // The truth of a scene without them.
    let time = view().time + view().time_offset * view().flow_dt;
    let opacity_then = |i: usize| {
        let base = 1.0 / (1.0 + (-f64::from(splats.opacity[i])).exp());
        let Some(m) = i.checked_sub(splats.n_static).map(|k| splats.motion[k]) else { return 1.0 };
        base * (-((time - f64::from(m.t_center)) / f64::from(m.t_scale).exp()).powi(2)).exp()
    };
    let mut without = splats.clone();
    for i in 0..splats.len() {
        if opacity_then(i) < f64::from(temporal_cut) {
            without.opacity[i] = -30.0;
        }
    }
    let truth = render_f64(&without, &view(), &Constants::default());
    let n = truth.alpha.len();
    let wrong = (0..n).filter(|i| (truth.alpha[*i] - f64::from(frame.alpha[*i])).abs() > 1e-4).count();
    assert!(20 * wrong < n, "{wrong} of {n} pixels are not those of the scene without them");
    let (below, _) = turned(&splats, &view(), Knobs { temporal_cut: 1e-3, ..Knobs::default() });
    assert_same_frame("a cut below alpha_min cuts nothing", &below, &exact);
}
