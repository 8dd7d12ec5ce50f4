//! The renderer: one frame from a view, in strips where a device's bindings are shorter than the picture, replayed with
//! more room where it overflows.

use super::backward::{Accumulation, Backward, Target};
use super::blend::{Blend, Outputs, Purpose, SEGMENT};
use super::counters::{Counters, PassReport, add_passes};
use super::fisher::{Census, Fisher, Response};
use super::gradients::Gradients;
use super::params::{Strip, TILE, view_params};
use super::scene::SceneBuffers;
use super::show::{Layer, Screen};
use super::workspace::{Room, Verdict, Workspace, max_active};
use crate::error::{Error, Result};
use crate::gpu::generated::Status;
use crate::gpu::{Dispatch, Gpu, PassTime, Recording};
use crate::scene::{Frame, Splats, View};
use crate::settings::Constants;
use std::sync::Arc;
use std::time::Instant;

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
    /// Each pass.
    #[serde(skip)]
    pub times: Vec<PassTime>,
    /// What the passes had to do; zeros unless asked for.
    pub counters: Counters,
    /// Seconds that the counting took, on the host; in none of the times.
    #[serde(skip)]
    pub counting_s: f64,
    /// Seconds in which the picture was read back to the host, where it was.
    #[serde(skip)]
    pub read_back_s: f64,
}

/// What is measured of a frame.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Measure {
    Nothing,
    /// The time of each pass.
    Times,
    /// That, and what the passes had to do, which is read back and takes longer than they did.
    Work,
}

/// Renders views of one scene.
pub struct Renderer {
    gpu: Arc<Gpu>,
    scene: SceneBuffers,
    constants: Constants,
    work: Option<Workspace>,
    room: Room,
}

impl Renderer {
    /// Uploads `splats`.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] naming the buffer that does not fit.
    pub fn new(gpu: Arc<Gpu>, splats: &Splats, constants: Constants) -> Result<Self> {
        let constants = constants.knobs.on(constants);
        let scene = SceneBuffers::upload(&gpu, splats, &constants, Purpose::Picture)?;
        let active = scene.n.clamp(1, max_active(&gpu));
        let room = Room {
            active,
            intersections: active.saturating_mul(2).max(1 << 16),
            tiles: 1,
            pixels: 1,
            outputs: Outputs::Color,
            purpose: Purpose::Picture,
            accumulation: Accumulation::default(),
            camera: false,
            depth_bits: constants.knobs.depth_bits,
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
        self.render_with(view, outputs, Measure::Nothing)
    }

    /// As [`Renderer::render`], but the picture stays on the device.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn draw(&mut self, view: &View, outputs: Outputs) -> Result<FrameReport> {
        self.strips(view, outputs, None, Measure::Nothing, |_, _, _| Ok(()))
    }

