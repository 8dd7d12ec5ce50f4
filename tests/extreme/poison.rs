//! N1: every number of a Gaussian and of a camera in turn takes every value that has ever hurt a renderer.

use crate::common::frames::{Tolerance, bits, check_finite, compare, render};
use crate::common::one::{One, camera, ones, scene_of};
use crate::common::random::scene;
use ivv::Constants;
use ivv::scene::{Frame, Splats, View};
use ivv::twin::{Camera, Params, Rules, project, render_f64};

const NOT_FINITE: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
/// Zeros, the least and the greatest denormal, 1e38 and half of the greatest number, both signs.
const EXTREME: [f32; 10] =
    [0.0, -0.0, 1e-45, -1e-45, 1.175_494_2e-38, -1.175_494_2e-38, 1e38, -1e38, f32::MAX / 2.0, f32::MIN / 2.0];

/// A name and the number it stands for.
type Slot = (&'static str, fn(&mut One) -> &mut f32);

const SLOTS: [Slot; 14] = [
    ("position x", |one| &mut one.position[0]),
    ("position y", |one| &mut one.position[1]),
    ("position z", |one| &mut one.position[2]),
    ("rotation w", |one| &mut one.rotation[0]),
    ("rotation x", |one| &mut one.rotation[1]),
    ("rotation z", |one| &mut one.rotation[3]),
    ("scale x", |one| &mut one.scale[0]),
    ("scale y", |one| &mut one.scale[1]),
    ("scale z", |one| &mut one.scale[2]),
    ("opacity", |one| &mut one.opacity),
    ("sh 0", |one| &mut one.sh[0][0]),
    ("sh 1", |one| &mut one.sh[2][1]),
    ("sh 2", |one| &mut one.sh[6][2]),
    ("sh 3", |one| &mut one.sh[12][0]),
];

const MOTION_SLOTS: [Slot; 5] = [
    ("velocity x", |one| &mut one.motion.as_mut().unwrap().velocity[0]),
    ("velocity y", |one| &mut one.motion.as_mut().unwrap().velocity[1]),
    ("velocity z", |one| &mut one.motion.as_mut().unwrap().velocity[2]),
    ("t_center", |one| &mut one.motion.as_mut().unwrap().t_center),
    ("t_scale", |one| &mut one.motion.as_mut().unwrap().t_scale),
];

/// The camera of all cases: in front of a scene of `random::scene`.
fn pose() -> View {
    let mut view = camera(40, 28);
    view.world_to_camera[2][3] = 4.0;
    view.fx = 40.0;
    view.fy = 36.0;
    view
}

/// Whether the truth shows Gaussian `i` at each pixel, nearly or really.
fn footprint(splats: &Splats, i: usize, view: &View) -> Vec<bool> {
    let (params, camera) = (Params::<f64>::new(splats, view), Camera::<f64>::new(view));
    let rules = Rules::<f64>::new(&Constants::default());
    let time = camera.shifted_time(params.time_offset);
    let near = Rules { alpha_min: rules.alpha_min * (1.0 - 1e-3), ..rules };
    let p = project(&params.gaussian(i), &camera, time, &near);
    let pixels = (0..view.height).flat_map(|y| (0..view.width).map(move |x| [x, y].map(|v| f64::from(v) + 0.5)));
    pixels.map(|at| p.is_some_and(|p| p.alpha_at(at, &near) >= near.alpha_min)).collect()
}

/// One case: `index` of `all` has taken a value. `without` is the frame of the scene without it.
fn check(all: &[One], index: usize, without: &Frame, must_be_bad: bool) -> Result<bool, String> {
    let (splats, view) = (scene_of(all), pose());
    let (frame, report) = render(&splats, &view);
    check_finite(&frame)?;
    if must_be_bad && report.bad_gaussians != 1 || report.bad_gaussians > 1 {
        return Err(format!("{} bad Gaussians", report.bad_gaussians));
    }
    let bad = report.bad_gaussians == 1;
    let touched = if bad { vec![false; frame.alpha.len()] } else { footprint(&splats, index, &view) };
    let pairs = bits(&frame).into_iter().zip(bits(without));
    if let Some(i) = pairs.zip(&touched).position(|((a, b), touched)| a != b && !touched) {
        return Err(format!("pixel {i} of the others differs (bad: {bad})"));
    }
    let drawn = touched.iter().any(|touched| *touched);
    if drawn {
        let tolerance = Tolerance { away: 1e-4, n_band: 0.2, ..Tolerance::default() };
        compare(&frame, &render_f64(&splats, &view, &Constants::default()), &tolerance)?;
    }
    Ok(drawn)
}

/// Poisons the slots of Gaussian `index`.
fn poison(index: usize, slots: &[Slot]) {
    let mut base = scene(61, 12, 3);
    // Brought together, so that the poisoned one lies among the others and all are seen.
    base.position.iter_mut().flatten().for_each(|x| *x *= 0.4);
    base.opacity.fill(1.0);
    base.scale.iter_mut().flatten().for_each(|s| *s = s.max(-2.5));
    base.motion.iter_mut().for_each(|m| (m.t_center, m.t_scale) = (0.4, 0.0));
    let base = ones(&base);
    let mut others = base.clone();
    others.remove(index);
    let (without, _) = render(&scene_of(&others), &pose());
    let (mut faults, mut n_drawn, mut n) = (Vec::new(), 0, 0);
    for (name, slot) in slots {
        for value in NOT_FINITE.into_iter().chain(EXTREME) {
            let mut all = base.clone();
            *slot(&mut all[index]) = value;
            // Infinite tau is a value: the Gaussian does not fade.
            let is_value = value.is_finite() || *name == "t_scale" && value > 0.0;
            match check(&all, index, &without, !is_value) {
                Ok(drawn) => n_drawn += usize::from(drawn),
                Err(fault) => faults.push(format!("{name} = {value:e}: {fault}")),
            }
            n += 1;
        }
    }
    assert!(faults.is_empty(), "{} of {n} cases fail\n{}", faults.len(), faults.join("\n"));
    assert!(n_drawn * 4 > n, "only {n_drawn} of {n} cases draw the poisoned Gaussian");
}

#[test]
fn n01_a_poisoned_number_of_a_static_gaussian_harms_no_other() {
    poison(2, &SLOTS);
}

#[test]
fn n01_a_poisoned_number_of_a_dynamic_gaussian_harms_no_other() {
    poison(8, &SLOTS);
}

#[test]
fn n01_a_poisoned_motion_harms_no_other_gaussian() {
    poison(8, &MOTION_SLOTS);
}

#[test]
fn n01_a_poisoned_camera_gives_a_finite_frame() {
    type ViewSlot = (&'static str, fn(&mut View) -> &mut f64);
    let slots: [ViewSlot; 11] = [
        ("fx", |view| &mut view.fx),
        ("fy", |view| &mut view.fy),
        ("cx", |view| &mut view.cx),
        ("cy", |view| &mut view.cy),
        ("rotation", |view| &mut view.world_to_camera[0][0]),
        ("rotation z", |view| &mut view.world_to_camera[2][1]),
        ("translation x", |view| &mut view.world_to_camera[0][3]),
        ("translation z", |view| &mut view.world_to_camera[2][3]),
        ("time", |view| &mut view.time),
        ("time_offset", |view| &mut view.time_offset),
        ("flow_dt", |view| &mut view.flow_dt),
    ];
    let splats = scene(62, 40, 1);
    let (whole, report) = render(&splats, &pose());
    assert!(report.visible > 10 && whole.alpha.iter().any(|alpha| *alpha > 0.5));
    let mut faults = Vec::new();
    for (name, slot) in slots {
        for value in NOT_FINITE.into_iter().chain(EXTREME).map(f64::from).chain([1e300, -1e300, 1e-300]) {
            let mut view = pose();
            *slot(&mut view) = value;
            if let Err(fault) = check_finite(&render(&splats, &view).0) {
                faults.push(format!("{name} = {value:e}: {fault}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
