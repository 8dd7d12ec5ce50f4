//! Taking the delay out of a response, so that responses of neighbouring directions can be mixed without a comb.

use std::f64::consts::PI;

use realfft::num_complex::Complex64;

use super::spectrum::{Spectra, good_length};

/// Samples before the onset that an aligned response keeps: most measured responses ring a little before it.
pub const LEAD: usize = 64;
/// Samples that an aligned response has more than the measured one.
pub const EXTRA: usize = 128;

/// Aligns responses of one length.
pub struct Aligner {
    taps: usize,
    spectra: Spectra,
}

/// A response without its delay.
pub struct Aligned {
    /// Delay of the onset, samples.
    pub delay: f64,
    /// The response with its onset at [`LEAD`]; `taps + EXTRA` samples.
    pub response: Vec<f32>,
    /// Energy that fell out at the ends, as a part of all.
    pub lost: f64,
}

impl Aligner {
    /// For responses of `taps` samples.
    pub fn new(taps: usize) -> Self {
        Aligner { taps, spectra: Spectra::new(good_length(4 * taps.max(EXTRA))) }
    }

    /// Finds the delay as the lag at which a response is most like its own minimum-phase version (Nam, Abel and Smith
    /// 2008), which stands up to the ringing before the onset that a threshold takes for it.
    pub fn align(&mut self, response: &[f32]) -> Aligned {
        let n = self.spectra.len();
        let bins = self.spectra.forward(response.iter().map(|value| f64::from(*value)));
        let minimum = self.minimum_phase(&bins);
        let cross: Vec<Complex64> = bins.iter().zip(&minimum).map(|(h, m)| h * m.conj()).collect();
        let correlation = self.spectra.inverse(&cross);
        let coarse = (0..self.taps).max_by(|a, b| correlation[*a].total_cmp(&correlation[*b])).unwrap_or(0);
        let delay = peak(&cross, n, coarse as f64);
        let moved = shifted(&bins, n, LEAD as f64 - delay);
        let signal = self.spectra.inverse(&moved);
        let kept = self.taps + EXTRA;
        let energy = |part: &[f64]| part.iter().map(|value| value * value).sum::<f64>();
        let lost = energy(&signal[kept..]) / energy(&signal).max(f64::MIN_POSITIVE);
        Aligned { delay, response: signal[..kept].iter().map(|value| *value as f32).collect(), lost }
    }

    /// The spectrum with the same magnitudes whose energy comes as early as it can, by the folded cepstrum.
    fn minimum_phase(&mut self, bins: &[Complex64]) -> Vec<Complex64> {
        let n = self.spectra.len();
        let floor = 1e-6 * bins.iter().map(|bin| bin.norm()).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
        let logs: Vec<Complex64> = bins.iter().map(|bin| Complex64::from(bin.norm().max(floor).ln())).collect();
        let cepstrum = self.spectra.inverse(&logs);
        let fold = |i: usize| match i {
            0 => 1.0,
            i if i == n / 2 => 1.0,
            i if i < n / 2 => 2.0,
            _ => 0.0,
        };
        let folded = self.spectra.forward(cepstrum.iter().enumerate().map(|(i, value)| value * fold(i)));
        folded.into_iter().map(Complex64::exp).collect()
    }
}

/// Bins of a signal that is later by `by` samples, of transforms of `n`.
pub fn shifted(bins: &[Complex64], n: usize, by: f64) -> Vec<Complex64> {
    let turn = |(k, bin): (usize, &Complex64)| bin * Complex64::from_polar(1.0, -2.0 * PI * k as f64 * by / n as f64);
    bins.iter().enumerate().map(turn).collect()
}

/// The lag within a sample of `coarse` at which a correlation, given by its bins, is highest.
pub fn peak(bins: &[Complex64], n: usize, coarse: f64) -> f64 {
    let at = |lag: f64| -> f64 {
        let turn = Complex64::from_polar(1.0, 2.0 * PI * lag / n as f64);
        let mut phase = Complex64::ONE;
        bins.iter().fold(0.0, |sum, bin| {
            let term = (bin * phase).re;
            phase *= turn;
            sum + term
        })
    };
    // Golden sections: the peak is smooth and alone within a sample.
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let (mut low, mut high) = (coarse - 1.0, coarse + 1.0);
    let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_a, mut at_b) = (at(a), at(b));
    while high - low > 1e-4 {
        if at_a > at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - golden * (high - low);
            at_a = at(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + golden * (high - low);
            at_b = at(b);
        }
    }
    0.5 * (low + high)
}
