//! From keypoints to tracks as a whole.

use super::rigs::{mouths, rig};
use crate::common::prelude::*;
use crate::common::program::{json, told};
use ivv::internals::sound::keypoints::{KeypointSettings, Mouths, keypoints_of};
use ivv::internals::sound::localize::{LocalizeSettings, Localized, localize};
use ivv::internals::sound::rig::{Rig, RigCamera};
use ivv::internals::sound::source_track::Flag;
use ivv::internals::synth::{Noise, Options};

/// Root mean square distance of a track from the truth at its frames, where it is seen.
fn error(found: &Localized, track: usize, truth: impl Fn(f64) -> DVec3) -> f64 {
    let seen: Vec<_> = found.tracks[track].samples.iter().filter(|sample| sample.flag == Flag::Seen).collect();
    assert!(seen.len() > 4);
    let squares: f64 = seen.iter().map(|s| (s.p - truth(s.t * found.tracks[track].fps)).length_squared()).sum();
    (squares / seen.len() as f64).sqrt()
}

/// Clocks that are off by up to half of a frame, a mouth that passes at 1.5 m/s.
#[test]
fn learnt_clocks_are_respected() {
    let mut rig = rig(6, 30.0, 45);
    for (camera, offset) in rig.cameras.iter_mut().zip([0.45, -0.3, 0.2, -0.45, 0.35, -0.25]) {
        camera.offset = offset;
    }
    let truth = |time: f64| DVec3::new(1.5 * (time / 30.0 - 0.75), 0.05, 3.0);
    let seen = mouths(&rig, 10, |time, _| vec![truth(time)]);
    let settings = LocalizeSettings::default();
    let known = localize(&rig, &seen, &settings);
    let folder = Folder::new("clocks");
    let rows: Vec<_> = rig
        .cameras
        .iter()
        .map(|c| serde_json::json!({ "camera": c.name, "how": "learnt", "offset": c.offset, "standard_error": null }))
        .collect();
    let table = folder.write("offsets.json", serde_json::to_vec(&rows).unwrap());
    let mut unknown = rig.clone();
    unknown.cameras.iter_mut().for_each(|camera| camera.offset = 0.0);
    let blind = error(&localize(&unknown, &seen, &settings), 0, truth);
    let right = error(&known, 0, truth);
    assert!(right < 0.004 && blind > 2.0 * right, "{right} with the clocks, {blind} without");
    unknown.read_offsets(&table).unwrap();
    assert_eq!(
        unknown.cameras.iter().map(|c| c.offset).collect::<Vec<_>>(),
        rig.cameras.iter().map(|c| c.offset).collect::<Vec<_>>()
    );
    // The width of a mouth tells the scale.
    assert!(known.report.is_scale_estimated && (known.report.metres_per_unit - 1.0).abs() < 0.02, "{:?}", known.report);
    let strange = folder.write("strange.json", "[{\"camera\": \"x\", \"offset\": 1}]");
    assert!(unknown.read_offsets(&strange).unwrap_err().to_string().contains("names no camera"));
    assert!(unknown.read_offsets(&folder.write("none.json", "{}")).is_err());
}

#[test]
fn several_speakers_and_false_alarms() {
    let rig = rig(6, 30.0, 60);
    let place = |person: usize, time: f64| match person {
        0 => DVec3::new(-0.6 + 0.005 * time, 0.0, 2.8),
        _ => DVec3::new(0.5, 0.1 * (0.1 * time).sin(), 3.2),
    };
    // A third is seen by one camera alone, a fourth for two frames.
    let seen = mouths(&rig, 11, |time, camera| {
        let mut all = vec![place(0, time)];
        if time >= 10.0 {
            all.push(place(1, time));
        }
        if camera == 2 {
            all.push(DVec3::new(0.0, -0.4, 3.0));
        }
        if (20.0..22.0).contains(&time) {
            all.push(DVec3::new(0.1, 0.4, 3.0));
        }
        all
    });
    let found = localize(&rig, &seen, &LocalizeSettings::default());
    let ids: Vec<&str> = found.tracks.iter().map(|track| track.id.as_str()).collect();
    assert_eq!(ids, ["p0", "p1"]);
    for person in 0..2 {
        let error = error(&found, person, |time| place(person, time));
        assert!(error < 0.005, "{person}: {error}");
    }
    assert_eq!(found.report.stray_places, 2);
    assert!(found.report.agreeing > 0.9 && found.report.agreeing < 0.96, "{}", found.report.agreeing);
    assert_eq!(found.tracks[1].samples[0].flag, Flag::Filled);
    assert!((found.openings[0][30] - 0.1).abs() < 1e-12 && found.openings[1][0].is_nan());
    assert!(found.report.sources[0].mean_views > 5.8 && found.report.sources[0].worst_sd < 0.01);
}

