//! Command streams: recorded once, submitted once, waited for on the timeline.

use super::buffer::{Buffer, Location};
use super::choose::ticks_since;
use super::device::Device;
use super::pipeline::{BindingKind, Pipeline};
use super::vk_error;
use crate::error::{Error, Result};
use ash::vk;
use std::sync::Arc;

/// A range of a buffer as one binding of a dispatch.
#[derive(Clone)]
pub struct Binding {
    pub buffer: Arc<Buffer>,
    pub offset: u64,
    pub size: u64,
}

pub struct Commands {
    pub(super) device: Arc<Device>,
    pool: vk::CommandPool,
    pub(super) raw: vk::CommandBuffer,
    descriptors: Option<vk::DescriptorPool>,
    queries: Option<vk::QueryPool>,
    // One word per pass, set by the device when the pass begins: names the last pass of a lost device. Only where breadcrumbs
    // are asked for: each is a transfer between two dispatches, for which a GPU may wait.
    markers: Option<Buffer>,
    passes: Vec<String>,
    pub(super) buffers: Vec<Arc<Buffer>>,
    /// A binary semaphore that the submission signals beside the timeline: a presentation waits for it.
    pub(super) signal: Option<vk::Semaphore>,
    pipelines: Vec<Arc<Pipeline>>,
    // Timeline value of the submission; 0 while recording.
    value: u64,
}

/// Work on its way through the device. Dropping it waits.
pub struct Submission(Commands);

/// The workgroups of a dispatch.
pub enum Groups {
    Known([u32; 3]),
    /// As many as three words on the device say when it gets there.
    Indirect(Binding),
}

/// The stages that kernels and copies run in, and their writes.
const WORK: vk::PipelineStageFlags = vk::PipelineStageFlags::from_raw(
    vk::PipelineStageFlags::COMPUTE_SHADER.as_raw() | vk::PipelineStageFlags::TRANSFER.as_raw(),
);
const WRITES: vk::AccessFlags =
    vk::AccessFlags::from_raw(vk::AccessFlags::SHADER_WRITE.as_raw() | vk::AccessFlags::TRANSFER_WRITE.as_raw());

impl Commands {
    /// Begins a stream of at most `n_passes` passes with at most `n_bindings` bindings in all.
    pub fn new(device: &Arc<Device>, n_passes: usize, n_bindings: usize, timestamps: bool) -> Result<Self> {
        let raw_device = &device.raw;
        let new_markers = || Buffer::new(device, "markers", 4 * n_passes as u64, Location::Readback);
        let mut markers = device.breadcrumbs.then(new_markers).transpose()?;
        if let Some(bytes) = markers.as_mut().and_then(Buffer::bytes_mut) {
            bytes.fill(0);
        }
        let retired = device.retired.lock().ok().and_then(|mut streams| streams.pop());
        let (pool, raw) = retired.map_or_else(|| new_stream(device), Ok)?;
        let mut commands = Commands {
            device: device.clone(),
            pool,
            raw,
            descriptors: None,
            queries: None,
            markers,
            passes: Vec::with_capacity(n_passes),
            buffers: Vec::new(),
            signal: None,
            pipelines: Vec::new(),
            value: 0,
        };
        // SAFETY: the pool is idle (new or retired after its submission ended) and used by this stream alone; what is
        // created here is destroyed in `drop`.
        unsafe {
            raw_device
                .reset_command_pool(pool, vk::CommandPoolResetFlags::empty())
                .map_err(vk_error("vkResetCommandPool"))?;
            if device.push_descriptor.is_none() && n_bindings > 0 {
                let sizes = [vk::DescriptorType::STORAGE_BUFFER, vk::DescriptorType::UNIFORM_BUFFER]
                    .map(|ty| vk::DescriptorPoolSize::default().ty(ty).descriptor_count(n_bindings as u32));
                let info = vk::DescriptorPoolCreateInfo::default().max_sets(n_passes as u32).pool_sizes(&sizes);
                let pool =
                    raw_device.create_descriptor_pool(&info, None).map_err(vk_error("vkCreateDescriptorPool"))?;
                commands.descriptors = Some(pool);
            }
            if timestamps && device.caps().timestamp_ns > 0.0 && n_passes > 0 {
                let info = vk::QueryPoolCreateInfo::default()
                    .query_type(vk::QueryType::TIMESTAMP)
                    .query_count(2 * n_passes as u32);
                let queries = raw_device.create_query_pool(&info, None).map_err(vk_error("vkCreateQueryPool"))?;
                commands.queries = Some(queries);
            }
            let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            raw_device.begin_command_buffer(commands.raw, &begin).map_err(vk_error("vkBeginCommandBuffer"))?;
            if let Some(queries) = commands.queries {
                raw_device.cmd_reset_query_pool(commands.raw, queries, 0, 2 * n_passes as u32);
            }
        }
        Ok(commands)
    }

