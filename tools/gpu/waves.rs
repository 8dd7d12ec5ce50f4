//! How many subgroups a chip holds at once, from what a program needs of it.

/// A part of a chip that subgroups share: its numbers are those of the vendors' documents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chip {
    /// Registers that a SIMD (AMD) or a quarter of a multiprocessor (NVIDIA) has for each lane of a subgroup.
    registers: u32,
    /// They are given out in multiples of this.
    granule: u32,
    /// Most subgroups of a SIMD, or of a quarter.
    most: u32,
    /// SIMDs, or quarters, that share the shared memory.
    simds: u32,
    shared: u32,
    /// Bytes of it that each workgroup loses.
    reserved: u32,
    /// Most workgroups on these; 0 where only the subgroups are bounded.
    groups: u32,
    /// True if subgroups are told per multiprocessor, and not per SIMD.
    per_processor: bool,
}

const fn amd(registers: u32, granule: u32, most: u32, simds: u32) -> Option<Chip> {
    Some(Chip { registers, granule, most, simds, shared: 65_536, reserved: 0, groups: 0, per_processor: false })
}

/// RDNA has registers of 32 lanes: a wave of 64 takes two of each, from half the granules.
const fn rdna(registers: u32, granule: u32, most: u32) -> [Option<Chip>; 2] {
    [amd(registers, granule, most, 2), amd(registers / 2, granule / 2, most, 2)]
}

const fn nvidia(warps: u32, shared: u32, reserved: u32, groups: u32) -> [Option<Chip>; 2] {
    let (most, shared) = (warps / 4, shared * 1024);
    [Some(Chip { registers: 512, granule: 8, most, simds: 4, shared, reserved, groups, per_processor: true }), None]
}

/// By parts of names: the chip with subgroups of 32 and of 64 lanes.
#[rustfmt::skip]
const CHIPS: [(&[&str], [Option<Chip>; 2]); 10] = [
    (&["NAVI31", "NAVI32", "GFX1100", "GFX1101", "GFX1200", "GFX1201", "NAVI44", "NAVI48"], rdna(1536, 24, 16)),
    (&["NAVI21", "NAVI22", "NAVI23", "NAVI24", "VANGOGH", "REMBRANDT", "NAVI33", "PHOENIX"], rdna(1024, 16, 16)),
    (&["NAVI10", "NAVI12", "NAVI14"], rdna(1024, 8, 20)),
    (&["VEGA10", "VEGA12", "VEGA20", "RAVEN", "RENOIR"], [None, amd(256, 4, 10, 4)]),
    (&["MI200", "MI300"], [None, amd(512, 8, 8, 4)]),
    (&["GH100", "H100", "H200"], nvidia(64, 228, 1024, 32)),
    (&["GA100", "NVIDIA A100-", "NVIDIA A100 "], nvidia(64, 164, 1024, 32)),
    (&["AD10", "GEFORCE RTX 40"], nvidia(48, 100, 1024, 24)),
    (&["GA10", "GEFORCE RTX 30"], nvidia(48, 100, 1024, 16)),
    (&["TU10", "TU11", "GEFORCE RTX 20"], nvidia(32, 64, 0, 16)),
];

impl Chip {
    /// By a device's name or a part of a driver's, such as `NAVI31` or `GA100`, and the lanes of a subgroup.
    pub fn named(name: &str, width: u32) -> Result<Chip, String> {
        let name = name.to_uppercase();
        let found = CHIPS.iter().find(|(parts, _)| parts.iter().any(|part| name.contains(part)));
        let (_, [narrow, wide]) = found.ok_or("the chip is not in the table of tools/gpu/waves.rs")?;
        let chip = match width {
            32 => *narrow,
            64 => *wide,
            _ => None,
        };
        chip.ok_or_else(|| format!("the chip has no subgroups of {width} lanes"))
    }

    /// Subgroups held at once by a SIMD (AMD) or a multiprocessor (NVIDIA): programs of so many registers a lane, in workgroups of
    /// so many subgroups with so many bytes of shared memory. Below 1 where workgroups leave SIMDs empty.
    pub fn waves(&self, registers: u32, subgroups: u32, shared_bytes: u32) -> f64 {
        let given = registers.max(1).div_ceil(self.granule) * self.granule;
        let by_registers = self.most.min(self.registers / given) * self.simds;
        let subgroups = subgroups.max(1);
        let of_groups = |most: u32| most.saturating_mul(subgroups);
        let held = match self.per_processor {
            // A workgroup starts when all of it fits.
            true => of_groups(by_registers / subgroups).min(of_groups(self.groups)),
            false => by_registers,
        };
        let each = shared_bytes + self.reserved;
        let held = if shared_bytes == 0 { held } else { held.min(of_groups(self.shared / each)) };
        f64::from(held) / if self.per_processor { 1.0 } else { f64::from(self.simds) }
    }

    pub fn unit(&self) -> &'static str {
        if self.per_processor { "multiprocessor" } else { "SIMD" }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// AMD's table for GCN: most registers for so many waves.
    #[test]
    fn waves_of_gcn_are_those_of_amds_table() {
        let chip = Chip::named("AMD Radeon RX Vega (RADV VEGA10)", 64).unwrap();
        let table =
            [(24, 10), (28, 9), (32, 8), (36, 7), (40, 6), (48, 5), (64, 4), (84, 3), (85, 2), (128, 2), (129, 1)];
        for (registers, waves) in table {
            assert_eq!(chip.waves(registers, 1, 0), f64::from(waves), "{registers}");
        }
        // 2 KiB a wave of the 64 KiB of four SIMDs.
        assert_eq!(chip.waves(16, 1, 2048), 8.0);
        assert_eq!(chip.waves(16, 1, 65_536), 0.25);
    }

    #[test]
    fn a_wave_of_64_takes_twice_the_registers_of_rdna() {
        let of = |name: &str, width: u32, registers: u32| Chip::named(name, width).unwrap().waves(registers, 2, 0);
        assert_eq!([of("navi31", 32, 96), of("navi31", 32, 120), of("navi31", 64, 120)], [16.0, 12.0, 6.0]);
        assert_eq!([of("navi21", 32, 112), of("navi21", 64, 120), of("navi21", 32, 224)], [9.0, 4.0, 4.0]);
        assert_eq!([of("gfx1200", 32, 168), of("mi200", 64, 128)], [9.0, 4.0]);
    }

    /// CUDA C++ Best Practices Guide, 10.2: 37 registers on a multiprocessor of 64 warps and 65,536 registers. Blocks of 128
    /// threads: 12 of them, 75 %. Blocks of 320: four, 63 %.
    #[test]
    fn warps_are_those_of_nvidias_guide() {
        let chip = Chip::named("GA100", 32).unwrap();
        assert_eq!([chip.waves(37, 4, 0), chip.waves(37, 10, 0), chip.waves(32, 4, 0)], [48.0, 40.0, 64.0]);
        // 32 warps of Turing; 16 workgroups at most.
        let turing = Chip::named("NVIDIA GeForce RTX 2080 Ti", 32).unwrap();
        assert_eq!([turing.waves(32, 2, 0), turing.waves(32, 1, 0)], [32.0, 16.0]);
    }

    #[test]
    fn an_unknown_chip_and_a_width_that_a_chip_lacks_say_why() {
        assert!(Chip::named("Intel(R) Arc(tm) A770", 16).unwrap_err().contains("table"));
        assert!(Chip::named("VEGA10", 32).unwrap_err().contains("32 lanes"));
    }
}
