//! The memory plan of a run, before it begins: bytes by class, the most Gaussians that fit, and what bounds them.
//!
//! `items` is the one table of the training loop's buffers; a test holds it to what a [`super::Trainer`] allocates.

use super::config::Config;
use super::setup::Setup;
use super::terms::{self, TermData};
use super::trainer::IN_FLIGHT;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::Splats;
use crate::scene::capture::{Capture, decoded_bytes, pixel_bytes};
use crate::stage::{AdamMode, GRID_BYTES, Grids, Lpips, Sums};
use crate::vk::DeviceKind;
use std::collections::BTreeSet;
use std::fmt;

/// Assumed pairs with tiles of a Gaussian, on average over all, in the view that has most of them: runs have 2 to 10,
/// fewest if Gaussians are small. A run that has more grows its lists.
const INTERSECTIONS_PER_GAUSSIAN: f64 = 4.0;

/// Pictures may take so many quarters of the memory that a run with the most Gaussians leaves: its lists may grow
/// longer than planned, and others use the device too.
const IMAGE_QUARTERS: u64 = 3;

/// The size of a run.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Workload {
    /// Gaussians to begin with.
    pub gaussians: u64,
    /// Dynamic ones among them; their share is assumed to stay.
    pub dynamic: u64,
    /// Gaussians never exceed this.
    pub max_gaussians: u64,
    /// Pairs with tiles per Gaussian, in the view that has most of them.
    pub intersections_per_gaussian: f64,
    /// Pixels of the largest picture.
    pub pixels: u64,
    /// Highest degree of the spherical harmonics, 0 to 3.
    pub sh_degree: u32,
    /// Bits of each of Adam's moments: 32, or 16.
    pub moment_bits: u32,
    /// Images of a step.
    pub batch: u32,
    /// Bytes of decoded pictures kept ahead, in the host's memory.
    pub cache_bytes: u64,
    /// Bytes of all training images.
    pub image_bytes: u64,
    /// Bytes of them to keep on the device; none for a share of what the rest leaves.
    pub kept_image_bytes: Option<u64>,
    /// Data of the capture that the terms of the loss use beside its colours.
    pub data: TermData,
    /// Adam moves the Gaussians out of view, too.
    pub dense: bool,
    /// Cameras' time offsets or poses are learnt.
    pub learns_cameras: bool,
    /// Cameras that have a bilateral grid.
    pub grids: u64,
    /// How gradients are added up.
    pub sums: Sums,
    /// Pixel rows of the largest picture.
    pub height: u32,
    /// Bytes of LPIPS's features, and of the largest of their buffers: of the loss, if it has LPIPS, and of scores.
    pub lpips: [[u64; 2]; 2],
}

impl Workload {
    /// A run on `capture` that begins with `n` Gaussians, `n_dynamic` of them dynamic, on a device.
    ///
    /// # Errors
    /// Those of the weights of LPIPS.
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

/// Limits of the device.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Limits {
    /// Longest range that one binding can see, bytes.
    pub binding_bytes: u64,
    /// Memory, bytes.
    pub memory_bytes: u64,
    /// It is the host's memory: a software driver.
    pub is_host: bool,
}

/// Classes of buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// The Gaussians, and their bounds for culling.
    Parameters,
    /// First and second moments of Adam, the state of density control, and gradients with their sums if a step has
    /// several images.
    Moments,
    /// Scratch per Gaussian in view: culling, projection, the sort by depth.
    Active,
    /// Scratch per pair of a Gaussian and a tile: lists, their sort, slots of gradients.
    Intersections,
    /// Scratch per pixel: images, their cotangents, the loss.
    Pixels,
    /// Bilateral grids, their moments and scratch.
    Cameras,
}

impl Class {
    /// All of them, in the order of the table.
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

/// The quantity that the length of a buffer grows with.
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
    /// The number of items with `gaussians`.
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

/// Buffers of one name.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Item {
    /// As the device knows it.
    name: &'static str,
    class: Class,
    per: Per,
    /// Bytes of all of them.
    bytes: f64,
    /// Bytes of the one that a single binding must see; 0 where it is cut into groups that fit.
    bound: f64,
}

