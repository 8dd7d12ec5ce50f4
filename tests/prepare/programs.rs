//! With the programs of others: ffmpeg, COLMAP and Python. Each test is skipped where its program is absent.

use super::{done, every, ivv_prepare, open, program, run, settings, video, video_with};
use crate::capture::assert_told;
use crate::capture::model::{Model, write_cameras};
use crate::common::prelude::*;
use ivv::internals::prepare::{Prepared, Share, ShiftBy, Stage, estimate, prepare_share};
use ivv::internals::scene::capture::Camera;
use ivv::internals::sound::wav;
use ivv::internals::synth::Options;

/// ImViD's layout: cameras and images of COLMAP, a video of each camera; `left` distorts.
fn imvid(folder: &str) -> Folder {
    let folder = Folder::new(folder);
    let model = Model {
        cameras: vec![
            (1, 2, "SIMPLE_RADIAL", 64, 48, vec![60.0, 32.0, 24.0, -0.05]),
            (2, 1, "PINHOLE", 128, 96, vec![120.0, 120.0, 64.0, 48.0]),
        ],
        images: vec![
            (1, [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0], 1, "left.png", vec![]),
            (2, [1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 1.0], 2, "right.png", vec![]),
        ],
        points: vec![],
    };
    write_cameras(&folder, "source", &model);
    folder
}

#[test]
fn videos_are_decoded_gone_on_with_and_compared() {
    needs!("ffmpeg");
    let folder = imvid("prepare-video");
    video(&folder.0.join("source/left.mp4"), 6);
    video(&folder.0.join("source/right.mp4"), 5);
    let settings = PrepareSettings { frames: every(2, 1), ..settings(&folder) };
    let prepared = done(&settings);
    let notes = prepared.notes.join("\n");
    assert!(notes.contains("5 (`right`) to 6 (`left`)") && notes.contains("it is scaled"), "{notes}");
    let capture = Capture::open(&settings.output).unwrap();
    assert_eq!((capture.n_frames, capture.fps), (2, 5.0));
    assert_eq!((capture.cameras[1].intrinsics.width, capture.cameras[1].intrinsics.fx), (64, 60.0));
    // Every frame of the test picture differs from the others, and frames 1 and 3 are those of the whole video.
    let whole =
        open(&PrepareSettings { frames: Frames::default(), output: folder.0.join("whole"), ..settings.clone() });
    let pixels = |capture: &Capture, frame| capture.picture(1, frame).unwrap().pixels;
    assert_eq!((pixels(&capture, 0), pixels(&capture, 1)), (pixels(&whole, 1), pixels(&whole, 3)));
    assert_ne!(pixels(&whole, 1), pixels(&whole, 3));
    assert!(pixels(&whole, 0).iter().any(|pixel| pixel & 0xff > 200), "the test picture has bright colours");
    let shifts = [("right".to_owned(), 2.0)].into();
    let shifted =
        PrepareSettings { frames: Frames::default(), shifts, output: folder.0.join("shifted"), ..settings.clone() };
    let shifted = open(&shifted);
    assert_eq!((shifted.n_frames, pixels(&shifted, 0)), (3, pixels(&whole, 2)));
    // The second of two frames is missing: only that is decoded.
    let image = settings.output.join("images/right/00001.png");
    let bytes = std::fs::read(&image).unwrap();
    std::fs::remove_file(&image).unwrap();
    done(&settings);
    assert_eq!(std::fs::read(&image).unwrap(), bytes);
}

#[test]
fn a_part_of_a_video_is_sought_and_has_the_frames_that_it_has_in_the_whole() {
    needs!("ffmpeg");
    // Rates that are no whole numbers, containers that do not tell how many frames there are, one that begins late, one whose sound
    // begins before its pictures, and one whose frames do not follow evenly, in which nothing is sought.
    let kinds: [(&str, &str, &[&str]); 5] = [
        ("mp4", "25", &[]),
        ("mp4", "30000/1001", &[]),
        ("mkv", "30000/1001", &[]),
        ("mp4", "25", &["-output_ts_offset", "3.3"]),
        ("mp4", "10", &["-vf", "select=not(eq(n\\,7))", "-fps_mode", "passthrough"]),
    ];
    for (kind, (ending, rate, options)) in kinds.into_iter().enumerate() {
        let folder = imvid(&format!("prepare-seek-{kind}"));
        for name in ["left", "right"] {
            let file = folder.0.join(format!("source/{name}.{ending}"));
            video_with(&file, 60, rate, options);
            if kind == 0 {
                with_sound(&file, "-0.3");
            }
        }
        let part = PrepareSettings { frames: "37:47:3".parse().unwrap(), ..settings(&folder) };
        let whole = PrepareSettings { frames: Frames::default(), output: folder.0.join("whole"), ..part.clone() };
        let [part, whole] = [part, whole].map(|settings| open(&settings));
        assert_eq!(part.n_frames, 4);
        for frame in 0..4 {
            let picture = |capture: &Capture, frame| capture.picture(1, frame).unwrap().pixels;
            assert!(picture(&part, frame) == picture(&whole, 37 + 3 * frame), "{rate} {options:?}, frame {frame}");
        }
    }
}

