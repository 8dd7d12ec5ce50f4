//! `ivv sound synth`.

use crate::run::files::{make_folder, read_json};
use crate::ui::screen::answer;
use anyhow::Context;
use glam::{DQuat, DVec3};
use ivv::internals::sound::FS;
use ivv::internals::sound::emitter::Emitter;
use ivv::internals::sound::hrtf::HrtfSet;
use ivv::internals::sound::pose::{HeadPose, PoseTrack};
use ivv::internals::sound::rig::Rig;
use ivv::internals::sound::sinc::DelayTable;
use ivv::internals::sound::source_track::{Flag, SourceSample, SourceTrack};
use ivv::internals::sound::wav::{Channel, Depth, read_channel, write};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// How far the head of a capture's truth is from the source, and how many degrees a second it goes around it.
const DISTANCE: f64 = 1.5;
const SPEED: f64 = 60.0;

#[derive(clap::Args)]
pub struct Args {
    /// The folder to write to: path.csv and truth.wav.
    #[arg(short, long)]
    output: PathBuf,
    /// A capture of `ivv synth`.
    #[arg(long)]
    capture: PathBuf,
    /// The ears: `sphere`, a SOFA file, or a folder of WAV files as SADIE's.
    #[arg(long, default_value = "sphere")]
    hrtf: PathBuf,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let hrtf = HrtfSet::open(&args.hrtf)?;
    make_folder(&args.output)?;
    let (head, truth) = of_capture(&args.capture, &hrtf)?;
    write_path(&head, &args.output.join("path.csv"))?;
    write(args.output.join("truth.wav"), &truth, Depth::Float32)?;
    let seconds = truth.len() as f64 / f64::from(FS);
    let path = args.output.to_string_lossy();
    let text = format!("{path}: {seconds:.2} s as heard through {}", hrtf.meta.title);
    answer(json, &serde_json::json!({ "path": path, "seconds": seconds, "hrtf": hrtf.meta }), text);
    Ok(())
}

/// `truth.json` of a synthetic capture.
#[derive(serde::Deserialize)]
struct Truth {
    source: TrueSource,
}

#[derive(serde::Deserialize)]
struct TrueSource {
    position: Vec<[f64; 3]>,
    speed_of_sound: f64,
}

/// A path around the speaker at the height of its mouth, and what is heard there.
fn of_capture(capture: &Path, hrtf: &HrtfSet) -> anyhow::Result<(PoseTrack, Vec<[f32; 2]>)> {
    let rig = Rig::open(capture)?;
    let (file, remedy) = (capture.join("truth.json"), "give a capture that `ivv synth` wrote");
    let Truth { source } = read_json(&file, remedy)?;
    let said = read_channel(&capture.join("truth/source.wav"), Channel::Left, 0.0)?;
    let sample = |(frame, p): (usize, &[f64; 3])| SourceSample {
        t: frame as f64 / rig.fps,
        p: DVec3::from(*p),
        cov: [0.0; 6],
        views: 0,
        reproj_px: 0.0,
        flag: Flag::Seen,
    };
    let samples: Vec<SourceSample> = source.position.iter().enumerate().map(sample).collect();
    let middle = samples.iter().map(|sample| sample.p).sum::<DVec3>() / samples.len().max(1) as f64;
    if samples.is_empty() || !middle.is_finite() {
        let reason = "expected a place of each frame, found none, or one that is not finite";
        return Err(ivv::Error::data(&file, "source.position", reason, remedy).into());
    }
    let track = SourceTrack { id: "truth".into(), samples, fps: rig.fps };
    let up = rig.up();
    let aside = up.any_orthonormal_vector();
    let seconds = said.len() as f64 / f64::from(FS);
    // The source begins on the head's left and crosses its front.
    let pose = |t: f64| {
        let p = middle + DQuat::from_axis_angle(up, (SPEED * t).to_radians()) * aside * DISTANCE;
        let forward = DQuat::from_axis_angle(up, -40f64.to_radians()) * -aside;
        HeadPose { t, p, q: HeadPose::looking(forward, up) }
    };
    let n_poses = (seconds * 60.0).ceil() as u32;
    let head = PoseTrack::new((0..=n_poses).map(|k| pose(f64::from(k) / 60.0)).collect())?;
    let table = DelayTable::new();
    let voice = |t: f64| f64::from(table.at(&said, t * f64::from(FS)));
    let place = |t: f64| track.at(t).unwrap_or(middle);
    let emitter = Emitter { voice: &voice, place: &place, speed_of_sound: source.speed_of_sound };
    Ok((head.clone(), emitter.binaural(&head, hrtf, said.len())))
}

fn write_path(head: &PoseTrack, path: &Path) -> anyhow::Result<()> {
    let mut text = String::from("t,x,y,z,qx,qy,qz,qw\n");
    for HeadPose { t, p, q } in head.poses() {
        writeln!(text, "{t},{},{},{},{},{},{},{}", p.x, p.y, p.z, q.x, q.y, q.z, q.w).context("a path")?;
    }
    ivv::internals::files::write_atomic(path, |to| to.write_all(text.as_bytes()))?;
    Ok(())
}
