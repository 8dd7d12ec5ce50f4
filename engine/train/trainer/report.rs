//! The report of a step.

use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::generated::Status;
use crate::internals::train::objective::{Objective, Report, Truth};
use crate::stage::Counts;
use std::collections::BTreeMap;

#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ImageReport {
    pub loss: f64,
    pub terms: BTreeMap<&'static str, f64>,
    pub active: u32,
    pub visible: u32,
    pub intersections: u32,
    /// Since the start, in this process.
    pub bad_gradients: u32,
}

impl ImageReport {
    pub fn new(gpu: &Gpu, objective: &Objective, truth: &Truth, report: &Report) -> Result<Self> {
        let (loss, terms) = objective.values(gpu, truth, report)?;
        let status: Status = gpu.peek(&report.status.slice())?.first().copied().unwrap_or_default();
        Ok(ImageReport {
            loss,
            terms,
            active: status.n_active,
            visible: status.n_visible,
            intersections: status.n_intersections,
            bad_gradients: gpu.peek(&report.n_bad.slice())?.first().copied().unwrap_or(0),
        })
    }
}

/// Means over the images of a step.
#[derive(Clone, Debug, serde::Serialize)]
pub struct StepReport {
    /// Number of the step, from 1.
    pub step: u64,
    /// Value of the loss.
    pub loss: f64,
    /// The numbers that the terms log, by key.
    #[serde(flatten)]
    pub terms: BTreeMap<&'static str, f64>,
    /// Gaussians.
    pub gaussians: u32,
    /// Gaussians in the view's time and frustum.
    pub active: u32,
    /// Gaussians that touch the picture.
    pub visible: u32,
    /// Pairs of a Gaussian and a tile.
    pub intersections: u32,
    /// Gradients that were not finite and changed nothing, since the start.
    pub bad_gradients: u32,
    /// Counts of the density control after the step.
    pub density: Option<Counts>,
}

impl StepReport {
    /// The report of a step of `images`, of which each process had `own`.
    pub(super) fn new(step: u64, gaussians: u32, images: &[ImageReport], own: usize) -> Self {
        let n = images.len().max(1);
        let mut terms: BTreeMap<&'static str, (f64, u32)> = BTreeMap::new();
        for (key, value) in images.iter().flat_map(|image| &image.terms) {
            let (sum, count) = terms.entry(key).or_default();
            (*sum, *count) = (*sum + value, *count + 1);
        }
        let mean = |of: fn(&ImageReport) -> u32| {
            (images.iter().map(|image| u64::from(of(image))).sum::<u64>() / n as u64) as u32
        };
        StepReport {
            step,
            loss: images.iter().map(|image| image.loss).sum::<f64>() / n as f64,
            terms: terms.into_iter().map(|(key, (sum, count))| (key, sum / f64::from(count))).collect(),
            gaussians,
            active: mean(|image| image.active),
            visible: mean(|image| image.visible),
            intersections: mean(|image| image.intersections),
            bad_gradients: images.chunks(own.max(1)).filter_map(<[_]>::last).map(|image| image.bad_gradients).sum(),
            density: None,
        }
    }

    /// A number that a term logs, if the step has it.
    pub fn term(&self, key: &str) -> Option<f64> {
        self.terms.get(key).copied()
    }
}
