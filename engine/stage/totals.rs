//! Sums of the terms of the loss, which leave them by workgroup.

use crate::gpu::generated::{Status, loss_sum, loss_sum_report};
use crate::gpu::{Buf, Grid, Recording};

/// Most terms whose sums one pass adds up.
pub const MOST_TERMS: usize = 4;

/// Where a step leaves its numbers.
pub struct Report<'a> {
    /// Four sums for each of [`MOST_TERMS`] terms.
    pub totals: &'a Buf<[f32; 4]>,
    /// The frame's report.
    pub status: &'a Buf<Status>,
    /// Bad gradients since the start.
    pub n_bad: &'a Buf<u32>,
}

/// Appends the addition of what each of `terms` left, [`MOST_TERMS`] at most: its four sums become one of `totals`.
pub fn record_totals(rec: &mut Recording, terms: &[Buf<[f32; 4]>], totals: &Buf<[f32; 4]>) {
    let Some(first) = terms.first() else { return };
    let ([sums0, sums1, sums2, sums3], [n0, n1, n2, n3]) = padded(terms, first);
    let args = loss_sum::Args { sums0, sums1, sums2, sums3, loss: totals };
    rec.pass(args, loss_sum::Push { n0, n1, n2, n3 }, Grid::Groups(terms.len() as u32));
}

/// As [`record_totals`], with the status of the step and its bad gradients, `to` where the host can read them.
pub fn record_report(
    rec: &mut Recording,
    terms: &[Buf<[f32; 4]>],
    status: &Buf<Status>,
    n_bad: &Buf<u32>,
    to: &Report,
) {
    let none = n_bad.cast();
    let ([sums0, sums1, sums2, sums3], [n0, n1, n2, n3]) = padded(terms, terms.first().unwrap_or(&none));
    let args = loss_sum_report::Args {
        sums0,
        sums1,
        sums2,
        sums3,
        loss: to.totals,
        frame_status: status,
        n_bad,
        left_status: to.status,
        left_bad: to.n_bad,
    };
    rec.pass(args, loss_sum_report::Push { n0, n1, n2, n3 }, Grid::Groups(terms.len().max(1) as u32));
}

/// The sums of each of four terms and how many there are; of one that is missing, 0 of `any`.
fn padded<'a>(terms: &'a [Buf<[f32; 4]>], any: &'a Buf<[f32; 4]>) -> ([&'a Buf<[f32; 4]>; 4], [u32; 4]) {
    assert!(terms.len() <= MOST_TERMS, "{} terms", terms.len());
    let four = std::array::from_fn(|term| terms.get(term));
    (four.map(|sums| sums.unwrap_or(any)), four.map(|sums| sums.map_or(0, |sums| sums.len() as u32)))
}
