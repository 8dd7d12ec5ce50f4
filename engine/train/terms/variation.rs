//! The total variation of the camera's bilateral grid (SPEC 7). Its gradient is part of the grid's own step.

use super::term::{Left, Logged, Part, Rendered, Shown, Term, TermKind};
use crate::error::Result;
use crate::gpu::{Gpu, Recording};

pub(super) const TERM: TermKind = TermKind {
    logged: &[Logged { key: "grid_variation", plot: "", from_zero: true }],
    new: |_, _, _| Ok(Some(Box::new(Variation))),
    ..TermKind::NONE
};

/// That of the authors of bilateral grids, which the grids' step takes for its gradient. A hundred times as much gained
/// 0.5 dB with `grids=bilateral` on small pictures (`assets/lab/measured.md`); `grids=affine` needs none.
pub const WEIGHT: f64 = 10.0;

struct Variation;

impl Term for Variation {
    fn record(&mut self, _: &Gpu, _: &mut Recording, _: &Shown, on: &Rendered) -> Result<Left> {
        Ok(on.grid_variation.cloned())
    }

    fn parts(&self, _: &Shown, [variation, ..]: [f32; 4]) -> Vec<Part> {
        vec![Part::error("grid_variation", f64::from(variation), WEIGHT)]
    }
}
