//! 3DGS PLY files.

use super::{Folder, fault, sample};
use crate::common::golden::{self, CASES};
use crate::common::prelude::*;

/// A plain PLY in the given encoding, written property by property independently of the project's writer.
pub fn by_hand(encoding: &str, names: &[&str], types: &[&str], rows: &[Vec<f64>]) -> Vec<u8> {
    let mut file = format!("ply\nformat {encoding} 1.0\ncomment by hand\nelement vertex {}\n", rows.len());
    for (name, kind) in names.iter().zip(types) {
        file += &format!("property {kind} {name}\n");
    }
    file += "end_header\n";
    let mut file = file.into_bytes();
    for row in rows {
        for (&value, &kind) in row.iter().zip(types) {
            let mut bytes = match kind {
                "float" => (value as f32).to_le_bytes().to_vec(),
                "double" => value.to_le_bytes().to_vec(),
                "int" => (value as i32).to_le_bytes().to_vec(),
                "ushort" => (value as u16).to_le_bytes().to_vec(),
                "char" => (value as i8).to_le_bytes().to_vec(),
                "uchar" => (value as u8).to_le_bytes().to_vec(),
                _ => unreachable!("{kind}"),
            };
            match encoding {
                "ascii" => bytes = format!("{value} ").into_bytes(),
                "binary_big_endian" => bytes.reverse(),
                _ => {}
            }
            file.extend(bytes);
        }
        if encoding == "ascii" {
            file.push(b'\n');
        }
    }
    file
}

pub const NAMES: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2",
    "rot_3",
];

fn plain_rows(n: usize) -> Vec<Vec<f64>> {
    // Quarters are exact in every encoding.
    (0..n).map(|i| (0..14).map(|j| (i * 14 + j) as f64 * 0.25 - 3.0).collect()).collect()
}

fn first_gaussian(splats: &Splats) -> Vec<f32> {
    let mut values = splats.position[0].to_vec();
    values.extend(splats.sh[0]);
    values.push(splats.opacity[0]);
    values.extend(splats.scale[0]);
    values.extend(splats.rotation[0]);
    values
}

#[test]
fn every_degree_and_population_is_read_back_equal_and_written_again_byte_for_byte() {
    let folder = Folder::new("round-trip");
    for degree in 0..=3 {
        for (n_static, n_dynamic) in [(7, 0), (0, 5), (6, 4), (1, 9), (0, 0)] {
            let scene = sample(degree, n_static, n_dynamic);
            let (first, second) = (folder.file("first.ply"), folder.file("second.ply"));
            write_ply(&first, &scene).unwrap();
            let read = read_ply(&first).unwrap();
            assert_eq!(read, scene, "degree {degree}, {n_static} static, {n_dynamic} dynamic");
            write_ply(&second, &read).unwrap();
            let bytes = fs::read(&first).unwrap();
            assert!(bytes.starts_with(b"ply\nformat binary_little_endian 1.0\nelement vertex "));
            assert_same("written again", &fs::read(&second).unwrap(), &bytes);
        }
    }
}

#[test]
fn values_that_are_not_finite_survive_a_round_trip_with_their_bits() {
    let folder = Folder::new("bits");
    let mut scene = sample(1, 2, 1);
    scene.position[0][1] = f32::from_bits(0x7fa0_1234);
    scene.scale[1][2] = f32::NEG_INFINITY;
    scene.scale[2][0] = -0.0;
    let path = folder.file("scene.ply");
    write_ply(&path, &scene).unwrap();
    let read = read_ply(&path).unwrap();
    assert_eq!(read.position[0][1].to_bits(), 0x7fa0_1234);
    assert_eq!(read.scale[1][2], f32::NEG_INFINITY);
    assert_eq!(read.scale[2][0].to_bits(), (-0.0_f32).to_bits());
}

