//! Formats of other projects: compressed PLY, SPZ, `.splat`.

use super::{Folder, fault};
use crate::common::prelude::*;
use ivv::internals::formats::World;
use std::io::Write;

/// What the quantisation of both formats can tell apart on the model they share.
#[derive(Debug, Default)]
struct Difference {
    position: f64,
    log_scale: f64,
    angle: f64,
    color: f64,
    opacity: f64,
}

/// Means over all Gaussians of the absolute differences; the angle in radians.
fn difference(a: &Splats, b: &Splats) -> Difference {
    let mut sum = Difference::default();
    let mean3 = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| f64::from((a[k] - b[k]).abs())).sum::<f64>() / 3.0;
    let sigmoid = |o: f32| 1.0 / (1.0 + f64::from(-o).exp());
    let k = [a.n_coefficients(), b.n_coefficients()];
    for i in 0..a.len() {
        sum.position += mean3(a.position[i], b.position[i]);
        sum.log_scale += mean3(a.scale[i], b.scale[i]);
        sum.color += mean3(a.sh[i * k[0]], b.sh[i * k[1]]) * 0.282;
        sum.opacity += (sigmoid(a.opacity[i]) - sigmoid(b.opacity[i])).abs();
        let dot: f64 = (0..4).map(|k| f64::from(a.rotation[i][k]) * f64::from(b.rotation[i][k])).sum();
        sum.angle += 2.0 * dot.abs().min(1.0).acos();
    }
    let n = a.len() as f64;
    Difference {
        position: sum.position / n,
        log_scale: sum.log_scale / n,
        angle: sum.angle / n,
        color: sum.color / n,
        opacity: sum.opacity / n,
    }
}

#[test]
fn the_same_model_as_compressed_ply_and_as_spz_is_the_same_scene() {
    let Some(ply) = shared("data/splat_playcanvas/biker.compressed.ply") else { return };
    let Some(spz) = shared("data/splat_playcanvas/biker.spz") else { return };
    let (ply, spz) = (read_scene(&ply).unwrap(), read_scene(&spz).unwrap());
    for scene in [&ply, &spz] {
        scene.check().unwrap();
        assert_eq!((scene.len(), scene.n_static, scene.sh_degree), (152_746, 152_746, 0));
        let summary = scene.summary();
        assert_eq!(summary.n_non_finite, 0);
        let bounds = summary.bounds.unwrap();
        assert!((0..3).all(|k| bounds.p99[k] - bounds.p01[k] > 0.1 && bounds.max[k] - bounds.min[k] < 100.0));
        assert!(summary.opacity.unwrap().p50 > 0.05);
    }
    let found = difference(&ply, &spz);
    // Half a step of the coarser format: 11 bits of a chunk, 1/16 in log scale, 9 bits, 8 bits of 1/0.15; the opacities
    // are the same bytes.
    assert!(found.position < 2e-4 && found.position > 0.0, "{found:?}");
    assert!(found.log_scale < 1.0 / 32.0 && found.angle < 0.004 && found.color < 0.004, "{found:?}");
    assert_eq!(found.opacity, 0.0);
    let worst =
        (0..ply.len()).map(|i| (0..3).map(|k| (ply.position[i][k] - spz.position[i][k]).abs()).fold(0.0, f32::max));
    assert!(worst.fold(0.0, f32::max) < 0.02);
}