#[test]
fn sound_is_as_late_as_in_the_video() {
    needs!("ffmpeg");
    let folder = imvid("prepare-late-sound");
    // The pictures of `right` begin half a second after its sound, and so does the clip, in both files.
    for (name, delay) in [("left", "1.0"), ("right", "-0.5")] {
        let file = folder.0.join(format!("source/{name}.mp4"));
        video_with(&file, 60, "25", &[]);
        with_sound(&file, delay);
    }
    // From 0.2 s on.
    let settings = PrepareSettings { frames: "5:45".parse().unwrap(), ..settings(&folder) };
    done(&settings);
    let heard = |name: &str| {
        let sound = wav::read(&settings.output.join(format!("audio/{name}.wav"))).unwrap();
        let loud = sound.channels[0].iter().position(|sample| sample.abs() > 0.01).unwrap();
        loud as f64 / f64::from(sound.fs)
    };
    let (late, early) = (heard("left"), heard("right"));
    assert!((late - 0.3).abs() < 0.03 && early < 0.01, "{late} s, {early} s");
}

/// Adds a tone to a video, which begins so many seconds later.
fn with_sound(file: &Path, delay: &str) {
    let without = file.with_extension("silent.mp4");
    std::fs::rename(file, &without).unwrap();
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-y", "-i"]).arg(&without).args(["-itsoffset", delay]);
    command.args(["-f", "lavfi", "-i", "sine=d=7"]);
    command.args(["-map", "0:v", "-map", "1:a", "-c:v", "copy", "-avoid_negative_ts", "make_zero"]).arg(file);
    assert!(command.status().unwrap().success());
    std::fs::remove_file(without).unwrap();
}

#[test]
fn time_codes_tell_which_frames_are_of_one_moment() {
    needs!("ffmpeg");
    let folder = imvid("prepare-timecode");
    // `right` began two frames later.
    video_with(&folder.0.join("source/left.mov"), 12, "10", &["-timecode", "01:00:00:08"]);
    video_with(&folder.0.join("source/right.mov"), 12, "10", &["-timecode", "01:00:01:00"]);
    let plain = done(&settings(&folder)).notes.join("\n");
    assert!(plain.contains("did not begin together") && plain.contains("--shift left=2"), "{plain}");
    let by_code = PrepareSettings { shift_by: ShiftBy::Timecode, output: folder.0.join("code"), ..settings(&folder) };
    let by_hand = PrepareSettings {
        shifts: [("left".to_owned(), 2.0), ("right".to_owned(), 0.0)].into(),
        output: folder.0.join("hand"),
        ..settings(&folder)
    };
    let [by_code, by_hand] = [by_code, by_hand].map(|settings| open(&settings));
    assert_eq!((by_code.n_frames, by_hand.n_frames), (10, 10));
    for (camera, frame) in [(0, 0), (0, 9), (1, 0), (1, 9)] {
        let picture = |capture: &Capture| capture.picture(camera, frame).unwrap().pixels;
        assert!(picture(&by_code) == picture(&by_hand), "camera {camera}, frame {frame}");
    }
    // Without a code there is nothing to go by.
    video_with(&folder.0.join("source/right.mov"), 12, "10", &[]);
    let again = PrepareSettings { shift_by: ShiftBy::Timecode, output: folder.0.join("again"), ..settings(&folder) };
    let told = run(&again).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("cameras without a time code: right"), "{told}");
}

#[test]
fn a_plan_by_time_codes_is_of_the_frames_of_the_capture() {
    needs!("ffmpeg");
    let folder = imvid("prepare-plan-timecode");
    // `right` began nine frames later: what lies in the middle of twelve is not in both.
    video_with(&folder.0.join("source/left.mov"), 12, "10", &["-timecode", "01:00:00:08"]);
    video_with(&folder.0.join("source/right.mov"), 12, "10", &["-timecode", "01:00:01:07"]);
    let settings = PrepareSettings { shift_by: ShiftBy::Timecode, ..settings(&folder) };
    let planned = estimate(&settings, &|_| {}).unwrap();
    assert_eq!((planned.frames, planned.sampled), (3, 3));
    assert!(planned.stages.iter().any(|stage| stage.stage == "images" && stage.bytes > 0), "{planned:?}");
    assert_eq!(open(&settings).n_frames, planned.frames);
}

