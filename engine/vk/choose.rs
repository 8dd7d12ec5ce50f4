//! Choices among what a device offers: the memory that a plan counts on, the width of subgroups, the bits of its clock.

use ash::vk;

/// PCI numbers of the makers whose hardware wants another width than their drivers call the default.
const AMD: u32 = 0x1002;
const NVIDIA: u32 = 0x10de;
const INTEL: u32 = 0x8086;

/// Bytes of the largest heap on the device itself, which is not the largest of all where a card has less memory than its host;
/// and how many of them are free for this process, where `VK_EXT_memory_budget` says so in `budgets`.
pub(super) fn device_memory(heaps: &[vk::MemoryHeap], budgets: Option<&[u64]>) -> (u64, u64) {
    let on_device = heaps.iter().enumerate().filter(|(_, heap)| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
    let Some((index, heap)) = on_device.max_by_key(|(_, heap)| heap.size) else { return (0, 0) };
    let budget = budgets.and_then(|budgets| budgets.get(index)).copied().filter(|bytes| *bytes > 0);
    (heap.size, budget.map_or(heap.size, |bytes| bytes.min(heap.size)))
}

/// The width of subgroups for kernels on a device of `vendor` that can run with `least` to `most` lanes: that of its
/// multiprocessors. RADV's default of 64 halves the waves of RDNA, and Intel's compiler has 32 registers a lane at 32 lanes where
/// 16 have 64. Devices of others, and those of one width, keep their `default`.
pub(super) fn subgroup_size(vendor: u32, least: u32, most: u32, default: u32) -> u32 {
    let wanted = match vendor {
        NVIDIA | AMD => 32,
        INTEL => 16,
        // Adreno's default is 128; kernels have 64 at most.
        _ => default.min(64),
    };
    if (least..=most).contains(&wanted) { wanted } else { default }
}

/// Threads of the largest workgroup: `sort_count`.
const MOST_THREADS: u32 = 256;
/// Most bytes that a workgroup shares; Vulkan guarantees as many on every device. Only `sort_scatter` shares more, and it runs only
/// where subgroups have fewer lanes than [`WIDE`].
const MOST_SHARED_BYTES: u32 = 16_384;
const SCATTER_SHARED_BYTES: u32 = 16_448;
/// Lanes from which on `sort_exchange` takes the place of `sort_scatter`.
const WIDE: u32 = 32;
/// Storage buffers of the kernel that may have most, as `shaders-glsl/README.md` says.
const MOST_BUFFERS: u32 = 24;

/// Refuses `limits` that some kernel does not fit on subgroups of `lanes` lanes.
pub(super) fn check_limits(limits: &vk::PhysicalDeviceLimits, lanes: u32) -> Result<(), String> {
    let threads = limits.max_compute_work_group_invocations.min(limits.max_compute_work_group_size[0]);
    let shared = if lanes < WIDE { SCATTER_SHARED_BYTES } else { MOST_SHARED_BYTES };
    let all = [
        ("threads of a workgroup", threads, MOST_THREADS),
        ("bytes that a workgroup shares", limits.max_compute_shared_memory_size, shared),
        ("storage buffers of a kernel", limits.max_per_stage_descriptor_storage_buffers, MOST_BUFFERS),
    ];
    let lacking = all.into_iter().find(|(_, has, needed)| has < needed);
    lacking.map_or(Ok(()), |(what, has, needed)| Err(format!("{has} {what}; expected at least {needed}")))
}

pub(super) fn check_size(lanes: u32, least: u32, most: u32) -> Result<(), String> {
    if lanes.is_power_of_two() && (least.max(4)..=most.min(64)).contains(&lanes) {
        return Ok(());
    }
    let expected = if least == most { least.to_string() } else { format!("a power of two from {least} to {most}") };
    Err(format!("subgroups of {lanes} lanes were asked for; expected {expected}"))
}

/// Ticks from `first` to `tick` on a clock of `bits` bits, which begins again at 0.
pub(super) fn ticks_since(first: u64, tick: u64, bits: u32) -> u64 {
    let elapsed = tick.wrapping_sub(first);
    if bits >= 64 { elapsed } else { elapsed & ((1 << bits) - 1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOCAL: vk::MemoryHeapFlags = vk::MemoryHeapFlags::DEVICE_LOCAL;

    fn heap(size: u64, flags: vk::MemoryHeapFlags) -> vk::MemoryHeap {
        vk::MemoryHeap { size, flags }
    }

    #[test]
    fn a_card_with_less_memory_than_its_host_is_planned_by_its_own() {
        // A card of 8 GiB with a window of 256 MiB, in a machine of 64 GiB.
        let heaps = [heap(8 << 30, LOCAL), heap(64 << 30, vk::MemoryHeapFlags::empty()), heap(256 << 20, LOCAL)];
        assert_eq!(device_memory(&heaps, None), (8 << 30, 8 << 30));
        assert_eq!(device_memory(&heaps, Some(&[5 << 30, 60 << 30, 200 << 20])), (8 << 30, 5 << 30));
        // A driver that says nothing, or more than there is.
        assert_eq!(device_memory(&heaps, Some(&[0, 0, 0])), (8 << 30, 8 << 30));
        assert_eq!(device_memory(&heaps, Some(&[9 << 30, 0, 0])), (8 << 30, 8 << 30));
        assert_eq!(device_memory(&[], None), (0, 0));
    }

    #[test]
    fn subgroups_are_as_wide_as_the_hardware_works() {
        for (device, vendor, [least, most, default], wanted) in [
            ("GeForce", NVIDIA, [32, 32, 32], 32),
            ("RDNA, which RADV would run with 64", AMD, [32, 64, 64], 32),
            ("GCN and CDNA", AMD, [64, 64, 64], 64),
            ("Xe", INTEL, [8, 32, 32], 16),
            ("Xe2", INTEL, [16, 32, 32], 16),
            ("lavapipe", 0x10005, [8, 8, 8], 8),
            ("Adreno, as Turnip tells of it", 0x5143, [64, 128, 128], 64),
            ("an Adreno that is refused", 0x5143, [128, 128, 128], 128),
        ] {
            assert_eq!(subgroup_size(vendor, least, most, default), wanted, "{device}");
        }
    }

    #[test]
    fn a_size_that_the_device_does_not_take_is_refused() {
        assert_eq!(check_size(16, 8, 32), Ok(()));
        for (lanes, least, most) in [(4, 8, 32), (64, 8, 32), (24, 8, 32), (0, 1, 128), (128, 1, 128), (2, 1, 128)] {
            assert!(check_size(lanes, least, most).unwrap_err().contains(&format!("{lanes} lanes")));
        }
    }

    #[test]
    fn a_device_that_some_kernel_does_not_fit_is_refused_with_the_limit() {
        let enough = vk::PhysicalDeviceLimits {
            max_compute_work_group_invocations: 256,
            max_compute_work_group_size: [256, 1, 1],
            max_compute_shared_memory_size: 16_448,
            max_per_stage_descriptor_storage_buffers: 24,
            ..Default::default()
        };
        assert_eq!(check_limits(&enough, 8), Ok(()));
        let few = vk::PhysicalDeviceLimits { max_compute_work_group_size: [128, 1, 1], ..enough };
        let narrow = vk::PhysicalDeviceLimits { max_compute_shared_memory_size: 16_384, ..enough };
        let less = vk::PhysicalDeviceLimits { max_compute_shared_memory_size: 16_380, ..enough };
        let poor = vk::PhysicalDeviceLimits { max_per_stage_descriptor_storage_buffers: 4, ..enough };
        for (limits, lanes, told) in [
            (few, 16, "128 threads of a workgroup; expected at least 256"),
            (narrow, 16, "16384 bytes that a workgroup shares; expected at least 16448"),
            (less, 64, "16380 bytes that a workgroup shares; expected at least 16384"),
            (poor, 16, "4 storage buffers of a kernel; expected at least 24"),
        ] {
            assert_eq!(check_limits(&limits, lanes), Err(told.to_owned()));
        }
        // What Vulkan promises is enough for the kernels of wide subgroups.
        assert_eq!(check_limits(&narrow, 32), Ok(()));
    }

    #[test]
    fn a_clock_of_few_bits_begins_again() {
        assert_eq!(ticks_since(10, 25, 64), 15);
        assert_eq!(ticks_since(0xffff_fff0, 0x10, 32), 0x20);
        assert_eq!(ticks_since(u64::MAX, 1, 64), 2);
        // The upper bits of a clock of 36 bits may hold anything.
        assert_eq!(ticks_since(0xabc0_0000_0010, 0x1230_0000_0030, 36), 0x20);
    }
}
