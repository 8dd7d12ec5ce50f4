//! `ivv sound localize`.

use crate::run::export_clip::check_metres;
use crate::run::files::{make_folder, write_json};
use crate::ui::screen::out;
use crate::verbs::synth::size;
use anyhow::Context;
use glam::DVec3;
use ivv::internals::sound::keypoints::{KeypointSettings, Mouths, keypoints_of};
use ivv::internals::sound::localize::{LocalizeSettings, Localized, localize};
use ivv::internals::sound::rig::{Rig, RigCamera};
use ivv::internals::sound::scene_file::{Mic, SoundScene, Source};
use ivv::internals::sound::source_track::Flag;
use ivv::internals::sound::wav::{Channel, read_channel};
use ivv::internals::sound::{FS, speaker};
use ivv::internals::words::count;
use std::path::{Path, PathBuf};

/// If fewer mouths agree than this part, the keypoints are wrong, and not just single detections.
const FEW_AGREE: f64 = 0.5;

#[derive(clap::Args)]
pub struct Args {
    /// A capture folder. Its lenses may distort if the keypoints are from the original pictures.
    capture: PathBuf,
    /// The folder for a track of each speaker (.csv), scene.json for `ivv sound render`, and localize.json.
    #[arg(short, long)]
    output: PathBuf,
    /// The folder of the keypoints, one file or folder per camera: MMPose, OpenPose, Pose2Sim. By default keypoints/ of the
    /// capture.
    #[arg(long)]
    keypoints: Option<PathBuf>,
    /// Time offsets of the cameras: offsets.json of a run on this capture, or the run's folder.
    #[arg(long)]
    offsets: Option<PathBuf>,
    /// Metres in a scene unit, if known, for scene.json. Without it the smoothing assumes mouths of 5 cm.
    #[arg(long)]
    metres_per_unit: Option<f64>,
    /// Holds a speaker's place through gaps of any length. Without it, gaps above 3 s are silent.
    #[arg(long)]
    hold: bool,
    /// Number of the first frame, if the keypoints do not say; usually 0 or 1.
    #[arg(long)]
    first_frame: Option<u32>,
    /// WIDTHxHEIGHT of the pictures that the detector saw, if not those of the camera.
    #[arg(long, value_parser = size)]
    image_size: Option<(u32, u32)>,
    /// The camera whose recording, audio/<camera>.wav, is used. By default the one nearest to the middle of all.
    #[arg(long)]
    microphone: Option<String>,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    args.metres_per_unit.map_or(Ok(()), check_metres)?;
    let mut rig = Rig::open(&args.capture)?;
    if let Some(offsets) = &args.offsets {
        let table = offsets.join("offsets.json");
        rig.read_offsets(if offsets.is_dir() { &table } else { offsets })?;
    }
    let mouths = read_keypoints(args, &rig)?;
    let settings = LocalizeSettings { metres_per_unit: args.metres_per_unit, hold: args.hold };
    let found = localize(&rig, &mouths, &settings);
    make_folder(&args.output)?;
    for track in &found.tracks {
        track.write_csv(&args.output.join(format!("{}.csv", track.id)))?;
    }
    write_json(&args.output.join("localize.json"), &found.report)?;
    let scene = match microphone(args, &rig)? {
        Some(microphone) if !found.tracks.is_empty() => {
            let scene = args.output.join("scene.json");
            sound_scene(args, &rig, microphone, &found)?.write(&scene)?;
            Some(scene)
        }
        _ => None,
    };
    if json {
        out!("{}", serde_json::json!({ "report": found.report, "scene": scene }));
    } else {
        print(args, &found, scene.as_deref());
    }
    Ok(())
}

/// The mouths in each camera of the rig; empty for a camera without keypoints.
fn read_keypoints(args: &Args, rig: &Rig) -> anyhow::Result<Vec<Mouths>> {
    let folder = args.keypoints.clone().unwrap_or_else(|| args.capture.join("keypoints"));
    let settings = KeypointSettings { first_frame: args.first_frame, image_size: args.image_size };
    let mut mouths = Vec::new();
    let mut n_cameras = 0;
    for camera in &rig.cameras {
        let path = keypoints_of(&folder, &camera.name);
        n_cameras += usize::from(path.is_some());
        mouths.push(path.map_or(Ok(Mouths::default()), |path| Mouths::read(&path, &camera.lens, &settings))?);
    }
    if n_cameras < 2 {
        let reason = format!("has keypoints of {} of the capture; expected two or more", count(n_cameras, "camera"));
        let remedy = "name the files after the cameras, <camera>.json";
        return Err(ivv::Error::data(&folder, "", reason, remedy).into());
    }
    Ok(mouths)
}