    pub fn begin_pass(&mut self, name: &str) {
        let index = self.passes.len();
        self.passes.push(name.to_owned());
        // SAFETY: recording into a stream that is not submitted yet; the marker word lies in its buffer.
        unsafe {
            if let (Some(debug), Ok(label)) = (&self.device.debug, std::ffi::CString::new(name)) {
                let label = vk::DebugUtilsLabelEXT::default().label_name(&label);
                debug.cmd_begin_debug_utils_label(self.raw, &label);
            }
            if let Some(markers) = &self.markers {
                self.device.raw.cmd_fill_buffer(self.raw, markers.raw, 4 * index as u64, 4, 1);
            }
            self.timestamp(2 * index as u32);
        }
    }

    pub fn end_pass(&mut self) {
        let index = self.passes.len().saturating_sub(1);
        // SAFETY: as in `begin_pass`.
        unsafe {
            self.timestamp(2 * index as u32 + 1);
            if let Some(debug) = &self.device.debug {
                debug.cmd_end_debug_utils_label(self.raw);
            }
        }
    }

    /// # Safety
    /// The stream is being recorded and `query` is below the pool's size.
    unsafe fn timestamp(&self, query: u32) {
        if let Some(queries) = self.queries {
            // SAFETY: the caller's promise.
            unsafe {
                self.device.raw.cmd_write_timestamp(self.raw, vk::PipelineStageFlags::BOTTOM_OF_PIPE, queries, query);
            }
        }
    }

    /// Makes all earlier writes of kernels and copies visible to all later reads, indirect arguments included.
    pub fn barrier(&self) {
        let accesses = vk::AccessFlags::SHADER_READ
            | vk::AccessFlags::UNIFORM_READ
            | vk::AccessFlags::TRANSFER_READ
            | vk::AccessFlags::INDIRECT_COMMAND_READ;
        self.barrier_before(WORK | vk::PipelineStageFlags::DRAW_INDIRECT, accesses | WRITES);
    }

    fn barrier_before(&self, stages: vk::PipelineStageFlags, accesses: vk::AccessFlags) {
        let barrier = [vk::MemoryBarrier::default().src_access_mask(WRITES).dst_access_mask(accesses)];
        let flags = vk::DependencyFlags::empty();
        // SAFETY: recording into a stream that is not submitted yet.
        unsafe { self.device.raw.cmd_pipeline_barrier(self.raw, WORK, stages, flags, &barrier, &[], &[]) };
    }

