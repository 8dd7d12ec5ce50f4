//! Conversions that the quantised formats share: from their bytes to raw parameters (SPEC 2), and back.

/// The logit of an opacity of 0 to 255. The ends, whose logits are infinite, are taken half a step inside.
pub(super) fn logit_of_byte(byte: u8) -> f32 {
    let p = (f64::from(byte) / 255.0).clamp(0.5 / 255.0, 254.5 / 255.0);
    (p / (1.0 - p)).ln() as f32
}

pub(super) fn byte_of_logit(logit: f32) -> u8 {
    level(1.0 / (1.0 + (-f64::from(logit)).exp()))
}

/// The nearest of 256 levels of a value in [0, 1]; beyond it, the nearest end.
pub(super) fn level(value: f64) -> u8 {
    (255.0 * value).round() as u8
}

/// A unit quaternion in the order of `stored`, whose entry `largest` is the one that is not stored (and positive).
pub(super) fn complete_quaternion(stored: [f64; 3], largest: usize) -> [f64; 4] {
    let mut rest = stored.into_iter();
    let missing = (1.0 - stored.iter().map(|v| v * v).sum::<f64>()).max(0.0).sqrt();
    std::array::from_fn(|i| if i == largest { missing } else { rest.next().unwrap_or_default() })
}
