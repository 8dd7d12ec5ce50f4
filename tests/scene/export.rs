//! Exported scenes: what is written is read back within the errors that the writers state.

use super::{Folder, fault, sample};
use crate::common::prelude::*;
use crate::common::program::{command, done};
use crate::common::random;
use ivv::internals::formats::{Clip, Contents, Scene, Sound, Sounds, WriteOptions, read, write, write_splat};

/// Static Gaussians of degree `sh_degree` with harmonics that SPZ can hold, rows in another order than the arrays.
fn exportable(sh_degree: u32, n: usize) -> Splats {
    let mut splats = sample(sh_degree, n, 0);
    let k = splats.n_coefficients();
    for (at, coefficient) in splats.sh.iter_mut().enumerate().filter(|(at, _)| at % k != 0) {
        *coefficient = coefficient.map(|c| c * 0.38 - 0.004 * (at % 7) as f32);
    }
    splats.source_row.reverse();
    splats
}

/// Largest differences of what `splats` and `read`, whose rows are in order, say of the same Gaussians.
struct Errors {
    position: f32,
    scale: f32,
    rotation: f32,
    opacity: f32,
    dc: f32,
    rest: f32,
}

fn errors(splats: &Splats, read: &Splats) -> Errors {
    assert_eq!((read.len(), read.n_static), (splats.len(), splats.len()));
    let mut e = Errors { position: 0.0, scale: 0.0, rotation: 0.0, opacity: 0.0, dc: 0.0, rest: 0.0 };
    let sigmoid = |o: f32| 1.0 / (1.0 + (-o).exp());
    let unit = |q: [f32; 4]| q.map(|v| v / q.iter().map(|v| v * v).sum::<f32>().sqrt());
    let worse = |e: &mut f32, a: &[f32], b: &[f32]| {
        *e = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(*e, f32::max);
    };
    let k = [splats.n_coefficients(), read.n_coefficients()];
    for i in 0..splats.len() {
        let row = splats.source_row[i] as usize;
        worse(&mut e.position, &splats.position[i], &read.position[row]);
        worse(&mut e.scale, &splats.scale[i], &read.scale[row]);
        worse(&mut e.opacity, &[sigmoid(splats.opacity[i])], &[sigmoid(read.opacity[row])]);
        worse(&mut e.dc, &splats.sh[i * k[0]], &read.sh[row * k[1]]);
        // q and -q are one rotation.
        let (a, b) = (unit(splats.rotation[i]), unit(read.rotation[row]));
        let sign = if a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>() < 0.0 { -1.0 } else { 1.0 };
        worse(&mut e.rotation, &a, &b.map(|v| sign * v));
        if k[0] == k[1] {
            let rest = |s: &Splats, i: usize| s.sh[i * k[0] + 1..(i + 1) * k[0]].as_flattened().to_vec();
            worse(&mut e.rest, &rest(splats, i), &rest(read, row));
        }
    }
    e
}

#[test]
fn an_spz_holds_every_degree_within_the_errors_it_states() {
    let folder = Folder::new("write-spz");
    for (sh_degree, version) in (0..=3).flat_map(|degree| [(degree, SpzVersion::V3), (degree, SpzVersion::V4)]) {
        let splats = exportable(sh_degree, 200);
        let path = folder.file("a.spz");
        write_spz(&path, &splats, version, None).unwrap();
        let read = read_scene(&path).unwrap();
        assert_eq!(read.sh_degree, sh_degree);
        let e = errors(&splats, &read);
        // The largest coordinate is below 4.
        assert!(e.position > 0.0 && e.position <= 4.0 * 2f32.powi(-24) * 1.01, "position {}", e.position);
        assert!(e.scale > 0.0 && e.scale <= 1.0 / 32.0 + 1e-6, "scale {}", e.scale);
        assert!(e.rotation > 0.0 && e.rotation <= 0.003, "rotation {}", e.rotation);
        assert!(e.opacity <= 1.0 / 510.0 + 1e-6, "opacity {}", e.opacity);
        assert!(e.dc > 0.0 && e.dc <= 1.0 / 76.5 + 1e-6, "dc {}", e.dc);
        assert!(e.rest <= 1.0 / 256.0 + 1e-6 && (e.rest > 0.0) == (sh_degree > 0), "rest {}", e.rest);
        let again = folder.file("b.spz");
        write_spz(&again, &read, version, None).unwrap();
        assert_eq!(read_scene(&again).unwrap().position, read.position, "what was read is written without loss");
    }
}

