//! The buffers of all stages of a frame, and their passes in order.

use super::backward::Backward;
use super::{Blend, Capacity, Cull, Drawn, Lists, Projected, Purpose, SceneBuffers, Size, Target, Tiles, ViewBuffers};
use crate::error::Result;
use crate::gpu::generated::{Status, ViewParams};
use crate::gpu::{Buf, Gpu, Recording};

const STATUS_WORDS: usize = size_of::<Status>() / 4;

pub struct Workspace {
    pub capacity: Capacity,
    pub view: Buf<ViewParams>,
    // The status, counters and sums of a backward pass, which begin at zero.
    pub(super) zeros: Zeros,
    pub status: Buf<Status>,
    pub cull: Cull,
    pub projected: Projected,
    pub tiles: Tiles,
    pub blend: Blend,
    /// The backward pass; unless for [`Purpose::Picture`].
    pub backward: Option<Backward>,
}

impl Workspace {
    pub fn new(gpu: &Gpu, scene: &SceneBuffers, capacity: Capacity) -> Result<Self> {
        let Capacity { active, intersections, tiles, pixels, outputs, purpose, .. } = capacity;
        let is_seen_only = purpose == Purpose::Picture;
        let lists = [active, intersections, tiles];
        let n_backward = if is_seen_only { 0 } else { Backward::n_zeros(&capacity) };
        let parts = [STATUS_WORDS, Tiles::n_zeros(lists), Blend::n_zeros(gpu), n_backward];
        let mut zeros = Zeros::new(gpu, &parts)?;
        let status = zeros.take(STATUS_WORDS).cast();
        gpu.write(&status, &[Status::default()])?;
        let mut tiles = Tiles::new(gpu, lists, capacity.has_slots(), &mut zeros)?;
        tiles.depth_bits = capacity.depth_bits;
        let blend = Blend::new(gpu, pixels, intersections, outputs, purpose, &mut zeros)?;
        Ok(Workspace {
            capacity,
            view: gpu.alloc("view", 1)?,
            status,
            cull: Cull::new(gpu, scene, capacity.active, capacity.idle)?,
            projected: Projected::new(gpu, capacity.active)?,
            tiles,
            backward: (!is_seen_only).then(|| Backward::new(gpu, scene, &blend, &capacity, &mut zeros)).transpose()?,
            blend,
            zeros,
        })
    }

    /// The workspace in `place`, made anew where it is for another room; the old one's buffers go first.
    pub fn fit<'a>(
        place: &'a mut Option<Workspace>,
        gpu: &Gpu,
        scene: &SceneBuffers,
        capacity: Capacity,
    ) -> Result<&'a Self> {
        if place.as_ref().is_none_or(|work| work.capacity != capacity) {
            *place = None;
        }
        Ok(match place {
            Some(work) => work,
            None => place.insert(Workspace::new(gpu, scene, capacity)?),
        })
    }

    /// Appends the forward pass of the view that was uploaded: all stages of one strip. A training step begins with the failure of the
    /// one before, if that failed: steps are handed over ahead, and none may be taken out of order. `seen` may append passes on the
    /// Gaussians in view, before they are projected.
    pub fn record_forward(
        &self,
        rec: &mut Recording,
        scene: &SceneBuffers,
        size: Size,
        seen: impl FnOnce(&mut Recording),
    ) -> Lists {
        let Size { n_tiles, rounds, .. } = size;
        let (view, status) = (&self.view, &self.status);
        rec.section("cull");
        self.zeros.record(rec, usize::from(self.capacity.purpose == Purpose::Training));
        self.cull.record(rec, scene, view, status);
        seen(rec);
        self.projected.record(rec, scene, &self.cull, view, status);
        let order = self.tiles.record_order(rec, &self.cull, &self.projected);
        let lists = self.tiles.record(rec, &self.cull, self.eye(), &order, n_tiles, self.blend.longest(rounds));
        self.blend.record(rec, &self.tiles, &lists, self.eye(), n_tiles, rounds);
        lists
    }

    /// Appends the backward pass of the forward pass recorded just before.
    pub fn record_backward(
        &self,
        rec: &mut Recording,
        scene: &SceneBuffers,
        lists: &Lists,
        size: Size,
        target: &Target,
    ) {
        let Workspace { cull, tiles, blend, .. } = self;
        if let (Some(backward), Some(tail)) = (&self.backward, &blend.tail) {
            backward.record(rec, scene, Drawn { cull, eye: self.eye(), tiles, lists, blend, tail, size }, target);
        }
    }

    fn eye(&self) -> ViewBuffers<'_> {
        ViewBuffers { view: &self.view, status: &self.status, projected: &self.projected }
    }
}

/// Words from one part to the next: a binding may begin there on every device, 256 bytes.
pub(super) const APART: usize = 64;

/// Buffers that a frame counts or adds up in from zero: parts of one buffer, so that one fill clears them all.
pub struct Zeros {
    words: Buf<u32>,
    n_taken: usize,
}

impl Zeros {
    pub fn new(gpu: &Gpu, parts: &[usize]) -> Result<Self> {
        let n = parts.iter().map(|n| n.next_multiple_of(APART)).sum();
        Ok(Zeros { words: gpu.alloc("frame sums", n)?, n_taken: 0 })
    }

    pub fn take(&mut self, n: usize) -> Buf<u32> {
        let part = self.words.range(self.n_taken, n);
        self.n_taken += n.next_multiple_of(APART);
        part
    }

    /// Appends the fill of all parts but the first `kept` words.
    pub fn record(&self, rec: &mut Recording, kept: usize) {
        rec.fill(self.words.range(kept, self.words.len() - kept).slice(), 0);
    }
}
