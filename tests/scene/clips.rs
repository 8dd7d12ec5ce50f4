//! Other projects' files of dynamic scenes, and glTF: what is written is read back, or read by hand.

use super::four_dgs::there_and_back;
use super::{Folder, fault, sample};
use crate::common::prelude::*;
use crate::common::random;
use ivv::internals::formats::{World, write_ftgs, write_glb, write_splatv};
use ivv::internals::scene::ALWAYS;
use serde_json::json;

const CLOCK: Clock = Clock { fps: 30.0, frames: 13 };

#[test]
fn a_ftgs_ply_has_88_bytes_a_gaussian_and_is_read_back() {
    let folder = Folder::new("ftgs");
    let path = folder.file("a.ftgs.ply");
    for (sh_degree, clock) in [(0, Some(CLOCK)), (3, None)] {
        let mut splats = random::scene(9, 40, sh_degree);
        splats.position[3][1] = f32::NAN;
        write_ftgs(&path, &splats, clock).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let end = bytes.windows(11).position(|line| line == b"end_header\n").unwrap() + 11;
        assert_eq!(bytes.len() - end, 39 * (88 + 12 * ((sh_degree as usize + 1).pow(2) - 1)));
        let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
        assert_eq!(header.contains("comment n_frames 13"), clock.is_some(), "{header}");
        let read = read_scene(&path).unwrap();
        read.check().unwrap();
        assert_eq!((read.len(), read.n_static), (39, splats.n_static - 1));
        assert_eq!(read.position[3..], splats.position[4..]);
        assert_eq!(
            (&read.opacity[3..], &read.sh[3 * read.n_coefficients()..]),
            (&splats.opacity[4..], &splats.sh[4 * splats.n_coefficients()..],)
        );
        for (told, found) in splats.motion.iter().zip(&read.motion) {
            let near = |a: f32, b: f32| (a - b).abs() <= 2e-6 * a.abs().max(1.0);
            let is_same = (0..3).all(|k| near(told.velocity[k], found.velocity[k]))
                && near(told.t_center, found.t_center)
                && near(told.t_scale, found.t_scale);
            assert!(is_same, "{told:?} is not {found:?}");
        }
    }
}

#[test]
fn a_ftgs_ply_is_at_each_of_its_frames_what_its_formula_says() {
    let folder = Folder::new("ftgs-formula");
    let path = folder.file("a.ftgs.ply");
    let mut splats = random::scene(2, 2, 0);
    splats.motion[0] = Motion { velocity: [3.0, 0.0, -1.0], t_center: 0.25, t_scale: 0.2_f32.ln() };
    write_ftgs(&path, &splats, Some(CLOCK)).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let number = |b: &[u8; 4]| f64::from(f32::from_le_bytes(*b));
    let row: Vec<f64> = bytes[bytes.len() - 88..].as_chunks().0.iter().map(number).collect();
    for frame in 0..CLOCK.frames {
        // Its frame i is at i / 12 of the sequence, ours at i / 13 of the clip.
        let (theirs, ours) = (f64::from(frame) / 12.0, f64::from(frame) / 13.0);
        let past = theirs - row[17];
        let weight = (-0.5 * (past / row[18].exp()).powi(2)).exp();
        assert!((weight - splats.weight_at(1, ours)).abs() < 1e-5, "frame {frame}: {weight}");
        let moved = splats.at(ours, 0.0);
        for axis in 0..3 {
            let place = row[axis] + row[19 + axis] * past;
            assert!((place - f64::from(moved.position[1][axis])).abs() < 1e-5, "frame {frame}: {place}");
        }
    }
}

