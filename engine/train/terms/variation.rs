//! The total variation of the camera's bilateral grid (SPEC 7). Its gradient is part of the grid's own step.

use super::term::{Left, Logged, Part, Rendered, Shown, Term, TermKind};
use crate::error::Result;
use crate::gpu::{Gpu, Recording};
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
    fn record(&mut self, _: &Gpu, _: &mut Recording, _: &Shown, on: &Rendered) -> Result<Left> {
        Ok(on.grid_variation.cloned())
    }

    fn parts(&self, _: &Shown, [variation, ..]: [f32; 4]) -> Vec<Part> {
        vec![Part::error("grid_variation", f64::from(variation), self.weight)]
    }
}