/// Every buffer of a training step that grows with the work. Tiles, counters and transfers are left out: below 1 %.
fn items(work: &Workload, is_host: bool) -> Vec<Item> {
    use {Class::*, Per::*};
    let item = |name, class, per, bytes: f64, bound: f64| Item { name, class, per, bytes, bound };
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
        item("splats", Active, Gaussian, 64.0, 64.0),
        item("active ids", Active, Gaussian, 4.0, 4.0),
        item("depth keys", Active, Gaussian, 4.0, 4.0),
        item("depth order", Active, Gaussian, 4.0, 4.0),
        item("tile counts", Active, Gaussian, 4.0, 4.0),
        item("tile offsets", Active, Gaussian, 4.0, 4.0),
        item("sort keys", Active, Gaussian, 4.0, 4.0),
        item("sort values", Active, Gaussian, 4.0, 4.0),
        item("sort counts", Active, Gaussian, 0.5, 0.5),
        item("tile keys", Intersections, Intersection, 4.0, 4.0),
        item("tile splats", Intersections, Intersection, 4.0, 4.0),
        item("sort keys", Intersections, Intersection, 4.0, 4.0),
        item("sort values", Intersections, Intersection, 4.0, 4.0),
        item("sort counts", Intersections, Intersection, 0.5, 0.5),
        item("image color", Pixels, Pixel, 16.0, 16.0),
        item("image tail", Pixels, Pixel, 8.0, 8.0),
        item("d image color", Pixels, Pixel, 16.0, 16.0),
        item("truth", Pixels, Pixel, image, 4.0),
        item("staged truth", Pixels, Pixel, image * IN_FLIGHT as f64, 4.0),
    ];
    if is_host {
        items.push(item("blend carry", Pixels, Pixel, 8.0, 8.0));
    } else {
        let extra = if work.data == TermData::NONE { 0.0 } else { 16.0 };
        let of_pixel = [("chunk color", 16.0), ("chunk depth flow", extra), ("chunk light", 4.0), ("chunk last", 4.0)];
        // Two chunks of 256 pixels for 1,024 intersections.
        items.extend(of_pixel.map(|(name, bytes)| item(name, Intersections, Intersection, bytes / 2.0, bytes / 2.0)));
    }
    items.extend(match work.sums {
        Sums::Slots => vec![
            item("slot first", Active, Gaussian, 4.0, 4.0),
            item("frame sums", Intersections, Intersection, 48.0, 48.0),
            item("slots", Intersections, Intersection, 4.0, 4.0),
            item("sorted splats", Intersections, Intersection, 4.0, 4.0),
        ],
        Sums::Fixed32 | Sums::Fixed64 => {
            vec![item("d slots", Active, Gaussian, 48.0, 48.0), item("frame sums", Active, Gaussian, 104.0, 104.0)]
        }
    });
    items.extend(lpips_items(work));
    items.extend(terms::buffers(work.data).map(|(name, bytes)| item(name, Pixels, Pixel, bytes, bytes)));
    if work.grids > 0 {
        let of_camera = (GRID_BYTES / 3) as f64;
        let partials = Grids::scratch_bytes(work.height) as f64;
        items.extend([
            item("bilateral grids", Cameras, Camera, of_camera, of_camera),
            item("bilateral first moments", Cameras, Camera, of_camera, of_camera),
            item("bilateral second moments", Cameras, Camera, of_camera, of_camera),
            item("d bilateral grid", Cameras, Once, of_camera, of_camera),
            item("bilateral partials", Cameras, Once, partials, partials),
            item("image graded", Pixels, Pixel, 16.0, 16.0),
            item("d image graded", Pixels, Pixel, 16.0, 16.0),
        ]);
    }
    items.extend(batch_items(work, each));
    items.extend((work.dense && work.batch == 1).then(|| item("idle ids", Active, Gaussian, 4.0, 4.0)));
    items.extend(work.learns_cameras.then(|| item("d camera of each", Active, Gaussian, 32.0, 32.0)));
    items
}

