//! What a driver's compiler made of the kernels: registers, spills, instructions, and the waves that follow.

use super::waves::Chip;
use ivv::Result;
use ivv::internals::gpu::KernelInfo;
use ivv::internals::gpu::table;
use ivv::internals::report::Table;
use ivv::internals::vk::{Compiler, Executable};
use serde::{Deserialize, Serialize};

/// One compiled kernel. What the driver does not tell is `None`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Static {
    pub kernel: String,
    /// Lanes of its subgroups.
    pub subgroup: u32,
    pub local: u32,
    /// 32-bit registers of a lane.
    pub registers: Option<u64>,
    /// Registers that a subgroup shares (AMD).
    pub scalar_registers: Option<u64>,
    /// Registers kept in memory or in other registers for want of room.
    pub spills: Option<u64>,
    /// Scratch or local memory, bytes: of a subgroup on AMD, of a lane on NVIDIA.
    pub scratch_bytes: Option<u64>,
    /// Shared memory of a workgroup, bytes; by the SPIR-V where the driver does not tell.
    pub shared_bytes: u64,
    pub instructions: Option<u64>,
    /// Cycles of one subgroup, by the compiler's model, which knows no trip counts.
    pub latency: Option<u64>,
    /// Cycles that a subgroup keeps the busiest unit, by the same model.
    pub inverse_throughput: Option<u64>,
    /// Subgroups held at once, per SIMD (AMD) or multiprocessor (NVIDIA).
    pub waves: Option<f64>,
    /// Why `waves` is unknown; empty where it is known.
    pub waves_unknown: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    pub device: String,
    pub driver: String,
    /// The chip that waves are counted for: the device's name, or the one given in its place.
    pub chip: String,
    /// Lanes that kernels with subgroup operations were compiled for.
    pub width: u32,
    pub kernels: Vec<Static>,
    /// Kernels that use what the device lacks.
    pub left_out: Vec<String>,
}

impl Statistics {
    /// Compiles `kernels` by `compiler`. `chip` names the chip where the device's name does not.
    pub fn of(compiler: &Compiler, chip: Option<&str>, kernels: &[&KernelInfo]) -> Result<Self> {
        let caps = compiler.caps();
        let chip = chip.unwrap_or(&caps.name).to_owned();
        let (mut compiled, mut left_out) = (Vec::with_capacity(kernels.len()), Vec::new());
        for kernel in kernels {
            if !caps.int64_atomics && declares(kernel.spirv, INT64_ATOMICS) {
                left_out.push(kernel.name.to_owned());
                continue;
            }
            let bindings: Vec<_> = kernel.bindings.iter().map(|binding| binding.kind).collect();
            let programs = compiler.statistics(&kernel.pipeline(&bindings))?;
            compiled.extend(programs.iter().map(|program| Static::new(kernel, program, &chip, caps.subgroup_size)));
        }
        let (device, driver) = (caps.name.clone(), caps.driver.clone());
        Ok(Statistics { device, driver, chip, width: caps.subgroup_size, kernels: compiled, left_out })
    }

    pub fn terminal(&self) -> String {
        let cell = |value: Option<u64>| value.map_or_else(|| "-".to_owned(), |value| value.to_string());
        let row = |one: &Static| {
            vec![
                one.kernel.clone(),
                one.subgroup.to_string(),
                cell(one.registers),
                cell(one.spills),
                cell(one.scratch_bytes),
                one.shared_bytes.to_string(),
                cell(one.instructions),
                cell(one.latency),
                cell(one.inverse_throughput),
                one.waves.map_or_else(|| "unknown".to_owned(), |waves| waves.to_string()),
            ]
        };
        #[rustfmt::skip]
        let heads = ["kernel", "width", "registers", "spills", "scratch", "shared", "instructions", "latency",
            "inv. throughput", "waves"];
        let table = Table::new(&heads, self.kernels.iter().map(row)).plain();
        let unit = Chip::named(&self.chip, self.width).map_or("SIMD or multiprocessor", |chip| chip.unit());
        let mut told = format!(
            "{}, {}\n{table}\nscratch and shared in bytes, latency and throughput in cycles without trip counts, waves per {unit}\n",
            self.device, self.driver
        );
        if let Some(why) = self.kernels.iter().map(|one| &one.waves_unknown).find(|why| !why.is_empty()) {
            told += &format!("waves unknown: {why}\n");
        }
        if !self.left_out.is_empty() {
            told += &format!("left out, since the device has no atomics of their kind: {}\n", self.left_out.join(", "));
        }
        told
    }
}

