//! `.4dgs`: the format's own fixtures, and scenes of ours there and back.

use super::{Folder, fault};
use crate::common::device::gpu;
use crate::common::notes::shared;
use crate::common::random;
use ivv::Constants;
use ivv::formats::{Clock, Contents, Encoded, FourDgs, Grades, Sounds, World, read_scene};
use ivv::scene::{Frame, Motion, Splats, View, demo};
use ivv::stage::{Goal, Outputs, Renderer, Subject, compact};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

static SILENT: LazyLock<Sounds> = LazyLock::new(Sounds::default);

fn contents(clock: Clock) -> Contents<'static> {
    Contents { clock, views: &[], own: BTreeMap::new(), sounds: &SILENT, world: None, is_quick: false }
}

/// The scene as it is read back from a file.
fn there_and_back(path: &Path, splats: &Splats, clock: Clock, grades: Grades) -> Splats {
    std::fs::write(path, Encoded::new(splats, clock).bytes(path, &contents(clock), grades).unwrap()).unwrap();
    let read = read_scene(path).unwrap();
    read.check().unwrap();
    read
}

/// Whether `found` is `told`: numbers up to the six digits that the fixtures have, and a part in 1e5 of large sums.
fn agree(place: &str, told: &Value, found: &Value) {
    match (told, found) {
        (Value::Object(told), Value::Object(found)) => {
            told.iter().for_each(|(key, told)| {
                if let Some(found) = found.get(key) {
                    agree(&format!("{place}.{key}"), told, found);
                }
            });
        }
        (Value::Array(told), Value::Array(found)) => {
            assert_eq!(told.len(), found.len(), "{place}");
            told.iter().zip(found).for_each(|(told, found)| agree(place, told, found));
        }
        (Value::Number(told), Value::Number(found)) => {
            let [told, found] = [told, found].map(|number| number.as_f64().unwrap());
            assert!((told - found).abs() <= 2e-6 + 1e-5 * told.abs(), "{place}: {found} is not {told}");
        }
        _ => assert_eq!(told, found, "{place}"),
    }
}

#[test]
fn every_fixture_of_the_format_reads_as_its_description_says() {
    let Some(folder) = shared("data/4dgs_fixtures") else { return };
    let keys = "gaussianCount durationSec shDegree temporalModel cutoff chunkIntervals aggregate audioSources";
    let (mut n_read, mut n_refused) = (0, 0);
    for entry in std::fs::read_dir(&folder).unwrap().chain(std::fs::read_dir(folder.join("invalid")).unwrap()) {
        let file = entry.unwrap().path();
        if file.extension().is_none_or(|ending| ending != "4dgs") {
            continue;
        }
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        let told = std::fs::read(file.with_extension("json")).ok();
        let told: Option<Value> = told.map(|text| serde_json::from_slice(&text).unwrap());
        match told {
            Some(told) if told.get("refused").is_none() => {
                let found = serde_json::to_value(FourDgs::read(&file).unwrap().summary()).unwrap();
                assert!(keys.split(' ').all(|key| found.get(key).is_some() && told.get(key).is_some()), "{name}");
                agree(&name, &told, &found);
                n_read += 1;
            }
            told => {
                let refused = fault(FourDgs::read(&file).and_then(|file| file.at(0.5)), &file);
                println!("{name}: {refused}");
                n_refused += usize::from(told.is_some());
            }
        }
    }
    assert_eq!((n_read, n_refused), (31, 4));
}

#[test]
fn what_appears_at_once_is_shown_at_one_moment_and_refused_at_all() {
    let Some(folder) = shared("data/4dgs_fixtures") else { return };
    let path = folder.join("TenWindows-UseChunkIndex-UseCrc.4dgs");
    let refused = fault(read_scene(&path), &path);
    assert!(refused.contains("at once") && refused.contains("--time"), "{refused}");
    let file = FourDgs::read(&path).unwrap();
    let [early, late] = [0.05, 0.95].map(|time| file.at(time).unwrap());
    early.check().unwrap();
    assert!(!early.is_empty() && !late.is_empty() && early.position != late.position);
    assert!(early.motion.is_empty() && early.len() < file.summary().gaussian_count.parse().unwrap());
}

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

