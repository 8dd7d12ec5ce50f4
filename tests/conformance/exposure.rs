//! N7 and N19: opacities and colours.

use super::prelude::*;

/// `x` moved by `n` units in the last place.
fn moved(x: f32, n: i32) -> f32 {
    (0..n.abs()).fold(x, |x, _| if n > 0 { x.next_up() } else { x.next_down() })
}

const ULPS: [i32; 11] = [-100, -8, -3, -2, -1, 0, 1, 2, 3, 8, 100];

pub(super) fn opacities(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let most = ULPS.map(|n| moved(logit(0.99), n));
    let ordinary = [-90.0, -20.0, -6.0, -5.54, 0.0, 5.0, 20.0, 90.0].into_iter().chain(most);
    for opacity in ordinary {
        exposed(opacity, 1e-5).run(bench, tally);
    }
    // At alpha_min either side is right, and nothing between: 1/255 of the light before the backdrop, or none.
    for n in ULPS {
        let is_either = |alpha: f32| [0.5, 0.5 + 0.5 / 255.0].iter().any(|x| (alpha - x).abs() < 1e-6);
        let check = move |frame: &Frame, _: &_| {
            ensure!(frame.alpha.iter().all(|a| is_either(*a)), "alpha {:?}", frame.alpha);
            Ok(())
        };
        exposed(moved(logit(1.0 / 255.0), n), 0.01).check(check).run(bench, tally);
        both_passes_agree(bench, tally, moved(logit(1.0 / 255.0), n));
    }
    for (n, is_added) in [(-1000, false), (1000, true)] {
        let check = move |frame: &Frame, _: &_| {
            ensure!((frame.alpha[0] > 0.501) == is_added, "alpha {:?}", frame.alpha);
            Ok(())
        };
        exposed(moved(logit(1.0 / 255.0), n), 1e-5).check(check).run(bench, tally);
    }
    clamped(bench, tally)
}

/// A Gaussian of that logit, flat over the picture, and an ordinary one behind it.
fn before_another(opacity: f32) -> [One; 2] {
    let one = One { opacity, ..ball([0.0, 0.0, 4.0], 1e3, 0.5, [0.1, 0.6, 0.9]) };
    [one, ball([0.0, 0.0, 6.0], 1e3, 0.5, [0.9, 0.3, 0.1])]
}

fn exposed(opacity: f32, band: f64) -> Case<'static> {
    let tolerance = Tolerance { band, n_band: 1.0, ..Tolerance::default() };
    Case::new(format!("opacity {opacity}"), scene_of(&before_another(opacity)), camera(5, 3)).tolerance(tolerance)
}

/// In a picture of one pixel, what the forward pass adds has a gradient and what it does not has none.
fn both_passes_agree(bench: &Bench, tally: &mut Tally, opacity: f32) {
    tally.case(format!("opacity {opacity}, forward and backward"), |_| {
        let (splats, view) = (scene_of(&before_another(opacity)), camera(1, 1));
        let (frame, _) = bench.render(&splats, &view)?;
        let (found, _) = bench.vjp(&splats, &view, &cotangents(4, &view, |_| false))?;
        let (is_added, has_gradient) = (frame.alpha[0] > 0.501, found.params.sh[0] != [0.0; 3]);
        ensure!(is_added == has_gradient, "added: {is_added}, a gradient: {has_gradient}");
        ensure!(found.params.sh[1] != [0.0; 3], "the Gaussian behind has no gradient");
        Ok(())
    });
}

