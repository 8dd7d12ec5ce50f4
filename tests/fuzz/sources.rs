//! Captures, and the recordings that `ivv prepare` makes captures of.

use super::engine::{Files, Seed};
use super::{files_of, mend};
use crate::capture::{dynamic, model, png, told, transforms as documents};
use crate::common::npy_rows;
use crate::common::prelude::*;
use image::codecs::jpeg::JpegEncoder;
use ivv::internals::prepare::prepare;
use ivv::internals::sound::rig::Rig;
use ivv::internals::synth::Options;
use std::fmt::Write;

/// Checks and opens a capture and reads what it is trained with.
fn capture(folder: &Path) -> bool {
    let report = check_capture(folder, &CaptureSettings::default());
    let Ok(capture) = Capture::open(folder) else {
        assert!(!told(&report).is_empty(), "what cannot be opened has a fault");
        return false;
    };
    let _ = (capture.extent(), capture.normalisation(), capture.lens_views());
    for (camera, frame) in capture.training_frames().into_iter().chain(capture.test_frames()).take(3) {
        let _ = (capture.view(camera, frame), capture.picture(camera, frame));
        let _ = (capture.foreground(camera, frame), capture.covisible(camera, frame), capture.points_of(frame));
    }
    true
}

/// A synthetic capture of two moments, without what is no part of a capture.
pub fn synthetic() -> Files {
    let folder = Folder::new("fuzz-capture");
    let tiny = Preset::Tiny.options(3);
    let options = Options { cameras: 3, test_cameras: 1, width: 16, height: 16, frames: 2, points: 20, ..tiny };
    write_capture(&folder.0.join("capture"), &options, 1, &mut |_, _| {}).unwrap();
    let mut files = files_of(&folder.0.join("capture"));
    files.retain(|name, _| !name.starts_with("truth/"));
    files
}

pub fn capture_folder() -> Vec<Seed> {
    let seed = Seed::of(synthetic(), capture);
    let only = |part| Seed { only: vec![part], ..seed.clone() };
    vec![only("capture.toml"), only("truth.json"), only("points"), only("sparse"), seed.clone()]
}

fn pictures(folder: &Folder) {
    model::write_images(folder);
}

pub fn colmap_text() -> Vec<Seed> {
    let folder = Folder::new("fuzz-colmap-text");
    model::write_text(&folder, "sparse/0", &model::sample());
    pictures(&folder);
    vec![Seed { only: vec!["sparse"], ..Seed::of(files_of(&folder.0), capture) }]
}

pub fn colmap_binary() -> Vec<Seed> {
    let folder = Folder::new("fuzz-colmap-binary");
    model::write(&folder, &model::sample());
    pictures(&folder);
    vec![Seed { only: vec!["sparse"], ..Seed::of(files_of(&folder.0), capture) }]
}

pub fn transforms() -> Vec<Seed> {
    let folder = Folder::new("fuzz-transforms");
    documents::write(&folder, 3, &documents::document(3));
    let seed = Seed::of(files_of(&folder.0), capture);
    vec![Seed { only: vec!["transforms.json"], ..seed.clone() }, seed]
}

pub fn dynamic() -> Vec<Seed> {
    let folder = Folder::new("fuzz-dynamic");
    dynamic::write(&folder, 2);
    vec![Seed { only: vec!["train_meta", "test_meta"], ..Seed::of(files_of(&folder.0), capture) }]
}

/// A capture whose image is a JPEG: in colour and grey, of whole blocks and of parts of them.
pub fn jpeg() -> Vec<Seed> {
    let seed = |width: u32, height: u32, color: ExtendedColorType| {
        let folder = Folder::new("fuzz-jpeg");
        let n = width * height * u32::from(color.bits_per_pixel()) / 8;
        let levels: Vec<u8> = (0..n).map(|i| (i * i / 7) as u8).collect();
        let mut file = Vec::new();
        JpegEncoder::new_with_quality(&mut file, 80).encode(&levels, width, height, color).unwrap();
        dynamic::write_sized(&folder, width, height, &file);
        Seed { only: vec!["ims"], ..Seed::of(files_of(&folder.0), capture) }
    };
    vec![
        seed(16, 16, ExtendedColorType::Rgb8),
        seed(21, 9, ExtendedColorType::Rgb8),
        seed(9, 17, ExtendedColorType::L8),
    ]
}

/// Points of NumPy's: the array, packed anew after each change, and the archive itself.
pub fn npz() -> Vec<Seed> {
    let folder = Folder::new("fuzz-npz");
    dynamic::write(&folder, 1);
    let row = |at: f64| [at, 2.0, 3.0, 0.5, 0.0, 1.0, 1.0];
    let array = npy_rows(2, &[row(1.0), row(-4.0)].concat());
    let mut parts = files_of(&folder.0);
    parts.insert("init_pt_cld.npz/data.npy".to_owned(), array);
    let seed = Seed { only: vec!["init_pt_cld"], build: mend::archives, ..Seed::of(parts, capture) };
    let archive = Seed { build: mend::pictures, parts: mend::archives(&seed.parts), ..seed.clone() };
    vec![seed, archive]
}

