//! N1: every number of a Gaussian and of a camera in turn takes every value that has ever hurt a renderer.

use super::prelude::*;
use ivv::internals::reference::{Camera, Params, Rules, project};

const NOT_FINITE: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
/// Zeros, the least and the greatest denormal, 1e38 and half of the greatest number, both signs.
const EXTREME: [f32; 10] =
    [0.0, -0.0, 1e-45, -1e-45, 1.175_494_2e-38, -1.175_494_2e-38, 1e38, -1e38, f32::MAX / 2.0, f32::MIN / 2.0];

type Slot = (&'static str, fn(&mut One, f32));

const SLOTS: [Slot; 15] = [
    ("position x", |one, x| one.position[0] = x),
    ("position y", |one, x| one.position[1] = x),
    ("position z", |one, x| one.position[2] = x),
    ("rotation w", |one, x| one.rotation[0] = x),
    ("rotation x", |one, x| one.rotation[1] = x),
    ("rotation y", |one, x| one.rotation[2] = x),
    ("rotation z", |one, x| one.rotation[3] = x),
    ("scale x", |one, x| one.scale[0] = x),
    ("scale y", |one, x| one.scale[1] = x),
    ("scale z", |one, x| one.scale[2] = x),
    ("opacity", |one, x| one.opacity = x),
    ("sh 0", |one, x| one.sh[0][0] = x),
    ("sh 1", |one, x| one.sh[2][1] = x),
    ("sh 2", |one, x| one.sh[6][2] = x),
    ("sh 3", |one, x| one.sh[12][0] = x),
];

fn moving(one: &mut One, set: impl FnOnce(&mut Motion)) {
    if let Some(motion) = &mut one.motion {
        set(motion);
    }
}

const MOTION_SLOTS: [Slot; 5] = [
    ("velocity x", |one, x| moving(one, |motion| motion.velocity[0] = x)),
    ("velocity y", |one, x| moving(one, |motion| motion.velocity[1] = x)),
    ("velocity z", |one, x| moving(one, |motion| motion.velocity[2] = x)),
    ("t_center", |one, x| moving(one, |motion| motion.t_center = x)),
    ("t_scale", |one, x| moving(one, |motion| motion.t_scale = x)),
];

/// The camera of all cases: in front of a scene of `random::scene`.
fn pose() -> View {
    let mut view = camera(40, 28);
    view.pose.translation.z = 4.0;
    view.intrinsics.fx = 40.0;
    view.intrinsics.fy = 36.0;
    view
}

/// By pixel: the truth shows Gaussian `i`, nearly or really.
fn footprint(splats: &Splats, i: usize, view: &View) -> Vec<bool> {
    let (params, camera) = (Params::<f64>::new(splats, view), Camera::<f64>::new(view));
    let rules = Rules::<f64>::new(&Constants::default());
    let time = camera.shifted_time(params.time_offset);
    let near = Rules { alpha_min: rules.alpha_min * (1.0 - 1e-3), ..rules };
    let p = project(&params.gaussian(i), &camera, time, &near);
    let pixels = (0..view.intrinsics.height)
        .flat_map(|y| (0..view.intrinsics.width).map(move |x| [x, y].map(|v| f64::from(v) + 0.5)));
    pixels.map(|at| p.is_some_and(|p| p.alpha_at(at, &near) >= near.alpha_min)).collect()
}

/// One case: `index` of `all` has taken a value. `without` is the frame of the scene without it. Says whether it is drawn.
fn check(
    bench: &Bench,
    tally: &mut Tally,
    all: &[One],
    index: usize,
    without: &Frame,
    must_be_bad: bool,
) -> Result<bool> {
    let (splats, view) = (scene_of(all), pose());
    let (frame, report) = bench.render(&splats, &view)?;
    check_finite(&frame)?;
    let n_bad = report.bad_gaussians;
    ensure!(n_bad == 1 || n_bad == 0 && !must_be_bad, "{n_bad} bad Gaussians");
    let touched = if n_bad == 1 { vec![false; frame.alpha.len()] } else { footprint(&splats, index, &view) };
    let pairs = bits(&frame).into_iter().zip(bits(without));
    if let Some(i) = pairs.zip(&touched).position(|((a, b), touched)| a != b && !touched) {
        bail!("pixel {i} of the others differs ({n_bad} bad)");
    }
    let drawn = touched.iter().any(|touched| *touched);
    if drawn {
        let tolerance = Tolerance { away: 1e-4, n_band: 0.2, ..Tolerance::default() };
        tally.frame(&frame, &render_f64(&splats, &view, &Constants::default()), &tolerance)?;
    }
    Ok(drawn)
}

fn poison(bench: &Bench, tally: &mut Tally, population: &str, index: usize, slots: &[Slot]) -> Result<()> {
    let mut base = scene(61, 12, 3);
    // Brought together, so that the poisoned one lies among the others and all are seen.
    base.position.iter_mut().flatten().for_each(|x| *x *= 0.4);
    base.opacity.fill(1.0);
    base.scale.iter_mut().flatten().for_each(|s| *s = s.max(-2.5));
    base.motion.iter_mut().for_each(|m| (m.t_center, m.t_scale) = (0.4, 0.0));
    let base = ones(&base);
    let mut others = base.clone();
    others.remove(index);
    let (without, _) = bench.render(&scene_of(&others), &pose())?;
    let (mut n_drawn, mut n) = (0, 0);
    for (name, set) in slots {
        for value in NOT_FINITE.into_iter().chain(EXTREME) {
            let mut all = base.clone();
            set(&mut all[index], value);
            // Infinite tau is a value: the Gaussian does not fade.
            let is_value = value.is_finite() || *name == "t_scale" && value > 0.0;
            tally.case(format!("{population}, {name} = {value:e}"), |tally| {
                n_drawn += usize::from(check(bench, tally, &all, index, &without, !is_value)?);
                Ok(())
            });
            n += 1;
        }
    }
    ensure!(n_drawn * 4 > n, "only {n_drawn} of {n} cases draw the poisoned Gaussian");
    Ok(())
}

pub(super) fn numbers(bench: &Bench, tally: &mut Tally) -> Result<()> {
    poison(bench, tally, "static", 2, &SLOTS)?;
    poison(bench, tally, "dynamic", 8, &SLOTS)?;
    poison(bench, tally, "dynamic", 8, &MOTION_SLOTS)?;
    cameras(bench, tally)
}

fn cameras(bench: &Bench, tally: &mut Tally) -> Result<()> {
    type ViewSlot = (&'static str, fn(&mut View) -> &mut f64);
    let slots: [ViewSlot; 12] = [
        ("fx", |view| &mut view.intrinsics.fx),
        ("fy", |view| &mut view.intrinsics.fy),
        ("cx", |view| &mut view.intrinsics.cx),
        ("cy", |view| &mut view.intrinsics.cy),
        ("rotation", |view| &mut view.pose.rotation.x_axis.x),
        ("rotation z", |view| &mut view.pose.rotation.y_axis.z),
        ("translation x", |view| &mut view.pose.translation.x),
        ("translation y", |view| &mut view.pose.translation.y),
        ("translation z", |view| &mut view.pose.translation.z),
        ("time", |view| &mut view.time),
        ("time_offset", |view| &mut view.time_offset),
        ("flow_dt", |view| &mut view.flow_dt),
    ];
    let splats = scene(62, 40, 1);
    let (whole, report) = bench.render(&splats, &pose())?;
    ensure!(report.visible > 10 && whole.alpha.iter().any(|alpha| *alpha > 0.5), "little shows: {report:?}");
    for (name, slot) in slots {
        for value in NOT_FINITE.into_iter().chain(EXTREME).map(f64::from).chain([1e300, -1e300, 1e-300]) {
            let mut view = pose();
            *slot(&mut view) = value;
            tally.case(format!("{name} = {value:e}"), |_| check_finite(&bench.render(&splats, &view)?.0));
        }
    }
    Ok(())
}
