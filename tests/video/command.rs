//! `ivv render --path`.

use crate::common::prelude::*;
use crate::common::program::command;
use ivv::internals::sound::scene_file::{Mic, Source};
use ivv::internals::sound::source_track::Flag;
use ivv::internals::sound::wav::{self, Channel, Depth};
use ivv::internals::synth::Options;

/// The same where a folder holds all programs that are installed.
fn with_programs_of(folder: &Path, arguments: &[&str]) -> Output {
    command(arguments).env("PATH", folder).output().unwrap()
}

/// Ears by 18 directions: what is on a side comes there two thirds of a millisecond earlier and twice as loud.
fn ears(folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    let ring = |el: i32, step: usize| (0..360).step_by(step).map(move |az| (az, el));
    for (az, el) in ring(0, 45).chain(ring(45, 90)).chain(ring(-45, 90)).chain([(0, 90), (0, -90)]) {
        let left = f64::from(az).to_radians().sin() * f64::from(el).to_radians().cos();
        let mut response = [[0.0_f32; 2]; 64];
        for (ear, side) in [left, -left].into_iter().enumerate() {
            response[24 - (16.0 * side).round() as usize][ear] = 2_f32.powf(0.5 * side as f32);
        }
        wav::write(folder.join(format!("azi_{az}_ele_{el}.wav")), &response, Depth::Float32).unwrap();
    }
}

fn click(folder: &Path) {
    let mut sound = vec![[0.0_f32; 1]; 48_000];
    sound[19_200][0] = 0.9;
    let wav = folder.join("click.wav");
    wav::write(&wav, &sound, Depth::Int24).unwrap();
    let sample = SourceSample { t: 0.0, p: DVec3::ZERO, cov: [0.0; 6], views: 2, reproj_px: 0.0, flag: Flag::Seen };
    let pose = PoseTrack::still(DVec3::new(0.0, 0.0, -2.0), HeadPose::looking(DVec3::Z, DVec3::NEG_Y));
    let scene = SoundScene {
        metres_per_unit: None,
        up: DVec3::NEG_Y,
        mic: Mic { camera: "a".into(), pose, wav, channel: Channel::Left, offset_s: 0.0 },
        sources: vec![Source {
            track: SourceTrack { id: "p0".into(), samples: vec![sample], fps: 30.0 },
            wav: None,
            gain_db: 0.0,
            gates: Vec::new(),
        }],
    };
    scene.write(&folder.join("scene.json")).unwrap();
}

/// A recording is not replaced by what is made of it, and an ending that no video has is told before sound is made.
fn names_that_no_video_can_have(folder: &Folder, arguments: &[&str], output: &str) {
    let recording = SoundScene::read(folder.0.join("scene.json")).unwrap().mic.wav;
    let (beside, bytes) = (recording.with_extension("y4m"), std::fs::read(&recording).unwrap());
    let other = folder.0.join("film.avi");
    for (name, reason) in [(&beside, "would replace the recording"), (&other, "unsupported video type")] {
        let words = arguments.iter().map(|word| if *word == output { name.to_str().unwrap() } else { word });
        let done = ivv(&words.collect::<Vec<_>>());
        let told = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(!done.status.success() && told.contains(reason), "{told}");
    }
    assert!(std::fs::read(&recording).unwrap() == bytes && !beside.exists() && !other.exists());
}