    fn bind(&mut self, pipeline: &Arc<Pipeline>, bindings: &[Binding], push: &[u8]) -> Result<()> {
        debug_assert_eq!(bindings.len(), pipeline.kinds.len());
        debug_assert_eq!(push.len(), pipeline.push_bytes as usize);
        for (binding, kind) in bindings.iter().zip(&pipeline.kinds) {
            let limit = match kind {
                BindingKind::Storage => self.device.caps().max_binding_bytes,
                BindingKind::Uniform => 65536,
            };
            if binding.size > limit {
                return Err(Error::OutOfMemory {
                    what: format!("a binding of buffer `{}` (bytes)", binding.buffer.name()),
                    needed: binding.size,
                    limit,
                    remedy: "choose a device with longer bindings or a smaller scene or picture".to_owned(),
                });
            }
        }
        let infos: Vec<_> = bindings
            .iter()
            .map(|b| [vk::DescriptorBufferInfo::default().buffer(b.buffer.raw).offset(b.offset).range(b.size)])
            .collect();
        let mut writes: Vec<_> = infos
            .iter()
            .zip(&pipeline.kinds)
            .zip(0..)
            .map(|((info, kind), binding)| {
                vk::WriteDescriptorSet::default()
                    .dst_binding(binding)
                    .descriptor_type(kind.descriptor_type())
                    .buffer_info(info)
            })
            .collect();
        let (device, point) = (&self.device.raw, vk::PipelineBindPoint::COMPUTE);
        // SAFETY: recording; the buffers and the pipeline are kept alive below until the submission has ended.
        unsafe {
            device.cmd_bind_pipeline(self.raw, point, pipeline.parts.pipeline);
            if let Some(push_descriptor) = &self.device.push_descriptor {
                push_descriptor.cmd_push_descriptor_set(self.raw, point, pipeline.parts.layout, 0, &writes);
            } else if let Some(pool) = self.descriptors {
                let layouts = [pipeline.parts.set_layout];
                let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
                let sets = device.allocate_descriptor_sets(&info).map_err(vk_error("vkAllocateDescriptorSets"))?;
                for write in &mut writes {
                    write.dst_set = sets.first().copied().unwrap_or_default();
                }
                device.update_descriptor_sets(&writes, &[]);
                device.cmd_bind_descriptor_sets(self.raw, point, pipeline.parts.layout, 0, &sets, &[]);
            }
            if !push.is_empty() {
                device.cmd_push_constants(self.raw, pipeline.parts.layout, vk::ShaderStageFlags::COMPUTE, 0, push);
            }
        }
        self.buffers.extend(bindings.iter().map(|b| b.buffer.clone()));
        self.pipelines.push(pipeline.clone());
        Ok(())
    }

    pub fn dispatch(
        &mut self,
        pipeline: &Arc<Pipeline>,
        bindings: &[Binding],
        push: &[u8],
        groups: &Groups,
    ) -> Result<()> {
        self.bind(pipeline, bindings, push)?;
        // SAFETY: everything is bound; the caller folds the groups to the device's limit, or gives three words inside their
        // buffer, which is kept alive.
        unsafe {
            match groups {
                Groups::Known([x, y, z]) => self.device.raw.cmd_dispatch(self.raw, *x, *y, *z),
                Groups::Indirect(args) => {
                    self.device.raw.cmd_dispatch_indirect(self.raw, args.buffer.raw, args.offset);
                    self.buffers.push(args.buffer.clone());
                }
            }
        }
        Ok(())
    }

    pub fn copy(&mut self, from: &Binding, to: &Binding) {
        debug_assert_eq!(from.size, to.size);
        let region =
            [vk::BufferCopy::default().src_offset(from.offset).dst_offset(to.offset).size(from.size.min(to.size))];
        self.buffers.extend([from.buffer.clone(), to.buffer.clone()]);
        // SAFETY: both ranges lie inside their buffers, which are kept alive.
        unsafe { self.device.raw.cmd_copy_buffer(self.raw, from.buffer.raw, to.buffer.raw, &region) };
    }

    pub fn fill(&mut self, range: &Binding, value: u32) {
        self.buffers.push(range.buffer.clone());
        // SAFETY: the range lies inside its buffer, which is kept alive.
        unsafe { self.device.raw.cmd_fill_buffer(self.raw, range.buffer.raw, range.offset, range.size, value) };
    }

    pub fn submit(mut self) -> Result<Submission> {
        let device = self.device.clone();
        // The host reads what copies wrote only after this.
        self.barrier_before(vk::PipelineStageFlags::HOST, vk::AccessFlags::HOST_READ);
        let lost = || Error::DeviceLost { after_pass: "(before the first)".to_owned() };
        let (queue, mut submitted) =
            (device.queue.lock().map_err(|_| lost())?, device.submitted.lock().map_err(|_| lost())?);
        let value = *submitted + 1;
        let semaphores: Vec<_> = [device.timeline].into_iter().chain(self.signal).collect();
        // A binary semaphore has no value: what stands in its place is not read.
        let (values, buffers) = (vec![value; semaphores.len()], [self.raw]);
        let mut timeline = vk::TimelineSemaphoreSubmitInfo::default().signal_semaphore_values(&values);
        let info = [vk::SubmitInfo::default()
            .command_buffers(&buffers)
            .signal_semaphores(&semaphores)
            .push_next(&mut timeline)];
        // SAFETY: the stream is complete, the queue is locked, and the timeline's values grow.
        unsafe {
            device.raw.end_command_buffer(self.raw).map_err(vk_error("vkEndCommandBuffer"))?;
            device.raw.queue_submit(*queue, &info, vk::Fence::null()).map_err(vk_error("vkQueueSubmit"))?;
        }
        *submitted = value;
        self.value = value;
        Ok(Submission(self))
    }

