//! The ways of adding gradients up.

use super::adjoint::layers;
use super::check::{cotangents, dot, flat, smooth_cotangents};
use crate::adversary::slack;
use crate::common::one::{at_pixel, with};
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use ivv::internals::reference::pull;
use ivv::internals::scene::SH_C0;
use ivv::internals::stage::{Accumulation, Capacity};
use ivv::internals::vk::Caps;
use ivv_conformance::adjoint::group_error;
use ivv_conformance::fixtures::adam::{Scene, Step};

tested! {
    "blend/fixed_sums.comp" by jvp in all_ways_agree_with_each_other_and_with_dual_numbers;
}

fn gradients(splats: &Splats, mode: Sums) -> Option<Gradients> {
    gradients_of(splats, mode, &cotangents(3, &view(), |_| false))
}

fn gradients_of(splats: &Splats, mode: Sums, cotangents: &Frame) -> Option<Gradients> {
    let (gpu, view) = (gpu(), view());
    let mut renderer = Renderer::new(gpu.clone(), splats, Constants::default()).unwrap();
    if let Err(reason) = renderer.accumulate(mode) {
        crate::common::notes::skip(reason);
        return None;
    }
    let (found, report) = renderer.vjp(&view, cotangents).unwrap();
    assert!(report.intersections > 0);
    Some(found)
}

#[test]
fn all_ways_agree_with_each_other_and_with_dual_numbers() {
    let splats = scene(8, 300, 1);
    let slots = gradients(&splats, Sums::Slots).unwrap();
    for mode in Sums::ALL {
        let Some(found) = gradients(&splats, mode) else { continue };
        assert_eq!(found.n_bad, 0, "{mode:?}");
        for name in ["position", "rotation", "scale", "opacity", "sh", "velocity", "t_center", "t_scale"] {
            let (a, b) = (flat(&found, name), flat(&slots, name));
            let difference: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
            let norm = dot(&b, &b).sqrt();
            let error = dot(&difference, &difference).sqrt() / norm;
            assert!(norm > 0.0 && error <= 2e-6, "{mode:?}: {name} differs by {error:e}");
        }
    }
    let (splats, view) = (scene(31, 60, 1), view());
    let smooth = smooth_cotangents(4, &splats, &view);
    for mode in Sums::ALL {
        let Some(found) = gradients_of(&splats, mode, &smooth) else { continue };
        for name in ["position", "rotation", "scale", "opacity", "sh", "velocity", "t_center", "t_scale"] {
            let error = group_error(&found, name, &splats, &view, &smooth).expect("a gradient");
            assert!(error <= 1e-5, "{mode:?}: {name} is off by {error:e}");
        }
    }
}

#[test]
fn each_way_tells_density_control_how_hard_a_centre_is_pulled() {
    let (gpu, view) = (gpu(), view());
    // Static and dynamic ones, some of which are not seen.
    let splats = scene(17, 60, 1);
    let d_color = smooth_cotangents(6, &splats, &view).color;
    let truth = pull(&splats, &view, &Constants::default(), &d_color);
    let most = truth.iter().fold(0.0, |a: f64, b| a.max(*b));
    assert!(truth.iter().filter(|pull| **pull > 1e-3 * most).count() > 20, "too few are pulled");
    for sums in Sums::ALL.into_iter().filter(|sums| sums.check(gpu.caps()).is_ok()) {
        let (after, n_bad) = Scene::new(&splats).step(&gpu, &view, &d_color, &Step { sums, ..Step::dense(1) }).unwrap();
        assert_eq!(n_bad, 0, "{sums:?}");
        for (i, ([found, n, ..], truth)) in after.state.iter().zip(&truth).enumerate() {
            let found = f64::from(*found);
            let allowed = slack(100.0) * (2e-5 * truth + 1e-6 * most);
            assert!((found - truth).abs() <= allowed, "{sums:?}: Gaussian {i} is pulled by {found}, not by {truth}");
            assert!(*n == 1.0 || *truth == 0.0, "{sums:?}: Gaussian {i} is pulled in no picture");
        }
    }
}

/// Drivers on a CPU end the loops of an invocation after 65,535 turns in all.
#[test]
fn a_list_whose_entries_all_meet_one_block_is_walked_whole() {
    let gpu = gpu();
    let view = camera(16, 16);
    let mut splats = layers(32_000, 1.1 / 255.0, 1.5 / 255.0);
    // Into the last quarter of the picture, a block of 8 x 8 pixels.
    for at in &mut splats.position {
        [at[0], at[1]] = [at[0], at[1]].map(|x| 0.5 * x + 4.0 / 64.0 * at[2]);
    }
    let cotangents = smooth_cotangents(7, &splats, &view);
    let gradients = |mode: Sums| {
        let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
        renderer.accumulate(mode).ok()?;
        Some(renderer.vjp(&view, &cotangents).unwrap().0)
    };
    let slots = gradients(Sums::Slots).unwrap();
    for mode in Sums::ALL {
        let Some(found) = gradients(mode) else { continue };
        for name in ["position", "opacity", "sh"] {
            let (a, b) = (flat(&found, name), flat(&slots, name));
            let difference: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
            let error = (dot(&difference, &difference) / dot(&b, &b)).sqrt();
            assert!(error <= 1e-5, "{mode:?}: {name} differs by {error:e}");
        }
    }
}

