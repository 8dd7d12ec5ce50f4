use super::SOUND;
use super::ears::{EARS, Ears};
use fourdgs::{Attachment, AudioSource, AudioSourceKeyframe, Metadata, SceneExtras};
use std::collections::BTreeMap;

/// The least distance of a file that has a microphone and does not say it.
const R_MIN: f64 = 0.2;

/// A source of sound, to be stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Sound {
    /// Its name.
    pub name: String,
    /// A WAV file of one channel.
    pub wav: Vec<u8>,
    /// Factor of its samples, for sound that is louder than the samples of a WAV file can be.
    pub gain: f64,
    /// When it begins, and how long it is; seconds of the clip.
    pub start: f64,
    /// See `start`; positive.
    pub seconds: f64,
    /// (Seconds of the clip, increasing; position in the scene's frame.) The source moves along lines between them, and rests
    /// outside.
    pub places: Vec<(f64, [f64; 3])>,
}

/// The sources of sound of a clip, how loud they are from where, and the ears that hear them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sounds {
    sources: Vec<AudioSource>,
    law: BTreeMap<String, String>,
    ears: Option<Ears>,
}

impl Sounds {
    /// Sources recorded at `mic`, in the scene's frame. A listener at the distance r hears them with the factor `max(r_m,
    /// r_min) / max(r, r_min)`, where r_m is their distance from `mic`, in units of the scene.
    pub fn new(mic: [f64; 3], r_min: f64, sounds: Vec<Sound>) -> Self {
        let mic = mic.map(|x| x.to_string()).join(" ");
        let law = [("mic", mic), ("r_min", r_min.to_string())].map(|(name, value)| (name.to_owned(), value)).into();
        let source = |(id, sound): (usize, Sound)| {
            let key = |(time, position)| AudioSourceKeyframe { time, position, rotation: [0.0, 0.0, 0.0, 1.0] };
            AudioSource {
                source_id: id as u32,
                name: sound.name,
                codec: "wav".to_owned(),
                start_sec: sound.start,
                duration_sec: sound.seconds,
                gain: sound.gain,
                position: sound.places.first().map_or([0.0; 3], |(_, place)| *place),
                keyframes: sound.places.into_iter().map(key).collect(),
                data: sound.wav,
                ..AudioSource::default()
            }
        };
        Sounds { sources: sounds.into_iter().enumerate().map(source).collect(), law, ears: None }
    }

    /// With the ears of a player, which has its own where there are none.
    pub fn heard_with(self, ears: Option<Ears>) -> Self {
        Sounds { ears, ..self }
    }

    pub(super) fn of(scene: &fourdgs::Scene, ears: Option<Ears>) -> Self {
        let law = scene.metadata.iter().find(|record| record.name == SOUND);
        Sounds {
            sources: scene.audio_sources.clone(),
            law: law.map(|record| record.entries.clone()).unwrap_or_default(),
            ears,
        }
    }

    pub(super) fn put_into(&self, extras: &mut SceneExtras) {
        extras.audio_sources.clone_from(&self.sources);
        if !self.law.is_empty() {
            extras.metadata.push(Metadata { name: SOUND.to_owned(), entries: self.law.clone() });
        }
        if let Some(ears) = &self.ears {
            let media_type = "application/octet-stream".to_owned();
            extras.attachments.push(Attachment { name: EARS.to_owned(), media_type, data: ears.bytes() });
        }
    }

    /// Number of sources.
    pub fn len(&self) -> usize {
        self.sources.len()
    }

    /// True without a source.
    pub fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// The ears of the player.
    pub fn ears(&self) -> Option<&Ears> {
        self.ears.as_ref()
    }

    #[doc(hidden)]
    pub fn sources(&self) -> &[AudioSource] {
        &self.sources
    }

    /// `mic` and `r_min` of [`Sounds::new`]. Without `mic`, a source is as loud as its payload at the distance 1 and below.
    #[doc(hidden)]
    pub fn law(&self) -> (Option<[f64; 3]>, f64) {
        let numbers = |name: &str| -> Vec<f64> {
            let text = self.law.get(name).map_or("", String::as_str);
            text.split_whitespace().filter_map(|word| word.parse().ok()).filter(|x: &f64| x.is_finite()).collect()
        };
        let r_min = numbers("r_min").first().copied().filter(|r| *r > 0.0);
        (numbers("mic").try_into().ok(), r_min.unwrap_or(R_MIN))
    }

    #[doc(hidden)]
    pub fn n_bytes(&self) -> usize {
        self.sources.iter().map(|source| source.data.len()).sum()
    }
}
