//! Camera files.

use super::{Folder, fault};
use crate::common::golden;
use crate::common::prelude::*;

fn view(name: &str) -> View {
    View {
        name: name.to_owned(),
        intrinsics: Intrinsics { width: 320, height: 240, fx: 300.1, fy: 1.0 / 3.0, cx: 160.0, cy: -2.5e-7 },
        pose: Pose::of_rows(&[[0.0, 0.0, 1.0, 0.1], [1.0, 0.0, 0.0, -2.0], [0.0, 1.0, 0.0, 3.0], [0.0, 0.0, 0.0, 1.0]]),
        time: 0.1 + 0.2,
        time_offset: -0.37,
        flow_dt: 1.0 / 30.0,
        background: [0.1, 0.2, 0.3],
        flow_model: FlowModel::Velocity,
        next_pose: None,
    }
}

#[test]
fn views_are_read_back_equal_to_the_last_bit() {
    let folder = Folder::new("views");
    let path = folder.file("cameras.json");
    let mut views = vec![view("a"), view("b 2.0")];
    // Numbers whose shortest decimal form needs a parser that rounds correctly.
    views[1].pose.translation.x = 0.121_314_151_617_181_93;
    views[1].intrinsics.fx = f64::from_bits(0x3ff1_9999_9999_999b);
    write_views(&path, &views).unwrap();
    assert_eq!(read_views(&path).unwrap(), views);
}

#[test]
fn the_cone_of_a_view_touches_its_farthest_corner() {
    let base = view("cone");
    let intrinsics = Intrinsics { fx: 250.0, fy: 260.0, cx: 150.0, cy: 130.0, ..base.intrinsics };
    let view = View { intrinsics, ..base };
    let origin = [0.5, -0.25, 1.0];
    let cone = view.cone(origin);
    // A point of the camera at depth 2, in the world, relative to the origin, against the cone.
    let tangent = |[x, y]: [f64; 2]| {
        let camera = [
            2.0 * (x - view.intrinsics.cx) / view.intrinsics.fx,
            2.0 * (y - view.intrinsics.cy) / view.intrinsics.fy,
            2.0,
        ];
        let m = view.pose.rows();
        let world = |k: usize| (0..3).map(|row| m[row][k] * (camera[row] - m[row][3])).sum::<f64>() - origin[k];
        let offset: [f64; 3] = std::array::from_fn(|k| world(k) - f64::from(cone.tip[k]));
        let depth: f64 = (0..3).map(|k| offset[k] * f64::from(cone.axis[k])).sum();
        assert!((depth - 2.0).abs() < 1e-6);
        let aside: f64 = (0..3).map(|k| (offset[k] - depth * f64::from(cone.axis[k])).powi(2)).sum();
        aside.sqrt() / depth
    };
    let corners = [[0.0, 0.0], [320.0, 0.0], [0.0, 240.0], [320.0, 240.0]].map(tangent);
    let farthest = corners.into_iter().fold(0.0, f64::max);
    assert!(corners[1] == farthest && corners[2] < farthest - 0.05, "{corners:?}");
    assert!((f64::from(cone.reach) - farthest).abs() < 1e-6, "{} for {farthest}", cone.reach);
}

const PLAIN: &str = r#"{"views": [{"name": "n", "width": 4, "height": 3, "fx": 5, "fy": 6.5, "cx": 2, "cy": 1.5,
    "world_to_camera": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "comment": "other fields are ignored"}]}"#;

#[test]
fn absent_fields_have_the_defaults_of_the_specification() {
    let folder = Folder::new("defaults");
    let views = read_views(&folder.write("cameras.json", PLAIN)).unwrap();
    assert_eq!(views.len(), 1);
    let view = &views[0];
    assert_eq!((view.time, view.time_offset, view.flow_dt, view.background), (0.0, 0.0, 1.0, [0.0; 3]));
    assert_eq!((view.intrinsics.fx, view.intrinsics.fy), (5.0, 6.5));
}