fn recording(args: &Args, camera: &RigCamera) -> PathBuf {
    args.capture.join("audio").join(format!("{}.wav", camera.name))
}

/// The camera of --microphone; else, of those with a recording, the one nearest to the centre of all.
fn microphone<'a>(args: &Args, rig: &'a Rig) -> anyhow::Result<Option<&'a RigCamera>> {
    if let Some(name) = &args.microphone {
        let camera = rig.cameras.iter().find(|camera| camera.name == *name);
        let camera = camera.with_context(|| format!("the capture has no camera `{name}` (--microphone)"))?;
        let wav = recording(args, camera);
        anyhow::ensure!(wav.is_file(), "{} does not exist (--microphone)", wav.display());
        return Ok(Some(camera));
    }
    let place = |camera: &RigCamera| camera.pose(0.0).center();
    let middle = rig.cameras.iter().map(place).sum::<DVec3>() / rig.cameras.len().max(1) as f64;
    let away = |camera: &&RigCamera| (place(camera) - middle).length();
    let recorded = rig.cameras.iter().filter(|camera| recording(args, camera).is_file());
    Ok(recorded.min_by(|a, b| away(a).total_cmp(&away(b))))
}

/// The sound scene of the microphone. Of several speakers, the one whose lips move is heard.
fn sound_scene(args: &Args, rig: &Rig, microphone: &RigCamera, found: &Localized) -> anyhow::Result<SoundScene> {
    let wav = recording(args, microphone);
    let offset_s = microphone.offset / rig.fps;
    let mut gates = vec![Vec::new(); found.tracks.len()];
    if found.tracks.len() > 1 {
        let sound = read_channel(&wav, Channel::default(), offset_s)?;
        gates = speaker::gates(&found.openings, &loudness(&sound, rig.fps, found.report.frames), rig.fps);
    }
    let sources = found.tracks.iter().zip(gates).filter(|(_, gates)| found.tracks.len() == 1 || !gates.is_empty());
    let source = |(track, gates): (&_, _)| Source { track: Clone::clone(track), wav: None, gain_db: 0.0, gates };
    Ok(SoundScene {
        metres_per_unit: args.metres_per_unit,
        up: rig.up(),
        mic: Mic {
            camera: microphone.name.clone(),
            pose: microphone.head(rig.fps)?,
            wav: std::path::absolute(&wav)?,
            channel: Channel::default(),
            offset_s,
        },
        sources: sources.map(source).collect(),
    })
}

fn loudness(sound: &[f32], fps: f64, n_frames: usize) -> Vec<f64> {
    let sample = |frame: usize| ((frame as f64 / fps * f64::from(FS)) as usize).min(sound.len());
    let rms = |frame: usize| {
        let part = &sound[sample(frame)..sample(frame + 1)];
        (part.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / part.len().max(1) as f64).sqrt()
    };
    (0..n_frames).map(rms).collect()
}

fn print(args: &Args, found: &Localized, scene: Option<&Path>) {
    let report = &found.report;
    let n_mouths: usize = report.mouths.values().sum();
    let (frames, cameras) = (count(report.frames, "frame"), count(report.mouths.len(), "camera"));
    let (mouths, percent) = (count(n_mouths, "mouth"), 100.0 * report.agreeing);
    out!("{frames}, {cameras}, {mouths}; cameras agree on {percent:.0} % of them");
    if report.agreeing < FEW_AGREE {
        out!("few cameras agree: check --image-size, --first-frame and the cameras' names");
    }
    for (source, track) in report.sources.iter().zip(&found.tracks) {
        let flags = source.flags.iter().map(|(flag, n)| format!("{n} {flag}")).collect::<Vec<_>>().join(", ");
        let (id, views, px, sd) = (&source.id, source.mean_views, source.reproj_px, source.worst_sd);
        out!("{id}: {flags}; {views:.1} views, {px:.2} px, standard deviation {sd:.4} units");
        if track.samples.iter().any(|sample| sample.flag == Flag::Approx) {
            out!("  approx: placed by the nose, about 7 cm from the mouth");
        }
    }
    if report.is_scale_estimated {
        out!("smoothing takes a scene unit for {:.2} m, from the width of mouths", report.metres_per_unit);
    }
    let output = args.output.display();
    match scene {
        Some(scene) => out!("{}", scene.display()),
        None if found.tracks.is_empty() => out!("{output}: no speaker was found"),
        None => out!("{output}: tracks only, no scene: the capture has no recording audio/<camera>.wav"),
    }
}
