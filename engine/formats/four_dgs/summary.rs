use super::FourDgs;
use serde::Serialize;

/// The contents of a file; 64-bit counts are text, as in the conformance suite of the format.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
    pub aggregate: Aggregate,
    pub audio_sources: Vec<AudioSource>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Aggregate {
    pub position_sum: [f64; 3],
    pub opacity_sum: f64,
    pub never_fades_count: String,
    pub zero_motion_count: String,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct AudioSource {
    pub source_id: String,
    pub name: String,
    pub codec: String,
    pub channel_layout: String,
    pub start_sec: f64,
    pub duration_sec: f64,
    pub gain: f64,
    pub spatial: bool,
    #[serde(rename = "loop")]
    pub is_loop: bool,
    pub position: [f64; 3],
    pub rotation: [f64; 4],
    pub interpolation: String,
    pub keyframe_count: String,
    pub byte_length: String,
}

impl FourDgs {
    pub fn summary(&self) -> FourDgsSummary {
        let scene = &self.scene;
        let set = &scene.gaussians;
        let sum =
            |values: &[f32], of: usize, k: usize| values.chunks_exact(of).map(|row| f64::from(row[k])).sum::<f64>();
        let count = |n: usize| n.to_string();
        FourDgsSummary {
            gaussian_count: count(set.count()),
            duration_sec: scene.duration_sec,
            sh_degree: scene.header.sh_degree,
            temporal_model: scene.header.temporal_model.clone(),
            cutoff: scene.header.cutoff,
            library: scene.header.library.clone(),
            chunk_intervals: scene.chunk_index.iter().map(|entry| [entry.t0, entry.t1]).collect(),
            aggregate: Aggregate {
                position_sum: std::array::from_fn(|k| sum(&set.positions, 3, k)),
                opacity_sum: sum(&set.colors, 4, 3),
                never_fades_count: count(set.sigma_t.iter().filter(|sigma| sigma.is_infinite()).count()),
                zero_motion_count: count(set.motions.chunks_exact(3).filter(|v| **v == [0.0; 3]).count()),
            },
            audio_sources: scene.audio_sources.iter().map(AudioSource::of).collect(),
        }
    }
}

impl AudioSource {
    fn of(source: &fourdgs::AudioSource) -> Self {
        AudioSource {
            source_id: source.source_id.to_string(),
            name: source.name.clone(),
            codec: source.codec.clone(),
            channel_layout: source.channel_layout.clone(),
            start_sec: source.start_sec,
            duration_sec: source.duration_sec,
            gain: source.gain,
            spatial: source.spatial,
            is_loop: source.loop_,
            position: source.position,
            rotation: source.rotation,
            interpolation: source.interpolation.clone(),
            keyframe_count: source.keyframes.len().to_string(),
            byte_length: source.data.len().to_string(),
        }
    }
}
