//! Videos are paired by time: frames that were lost, rates that differ, late beginnings, trimmed clips.

use super::coded::{coded, ffmpeg, numbers, rig};
use super::{done, run, settings};
use crate::capture::assert_told;
use crate::common::prelude::*;
use ivv::internals::prepare::Prepared;

/// Frames whose numbers a condition of ffmpeg's `select` names stay, each with its time.
fn kept(condition: &str) -> [String; 4] {
    ["-vf".to_owned(), format!("select='{condition}'"), "-fps_mode".to_owned(), "passthrough".to_owned()]
}

/// Prepares a rig of two videos of `n` frames, `a` being a whole one at 30 frames per second, and returns notes and capture.
fn beside(name: &str, ending: &str, n: [u32; 2], rate: &str, options: &[&str]) -> (Folder, Prepared, Capture) {
    let folder = rig(name, &["a", "b"]);
    coded(&folder.0.join("source/a.mp4"), n[0], "30", &[]);
    coded(&folder.0.join(format!("source/b.{ending}")), n[1], rate, options);
    let settings = settings(&folder);
    let prepared = done(&settings);
    let capture = Capture::open(&settings.output).unwrap();
    (folder, prepared, capture)
}

fn has(prepared: &Prepared, words: &str) {
    assert!(prepared.notes.iter().any(|note| note.contains(words)), "{words}: {:#?}", prepared.notes);
}

fn whole(numbers: std::ops::Range<u32>) -> Vec<Option<u32>> {
    numbers.map(Some).collect()
}

/// Matroska's rates say nothing of frames that were lost, and one lost frame of many hardly changes MP4's.
#[test]
fn frames_after_lost_ones_stay_in_step_and_a_part_has_those_of_the_whole() {
    needs!("ffmpeg");
    let lost = kept("not(between(n,60,64))");
    let lost: Vec<&str> = lost.iter().map(String::as_str).collect();
    for ending in ["mkv", "mp4"] {
        let (folder, prepared, capture) = beside(&format!("prepare-lost-{ending}"), ending, [120; 2], "30", &lost);
        has(&prepared, "camera `b`: 5 frames are missing at 2.00 s of its video");
        assert_eq!(numbers(&capture, 0), whole(0..120));
        let expected: Vec<_> = (0..120).map(|frame| (!(60..65).contains(&frame)).then_some(frame)).collect();
        assert_eq!(numbers(&capture, 1), expected, "{ending}");
        let absent = &Manifest::read(&folder.0.join("out")).unwrap().absent;
        assert_eq!(absent["b"].iter().copied().collect::<Vec<_>>(), (60..65).collect::<Vec<_>>());
        // A part, from a frame on that is sought.
        for (frames, step) in [("50:100", 1), ("37:115:3", 3), ("70:", 1)] {
            let frames: Frames = frames.parse().unwrap();
            let part =
                PrepareSettings { frames, output: folder.0.join(format!("part-{}", frames.from)), ..settings(&folder) };
            done(&part);
            let capture = Capture::open(&part.output).unwrap();
            for camera in 0..2 {
                let all = if camera == 0 { whole(0..120) } else { expected.clone() };
                let chosen: Vec<_> = frames.of(120).map(|frame| all[frame as usize]).collect();
                assert_eq!(numbers(&capture, camera), chosen, "{ending} {frames} every {step}");
            }
        }
        // The capture is a source, and what it lacks stays absent.
        let again =
            PrepareSettings { scale: 0.5, ..PrepareSettings::new(&folder.0.join("out"), &folder.0.join("half")) };
        let again = PrepareSettings { triangulate: settings(&folder).triangulate, ..again };
        done(&again);
        assert_eq!(numbers(&Capture::open(&again.output).unwrap(), 1), expected);
    }
}

#[test]
fn rates_that_differ_are_paired_by_time() {
    needs!("ffmpeg");
    let (folder, prepared, capture) = beside("prepare-double", "mp4", [120, 240], "60", &[]);
    has(&prepared, "have 30 (a), 60 (b) frames per second");
    has(&prepared, "the capture has 30 frames per second");
    assert_eq!((capture.fps, capture.n_frames), (30.0, 120));
    assert_eq!(numbers(&capture, 1), (0..120).map(|frame| Some(2 * frame)).collect::<Vec<_>>());
    // A rate that is asked for, at which the slower camera has every second frame.
    let faster = PrepareSettings { fps: Some(60.0), output: folder.0.join("faster"), ..settings(&folder) };
    done(&faster);
    let capture = Capture::open(&faster.output).unwrap();
    assert_eq!(capture.fps, 60.0);
    let every_second: Vec<_> = (0..239).map(|frame| (frame % 2 == 0).then_some(frame / 2)).collect();
    assert_eq!((numbers(&capture, 0), numbers(&capture, 1)), (every_second, whole(0..239)));
    let slower = PrepareSettings { fps: Some(10.0), output: folder.0.join("slower"), ..settings(&folder) };
    done(&slower);
    let capture = Capture::open(&slower.output).unwrap();
    assert_eq!((capture.fps, capture.n_frames), (10.0, 40));
    assert_eq!(numbers(&capture, 1), (0..40).map(|frame| Some(6 * frame)).collect::<Vec<_>>());
}