#[test]
fn opacities_of_0_and_1_are_finite_although_their_logits_are_not() {
    let folder = Folder::new("opaque");
    let mut rows = plain_rows(3);
    for (row, logit) in rows.iter_mut().zip([f64::INFINITY, f64::NEG_INFINITY, f64::NAN]) {
        row[6] = logit;
    }
    for encoding in ["binary_little_endian", "binary_big_endian"] {
        let file = by_hand(encoding, &NAMES, &["float"; 14], &rows);
        let scene = read_ply(&folder.write("scene.ply", file)).unwrap();
        let [opaque, faint] = [0, 1].map(|i: usize| 1.0 / (1.0 + (-scene.opacity[i]).exp()));
        assert!(opaque > 0.99 && opaque < 1.0, "{encoding}: {opaque}");
        assert!(faint > 0.0 && faint < 1.0 / 255.0, "{encoding}: {faint}");
        assert!(scene.opacity[2].is_nan(), "{encoding}");
        // Those that are drawn, and that exports hold.
        assert_eq!(scene.summary().n_non_finite, 1, "{encoding}");
    }
}

#[test]
fn harmonics_are_stored_channel_after_channel() {
    let folder = Folder::new("channels");
    let mut scene = sample(1, 1, 0);
    scene.sh = vec![[0.0; 3], [1.0, 4.0, 7.0], [2.0, 5.0, 8.0], [3.0, 6.0, 9.0]];
    let path = folder.file("scene.ply");
    write_ply(&path, &scene).unwrap();
    let bytes = fs::read(&path).unwrap();
    let floats: Vec<f32> = bytes[bytes.len() - 4 * 26..].as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
    assert_eq!(floats[9..18], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
}

#[test]
fn all_three_encodings_give_the_same_scene() {
    let folder = Folder::new("encodings");
    let rows = plain_rows(5);
    let types = ["float"; 14];
    let read = |encoding: &str| read_ply(&folder.write("scene.ply", by_hand(encoding, &NAMES, &types, &rows))).unwrap();
    let little = read("binary_little_endian");
    assert_eq!(first_gaussian(&little)[..4], [-3.0, -2.75, -2.5, -2.25]);
    assert_eq!(little.len(), 5);
    assert_eq!(little.n_static, 5);
    assert_eq!(little, read("binary_big_endian"));
    assert_eq!(little, read("ascii"));
}

#[test]
fn the_order_and_the_types_of_properties_do_not_matter() {
    let folder = Folder::new("order");
    let rows: Vec<Vec<f64>> = (0..3).map(|i| (0..14).map(|j| f64::from(i * 14 + j)).collect()).collect();
    let plain = by_hand("binary_little_endian", &NAMES, &["float"; 14], &rows);
    let plain = read_ply(&folder.write("plain.ply", plain)).unwrap();
    assert_eq!(first_gaussian(&plain)[13], 13.0);
    for encoding in ["binary_little_endian", "binary_big_endian", "ascii"] {
        let reversed: Vec<&str> = NAMES.iter().rev().copied().chain(["extra"]).collect();
        let types: Vec<&str> = ["double", "int", "ushort", "char", "float"].into_iter().cycle().take(15).collect();
        let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.iter().rev().copied().chain([77.0]).collect()).collect();
        let file = by_hand(encoding, &reversed, &types, &rows);
        assert_eq!(read_ply(&folder.write("reversed.ply", file)).unwrap(), plain, "{encoding}");
    }
}

#[test]
fn other_elements_with_lists_are_skipped_in_every_encoding() {
    let folder = Folder::new("lists");
    let rows = plain_rows(2);
    let expected = read_ply(&folder.write("a.ply", by_hand("ascii", &NAMES, &["float"; 14], &rows))).unwrap();
    assert_eq!(expected.len(), 2);
    for encoding in ["binary_little_endian", "binary_big_endian", "ascii"] {
        let file = by_hand(encoding, &NAMES, &["float"; 14], &rows);
        let at = file.windows(11).position(|w| w == b"end_header\n").unwrap();
        let faces = "element face 2\nproperty list uchar int vertex_indices\nproperty float area\n";
        let list: Vec<u8> = match encoding {
            "ascii" => b"3 0 1 2 0.5\n0 0.25\n".to_vec(),
            _ => [&[3][..], &[7; 12], &[9; 4], &[0], &[9; 4]].concat(),
        };
        let file = [&file[..at], faces.as_bytes(), &file[at..], &list].concat();
        let path = folder.write("faces.ply", &file);
        assert_eq!(read_ply(&path).unwrap(), expected, "{encoding}");
        let path = folder.write("short.ply", &file[..file.len() - 5]);
        fault(read_ply(&path), &path);
    }
}

