//! Stable radix sort of (key, value) pairs by 8-bit digits.

use crate::error::Result;
use crate::gpu::generated::{self, constants, sort_count, sort_places, sort_scatter};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Keys per workgroup.
pub const SORT_BLOCK: usize = constants::args::SORT_BLOCK as usize;

/// Values of a digit.
const DIGITS: usize = 256;
/// Most rounds: those of a key's four bytes.
const MOST_ROUNDS: usize = 4;

/// Scratch of a sort: digit counts, and the second half of the ping-pong.
pub struct Sort {
    digits: Buf<u32>,
    // Of each round.
    histograms: Buf<u32>,
    keys: Buf<u32>,
    values: Buf<u32>,
    subgroup_size: u32,
}

impl Sort {
    /// Scratch for up to `capacity` pairs.
    pub fn new(gpu: &Gpu, capacity: usize) -> Result<Self> {
        Ok(Sort {
            digits: gpu.alloc("sort digits", DIGITS * capacity.div_ceil(SORT_BLOCK))?,
            histograms: gpu.alloc("sort histograms", MOST_ROUNDS * DIGITS)?,
            keys: gpu.alloc("sort keys", capacity)?,
            values: gpu.alloc("sort values", capacity)?,
            subgroup_size: gpu.caps().subgroup_size,
        })
    }

    /// Sorts the first `count[0]` pairs by the low `8 * n_rounds` bits of their keys; equal keys keep their order.
    /// `blocks` has one workgroup per `SORT_BLOCK` keys. Returns the buffers that hold the result: the given ones after
    /// an even number of rounds, else the scratch.
    pub fn record(
        &self,
        rec: &mut Recording,
        count: &Buf<u32>,
        pairs: (&Buf<u32>, &Buf<u32>),
        n_rounds: u32,
        blocks: &Grid,
    ) -> (Buf<u32>, Buf<u32>) {
        let mut from = (pairs.0.clone(), pairs.1.clone());
        let mut to = (self.keys.clone(), self.values.clone());
        let digits = &self.digits;
        rec.fill(self.histograms.range(0, n_rounds as usize * DIGITS).slice(), 0);
        for round in 0..n_rounds {
            let shift = 8 * round;
            let histogram = &self.histograms.range(round as usize * DIGITS, DIGITS);
            rec.pass(
                sort_count::Args { count, keys: &from.0, digits, histogram },
                sort_count::Push { shift },
                blocks.clone(),
            );
            let n_subgroups = sort_places::INFO.local / self.subgroup_size;
            rec.pass(
                sort_places::Args { count, histogram, digits },
                (),
                Grid::Groups((DIGITS as u32).div_ceil(n_subgroups)),
            );
            let kernel = generated::sort_scatter(self.subgroup_size >= 32);
            let args = sort_scatter::Args {
                count,
                digits,
                keys_in: &from.0,
                values_in: &from.1,
                keys_out: &to.0,
                values_out: &to.1,
            };
            rec.pass_variant(kernel, args, sort_scatter::Push { shift }, blocks.clone());
            std::mem::swap(&mut from, &mut to);
        }
        from
    }
}
