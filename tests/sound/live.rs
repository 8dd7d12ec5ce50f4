//! Sound block by block, as a player mixes it, against the rendering of a way that is known.

use super::measure::energy;
use super::{db, ear, noise, scene, sphere, track};
use crate::common::prelude::*;
use ivv::internals::formats::{Sound, Sounds};
use ivv::internals::scene::Playhead;
use ivv::internals::sound::geometry::Mode;
use ivv::internals::sound::live::{Chase, Live};
use ivv::internals::sound::wav::{self, Depth};

const FS: f64 = 48_000.0;
const BLOCK: usize = 512;
const N: usize = 64 * BLOCK;

fn ears() -> HrtfSet {
    HrtfSet::new(Sphere::default().measured(3), Path::new("sphere")).unwrap()
}

fn encoded<const CHANNELS: usize>(frames: &[[f32; CHANNELS]]) -> Vec<u8> {
    // Tests run at once, and each removes its folder.
    let folder = Folder::new(&format!("live-{:?}", std::thread::current().id()));
    let file = folder.file("sound.wav");
    wav::write(&file, frames, Depth::Float32).unwrap();
    std::fs::read(&file).unwrap()
}

fn mono(signal: &[f32]) -> Vec<u8> {
    encoded(&signal.iter().map(|x| [*x]).collect::<Vec<_>>())
}

/// One source of `wav` along `places`, from `start` seconds on, recorded at the origin.
fn sounds(wav: Vec<u8>, start: f64, places: &[(f64, DVec3)]) -> Sounds {
    let places = places.iter().map(|(t, p)| (*t, p.to_array())).collect();
    Sounds::new([0.0; 3], 0.2, vec![Sound { name: "a".into(), wav, gain: 1.0, start, seconds: N as f64 / FS, places }])
}

/// What a listener on `head` hears in blocks of `n` samples from the time 0 on.
fn heard(live: &Live, head: &PoseTrack, n: usize) -> Vec<[f32; 2]> {
    let mut listener = live.listener();
    let mut out = vec![[0.0; 2]; N];
    for (k, block) in out.chunks_mut(n).enumerate() {
        listener.block((k * n) as f64 / FS, head, block);
    }
    out
}

fn off(a: &[[f32; 2]], b: &[[f32; 2]], side: usize) -> f64 {
    let (a, b) = (ear(a, side), ear(b, side));
    let difference: Vec<f32> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
    db(energy(&difference) / energy(&b))
}

/// A head that goes on a way and turns meanwhile.
fn walk() -> PoseTrack {
    let pose = |k: u32| {
        let t = f64::from(k) / 60.0;
        let q = DQuat::from_rotation_z(0.4 + 0.8 * t) * DQuat::from_rotation_y(0.2 * t);
        HeadPose { t, p: DVec3::new(0.6 * t, -0.4 * t, 0.1 * t), q }
    };
    PoseTrack::new((0..60).map(pose).collect()).unwrap()
}

#[test]
fn blocks_are_what_a_rendering_of_the_way_is() {
    let places = [(0.0, DVec3::new(1.0, 2.0, 0.2)), (0.7, DVec3::new(-0.8, 1.5, 0.0))];
    let signal: Vec<f32> = noise(N, 3).iter().map(|x| 0.1 * x).collect();
    let live = Live::new(&sounds(mono(&signal), 0.0, &places), ears());
    assert!(live.faults.is_empty());
    // What differs is where delays glide from, which shows less in short blocks; and at the beginning a rendering holds them for what
    // is on its way already.
    for (block, least) in [(BLOCK, -70.0), (BLOCK / 4, -80.0)] {
        // No floor of distances, no delay of the way, and no change of loudness, as live.
        let config = RenderConfig { mode: Mode::Physical, propagation: false, ..RenderConfig::default() };
        let config = RenderConfig { block, r_min_m: 1e-6, lufs: None, ..config };
        let scene = scene(track("a", &places));
        let expected = render_signals(&scene, std::slice::from_ref(&signal), &walk(), sphere(), &config).unwrap();
        assert_eq!(expected.report.gain_db, 0.0);
        let found = heard(&live, &walk(), block);
        for side in 0..2 {
            let off = off(&found[BLOCK..], &expected.samples[BLOCK..], side);
            println!("ear {side}, blocks of {block}: {off:.1} dB");
            assert!(off < least, "ear {side}, blocks of {block}: {off} dB");
        }
    }
}

#[test]
fn a_source_that_moved_alone_is_heard_the_same_in_blocks_of_any_length() {
    let places = [(0.0, DVec3::new(1.0, 2.0, 0.2)), (0.7, DVec3::new(-0.8, 1.5, 0.0))];
    let live = Live::new(&sounds(mono(&noise(N, 4)), 0.0, &places), ears());
    let head = PoseTrack::still(DVec3::new(0.3, 0.0, 0.0), DQuat::from_rotation_z(1.0));
    let [long, short] = [BLOCK, 128].map(|n| heard(&live, &head, n));
    // Between the edges of blocks responses glide along lines, which are not the same of long and short ones.
    for side in 0..2 {
        let off = off(&long, &short, side);
        assert!(off < -50.0, "ear {side}: {off} dB");
    }
}

