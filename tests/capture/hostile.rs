//! What a hostile or careless author may write: files that are no files, cameras that no camera has, clips without end.

use super::model::{Model, sample, write, write_cameras, write_images};
use super::{Folder, assert_told, png, told};
use crate::common::prelude::*;
use ivv::internals::sound::wav;
use std::sync::mpsc;

/// A named pipe, which nobody writes to.
pub fn pipe(folder: &Folder, name: &str) -> PathBuf {
    let path = folder.0.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let _ = std::fs::remove_file(&path);
    assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
    path
}

/// What `work` returns; a failure when it waits for ever.
fn ends<T: Send + 'static>(what: &str, work: impl FnOnce() -> T + Send + 'static) -> T {
    let (to, from) = mpsc::channel();
    std::thread::spawn(move || to.send(work()));
    from.recv_timeout(Duration::from_secs(60)).unwrap_or_else(|_| panic!("{what} waits for ever"))
}

#[test]
fn a_pipe_or_a_device_is_no_file_to_any_reader() {
    let folder = Folder::new("pipe");
    for name in
        ["scene.ply", "scene.splat", "cameras.json", "a.wav", "00000007.ckpt", "depth.exr", "depth.npy", "depth.png"]
    {
        let path = pipe(&folder, name);
        let told = ends(name, move || match path.extension().and_then(|e| e.to_str()).unwrap() {
            "json" => read_views(&path).unwrap_err().to_string(),
            "wav" => wav::read(&path).unwrap_err().to_string(),
            "exr" | "npy" | "png" => read_depth(&path, 6, 4).unwrap_err().to_string(),
            "ckpt" => Checkpoint::read(&path).unwrap_err().to_string(),
            _ => read_scene(&path).unwrap_err().to_string(),
        });
        assert!(told.contains("expected a regular file, found a named pipe"), "{name}: {told}");
    }
    let told = ends("/dev/zero", || read_views("/dev/zero".as_ref()).unwrap_err().to_string());
    assert!(told.contains("found a device"), "{told}");
    let told = read_views(&folder.0).unwrap_err().to_string();
    assert!(told.contains("found a folder"), "{told}");
    // A capture with one in the place of each of its files.
    for name in ["sparse/0/cameras.bin", "sparse/0/images.bin", "sparse/0/points3D.bin", "images/b.png"] {
        let folder = Folder::new(&format!("pipe-{}", name.replace('/', "-")));
        write(&folder, &sample());
        write_images(&folder);
        pipe(&folder, name);
        let report = ends(name, move || folder.check());
        // Without a file of the cameras the folder is no model.
        assert!(report.n_faults > 0 || name.ends_with("points3D.bin"), "{name}");
    }
}

#[test]
fn the_newest_checkpoint_may_be_a_pipe() {
    let folder = Folder::new("pipe-checkpoint");
    pipe(&folder, "00000007.ckpt");
    let path = folder.0.clone();
    let found = ends("newest", move || Checkpoint::newest(&path).map(|found| found.is_some()));
    assert!(!found.unwrap_or(false));
}

#[test]
fn a_camera_that_nobody_has_is_refused_by_the_name_of_its_number() {
    for (name, number, parameters, says) in [
        ("PINHOLE", 1, vec![1e-320, 5.0, 3.0, 2.0], "fx = 1e-320"),
        ("PINHOLE", 1, vec![5.0, -5.0, 3.0, 2.0], "fy = -5"),
        ("PINHOLE", 1, vec![5.0, f64::NAN, 3.0, 2.0], "fy = NaN"),
        ("PINHOLE", 1, vec![5.0, 5.0, -1e9, 2.0], "cx = -1000000000"),
        ("PINHOLE", 1, vec![5.0, 5.0, 3.0, 1e12], "cy = 1000000000000"),
        ("SIMPLE_RADIAL", 2, vec![5.0, 3.0, 2.0, 1e30], "k1 = 1e30"),
        ("OPENCV", 4, vec![5.0, 5.0, 3.0, 2.0, 0.1, 0.0, 0.0, 1e37], "p2 = 1e37"),
        ("OPENCV_FISHEYE", 5, vec![5.0, 5.0, 3.0, 2.0, 0.1, 0.0, 0.0, f64::INFINITY], "k4 = inf"),
    ] {
        let folder = Folder::new("bounds");
        let model =
            Model { cameras: vec![(3, number, name, 6, 4, parameters), sample().cameras[1].clone()], ..sample() };
        write(&folder, &model);
        write_images(&folder);
        assert_told(&folder.check(), &[says]);
    }
}