fn psnr(a: &Frame, b: &Frame) -> f64 {
    let pairs = a.color.as_flattened().iter().zip(b.color.as_flattened());
    let squares: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
    -10.0 * (squares / a.color.as_flattened().len() as f64).max(1e-12).log10()
}

#[test]
fn frames_of_a_file_are_those_of_the_scene_at_all_times_borders_of_chunks_too() {
    let folder = Folder::new("four-dgs-frames");
    let (scene, views) = demo();
    for (name, splats, clock) in
        [("demo", scene, Clock { fps: 30.0, frames: 60 }), ("long", long_scene().0, long_scene().1)]
    {
        for (grades, least) in [(Grades::default(), 45.0), (all(2), 27.0)] {
            let path = folder.file("a.4dgs");
            let read = there_and_back(&path, &splats, clock, grades);
            assert_eq!(read.len(), splats.len());
            let told = FourDgs::read(&path).unwrap().summary();
            let borders = told.chunk_intervals.iter().flatten().map(|seconds| seconds / clock.seconds());
            let mut times: Vec<f64> = (0..10).map(|i| f64::from(i) / 9.0).chain(borders).collect();
            times.sort_unstable_by(f64::total_cmp);
            times.dedup();
            assert!(name == "demo" || told.chunk_intervals.len() > 5, "{name}: {} chunks", told.chunk_intervals.len());
            let at = |time: &f64| View { time: *time, name: time.to_string(), ..views[2].clone() };
            let views: Vec<View> = times.iter().map(at).collect();
            let pairs = frames(&splats, &views).into_iter().zip(frames(&read, &views));
            let worst = pairs.map(|(a, b)| psnr(&a, &b)).fold(f64::INFINITY, f64::min);
            let bytes = std::fs::metadata(&path).unwrap().len();
            println!("{name}, {grades:?}: {worst:.1} dB at the worst of {} times, {bytes} bytes", times.len());
            assert!(worst >= least, "{name}, {grades:?}: {worst} dB");
        }
    }
}

/// Numbers of a Gaussian that both readers are asked for: place, standard deviations, colour and opacity, velocity, time and
/// sigma; then all bytes of its higher harmonics.
const PYTHON: &str = "
import fourdgs, json, sys
scene = fourdgs.read(sys.argv[1])
g = scene.gaussians
row = lambda values, i: [float(v) for v in (values[i] if getattr(values[i], '__len__', None) else [values[i]])]
json.dump([sum((row(v, i) for v in (g.positions, g.scales, g.colors, g.motions, g.mu_t, g.sigma_t)), [])
           + ([] if g.sh is None else [float(b) for b in g.sh[i]]) for i in range(len(g.mu_t))], sys.stdout)
";

