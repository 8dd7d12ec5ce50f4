//! The JSON of detectors.

use crate::common::prelude::*;
use ivv::internals::scene::undistort::Lens;
use ivv::internals::sound::keypoints::{KeypointSettings, Mouths, keypoints_of};
use serde_json::json;

const LENS: Lens = Lens {
    intrinsics: Intrinsics { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0 },
    distortion: Distortion::None,
};
const N_FRAMES: u64 = 3;

/// The points of a person: mouth about (300 + frame, 200), 40 pixels wide; scores of SimCC's kind.
fn person(frame: u64) -> (Vec<[f64; 2]>, Vec<f64>) {
    let mut points = vec![[0.0; 2]; 133];
    let mut scores = vec![0.0; 133];
    for (index, (first, n, w, h)) in
        (71..91).map(|i| (i, if i < 83 { (71, 12.0, 20.0, 8.0) } else { (83, 8.0, 16.0, 4.0) }))
    {
        let turn = std::f64::consts::TAU * f64::from(index - first) / n;
        points[index as usize] = [300.25 + frame as f64 - w * turn.cos(), 200.5 - h * turn.sin()];
        scores[index as usize] = if index % 2 == 0 { 1.11 } else { 0.875 };
    }
    (points, scores)
}

fn instances(frame: u64) -> Value {
    let (keypoints, keypoint_scores) = person(frame);
    json!([{ "keypoints": keypoints, "keypoint_scores": keypoint_scores, "bbox": [[1.0, 2.0, 3.0, 4.0]], "bbox_score": 0.9 }])
}

fn triples(points: &[[f64; 2]], scores: &[f64]) -> Vec<f64> {
    points.iter().zip(scores).flat_map(|([x, y], score)| [*x, *y, *score]).collect()
}

/// The same detections as each program writes them.
pub fn dialects(folder: &Folder) -> Vec<PathBuf> {
    let frames = |first: u64| -> Vec<Value> {
        (0..N_FRAMES).map(|frame| json!({ "frame_id": frame + first, "instances": instances(frame) })).collect()
    };
    let mut paths = vec![folder.write("video/cam.json", json!(frames(0)).to_string())];
    let demo = json!({ "meta_info": { "dataset_name": "coco_wholebody" }, "instance_info": frames(1) });
    paths.push(folder.write("demo/cam.json", demo.to_string()));
    for frame in 0..N_FRAMES {
        folder.write(&format!("pictures/cam/{frame:05}.json"), instances(frame).to_string());
        let (points, scores) = person(frame);
        // BODY_25 has no mouth; the face's 68 points begin at 23 in COCO-WholeBody, and two pupils follow.
        let face = [triples(&points[23..91], &scores[23..91]), vec![0.0; 6]].concat();
        let open_pose = json!({ "version": 1.3, "people": [{
            "person_id": [-1], "pose_keypoints_2d": vec![0.0; 75], "face_keypoints_2d": face, "hand_left_keypoints_2d": [],
        }] });
        folder.write(&format!("openpose/cam/clip2_{frame:012}_keypoints.json"), open_pose.to_string());
        let pose2sim = json!({ "version": 1.3, "people": [{
            "person_id": [-1], "pose_keypoints_2d": triples(&points, &scores), "face_keypoints_2d": [],
        }] });
        // What it does not find it writes as Python writes what is no number.
        let text = pose2sim.to_string().replacen("0.0,0.0,0.0", "NaN,NaN,NaN", 5);
        folder.write(&format!("pose2sim/cam_json/cam_{frame:06}.json"), text);
        // RTMLib's 134 points in OpenPose's order: a neck stands after the body.
        let neck = |list: &mut Vec<[f64; 2]>| list.insert(17, [9.0, 9.0]);
        let (mut points, mut scores) = (points, scores);
        neck(&mut points);
        scores.insert(17, 0.9);
        let with_neck = json!([{ "keypoints": points, "keypoint_scores": scores }]);
        folder.write(&format!("rtmlib/cam/{frame:05}.json"), with_neck.to_string());
    }
    for name in ["pictures", "openpose", "pose2sim", "rtmlib"] {
        paths.push(keypoints_of(&folder.0.join(name), "cam").unwrap());
    }
    paths
}

pub fn read(path: &Path) -> ivv::Result<Mouths> {
    Mouths::read(path, &LENS, &KeypointSettings::default())
}

#[test]
fn every_dialect_tells_the_same_mouths() {
    let folder = Folder::new("dialects");
    let paths = dialects(&folder);
    assert_eq!(paths.len(), 6);
    let expected = read(&paths[0]).unwrap();
    assert_eq!(expected.frames.len(), N_FRAMES as usize);
    for (frame, mouths) in &expected.frames {
        let [mouth] = mouths.as_slice() else { panic!("{mouths:?}") };
        assert!((mouth.at.x - (300.25 + f64::from(*frame))).abs() < 1e-3 && (mouth.at.y - 200.5).abs() < 0.2);
        assert!((mouth.width - 40.0).abs() < 1e-9 && (mouth.opening.unwrap() - 0.2).abs() < 1e-9);
        assert!(mouth.weight > 0.8 && mouth.weight <= 1.0 && mouth.sigma == 1.0 && !mouth.approx);
    }
    for path in &paths[1..] {
        assert_eq!(read(path).unwrap(), expected, "{}", path.display());
    }
}