#[test]
fn slots_and_fixed_point_give_the_same_bits_in_every_run() {
    let splats = scene(9, 400, 0);
    for mode in Sums::ALL {
        let Some(first) = gradients(&splats, mode) else { continue };
        assert!(flat(&first, "position").iter().any(|x| *x != 0.0));
        for _ in 0..3 {
            assert_same_gradients(format_args!("{mode:?}"), &gradients(&splats, mode).unwrap(), &first);
        }
    }
}

#[test]
fn fixed_point_in_one_word_gives_the_bits_of_two() {
    // One word carries where the other adds its own carry: sums of both signs, and words of zeros.
    for (seed, n) in [(11, 1), (12, 40), (13, 900)] {
        let splats = scene(seed, n, 1);
        let Some(one) = gradients(&splats, Sums::Fixed64) else { return };
        let two = gradients(&splats, Sums::Fixed32).unwrap();
        if crate::adversary::rounds_otherwise("two kernels are compared to the bit") {
            return;
        }
        assert!(flat(&one, "position").iter().any(|x| *x != 0.0));
        assert_same_gradients(format_args!("{n} Gaussians"), &one, &two);
    }
}

#[test]
fn gaussians_count_where_they_are_more_than_intersections() {
    // All are active and few touch a tile, the last ones.
    let mut splats = scene(14, 3000, 0);
    splats.opacity[..2990].fill(-9.0);
    let slots = gradients(&splats, Sums::Slots).unwrap();
    let b = flat(&slots, "opacity");
    assert!(b[2990..].iter().filter(|x| **x != 0.0).count() > 4 && b[..2990].iter().all(|x| *x == 0.0));
    for mode in Sums::ALL {
        let Some(found) = gradients(&splats, mode) else { continue };
        let a = flat(&found, "opacity");
        let difference: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
        let error = (dot(&difference, &difference) / dot(&b, &b)).sqrt();
        assert!(error <= 2e-6, "{mode:?}: opacity differs by {error:e}");
    }
}

#[test]
fn auto_is_what_repeats_slots_on_a_cpu_and_integers_on_a_gpu() {
    let gpu = gpu();
    let caps = |kind, int64_atomics| Caps { kind, int64_atomics, ..gpu.caps().clone() };
    let auto = |kind, int64| Accumulation::Auto.on(&caps(kind, int64));
    assert_eq!(auto(DeviceKind::Cpu, true), Sums::Slots);
    assert_eq!(auto(DeviceKind::DiscreteGpu, true), Sums::Fixed64);
    assert_eq!(auto(DeviceKind::IntegratedGpu, false), Sums::Fixed32);
    assert_eq!(Accumulation::FixedPoint.on(&caps(DeviceKind::Cpu, true)), Sums::Fixed64);
    assert_eq!(Accumulation::FixedPoint.on(&caps(DeviceKind::Cpu, false)), Sums::Fixed32);
    let poor = caps(DeviceKind::DiscreteGpu, false);
    for sums in Sums::ALL {
        let lacks = sums.check(&poor).err().map(|e| e.to_string()).unwrap_or_default();
        let says = if sums == Sums::Fixed64 { "no 64-bit atomics" } else { "" };
        assert!(lacks.contains(says) && lacks.is_empty() == says.is_empty(), "{sums:?}: {lacks}");
    }
}

#[test]
fn a_cotangent_beyond_the_fixed_point_s_range_is_counted_and_never_wraps() {
    let (gpu, view) = (gpu(), view());
    let splats = scene(10, 60, 0);
    let sizes = [1e12f32, 1e30, f32::INFINITY, f32::NAN];
    for (size, sums) in sizes.into_iter().flat_map(|size| [Sums::Fixed32, Sums::Fixed64].map(|sums| (size, sums))) {
        let mut huge = cotangents(4, &view, |_| true);
        huge.color[(28 * view.intrinsics.width + 40) as usize] = [size, 0.0, 0.0];
        let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
        if let Err(reason) = renderer.accumulate(sums) {
            crate::common::notes::skip(reason);
            continue;
        }
        let (found, _) = renderer.vjp(&view, &huge).unwrap();
        assert!(found.n_bad > 0 && super::check::is_finite(&found), "{sums:?}: {size:e}");
    }
}

fn gradients_in(splats: &Splats, view: &View, cotangents: &Frame, mode: Sums) -> Option<(Gradients, FrameReport)> {
    let gpu = gpu();
    let mut renderer = Renderer::new(gpu.clone(), splats, Constants::default()).unwrap();
    if let Err(reason) = renderer.accumulate(mode) {
        crate::common::notes::skip(reason);
        return None;
    }
    Some(renderer.vjp(view, cotangents).unwrap())
}