#[test]
fn what_a_ftgs_ply_says_in_comments_is_done_or_refused() {
    let folder = Folder::new("ftgs-comments");
    let path = folder.file("a.ftgs.ply");
    write_ftgs(&path, &random::scene(2, 6, 0), None).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let with = |from: &str, to: &str| {
        let end = bytes.windows(10).position(|line| line == b"end_header").unwrap();
        let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
        assert!(header.contains(from), "{header}");
        folder.write("b.ftgs.ply", [header.replace(from, to).as_bytes(), &bytes[end..]].concat())
    };
    let still = read_scene(&with("use_velocity 1", "use_velocity 0")).unwrap();
    assert!(still.motion.iter().all(|motion| motion.velocity == [0.0; 3]));
    let long = read_scene(&with("min_duration 1e-30", "min_duration 2")).unwrap();
    assert!(long.motion.iter().all(|motion| motion.t_scale >= (2.0 * 2f32.sqrt()).ln() - 1e-6));
    for (from, to, place) in [
        ("ftgs_version 1", "ftgs_version 2", "ftgs_version"),
        ("time_units normalized", "time_units seconds", "time_units"),
        ("opacity_floor 0", "opacity_floor 0.1", "opacity_floor"),
        ("use_velocity 1", "use_velocity maybe", "use_velocity"),
        ("min_duration 1e-30", "min_duration -1", "min_duration"),
        ("ftgs_version 1", "ftgs_version 1\ncomment n_frames 2.5", "n_frames"),
    ] {
        let path = with(from, to);
        let refused = fault(read_scene(&path), &path);
        assert!(refused.contains(place), "{refused}");
    }
}

fn spacetime(motion: [f32; 9], omega: [f32; 4]) -> Vec<u8> {
    let mut names: Vec<String> =
        ["x", "y", "z", "trbf_center", "trbf_scale", "nx", "ny", "nz"].map(str::to_owned).into();
    let mut values = vec![1.0, 2.0, 3.0, 0.4, 0.1_f32.ln(), 0.0, 0.0, 0.0];
    let mut add = |name: &str, numbers: &[f32]| {
        names.extend((0..numbers.len()).map(|k| format!("{name}_{k}")));
        values.extend(numbers);
    };
    add("motion", &motion);
    add("f_dc", &[0.25, 0.5, 1.0]);
    add("scale", &[-2.0, -3.0, -4.0]);
    add("rot", &[1.0, 0.0, 0.0, 0.0]);
    add("omega", &omega);
    names.push("opacity".to_owned());
    values.push(1.5);
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let mut bytes =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex 1\n{properties}end_header\n").into_bytes();
    values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    bytes
}

