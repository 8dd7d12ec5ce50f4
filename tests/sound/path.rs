//! Paths of heads in every kind of file.

use crate::common::prelude::*;
use ivv::internals::sound::path::{Convention, HeadPath, read_path};

fn heads() -> [HeadPose; 2] {
    let turn = |a: f64, b: f64| DQuat::from_rotation_z(a) * DQuat::from_rotation_x(b) * DQuat::from_rotation_y(0.3);
    [
        HeadPose { t: 0.0, p: DVec3::new(0.1, -2.0, 3.5), q: turn(0.7, -0.4) },
        HeadPose { t: 0.5, p: DVec3::new(1.1, -2.5, 3.0), q: turn(-2.0, 1.2) },
    ]
}

/// The axes x, y, z of a camera in the head's (x forward, y left, z up), written from the words of each convention.
fn camera_axes(convention: Convention) -> DMat3 {
    let (forward, left, up) = (DVec3::X, DVec3::Y, DVec3::Z);
    match convention {
        Convention::OpenCv => DMat3::from_cols(-left, -up, forward),
        Convention::OpenGl | Convention::OpenXr => DMat3::from_cols(-left, up, -forward),
        Convention::Head => DMat3::from_cols(forward, left, up),
    }
}

fn camera_to_world(head: &HeadPose, convention: Convention) -> DMat3 {
    DMat3::from_quat(head.q) * camera_axes(convention)
}

fn assert_heads(found: &HeadPath, what: &str) {
    let poses = found.track.poses();
    assert_eq!(poses.len(), 2, "{what}");
    for (found, head) in poses.iter().zip(heads()) {
        assert!((found.t - head.t).abs() < 1e-12 && (found.p - head.p).length() < 1e-12, "{what}");
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            assert!((found.q * axis - head.q * axis).length() < 1e-9, "{what}: {axis}");
        }
    }
}

pub fn tum(convention: Convention) -> String {
    let line = |head: &HeadPose| {
        let q = DQuat::from_mat3(&camera_to_world(head, convention));
        format!("{} {} {} {} {} {} {} {}\n", head.t, head.p.x, head.p.y, head.p.z, q.x, q.y, q.z, q.w)
    };
    format!("# timestamp tx ty tz qx qy qz qw\n{}", heads().iter().map(line).collect::<String>())
}

pub fn nerfstudio(is_flat: bool) -> String {
    let camera = |head: &HeadPose| {
        let m = camera_to_world(head, Convention::OpenGl);
        let row = |k: usize| [m.x_axis[k], m.y_axis[k], m.z_axis[k], head.p[k]];
        let rows = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
        let matrix = if is_flat { serde_json::json!(rows.as_flattened()) } else { serde_json::json!(rows) };
        serde_json::json!({ "camera_to_world": matrix, "fov": 50.0, "aspect": 1.5 })
    };
    let path: Vec<_> = heads().iter().map(camera).collect();
    serde_json::json!({ "camera_type": "perspective", "fps": 2.0, "seconds": 1.0, "render_width": 96, "render_height": 64, "camera_path": path }).to_string()
}

pub fn csv() -> String {
    let line =
        |h: &HeadPose| format!("{},{},{},{},{},{},{},{}\n", h.q.w, h.q.x, h.q.y, h.q.z, h.t, h.p.x, h.p.y, h.p.z);
    format!("qw,qx,qy,qz,t,x,y,z\n{}", heads().iter().map(line).collect::<String>())
}

#[test]
fn every_kind_of_file_gives_the_same_head() {
    let folder = Folder::new("paths");
    for convention in [Convention::OpenCv, Convention::OpenGl, Convention::OpenXr, Convention::Head] {
        let path = folder.write("path.txt", tum(convention));
        let what = format!("{convention:?}");
        assert_heads(&read_path(&path, Some(convention)).unwrap(), &what);
        let other = if convention == Convention::Head { Convention::OpenCv } else { Convention::Head };
        assert!(read_path(&path, Some(other)).unwrap().track.poses()[0].q.angle_between(heads()[0].q) > 0.1, "{what}");
    }
    assert_heads(&read_path(folder.write("path.tum", tum(Convention::OpenCv)), None).unwrap(), "TUM");
    assert_heads(&read_path(folder.write("path.csv", csv()), None).unwrap(), "CSV");
    for is_flat in [true, false] {
        let found = read_path(folder.write("path.json", nerfstudio(is_flat)), None).unwrap();
        assert_heads(&found, "nerfstudio");
        let camera = found.camera.unwrap();
        assert_eq!((camera.fps, camera.width, camera.height, camera.fov), (2.0, 96, 64, 50.0));
    }
}

#[test]
fn a_head_is_a_camera() {
    for head in heads() {
        let rows = head.world_to_camera().rows();
        let camera = |p: DVec3| DVec3::from_array([0, 1, 2].map(|k| DVec3::from_slice(&rows[k]).dot(p) + rows[k][3]));
        // What is ahead, to the right and below of the head.
        let seen = camera(head.p + head.q * DVec3::new(2.0, -0.5, -0.25));
        assert!((seen - DVec3::new(0.5, 0.25, 2.0)).length() < 1e-12, "{seen}");
        assert_eq!(rows[3], [0.0, 0.0, 0.0, 1.0]);
    }
}

#[test]
fn damaged_paths_are_told() {
    let folder = Folder::new("bad-paths");
    let cases = [
        ("a.txt", tum(Convention::Head).replace("0.5 ", "0 "), "pose 1"),
        ("b.txt", tum(Convention::Head) + "1 2 3\n", "line 4"),
        ("c.txt", "0 0 0 0 0 0 0 0\n".to_owned(), "pose 0"),
        ("d.txt", "0 nan 0 0 0 0 0 1\n".to_owned(), "pose 0"),
        ("e.txt", "# nothing\n".to_owned(), "there is none"),
        ("f.csv", csv().replace("qz", "q3"), "no column `qz`"),
        ("g.csv", csv() + "1,2,x,4,5,6,7,8\n", "line 4: has no number in the column `qy`"),
        ("h.json", nerfstudio(true).replace("perspective", "fisheye"), "fisheye"),
        ("i.json", nerfstudio(true).replace("\"fps\":2.0", "\"fps\":0"), "0 frames per second"),
        ("j.json", "{".to_owned(), "line 1"),
    ];
    for (name, text, says) in cases {
        let error = read_path(folder.write(name, text), None).unwrap_err().to_string();
        assert!(error.contains(says) && error.contains(name), "{error} does not say {says}");
    }
    let mut stretched: serde_json::Value = serde_json::from_str(&nerfstudio(true)).unwrap();
    stretched["camera_path"][1]["camera_to_world"][0] = 3.0.into();
    let error = read_path(folder.write("k.json", stretched.to_string()), None).unwrap_err().to_string();
    assert!(error.contains("pose 1, ") || error.contains("pose 1:"), "{error}");
    assert!(read_path(folder.0.join("absent.txt"), None).is_err());
}
