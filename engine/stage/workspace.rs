//! The buffers of all stages of a frame, and their passes in order.

use super::backward::{Backward, Drawn, Target};
use super::blend::Blend;
use super::cull::Cull;
use super::params::Purpose;
use super::project::{Eye, Projected};
use super::room::{Room, Size};
use super::scene::SceneBuffers;
use super::tiles::{Lists, Tiles};
use super::zeros::Zeros;
use crate::error::Result;
use crate::gpu::generated::{Status, ViewParams};
use crate::gpu::{Buf, Gpu, Recording};

/// Words of what a frame reports; the first says whether it failed.
const STATUS_WORDS: usize = size_of::<Status>() / 4;

/// The buffers of all stages of a frame.
pub struct Workspace {
    /// The capacities.
    pub room: Room,
    /// The view or strip at hand.
    pub view: Buf<ViewParams>,
    // What begins at zero: the status, counters, what a backward pass adds up.
    pub(super) zeros: Zeros,
    /// The frame's report.
    pub status: Buf<Status>,
    /// Culling.
    pub cull: Cull,
    /// Projection.
    pub projected: Projected,
    /// Binning.
    pub tiles: Tiles,
    /// Blending and its pictures.
    pub blend: Blend,
    /// The backward pass; unless for [`Purpose::Picture`].
    pub backward: Option<Backward>,
}

impl Workspace {
    /// Buffers for frames of `scene` within `room`.
    ///
    /// # Errors
    /// `OutOfMemory` naming the buffer that does not fit.
    pub fn new(gpu: &Gpu, scene: &SceneBuffers, room: Room) -> Result<Self> {
        let Room { active, intersections, tiles, pixels, outputs, purpose, .. } = room;
        let is_seen_only = purpose == Purpose::Picture;
        let lists = [active, intersections, tiles];
        let n_backward = if is_seen_only { 0 } else { Backward::n_zeros(&room) };
        let parts = [STATUS_WORDS, Tiles::n_zeros(lists), Blend::n_zeros(gpu), n_backward];
        let mut zeros = Zeros::new(gpu, &parts)?;
        let status = zeros.take(STATUS_WORDS).cast();
        gpu.write(&status, &[Status::default()])?;
        let tiles = Tiles::new(gpu, lists, room.has_slots(), &mut zeros)?.with_depth_bits(room.depth_bits);
        let blend = Blend::new(gpu, pixels, intersections, outputs, purpose, &mut zeros)?;
        Ok(Workspace {
            room,
            view: gpu.alloc("view", 1)?,
            status,
            cull: Cull::new(gpu, scene, room.active, room.idle)?,
            projected: Projected::new(gpu, room.active)?,
            tiles,
            backward: match is_seen_only {
                true => None,
                false => Some(Backward::new(gpu, scene, &blend, &room, &mut zeros)?),
            },
            blend,
            zeros,
        })
    }

    /// The workspace in `place`, replaced by a new one when it was made for another room; the old one's buffers go first.
    ///
    /// # Errors
    /// As [`Workspace::new`].
    pub fn fit<'a>(place: &'a mut Option<Workspace>, gpu: &Gpu, scene: &SceneBuffers, room: Room) -> Result<&'a Self> {
        if place.as_ref().is_none_or(|work| work.room != room) {
            *place = None;
        }
        Ok(match place {
            Some(work) => work,
            None => place.insert(Workspace::new(gpu, scene, room)?),
        })
    }

    /// Appends the forward pass of the view that was uploaded: all stages of one strip. A training step begins with the
    /// failure of the one before, if that failed: steps are handed over ahead, and none may be taken out of order.
    /// `seen` may append passes on the Gaussians in view, before they are projected.
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
        self.zeros.record(rec, usize::from(self.room.purpose == Purpose::Training));
        self.cull.record(rec, scene, view, status);
        seen(rec);
        self.projected.record(rec, scene, &self.cull, view, status);
        let order = self.tiles.record_order(rec, &self.cull, &self.projected);
        let lists = self.tiles.record(rec, &self.cull, self.eye(), &order, n_tiles, self.blend.longest(rounds));
        self.blend.record(rec, &self.tiles, &lists, self.eye(), n_tiles, rounds);
        lists
    }

    /// Appends the backward pass of the forward pass recorded just before, if the workspace has one.
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

    /// The view, and where the Gaussians in it lie.
    fn eye(&self) -> Eye<'_> {
        Eye { view: &self.view, status: &self.status, projected: &self.projected }
    }
}