#[test]
fn every_version_of_spz_gives_the_same_four_gaussians() {
    let Some(folder) = shared("data/splat_fixtures") else { return };
    let splat = read_scene(&folder.join("minimal.splat")).unwrap();
    assert_eq!((splat.len(), splat.n_static, splat.sh_degree), (4, 4, 0));
    assert_eq!(splat.position[0], [-1.0, 0.0, -1.0]);
    assert!((splat.scale[0][0] - 0.1_f32.ln()).abs() < 1e-6);
    for version in ["raw", "v2", "v3", "v4"] {
        let scene = read_scene(&folder.join(format!("minimal-{version}.spz"))).unwrap();
        scene.check().unwrap();
        // The files of version 2 were made without the turn of axes, so their z comes out the other way.
        let sign = if matches!(version, "raw" | "v2") { -1.0 } else { 1.0 };
        let expected: Vec<[f32; 3]> = splat.position.iter().map(|&[x, y, z]| [x, y, sign * z]).collect();
        assert_eq!(scene.position, expected, "{version}");
        assert_eq!(scene.opacity, splat.opacity, "{version}");
        assert!(scene.rotation.iter().all(|q| q[0] > 0.999), "{version}: {:?}", scene.rotation);
        assert!((scene.scale[0][0].exp() - 0.1).abs() < 0.01);
    }
}

/// A version-3 SPZ of one Gaussian of the given degree with the given rotation and harmonics, gzipped.
fn spz(degree: u8, rotation: u32, rest: &[u8]) -> Vec<u8> {
    gzip(&raw_spz(degree, rotation, rest))
}

pub fn raw_spz(degree: u8, rotation: u32, rest: &[u8]) -> Vec<u8> {
    let mut raw = b"NGSP".to_vec();
    raw.extend(3_u32.to_le_bytes());
    raw.extend(1_u32.to_le_bytes());
    raw.extend([degree, 8, 0, 0]);
    // (1, 2, -3) in units of 1/256.
    raw.extend([0, 1, 0, 0, 2, 0, 0, 0xfd, 0xff]);
    raw.extend([128, 0, 128, 255, 160, 144, 128]);
    raw.extend(rotation.to_le_bytes());
    raw.extend(rest);
    raw
}

pub fn gzip(raw: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(raw).unwrap();
    encoder.finish().unwrap()
}

/// The value of degree 0 to 3 in direction (x, y, z), 3DGS's basis, one channel.
fn harmonics(sh: &[[f32; 3]], [x, y, z]: [f64; 3]) -> f64 {
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let basis = [
        0.282_094_791_773_878_14,
        -0.488_602_511_902_919_9 * y,
        0.488_602_511_902_919_9 * z,
        -0.488_602_511_902_919_9 * x,
        1.092_548_430_592_079_2 * x * y,
        -1.092_548_430_592_079_2 * y * z,
        0.315_391_565_252_520_05 * (2.0 * zz - xx - yy),
        -1.092_548_430_592_079_2 * x * z,
        0.546_274_215_296_039_6 * (xx - yy),
        -0.590_043_589_926_643_5 * y * (3.0 * xx - yy),
        2.890_611_442_640_554 * x * y * z,
        -0.457_045_799_464_465_8 * y * (4.0 * zz - xx - yy),
        0.373_176_332_590_115_4 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.457_045_799_464_465_8 * x * (4.0 * zz - xx - yy),
        1.445_305_721_320_277 * z * (xx - yy),
        -0.590_043_589_926_643_5 * x * (xx - 3.0 * yy),
    ];
    sh.iter().zip(basis).map(|(c, b)| f64::from(c[0]) * b).sum()
}

