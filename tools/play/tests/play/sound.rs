//! Sound into a file, by ALSA's own plugin, and without any device.

use super::display::Display;
use super::{Bed, told};
use ivv::formats::{Clip, Clock, Scene, Sound, Sounds, WriteOptions, write};
use ivv::internals::random::Random;
use ivv::internals::scene::demo;
use ivv::internals::sound::wav::{self, Depth};
use std::path::Path;
use std::process::Command;

/// A clip of the scene with noise to one side of the first view.
fn clip(bed: &Bed, file: &Path, to_the_right: f64) {
    let pose = bed.views[0].pose;
    let (right, forward, center) = (pose.right(), pose.forward(), pose.center());
    let place = [0, 1, 2].map(|k| center[k] + to_the_right * right[k] + 0.2 * forward[k]);
    let mut random = Random::new(1);
    let frames: Vec<[f32; 1]> = (0..48_000 * 4).map(|_| random.vector(-0.25, 0.25)).collect();
    wav::write(bed.at("noise.wav"), &frames, Depth::Int16).unwrap();
    let wav = std::fs::read(bed.at("noise.wav")).unwrap();
    let sound =
        Sound { name: "noise".to_owned(), wav, gain: 1.0, start: 0.0, seconds: 4.0, places: vec![(0.0, place)] };
    let sounds = Sounds::new(place, 0.2, vec![sound]);
    assert_eq!(sounds.law(), (Some(place), 0.2));
    let clock = Some(Clock { fps: 30.0, frames: 120 });
    let clip = Clip { clock, views: bed.views.clone(), sounds, ..Clip::default() };
    let scene = Scene { splats: demo().0, clip, notes: vec![] };
    write(file, &scene, &WriteOptions { clamp_colors: true, ..WriteOptions::default() }).unwrap();
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
