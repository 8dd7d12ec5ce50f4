//! Flow, depth and points of the frames: every format arrives, and every fault is told.

use super::model::{Model, write_cameras};
use super::{Folder, assert_told, png};
use crate::common::npy;
use crate::common::prelude::*;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, WritableImage,
};
use image::ImageEncoder;
use image::codecs::png::PngEncoder;
use ivv::internals::scene::capture::FramePoint;
use ivv::internals::scene::prior::write_depth_halves;

pub const WIDTH: u32 = 3;
pub const HEIGHT: u32 = 2;
/// Row by row, top first.
const FLOW: [[f32; 2]; 6] = [[0.5, -1.25], [2.0, 0.0], [-3.0, 7.5], [0.0, 0.0], [10.0, -20.0], [1.5, 1.0]];
const DEPTH: [f32; 6] = [1.0, 2.5, -0.25, 4.0, 0.0, 6.0];

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn flo(flow: &[[f32; 2]]) -> Vec<u8> {
    let mut bytes = b"PIEH".to_vec();
    bytes.extend([WIDTH, HEIGHT].into_iter().flat_map(u32::to_le_bytes));
    bytes.extend(floats(flow.as_flattened()));
    bytes
}

/// Rows from the bottom up, in one byte order or the other.
fn pfm(scale: &str, bytes_of: fn(f32) -> [u8; 4]) -> Vec<u8> {
    let mut bytes = format!("Pf\n{WIDTH} {HEIGHT}\n{scale}\n").into_bytes();
    bytes.extend(DEPTH.chunks_exact(WIDTH as usize).rev().flatten().flat_map(|v| bytes_of(*v)));
    bytes
}

fn exr(path: &Path, channels: &[(&str, Vec<f32>)]) {
    let list: SmallVec<[_; 4]> =
        channels.iter().map(|(name, values)| AnyChannel::new(*name, FlatSamples::F32(values.clone()))).collect();
    let size = (WIDTH as usize, HEIGHT as usize);
    let layer = Layer::new(size, LayerAttributes::default(), Encoding::SMALL_LOSSLESS, AnyChannels::sort(list));
    Image::from_layer(layer).write().to_file(path).unwrap();
}

fn png16(levels: &[u16], kind: ExtendedColorType) -> Vec<u8> {
    let mut bytes = Vec::new();
    // The encoder takes levels in the machine's byte order.
    let levels: Vec<u8> = levels.iter().flat_map(|level| level.to_ne_bytes()).collect();
    PngEncoder::new(&mut bytes).write_image(&levels, WIDTH, HEIGHT, kind).unwrap();
    bytes
}

fn kitti(valid: u16) -> Vec<u8> {
    let levels = FLOW.iter().flat_map(|flow| {
        let [u, v] = flow.map(|v| (v * 64.0 + 32_768.0) as u16);
        [u, v, valid]
    });
    png16(&levels.collect::<Vec<_>>(), ExtendedColorType::Rgb16)
}

fn write_flows(folder: &Folder) -> [PathBuf; 7] {
    let [x, y] = [0, 1].map(|k| FLOW.iter().map(|flow| flow[k]).collect::<Vec<f32>>());
    let doubles: Vec<u8> = FLOW.as_flattened().iter().flat_map(|v| f64::from(*v).to_le_bytes()).collect();
    let halves: Vec<u8> =
        FLOW.as_flattened().iter().flat_map(|v| exr::prelude::f16::from_f32(*v).to_le_bytes()).collect();
    let files = [
        folder.write("a.flo", flo(&FLOW)),
        folder.write("a.npy", npy("(2, 3, 2)", "<f4", &floats(FLOW.as_flattened()))),
        folder.write("b.npy", npy("(2, 3, 2)", "<f8", &doubles)),
        folder.write("c.npy", npy("(2, 3, 2)", "<f2", &halves)),
        folder.write("a.png", kitti(1)),
        folder.0.join("a.exr"),
        folder.0.join("b.exr"),
    ];
    exr(&files[5], &[("flow.X", x.clone()), ("flow.Y", y.clone()), ("body", vec![9.0; 6])]);
    exr(&files[6], &[("B", vec![9.0; 6]), ("G", y), ("R", x)]);
    files
}

