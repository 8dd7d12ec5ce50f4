//! One frame from a view, in strips where a device's bindings are shorter than the picture, replayed with more room where it overflows.

use super::blend::SEGMENT;
use super::capacity::too_large;
use super::fisher::Fisher;
use super::launch::{Extent, Job, Landed, Launched, Measure};
use super::params::TILE;
use super::{
    Census, Counters, Destination, Gradients, Layer, Outcome, Outputs, PassReport, Renderer, Response, SceneBuffers,
    Screen, Size, Strip, Workspace, add_passes, view_params,
};
use crate::error::{Error, Result};
use crate::gpu::{Dispatch, PassTime, Recording};
use crate::scene::{Frame, View};
use std::time::Instant;

/// Numbers that belong to a frame.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct FrameReport {
    /// Gaussians on the device: of the scene, or of a clip those that live near the view's time.
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
    /// Barriers between all its passes, summed over strips; zero unless the passes were asked for.
    pub barriers: usize,
    /// The time of each pass.
    #[serde(skip)]
    pub times: Vec<PassTime>,
    /// The work of the passes; zeros unless asked for.
    pub counters: Counters,
    /// Seconds that the counting took, on the host; in none of the times.
    #[serde(skip)]
    pub counting_s: f64,
    /// Seconds in which the picture was read back to the host, where it was.
    #[serde(skip)]
    pub read_back_s: f64,
}

/// A picture that the device works on, see [`Renderer::begin`].
pub struct Picture {
    pub(super) view: View,
    pub(super) outputs: Outputs,
    pub(super) destination: Destination,
    /// None where it does not fit one strip: those follow one another.
    pub(super) launched: Option<Launched>,
}

impl Renderer {
    /// Renders `view`. Outputs that were not asked for are empty.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] when a single row of tiles exceeds a limit of the device, naming it;
    /// [`Error::DeviceLost`] with the last pass.
    #[tracing::instrument(level = "debug", name = "frame", skip_all)]
    pub fn render(&mut self, view: &View, outputs: Outputs) -> Result<(Frame, FrameReport)> {
        let picture = self.begin(view, outputs, Destination::Host)?;
        self.end(picture)
    }

    /// As [`Renderer::render`], but the picture stays on the device.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    #[tracing::instrument(level = "debug", name = "frame", skip_all)]
    pub fn draw(&mut self, view: &View, outputs: Outputs) -> Result<FrameReport> {
        let picture = self.begin(view, outputs, Destination::Device)?;
        Ok(self.end(picture)?.1)
    }

    /// Renders `view`, which has the size of `screen`, and puts `layer` of it there; timed where it `is_timed`.
    #[doc(hidden)]
    pub fn show(&mut self, view: &View, layer: Layer, screen: &Screen, is_timed: bool) -> Result<FrameReport> {
        let size = (view.intrinsics.width, view.intrinsics.height);
        assert_eq!(size, (screen.width, screen.height), "the view and the screen");
        let gpu = self.gpu.clone();
        let outputs = if matches!(layer, Layer::Color | Layer::Alpha) { Outputs::Color } else { Outputs::All };
        let measure = if is_timed { Measure::Times } else { Measure::Nothing };
        let job = Job { measure, ..Job::new(view, outputs, Destination::Device) };
        self.strips(&job, None, |_, work, landed| {
            let mut rec = Recording::new();
            let strip = landed.extent.strip;
            let pixels = [strip.first_row, strip.n_rows].map(|rows| view.intrinsics.width * rows);
            screen.record(&mut rec, &work.blend.image0, work.blend.image1.as_ref(), layer, pixels);
            gpu.run(&rec)
        })
    }

    /// As [`Renderer::draw`], with the time and the work of every pass in the report.
    #[doc(hidden)]
    pub fn profile(&mut self, view: &View, outputs: Outputs) -> Result<FrameReport> {
        let job = Job { measure: Measure::Work, ..Job::new(view, outputs, Destination::Device) };
        self.strips(&job, None, |_, _, _| Ok(()))
    }

    /// Renders `views` one after the other, each while the host is busy with the one before: `done` has a view, its picture
    /// (empty where it stays on the device) and report, and says whether to go on.
    #[doc(hidden)]
    pub fn stream<E: From<Error>>(
        &mut self,
        views: impl IntoIterator<Item = View>,
        outputs: Outputs,
        destination: Destination,
        mut done: impl FnMut(&View, Frame, FrameReport) -> std::result::Result<bool, E>,
    ) -> std::result::Result<(), E> {
        let mut views = views.into_iter();
        let mut last: Option<Picture> = None;
        loop {
            let next = views.next().map(|view| self.begin(&view, outputs, destination)).transpose()?;
            if let Some(picture) = last {
                let view = picture.view.clone();
                let (frame, report) = self.end(picture)?;
                if !done(&view, frame, report)? {
                    return Ok(());
                }
            }
            if next.is_none() {
                return Ok(());
            }
            last = next;
        }
    }

