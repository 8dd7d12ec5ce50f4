//! Recorded speech through measured ears.

use super::measure::ear_course;
use super::{head, sadie, scene, track};
use crate::common::prelude::*;
use ivv::internals::sound::wav::{Channel, read_channel};

#[test]
fn speech_on_a_circle_leads_in_the_ear_on_its_side_throughout() {
    let Some(path) = shared("data/mono_speech_music/input_samples/cmu_arctic_us_aew_a0001.wav") else { return };
    let Some(hrtf) = sadie() else { return };
    let speech = read_channel(&path, Channel::Left, 0.0).unwrap();
    let seconds = speech.len() as f64 / 48_000.0;
    assert!(seconds > 3.0);
    // Once around, counter-clockwise, from the front.
    let place = |k: u32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 120.0).sin_cos();
        (seconds * f64::from(k) / 120.0, 2.0 * DVec3::new(-sin, cos, 0.0))
    };
    let way: Vec<(f64, DVec3)> = (0..=120).map(place).collect();
    let rendered =
        render_signals(&scene(track("a", &way)), &[speech], &head(DVec3::ZERO, 0.0), hrtf, &RenderConfig::default())
            .unwrap();
    let mut judged = [0, 0];
    for at in ear_course(&rendered.samples) {
        let cue = rendered.cues[0].iter().min_by(|a, b| (a.t - at.t).abs().total_cmp(&(b.t - at.t).abs())).unwrap();
        let side = cue.az.sin();
        if side.abs() > 0.25 {
            assert!(at.itd * side > 0.0 && at.ild_db * side > 0.0, "azimuth {}: {at:?}", cue.az.to_degrees());
            judged[usize::from(side > 0.0)] += 1;
        }
    }
    assert!(judged[0] > 8 && judged[1] > 8, "{judged:?}");
}
