//! What is written: T39, T40, T41.

use super::{head, noise, scene, sphere, tone, track};
use crate::common::prelude::*;
use ivv::Error;
use ivv::internals::sound::geometry::{Mode, angles};
use ivv::internals::sound::loudness::{PEAK_LIMIT_DB, gain_db, measure};
use ivv::internals::sound::render::{SPEED_OF_SOUND, render_ambix};
use ivv::internals::sound::scene_file::Source;
use ivv::internals::sound::wav::{Channel, Depth, integer, read, read_channel, write};

#[test]
fn t39_files_hold_the_rounded_samples() {
    let folder = Folder::new("wav");
    let path = folder.file("a.wav");
    let mut frames: Vec<[f32; 2]> = noise(600, 39).chunks(2).map(|pair| [pair[0], pair[1]]).collect();
    frames.extend([[1.5, -1.5], [1.0, -1.0], [0.5 / 8_388_608.0, -0.4 / 8_388_608.0]]);
    write(&path, &frames, Depth::Int24).unwrap();
    let mut reader = hound::WavReader::open(&path).unwrap();
    let spec = reader.spec();
    assert_eq!((spec.channels, spec.sample_rate, spec.bits_per_sample), (2, 48_000, 24));
    let found: Vec<i32> = reader.samples::<i32>().map(Result::unwrap).collect();
    let expected: Vec<i32> = frames
        .as_flattened()
        .iter()
        .map(|value| (f64::from(*value) * 8_388_608.0).round().clamp(-8_388_608.0, 8_388_607.0) as i32)
        .collect();
    assert_eq!(found, expected);
    assert_eq!((integer(2.0, 24), integer(-2.0, 24), integer(1.0, 16)), (8_388_607, -8_388_608, 32_767));
    write(&path, &frames, Depth::Float32).unwrap();
    let back = read(&path).unwrap();
    assert!(back.channels[0].iter().zip(&frames).all(|(value, frame)| *value == frame[0]));
    // What is not finite is not written, and the file stays as it was.
    frames[3][1] = f32::NAN;
    assert!(matches!(write(&path, &frames, Depth::Int24), Err(Error::NonFinite { count: 1, .. })));
    assert!(read(&path).is_ok());
}

