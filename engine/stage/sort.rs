//! Stable radix sort of (key, value) pairs by 8-bit digits.

use super::scan::Scan;
use crate::error::Result;
use crate::gpu::generated::{self, constants, sort_count, sort_scatter};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Keys per workgroup.
pub const SORT_BLOCK: usize = constants::args::SORT_BLOCK as usize;

/// Scratch of a sort: digit counts, and the second half of the ping-pong.
pub struct Sort {
    digits: Buf<u32>,
    total: Buf<u32>,
    scan: Scan,
    keys: Buf<u32>,
    values: Buf<u32>,
    wide: bool,
}

/// Grids of a sort, each for the number of keys that the device knows.
pub struct SortGrids {
    /// One workgroup per `SORT_BLOCK` keys.
    pub blocks: Grid,
    /// One workgroup per 1,024 digit counts.
    pub digits: Grid,
}

impl Sort {
    /// Scratch for up to `capacity` pairs.
    pub fn new(gpu: &Gpu, capacity: usize) -> Result<Self> {
        let n_digits = 256 * capacity.div_ceil(SORT_BLOCK);
        Ok(Sort {
            digits: gpu.alloc("sort digits", n_digits)?,
            total: gpu.alloc("sort total", 1)?,
            scan: Scan::new(gpu, n_digits)?,
            keys: gpu.alloc("sort keys", capacity)?,
            values: gpu.alloc("sort values", capacity)?,
            wide: gpu.caps().subgroup_size >= 32,
        })
    }

    /// Sorts the first `count[0]` pairs by the low `8 * n_passes` bits of their keys; equal keys keep their order.
    /// `n_digits[0]` is 256 times the number of blocks. Returns the buffers that hold the result: the given ones after
    /// an even number of passes, else the scratch.
    pub fn record(
        &self,
        rec: &mut Recording,
        count: &Buf<u32>,
        n_digits: &Buf<u32>,
        pairs: (&Buf<u32>, &Buf<u32>),
        n_passes: u32,
        grids: &SortGrids,
    ) -> (Buf<u32>, Buf<u32>) {
        let mut from = (pairs.0.clone(), pairs.1.clone());
        let mut to = (self.keys.clone(), self.values.clone());
        for pass in 0..n_passes {
            let shift = 8 * pass;
            rec.pass(
                sort_count::Args { count, keys: &from.0, digits: &self.digits },
                sort_count::Push { shift },
                grids.blocks.clone(),
            );
            self.scan.record(rec, n_digits, &self.digits, &self.total, grids.digits.clone());
            let kernel = generated::sort_scatter(self.wide);
            let args = sort_scatter::Args {
                count,
                digits: &self.digits,
                keys_in: &from.0,
                values_in: &from.1,
                keys_out: &to.0,
                values_out: &to.1,
            };
            rec.pass_variant(kernel, args, sort_scatter::Push { shift }, grids.blocks.clone());
            std::mem::swap(&mut from, &mut to);
        }
        from
    }
}