#[test]
fn spacetime_gaussians_are_read_where_they_move_along_lines() {
    let folder = Folder::new("spacetime");
    let line = [0.5, -1.0, 0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let read = read_scene(&folder.write("a.ply", spacetime(line, [0.0; 4]))).unwrap();
    assert_eq!((read.n_static, read.position[0], read.opacity[0]), (0, [1.0, 2.0, 3.0], 1.5));
    let expected = Motion { velocity: [0.5, -1.0, 0.25], t_center: 0.4, t_scale: 0.1_f32.ln() };
    assert_eq!(read.motion, [expected]);
    // Colours are stored as they are.
    let color = read.sh[0].map(|dc| 0.5 + 0.282_094_79 * dc);
    assert!(color.iter().zip([0.25, 0.5, 1.0]).all(|(a, b)| (a - b).abs() < 1e-6), "{color:?}");
    let mut bent = line;
    bent[5] = 0.1;
    for bytes in [spacetime(bent, [0.0; 4]), spacetime(line, [0.0, 0.0, 1.0, 0.0])] {
        let path = folder.write("b.ply", bytes);
        let refused = fault(read_scene(&path), &path);
        assert!(refused.contains("row 0") && refused.contains("motion_3"), "{refused}");
    }
}

fn half(bytes: &[u8]) -> f64 {
    let bits = u16::from_le_bytes([bytes[0], bytes[1]]);
    let (sign, exponent, fraction) = (bits >> 15, i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let magnitude =
        if exponent == 0 { fraction * 2f64.powi(-24) } else { (1024.0 + fraction) * 2f64.powi(exponent - 25) };
    if sign == 1 { -magnitude } else { magnitude }
}

#[test]
fn a_splatv_holds_the_largest_first_and_cameras_as_3dgs_has_them() {
    let folder = Folder::new("splatv");
    let path = folder.file("a.splatv");
    let mut splats = random::scene(4, 6, 1);
    // A dynamic one that is largest by far, then a static one.
    splats.scale[5] = [1.0; 3];
    splats.opacity[5] = 2.0;
    splats.motion[2] = Motion { velocity: [0.5, -0.25, 2.0], t_center: 0.625, t_scale: 0.125_f32.ln() };
    splats.scale[0] = [0.5; 3];
    splats.opacity[0] = 2.0;
    let view = demo().1.remove(1);
    assert!(fault(write_splatv(&path, &splats, &[]), &path).contains("--cameras"));
    write_splatv(&path, &splats, std::slice::from_ref(&view)).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|k| bytes[at + k])) as usize;
    assert_eq!(word(0), 0x674b);
    let chunks: Value = serde_json::from_slice(&bytes[8..8 + word(4)]).unwrap();
    let rows = &bytes[8 + word(4)..];
    assert_eq!(
        (&chunks[0]["type"], &chunks[0]["texwidth"], &chunks[0]["texheight"]),
        (&"splat".into(), &4096.into(), &1.into())
    );
    assert_eq!((rows.len(), &chunks[0]["size"]), (4096 * 16, &(4096 * 16).into()));
    let float = |row: usize, at: usize| f32::from_le_bytes(std::array::from_fn(|k| rows[64 * row + 4 * at + k]));
    assert_eq!([0, 1, 2].map(|k| float(0, k)), splats.position[5]);
    assert_eq!([0, 1, 2].map(|k| float(1, k)), splats.position[0]);
    let halves = |row: usize, from: usize, n: usize| -> Vec<f64> {
        (0..n).map(|k| half(&rows[64 * row + from + 2 * k..])).collect()
    };
    // Words 8 and on: velocity, bending, turning; at the end centre and tau.
    assert_eq!(halves(0, 32, 3), [0.5, -0.25, 2.0]);
    assert!(halves(0, 38, 11).iter().all(|v| *v == 0.0));
    assert_eq!(halves(0, 60, 2), [0.625, 0.125]);
    assert_eq!(halves(1, 60, 2)[1], 65504.0);
    assert!((halves(0, 20, 3)[0] - 1f64.exp()).abs() < 2e-3, "{:?}", halves(0, 20, 3));
    let alpha = f64::from(rows[31]) / 255.0;
    assert!((alpha - 1.0 / (1.0 + (-2f64).exp())).abs() < 0.5 / 255.0 + 1e-9, "{alpha}");
    // World to camera again: the transpose of its axes, and minus that times its place.
    let camera = &chunks[0]["cameras"][0];
    for row in 0..3 {
        let of = |k: usize| camera["rotation"][k][row].as_f64().unwrap();
        let shift: f64 = -(0..3).map(|k| of(k) * camera["position"][k].as_f64().unwrap()).sum::<f64>();
        assert!((0..3).all(|k| (of(k) - view.pose.rows()[row][k]).abs() < 1e-12));
        assert!((shift - view.pose.rows()[row][3]).abs() < 1e-12);
    }
}

fn accessor(document: &Value, binary: &[u8], name: &str) -> Vec<Vec<f64>> {
    let index = document["meshes"][0]["primitives"][0]["attributes"][name].as_u64().unwrap() as usize;
    let accessor = &document["accessors"][index];
    let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let number = |key: &str| view[key].as_u64().unwrap() as usize;
    let bytes = &binary[number("byteOffset")..number("byteOffset") + number("byteLength")];
    let n = match accessor["type"].as_str().unwrap() {
        "SCALAR" => 1,
        "VEC3" => 3,
        _ => 4,
    };
    assert_eq!(accessor["count"].as_u64().unwrap() as usize * n * 4, bytes.len(), "{name}");
    let floats: Vec<f64> = bytes.as_chunks().0.iter().map(|b: &[u8; 4]| f64::from(f32::from_le_bytes(*b))).collect();
    floats.chunks(n).map(<[f64]>::to_vec).collect()
}

fn document_of(glb: &[u8]) -> Value {
    let length = u32::from_le_bytes(std::array::from_fn(|k| glb[12 + k])) as usize;
    serde_json::from_slice(&glb[20..20 + length]).unwrap()
}

