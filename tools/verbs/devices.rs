//! `ivv devices`.

use crate::ui::screen::{out, print_json};
use ivv::internals::vk::{Device, DeviceChoice, list_devices};

#[derive(clap::Args)]
pub struct Args {
    /// The device to choose: an index or part of a name.
    #[arg(long)]
    device: Option<String>,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let devices = list_devices()?;
    let (picked, why) = Device::open(&DeviceChoice { device: args.device.clone(), ..DeviceChoice::default() })?;
    if json {
        let listed: Vec<_> = devices
            .iter()
            .map(|device| match device {
                Ok(caps) => serde_json::json!({ "usable": true, "caps": caps }),
                Err(reason) => serde_json::json!({ "usable": false, "reason": reason }),
            })
            .collect();
        let report = serde_json::json!({ "devices": listed, "picked": picked.caps().name, "because": why });
        return print_json(&report);
    }
    for (index, device) in devices.iter().enumerate() {
        let caps = match device {
            Ok(caps) => caps,
            Err(reason) => {
                out!("{index}: unusable: {reason}");
                continue;
            }
        };
        let yes = |b: bool| if b { "yes" } else { "no" };
        out!("{index}: {} ({:?}), Vulkan {}, {}", caps.name, caps.kind, caps.api, caps.driver.trim());
        out!(
            "   subgroups of {} lanes ({} to {}, {}), workgroups of up to {}, {} KiB shared",
            caps.subgroup_size,
            caps.subgroup_min,
            caps.subgroup_max,
            if caps.subgroup_pinned { "pinned" } else { "fixed" },
            caps.max_workgroup,
            caps.max_shared_bytes >> 10,
        );
        out!(
            "   bindings of up to {} MiB, allocations of up to {} MiB, device memory {} MiB, {} of them free",
            caps.max_binding_bytes >> 20,
            caps.max_allocation_bytes >> 20,
            caps.heap_bytes >> 20,
            caps.budget_bytes >> 20,
        );
        out!(
            "   push descriptors {}, timestamps {}, 64-bit atomics {}, half precision {}",
            yes(caps.push_descriptors),
            yes(caps.timestamp_ns > 0.0),
            yes(caps.int64_atomics),
            yes(caps.float16),
        );
    }
    out!("picked: {} ({why})", picked.caps().name);
    Ok(())
}
