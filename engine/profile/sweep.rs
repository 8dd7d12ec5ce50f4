//! How the time of a step and of a frame grows with Gaussians, pixels, the length of a clip and cameras: each grows by itself, the
//! others stay.

use super::exponent::Exponent;
use super::probe::WarmUp;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::random::Random;
use crate::report::statistics::median;
use crate::scene::capture::{Extent, Picture};
use crate::scene::{FlowModel, Intrinsics, Motion, Pose, Splats, View};
use crate::settings::Constants;
use crate::stage::{AdamMode, Outputs, Renderer};
use crate::train::{Config, Density, Setup, Trainer};
use crate::vk::Caps;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};

#[derive(Clone, Copy, Debug, Serialize)]
pub struct SweepOptions {
    /// Gaussians that live at a time while something else than they grows.
    pub gaussians: usize,
    /// Most Gaussians of a scene.
    pub most_gaussians: usize,
    pub size: [u32; 2],
    /// Seconds in all; what would take longer is left out.
    pub seconds: f64,
    pub adam: AdamMode,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Grows {
    /// Frames of the clip, each with as many living Gaussians.
    Frames,
    /// Cameras that are trained on, each with its clock and its grid.
    Cameras,
    Pixels,
    /// Gaussians, which become smaller, so that they cover the picture as often.
    Gaussians,
}

#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Frames, cameras, pixels or Gaussians.
    pub size: f64,
    pub gaussians: usize,
    pub active: f64,
    pub intersections: f64,
    /// A step, milliseconds of the host's clock: median of blocks of steps.
    pub step_ms: f64,
    /// A frame that stays on the device: median.
    pub frame_ms: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct Course {
    pub grows: Grows,
    pub points: Vec<Point>,
    /// By which powers of the size a step and a frame grow; none of a single point.
    pub step: Option<Exponent>,
    pub frame: Option<Exponent>,
}

#[derive(Clone, Debug, Serialize)]
pub struct Sweep {
    pub device: Caps,
    pub shaders: String,
    pub options: SweepOptions,
    pub courses: Vec<Course>,
    pub left_out: Vec<String>,
    pub seconds: f64,
}

impl SweepOptions {
    pub fn points(&self) -> usize {
        Grows::ALL.iter().map(|grows| grows.works(self).len()).sum()
    }
}

impl Default for SweepOptions {
    fn default() -> Self {
        let (gaussians, most_gaussians, size) = (2_000, 300_000, [192, 144]);
        SweepOptions { gaussians, most_gaussians, size, seconds: 240.0, adam: AdamMode::default() }
    }
}

#[derive(Clone, Copy)]
struct Work {
    /// Gaussians that live at a time.
    alive: usize,
    size: [u32; 2],
    frames: usize,
    cameras: usize,
}

/// Frames that a Gaussian of a clip is visible in, and its tau in frames: opacity 0.62 fades to 1 / 255 in 2.25 tau.
const LIFE: f64 = 4.5;
const TAU: f64 = 1.0;
const OPACITY: f32 = 0.5;
/// How often the Gaussians cover a picture, in squares of their standard deviations.
const COVER: f64 = 0.5;
/// Steps of a block that is timed, and blocks or frames at a point: at least, and at most.
const STEPS: usize = 4;
const SAMPLES: [usize; 2] = [3, 9];
/// Share of a course's time that one point may take beyond its fewest samples.
const SHARE: f64 = 0.15;
/// Steps of the run that is timed: rates are those of a long one, which moves nothing far in a few steps.
const TOTAL: u64 = 30_000;

impl Grows {
    pub const ALL: [Grows; 4] = [Grows::Frames, Grows::Cameras, Grows::Pixels, Grows::Gaussians];

    pub fn name(self) -> &'static str {
        match self {
            Grows::Frames => "frames",
            Grows::Cameras => "cameras",
            Grows::Pixels => "pixels",
            Grows::Gaussians => "Gaussians",
        }
    }

    fn works(self, options: &SweepOptions) -> Vec<(f64, Work)> {
        let base = Work { alive: options.gaussians, size: options.size, frames: 1, cameras: 8 };
        let fours = (0..4).map(|k| 4usize.pow(k));
        match self {
            Grows::Frames => fours.map(|n| 12 * n).map(|frames| (frames as f64, Work { frames, ..base })).collect(),
            Grows::Cameras => fours.map(|n| 2 * n).map(|cameras| (cameras as f64, Work { cameras, ..base })).collect(),
            Grows::Pixels => {
                let sizes = (0..4).map(|k| base.size.map(|side| (side / 2 * 2u32.pow(k)).max(1)));
                sizes.map(|size| (f64::from(size[0]) * f64::from(size[1]), Work { size, ..base })).collect()
            }
            Grows::Gaussians => {
                let threes = (0..4).flat_map(|k| [1, 3].map(|first| first * 10usize.pow(k)));
                let sizes = threes.map(|times| 5 * base.alive * times).filter(|n| *n <= options.most_gaussians);
                sizes.map(|alive| (alive as f64, Work { alive, ..base })).collect()
            }
        }
    }
}

