//! What the terms of the loss leave by workgroup, added up.

use crate::gpu::generated::loss_sum;
use crate::gpu::{Buf, Grid, Recording};

/// Most terms whose sums one pass adds up.
pub const MOST_TERMS: usize = 4;

/// Appends the addition of what each of `terms` left, [`MOST_TERMS`] at most: its four sums become one of `totals`.
pub fn record_totals(rec: &mut Recording, terms: &[Buf<[f32; 4]>], totals: &Buf<[f32; 4]>) {
    assert!(terms.len() <= MOST_TERMS.min(totals.len()), "{} terms", terms.len());
    let Some(first) = terms.first() else { return };
    let of = |term: usize| terms.get(term).unwrap_or(first);
    let n = |term: usize| terms.get(term).map_or(0, |sums| sums.len() as u32);
    let args = loss_sum::Args { sums0: of(0), sums1: of(1), sums2: of(2), sums3: of(3), loss: totals };
    let push = loss_sum::Push { n0: n(0), n1: n(1), n2: n(2), n3: n(3) };
    rec.pass(args, push, Grid::Groups(terms.len() as u32));
}
