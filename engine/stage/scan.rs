//! Exclusive prefix sum of any length: reduce, downsweep. No spinning: lavapipe ends long loops.

use crate::error::Result;
use crate::gpu::generated::{Status, constants, scan_downsweep, scan_downsweep_gathered};
use crate::gpu::generated::{scan_reduce, scan_reduce_gathered};
use crate::gpu::{Buf, Gpu, Grid, Recording};

pub const SCAN_BLOCK: usize = constants::args::SCAN_BLOCK as usize;

pub struct Scan {
    partials: Buf<u32>,
}

impl Scan {
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

    /// As [`Scan::record`], of the items of `table` that the first `count[0]` of `index` name; the sums go to `sums`. The sum of all is
    /// the number of intersections: grids are made of it, and it becomes 0 where it exceeds the capacity or the frame has failed.
    pub fn record_gathered(
        &self,
        rec: &mut Recording,
        count: &Buf<u32>,
        [index, table]: [&Buf<u32>; 2],
        sums: &Buf<u32>,
        total: &Buf<u32>,
        grids: PairGrids,
    ) {
        let (partials, blocks) = (&self.partials, grids.blocks);
        rec.pass(scan_reduce_gathered::Args { count, index, table, partials }, (), blocks.clone());
        let PairGrids { args, emit_args, frame_status, capacity, .. } = grids;
        let sweep =
            scan_downsweep_gathered::Args { count, partials, index, table, sums, total, args, emit_args, frame_status };
        rec.pass(sweep, scan_downsweep_gathered::Push { capacity }, blocks);
    }
}

/// The grids that [`Scan::record_gathered`] makes of the number of intersections.
pub struct PairGrids<'a> {
    pub blocks: Grid,
    /// Grids over the items of `index`; those of threads and of a sort become grids over intersections.
    pub args: &'a Buf<[u32; 4]>,
    /// The grid of threads over the items, which it was before; none where the intersections do not fit.
    pub emit_args: &'a Buf<[u32; 4]>,
    pub frame_status: &'a Buf<Status>,
    pub capacity: u32,
}
