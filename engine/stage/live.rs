//! Which blocks of a group may have a Gaussian that lives at a view's time: culling and what follows leave the others out.

use crate::error::Result;
use crate::gpu::generated::constants::grid::MAX_GROUPS;
use crate::gpu::generated::{ViewParams, cull_static, live_blocks};
use crate::gpu::table::Count;
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Gaussians per workgroup of the cull; groups begin at multiples of it in the flat index.
pub const CULL_BLOCK: u32 = cull_static::INFO.local;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Among {
    All,
    /// Those that the culling recorded last found alive, and static Gaussians.
    Live,
}

pub struct Live {
    /// Keys of -first and last time that a Gaussian of a block may be seen, `bound.comp`; dynamic groups only.
    pub life: Option<Buf<[u32; 2]>>,
    /// The blocks that live, in any order, and a workgroup for each of them.
    pub blocks: Buf<u32>,
    pub args: Buf<[u32; 4]>,
    n_blocks: u32,
}

impl Live {
    /// For `n` Gaussians, which all live until a view is culled for.
    pub(super) fn new(gpu: &Gpu, n: usize, dynamic: bool) -> Result<Self> {
        let n_blocks = (n as u32).div_ceil(CULL_BLOCK);
        let blocks: Vec<u32> = (0..n_blocks).collect();
        let args = [n_blocks.min(MAX_GROUPS), n_blocks.div_ceil(MAX_GROUPS), 1, n_blocks];
        Ok(Live {
            life: dynamic.then(|| gpu.alloc("lives", n_blocks as usize)).transpose()?,
            blocks: gpu.upload("live blocks", &blocks)?,
            args: gpu.upload("live args", &[args])?,
            n_blocks,
        })
    }

    /// The workgroups of `among`, one per block, and the kernels' `is_listed`.
    pub(super) fn grid(&self, among: Among) -> (Grid, u32) {
        match among {
            Among::All => (Grid::Groups(self.n_blocks), 0),
            Among::Live => (Grid::Indirect(self.args.slice()), 1),
        }
    }

    pub(super) fn count(&self, gpu: &Gpu, n: u32) -> Result<u32> {
        let listed = gpu.read(&self.args)?.first().map_or(0, |args| args[3]);
        Ok(listed.saturating_mul(CULL_BLOCK).min(n))
    }

    /// Appends the listing of the blocks that live at the time of `view`, of a group whose first block is `first` in the flat
    /// index; the others' `bits` and `counts` become 0.
    pub(super) fn record(
        &self,
        rec: &mut Recording,
        view: &Buf<ViewParams>,
        bits: &Buf<u32>,
        counts: &Buf<u32>,
        first: u32,
    ) {
        let Live { life: Some(life), blocks: live, args, n_blocks: n } = self else { return };
        rec.fill(args.slice(), 0);
        let args = live_blocks::Args { view, life, live, live_args: &args.cast(), bits, counts };
        rec.pass(args, live_blocks::Push { n: *n, first }, Grid::Threads(*n));
    }
}

impl Among {
    pub(super) fn counted(self) -> Count {
        match self {
            Among::All => Count::Gaussians,
            Among::Live => Count::Live,
        }
    }
}