impl Static {
    fn new(kernel: &KernelInfo, program: &Executable, chip: &str, width: u32) -> Self {
        // By the names of RADV, NVK, ANV and NVIDIA's driver.
        let get = |names: &[&str]| {
            let named = |name: &&str| program.statistics.iter().find(|(told, _)| told.eq_ignore_ascii_case(name));
            names.iter().find_map(named).map(|(_, value)| *value as u64)
        };
        let subgroup = if program.subgroup_size == 0 { width } else { program.subgroup_size };
        let registers = get(&["VGPRs", "Number of GPRs", "Register Count", "GRF registers"]);
        let shared_bytes = get(&["LDS size", "Workgroup Memory Size"]);
        let shared_bytes = shared_bytes.unwrap_or_else(|| workgroup_bytes(kernel.spirv));
        let waves = match (Chip::named(chip, subgroup), registers) {
            (Ok(chip), Some(registers)) => {
                Ok(chip.waves(registers as u32, kernel.local.div_ceil(subgroup.max(1)), shared_bytes as u32))
            }
            (Err(why), _) => Err(why),
            (_, None) => Err("the driver does not tell registers".to_owned()),
        };
        Static {
            kernel: kernel.name.to_owned(),
            subgroup,
            local: kernel.local,
            registers,
            scalar_registers: get(&["SGPRs"]),
            spills: get(&["Spilled VGPRs", "Spills to memory", "Spill Count"]),
            scratch_bytes: get(&["Scratch size", "SLM Size", "Scratch Memory Size", "Local Memory Size"]),
            shared_bytes,
            instructions: get(&["Instructions", "Instruction count"]),
            latency: get(&["Latency", "Static cycle count", "Cycle Count"]),
            inverse_throughput: get(&["Inverse Throughput"]),
            waves: waves.as_ref().ok().copied(),
            waves_unknown: waves.err().unwrap_or_default(),
        }
    }
}

/// True if a GPU with subgroups of `lanes` would run the kernel in a frame or a step: `Blend` takes eight pixels a lane on CPUs
/// alone, `Sort` the scatter on subgroups below 32, `Grids` teams of lanes on CPUs, `Lpips` the convolution of their width, and
/// probes only measure the device.
pub(super) fn gpu_runs(kernel: &str, lanes: u32) -> bool {
    let is_for_gpus = |spec: &table::Spec| {
        let by_teams = ["bilateral/bilateral_slice.comp", "bilateral/bilateral_bwd.comp"].contains(&spec.file);
        let has_width = spec.family.axes.iter().any(|axis| axis.name == "lanes");
        spec.value("PIXELS") != 8
            && spec.file != "sort/sort_scatter.comp"
            && !by_teams
            && (!has_width || spec.value("LANES") == lanes as usize)
            && !spec.file.starts_with("probe/")
    };
    table::kernel(kernel).is_some_and(is_for_gpus)
}

/// The instructions of a SPIR-V module, each with its opcode first.
pub(super) fn instructions(spirv: &[u8]) -> Vec<Vec<u32>> {
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(spirv);
    let mut found = Vec::new();
    let mut at = 5;
    while let Some(first) = words.get(at) {
        let length = (first >> 16).max(1) as usize;
        let mut one = words.get(at..at + length).unwrap_or_default().to_vec();
        if let Some(word) = one.first_mut() {
            *word &= 0xffff;
        }
        found.push(one);
        at += length;
    }
    found
}

const INT64_ATOMICS: u32 = 12;

fn declares(spirv: &[u8], capability: u32) -> bool {
    instructions(spirv).iter().any(|one| one == &[17, capability])
}

