//! What pictures say of the parts of Gaussians: against the gradients, and against pictures without the part.

use crate::common::prelude::*;
use crate::common::random::{scene, view};
use ivv::internals::reference::responses;
use ivv::internals::stage::{Census, Response};

tested! {
    "fisher/fisher.comp" by responses in sums_over_views_are_those_of_the_gradients;
}

const CAMERAS: [[f64; 3]; 3] = [[0.0, 0.0, -4.0], [3.0, 0.5, -2.0], [-2.0, 1.0, -3.0]];

fn mixed(seed: u64, n: usize) -> Splats {
    let mut splats = scene(seed, n, 3);
    let k = splats.n_coefficients();
    for i in 0..n {
        let degree = i % 4;
        splats.sh[i * k + (degree + 1).pow(2)..(i + 1) * k].fill([0.0; 3]);
    }
    let splats = splats.by_degree();
    assert!(splats.check().is_ok() && splats.degree.windows(2).any(|d| d[0] != d[1]));
    splats
}

fn views() -> [View; 2] {
    [view(), View { time: 0.7, time_offset: 0.0, ..view() }]
}

/// Random signs, no sign in the first column.
fn signs(view: &View, seed: u64) -> Frame {
    let mut random = Random::new(seed);
    let n = (view.intrinsics.width * view.intrinsics.height) as usize;
    let mut sign = || if random.bits() & 1 == 0 { 1.0f32 } else { -1.0 };
    let color = (0..n)
        .map(|i| if i % view.intrinsics.width as usize == 0 { [0.0; 3] } else { [sign(), sign(), sign()] })
        .collect();
    let (width, height) = (view.intrinsics.width, view.intrinsics.height);
    Frame { width, height, color, alpha: vec![0.0; n], ..Frame::default() }
}

fn whole(cotangents: &Frame) -> Frame {
    let n = cotangents.alpha.len();
    Frame { depth: vec![0.0; n], inverse_depth: vec![0.0; n], flow: vec![[0.0; 2]; n], ..cotangents.clone() }
}

fn count(renderer: &mut Renderer, census: &Census, view: &View, signs: &Frame, errors: &Frame) {
    renderer.count(census, view, signs, |_| errors.clone()).unwrap();
}

fn numbers(r: &Response) -> [f64; 11] {
    let [b1, b2, b3] = r.bands;
    let [x, y, z, ramp, swell] = r.lacks;
    [r.rest, b1, b2, b3, r.whole, r.color, x, y, z, ramp, swell]
}

fn assert_close(found: &[Response], expected: &[[f64; 11]]) {
    for number in 0..11 {
        let largest = expected.iter().map(|e| e[number].abs()).fold(0.0, f64::max);
        assert!(largest > 0.0, "number {number} is 0 everywhere");
        for (i, (r, e)) in found.iter().zip(expected).enumerate() {
            let (a, b) = (numbers(r)[number], e[number]);
            assert!((a - b).abs() <= 1e-3 * b.abs() + 1e-5 * largest, "{i}, number {number}: {a}, not {b}");
        }
    }
}

#[test]
fn sums_over_views_are_those_of_the_gradients() {
    let _device = gpu();
    let splats = mixed(4, 301);
    let mut renderer = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
    let census = renderer.census(&CAMERAS).unwrap();
    let (mut squares, mut plain) = (vec![[0.0; 11]; splats.len()], vec![[0.0; 11]; splats.len()]);
    let photo = View { time: 1e6, time_offset: 0.0, ..view() };
    assert!(photo.is_photo());
    for (seed, view) in (0..).zip(views().into_iter().chain([photo])) {
        let (signs, errors) = (signs(&view, seed), signs(&view, 10 + seed));
        count(&mut renderer, &census, &view, &signs, &errors);
        for (cotangents, sums, square) in [(signs, &mut squares, true), (errors, &mut plain, false)] {
            let (d, _) = renderer.vjp(&view, &whole(&cotangents)).unwrap();
            for (i, sum) in sums.iter_mut().enumerate() {
                let (part, color, lacks) = responses(&splats, &d.params, i, &view, &CAMERAS);
                let term = |s: f64| if square { s * s } else { s };
                let color = color.map(term).iter().sum();
                let all = [part.map(term).as_slice(), &[color], &lacks.map(term)].concat();
                sum.iter_mut().zip(all).for_each(|(sum, x)| *sum += x);
            }
        }
    }
    let (information, slope) = renderer.counted(&census).unwrap();
    assert_close(&information, &squares);
    assert_close(&slope, &plain);
    let seen: f64 = information.iter().map(|r| r.seen).sum();
    assert!(seen > 100.0 && information.iter().all(|r| r.seen <= 3.0), "{seen}");
}

#[test]
fn a_gaussian_and_a_band_are_worth_what_the_picture_without_them_tells() {
    let (splats, view) = (mixed(8, 60), view());
    let gpu = gpu();
    let show = |splats: &Splats| {
        Renderer::new(gpu.clone(), splats, Constants::default()).unwrap().render(&view, Outputs::Color).unwrap().0.color
    };
    let own = show(&splats);
    let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
    let census = renderer.census(&CAMERAS).unwrap();
    let errors = signs(&view, 99);
    const DRAWS: u64 = 48;
    for draw in 0..DRAWS {
        count(&mut renderer, &census, &view, &signs(&view, draw), &errors);
    }
    let (information, slope) = renderer.counted(&census).unwrap();
    let k = splats.n_coefficients();
    let mut n_compared = 0;
    for i in (0..splats.len()).step_by(3) {
        let mut without = splats.clone();
        without.opacity[i] = -40.0;
        let mut plain = splats.clone();
        plain.sh[i * k + 1..i * k + 4].fill([0.0; 3]);
        let mean = information[i].band_means[0];
        plain.sh[i * k].iter_mut().zip(mean).for_each(|(x, mean)| *x += (mean / 0.282_094_8) as f32);
        let cases =
            [(without, information[i].whole, slope[i].whole), (plain, information[i].bands[0], slope[i].bands[0])];
        for (changed, information, slope) in cases {
            let change: Vec<f64> = own
                .as_flattened()
                .iter()
                .zip(show(&changed).as_flattened())
                .zip(errors.color.as_flattened())
                .map(|((a, b), e)| if *e == 0.0 { 0.0 } else { f64::from(b - a) })
                .collect();
            let squares: f64 = change.iter().map(|x| x * x).sum();
            // Colours that are clamped, and alphas at their bound, are not affine.
            if squares < 1e-3 {
                continue;
            }
            let along: f64 = change.iter().zip(errors.color.as_flattened()).map(|(x, e)| x * f64::from(*e)).sum();
            let size = squares.sqrt();
            assert!((slope / DRAWS as f64 - along).abs() < 0.15 * size, "{i}: slope {slope}, not {along} of {size}");
            // A mean of so many squares of nearly normal numbers has a fifth of it for its deviation: three below, six above.
            let ratio = information / DRAWS as f64 / squares;
            assert!((0.4..2.2).contains(&ratio), "{i}: information {ratio} times {squares}");
            n_compared += 1;
        }
    }
    assert!(n_compared > 12, "{n_compared} compared");
}
