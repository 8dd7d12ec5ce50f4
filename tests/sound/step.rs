//! Sound and pictures in step.

use super::{ear, head, scene, sphere, track};
use crate::common::prelude::*;
use ivv::internals::sound::render::render;
use ivv::internals::sound::wav::{self, Depth};

/// T38, the sound: what the microphone records at a frame is heard at that frame.
#[test]
fn a_click_is_heard_at_its_frame() {
    let folder = Folder::new("step");
    let at = (17.0_f64 / 30.0 * 48_000.0).round() as usize;
    let mut sound = vec![[0.0_f32; 1]; 48_000];
    sound[at][0] = 0.8;
    let mut scene = scene(track("p0", &[(0.0, DVec3::new(-1.0, 2.0, 0.0))]));
    scene.mic.wav = folder.0.join("click.wav");
    wav::write(&scene.mic.wav, &sound, Depth::Int24).unwrap();
    for (offset_s, yaw) in [(0.0, 0.0), (0.01, 90.0), (-0.02, -60.0)] {
        scene.mic.offset_s = offset_s;
        let heard = render(&scene, &head(DVec3::new(0.5, 0.5, 0.0), yaw), sphere(), &RenderConfig::default()).unwrap();
        let truth = at as f64 / 48_000.0 + offset_s;
        for side in 0..2 {
            let ear = ear(&heard.samples, side);
            let loudest = (0..ear.len()).max_by(|a, b| ear[*a].abs().total_cmp(&ear[*b].abs())).unwrap();
            assert!(ear[loudest].abs() > 0.05);
            let late = loudest as f64 / 48_000.0 - truth;
            assert!(late.abs() < 1e-3, "ear {side}: {late} s late at an offset of {offset_s} s");
        }
    }
}