#[test]
fn a_glb_stands_upright_in_metres_where_the_scene_says_how() {
    let folder = Folder::new("glb-world");
    let path = folder.file("a.glb");
    let splats = sample(1, 5, 0);
    for (up, metres_per_unit) in [
        ([0.0, 1.0, 0.0], Some(0.5)),
        ([0.0, -1.0, 0.0], None),
        ([0.1, -0.97, 0.2], Some(3.0)),
        ([0.0, 0.0, 2.0], None),
    ] {
        write_glb(&path, &splats, Some(World { up, metres_per_unit })).unwrap();
        let node = document_of(&std::fs::read(&path).unwrap())["nodes"][0].clone();
        let rotation: [f64; 4] = serde_json::from_value(node["rotation"].clone()).unwrap();
        // The direction in glTF's axes, as positions are stored, and then as the node turns it.
        let turned = glam::DQuat::from_array(rotation) * glam::DVec3::new(up[0], -up[1], -up[2]).normalize();
        assert!((turned - glam::DVec3::Y).length() < 1e-9, "{up:?}: {turned}");
        assert_eq!(node.get("scale").cloned(), metres_per_unit.map(|metres| json!([metres, metres, metres])));
    }
    // Half a turn and the same back: nothing stands otherwise than it did.
    write_glb(&path, &splats, Some(World { up: [0.0, 1.0, 0.0], metres_per_unit: None })).unwrap();
    assert_eq!(document_of(&std::fs::read(&path).unwrap())["nodes"][0]["rotation"], json!([1.0, 0.0, 0.0, 0.0]));
}

#[test]
fn a_glb_is_the_scene_in_the_axes_of_gltf() {
    let folder = Folder::new("glb");
    let path = folder.file("a.glb");
    let splats = Splats { source_row: (0..20).collect(), ..sample(2, 20, 0) };
    write_glb(&path, &splats, None).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|k| bytes[at + k])) as usize;
    assert_eq!((&bytes[..4], word(4), word(8)), (b"glTF".as_slice(), 2, bytes.len()));
    let document = document_of(&bytes);
    assert_eq!(document["nodes"], json!([{ "mesh": 0 }]), "nobody knows which way is up");
    let binary = &bytes[28 + word(12)..];
    assert_eq!((&bytes[16..20], word(20 + word(12)) % 4), (b"JSON".as_slice(), 0));
    let primitive = &document["meshes"][0]["primitives"][0];
    assert_eq!(primitive["extensions"]["KHR_gaussian_splatting"]["kernel"], "ellipse");
    let place = accessor(&document, binary, "POSITION");
    let of = |name: &str| accessor(&document, binary, &format!("KHR_gaussian_splatting:{name}"));
    let (scale, rotation, opacity) = (of("SCALE"), of("ROTATION"), of("OPACITY"));
    for i in 0..20 {
        let [x, y, z] = splats.position[i].map(f64::from);
        assert_eq!(place[i], [x, -y, -z]);
        assert!((scale[i][1] - f64::from(splats.scale[i][1]).exp()).abs() < 1e-5 * scale[i][1]);
        let sigmoid = 1.0 / (1.0 + (-f64::from(splats.opacity[i])).exp());
        assert!((opacity[i][0] - sigmoid).abs() < 1e-6);
        // A unit axis turned by both, the one half a turn about x after the other.
        let turned = |q: [f64; 4]| {
            let [w, x, y, z] = q.map(|v| v / q.iter().map(|v| v * v).sum::<f64>().sqrt());
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
        };
        let [a, b] =
            [splats.rotation[i].map(f64::from), [rotation[i][3], rotation[i][0], rotation[i][1], rotation[i][2]]];
        let (a, b) = (turned(a), turned(b));
        // The first axis of the one is that of the other, since half a turn leaves it; its sign is free.
        let dot = a[0] * b[0] - a[1] * b[1] - a[2] * b[2];
        assert!((dot.abs() - 1.0).abs() < 1e-6, "{i}: {dot}");
    }
    // Colours in a direction are the same in both axes: d in ours is (x, -y, -z) in glTF's.
    let all: Vec<Vec<Vec<f64>>> = [(0, 0), (1, 0), (1, 1), (1, 2), (2, 0), (2, 1), (2, 2), (2, 3), (2, 4)]
        .map(|(l, n)| of(&format!("SH_DEGREE_{l}_COEF_{n}")))
        .into();
    let basis = |[x, y, z]: [f64; 3]| {
        [
            0.282_094_79,
            -0.488_602_51 * y,
            0.488_602_51 * z,
            -0.488_602_51 * x,
            1.092_548_43 * x * y,
            -1.092_548_43 * y * z,
            0.315_391_57 * (2.0 * z * z - x * x - y * y),
            -1.092_548_43 * x * z,
            0.546_274_22 * (x * x - y * y),
        ]
    };
    let direction = [0.48, -0.6, 0.64];
    let [x, y, z] = direction;
    for (i, own) in splats.sh.chunks(9).enumerate() {
        let ours: f64 = basis(direction).iter().enumerate().map(|(c, b)| b * f64::from(own[c][1])).sum();
        let theirs: f64 = basis([x, -y, -z]).iter().enumerate().map(|(c, b)| b * all[c][i][1]).sum();
        assert!((ours - theirs).abs() < 1e-5, "{i}: {ours} and {theirs}");
    }
    let limits = document["accessors"][0]["max"][1].as_f64().unwrap();
    assert_eq!(limits, place.iter().map(|p| p[1]).fold(f64::NEG_INFINITY, f64::max));
}

