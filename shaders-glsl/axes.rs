// The choices that kernels of a family differ in.

use super::family::{Axis, NONE, switch};

pub const POPULATION: Axis = switch("is_dynamic", &[("static", NONE), ("dynamic", ("DYNAMIC", "1"))]);
pub const DEGREE: Axis = Axis {
    name: "degree",
    values: &[
        ("sh0", ("SH_DEGREE", "0")),
        ("sh1", ("SH_DEGREE", "1")),
        ("sh2", ("SH_DEGREE", "2")),
        ("sh3", ("SH_DEGREE", "3")),
    ],
};
pub const TRAINING: Axis = switch("is_training", &[("", NONE), ("train", ("TRAIN", "1"))]);
pub const SLOTS: Axis = switch("has_slots", &[("", NONE), ("slots", ("SLOTS", "1"))]);
pub const STEPS: Axis = switch("steps", &[("", NONE), ("adam", ("ADAM", "1"))]);
pub const PIXELS: Axis = switch("is_eight", &[("p4", ("PIXELS", "4")), ("p8", ("PIXELS", "8"))]);
pub const OUTPUTS: Axis = switch("is_color", &[("", ("FULL", "1")), ("color", NONE)]);
pub const MOMENTS: Axis = switch("is_16_bit", &[("", NONE), ("m16", ("MOMENTS_16", "1"))]);
pub const STRIDE: Axis = switch("is_halved", &[("", NONE), ("s2", ("STRIDE", "2u"))]);
pub const GATHERED: Axis = switch("is_gathered", &[("", NONE), ("gathered", ("GATHERED", "1"))]);
pub const REPORTED: Axis = switch("is_reported", &[("", NONE), ("report", ("REPORT", "1"))]);
pub const POOLED: Axis = switch("is_pooled", &[("", NONE), ("pooled", ("POOLED", "1"))]);
pub const CARRIED: Axis = switch("is_indexed", &[("", NONE), ("indexed", ("INDEXED", "1"))]);
pub const DIRECTION: Axis = switch("is_backward", &[("", NONE), ("bwd", ("BACKWARD", "1"))]);

pub const LANES: Axis = Axis {
    name: "lanes",
    values: &[("", NONE), ("w16", ("LANES", "16u")), ("w32", ("LANES", "32u")), ("w64", ("LANES", "64u"))],
};

pub const ACCUMULATION: Axis = Axis {
    name: "accumulation",
    values: &[("", NONE), ("fixed", ("ACCUMULATE", "1")), ("fixed64", ("ACCUMULATE", "2"))],
};
