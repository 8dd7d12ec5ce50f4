//! Priors of an image, as halves.

use std::collections::HashMap;
use std::path::PathBuf;

use exr::prelude::f16;

use super::Fault;
use crate::scene::prior::{read_depth, read_flow};

/// Which priors are decoded with the images of a capture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PriorPlan {
    pub flow: bool,
    /// Images whose depth is, by (camera, frame): with (a, b) the prior p stands for a p + b, which is not below 0.
    pub depth: HashMap<(usize, u32), [f64; 2]>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct PriorSource {
    pub flow: Option<PathBuf>,
    pub depth: Option<(PathBuf, [f64; 2])>,
}

impl PriorSource {
    pub fn is_empty(&self) -> bool {
        self.flow.is_none() && self.depth.is_none()
    }

    /// Halves of depth and of flow, by pixel; empty where there are none.
    pub fn decode(&self, width: u32, height: u32) -> Result<(Vec<u16>, Vec<[u16; 2]>), Fault> {
        let mut flow = Vec::new();
        if let Some(path) = &self.flow {
            flow = read_flow(path, width, height)?.into_iter().map(|flow| flow.map(half_bits)).collect();
        }
        let mut depth = Vec::new();
        if let Some((path, [a, b])) = &self.depth {
            // Not `max`, which would make NaN a number.
            let compared = |p: f32| {
                let d = (a * f64::from(p) + b) as f32;
                if d < 0.0 { 0.0 } else { d }
            };
            depth = read_depth(path, width, height)?.into_iter().map(|p| half_bits(compared(p))).collect();
        }
        Ok((depth, flow))
    }
}

/// The half nearest to `x`. Values that are not finite, or beyond a half's 65,504, are no prior.
pub fn half_bits(x: f32) -> u16 {
    f16::from_f32(x).to_bits()
}

pub fn half_value(bits: u16) -> f64 {
    f16::from_bits(bits).to_f64()
}

pub(super) fn is_prior(halves: &[u16]) -> bool {
    halves.iter().all(|half| half & 0x7c00 != 0x7c00)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_the_nearest_ones() {
        // Every half is its own nearest.
        for bits in (0..0x7c00).chain(0x8000..0xfc00) {
            assert_eq!(half_bits(half_value(bits) as f32), bits, "{bits:x}");
        }
        // Round to the nearer one, and to the even one half-way between two; by no more than the documentation says.
        for bits in 0..0x7bff_u16 {
            let (low, high) = (half_value(bits), half_value(bits + 1));
            let middle = (low + high) / 2.0;
            assert_eq!(half_bits((middle * 0.99 + low * 0.01) as f32), bits, "{bits:x}");
            assert_eq!(half_bits((middle * 0.99 + high * 0.01) as f32), bits + 1, "{bits:x}");
            assert_eq!(half_bits(middle as f32), bits + bits % 2, "{bits:x}");
            assert!(middle - low <= f64::max(middle * 2f64.powi(-11), 2f64.powi(-25)), "{bits:x}");
        }
        assert_eq!(half_bits(65_519.0), 0x7bff);
        for beyond in [65_520.0, 1e30, f32::INFINITY, f32::NAN] {
            assert!(!is_prior(&[half_bits(beyond)]) && !is_prior(&[half_bits(-beyond), 0]), "{beyond}");
        }
        assert!(is_prior(&[half_bits(-1.0), half_bits(0.0)]));
    }
}
