//! N11 to N14: time, fading and motion.

use super::adjoint::{self, flat};
use super::prelude::*;
use super::random;
use ivv::internals::train::{Config, LearningRates, Setup, Trainer};

/// A Gaussian of base opacity 0.99, visible for u = |t - t_center| / tau up to 2.352.
fn fading(t_center: f32, t_scale: f32) -> One {
    let motion = Motion { velocity: [0.0; 3], t_center, t_scale };
    One { motion: Some(motion), ..ball([0.0, 0.0, 4.0], 3.0, 0.99, [0.1, 0.6, 0.9]) }
}

/// A Gaussian before the backdrop, over the whole picture, that fades, and while it does moves by 0.1 units at most.
fn fading_and_moving(t_center: f32, t_scale: f32) -> Splats {
    let speed = (-f64::from(t_scale)).exp().min(1.0) as f32;
    let motion = Motion { velocity: [0.1 * speed, 0.0, 0.0], t_center, t_scale };
    let one = ball([0.0, 0.0, 4.0], 3.0, 0.95, [0.1, 0.6, 0.9]);
    let [mut one, mut backdrop] = [One { motion: Some(motion), ..one }, backdrop()];
    (one.scale[0], backdrop.scale[1]) = (0.3, -1.0);
    scene_of(&[backdrop, one])
}

pub(super) fn distances(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let times = [0.0, 1e-20, 0.707, 1.0, 2.35, 2.36, 9.3, 9.4, 16.0, 1e10, 1e19, 1e30];
    for t_scale in [-18.42f32, 0.0, 9.21] {
        for u in times {
            let view = View { time: u * f64::from(t_scale).exp(), ..camera(48, 32) };
            let gone = u > 2.355;
            let shown = view.clone();
            let scene = scene_of(&[fading(0.0, t_scale), backdrop()]);
            Case::new(format!("u = {u:e}, log tau = {t_scale}"), scene, view)
                // exp is good to 3 + 2|x| ULP (A.1): of log tau, and of u^2, which doubles the error of u.
                .tolerance(Tolerance { away: 3e-5, ..Tolerance::default() })
                .check(|frame, _| {
                    let same = bits(frame) == bits(&bench.render(&scene_of(&[backdrop()]), &shown)?.0);
                    ensure!(same == gone, "gone: {same}, but {gone} is right");
                    Ok(())
                })
                .run(bench, tally);
        }
        for u in times.map(|u| if u == 2.35 { 2.3 } else { u }) {
            tally.case(format!("the gradient at u = {u:e}, log tau = {t_scale}"), |tally| {
                distant_gradient(bench, tally, u, t_scale)
            });
        }
    }
    Ok(())
}

/// The truth's gradient, and exactly none past the cut.
fn distant_gradient(bench: &Bench, tally: &mut Tally, u: f64, t_scale: f32) -> Result<()> {
    let view = View { time: u * f64::from(t_scale).exp(), ..camera(24, 16) };
    let splats = fading_and_moving(0.0, t_scale);
    let cotangents = cotangents(5, &view, |_| false);
    let (found, report) = bench.vjp(&splats, &view, &cotangents)?;
    ensure!(found.n_bad == 0 && report.intersections > 0 && is_finite(&found), "{} bad", found.n_bad);
    if u > 2.355 {
        let motion = found.motion(1);
        let of_time = [motion.t_center, motion.t_scale] == [0.0; 2] && found.time_offset == 0.0;
        let of_place = found.params.position[1] == [0.0; 3] && motion.velocity == [0.0; 3];
        ensure!(of_time && of_place, "a gradient past the cut: {motion:?}");
        return Ok(());
    }
    // The gradient of log tau goes with u^2: for u = 1e-20 it is denormal, which drivers may flush to zero. The rest is
    // then that of u = 0.
    if u > 0.0 && u < 1e-15 && flat(&found, "t_scale").iter().all(|x| *x == 0.0) {
        return Ok(());
    }
    let least = if u == 0.0 { 8 } else { 9 };
    tally.within("a gradient", check_adjoint(bench, &splats, &view, &cotangents, 1e-4, least)?, 1e-4)
}

/// Cotangents of `alpha` alone, all 1.
fn of_alpha(view: &View) -> Frame {
    let zero = cotangents(0, view, |_| true);
    Frame { alpha: vec![1.0; zero.alpha.len()], ..zero }
}

