//! N2 to N4: sizes, needles and quaternions.

use super::adjoint::dot;
use super::prelude::*;

/// Pixels per scene unit at depth 4 of `one::camera`.
const PIXELS: f64 = 16.0;

pub(super) fn scales(bench: &Bench, tally: &mut Tally) -> Result<()> {
    for scale in [-30.0f32, -15.0, -5.0, 0.0, 5.0, 10.0, 20.0, 40.0] {
        for n_axes in 1..=3 {
            let mut one = ball([0.2, 0.1, 4.0], 0.1, 0.88, [0.1, 0.6, 0.9]);
            one.rotation = [0.7, -0.2, 0.4, 0.1];
            one.scale[..n_axes].fill(scale);
            let name = format!("{n_axes} axes of e^{scale}");
            Case::new(name, scene_of(&[one, backdrop()]), camera(48, 32)).run(bench, tally);
        }
    }
    Ok(())
}

pub(super) fn needles(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let view = camera(64, 48);
    for major in [0.01, 0.1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5] {
        let mut random = Random::new(major as u64);
        let mut all = vec![backdrop()];
        for i in 0..8 {
            let [x, y] = [random.uniform(8.0, 56.0), random.uniform(8.0, 40.0)];
            let mut one = ball(at_pixel(&view, x, y, 4.0 + f64::from(i) / 8.0), 1e-4, 0.8, [0.2, 0.9, 0.5]);
            one.scale[(random.bits() % 3) as usize] = (major / PIXELS).ln() as f32;
            one.rotation = random.vector(-1.0, 1.0);
            all.push(one);
        }
        // Along a needle of any length its line is as straight as f32 angles: 1e-7 of the distance from the centre.
        let away = if major < 1e3 { 1e-5 } else { 5e-5 };
        let tolerance = Tolerance { away, ..Tolerance::default() };
        Case::new(format!("{major} px"), scene_of(&all), view.clone()).tolerance(tolerance).run(bench, tally);
    }
    Ok(())
}

/// A Gaussian of unequal axes and that quaternion, before the backdrop.
fn turned(rotation: [f32; 4], deviation: f64, long: f32) -> [One; 2] {
    let mut one = ball([0.1, -0.1, 4.0], deviation, 0.9, [0.1, 0.6, 0.9]);
    one.scale[1] = long;
    [One { rotation, ..one }, backdrop()]
}

pub(super) fn quaternions(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let view = camera(48, 32);
    let q = [0.8f32, 0.0, -0.48, 0.36];
    let scene = |length: f32| scene_of(&turned(q.map(|x| x * length), 0.02, -0.5));
    for length in [1e-30, 1e-20, 1e-10, 1.0, 1e10, 1e19, 1e20, 3e38] {
        let case = Case::new(format!("length {length:e}"), scene(length), view.clone());
        Case { truth: Some(scene(1.0)), ..case }.run(bench, tally);
    }
    let tolerance = Tolerance { band: 1e-5, ..Tolerance::default() };
    Case { n_bad: 1, tolerance, ..Case::new("length 0", scene(0.0), view.clone()) }.run(bench, tally);

    let scene = |length: f32| scene_of(&turned(q.map(|x| x * length), 0.05, -1.0));
    let cotangents = cotangents(1, &view, |_| false);
    let (unit, _) = bench.vjp(&scene(1.0), &view, &cotangents)?;
    let unit = unit.params.rotation[0].map(f64::from);
    let norm = dot(&unit, &unit).sqrt();
    ensure!(norm > 1e-2, "a quaternion of length 1 has no gradient");
    for length in [1e-20f32, 1e-10, 1e-3, 1.0, 1e3, 1e10, 1e19, 1e20] {
        tally.case(format!("the gradient at length {length:e}"), |tally| {
            let splats = scene(length);
            let (found, _) = bench.vjp(&splats, &view, &cotangents)?;
            ensure!(found.n_bad == 0 && is_finite(&found), "{} bad", found.n_bad);
            let (q, g) = (splats.rotation[0].map(f64::from), found.params.rotation[0].map(f64::from));
            let along = dot(&q, &g).abs() / (dot(&q, &q).sqrt() * dot(&g, &g).sqrt());
            tally.within("the part along q", along, 1e-5)?;
            let difference: Vec<f64> = g.iter().zip(&unit).map(|(a, b)| a * f64::from(length) - b).collect();
            tally.within("length times the gradient", dot(&difference, &difference).sqrt() / norm, 1e-5)
        });
    }
    Ok(())
}
