//! The device with its kernels: runs recordings, moves data.

use super::generated::ALL;
use super::kernel::{BindingKind, Buf, KernelInfo, Pod, Slice};
use super::record::{Grid, Pass, Recording, Work};
use crate::error::{Error, Result};
use crate::vk::{Buffer, Caps, Commands, Device, DeviceChoice, DeviceKind, Groups, Location, Pipeline, PipelineDesc};
#[cfg(feature = "window")]
use crate::vk::{Swapchain, WindowHandle};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// Most workgroups in one dimension; larger grids fold into two (`include/grid.glsl`).
const MAX_GROUPS: u32 = 65_535;
/// Bytes moved per transfer.
const STAGING_BYTES: usize = 32 << 20;

/// How to open a [`Gpu`].
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Which device.
    pub device: DeviceChoice,
    /// Fill new buffers with 0xAB bytes, so that a read of something never written shows.
    #[doc(hidden)]
    pub poison: bool,
    #[doc(hidden)]
    pub rewrite: Option<Rewrite>,
    /// Run the passes between two barriers last to first, where they are not timed: so a barrier that is missing shows.
    #[doc(hidden)]
    pub reversed: bool,
    /// Bind a buffer of words behind the buffers of every kernel, which rewritten kernels count in: see [`Gpu::counted`].
    #[doc(hidden)]
    pub counts: bool,
    /// Record as for another device; nothing may run.
    #[doc(hidden)]
    pub stands_in: Option<StandIn>,
}

/// Recordings are made for a graphics card with bindings of 4 GiB, in place of the device that holds their buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StandIn {
    pub subgroup_size: u32,
}

/// Changes kernels before they are compiled: for tests with subgroups that the device lacks, or errors that Vulkan allows and it does
/// not make.
#[derive(Clone, Copy, Debug)]
pub struct Rewrite {
    /// Lanes of a subgroup after the change, where it replaces all subgroup operations. The engine then takes the device for a GPU.
    pub subgroup_size: Option<u32>,
    pub spirv: fn(&KernelInfo) -> Vec<u8>,
}

pub const COUNTS: &str = "counts of rewritten kernels";

#[derive(Clone, Debug)]
pub struct PassTime {
    pub label: String,
    /// Nanoseconds from the beginning of the recording's first pass to that of this one, by the device's clock.
    pub begin_ns: f64,
    pub ns: f64,
}

/// A recording that the device works on. Dropping it waits.
pub struct Running {
    submission: crate::vk::Submission,
    /// The place in the recording and the label of each timed pass, in the order in which they ran.
    passes: Vec<(usize, String)>,
    barriers: usize,
}

impl Running {
    /// One barrier before each window of passes, see [`Recording::windows`].
    pub fn barriers(&self) -> usize {
        self.barriers
    }

    /// Waits for its end and returns the time of each pass, in the order of the recording; none where they are not timed or the device
    /// has no timestamps. Unless the device is lost, it can be waited for again after an error.
    pub fn wait(&self) -> Result<Vec<PassTime>> {
        let ns = tracing::debug_span!("wait", what = %"device").in_scope(|| self.submission.wait())?;
        let mut times: Vec<_> = self.passes.iter().zip(ns).collect();
        times.sort_by_key(|((at, _), _)| *at);
        let timed = |((_, label), [begin_ns, end]): (&(usize, String), [f64; 2])| PassTime {
            label: label.clone(),
            begin_ns,
            ns: end - begin_ns,
        };
        Ok(times.into_iter().map(timed).collect())
    }
}

/// An open device with its compiled kernels.
pub struct Gpu {
    pub(super) device: Arc<Device>,
    chosen_because: String,
    pipelines: Mutex<HashMap<&'static str, Arc<Pipeline>>>,
    poison: bool,
    rewrite: Option<Rewrite>,
    reversed: bool,
    counts: Option<Buf<u32>>,
    caps: Caps,
}

impl Gpu {
    /// Opens a device.
    ///
    /// # Errors
    /// [`Error::NoDevice`] with the reason.
    pub fn open(options: &Options) -> Result<Self> {
        let (device, chosen_because) = Device::open(&options.device)?;
        let mut caps = device.caps().clone();
        if let Some(lanes) = options.rewrite.and_then(|rewrite| rewrite.subgroup_size) {
            (caps.subgroup_size, caps.kind) = (lanes, DeviceKind::DiscreteGpu);
        }
        if let Some(StandIn { subgroup_size }) = options.stands_in {
            let (kind, max_binding_bytes) = (DeviceKind::DiscreteGpu, u64::from(u32::MAX));
            caps = Caps { kind, subgroup_size, max_binding_bytes, int64_atomics: true, ..caps };
        }
        let Options { poison, rewrite, reversed, .. } = *options;
        let (pipelines, counts) = (Mutex::default(), None);
        let mut gpu = Gpu { device, chosen_because, pipelines, poison, rewrite, reversed, counts, caps };
        if options.counts {
            gpu.counts = Some(gpu.upload(COUNTS, &vec![0; ALL.len() + 1])?);
        }
        Ok(gpu)
    }

