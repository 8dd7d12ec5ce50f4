//! N5, N6, N17, N18: where Gaussians are, and the picture they are on.

use super::prelude::*;
use ivv::Error;
use ivv::internals::scene::Intrinsics;
use ivv::internals::stage::{Outputs, Renderer};

pub(super) fn depths(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let near = Constants::default().near;
    let kept = [near.next_up(), 0.011, 0.2, 1.0, 1e2, 1e4, 1e6].map(|z| (z, true));
    let dropped = [near.next_down(), near, 0.0, -1.0, -1e6].map(|z| (z, false));
    for (z, kept) in kept.into_iter().chain(dropped) {
        let size = f64::from(z.abs().max(near));
        let one = ball([0.05 * size as f32, 0.0, z], 0.05 * size, 0.8, [0.1, 0.6, 0.9]);
        let other = ball([-0.3, 0.1, 3.0], 0.2, 0.7, [0.9, 0.3, 0.1]);
        Case::new(format!("z = {z:e}"), scene_of(&[one, other]), camera(48, 32))
            // The predicate is exact for a camera at the origin, so the band is as exact as the rest.
            .tolerance(Tolerance { band: 1e-5, n_band: 1.0, ..Tolerance::default() })
            .check(|_, report| {
                ensure!(report.visible == 1 + u64::from(kept), "{} visible Gaussians", report.visible);
                Ok(())
            })
            .run(bench, tally);
    }
    let view = camera(33, 25);
    for z in [near.next_up(), 0.010_01, 0.011, 0.2, 1.0, 1e2, 1e4, 1e6] {
        tally.case(format!("the gradient at z = {z:e}"), |tally| {
            // Three pixels wide wherever it is, and not quite on the axis.
            let [x, y, _] = at_pixel(&view, 18.3, 11.6, f64::from(z));
            let mut one = ball([x, y, z], 3.0 / 64.0 * f64::from(z), 0.7, [0.1, 0.6, 0.9]);
            one.scale[0] += 0.7;
            one.rotation = [0.7, -0.2, 0.4, 0.1];
            let motion = Motion { velocity: [0.3 * z, -0.2 * z, 0.0], t_center: 0.45, t_scale: -1.0 };
            let splats = scene_of(&[One { motion: Some(motion), ..one }]);
            let truth = render_f64(&splats, &view, &Constants::default());
            ensure!(truth.alpha.iter().any(|alpha| *alpha > 0.1), "the truth shows nothing");
            // Next to the near plane every pixel is in the band, but the depth of a camera at the origin is exact.
            let by_alpha = |i: usize| (truth.alpha[i] * 255.0 - 1.0).abs() < 0.05 || truth.alpha[i] == 0.0;
            let cotangents = cotangents(2, &view, by_alpha);
            tally.within("a gradient", check_adjoint(bench, &splats, &view, &cotangents, 1e-5, 9)?, 1e-5)
        });
    }
    Ok(())
}

pub(super) fn centres(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let view = camera(48, 32);
    // Depth 4 and focal length 64: every pixel position on a grid of 2^-20 is exact.
    let ulp = f64::from(f32::EPSILON) * 2.0;
    for (name, shift) in [("on borders", 0.0), ("1 ulp above", ulp), ("1 ulp below", -ulp), ("half a pixel on", 0.25)] {
        let mut all = Vec::new();
        for x in [0.0, 0.5, 15.5, 16.0, 16.5, 31.5, 32.0, 47.5, 48.0] {
            for y in [0.0, 0.5, 15.5, 16.0, 16.5, 31.5, 32.0] {
                let z = 4.0 + all.len() as f64 / 64.0;
                let [px, py, _] = at_pixel(&view, x + shift * 16.0, y - shift * 16.0, 4.0);
                let turned = [px * (z / 4.0) as f32, py * (z / 4.0) as f32, z as f32];
                all.push(ball(turned, 1e-3, 0.5, [0.2, 0.9, 0.5]));
            }
        }
        Case::new(name, scene_of(&all), view.clone()).run(bench, tally);
    }
    // Each corner of the picture alone, with nothing else to hide what is missing.
    for (x, y) in [(0.0, 0.0), (48.0, 0.0), (0.0, 32.0), (48.0, 32.0)] {
        let one = ball(at_pixel(&view, x, y, 4.0), 0.05, 0.8, [0.2, 0.9, 0.5]);
        Case::new(format!("the corner ({x}, {y})"), scene_of(&[one]), view.clone()).run(bench, tally);
    }
    for distance in [1e3, 1e4, 1e5, 1e6] {
        for (dx, dy) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.7, 0.7)] {
            // Reaches into the picture at about half of the opacity, and with its faint end.
            for deviation in [0.8, 0.4] {
                let position = at_pixel(&view, 24.0 + dx * distance, 16.0 + dy * distance, 4.0);
                let one = ball(position, deviation * distance / 16.0, 0.8, [0.2, 0.9, 0.5]);
                let name = format!("{distance:e} px away, ({dx}, {dy}), of deviation {deviation}");
                let tolerance = Tolerance { away: 2e-5, ..Tolerance::default() };
                Case::new(name, scene_of(&[one]), view.clone()).tolerance(tolerance).run(bench, tally);
            }
        }
    }
    Ok(())
}

