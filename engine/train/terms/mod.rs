//! The terms of the loss: a file for each, and [`TERMS`], which lists them. A new term is its file, a line in [`TERMS`]
//! and its weight in [`crate::internals::train::Loss`].

mod lpips;
mod photometric;
mod priors;
mod term;
mod variation;

use crate::error::Result;
use crate::gpu::Gpu;
use crate::internals::train::Config;
use term::TermKind;

pub(super) use priors::data;
pub(super) use term::{Left, Pair, Part, Rendered, Shown, Term};
pub use term::{Logged, TermData};
pub(super) use variation::WEIGHT as GRID_VARIATION_WEIGHT;

/// In the order in which they are recorded and added up: the first sets the cotangent of the colours.
const TERMS: &[TermKind] = &[photometric::TERM, priors::TERM, lpips::TERM, variation::TERM];

/// Logged numbers, in the order of the report's plots.
pub fn logged() -> impl Iterator<Item = &'static Logged> {
    TERMS.iter().flat_map(|term| term.logged)
}

/// Buffers of all terms that use `data`: name, bytes per pixel.
pub(super) fn buffers(data: TermData) -> impl Iterator<Item = (&'static str, f64)> {
    TERMS.iter().flat_map(move |term| (term.buffers)(data)).copied()
}

pub(super) fn begin(gpu: &Gpu, config: &Config, data: TermData) -> Result<Vec<Box<dyn Term>>> {
    TERMS.iter().filter_map(|term| (term.new)(gpu, config, data).transpose()).collect()
}