    /// By kernel, the counts of rewritten kernels since the last call; a kernel has the word of its place in [`ALL`], others the last.
    #[doc(hidden)]
    pub fn counted(&self) -> Result<Vec<(&'static str, u32)>> {
        let Some(counts) = &self.counts else { return Ok(Vec::new()) };
        let words = self.read(counts)?;
        let names = ALL.iter().map(|kernel| kernel.name).chain(["another kernel"]);
        self.write(counts, &vec![0; counts.len()])?;
        Ok(names.zip(words).filter(|(_, n)| *n > 0).collect())
    }

    /// Limits and features, with the kind and the subgroups that a rewrite says.
    pub fn caps(&self) -> &Caps {
        &self.caps
    }

    /// Why this device was taken.
    pub fn chosen_because(&self) -> &str {
        &self.chosen_because
    }

    /// The device itself: memory in use, messages of the validation layer.
    #[doc(hidden)]
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// A window that shows pictures. Open the device with [`surface_extensions`](crate::vk::surface_extensions) of its display.
    #[cfg(feature = "window")]
    #[doc(hidden)]
    pub fn window(&self, window: Arc<dyn WindowHandle>, is_synced: bool) -> Result<Swapchain> {
        Swapchain::new(&self.device, window, is_synced)
    }

    fn pipeline(&self, kernel: &'static KernelInfo) -> Result<Arc<Pipeline>> {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(pipeline) = pipelines.get(kernel.name) {
            return Ok(pipeline.clone());
        }
        let _compiling = tracing::debug_span!("compile", kernel = %kernel.name).entered();
        let counted = self.counts.iter().map(|_| BindingKind::Storage);
        let bindings: Vec<_> = kernel.bindings.iter().map(|b| b.kind).chain(counted).collect();
        let rewritten = self.rewrite.map(|rewrite| (rewrite.spirv)(kernel));
        let emulated = self.rewrite.is_some_and(|rewrite| rewrite.subgroup_size.is_some());
        let desc = PipelineDesc {
            spirv: rewritten.as_deref().unwrap_or(kernel.spirv),
            subgroups: kernel.subgroups && !emulated,
            ..kernel.pipeline(&bindings)
        };
        let pipeline = Arc::new(Pipeline::new(&self.device, &desc)?);
        pipelines.insert(kernel.name, pipeline.clone());
        Ok(pipeline)
    }

    /// A device buffer of `len` items with undefined contents.
    #[doc(hidden)]
    pub fn alloc<T: Pod>(&self, name: &str, len: usize) -> Result<Buf<T>> {
        let bytes = (len.max(1) * size_of::<T>()) as u64;
        let buf = Buf::new(Arc::new(Buffer::new(&self.device, name, bytes, Location::Device)?), len);
        if self.poison {
            let mut rec = Recording::new();
            rec.fill(whole_words(&buf.slice()), 0xABAB_ABAB);
            self.run(&rec)?;
        }
        Ok(buf)
    }

    #[doc(hidden)]
    pub fn upload<T: Pod>(&self, name: &str, items: &[T]) -> Result<Buf<T>> {
        let buf = self.alloc(name, items.len())?;
        self.write(&buf, items)?;
        Ok(buf)
    }

    /// Overwrites the beginning of `buf` and waits.
    #[doc(hidden)]
    pub fn write<T: Pod>(&self, buf: &Buf<T>, items: &[T]) -> Result<()> {
        assert!(items.len() <= buf.len(), "{} items into a buffer of {}", items.len(), buf.len());
        let mut to = buf.slice();
        for chunk in bytemuck::cast_slice::<T, u8>(items).chunks(STAGING_BYTES) {
            let from = self.staged("upload staging", chunk)?;
            to.size = from.size;
            self.copy(from, to.clone())?;
            to.offset += to.size;
        }
        Ok(())
    }

    #[doc(hidden)]
    pub fn read<T: Pod>(&self, buf: &Buf<T>) -> Result<Vec<T>> {
        let mut items = vec![T::zeroed(); buf.len()];
        let mut from = buf.slice();
        for chunk in bytemuck::cast_slice_mut::<T, u8>(&mut items).chunks_mut(STAGING_BYTES) {
            let to = self.readback::<u8>("readback staging", chunk.len())?;
            from.size = to.size;
            self.copy(from.clone(), to.clone())?;
            chunk.copy_from_slice(mapped(&to)?);
            from.offset += from.size;
        }
        Ok(items)
    }

    fn copy(&self, from: Slice, to: Slice) -> Result<()> {
        let mut rec = Recording::new();
        rec.copy(from, to);
        self.run(&rec)
    }

    /// Bytes that a recording may copy from.
    pub(crate) fn staged<T: Pod>(&self, name: &str, items: &[T]) -> Result<Slice> {
        let bytes: &[u8] = bytemuck::cast_slice(items);
        let mut buffer = Buffer::new(&self.device, name, bytes.len() as u64, Location::Upload)?;
        let mapped = buffer.bytes_mut().ok_or_else(|| unmapped(name))?;
        mapped[..bytes.len()].copy_from_slice(bytes);
        Ok(Slice { buffer: Arc::new(buffer), offset: 0, size: bytes.len() as u64 })
    }

    /// Room for `len` items that a recording may copy to; read them with [`Gpu::peek`] once it has ended.
    #[doc(hidden)]
    pub fn readback<T: Pod>(&self, name: &str, len: usize) -> Result<Slice> {
        let size = (len * size_of::<T>()) as u64;
        let buffer = Buffer::new(&self.device, name, size, Location::Readback)?;
        Ok(Slice { buffer: Arc::new(buffer), offset: 0, size })
    }

    /// The items of a [`Gpu::readback`] slice, after the submission that wrote them has ended.
    #[doc(hidden)]
    pub fn peek<T: Pod>(&self, slice: &Slice) -> Result<Vec<T>> {
        mapped(slice).map(bytemuck::pod_collect_to_vec)
    }

    /// Hands `recording` to the device and does not wait; it begins when all that was handed over before has ended.
    #[doc(hidden)]
    pub fn start(&self, recording: &Recording) -> Result<Running> {
        self.start_as(recording, false)
    }

    pub(crate) fn start_timed(&self, recording: &Recording) -> Result<Running> {
        self.start_as(recording, true)
    }

    fn start_as(&self, recording: &Recording, timed: bool) -> Result<Running> {
        let windows = recording.windows();
        let order = windows.iter().flatten().filter(|_| timed);
        let passes = order.map(|&at| (at, recording.passes()[at].label.clone())).collect();
        Ok(Running { submission: self.submit(recording, &windows, timed)?, passes, barriers: windows.len() })
    }

    #[doc(hidden)]
    pub fn run(&self, recording: &Recording) -> Result<()> {
        self.start(recording)?.wait().map(drop)
    }

    /// The time of each pass; none where the device has no timestamps.
    pub(crate) fn run_timed(&self, recording: &Recording) -> Result<Vec<PassTime>> {
        self.start_timed(recording)?.wait()
    }

    #[tracing::instrument(level = "debug", name = "submit", skip_all)]
    fn submit(&self, recording: &Recording, windows: &[Vec<usize>], timestamps: bool) -> Result<crate::vk::Submission> {
        let passes = recording.passes();
        let n_bound = |pass: &Pass| if let Work::Dispatch { slices, .. } = &pass.work { slices.len() + 1 } else { 0 };
        let n_bindings = passes.iter().map(n_bound).sum();
        let mut commands = Commands::new(&self.device, passes.len(), n_bindings, timestamps)?;
        for window in windows {
            // The first: an earlier recording may still be running.
            commands.barrier();
            let mut window = window.clone();
            if self.reversed && !timestamps {
                window.reverse();
            }
            window.iter().try_for_each(|at| self.submit_pass(&mut commands, &passes[*at]))?;
        }
        commands.submit()
    }

    fn submit_pass(&self, commands: &mut Commands, pass: &Pass) -> Result<()> {
        let _pass = tracing::trace_span!("pass", label = %pass.label).entered();
        commands.begin_pass(&pass.label);
        match &pass.work {
            Work::Copy(from, to) => commands.copy(&from.binding(), &to.binding()),
            Work::Fill(slice, value) => commands.fill(&slice.binding(), *value),
            Work::Dispatch { kernel, slices, push, grid } => {
                let pipeline = self.pipeline(kernel)?;
                let counts = self.counts.iter().map(|counts| counts.slice().binding());
                let bindings: Vec<_> = slices.iter().map(Slice::binding).chain(counts).collect();
                let grid = match grid {
                    Grid::Threads(n) => Groups::Known(fold(n.div_ceil(kernel.local))),
                    Grid::Groups(n) => Groups::Known(fold(*n)),
                    Grid::Indirect(args) => Groups::Indirect(args.binding()),
                };
                commands.dispatch(&pipeline, &bindings, push, &grid)?;
            }
        }
        commands.end_pass();
        Ok(())
    }
}

/// `n` workgroups in two dimensions, each below the limit.
pub(super) fn fold(n: u32) -> [u32; 3] {
    [n.min(MAX_GROUPS), n.div_ceil(MAX_GROUPS), 1]
}

/// The slice with its tail of less than a word, which the buffer's own padding holds.
fn whole_words(slice: &Slice) -> Slice {
    Slice { size: slice.size.next_multiple_of(4), ..slice.clone() }
}

fn mapped(slice: &Slice) -> Result<&[u8]> {
    let bytes = slice.buffer.bytes().ok_or_else(|| unmapped(slice.buffer.name()))?;
    Ok(&bytes[slice.offset as usize..][..slice.size as usize])
}

pub(super) fn unmapped(name: &str) -> Error {
    Error::Vulkan { call: "mapping host memory", reason: format!("`{name}` is not visible to the host") }
}
