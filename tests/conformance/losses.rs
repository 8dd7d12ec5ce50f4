//! N20 to N23: losses without an error, flat and bright pictures, dead features, colours of any kind.

use super::fixtures::lpips::{self, TRUNKS, narrow};
use super::fixtures::photometric::{Pair, word};
use super::fixtures::{grids, priors};
use super::prelude::*;
use ivv::internals::reference::BilateralGrid;
use ivv::internals::stage::{DepthSpace, GRID_SIZE, GridState, GridStep, Grids};

pub(super) fn no_error(bench: &Bench, tally: &mut Tally) -> Result<()> {
    type Level = fn(u32, u32) -> u8;
    let levels: [Level; 4] =
        [|_, _| 51, |_, _| 255, |x, _| if x < 9 { 77 } else { 179 }, |x, y| (x * 71 + y * y * 37 + x * y * 13) as u8];
    for size in [[1, 1], [1, 17], [17, 1], [5, 5], [16, 16], [33, 47], [64, 48]] {
        for (kind, level) in levels.into_iter().enumerate() {
            tally.case(format!("L1 and SSIM of picture {kind} of {size:?}"), |tally| {
                let mask = |x, y| if kind == 3 && (x + y) % 5 == 2 { 0 } else { 255 };
                // As the device decodes it: a product is rounded alike everywhere, a division need not be.
                let image = |x, y| [f32::from(level(x, y)) * (1.0 / 255.0); 3];
                let found =
                    Pair::new(size, image, |x, y| word([level(x, y); 3], mask(x, y))).on_device(&bench.gpu())?;
                ensure!(found.l1 == 0.0, "L1 {}", found.l1);
                tally.within("SSIM", (found.ssim - 1.0).abs(), 2e-5)?;
                // Adam makes a full step of a gradient of any size, so that rounding alone would move the parameters.
                ensure!(found.largest() == 0.0, "a cotangent of {:e}", found.largest());
                Ok(())
            });
        }
    }
    tally.case("depth and end-point error", |_| no_error_of_priors(bench));
    tally.case("a bilateral grid without a cotangent", |_| no_error_of_grids(bench));
    for (trunk, smallest) in TRUNKS {
        let weights = narrow(7, trunk);
        for size in [[smallest; 2], [37, 41]] {
            tally.case(format!("LPIPS of {trunk}, {size:?}"), |_| {
                let gpu = bench.gpu();
                let mut pair = lpips::Pair::random(4, size, |i| if i % 5 == 2 { 0 } else { 255 });
                let decoded = |word: u32| std::array::from_fn(|c| f32::from(word.to_le_bytes()[c]) * (1.0 / 255.0));
                pair.image = pair.truth.iter().map(|word| decoded(*word)).collect();
                let found = pair.on_device(&gpu, &mut lpips::load(&gpu, &weights)?)?;
                ensure!(found.value == 0, "LPIPS {}", found.value());
                ensure!(found.d_image.iter().all(|d| *d == [0; 3]), "a cotangent of {:e}", found.largest());
                Ok(())
            });
        }
    }
    Ok(())
}

fn no_error_of_priors(bench: &Bench) -> Result<()> {
    let mut case = priors::Case::random(8, 300);
    // Sizes down to the smallest halves, which priors are.
    for (i, pixel) in case.image1.iter_mut().enumerate() {
        let scale = f32::exp2(-((i % 23) as f32));
        *pixel = [0.75 * scale, 1.25 * scale, 0.5 * scale, -scale];
        (case.depth[i], case.flow[i], case.counts[i]) = (pixel[1], [pixel[2], pixel[3]], true);
    }
    let found = case.on_device(&bench.gpu(), DepthSpace::Inverse)?;
    ensure!(case.weights().n_flow == 300 && found.values == [0.0; 2], "losses of {:?}", found.values);
    ensure!(found.d_image1.iter().all(|d| *d == [0.0; 4]), "a cotangent");
    // An error whose square underflows has no direction.
    case.image1.iter_mut().for_each(|pixel| *pixel = [0.0, 1e-30, 1e-30, -1e-30]);
    case.depth.fill(0.0);
    case.flow.fill([0.0; 2]);
    let found = case.on_device(&bench.gpu(), DepthSpace::Inverse)?;
    ensure!(found.d_image1.as_flattened().iter().all(|x| x.is_finite()), "a cotangent that is not finite");
    ensure!(found.d_image1.iter().all(|d| d[1] > 0.0), "the depth's error has no sign at 1e-30");
    Ok(())
}