#[test]
fn the_axes_of_spz_are_turned_with_everything_that_depends_on_them() {
    let folder = Folder::new("spz-axes");
    // x, y and z are 0.2, -0.3 and 0.4 of 1/sqrt(2): a sign and nine bits each; w is the largest.
    let rotation = 3 << 30 | 102 << 20 | (0x200 | 153) << 10 | 204;
    let rest: Vec<u8> = (0..45).map(|i| 128_u8.wrapping_add((i * 37 % 101) as u8).wrapping_sub(50)).collect();
    let scene = read_scene(&folder.write("a.spz", spz(3, rotation, &rest))).unwrap();
    assert_eq!(scene.position, [[1.0, -2.0, 3.0]]);
    let [w, x, y, z] = scene.rotation[0].map(|v| f64::from(v) * std::f64::consts::SQRT_2);
    assert!(w > 1.2 && (x - 0.2).abs() < 2e-3 && (y - 0.3).abs() < 2e-3 && (z + 0.4).abs() < 2e-3);
    assert_eq!(scene.scale, [[0.0, -1.0, -2.0]]);
    // Before the turn: the same coefficients with the file's own signs.
    let mut stored = vec![scene.sh[0]];
    stored.extend(rest.as_chunks::<3>().0.iter().map(|b| b.map(|v| (f32::from(v) - 128.0) / 128.0)));
    assert_eq!(stored.len(), scene.sh.len());
    for direction in [[0.6, 0.48, 0.64], [-0.36, 0.8, -0.48], [0.0, 0.6, 0.8], [0.28, -0.96, 0.0]] {
        let [x, y, z] = direction;
        let (turned, before) = (harmonics(&scene.sh, [x, -y, -z]), harmonics(&stored, direction));
        assert!((turned - before).abs() < 1e-6, "{direction:?}: {turned} and {before}");
        assert!((turned - harmonics(&stored, [x, -y, -z])).abs() > 1e-3, "this direction proves nothing");
    }
}

#[test]
fn a_scene_whose_y_is_up_is_not_turned_over_on_its_way_into_an_spz() {
    let folder = Folder::new("spz-up");
    let rotation = 3 << 30 | 102 << 20 | (0x200 | 153) << 10 | 204;
    let rest: Vec<u8> = (0..45).map(|i| 128_u8.wrapping_add((i * 37 % 101) as u8).wrapping_sub(50)).collect();
    let scene = read_scene(&folder.write("a.spz", spz(3, rotation, &rest))).unwrap();
    let written = |up: Option<[f64; 3]>| {
        let path = folder.file("b.spz");
        let world = up.map(|up| World { up, metres_per_unit: None });
        write_spz(&path, &scene, SpzVersion::V3, world).unwrap();
        (fs::read(&path).unwrap(), read_scene(&path).unwrap())
    };
    let (bytes, turned) = written(None);
    assert_eq!(turned.position, scene.position);
    assert_eq!(written(Some([0.1, -0.9, 0.2])).0, bytes, "upwards is where it is taken to be");
    // Reading makes half a turn in any case, of everything.
    let (_, upright) = written(Some([0.1, 0.9, 0.2]));
    let [x, y, z] = scene.position[0];
    assert_eq!(upright.position, [[x, -y, -z]]);
    let [w, x, y, z] = turned.rotation[0];
    assert_eq!(upright.rotation, [[w, x, -y, -z]]);
    for direction in [[0.6, 0.48, 0.64], [-0.36, 0.8, -0.48], [0.28, -0.96, 0.0]] {
        let [x, y, z] = direction;
        let (found, before) = (harmonics(&upright.sh, [x, -y, -z]), harmonics(&turned.sh, direction));
        assert!((found - before).abs() < 1e-6, "{direction:?}: {found} and {before}");
        assert!((found - harmonics(&upright.sh, direction)).abs() > 1e-3, "this direction proves nothing");
    }
}

fn record(kind: u32, content: &[u8]) -> Vec<u8> {
    [&kind.to_le_bytes()[..], &(content.len() as u32).to_le_bytes(), content].concat()
}

