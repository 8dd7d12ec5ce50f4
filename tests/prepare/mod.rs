//! Preparing captures: lenses are undone, every source is read, work is gone on with and never overwritten.

mod along;
mod board;
mod calibrations;
mod cases;
mod cases_video;
mod coded;
mod colours;
mod forms;
mod hostile;
mod in_step;
mod layouts;
mod moving;
mod photos;
mod pictures;
mod programs;
mod resume;
pub mod sources;
mod stale;
mod tracking;
mod undistort;
mod videos;

use std::path::Path;
use std::sync::Mutex;

use ivv::internals::prepare::{PrepareSettings, Prepared, Triangulate, prepare};
use ivv::internals::scene::capture::{Capture, CaptureSettings, Frames};

use crate::capture::Folder;

/// Settings from a source to a new folder `out` in it, without programs of others.
fn settings(folder: &Folder) -> PrepareSettings {
    PrepareSettings {
        triangulate: Some(Triangulate::None),
        threads: 2,
        ..PrepareSettings::new(&folder.0.join("source"), &folder.0.join("out"))
    }
}

fn every(every: u32, from: u32) -> Frames {
    Frames { from, every, ..Frames::default() }
}

/// How a source is read whose image sequences have `fps` frames per second.
fn rate(fps: f64) -> CaptureSettings {
    CaptureSettings { fps, ..CaptureSettings::default() }
}

/// Prepares; returns also the pieces that were done now.
fn run(settings: &PrepareSettings) -> ivv::Result<(Prepared, Vec<String>)> {
    let pieces = Mutex::new(Vec::new());
    let prepared = prepare(settings, &|progress| {
        pieces.lock().unwrap().push(format!("{} {}", progress.stage, progress.piece));
    })?;
    Ok((prepared, pieces.into_inner().unwrap()))
}

fn done(settings: &PrepareSettings) -> Prepared {
    let (prepared, _) = run(settings).unwrap();
    assert_eq!(crate::capture::told(&prepared.report), "");
    prepared
}

fn open(settings: &PrepareSettings) -> Capture {
    done(settings);
    Capture::open(&settings.output).unwrap()
}

/// A video of 64 x 48 at 10 frames per second.
fn video(path: &Path, n_frames: u32) {
    encoded(path, &format!("testsrc=size=64x48:rate=10:duration={}", f64::from(n_frames) / 10.0), &[]);
}

/// The same with frames between others (B frames), few key frames and these options, at `rate` frames per second.
fn video_with(path: &Path, n_frames: u32, rate: &str, options: &[&str]) {
    let own = ["-frames:v", &n_frames.to_string(), "-g", "12", "-bf", "2"];
    encoded(path, &format!("testsrc=size=64x48:rate={rate}"), &[&own, options].concat());
}

fn encoded(path: &Path, source: &str, options: &[&str]) {
    coded::made(path, &format!("{source} {options:?}"), |path| {
        let own = ["-f", "lavfi", "-i", source, "-c:v", "mpeg4", "-q:v", "2"];
        coded::ffmpeg(&[&own[..], options, &[path.to_str().unwrap()]].concat());
    });
}