fn no_error_of_grids(bench: &Bench) -> Result<()> {
    let gpu = bench.gpu();
    let mut case = grids::Case::random(7, [61, 47]);
    case.d_graded.fill([0.0; 3]);
    let mut found = case.on_device(&gpu)?;
    let has_none = |found: &grids::Found| found.d_image.as_flattened().iter().chain(&found.d_grid).all(|d| *d == 0.0);
    ensure!(has_none(&found), "a gradient");
    // Nor has the identity a variation.
    case.state = GridState::identity();
    found = case.on_device_by(&gpu, None, 10.0)?;
    ensure!(has_none(&found) && found.variation == 0.0, "a variation");
    let states = [GridState::identity(), GridState::identity()];
    let uploaded = Grids::upload(&gpu, &states)?;
    let step = GridStep { step: 2, is_free: true, is_affine: false, camera_step: 1, rate: 0.1 };
    grids::step(&gpu, &uploaded, 0, &found.d_grid, &step, 0)?;
    ensure!(uploaded.download(&gpu)? == states, "a step");
    Ok(())
}

pub(super) fn similarity(bench: &Bench, tally: &mut Tally) -> Result<()> {
    type Picture = (&'static str, fn(u32, u32) -> f32);
    let grey: fn(u32, u32) -> f32 = |_, _| 0.5;
    let pictures: [Picture; 10] = [
        ("black", |_, _| 0.0),
        ("grey", grey),
        ("white", |_, _| 1.0),
        ("chequered", |x, y| ((x + y) % 2) as f32),
        ("bright", |_, _| 10.0),
        ("bright chequered", |x, y| 10.0 * ((x + y) % 2) as f32),
        ("bright ramp", |x, y| 10.0 * (x + y) as f32 / 78.0),
        ("blinding", |_, _| 100.0),
        ("more than blinding", |_, _| 173.0),
        // The sums of flat pictures round alike. Last bits that differ make variances of either sign, some of them -C2.
        ("not quite flat and blinding", |x, y| 100.0 + 7.63e-6 * ((5 * x + 3 * y) % 7) as f32),
    ];
    for size in [[33, 47], [1, 1]] {
        for (name, picture) in pictures {
            for (other, truth) in [("itself", picture), ("grey", grey), ("black", pictures[0].1)] {
                tally.case(format!("{name} against {other}, {size:?}"), |tally| {
                    let byte = |x, y| (255.0 * truth(x, y).min(1.0)).round() as u8;
                    let pair = Pair::new(size, |x, y| [picture(x, y); 3], |x, y| word([byte(x, y); 3], 255));
                    let found = pair.on_device(&bench.gpu())?;
                    ensure!(found.ssim >= 0.0 && found.ssim <= 1.0 + 2e-6, "SSIM {}", found.ssim);
                    let is_finite = found.d_image().as_flattened().iter().all(|x| x.is_finite());
                    ensure!(found.l1.is_finite() && is_finite, "an error or a cotangent that is not finite");
                    // The variance of a bright flat picture is what its moments' cancellation leaves: up to 22 roundings of
                    // 4e-6, 9 % of C2; they are not all of one sign. Of a blinding one it is many times C2, and the means alone
                    // tell that the two differ.
                    let allowed = if name.ends_with("blinding") {
                        2e-2
                    } else if name.starts_with("bright") {
                        5e-3
                    } else {
                        // Rounding of the variances, by luck of the colours: 6e-6 in the mean over random ones.
                        1e-5
                    };
                    let exact = pair.dual(&pair.image).ssim.value;
                    tally.within("SSIM", (found.ssim - exact).abs(), allowed)
                });
            }
        }
    }
    Ok(())
}

pub(super) fn dead_features(bench: &Bench, tally: &mut Tally) -> Result<()> {
    for (trunk, smallest) in TRUNKS {
        let size = [smallest + 2, smallest];
        let weights = narrow(8, trunk);
        let on_device = |pair: &lpips::Pair, weights: &lpips::Weights| {
            let gpu = bench.gpu();
            pair.on_device(&gpu, &mut lpips::load(&gpu, weights)?)
        };
        tally.case(format!("{trunk}: black against black"), |_| {
            let found = on_device(&lpips::Pair::flat(size, 0.0, 0), &weights)?;
            ensure!((found.value, found.largest()) == (0, 0.0), "LPIPS {}, {:e}", found.value(), found.largest());
            Ok(())
        });
        tally.case(format!("{trunk}: no feature of any layer is alive"), |_| {
            let mut dead = weights.clone();
            for (name, (_, values)) in &mut dead {
                if name.ends_with("bias") {
                    values.fill(-1e3);
                }
            }
            let found = on_device(&lpips::Pair::random(5, size, |_| 255), &dead)?;
            ensure!((found.value, found.largest()) == (0, 0.0), "LPIPS {}, {:e}", found.value(), found.largest());
            Ok(())
        });
        // Black kills the first layer, as the truth does not; then a little light, which the norm barely sees.
        let mut first = weights.clone();
        for (name, value) in [("features.0.weight", 1.0), ("features.0.bias", 0.0)] {
            if let Some((_, values)) = first.get_mut(name) {
                values.iter_mut().for_each(|x| *x = value * x.abs());
            }
        }
        let black = lpips::Pair::flat(size, 0.0, 255);
        tally.case(format!("{trunk}: dead against alive"), |_| {
            let found = on_device(&black, &first)?;
            ensure!(found.value() > 0.1 && found.largest() == 0.0, "LPIPS {}, {:e}", found.value(), found.largest());
            Ok(())
        });
        for light in [1e-7, 1e-6, 1e-5] {
            tally.case(format!("{trunk}: a light of {light:e}"), |tally| {
                // What the trunk sees as 0 in each channel, and a little more.
                let grey = |c: usize| 0.5 + [-0.030, -0.088, -0.188][c] / 2.0 + light;
                let mut pair = black.clone();
                pair.image.fill([grey(0), grey(1), grey(2)]);
                let found = on_device(&pair, &first)?;
                ensure!(found.largest().is_finite(), "a cotangent of {}", found.largest());
                let exact = pair.dual(&first, &vec![[0.0; 3]; pair.image.len()])?.value;
                ensure!(exact > 0.0, "the truth is 0");
                // Such a light is two last bits of the picture and more, and is known as well as those are.
                tally.within("LPIPS", (found.value() - exact).abs() / exact, 6e-8 / f64::from(light))
            });
        }
    }
    Ok(())
}

pub(super) fn colors_through_grids(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let below_one = f32::from_bits(1.0f32.to_bits() - 1);
    let values = [-1.0, -0.0, 0.0, 1e-30, below_one, 1.0, 2.0, 1e30, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    for size in [[1, 1], [19, 17], [40, 3]] {
        let plain = grids::Case::random(8, size);
        let expected = plain.on_device(&bench.gpu())?;
        let [w, h] = size;
        for value in values {
            // The corners, where (u, v) is 0 and 1, and the middle; all channels, or one.
            for (at, channels) in [(0, 3), (w - 1, 1), ((h - 1) * w, 3), (w * h - 1, 2), (w * h / 2, 3)] {
                tally.case(format!("{value} in {channels} channels of pixel {at} of {size:?}"), |tally| {
                    let mut case = plain.clone();
                    case.image[at as usize][..channels].fill(value);
                    let found = case.on_device(&bench.gpu())?;
                    for i in (0..case.image.len()).filter(|i| *i != at as usize) {
                        let is_same = found.graded[i] == expected.graded[i] && found.d_image[i] == expected.d_image[i];
                        ensure!(is_same, "pixel {i} differs");
                    }
                    ensure!(found.d_grid.iter().all(|x| x.is_finite()), "a gradient that is not finite");
                    let seen = found.graded[at as usize];
                    if !value.is_finite() {
                        ensure!(!seen.iter().all(|x| x.is_finite()), "what is not finite is hidden: {seen:?}");
                        return Ok(());
                    }
                    let is_finite = found.d_image[at as usize].iter().all(|x| x.is_finite());
                    ensure!(is_finite, "a cotangent that is not finite");
                    let exact = case.truth()[at as usize];
                    let largest = exact.iter().fold(1.0, |m, x| f64::max(m, x.abs()));
                    let off = seen.iter().zip(exact).fold(0.0, |m, (a, b)| f64::max(m, (f64::from(*a) - b).abs()));
                    tally.within("the graded colour", off / largest, 1e-6)
                });
            }
        }
    }
    luma_past_the_end(bench, tally);
    Ok(())
}

/// Where the level is held, the derivative is the map's own, transposed.
fn luma_past_the_end(bench: &Bench, tally: &mut Tally) {
    let [nx, ny, nz] = GRID_SIZE;
    for value in [-1.0f32, 0.0, 1.5] {
        tally.case(format!("the cotangent of a colour {value}"), |tally| {
            let mut case = grids::Case::random(10, [15, 15]);
            case.image.fill([value; 3]);
            let found = case.on_device(&bench.gpu())?.d_image;
            let z = if value > 0.0 { nz - 1 } else { 0 };
            // The pixel in the middle of the picture is between the four cells in the middle.
            let (middle, d) = (7 * 15 + 7, case.d_graded[7 * 15 + 7]);
            let numbers: Vec<f64> = case.state.grid.iter().map(|x| f64::from(*x)).collect();
            let cells = BilateralGrid::new(&numbers).cells;
            let expected: [f64; 3] = std::array::from_fn(|k| {
                let entry = |c: usize| -> f64 {
                    let corners = [(7, 7), (8, 7), (7, 8), (8, 8)];
                    corners.iter().map(|(x, y)| cells[(z * ny + y) * nx + x][c][k] / 4.0).sum()
                };
                (0..3).map(|c| f64::from(d[c]) * entry(c)).sum()
            });
            let off = found[middle].iter().zip(expected).fold(0.0, |m, (a, b)| f64::max(m, (f64::from(*a) - b).abs()));
            tally.within("the cotangent", off, 1e-5)
        });
    }
}