#[test]
fn when_gaussians_are_there_is_kept_or_refused() {
    let folder = Folder::new("clips-spans");
    let mut splats = Splats { source_row: (0..30).collect(), ..random::scene(5, 30, 1) };
    let n = splats.motion.len();
    assert!(n > 8);
    let spans = [ALWAYS, [0.25, 0.75], [f32::NEG_INFINITY, 0.5], [0.5, f32::INFINITY]];
    splats.span = (0..n).map(|k| spans[k % 4]).collect();
    for (k, motion) in splats.motion.iter_mut().enumerate() {
        // Seen all over the clip, so that a span shows. One rests and never fades, and is not static: it is not always there.
        (motion.t_center, motion.t_scale) = (0.5, if k == 1 { f32::INFINITY } else { 1.0 });
        motion.velocity = if k == 1 { [0.0; 3] } else { motion.velocity };
    }
    let path = folder.file("a.ply");
    write_ply(&path, &splats).unwrap();
    assert_eq!(read_scene(&path).unwrap(), splats);
    let text = String::from_utf8_lossy(&std::fs::read(&path).unwrap()).into_owned();
    assert!(text.contains("property float t_scale\nproperty float t_from\nproperty float t_to\nend_header"));

    let clip = folder.file("a.4dgs");
    let read = there_and_back(&clip, &splats, CLOCK, Grades::default());
    assert_eq!((read.len(), read.n_static), (splats.len(), splats.n_static));
    for time in [0.0, 0.1, 0.249, 0.25, 0.4, 0.499, 0.5, 0.74, 0.75, 0.99] {
        let n_there = |splats: &Splats| (0..splats.len()).filter(|&i| splats.is_there(i, time)).count();
        assert_eq!(n_there(&read), n_there(&splats), "at {time}");
        assert_eq!(splats.at(time, 0.0).len(), n_there(&splats));
    }

    let view = random::view();
    for refused in [
        fault(write_ftgs(&folder.file("a.ftgs.ply"), &splats, None), &folder.file("a.ftgs.ply")),
        fault(write_splatv(&folder.file("a.splatv"), &splats, std::slice::from_ref(&view)), &folder.file("a.splatv")),
    ] {
        assert!(refused.contains("appear or disappear at once") && refused.contains(".4dgs"), "{refused}");
    }
    // On another clock, and behind a scene without spans.
    let moved = splats.clone().on_clock(0.5, 0.25);
    assert_eq!(moved.span[1], [0.375, 0.625]);
    assert!((moved.weight_at(splats.n_static + 3, 0.6) - splats.weight_at(splats.n_static + 3, 0.7)).abs() < 1e-6);
    assert_eq!(moved.weight_at(splats.n_static + 1, 0.3), 0.0);
    let [few, wrong] = [vec![ALWAYS; n - 1], vec![]].map(|span| Splats { span, ..splats.clone() }.check());
    assert!(few.unwrap_err().contains("span has") && wrong.is_ok());
}
