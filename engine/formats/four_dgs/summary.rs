//! The contents of a `.4dgs` for people, with the names of the format's conformance suite.

use super::FourDgs;
use serde::Serialize;

/// The contents of a file; 64-bit counts are text, as in the conformance suite of the format.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct FourDgsSummary {
    /// Gaussians.
    pub gaussian_count: String,
    /// Length of the clip, seconds.
    pub duration_sec: f64,
    /// Degree of the spherical harmonics.
    pub sh_degree: u8,
    /// Name of the temporal model.
    pub temporal_model: String,
    /// Temporal factor below which a Gaussian is not visible.
    pub cutoff: f64,
    /// The program that wrote the file.
    pub library: String,
    /// From when to when each chunk is needed, seconds, in the order of the index; none where the file has no index.
    pub chunk_intervals: Vec<[f64; 2]>,
    /// Sums over all Gaussians.
    pub aggregate: Aggregate,
    /// Sources of sound.
    pub audio_sources: Vec<AudioSource>,
}

/// Sums over all Gaussians.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Aggregate {
    /// Of the positions.
    pub position_sum: [f64; 3],
    /// Of the base opacities.
    pub opacity_sum: f64,
    /// Gaussians that never fade.
    pub never_fades_count: String,
    /// Static Gaussians.
    pub zero_motion_count: String,
}

/// A source of sound.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct AudioSource {
    /// Its number.
    pub source_id: String,
    /// Its name.
    pub name: String,
    /// How the sound is coded.
    pub codec: String,
    /// Channels.
    pub channel_layout: String,
    /// When it begins, seconds.
    pub start_sec: f64,
    /// Its length, seconds.
    pub duration_sec: f64,
    /// Factor of its level.
    pub gain: f64,
    /// True if it is heard from a place.
    pub spatial: bool,
    /// True if it begins again at its end.
    #[serde(rename = "loop")]
    pub is_loop: bool,
    /// Its place, where it does not move.
    pub position: [f64; 3],
    /// Quaternion (x, y, z, w).
    pub rotation: [f64; 4],
    /// How places between keyframes are found.
    pub interpolation: String,
    /// Places that it moves through.
    pub keyframe_count: String,
    /// Bytes of its coded sound.
    pub byte_length: String,
}

impl FourDgs {
    /// The contents of the file.
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