/// [`DEPTH`] in every format that holds such numbers.
fn write_depths(folder: &Folder) -> [PathBuf; 5] {
    let files = [
        folder.write("a.npy", npy("(2, 3)", "<f4", &floats(&DEPTH))),
        folder.write("a.pfm", pfm("-1.0", f32::to_le_bytes)),
        folder.write("b.pfm", pfm("1.0", f32::to_be_bytes)),
        folder.0.join("a.exr"),
        folder.0.join("b.exr"),
    ];
    exr(&files[3], &[("Z", DEPTH.to_vec()), ("A", vec![1.0; 6])]);
    exr(&files[4], &[("Y", DEPTH.to_vec())]);
    files
}

/// Names and bytes of flow in every format.
pub fn flow_files(name: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Folder::new(name);
    write_flows(&folder);
    loaded(&folder)
}

/// Names and bytes of depth in every format.
pub fn depth_files(name: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Folder::new(name);
    write_depths(&folder);
    folder.write("a.png", png16(&[1, 300, 65_535, 0, 5, 6], ExtendedColorType::L16));
    loaded(&folder)
}

fn loaded(folder: &Folder) -> Vec<(String, Vec<u8>)> {
    let mut all: Vec<_> = std::fs::read_dir(&folder.0)
        .unwrap()
        .map(|entry| entry.unwrap())
        .map(|entry| (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap()))
        .collect();
    all.sort();
    all
}

#[test]
fn flow_arrives_in_every_format() {
    let folder = Folder::new("flow-formats");
    for file in &write_flows(&folder) {
        assert_eq!(read_flow(file, WIDTH, HEIGHT).unwrap(), FLOW, "{}", file.display());
    }
}

#[test]
fn depth_arrives_in_every_format_row_0_at_the_top() {
    let folder = Folder::new("depth-formats");
    for file in &write_depths(&folder) {
        assert_eq!(read_depth(file, WIDTH, HEIGHT).unwrap(), DEPTH, "{}", file.display());
    }
    let levels = [1, 300, 65_535, 0, 5, 6];
    let wide = folder.write("a.png", png16(&levels, ExtendedColorType::L16));
    let narrow = folder.write("b.png", super::encode(&[1, 200, 255, 0, 5, 6], WIDTH, HEIGHT, ExtendedColorType::L8));
    for (file, third) in [(wide, [300.0, 65_535.0]), (narrow, [200.0, 255.0])] {
        let depth = read_depth(&file, WIDTH, HEIGHT).unwrap();
        assert_eq!([depth[0], depth[1], depth[2], depth[4], depth[5]], [1.0, third[0], third[1], 5.0, 6.0]);
        assert!(depth[3].is_nan());
    }
}

#[test]
fn pixels_without_a_value_are_nan() {
    let folder = Folder::new("prior-unknown");
    let mut flow = FLOW;
    flow[1] = [2e9, 0.0];
    flow[3] = [1.0, f32::INFINITY];
    let read = read_flow(&folder.write("a.flo", flo(&flow)), WIDTH, HEIGHT).unwrap();
    for (i, pixel) in read.iter().enumerate() {
        assert!(if [1, 3].contains(&i) { pixel.iter().all(|v| v.is_nan()) } else { *pixel == FLOW[i] }, "{i}");
    }
    let invalid = read_flow(&folder.write("a.png", kitti(0)), WIDTH, HEIGHT).unwrap();
    assert!(invalid.as_flattened().iter().all(|v| v.is_nan()));
    let mut depth = DEPTH;
    (depth[0], depth[5]) = (f32::INFINITY, f32::NAN);
    let read = read_depth(&folder.write("a.npy", npy("(2, 3)", "<f4", &floats(&depth))), WIDTH, HEIGHT).unwrap();
    assert!(read[0].is_nan() && read[5].is_nan());
    assert_eq!(read[1..5], DEPTH[1..5]);
}

