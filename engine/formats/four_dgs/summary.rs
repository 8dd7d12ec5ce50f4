//! The contents of a `.4dgs` for people, with the names and forms (64-bit counts are text) of the format's conformance suite.

use super::FourDgs;
use serde_json::{Value, json};

#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub struct FourDgsSummary {
    pub gaussian_count: String,
    pub duration_sec: f64,
    pub sh_degree: u8,
    pub temporal_model: String,
    pub cutoff: f64,
    pub library: String,
    /// Seconds, in the order of the index.
    pub chunk_intervals: Vec<[f64; 2]>,
    /// Sums over all Gaussians.
    pub aggregate: Value,
    pub audio_sources: Vec<Value>,
}

impl FourDgs {
    pub fn summary(&self) -> FourDgsSummary {
        let scene = &self.scene;
        let set = &scene.gaussians;
        let sum =
            |values: &[f32], of: usize, k: usize| -> f64 { values.chunks_exact(of).map(|row| f64::from(row[k])).sum() };
        let n_lasting = set.sigma_t.iter().filter(|sigma| sigma.is_infinite()).count();
        let n_resting = set.motions.chunks_exact(3).filter(|v| **v == [0.0; 3]).count();
        FourDgsSummary {
            gaussian_count: set.count().to_string(),
            duration_sec: scene.duration_sec,
            sh_degree: scene.header.sh_degree,
            temporal_model: scene.header.temporal_model.clone(),
            cutoff: scene.header.cutoff,
            library: scene.header.library.clone(),
            chunk_intervals: scene.chunk_index.iter().map(|entry| [entry.t0, entry.t1]).collect(),
            aggregate: json!({
                "positionSum": std::array::from_fn::<f64, 3, _>(|k| sum(&set.positions, 3, k)),
                "opacitySum": sum(&set.colors, 4, 3),
                "neverFadesCount": n_lasting.to_string(),
                "zeroMotionCount": n_resting.to_string(),
            }),
            audio_sources: scene.audio_sources.iter().map(audio_source).collect(),
        }
    }
}

fn audio_source(source: &fourdgs::AudioSource) -> Value {
    json!({
        "sourceId": source.source_id.to_string(),
        "name": source.name,
        "codec": source.codec,
        "channelLayout": source.channel_layout,
        "startSec": source.start_sec,
        "durationSec": source.duration_sec,
        "gain": source.gain,
        "spatial": source.spatial,
        "loop": source.loop_,
        "position": source.position,
        "rotation": source.rotation,
        "interpolation": source.interpolation,
        "keyframeCount": source.keyframes.len().to_string(),
        "byteLength": source.data.len().to_string(),
    })
}
