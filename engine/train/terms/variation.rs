//! The total variation of the camera's bilateral grid (SPEC 7). Its gradient is part of the grid's own step.

use super::term::{Logged, Part, Rendered, Shown, Term, TermKind};
use crate::error::Result;
use crate::gpu::{Gpu, Recording, Slice};
use crate::stage::Grids;
use crate::train::config::Config;

pub(super) const TERM: TermKind = TermKind {
    logged: &[Logged { key: "grid_variation", plot: "", from_zero: true }],
    new: |_, config, _| Ok(Some(Box::new(Variation { weight: weight(config) }))),
    ..TermKind::NONE
};

/// The weight, which the grids' step takes for its gradient.
pub fn weight(config: &Config) -> f64 {
    config.loss.grid_variation
}

struct Variation {
    weight: f64,
}

impl Term for Variation {
    fn record(&mut self, _: &Gpu, _: &mut Recording, _: &Shown, _: &Rendered) -> Result<()> {
        Ok(())
    }

    fn sums(&self, shown: &Shown, grids: Option<&Grids>) -> Option<Slice> {
        grids.filter(|_| shown.has_grid).map(|grids| grids.tv.slice())
    }

    fn parts(&self, _: &Shown, sums: &[f32]) -> Vec<Part> {
        let variation = sums.first().map(|value| f64::from(*value));
        variation.map(|variation| Part::error("grid_variation", variation, self.weight)).into_iter().collect()
    }
}
