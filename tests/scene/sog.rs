//! PlayCanvas' SOG.

use super::{Folder, fault};
use crate::common::prelude::*;
use image::codecs::webp::WebPEncoder;

#[test]
fn the_levels_of_a_real_scene_agree() {
    let Some(folder) = shared("data/splat_playcanvas/playbot") else { return };
    let mut levels = Vec::new();
    for (level, count) in [("6_0", 1_873), ("5_0", 3_000), ("4_0", 8_406)] {
        let scene = read_scene(&folder.join(level)).unwrap();
        scene.check().unwrap();
        assert_eq!((scene.len(), scene.n_static, scene.sh_degree), (count, count, 2));
        let summary = scene.summary();
        assert_eq!(summary.n_non_finite, 0);
        for q in &scene.rotation {
            let norm: f32 = q.iter().map(|v| v * v).sum();
            assert!((norm - 1.0).abs() < 1e-4);
        }
        // lod-meta.json's box is of the Gaussians, whose centres lie inside.
        let bounds = summary.bounds.unwrap();
        let (low, high) = ([-1.033_496, -1.083_135, -1.039_343], [1.035_09, 0.052_055_18, 1.042_389]);
        assert!((0..3).all(|k| bounds.min[k] >= low[k] && bounds.max[k] <= high[k]), "{bounds:?}");
        assert!((0..3).all(|k| bounds.p99[k] - bounds.p01[k] > 0.8 * (high[k] - low[k])), "{bounds:?}");
        let color: f32 = (0..count).map(|i| scene.sh[9 * i].iter().sum::<f32>()).sum::<f32>() / (3 * count) as f32;
        let rest = scene.sh.iter().enumerate().filter(|(i, _)| i % 9 != 0).flat_map(|(_, c)| c);
        let energy: f32 = rest.map(|v| v * v).sum::<f32>() / (24 * count) as f32;
        levels.push((summary, color, energy.sqrt()));
    }
    for pair in levels.windows(2) {
        let ((coarse, color, rest), (fine, finer_color, finer_rest)) = (&pair[0], &pair[1]);
        // Fewer Gaussians are larger, the picture stays.
        assert!(coarse.scale.unwrap().p50 > fine.scale.unwrap().p50);
        assert!((color - finer_color).abs() < 0.2, "{color} {finer_color}");
        assert!(*rest > 0.0 && *rest < 0.5 && (rest - finer_rest).abs() < 0.1, "{rest} {finer_rest}");
    }
}

fn webp(width: u32, height: u32, pixels: &[[u8; 4]]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder = WebPEncoder::new_lossless(&mut bytes);
    encoder.encode(pixels.as_flattened(), width, height, ExtendedColorType::Rgba8).unwrap();
    bytes
}

/// Two Gaussians with a palette of one entry, degree 1.
pub fn scene(folder: &Folder, change: impl FnOnce(String) -> String) -> PathBuf {
    let book = |first: f32| (0..256).map(|i| (first + i as f32 * 0.25).to_string()).collect::<Vec<_>>().join(",");
    folder.write("means_l.webp", webp(2, 1, &[[255, 255, 255, 255], [0, 0, 0, 255]]));
    folder.write("means_u.webp", webp(2, 1, &[[255, 255, 255, 255], [0, 0, 128, 255]]));
    folder.write("scales.webp", webp(2, 1, &[[0, 1, 2, 255], [3, 4, 5, 255]]));
    folder.write("quats.webp", webp(2, 1, &[[255, 128, 128, 252], [0, 128, 128, 255]]));
    folder.write("sh0.webp", webp(2, 1, &[[4, 8, 12, 128], [0, 0, 0, 0]]));
    let palette: Vec<[u8; 4]> = (0..192).map(|i| [i as u8, 100, 200, 255]).collect();
    folder.write("shN_centroids.webp", webp(192, 1, &palette));
    folder.write("shN_labels.webp", webp(2, 1, &[[0, 0, 0, 255], [1, 0, 0, 255]]));
    let text = format!(
        r#"{{"version": 2, "count": 2,
        "means": {{"mins": [-1, -2, -3], "maxs": [1, 2, 3], "files": ["means_l.webp", "means_u.webp"]}},
        "scales": {{"codebook": [{}], "files": ["scales.webp"]}},
        "quats": {{"files": ["quats.webp"]}},
        "sh0": {{"codebook": [{}], "files": ["sh0.webp"]}},
        "shN": {{"count": 2, "bands": 1, "codebook": [{}], "files": ["shN_centroids.webp", "shN_labels.webp"]}}}}"#,
        book(-5.0),
        book(-1.0),
        book(0.0)
    );
    folder.write("meta.json", change(text))
}

