//! Intersections of Gaussians and tiles: placed in depth order, sorted by tile, listed per tile.

use super::cull::{ARGS_SCAN, ARGS_SORT, ARGS_THREADS, Cull, indirect};
use super::project::{Eye, Projected};
use super::scan::{PairGrids, Scan};
use super::sort::{Carried, Sort, Unsorted};
use super::zeros::{APART, Zeros};
use crate::error::Result;
use crate::gpu::generated::{Status, emit, emit_slots, gather, tile_order, tile_ranges};
use crate::gpu::table::Count;
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Buckets of the tile order, one per bit width of a list's length.
const BUCKETS: usize = 32;

/// The lists of all tiles, one after the other: sorted by tile, then depth, then index.
pub struct Lists {
    /// Active index of each entry.
    pub splat_ids: Buf<u32>,
    /// Slot of each entry: its place before the sort, where a Gaussian's slots are neighbours. For gradients only.
    pub slots: Option<Buf<u32>>,
}

/// Buffers of the slots.
struct Slots {
    slots: Buf<u32>,
    sorted_ids: Buf<u32>,
}

/// Scratch and result of tile binning.
pub struct Tiles {
    depth_sort: Sort,
    tile_sort: Sort,
    scan: Scan,
    offsets: Buf<u32>,
    n_intersections: Buf<u32>,
    emit_args: Buf<[u32; 4]>,
    tile_keys: Buf<u32>,
    splat_ids: Buf<u32>,
    slots: Option<Slots>,
    /// First slot of each active Gaussian; for gradients only.
    pub slot_first: Buf<u32>,
    // Tiles by the length of their lists, and how many of them are in order; they count up from zero.
    buckets: [Buf<u32>; 2],
    /// First entry of each tile's list.
    pub tile_first: Buf<u32>,
    /// One past the last entry of each tile's list.
    pub tile_last: Buf<u32>,
    /// Tiles, those with long lists first.
    pub tile_order: Buf<u32>,
    depth_bits: u32,
    capacity: u32,
}

/// Bits of the keys of so many tiles: they go from 0 to `n_tiles`, which marks a slot that no tile reads.
fn key_bits(n_tiles: u32) -> u32 {
    u32::BITS - n_tiles.leading_zeros()
}

impl Tiles {
    /// Words of `zeros` that [`Tiles::new`] takes for the same room.
    pub fn n_zeros(room: [u32; 3]) -> usize {
        Self::counters(room).iter().sum()
    }

    /// Counters of the sorts by depth and by tile, and of either list of buckets.
    fn counters([active, intersections, tiles]: [u32; 3]) -> [usize; 4] {
        let sorts = [(active, u32::BITS), (intersections, key_bits(tiles))];
        let [of_depths, of_tiles] = sorts.map(|(n, bits)| Sort::n_counters(n as usize, bits).next_multiple_of(APART));
        [of_depths, of_tiles, APART, APART]
    }

    /// `room` for so many Gaussians, pairs and tiles; with a slot per pair or without. Each binning needs its
    /// part of `zeros` to be zero.
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
            slots: match has_slots {
                false => None,
                true => Some(Slots { slots: gpu.alloc("slots", i)?, sorted_ids: gpu.alloc("sorted splats", i)? }),
            },
            slot_first: gpu.alloc("slot first", if has_slots { n } else { 1 })?,
            buckets: [buckets, cursors].map(|whole| whole.range(0, BUCKETS)),
            tile_first: gpu.alloc("tile first", t)?,
            tile_last: gpu.alloc("tile last", t)?,
            tile_order: gpu.alloc("tile order", t)?,
            depth_bits: u32::BITS,
            capacity: room[1],
        })
    }

    /// Sorts by depth keys of so many bits from now on; they have 32 otherwise.
    pub(crate) fn with_depth_bits(self, depth_bits: u32) -> Self {
        Tiles { depth_bits, ..self }
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
        eye: Eye,
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
    fn record_pairs(&self, rec: &mut Recording, cull: &Cull, eye: Eye, order: &Buf<u32>) {
        let Eye { view, status, projected } = eye;
        let (n_active, tile_counts, offsets) = (&cull.n_active, &projected.tile_counts, &self.offsets);
        let grids = PairGrids {
            blocks: indirect(&cull.args, ARGS_SCAN),
            args: &cull.args,
            emit_args: &self.emit_args,
            frame_status: status,
            capacity: self.capacity,
        };
        self.scan.record_gathered(rec, n_active, [order, tile_counts], offsets, &self.n_intersections, grids);
        let (tile_keys, splat_ids) = (&self.tile_keys, &self.splat_ids);
        let splats = &projected.splats;
        let emit_grid = self.active_grid();
        match &self.slots {
            None => {
                let args = emit::Args { view, n_active, order, tile_counts, offsets, splats, tile_keys, splat_ids };
                rec.pass(args, (), emit_grid);
            }
            Some(_) => {
                let slot_first = &self.slot_first;
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
                rec.pass(args, (), emit_grid);
            }
        }
    }

    /// Appends the sort of the pairs by tile; gives the tile of each, and the lists.
    fn record_sort(&self, rec: &mut Recording, args: &Buf<[u32; 4]>, n_tiles: u32) -> (Buf<u32>, Lists) {
        rec.section("tile sort");
        let (n_intersections, splat_ids) = (&self.n_intersections, &self.splat_ids);
        let first_pass = rec.passes().len();
        let carried = self.slots.as_ref().map_or(Carried::Values(splat_ids), |s| Carried::Places(&s.slots));
        let unsorted = Unsorted {
            count: n_intersections,
            keys: &self.tile_keys,
            carried,
            n_bits: key_bits(n_tiles),
            blocks: &indirect(args, ARGS_SORT),
        };
        let (tile_keys, sorted) = self.tile_sort.record(rec, unsorted);
        rec.count_as(first_pass, Count::Intersections);

        rec.section("tiles");
        let Some(Slots { sorted_ids, .. }) = &self.slots else {
            return (tile_keys, Lists { splat_ids: sorted, slots: None });
        };
        let first_pass = rec.passes().len();
        rec.pass(
            gather::Args { count: n_intersections, index: &sorted, table: splat_ids, gathered: sorted_ids },
            (),
            indirect(args, ARGS_THREADS),
        );
        rec.count_as(first_pass, Count::Intersections);
        (tile_keys, Lists { splat_ids: sorted_ids.clone(), slots: Some(sorted) })
    }

    /// Appends where the list of each tile begins and ends, and the order of the tiles.
    fn record_ranges(
        &self,
        rec: &mut Recording,
        frame_status: &Buf<Status>,
        tile_keys: &Buf<u32>,
        n_tiles: u32,
        longest: u32,
    ) {
        let n_intersections = &self.n_intersections;
        let (tile_first, tile_last) = (&self.tile_first, &self.tile_last);
        let [buckets, cursors] = &self.buckets;
        rec.pass(
            tile_ranges::Args { n_intersections, tile_keys, tile_first, tile_last, buckets, frame_status },
            tile_ranges::Push { n_tiles, longest },
            Grid::Threads(n_tiles),
        );
        rec.pass(
            tile_order::Args { tile_first, tile_last, buckets, cursors, tile_order: &self.tile_order },
            tile_order::Push { n_tiles },
            Grid::Threads(n_tiles),
        );
    }
}
