//! What one step tells of itself.

use crate::stage::Counts;
use std::collections::BTreeMap;

/// What one step did.
#[derive(Clone, Debug, serde::Serialize)]
pub struct StepReport {
    /// Number of the step, from 1.
    pub step: u64,
    /// Value of the loss.
    pub loss: f64,
    /// What the terms log, by key: those of [`crate::train::logged`] that the step has.
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
    /// The round of density control after the step, if there was one.
    pub density: Option<Counts>,
}

impl StepReport {
    /// A number that a term logs, where the step has it.
    pub fn term(&self, key: &str) -> Option<f64> {
        self.terms.get(key).copied()
    }
}