#[test]
fn where_a_clip_begins_is_known_or_asked_for() {
    let folder = Folder::new("first-frame");
    let frames = |first: u64| -> Vec<Value> {
        (0..N_FRAMES).map(|frame| json!({ "frame_id": frame + first, "instances": instances(frame) })).collect()
    };
    let list = folder.write("list.json", json!(frames(1)).to_string());
    let demo = folder.write("demo.json", json!({ "instance_info": frames(0) }).to_string());
    folder.write("pictures/0007.json", instances(0).to_string());
    for path in [&list, &demo, &folder.0.join("pictures")] {
        let error = read(path).unwrap_err().to_string();
        assert!(error.contains("--first-frame"), "{error}");
    }
    let with = |first_frame: u32, path: &Path| {
        Mouths::read(path, &LENS, &KeypointSettings { first_frame: Some(first_frame), image_size: None })
    };
    assert!(with(1, &list).unwrap().frames.keys().eq(&[0, 1, 2]));
    assert!(with(0, &list).unwrap().frames.keys().eq(&[1, 2, 3]));
    assert!(with(5, &folder.0.join("pictures")).unwrap().frames.keys().eq(&[2]));
    assert!(with(2, &list).unwrap_err().to_string().contains("the first is 2"));
}

#[test]
fn without_lips_the_nose_is_taken() {
    let folder = Folder::new("nose");
    let with = |n: usize, scores: &[(usize, f64)]| {
        let points: Vec<[f64; 2]> = (0..n).map(|i| [100.0 + 10.0 * i as f64, 100.0]).collect();
        let mut all = vec![0.0; n];
        scores.iter().for_each(|(index, score)| all[*index] = *score);
        let frame = json!([{ "frame_id": 0, "instances": [{ "keypoints": points, "keypoint_scores": all }] }]);
        read(&folder.write("cam.json", frame.to_string())).unwrap()
    };
    let found = with(17, &[(0, 0.8), (1, 0.9), (2, 0.9)]);
    let mouth = found.frames[&0][0];
    assert!(mouth.approx && mouth.at.x == 100.0 && mouth.weight == 0.8 && (mouth.sigma - 12.0).abs() < 1e-9);
    // Five points of the lips are too few.
    let lips: Vec<(usize, f64)> = (71..76).map(|index| (index, 0.9)).chain([(0, 0.5), (4, 0.5)]).collect();
    assert!(with(133, &lips).frames[&0][0].approx);
    // A nose alone does not tell how large the head is.
    let alone = with(133, &[(0, 0.9)]);
    assert!(alone.frames.is_empty());
}

#[test]
fn pictures_of_another_size_are_refused() {
    let folder = Folder::new("size");
    let path = dialects(&folder).remove(0);
    let read = |width: u32, height: u32, image_size: Option<(u32, u32)>| {
        let lens = Lens { intrinsics: Intrinsics { width, height, ..LENS.intrinsics }, ..LENS };
        Mouths::read(&path, &lens, &KeypointSettings { first_frame: None, image_size })
    };
    let error = read(256, 192, None).unwrap_err().to_string();
    assert!(error.contains("3 of 3 mouths outside") && error.contains("--image-size"), "{error}");
    let error = read(256, 192, Some((640, 360))).unwrap_err().to_string();
    assert!(error.contains("640 x 360"), "{error}");
    let same = read(640, 480, None).unwrap();
    let half = read(320, 240, Some((640, 480))).unwrap();
    assert_eq!(half.frames.len(), 3);
    for (a, b) in same.frames.values().flatten().zip(half.frames.values().flatten()) {
        assert!((a.at * 0.5 - b.at).length() < 1e-9 && (a.width - 2.0 * b.width).abs() < 1e-9);
    }
}

#[test]
fn damaged_files_are_told() {
    let folder = Folder::new("damaged");
    let cases: [(&str, &str); 8] = [
        ("", "EOF"),
        ("[{\"frame_id\": 0}]", "neither `instances`"),
        ("{\"version\": 1.3}", "neither `instance_info`"),
        (
            "[{\"frame_id\": 0, \"instances\": [{\"keypoints\": [[1, 2]], \"keypoint_scores\": []}]}]",
            "1 points and 0 scores",
        ),
        (
            "[{\"frame_id\": 0, \"instances\": [{\"keypoints\": [[1, 2]], \"keypoint_scores\": [1]}]}]",
            "a person of 1 points",
        ),
        ("[{\"frame_id\": -3, \"instances\": []}]", "line 1"),
        ("[{\"frame_id\": 18446744073709551615, \"instances\": []}]", "--first-frame"),
        ("[{\"keypoints\": [], \"keypoint_scores\": []}]", "one picture"),
    ];
    for (text, says) in cases {
        let error = read(&folder.write("cam.json", text)).unwrap_err().to_string();
        assert!(error.contains(says) && error.contains("cam.json"), "{error} does not say {says}");
    }
    let far = "[{\"frame_id\": 0, \"instances\": []}, {\"frame_id\": 4000000000, \"instances\": []}]";
    assert!(read(&folder.write("far.json", far)).unwrap_err().to_string().contains("at most 1048576"));
    let open_pose = "{\"people\": [{\"pose_keypoints_2d\": [1, 2]}]}";
    folder.write("odd/f_0.json", open_pose);
    assert!(read(&folder.0.join("odd")).unwrap_err().to_string().contains("triples"));
    folder.write("nameless/f.json", "[]");
    assert!(read(&folder.0.join("nameless")).unwrap_err().to_string().contains("no number"));
    assert!(read(&folder.0.join("absent.json")).is_err());
    assert_eq!(read(&folder.write("nobody.json", "[]")).unwrap(), Mouths::default());
    assert_eq!(keypoints_of(&folder.0, "cam9"), None);
}