#[test]
fn vendor_records_are_left_alone_where_they_change_nothing_and_refused_where_they_may() {
    let folder = Folder::new("spz-records");
    let (orbit, axes) = (record(0xadbe_0002, &[0; 12]), |value: u32| record(0xadbe_0003, &value.to_le_bytes()));
    for degree in [0, 1] {
        let rest = vec![130_u8; if degree == 0 { 0 } else { 9 }];
        let raw = raw_spz(degree, 3 << 30, &rest);
        let plain = read_scene(&folder.write("plain.spz", gzip(&raw))).unwrap();
        let streams = folder.file("streams.spz");
        write_spz(&streams, &plain, SpzVersion::V4, None).unwrap();
        let streams = fs::read(streams).unwrap();
        for (records, says) in [
            (vec![], None),
            (orbit.clone(), None),
            ([orbit.clone(), axes(4), axes(0)].concat(), None),
            (axes(6), Some("the axes right, up and back")),
            ([orbit.clone(), axes(3)].concat(), Some("the axes right, up and back")),
            // The bits of harmonics, of which degree 0 has none.
            (record(0xadbe_0001, &[5, 4]), (degree > 0).then_some("0xadbe0001")),
            (record(0xadbe_0004, &[5, 4]), Some("0xadbe0004")),
            (orbit[..19].to_vec(), Some("found 19 bytes that are not")),
            (orbit[..7].to_vec(), Some("found 7 bytes that are not")),
        ] {
            // Behind the attributes, and in front of the table of streams.
            let mut behind = [&raw[..], &records].concat();
            behind[14] = 2;
            let mut before = [&streams[..32], &records, &streams[32..]].concat();
            before[14] = 2;
            before[16..20].copy_from_slice(&(32 + records.len() as u32).to_le_bytes());
            for (name, bytes) in [("behind.spz", gzip(&behind)), ("bare.spz", behind), ("before.spz", before)] {
                let path = folder.write(name, bytes);
                match says {
                    None => assert_eq!(read_scene(&path).unwrap().position, plain.position, "{name}"),
                    Some(says) => {
                        let told = fault(read_scene(&path), &path);
                        assert!(told.contains(says), "{name}: {told}");
                    }
                }
            }
        }
    }
}

/// Reads `bytes` cut at every length: an error each time. `fuzz` changes bytes.
fn survives_cuts(folder: &Folder, name: &str, bytes: &[u8], read: fn(&Path) -> ivv::Result<Splats>) {
    read(&folder.write(name, bytes)).unwrap().check().unwrap();
    for n in 0..bytes.len() {
        let path = folder.write(name, &bytes[..n]);
        match read(&path) {
            // A .splat cut between two rows is a shorter scene.
            Ok(scene) => assert!(name.ends_with(".splat") && n % 32 == 0 && scene.len() == n / 32, "{name} cut at {n}"),
            outcome => {
                fault(outcome, &path);
            }
        }
    }
}

#[test]
fn files_of_every_format_that_are_cut_give_errors_and_never_a_panic() {
    let folder = Folder::new("damage");
    survives_cuts(&folder, "one.spz", &spz(1, 3 << 30, &[130; 9]), read_scene);
    survives_cuts(&folder, "a.compressed.ply", &compressed(3, true), read_scene);
    let Some(fixtures) = shared("data/splat_fixtures") else { return };
    for name in ["minimal-raw.spz", "minimal-v2.spz", "minimal-v3.spz", "minimal-v4.spz"] {
        survives_cuts(&folder, name, &fs::read(fixtures.join(name)).unwrap(), read_scene);
    }
    survives_cuts(&folder, "minimal.splat", &fs::read(fixtures.join("minimal.splat")).unwrap(), read_scene);
}

