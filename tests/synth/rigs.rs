//! Rigs that look outward, at rest and on their way.

use super::{bodies, exr, json, make, numbers, options};
use crate::common::prelude::*;
use ivv::internals::synth::{Noise, Options, Rig};

fn few(rig: Rig, cameras: u32, frames: u32) -> Options {
    Options { rig, cameras, frames, samples: 1, noise: Noise::None, points: 60, ..options() }
}

fn rotation(view: &View) -> DMat3 {
    let m = view.pose.rows();
    DMat3::from_cols_array_2d(&[0, 1, 2].map(|k| [m[0][k], m[1][k], m[2][k]]))
}

fn center(view: &View) -> DVec3 {
    view.pose.center()
}

fn project(view: &View, world: DVec3) -> (DVec2, f64) {
    let at = rotation(view) * (world - center(view));
    (
        DVec2::new(
            view.intrinsics.fx * at.x / at.z + view.intrinsics.cx,
            view.intrinsics.fy * at.y / at.z + view.intrinsics.cy,
        ),
        at.z,
    )
}

fn unproject(view: &View, pixel: DVec2, depth: f64) -> DVec3 {
    let at = DVec3::new(
        (pixel.x - view.intrinsics.cx) / view.intrinsics.fx,
        (pixel.y - view.intrinsics.cy) / view.intrinsics.fy,
        1.0,
    ) * depth;
    rotation(view).transpose() * at + center(view)
}

fn pixel(view: &View, i: usize) -> DVec2 {
    let width = view.intrinsics.width as usize;
    DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5)
}

#[test]
fn an_outward_rig_is_a_hemisphere_of_half_a_metre_in_a_scene_of_1_to_8_metres() {
    let folder = make("outward", &few(Rig::Outward, 9, 1), 2);
    let capture = Capture::open(&folder).unwrap();
    let views: Vec<View> = (0..9).map(|camera| capture.view(camera, 0).unwrap()).collect();
    let ahead: Vec<DVec3> = views.iter().map(|view| rotation(view).row(2)).collect();
    // Lenses lie behind each other along where they look: the middle is where these lines meet.
    let middle = views.iter().zip(&ahead).map(|(view, ahead)| center(view) - 0.25 * *ahead).sum::<DVec3>() / 9.0;
    let (mut nearest, mut farthest) = (f64::INFINITY, 0.0_f64);
    for (camera, (view, ahead)) in views.iter().zip(&ahead).enumerate() {
        let out = center(view) - middle;
        assert!((out.length() - 0.25).abs() < 0.02, "camera {camera} is {} from the middle", out.length());
        assert!(out.normalize().dot(*ahead) > 0.99, "camera {camera} does not look outward");
        let exact = exr(&folder.join(format!("truth/exact/{}/00000.exr", capture.cameras[camera].name)));
        for (i, depth) in exact["depth.Z"].iter().enumerate() {
            let distance = (unproject(view, pixel(view, i), f64::from(*depth)) - middle).length();
            (nearest, farthest) = (nearest.min(distance), farthest.max(distance));
        }
    }
    assert!(nearest > 1.0 && nearest < 1.6 && farthest > 6.0 && farthest < 8.2, "{nearest} to {farthest} m");
    // They look all over the hemisphere, and every preset takes the rig.
    assert!(ahead.iter().any(|a| a.x < -0.5) && ahead.iter().any(|a| a.x > 0.5) && ahead.iter().any(|a| a.y < -0.5));
    assert!(capture.points.len() >= 30, "{} points", capture.points.len());
}

#[test]
fn a_moving_rig_has_a_pose_for_each_frame_and_flow_by_its_own_way() {
    let folder = make("moving", &Options { offsets: true, ..few(Rig::Moving, 5, 4) }, 2);
    let capture = Capture::open(&folder).unwrap();
    let is_dynamic: Vec<bool> = bodies(&folder).iter().map(|body| body.dynamic).collect();
    let truth = json(&folder.join("truth.json"));
    let (mut n, mut longest) = (0, 0.0_f64);
    for (camera, own) in capture.cameras.iter().enumerate() {
        assert_eq!(own.shots.len(), 4);
        for frame in 0..3 {
            let [now, next] = [frame, frame + 1].map(|frame| capture.view(camera, frame).unwrap());
            assert!(now.next_pose == Some(next.pose), "{}: no way to go", now.name);
            let way = (center(&next) - center(&now)).length();
            assert!((0.1..0.4).contains(&way), "{}: {way} m in a frame", now.name);
            let microphone = DVec3::from_slice(&numbers(&truth["microphones"][&own.name][frame as usize]));
            assert!((microphone - center(&now)).length() < 1e-9, "the microphone moves with its camera");
            let exact = exr(&folder.join(format!("truth/exact/{}/{frame:05}.exr", own.name)));
            for (i, depth) in exact["depth.Z"].iter().enumerate() {
                if is_dynamic[exact["body"][i] as usize] {
                    continue;
                }
                let flow = DVec2::new(exact["flow.X"][i].into(), exact["flow.Y"][i].into());
                let (there, z) = project(&next, unproject(&now, pixel(&now, i), f64::from(*depth)));
                let off = (there - pixel(&now, i) - flow).length();
                assert!(z < 0.1 || off < 1e-3 * (1.0 + flow.length()), "{}, pixel {i}: {off} pixels off", now.name);
                (n, longest) = (n + 1, longest.max(flow.length()));
            }
        }
    }
    assert!(n > 5000 && longest > 1.0, "{n} pixels at rest, flow of {longest} pixels at most");
}

#[test]
fn points_of_a_moving_rig_lie_where_its_cameras_of_that_frame_see_them() {
    let folder = make("moving-points", &few(Rig::Moving, 5, 4), 2);
    let capture = Capture::open(&folder).unwrap();
    let mut n = 0;
    for frame in [0, 3] {
        for point in capture.points_of(frame).unwrap() {
            assert!(point.seen_by.len() >= 2);
            for &camera in &point.seen_by {
                let view = capture.view(camera, frame).unwrap();
                let (at, z) = project(&view, DVec3::from_array(point.position));
                assert!(z > 0.0 && at.x >= 0.0 && at.y >= 0.0 && at.x < 48.0 && at.y < 36.0, "{at} at depth {z}");
                n += 1;
            }
        }
    }
    assert!(n > 100, "{n} sights");
}

#[test]
fn photographs_show_the_room_without_what_moves_and_change_nothing_else() {
    let with = make("photos", &Options { photos: Some(4), ..few(Rig::Outward, 4, 2) }, 2);
    let without = make("no-photos", &few(Rig::Outward, 4, 2), 2);
    let (mut files, others) = (super::files(&with), super::files(&without));
    let photos: Vec<_> = files.keys().filter(|path| path.starts_with("photos")).cloned().collect();
    assert!(photos.iter().filter(|path| path.extension().is_some_and(|end| end == "png")).count() == 4, "{photos:?}");
    photos.iter().for_each(|path| assert!(files.remove(path).is_some()));
    let differ: Vec<_> =
        files.iter().filter(|(path, bytes)| others.get(*path) != Some(bytes)).map(|(p, _)| p).collect();
    assert_eq!(differ, [Path::new("capture.toml"), Path::new("synth.json")]);
    let capture = Capture::open(&with).unwrap();
    assert_eq!(capture.cameras.iter().filter(|camera| camera.is_photo).count(), 4);
    assert!(capture.photo_points.len() > 10 && Capture::open(&without).unwrap().photo_points.is_empty());
}
