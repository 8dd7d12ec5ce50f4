//! The renderer: one frame from a view, in strips where a device's bindings are shorter than the picture, replayed with
//! more room where it overflows.

use super::blend::{Blend, Outputs, SEGMENT};
use super::cull::Cull;
use super::params::{Strip, TILE, view_params};
use super::project::{Projected, SPLAT_PLANES};
use super::scene::SceneBuffers;
use super::tiles::Tiles;
use crate::error::{Error, Result};
use crate::gpu::generated::{Status, ViewParams};
use crate::gpu::table::{Count, KERNELS};
use crate::gpu::{Buf, Gpu, PassTime, Recording};
use crate::scene::{Frame, Splats, View};
use crate::settings::Constants;
use std::sync::Arc;

/// Bits of [`Status::failed`], `FAILED_*` of the shaders.
const FAILED_ACTIVE: u32 = 1;
const FAILED_INTERSECTIONS: u32 = 2;

/// Numbers that belong to a frame.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct FrameReport {
    /// Gaussians of the scene.
    pub gaussians: u64,
    /// In the view's time and frustum; summed over strips.
    pub active: u64,
    /// Touching a tile; summed over strips.
    pub visible: u64,
    /// Pairs of a Gaussian and a tile.
    pub intersections: u64,
    /// Tiles.
    pub tiles: u64,
    /// The longest list of a tile.
    pub max_tile_list: u64,
    /// Gaussians that are never drawn because a parameter or their projection is not finite.
    pub bad_gaussians: u64,
    /// Strips the picture was rendered in.
    pub strips: u64,
    /// Times a strip was replayed with more room.
    pub replays: u64,
    /// Passes with their times, in order; empty unless asked for.
    pub passes: Vec<PassReport>,
}

/// One line of a profile: all passes of a frame with the same label.
#[derive(Clone, Debug, serde::Serialize)]
pub struct PassReport {
    /// Stage and kernel.
    pub label: String,
    /// Passes with this label.
    pub dispatches: u64,
    /// Nanoseconds in all.
    pub ns: f64,
    /// What the time grows with, in all.
    pub units: u64,
    /// The ideal-limit model's nanoseconds for `units` on one core of a CPU driver.
    pub limit_ns: f64,
}

/// Renders views of one scene.
pub struct Renderer {
    gpu: Arc<Gpu>,
    scene: SceneBuffers,
    constants: Constants,
    work: Option<Workspace>,
    room: Room,
}

/// Capacities; they only grow, but for the strip.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Room {
    active: u32,
    intersections: u32,
    tiles: u32,
    pixels: usize,
    outputs: Outputs,
}

struct Workspace {
    room: Room,
    view: Buf<ViewParams>,
    status: Buf<Status>,
    cull: Cull,
    projected: Projected,
    tiles: Tiles,
    blend: Blend,
}

impl Workspace {
    fn new(gpu: &Gpu, scene: &SceneBuffers, room: Room) -> Result<Self> {
        Ok(Workspace {
            room,
            view: gpu.alloc("view", 1)?,
            status: gpu.alloc("status", 1)?,
            cull: Cull::new(gpu, scene, room.active)?,
            projected: Projected::new(gpu, room.active)?,
            tiles: Tiles::new(gpu, room.active, room.intersections, room.tiles)?,
            blend: Blend::new(gpu, room.pixels, room.outputs)?,
        })
    }
}

impl Renderer {
    /// Uploads `splats`.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] naming the buffer that does not fit.
    pub fn new(gpu: Arc<Gpu>, splats: &Splats, constants: Constants) -> Result<Self> {
        let scene = SceneBuffers::upload(&gpu, splats, constants.alpha_min)?;
        let active = scene.n.clamp(1, max_active(&gpu));
        let room = Room {
            active,
            intersections: active.saturating_mul(2).clamp(1 << 16, max_intersections(&gpu)),
            tiles: 1,
            pixels: 1,
            outputs: Outputs::Color,
        };
        Ok(Renderer { gpu, scene, constants, work: None, room })
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Starts with room for so few intersections; the first frame that needs more grows it.
    pub fn limit_intersections(&mut self, n: u32) {
        self.room.intersections = n.max(1);
        self.work = None;
    }

    /// Renders `view`. Outputs that were not asked for are empty.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] when a single row of tiles exceeds a limit of the device, naming it;
    /// [`Error::DeviceLost`] with the last pass.
    pub fn render(&mut self, view: &View, outputs: Outputs) -> Result<(Frame, FrameReport)> {
        self.render_with(view, outputs, false)
    }

    /// As [`Renderer::render`], with the time of every pass in the report.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn profile(&mut self, view: &View, outputs: Outputs) -> Result<(Frame, FrameReport)> {
        self.render_with(view, outputs, true)
    }

