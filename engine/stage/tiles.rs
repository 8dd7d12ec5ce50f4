//! Intersections of Gaussians and tiles: placed in depth order, sorted by tile, listed per tile.

use super::cull::{ARGS_SCAN, ARGS_SORT, ARGS_THREADS, indirect};
use super::workspace::APART;
use super::{Carried, Cull, PairGrids, Projected, Scan, Sort, Unsorted, ViewBuffers, Zeros};
use crate::error::Result;
use crate::gpu::generated::{Status, emit, emit_slots, gather, tile_order, tile_ranges};
use crate::gpu::table::Count;
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Buckets of the tile order, one per bit width of a list's length.
const BUCKETS: usize = 32;

/// The lists of all tiles, one after the other: sorted by tile, then depth, then index.
pub struct Lists {
    pub splat_ids: Buf<u32>,
    /// Slot of each entry: its place before the sort, where a Gaussian's slots are neighbours. For gradients only.
    pub slots: Option<Buf<u32>>,
}

pub struct Tiles {
    depth_sort: Sort,
    tile_sort: Sort,
    scan: Scan,
    offsets: Buf<u32>,
    n_intersections: Buf<u32>,
    emit_args: Buf<[u32; 4]>,
    tile_keys: Buf<u32>,
    splat_ids: Buf<u32>,
    /// For gradients: the slots, and the active index of each entry.
    slots: Option<[Buf<u32>; 2]>,
    pub slot_first: Buf<u32>,
    // Tiles by the length of their lists, and how many of them are in order.
    buckets: [Buf<u32>; 2],
    pub tile_first: Buf<u32>,
    pub tile_last: Buf<u32>,
    pub tile_order: Buf<u32>,
    pub(super) depth_bits: u32,
    capacity: u32,
}

/// Bits of the keys of so many tiles, and of `n_tiles` itself, which marks a slot that no tile reads.
fn key_bits(n_tiles: u32) -> u32 {
    u32::BITS - n_tiles.leading_zeros()
}

impl Tiles {
    pub fn n_zeros(room: [u32; 3]) -> usize {
        Self::counters(room).iter().sum()
    }

    /// Counters of the sorts by depth and by tile, and of either list of buckets.
    fn counters([active, intersections, tiles]: [u32; 3]) -> [usize; 4] {
        let sorts = [(active, u32::BITS), (intersections, key_bits(tiles))];
        let [of_depths, of_tiles] = sorts.map(|(n, bits)| Sort::n_counters(n as usize, bits).next_multiple_of(APART));
        [of_depths, of_tiles, APART, APART]
    }

    /// `room` for so many Gaussians, pairs and tiles; with a slot per pair or without. Each binning needs its part of `zeros` to be zero.
    pub fn new(gpu: &Gpu, room: [u32; 3], has_slots: bool, zeros: &mut Zeros) -> Result<Self> {
        let [n, i, t] = room.map(|n| n as usize);
        let lengths = Self::counters(room);
        let counters = zeros.take(lengths.iter().sum());
        let mut next = 0;
        let [of_depths, of_tiles, buckets, cursors] = lengths.map(|length| {
            next += length;
            counters.range(next - length, length)
        });
        Ok(Tiles {
            depth_sort: Sort::counting_in(gpu, n, of_depths)?,
            tile_sort: Sort::counting_in(gpu, i, of_tiles)?,
            scan: Scan::new(gpu, n)?,
            offsets: gpu.alloc("tile offsets", n)?,
            n_intersections: gpu.alloc("intersection count", 1)?,
            emit_args: gpu.alloc("emit args", 1)?,
            tile_keys: gpu.alloc("tile keys", i)?,
            splat_ids: gpu.alloc("tile splats", i)?,
            slots: if has_slots { Some([gpu.alloc("slots", i)?, gpu.alloc("sorted splats", i)?]) } else { None },
            slot_first: gpu.alloc("slot first", if has_slots { n } else { 1 })?,
            buckets: [buckets, cursors].map(|whole| whole.range(0, BUCKETS)),
            tile_first: gpu.alloc("tile first", t)?,
            tile_last: gpu.alloc("tile last", t)?,
            tile_order: gpu.alloc("tile order", t)?,
            depth_bits: u32::BITS,
            capacity: room[1],
        })
    }

    /// The grid of a thread per active Gaussian, which `cull.args` lose to the intersections; empty where those did not fit.
    pub(super) fn active_grid(&self) -> Grid {
        indirect(&self.emit_args, 0)
    }

