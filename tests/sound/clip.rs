//! Sources of sound in a file with a clock: what a player that knows the law of distance makes of them is what is rendered here.

use super::{head, horizon, noise, scene, track};
use crate::common::prelude::*;
use crate::common::program::{command, done};
use crate::common::random;
use fourdgs::ReadOptions;
use ivv::internals::formats::{Contents, Ears, Sounds, World};
use ivv::internals::sound::FS;
use ivv::internals::sound::clip::{ears, sounds};
use ivv::internals::sound::geometry::Mode;
use ivv::internals::sound::hrtf::degrees;
use ivv::internals::sound::render::render;
use ivv::internals::sound::scene_file::Source;
use ivv::internals::sound::wav::{Depth, read, write};
use ivv::internals::train::CaptureSummary;

/// The sources of a file of so many frames at 30 a second, and the law of distance that it states: the microphone's place, the
/// least distance.
fn stored(folder: &Folder, frames: u32, sounds: &Sounds) -> (Vec<fourdgs::AudioSource>, [f64; 3], f64) {
    let path = folder.file("clip.4dgs");
    let clock = Clock { fps: 30.0, frames };
    let contents =
        Contents { clock, views: &[], own: BTreeMap::new(), sounds, world: None, cutoff: None, is_quick: false };
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
        let (sources, place, r_min) = stored(&folder, 45, &sounds(&scene, 0.0, 1.5).unwrap());
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
fn a_clip_of_some_frames_is_heard_from_its_begin_to_its_end() {
    let folder = Folder::new("sound-clip-part");
    let (scene, _) = walk(&folder);
    let (all, ..) = stored(&folder, 45, &sounds(&scene, 0.0, 1.5).unwrap());
    // From a time between samples of the track; of both gates the second one is within.
    let (start, seconds) = (0.51, 0.4);
    let (part, ..) = stored(&folder, 12, &sounds(&scene, start, seconds).unwrap());
    let ([all], [part]) = (&all[..], &part[..]) else { panic!("{} and {} sources", all.len(), part.len()) };
    let times: Vec<f64> = part.keyframes.iter().map(|key| key.time).collect();
    assert_eq!((times[0], times[times.len() - 1], times.len()), (0.0, seconds, 14));
    for key in &part.keyframes {
        let x = 4.0 * (start + key.time) - 2.0;
        assert!((key.position[0] - x).abs() < 1e-9, "{} at {}, expected {x}", key.position[0], key.time);
    }
    assert!((part.start_sec - 0.055).abs() < 1e-3 && (part.duration_sec - 0.27).abs() < 2e-3, "{part:?}");
    let [whole, heard] =
        [all, part].map(|source| read(&folder.write("stored.wav", &source.data)).unwrap().channels.concat());
    let at = ((start + part.start_sec - all.start_sec) * f64::from(FS)).round() as usize;
    assert!(
        heard.iter().any(|x| *x != 0.0) && heard == whole[at..],
        "{} samples from {at} of {}",
        heard.len(),
        whole.len()
    );
    // One that begins with the recording may end before it; nothing is heard behind its end.
    let (first, ..) = stored(&folder, 9, &sounds(&scene, 0.0, 0.3).unwrap());
    let last = first[0].keyframes.last().unwrap();
    assert!(last.time == 0.3 && (last.position[0] + 0.8).abs() < 1e-9, "{last:?}");
    assert!(sounds(&scene, 2.0, 1.0).unwrap().is_empty());
}

/// A run that took the frames from 0.5 up to 0.9 s of a capture, which is not there any more.
pub fn run_of_some_frames(folder: &Folder, constants: Constants) {
    let path = folder.file("run");
    std::fs::create_dir_all(&path).unwrap();
    write_ply(&path.join("scene.ply"), &demo().0).unwrap();
    std::fs::write(path.join("config.json"), serde_json::to_vec(&exact()).unwrap()).unwrap();
    let held = CaptureSummary {
        cameras: 2,
        frames: 12,
        fps: 30.0,
        training_images: 24,
        test_images: 0,
        masks: 0,
        largest_image: [16, 16],
        points: 0,
    };
    let run = Run {
        capture: folder.file("gone"),
        capture_settings: CaptureSettings { frames: "15:27".parse().unwrap(), ..CaptureSettings::default() },
        test_cameras: Vec::new(),
        viewpoints: Vec::new(),
        calibration: BTreeMap::new(),
        world: Similarity::default(),
        constants,
        held,
        fingerprints: None,
    };
    run.write(&path).unwrap();
}

#[test]
fn what_a_run_of_some_frames_shows_is_heard_as_it_was_then() {
    let folder = Folder::new("sound-run-part");
    let (scene, _) = walk(&folder);
    scene.write(&folder.file("scene.json")).unwrap();
    run_of_some_frames(&folder, Constants::default());
    let ivv = |arguments: &[&str]| {
        done(command(arguments).current_dir(&folder.0));
    };
    ivv(&["export", "run", "-o", "run.4dgs", "--sound", "scene.json"]);
    let expected = sounds(&SoundScene::read(folder.file("scene.json")).unwrap(), 0.5, 0.4).unwrap();
    assert!(expected.len() == 1 && FourDgs::read(&folder.file("run.4dgs")).unwrap().sounds() == expected);
    // So is its scene alone, and a file that was made of it, where the clip is as long.
    for (from, to, seconds) in [("run/scene.ply", "run/a.4dgs", "0.4"), ("run/scene.ply", "run/b.4dgs", "1")] {
        ivv(&["export", from, "-o", to, "--seconds", seconds, "--sound", "scene.json"]);
    }
    ivv(&["export", "run/a.4dgs", "-o", "c.4dgs", "--sound", "scene.json"]);
    let is_heard = |file: &str| FourDgs::read(&folder.file(file)).unwrap().sounds() == expected;
    assert_eq!(["run/a.4dgs", "run/b.4dgs", "c.4dgs"].map(is_heard), [true, false, true]);
    // A video, the sound of which is beside it: the gate from 0.6 to 0.8 s is from 0.1 to 0.3 s of it.
    // The head goes to the right and looks along y, z up.
    let turn = "-0.70710678 0 0 0.70710678";
    folder.write("path.txt", format!("0 -0.3 0 0 {turn}\n0.3 0.3 0 0 {turn}\n"));
    let film = ["render", "run", "--path", "path.txt", "-o", "film.y4m", "--sound", "scene.json"];
    ivv(&[&film[..], &["--size", "32x24", "--fps", "10"]].concat());
    let heard = read(&folder.file("film.wav")).unwrap();
    assert_eq!(heard.channels[0].len(), 19_200);
    let loudest = |from: f64, to: f64| {
        let [from, to] = [from, to].map(|time| (time * f64::from(FS)) as usize);
        heard.channels.iter().flat_map(|ear| &ear[from..to]).fold(0.0_f32, |most, x| most.max(x.abs()))
    };
    let (before, within, behind) = (loudest(0.0, 0.05), loudest(0.12, 0.28), loudest(0.355, 0.4));
    assert!(within > 100.0 * before.max(behind) && within > 0.01, "{before}, {within}, {behind}");
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
        let done = command(&[&["export"], arguments].concat()).current_dir(&folder.0).output().unwrap();
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
    // Sound that is kept cannot follow another length.
    let (code, said) = export(&["a.4dgs", "-o", "n.4dgs", "--seconds", "0.5"]);
    assert!(
        code == Some(2) && said.contains("its sound cannot be stretched") && !folder.file("n.4dgs").exists(),
        "{said}"
    );
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
        let mut wola =
            ivv::internals::sound::wola::Wola::new(1024, 512, set.taps(Lookup::Aligned), set.max_delay()).unwrap();
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
    let sounds = sounds(&scene, 0.0, 1.5).unwrap().heard_with(Some(stored.clone()));
    let (_, mic, _) = self::stored(&folder, 45, &sounds);
    assert_eq!(mic, scene.mic.pose.poses()[0].p.to_array());
}

#[test]
fn damaged_ears_are_refused() {
    let folder = Folder::new("sound-ears-damaged");
    let set = HrtfSet::new(Sphere::default().measured(1), Path::new("few")).unwrap();
    let (stored, clock) = (ears(&set), Clock { fps: 30.0, frames: 45 });
    let sounds = Sounds::default().heard_with(Some(stored.clone()));
    let contents = Contents {
        clock,
        views: &[],
        own: BTreeMap::new(),
        sounds: &sounds,
        world: None,
        cutoff: None,
        is_quick: false,
    };
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