#[test]
fn the_formats_own_python_package_reads_the_same_numbers() {
    let Some(python) = crate::common::python_with("fourdgs") else { return };
    let folder = Folder::new("four-dgs-python");
    let path = folder.file("a.4dgs");
    for sh_degree in [0, 3] {
        let mut splats = random::scene(3, 100, sh_degree);
        splats.sh.iter_mut().for_each(|c| *c = c.map(|c| 0.5 * c));
        let clock = Clock { fps: 25.0, frames: 50 };
        let read = there_and_back(&path, &splats, clock, Grades::default());
        let told = std::process::Command::new(&python).args(["-c", PYTHON]).arg(&path).output().unwrap();
        assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
        // Python writes infinity, which JSON has not.
        let text = String::from_utf8(told.stdout).unwrap().replace("Infinity", "1e999");
        let rows: Vec<Vec<f64>> = text
            .trim_matches(['[', ']'])
            .split("], [")
            .map(|row| row.split(", ").map(|number| number.parse().unwrap()).collect())
            .collect();
        assert_eq!(rows.len(), 100);
        let by_place = |rows: &mut Vec<Vec<f64>>| rows.sort_by(|a, b| a[..3].partial_cmp(&b[..3]).unwrap());
        let seconds = clock.seconds();
        let mut ours: Vec<Vec<f64>> = (0..read.len())
            .map(|i| {
                let of = |values: &[f32]| values.iter().map(|v| f64::from(*v)).collect::<Vec<f64>>();
                let motion = i.checked_sub(read.n_static).map(|dynamic| read.motion[dynamic]);
                let k = read.n_coefficients();
                let color = read.sh[i * k].map(|dc| 0.5 + 0.282_094_79 * f64::from(dc));
                let logit = f64::from(read.opacity[i]);
                let moved = motion.map_or([0.0; 3], |m| m.velocity.map(|v| f64::from(v) / seconds));
                let sigma = motion.map_or(f64::INFINITY, |m| f64::from(m.t_scale).exp() * seconds / 2f64.sqrt());
                let bytes = |channel: usize| {
                    read.sh[i * k + 1..(i + 1) * k]
                        .iter()
                        .map(move |c| ((f64::from(c[channel]) + 4.0) * 255.0 / 8.0).round())
                };
                let scales = read.scale[i].map(|s| f64::from(s).exp());
                [
                    of(&read.position[i]),
                    scales.to_vec(),
                    color.to_vec(),
                    vec![1.0 / (1.0 + (-logit).exp())],
                    moved.to_vec(),
                    vec![motion.map_or(0.0, |m| f64::from(m.t_center) * seconds), sigma],
                    (0..3).flat_map(bytes).collect(),
                ]
                .concat()
            })
            .collect();
        let mut theirs = rows;
        by_place(&mut ours);
        by_place(&mut theirs);
        for (ours, theirs) in ours.iter().zip(&theirs) {
            assert_eq!(ours.len(), theirs.len());
            for (at, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
                let is_same = ours == theirs || (ours - theirs).abs() <= 3e-6 * theirs.abs().max(1.0);
                assert!(is_same, "number {at}: {ours} is not {theirs}");
            }
        }
    }
}

