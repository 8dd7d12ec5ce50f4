//! A strip of a picture on its way through the device. Its view goes there and its status comes back in the submission that
//! renders it, its images in one behind that: the host waits only at the end, and may hand over another strip meanwhile.

use super::backward::Backward;
use super::{Capacity, Lists, Outcome, Outputs, Purpose, Renderer, Size, Strip, Target, Workspace, view_params};
use crate::error::Result;
use crate::gpu::generated::Status;
use crate::gpu::{Buf, Gpu, PassTime, Recording, Running, Slice};
use crate::scene::{Frame, View};
use std::time::Instant;

/// Slices of the host's memory that are kept; two pictures on their way have three each.
const MOST_SPARE: usize = 6;

impl Renderer {
    /// Hands `strip` to the device, to be blended in so many rounds, and behind it the copies of its images.
    pub(super) fn launch(&mut self, job: &Job, strip: Strip, rounds: u32) -> Result<Launched> {
        self.load_window(job.view)?;
        let extent = Extent::new(job.view, strip);
        self.make_room(job, &extent);
        let view = self.gpu.staged("view", &[view_params(job.view, &self.constants, self.scene.origin, strip)])?;
        let status = self.slice(size_of::<Status>())?;
        let work = Workspace::fit(&mut self.work, &self.gpu, &self.scene, self.capacity)?;
        if let (Some(cotangents), Some(backward)) = (job.cotangents, &work.backward) {
            write_cotangents(&self.gpu, backward, cotangents, job.view, strip)?;
        }
        let mut recording = Recording::new();
        recording.section("view");
        recording.copy(view, work.view.slice());
        let Extent { n_tiles, n_pixels, .. } = extent;
        let size = Size { n_tiles, n_pixels, rounds };
        let lists = work.record_forward(&mut recording, &self.scene, size, |_| ());
        work.record_backward(&mut recording, &self.scene, &lists, size, &Target::Gradients);
        recording.section("status");
        recording.copy(work.status.slice(), status.clone());
        let is_read_back = job.destination == Destination::Host;
        let images = if is_read_back { work.blend.images() } else { Vec::new() };
        let running = match job.measure {
            Measure::Nothing => self.gpu.start(&recording)?,
            Measure::Times | Measure::Work => self.gpu.start_timed(&recording)?,
        };
        let copies = self.copy_back(&images, extent.n_pixels as usize)?;
        let n = (self.scene.n, self.scene.n_bad);
        Ok(Launched { running, copies, recording, lists, extent, status, capacity: self.capacity, rounds, n })
    }

    fn make_room(&mut self, job: &Job, extent: &Extent) {
        let capacity = &mut self.capacity;
        capacity.tiles = capacity.tiles.max(extent.n_tiles);
        capacity.pixels = capacity.pixels.max(extent.n_pixels as usize);
        capacity.outputs = job.outputs;
        capacity.purpose = if job.cotangents.is_some() { Purpose::Gradient } else { Purpose::Picture };
        capacity.active = capacity.active_of(self.scene.n, self.gpu.caps());
        capacity.intersections = capacity.intersections.min(capacity.max_intersections(&self.gpu));
    }

    /// Starts the copies of the first `n` pixels of `images`: by themselves, so that it is known when the picture was there.
    fn copy_back(&mut self, images: &[Buf<[f32; 4]>], n: usize) -> Result<Option<Copies>> {
        if images.is_empty() {
            return Ok(None);
        }
        let mut recording = Recording::new();
        let copied = images.iter().map(|image| {
            let to = self.slice(n * size_of::<[f32; 4]>())?;
            recording.copy(image.range(0, n).slice(), to.clone());
            Ok(to)
        });
        let images = copied.collect::<Result<_>>()?;
        Ok(Some(Copies { running: self.gpu.start(&recording)?, images, _recording: recording }))
    }

    /// A slice of the host's memory that so many bytes are copied to.
    fn slice(&mut self, bytes: usize) -> Result<Slice> {
        match self.spare.iter().position(|spare| spare.size() == bytes as u64) {
            Some(found) => Ok(self.spare.swap_remove(found)),
            None => self.gpu.readback::<u8>("picture read back", bytes),
        }
    }

    pub(super) fn land(&self, launched: &Launched) -> Result<Landed> {
        let times = launched.running.wait()?;
        let status: Status = self.gpu.peek(&launched.status)?.first().copied().unwrap_or_default();
        let outcome = launched.capacity.outcome(&self.gpu, &status, launched.rounds);
        let begun = Instant::now();
        let images = match &launched.copies {
            Some(copies) if outcome == Outcome::Complete => {
                copies.running.wait()?;
                copies.images.iter().map(|image| self.gpu.peek(image)).collect::<Result<_>>()?
            }
            _ => Vec::new(),
        };
        let read_back_s = begun.elapsed().as_secs_f64();
        Ok(Landed { extent: launched.extent, status, outcome, images, times, read_back_s })
    }

    pub(super) fn retire(&mut self, launched: Launched) {
        let images = launched.copies.map_or_else(Vec::new, |copies| copies.images);
        self.spare.extend(images.into_iter().chain([launched.status]));
        let surplus = self.spare.len().saturating_sub(MOST_SPARE);
        self.spare.drain(..surplus);
    }
}

fn write_cotangents(gpu: &Gpu, backward: &Backward, c: &Frame, view: &View, strip: Strip) -> Result<()> {
    let first = (view.intrinsics.width * strip.first_row) as usize;
    let pixels = first..first + (view.intrinsics.width * strip.n_rows) as usize;
    let image0: Vec<_> = pixels.clone().map(|p| [c.color[p][0], c.color[p][1], c.color[p][2], c.alpha[p]]).collect();
    gpu.write(&backward.d_image0, &image0)?;
    if let Some(d_image1) = &backward.d_image1 {
        let image1: Vec<_> = pixels.map(|p| [c.depth[p], c.inverse_depth[p], c.flow[p][0], c.flow[p][1]]).collect();
        gpu.write(d_image1, &image1)?;
    }
    Ok(())
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Destination {
    Device,
    /// Copied and read back.
    Host,
}

#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    pub view: &'a View,
    pub outputs: Outputs,
    pub destination: Destination,
    pub cotangents: Option<&'a Frame>,
    pub measure: Measure,
}

impl<'a> Job<'a> {
    pub(super) fn new(view: &'a View, outputs: Outputs, destination: Destination) -> Self {
        Job { view, outputs, destination, cotangents: None, measure: Measure::Nothing }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Measure {
    Nothing,
    Times,
    /// Times, and what the passes had to do, which is read back and takes longer than they did.
    Work,
}

#[derive(Clone, Copy)]
pub(super) struct Extent {
    pub strip: Strip,
    pub n_tiles: u32,
    pub n_pixels: u32,
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
    pub capacity: Capacity,
    pub rounds: u32,
    /// Gaussians on the device, and those of them that are never drawn.
    pub n: (u32, u32),
}

pub(super) struct Copies {
    // Goes first, as above.
    pub running: Running,
    pub _recording: Recording,
    pub images: Vec<Slice>,
}

pub(super) struct Landed {
    pub extent: Extent,
    pub status: Status,
    pub outcome: Outcome,
    /// Colour and alpha; depth, inverse depth and flow; as many as are read back.
    pub images: Vec<Vec<[f32; 4]>>,
    pub times: Vec<PassTime>,
    /// Seconds from when the images were there until they were read back.
    pub read_back_s: f64,
}
