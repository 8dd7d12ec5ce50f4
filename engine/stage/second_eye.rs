//! What the second of two eyes has of its own.

use super::blend::Blend;
use super::cull::ARGS_FIRST_GROUP;
use super::project::{Eye, Projected};
use super::room::Room;
use super::workspace::Workspace;
use crate::error::Result;
use crate::gpu::generated::{Status, ViewParams};
use crate::gpu::{Buf, Gpu};

/// Its buffers; the order of its splats is that of the first eye.
pub(super) struct SecondEye {
    pub room: Room,
    pub view: Buf<ViewParams>,
    /// The view that both are culled for.
    pub union: Buf<ViewParams>,
    /// Grids over the active Gaussians, of which the first eye's lists make grids over its intersections.
    pub grids: Buf<[u32; 4]>,
    pub status: Buf<Status>,
    pub projected: Projected,
    pub blend: Blend,
}

impl SecondEye {
    /// That in `place`, if it is of `work` as it is now; else a new one there.
    ///
    /// # Errors
    /// As [`SecondEye::new`].
    pub fn fit<'a>(place: &'a mut Option<SecondEye>, gpu: &Gpu, work: &Workspace) -> Result<&'a Self> {
        let is_its_own = |second: &SecondEye| {
            second.room == work.room && second.projected.order.slice().overlaps(&work.projected.order.slice())
        };
        Ok(match place.take().filter(is_its_own) {
            Some(second) => place.insert(second),
            None => place.insert(SecondEye::new(gpu, work)?),
        })
    }

    /// Its view, and the buffers that its picture is written to.
    pub fn eye(&self) -> Eye<'_> {
        Eye { view: &self.view, status: &self.status, projected: &self.projected }
    }

    /// Of the size of `work`, whose order it shares.
    ///
    /// # Errors
    /// `OutOfMemory` naming the buffer that does not fit.
    fn new(gpu: &Gpu, work: &Workspace) -> Result<Self> {
        let room = work.room;
        Ok(SecondEye {
            room,
            view: gpu.alloc("second view", 1)?,
            union: gpu.alloc("view of both eyes", 1)?,
            grids: gpu.alloc("second grids", ARGS_FIRST_GROUP)?,
            status: gpu.alloc("second status", 1)?,
            projected: work.projected.beside(gpu)?,
            blend: work.blend.beside(gpu)?,
        })
    }
}