    /// Appends the sort of `projected` by depth; gives the active indices, near to far.
    pub fn record_order(&self, rec: &mut Recording, cull: &Cull, projected: &Projected) -> Buf<u32> {
        rec.section("depth sort");
        let unsorted = Unsorted {
            count: &cull.n_active,
            keys: &projected.depth_keys,
            carried: Carried::Places(&projected.order),
            n_bits: self.depth_bits,
            blocks: &indirect(&cull.args, ARGS_SORT),
        };
        self.depth_sort.record(rec, unsorted).1
    }

    /// Appends the binning of what `eye` sees, in the `order` of their depths, into `n_tiles` tiles. A list of more than `longest`
    /// entries is reported as a failure.
    pub fn record(
        &self,
        rec: &mut Recording,
        cull: &Cull,
        eye: ViewBuffers,
        order: &Buf<u32>,
        n_tiles: u32,
        longest: u32,
    ) -> Lists {
        rec.section("tiles");
        self.record_pairs(rec, cull, eye, order);
        let (tile_keys, lists) = self.record_sort(rec, &cull.args, n_tiles);
        self.record_ranges(rec, eye.status, &tile_keys, n_tiles, longest);
        lists
    }

    /// Appends the pairs of a Gaussian and a tile, near to far; from here on `cull.args` are grids over those.
    fn record_pairs(&self, rec: &mut Recording, cull: &Cull, eye: ViewBuffers, order: &Buf<u32>) {
        let ViewBuffers { view, status: frame_status, projected: Projected { splats, tile_counts, .. } } = eye;
        let Tiles { offsets, tile_keys, splat_ids, slot_first, emit_args, capacity, .. } = self;
        let (n_active, args, blocks) = (&cull.n_active, &cull.args, indirect(&cull.args, ARGS_SCAN));
        let grids = PairGrids { blocks, args, emit_args, frame_status, capacity: *capacity };
        self.scan.record_gathered(rec, n_active, [order, tile_counts], offsets, &self.n_intersections, grids);
        if self.slots.is_none() {
            let args = emit::Args { view, n_active, order, tile_counts, offsets, splats, tile_keys, splat_ids };
            rec.pass(args, (), self.active_grid());
        } else {
            let args = emit_slots::Args {
                view,
                n_active,
                order,
                tile_counts,
                offsets,
                splats,
                tile_keys,
                splat_ids,
                slot_first,
            };
            rec.pass(args, (), self.active_grid());
        }
    }

    fn record_sort(&self, rec: &mut Recording, grids: &Buf<[u32; 4]>, n_tiles: u32) -> (Buf<u32>, Lists) {
        rec.section("tile sort");
        let (n_intersections, splat_ids) = (&self.n_intersections, &self.splat_ids);
        let first_pass = rec.passes().len();
        let carried = self.slots.as_ref().map_or(Carried::Values(splat_ids), |[slots, _]| Carried::Places(slots));
        let unsorted = Unsorted {
            count: n_intersections,
            keys: &self.tile_keys,
            carried,
            n_bits: key_bits(n_tiles),
            blocks: &indirect(grids, ARGS_SORT),
        };
        let (tile_keys, sorted) = self.tile_sort.record(rec, unsorted);
        rec.count_as(first_pass, Count::Intersections);

        rec.section("tiles");
        let Some([_, sorted_ids]) = &self.slots else {
            return (tile_keys, Lists { splat_ids: sorted, slots: None });
        };
        let first_pass = rec.passes().len();
        let args = gather::Args { count: n_intersections, index: &sorted, table: splat_ids, gathered: sorted_ids };
        rec.pass(args, (), indirect(grids, ARGS_THREADS));
        rec.count_as(first_pass, Count::Intersections);
        (tile_keys, Lists { splat_ids: sorted_ids.clone(), slots: Some(sorted) })
    }

    fn record_ranges(
        &self,
        rec: &mut Recording,
        frame_status: &Buf<Status>,
        tile_keys: &Buf<u32>,
        n_tiles: u32,
        longest: u32,
    ) {
        let Tiles { n_intersections, tile_first, tile_last, tile_order, buckets: [buckets, cursors], .. } = self;
        rec.pass(
            tile_ranges::Args { n_intersections, tile_keys, tile_first, tile_last, buckets, frame_status },
            tile_ranges::Push { n_tiles, longest },
            Grid::Threads(n_tiles),
        );
        let args = tile_order::Args { tile_first, tile_last, buckets, cursors, tile_order };
        rec.pass(args, tile_order::Push { n_tiles }, Grid::Threads(n_tiles));
    }
}