pub(super) fn time_scales(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let half_frame = (0.5f64 / 300.0).ln() as f32;
    for t_scale in [half_frame, -18.42, -60.0, -80.0, 0.0, 9.21, 60.0, 88.0, 100.0, 1e38, f32::INFINITY] {
        // At its centre, and 0.25 away, where only tau above 0.1 still shows it.
        for t_center in [0.5, 0.25] {
            let all = [fading(t_center, t_scale), backdrop()];
            let name = format!("log tau = {t_scale:e}, centre {t_center}");
            Case::new(name, scene_of(&all), camera(48, 32)).run(bench, tally);
        }
    }
    // exp(-t_scale) overflows below -88.7, and 0 * infinity is no number.
    for t_scale in [-80.0, -87.0, -89.0, -100.0, -600.0f32] {
        let motion = Motion { velocity: [0.0; 3], t_center: 0.5, t_scale };
        let all = [One { motion: Some(motion), ..ball([0.0, 0.0, 4.0], 0.3, 0.9, [0.5; 3]) }];
        let tolerance = Tolerance { n_band: 0.5, ..Tolerance::default() };
        let name = format!("log tau = {t_scale}, at its own time");
        Case::new(name, scene_of(&all), camera(24, 16)).tolerance(tolerance).run(bench, tally);
    }
    static_is_a_special_case_of_dynamic(bench, tally)?;

    let mut largest = 0.0f64;
    for t_scale in [half_frame, -18.42, -60.0, -80.0, -1.0, 0.0, 9.21, 60.0, 88.0, 100.0, 1e38, f32::INFINITY] {
        for u in [0.0, 0.5, 1.0, 1.5, 2.2] {
            tally.case(format!("the gradient at log tau = {t_scale:e}, u = {u}"), |_| {
                let view = camera(24, 16);
                let t_center = (0.5 - u * f64::from(t_scale.min(9.0)).exp()) as f32;
                let splats = fading_and_moving(t_center, t_scale);
                let (found, _) = bench.vjp(&splats, &view, &of_alpha(&view))?;
                ensure!(found.n_bad == 0 && is_finite(&found), "{} bad", found.n_bad);
                // The backdrop hides nothing before it: of opacity o and weight e^-u^2 each pixel has at most the share o.
                let bound = 0.736 * 0.95 * f64::from(view.intrinsics.width * view.intrinsics.height);
                let slope = f64::from(found.motion(1).t_scale.abs());
                ensure!(slope <= bound, "{slope} by log tau, {bound} is allowed");
                largest = largest.max(slope / bound);
                ensure!(t_scale <= 90.0 || slope == 0.0, "infinite tau has a gradient");
                Ok(())
            });
        }
    }
    ensure!(largest > 0.3, "the bound of the gradient is never near: {largest}");
    Ok(())
}

/// Without velocity and with infinite tau, bit for bit.
fn static_is_a_special_case_of_dynamic(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let view = random::view();
    for sh_degree in 0..=3 {
        let splats = Splats { n_static: 100, motion: vec![], ..random::scene(21, 100, sh_degree) };
        let (fixed, _) = bench.render(&splats, &view)?;
        ensure!(4 * fixed.alpha.iter().filter(|alpha| **alpha > 0.1).count() > fixed.alpha.len(), "little shows");
        for t_center in [0.0, 0.4, 1e5] {
            tally.case(format!("static and dynamic, degree {sh_degree}, t_center {t_center}"), |_| {
                let motion = Motion { velocity: [0.0; 3], t_center, t_scale: f32::INFINITY };
                let moving = Splats { n_static: 0, motion: vec![motion; 100], ..splats.clone() };
                let (moving, report) = bench.render(&moving, &view)?;
                ensure!(report.bad_gaussians == 0 && bits(&fixed) == bits(&moving), "other bits, {report:?}");
                Ok(())
            });
        }
    }
    Ok(())
}

/// Gaussians whose times lie on a grid of 1/128, which f32 holds up to 1e5 and beyond, and a view of them.
fn clip(origin: f64) -> (Splats, View) {
    let mut random = Random::new(13);
    let one = |_| {
        let grid = (random.bits() % 128) as f64 / 128.0;
        let motion = Motion {
            velocity: random.vector(-1.0, 1.0),
            t_center: (origin + grid) as f32,
            t_scale: random.uniform(-2.0, 1.0) as f32,
        };
        let [x, y] = random.vector(-1.0, 1.0);
        One { motion: Some(motion), ..ball([x, y, 4.0], 0.15, 0.8, [0.3, 0.6, 0.1]) }
    };
    (scene_of(&(0..30).map(one).collect::<Vec<_>>()), View { time: origin + 0.5, ..camera(48, 32) })
}

