//! `scene.json`: a recording, where its microphone and the sources were, and how long a scene unit is.
//!
//! ```json
//! {"version": 1, "metres_per_unit": 1.0, "up": [0, -1, 0],
//!  "mic": {"camera": "cam20", "wav": "cam20.wav", "channel": "left", "offset_s": 0.0,
//!          "poses": [{"t": 0.0, "p": [0, 0, 0], "forward": [0, 0, 1]}]},
//!  "sources": [{"id": "p0", "track": "p0.csv", "gain_db": 0.0, "gates": [[0, 12.5]]}]}
//! ```
//! Paths are relative to the file. A microphone with several poses moves. `forward` of its first pose is the y axis of the
//! sound plane. `offset_s` is the time of the recording's first sample, the camera's learnt offset included. A source
//! may have a `wav` of its own, as the microphone would have recorded it alone; otherwise it is heard in the
//! microphone's recording. `gates` are the seconds in which a source is heard; without any it always is.

use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::pose::{HeadPose, PoseTrack};
use super::source_track::SourceTrack;
use super::wav::Channel;
use crate::error::{Error, Result};
use crate::files::{read_json, write_atomic};

const VERSION: u32 = 1;
const REMEDY: &str = "see engine/sound/README.md for what a scene holds";

/// A recording and the places of who is in it.
#[derive(Clone, Debug)]
pub struct SoundScene {
    /// Length of a scene unit; `None` where the capture has no metric scale.
    pub metres_per_unit: Option<f64>,
    /// Up, world.
    pub up: DVec3,
    /// The microphone.
    pub mic: Mic,
    /// Who is heard; at least one.
    pub sources: Vec<Source>,
}

#[derive(Clone, Debug)]
pub struct Mic {
    pub camera: String,
    /// Where it was, looking as its camera looked.
    pub pose: PoseTrack,
    pub wav: PathBuf,
    pub channel: Channel,
    /// Time of the recording's first sample, seconds.
    pub offset_s: f64,
}

#[derive(Clone, Debug)]
pub struct Source {
    pub track: SourceTrack,
    /// The microphone's recording of it alone, where there is one.
    pub wav: Option<PathBuf>,
    /// Added to its level, decibels.
    pub gain_db: f64,
    /// Seconds in which it is heard; empty for always.
    pub gates: Vec<(f64, f64)>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    version: u32,
    #[serde(default)]
    metres_per_unit: Option<f64>,
    up: [f64; 3],
    mic: MicFile,
    sources: Vec<SourceFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MicFile {
    camera: String,
    wav: PathBuf,
    #[serde(default)]
    channel: Channel,
    #[serde(default)]
    offset_s: f64,
    poses: Vec<PoseFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseFile {
    t: f64,
    p: [f64; 3],
    forward: [f64; 3],
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SourceFile {
    id: String,
    track: PathBuf,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    wav: Option<PathBuf>,
    #[serde(default)]
    gain_db: f64,
    #[serde(default)]
    gates: Vec<(f64, f64)>,
}

impl SoundScene {
    /// Reads a scene and the tracks that it names.
    ///
    /// # Errors
    /// [`Error::Data`] naming the file and the entry that cannot be read.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let fault = |place: &str, reason: String| Error::data(path, place, reason, REMEDY);
        let file: SceneFile = read_json(path, "sound scene", REMEDY)?;
        if file.version != VERSION {
            return Err(fault("version", format!("it is {}, not {VERSION}", file.version)));
        }
        let up = DVec3::from(file.up);
        if !(up.is_finite() && up.length() > 1e-9) {
            return Err(fault("up", "it is no direction".into()));
        }
        if file.metres_per_unit.is_some_and(|metres| !(metres.is_finite() && metres > 0.0)) {
            return Err(fault("metres_per_unit", "it is not positive".into()));
        }
        if !file.mic.offset_s.is_finite() || file.mic.offset_s.abs() > 3600.0 {
            return Err(fault("mic.offset_s", "it is not within an hour of 0".into()));
        }
        if file.sources.is_empty() {
            return Err(fault("sources", "there is none".into()));
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        let pose =
            |pose: PoseFile| HeadPose { t: pose.t, p: pose.p.into(), q: HeadPose::looking(pose.forward.into(), up) };
        let mut sources = Vec::new();
        for source in file.sources {
            let is_gate = |(from, to): &(f64, f64)| from.is_finite() && to.is_finite() && from < to;
            if !(source.gates.iter().all(is_gate) && source.gain_db.is_finite()) {
                let reason = "a gate ends before it begins, or a gain is no number";
                return Err(fault(&format!("source {}", source.id), reason.into()));
            }
            let track = SourceTrack { id: source.id, ..SourceTrack::read_csv(&folder.join(source.track))? };
            let wav = source.wav.map(|wav| folder.join(wav));
            sources.push(Source { track, wav, gain_db: source.gain_db, gates: source.gates });
        }
        Ok(SoundScene {
            metres_per_unit: file.metres_per_unit,
            up,
            mic: Mic {
                camera: file.mic.camera,
                pose: PoseTrack::new(file.mic.poses.into_iter().map(pose).collect())
                    .map_err(|e| fault("mic.poses", e.to_string()))?,
                wav: folder.join(file.mic.wav),
                channel: file.mic.channel,
                offset_s: file.mic.offset_s,
            },
            sources,
        })
    }

    /// Writes the scene, and beside it each source's track as `<id>.csv`. Paths of recordings below the folder are relative, others whole.
    ///
    /// # Errors
    /// [`Error::Data`] naming the file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let relative = |wav: &Path| match wav.strip_prefix(folder) {
            Ok(below) => below.to_owned(),
            Err(_) => std::path::absolute(wav).unwrap_or_else(|_| wav.to_owned()),
        };
        let pose = |pose: &HeadPose| PoseFile { t: pose.t, p: pose.p.into(), forward: pose.forward().into() };
        let mut sources = Vec::new();
        for source in &self.sources {
            let track = PathBuf::from(format!("{}.csv", source.track.id));
            source.track.write_csv(&folder.join(&track))?;
            sources.push(SourceFile {
                id: source.track.id.clone(),
                track,
                wav: source.wav.as_deref().map(relative),
                gain_db: source.gain_db,
                gates: source.gates.clone(),
            });
        }
        let file = SceneFile {
            version: VERSION,
            metres_per_unit: self.metres_per_unit,
            up: self.up.into(),
            mic: MicFile {
                camera: self.mic.camera.clone(),
                wav: relative(&self.mic.wav),
                channel: self.mic.channel,
                offset_s: self.mic.offset_s,
                poses: self.mic.pose.poses().iter().map(pose).collect(),
            },
            sources,
        };
        write_atomic(path, |to| {
            serde_json::to_writer_pretty(&mut *to, &file)?;
            to.write_all(b"\n")
        })
    }
}