/// Bytes of the variables in workgroups' storage: 32-bit numbers, vectors, arrays and structs of them, without padding.
fn workgroup_bytes(spirv: &[u8]) -> u64 {
    let mut sizes = std::collections::HashMap::new();
    let mut constants = std::collections::HashMap::new();
    let mut total = 0;
    for one in instructions(spirv) {
        let size = |id: &u32| sizes.get(id).copied().unwrap_or(0);
        let value = |id: &u32| constants.get(id).copied().unwrap_or(0);
        // OpTypeBool, Int, Float, Vector, Array, Struct, Pointer; OpConstant; OpVariable of storage class Workgroup.
        let (id, bytes) = match one.as_slice() {
            [20, id] => (*id, 4),
            [21, id, bits, _] | [22, id, bits] => (*id, u64::from(bits / 8)),
            [23, id, of, n] => (*id, size(of) * u64::from(*n)),
            [28, id, of, n] => (*id, size(of) * value(n)),
            [30, id, parts @ ..] => (*id, parts.iter().map(size).sum()),
            [32, id, _, of] => (*id, size(of)),
            [43, _, id, n] => {
                constants.insert(*id, u64::from(*n));
                continue;
            }
            [59, of, _, 4, ..] => {
                total += size(of);
                continue;
            }
            _ => continue,
        };
        sizes.insert(id, bytes);
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivv::internals::gpu::kernel_named;

    fn kernel(name: &str) -> &'static KernelInfo {
        kernel_named(name).unwrap()
    }

    #[test]
    fn a_module_tells_its_shared_memory_and_whether_it_needs_64_bit_atomics() {
        assert_eq!(workgroup_bytes(kernel("adam_idle").spirv), 0);
        // A block of 2,048 keys, a base for each of 256 digits, two sums for each of 8 subgroups.
        assert_eq!(workgroup_bytes(kernel("sort_exchange").spirv), 4 * (2048 + 256 + 2 * 8));
        let needs = |name| declares(kernel(name).spirv, INT64_ATOMICS);
        assert!(!needs("blend_bwd_fixed_p4") && needs("blend_bwd_fixed64_p4"));
    }

    /// `check_limits` of `vk` asks devices for as much.
    #[test]
    fn the_scatter_alone_shares_more_than_every_device_has() {
        let larger = table::KERNELS.iter().filter(|spec| workgroup_bytes(kernel(&spec.name).spirv) > 16_384);
        let names: Vec<&str> = larger.map(|spec| &*spec.name).collect();
        assert_eq!(names, ["sort_scatter", "sort_scatter_indexed"]);
        assert!(names.into_iter().all(|name| workgroup_bytes(kernel(name).spirv) == 16_448));
    }

    #[test]
    fn shapes_for_cpus_and_probes_have_no_budget() {
        let ours = ["blend_fwd_p4", "sort_exchange", "emit_slots", "cull_dynamic"];
        assert!(ours.into_iter().all(|kernel| gpu_runs(kernel, 32)));
        let others = [
            "blend_fwd_p8",
            "blend_bwd_fixed_color_p8",
            "sort_scatter",
            "probe_fma",
            "bilateral_bwd",
            "lpips_conv",
            "lpips_conv_w64",
        ];
        assert!(!others.into_iter().any(|kernel| gpu_runs(kernel, 32)));
    }

    #[test]
    fn names_of_drivers_are_understood_and_what_none_tells_is_unknown() {
        let told = |names: &[(&str, f64)]| Executable {
            subgroup_size: 32,
            statistics: names.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
        };
        let kernel = kernel("blend_fwd_train_p4");
        let radv = told(&[("VGPRs", 96.0), ("Spilled VGPRs", 2.0), ("LDS size", 0.0), ("Latency", 9631.0)]);
        let radv = Static::new(kernel, &radv, "RADV NAVI31", 32);
        assert_eq!((radv.registers, radv.spills, radv.latency), (Some(96), Some(2), Some(9631)));
        assert_eq!((radv.waves, radv.waves_unknown.as_str()), (Some(16.0), ""));
        let nvk = Static::new(kernel, &told(&[("Number of GPRs", 134.0), ("SLM Size", 44.0)]), "GA100", 32);
        assert_eq!((nvk.scratch_bytes, nvk.latency, nvk.waves), (Some(44), None, Some(12.0)));
        let none = Static::new(kernel, &told(&[]), "GA100", 32);
        assert_eq!((none.waves, none.waves_unknown.as_str()), (None, "the driver does not tell registers"));
        assert!(Static::new(kernel, &told(&[]), "Arc", 16).waves_unknown.contains("table"));
    }
}