#[test]
fn damaged_priors_are_refused_before_anything_is_allocated() {
    let folder = Folder::new("prior-faults");
    let huge = |bytes: Vec<u8>, at: usize| {
        let mut bytes = bytes;
        bytes[at..at + 8].fill(0xff);
        bytes
    };
    let whole = flo(&FLOW);
    exr(&folder.0.join("none.exr"), &[("A", vec![1.0; 6])]);
    exr(&folder.0.join("good.exr"), &[("u", vec![1.0; 6]), ("v", vec![1.0; 6])]);
    let good = fs::read(folder.0.join("good.exr")).unwrap();
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("a.flo", b"PIE".to_vec(), "has no 12 bytes"),
        ("b.flo", b"PIEGxxxxxxxx".to_vec(), "does not begin with PIEH"),
        ("c.flo", whole[..whole.len() - 1].to_vec(), "takes 60 bytes, and has 59"),
        ("d.flo", huge(whole.clone(), 4), "4294967295 x 4294967295"),
        ("e.flo", [&whole[..], b"x"].concat(), "takes 60 bytes, and has 61"),
        ("f.flo", b"PIEH\0\0\0\0\0\0\0\0".to_vec(), "is 0 x 0"),
        ("a.npy", npy("(2, 3)", "<f4", &[0; 24]), "has the shape [2, 3], not [H, W, 2]"),
        ("b.npy", npy("(3, 2, 2)", "<f4", &[0; 48]), "is 2 x 3, its camera is 3 x 2"),
        ("c.npy", npy("(2, 3, 2)", "<i4", &[0; 48]), "is not of little-endian f16, f32 or f64"),
        ("d.npy", npy("(2, 3, 2)", "<f4", &[0; 47]), "and has"),
        ("e.npy", npy("(99999999999, 99999999999, 2)", "<f4", &[]), "has the shape"),
        ("f.npy", b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(), "has a header of 4294967295 bytes"),
        ("a.png", png(WIDTH, HEIGHT, 0), "has pixels of the type Rgb8"),
        ("b.png", kitti(1)[..60].to_vec(), "is cut off"),
        ("a.exr", b"text".to_vec(), "has a broken header"),
        ("b.exr", good[..good.len() / 2].to_vec(), ""),
        ("a.txt", vec![], "has no known extension"),
        ("a.pfm", pfm("-1.0", f32::to_le_bytes), "has no known extension"),
    ];
    for (name, bytes, says) in cases {
        let fault = read_flow(&folder.write(name, bytes), WIDTH, HEIGHT).unwrap_err();
        assert_eq!(fault.exit_code(), 3);
        assert!(fault.to_string().contains(says) && fault.to_string().contains(name), "{name}: {fault}");
    }
    let fault = read_flow(&folder.0.join("none.exr"), WIDTH, HEIGHT).unwrap_err().to_string();
    assert!(fault.contains("none of the channels") && fault.contains("flow.X and flow.Y"), "{fault}");
    for (name, text, says) in [
        ("b.pfm", "PF\n3 2\n-1\n", "has three channels"),
        ("c.pfm", "Pg\n3 2\n-1\n", "does not begin with Pf"),
        ("d.pfm", "Pf\n3 2\n0\n", "without width, height and scale"),
        ("e.pfm", "Pf\n3 2\n", "ends within its header"),
        ("f.pfm", "Pf\n3 2\n-1\n", "takes 34 bytes"),
        ("g.pfm", "Pf\n4294967295 4294967295\n-1\n", "4294967295 x 4294967295"),
        ("h.pfm", "Pf\n3 \u{1}\n", "its header is not text"),
    ] {
        let fault = read_depth(&folder.write(name, text), WIDTH, HEIGHT).unwrap_err().to_string();
        assert!(fault.contains(says), "{name}: {fault}");
    }
}

/// Two cameras, 40 and 7 in COLMAP's numbers, three frames.
fn write_capture(folder: &Folder) {
    let turn = [1.0, 0.0, 0.0, 0.0];
    let params = || vec![5.0, 5.0, 1.5, 1.0];
    let model = Model {
        cameras: vec![
            (40, 1, "PINHOLE", WIDTH.into(), HEIGHT.into(), params()),
            (7, 1, "PINHOLE", WIDTH.into(), HEIGHT.into(), params()),
        ],
        images: vec![(1, turn, [0.0, 0.0, 4.0], 40, "b.png", vec![]), (2, turn, [1.0, 0.0, 4.0], 7, "a.png", vec![])],
        points: vec![],
    };
    write_cameras(folder, "sparse/0", &model);
    let manifest = Manifest { fps: 30.0, frames: 3, points: true, flow: true, depth: true, ..Manifest::default() };
    manifest.write(&folder.0).unwrap();
    for frame in 0..3 {
        for camera in ["a", "b"] {
            folder.write(&format!("images/{camera}/{frame:05}.png"), png(WIDTH, HEIGHT, 0));
            folder.write(&format!("depth/{camera}/{frame:05}.npy"), npy("(2, 3)", "<f4", &floats(&DEPTH)));
        }
        if frame < 2 {
            folder.write(&format!("flow/a/{frame:05}.flo"), flo(&FLOW));
        }
        folder.write(&format!("points/{frame:05}.ply"), points("1 2 3 10 20 30 2 40 7\n-1 0 0.5 1 2 3 1 7\n"));
    }
}

