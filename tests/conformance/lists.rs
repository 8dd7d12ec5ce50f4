//! N8 to N10: long lists, lists around the sizes at which something changes, and ties.

use super::adjoint::group_error;
use super::prelude::*;
use super::random;
use ivv::internals::stage::FrameReport;
use ivv::internals::vk::DeviceKind;

/// Entries that one round of blending walks, `SEGMENT` of the engine.
const SEGMENT: u64 = 32_768;

/// `n` Gaussians of that opacity one behind the other, flat over the picture.
fn chain(n: usize, opacity: f64) -> Splats {
    let one = |i| ball([0.0, 0.0, 2.0 + i as f32 / 65_536.0], 100.0, opacity, [0.2, 0.9, i as f64 / n as f64]);
    scene_of(&(0..n).map(one).collect::<Vec<_>>())
}

pub(super) fn chains(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let view = camera(3, 3);
    let lengths = [(2300, 0.004), (100_000, 1.02 / 255.0), (9, 0.6), (2, 0.98), (40, 0.2), (5, 0.999), (700, 0.0125)];
    for (n, opacity) in lengths {
        Case::new(format!("{n} x {opacity:.4}"), chain(n, opacity), view.clone())
            .tolerance(Tolerance { away: 1e-4, band: 1e-4, n_band: 1.0 })
            .check(|_, report| {
                ensure!(report.max_tile_list == n as u64, "a list of {}", report.max_tile_list);
                Ok(())
            })
            .run(bench, tally);
    }
    // (1 - 0.99)^2 is the floor of the transmittance itself: either both are added or one, and both passes do the same.
    tally.case("2 x 0.99, at the floor", |_| {
        let (splats, view) = (chain(2, 0.99), camera(1, 1));
        let (frame, _) = bench.render(&splats, &view)?;
        let (found, _) = bench.vjp(&splats, &view, &cotangents(4, &view, |_| false))?;
        let is_near = |alpha: f32| (frame.alpha[0] - alpha).abs() < 1e-6;
        ensure!(is_near(0.9999) || is_near(0.99), "alpha {}", frame.alpha[0]);
        let has_gradient = found.params.sh[1] != [0.0; 3];
        ensure!(has_gradient == is_near(0.9999), "alpha {}, a gradient: {has_gradient}", frame.alpha[0]);
        Ok(())
    });
    for (n, opacity) in [(2300, 0.0041), (9, 0.6), (2, 0.98), (40, 0.2), (700, 0.0125), (1500, 1.02 / 255.0)] {
        tally.case(format!("the gradient of {n} x {opacity:.4}"), |tally| {
            let splats = chain(n, opacity);
            let truth = render_f64(&splats, &view, &Constants::default());
            ensure!(truth.near_discontinuity.iter().all(|near| !near), "in the band");
            let cotangents = cotangents(4, &view, |_| false);
            let (found, _) = bench.vjp(&splats, &view, &cotangents)?;
            ensure!(found.n_bad == 0, "{} bad gradients", found.n_bad);
            for name in ["opacity", "sh"] {
                let error = group_error(&found, name, &splats, &view, &cotangents).unwrap_or(f64::NAN);
                tally.within(&format!("the gradient of {name}"), error, 1e-4)?;
            }
            Ok(())
        });
    }
    Ok(())
}

/// `n` Gaussians in one tile, each on about one pixel with an alpha of a little over 1/255, so that none saturates.
fn dust(n: usize) -> Vec<One> {
    let mut random = Random::new(n as u64);
    (0..n)
        .map(|i| {
            // Depths on a grid of 2^-16, no two equal; pixels are 1/64 of the depth.
            let z = 2.0 + ((i * 7919) % n) as f32 / 65_536.0;
            let [x, y] = [0, 1].map(|_| random.uniform(-7.9, 7.9) as f32 / 64.0 * z);
            let color = std::array::from_fn(|_| random.uniform(0.0, 1.0));
            ball([x, y, z], 1e-4, random.uniform(1.1, 1.5) / 255.0, color)
        })
        .collect()
}