#[test]
fn lenses_that_are_made_are_not_refused() {
    // An ordinary lens, a fisheye of 200 degrees, a 2,000 mm lens, a rational model with large terms, a crop far from the axis.
    for (name, number, parameters) in [
        ("SIMPLE_RADIAL", 2, vec![5.0, 3.0, 2.0, -0.3]),
        ("OPENCV_FISHEYE", 5, vec![1.7, 1.7, 3.0, 2.0, 0.02, -0.004, 0.001, 0.0]),
        ("SIMPLE_RADIAL", 2, vec![336.0, 3.0, 2.0, 900.0]),
        ("FULL_OPENCV", 6, vec![5.0, 5.0, 3.0, 2.0, 45.0, 30.0, 0.01, 0.01, 8.0, 45.5, 31.0, 9.0]),
        ("PINHOLE", 1, vec![5.0, 5.0, -200.0, 2.0]),
    ] {
        let folder = Folder::new("made");
        let model =
            Model { cameras: vec![(3, number, name, 6, 4, parameters), sample().cameras[1].clone()], ..sample() };
        write(&folder, &model);
        write_images(&folder);
        let told = told(&folder.check());
        assert!(!told.contains("expected"), "{name}: {told}");
    }
}

/// A capture folder of two cameras that stand still.
fn still(folder: &Folder, manifest: &Manifest) {
    let turn = [1.0, 0.0, 0.0, 0.0];
    let model = Model {
        cameras: [1, 2].map(|id| (id, 1, "PINHOLE", 6, 4, vec![5.0, 5.0, 3.0, 2.0])).into(),
        images: vec![(1, turn, [0.0; 3], 1, "a.png", vec![]), (2, turn, [1.0, 0.0, 0.0], 2, "b.png", vec![])],
        points: vec![],
    };
    write_cameras(folder, "sparse/0", &model);
    for camera in ["a", "b"] {
        folder.write(&format!("images/{camera}/00000.png"), png(6, 4, 0));
    }
    std::fs::create_dir_all(folder.0.join("points")).unwrap();
    manifest.write(&folder.0).unwrap();
}

#[test]
fn a_clip_without_end_is_one_fault() {
    let folder = Folder::new("endless");
    let manifest = Manifest { fps: 25.0, frames: u32::MAX, points: true, ..Manifest::default() };
    still(&folder, &manifest);
    let report = folder.check();
    assert_told(&report, &["has 4294967295 frames, 1 to 1048576 are allowed"]);
    assert_eq!(report.n_faults, 1, "{}", told(&report));
    // A long one whose files are not there.
    still(&folder, &Manifest { frames: 1_000_000, ..manifest.clone() });
    let report = folder.check();
    assert_told(&report, &["points/00000.ply: is missing, as are those of 999999 more frames"]);
    assert!(report.n_faults < 2_100, "{}", report.n_faults);
    for (fps, says) in [(1e300, "has 1e300 frames"), (1e-300, "has 1e-300 frames")] {
        still(&folder, &Manifest { fps, frames: 1, points: false, ..manifest.clone() });
        let report = folder.check();
        let told = told(&report);
        assert!(
            report.n_faults == 1 && told.contains("field `fps`") && told.contains("0.0001 to 100000"),
            "{says}: {told}"
        );
    }
    still(&folder, &Manifest { fps: 0.001, frames: 1, points: false, ..manifest });
    assert!(Capture::open(&folder.0).is_ok());
}

#[cfg(unix)]
#[test]
fn a_name_that_is_not_utf8_is_told_as_what_it_is() {
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::new("not-utf8");
    let path = folder.0.join(std::ffi::OsStr::from_bytes(b"caf\xe9"));
    let inside = Folder(path.clone());
    write(&inside, &sample());
    write_images(&inside);
    let ivv = |verb: &str, rest: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
        command.arg(verb).arg(&path).args(rest).output().unwrap()
    };
    let checked = ivv("check", &["--json"]);
    assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stderr));
    let report: serde_json::Value = serde_json::from_slice(&checked.stdout).unwrap();
    assert!(report["path"].as_str().unwrap().contains("caf"));
    let output = folder.0.join("run");
    let trained = ivv("train", &["-o", output.to_str().unwrap(), "--steps", "1"]);
    let told = String::from_utf8_lossy(&trained.stderr).into_owned();
    assert_eq!(trained.status.code(), Some(3), "{told}");
    assert!(told.contains("not UTF-8") && !told.contains("not full"), "{told}");
    let out = folder.0.join("out");
    let prepared = ivv("prepare", &["-o", out.to_str().unwrap()]);
    assert!(prepared.status.success(), "{}", String::from_utf8_lossy(&prepared.stderr));
}
