//! What the second of two eyes has of its own.

use super::blend::Blend;
use super::params::Purpose;
use super::project::Projected;
use super::room::Room;
use super::workspace::Workspace;
use crate::error::Result;
use crate::gpu::generated::{Status, ViewParams};
use crate::gpu::{Buf, Gpu};

/// Its buffers; splats and their order are those of the first eye.
pub(super) struct SecondEye {
    pub room: Room,
    pub view: Buf<ViewParams>,
    /// The view that both are culled for.
    pub union: Buf<ViewParams>,
    pub status: Buf<Status>,
    pub projected: Projected,
    pub blend: Blend,
}

impl SecondEye {
    /// Of the size of `work`, whose splats and order it shares.
    ///
    /// # Errors
    /// `OutOfMemory` naming the buffer that does not fit.
    pub fn new(gpu: &Gpu, work: &Workspace) -> Result<Self> {
        let (room, n) = (work.room, work.room.active as usize);
        Ok(SecondEye {
            room,
            view: gpu.alloc("second view", 1)?,
            union: gpu.alloc("view of both eyes", 1)?,
            status: gpu.alloc("second status", 1)?,
            projected: Projected {
                splats: work.projected.splats.clone(),
                tile_counts: work.projected.tile_counts.clone(),
                // The order is that of the first eye, and stays where it is.
                depth_keys: gpu.alloc("second depth keys", n)?,
                identity: gpu.alloc("second depth order", n)?,
            },
            blend: Blend::new(gpu, room.pixels, room.outputs, Purpose::Picture)?,
        })
    }
}
