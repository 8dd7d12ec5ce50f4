//! `.4dgs`: Gaussians on a clock, in chunks that a player fetches as it needs them, with cameras and sound (version 1 of the
//! format's draft, by the crate `fourdgs`).
//!
//! Its model `gaussian-birth` is ours (SPEC 2) in seconds: the centre is `p + v (t - mu)`, the opacity is multiplied by
//! `exp(-((t - mu) / sigma)^2 / 2)`, so sigma = tau / sqrt 2. What a Gaussian is at times when that factor is below the
//! file's cutoff is not told: we write 1/255, below which no alpha reaches a pixel, or that of the
//! file that the Gaussians are from.

mod decode;
mod ears;
mod encode;
mod export;
mod grades;
mod harmonics;
mod parts;
mod sounds;
mod summary;
mod world;
mod write;

pub use decode::FourDgs;
pub(super) use decode::READER;
pub use ears::Ears;
pub use encode::{Contents, Encoded};
pub(super) use export::WRITER;
pub use grades::Grades;
pub use parts::FourDgsParts;
pub use sounds::{Sound, Sounds};
pub use world::World;

const MAGIC: [u8; 4] = [0x89, b'4', b'D', b'G'];
/// Metadata record of this project's own values.
const RECORD: &str = "ivv";
/// Metadata record of the law of loudness.
const SOUND: &str = "ivv.sound";
/// Attachment with the views to start from.
const VIEWS: &str = "views.json";