#[test]
fn a_path_becomes_a_video_with_what_is_heard_on_it() {
    let folder = Folder::new("film");
    let at = |name: &str| folder.0.join(name).to_str().unwrap().to_owned();
    ears(&folder.0.join("ears"));
    click(&folder.0);
    let tiny = Preset::Tiny.options(3);
    let tiny =
        Options { cameras: 3, test_cameras: 0, width: 16, height: 16, frames: 30, samples: 1, points: 8, ..tiny };
    write_capture(&folder.0.join("capture"), &tiny, 2, &mut |_, _| {}).unwrap();
    // From 0.2 to 0.7 s, sideways before the scene and looking along z (OpenCV's axes).
    let path = folder.write("path.txt", "0.2 -0.3 0 -4 0 0 0 1\n0.7 0.3 0 -4 0 0 0 1\n");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/demo/scene.ply");
    let output = at("film.y4m");
    let mut arguments = vec!["render", scene, "--path", path.to_str().unwrap(), "-o", &output];
    let sound = at("scene.json");
    let hrtf = at("ears");
    arguments.extend(["--size", "32x24", "--fps", "10", "--sound", &sound, "--hrtf", &hrtf, "--json"]);

    let told = fails(&arguments, 2);
    assert!(told.contains("--capture"), "{told}");

    let capture = at("capture");
    arguments.extend(["--capture", &capture]);
    // What a killed process left.
    let left = folder.write(".film.mp4.1-0.tmp.mp4", "");
    let done = ivv(&arguments);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    assert!(!left.exists() && at("film.y4m") == output);
    let report: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!((report["frames"].as_u64(), report["fps"].as_f64()), (Some(6), Some(10.0)));
    assert_eq!(report["sound"]["sources"][0]["id"], "p0");

    let film = std::fs::read(&output).unwrap();
    let header = film.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    let frames: Vec<&[u8]> = film[header..].chunks(6 + 3 * 32 * 24).map(|frame| &frame[6..]).collect();
    assert!(frames.len() == 6 && frames.iter().all(|frame| frame.len() == 3 * 32 * 24));
    for (index, frame) in frames.iter().enumerate() {
        let luma = &frame[..32 * 24];
        assert!(luma.iter().max().unwrap() - luma.iter().min().unwrap() > 40, "frame {index} is empty");
        assert!(index == 0 || *frame != frames[index - 1], "frame {index} is the one before");
    }

    // Where ffmpeg is not found, the same pictures and sound are left beside the video's name, with the command that joins
    // them.
    let whole = at("without/film.mp4");
    let alone = arguments.iter().map(|word| if *word == output.as_str() { whole.as_str() } else { word });
    let done = with_programs_of(&folder.0.join("ears"), &alone.collect::<Vec<_>>());
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let report: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    let pictures = at("without/film.y4m");
    assert_eq!(report["path"], pictures.as_str());
    assert_same("pictures", &std::fs::read(&pictures).unwrap(), &film);
    let command = report["command"].as_str().unwrap();
    assert!(command.starts_with("ffmpeg ") && !Path::new(&whole).exists(), "{command}");
    let sound = std::fs::read(folder.0.join("film.wav")).unwrap();
    assert_same("sound", &std::fs::read(folder.0.join("without/film.wav")).unwrap(), &sound);
    if has_program("ffmpeg") {
        let joined = Command::new("sh").args(["-c", command]).output().unwrap();
        assert!(joined.status.success(), "{command}: {}", String::from_utf8_lossy(&joined.stderr));
        let pixels = super::decoded(Path::new(&whole), &["-map", "0:v", "-f", "rawvideo", "-pix_fmt", "gray"]);
        let samples = super::decoded(Path::new(&whole), &["-map", "0:a", "-ac", "1", "-f", "s16le"]);
        assert_eq!(pixels.len(), 6 * 32 * 24);
        assert!(samples.len().abs_diff(2 * 28_800) < 2 * 4_800 && samples.iter().any(|byte| *byte != 0));
    }

    names_that_no_video_can_have(&folder, &arguments, &output);
    // The sound begins where the film does.
    let heard = wav::read(&folder.0.join("film.wav")).unwrap();
    for (side, ear) in heard.channels.iter().enumerate() {
        assert_eq!(ear.len(), 28_800);
        let loudest = (0..ear.len()).max_by(|a, b| ear[*a].abs().total_cmp(&ear[*b].abs())).unwrap();
        assert!(ear[loudest].abs() > 0.05 && loudest.abs_diff(9_600) <= 48, "ear {side}: the click is at {loudest}");
    }

    let both = ivv(&[&arguments[..], &["--cameras", "c.json"]].concat());
    assert_eq!(both.status.code(), Some(2));
}

#[test]
fn a_name_with_a_colon_is_a_name() {
    needs!("ffmpeg");
    let folder = Folder::new("film-colon");
    let path = folder.write("path.txt", "0 -0.3 0 -4 0 0 0 1\n0.05 0.3 0 -4 0 0 0 1\n");
    let still = still_scene(&folder);
    for name in ["a:b.mp4", "-c.mp4"] {
        let render = ["render", &still, "--path", text(&path), "--size", "32x24"];
        let output = command(&render).current_dir(&folder.0).arg(format!("--output={name}")).output().unwrap();
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(folder.0.join(name).is_file(), "{name}");
    }
}