/// Buffers of LPIPS in a step and in scores.
fn lpips_items(work: &Workload) -> impl Iterator<Item = Item> {
    let item = |(name, [bytes, bound]): (&'static str, [u64; 2])| {
        let (class, per) = (Class::Pixels, Per::Once);
        Item { name, class, per, bytes: bytes as f64, bound: bound as f64 }
    };
    ["lpips features", "lpips features of scores"].into_iter().zip(work.lpips).map(item)
}

/// Additional buffers of steps on several images, for parameters of `each` bytes a static Gaussian.
fn batch_items(work: &Workload, each: f64) -> Vec<Item> {
    if work.batch == 1 {
        return Vec::new();
    }
    let of = |name, class, per, bytes: f64, bound: f64| Item { name, class, per, bytes, bound };
    let cut = |name, per, bytes: f64| of(name, Class::Moments, per, bytes, 0.0);
    let mut items = vec![
        cut("gradients", Per::Gaussian, each),
        cut("gradients", Per::Dynamic, 16.0),
        cut("gradient sums", Per::Gaussian, 2.0 * each),
        cut("gradient sums", Per::Dynamic, 32.0),
    ];
    if work.grids > 0 {
        let of_step = f64::from(work.batch) * (GRID_BYTES / 3) as f64;
        items.push(of("d grids of a step", Class::Cameras, Per::Once, of_step, of_step));
    }
    items
}

/// Bytes that a number of Gaussians needs.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Need {
    /// Gaussians.
    pub gaussians: u64,
    /// Bytes of the device's buffers: name, class, bytes of all of this name and class.
    pub buffers: Vec<(&'static str, Class, u64)>,
}

impl Need {
    fn new(work: &Workload, gaussians: u64, is_host: bool) -> Self {
        let bytes = |item: &Item| (item.bytes * item.per.count(work, gaussians as f64)) as u64;
        let buffers = items(work, is_host).iter().map(|item| (item.name, item.class, bytes(item))).collect();
        Need { gaussians, buffers }
    }

    /// Bytes of a class.
    pub fn class(&self, class: Class) -> u64 {
        self.buffers.iter().filter(|(_, of, _)| *of == class).map(|(.., bytes)| bytes).sum()
    }

    /// Bytes of all classes.
    pub fn bytes(&self) -> u64 {
        self.buffers.iter().map(|(.., bytes)| bytes).sum()
    }
}

/// The limit of the number of Gaussians.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BoundBy {
    /// The setting.
    MaxGaussians,
    /// The longest range of a binding, for the buffer of this name.
    Binding(&'static str),
    /// The device's memory.
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

/// Memory for pictures.
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

    /// Plans `work` on a device with `limits`. [`Plan::full`] has no Gaussian if a picture alone is too much.
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
        // Scores of the run need as much memory again. A software driver counts the host's cache as memory of the
        // device already.
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
        for class in Class::ALL {
            writeln!(f, "  {:<20} {:>12.1} {:>12.1}", class.label(), mib(begin.class(class)), mib(full.class(class)))?;
        }
        writeln!(f, "  {:<20} {:>12.1} {:>12.1}", "device", mib(begin.bytes()), mib(full.bytes()))?;
        writeln!(f, "  {:<20} {:>12.1} {:>12.1}", "images (device)", mib(*image_bytes), mib(*image_bytes))?;
        writeln!(f, "  {:<20} {:>12.1} {:>12.1}", "frame cache (host)", mib(*cache_bytes), mib(*cache_bytes))?;
        let (memory, binding) = (mib(limits.memory_bytes), mib(limits.binding_bytes));
        write!(
            f,
            "limit: {} Gaussians ({bound_by}); device memory {memory:.0} MiB, largest single buffer {binding:.0} MiB",
            full.gaussians
        )
    }
}