    fn render_with(&mut self, view: &View, outputs: Outputs, timed: bool) -> Result<(Frame, FrameReport)> {
        let gpu = self.gpu.clone();
        let n_pixels = view.width as usize * view.height as usize;
        let mut frame = Frame { width: view.width, height: view.height, ..Frame::default() };
        frame.color.reserve_exact(n_pixels);
        let mut report = FrameReport {
            gaussians: u64::from(self.scene.n),
            bad_gaussians: u64::from(self.scene.n_bad),
            ..FrameReport::default()
        };
        let mut strip_rows = self.longest_strip(view)?;
        let mut first_row = 0;
        while first_row < view.height {
            let strip = Strip { first_row, n_rows: strip_rows.min(view.height - first_row) };
            match self.strip(view, strip, outputs, timed, &mut report)? {
                Some(work) => {
                    let n = (view.width * strip.n_rows) as usize;
                    append(&mut frame, &gpu, &work.blend, n)?;
                    first_row += strip.n_rows;
                }
                // More active Gaussians or intersections than one binding can list: fewer rows at a time.
                None => strip_rows = (strip.n_rows / 2).next_multiple_of(TILE),
            }
        }
        Ok((frame, report))
    }

    /// The most rows, whole tiles, whose images fit a binding.
    fn longest_strip(&self, view: &View) -> Result<u32> {
        let row_bytes = 16 * u64::from(view.width);
        let limit = self.gpu.caps().max_binding_bytes;
        let rows = limit / row_bytes / u64::from(TILE) * u64::from(TILE);
        if rows == 0 {
            return Err(Error::OutOfMemory {
                what: format!("one row of tiles of view `{}` (bytes of a binding)", view.name),
                needed: row_bytes * u64::from(TILE),
                limit,
                remedy: "render a narrower picture or choose another device".to_owned(),
            });
        }
        let whole = u64::from(view.height.next_multiple_of(TILE));
        Ok(rows.min(whole) as u32)
    }

    /// Renders one strip into the workspace; `None` when its lists do not fit a binding and those of fewer rows might.
    fn strip(
        &mut self,
        view: &View,
        strip: Strip,
        outputs: Outputs,
        timed: bool,
        report: &mut FrameReport,
    ) -> Result<Option<&Workspace>> {
        let (tiles_x, tiles_y) = strip.tiles(view);
        let n_tiles = tiles_x * tiles_y;
        self.room.tiles = self.room.tiles.max(n_tiles);
        self.room.pixels = self.room.pixels.max((view.width * strip.n_rows) as usize);
        self.room.outputs = outputs;
        let params = view_params(view, &self.constants, self.scene.origin, strip);
        let mut rounds = 1;
        loop {
            let work = match self.work.take() {
                Some(work) if work.room == self.room => work,
                // The old buffers go before the new ones come.
                old => {
                    drop(old);
                    Workspace::new(&self.gpu, &self.scene, self.room)?
                }
            };
            self.gpu.write(&work.view, &[params])?;
            let rec = record_strip(&work, &self.scene, n_tiles, rounds);
            let times = if timed {
                self.gpu.run_timed(&rec)?
            } else {
                self.gpu.run(&rec)?;
                Vec::new()
            };
            let status = self.gpu.read(&work.status)?.first().copied().unwrap_or_default();
            self.work = Some(work);
            if status.failed & FAILED_ACTIVE != 0 {
                report.replays += 1;
                if tiles_y > 1 {
                    return Ok(None);
                }
                return Err(Error::OutOfMemory {
                    what: format!("view `{}`: Gaussians active in one row of tiles", view.name),
                    needed: u64::from(status.n_active),
                    limit: u64::from(status.capacity_active),
                    remedy: "use a smaller scene or a device with longer bindings".to_owned(),
                });
            }
            if status.failed & FAILED_INTERSECTIONS != 0 {
                report.replays += 1;
                let limit = max_intersections(&self.gpu);
                if status.n_intersections > limit {
                    if tiles_y > 1 {
                        return Ok(None);
                    }
                    return Err(Error::OutOfMemory {
                        what: format!("view `{}`: intersections in one row of tiles", view.name),
                        needed: u64::from(status.n_intersections),
                        limit: u64::from(limit),
                        remedy: "render a narrower picture or choose a device with longer bindings".to_owned(),
                    });
                }
                let roomy = u64::from(status.n_intersections) * 5 / 4;
                self.room.intersections = roomy.min(u64::from(limit)) as u32;
                continue;
            }
            if status.max_tile_list > rounds * SEGMENT {
                report.replays += 1;
                rounds = status.max_tile_list.div_ceil(SEGMENT);
                continue;
            }
            report.add(&status, n_tiles);
            if timed {
                let ranges = self.work.as_ref().map_or(Ok(Vec::new()), |work| self.gpu.read(&work.cull.ranges))?;
                report.add_passes(&rec, &times, &status, &self.scene, &ranges, n_tiles);
            }
            return Ok(self.work.as_ref());
        }
    }
}