#[test]
fn a_count_that_the_file_cannot_hold_is_refused_before_it_is_believed() {
    let folder = Folder::new("bomb");
    let mut raw = b"NGSP".to_vec();
    raw.extend(3_u32.to_le_bytes());
    raw.extend(u32::MAX.to_le_bytes());
    raw.extend([3, 12, 0, 0]);
    let path = folder.write("count.spz", gzip(&raw));
    assert!(fault(read_scene(&path), &path).contains("4294967295 Gaussians"));
    // Version 4, whose streams of zstd can promise more of a byte: 2^28 Gaussians of degree 0.
    let mut streams = raw.clone();
    streams[4] = 4;
    streams[8..12].copy_from_slice(&(1_u32 << 28).to_le_bytes());
    (streams[12], streams[15]) = (0, 5);
    streams.extend(32_u32.to_le_bytes());
    streams.resize(32, 0);
    for size in [9_u64, 1, 3, 3, 4] {
        streams.extend([0, size << 28].map(u64::to_le_bytes).concat());
    }
    let path = folder.write("streams.spz", streams);
    assert!(fault(read_scene(&path), &path).contains("268435456 Gaussians need 5368709120 bytes"));
    // Ten megabytes of zeros behind a header that needs twenty bytes.
    raw[8..12].copy_from_slice(&1_u32.to_le_bytes());
    raw[12] = 0;
    raw.resize(10 << 20, 0);
    let path = folder.write("bomb.spz", gzip(&raw));
    assert!(fault(read_scene(&path), &path).contains("more than 20 bytes"));
    for (at, value, says) in [
        (4, 1, "version 1"),
        (4, 5, "version 5"),
        (12, 5, "degree 5"),
        (13, 24, "24 fractional bits"),
        (14, 0x80, "unknown flags 0x80"),
    ] {
        let mut raw = raw[..36].to_vec();
        raw[at] = value;
        let path = folder.write("field.spz", gzip(&raw));
        let told = fault(read_scene(&path), &path);
        assert!(told.contains(says), "{told}");
    }
}

/// A compressed PLY of `n` Gaussians in one chunk, with spherical harmonics of degree 1.
pub fn compressed(n: usize, chunk_colors: bool) -> Vec<u8> {
    let ranges = [("", "x y z"), ("scale_", "x y z"), ("", "r g b")];
    let mut file = "ply\nformat binary_little_endian 1.0\nelement chunk 1\n".to_owned();
    let mut chunk: Vec<f32> = Vec::new();
    for (i, (prefix, axes)) in ranges.iter().enumerate().take(if chunk_colors { 3 } else { 2 }) {
        for (end, value) in [("min", -1.0), ("max", 3.0)] {
            for (k, axis) in axes.split(' ').enumerate() {
                file += &format!("property float {end}_{prefix}{axis}\n");
                chunk.push(value * (1 + k + 3 * i) as f32);
            }
        }
    }
    file += &format!("element vertex {n}\n");
    for word in ["position", "rotation", "scale", "color"] {
        file += &format!("property uint packed_{word}\n");
    }
    file += &format!("element sh {n}\n");
    (0..9).for_each(|i| file += &format!("property uchar f_rest_{i}\n"));
    file += "end_header\n";
    let mut file = file.into_bytes();
    chunk.iter().for_each(|v| file.extend(v.to_le_bytes()));
    for i in 0..n as u32 {
        // Top, bottom and top of the ranges; no rotation about any axis but a little about x.
        let ends = 0x7ff << 21 | 0x7ff;
        for word in [ends, 0x3ff << 20 | 0x200 << 10 | 0x200, ends, 0xff00_ff80 - i] {
            file.extend(word.to_le_bytes());
        }
    }
    (0..n).for_each(|_| file.extend([0, 128, 255, 1, 2, 3, 4, 5, 6]));
    file
}