fn points(rows: &str) -> String {
    let n = rows.lines().count();
    format!(
        "ply\nformat ascii 1.0\nelement vertex {n}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nproperty list uchar int camera_ids\n\
         end_header\n{rows}"
    )
}

#[test]
fn a_capture_finds_its_priors_and_the_points_of_its_frames() {
    let folder = Folder::new("priors");
    write_capture(&folder);
    let report = folder.check();
    assert_eq!(report.n_faults, 0, "{}", super::told(&report));
    assert_eq!((report.n_flows, report.n_depths, report.has_frame_points), (2, 6, true));
    let capture = folder.open();
    let flow = |camera: usize| capture.cameras[camera].shots.iter().map(|shot| shot.flow.is_some()).collect::<Vec<_>>();
    // A camera without a folder has no flow; the last frame has none.
    assert_eq!((flow(0), flow(1)), (vec![true, true, false], vec![false; 3]));
    assert_eq!(read_flow(capture.cameras[0].shots[1].flow.as_ref().unwrap(), WIDTH, HEIGHT).unwrap(), FLOW);
    assert!(capture.has_frame_points());
    let expected = [
        FramePoint { position: [1.0, 2.0, 3.0], color: [10, 20, 30], seen_by: vec![0, 1] },
        FramePoint { position: [-1.0, 0.0, 0.5], color: [1, 2, 3], seen_by: vec![0] },
    ];
    assert_eq!(capture.points_of(2).unwrap(), expected);
    assert!(capture.points_of(3).is_err());
    let first = Similarity { origin: [1.0, 0.0, -1.0], scale: 2.0 };
    let second = Similarity { origin: [4.0, 0.0, 1.0], scale: 0.5 };
    let moved = capture.transformed(&first).transformed(&second);
    assert_eq!(moved.points_of(1).unwrap()[0].position, second.point(first.point([1.0, 2.0, 3.0])));
}

