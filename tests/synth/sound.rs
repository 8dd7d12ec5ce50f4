//! Recordings and keypoints against the place of the mouth.

use super::model::read_model;
use super::{json, numbers, options, shared};
use crate::common::prelude::*;

const SPEED_OF_SOUND: f64 = 343.0;

fn wav(path: &Path) -> Vec<f64> {
    let bytes = fs::read(path).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    assert_eq!((&bytes[..4], &bytes[8..16], &bytes[36..40]), (&b"RIFF"[..], &b"WAVEfmt "[..], &b"data"[..]));
    assert_eq!((word(4) as usize, word(24), word(40) as usize), (bytes.len() - 8, 48_000, bytes.len() - 44));
    bytes[44..].as_chunks().0.iter().map(|b| f64::from(i16::from_le_bytes(*b)) / 32_767.0).collect()
}

fn mouths() -> Vec<DVec3> {
    let truth = json(&shared().join("truth.json"));
    truth["source"]["position"].as_array().unwrap().iter().map(|p| DVec3::from_slice(&numbers(p))).collect()
}

#[test]
fn recordings_are_delayed_and_fainter_by_the_distance() {
    let source = wav(&shared().join("truth/source.wav"));
    assert_eq!(source.len(), 48_000 * 6 / 30);
    let mut n = 0;
    for camera in &read_model(shared()).0 {
        let heard = wav(&shared().join(format!("audio/{}.wav", camera.name)));
        assert_eq!(heard.len(), source.len());
        for (frame, mouth) in mouths().into_iter().enumerate().skip(1).take(4) {
            // What the mouth says at the frame arrives after the way from where it is then. The mouth moves, so that
            // only a few samples about that moment keep this delay.
            let distance = (mouth - camera.center()).length();
            let said = frame * 1600;
            let arrives = said as f64 + distance / SPEED_OF_SOUND * 48_000.0;
            let error = |shift: i32| -> f64 {
                let nearby = -30..=30;
                let terms = nearby.map(|j| {
                    let expected = source[(said as i32 + j) as usize];
                    (distance * between(&heard, arrives + f64::from(shift + j)) - expected).powi(2)
                });
                terms.sum()
            };
            let energy: f64 = source[said - 30..=said + 30].iter().map(|v| v * v).sum();
            let best = (-300..300).min_by(|a, b| error(*a).total_cmp(&error(*b))).unwrap();
            assert_eq!(best, 0, "{} frame {frame}: the delay is not that of {distance}", camera.name);
            assert!(
                error(0) < 0.02 * energy && energy > 0.1,
                "{} frame {frame}: {} of {energy}",
                camera.name,
                error(0)
            );
            n += 1;
        }
    }
    assert_eq!(n, 16);
}

/// A signal between its samples (Catmull and Rom's cubic).
fn between(signal: &[f64], at: f64) -> f64 {
    let (i, t) = (at.floor() as usize, at.fract());
    let [a, b, c, d] = [signal[i - 1], signal[i], signal[i + 1], signal[i + 2]];
    b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
}

#[test]
fn keypoints_find_the_mouth() {
    let mouths = mouths();
    let mut n_seen = 0;
    for camera in &read_model(shared()).0 {
        let found = json(&shared().join(format!("keypoints/{}.json", camera.name)));
        let frames = found.as_array().unwrap();
        assert_eq!(frames.len(), options().frames as usize);
        for (frame, found) in frames.iter().enumerate() {
            assert_eq!(found["frame_id"], frame);
            for person in found["instances"].as_array().unwrap() {
                let at = |i: usize| DVec2::from_slice(&numbers(&person["keypoints"][i]));
                let scores = numbers(&person["keypoint_scores"]);
                assert_eq!((scores.len(), person["keypoints"].as_array().unwrap().len()), (133, 133));
                assert!(scores[100] == 0.0 && person["bbox"][0].as_array().unwrap().len() == 4);
                if scores[71..91].iter().all(|score| *score > 0.5) {
                    let mean = (71..91).map(at).sum::<DVec2>() / 20.0;
                    let (mouth, _) = camera.project(mouths[frame]);
                    assert!((mean - mouth).length() < 1.0, "{} frame {frame}: {mean}, not {mouth}", camera.name);
                    n_seen += 1;
                }
            }
        }
    }
    assert!(n_seen >= 6, "the mouth is seen {n_seen} times");
}