#[test]
fn a_splat_file_holds_degree_0_within_the_errors_it_states() {
    let folder = Folder::new("write-splat");
    let mut splats = exportable(2, 200);
    // Colours within [0, 1].
    splats.sh.iter_mut().for_each(|c| *c = c.map(|c| 0.6 * c));
    let path = folder.file("a.splat");
    write_splat(&path, &splats).unwrap();
    let read = read_scene(&path).unwrap();
    assert_eq!(read.sh_degree, 0);
    let e = errors(&splats, &read);
    assert_eq!(e.position, 0.0);
    assert!(e.scale < 1e-5 && e.opacity <= 1.0 / 510.0 + 1e-6, "scale {}, opacity {}", e.scale, e.opacity);
    assert!(e.dc > 0.0 && 0.2821 * e.dc <= 1.0 / 510.0 + 1e-4, "dc {}", e.dc);
    assert!(e.rotation > 0.0 && e.rotation <= 0.012, "rotation {}", e.rotation);
}

#[test]
fn what_a_format_cannot_hold_is_refused_or_left_out() {
    let folder = Folder::new("write-refused");
    let dynamic = sample(1, 3, 2);
    for (name, write) in [
        (
            "a.spz",
            (|path, splats| write_spz(path, splats, SpzVersion::V3, None)) as fn(&Path, &Splats) -> ivv::Result<()>,
        ),
        ("b.spz", |path, splats| write_spz(path, splats, SpzVersion::V4, None)),
        ("a.splat", write_splat),
    ] {
        let path = folder.file(name);
        assert!(fault(write(&path, &dynamic), &path).contains("2 dynamic Gaussians"));
        assert!(fault(write(&path, &Splats::new(1)), &path).contains("there is no Gaussian to write"), "{name}");
        assert!(!path.exists());
        let mut broken = exportable(1, 4);
        broken.position[1] = [0.0, f32::NAN, 0.0];
        write(&path, &broken).unwrap();
        assert_eq!(read_scene(&path).unwrap().len(), 3, "{name}");
    }
    let mut far = exportable(0, 2);
    far.position[0][2] = 9e6;
    let path = folder.file("far.spz");
    assert!(fault(write_spz(&path, &far, SpzVersion::V3, None), &path).contains("9000000"));
    far.position[0][2] = 8e6;
    write_spz(&path, &far, SpzVersion::V3, None).unwrap();
    assert!(read_scene(&path).unwrap().position.iter().any(|p| p[2] == 8e6));
}

/// What the program tells of an export of `from`, with and without --json.
fn told(from: &Path, to: &Path, more: &[&str]) -> (Value, String) {
    let export = |last: &[&str]| done(command(&["export"]).arg(from).arg("-o").arg(to).args(more).args(last));
    (serde_json::from_str(&export(&["--json"])).unwrap(), export(&[]))
}

#[test]
fn an_export_tells_how_many_gaussians_it_wrote() {
    let folder = Folder::new("export-told");
    let mut still = exportable(0, 4);
    // Colours within [0, 1].
    still.sh.iter_mut().for_each(|c| *c = c.map(|c| 0.6 * c));
    let mut moving = sample(0, 3, 2);
    moving.sh.fill([0.2; 3]);
    still.scale[1][2] = f32::NAN;
    (moving.position[0][1], moving.motion[1].t_center) = (f32::NAN, f32::NAN);
    let [of_still, of_moving] = [("still.ply", &still), ("moving.ply", &moving)].map(|(name, splats)| {
        let path = folder.file(name);
        write_ply(&path, splats).unwrap();
        path
    });
    for (from, name, n, n_dynamic) in [
        (&of_still, "a.splat", 3, 0),
        (&of_still, "a.spz", 3, 0),
        (&of_still, "a.glb", 3, 0),
        (&of_still, "a.4dgs", 3, 0),
        (&of_still, "a.ply", 4, 0),
        (&of_moving, "b.ftgs.ply", 3, 1),
        (&of_moving, "b.4dgs", 3, 1),
        (&of_moving, "b.ply", 5, 2),
    ] {
        let to = folder.file(name);
        let clip: &[&str] = if name == "b.4dgs" { &["--seconds", "1"] } else { &[] };
        let (report, text) = told(from, &to, clip);
        let found = [&report["gaussians"], &report["dynamic_gaussians"]].map(Value::as_u64);
        assert_eq!(found, [Some(n), Some(n_dynamic)], "{name}");
        let of = if from == &of_still { 4 } else { 5 };
        assert!(text.contains(&format!("{n} of {of} Gaussians, {n_dynamic} of them dynamic")), "{text}");
        // Nobody else counts them in that.
        if name == "a.splat" {
            assert_eq!(std::fs::metadata(&to).unwrap().len(), 32 * n);
        } else if !name.ends_with("glb") {
            assert_eq!(read_scene(&to).unwrap().len() as u64, n, "{name}");
        }
    }
}

