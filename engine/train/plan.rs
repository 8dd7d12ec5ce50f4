//! The memory plan of a run: bytes by class, the most Gaussians that fit, and what bounds them.
//!
//! `items` is the one table of the training loop's buffers; a test holds it to what a [`super::Trainer`] allocates.

use super::terms::{self};
use super::trainer::IN_FLIGHT;
use super::{Config, Setup, TermData};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::Splats;
use crate::scene::capture::{Capture, decoded_bytes, pixel_bytes};
use crate::stage::{AdamMode, GRID_BYTES, Grids, Lpips, Sums};
use crate::vk::DeviceKind;
use std::collections::BTreeSet;
use std::fmt;

/// Assumed pairs with tiles of a Gaussian, on average, in the view that has most of them: runs have 2 to 10.
const INTERSECTIONS_PER_GAUSSIAN: f64 = 4.0;

/// Quarters of the memory that a run with the most Gaussians leaves that pictures may take: lists may grow longer.
const IMAGE_QUARTERS: u64 = 3;

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Workload {
    pub gaussians: u64,
    /// Dynamic ones among them; their share is assumed to stay.
    pub dynamic: u64,
    pub max_gaussians: u64,
    /// Pairs with tiles per Gaussian, in the view that has most of them.
    pub intersections_per_gaussian: f64,
    /// Of the largest picture.
    pub pixels: u64,
    pub sh_degree: u32,
    pub moment_bits: u32,
    pub batch: u32,
    pub cache_bytes: u64,
    pub image_bytes: u64,
    /// Bytes of training images to keep on the device; none for a share of what the rest leaves.
    pub kept_image_bytes: Option<u64>,
    pub data: TermData,
    /// Adam moves the Gaussians out of view, too.
    pub dense: bool,
    pub learns_cameras: bool,
    pub grids: u64,
    pub sums: Sums,
    /// Pixel rows of the largest picture.
    pub height: u32,
    /// Bytes of LPIPS's features, and of the largest of their buffers: of the loss, and of scores.
    pub lpips: [[u64; 2]; 2],
}

impl Workload {
    pub fn of(
        capture: &Capture,
        config: &Config,
        setup: &Setup,
        n: u64,
        n_dynamic: u64,
        gpu: &Gpu,
        memory: ImageMemory,
    ) -> Result<Self> {
        let image_bytes = decoded_bytes(capture, setup.data.depth, setup.data.flow);
        let pixels = capture.cameras.iter().map(|camera| camera.intrinsics.n_pixels());
        Ok(Workload {
            gaussians: n,
            dynamic: n_dynamic,
            max_gaussians: config.max_gaussians as u64,
            intersections_per_gaussian: INTERSECTIONS_PER_GAUSSIAN,
            pixels: pixels.max().unwrap_or(0),
            sh_degree: config.sh_degree,
            moment_bits: config.moment_bits,
            batch: config.batch,
            cache_bytes: memory.cache_bytes.min(image_bytes),
            image_bytes,
            kept_image_bytes: memory.device_bytes,
            data: setup.data,
            dense: config.adam == AdamMode::Dense,
            learns_cameras: !(setup.learns_offset.is_empty() && setup.learns_pose.is_empty()),
            grids: setup.most_grids as u64,
            sums: config.accumulation.on(gpu.caps()),
            height: capture.cameras.iter().map(|camera| camera.intrinsics.height).max().unwrap_or(0),
            lpips: lpips_bytes(capture, config, gpu)?,
        })
    }
}

/// [`Workload::lpips`]: the most over the training cameras, and over the test cameras. None for views that LPIPS
/// cannot take.
fn lpips_bytes(capture: &Capture, config: &Config, gpu: &Gpu) -> Result<[[u64; 2]; 2]> {
    let Some(file) = &config.loss.lpips_weights else { return Ok([[0; 2]; 2]) };
    let (lpips, most_bytes) = (Lpips::load(gpu, file)?, gpu.caps().max_binding_bytes);
    let largest = |is_test: bool, bytes: &dyn Fn([u32; 2]) -> Result<[u64; 2]>| {
        let cameras = capture.cameras.iter().filter(|camera| camera.is_test == is_test);
        let sizes: BTreeSet<[u32; 2]> = cameras.map(|camera| camera.intrinsics).map(|i| [i.width, i.height]).collect();
        let of_sizes = sizes.into_iter().filter_map(|size| bytes(size).ok());
        of_sizes.fold([0; 2], |[all, one], [more, other]| [all.max(more), one.max(other)])
    };
    let crop = if config.loss.lpips_crop > 0 { config.loss.lpips_crop } else { u32::MAX };
    let of_loss = largest(false, &|size| lpips.loss_bytes(size.map(|side| side.min(crop))));
    let of_scores = largest(true, &|size| lpips.score_bytes(size, most_bytes));
    Ok([if config.loss.has_lpips() { of_loss } else { [0; 2] }, of_scores])
}

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Limits {
    pub binding_bytes: u64,
    pub memory_bytes: u64,
    /// The memory is the host's: a software driver.
    pub is_host: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    Parameters,
    /// Moments of Adam, state of density control, and gradients with their sums if a step has several images.
    Moments,
    /// Scratch per Gaussian in view: culling, projection, the sort by depth.
    Active,
    /// Scratch per pair of a Gaussian and a tile: lists, their sort, slots of gradients.
    Intersections,
    Pixels,
    Cameras,
}