impl Work {
    fn gaussians(&self) -> usize {
        match self.frames {
            1 => self.alive,
            frames => (self.alive as f64 * frames as f64 / LIFE).ceil() as usize,
        }
    }

    /// Step or frame `k`'s camera and view: times in the middle of the clip, where as many live at each.
    fn view_of(&self, k: usize) -> (usize, View) {
        let ([width, height], camera) = (self.size, k % self.cameras);
        let (first, n) = (self.frames / 4, (self.frames / 2).max(1));
        let frame = first + 7 * k % n;
        let [f, h] = self.size.map(f64::from);
        // Cameras a little apart, so that all see the same.
        let aside = 0.05 * (camera as f64 / self.cameras as f64 - 0.5);
        let view = View {
            name: format!("camera {camera}"),
            intrinsics: Intrinsics { width, height, fx: f, fy: f, cx: 0.5 * f, cy: 0.5 * h },
            pose: Pose { translation: [aside, 0.0, 0.0].into(), ..Pose::default() },
            time: frame as f64 / self.frames as f64,
            time_offset: 0.0,
            flow_dt: 1.0 / self.frames as f64,
            background: [0.0; 3],
            flow_model: FlowModel::Velocity,
            next_pose: None,
        };
        (camera, view)
    }

    /// Gaussians in the view of all cameras; those of a clip in order of time, as they are laid down frame by frame.
    fn splats(&self, sh_degree: u32) -> Splats {
        let n = self.gaussians();
        let mut random = Random::new(n as u64);
        let mut splats = Splats::new(sh_degree);
        let n_coefficients = splats.n_coefficients();
        let [width, height] = self.size.map(f64::from);
        let pixels = (COVER * width * height / self.alive as f64).sqrt();
        for i in 0..n {
            let depth = random.uniform(2.0, 6.0);
            let at = [width, height].map(|side| 0.5 * depth * side / width * random.uniform(-0.95, 0.95));
            splats.position.push([at[0], at[1], depth].map(|x| x as f32));
            splats.rotation.push(random.vector(-1.0, 1.0));
            let scale = (pixels * depth / width).ln();
            splats.scale.push([0; 3].map(|_| (scale + random.uniform(-0.5, 0.5)) as f32));
            splats.opacity.push(OPACITY);
            splats.sh.push(random.vector(-0.5, 0.5));
            splats.sh.extend((1..n_coefficients).map(|_| random.vector::<3>(-0.05, 0.05)));
            let t_scale = if self.frames == 1 { 10.0f64.ln() } else { (TAU / self.frames as f64).ln() };
            let t_center = ((i as f64 + 0.5) / n as f64) as f32;
            splats.motion.push(Motion { velocity: random.vector(-0.1, 0.1), t_center, t_scale: t_scale as f32 });
            splats.source_row.push(i as u32);
        }
        splats
    }
}

impl Sweep {
    /// `begins` is called before each point. What does not fit the device is left out.
    pub fn measure(gpu: &Arc<Gpu>, options: &SweepOptions, begins: &mut dyn FnMut()) -> Result<Self> {
        let begun = Instant::now();
        let mut left_out = Vec::new();
        let mut courses = Vec::new();
        for (at, grows) in Grows::ALL.into_iter().enumerate() {
            // What one course leaves, the others have.
            let rest = options.seconds - begun.elapsed().as_secs_f64();
            let seconds = rest / (Grows::ALL.len() - at) as f64;
            courses.push(Course::measure(gpu, options, grows, seconds, &mut left_out, begins)?);
        }
        let (device, shaders) = (gpu.caps().clone(), crate::gpu::shaders_hash());
        let seconds = begun.elapsed().as_secs_f64();
        Ok(Sweep { device, shaders, options: *options, courses, left_out, seconds })
    }
}

