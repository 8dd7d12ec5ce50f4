//! `tools/board_clocks.py`, run as a program: clocks and poses of cameras that see one board.

use crate::common::prelude::*;
const FOCAL: f64 = 600.0;
const RADIAL: f64 = -0.2;
/// When the cameras' frames are taken, frames after they count as taken; the mean is 0.
const OFFSETS: [f64; 3] = [0.3, -0.45, 0.15];
const FRAMES: usize = 24;

/// Rotation and translation from the world to a camera on an arc around it, 1.5 m away.
fn camera(id: usize) -> (DMat3, DVec3) {
    let turn =
        DMat3::from_quat(DQuat::from_rotation_x(0.1 * id as f64) * DQuat::from_rotation_y(0.5 * (id as f64 - 1.0)));
    (turn, DVec3::new(0.0, 0.0, 1.5))
}

/// A corner of the board at a time, in frames: it turns and goes to and fro.
fn corner(at: DVec3, time: f64) -> DVec3 {
    let turn = DQuat::from_scaled_axis(DVec3::new(0.5 * (0.16 * time).sin(), 0.4 * (0.12 * time).cos(), 0.05 * time));
    let shift = DVec3::new(0.2 * (0.2 * time).sin(), 0.15 * (0.17 * time).cos(), 0.1 * (0.14 * time + 1.0).sin());
    turn * at + shift
}

/// A session as caliscope writes it: corners as cameras with these offsets see them, and a pose of camera 1 that is wrong.
fn write_session(folder: &Folder) {
    let mut corners =
        "sync_index,cam_id,object_id,keypoint_id,img_loc_x,img_loc_y,obj_loc_x,obj_loc_y,obj_loc_z\n".to_owned();
    let mut times = "sync_index,cam_id,frame_time\n".to_owned();
    let mut array = String::new();
    for (id, offset) in OFFSETS.into_iter().enumerate() {
        let (turn, shift) = camera(id);
        for frame in 0..FRAMES {
            // They arrive a little early or late, which says nothing.
            times += &format!("{},{id},{}\n", frame + 5, 9.0 + frame as f64 / 6.0 + 0.01 * (id as f64 - 1.0));
            for key in 0..12 {
                let at = DVec3::new((key % 4) as f64 * 0.05, (key / 4) as f64 * 0.05, 0.0);
                let p = turn * corner(at, frame as f64 + offset) + shift;
                let radial = 1.0 + RADIAL * (p.x * p.x + p.y * p.y) / (p.z * p.z);
                // One corner was taken for another.
                let mistaken = if (id, frame, key) == (2, 7, 3) { 30.0 } else { 0.0 };
                let [x, y] = [radial * p.x / p.z * FOCAL + 320.0 + mistaken, radial * p.y / p.z * FOCAL + 240.0];
                corners += &format!("{},{id},0,{key},{x:.6},{y:.6},{},{},0.0\n", frame + 5, at.x, at.y);
            }
        }
        let wrong = if id == 1 { 1.0 } else { 0.0 };
        let told = DMat3::from_rotation_y(0.01 * wrong) * turn;
        let rows: Vec<[f64; 3]> = (0..3).map(|row| told.row(row).to_array()).collect();
        // caliscope writes matrices or, as for camera 0 here, rotation vectors.
        let rotation = if id == 0 { "[0.0, -0.5, 0.0]".to_owned() } else { format!("{rows:?}") };
        let translation = (shift + DVec3::new(0.01, -0.01, 0.005) * wrong).to_array();
        array += &format!(
            "[cameras.{id}]\nsize = [640, 480]\nmatrix = [[{FOCAL:.1}, 0.0, 320.0], [0.0, {FOCAL:.1}, 240.0], [0.0, 0.0, 1.0]]\n\
             distortions = [{RADIAL}, 0.0, 0.0, 0.0, 0.0]\ntranslation = {translation:?}\nrotation = {rotation}\n\n"
        );
    }
    // A frame without neighbours tells nothing of how the board moves.
    corners += "90,0,0,0,300.0,200.0,0.0,0.0,0.0\n";
    folder.write("session/camera_array.toml", array);
    folder.write("session/calibration/extrinsic/timestamps.csv", times);
    folder.write("session/calibration/extrinsic/CHARUCO/xy_CHARUCO.csv", corners);
}

#[test]
fn corners_of_a_board_tell_clocks_and_poses() {
    let Some(python) = ["python3", "/usr/bin/python3"].into_iter().find(|python| {
        let output = Command::new(python).args(["-c", "import cv2, numpy, tomllib"]).output();
        output.is_ok_and(|output| output.status.success())
    }) else {
        return crate::common::notes::skip("no python3 with OpenCV and NumPy is installed");
    };
    let folder = Folder::new("board");
    write_session(&folder);
    let (session, fitted) = (folder.0.join("session"), folder.0.join("fitted"));
    let run = || {
        let tool = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/board_clocks.py");
        Command::new(python).arg(tool).arg(&session).arg("-o").arg(&fitted).output().unwrap()
    };
    let output = run();
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && said.contains("864 corners in 24 frames"), "{said}");

    let text = std::fs::read_to_string(fitted.join("timestamps.csv")).unwrap();
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 3 * FRAMES);
    for row in rows {
        let expected = 9.0 + (row[0] - 5.0 + OFFSETS[row[1] as usize]) / 6.0;
        assert!((row[2] - expected).abs() < 0.01 / 6.0, "{row:?}, not {expected}");
    }
    let array: toml::Table = std::fs::read_to_string(fitted.join("camera_array.toml")).unwrap().parse().unwrap();
    for id in 0..3 {
        let own = &array["cameras"][&id.to_string()];
        let number = |value: &toml::Value| value.as_float().unwrap();
        let translation: Vec<f64> = own["translation"].as_array().unwrap().iter().map(number).collect();
        let rotation: Vec<f64> =
            own["rotation"].as_array().unwrap().iter().flat_map(|row| row.as_array().unwrap()).map(number).collect();
        let (turn, shift) = camera(id);
        let off = (DVec3::from_slice(&translation) - shift).length();
        let turned = (0..9).map(|k| (rotation[k] - turn.row(k / 3)[k % 3]).abs()).fold(0.0, f64::max);
        assert!(off < 2e-3 && turned < 2e-3, "camera {id}: {off} m, {turned}; {said}");
        assert!(fitted.join(format!("cam_{id}.mp4")).is_symlink());
    }
    let again = run();
    assert!(!again.status.success() && String::from_utf8_lossy(&again.stderr).contains("is there already"));
    std::fs::remove_dir_all(&fitted).unwrap();
    let array = std::fs::read_to_string(session.join("camera_array.toml")).unwrap();
    let fails = |file: &str, text: &str, says: &str| {
        folder.write(&format!("session/{file}"), text);
        let said = String::from_utf8_lossy(&run().stderr).into_owned();
        assert!(said.contains(says) && !said.contains("Traceback") && !fitted.exists(), "{file}: {said}");
    };
    fails("camera_array.toml", &array.replace("distortions", "fisheye = true\ndistortions"), "is a fisheye");
    fails("camera_array.toml", &array.replace("translation", "t"), "camera 0 has no translation: calibrate it");
    fails("camera_array.toml", "[cameras.0]\n", "camera 0 has no matrix");
    let corners = "calibration/extrinsic/CHARUCO/xy_CHARUCO.csv";
    fails(corners, "sync_index,cam_id\nx,1\n", "is no session that caliscope calibrated");
    fails(corners, "sync_index\n", "holds no corners of three frames in a row");
    fails("calibration/extrinsic/xy_other.csv", "", "holds 2 files xy_*.csv");
}