    /// Hands a picture to the device and does not wait for it.
    #[doc(hidden)]
    pub fn begin(&mut self, view: &View, outputs: Outputs, destination: Destination) -> Result<Picture> {
        let job = Job::new(view, outputs, destination);
        let fits = self.longest_strip(view)? >= view.intrinsics.height;
        let launched = if fits { Some(self.launch(&job, Strip::whole(view), 1)?) } else { None };
        Ok(Picture { view: view.clone(), outputs, destination, launched })
    }

    #[doc(hidden)]
    pub fn end(&mut self, picture: Picture) -> Result<(Frame, FrameReport)> {
        let Picture { view, outputs, destination, launched } = picture;
        let job = Job::new(&view, outputs, destination);
        let mut frame = Frame { width: view.intrinsics.width, height: view.intrinsics.height, ..Frame::default() };
        let report = self.strips(&job, launched, |_, _, landed| {
            append(&mut frame, &landed.images);
            Ok(())
        })?;
        Ok((frame, report))
    }

    /// The first dispatch of a kernel in a frame, with what it worked on. The picture must be of one strip.
    #[doc(hidden)]
    pub fn dump(&mut self, view: &View, outputs: Outputs, kernel: &str) -> Result<Option<Dispatch>> {
        // Lists grow to their size.
        let report = self.draw(view, outputs)?;
        if report.strips > 1 {
            let what = format!("view `{}` in one strip (strips)", view.name);
            return Err(too_large(what, report.strips, 1, "dump it of a smaller picture"));
        }
        let rounds = (report.max_tile_list as u32).div_ceil(SEGMENT).max(1);
        let strip = Strip::whole(view);
        let Extent { n_tiles, n_pixels, .. } = Extent::new(view, strip);
        let work = Workspace::fit(&mut self.work, &self.gpu, &self.scene, self.capacity)?;
        self.gpu.write(&work.view, &[view_params(view, &self.constants, self.scene.origin, strip)])?;
        let mut rec = Recording::new();
        work.record_forward(&mut rec, &self.scene, Size { n_tiles, n_pixels, rounds }, |_| ());
        self.gpu.run_dumping(rec, kernel)
    }