pub(super) fn origins(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let gradients = |origin: f64| {
        let (splats, view) = clip(origin);
        bench.vjp(&splats, &view, &cotangents(6, &view, |_| false)).map(|(found, _)| adjoint::bits(&found))
    };
    let (splats, view) = clip(0.0);
    let (frame, gradient) = (bits(&bench.render(&splats, &view)?.0), gradients(0.0)?);
    ensure!(gradient.iter().filter(|x| f64::from_bits(**x) != 0.0).count() > 300, "few numbers have a gradient");
    for origin in [0.0, 300.0, 18_000.0, 1e5] {
        let (splats, view) = clip(origin);
        Case::new(format!("time {origin}"), splats, view)
            .tolerance(Tolerance { n_band: 0.2, ..Tolerance::default() })
            .check(|found, _| {
                ensure!(bits(found) == frame, "not the bits of the clip at time 0");
                ensure!(gradients(origin)? == gradient, "not the gradient's bits of the clip at time 0");
                Ok(())
            })
            .run(bench, tally);
    }
    for n_frames in [10.0, 300.0, 18_000.0] {
        tally.case(format!("100 steps in a clip of {n_frames} frames"), |_| {
            let moved = moved(&hundred_steps(bench, 0.0, 1.0 / n_frames)?.0, 0.0);
            ensure!(moved > 1e-4 && moved < 0.1, "t_center moved by {moved} in all");
            Ok(())
        });
    }
    let (at_zero, first) = hundred_steps(bench, 0.0, 1.0 / 300.0)?;
    for origin in [1.0, 300.0] {
        tally.case(format!("100 steps from time {origin}"), |tally| {
            let (end, frame) = hundred_steps(bench, origin, 1.0 / 300.0)?;
            let (found, expected) = (moved(&end, origin), moved(&at_zero, 0.0));
            ensure!(found > 0.5 * expected, "t_center moved by {found} in all, at time 0 by {expected}");
            // t_center has an ulp of 3e-5 at 300 clips; what it loses is kept for its own steps but not for the picture.
            let bound = if origin < 2.0 { 3e-5 } else { 3e-3 };
            tally.within("the picture against that of time 0", rms(&frame, &first), bound)
        });
    }
    Ok(())
}

/// The sum of all changes of t_center since [`hundred_steps`] began.
fn moved(end: &Splats, origin: f64) -> f64 {
    end.motion.iter().map(|m| (f64::from(m.t_center) - (origin + 0.375)).abs()).sum()
}

/// Trains on noise, in a clip that starts at `origin`; the Gaussians and their picture at the end.
fn hundred_steps(bench: &Bench, origin: f64, frame_dt: f64) -> Result<(Splats, Frame)> {
    let mut splats = random::scene(5, 60, 0);
    for motion in &mut splats.motion {
        (motion.t_center, motion.t_scale) = ((origin + 0.375) as f32, -1.0);
    }
    let view = View { time: origin + 0.375, time_offset: 0.0, flow_dt: frame_dt, ..random::small_view() };
    // Large Gaussians that move at the pace of their size carry the rounding of t_center further than it goes by itself.
    let lr = LearningRates { position_size: 0.0, ..LearningRates::default() };
    let config = Config { sh_degree: 0, lr, ..Config::default().with_preset("exact").expect("a preset of the engine") };
    let extent = Extent { center: [0.0; 3], radius: 4.0 };
    let gpu = bench.gpu();
    let setup = Setup::plain(extent, frame_dt);
    let mut trainer = Trainer::new(Arc::clone(&gpu), &splats, Constants::default(), config, 10_000, setup)?;
    for step in 0..100 {
        trainer.train(0, &view, &noise(step, &view))?;
    }
    let end = trainer.splats()?;
    let (frame, _) = bench.render(&end, &view)?;
    Ok((end, frame))
}

pub(super) fn velocities(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let case = |velocity: [f32; 3]| {
        let motion = Motion { velocity, t_center: 0.5, t_scale: 0.0 };
        let all = [One { motion: Some(motion), ..ball([0.1, 0.0, 4.0], 0.3, 0.8, [0.1, 0.6, 0.9]) }, backdrop()];
        Case::new(format!("velocity {velocity:?}"), scene_of(&all), camera(48, 32))
    };
    let finite =
        [[0.0; 3], [-0.0; 3], [1e-12, -1e-12, 0.0], [1e-30, 0.0, 0.0], [1e3, -5e2, 2e2], [0.0, 0.0, 1e3], [1e30; 3]];
    for velocity in finite {
        case(velocity).run(bench, tally);
    }
    for velocity in [[f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0], [0.0, 0.0, f32::NEG_INFINITY]] {
        Case { n_bad: 1, ..case(velocity) }.run(bench, tally);
    }
    Ok(())
}
