//! Recordings, detections of faces, tracks and sets of responses.

use super::engine::Seed;
use super::{file, files_of};
use crate::common::prelude::*;
use crate::sound::{keypoints as detections, path as ways, scene, track};
use ivv::internals::sound::keypoints::keypoints_of;
use ivv::internals::sound::path::{Convention, read_path};
use ivv::internals::sound::wav::{self, Channel, Depth};

pub fn keypoints() -> Vec<Seed> {
    let folder = Folder::new("fuzz-keypoints");
    detections::dialects(&folder);
    let files = files_of(&folder.0);
    let read = |folder: &Path| {
        let single = ["video/cam.json", "demo/cam.json"].map(|name| folder.join(name));
        let many = ["pictures", "openpose", "pose2sim", "rtmlib"].map(|name| keypoints_of(&folder.join(name), "cam"));
        let all = single.into_iter().filter(|path| path.exists()).chain(many.into_iter().flatten());
        all.filter(|path| detections::read(path).is_ok()).count() > 0
    };
    let of = |dialect: &'static str| {
        let parts = files.iter().filter(|(name, _)| name.starts_with(dialect));
        Seed::of(parts.map(|(name, bytes)| (name.clone(), bytes.clone())), read)
    };
    ["video", "demo", "pictures", "openpose", "pose2sim", "rtmlib"].map(of).into()
}

pub fn wav() -> Vec<Seed> {
    let frames: Vec<[f32; 2]> = (0..64).map(|i| [i as f32 / 64.0, -0.5]).collect();
    let seed = |depth: Depth| {
        let bytes = file("a.wav", |path| wav::write(path, &frames, depth));
        Seed::of([("a.wav", bytes)], |folder| {
            let _ = wav::read_channel(&folder.join("a.wav"), Channel::Left, 0.0);
            wav::read(&folder.join("a.wav")).is_ok()
        })
    };
    vec![seed(Depth::Int24), seed(Depth::Float32)]
}

/// A folder of impulse responses by their names.
pub fn responses() -> Vec<Seed> {
    let folder = Folder::new("fuzz-responses");
    folder.write("LICENSE", "Free of all\nterms");
    let mut frames = vec![[0.0f32; 2]; 64];
    for az in [0, 45, 90, 135, 180, 225, 270, 315] {
        for el in [-45, 0, 45] {
            let turn = f64::from(az).to_radians().sin() * f64::from(el).to_radians().cos();
            let ears = [0.5 + 0.3 * turn, 0.5 - 0.3 * turn];
            let (at, delay) = (8, (8.0 * turn).round() as i32);
            frames.iter_mut().for_each(|frame| *frame = [0.0; 2]);
            frames[(at + 8 - delay) as usize][0] = ears[0] as f32;
            frames[(at + 8 + delay) as usize][1] = ears[1] as f32;
            wav::write(folder.0.join(format!("azi_{az}_ele_{el}.wav")), &frames, Depth::Float32).unwrap();
        }
    }
    vec![Seed::of(files_of(&folder.0), |folder| HrtfSet::open(folder).is_ok())]
}

fn way() -> SourceTrack {
    track("p7", &[(0.0, DVec3::X), (1.0 / 30.0, DVec3::Y), (2.0 / 30.0, DVec3::new(0.1, -2e-7, 1.0 / 7.0))])
}

pub fn tracks() -> Vec<Seed> {
    let bytes = file("p7.csv", |path| way().write_csv(path));
    vec![Seed::of([("p7.csv", bytes)], |folder| SourceTrack::read_csv(&folder.join("p7.csv")).is_ok())]
}

pub fn sound_scene() -> Vec<Seed> {
    let folder = Folder::new("fuzz-sound-scene");
    let frames: Vec<[f32; 1]> = (0..64).map(|i| [i as f32 / 64.0]).collect();
    wav::write(folder.0.join("a.wav"), &frames, Depth::Int24).unwrap();
    let mut scene = scene(way());
    scene.mic.wav = folder.0.join("a.wav");
    scene.write(&folder.0.join("scene.json")).unwrap();
    let only = vec!["scene.json"];
    let seed = Seed::of(files_of(&folder.0), |folder| SoundScene::read(folder.join("scene.json")).is_ok());
    vec![Seed { only, ..seed.clone() }, seed]
}

pub fn paths() -> Vec<Seed> {
    let seeds = [
        ("a.tum", ways::tum(Convention::OpenCv)),
        ("a.csv", ways::csv()),
        ("a.json", ways::nerfstudio(true)),
        ("b.json", ways::nerfstudio(false)),
    ];
    let read = |folder: &Path| {
        let all = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        all.filter(|path| read_path(path, None).is_ok()).count() > 0
    };
    seeds.map(|(name, text)| Seed::of([(name, text)], read)).into()
}
