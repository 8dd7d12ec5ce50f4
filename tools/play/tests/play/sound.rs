//! Sound into a file, by ALSA's own plugin, and without any device.

use super::display::Display;
use super::{Bed, told};
use ivv::internals::formats::{Clock, Contents, Encoded, Grades, Sound, Sounds};
use ivv::internals::sound::wav::{self, Depth};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// A clip of the scene with noise to one side of the first view.
fn clip(bed: &Bed, file: &Path, to_the_right: f64) {
    let (splats, _) = ivv::internals::scene::demo();
    let pose = bed.views[0].pose;
    let (right, forward, center) = (pose.right(), pose.forward(), pose.center());
    let place = [0, 1, 2].map(|k| center[k] + to_the_right * right[k] + 0.2 * forward[k]);
    let mut state = 1u32;
    let noise = |_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        [0.25 * (f32::from((state >> 16) as u16) / 32768.0 - 1.0)]
    };
    let frames: Vec<[f32; 1]> = (0..48_000 * 4).map(noise).collect();
    wav::write(bed.at("noise.wav"), &frames, Depth::Int16).unwrap();
    let wav = std::fs::read(bed.at("noise.wav")).unwrap();
    let sound =
        Sound { name: "noise".to_owned(), wav, gain: 1.0, start: 0.0, seconds: 4.0, places: vec![(0.0, place)] };
    let sounds = Sounds::new(place, 0.2, vec![sound]);
    assert_eq!(sounds.law(), (Some(place), 0.2));
    let clock = Clock { fps: 30.0, frames: 120 };
    let contents = Contents {
        clock,
        views: &bed.views,
        own: BTreeMap::new(),
        sounds: &sounds,
        world: None,
        cutoff: None,
        is_quick: false,
    };
    let bytes = Encoded::new(&splats, clock).bytes(file, &contents, Grades::default()).unwrap();
    std::fs::write(file, bytes).unwrap();
}

fn play(bed: &Bed, display: &Display, scene: &Path, alsa: &str) -> Command {
    let config = bed.at("asound.conf");
    std::fs::write(&config, alsa).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivv-play"));
    command.arg(scene).args(["--size", "64x48", "--frames", "60", "--validation"]);
    command.env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY").env("ALSA_CONFIG_PATH", config);
    command
}

#[test]
fn a_source_to_one_side_is_louder_in_that_ear() {
    let (display, bed) = (Display::new(), Bed::new("sides"));
    for (name, to_the_right) in [("left", -2.0), ("right", 2.0)] {
        let (scene, heard) = (bed.at(&format!("{name}.4dgs")), bed.at(&format!("{name}.raw")));
        clip(&bed, &scene, to_the_right);
        let alsa = format!(
            "pcm.null {{ type null }}\nctl.null {{ type null }}\npcm.!default {{ type plug slave {{ pcm {{ type file \
             slave.pcm null file \"{}\" format raw }} format S16_LE channels 2 rate 48000 }} }}\nctl.!default {{ type null }}\n",
            heard.display()
        );
        let told = told(play(&bed, &display, &scene, &alsa).output().unwrap());
        assert!(!told.contains("without sound"), "{told}");
        let bytes = std::fs::read(&heard).unwrap();
        let (samples, _) = bytes.as_chunks::<2>();
        let energy = |ear: usize| {
            samples.iter().skip(ear).step_by(2).map(|b| f64::from(i16::from_le_bytes(*b)).powi(2)).sum::<f64>()
        };
        let difference = 10.0 * (energy(1) / energy(0)).log10();
        println!("{name}: {difference:.1} dB of {} samples", samples.len() / 2);
        assert!(difference * to_the_right.signum() > 3.0, "{name}: {difference:.1} dB to the right");
    }
}

#[test]
fn without_a_device_it_plays_in_silence_and_says_so() {
    let (display, bed) = (Display::new(), Bed::new("silent"));
    let scene = bed.at("clip.4dgs");
    clip(&bed, &scene, 2.0);
    let told = told(play(&bed, &display, &scene, "").output().unwrap());
    assert!(told.contains("this plays without sound"), "{told}");
}