/// 29.97 beside 30: half a frame after 17 seconds, a whole one after 33.
#[test]
fn rates_that_drift_stay_within_half_a_frame() {
    needs!("ffmpeg");
    let folder = rig("prepare-drift", &["a", "b"]);
    coded(&folder.0.join("source/a.mp4"), 1100, "30", &[]);
    coded(&folder.0.join("source/b.mp4"), 1100, "30000/1001", &[]);
    let settings = PrepareSettings { frames: "403:1090:10".parse().unwrap(), ..settings(&folder) };
    has(&done(&settings), "have 29.97 (b), 30 (a) frames per second");
    let capture = Capture::open(&settings.output).unwrap();
    let frames = || (403..1090).step_by(10);
    assert_eq!(numbers(&capture, 1), frames().map(Some).collect::<Vec<_>>());
    let nearest = |frame: u32| (f64::from(frame) * 1.001).round() as u32;
    assert_eq!(numbers(&capture, 0), frames().map(|frame| Some(nearest(frame))).collect::<Vec<_>>());
}

/// A phone that drops frames and is never quite on time.
#[test]
fn a_variable_rate_is_paired_by_its_times() {
    needs!("ffmpeg");
    let lost = |frame: u32| frame % 7 == 3 || frame % 11 == 5;
    let filter = "select='not(eq(mod(n,7),3)+eq(mod(n,11),5))',settb=1/3000,setpts=PTS+0.25*sin(N)/30/TB";
    let options = ["-vf", filter, "-fps_mode", "passthrough", "-enc_time_base", "1/3000"];
    let (_folder, prepared, capture) = beside("prepare-variable", "mp4", [120; 2], "30", &options);
    has(&prepared, "frames are missing in");
    has(&prepared, "camera `b`: its pictures come unevenly");
    let expected: Vec<_> = (0..capture.n_frames).map(|frame| (!lost(frame)).then_some(frame)).collect();
    assert_eq!((capture.n_frames, numbers(&capture, 1)), (120, expected));
}

#[test]
fn late_beginnings_b_frames_and_odd_containers_stay_in_step() {
    needs!("ffmpeg");
    // Its file says when the first picture is shown: half a second after the other's.
    let late = kept("gte(n,15)");
    let late: Vec<&str> = late.iter().map(String::as_str).collect();
    for ending in ["mp4", "mkv"] {
        let (_folder, prepared, capture) = beside(&format!("prepare-late-{ending}"), ending, [60; 2], "30", &late);
        has(&prepared, "begin late in their files (b), by up to 0.50 s");
        assert_eq!((numbers(&capture, 0), numbers(&capture, 1)), (whole(15..60), whole(15..60)), "{ending}");
    }
    // B frames without an edit list make the first picture late by what they wait for, which says nothing.
    let odd: [(&str, &str, &[&str]); 5] = [
        ("no-list", "mp4", &["-use_editlist", "0"]),
        ("negative", "mp4", &["-movflags", "negative_cts_offsets"]),
        ("avi", "avi", &[]),
        ("mkv", "mkv", &[]),
        ("fragments", "mp4", &["-movflags", "frag_keyframe+empty_moov"]),
    ];
    for (name, ending, options) in odd {
        let (folder, _, capture) = beside(&format!("prepare-odd-{name}"), ending, [60; 2], "30", options);
        assert_eq!((numbers(&capture, 0), numbers(&capture, 1)), (whole(0..60), whole(0..60)), "{name}");
        let part =
            PrepareSettings { frames: "33:46".parse().unwrap(), output: folder.0.join("part"), ..settings(&folder) };
        done(&part);
        assert_eq!(numbers(&Capture::open(&part.output).unwrap(), 1), whole(33..46), "{name}");
    }
}

#[test]
fn a_clip_that_was_trimmed_without_encoding_shows_what_players_show() {
    needs!("ffmpeg");
    let folder = rig("prepare-trimmed", &["a", "b"]);
    let [a, b] = ["a", "b"].map(|name| folder.0.join(format!("source/{name}.mp4")));
    coded(&a, 120, "30", &["-g", "50"]);
    ffmpeg(&["-ss", "0.7", "-i", a.to_str().unwrap(), "-c", "copy", b.to_str().unwrap()]);
    let settings = settings(&folder);
    let prepared = done(&settings);
    has(&prepared, "different numbers of frames, 99 (`b`) to 120 (`a`)");
    let capture = Capture::open(&settings.output).unwrap();
    assert_eq!((numbers(&capture, 0), numbers(&capture, 1)), (whole(0..99), whole(21..120)));
    let shifted =
        PrepareSettings { shifts: [("a".to_owned(), 21.0)].into(), output: folder.0.join("shifted"), ..settings };
    done(&shifted);
    let capture = Capture::open(&shifted.output).unwrap();
    assert_eq!((numbers(&capture, 0), numbers(&capture, 1)), (whole(21..120), whole(21..120)));
}

#[test]
fn a_rate_that_leaves_a_camera_nothing_is_refused_and_so_is_a_shift_before_the_footage() {
    needs!("ffmpeg");
    let folder = rig("prepare-nothing-left", &["a", "b"]);
    coded(&folder.0.join("source/a.mp4"), 30, "30", &[]);
    let lost = kept("not(between(n,10,19))");
    coded(&folder.0.join("source/b.mkv"), 30, "30", &lost.iter().map(String::as_str).collect::<Vec<_>>());
    let lost = PrepareSettings { frames: "11:18".parse().unwrap(), ..settings(&folder) };
    assert_told(&run(&lost).unwrap().0.report, &["camera `b`: has no picture of any chosen frame"]);
    let early = PrepareSettings { shifts: [("a".to_owned(), -3.0)].into(), ..settings(&folder) };
    assert_told(
        &run(&early).unwrap().0.report,
        &["camera `a`: is to begin 3 frames before its footage", "--frames 3:"],
    );
}