#[test]
fn a_file_cut_at_any_length_gives_an_error() {
    let folder = Folder::new("cut");
    let path = folder.file("scene.ply");
    write_ply(&path, &sample(1, 2, 1)).unwrap();
    let whole = fs::read(&path).unwrap();
    for encoding in ["binary_big_endian", "ascii"] {
        let file = by_hand(encoding, &NAMES, &["float"; 14], &plain_rows(2));
        // Where the last word of an ascii file ends, nothing can tell.
        let last_word = file.trim_ascii_end().iter().rposition(|&b| b == b' ').unwrap() + 1;
        let needed = if encoding == "ascii" { last_word + 1 } else { file.len() };
        (0..needed).for_each(|n| cut_fails(&folder, &file[..n]));
    }
    (0..whole.len()).for_each(|n| cut_fails(&folder, &whole[..n]));
    let path = folder.write("long.ply", [&whole[..], &[0]].concat());
    assert!(fault(read_ply(&path), &path).contains("bytes of data"));
}

fn cut_fails(folder: &Folder, bytes: &[u8]) {
    let path = folder.write("cut.ply", bytes);
    fault(read_ply(&path), &path);
    fault(read_scene(&path), &path);
}

#[test]
fn a_header_with_any_byte_changed_gives_an_error_or_a_whole_scene() {
    let folder = Folder::new("flip");
    let path = folder.file("scene.ply");
    write_ply(&path, &sample(1, 1, 1)).unwrap();
    let whole = fs::read(&path).unwrap();
    let header = whole.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let mut refused = 0;
    for at in 0..header {
        for flip in [0x01, 0x02, 0x10, 0x20, 0x80, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] ^= flip;
            let path = folder.write("flip.ply", &bytes);
            match read_ply(&path) {
                Ok(scene) => scene.check().unwrap(),
                outcome => {
                    fault(outcome, &path);
                    refused += 1;
                }
            }
        }
    }
    assert!(refused > 4 * header, "only {refused} of {} changes were noticed", 6 * header);
}

/// (what the header is changed from, to, what the error must say)
const FAULTS: [(&str, &str, &str); 18] = [
    ("ply\n", "plx\n", "does not begin with `ply`"),
    ("format binary_little_endian 1.0\n", "", "no `format` line"),
    ("binary_little_endian", "binary_middle_endian", "no PLY encoding"),
    ("1.0", "2.0", "not a line of a PLY 1.0 header"),
    ("vertex 3", "vertex 4", "bytes of data"),
    ("vertex 3", "vertex 2", "bytes of data"),
    ("vertex 3", "vertex 0", "bytes of data"),
    ("vertex 3", "vertex -1", "no count"),
    ("vertex 3", "vertex 4294967295", "bytes of data"),
    ("vertex 3", "vertex 4294967296", "no count"),
    ("vertex 3", "vertex 99999999999999999999999", "no count"),
    ("element vertex 3\n", "", "before any element"),
    ("element vertex", "element point", "no element `vertex`"),
    ("float x\n", "float y\n", "declared twice"),
    ("float opacity", "float transparency", "is missing"),
    ("float x\n", "quadruple x\n", "no PLY type"),
    ("float t_scale", "float tau", "`t_scale`: is missing"),
    ("f_rest_8", "f_rest_9", "`f_rest_8`: is missing"),
];

