//! Priors of an image, as the device takes them.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::report::Fault;
use crate::error::{Error, Result};
use crate::scene::prior::{read_depth, read_flow};

/// Which priors are decoded with the images of a capture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PriorPlan {
    /// Whether flow is.
    pub flow: bool,
    /// Images whose depth is, by (camera, frame): with (a, b) the prior p stands for a p + b, which is not below 0.
    pub depth: HashMap<(usize, u32), [f64; 2]>,
}

/// The priors of one image.
#[derive(Clone, Debug, Default)]
pub(super) struct PriorSource {
    pub flow: Option<PathBuf>,
    pub depth: Option<(PathBuf, [f64; 2])>,
}

/// Priors that have been decoded.
pub(super) struct Priors {
    /// See [`prior_word`].
    pub words: Vec<[u32; 2]>,
    pub n_depth: u32,
    pub n_flow: u32,
}

impl PriorSource {
    pub fn is_empty(&self) -> bool {
        self.flow.is_none() && self.depth.is_none()
    }

    /// Decodes the priors of an image of `width` x `height` pixels whose mask is in the top bytes of `pixels`.
    pub fn decode(&self, width: u32, height: u32, pixels: &[u32]) -> std::result::Result<Priors, Fault> {
        let n = pixels.len();
        let flow = match &self.flow {
            Some(path) => told(path, read_flow(path, width, height))?,
            None => vec![[f32::NAN; 2]; n],
        };
        let depth = match &self.depth {
            Some((path, [a, b])) => {
                let prior = told(path, read_depth(path, width, height))?;
                // Not `max`, which would make NaN a number.
                let compared = |p: f32| {
                    let d = (a * f64::from(p) + b) as f32;
                    if d < 0.0 { 0.0 } else { d }
                };
                prior.into_iter().map(compared).collect()
            }
            None => vec![f32::NAN; n],
        };
        let words: Vec<[u32; 2]> = depth.iter().zip(&flow).map(|(depth, flow)| prior_word(*depth, *flow)).collect();
        let count = |has: &dyn Fn(&[u32; 2]) -> bool| {
            words.iter().zip(pixels).filter(|(word, pixel)| **pixel >> 24 != 0 && has(word)).count() as u32
        };
        let is_half = |half: u32| half & 0x7c00 != 0x7c00;
        let (n_depth, n_flow) = (
            count(&|word| f32::from_bits(word[0]).is_finite()),
            count(&|word| is_half(word[1]) && is_half(word[1] >> 16)),
        );
        Ok(Priors { words, n_depth, n_flow })
    }
}

/// An error of a reader as a fault, which can be told more than once.
fn told<T>(path: &Path, outcome: Result<T>) -> std::result::Result<T, Fault> {
    outcome.map_err(|error| match error {
        Error::Data { file, place, reason, remedy } => Fault { file, place, reason, remedy },
        other => Fault {
            file: path.to_owned(),
            place: String::new(),
            reason: other.to_string(),
            remedy: "this is no fault of the capture: try again".to_owned(),
        },
    })
}

/// A pixel's priors as the device takes them: the bits of the depth, the flow (pixels) as two halves, rounded to nearest.
/// What is not finite is no prior; nor is a flow beyond a half's range of 65,504 pixels.
pub fn prior_word(depth: f32, flow: [f32; 2]) -> [u32; 2] {
    let [x, y] = flow.map(|x| u32::from(half_bits(x)));
    [depth.to_bits(), x | y << 16]
}

/// The depth and the flow that a word of [`prior_word`] holds; `None` where it holds none.
pub(super) fn prior_of([depth, flow]: [u32; 2]) -> (Option<f32>, Option<[f64; 2]>) {
    let flow = [flow as u16, (flow >> 16) as u16].map(half_value);
    let depth = f32::from_bits(depth);
    (depth.is_finite().then_some(depth), flow.iter().all(|x| x.is_finite()).then_some(flow))
}

/// The value of a half; what is not finite is not a number.
fn half_value(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023) / 1024.0);
    let size = match exponent {
        0 => fraction * 2f64.powi(-14),
        31 => f64::NAN,
        _ => (1.0 + fraction) * 2f64.powi(exponent - 15),
    };
    if bits & 0x8000 != 0 { -size } else { size }
}

/// The bits of the nearest half; those of infinity where the number is too large.
fn half_bits(x: f32) -> u16 {
    let sign = (x.to_bits() >> 16 & 0x8000) as u16;
    let size = x.abs();
    if size.is_nan() || size >= 65_520.0 {
        return sign | 0x7c00;
    }
    // Steps of a half below 2^-14 are 2^-24; above, 2^-10 of the power of two.
    let power = (size.to_bits() >> 23) as i32 - 127;
    let step = f32::exp2((power.max(-14) - 10) as f32);
    let steps = (size / step).round_ties_even() as u16;
    // 1,024 steps more than those of the exponent below: a carry moves on to the next exponent by itself.
    let exponent = (power.max(-14) + 14) as u16;
    sign | (exponent * 1024 + steps)
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
        // Round to the nearer one, and to the even one half-way between two.
        for bits in 0..0x7bff_u16 {
            let (low, high) = (half_value(bits), half_value(bits + 1));
            let middle = (low + high) / 2.0;
            assert_eq!(half_bits((middle * 0.99 + low * 0.01) as f32), bits, "{bits:x}");
            assert_eq!(half_bits((middle * 0.99 + high * 0.01) as f32), bits + 1, "{bits:x}");
            assert_eq!(half_bits(middle as f32), bits + bits % 2, "{bits:x}");
        }
        assert_eq!(half_bits(65_519.0), 0x7bff);
        for beyond in [65_520.0, 1e30, f32::INFINITY, f32::NAN] {
            assert_eq!(half_bits(beyond) & 0x7c00, 0x7c00, "{beyond}");
        }
        assert_eq!(half_bits(-1.0), 0xbc00);
    }
}
