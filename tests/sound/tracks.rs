//! Persons over time.

use super::rigs::{mouths, normal, rig, sights};
use crate::common::prelude::*;
use ivv::internals::sound::localize::{LocalizeSettings, associate, localize};
use ivv::internals::sound::smooth::{Motion, smooth};
use ivv::internals::sound::source_track::Flag;
use ivv::internals::sound::triangulate::{Fix, triangulate_all};
use std::f64::consts::TAU;

const MOTION: Motion = Motion { density: 2.0, speed: 2.0 };
const METRIC: LocalizeSettings = LocalizeSettings { metres_per_unit: Some(1.0), hold: false };

#[test]
fn two_who_cross_keep_their_names() {
    let fps = 30.0;
    let rig = rig(5, fps, 60);
    for seed in 0..5 {
        let mut random = Random::new(seed);
        let at = |person: usize, frame: usize| {
            let way = frame as f64 / fps - 1.0;
            if person == 0 { DVec3::new(way, 0.0, 3.0) } else { DVec3::new(-way, 0.1, 3.15) }
        };
        let mut truth: Vec<Vec<usize>> = Vec::new();
        let mut fixes: Vec<Vec<Fix>> = Vec::new();
        for frame in 0..60 {
            // Nobody is seen for 0.3 s while they pass.
            let mut seen = Vec::new();
            if !(26..35).contains(&frame) {
                seen.extend(sights(&rig, at(0, frame), 2.0, &mut random));
                seen.extend(sights(&rig, at(1, frame), 2.0, &mut random));
            }
            let found = triangulate_all(&seen);
            let nearest = |fix: &Fix| usize::from((fix.p - at(1, frame)).length() < (fix.p - at(0, frame)).length());
            truth.push(found.iter().map(nearest).collect());
            fixes.push(found);
        }
        let persons: Vec<_> = associate(&fixes, 1.0 / fps, MOTION).into_iter().filter(|p| p.len() > 10).collect();
        assert_eq!(persons.len(), 2, "seed {seed}");
        for person in persons {
            assert_eq!(person.len(), 51, "seed {seed}");
            let names: Vec<usize> = person.iter().map(|(frame, index)| truth[*frame][*index]).collect();
            assert!(names.iter().all(|name| *name == names[0]), "seed {seed}: {names:?}");
        }
    }
}

#[test]
fn sway_is_smoothed_without_lag() {
    let (fps, sd) = (60.0, 0.01);
    let mut random = Random::new(7);
    let truth = |i: usize| DVec3::new(0.3 * (TAU * i as f64 / fps).sin(), 0.0, 2.0);
    let raw: Vec<DVec3> =
        (0..300).map(|i| truth(i) + sd * DVec3::from_array([0; 3].map(|_| normal(&mut random)))).collect();
    let cov = DMat3::from_diagonal(DVec3::splat(sd * sd));
    let seen: Vec<_> = raw.iter().map(|p| Some((*p, cov))).collect();
    let smoothed: Vec<DVec3> = smooth(&seen, 1.0 / fps, MOTION).iter().map(|state| state.p).collect();
    assert_eq!(smoothed.len(), 300);
    let rms = |track: &[DVec3]| {
        let sum: f64 = track.iter().enumerate().map(|(i, p)| (*p - truth(i)).length_squared()).sum();
        (sum / track.len() as f64).sqrt()
    };
    let ratio = rms(&smoothed) / rms(&raw);
    assert!(ratio <= 0.6, "{ratio} of the raw error");
    let part =
        |f: fn(f64) -> f64| -> f64 { smoothed.iter().enumerate().map(|(i, p)| p.x * f(TAU * i as f64 / fps)).sum() };
    let lag = (-part(f64::cos)).atan2(part(f64::sin)) / TAU;
    assert!(lag.abs() < 2e-3, "{lag} s behind");
    assert!((part(f64::sin) / 150.0 / 0.3 - 1.0).abs() < 0.02);
}

#[test]
fn a_short_dropout_is_filled() {
    let fps = 60.0;
    let rig = rig(5, fps, 120);
    let truth = |time: f64| DVec3::new(time / fps - 1.0, 0.1, 3.0);
    // 24 frames are 0.4 s.
    let seen = mouths(&rig, 8, |time, _| if (48.0..72.0).contains(&time) { vec![] } else { vec![truth(time)] });
    let found = localize(&rig, &seen, &METRIC);
    assert_eq!(found.tracks.len(), 1);
    let samples = &found.tracks[0].samples;
    assert_eq!(samples.len(), 120);
    for (frame, sample) in samples.iter().enumerate() {
        let expected = if (48..72).contains(&frame) { Flag::Filled } else { Flag::Seen };
        assert_eq!(sample.flag, expected, "frame {frame}");
        let error = (sample.p - truth(frame as f64)).length();
        assert!(error <= 0.03, "frame {frame}: {error}");
    }
    let seen = samples[10];
    assert!(seen.views == 5 && seen.reproj_px > 0.2 && seen.reproj_px < 4.0 && seen.cov[0] > 0.0);
    // Less is known inside of the gap.
    assert!(samples[60].cov[0] > 3.0 * seen.cov[0]);
}

