//! `ivv devices`.

use crate::ui::screen::{out, print_json};
use ivv::internals::vk::{Caps, Device, DeviceChoice, list_devices};

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
        match device {
            Ok(caps) => print(index, caps),
            Err(reason) => out!("{index}: unusable: {reason}"),
        }
    }
    out!("picked: {} ({why})", picked.caps().name);
    Ok(())
}

fn print(index: usize, caps: &Caps) {
    let Caps { name, kind, api, driver, .. } = caps;
    out!("{index}: {name} ({kind:?}), Vulkan {api}, {}", driver.trim());
    let Caps { subgroup_size, subgroup_min: least, subgroup_max: most, max_workgroup, .. } = caps;
    let (how, kib) = (if caps.subgroup_pinned { "pinned" } else { "fixed" }, caps.max_shared_bytes >> 10);
    out!(
        "   subgroups of {subgroup_size} lanes ({least} to {most}, {how}), workgroups of up to {max_workgroup}, {kib} KiB shared"
    );
    let [binding, allocation] = [caps.max_binding_bytes >> 20, caps.max_allocation_bytes >> 20];
    let [heap, free] = [caps.heap_bytes >> 20, caps.budget_bytes >> 20];
    out!(
        "   bindings of up to {binding} MiB, allocations of up to {allocation} MiB, device memory {heap} MiB, {free} of them free"
    );
    let has = [caps.push_descriptors, caps.timestamp_ns > 0.0, caps.int64_atomics, caps.float16];
    let [push, times, atomics, half] = has.map(|has| if has { "yes" } else { "no" });
    out!("   push descriptors {push}, timestamps {times}, 64-bit atomics {atomics}, half precision {half}");
}