#[test]
fn recordings_are_read_by_channel_rate_and_offset() {
    let folder = Folder::new("read");
    let path = folder.file("a.wav");
    let spec = hound::WavSpec {
        channels: 2,
        sample_rate: 16_000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(&path, spec).unwrap();
    for i in 0..1600 {
        let value = (8000.0 * (std::f64::consts::TAU * 440.0 * f64::from(i) / 16_000.0).sin()) as i16;
        writer.write_sample(value).unwrap();
        writer.write_sample(0i16).unwrap();
    }
    writer.finalize().unwrap();
    // Recorded from 0.01 s on: a silence of 480 samples comes first.
    let left = read_channel(&path, Channel::Left, 0.01).unwrap();
    assert_eq!(left.len(), 4800 + 480);
    let expected = tone(440.0, 4800);
    let worst = (1000..4000).map(|i| (left[i + 480] - 8000.0 / 32_768.0 * expected[i]).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-4, "{worst}");
    assert!(read_channel(&path, Channel::Right, 0.0).unwrap().iter().all(|value| *value == 0.0));
    let mid = read_channel(&path, Channel::Mid, 0.01).unwrap();
    assert!((mid[1500] - 0.5 * left[1500]).abs() < 1e-6);
    for bytes in [&b""[..], b"RIFF", &fs::read(&path).unwrap()[..60], &fs::read(&path).unwrap()[..44]] {
        fs::write(folder.file("bad.wav"), bytes).unwrap();
        assert!(matches!(read(&folder.file("bad.wav")), Err(Error::Data { .. })), "{} bytes were taken", bytes.len());
    }
    assert!(read(&folder.file("absent.wav")).is_err());
}

#[test]
fn t40_the_meter_reads_what_the_norm_says() {
    // EBU Tech 3341, case 1: a stereo sine at -23 dBFS reads -23 LUFS; the filter is flat near 1 kHz.
    let amplitude = 10f32.powf(-23.0 / 20.0);
    let frames: Vec<[f32; 2]> = tone(997.0, 96_000).iter().map(|x| [amplitude * x; 2]).collect();
    let measured = measure(&frames).unwrap();
    assert!((measured.lufs.unwrap() + 23.0).abs() < 0.1, "{measured:?}");
    assert!((measured.true_peak_db.unwrap() + 23.0).abs() < 0.1, "{measured:?}");
    assert!((gain_db(&measured, Some(-16.0)) - 7.0).abs() < 0.1);
    assert_eq!(gain_db(&measured, None), 0.0);
    let silence = measure(&[[0.0; 2]; 4800]).unwrap();
    assert_eq!((silence.lufs, silence.true_peak_db, gain_db(&silence, Some(-23.0))), (None, None, 0.0));
}

#[test]
fn t40_peaks_are_held_back_once_for_all() {
    let way = scene(track("a", &[(0.0, DVec3::new(0.3, 1.0, 0.0))]));
    let signal = tone(997.0, 24_000);
    let near = head(DVec3::new(0.3, 0.7, 0.0), 0.0);
    let rendered = |lufs: Option<f64>| {
        let config = RenderConfig { lufs, ..RenderConfig::default() };
        render_signals(&way, std::slice::from_ref(&signal), &near, sphere(), &config).unwrap()
    };
    let guarded = rendered(None);
    let after = measure(&guarded.samples).unwrap().true_peak_db.unwrap();
    assert!(guarded.report.gain_db < -6.0 && after <= PEAK_LIMIT_DB + 1e-4, "{after} {:?}", guarded.report);
    let quiet = rendered(Some(-30.0));
    assert!((measure(&quiet.samples).unwrap().lufs.unwrap() + 30.0).abs() < 0.1);
}

/// The direction that a sound field comes from: of its mean energy flow.
fn decode(frames: &[[f32; 4]]) -> (f64, f64) {
    angles(frames.iter().map(|frame| frame.map(f64::from)).map(|[w, y, z, x]| w * DVec3::new(x, y, z)).sum())
}

#[test]
fn t41_ambisonics_point_at_the_source() {
    let signal = noise(2000, 41);
    for (az, el) in [(30.0f64, 20.0f64), (-100.0, -35.0), (170.0, 5.0)] {
        let (sin, cos) = az.to_radians().sin_cos();
        let (up, level) = el.to_radians().sin_cos();
        let at = DVec3::new(0.4, -0.2, 0.1);
        // Left is -x, forward y. The head's turn does not matter, since the player turns.
        let source = at + 3.0 * DVec3::new(-sin * level, cos * level, up);
        let way = scene(track("a", &[(0.0, source)]));
        let config = RenderConfig { mode: Mode::Paper3d, ..RenderConfig::default() };
        let frames = render_ambix(&way, std::slice::from_ref(&signal), &head(at, 77.0), &config).unwrap();
        let (found_az, found_el) = decode(&frames);
        assert!((found_az.to_degrees() - az).abs() < 0.1 && (found_el.to_degrees() - el).abs() < 0.1);
        // W carries the level relative to the recording.
        let gain = source.length() / 3.0;
        assert!((f64::from(frames[700][0] / signal[700]) / gain - 1.0).abs() < 1e-4);
    }
}

#[test]
fn t41_ambisonics_are_as_late_as_the_way_is_longer() {
    // The microphone is at 0; the head stands 10 m farther from the source, then it jumps to the microphone.
    let way = scene(track("a", &[(0.0, DVec3::new(0.0, 2.0, 0.0))]));
    let mut signal = vec![0.0; 24_000];
    (signal[1000], signal[20_000]) = (1.0, 1.0);
    let far = HeadPose { t: 0.0, p: DVec3::new(0.0, -10.0, 0.0), q: DQuat::IDENTITY };
    let here = HeadPose { t: 0.3005, p: DVec3::ZERO, ..far };
    let path = PoseTrack::new(vec![far, HeadPose { t: 0.3, ..far }, here]).unwrap();
    let frames = |mode: Mode| {
        let config = RenderConfig { mode, ..RenderConfig::default() };
        render_ambix(&way, std::slice::from_ref(&signal), &path, &config).unwrap()
    };
    let loudest = |frames: &[[f32; 4]], from: usize| {
        let far = |i: &usize| frames[*i][0].abs();
        (from..from + 4000).max_by(|a, b| far(a).total_cmp(&far(b))).unwrap()
    };
    let physical = frames(Mode::Physical);
    let late = 10.0 / SPEED_OF_SOUND * 48_000.0;
    assert!((loudest(&physical, 800) as f64 - 1000.0 - late).abs() <= 1.0, "{}", loudest(&physical, 800));
    assert_eq!(loudest(&physical, 18_000), 20_000, "after the jump");
    let of_paper = frames(Mode::Paper3d);
    assert_eq!([loudest(&of_paper, 800), loudest(&of_paper, 18_000)], [1000, 20_000]);
}

#[test]
fn t41_the_same_input_gives_the_same_bytes() {
    let folder = Folder::new("twice");
    let source = track("a", &[(0.0, DVec3::new(-1.0, 2.0, 0.3)), (0.2, DVec3::new(1.0, 2.0, 0.3))]);
    for mode in [Mode::Paper2d, Mode::Paper3d, Mode::Physical] {
        let config = RenderConfig { mode, ..RenderConfig::default() };
        let bytes = |name: &str| {
            let rendered =
                render_signals(&scene(source.clone()), &[noise(6000, 4)], &head(DVec3::ZERO, 10.0), sphere(), &config)
                    .unwrap();
            write(folder.file(name), &rendered.samples, Depth::Int24).unwrap();
            fs::read(folder.file(name)).unwrap()
        };
        assert_eq!(bytes("a.wav"), bytes("b.wav"));
    }
}

#[test]
fn gates_let_one_source_through_at_a_time() {
    let mut both = scene(track("a", &[(0.0, DVec3::new(-2.0, 0.0, 0.0))]));
    let second = track("b", &[(0.0, DVec3::new(2.0, 0.0, 0.0))]);
    both.sources.push(Source { track: second, wav: None, gain_db: 0.0, gates: vec![(0.2, 0.5)] });
    both.sources[0].gates = vec![(-1.0, 0.2)];
    let signal = tone(700.0, 19_200);
    let config = RenderConfig::default();
    let rendered =
        render_signals(&both, &[signal.clone(), signal], &head(DVec3::ZERO, 0.0), sphere(), &config).unwrap();
    let level =
        |side: usize, from: usize| -> f32 { rendered.samples[from..from + 2000].iter().map(|f| f[side].powi(2)).sum() };
    assert!(level(0, 4000) > 2.0 * level(1, 4000), "the first source is on the left");
    assert!(level(1, 15_000) > 2.0 * level(0, 15_000), "the second one is on the right");
    // Where the track says that nobody speaks, nothing is heard.
    let mut quiet = scene(track("a", &[(0.0, DVec3::Y), (0.1, DVec3::Y), (0.2, DVec3::Y), (0.3, DVec3::Y)]));
    quiet.sources[0].track.samples[2].flag = ivv::internals::sound::source_track::Flag::Inactive;
    quiet.sources[0].track.samples[3].flag = ivv::internals::sound::source_track::Flag::Inactive;
    let rendered = render_signals(&quiet, &[tone(700.0, 14_400)], &head(DVec3::ZERO, 0.0), sphere(), &config).unwrap();
    assert!(rendered.samples[3000][0].abs() > 1e-3);
    assert!(rendered.samples[8000..14_000].iter().flatten().all(|value| value.abs() < 1e-6));
}

#[test]
fn a_scene_file_is_read_back() {
    let folder = Folder::new("scene");
    let mut written = scene(track("speaker", &[(0.0, DVec3::X), (0.5, DVec3::Y)]));
    written.mic.wav = folder.file("audio/a.wav");
    written.mic.offset_s = 0.125;
    written.mic.channel = Channel::Mid;
    written.sources[0].gates = vec![(0.0, 0.25)];
    written.write(&folder.file("scene.json")).unwrap();
    let text = fs::read_to_string(folder.file("scene.json")).unwrap();
    assert!(text.contains("\"audio/a.wav\"") && text.contains("\"speaker.csv\""), "{text}");
    let found = SoundScene::read(folder.file("scene.json")).unwrap();
    assert_eq!((found.up, found.metres_per_unit, found.mic.offset_s), (DVec3::Z, Some(1.0), 0.125));
    assert_eq!((found.mic.wav, found.mic.channel), (written.mic.wav.clone(), Channel::Mid));
    assert_eq!(found.sources[0].track.samples, written.sources[0].track.samples);
    assert!((found.mic.pose.at(0.0).forward() - DVec3::Y).length() < 1e-12);
    for (from, to) in [
        ("\"version\": 1", "\"version\": 2"),
        ("\"up\": [", "\"down\": ["),
        ("\"metres_per_unit\": 1.0", "\"metres_per_unit\": -1.0"),
        ("speaker.csv", "absent.csv"),
    ] {
        assert!(text.contains(from), "{text}");
        fs::write(folder.file("bad.json"), text.replace(from, to)).unwrap();
        assert!(matches!(SoundScene::read(folder.file("bad.json")), Err(Error::Data { .. })), "{to} was taken");
    }
}

#[test]
fn the_physical_mode_asks_for_a_scale() {
    let mut way = scene(track("a", &[(0.0, DVec3::Y)]));
    way.metres_per_unit = None;
    let config = |mode| RenderConfig { mode, ..RenderConfig::default() };
    let rendered = |mode| render_signals(&way, &[noise(500, 1)], &head(DVec3::ZERO, 0.0), sphere(), &config(mode));
    assert!(rendered(Mode::Physical).unwrap_err().to_string().contains("metres_per_unit"));
    assert!((rendered(Mode::Paper2d).unwrap().report.r_min - 0.02).abs() < 1e-12);
}

fn two_samples(fs: u32) -> Vec<u8> {
    let mut bytes = b"RIFF\x28\0\0\0WAVEfmt \x10\0\0\0\x01\0\x01\0".to_vec();
    bytes.extend(fs.to_le_bytes());
    bytes.extend(fs.wrapping_mul(2).to_le_bytes());
    bytes.extend(b"\x02\0\x10\0data\x04\0\0\0\0\x10\0\x20");
    bytes
}

/// Weights of a change of rate are kept by phase, so that 268,468,411 Hz would need 40 GB of them and 1 Hz 38 GB.
#[test]
fn sample_rates_that_no_sound_has_are_refused_by_the_name_of_the_field() {
    let folder = Folder::new("rates");
    let path = folder.file("a.wav");
    for fs in [0, 1, 7_999, 400_001, 999_983, 268_468_411] {
        fs::write(&path, two_samples(fs)).unwrap();
        let error = read_channel(&path, Channel::Left, 0.0).unwrap_err();
        let told = error.to_string();
        assert!(matches!(error, Error::Data { .. }) && error.exit_code() == 3, "{told}");
        assert!(told.contains("field `sample rate`") && told.contains(&format!("is {fs}")), "{told}");
    }
    for fs in [8_000, 400_000] {
        fs::write(&path, two_samples(fs)).unwrap();
        assert_eq!(read(&path).unwrap().fs, fs);
    }
}
