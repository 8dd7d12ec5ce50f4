//! Adam on the device, one group of parameters at a time; rates and bias corrections come from the host.

use crate::error::Result;
use crate::gpu::generated::{Status, adam};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Exponential decay of the first moment (SPEC 6).
pub const BETA1: f64 = 0.9;
/// Exponential decay of the second moment (SPEC 6).
pub const BETA2: f64 = 0.999;
/// Keeps a step finite where no gradient has been (SPEC 6).
pub const EPS: f32 = 1e-15;

/// Moments of one parameter buffer.
pub struct Moments {
    /// Mean of the gradients, in the parameters' layout.
    pub first: Buf<[f32; 4]>,
    /// Mean of their squares.
    pub second: Buf<[f32; 4]>,
}

impl Moments {
    /// Zeros for `parameter`.
    pub fn new(gpu: &Gpu, parameter: &Buf<[f32; 4]>) -> Result<Self> {
        let zeros = vec![[0.0; 4]; parameter.len()];
        Ok(Moments { first: gpu.upload("adam m", &zeros)?, second: gpu.upload("adam v", &zeros)? })
    }

    /// Appends step number `step` (from 1) on `parameter`. `rates` are the learning rates of each plane's components, at
    /// most six planes; `lowest` is the floor of the last plane's last component, if its rate is not 0; `n_bad` counts the vec4 whose gradient is not finite.
    #[expect(clippy::too_many_arguments, reason = "a buffer each")]
    pub fn record(
        &self,
        rec: &mut Recording,
        parameter: &Buf<[f32; 4]>,
        gradient: &Buf<[f32; 4]>,
        rates: &[[f32; 4]],
        lowest: f32,
        step: u64,
        status: &Buf<Status>,
        n_bad: &Buf<u32>,
    ) {
        // Of the decay that f32 holds: 1 - 0.999 is off by 1e-5 otherwise.
        let correction = |beta: f64| 1.0 - f64::from(beta as f32).powf(step as f64);
        let mut push = adam::Push {
            n: parameter.len() as u32,
            planes: rates.len() as u32,
            beta1: BETA1 as f32,
            beta2: BETA2 as f32,
            inverse_c2: (1.0 / correction(BETA2)) as f32,
            eps: EPS,
            lowest,
            ..adam::Push::default()
        };
        for (to, from) in push.rates.iter_mut().zip(rates) {
            *to = from.map(|rate| (f64::from(rate) / correction(BETA1)) as f32);
        }
        let args = adam::Args {
            frame_status: status,
            gradient,
            parameter,
            moment1: &self.first,
            moment2: &self.second,
            n_bad,
        };
        rec.pass(args, push, Grid::Threads(push.n));
    }
}