/// An alpha at its clamp has no gradient, one below has the truth's.
fn clamped(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let view = camera(5, 3);
    let cotangents = cotangents(3, &view, |_| false);
    let most = logit(0.99);
    let mut seen = [0, 0];
    for opacity in [-90.0, -20.0, -6.0, -5.0, 0.0, 4.0, most - 1e-4, most, most + 1e-4, 5.0, 20.0, 90.0] {
        let held = opacity >= most + 1e-4 || opacity <= -6.0;
        let free = opacity <= most - 1e-4 && opacity >= -5.0;
        seen = [seen[0] + usize::from(held), seen[1] + usize::from(free)];
        tally.case(format!("the gradient at opacity {opacity}"), |tally| {
            let splats = scene_of(&before_another(opacity));
            let (found, _) = bench.vjp(&splats, &view, &cotangents)?;
            ensure!(found.n_bad == 0 && is_finite(&found) && found.params.opacity[1] != 0.0, "{} bad", found.n_bad);
            let of_opacity = found.params.opacity[0];
            ensure!(!held || of_opacity == 0.0, "{of_opacity} where it is held");
            let of_shape = (found.params.scale[0], found.params.rotation[0]);
            ensure!(!held || of_shape == ([0.0; 3], [0.0; 4]), "{of_shape:?} of its shape");
            ensure!(!free || of_opacity != 0.0, "none");
            // What is held at its clamp still has a colour.
            ensure!(opacity < -5.5 || found.params.sh[0] != [0.0; 3], "none of the colour");
            if free {
                tally.within("a gradient", check_adjoint(bench, &splats, &view, &cotangents, 1e-4, 2)?, 1e-4)?;
            }
            Ok(())
        });
    }
    ensure!(seen == [7, 4], "{seen:?} opacities are held and free");
    Ok(())
}

pub(super) fn colors(bench: &Bench, tally: &mut Tally) -> Result<()> {
    for sh_degree in 0..=3usize {
        for size in [1.0, 1e3] {
            let mut random = Random::new(sh_degree as u64);
            let all = (0..30).map(|_| {
                let [x, y] = random.vector(-1.0, 1.0);
                let mut one = ball([x, y, random.uniform(3.0, 5.0) as f32], 0.1, 0.6, [0.0; 3]);
                one.sh = (0..(sh_degree + 1).pow(2)).map(|_| random.vector(-size, size)).collect();
                one
            });
            let scene = scene_of(&all.collect::<Vec<_>>());
            let check = |frame: &Frame, _: &_| {
                ensure!(frame.color.as_flattened().iter().all(|c| *c >= 0.0), "a negative colour");
                Ok(())
            };
            let name = format!("degree {sh_degree}, coefficients to {size}");
            Case::new(name, scene, camera(48, 32)).check(check).run(bench, tally);
        }
    }
    for value in [-1.8, -10.0, -1e3, -1e30] {
        black(bench, tally, value);
    }
    for value in [1.8, 10.0, 1e3] {
        bright(bench, tally, value);
    }
    Ok(())
}

fn of_coefficient(value: f32) -> Splats {
    scene_of(&[One { sh: vec![[value; 3]], ..ball([0.0, 0.0, 4.0], 0.5, 0.9, [0.0; 3]) }])
}

/// Below 0 in every channel: black, whatever the amount, and without a gradient of the colour.
fn black(bench: &Bench, tally: &mut Tally, value: f32) {
    let (splats, view) = (of_coefficient(value), camera(48, 32));
    let check = |frame: &Frame, _: &_| {
        let is_black = |(color, alpha): (&[f32; 3], &f32)| {
            (0..3).all(|k| (color[k] - (1.0 - alpha) * view.background[k]).abs() <= 1e-6)
        };
        ensure!(frame.color.iter().zip(&frame.alpha).all(is_black), "not black");
        let (found, _) = bench.vjp(&splats, &view, &cotangents(9, &view, |_| false))?;
        ensure!(found.params.sh[0] == [0.0; 3], "a gradient of {:?}", found.params.sh[0]);
        ensure!(found.params.opacity[0] != 0.0, "no gradient of its opacity");
        Ok(())
    };
    Case::new(format!("coefficient {value:e}"), splats.clone(), view.clone()).check(check).run(bench, tally);
}

/// Above 1 nothing is held: the gradient is that of any colour.
fn bright(bench: &Bench, tally: &mut Tally, value: f32) {
    tally.case(format!("the gradient of coefficient {value:e}"), |_| {
        let view = camera(48, 32);
        let cotangents = cotangents(9, &view, |_| false);
        let of = |value| bench.vjp(&of_coefficient(value), &view, &cotangents).map(|(found, _)| found.params.sh[0]);
        let (found, plain) = (of(value)?, of(0.5)?);
        ensure!(found == plain && found != [0.0; 3], "{found:?}, and {plain:?} of a colour between 0 and 1");
        Ok(())
    });
}
