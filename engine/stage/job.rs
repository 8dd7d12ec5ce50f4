//! A strip of a picture: what is asked of it, on its way through the device, and when it has ended.

use super::blend::Blend;
use super::params::{Outputs, Purpose, Strip};
use super::room::{Outcome, Room};
use super::tiles::Lists;
use crate::gpu::generated::Status;
use crate::gpu::{Buf, PassTime, Recording, Running, Slice};
use crate::scene::{Frame, View};

/// Where a picture is written to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Destination {
    /// It stays on the device.
    Device,
    /// It is read back.
    Host,
}

/// The order for a strip.
#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    pub view: &'a View,
    pub outputs: Outputs,
    pub destination: Destination,
    pub cotangents: Option<&'a Frame>,
    pub measure: Measure,
}

/// The measurements of a strip.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Measure {
    Nothing,
    /// The time of each pass.
    Times,
    /// That, and what the passes had to do, which is read back and takes longer than they did.
    Work,
}

/// The size of a strip.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    pub strip: Strip,
    pub n_tiles: u32,
    pub n_pixels: u32,
}

impl Job<'_> {
    /// Those of its images that are read back.
    pub(super) fn read_back(&self, blend: &Blend) -> Vec<Buf<[f32; 4]>> {
        if self.destination == Destination::Host { blend.images() } else { Vec::new() }
    }

    /// True if a backward pass follows.
    pub(super) fn purpose(&self) -> Purpose {
        if self.cotangents.is_some() { Purpose::Gradient } else { Purpose::Picture }
    }
}

impl Extent {
    pub(super) fn new(view: &View, strip: Strip) -> Self {
        let (tiles_x, tiles_y) = strip.tiles(view);
        Extent { strip, n_tiles: tiles_x * tiles_y, n_pixels: view.intrinsics.width * strip.n_rows }
    }
}

/// A strip that the device works on.
pub(super) struct Launched {
    // Goes first: it waits for the device, which uses what the recording holds.
    pub running: Running,
    pub copies: Option<Copies>,
    pub recording: Recording,
    pub lists: Lists,
    pub extent: Extent,
    pub status: Slice,
    pub room: Room,
    pub rounds: u32,
    /// Gaussians on the device, and those of them that are never drawn.
    pub n: (u32, u32),
}

/// Images on their way to the host.
pub(super) struct Copies {
    // Goes first, as above.
    pub running: Running,
    pub _recording: Recording,
    pub images: Vec<Slice>,
}

/// A strip that has ended.
pub(super) struct Landed {
    pub extent: Extent,
    pub status: Status,
    pub outcome: Outcome,
    /// Colour and alpha; depth, inverse depth and flow; as many as are read back.
    pub images: Vec<Vec<[f32; 4]>>,
    /// Of each pass, where they are timed.
    pub times: Vec<PassTime>,
    /// Seconds from when the images were there until they were read back.
    pub read_back_s: f64,
}
