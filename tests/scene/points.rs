//! `tools/points_to_ply.py`, run as a program.

use super::Folder;
use crate::common::prelude::*;

/// Writes an .npz of 60 points as numpy would, without numpy.
const MAKE: &str = r#"
import array, sys, zipfile
points = array.array("f")
state = 1
for i in range(180):
    state = state * 48271 % 2147483647
    # A dense cluster and a few points far away.
    points.append(state / 2147483647 * (40.0 if i > 150 else 1.0))
def member(archive, name, kind, shape, values):
    header = repr({"descr": kind, "fortran_order": False, "shape": shape}).encode()
    header += b" " * (-(len(header) + 11) % 64) + b"\n"
    archive.writestr(name + ".npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + values.tobytes())
with zipfile.ZipFile(sys.argv[1], "w") as archive:
    member(archive, "means3d", "<f4", (60, 3), points)
    member(archive, "colors", "|u1", (60, 3), array.array("B", range(180)))
    identity = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    member(archive, "viewmats", "<f4", (2, 4, 4), array.array("f", identity * 2))
    member(archive, "Ks", "<f8", (2, 3, 3), array.array("d", [90.0, 0, 32, 0, 80, 24, 0, 0, 1] * 2))
    member(archive, "width", "<i8", (), array.array("q", [64]))
    member(archive, "height", "<i8", (), array.array("q", [48]))
"#;

#[track_caller]
fn python(arguments: &[&Path]) -> Option<Output> {
    let output = Command::new("python3").args(arguments).output();
    if output.is_err() {
        crate::common::notes::skip("python3 is not installed");
    }
    output.ok()
}

#[test]
fn points_become_gaussians_as_large_as_their_neighbours_are_near() {
    let folder = Folder::new("points");
    let tool = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/points_to_ply.py");
    let (npz, ply, json) = (folder.file("points.npz"), folder.file("scene.ply"), folder.file("cameras.json"));
    let Some(made) = python(&[&folder.write("make.py", MAKE), &npz]) else { return };
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let options = ["--opacity=0.75", "--size=1", "--quantile=1"].map(Path::new);
    let arguments = [&tool, &npz, &ply, &json].map(|path| path.as_path()).into_iter().chain(options);
    let done = python(&arguments.collect::<Vec<_>>()).unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let scene = read_ply(&ply).unwrap();
    assert_eq!((scene.len(), scene.n_static, scene.sh_degree), (60, 60, 0));
    for (i, &[x, y, z]) in scene.position.iter().enumerate() {
        let others = scene.position.iter().enumerate().filter(|&(j, _)| j != i);
        let mut distances: Vec<f32> = others.map(|(_, p)| (p[0] - x).hypot(p[1] - y).hypot(p[2] - z)).collect();
        distances.sort_by(f32::total_cmp);
        let expected = (distances[0] + distances[1] + distances[2]) / 3.0;
        assert!((scene.scale[i][0].exp() / expected - 1.0).abs() < 1e-4, "point {i}");
        assert_eq!(scene.scale[i], [scene.scale[i][0]; 3]);
        assert!((scene.opacity[i] - 3.0_f32.ln()).abs() < 1e-6);
        assert!((0.5 + 0.282_094_8 * scene.sh[i][1] - (3 * i + 1) as f32 / 255.0).abs() < 1e-6);
    }
    let views = read_views(&json).unwrap();
    assert_eq!(views.len(), 2);
    let view = &views[1];
    assert_eq!((view.name.as_str(), view.intrinsics.width, view.intrinsics.height), ("view01", 64, 48));
    assert_eq!(
        (view.intrinsics.fx, view.intrinsics.fy, view.intrinsics.cx, view.intrinsics.cy),
        (90.0, 80.0, 32.0, 24.0)
    );
    let bad = folder.write("bad.npz", "no archive");
    let failed = python(&[&tool, &bad, &folder.file("none.ply"), &json]).unwrap();
    assert_eq!(failed.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&failed.stderr).contains("bad.npz"));
    assert!(!folder.file("none.ply").exists());
}