/// Prepares `source` into a folder beside it.
fn prepared(folder: &Path) -> bool {
    let output = folder.with_extension("out");
    let settings = PrepareSettings {
        triangulate: Some(Triangulate::None),
        threads: 1,
        ..PrepareSettings::new(&folder.join("source"), &output)
    };
    let done = prepare(&settings, &|_| {}).is_ok_and(|prepared| told(&prepared.report).is_empty());
    let is_whole = !done || Capture::open(&output).is_ok();
    let _ = std::fs::remove_dir_all(&output);
    assert!(is_whole, "what was prepared without a fault can be opened");
    done
}

fn source(calibration: &str, text: impl Into<Vec<u8>>, cameras: [&str; 2]) -> Vec<Seed> {
    let pictures = cameras.map(|camera| (format!("source/{camera}/0.png"), png(16, 12, 3)));
    let parts = pictures.into_iter().chain([(format!("source/{calibration}"), text.into())]);
    let text = Seed::of(parts, prepared);
    vec![Seed { only: vec![if calibration.starts_with("cal") { "source/cali" } else { "source/" }], ..text }]
}

pub fn caliscope() -> Vec<Seed> {
    let camera = |id: u32| {
        format!(
            "[cameras.{id}]\nsize = [16, 12]\nmatrix = [[12.0, 0.0, 7.5], [0.0, 12.5, 5.5], [0.0, 0.0, 1.0]]\n\
             distortions = [-0.1, 0.02, 0.001, -0.001, 0.003]\ntranslation = [0.0, 0.0, {id}.5]\n\
             rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n"
        )
    };
    let cameras = ["calibration/extrinsic/cam_0", "calibration/extrinsic/cam_1"];
    let mut seeds = source("camera_array.toml", [camera(0), camera(1)].concat(), cameras);
    let times = "sync_index,cam_id,frame_time\n3,1,1.25\n3,0,1.0\n4,0,1.5\n4,1,1.5\n";
    for seed in &mut seeds {
        seed.parts.insert("source/calibration/extrinsic/timestamps.csv".to_owned(), times.into());
        seed.only = vec!["source/camera_array", "source/calibration/extrinsic/timestamps"];
    }
    seeds
}

pub fn qualisys() -> Vec<Seed> {
    let mut cameras = String::new();
    for (serial, x) in [("cam01", 0), ("cam02", 1000)] {
        write!(
            cameras,
            r#"<camera serial="{serial}" viewrotation="0"><fov_video left="0" top="0" right="15" bottom="11"/>
            <transform x="{x}" y="0" z="1500" r11="0" r12="1" r13="0" r21="0" r22="0" r23="1" r31="1" r32="0" r33="0"/>
            <intrinsic focalLengthU="800" focalLengthV="816" centerPointU="512" centerPointV="384" skew="0"
            radialDistortion1="-0.05" radialDistortion2="0.1" radialDistortion3="0" tangentalDistortion1="0.001"
            tangentalDistortion2="0"/></camera>"#
        )
        .unwrap();
    }
    let text = format!("<?xml version='1.0'?><calibration><cameras>{cameras}</cameras></calibration>");
    source("calibration/Calib.qca.txt", text, ["videos/cam01", "videos/cam02"])
}

pub fn pose2sim() -> Vec<Seed> {
    let section = |name: &str, turn: f64| {
        format!(
            "[{name}]\nname = '{name}'\nsize = [16.0, 12.0]\nmatrix = [[12.0, 0.0, 7.5], [0.0, 12.5, 5.5], [0.0, 0.0, 1.0]]\n\
             distortions = [0.01, 0.0, 0.0, 0.0]\nrotation = [0.0, {turn}, 0.0]\ntranslation = [1.0, 2.0, 3.0]\nfisheye = false\n"
        )
    };
    let text = [section("cam_01", 0.0), section("cam_02", 1.0), "[metadata]\nerror = 0.0\n".into()].concat();
    source("calibration/Calib_scene.toml", text, ["videos/cam01", "videos/cam02"])
}