#[test]
fn a_part_of_a_clip_is_a_clip_whose_frames_are_counted_from_0() {
    let folder = Folder::new("priors-part");
    write_capture(&folder);
    folder.write("points/00002.ply", points("9 9 9 1 2 3 1 7\n"));
    folder.write("truth.json", r#"{"time_offsets_frames": {"a": 0.5, "b": -0.5}}"#);
    let part = |frames: &str| {
        let settings = CaptureSettings { frames: frames.parse().unwrap(), ..CaptureSettings::default() };
        Capture::open_with(&folder.0, &settings).unwrap()
    };
    let frames = |capture: &Capture| -> Vec<(u32, String, bool)> {
        let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
        capture.cameras[0].shots.iter().map(|shot| (shot.frame, name(&shot.image), shot.flow.is_some())).collect()
    };
    let image = |frame: u32, file: &str, has_flow: bool| (frame, format!("0000{file}.png"), has_flow);

    let end = part("1:");
    assert_eq!((end.n_frames, end.fps, end.reference_frame), (2, 30.0, 0));
    assert_eq!(frames(&end), [image(0, "1", true), image(1, "2", false)]);
    assert_eq!((end.points_of(1).unwrap()[0].position, end.points_of(0).unwrap().len()), ([9.0; 3], 2));
    assert!(end.points_of(2).is_err());
    assert_eq!(end.view(0, 1).unwrap().time, 0.5);
    // Whatever the flow of its last frame led to is not there.
    assert_eq!(frames(&part("2")), [image(0, "0", true), image(1, "1", false)]);

    let every_second = part("::2");
    assert_eq!((every_second.n_frames, every_second.fps), (2, 15.0));
    assert_eq!(frames(&every_second), [image(0, "0", false), image(1, "2", false)]);
    assert_eq!(every_second.points_of(1).unwrap()[0].position, [9.0; 3]);
    assert_eq!(every_second.true_offsets["a"], 0.25);

    // Files of frames that are not used need not be there.
    fs::remove_file(folder.0.join("points/00000.ply")).unwrap();
    assert_eq!(frames(&part("1:")).len(), 2);
    let settings = CaptureSettings { frames: "3:9".parse().unwrap(), ..CaptureSettings::default() };
    assert_told(&check_capture(&folder.0, &settings), &["--frames: begins at frame 3, the clip has 3 frames"]);
}

#[test]
fn every_fault_of_the_priors_is_told_at_once() {
    let folder = Folder::new("priors-faults");
    write_capture(&folder);
    folder.write("flow/a/00000.flo", &flo(&FLOW)[..30]);
    folder.write("depth/b/00001.npy", npy("(3, 2)", "<f4", &floats(&DEPTH)));
    folder.write("depth/a/00002.pfm", pfm("-1", f32::to_le_bytes));
    fs::create_dir_all(folder.0.join("flow/b")).unwrap();
    folder.write("points/00001.ply", points("").replace("property list uchar int camera_ids\n", ""));
    fs::remove_file(folder.0.join("points/00002.ply")).unwrap();
    let says = [
        "flow/a/00000.flo: is 3 x 2, which takes 60 bytes, and has 30",
        "depth/b/00001.npy: is 2 x 3, its camera is calibrated for 3 x 2",
        "depth/a: holds files of several kinds; keep one of npy, pfm",
        "flow/b: holds no file of a known kind; give one of flo, npy, exr, png",
        "00001.ply, header: has no list `camera_ids`",
        "00002.ply: is missing",
    ];
    assert_told(&folder.check(), &says);
    assert_eq!(folder.check().n_faults, 6);
    fs::remove_dir_all(folder.0.join("flow")).unwrap();
    fs::create_dir_all(folder.0.join("flow")).unwrap();
    assert_told(&folder.check(), &["flow: holds no folder of any camera"]);
    folder.write("flow/a/frame_1.flo", flo(&FLOW));
    assert_told(&folder.check(), &["flow/a: holds no file of any frame"]);
}

#[test]
fn damaged_points_of_a_frame_are_refused() {
    let folder = Folder::new("points-faults");
    write_capture(&folder);
    let capture = folder.open();
    for (rows, says) in [
        ("1 2 3 10 20 30 1 8\n", "row 0: was seen by camera 8"),
        ("1 2 3 10 20 30 1 -1\n", "was seen by camera -1"),
        ("1 2 nan 10 20 30 0\n", "not finite"),
        ("1 2 3 10 20 30 2 7\n", "the file ends here"),
        ("1 2 3 10 20 300 0\n", "`300` is no U8 value"),
        ("1 2 3 10 20 30 x\n", "`x` is no U8 value"),
    ] {
        folder.write("points/00000.ply", points(rows));
        let fault = capture.points_of(0).unwrap_err();
        assert_eq!(fault.exit_code(), 3);
        assert!(fault.to_string().contains(says), "{rows}: {fault}");
    }
    let turn = [1.0, 0.0, 0.0, 0.0];
    let model = Model {
        cameras: vec![(40, 1, "PINHOLE", WIDTH.into(), HEIGHT.into(), vec![5.0, 5.0, 1.5, 1.0])],
        images: vec![(1, turn, [0.0; 3], 40, "b.png", vec![]), (2, turn, [0.0; 3], 40, "a.png", vec![])],
        points: vec![],
    };
    write_cameras(&folder, "sparse/0", &model);
    assert_told(&folder.check(), &["camera 40: is that of `b` and `a`"]);
}

#[test]
fn depth_is_written_as_halves_where_they_hold_it() {
    let folder = Folder::new("depth-halves");
    let path = folder.write("depth.npy", "");
    for (value, kind) in [(0.25, "<f2"), (-6e4, "<f2"), (0.0, "<f2"), (f32::NAN, "<f2"), (7e4, "<f4"), (1e-6, "<f4")] {
        write_depth_halves(&path, &[value, 1.001], 2, 1).unwrap();
        assert!(String::from_utf8_lossy(&std::fs::read(&path).unwrap()).contains(kind), "{value}");
        let is_near =
            |found: f32, told: f32| (found - told).abs() <= told.abs() / 2048.0 || found.is_nan() && told.is_nan();
        let found = read_depth(&path, 2, 1).unwrap();
        assert!(is_near(found[0], value) && is_near(found[1], 1.001), "{value}: {found:?}");
    }
}
