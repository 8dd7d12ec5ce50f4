//! Which Gaussians a view may see: time window and frustum, then a compact list in index order.

use super::live::{Among, CULL_BLOCK};
use super::scan::{SCAN_BLOCK, Scan};
use super::scene::SceneBuffers;
use crate::error::Result;
use crate::gpu::generated::constants::args;
use crate::gpu::generated::{Status, ViewParams, compact, cull_dynamic, cull_static, prepare_active};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Places in the indirect arguments.
pub(super) const ARGS_THREADS: usize = args::ARGS_THREADS as usize;
pub(super) const ARGS_SCAN: usize = args::ARGS_SCAN as usize;
pub(super) const ARGS_SORT: usize = args::ARGS_SORT as usize;
pub(super) const ARGS_FIRST_GROUP: usize = args::ARGS_FIRST_GROUP as usize;

/// One entry of an indirect-argument buffer as a grid.
pub(super) fn indirect(args: &Buf<[u32; 4]>, at: usize) -> Grid {
    Grid::Indirect(args.range(at, 1).slice())
}

/// Scratch and result of culling.
pub struct Cull {
    /// A bit for each flat index: whether it is active.
    pub bits: Buf<u32>,
    /// Active Gaussians before each block of `CULL_BLOCK` flat indices.
    pub offsets: Buf<u32>,
    n_blocks: Buf<u32>,
    scan: Scan,
    /// Flat indices of the active Gaussians, ascending.
    pub active_id: Buf<u32>,
    /// Flat indices of the others, ascending, those past the end of a group among them; for training only.
    pub idle_id: Buf<u32>,
    wants_idle: bool,
    /// How many are active; 0 when they exceed the capacity.
    pub n_active: Buf<u32>,
    /// Range of each group in `active_id`.
    pub ranges: Buf<[u32; 2]>,
    /// Grids over the active Gaussians.
    pub args: Buf<[u32; 4]>,
    capacity: u32,
}

impl Cull {
    /// Scratch for `scene` with room for `capacity` active Gaussians; `wants_idle` lists the others too.
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

    /// Appends culling of `scene` for `view`.
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
                rec.pass(
                    cull_static::Args { view, bound, bits, counts },
                    cull_static::Push { n, first },
                    Grid::Threads(n),
                );
            }
        }
        rec.group(None);
        // At least one, which says that there is nothing.
        let blocks = Grid::Groups((scene.n_flat / CULL_BLOCK).div_ceil(SCAN_BLOCK as u32).max(1));
        self.scan.record(rec, &self.n_blocks, &self.offsets, &self.n_active, blocks);
        self.record_compact(rec, scene);
        rec.pass(
            prepare_active::Args {
                n_active: &self.n_active,
                offsets: &self.offsets,
                group_first: &scene.group_first,
                ranges: &self.ranges,
                args: &self.args,
                frame_status: status,
            },
            prepare_active::Push {
                n_groups: scene.groups.len() as u32,
                capacity: self.capacity,
                n_blocks: scene.n_flat / CULL_BLOCK,
            },
            Grid::Groups(1),
        );
    }

    /// Appends the lists of the active Gaussians and, if they are wanted, of the others.
    fn record_compact(&self, rec: &mut Recording, scene: &SceneBuffers) {
        let among = if self.wants_idle { Among::All } else { Among::Live };
        for (index, group) in scene.groups.iter().enumerate() {
            rec.group(Some(index));
            let (grid, is_listed) = group.live.grid(among);
            let args = compact::Args {
                bits: &self.bits,
                offsets: &self.offsets,
                active_id: &self.active_id,
                idle_id: &self.idle_id,
                live: &group.live.blocks,
                live_args: &group.live.args.cast(),
            };
            let (n, first) = (group.n.next_multiple_of(CULL_BLOCK), group.first);
            let wants_idle = u32::from(self.wants_idle);
            rec.pass(args, compact::Push { n, first, capacity: self.capacity, is_listed, wants_idle }, grid);
            rec.count(among.counted());
        }
        rec.group(None);
    }
}