#[test]
fn a_plan_tells_what_a_preparation_takes_and_leaves_nothing() {
    needs!("ffmpeg");
    let folder = imvid("prepare-plan");
    for name in ["left", "right"] {
        video_with(&folder.0.join(format!("source/{name}.mp4")), 40, "10", &[]);
    }
    let settings = PrepareSettings { triangulate: Some(Triangulate::None), ..settings(&folder) };
    let files = || std::fs::read_dir(&folder.0).unwrap().map(|entry| entry.unwrap().file_name()).collect::<Vec<_>>();
    let before = files();
    let planned = estimate(&settings, &|_| {}).unwrap();
    assert_eq!(files(), before, "nothing is left of the sample");
    assert_eq!((planned.cameras, planned.frames, planned.sampled), (2, 40, 4));
    let images = planned.stages.iter().find(|stage| stage.stage == "images").unwrap();
    assert!((images.seconds - 10.0 * images.sampled_seconds).abs() < 1e-9 && images.seconds > 0.0);
    // What is on the disk in the end is what was told, but for what frames differ by.
    done(&settings);
    let bytes = |folder: &Path| -> u64 {
        let cameras = ["left", "right"].map(|name| std::fs::read_dir(folder.join(name)).ok());
        cameras.into_iter().flatten().flatten().map(|file| file.unwrap().metadata().unwrap().len()).sum()
    };
    let on_disk = bytes(&settings.output.join("images")) + bytes(&settings.output.join("masks"));
    let ratio = images.bytes as f64 / on_disk as f64;
    assert!((0.9..1.1).contains(&ratio), "{} told, {on_disk} on the disk", images.bytes);
}

#[test]
fn damaged_videos_are_told_in_the_words_of_ffmpeg() {
    needs!("ffmpeg");
    let folder = imvid("prepare-damaged");
    video(&folder.0.join("source/left.mp4"), 4);
    video(&folder.0.join("source/right.mp4"), 4);
    let left = folder.0.join("source/left.mp4");
    let whole = std::fs::read(&left).unwrap();
    std::fs::write(&left, &whole[..whole.len() / 2]).unwrap();
    std::fs::write(folder.0.join("source/right.mp4"), b"").unwrap();
    let (prepared, _) = run(&settings(&folder)).unwrap();
    assert_told(&prepared.report, &["left.mp4: ffprobe failed", "right.mp4: ffprobe failed"]);
    assert_eq!(prepared.report.n_faults, 2);
    assert!(!folder.0.join("out").exists());
}

/// Two frames of noise, of which no two cameras see the same.
fn noise(folder: &str) -> Folder {
    let folder = imvid(folder);
    let noise = |seed: u32, side: u32| -> Vec<u8> {
        let level = |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(seed).wrapping_mul(2_246_822_519) >> 24) as u8;
        crate::capture::encode(&(0..side).map(level).collect::<Vec<_>>(), 64, side / 64, image::ExtendedColorType::L8)
    };
    for frame in 0..2 {
        folder.write(&format!("source/left/{frame}.png"), noise(1, 64 * 48));
        folder.write(&format!("source/right/{frame}.png"), noise(99, 64 * 48));
    }
    folder
}

#[test]
fn a_frame_without_matches_has_no_points() {
    needs!("colmap");
    let folder = noise("prepare-blank");
    let settings = PrepareSettings { triangulate: Some(Triangulate::Every(1)), ..settings(&folder) };
    let prepared = done(&settings);
    assert_eq!(prepared.points, [(0, 0), (1, 0)]);
    let of_the_size = |prepared: &Prepared| prepared.notes.iter().any(|note| note.contains("without --scale"));
    assert!(!of_the_size(&prepared), "the pictures are as large as they can be");
    assert!(!settings.output.join(".colmap").exists());
    let scaled = PrepareSettings { scale: 0.5, output: folder.0.join("scaled"), ..settings };
    assert!(of_the_size(&done(&scaled)));
}