/// The same grade for every attribute.
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
fn the_same_scene_gives_the_same_bytes_and_what_cannot_be_held_is_counted() {
    let folder = Folder::new("four-dgs-bytes");
    let clock = Clock { fps: 30.0, frames: 30 };
    let path = folder.file("a.4dgs");
    let mut splats = super::sample(1, 5, 5);
    splats.sh.fill([0.2; 3]);
    let clean = Encoded::new(&splats, clock);
    assert_eq!((clean.len(), clean.n_clamped_colors, clean.n_clamped_harmonics), (10, 0, 0));
    let bytes = |encoded: &Encoded| encoded.bytes(&path, &contents(clock), Grades::default()).unwrap();
    assert_eq!(bytes(&clean), bytes(&Encoded::new(&splats, clock)));
    // Too bright; too dark with harmonics that may brighten it; too dark without, which is black all the same.
    splats.sh[0] = [3.0, 0.0, 0.0];
    splats.sh[4] = [-3.0; 3];
    splats.sh[8] = [-3.0; 3];
    splats.sh[9..12].fill([0.0; 3]);
    splats.sh[13] = [0.0, 4.5, 0.0];
    splats.position[9][1] = f32::NAN;
    let dirty = Encoded::new(&splats, clock);
    assert_eq!((dirty.len(), dirty.n_clamped_colors, dirty.n_clamped_harmonics), (9, 2, 1));
    std::fs::write(&path, bytes(&dirty)).unwrap();
    let read = FourDgs::read(&path).unwrap();
    assert_eq!((read.splats().unwrap().len(), read.clock()), (9, clock));
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
    for db in [42.0, 36.0, 30.0] {
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

/// A view from `eye` to the origin.
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
    let (width, height, fx, fy, cx, cy) = (640, 480, 500.0, 500.0, 320.0, 240.0);
    View { name: name.to_string(), world_to_camera, width, height, fx, fy, cx, cy, ..views[0].clone() }
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
        ivv::twin::color(&coefficients, to.map(|x| x / length))
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

/// Found by an hour of damaged files.
#[test]
fn a_degree_that_there_is_not_is_refused_before_anything_is_made_of_it() {
    let folder = Folder::new("four-dgs-degree");
    let path = folder.file("a.4dgs");
    let clock = Clock { fps: 30.0, frames: 30 };
    for sh_degree in [0, 1] {
        let splats = random::scene(3, 5, sh_degree);
        let mut bytes = Encoded::new(&splats, clock).bytes(&path, &contents(clock), Grades::default()).unwrap();
        // Magic, the header's opcode and length, flags; the writer's name; length, count, cutoff; the model's name; the box.
        let text =
            |bytes: &[u8], at: usize| at + 4 + u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let at = text(&bytes, text(&bytes, 21) + 24) + 48;
        assert_eq!(u32::from(bytes[at]), sh_degree);
        for degree in [4, 127, 255] {
            bytes[at] = degree;
            let told = fault(FourDgs::of_bytes(&path, &bytes), &path);
            assert!(told.contains("sh_degree") && told.contains(&degree.to_string()), "{told}");
        }
    }
}

#[test]
fn which_way_is_up_and_how_large_a_clip_is_are_kept_and_told_in_the_formats_own_words() {
    let folder = Folder::new("four-dgs-world");
    let (path, clock) = (folder.file("a.4dgs"), Clock { fps: 30.0, frames: 30 });
    let encoded = Encoded::new(&random::scene(3, 5, 0), clock);
    let write =
        |world: Option<World>| encoded.bytes(&path, &Contents { world, ..contents(clock) }, Grades::default()).unwrap();
    assert_eq!(FourDgs::of_bytes(&path, &write(None)).unwrap().world(), None);
    let down = [0.1, -0.97, 0.2];
    for (up, axis, forward) in
        [(down, 4, 2), ([0.0, 0.0, 2.0], 2, 0), ([-1.0, 0.5, 0.5], 3, 2), ([3.0, 1.0, 0.0], 0, 2)]
    {
        for metres_per_unit in [None, Some(1.0), Some(0.37)] {
            let world = World { up, metres_per_unit };
            let bytes = write(Some(world));
            assert_eq!(FourDgs::of_bytes(&path, &bytes).unwrap().world(), Some(world));
            let scene = fourdgs::read_from(&bytes[..], &fourdgs::ReadOptions::default()).unwrap();
            let frame = scene.provenance.frame().unwrap();
            assert_eq!((frame.handedness, frame.up_axis, frame.forward_axis), (1, axis, forward), "{up:?}");
            assert_eq!(
                (frame.metres_per_unit, frame.length_unit),
                match metres_per_unit {
                    None => (0.0, 0),
                    Some(1.0) => (1.0, 1),
                    Some(metres) => (metres, 0),
                }
            );
        }
    }
}

#[test]
fn a_quick_file_holds_the_same_in_more_bytes() {
    let folder = Folder::new("four-dgs-quick");
    let (path, clock) = (folder.file("a.4dgs"), Clock { fps: 30.0, frames: 30 });
    let encoded = Encoded::new(&random::scene(3, 3000, 1), clock);
    let write = |is_quick| encoded.bytes(&path, &Contents { is_quick, ..contents(clock) }, Grades::default()).unwrap();
    let (small, quick) = (write(false), write(true));
    assert!(quick.len() > small.len() && quick.len() < 2 * small.len(), "{} and {}", quick.len(), small.len());
    let [small, quick] = [small, quick].map(|bytes| FourDgs::of_bytes(&path, &bytes).unwrap().splats().unwrap());
    assert_eq!(quick, small);
}
