//! The errors of depth and flow against priors (SPEC 4), both in one pass over the picture.

use super::term::{LEAST_PIXELS, Left, Logged, Pair, Part, Rendered, Shown, Term, TermData, TermKind};
use crate::error::Result;
use crate::gpu::{Gpu, Recording};
use crate::internals::train::Config;
use crate::scene::capture::Capture;
use crate::stage::{DepthSpace, Outputs, PriorLoss, PriorPicture, PriorWeights};

pub(super) const TERM: TermKind = TermKind {
    logged: LOGGED,
    buffers: |data| if data == TermData::NONE { &[] } else { BUFFERS },
    new: |gpu, config, data| {
        let loss = &config.loss;
        let on = |is_on: bool, weight: f64| if is_on { weight } else { 0.0 };
        let (depth, flow) = (on(data.depth, loss.depth), on(data.flow, loss.flow));
        if data == TermData::NONE {
            return Ok(None);
        }
        let scratch = PriorLoss::new(gpu, 1, loss.depth_space)?;
        Ok(Some(Box::new(Priors { scratch, depth, flow, space: loss.depth_space })))
    },
};

const BUFFERS: &[(&str, f64)] = &[("image depth flow", 16.0), ("d image depth flow", 16.0)];

const LOGGED: &[Logged] = &[
    Logged { key: "depth", plot: "Error of the depth against its priors", from_zero: true },
    Logged { key: "flow", plot: "End-point error of the flow, pixels", from_zero: true },
];

/// The priors that have a weight and that any training image has.
pub fn data(config: &Config, capture: &Capture) -> TermData {
    let shots = || capture.cameras.iter().filter(|camera| !camera.is_test).flat_map(|camera| &camera.shots);
    TermData {
        depth: config.loss.depth > 0.0 && shots().any(|shot| shot.depth.is_some()),
        flow: config.loss.flow > 0.0 && shots().any(|shot| shot.flow.is_some()),
    }
}

struct Priors {
    scratch: PriorLoss,
    /// Weights; 0 of what is off.
    depth: f64,
    flow: f64,
    space: DepthSpace,
}

impl Priors {
    fn weights(&self, shown: &Shown) -> Option<PriorWeights> {
        let used = |weight: f64, n: u32| if n >= LEAST_PIXELS { weight } else { 0.0 };
        let depth = used(self.depth, shown.n_depth);
        // The unit is a pixel of the full picture.
        let flow = f64::from(shown.reduction) * used(self.flow, shown.n_flow);
        let weights = PriorWeights { depth, flow, n_depth: shown.n_depth, n_flow: shown.n_flow };
        (depth > 0.0 || flow > 0.0).then_some(weights)
    }
}

impl Term for Priors {
    fn outputs(&self) -> Outputs {
        Outputs::All
    }

    fn fit(&mut self, gpu: &Gpu, pixels: usize) -> Result<()> {
        self.scratch = PriorLoss::new(gpu, pixels, self.space)?;
        Ok(())
    }

    fn record(&mut self, _: &Gpu, rec: &mut Recording, shown: &Shown, on: &Rendered) -> Result<Left> {
        let Some(Pair { image, cotangent: d_image }) = on.geometry else { return Ok(None) };
        let n = shown.size[0] * shown.size[1];
        let Some(weights) = self.weights(shown) else {
            // Or values of an earlier step would count.
            rec.fill(d_image.range(0, n as usize).slice(), 0);
            return Ok(None);
        };
        let picture = PriorPicture { image, d_image, truth: on.truth, n_pixels: n };
        Ok(Some(self.scratch.record(rec, picture, on.priors, &weights)))
    }

    fn parts(&self, shown: &Shown, sums: [f32; 4]) -> Vec<Part> {
        let Some(weights) = self.weights(shown) else { return Vec::new() };
        let [depth, flow] = PriorLoss::values(sums, &weights);
        let depth = Part::error("depth", depth, weights.depth);
        let flow = Part { key: "flow", value: flow * f64::from(shown.reduction), error: flow, weight: weights.flow };
        [depth, flow].into_iter().filter(|part| part.weight > 0.0).collect()
    }
}