pub(super) fn overlaps(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let view = camera(16, 16);
    // A GPU walks long lists in chunks, not in rounds.
    let has_rounds = bench.gpu().caps().kind == DeviceKind::Cpu;
    // A subgroup's width, a sort block, a round of blending.
    for n in [1, 3, 4, 5, 7, 8, 9, 31, 32, 33, 63, 64, 65, 255, 256, 257, 2049, 40_000, 100_000] {
        tally.case(format!("{n} in a tile"), |tally| {
            let splats = scene_of(&dust(n));
            let (frame, report) = bench.render(&splats, &view)?;
            let longest = report.max_tile_list;
            ensure!(longest > n as u64 * 9 / 10 || n < 100 && longest > 0, "a list of {longest}");
            ensure!((report.replays > 0) == (has_rounds && longest > SEGMENT), "{report:?}");
            let truth = render_f64(&splats, &view, &Constants::default());
            let n_added = truth.n_contributing.iter().sum::<u32>();
            ensure!(n_added as usize > n / 4 || n < 10, "only {n_added} contributions");
            let full = truth.alpha.iter().filter(|alpha| **alpha > 0.999).count();
            ensure!(full == 0, "{full} pixels are finished before the last entry");
            // A position's rounding decides whether such faint Gaussians contribute: 1/255 of the frame each.
            tally.frame(&frame, &truth, &Tolerance { band: 0.05, n_band: 0.3, ..Tolerance::default() })
        });
    }
    nothing(bench, tally);
    for (name, velocity) in [("static", None), ("dynamic", Some([1.0, 0.0, 0.0]))] {
        let motion = velocity.map(|velocity| Motion { velocity, t_center: 0.5, t_scale: 0.0 });
        let splats = scene_of(&[One { motion, ..ball([0.0, 0.0, 3.0], 0.1, 0.9, [1.0, 0.5, 0.0]) }]);
        let check = |_: &_, report: &FrameReport| {
            ensure!((report.active, report.visible) == (1, 1), "{report:?}");
            Ok(())
        };
        Case::new(format!("a single {name} Gaussian"), splats, camera(33, 17)).check(check).run(bench, tally);
    }
    Ok(())
}

/// An empty scene, and one behind the camera, show the background exactly.
fn nothing(bench: &Bench, tally: &mut Tally) {
    let view = camera(33, 17);
    let behind = scene_of(&[ball([0.0, 0.0, -3.0], 0.1, 0.9, [1.0; 3]), ball([0.0, 0.0, 0.0], 0.1, 0.9, [1.0; 3])]);
    let empty = (0..=3).map(|degree| (format!("an empty scene of degree {degree}"), Splats::new(degree)));
    for (name, splats) in empty.chain([("a scene behind the camera".to_owned(), behind)]) {
        tally.case(name, |_| {
            let (frame, report) = bench.render(&splats, &view)?;
            let counts = [report.active, report.intersections, report.bad_gaussians];
            ensure!(counts == [0; 3] && (report.replays, report.strips) == (0, 1), "{report:?}");
            ensure!(frame.color.len() == 33 * 17 && frame.color.iter().all(|c| *c == view.background), "a colour");
            let mut rest = frame.alpha.iter().chain(&frame.depth).chain(&frame.inverse_depth);
            ensure!(rest.all(|x| *x == 0.0) && frame.flow.as_flattened().iter().all(|x| *x == 0.0), "an output");
            Ok(())
        });
    }
}

fn shuffled(mut items: Vec<One>, random: &mut Random) -> Vec<One> {
    for i in (1..items.len()).rev() {
        items.swap(i, random.bits() as usize % (i + 1));
    }
    items
}

pub(super) fn ties(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let mut random = Random::new(42);
    let all: Vec<One> = (0..1000)
        .map(|i| {
            let [x, y] = random.vector(-1.0, 1.0);
            let color = std::array::from_fn(|_| random.uniform(0.0, 1.0));
            let one = ball([x, y, 4.0], random.uniform(0.03, 0.1), random.uniform(0.1, 0.9), color);
            let motion = Motion { velocity: [0.25, 0.0, 0.0], t_center: 0.5, t_scale: 0.0 };
            One { motion: (i >= 500).then_some(motion), ..one }
        })
        .collect();
    let view = camera(48, 32);
    let mut frames = Vec::new();
    for (name, all) in [("in order", all.clone()), ("shuffled", shuffled(all, &mut random))] {
        let splats = scene_of(&all);
        // Saturated pixels end where rounding says.
        Case::new(format!("1000 of one depth, {name}"), splats.clone(), view.clone())
            .tolerance(Tolerance { n_band: 0.3, ..Tolerance::default() })
            .run(bench, tally);
        frames.push(bits(&bench.render(&splats, &view)?.0));
    }
    ensure!(frames[0] != frames[1], "the order of equal depths cannot be seen");
    let splats = scene(41, 200, 1);
    let view = random::view();
    let first = bits(&bench.render(&splats, &view)?.0);
    for turn in 0..3 {
        tally.case(format!("200 of different depths, shuffled for time {turn}"), |_| {
            // Static ones stay before dynamic ones; all depths of a random scene differ.
            let other = scene_of(&shuffled(ones(&splats), &mut random));
            ensure!(other.position != splats.position, "the order is the same");
            ensure!(bits(&bench.render(&other, &view)?.0) == first, "other bits");
            Ok(())
        });
    }
    Ok(())
}