#[test]
fn nobody_is_no_track() {
    let rig = rig(3, 30.0, 10);
    let found = localize(&rig, &vec![Mouths::default(); 3], &LocalizeSettings::default());
    assert!(found.tracks.is_empty() && found.report.sources.is_empty() && found.report.agreeing == 0.0);
}

#[test]
fn the_synthetic_speaker_is_found() {
    let folder = Folder::new("speaker");
    let options = Options {
        cameras: 4,
        test_cameras: 1,
        width: 32,
        height: 24,
        frames: 40,
        samples: 1,
        points: 20,
        noise: Noise::None,
        ..Preset::Tiny.options(7)
    };
    write_capture(&folder.0, &options, 2, &mut |_, _| {}).unwrap();
    let rig = Rig::open(&folder.0).unwrap();
    assert_eq!((rig.cameras.len(), rig.fps, rig.n_frames), (4, 30.0, 40));
    let read = |camera: &RigCamera| {
        let path = keypoints_of(&folder.0.join("keypoints"), &camera.name).unwrap();
        Mouths::read(&path, &camera.lens, &KeypointSettings::default()).unwrap()
    };
    let seen: Vec<Mouths> = rig.cameras.iter().map(read).collect();
    let found = localize(&rig, &seen, &LocalizeSettings { metres_per_unit: Some(1.0), hold: false });
    let truth = json(&folder.file("truth.json"));
    let truth = |time: f64| {
        let at: Vec<f64> = serde_json::from_value(truth["source"]["position"][time.round() as usize].clone()).unwrap();
        DVec3::from_slice(&at)
    };
    assert_eq!(found.tracks.len(), 1, "{:?}", found.report);
    let error = error(&found, 0, truth);
    // The middle of the lips lies behind the point between them.
    assert!(error < 0.02, "{error}");
    let output = folder.0.join("out");
    let run =
        |arguments: &[&str]| ivv(&[&["sound", "localize", text(&folder.0), "-o", text(&output)], arguments].concat());
    let done = run(&["--metres-per-unit", "1", "--microphone", "cam02", "--json"]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let scene = SoundScene::read(output.join("scene.json")).unwrap();
    assert_eq!(scene.sources[0].track.samples, found.tracks[0].samples);
    assert_eq!((scene.metres_per_unit, scene.mic.camera.as_str()), (Some(1.0), "cam02"));
    assert!(scene.mic.wav.is_file() && scene.sources.len() == 1 && scene.sources[0].gates.is_empty());
    // The microphone is the camera, and looks where it looks.
    let camera = rig.cameras.iter().find(|camera| camera.name == "cam02").unwrap();
    let pose = camera.pose(0.0);
    let mic = scene.mic.pose.at(0.3);
    assert!((mic.p - pose.center()).length() < 1e-9 && (mic.forward() - pose.forward()).length() < 1e-9);
    assert!(scene.up.dot(DVec3::NEG_Y) > 0.9);
    let failed = run(&["--keypoints", text(&folder.0)]);
    assert!(failed.status.code() == Some(3) && told(&failed).contains("keypoints of 0 cameras"), "{}", told(&failed));
    assert_eq!(run(&["--microphone", "cam77"]).status.code(), Some(2));
}
