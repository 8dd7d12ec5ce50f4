//! Priors of depth and flow, as a session reads them from its capture.

use super::notice::{Notice, Phase, Watch, work};
use crate::error::Result;
use crate::internals::train::config::Config;
use crate::internals::train::depth::{DepthSummary, fit_depths};
use crate::internals::train::setup::Setup;
use crate::internals::train::terms::TermData;
use crate::parallel::threads;
use crate::scene::capture::{Capture, PriorPlan};

/// Priors of depth and flow of the training images.
#[derive(Clone, Debug, Default)]
pub struct Priors {
    /// The priors in use, and the scales of depths.
    pub plan: PriorPlan,
    /// The fits of the depths; none if no depth is used.
    pub depth: Option<DepthSummary>,
}

impl Priors {
    /// Reads the priors of `capture` that the terms of the loss use.
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
