//! Graphics cards that are not here: what their makers and others say of them, for estimates.

use serde::Serialize;

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figure {
    pub value: f64,
    /// Where it is from.
    pub source: &'static str,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Card {
    pub name: &'static str,
    /// The chip of the table of budgets whose compiler's counts are taken for it, and what that is to the card.
    pub compiled: (&'static str, &'static str),
    /// Lanes of a subgroup.
    pub lanes: u32,
    /// Bytes of its memory.
    pub memory: Figure,
    /// Peak bandwidth of its memory, bytes a second.
    pub peak: Figure,
    /// What of that kernels reach.
    pub bytes: Figure,
    /// Bandwidth of the cache that all its processors share, bytes a second.
    pub cache: Figure,
    /// Bytes of that cache.
    pub cache_bytes: Figure,
    /// Instructions of a subgroup that it issues, a second.
    pub issue: Figure,
    /// Additions and multiplications, a second.
    pub flops: Figure,
    /// Powers of two, a second.
    pub exp2: Figure,
    /// Nanoseconds that a small dispatch costs which waits for the one before.
    pub barrier_ns: Figure,
}

const fn figure(value: f64, source: &'static str) -> Figure {
    Figure { value, source }
}

/// Kernels that stream are reported to reach 80 to 92 % of a peak.
const REACHED: f64 = 0.85;

const fn reached(peak: f64) -> Figure {
    figure(REACHED * peak, "0.85 of the peak, assumed")
}

const CACHE: &str = "assumed: others measure 4 to 6 TB/s on cards of this size; not checked here";
const BARRIER: &str = "assumed: 2.5 to 5 us are usual; `ivv profile` measures it on the card";
const NVIDIA_EXP2: &str = "16 a clock and multiprocessor: CUDA C++ Programming Guide, throughput of arithmetic";

pub const CARDS: [Card; 4] = [
    Card {
        name: "H200",
        compiled: ("GA100/32", "Ampere where the card is Hopper, and Mesa's compiler, not NVIDIA's"),
        lanes: 32,
        memory: figure(141e9, "NVIDIA, data sheet of the H200"),
        peak: figure(4.8e12, "NVIDIA, data sheet of the H200"),
        bytes: reached(4.8e12),
        cache: figure(5.5e12, CACHE),
        cache_bytes: figure(50e6, "NVIDIA, Hopper white paper, H100 SXM5"),
        issue: figure(
            132.0 * 4.0 * 1.98e9,
            "132 multiprocessors x 4 schedulers x 1.98 GHz (boost): NVIDIA, Hopper white paper",
        ),
        flops: figure(67e12, "NVIDIA, data sheet of the H200"),
        exp2: figure(132.0 * 16.0 * 1.98e9, NVIDIA_EXP2),
        barrier_ns: figure(4000.0, BARRIER),
    },
    Card {
        name: "RTX4090",
        compiled: ("GA102/32", "Ampere where the card is Ada, and Mesa's compiler, not NVIDIA's"),
        lanes: 32,
        memory: figure(24e9, "NVIDIA, Ada white paper"),
        peak: figure(1.008e12, "NVIDIA, Ada white paper"),
        bytes: reached(1.008e12),
        cache: figure(5e12, CACHE),
        cache_bytes: figure(72e6, "NVIDIA, Ada white paper"),
        issue: figure(
            128.0 * 4.0 * 2.52e9,
            "128 multiprocessors x 4 schedulers x 2.52 GHz (boost): NVIDIA, Ada white paper",
        ),
        flops: figure(82.6e12, "NVIDIA, Ada white paper"),
        exp2: figure(128.0 * 16.0 * 2.52e9, NVIDIA_EXP2),
        barrier_ns: figure(4000.0, BARRIER),
    },
    Card {
        name: "RX7900XTX",
        compiled: ("navi31/32", "the card's own chip, by Mesa's compiler"),
        lanes: 32,
        memory: figure(24e9, "AMD, page of the RX 7900 XTX"),
        peak: figure(0.96e12, "AMD, page of the RX 7900 XTX"),
        bytes: reached(0.96e12),
        cache: figure(3.5e12, "assumed, as its 96 MB behind the 6 MB are said to give; not checked here"),
        cache_bytes: figure(6e6, "AMD, RDNA 3; 96 MB of Infinity Cache behind it"),
        issue: figure(96.0 * 2.0 * 2.5e9, "96 compute units x 2 SIMDs x 2.5 GHz (boost): AMD, page of the RX 7900 XTX"),
        flops: figure(61.4e12, "AMD, page of the RX 7900 XTX; two a clock where the compiler pairs them"),
        exp2: figure(96.0 * 2.0 * 8.0 * 2.5e9, "a quarter of the lanes a clock: AMD, RDNA 3 instruction set"),
        barrier_ns: figure(4000.0, BARRIER),
    },
    Card {
        name: "A770",
        compiled: ("navi31/32", "of AMD, since no compiler of Intel's runs without the card"),
        lanes: 16,
        memory: figure(16e9, "Intel, page of the Arc A770, 16 GB"),
        peak: figure(0.56e12, "Intel, page of the Arc A770, 16 GB"),
        bytes: reached(0.56e12),
        cache: figure(2e12, "assumed; not checked here"),
        cache_bytes: figure(16e6, "Intel, Xe-HPG"),
        issue: figure(
            512.0 * 2.1e9 / 2.0,
            "512 vector engines of 8 lanes x 2.1 GHz, two clocks for 16 lanes: Intel, Xe-HPG",
        ),
        flops: figure(17.2e12, "512 vector engines x 8 lanes x 2 x 2.1 GHz"),
        exp2: figure(512.0 * 2.0 * 2.1e9, "2 a clock and vector engine: Intel, Xe-HPG"),
        barrier_ns: figure(8000.0, "assumed, twice that of the others"),
    },
];

