//! `.4dgs`: Gaussians on a clock, in chunks that a player fetches as it needs them, with cameras and sound (version 1 of the
//! format's draft, by the crate `fourdgs`).
//!
//! Its model `gaussian-birth` is ours (SPEC 2) in seconds: the centre is `p + v (t - mu)`, the opacity is multiplied by
//! `exp(-((t - mu) / sigma)^2 / 2)`, so sigma = tau / sqrt 2. What a Gaussian is at times when that factor is below the
//! file's cutoff is not told: we write 1/255, below which no alpha reaches a pixel.

mod decode;
mod ears;
mod encode;
mod grades;
mod harmonics;
mod sounds;
mod summary;
mod world;

pub use decode::FourDgs;
pub use ears::Ears;
pub use encode::{Contents, Encoded};
pub use grades::Grades;
pub use sounds::{Sound, Sounds};
pub use summary::FourDgsSummary;
pub use world::World;

use std::collections::BTreeMap;

/// First bytes of a file, without the number of its version.
pub(super) const MAGIC: [u8; 4] = [0x89, b'4', b'D', b'G'];
/// Name of the metadata record that holds what is this project's own.
const RECORD: &str = "ivv";
/// Name of the metadata record that says how loud sources of sound are from where.
const SOUND: &str = "ivv.sound";
/// Name of the attachment that holds views to start from, a cameras file.
const VIEWS: &str = "views.json";
/// Frames per second of a file that does not say.
const FPS: f64 = 30.0;

/// The clock of a clip: normalised time 0 to 1 is 0 to `frames / fps` seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Frames per second, positive.
    pub fps: f64,
    /// Frames of the clip, at least 1.
    pub frames: u32,
}

impl Clock {
    /// Length of the clip, seconds.
    pub fn seconds(self) -> f64 {
        f64::from(self.frames) / self.fps
    }

    /// What a file of `seconds` says, or else what frames it would have at the usual rate.
    fn of_file(own: Option<&BTreeMap<String, String>>, seconds: f64) -> Clock {
        let said = own.and_then(|own| {
            let clock = Clock { fps: own.get("fps")?.parse().ok()?, frames: own.get("frames")?.parse().ok()? };
            ((clock.seconds() - seconds).abs() <= 1e-6 * seconds).then_some(clock)
        });
        said.unwrap_or_else(|| {
            let frames = (seconds * FPS).round().clamp(1.0, f64::from(u32::MAX));
            Clock { fps: frames / seconds, frames: frames as u32 }
        })
    }
}
