//! Options of a session, and the priors that it reads from its capture.

use super::notice::{Notice, Phase, Watch, work};
use crate::error::Result;
use crate::internals::train::{Config, DepthSummary, Ranks, Setup, TermData, fit_depths};
use crate::parallel::threads;
use crate::scene::capture::{Capture, PriorPlan, share_of_memory};
use crate::scene::{Similarity, Splats};
use crate::settings::Constants;
use std::sync::Arc;

/// Options of a session that are no settings of the run.
pub struct SessionOptions<'a> {
    /// Rendering constants, the near plane in the frame of training.
    pub constants: Constants,
    /// Steps; none for the settings' number.
    pub total: Option<u64>,
    /// From the capture's world to the frame of training; none for [`crate::Capture::normalisation`].
    pub world: Option<Similarity>,
    /// The first Gaussians, in the capture's world; none to make them of the capture.
    pub first: Option<Splats>,
    /// The priors, as another session of the same capture read them.
    pub priors: Option<Priors>,
    /// Bytes of images that are decoded ahead, at most. By default a quarter of the machine's memory.
    pub cache_bytes: u64,
    /// Bytes of images that stay in the device's memory; none for the plan's number. Does not change the bits.
    pub device_image_bytes: Option<u64>,
    /// Images whose order is known ahead, at most, some 100 bytes each. Does not change the bits.
    pub listed_images: u64,
    /// The other processes, if several share the images of each step: any number that divides `batch` gives the same
    /// bits. All begin with the same capture and settings.
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

/// Priors of depth and flow of the training images.
#[derive(Clone, Debug, Default)]
pub struct Priors {
    /// The priors in use, and the scales of depths.
    pub plan: PriorPlan,
    /// The fits of the depths; none if no depth is used.
    pub depth: Option<DepthSummary>,
}

impl Priors {
    /// Those that the terms of the loss use.
    pub(super) fn read(capture: &Capture, config: &Config, setup: &Setup, watch: &mut Watch) -> Result<Self> {
        let TermData { depth, flow } = setup.data;
        if !depth {
            return Ok(Priors { plan: PriorPlan { flow, ..PriorPlan::default() }, depth: None });
        }
        let space = config.loss.depth_space;
        let fits = fit_depths(capture, space, threads(), &mut work(watch, Phase::DepthPriors))?;
        let usable = fits.iter().filter_map(|(image, fit)| Some((image, fit.ok()?)));
        let depth = usable.map(|(image, fit)| (image, [fit.scale, fit.shift])).collect();
        let summary = fits.summary();
        watch(Notice::DepthPriors(&summary));
        Ok(Priors { plan: PriorPlan { flow, depth }, depth: Some(summary) })
    }
}