impl Card {
    /// The card called `name`, however it is written.
    pub fn named(name: &str) -> Result<&'static Card, String> {
        let plain = |name: &str| name.to_uppercase().replace([' ', '-'], "");
        let found = CARDS.iter().find(|card| card.name == plain(name));
        let names = CARDS.map(|card| card.name).join(", ");
        found.ok_or_else(|| format!("there are no figures of a card `{name}`; there are of {names}"))
    }

    pub fn figures(&self) -> [(&'static str, String, &'static str); 8] {
        let tera = |figure: Figure, unit: &str| (format!("{:.2} T{unit}", figure.value / 1e12), figure.source);
        let told = |name, (value, source): (String, &'static str)| (name, value, source);
        [
            told("memory, peak", tera(self.peak, "B/s")),
            told("memory, in practice", tera(self.bytes, "B/s")),
            told("shared cache", tera(self.cache, "B/s")),
            told("its size", (format!("{} MB", self.cache_bytes.value / 1e6), self.cache_bytes.source)),
            told("instructions issued", tera(self.issue, "/s")),
            told("float operations", tera(self.flops, "/s")),
            told("powers of two", tera(self.exp2, "/s")),
            told("dispatch behind a barrier", (format!("{} us", self.barrier_ns.value / 1e3), self.barrier_ns.source)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_card_is_found_however_it_is_written_and_others_are_named() {
        assert_eq!(Card::named("rtx 4090").unwrap().name, "RTX4090");
        assert_eq!(Card::named("RX-7900-XTX").unwrap().name, "RX7900XTX");
        assert!(Card::named("GTX 480").unwrap_err().contains("H200, RTX4090, RX7900XTX, A770"));
    }

    /// A multiply-add of every lane issued: what the makers call the peak, which AMD counts twice.
    #[test]
    fn the_peak_of_arithmetic_is_that_of_the_issue_rate() {
        for card in &CARDS {
            let issued = 2.0 * f64::from(card.lanes) * card.issue.value;
            let times = if card.name == "RX7900XTX" { 2.0 } else { 1.0 };
            assert!((card.flops.value / (times * issued) - 1.0).abs() < 0.01, "{}", card.name);
        }
    }
}