    fn wait(&self) -> Result<()> {
        if self.value == 0 {
            return Ok(());
        }
        let (semaphores, values) = ([self.device.timeline], [self.value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore belongs to this device and will be signalled with at least this value.
        unsafe { self.device.raw.wait_semaphores(&info, u64::MAX) }.map_err(|e| match e {
            vk::Result::ERROR_DEVICE_LOST => {
                let words = self.markers.as_ref().and_then(Buffer::bytes);
                let after_pass = words.map_or_else(String::new, |words| last_begun(words, &self.passes));
                Error::DeviceLost { after_pass }
            }
            other => vk_error("vkWaitSemaphores")(other),
        })
    }
}

fn new_stream(device: &Device) -> Result<(vk::CommandPool, vk::CommandBuffer)> {
    let info = vk::CommandPoolCreateInfo::default()
        .flags(vk::CommandPoolCreateFlags::TRANSIENT)
        .queue_family_index(device.queue_family);
    // SAFETY: plain creation; the device destroys the pool, and with it the buffer, when it is dropped.
    unsafe {
        let pool = device.raw.create_command_pool(&info, None).map_err(vk_error("vkCreateCommandPool"))?;
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        match device.raw.allocate_command_buffers(&info) {
            Ok(buffers) => Ok((pool, buffers.first().copied().unwrap_or_default())),
            Err(e) => {
                device.raw.destroy_command_pool(pool, None);
                Err(vk_error("vkAllocateCommandBuffers")(e))
            }
        }
    }
}

/// Name of the last pass whose breadcrumb is set.
fn last_begun(markers: &[u8], passes: &[String]) -> String {
    let begun = markers.chunks_exact(4).zip(passes).take_while(|(word, _)| word.iter().any(|b| *b != 0));
    begun.last().map_or_else(|| "(before the first)".to_owned(), |(_, name)| name.clone())
}

impl Submission {
    /// Waits for the end; gives the beginning and end of each pass, nanoseconds since the first began, or nothing without
    /// timestamps. Unless the device is lost, it can be waited for again after an error.
    ///
    /// # Errors
    /// [`Error::DeviceLost`] with the name of the last pass that began.
    pub fn wait(&self) -> Result<Vec<[f64; 2]>> {
        let Submission(Commands { device, passes, queries, .. }) = self;
        self.0.wait()?;
        let Some(queries) = queries.filter(|_| !passes.is_empty()) else { return Ok(Vec::new()) };
        let mut ticks = vec![0u64; 2 * passes.len()];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the submission has ended and wrote the first `ticks.len()` queries.
        unsafe { device.raw.get_query_pool_results(queries, 0, &mut ticks, flags) }
            .map_err(vk_error("vkGetQueryPoolResults"))?;
        let (ns, bits) = (f64::from(device.caps().timestamp_ns), device.caps().timestamp_bits);
        let since = |tick: u64| ticks_since(ticks[0], tick, bits) as f64 * ns;
        Ok(ticks.chunks_exact(2).map(|t| [since(t[0]), since(t[1]).max(since(t[0]))]).collect())
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        // A lost device does no more work, so nothing is in use then either.
        let _ = self.wait();
        // SAFETY: the stream has ended or was never submitted.
        unsafe {
            if let Some(pool) = self.descriptors {
                self.device.raw.destroy_descriptor_pool(pool, None);
            }
            if let Some(queries) = self.queries {
                self.device.raw.destroy_query_pool(queries, None);
            }
        }
        if let Ok(mut retired) = self.device.retired.lock() {
            retired.push((self.pool, self.raw));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::last_begun;

    #[test]
    fn the_last_begun_pass_is_named() {
        let passes: Vec<String> = ["cull", "scan", "blend"].map(String::from).to_vec();
        let words =
            |n: usize| [1u32; 3].iter().take(n).chain(&[0; 3]).flat_map(|w| w.to_le_bytes()).collect::<Vec<_>>();
        assert_eq!(last_begun(&words(0), &passes), "(before the first)");
        assert_eq!(last_begun(&words(2), &passes), "scan");
        assert_eq!(last_begun(&words(3), &passes), "blend");
    }
}
