//! Options of a session.

use super::notice::Watch;
use super::priors::Priors;
use crate::internals::train::plan::ImageMemory;
use crate::internals::train::ranks::Ranks;
use crate::scene::capture::share_of_memory;
use crate::scene::{Similarity, Splats};
use crate::settings::Constants;
use std::sync::Arc;

/// Options of a session that are no settings of the run.
pub struct SessionOptions<'a> {
    /// Rendering constants, the near plane in the frame of training.
    pub constants: Constants,
    /// Steps; none for the settings' number.
    pub total: Option<u64>,
    /// From the capture's world to the frame of training; none for
    /// [`Capture::normalisation`](crate::scene::capture::Capture::normalisation).
    pub world: Option<Similarity>,
    /// The first Gaussians, in the capture's world; none to make them of the capture.
    pub first: Option<Splats>,
    /// The priors, as another session of the same capture read them.
    pub priors: Option<Priors>,
    /// Bytes of images that are decoded ahead; no more are taken than all training images need. By default a quarter of
    /// the machine's memory.
    pub cache_bytes: u64,
    /// Bytes of images that stay in the device's memory; none for the plan's number. Steps on them neither decode nor
    /// copy anything, and have the same bits.
    pub device_image_bytes: Option<u64>,
    /// Images whose order is known ahead, at most, some 100 bytes each. Does not change the bits.
    pub listed_images: u64,
    /// The other processes, if several share the images of each step: the run has the same bits for any number of them
    /// that divides `batch`. All begin with the same capture and settings.
    pub ranks: Option<Arc<dyn Ranks>>,
    /// Receives the notices.
    pub watch: Watch<'a>,
}

impl Default for SessionOptions<'_> {
    fn default() -> Self {
        SessionOptions {
            constants: Constants::default(),
            total: None,
            world: None,
            first: None,
            priors: None,
            cache_bytes: share_of_memory(),
            device_image_bytes: None,
            listed_images: 1 << 18,
            ranks: None,
            watch: Box::new(|_| ()),
        }
    }
}

impl SessionOptions<'_> {
    pub(super) fn image_memory(&self) -> ImageMemory {
        ImageMemory { cache_bytes: self.cache_bytes, device_bytes: self.device_image_bytes }
    }
}