/// Gaussians of 0.7 to 5 px all over the picture of `view`, a camera at the origin.
fn spread(view: &View, n: usize) -> Vec<One> {
    let mut random = Random::new(u64::from(view.intrinsics.width));
    let Intrinsics { width, height, fx, .. } = view.intrinsics;
    let one = |_| {
        let [x, y] = [width, height].map(|side| random.uniform(0.0, f64::from(side)));
        let z = random.uniform(2.0, 6.0);
        let color = std::array::from_fn(|_| random.uniform(0.0, 1.0));
        let mut one = ball(at_pixel(view, x, y, z), 1.0, random.uniform(0.2, 0.95), color);
        one.scale = std::array::from_fn(|_| (random.uniform(0.7, 5.0) * z / fx).ln() as f32);
        one.rotation = random.vector(-1.0, 1.0);
        one
    };
    (0..n).map(one).collect()
}

pub(super) fn fields_of_view(bench: &Bench, tally: &mut Tally) -> Result<()> {
    for degrees in [1.0, 60.0, 120.0, 179.0f64] {
        let focal = 24.0 / (degrees.to_radians() / 2.0).tan();
        let square = with(camera(48, 32), |of| (of.fx, of.fy) = (focal, focal));
        let narrow = with(square.clone(), |of| of.fy = 2.5 * focal);
        let outside = with(square.clone(), |of| (of.cx, of.cy) = (-40.0, 90.0));
        for (name, view) in [("", square), (", narrow in y", narrow), (", principal point outside", outside)] {
            Case::new(format!("{degrees} degrees{name}"), scene_of(&spread(&view, 30)), view)
                .tolerance(Tolerance { away: 3e-5, ..Tolerance::default() })
                .run(bench, tally);
        }
    }
    Ok(())
}

pub(super) fn image_sizes(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let sizes = [(1, 1), (1, 2048), (4080, 1), (4096, 1), (2, 3), (15, 17), (16, 16), (17, 15), (31, 33), (65_536, 1)];
    for (width, height) in sizes {
        let view = camera(width, height);
        Case::new(format!("{width} x {height}"), scene_of(&spread(&view, 40)), view)
            // The pixel positions of long pictures have few bits left for their fractions.
            .tolerance(Tolerance { away: 2e-5, n_band: 0.3, ..Tolerance::default() })
            .run(bench, tally);
    }
    tally.case("a row of tiles that no binding holds", |_| {
        let gpu = bench.gpu();
        let most = gpu.caps().max_binding_bytes;
        let width = u32::try_from(most / (16 * 16) + 1).unwrap_or(u32::MAX);
        let view = camera(width, 16);
        let splats = scene_of(&spread(&view, 10));
        match Renderer::new(Arc::clone(&gpu), &splats, Constants::default())?.render(&view, Outputs::Color) {
            Err(Error::OutOfMemory { needed, limit, .. }) => {
                ensure!(needed > limit && limit == most, "{needed} of {limit}, where a binding has {most}");
                Ok(())
            }
            Err(other) => bail!("another error: {other}"),
            Ok((_, report)) => bail!("a picture: {report:?}"),
        }
    });
    if bench.slow {
        // 62,084 and 90,828 tiles: below and above the 65,535 workgroups of one dimension.
        of_real_rigs(bench, tally, 5312, 2988);
        of_real_rigs(bench, tally, 5568, 4176);
    } else {
        tally.leave_out("5312 x 2988 and 5568 x 4176: minutes on a CPU, `--slow` runs them");
    }
    Ok(())
}

fn of_real_rigs(bench: &Bench, tally: &mut Tally, width: u32, height: u32) {
    let view = with(camera(width, height), |of| (of.fx, of.fy) = (3000.0, 3000.0));
    let mut random = Random::new(u64::from(width));
    let all = (0..60).map(|_| {
        let [x, y] = [width, height].map(|side| random.uniform(0.0, f64::from(side)));
        let z = random.uniform(2.0, 6.0);
        let deviation = random.uniform(0.5, 150.0) * z / 3000.0;
        ball(at_pixel(&view, x, y, z), deviation, random.uniform(0.1, 0.95), [0.3, 0.6, 0.1])
    });
    Case::new(format!("{width} x {height}"), scene_of(&all.collect::<Vec<_>>()), view.clone())
        // A pixel position of 5,000 is known to 2.4e-4 in f32.
        .tolerance(Tolerance { away: 5e-4, ..Tolerance::default() })
        .check(|_, report| {
            ensure!(report.tiles == u64::from(width.div_ceil(16) * height.div_ceil(16)), "{report:?}");
            let image_bytes = 16 * u64::from(width) * u64::from(height);
            let is_in_one = image_bytes <= bench.gpu().caps().max_binding_bytes;
            ensure!(is_in_one || report.strips > 1, "{report:?}");
            Ok(())
        })
        .run(bench, tally);
}