#[cfg(unix)]
#[test]
fn an_export_removes_what_killed_ones_left_and_nothing_that_is_being_written() {
    let folder = Folder::new("export-left");
    write_ply(&folder.file("scene.ply"), &demo().0).unwrap();
    std::fs::create_dir(folder.file("web")).unwrap();
    let export = |to: &str| {
        done(command(&["export", "scene.ply", "--seconds", "1", "-o", to]).current_dir(&folder.0));
    };
    for (to, within) in [("s.4dgs", ""), ("./s.html", ""), ("web/", "web/")] {
        let left = folder.write(&format!("{within}.s.ply.1-0.tmp"), "half");
        let held = folder.write(&format!("{within}.t.ply.1-0.tmp"), "half");
        let lock = std::fs::File::open(&held).unwrap();
        lock.lock().unwrap();
        export(to);
        assert!(!left.exists() && held.exists(), "{to}");
    }
}

/// JSON is text, and not every name of a file is.
#[cfg(target_os = "linux")]
#[test]
fn a_file_whose_name_is_not_utf_8_is_told_of_in_json() {
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::new("export-name");
    let from = folder.file("scene.ply");
    write_ply(&from, &exportable(0, 4)).unwrap();
    let to = folder.0.join(std::ffi::OsStr::from_bytes(b"caf\xe9.ply"));
    let (report, _) = told(&from, &to, &[]);
    assert!(report["path"].as_str().is_some_and(|path| path.ends_with("caf\u{fffd}.ply")), "{report}");
    assert_eq!(report["gaussians"], 4);
}

#[test]
fn a_snapshot_is_the_scene_at_its_time() {
    let folder = Folder::new("snapshot");
    let mut splats = sample(1, 2, 3);
    let motion = |velocity, t_center, t_scale| Motion { velocity, t_center, t_scale };
    splats.motion[0] = motion([2.0, -4.0, 1.0], 0.5, 0.25_f32.ln());
    splats.motion[1] = motion([1.0, 0.0, 0.0], 0.25, f32::INFINITY);
    // Gone long before.
    splats.motion[2] = motion([0.0; 3], -3.0, 0.1_f32.ln());
    splats.opacity = vec![0.5, 20.0, 1.5, 40.0, 3.0];
    let still = splats.at(0.75, 1.0 / 255.0);
    still.check().unwrap();
    assert_eq!((still.len(), still.n_static), (4, 4));
    let of = |i: usize| {
        let rows: Vec<u32> = splats.source_row[..4].to_vec();
        rows.iter().filter(|row| **row < splats.source_row[i]).count()
    };
    let p = splats.position[2];
    assert_eq!(still.position[of(2)], [p[0] + 0.5, p[1] - 1.0, p[2] + 0.25]);
    let expected = 1.0 / (1.0 + (-1.5_f64).exp()) * (-1.0_f64).exp();
    let found = 1.0 / (1.0 + (-f64::from(still.opacity[of(2)])).exp());
    assert!((found - expected).abs() < 1e-7, "{found} for {expected}");
    // No fading, no change: not even of a logit whose sigmoid is 1.
    assert_eq!((still.opacity[of(3)], still.opacity[of(1)]), (40.0, 20.0));
    assert_eq!(still.position[of(3)][0], splats.position[3][0] + 0.5);
    let path = folder.file("at.ply");
    write_ply(&path, &still).unwrap();
    assert_eq!(read_ply(&path).unwrap(), still);
    assert!(!String::from_utf8_lossy(&std::fs::read(&path).unwrap()).contains("velocity"), "a plain 3DGS PLY");
}