/// All passes of one strip.
fn record_strip(work: &Workspace, scene: &SceneBuffers, n_tiles: u32, rounds: u32) -> Recording {
    let mut rec = Recording::new();
    let (view, status) = (&work.view, &work.status);
    rec.stage("cull");
    rec.fill(status.slice(), 0);
    work.cull.record(&mut rec, scene, view, status);
    work.projected.record(&mut rec, scene, &work.cull, view, status);
    let lists = work.tiles.record(&mut rec, &work.cull, &work.projected, view, status, n_tiles);
    work.blend.record(&mut rec, &work.tiles, &lists, &work.projected, view, n_tiles, rounds);
    rec
}

/// Appends the strip's `n` pixels to the frame.
fn append(frame: &mut Frame, gpu: &Gpu, blend: &Blend, n: usize) -> Result<()> {
    for [r, g, b, alpha] in gpu.read(&blend.image0.range(0, n))? {
        frame.color.push([r, g, b]);
        frame.alpha.push(alpha);
    }
    if let Some(image1) = &blend.image1 {
        for [depth, inverse_depth, x, y] in gpu.read(&image1.range(0, n))? {
            frame.depth.push(depth);
            frame.inverse_depth.push(inverse_depth);
            frame.flow.push([x, y]);
        }
    }
    Ok(())
}

/// Active Gaussians whose splats fit one binding.
fn max_active(gpu: &Gpu) -> u32 {
    let limit = gpu.caps().max_binding_bytes / (16 * SPLAT_PLANES as u64);
    limit.min(u64::from(u32::MAX / 2)) as u32
}

/// Intersections whose list fits one binding.
fn max_intersections(gpu: &Gpu) -> u32 {
    (gpu.caps().max_binding_bytes / 4).min(u64::from(u32::MAX - 1)) as u32
}

impl FrameReport {
    fn add(&mut self, status: &Status, n_tiles: u32) {
        self.active += u64::from(status.n_active);
        self.visible += u64::from(status.n_visible);
        self.intersections += u64::from(status.n_intersections);
        self.tiles += u64::from(n_tiles);
        self.max_tile_list = self.max_tile_list.max(u64::from(status.max_tile_list));
        self.bad_gaussians += u64::from(status.n_bad);
        self.strips += 1;
    }

    fn add_passes(
        &mut self,
        rec: &Recording,
        times: &[PassTime],
        status: &Status,
        scene: &SceneBuffers,
        ranges: &[[u32; 2]],
        n_tiles: u32,
    ) {
        for (pass, time) in rec.passes().iter().zip(times) {
            let units = match (pass.count, pass.group) {
                (Count::Gaussians, Some(group)) => scene.groups[group].n,
                (Count::Gaussians, None) => scene.n,
                (Count::Active, Some(group)) => ranges[group][1] - ranges[group][0],
                (Count::Active, None) => status.n_active,
                (Count::Intersections, _) => status.n_intersections,
                (Count::Tiles, _) => n_tiles,
                (Count::Dispatches, _) => 1,
            };
            let kernel = pass.label.split_once('/').map_or("", |(_, kernel)| kernel);
            let limit = KERNELS.iter().find(|row| row.name == kernel).map_or(0.0, |row| row.limit_ns);
            let line = match self.passes.iter_mut().position(|line| line.label == time.label) {
                Some(at) => &mut self.passes[at],
                None => {
                    let label = time.label.clone();
                    self.passes.push(PassReport { label, dispatches: 0, ns: 0.0, units: 0, limit_ns: 0.0 });
                    let last = self.passes.len() - 1;
                    &mut self.passes[last]
                }
            };
            line.dispatches += 1;
            line.ns += time.ns;
            line.units += u64::from(units);
            line.limit_ns += limit * f64::from(units);
        }
    }
}
