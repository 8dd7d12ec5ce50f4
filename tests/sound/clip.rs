//! Sources of sound in a file with a clock: what a player that knows the law of distance makes of them is what is rendered here.

use super::{head, horizon, noise, scene, track};
use crate::common::random;
use crate::scene::Folder;
use fourdgs::ReadOptions;
use glam::DVec3;
use ivv::scene::{Clock, Contents, Encoded, FourDgs, Grades, Sounds, View, demo, write_ply, write_views};
use ivv::sound::FS;
use ivv::sound::clip::sounds;
use ivv::sound::geometry::Mode;
use ivv::sound::pose::{Pose, PoseTrack};
use ivv::sound::render::{RenderConfig, render};
use ivv::sound::scene_file::{SoundScene, Source};
use ivv::sound::wav::{Depth, read, write};
use std::collections::BTreeMap;
use std::path::Path;

/// The sources of a file of a second and a half, and the law of distance that it states: the microphone's place, the least
/// distance.
fn stored(folder: &Folder, sounds: &Sounds) -> (Vec<fourdgs::AudioSource>, [f64; 3], f64) {
    let path = folder.file("clip.4dgs");
    let clock = Clock { fps: 30.0, frames: 45 };
    let contents = Contents { clock, views: &[], own: BTreeMap::new(), sounds };
    let bytes = Encoded::new(&random::scene(3, 5, 1), clock).bytes(&path, &contents, Grades::default()).unwrap();
    assert_eq!(FourDgs::of_bytes(&path, &bytes).unwrap().sounds(), *sounds);
    let scene = fourdgs::read_from(&bytes[..], &ReadOptions::default()).unwrap();
    let law = &scene.metadata.iter().find(|record| record.name == "ivv.sound").unwrap().entries;
    let mic: Vec<f64> = law["mic"].split(' ').map(|x| x.parse().unwrap()).collect();
    (scene.audio_sources, mic.try_into().unwrap(), law["r_min"].parse().unwrap())
}

/// Someone who walks from left to right, says something twice, and a recording of a second.
fn walk(folder: &Folder) -> (SoundScene, Vec<f32>) {
    let recording = noise(FS as usize, 5);
    let wav = folder.file("mic.wav");
    write(&wav, &recording.iter().map(|x| [*x]).collect::<Vec<_>>(), Depth::Float32).unwrap();
    let way: Vec<(f64, DVec3)> =
        (0..=30).map(|k| f64::from(k) / 30.0).map(|t| (t, DVec3::new(4.0 * t - 2.0, 1.5, 0.2))).collect();
    let mut scene = scene(track("p0", &way));
    scene.mic.wav = wav;
    scene.sources[0].gates = vec![(0.2, 0.45), (0.6, 0.8)];
    scene.sources[0].gain_db = -6.0;
    (scene, recording)
}

