//! Exclusive prefix sum of any length: reduce, downsweep. No spinning: lavapipe ends long loops.

use crate::error::Result;
use crate::gpu::generated::{constants, scan_downsweep, scan_downsweep_gathered, scan_reduce, scan_reduce_gathered};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Items per workgroup.
pub const SCAN_BLOCK: usize = constants::args::SCAN_BLOCK as usize;

/// Scratch of a prefix sum.
pub struct Scan {
    partials: Buf<u32>,
}

impl Scan {
    /// Scratch for up to `capacity` items.
    pub fn new(gpu: &Gpu, capacity: usize) -> Result<Self> {
        Ok(Scan { partials: gpu.alloc("scan partials", capacity.div_ceil(SCAN_BLOCK))? })
    }

    /// Replaces the first `count[0]` of `values` by the sums of all before them and writes the sum of all to `total`,
    /// saturated at 2^32 - 1. `blocks` has one workgroup per `SCAN_BLOCK` items, and at least one.
    pub fn record(&self, rec: &mut Recording, count: &Buf<u32>, values: &Buf<u32>, total: &Buf<u32>, blocks: Grid) {
        let partials = &self.partials;
        rec.pass(scan_reduce::Args { count, values, partials }, (), blocks.clone());
        rec.pass(scan_downsweep::Args { count, partials, sums: values, total }, (), blocks);
    }

    /// As [`Scan::record`], of the items of `table` that the first `count[0]` of `index` name; the sums go to `sums`.
    pub fn record_gathered(
        &self,
        rec: &mut Recording,
        count: &Buf<u32>,
        [index, table]: [&Buf<u32>; 2],
        (sums, total): (&Buf<u32>, &Buf<u32>),
        blocks: Grid,
    ) {
        let partials = &self.partials;
        rec.pass(scan_reduce_gathered::Args { count, index, table, partials }, (), blocks.clone());
        rec.pass(scan_downsweep_gathered::Args { count, partials, index, table, sums, total }, (), blocks);
    }
}
