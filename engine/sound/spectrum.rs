//! Fourier transforms of real signals in f64, for what is prepared once (responses) or measured.

use std::f64::consts::PI;
use std::sync::Arc;

use realfft::num_complex::Complex64;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};

/// Transforms of one length.
pub struct Spectra {
    n: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl Spectra {
    /// Transforms of `n` samples; `n` is even.
    pub fn new(n: usize) -> Self {
        let mut planner = RealFftPlanner::new();
        Spectra { n, forward: planner.plan_fft_forward(n), inverse: planner.plan_fft_inverse(n) }
    }

    pub fn size(&self) -> usize {
        self.n
    }

    /// The bins 0 to n / 2 of a signal, which is cut or padded with zeros.
    pub fn forward(&mut self, signal: impl IntoIterator<Item = f64>) -> Vec<Complex64> {
        let mut padded: Vec<f64> = signal.into_iter().take(self.n).collect();
        padded.resize(self.n, 0.0);
        let mut bins = self.forward.make_output_vec();
        // The lengths are the plan's own, which is all that can be wrong.
        let _ = self.forward.process(&mut padded, &mut bins);
        bins
    }

    /// A signal that is later by `by` samples; what leaves at one end comes in at the other.
    pub fn delayed(&mut self, signal: &[f32], by: f64) -> Vec<f64> {
        let mut bins = self.forward(signal.iter().map(|value| f64::from(*value)));
        for (k, bin) in bins.iter_mut().enumerate() {
            *bin *= Complex64::from_polar(1.0, -2.0 * PI * k as f64 * by / self.n as f64);
        }
        self.inverse(&bins)
    }

    /// The signal of bins 0 to n / 2, scaled so that it undoes [`Spectra::forward`].
    pub fn inverse(&mut self, bins: &[Complex64]) -> Vec<f64> {
        let mut bins = bins.to_vec();
        bins.resize(self.n / 2 + 1, Complex64::ZERO);
        // A real signal has real ends; what is lost here is half of a component at the Nyquist frequency.
        bins[0].im = 0.0;
        bins[self.n / 2].im = 0.0;
        let mut signal = self.inverse.make_output_vec();
        let _ = self.inverse.process(&mut bins, &mut signal);
        let scale = 1.0 / self.n as f64;
        signal.iter().map(|value| value * scale).collect()
    }
}

/// The smallest length of at least `n` with no factor above 5, even.
pub fn good_length(n: usize) -> usize {
    let is_good = |n: &usize| {
        let mut rest = *n;
        for factor in [2, 3, 5] {
            while rest.is_multiple_of(factor) {
                rest /= factor;
            }
        }
        rest == 1
    };
    (n.max(2).div_ceil(2)..).map(|half| 2 * half).find(is_good).unwrap_or(n)
}
