//! What a `.4dgs` file loses: how far its numbers, its frames and its colours are off, at which size.

use super::four_dgs::{contents, there_and_back};
use super::{Folder, fault};
use crate::common::frames::psnr;
use crate::common::prelude::*;
use crate::common::random;
use ivv::internals::formats::Contents;
use ivv::internals::stage::{Goal, Subject, compact};

/// The demo's scene with Gaussians that live shortly all over a long clip, so that there are many chunks.
fn long_scene() -> (Splats, Clock) {
    let once = demo().0;
    let mut splats = Splats::new(once.sh_degree);
    let moving: Vec<usize> = (once.n_static..once.len()).collect();
    for repeat in 0..6 {
        let mut part = once.in_order(&moving);
        for motion in &mut part.motion {
            let tau = (motion.t_scale.exp() / 6.0).min(0.03);
            *motion = Motion {
                velocity: motion.velocity.map(|v| 6.0 * v),
                t_center: (motion.t_center + repeat as f32) / 6.0,
                t_scale: tau.ln(),
            };
        }
        let k = part.n_coefficients();
        let first = splats.len() as u32;
        splats.source_row.extend(first..first + part.len() as u32);
        splats.position.append(&mut part.position);
        splats.rotation.append(&mut part.rotation);
        splats.scale.append(&mut part.scale);
        splats.opacity.append(&mut part.opacity);
        splats.sh.extend_from_slice(&part.sh[..k * part.motion.len()]);
        splats.motion.append(&mut part.motion);
    }
    splats.check().unwrap();
    (splats, Clock { fps: 30.0, frames: 240 })
}

fn frames(splats: &Splats, views: &[View]) -> Vec<Frame> {
    let gpu = gpu();
    let mut renderer = Renderer::new(gpu.clone(), &splats.clone().by_degree(), Constants::default()).unwrap();
    views.iter().map(|view| renderer.render(view, Outputs::Color).unwrap().0).collect()
}

#[test]
fn frames_of_a_file_are_those_of_the_scene_at_all_times_borders_of_chunks_too() {
    let folder = Folder::new("four-dgs-frames");
    let (scene, views) = demo();
    for (name, splats, clock) in
        [("demo", scene, Clock { fps: 30.0, frames: 60 }), ("long", long_scene().0, long_scene().1)]
    {
        let mut truth = (Vec::new(), Vec::new());
        for (grades, least) in [(Grades::default(), 45.0), (all(2), 27.0)] {
            let path = folder.file("a.4dgs");
            let read = there_and_back(&path, &splats, clock, grades);
            assert_eq!(read.len(), splats.len());
            let told = FourDgs::read(&path).unwrap().summary();
            let borders = told.chunk_intervals.iter().flatten().map(|seconds| seconds / clock.seconds());
            let mut times: Vec<f64> = (0..4).map(|i| f64::from(i) / 3.0).chain(borders).collect();
            times.sort_unstable_by(f64::total_cmp);
            times.dedup();
            assert!(name == "demo" || told.chunk_intervals.len() > 5, "{name}: {} chunks", told.chunk_intervals.len());
            let at = |time: &f64| View { time: *time, name: time.to_string(), ..views[2].reduced(2) };
            let views: Vec<View> = times.iter().map(at).collect();
            // Once, unless another grade has other borders.
            if truth.0 != views {
                truth = (views.clone(), frames(&splats, &views));
            }
            let pairs = truth.1.iter().zip(frames(&read, &views));
            let worst = pairs.map(|(a, b)| psnr(a, &b)).fold(f64::INFINITY, f64::min);
            let bytes = std::fs::metadata(&path).unwrap().len();
            println!("{name}, {grades:?}: {worst:.1} dB at the worst of {} times, {bytes} bytes", times.len());
            assert!(worst >= least, "{name}, {grades:?}: {worst} dB");
        }
    }
}

fn all(grade: u8) -> Grades {
    let mut grades = Grades::default();
    (0..Grades::N).for_each(|attribute| *grades.of(attribute) = grade);
    grades
}

