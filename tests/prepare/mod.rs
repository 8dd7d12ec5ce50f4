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

use crate::common::prelude::*;
use ivv::internals::prepare::{Prepared, prepare};
use std::os::unix::fs::PermissionsExt;

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

/// Puts a program of this name into `bin/` of the folder.
fn program(folder: &Folder, name: &str, script: &str) {
    let program = folder.write(&format!("bin/{name}"), script);
    std::fs::set_permissions(&program, PermissionsExt::from_mode(0o755)).unwrap();
}

/// A stand-in for COLMAP: its mapper finds `model/`, and it deletes images by taking the model of that name.
const COLMAP: &str = r#"#!/bin/sh
here=$(dirname "$0")/..
echo "$@" >>"$here/calls"
verb=$1
while [ $# -gt 0 ]; do case $1 in
--output_path) out=$2 ;;
--image_list_path) list=$2 ;;
--image_names_path) names=$2 ;;
esac; shift; done
case $verb in
feature_extractor) [ -z "$list" ] || cat "$list" >>"$here/listed" ;;
mapper) mkdir -p "$out/0"; cp "$here"/model/* "$out/0" ;;
image_deleter) cat "$names" >>"$here/deleted"; cp "$here/$(basename "$out")"/* "$out" ;;
esac
"#;

/// `ivv` with the programs in `bin/` of the folder before others.
fn ivv_in(folder: &Folder) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
    let path = format!("{}:{}", folder.0.join("bin").display(), std::env::var("PATH").unwrap());
    command.env("PATH", path);
    command
}

/// `ivv prepare` of `source/` to `out/` as [`ivv_in`].
fn ivv_prepare(folder: &Folder, options: &[&str]) -> Output {
    let mut command = ivv_in(folder);
    command.arg("prepare").arg(folder.0.join("source")).arg("-o").arg(folder.0.join("out"));
    command.args(options).output().unwrap()
}

/// The calls that the programs in `bin/` noted.
fn calls(folder: &Folder) -> String {
    std::fs::read_to_string(folder.0.join("calls")).unwrap()
}