/// COLMAP's threads at times wait for each other for ever.
#[test]
#[ignore = "slow: it waits until a program counts as asleep"]
fn a_program_that_sleeps_is_begun_again() {
    needs!("colmap");
    let folder = noise("prepare-asleep");
    // Its first call sleeps, and those after it are the real program's.
    let script = "#!/bin/sh\nmkdir \"$0.slept\" 2>/dev/null && exec sleep 600\nPATH=${PATH#*:} exec colmap \"$@\"\n";
    program(&folder, "colmap", script);
    let began = Instant::now();
    let output = ivv_prepare(&folder, &[]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(folder.0.join("bin/colmap.slept").is_dir() && began.elapsed().as_secs() >= 30);
    assert!(Manifest::read(&folder.0.join("out")).unwrap().points);
}

#[test]
fn colmap_triangulates_and_opencv_estimates_flow() {
    triangulated("prepare-points", |_| ());
}

#[test]
#[ignore = "slow: COLMAP and OpenCV twice; prepare::resume has shares of other stages"]
fn shares_triangulate_and_estimate_flow() {
    triangulated("prepare-shared", |settings| {
        // One of them has the frame of the model.
        let shared = PrepareSettings { output: settings.output.with_file_name("shared"), ..settings };
        for stage in [Stage::Images, Stage::Points, Stage::Flow] {
            for part in [1, 0] {
                prepare_share(&shared, stage, Share { part, of: 2 }, &|_| {}).unwrap();
            }
        }
        let (shared, pieces) = run(&shared).unwrap();
        assert!(pieces.iter().all(|piece| piece.starts_with("images")), "{pieces:?}");
        assert!(shared.points.len() == 2 && shared.points.iter().all(|(_, n)| *n > 20), "{:?}", shared.points);
    });
}

/// Points and flow of a rig, and what is done with its settings then.
fn triangulated(name: &str, then: impl FnOnce(PrepareSettings)) {
    needs!("colmap", "/usr/bin/python3");
    let folder = Folder::new(name);
    let options = Options { cameras: 6, frames: 2, width: 256, height: 192, ..Preset::Tiny.options(3) };
    write_capture(&folder.0.join("source"), &options, 2, &mut |_, _| {}).unwrap();
    // As a rig of image sequences, without what the synthetic capture knows beyond.
    for part in ["capture.toml", "truth.json", "synth.json"] {
        std::fs::remove_file(folder.0.join("source").join(part)).unwrap();
    }
    std::fs::rename(folder.0.join("source/flow"), folder.0.join("true flow")).unwrap();
    for part in ["points", "depth", "truth", "keypoints", "audio"] {
        std::fs::remove_dir_all(folder.0.join("source").join(part)).unwrap();
    }
    let settings = PrepareSettings { triangulate: Some(Triangulate::Every(1)), flow: true, ..settings(&folder) };
    let prepared = match run(&settings) {
        Ok((prepared, _)) => prepared,
        Err(error) if error.to_string().contains("not installed") => return crate::common::notes::skip(error),
        Err(error) => panic!("{error}"),
    };
    assert_eq!(crate::capture::told(&prepared.report), "");
    assert_eq!(prepared.points.len(), 2);
    assert!(prepared.points.iter().all(|(_, n)| *n > 20), "{:?}", prepared.points);
    let manifest = Manifest::read(&settings.output).unwrap();
    assert!(manifest.points && manifest.flow && !manifest.depth);
    let capture = Capture::open(&settings.output).unwrap();
    assert_eq!(capture.points.len(), prepared.points[0].1);
    // The room is 6 units wide or so: what is triangulated lies in it.
    let inside = |p: &[f64; 3]| p.iter().all(|v| v.abs() < 10.0);
    let n_inside = capture.points.iter().filter(|point| inside(&point.position)).count();
    assert!(n_inside * 10 >= capture.points.len() * 9, "{n_inside} of {}", capture.points.len());
    let name = &capture.cameras[0].name;
    let flow = std::fs::read(settings.output.join(format!("flow/{name}/00000.npy"))).unwrap();
    assert_eq!((&flow[..6], flow.len()), (b"\x93NUMPY".as_slice(), 128 + 4 * 256 * 192));
    assert!(!settings.output.join(format!("flow/{name}/00001.npy")).exists());
    let flows = |place: &Path, file: &str| -> Vec<[f32; 2]> {
        let of = |camera: &Camera| read_flow(&place.join(&camera.name).join(file), 256, 192).unwrap();
        capture.cameras.iter().flat_map(of).collect()
    };
    let found = flows(&settings.output.join("flow"), "00000.npy");
    let truth = flows(&folder.0.join("true flow"), "00000.flo");
    let miss = |(a, b): (&[f32; 2], &[f32; 2])| (a[0] - b[0]).hypot(a[1] - b[1]);
    let mut misses: Vec<f32> = found.iter().zip(&truth).map(miss).filter(|miss| !miss.is_nan()).collect();
    misses.sort_by(f32::total_cmp);
    let share = misses.len() as f64 / truth.iter().filter(|flow| !flow[0].is_nan()).count() as f64;
    let [median, most] = [misses.len() / 2, misses.len() * 95 / 100].map(|at| misses[at]);
    println!(
        "flow of {share:.3} of the pixels, off by {median:.3} pixels in the median, {most:.3} at the 95th percentile"
    );
    assert!(share > 0.8 && median < 0.1 && most < 1.0, "{share} {median} {most}");
    let (_, pieces) = run(&settings).unwrap();
    assert!(pieces.iter().all(|piece| piece.starts_with("images")), "{pieces:?}");
    then(settings);
}