/// EasyMocap's two files, as OpenCV writes them.
pub fn easymocap() -> Vec<Seed> {
    let matrix = |key: &str, rows: usize, data: &str| {
        format!("{key}: !!opencv-matrix\n   rows: {rows}\n   cols: 3\n   dt: d\n   data: [ {data} ]\n")
    };
    let lens = |name: &str| {
        let k = matrix(&format!("K_{name}"), 3, "12., 0., 7.5, 0., 12.5,\n       5.5, 0., 0., 1.");
        k + &matrix(&format!("dist_{name}"), 1, "-0.1, 0.02, 0., 0.") + &format!("H_{name}: 12\nW_{name}: 16\n")
    };
    let pose = |name: &str| {
        matrix(&format!("R_{name}"), 3, "0., 0., 0.")
            + &matrix(&format!("Rot_{name}"), 3, "1., 0., 0., 0., 1., 0., 0., 0., 1.")
            + &matrix(&format!("T_{name}"), 3, "0., 0., 2.")
    };
    let head = "%YAML:1.0\n---\nnames:\n   - \"00\"\n   - \"01\"\n";
    let mut seeds = source("intri.yml", head.to_owned() + &lens("00") + &lens("01"), ["images/00", "images/01"]);
    for seed in &mut seeds {
        let extrinsics = head.to_owned() + &pose("00") + &pose("01");
        seed.parts.insert("source/extri.yml".to_owned(), extrinsics.into());
        seed.only = vec!["source/intri", "source/extri"];
    }
    seeds
}

pub fn immersive() -> Vec<Seed> {
    let model = |name: &str, x: f64| {
        serde_json::json!({ "name": name, "width": 16.0, "height": 12.0, "focal_length": 8.0, "principal_point": [7.5, 6.0],
            "radial_distortion": [0.05, -0.01, 0.0], "projection_type": "fisheye", "pixel_aspect_ratio": 1.0,
            "position": [x, 0.0, 0.0], "orientation": [0.0, 0.0, 1.5] })
    };
    let text = serde_json::json!([model("camera_0001", 0.0), model("camera_0002", 2.0)]).to_string();
    let mut seeds = source("models.json", text, ["camera_0001", "camera_0002"]);
    seeds.iter_mut().for_each(|seed| seed.only = vec!["source/models.json"]);
    seeds
}

pub fn llff() -> Vec<Seed> {
    let row = |x: f64| {
        let (down, right, back) = ([0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]);
        let (center, hwf) = ([x, 2.0, 3.0], [12.0, 16.0, 12.0]);
        let row: Vec<f64> = (0..3).flat_map(|k| [down[k], right[k], back[k], center[k], hwf[k]]).collect();
        [row, vec![1.0, 100.0]].concat()
    };
    let array = npy_rows(2, &[row(1.0), row(0.0)].concat());
    let mut seeds = source("poses_bounds.npy", array, ["cam00", "cam01"]);
    seeds.iter_mut().for_each(|seed| seed.only = vec!["source/poses_bounds.npy"]);
    seeds
}

/// COLMAP's calibration of one camera that stands and one that moves, binary and text, beside their image sequences.
pub fn colmap_rig() -> Vec<Seed> {
    let still = [1.0, 0.0, 0.0, 0.0];
    let model = model::Model {
        cameras: vec![(4, 4, "OPENCV", 16, 12, vec![12.0, 12.5, 8.0, 6.0, -0.05, 0.01, 1e-3, 0.0])],
        images: vec![
            (1, still, [0.0, 0.0, 1.0], 4, "left/000010.jpg", vec![]),
            (2, still, [0.0, 1.0, 1.0], 4, "rig/00001.jpg", vec![]),
            (3, still, [0.0, 2.0, 1.0], 4, "rig/00002.jpg", vec![]),
        ],
        points: vec![(7, [0.125, 0.5, 3.0], [255, 0, 17], 0.5, vec![(1, 0), (2, 0)])],
    };
    let seed = |ending: &str, files: [Vec<u8>; 3]| {
        let files =
            model::STEMS.iter().zip(files).map(|(stem, bytes)| (format!("source/sparse/0/{stem}.{ending}"), bytes));
        let at = |camera: &'static str| {
            (0..2u8).map(move |frame| (format!("source/{camera}/{frame}.png"), png(16, 12, frame)))
        };
        Seed { only: vec!["source/sparse"], ..Seed::of(files.chain(at("left")).chain(at("rig")), prepared) }
    };
    vec![seed("bin", model::binary(&model)), seed("txt", model::text(&model).map(String::into_bytes))]
}

pub fn rig() -> Vec<Seed> {
    let mut files = synthetic();
    let offsets = r#"[{"camera": "cam00", "how": "learnt", "offset": 0.25, "standard_error": 0.1}]"#;
    files.insert("offsets.json".to_owned(), offsets.into());
    let read = |folder: &Path| {
        Rig::open(folder).is_ok_and(|mut rig| {
            let _ = rig.up();
            for camera in &rig.cameras {
                let _ = (camera.pose(0.5), camera.plane(DVec2::new(3.0, 5.0)));
            }
            rig.read_offsets(&folder.join("offsets.json")).is_ok()
        })
    };
    vec![Seed { only: vec!["sparse", "capture.toml", "offsets.json"], ..Seed::of(files, read) }]
}