#[test]
fn every_attribute_is_decoded_from_its_image() {
    let folder = Folder::new("sog");
    let scene = read_scene(&scene(&folder, |text| text)).unwrap();
    scene.check().unwrap();
    let e = |v: f64| v.exp_m1() as f32;
    assert_eq!(scene.position[0], [e(1.0), e(2.0), e(3.0)]);
    assert_eq!(scene.position[1][..2], [-e(1.0), -e(2.0)]);
    assert!((scene.position[1][2] - e(6.0 * 32768.0 / 65535.0 - 3.0)).abs() < 1e-6);
    assert_eq!(scene.scale, [[-5.0, -4.75, -4.5], [-4.25, -4.0, -3.75]]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    assert!((scene.rotation[0][0] - half).abs() < 1e-2 && (scene.rotation[0][1] - half).abs() < 1e-6);
    assert!((scene.rotation[1][0] + half).abs() < 1e-6 && (scene.rotation[1][3] - half).abs() < 1e-2);
    assert!((scene.opacity[0] - (128.0_f32 / 127.0).ln()).abs() < 1e-6);
    assert_eq!(scene.sh[0], [0.0, 1.0, 2.0]);
    assert_eq!(scene.sh[1..4], [[0.0, 25.0, 50.0], [0.25, 25.0, 50.0], [0.5, 25.0, 50.0]]);
    assert_eq!(scene.sh[5], [0.75, 25.0, 50.0]);
}

#[test]
fn every_fault_of_a_scene_is_named() {
    let folder = Folder::new("sog-faults");
    for (from, to, says) in [
        ("\"version\": 2", "\"version\": 3", "field `version`"),
        ("\"version\": 2,", "", "missing field `version`"),
        ("\"count\": 2,\n", "\"count\": 3,\n", "has 2 x 1 pixels for 3 values"),
        ("\"count\": 2,\n", "\"count\": 4294967295,\n", "has 2 x 1 pixels for 4294967295 values"),
        ("\"count\": 2, \"bands\": 1", "\"count\": 1, \"bands\": 1", "palette entry 1, there are 1"),
        ("\"count\": 2, \"bands\": 1", "\"count\": 2, \"bands\": 2", "has 192 x 1 pixels for 512 values"),
        ("\"bands\": 1", "\"bands\": 4", "4 bands"),
        ("\"bands\": 1", "\"bands\": 0", "0 bands"),
        ("\"codebook\": [-5,", "\"codebook\": [", "field `scales.codebook`"),
        ("[\"quats.webp\"]", "[\"../quats.webp\"]", "is not the plain name"),
        ("[\"quats.webp\"]", "[\"/etc/passwd\"]", "is not the plain name"),
        ("[\"quats.webp\"]", "[\"meta.json\"]", "is no WebP"),
        ("[\"quats.webp\"]", "[\"scales.webp\"]", "the tag of a quaternion is 255"),
        ("[\"quats.webp\"]", "[]", "is no SOG description"),
    ] {
        let path = scene(&folder, |text| {
            assert!(text.contains(from), "{from}");
            text.replacen(from, to, 1)
        });
        // Entries of opaque images are valid tags, so the last Gaussian's is made invalid.
        if to.contains("scales") {
            folder.write("scales.webp", webp(2, 1, &[[0, 1, 2, 255], [3, 4, 5, 251]]));
        }
        let told = fault(read_scene(&path), &path);
        let says = says.replace("is 255", "is 251");
        assert!(told.contains(&says), "{from:?} -> {to:?}: {told:?} does not say {says:?}");
    }
    let path = scene(&folder, |text| text);
    let whole = read_scene(&path).unwrap();
    let image = std::fs::read(folder.file("sh0.webp")).unwrap();
    for n in 0..image.len() {
        folder.write("sh0.webp", &image[..n]);
        match read_scene(&path) {
            // The container pads to an even length.
            Ok(scene) => assert!(n + 1 == image.len() && scene == whole, "cut at {n}"),
            outcome => {
                fault(outcome, &path);
            }
        }
    }
    std::fs::remove_file(folder.file("sh0.webp")).unwrap();
    fault(read_scene(&path), &folder.file("sh0.webp"));
    // A small file that would inflate to 64 megabytes for two Gaussians.
    folder.write("sh0.webp", webp(4096, 4096, &vec![[0; 4]; 1 << 24]));
    assert!(fault(read_scene(&path), &path).contains("has 4096 x 4096 pixels for 2 values"));
}

#[test]
fn a_bundle_is_the_same_scene_as_its_folder() {
    let folder = Folder::new("sog-bundle");
    let path = scene(&folder, |text| text);
    let whole = read_scene(&path).unwrap();
    let names = ["means_l", "means_u", "scales", "quats", "sh0", "shN_centroids", "shN_labels"];
    let names = names.iter().map(|name| format!("{name}.webp")).chain(["meta.json".to_owned()]);
    let mut files: Vec<(String, Vec<u8>)> =
        names.map(|name| (name.clone(), std::fs::read(folder.file(&name)).unwrap())).collect();
    let bundle = folder.write("scene.sog", zip(&files));
    assert_eq!(read_scene(&bundle).unwrap(), whole);
    // What it is shows in its first bytes.
    assert_eq!(read_scene(&folder.write("scene", zip(&files))).unwrap(), whole);
    for (at, name) in [(0, "means_l.webp"), (7, "meta.json")] {
        let mut fewer = files.clone();
        fewer.remove(at);
        let path = folder.write("scene.sog", zip(&fewer));
        let told = fault(read_scene(&path), &path);
        assert!(told.contains(name) && told.contains("is not in the archive"), "{told}");
    }
    // A small archive of a text of 2 MiB, and an image of more bytes than its pixels can take.
    for (at, name, bytes) in [(7, "meta.json", 2 << 20), (0, "means_l.webp", 1 << 20)] {
        let mut larger = files.clone();
        larger[at].1.resize(bytes, b' ');
        let path = folder.write("scene.sog", zip(&larger));
        let told = fault(read_scene(&path), &path);
        assert!(told.contains(name) && told.contains("are allowed"), "{told}");
    }
    files[7].1 = b"{}".to_vec();
    let path = folder.write("scene.sog", zip(&files));
    assert!(fault(read_scene(&path), &path).contains("no SOG description"));
}