fn still_scene(folder: &Folder) -> String {
    let splats = ivv::internals::scene::Splats {
        position: vec![[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]],
        rotation: vec![[1.0, 0.0, 0.0, 0.0]; 2],
        scale: vec![[-1.5; 3]; 2],
        opacity: vec![3.0; 2],
        sh: vec![[0.5, 0.2, 0.1]; 2],
        n_static: 2,
        source_row: vec![0, 1],
        ..ivv::internals::scene::Splats::new(0)
    };
    let path = folder.0.join("still.ply");
    ivv::internals::formats::write_ply(&path, &splats).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn a_video_of_years_is_refused_with_the_number_of_its_frames() {
    let folder = Folder::new("film-endless");
    let path = folder.write("path.txt", "0 0 0 -4 0 0 0 1\n1e9 0 0 -4 0 0 0 1\n");
    let output = folder.0.join("film.y4m");
    let scene = still_scene(&folder);
    let told = fails(&["render", &scene, "--path", path.to_str().unwrap(), "-o", output.to_str().unwrap()], 3);
    assert!(told.contains("30000000001 frames") && told.contains("5184000"), "{told}");
    assert!(!output.exists());
}

/// The pictures of a .y4m of `width` x `height` pixels in three full planes.
fn y4m(file: &Path, width: usize, height: usize) -> Vec<Vec<u8>> {
    let film = std::fs::read(file).unwrap();
    let header = film.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    film[header..].chunks(6 + 3 * width * height).map(|frame| frame[6..].to_vec()).collect()
}

/// A clip of 30 frames at 30 a second, as long as its cameras are small.
fn small_capture(folder: &Folder) -> String {
    let tiny = Preset::Tiny.options(1);
    let tiny =
        Options { cameras: 3, test_cameras: 0, width: 16, height: 16, frames: 30, samples: 1, points: 8, ..tiny };
    let capture = folder.0.join("capture");
    write_capture(&capture, &tiny, 2, &mut |_, _| {}).unwrap();
    capture.to_str().unwrap().to_owned()
}

#[test]
fn a_path_that_outlasts_the_clip_shows_its_last_moment_and_says_so() {
    let folder = Folder::new("film-late");
    let capture = small_capture(&folder);
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/demo/scene.ply");
    let at = |name: &str| folder.0.join(name).to_str().unwrap().to_owned();
    let film = |from: &str, to: &str, output: &str| {
        folder.write("path.txt", format!("{from} 0 0 -4 0 0 0 1\n{to} 0 0 -4 0 0 0 1\n"));
        let (path, output) = (at("path.txt"), at(output));
        let video = ["--path", &path, "--size", "32x24", "--fps", "5", "-o", &output];
        let done = ivv(&[&["render", scene, "--capture", &capture][..], &video].concat());
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let (code, told) = film("-0.4", "2", "late.y4m");
    assert!(code == Some(0) && told.matches("lie outside of the clip").count() == 1, "{told}");
    // At -0.4, -0.2, 1, 1.2 to 2 s of a clip whose last frame is at 29 / 30 s.
    assert!(told.contains("8 of 13 frames") && told.contains("0.967 s"), "{told}");
    let frames = y4m(Path::new(&at("late.y4m")), 32, 24);
    assert_eq!(frames.len(), 13);
    assert!(frames[0] == frames[2] && frames[2] != frames[6] && frames[6] != frames[7]);
    assert!(frames[7..].iter().all(|frame| *frame == frames[7]), "the last moment stays");
    let (code, told) = film("0", "0.8", "within.y4m");
    assert!(code == Some(0) && !told.contains("outside"), "{told}");
    let path = at("path.txt");
    let told = fails(&["render", scene, "--capture", &capture, "--path", &path, "--frames", "1", "-o", "x.y4m"], 2);
    assert!(told.contains("--frames choose views"), "{told}");
    let (code, told) = film("1000", "1002", "seconds.y4m");
    assert!(code == Some(2) && told.contains("in seconds of the clip"), "{told}");
    assert!(!folder.0.join("seconds.y4m").exists());
}

#[test]
fn an_orbit_shows_what_cameras_look_at_from_all_sides() {
    let folder = Folder::new("film-orbit");
    let scene = still_scene(&folder);
    let at = |name: &str| folder.0.join(name).to_str().unwrap().to_owned();
    let view = |name: &str, x: f64, z: f64| {
        let p = DVec3::new(x, -1.0, z);
        let pose = HeadPose { t: 0.0, p, q: HeadPose::looking(-p, DVec3::NEG_Y) }.world_to_camera();
        serde_json::json!({
            "name": name, "width": 33, "height": 24, "fx": 30.0, "fy": 30.0, "cx": 16.5, "cy": 12.0, "world_to_camera": pose,
        })
    };
    let views =
        |views: &[serde_json::Value]| folder.write("cameras.json", serde_json::json!({ "views": views }).to_string());
    let cameras = views(&[view("a", 3.0, -3.0), view("b", 0.0, -4.0), view("c", -3.0, -3.0)]);
    let (cameras, output) = (cameras.to_str().unwrap(), at("orbit.y4m"));
    let orbit = ["render", &scene, "--cameras", cameras, "--orbit", "2", "--fps", "4", "-o", &output];
    let done = ivv(&orbit);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let frames = y4m(Path::new(&output), 32, 24);
    assert_eq!(frames.len(), 8, "two seconds, with no frame twice");
    for (index, frame) in frames.iter().enumerate() {
        let bright: u32 = (8..16).flat_map(|y| &frame[y * 32 + 10..y * 32 + 22]).map(|v| u32::from(*v)).sum();
        let edge: u32 = frame[..32].iter().map(|v| u32::from(*v)).sum();
        assert!(bright / 96 > edge / 32 + 20, "frame {index}: {bright} in the middle, {edge} at the edge");
        assert!(index == 0 || *frame != frames[index - 1], "frame {index} is the one before");
    }
    let bad = |more: &[&str]| {
        let done = ivv(&[&["render", &scene, "--cameras", cameras, "-o", &output][..], more].concat());
        assert_eq!(done.status.code(), Some(2), "{more:?}");
        String::from_utf8_lossy(&done.stderr).into_owned()
    };
    for seconds in ["0", "-1", "nan", "inf"] {
        assert!(bad(&[&format!("--orbit={seconds}")]).contains("positive number of seconds"), "{seconds}");
    }
    assert!(bad(&["--orbit", "1e9"]).contains("at most"));
    assert!(bad(&["--orbit", "1", "--format", "exr"]).contains("--format"));
    assert!(bad(&["--fov", "50"]).contains("--orbit"));
    let wide = bad(&["--orbit", "1", "--fov", "200"]);
    assert!(wide.contains("--fov: expected degrees above 0 and below 180, found 200"), "{wide}");
    views(&[view("a", 3.0, -3.0)]);
    let done = ivv(&orbit);
    let told = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.code() == Some(2) && told.contains("at least two views"), "{told}");
}

#[test]
fn an_orbit_of_a_clip_plays_it_once_or_stands_still() {
    let folder = Folder::new("film-orbit-clip");
    let capture = small_capture(&folder);
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/demo/scene.ply");
    let orbit = |more: &[&str]| {
        let output = folder.0.join("orbit.y4m");
        let film = ["--orbit", "1", "--fps", "3", "--size", "32x24", "-o", output.to_str().unwrap()];
        let done = ivv(&[&["render", scene, "--capture", &capture][..], &film, more].concat());
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        y4m(&output, 32, 24)
    };
    let (played, begin, end) = (orbit(&[]), orbit(&["--time", "0"]), orbit(&["--time", &(29.0 / 30.0).to_string()]));
    assert_eq!([played.len(), begin.len(), end.len()], [3; 3]);
    assert!(played[0] == begin[0] && played[2] == end[2], "from the first frame to the last");
    assert!(played[2] != begin[2], "it moves");
    // A file of a clip has views to start from, all of them at its begin.
    let [cameras, clip] = ["cameras.json", "clip.4dgs"].map(|name| folder.0.join(name).to_str().unwrap().to_owned());
    for step in [
        &["inspect", &capture, "--frames", "0", "--cameras", &cameras][..],
        &["export", scene, "-o", &clip, "--seconds", "1", "--cameras", &cameras],
    ] {
        let done = ivv(step);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    }
    let of_clip = |more: &[&str]| {
        let output = folder.0.join("clip.y4m");
        let film = ["render", &clip, "--orbit", "1", "--fps", "3", "--size", "32x24", "-o", output.to_str().unwrap()];
        let done = ivv(&[&film[..], more].concat());
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        y4m(&output, 32, 24)
    };
    let (played, begin, end) =
        (of_clip(&[]), of_clip(&["--time", "0"]), of_clip(&["--time", &(29.0 / 30.0).to_string()]));
    assert!(played[0] == begin[0] && played[2] == end[2] && played[2] != begin[2], "a file of a clip plays too");
}