impl Class {
    pub const ALL: [Class; 6] =
        [Class::Parameters, Class::Moments, Class::Active, Class::Intersections, Class::Pixels, Class::Cameras];

    fn label(self) -> &'static str {
        match self {
            Class::Parameters => "parameters",
            Class::Moments => "moments",
            Class::Active => "per Gaussian in view",
            Class::Intersections => "per intersection",
            Class::Pixels => "per pixel",
            Class::Cameras => "bilateral grids",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Per {
    Gaussian,
    Dynamic,
    Intersection,
    Pixel,
    Camera,
    Once,
}

impl Per {
    fn count(self, work: &Workload, gaussians: f64) -> f64 {
        match self {
            Per::Gaussian => gaussians,
            Per::Dynamic => gaussians * work.dynamic as f64 / work.gaussians.max(1) as f64,
            Per::Intersection => gaussians * work.intersections_per_gaussian,
            Per::Pixel => work.pixels as f64,
            Per::Camera => work.grids as f64,
            Per::Once => 1.0,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Item {
    name: &'static str,
    class: Class,
    per: Per,
    /// Of all of them.
    bytes: f64,
    /// Bytes of the one that a single binding must see; 0 where it is cut into groups that fit.
    bound: f64,
}

/// Every buffer of a training step that grows with the work. Tiles, counters and transfers are left out: below 1 %.
fn items(work: &Workload, is_host: bool) -> Vec<Item> {
    use {Class::*, Per::*};
    let item = |name, class, per, bytes: f64| Item { name, class, per, bytes, bound: bytes };
    let cut = |name, class, per, bytes: f64| Item { name, class, per, bytes, bound: 0.0 };
    // Geometry, the constant band, and those above it.
    let bands = [48.0, 64.0, 96.0];
    let each = 48.0 + 16.0 + bands[..work.sh_degree.min(3) as usize].iter().sum::<f64>();
    let moments = f64::from(work.moment_bits / 16);
    let image = pixel_bytes(work.data.depth, work.data.flow) as f64;
    let mut items = vec![
        cut("parameters", Parameters, Gaussian, each),
        cut("parameters", Parameters, Dynamic, 16.0),
        cut("bound", Parameters, Gaussian, 16.0),
        cut("window", Parameters, Dynamic, 4.0),
        cut("moments", Moments, Gaussian, moments * each),
        cut("moments", Moments, Dynamic, moments * 16.0),
        cut("state", Moments, Gaussian, 16.0),
        item("splats", Active, Gaussian, 64.0),
    ];
    let ids = ["active ids", "depth keys", "depth order", "tile counts", "tile offsets", "sort keys", "sort values"];
    items.extend(ids.map(|name| item(name, Active, Gaussian, 4.0)));
    items.push(item("sort counts", Active, Gaussian, 0.5));
    let keys = ["tile keys", "tile splats", "sort keys", "sort values"];
    items.extend(keys.map(|name| item(name, Intersections, Intersection, 4.0)));
    items.extend([
        item("sort counts", Intersections, Intersection, 0.5),
        item("image color", Pixels, Pixel, 16.0),
        item("image tail", Pixels, Pixel, 8.0),
        item("d image color", Pixels, Pixel, 16.0),
        Item { bound: 4.0, ..item("truth", Pixels, Pixel, image) },
        Item { bound: 4.0, ..item("staged truth", Pixels, Pixel, image * IN_FLIGHT as f64) },
    ]);
    if is_host {
        items.push(item("blend carry", Pixels, Pixel, 8.0));
    } else {
        let extra = if work.data == TermData::NONE { 0.0 } else { 16.0 };
        let of_pixel = [("chunk color", 16.0), ("chunk depth flow", extra), ("chunk light", 4.0), ("chunk last", 4.0)];
        // Two chunks of 256 pixels for 1,024 intersections.
        items.extend(of_pixel.map(|(name, bytes)| item(name, Intersections, Intersection, bytes / 2.0)));
    }
    items.extend(match work.sums {
        Sums::Slots => vec![
            item("slot first", Active, Gaussian, 4.0),
            item("frame sums", Intersections, Intersection, 48.0),
            item("slots", Intersections, Intersection, 4.0),
            item("sorted splats", Intersections, Intersection, 4.0),
        ],
        Sums::Fixed32 | Sums::Fixed64 => {
            vec![item("d slots", Active, Gaussian, 48.0), item("frame sums", Active, Gaussian, 104.0)]
        }
    });
    let lpips = ["lpips features", "lpips features of scores"].into_iter().zip(work.lpips);
    items.extend(
        lpips.map(|(name, [bytes, bound])| Item { bound: bound as f64, ..item(name, Pixels, Once, bytes as f64) }),
    );
    items.extend(terms::buffers(work.data).map(|(name, bytes)| item(name, Pixels, Pixel, bytes)));
    if work.grids > 0 {
        let of_camera = (GRID_BYTES / 3) as f64;
        let maps = ["bilateral grids", "bilateral first moments", "bilateral second moments"];
        items.extend(maps.map(|name| item(name, Cameras, Camera, of_camera)));
        items.extend([
            item("d bilateral grid", Cameras, Once, of_camera),
            item("bilateral partials", Cameras, Once, Grids::scratch_bytes(work.height) as f64),
            item("image graded", Pixels, Pixel, 16.0),
            item("d image graded", Pixels, Pixel, 16.0),
        ]);
    }
    items.extend(batch_items(work, each));
    items.extend((work.dense && work.batch == 1).then(|| item("idle ids", Active, Gaussian, 4.0)));
    items.extend(work.learns_cameras.then(|| item("d camera of each", Active, Gaussian, 32.0)));
    items
}

/// Additional buffers of steps on several images, for parameters of `each` bytes a static Gaussian.
fn batch_items(work: &Workload, each: f64) -> Vec<Item> {
    if work.batch == 1 {
        return Vec::new();
    }
    let cut = |name, per, bytes: f64| Item { name, class: Class::Moments, per, bytes, bound: 0.0 };
    let mut items = vec![
        cut("gradients", Per::Gaussian, each),
        cut("gradients", Per::Dynamic, 16.0),
        cut("gradient sums", Per::Gaussian, 2.0 * each),
        cut("gradient sums", Per::Dynamic, 32.0),
    ];
    if work.grids > 0 {
        let of_step = f64::from(work.batch) * (GRID_BYTES / 3) as f64;
        let (class, per) = (Class::Cameras, Per::Once);
        items.push(Item { name: "d grids of a step", class, per, bytes: of_step, bound: of_step });
    }
    items
}

/// Bytes that a number of Gaussians needs.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Need {
    pub gaussians: u64,
    /// Name, class, bytes of all buffers of this name and class.
    pub buffers: Vec<(&'static str, Class, u64)>,
}

impl Need {
    fn new(work: &Workload, gaussians: u64, is_host: bool) -> Self {
        let bytes = |item: &Item| (item.bytes * item.per.count(work, gaussians as f64)) as u64;
        let buffers = items(work, is_host).iter().map(|item| (item.name, item.class, bytes(item))).collect();
        Need { gaussians, buffers }
    }

    pub fn class(&self, class: Class) -> u64 {
        self.buffers.iter().filter(|(_, of, _)| *of == class).map(|(.., bytes)| bytes).sum()
    }

    pub fn bytes(&self) -> u64 {
        self.buffers.iter().map(|(.., bytes)| bytes).sum()
    }
}

#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BoundBy {
    MaxGaussians,
    Binding(&'static str),
    Memory,
}

impl fmt::Display for BoundBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BoundBy::MaxGaussians => write!(f, "--max-gaussians"),
            BoundBy::Binding(name) => write!(f, "largest single buffer: `{name}`"),
            BoundBy::Memory => write!(f, "device memory"),
        }
    }
}

/// The memory of a run, and how far it can grow.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Plan {
    /// At the beginning.
    pub begin: Need,
    /// With the most Gaussians.
    pub full: Need,
    /// The limit of the most Gaussians.
    pub bound_by: BoundBy,
    /// Limits of the device.
    pub limits: Limits,
    /// Bytes of decoded pictures, in the host's memory.
    pub cache_bytes: u64,
    /// Bytes of pictures that stay on the device.
    pub image_bytes: u64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageMemory {
    /// The most bytes of decoded pictures in the host's memory.
    pub cache_bytes: u64,
    /// Bytes of pictures that stay on the device; none for a share of what the rest leaves.
    pub device_bytes: Option<u64>,
}

impl Plan {
    /// The plan of a run on `capture` that begins with `splats` and has so much memory for pictures.
    ///
    /// # Errors
    /// As [`Workload::of`].
    pub fn of(
        capture: &Capture,
        config: &Config,
        setup: &Setup,
        splats: &Splats,
        gpu: &Gpu,
        memory: ImageMemory,
    ) -> Result<Self> {
        let n_dynamic = splats.motion.len() as u64;
        let work = Workload::of(capture, config, setup, splats.len() as u64, n_dynamic, gpu, memory)?;
        let caps = gpu.caps();
        let is_host = caps.kind == DeviceKind::Cpu;
        Ok(Plan::new(
            &work,
            &Limits { binding_bytes: caps.max_binding_bytes, memory_bytes: caps.budget_bytes, is_host },
        ))
    }

    /// [`Plan::full`] has no Gaussian if a picture alone is too much.
    #[doc(hidden)]
    pub fn new(work: &Workload, limits: &Limits) -> Self {
        let binding = limits.binding_bytes as f64;
        // As many Gaussians as one binding sees.
        let by_binding = |item: &Item| match item.per {
            Per::Pixel | Per::Camera | Per::Once if item.bound * item.per.count(work, 0.0) <= binding => u64::MAX,
            Per::Pixel | Per::Camera | Per::Once => 0,
            per => (binding / (item.bound * per.count(work, 1.0))) as u64,
        };
        let by_memory = {
            let cache = if limits.is_host { work.cache_bytes } else { 0 };
            // Bytes are linear in the number.
            let [fixed, million] = [0, 1_000_000].map(|n| Need::new(work, n, limits.is_host).bytes());
            limits.memory_bytes.saturating_sub(fixed + cache) as f64 * 1e6 / (million - fixed) as f64
        };
        let bindings = items(work, limits.is_host).into_iter().filter(|item| item.bound > 0.0);
        let bounds = bindings.map(|item| (by_binding(&item), BoundBy::Binding(item.name)));
        let all = [(work.max_gaussians, BoundBy::MaxGaussians), (by_memory as u64, BoundBy::Memory)].into_iter();
        let (most, bound_by) = all.chain(bounds).min_by_key(|(most, _)| *most).unwrap_or((0, BoundBy::MaxGaussians));
        let full = Need::new(work, most, limits.is_host);
        // Scores need as much memory again. A software driver counts the host's cache as memory of the device already.
        let left = if limits.is_host { 0 } else { limits.memory_bytes.saturating_sub(2 * full.bytes()) };
        Plan {
            begin: Need::new(work, work.gaussians, limits.is_host),
            full,
            bound_by,
            limits: *limits,
            cache_bytes: work.cache_bytes,
            image_bytes: work.kept_image_bytes.unwrap_or(left / 4 * IMAGE_QUARTERS).min(work.image_bytes),
        }
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let Plan { begin, full, bound_by, limits, cache_bytes, image_bytes } = self;
        writeln!(f, "{:<22} {:>12} {:>12} Gaussians", "memory, MiB", begin.gaussians, full.gaussians)?;
        let classes = Class::ALL.map(|class| (class.label(), begin.class(class), full.class(class)));
        let device = [
            ("device", begin.bytes(), full.bytes()),
            ("images (device)", *image_bytes, *image_bytes),
            ("frame cache (host)", *cache_bytes, *cache_bytes),
        ];
        for (label, begin, full) in classes.into_iter().chain(device) {
            writeln!(f, "  {label:<20} {:>12.1} {:>12.1}", mib(begin), mib(full))?;
        }
        let (memory, binding) = (mib(limits.memory_bytes), mib(limits.binding_bytes));
        write!(
            f,
            "limit: {} Gaussians ({bound_by}); device memory {memory:.0} MiB, largest single buffer {binding:.0} MiB",
            full.gaussians
        )
    }
}