#[test]
fn a_snapshot_renders_as_the_scene_does_at_its_time() {
    let gpu = gpu();
    let splats = random::scene(11, 300, 2);
    let view = random::view();
    let time = view.time + view.time_offset * view.flow_dt;
    let render = |splats: &Splats| {
        let mut renderer = Renderer::new(gpu.clone(), splats, Constants::default()).unwrap();
        renderer.render(&view, Outputs::Color).unwrap().0.color
    };
    let still = splats.at(time, Constants::default().alpha_min);
    assert!(still.len() < splats.len(), "something is not visible then");
    let (moving, still) = (render(&splats), render(&still));
    let largest =
        moving.as_flattened().iter().zip(still.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // Rounding alone, but for a pixel where it carries a Gaussian over alpha_min.
    assert!(largest < 1.0 / 200.0, "{largest}");
    let mean = moving.as_flattened().iter().zip(still.as_flattened()).map(|(a, b)| (a - b).abs()).sum::<f32>();
    assert!(mean / (3 * moving.len()) as f32 <= 1e-6, "{}", mean / (3 * moving.len()) as f32);
}

#[test]
fn one_call_writes_what_each_format_writes_and_says_what_is_lost() {
    let folder = Folder::new("write-any");
    let mut splats = exportable(0, 5);
    splats.sh.iter_mut().for_each(|c| *c = c.map(|c| 0.6 * c));
    let clip = Clip { constants: Constants { near: 0.375, ..Constants::default() }, ..Clip::default() };
    let scene = Scene { splats: splats.clone(), clip, notes: Vec::new() };
    let bytes = |name: &str| std::fs::read(folder.file(name)).unwrap();
    let any = |name: &str, scene: &Scene| write(folder.file(name), scene, &WriteOptions::default()).unwrap();
    let lost = "the format spz has no place for near 0.375; viewers use theirs";
    assert_eq!(any("a.spz", &scene).notes, [lost]);
    write_spz(&folder.file("b.spz"), &splats, SpzVersion::V3, None).unwrap();
    assert_eq!(bytes("a.spz"), bytes("b.spz"));
    assert!(any("a.PLY", &scene).notes.is_empty());
    let back = read(folder.file("a.PLY")).unwrap();
    assert_eq!((back.clip.constants.near, back.splats.len()), (0.375, 5));

    // A .4dgs holds all of the clip, and other formats say that they have no place for sound.
    let sound =
        Sound { name: "a".into(), wav: vec![1], gain: 1.0, start: 0.0, seconds: 1.0, places: vec![(0.0, [0.0; 3])] };
    let sounds = Sounds::new([0.0; 3], 0.2, vec![sound]);
    let clock = Clock { fps: 10.0, frames: 20 };
    let scene = Scene { clip: Clip { clock: Some(clock), sounds, ..scene.clip }, ..scene };
    let written = any("a.4dgs", &scene);
    assert_eq!((written.n, written.n_dynamic, written.bytes), (5, 0, bytes("a.4dgs").len() as u64));
    let contents = Contents {
        clock,
        views: &[],
        own: ivv::internals::formats::own(&scene.clip.constants, [0.0; 3]),
        sounds: &scene.clip.sounds,
        world: None,
        cutoff: None,
        is_quick: false,
    };
    let path = folder.file("b.4dgs");
    assert_eq!(bytes("a.4dgs"), Encoded::new(&splats, clock).bytes(&path, &contents, Grades::default()).unwrap());
    let back = read(folder.file("a.4dgs")).unwrap();
    assert_eq!((back.clip.clock, back.clip.sounds.len(), back.clip.constants.near), (Some(clock), 1, 0.375));
    assert_eq!(any("c.splat", &scene).notes[1], "the format splat has no place for sound");

    // A clip without a clock, and an ending that no format has.
    let moving = Scene::from(sample(0, 3, 2));
    let refused = |name: &str| {
        let path = folder.file(name);
        fault(write(&path, &moving, &WriteOptions::default()), &path)
    };
    assert!(refused("d.4dgs").contains("expected the clock of the clip"));
    assert!(refused("d.obj").contains(".4dgs, .ply, .ftgs.ply, .splatv, .spz, .glb, .splat"));
    write(folder.file("d.4dgs"), &moving, &WriteOptions { clamp_colors: true, ..WriteOptions::at(0.5) }).unwrap();
}