#[test]
fn a_player_hears_every_source_as_loud_as_it_is_rendered_from_anywhere() {
    let folder = Folder::new("sound-clip");
    let (mut scene, recording) = walk(&folder);
    let silent = Source { gates: vec![(3.0, 4.0)], ..scene.sources[0].clone() };
    scene.sources.push(silent);
    let moving =
        [(0.0, DVec3::ZERO), (1.0, DVec3::new(1.0, 0.5, 0.0))].map(|(t, p)| Pose { t, p, q: scene.mic.pose.at(0.0).q });
    for mic in [scene.mic.pose.clone(), PoseTrack::new(moving.to_vec()).unwrap()] {
        scene.mic.pose = mic;
        let (sources, place, r_min) = stored(&folder, &sounds(&scene, 1.5).unwrap());
        let [source] = &sources[..] else { panic!("{} sources", sources.len()) };
        assert_eq!((source.name.as_str(), source.spatial, source.gain), ("p0", true, 1.0));
        let sound = read(&folder.write("stored.wav", &source.data)).unwrap();
        assert_eq!((sound.fs, sound.channels.len()), (FS, 1));
        // Gates and their fades are all that is stored.
        assert!((source.start_sec - 0.165).abs() < 1e-3 && (source.duration_sec - 0.67).abs() < 2e-3, "{source:?}");
        for listener in [DVec3::ZERO, DVec3::new(-1.0, 0.5, 0.3), DVec3::new(0.0, 1.5, 0.2), DVec3::new(3.0, 9.0, -2.0)]
        {
            let config = RenderConfig { mode: Mode::Paper3d, ..RenderConfig::default() };
            let rendered = render(&scene, &head(listener, 20.0), horizon(), &config).unwrap();
            let mut n_heard = 0;
            for cue in rendered.cues[0].iter().filter(|cue| cue.gain > 0.0) {
                let at = ((cue.t - source.start_sec) * f64::from(FS)).round() as usize;
                let Some(stored) = sound.channels[0].get(at) else { continue };
                // The law of the player, by the places in the file.
                let next =
                    source.keyframes.iter().position(|key| key.time > cue.t).unwrap_or(source.keyframes.len() - 1);
                let (a, b) = (&source.keyframes[next - 1], &source.keyframes[next]);
                let part = ((cue.t - a.time) / (b.time - a.time)).min(1.0);
                let p = DVec3::from(a.position).lerp(b.position.into(), part);
                let reach = |from: DVec3| p.distance(from).max(r_min);
                let heard = f64::from(*stored) * reach(place.into()) / reach(listener);
                let told = f64::from(recording[(cue.t * f64::from(FS)).round() as usize]) * cue.gain;
                let step = 2.0 / 65_536.0 * reach(place.into()) / reach(listener);
                assert!((heard - told).abs() < step + 1e-3 * told.abs(), "{listener} at {}: {heard} for {told}", cue.t);
                n_heard += 1;
            }
            assert!(n_heard > 30, "{n_heard}");
        }
    }
}

#[test]
fn an_export_takes_sound_along_and_keeps_what_a_file_has() {
    let folder = Folder::new("sound-export");
    let (mut scene, _) = walk(&folder);
    scene.mic.wav = folder.file("mic.wav");
    scene.write(&folder.file("scene.json")).unwrap();
    let (splats, views) = demo();
    write_ply(&folder.file("demo.ply"), &splats).unwrap();
    write_views(&folder.file("cameras.json"), &views).unwrap();
    let export = |arguments: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_ivv"));
        let done = command.current_dir(folder.file("")).arg("export").args(arguments).output().unwrap();
        (done.status.code(), String::from_utf8(done.stderr).unwrap())
    };
    let (code, said) =
        export(&["demo.ply", "-o", "a.4dgs", "--seconds", "1", "--cameras", "cameras.json", "--sound", "scene.json"]);
    assert!(code == Some(0) && said.contains("1 source of sound"), "{said}");
    let open = |name: &str| FourDgs::read(&folder.file(name)).unwrap();
    let first = open("a.4dgs");
    assert_eq!((first.sounds().len(), first.views().unwrap().len()), (1, views.len()));
    // Another export of it keeps its sound, its views and how it is rendered, or takes what it is given.
    assert_eq!(export(&["a.4dgs", "-o", "b.4dgs", "--sound", "scene.json"]).0, Some(0));
    let again = open("b.4dgs");
    assert_eq!((again.sounds(), again.own()), (first.sounds(), first.own()));
    let names = |file: &FourDgs| file.views().unwrap().into_iter().map(|view: View| view.name).collect::<Vec<_>>();
    assert_eq!(names(&again), names(&first));
    write_views(&folder.file("one.json"), &views[..1]).unwrap();
    assert_eq!(export(&["a.4dgs", "-o", "c.4dgs", "--cameras", "one.json"]).0, Some(0));
    assert_eq!((open("c.4dgs").sounds(), names(&open("c.4dgs"))), (first.sounds(), names(&first)[..1].to_vec()));
    let (code, said) = export(&["demo.ply", "-o", "d.4dgs", "--seconds", "1", "--sound", "none.json"]);
    assert!(code == Some(3) && said.contains("none.json") && !Path::new(&folder.file("d.4dgs")).exists(), "{said}");
}