#[test]
fn no_number_of_a_file_is_further_off_than_its_grade_states() {
    let folder = Folder::new("four-dgs-errors");
    let clock = Clock { fps: 24.0, frames: 120 };
    for grade in 0..=3 {
        let grades = all(grade);
        let mut splats = random::scene(5, 300, 2);
        splats.sh.iter_mut().for_each(|c| *c = c.map(|c| c.clamp(-1.5, 1.5)));
        // Far from the origin, where single precision is coarser than the check of the format's own writer allows.
        splats.position.iter_mut().for_each(|p| p[0] += 900.0);
        let path = folder.file("a.4dgs");
        let read = there_and_back(&path, &splats, clock, grades);
        assert_eq!((read.len(), read.n_static), (splats.len(), splats.n_static));
        let mut scales: Vec<f32> = splats.scale.as_flattened().iter().map(|s| s.exp()).collect();
        scales.sort_unstable_by(f32::total_cmp);
        let median = f64::from(scales[scales.len() / 2]);
        let [place, scale, color, sigma] =
            [0.02, 1.005_f64.ln(), 0.5 / 255.0, 1.005_f64.ln()].map(|finest| finest * f64::from(1 << grade));
        // Chunks have their own order: a Gaussian is found by its place.
        let near = |i: usize| {
            let off =
                |j: &usize| (0..3).map(|k| (read.position[*j][k] - splats.position[i][k]).abs()).fold(0.0, f32::max);
            (0..read.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap()
        };
        let mut worst = [0.0_f64; 6];
        let k = splats.n_coefficients();
        for i in 0..splats.len() {
            let j = near(i);
            let unit = |q: [f32; 4]| q.map(|v| f64::from(v) / q.iter().map(|v| f64::from(v * v)).sum::<f64>().sqrt());
            let (a, b) = (unit(splats.rotation[i]), unit(read.rotation[j]));
            let sigmoid = |o: f32| 1.0 / (1.0 + (-f64::from(o)).exp());
            let base =
                |s: &Splats, i: usize, c: usize| (0.5 + 0.282_094_79 * f64::from(s.sh[i * k][c])).clamp(0.0, 1.0);
            let mut errors = [
                (0..3).map(|c| f64::from((read.position[j][c] - splats.position[i][c]).abs())).fold(0.0, f64::max),
                (0..3).map(|c| f64::from((read.scale[j][c] - splats.scale[i][c]).abs())).fold(0.0, f64::max),
                (0..3).map(|c| (base(&read, j, c) - base(&splats, i, c)).abs()).fold(0.0, f64::max),
                0.0,
                2.0 * a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>().abs().min(1.0).acos(),
                (1..k)
                    .flat_map(|c| (0..3).map(move |x| (c, x)))
                    .map(|(c, x)| f64::from((read.sh[j * k + c][x] - splats.sh[i * k + c][x]).abs()))
                    .fold(0.0, f64::max),
            ];
            errors[2] = errors[2].max((sigmoid(read.opacity[j]) - sigmoid(splats.opacity[i])).abs());
            if let Some(d) = i.checked_sub(splats.n_static) {
                let (told, found) = (splats.motion[d], read.motion[j - read.n_static]);
                errors[3] = f64::from((told.t_scale - found.t_scale).abs());
            }
            worst.iter_mut().zip(errors).for_each(|(worst, error)| *worst = worst.max(error));
        }
        println!("grade {grade}: {worst:?}, median {median}");
        let rounding = 2.0 * 900.0 * f64::from(f32::EPSILON);
        assert!(worst[0] > 0.0 && worst[0] <= place * median + rounding, "grade {grade}: places {}", worst[0]);
        assert!(worst[1] > 0.0 && worst[1] <= scale + 1e-5, "grade {grade}: scales {}", worst[1]);
        assert!(worst[2] > 0.0 && worst[2] <= color + 1e-6, "grade {grade}: colours {}", worst[2]);
        assert!(worst[3] > 0.0 && worst[3] <= sigma + 1e-5, "grade {grade}: sigmas {}", worst[3]);
        assert!(worst[4] > 0.0 && worst[4] <= 0.003 * f64::from(1 << grade), "grade {grade}: angles {}", worst[4]);
        let harmonics = if grade == 0 { 0.5 } else { 0.5 + 0.5 * f64::from(1 << grade) };
        assert!(worst[5] > 0.0 && worst[5] <= harmonics * 8.0 / 255.0 + 1e-6, "grade {grade}: harmonics {}", worst[5]);
    }
}

#[test]
fn a_file_is_as_small_as_its_pictures_allow_and_as_good_as_its_size_allows() {
    let folder = Folder::new("four-dgs-compact");
    let path = folder.file("a.4dgs");
    let (splats, views) = demo();
    let clock = Clock { fps: 30.0, frames: 60 };
    let (encoded, contents) = (Encoded::new(&splats, clock), contents(clock));
    let finest = encoded.bytes(&path, &contents, Grades::default()).unwrap().len() as u64;
    let views: Vec<View> = views[..3].iter().map(|view| view.reduced(2)).collect();
    let constants = Constants::default();
    let subject =
        Subject { path: &path, splats: &splats, encoded: &encoded, contents: &contents, constants, views: &views };
    let gpu = gpu();
    let find = |goal| compact(&gpu, &subject, goal, &mut |_, _| {});
    let mut before = finest;
    for db in [42.0, 30.0] {
        let found = find(Goal::Psnr(db)).unwrap();
        println!("{db} dB: {} bytes of {finest}, {:.2} dB, {:?}", found.bytes.len(), found.psnr, found.grades);
        assert!(found.psnr >= db && (found.bytes.len() as u64) < before, "{db}: {} dB", found.psnr);
        before = found.bytes.len() as u64;
        // What it says of its pictures is so.
        let read = FourDgs::of_bytes(&path, &found.bytes).unwrap().splats().unwrap();
        let pairs: Vec<(Frame, Frame)> = frames(&splats, &views).into_iter().zip(frames(&read, &views)).collect();
        let error = pairs.iter().map(|(a, b)| 10f64.powf(-psnr(a, b) / 10.0)).sum::<f64>() / pairs.len() as f64;
        assert!((-10.0 * error.log10() - found.psnr).abs() < 0.01, "{}", -10.0 * error.log10());
    }
    // Where the finest fits, it is that.
    let found = find(Goal::Bytes(finest)).unwrap();
    assert_eq!((found.bytes.len() as u64, found.grades, found.n_tried), (finest, Grades::default(), 1));
    let found = find(Goal::Bytes(finest * 2 / 3)).unwrap();
    println!("{} bytes of {finest}: {:.2} dB, {:?}", found.bytes.len(), found.psnr, found.grades);
    assert!(found.bytes.len() as u64 <= finest * 2 / 3 && found.psnr > 33.0, "{} dB", found.psnr);
    assert!(fault(find(Goal::Psnr(90.0)), &path).contains("90 dB"));
    assert!(fault(find(Goal::Bytes(500)), &path).contains("500 bytes"));
    // Bands that are left out are no part of the file.
    let mut plain = Grades::default();
    plain.bands[0] = Grades::LEFT_OUT;
    let bytes = encoded.bytes(&path, &contents, plain).unwrap();
    assert_eq!(FourDgs::of_bytes(&path, &bytes).unwrap().splats().unwrap().sh_degree, 0);
}

fn look(name: usize, eye: [f64; 3]) -> View {
    let unit = |v: [f64; 3]| v.map(|x| x / v.iter().map(|x| x * x).sum::<f64>().sqrt());
    let cross = |a: [f64; 3], b: [f64; 3]| {
        std::array::from_fn(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
    };
    let forward = unit(eye.map(|x| -x));
    let right = unit(cross(forward, [0.0, -1.0, 0.0]));
    let rows: [[f64; 3]; 3] = [right, cross(forward, right), forward];
    let mut world_to_camera = [[0.0, 0.0, 0.0, 1.0]; 4];
    for (to, row) in world_to_camera.iter_mut().zip(rows) {
        *to = [row[0], row[1], row[2], -(0..3).map(|k| row[k] * eye[k]).sum::<f64>()];
    }
    let (_, views) = demo();
    let intrinsics = Intrinsics { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0 };
    View { name: name.to_string(), pose: Pose::of_rows(&world_to_camera), intrinsics, ..views[0].clone() }
}

#[test]
fn colours_are_rounded_so_that_they_are_right_where_cameras_look() {
    let folder = Folder::new("four-dgs-colors");
    let path = folder.file("a.4dgs");
    let clock = Clock { fps: 30.0, frames: 30 };
    let mut splats = random::scene(7, 300, 3);
    splats.position.iter_mut().for_each(|p| *p = p.map(|x| 0.4 * x.sin()));
    for (i, coefficients) in splats.sh.chunks_exact_mut(16).enumerate() {
        let value = |k: usize| ((i * 37 + k * 101) as f32 * 0.618).fract() - 0.5;
        // One in four is brighter or darker than the format holds.
        let beyond = if i % 4 == 0 { 2.4 } else { 1.2 };
        coefficients.iter_mut().enumerate().for_each(|(k, c)| {
            *c = [0, 1, 2].map(|channel| value(3 * k + channel) * if k == 0 { 2.0 * beyond } else { 0.4 });
        });
    }
    // Cameras along an arc, as rigs have them; eyes between them, and anywhere.
    let on_arc =
        |degrees: f64, height: f64| [5.0 * degrees.to_radians().sin(), height, -5.0 * degrees.to_radians().cos()];
    let cameras: Vec<[f64; 3]> = (0..14).map(|k| on_arc(-60.0 + 9.0 * f64::from(k), f64::from(k % 2))).collect();
    let between: Vec<[f64; 3]> = (0..13).map(|k| on_arc(-55.5 + 9.0 * f64::from(k), 0.5)).collect();
    let anywhere: Vec<[f64; 3]> =
        (0..24).map(|k| on_arc(15.0 * f64::from(k), 4.0 * (f64::from(k) * 2.4).sin())).collect();
    let views: Vec<View> = cameras.iter().enumerate().map(|(k, eye)| look(k, *eye)).collect();
    let read = |views: &[View], grades: Grades| {
        let contents = Contents { views, ..contents(clock) };
        let bytes = Encoded::new(&splats, clock).bytes(&path, &contents, grades).unwrap();
        FourDgs::of_bytes(&path, &bytes).unwrap().splats().unwrap()
    };
    // Root mean square of the error of the colours that eyes see. Files are in an order of their own, so Gaussians are found by
    // their places.
    let color = |splats: &Splats, i: usize, eye: &[f64; 3]| {
        let to: [f64; 3] = std::array::from_fn(|k| f64::from(splats.position[i][k]) - eye[k]);
        let length = to.iter().map(|x| x * x).sum::<f64>().sqrt();
        let k = splats.n_coefficients();
        let coefficients: Vec<[f64; 3]> = splats.sh[i * k..(i + 1) * k].iter().map(|c| c.map(f64::from)).collect();
        ivv::internals::reference::color(&coefficients, to.map(|x| x / length))
    };
    let error = |found: &Splats, eyes: &[[f64; 3]]| {
        let (mut sum, mut n) = (0.0, 0);
        for i in 0..splats.len() {
            let away = |j: &usize| (0..3).map(|k| (found.position[*j][k] - splats.position[i][k]).powi(2)).sum::<f32>();
            let j = (0..found.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap();
            for eye in eyes {
                let (a, b) = (color(&splats, i, eye), color(found, j, eye));
                sum += (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
                n += 3;
            }
        }
        (sum / f64::from(n)).sqrt()
    };
    let encoded = Encoded::new(&splats, clock);
    let [without, with] = [&[], &views[..]].map(|views| encoded.n_off(views));
    println!(
        "{without} of {} are off without views, {with} with them; {} are cut",
        encoded.len(),
        encoded.n_clamped_colors
    );
    assert!(encoded.n_clamped_colors > 50 && without > 50 && with * 5 < without, "{without}, {with}");
    let coarse = Grades { bands: [1, 2, Grades::LEFT_OUT], ..Grades::default() };
    for (grades, better, worse) in [(Grades::default(), 5.0, 1.5), (coarse, 3.0, 2.0)] {
        let (plain, fitted) = (read(&[], grades), read(&views, grades));
        let [of_plain, of_fitted] =
            [&plain, &fitted].map(|found| [&cameras, &between, &anywhere].map(|eyes| error(found, eyes)));
        println!("{grades}: alone {of_plain:.4?}, for cameras {of_fitted:.4?}");
        assert!(of_fitted[..2].iter().zip(of_plain).all(|(fitted, plain)| fitted * better < plain), "{of_fitted:?}");
        assert!(of_fitted[2] < worse * of_plain[2], "{of_fitted:?}");
    }
}
