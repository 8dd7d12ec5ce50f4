//! Sums of costs: what passes must do at least, in the units of a device's peaks. What each kernel costs is in the table of
//! kernels.

use super::table::Cost;
use serde::{Serialize, Serializer};

impl Cost {
    pub fn add(&mut self, other: &Cost, n: f64) {
        self.bytes += n * other.bytes;
        self.copied += n * other.copied;
        self.filled += n * other.filled;
        self.rows += n * other.rows;
        self.flops += n * other.flops;
        self.exp2 += n * other.exp2;
        self.shuffles += n * other.shuffles;
        self.atomics += n * other.atomics;
    }
}

// Written out, since the build reads the table too, which has no serde.
impl Serialize for Cost {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let Cost { bytes, copied, filled, rows, flops, exp2, shuffles, atomics } = *self;
        to.collect_map([
            ("bytes", bytes),
            ("copied", copied),
            ("filled", filled),
            ("rows", rows),
            ("flops", flops),
            ("exp2", exp2),
            ("shuffles", shuffles),
            ("atomics", atomics),
        ])
    }
}