    /// Gradients of sum(cotangent * output) of `view`, where `cotangents` holds the cotangents of a frame.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn vjp(&mut self, view: &View, cotangents: &Frame) -> Result<(Gradients, FrameReport)> {
        let gpu = self.gpu.clone();
        let mut gradients = Gradients::default();
        self.load_whole()?;
        let job = Job { cotangents: Some(cotangents), ..Job::new(view, Outputs::All, Destination::Device) };
        let report = self.strips(&job, None, |scene, work, _| {
            let Some(backward) = &work.backward else { return Ok(()) };
            let strip = scene.download(&gpu, backward.gradients.iter())?;
            let n_bad = gpu.read(&backward.n_bad)?.first().copied().unwrap_or(0);
            gradients.add(strip, &gpu.read(&backward.d_camera)?, n_bad, view.flow_dt);
            Ok(())
        })?;
        Ok((gradients, report))
    }

    /// An empty census of this renderer's scene, for cameras with these centres (world), over which the means of bands are.
    #[doc(hidden)]
    pub fn census(&mut self, cameras: &[[f64; 3]]) -> Result<Census> {
        self.load_whole()?;
        Census::new(&self.gpu, &self.scene, cameras)
    }

    /// Adds `view` to `census`, which this renderer made: by the cotangents of colour `signs`, which must be random signs, the
    /// information; by those that `errors` makes of the picture, its errors, the slope of half their square.
    #[doc(hidden)]
    pub fn count(
        &mut self,
        census: &Census,
        view: &View,
        signs: &Frame,
        errors: impl FnOnce(Frame) -> Frame,
    ) -> Result<()> {
        let gpu = self.gpu.clone();
        let mut frame = Frame { width: view.intrinsics.width, height: view.intrinsics.height, ..Frame::default() };
        let add = |fisher: &Fisher, scene: &SceneBuffers, work: &Workspace| {
            let Some(backward) = &work.backward else { return Ok(()) };
            let mut rec = Recording::new();
            fisher.record(&mut rec, scene, &backward.gradients, view);
            gpu.run(&rec)
        };
        let job = Job { cotangents: Some(signs), ..Job::new(view, Outputs::Color, Destination::Host) };
        self.strips(&job, None, |scene, work, landed| {
            append(&mut frame, &landed.images);
            add(&census.information, scene, work)
        })?;
        let cotangents = errors(frame);
        let job = Job { destination: Destination::Device, cotangents: Some(&cotangents), ..job };
        self.strips(&job, None, |scene, work, _| add(&census.slope, scene, work))?;
        Ok(())
    }

    /// How often a picture of `census` showed each Gaussian so far, in the scene's order; once for each of its strips.
    #[doc(hidden)]
    pub fn seen(&self, census: &Census) -> Result<Vec<f32>> {
        census.information.seen(&self.gpu, &self.scene)
    }

    /// The sums of `census` for every Gaussian, in the scene's order: information, and slope of half the squared error.
    #[doc(hidden)]
    pub fn counted(&self, census: &Census) -> Result<(Vec<Response>, Vec<Response>)> {
        Ok((census.information.read(&self.gpu, &self.scene)?, census.slope.read(&self.gpu, &self.scene)?))
    }

    /// Runs `job` strip by strip, of which the first may have been launched, and hands each finished strip to `done`.
    fn strips(
        &mut self,
        job: &Job,
        mut launched: Option<Launched>,
        mut done: impl FnMut(&SceneBuffers, &Workspace, &Landed) -> Result<()>,
    ) -> Result<FrameReport> {
        let view = job.view;
        let mut report = FrameReport::default();
        let mut strip_rows = self.longest_strip(view)?;
        let mut first_row = 0;
        while first_row < view.intrinsics.height {
            let strip = Strip { first_row, n_rows: strip_rows.min(view.intrinsics.height - first_row) };
            if let Some(landed) = self.strip(job, strip, launched.take(), &mut report)? {
                if let Some(work) = &self.work {
                    done(&self.scene, work, &landed)?;
                }
                first_row += strip.n_rows;
            } else {
                // More active Gaussians or intersections than one binding can list: fewer rows at a time.
                strip_rows = (strip.n_rows / 2).next_multiple_of(TILE);
            }
        }
        Ok(report)
    }

    fn longest_strip(&self, view: &View) -> Result<u32> {
        let row_bytes = 16 * u64::from(view.intrinsics.width);
        let limit = self.gpu.caps().max_binding_bytes;
        let rows = limit / row_bytes / u64::from(TILE) * u64::from(TILE);
        if rows == 0 {
            let what = format!("one row of tiles of view `{}` (bytes of a binding)", view.name);
            let remedy = "render a narrower picture or choose another device";
            return Err(too_large(what, row_bytes * u64::from(TILE), limit, remedy));
        }
        let whole = u64::from(view.intrinsics.height.next_multiple_of(TILE));
        Ok(rows.min(whole) as u32)
    }

    /// Runs one strip in the workspace; none when its lists do not fit a binding and those of fewer rows might.
    fn strip(
        &mut self,
        job: &Job,
        strip: Strip,
        mut launched: Option<Launched>,
        report: &mut FrameReport,
    ) -> Result<Option<Landed>> {
        let mut rounds = 1;
        loop {
            let launched = launched.take().map_or_else(|| self.launch(job, strip, rounds), Ok)?;
            let landed = self.land(&launched)?;
            match landed.outcome {
                Outcome::Complete => {}
                Outcome::Replay(capacity, new_rounds) => {
                    report.replays += 1;
                    (self.capacity, rounds) = (capacity, new_rounds);
                    continue;
                }
                Outcome::TooMuch { .. } if strip.n_rows > TILE => {
                    report.replays += 1;
                    return Ok(None);
                }
                Outcome::TooMuch { what, needed, limit } => {
                    let remedy = "render a narrower picture, a smaller scene, or choose a device with longer bindings";
                    let what = format!("view `{}`: {what} in one row of tiles", job.view.name);
                    return Err(too_large(what, needed.into(), limit.into(), remedy));
                }
            }
            report.add(&launched, &landed);
            if job.measure == Measure::Work {
                self.count_passes(&launched, &landed, report)?;
            }
            self.retire(launched);
            return Ok(Some(landed));
        }
    }

    fn count_passes(&self, launched: &Launched, landed: &Landed, report: &mut FrameReport) -> Result<()> {
        let begun = Instant::now();
        let Launched { recording, lists, extent, .. } = launched;
        if let Some(work) = &self.work {
            let counters = Counters::read(&self.gpu, work, &self.scene, lists, extent.n_tiles, extent.n_pixels)?;
            report.passes = add_passes(std::mem::take(&mut report.passes), recording, &landed.times, &counters);
            report.counters.add(&counters);
            report.barriers += launched.running.barriers();
        }
        report.counting_s += begun.elapsed().as_secs_f64();
        Ok(())
    }
}

pub(super) fn append(frame: &mut Frame, images: &[Vec<[f32; 4]>]) {
    let [image0, image1] = std::array::from_fn(|at| images.get(at).map_or(&[][..], |image| image));
    for [r, g, b, alpha] in image0 {
        frame.color.push([*r, *g, *b]);
        frame.alpha.push(*alpha);
    }
    for [depth, inverse_depth, x, y] in image1 {
        frame.depth.push(*depth);
        frame.inverse_depth.push(*inverse_depth);
        frame.flow.push([*x, *y]);
    }
}

impl FrameReport {
    pub(super) fn add(&mut self, launched: &Launched, landed: &Landed) {
        let status = &landed.status;
        let (n, n_bad) = launched.n;
        if self.strips == 0 {
            (self.gaussians, self.bad_gaussians) = (n.into(), n_bad.into());
        }
        self.active += u64::from(status.n_active);
        self.visible += u64::from(status.n_visible);
        self.intersections += u64::from(status.n_intersections);
        self.tiles += u64::from(launched.extent.n_tiles);
        self.max_tile_list = self.max_tile_list.max(u64::from(status.max_tile_list));
        self.bad_gaussians += u64::from(status.n_bad);
        self.strips += 1;
        self.read_back_s += landed.read_back_s;
        self.times.extend(landed.times.iter().cloned());
    }
}