#[test]
fn a_compressed_ply_spans_the_ranges_of_its_chunk() {
    let folder = Folder::new("compressed");
    let path = folder.write("a.compressed.ply", compressed(2, true));
    let scene = read_scene(&path).unwrap();
    assert_eq!((scene.len(), scene.n_static, scene.sh_degree), (2, 2, 1));
    assert_eq!(scene.position[0], [3.0, -2.0, 9.0]);
    assert_eq!(scene.scale[0], [12.0, -5.0, 18.0]);
    let [w, x, y, z] = scene.rotation[0];
    assert!((w - x).abs() < 2e-3 && y.abs() < 1e-3 && z.abs() < 1e-3, "{:?}", scene.rotation[0]);
    let dc = |color: f64| ((color - 0.5) / 0.282_094_791_773_878_14) as f32;
    assert_eq!(scene.sh[0], [dc(21.0), dc(-8.0), dc(27.0)]);
    assert_eq!(scene.sh[1], [-4.0, (1.5 / 256.0 - 0.5) * 8.0, (4.5 / 256.0 - 0.5) * 8.0]);
    assert_eq!((scene.sh[2][0], scene.sh[3][0]), ((128.5 / 256.0 - 0.5) * 8.0, 4.0));
    assert!((scene.opacity[0] - (128.0_f32 / 127.0).ln()).abs() < 1e-6);
    let plain = read_scene(&folder.write("b.compressed.ply", compressed(2, false))).unwrap();
    assert_eq!(plain.sh[0], [dc(1.0), dc(0.0), dc(1.0)]);
    assert_eq!(read_ply(&path).unwrap(), scene);
    let text = String::from_utf8_lossy(&compressed(2, true)).into_owned();
    assert!(text.contains("element chunk 1"));
    let mut none = compressed(300, true);
    let path = folder.write("few.ply", &none);
    assert!(fault(read_scene(&path), &path).contains("has 1 entries, 300 Gaussians need 2"));
    let at = none.windows(9).position(|w| w == b"uint pack").unwrap();
    none[at..at + 4].copy_from_slice(b"int ");
    let path = folder.write("type.ply", &none);
    assert!(fault(read_scene(&path), &path).contains("not of type U32"));
}

#[test]
fn opacities_of_0_and_255_stay_finite_and_on_the_right_side_of_the_thresholds() {
    let folder = Folder::new("opacity");
    let mut row = [0; 32];
    row[31] = 128;
    let mut bytes = row.to_vec();
    row[27] = 255;
    bytes.extend(row);
    let scene = read_scene(&folder.write("a.splat", bytes)).unwrap();
    let alpha = |i: usize| 1.0 / (1.0 + (-scene.opacity[i]).exp());
    assert!(0.0 < alpha(0) && alpha(0) < 1.0 / 255.0);
    assert!(0.99 < alpha(1) && alpha(1) < 1.0);
}

#[test]
fn a_splat_whose_first_coordinate_begins_as_gzip_does_is_one() {
    let folder = Folder::new("gzip-splat");
    let mut row = [0; 32];
    row[..4].copy_from_slice(&[0x1f, 0x8b, 0x00, 0x3f]);
    let scene = read_scene(&folder.write("a.splat", row)).unwrap();
    assert_eq!(scene.position, [[f32::from_le_bytes([0x1f, 0x8b, 0x00, 0x3f]), 0.0, 0.0]]);
    // By content, whatever its name.
    assert_eq!(read_scene(&folder.write("a.bin", spz(0, 3 << 30, &[]))).unwrap().len(), 1);
}

#[test]
fn an_unknown_format_is_told_what_is_supported() {
    let folder = Folder::new("unknown");
    for (name, bytes, says) in [
        ("scene.ksplat", &b"\0\x01scene"[..], "not a recognised scene format"),
        ("scene.ply", b"", "not a recognised scene format"),
        ("scene.ply", b"plywood", "not a recognised scene format"),
        ("scene.sog", b"SOG", "not a recognised scene format"),
        ("scene.sog", b"PK\x03\x04", "not a zip archive"),
        ("scene.splat", b"", "no whole number of rows"),
        ("scene.splat", b"123456789", "no whole number of rows"),
        ("meta.json", b"{}", "no SOG description"),
    ] {
        let path = folder.write(name, bytes);
        let told = fault(read_scene(&path), &path);
        assert!(told.contains(says), "{name}: {told}");
    }
    let path = folder.write("scene.obj", "v 0 0 0");
    let told = fault(read_scene(&path), &path);
    assert!(["PLY", "SPZ", ".splat", "SOG"].iter().all(|format| told.contains(format)), "{told}");
}