impl Course {
    fn measure(
        gpu: &Arc<Gpu>,
        options: &SweepOptions,
        grows: Grows,
        seconds: f64,
        left_out: &mut Vec<String>,
        begins: &mut dyn FnMut(),
    ) -> Result<Self> {
        let begun = Instant::now();
        let mut points: Vec<Point> = Vec::new();
        // Seconds that the last two points took.
        let mut took = [0.0f64; 2];
        for (size, work) in grows.works(options) {
            let expected = took[1] * if took[0] > 0.0 { (took[1] / took[0]).max(1.0) } else { 1.0 };
            let rest = seconds - begun.elapsed().as_secs_f64();
            let fault = if work.gaussians() > options.most_gaussians {
                format!("{} Gaussians are more than asked for", work.gaussians())
            } else if expected > rest {
                format!("would take some {expected:.0} s, and {:.0} are left", rest.max(0.0))
            } else {
                begins();
                let began = Instant::now();
                match work.measure(gpu, options, size, Duration::from_secs_f64((SHARE * seconds).max(0.0))) {
                    Ok(point) => {
                        points.push(point);
                        took = [took[1], began.elapsed().as_secs_f64()];
                        continue;
                    }
                    Err(error @ Error::OutOfMemory { .. }) => error.to_string(),
                    Err(error) => return Err(error),
                }
            };
            left_out.push(format!("{size} {}: {fault}", grows.name()));
            break;
        }
        let fit = |ms: fn(&Point) -> f64| Exponent::of(points.iter().map(|point| [point.size, ms(point)]));
        Ok(Course { grows, step: fit(|point| point.step_ms), frame: fit(|point| point.frame_ms), points })
    }
}

impl Work {
    fn measure(&self, gpu: &Arc<Gpu>, options: &SweepOptions, size: f64, time: Duration) -> Result<Point> {
        let config = Config {
            adam: options.adam,
            // Nothing is added or removed.
            density: Density { stop: 0.0, reset_every: 0, ..Density::default() },
            ..Config::default()
        };
        let splats = self.splats(config.sh_degree);
        let frame_ms = self.frame_ms(gpu, &splats, time)?;
        let extent = Extent { center: [0.0; 3], radius: 3.0 };
        let every = vec![true; self.cameras];
        let setup = Setup {
            n_filming: self.cameras,
            learns_offset: every.clone(),
            has_grid: every,
            ..Setup::plain(extent, 1.0 / self.frames as f64)
        };
        let mut trainer = Trainer::new(gpu.clone(), &splats, Constants::default(), config, TOTAL, setup)?;
        let picture = noise(self.size);
        let mut heat = WarmUp::new(gpu)?;
        let mut taken = 0;
        let mut steps = |trainer: &mut Trainer, n: usize| {
            for _ in 0..n {
                let (camera, view) = self.view_of(taken);
                trainer.train(camera, &view, &picture)?;
                taken += 1;
            }
            trainer.finish()
        };
        // Kernels are compiled at their first dispatch, and lists grow to their size.
        steps(&mut trainer, STEPS)?;
        heat.before(gpu)?;
        let step_ms = sampled(time, || steps(&mut trainer, STEPS))? / STEPS as f64;
        let (camera, view) = self.view_of(0);
        let counters = trainer.profile(camera, &view, &picture)?.counters;
        Ok(Point {
            size,
            gaussians: splats.len(),
            active: counters.active,
            intersections: counters.intersections,
            step_ms,
            frame_ms,
        })
    }

    fn frame_ms(&self, gpu: &Arc<Gpu>, splats: &Splats, time: Duration) -> Result<f64> {
        let mut renderer = Renderer::new(gpu.clone(), splats, Constants::default())?;
        let mut drawn = 0;
        let mut draw = || {
            drawn += 1;
            renderer.draw(&self.view_of(drawn).1, Outputs::Color)
        };
        draw()?;
        WarmUp::new(gpu)?.before(gpu)?;
        sampled(time, || draw().map(drop))
    }
}

/// Median of the milliseconds that `what` takes, within `time` where that is more than the fewest samples take.
fn sampled(time: Duration, mut what: impl FnMut() -> Result<()>) -> Result<f64> {
    let begun = Instant::now();
    let mut ms = Vec::new();
    while ms.len() < SAMPLES[0] || (ms.len() < SAMPLES[1] && begun.elapsed() < time) {
        let began = Instant::now();
        what()?;
        ms.push(1e3 * began.elapsed().as_secs_f64());
    }
    Ok(median(&ms))
}

fn noise([width, height]: [u32; 2]) -> Picture {
    let mut random = Random::new(1);
    let pixels = (0..width * height).map(|_| random.bits() as u32 | 0xff00_0000).collect();
    Picture::new(width, height, pixels)
}
