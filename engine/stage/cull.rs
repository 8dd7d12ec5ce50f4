//! Which Gaussians a view may see: time window and frustum, then a compact list in index order.

use super::live::CULL_BLOCK;
use super::scan::SCAN_BLOCK;
use super::{Among, Scan, SceneBuffers};
use crate::error::Result;
use crate::gpu::generated::constants::args;
use crate::gpu::generated::{Status, ViewParams, compact, cull_dynamic, cull_static, prepare_active};
use crate::gpu::{Buf, Gpu, Grid, Recording};

pub(super) const ARGS_THREADS: usize = args::ARGS_THREADS as usize;
pub(super) const ARGS_SCAN: usize = args::ARGS_SCAN as usize;
pub(super) const ARGS_SORT: usize = args::ARGS_SORT as usize;
pub(super) const ARGS_FIRST_GROUP: usize = args::ARGS_FIRST_GROUP as usize;

pub(super) fn indirect(args: &Buf<[u32; 4]>, at: usize) -> Grid {
    Grid::Indirect(args.range(at, 1).slice())
}

pub struct Cull {
    /// A bit for each flat index that is active.
    pub bits: Buf<u32>,
    /// Active Gaussians before each block of `CULL_BLOCK` flat indices.
    pub offsets: Buf<u32>,
    n_blocks: Buf<u32>,
    scan: Scan,
    pub active_id: Buf<u32>,
    /// Flat indices of the others, ascending, those past the end of a group among them; for training only.
    pub idle_id: Buf<u32>,
    wants_idle: bool,
    /// How many are active; 0 when they exceed the capacity.
    pub n_active: Buf<u32>,
    pub ranges: Buf<[u32; 2]>,
    pub args: Buf<[u32; 4]>,
    capacity: u32,
}

impl Cull {
    /// Room for `capacity` active Gaussians; `wants_idle` lists the others too.
    pub fn new(gpu: &Gpu, scene: &SceneBuffers, capacity: u32, wants_idle: bool) -> Result<Self> {
        let n_blocks = scene.n_flat / CULL_BLOCK;
        Ok(Cull {
            bits: gpu.alloc("cull bits", scene.n_flat as usize / 32)?,
            offsets: gpu.alloc("cull offsets", n_blocks as usize)?,
            n_blocks: gpu.upload("cull blocks", &[n_blocks])?,
            scan: Scan::new(gpu, n_blocks as usize)?,
            active_id: gpu.alloc("active ids", capacity as usize)?,
            idle_id: gpu.alloc("idle ids", if wants_idle { scene.n_flat as usize } else { 1 })?,
            wants_idle,
            n_active: gpu.alloc("active count", 1)?,
            ranges: gpu.alloc("group ranges", scene.groups.len())?,
            args: gpu.alloc("active args", ARGS_FIRST_GROUP + 2 * scene.groups.len())?,
            capacity,
        })
    }

    pub fn record(&self, rec: &mut Recording, scene: &SceneBuffers, view: &Buf<ViewParams>, status: &Buf<Status>) {
        rec.section("cull");
        let (bits, counts) = (&self.bits, &self.offsets);
        for (index, group) in scene.groups.iter().enumerate() {
            rec.group(Some(index));
            let (n, first, bound) = (group.n, group.first, &group.bound);
            group.live.record(rec, view, bits, counts, first / CULL_BLOCK);
            if let (Some(motion), Some(window)) = (&group.params.motion, &group.window) {
                let (live, live_args) = (&group.live.blocks, &group.live.args.cast());
                let args = cull_dynamic::Args { view, bound, bits, counts, motion, window, live, live_args };
                rec.pass(args, cull_dynamic::Push { n, first }, group.live.grid(Among::Live).0);
            } else {
                let args = cull_static::Args { view, bound, bits, counts };
                rec.pass(args, cull_static::Push { n, first }, Grid::Threads(n));
            }
        }
        rec.group(None);
        let Cull { n_active, offsets, ranges, args, n_blocks, capacity, .. } = self;
        // At least one, which says that there is nothing.
        let blocks = Grid::Groups((scene.n_flat / CULL_BLOCK).div_ceil(SCAN_BLOCK as u32).max(1));
        self.scan.record(rec, n_blocks, offsets, n_active, blocks);
        self.record_compact(rec, scene);
        let (group_first, frame_status) = (&scene.group_first, status);
        let args = prepare_active::Args { n_active, offsets, group_first, ranges, args, frame_status };
        let (n_groups, n_blocks) = (scene.groups.len() as u32, scene.n_flat / CULL_BLOCK);
        rec.pass(args, prepare_active::Push { n_groups, capacity: *capacity, n_blocks }, Grid::Groups(1));
    }

    fn record_compact(&self, rec: &mut Recording, scene: &SceneBuffers) {
        let Cull { bits, offsets, active_id, idle_id, capacity, .. } = self;
        let among = if self.wants_idle { Among::All } else { Among::Live };
        for (index, group) in scene.groups.iter().enumerate() {
            rec.group(Some(index));
            let (grid, is_listed) = group.live.grid(among);
            let (live, live_args) = (&group.live.blocks, &group.live.args.cast());
            let args = compact::Args { bits, offsets, active_id, idle_id, live, live_args };
            let (n, first) = (group.n.next_multiple_of(CULL_BLOCK), group.first);
            let wants_idle = u32::from(self.wants_idle);
            rec.pass(args, compact::Push { n, first, capacity: *capacity, is_listed, wants_idle }, grid);
            rec.count(among.counted());
        }
        rec.group(None);
    }
}