#[test]
fn a_long_dropout_is_flagged() {
    let fps = 20.0;
    let rig = rig(4, fps, 200);
    let truth = |time: f64| DVec3::new(0.2 * (0.02 * time).sin(), 0.1, 3.0);
    // 40 frames are 2 s, 100 are 5 s; the last 5 frames are the end of the clip.
    let lost = |time: f64| (20.0..60.0).contains(&time) || (80.0..180.0).contains(&time) || time >= 195.0;
    let seen = mouths(&rig, 9, |time, _| if lost(time) { vec![] } else { vec![truth(time)] });
    let found = localize(&rig, &seen, &METRIC);
    let flags: Vec<Flag> = found.tracks[0].samples.iter().map(|sample| sample.flag).collect();
    for (frame, flag) in flags.iter().enumerate() {
        let expected = match frame {
            20..60 => Flag::Held,
            80..180 => Flag::Inactive,
            195.. => Flag::Filled,
            _ => Flag::Seen,
        };
        assert_eq!(*flag, expected, "frame {frame}");
    }
    let track = &found.tracks[0];
    assert_eq!(track.at(130.0 / fps), None);
    assert!((track.at(40.0 / fps).unwrap() - truth(40.0)).length() < 0.1);
    assert_eq!(found.report.sources[0].flags["inactive"], 100);
    let held = localize(&rig, &seen, &LocalizeSettings { hold: true, ..METRIC });
    assert_eq!(held.tracks[0].samples[130].flag, Flag::Held);
    assert!(held.tracks[0].at(130.0 / fps).is_some());
}

fn sample(t: f64, p: DVec3, flag: Flag) -> SourceSample {
    SourceSample { t, p, cov: [1.0 / 3.0, 0.0, 0.0, 0.1, 0.0, 1e-9], views: 3, reproj_px: 0.7, flag }
}

#[test]
fn a_track_is_a_smooth_curve_through_its_samples() {
    let way = |t: f64| DVec3::new(t * t, 1.0 - t, 2.0);
    let samples = (0..10).map(|i| sample(0.1 * f64::from(i), way(0.1 * f64::from(i)), Flag::Seen)).collect();
    let track = SourceTrack { id: "p0".into(), samples, fps: 10.0 };
    for t in [0.1, 0.2, 0.234, 0.5, 0.777] {
        assert!((track.at(t).unwrap() - way(t)).length() < 1e-12, "{t}");
    }
    assert_eq!((track.at(-1.0), track.at(5.0)), (Some(way(0.0)), Some(track.samples[9].p)));
    let mut silent = track.clone();
    silent.samples[4].flag = Flag::Inactive;
    assert_eq!((silent.at(0.35), silent.at(0.4), silent.at(0.45)), (None, None, None));
    assert!(silent.at(0.25).is_some() && silent.at(0.55).is_some());
    assert_eq!(SourceTrack { samples: vec![], ..track }.at(0.0), None);
}

#[test]
fn a_track_returns_from_its_file_as_it_was() {
    let folder = Folder::new("track");
    let flags = [Flag::Seen, Flag::Filled, Flag::Held, Flag::Inactive, Flag::Approx];
    let samples: Vec<_> = flags
        .iter()
        .enumerate()
        .map(|(i, flag)| sample(i as f64 / 30.0, DVec3::new(0.1, -2e-7, i as f64 / 7.0), *flag))
        .collect();
    let track = SourceTrack { id: "p7".into(), samples, fps: 30.0 };
    let path = folder.0.join("p7.csv");
    track.write_csv(&path).unwrap();
    let back = SourceTrack::read_csv(&path).unwrap();
    assert_eq!((back.id, back.samples), (track.id, track.samples));
    assert!((back.fps - 30.0).abs() < 1e-9);
    let text = std::fs::read_to_string(&path).unwrap();
    let cases: [(&str, &str, &str); 6] = [
        ("t,x,y", "t,y,x", "line 1"),
        ("filled", "guessed", "line 3, has the unknown flag"),
        ("-0.0000002", "NaN", "line 2, has `NaN`"),
        ("0.06666666666666667", "0.03", "line 4, is of 0.03"),
        (",3,0.7,held", ",0.7,held", "line 4, has 12 columns"),
        ("\n", "", "line 1"),
    ];
    for (from, to, says) in cases {
        let path = folder.write("bad.csv", text.replacen(from, to, 1));
        let error = SourceTrack::read_csv(&path).unwrap_err().to_string().replace(": ", ", ");
        assert!(error.contains(says), "{error} does not say {says}");
    }
    assert!(SourceTrack::read_csv(&folder.write("empty.csv", text.lines().next().unwrap())).is_err());
}