/// A listener where the microphone was hears the recording's level.
#[test]
fn gains_are_those_of_the_law_of_distance() {
    let level = |listener: DVec3| {
        let live = Live::new(&sounds(mono(&noise(N, 5)), 0.0, &[(0.0, DVec3::new(0.0, 2.0, 0.0))]), ears());
        let samples = heard(&live, &PoseTrack::still(listener, HeadPose::looking(DVec3::Y, DVec3::Z)), BLOCK);
        energy(&ear(&samples, 0)).sqrt()
    };
    let at_the_microphone = level(DVec3::ZERO);
    // 1 m, 4 m, and nearer than counts: straight ahead in each case.
    for (y, gain) in [(1.0, 2.0), (-2.0, 0.5), (1.95, 10.0)] {
        let found = level(DVec3::new(0.0, y, 0.0)) / at_the_microphone;
        assert!((found / gain - 1.0).abs() < 1e-4, "at {y}: {found}, expected {gain}");
    }
}

#[test]
fn a_source_is_silent_before_it_begins_and_after_it_ends_and_begins_anew_after_a_jump() {
    let start = (8 * BLOCK) as f64 / FS;
    let live = Live::new(&sounds(mono(&noise(16 * BLOCK, 6)), start, &[(0.0, DVec3::new(1.0, 1.0, 0.0))]), ears());
    let head = PoseTrack::still(DVec3::ZERO, DQuat::IDENTITY);
    let all = heard(&live, &head, BLOCK);
    let loud = |from: usize, to: usize| all[from * BLOCK..to * BLOCK].as_flattened().iter().any(|x| *x != 0.0);
    assert!(!loud(0, 8) && loud(8, 9) && loud(23, 24));
    // Responses and delays sound on for a while.
    assert!(!loud(30, 64));
    let block = |listener: &mut ivv::internals::sound::live::Listener, t: f64| {
        let mut out = vec![[0.0; 2]; BLOCK];
        listener.block(t, &head, &mut out);
        out
    };
    let mut listener = live.listener();
    block(&mut listener, start + 0.05);
    let jumped = block(&mut listener, start + 0.02);
    assert_eq!(jumped, block(&mut live.listener(), start + 0.02));
    listener.rest();
    assert_eq!(block(&mut listener, start + 0.02), jumped);
}

#[test]
fn channels_become_their_mean_and_what_cannot_be_read_is_told_and_stays_silent() {
    let (a, b) = (noise(N, 7), noise(N, 8));
    let both: Vec<[f32; 2]> = a.iter().zip(&b).map(|(a, b)| [*a, *b]).collect();
    let mean: Vec<f32> = both.iter().map(|[a, b]| (a + b) / 2.0).collect();
    let place = [(0.0, DVec3::new(1.0, 1.0, 0.0))];
    let head = PoseTrack::still(DVec3::ZERO, DQuat::IDENTITY);
    let [two, one] = [encoded(&both), mono(&mean)].map(|wav| Live::new(&sounds(wav, 0.0, &place), ears()));
    assert_eq!(heard(&two, &head, BLOCK), heard(&one, &head, BLOCK));
    let damaged = Live::new(&sounds(b"RIFF and no more".to_vec(), 0.0, &place), ears());
    assert!(heard(&damaged, &head, BLOCK).as_flattened().iter().all(|x| *x == 0.0));
    let [fault] = damaged.faults.as_slice() else { panic!("{:?}", damaged.faults) };
    assert!(fault.to_string().contains("sound \"a\""), "{fault}");
}

#[test]
fn a_chase_leaves_no_gaps_while_the_picture_is_near_and_jumps_where_it_is_not() {
    let block = BLOCK as f64 / FS;
    let mut clip = Playhead::new(1.0, 0.0, true);
    let begun = Instant::now();
    let mut chase = Chase::default();
    let moment = |k: u32, late: f64| begun + Duration::from_secs_f64(0.1 + f64::from(k) * block + late);
    // The system asks a little early and a little late; the clip ends meanwhile and begins again.
    let mut last = chase.next(&clip, moment(0, 0.0), BLOCK).unwrap();
    let (mut n_laps, expected_laps) = (0, (last + 299.0 * block) as u32);
    for k in 1..300 {
        let t = chase.next(&clip, moment(k, if k % 2 == 0 { 0.008 } else { -0.008 }), BLOCK).unwrap();
        assert!((0.0..1.0).contains(&t));
        n_laps += u32::from(t < last);
        let gap = (t - last).rem_euclid(1.0) - block;
        assert!(gap.abs() < 1e-9, "a gap of {gap} s before block {k}");
        last = t;
    }
    assert!(n_laps == expected_laps && n_laps > 2, "{n_laps} laps, expected {expected_laps}");
    // The picture is 30 ms ahead and stays so: one jump.
    let mut n_jumps = 0;
    for k in 300..500 {
        let t = chase.next(&clip, moment(k, 0.03), BLOCK).unwrap();
        n_jumps += u32::from(((t - last).rem_euclid(1.0) - block).abs() > 1e-9);
        last = t;
    }
    assert_eq!(n_jumps, 1);
    // A person goes elsewhere: at once.
    clip.seek(0.5);
    let now = Instant::now();
    assert_eq!(chase.next(&clip, now, BLOCK), Some(clip.at(now)));
    for (is_playing, speed) in [(true, 2.0), (false, 1.0)] {
        clip.set(0.5, is_playing, speed);
        assert_eq!(chase.next(&clip, Instant::now(), BLOCK), None);
    }
    // And goes on as it was: from where the picture is, not from where sound was.
    clip.set(0.2, true, 1.0);
    let now = Instant::now();
    assert_eq!(chase.next(&clip, now, BLOCK), Some(clip.at(now)));
}
