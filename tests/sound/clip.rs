//! Sources of sound in a file with a clock: what a player that knows the law of distance makes of them is what is rendered here.

use super::{head, horizon, noise, scene, track};
use crate::common::random;
use crate::scene::Folder;
use fourdgs::ReadOptions;
use glam::DVec3;
use ivv::formats::{Clock, Contents, Ears, Encoded, FourDgs, Grades, Sounds, World, write_ply};
use ivv::scene::{View, demo, write_views};
use ivv::sound::FS;
use ivv::sound::clip::{ears, sounds};
use ivv::sound::geometry::Mode;
use ivv::sound::hrtf::{HrtfSet, Lookup, degrees};
use ivv::sound::pose::{HeadPose, PoseTrack};
use ivv::sound::render::{RenderConfig, render};
use ivv::sound::scene_file::{SoundScene, Source};
use ivv::sound::sphere::Sphere;
use ivv::sound::wav::{Depth, read, write};
use std::collections::BTreeMap;
use std::path::Path;

/// The sources of a file of a second and a half, and the law of distance that it states: the microphone's place, the least
/// distance.
fn stored(folder: &Folder, sounds: &Sounds) -> (Vec<fourdgs::AudioSource>, [f64; 3], f64) {
    let path = folder.file("clip.4dgs");
    let clock = Clock { fps: 30.0, frames: 45 };
    let contents = Contents { clock, views: &[], own: BTreeMap::new(), sounds, world: None, is_quick: false };
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
    let moving = [(0.0, DVec3::ZERO), (1.0, DVec3::new(1.0, 0.5, 0.0))].map(|(t, p)| HeadPose {
        t,
        p,
        q: scene.mic.pose.at(0.0).q,
    });
    let still = scene.mic.pose.clone();
    // The last is louder than the whole numbers of a WAV file can be.
    for (mic, gain_db) in [(still.clone(), -6.0), (PoseTrack::new(moving.to_vec()).unwrap(), -6.0), (still, 40.0)] {
        (scene.mic.pose, scene.sources[0].gain_db) = (mic, gain_db);
        let (sources, place, r_min) = stored(&folder, &sounds(&scene, 1.5).unwrap());
        let [source] = &sources[..] else { panic!("{} sources", sources.len()) };
        assert_eq!((source.name.as_str(), source.spatial, source.gain == 1.0), ("p0", true, gain_db < 0.0));
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
                let heard = source.gain * f64::from(*stored) * reach(place.into()) / reach(listener);
                let told = f64::from(recording[(cue.t * f64::from(FS)).round() as usize]) * cue.gain;
                let step = source.gain * 2.0 / 65_536.0 * reach(place.into()) / reach(listener);
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
    let world = World { up: scene.up.to_array(), metres_per_unit: scene.metres_per_unit };
    assert_eq!((first.world(), again.world()), (Some(world), Some(world)));
    assert_eq!(export(&["a.4dgs", "-o", "m.4dgs", "--metres-per-unit", "0.5"]).0, Some(0));
    assert_eq!(open("m.4dgs").world(), Some(World { metres_per_unit: Some(0.5), ..world }));
    let (code, said) = export(&["a.4dgs", "-o", "n.4dgs", "--metres-per-unit", "0"]);
    assert!(code == Some(2) && said.contains("--metres-per-unit: expected a positive number, found 0"), "{said}");
    let names = |file: &FourDgs| file.views().unwrap().into_iter().map(|view: View| view.name).collect::<Vec<_>>();
    assert_eq!(names(&again), names(&first));
    write_views(&folder.file("one.json"), &views[..1]).unwrap();
    assert_eq!(export(&["a.4dgs", "-o", "c.4dgs", "--cameras", "one.json"]).0, Some(0));
    assert_eq!((open("c.4dgs").sounds(), names(&open("c.4dgs"))), (first.sounds(), names(&first)[..1].to_vec()));
    // Ears come along once they are in it, also with another sound.
    let (code, said) = export(&["a.4dgs", "-o", "e.4dgs", "--hrtf", "sphere"]);
    assert!(code == Some(0) && said.contains("ears: rigid sphere"), "{said}");
    assert!(open("a.4dgs").sounds().ears().is_none() && open("e.4dgs").sounds().ears().is_some());
    assert_eq!(export(&["e.4dgs", "-o", "f.4dgs", "--cameras", "one.json"]).0, Some(0));
    assert_eq!(open("f.4dgs").sounds(), open("e.4dgs").sounds());
    assert_eq!(export(&["f.4dgs", "-o", "g.4dgs", "--sound", "scene.json"]).0, Some(0));
    assert_eq!(open("g.4dgs").sounds(), open("e.4dgs").sounds());
    let (code, said) = export(&["demo.ply", "-o", "h.4dgs", "--seconds", "1", "--hrtf", "sphere"]);
    assert!(code != Some(0) && said.contains("--sound") && !folder.file("h.4dgs").exists(), "{said}");
    let (code, said) = export(&["a.4dgs", "-o", "h.4dgs", "--hrtf", "none.sofa"]);
    assert!(code == Some(3) && said.contains("none.sofa") && !folder.file("h.4dgs").exists(), "{said}");
    // What does not apply to another format is refused.
    let (code, said) =
        export(&["demo.ply", "-o", "d.spz", "--time", "0", "--target-size", "2", "--sound", "scene.json"]);
    assert!(code == Some(2) && said.contains("--target-size, --sound do not apply to the format spz"), "{said}");
    let (code, said) = export(&["demo.ply", "-o", "d.ply", "--seconds", "1"]);
    assert!(code == Some(2) && said.contains("--seconds does not apply to the format ply"), "{said}");
    assert!(!folder.file("d.spz").exists() && !folder.file("d.ply").exists());
    let (code, said) = export(&["demo.ply", "-o", "d.4dgs", "--seconds", "1", "--sound", "none.json"]);
    assert!(code == Some(3) && said.contains("none.json") && !Path::new(&folder.file("d.4dgs")).exists(), "{said}");
}

/// Level of the difference of two responses against the first, dB.
fn off(expected: &[f32], found: &[f32]) -> f64 {
    let energy = |x: f64| x * x;
    let sum: f64 = expected.iter().map(|x| energy((*x).into())).sum();
    let at = |k: usize| f64::from(found.get(k).copied().unwrap_or(0.0));
    let difference: f64 = expected.iter().enumerate().map(|(k, x)| energy(f64::from(*x) - at(k))).sum();
    10.0 * (difference / sum).log10()
}

#[test]
fn ears_of_a_file_are_those_that_are_rendered_with() {
    let folder = Folder::new("sound-ears");
    let set = HrtfSet::open(Path::new("sphere")).unwrap();
    let stored = ears(&set);
    let bytes = stored.bytes();
    println!("{} bytes: {}", bytes.len(), stored.about());
    assert!(bytes.len() < 2_400_000 && stored.about().contains("sphere"), "{} bytes", bytes.len());
    assert_eq!(Ears::parse(Path::new("ears.bin"), &bytes).unwrap(), stored);
    let grid = Ears::grid(stored.rows());
    assert_eq!(
        (grid[0], grid[grid.len() - 1], grid.len() as u32),
        ([0.0, -90.0], [0.0, 90.0], stored.rows().iter().sum())
    );
    // What a listener hears of one sample that a source sends in each of these directions.
    let mut impulse = vec![0.0; 2048];
    impulse[1024] = 1.0;
    let mut worst = f64::NEG_INFINITY;
    for (at, [az, el]) in grid.iter().enumerate().filter(|(at, _)| at % 97 == 0 || grid[*at][1] == 0.0) {
        let filter = set.filter(degrees(*az, *el), Lookup::Aligned);
        let mut heard = vec![[0.0; 2]; impulse.len()];
        let mut wola = ivv::sound::wola::Wola::new(1024, 512, set.taps(Lookup::Aligned), set.max_delay()).unwrap();
        let spectra = wola.spectra(&filter);
        let mut spectra = Some(spectra);
        wola.process(&impulse, &mut heard, |_, _| (spectra.take(), 1.0));
        for ear in 0..2 {
            let expected: Vec<f32> = heard[1024 - 32..].iter().map(|ears| ears[ear]).collect();
            worst = worst.max(off(&expected, &stored.response(at, ear)));
        }
    }
    println!("off by {worst:.1} dB at most");
    assert!(worst < -45.0, "{worst} dB");

    // A file keeps them beside what is heard.
    let (scene, _) = walk(&folder);
    let sounds = sounds(&scene, 1.5).unwrap().heard_with(Some(stored.clone()));
    let (_, mic, _) = self::stored(&folder, &sounds);
    assert_eq!(mic, scene.mic.pose.poses()[0].p.to_array());
}

#[test]
fn damaged_ears_are_refused() {
    let folder = Folder::new("sound-ears-damaged");
    let set = HrtfSet::new(Sphere::default().measured(1), Path::new("few")).unwrap();
    let (stored, clock) = (ears(&set), Clock { fps: 30.0, frames: 45 });
    let sounds = Sounds::default().heard_with(Some(stored.clone()));
    let contents = Contents { clock, views: &[], own: BTreeMap::new(), sounds: &sounds, world: None, is_quick: false };
    let path = folder.file("ears.4dgs");
    let whole = Encoded::new(&random::scene(3, 5, 1), clock).bytes(&path, &contents, Grades::default()).unwrap();
    assert_eq!(FourDgs::of_bytes(&path, &whole).unwrap().sounds().ears(), Some(&stored));
    let start = whole.windows(8).position(|bytes| bytes == b"IVVEARS1").unwrap();
    let text = start + 8 + 4 * (3 + stored.rows().len());
    for (at, word, said) in [
        (4, *b"ARS2", "IVVEARS1"),
        (8, 44_100u32.to_le_bytes(), "48000 samples per second"),
        (12, 0u32.to_le_bytes(), "taps from 1 to 1024"),
        (12, u32::MAX.to_le_bytes(), "taps from 1 to 1024"),
        (12, 8u32.to_le_bytes(), "bytes of responses"),
        (16, 1u32.to_le_bytes(), "step"),
        (16, 100_000u32.to_le_bytes(), "rows from 1 to 181"),
        (20, 721u32.to_le_bytes(), "directions of a row from 1 to 720"),
        (text - start, f32::NAN.to_le_bytes(), "positive step"),
        (text - start, (-1f32).to_le_bytes(), "positive step"),
        (text - start + 4, u32::MAX.to_le_bytes(), "bytes of text"),
        (text - start + 8, [0xff; 4], "UTF-8"),
    ] {
        let mut bytes = whole.clone();
        bytes[start + at..start + at + 4].copy_from_slice(&word);
        let fault = FourDgs::of_bytes(&path, &bytes).unwrap_err().to_string();
        assert!(fault.contains("ears.bin") && fault.contains(said), "byte {at}: {fault}");
    }
    let attachment = stored.bytes();
    for length in (0..200).chain([attachment.len() / 2, attachment.len() - 1]) {
        let fault = Ears::parse(&path, &attachment[..length]).unwrap_err().to_string();
        assert!(fault.contains("ears.bin") && fault.contains("expected"), "{length}: {fault}");
    }
}
