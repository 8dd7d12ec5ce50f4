//! Cameras that began apart are put in step by what they hear.

use super::coded::{coded, ffmpeg, numbers, rig};
use super::{done, run, settings};
use crate::common::prelude::*;
use ivv::internals::prepare::ShiftBy;

/// The part from `from` seconds on of a video of ten seconds of noise, louder by `gain`, with hiss of its own.
fn recorded(path: &Path, from: f64, gain: f64, hiss: f64, seed: u32) {
    let silent = path.with_extension("silent.mkv");
    coded(&silent, 150, "15", &["-c:v", "ffv1"]);
    let mix = format!(
        "anoisesrc=d=10:r=16000:seed=7:a=0.3,volume={gain}[scene];anoisesrc=d=10:r=16000:seed={seed}:a={hiss}[hiss];\
         [scene][hiss]amix=normalize=0[out]"
    );
    let whole = path.with_extension("whole.mkv");
    let [silent, whole_name] = [&silent, &whole].map(|path| path.to_str().unwrap().to_owned());
    let maps = ["-map", "0:v", "-map", "[out]", "-c:v", "copy", "-c:a", "pcm_s16le", &whole_name];
    ffmpeg(&[&["-i", &silent, "-filter_complex", &mix][..], &maps].concat());
    let from = from.to_string();
    ffmpeg(&["-i", &whole_name, "-ss", &from, "-c:v", "mpeg4", "-q:v", "2", "-c:a", "aac", path.to_str().unwrap()]);
    std::fs::remove_file(&silent).unwrap();
    std::fs::remove_file(whole).unwrap();
}

#[test]
fn sound_tells_when_cameras_began() {
    needs!("ffmpeg");
    let folder = rig("prepare-by-sound", &["a", "b", "c"]);
    let file = |name: &str| folder.0.join(format!("source/{name}.mp4"));
    recorded(&file("a"), 0.0, 1.0, 0.02, 21);
    recorded(&file("b"), 1.4, 0.1, 0.03, 22);
    recorded(&file("c"), 0.6, 0.5, 0.2, 23);
    let plain = done(&settings(&folder)).notes.join("\n");
    assert!(plain.contains("--shift sound finds out by it"), "{plain}");
    let by_sound = PrepareSettings { shift_by: ShiftBy::Sound, output: folder.0.join("sound"), ..settings(&folder) };
    let notes = done(&by_sound).notes.join("\n");
    println!("{notes}");
    assert!(notes.contains("by sound, frames by which the clip begins later in each video"), "{notes}");
    let capture = Capture::open(&by_sound.output).unwrap();
    let [a, b, c] = [0, 1, 2].map(|camera| numbers(&capture, camera));
    assert_eq!((a[0], a.len()), (Some(21), 129), "{a:?}");
    assert_eq!((&a, &a), (&b, &c));
    // What is less than a frame is known to those who compare: here it is nothing.
    assert!(capture.true_offsets.values().all(|rest| rest.abs() < 0.1), "{:?}", capture.true_offsets);
    // Half a frame by hand.
    let shifts = [("a".to_owned(), 21.4), ("c".to_owned(), 12.0)].into();
    let by_hand = PrepareSettings { shifts, output: folder.0.join("hand"), ..settings(&folder) };
    done(&by_hand);
    let capture = Capture::open(&by_hand.output).unwrap();
    assert_eq!((numbers(&capture, 0)[0], numbers(&capture, 2)[0]), (Some(21), Some(21)));
    assert!((capture.true_offsets["a"] + 0.4).abs() < 0.02, "{:?}", capture.true_offsets);
}

#[test]
fn what_sound_does_not_tell_is_refused_by_name() {
    needs!("ffmpeg");
    let folder = rig("prepare-unheard", &["a", "b", "c"]);
    let file = |name: &str| folder.0.join(format!("source/{name}.mp4"));
    let told = || {
        let by_sound = PrepareSettings { shift_by: ShiftBy::Sound, ..settings(&folder) };
        run(&by_sound).map(|_| ()).unwrap_err().to_string()
    };
    recorded(&file("a"), 0.0, 1.0, 0.02, 21);
    recorded(&file("b"), 1.0, 0.1, 0.03, 22);
    coded(&file("c"), 60, "15", &[]);
    assert!(told().contains("has cameras without sound: c"), "{}", told());
    assert!(told().contains("--shift c=FRAMES"), "{}", told());
    // It hears nothing of the others.
    recorded(&file("c"), 0.0, 0.0, 0.3, 23);
    let told = told();
    assert!(told.contains("no clear match of the sound of c with") && told.contains("a=15.0"), "{told}");
}