    /// Renders `view`, which has the size of `screen`, and puts `layer` of it there. The report has the time of each pass where
    /// it `is_timed`.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn show(&mut self, view: &View, layer: Layer, screen: &Screen, is_timed: bool) -> Result<FrameReport> {
        assert_eq!((view.width, view.height), (screen.width, screen.height), "the view and the screen");
        let gpu = self.gpu.clone();
        let outputs = if matches!(layer, Layer::Color | Layer::Alpha) { Outputs::Color } else { Outputs::All };
        let measure = if is_timed { Measure::Times } else { Measure::Nothing };
        self.strips(view, outputs, None, measure, |_, work, strip| {
            let mut rec = Recording::new();
            let pixels = [strip.first_row, strip.n_rows].map(|rows| view.width * rows);
            screen.record(&mut rec, &work.blend.image0, work.blend.image1.as_ref(), layer, pixels);
            gpu.run(&rec)
        })
    }

    /// As [`Renderer::render`], with the time of every pass in the report.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn profile(&mut self, view: &View, outputs: Outputs) -> Result<(Frame, FrameReport)> {
        self.render_with(view, outputs, Measure::Work)
    }

    /// As [`Renderer::render`], but gives the frame's first dispatch of a kernel, with what it worked on. The picture is of
    /// one strip.
    ///
    /// # Errors
    /// As [`Renderer::render`]; [`Error::OutOfMemory`] when one strip does not hold the picture.
    pub fn capture(&mut self, view: &View, outputs: Outputs, kernel: &str) -> Result<Option<Dispatch>> {
        // Lists grow to their size.
        let (_, report) = self.render(view, outputs)?;
        if report.strips > 1 {
            return Err(Error::OutOfMemory {
                what: format!("view `{}` in one strip (strips)", view.name),
                needed: report.strips,
                limit: 1,
                remedy: "capture a smaller picture".to_owned(),
            });
        }
        let rounds = (report.max_tile_list as u32).div_ceil(SEGMENT).max(1);
        let strip = Strip::whole(view);
        let (tiles_x, tiles_y) = strip.tiles(view);
        let work = Workspace::fit(&mut self.work, &self.gpu, &self.scene, self.room)?;
        self.gpu.write(&work.view, &[view_params(view, &self.constants, self.scene.origin, strip)])?;
        let mut rec = Recording::new();
        work.record_forward(&mut rec, &self.scene, tiles_x * tiles_y, rounds, |_| ());
        self.gpu.run_capturing(rec, kernel)
    }

    /// Adds gradients up in another way from now on.
    ///
    /// # Errors
    /// [`Error::NoDevice`] when the device cannot.
    pub fn accumulate(&mut self, accumulation: Accumulation) -> Result<()> {
        accumulation.check(&self.gpu)?;
        self.room.accumulation = accumulation;
        Ok(())
    }

    /// Gradients of sum(cotangent * output) of `view`, where `cotangents` holds the cotangents of a frame.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn vjp(&mut self, view: &View, cotangents: &Frame) -> Result<(Gradients, FrameReport)> {
        let gpu = self.gpu.clone();
        let mut gradients = Gradients::default();
        let report = self.strips(view, Outputs::All, Some(cotangents), Measure::Nothing, |scene, work, _| {
            let Some(backward) = &work.backward else { return Ok(()) };
            let strip = scene.download(&gpu, backward.gradients.iter())?;
            let n_bad = gpu.read(&backward.n_bad)?.first().copied().unwrap_or(0);
            gradients.add(strip, &gpu.read(&backward.d_camera)?, n_bad, view.flow_dt);
            Ok(())
        })?;
        Ok((gradients, report))
    }

    /// An empty census of this renderer's scene, for cameras with these centres (world), over which the means of bands are.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] naming the buffer that does not fit.
    pub fn census(&self, cameras: &[[f64; 3]]) -> Result<Census> {
        Census::new(&self.gpu, &self.scene, cameras)
    }

    /// Adds `view` to `census`, which this renderer made: by the cotangents of colour `signs`, which must be random signs, the
    /// information; by those that `errors` makes of the picture, its errors, the slope of half their square.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn count(
        &mut self,
        census: &Census,
        view: &View,
        signs: &Frame,
        errors: impl FnOnce(Frame) -> Frame,
    ) -> Result<()> {
        let gpu = self.gpu.clone();
        let time = view.time + view.time_offset * view.flow_dt;
        let mut frame = Frame { width: view.width, height: view.height, ..Frame::default() };
        let add = |fisher: &Fisher, scene: &SceneBuffers, work: &Workspace| {
            let Some(backward) = &work.backward else { return Ok(()) };
            let mut rec = Recording::new();
            fisher.record(&mut rec, scene, &backward.gradients, time);
            gpu.run(&rec)
        };
        self.strips(view, Outputs::Color, Some(signs), Measure::Nothing, |scene, work, strip| {
            append(&mut frame, &gpu, &work.blend, (view.width * strip.n_rows) as usize)?;
            add(&census.information, scene, work)
        })?;
        self.strips(view, Outputs::Color, Some(&errors(frame)), Measure::Nothing, |scene, work, _| {
            add(&census.slope, scene, work)
        })?;
        Ok(())
    }

    /// Of every Gaussian, in the scene's order, how often a picture of `census` showed it so far; once for each of its strips.
    ///
    /// # Errors
    /// [`Error::DeviceLost`].
    pub fn seen(&self, census: &Census) -> Result<Vec<f32>> {
        census.information.seen(&self.gpu, &self.scene)
    }

    /// What `census` has counted of every Gaussian, in the scene's order: information, and slope of half the squared error.
    ///
    /// # Errors
    /// [`Error::DeviceLost`].
    pub fn counted(&self, census: &Census) -> Result<(Vec<Response>, Vec<Response>)> {
        Ok((census.information.read(&self.gpu, &self.scene)?, census.slope.read(&self.gpu, &self.scene)?))
    }

    fn render_with(&mut self, view: &View, outputs: Outputs, measure: Measure) -> Result<(Frame, FrameReport)> {
        let gpu = self.gpu.clone();
        let mut frame = Frame { width: view.width, height: view.height, ..Frame::default() };
        let mut read_back_s = 0.0;
        let report = self.strips(view, outputs, None, measure, |_, work, strip| {
            let begun = Instant::now();
            append(&mut frame, &gpu, &work.blend, (view.width * strip.n_rows) as usize)?;
            read_back_s += begun.elapsed().as_secs_f64();
            Ok(())
        })?;
        Ok((frame, FrameReport { read_back_s, ..report }))
    }

    /// Runs `view` strip by strip, with the backward pass of `cotangents` if there are any, and hands each finished
    /// strip to `done`.
    fn strips(
        &mut self,
        view: &View,
        outputs: Outputs,
        cotangents: Option<&Frame>,
        measure: Measure,
        mut done: impl FnMut(&SceneBuffers, &Workspace, Strip) -> Result<()>,
    ) -> Result<FrameReport> {
        let mut report = FrameReport {
            gaussians: u64::from(self.scene.n),
            bad_gaussians: u64::from(self.scene.n_bad),
            ..FrameReport::default()
        };
        let mut strip_rows = self.longest_strip(view)?;
        let mut first_row = 0;
        while first_row < view.height {
            let strip = Strip { first_row, n_rows: strip_rows.min(view.height - first_row) };
            if self.strip(view, strip, outputs, cotangents, measure, &mut report)? {
                if let Some(work) = &self.work {
                    done(&self.scene, work, strip)?;
                }
                first_row += strip.n_rows;
            } else {
                // More active Gaussians or intersections than one binding can list: fewer rows at a time.
                strip_rows = (strip.n_rows / 2).next_multiple_of(TILE);
            }
        }
        Ok(report)
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

    /// Runs one strip in the workspace; `false` when its lists do not fit a binding and those of fewer rows might.
    fn strip(
        &mut self,
        view: &View,
        strip: Strip,
        outputs: Outputs,
        cotangents: Option<&Frame>,
        measure: Measure,
        report: &mut FrameReport,
    ) -> Result<bool> {
        let (tiles_x, tiles_y) = strip.tiles(view);
        let n_tiles = tiles_x * tiles_y;
        self.room.tiles = self.room.tiles.max(n_tiles);
        self.room.pixels = self.room.pixels.max((view.width * strip.n_rows) as usize);
        self.room.outputs = outputs;
        self.room.purpose = if cotangents.is_some() { Purpose::Gradient } else { Purpose::Picture };
        let limit = self.room.max_intersections(&self.gpu);
        self.room.intersections = self.room.intersections.min(limit);
        let params = view_params(view, &self.constants, self.scene.origin, strip);
        let mut rounds = 1;
        loop {
            let work = Workspace::fit(&mut self.work, &self.gpu, &self.scene, self.room)?;
            self.gpu.write(&work.view, &[params])?;
            if let (Some(cotangents), Some(backward)) = (cotangents, &work.backward) {
                write_cotangents(&self.gpu, backward, cotangents, view, strip)?;
            }
            let mut rec = Recording::new();
            let lists = work.record_forward(&mut rec, &self.scene, n_tiles, rounds, |_| ());
            let n_pixels = view.width * strip.n_rows;
            work.record_backward(&mut rec, &self.scene, &lists, n_tiles, n_pixels, rounds, &Target::Gradients);
            let times = if measure == Measure::Nothing {
                self.gpu.run(&rec)?;
                Vec::new()
            } else {
                self.gpu.run_timed(&rec)?
            };
            let status = self.gpu.read(&work.status)?.first().copied().unwrap_or_default();
            let verdict = work.verdict(&self.gpu, &status, rounds);
            match verdict {
                Verdict::Complete => {}
                Verdict::Replay(room, new_rounds) => {
                    report.replays += 1;
                    (self.room, rounds) = (room, new_rounds);
                    continue;
                }
                Verdict::TooMuch { .. } if tiles_y > 1 => {
                    report.replays += 1;
                    return Ok(false);
                }
                Verdict::TooMuch { what, needed, limit } => {
                    return Err(Error::OutOfMemory {
                        what: format!("view `{}`: {what} in one row of tiles", view.name),
                        needed: u64::from(needed),
                        limit: u64::from(limit),
                        remedy: "render a narrower picture, a smaller scene, or choose a device with longer bindings"
                            .to_owned(),
                    });
                }
            }
            report.add(&status, n_tiles);
            if measure == Measure::Work {
                let begun = Instant::now();
                if let Some(work) = &self.work {
                    let counters = Counters::read(&self.gpu, work, &self.scene, &lists, n_tiles, n_pixels)?;
                    report.passes = add_passes(std::mem::take(&mut report.passes), &rec, &times, &counters);
                    report.counters.add(&counters);
                }
                report.counting_s += begun.elapsed().as_secs_f64();
            }
            report.times.extend(times);
            return Ok(true);
        }
    }
}

/// Uploads the strip's rows of the cotangents.
fn write_cotangents(gpu: &Gpu, backward: &Backward, c: &Frame, view: &View, strip: Strip) -> Result<()> {
    let first = (view.width * strip.first_row) as usize;
    let pixels = first..first + (view.width * strip.n_rows) as usize;
    let image0: Vec<_> = pixels.clone().map(|p| [c.color[p][0], c.color[p][1], c.color[p][2], c.alpha[p]]).collect();
    gpu.write(&backward.d_image0, &image0)?;
    if let Some(d_image1) = &backward.d_image1 {
        let image1: Vec<_> = pixels.map(|p| [c.depth[p], c.inverse_depth[p], c.flow[p][0], c.flow[p][1]]).collect();
        gpu.write(d_image1, &image1)?;
    }
    Ok(())
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
}