/// (changes a good view, what the error must say)
type Case = (fn(&mut View), &'static str);

const CASES: [Case; 25] = [
    (|v| v.name.clear(), "view 1, field `name`: has 0 bytes"),
    (|v| v.name = "x".repeat(201), "field `name`: has 201 bytes"),
    (|v| v.name = "a/b".into(), "field `name`: has a path separator"),
    (|v| v.name = "a\\b".into(), "field `name`: has a path separator"),
    (|v| v.name = "a..b".into(), "field `name`: has a path separator"),
    (|v| v.name = "a\nb".into(), "field `name`: has a path separator"),
    (|v| v.name = "first".into(), "view 1 (`first`), field `name`: is the name of an earlier view"),
    (|v| v.intrinsics.width = 0, "view 1 (`second`), field `width`: is 0"),
    (|v| v.intrinsics.width = 65537, "field `width`: is 65537"),
    (|v| v.intrinsics.height = 0, "field `height`: is 0"),
    (|v| v.intrinsics.height = u32::MAX, "field `height`: is 4294967295"),
    (|v| v.intrinsics.fx = 0.0, "field `fx`: is 0"),
    (|v| v.intrinsics.fx = f64::NAN, "field `fx`: is NaN"),
    (|v| v.intrinsics.fy = -1.0, "field `fy`: is -1"),
    (|v| v.intrinsics.fy = f64::INFINITY, "field `fy`: is inf"),
    (|v| v.intrinsics.cx = f64::NAN, "field `cx`: is NaN"),
    (|v| v.intrinsics.cy = f64::NEG_INFINITY, "field `cy`: is -inf"),
    (|v| v.time = f64::NAN, "field `time`: is NaN"),
    (|v| v.time_offset = f64::NAN, "field `time_offset`: is NaN"),
    (|v| v.flow_dt = f64::INFINITY, "field `flow_dt`: is inf"),
    (|v| v.background[1] = f32::NAN, "field `background`: is [0.1, NaN, 0.3]"),
    (|v| v.pose.translation.z = f64::NAN, "field `world_to_camera`: has an entry that is not finite"),
    (|v| v.pose.rotation.z_axis.x = 1.001, "has no rotation: rows 0 and 0"),
    (|v| v.pose.rotation.z_axis.x = -1.0, "mirrors"),
    (|v| v.pose.rotation.y_axis = DVec3::splat(1e300), "has no rotation"),
];

#[test]
fn every_fault_of_a_view_is_named_by_the_writer() {
    let folder = Folder::new("faults-of-views");
    let path = folder.file("cameras.json");
    for (spoil, says) in CASES {
        let mut views = vec![view("first"), view("second")];
        spoil(&mut views[1]);
        let told = fault(write_views(&path, &views), &path);
        assert!(told.contains(says), "{told:?} does not say {says:?}");
        assert!(!path.exists());
    }
    let mut nearly = view("first");
    nearly.pose.rotation.z_axis.x = 1.000_4;
    write_views(&path, &[nearly]).unwrap();
}

#[test]
fn every_fault_of_a_file_is_named_by_the_reader() {
    let folder = Folder::new("faults-of-files");
    let cases = [
        ("", "", "not a cameras file"),
        (PLAIN, "{\"views\": []}", "holds no view"),
        (PLAIN, "[]", "not a cameras file"),
        (PLAIN, "{\"views\": [3]}", "view 0: invalid type"),
        ("\"width\": 4", "\"width\": -4", "view 0 (`n`): invalid value"),
        ("\"width\": 4", "\"width\": 4.5", "view 0 (`n`): invalid type"),
        ("\"width\": 4", "\"width\": 65537", "view 0 (`n`), field `width`"),
        ("\"fx\": 5,", "", "missing field `fx`"),
        ("\"fx\": 5", "\"fx\": 1e999", "not a cameras file"),
        ("[0,0,0,1]]", "[0,0,0]]", "view 0 (`n`): invalid length 3"),
        (
            "[0,0,0,1]]",
            "[0,0,0,2]]",
            "field `world_to_camera`: has [0.0, 0.0, 0.0, 2.0] as its last row, not [0, 0, 0, 1]",
        ),
        (
            "[0,0,0,1]]",
            "[1e-9,0,0,1]]",
            "field `world_to_camera`: has [1e-9, 0.0, 0.0, 1.0] as its last row, not [0, 0, 0, 1]",
        ),
        ("[1,0,0,0]", "[2,0,0,0]", "has no rotation"),
        ("\"name\": \"n\",", "", "view 0: missing field `name`"),
        ("\"name\": \"n\"", "\"name\": \"../n\"", "has a path separator"),
    ];
    for (from, to, says) in cases {
        let text = if from.is_empty() { "{".to_owned() } else { PLAIN.replace(from, to) };
        let path = folder.write("cameras.json", text);
        let told = fault(read_views(&path), &path);
        assert!(told.contains(says), "{from:?} -> {to:?}: {told:?} does not say {says:?}");
    }
    for n in 0..PLAIN.len() {
        let path = folder.write("cut.json", &PLAIN[..n]);
        fault(read_views(&path), &path);
    }
    let path = folder.file("absent.json");
    fault(read_views(&path), &path);
}

#[test]
fn the_golden_cameras_are_read() {
    for case in golden::CASES {
        let Some(folder) = golden::folder(case) else { continue };
        let views = read_views(&folder.join("camera.json")).unwrap();
        assert_eq!(views.len(), 1, "{case}");
        assert_eq!(views[0].name, case);
        assert!(views[0].intrinsics.width > 32 && views[0].intrinsics.fx > 32.0);
    }
}

#[test]
fn a_view_looks_from_where_it_is_to_what_it_looks_at_with_up_upwards() {
    let in_camera = |view: &View, p: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|row| {
            let m = view.pose.rows()[row];
            m[3] + (0..3).map(|k| m[k] * p[k]).sum::<f64>()
        })
    };
    let (eye, target) = ([1.0, -2.0, 0.5], [3.0, 1.0, 4.0]);
    let view = View::look_at(eye, target, [0.0, -1.0, 0.0], Intrinsics::of_fov(640, 480, 60.0));
    assert!(in_camera(&view, eye).iter().all(|x| x.abs() < 1e-12));
    let distance = (4.0f64 + 9.0 + 12.25).sqrt();
    let [x, y, z] = in_camera(&view, target);
    assert!(x.abs() < 1e-12 && y.abs() < 1e-12 && (z - distance).abs() < 1e-12);
    // What is above the target is above it in the picture, and straight above.
    let [x, y, z] = in_camera(&view, [3.0, 0.9, 4.0]);
    assert!(x.abs() < 1e-12 && y < -1e-3);
    assert!((view.intrinsics.cy + view.intrinsics.fy * y / z) < 240.0);
    // The borders are 60 degrees apart.
    assert!(
        ((240.0 / view.intrinsics.fy).atan().to_degrees() - 30.0).abs() < 1e-12
            && view.intrinsics.fx == view.intrinsics.fy
    );
    let folder = Folder::new("look-at");
    let views = [
        view,
        View {
            name: "down".to_owned(),
            ..View::look_at(eye, [1.0, 3.0, 0.5], [0.0, -1.0, 0.0], Intrinsics::of_fov(8, 8, 90.0))
        },
        View { name: "nowhere".to_owned(), ..View::look_at(eye, eye, [0.0; 3], Intrinsics::of_fov(8, 8, 90.0)) },
    ];
    write_views(&folder.file("views.json"), &views).unwrap();
    assert_eq!(read_views(&folder.file("views.json")).unwrap(), views, "rotations, all of them");
}