/// A Gaussian over the whole picture: of each block of pixels its red has a term far within the range, and 1,024 of them or more.
#[test]
fn a_sum_beyond_the_fixed_point_s_range_is_counted_though_all_its_terms_are_within() {
    let view = with(camera(512, 512), |of| (of.fx, of.fy) = (512.0, 512.0));
    let splats = scene_of(&[ball([0.0, 0.0, 4.0], 8.0, 0.5, [0.3, 0.6, 0.2])]);
    let opaque: f64 = render_f64(&splats, &view, &Constants::default()).alpha.iter().sum();
    // In units of a cotangent: 2^31 are 2^63.
    let (range, most) = (2f64.powi(31), 0.75 * 2f64.powi(31));
    assert!(6_000.0 * opaque < 0.5 * most && 25_000.0 * opaque > 1.2 * range && 25_000.0 * opaque < 1.8 * range);
    for mode in Sums::ALL {
        for size in [6e3f32, -6e3, 2.5e4, -2.5e4] {
            let none = cotangents(4, &view, |_| true);
            let red = Frame { color: vec![[size, 0.0, 0.0]; none.color.len()], ..none };
            let Some((found, report)) = gradients_in(&splats, &view, &red, mode) else { continue };
            let (found_red, truth) = (flat(&found, "sh")[0], SH_C0 * f64::from(size) * opaque);
            let is_refused = mode != Sums::Slots && size.abs() > 1e4;
            assert_eq!((report.visible, found.n_bad), (1, u32::from(is_refused)), "{mode:?}: {size}");
            let truth = if is_refused { 0.0 } else { truth };
            assert!((found_red - truth).abs() <= 1e-4 * truth.abs(), "{mode:?}: {found_red}, not {truth}");
            assert!(super::check::is_finite(&found), "{mode:?}: {size}");
        }
    }
}

/// 104 bytes of sums for each in fixed point, where its splat has 64.
#[test]
fn as_many_gaussians_are_active_as_a_binding_holds_splats_and_sums_of() {
    let caps = Caps { max_binding_bytes: 128 << 20, ..gpu().caps().clone() };
    let purposes = [Purpose::Picture, Purpose::Gradient, Purpose::Training];
    for (sums, purpose) in Sums::ALL.into_iter().flat_map(|sums| purposes.map(|purpose| (sums, purpose))) {
        let capacity = Capacity {
            active: 1,
            intersections: 1,
            tiles: 1,
            pixels: 1,
            outputs: Outputs::Color,
            purpose,
            sums,
            camera: false,
            idle: false,
            is_batched: false,
            depth_bits: 32,
        };
        let is_fixed = sums != Sums::Slots && purpose != Purpose::Picture;
        let most = if is_fixed { 1_290_555 } else { 2_097_152 };
        let found = [0, 1000, most, most + 1, u32::MAX].map(|n| capacity.active_of(n, &caps));
        assert_eq!(found, [1, 1000, most, most, most], "{sums:?}, {purpose:?}");
    }
}

#[test]
#[ignore = "slow: 1.3 million Gaussians"]
fn more_gaussians_than_a_binding_holds_sums_of_have_their_gradients_by_strips() {
    let most = gpu().caps().max_binding_bytes / 104;
    if most > 2 << 20 {
        return crate::common::notes::skip(format!("a binding holds the sums of {most} Gaussians"));
    }
    // All of them in view, a few over each pixel to be seen before it is dark.
    let view = camera(64, 64);
    let n = most as usize + 1000;
    let one = |i: usize| {
        let [x, y] = [i * 37 % 64, i / 64 % 64].map(|at| at as f64 + 0.5);
        One { opacity: 0.0, ..ball(at_pixel(&view, x, y, 2.0 + i as f64 / n as f64), 0.01, 0.5, [0.7, 0.4, 0.3]) }
    };
    let splats = scene_of(&(0..n).map(one).collect::<Vec<One>>());
    let cotangents = cotangents(5, &view, |_| false);
    let slots = gradients_in(&splats, &view, &cotangents, Sums::Slots).unwrap().0;
    let b = flat(&slots, "sh");
    assert!(b.iter().filter(|x| **x != 0.0).count() > 10_000);
    for mode in [Sums::Fixed32, Sums::Fixed64] {
        let Some((found, report)) = gradients_in(&splats, &view, &cotangents, mode) else { continue };
        assert!(report.strips > 1 && found.n_bad == 0, "{mode:?}: {report:?}");
        let difference: Vec<f64> = flat(&found, "sh").iter().zip(&b).map(|(a, b)| a - b).collect();
        let error = (dot(&difference, &difference) / dot(&b, &b)).sqrt();
        assert!(error <= 1e-5, "{mode:?}: sh differs by {error:e}");
    }
}