#[test]
fn every_fault_of_a_header_is_named() {
    let folder = Folder::new("faults");
    let path = folder.file("scene.ply");
    write_ply(&path, &sample(1, 2, 1)).unwrap();
    let whole = fs::read(&path).unwrap();
    for (from, to, says) in FAULTS {
        let at = whole.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        let path = folder.write("bad.ply", [&whole[..at], to.as_bytes(), &whole[at + from.len()..]].concat());
        let told = fault(read_ply(&path), &path);
        assert!(told.contains(says), "{from:?} -> {to:?}: {told:?} does not say {says:?}");
    }
    let path = folder.write("long.ply", [b"ply\ncomment ".to_vec(), vec![b'a'; 2 << 20], whole.clone()].concat());
    assert!(fault(read_ply(&path), &path).contains("longer than 1 MiB"));
    let path =
        folder.write("list.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty list int float x\nend_header\n0\n");
    assert!(fault(read_ply(&path), &path).contains("is a list"));
    let path = folder.file("absent.ply");
    assert!(fault(read_ply(&path), &path).contains("cannot be read"));
    let path = folder.write("word.ply", by_hand("ascii", &NAMES, &["float"; 14], &plain_rows(1)).replace_last(b"x.5"));
    assert!(fault(read_ply(&path), &path).contains("row 0, property `rot_3`"));
}

trait ReplaceLast {
    fn replace_last(self, word: &[u8]) -> Vec<u8>;
}

impl ReplaceLast for Vec<u8> {
    fn replace_last(self, word: &[u8]) -> Vec<u8> {
        let end = self.trim_ascii_end().len();
        let start = self[..end].iter().rposition(|&b| b == b' ').unwrap() + 1;
        [&self[..start], word, b"\n"].concat()
    }
}

#[test]
fn a_scene_whose_arrays_disagree_is_not_written() {
    let folder = Folder::new("disagree");
    let path = folder.file("scene.ply");
    let mut scene = sample(1, 2, 1);
    scene.sh.pop();
    assert!(fault(write_ply(&path, &scene), &path).contains("sh has 11 entries, it should have 12"));
    assert!(!path.exists());
}

#[test]
fn a_failed_write_leaves_the_old_file_and_nothing_else() {
    let folder = Folder::new("atomic");
    let path = folder.write("scene.ply", "old");
    let told = fault(
        ivv::internals::files::write_atomic(&path, |to| {
            to.write_all(&[0; 100_000])?;
            Err(std::io::Error::other("the pen broke"))
        }),
        &path,
    );
    assert!(told.contains("the pen broke"), "{told}");
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(fs::read_dir(&folder.0).unwrap().count(), 1);
    ivv::internals::files::write_atomic(&path, |to| to.write_all(b"new")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"new");
    assert_eq!(fs::read_dir(&folder.0).unwrap().count(), 1);
    // What is no file keeps its name: as root `-o /dev/null` would replace the device.
    #[cfg(unix)]
    {
        let device = folder.file("device.ply");
        std::os::unix::fs::symlink("/dev/null", &device).unwrap();
        assert!(fault(write_ply(&device, &sample(0, 1, 0)), &device).contains("found a device"));
        assert!(fs::symlink_metadata(&device).unwrap().is_symlink());
        let inside = folder.file("folder");
        fs::create_dir(&inside).unwrap();
        assert!(fault(write_ply(&inside, &sample(0, 1, 0)), &inside).contains("found a folder"));
    }
    let nowhere = folder.file("absent/scene.ply");
    fault(write_ply(&nowhere, &sample(0, 1, 0)), &nowhere);
    fault(write_ply(Path::new("/"), &sample(0, 1, 0)), Path::new("/"));
}

#[test]
fn the_golden_scenes_are_written_again_byte_for_byte() {
    let folder = Folder::new("golden");
    for (case, n) in CASES.into_iter().zip([52, 200, 300, 400, 500]) {
        let Some(path) = golden::folder(case).map(|folder| folder.join("scene.ply")) else { continue };
        let scene = read_ply(&path).unwrap();
        assert_eq!(scene.len(), n, "{case}");
        let again = folder.file("again.ply");
        write_ply(&again, &scene).unwrap();
        assert_same(case, &fs::read(&again).unwrap(), &fs::read(&path).unwrap());
    }
}
