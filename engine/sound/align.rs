//! Taking the delay out of a response, so that responses of neighbouring directions can be mixed without a comb.

use std::f64::consts::PI;

use realfft::num_complex::Complex64;

use super::spectrum::{Spectra, good_length};
use crate::report::statistics::median;

/// Samples before the onset that an aligned response keeps at least: most measured responses ring a little before it.
pub const LEAD: usize = 64;
/// Samples that an aligned response has more than the measured one, with the onset at [`LEAD`].
pub const EXTRA: usize = 128;
/// The part of its energy before which a response counts as silence.
const SILENT: f64 = 1e-8;

pub struct Aligner {
    taps: usize,
    spectra: Spectra,
}

pub struct Aligned {
    /// The response with its onset at `lead`; `taps + EXTRA + lead - LEAD` samples.
    pub response: Vec<f32>,
    /// Energy that fell out at the ends, as a part of all.
    pub lost: f64,
}

#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Samples.
    pub delay: f64,
    /// The correlation there, relative to the highest.
    pub height: f64,
}

impl Aligner {
    pub fn new(taps: usize) -> Self {
        Aligner { taps, spectra: Spectra::new(good_length(4 * taps.max(EXTRA))) }
    }

    /// The delays that a response may have: maxima of its correlation with its own minimum-phase version (Nam, Abel and Smith 2008)
    /// of at least half the highest, which comes first. A threshold would take the ringing before an onset for it.
    pub fn candidates(&mut self, response: &[f32]) -> Vec<Candidate> {
        let n = self.spectra.size();
        let bins = self.spectra.forward(response.iter().map(|value| f64::from(*value)));
        let minimum = self.minimum_phase(&bins);
        let cross: Vec<Complex64> = bins.iter().zip(&minimum).map(|(h, m)| h * m.conj()).collect();
        let correlation = self.spectra.inverse(&cross);
        let highest = correlation[..self.taps].iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let is_peak = |at: &usize| {
            let before = correlation[at.checked_sub(1).unwrap_or(n - 1)];
            correlation[*at] >= before && correlation[*at] > correlation[at + 1] && correlation[*at] >= 0.5 * highest
        };
        let candidate = |at: usize| Candidate { delay: peak(&cross, n, at as f64), height: correlation[at] / highest };
        let mut found: Vec<Candidate> = (0..self.taps).filter(is_peak).map(candidate).collect();
        found.sort_by(|a, b| b.height.total_cmp(&a.height));
        if found.is_empty() { vec![candidate(0)] } else { found }
    }

    /// Takes a delay out of a response, so that its onset comes to lie at `lead`, which is [`LEAD`] to `LEAD + taps`.
    pub fn align(&mut self, response: &[f32], delay: f64, lead: usize) -> Aligned {
        let signal = self.spectra.delayed(response, lead as f64 - delay);
        let kept = self.taps + EXTRA + lead - LEAD;
        let energy = |part: &[f64]| part.iter().map(|value| value * value).sum::<f64>();
        let lost = energy(&signal[kept..]) / energy(&signal).max(f64::MIN_POSITIVE);
        Aligned { response: signal[..kept].iter().map(|value| *value as f32).collect(), lost }
    }

    /// The spectrum with the same magnitudes whose energy comes as early as it can, by the folded cepstrum.
    fn minimum_phase(&mut self, bins: &[Complex64]) -> Vec<Complex64> {
        let n = self.spectra.size();
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

/// Samples of a response before an onset that are not silence.
pub fn before_onset(response: &[f32], onset: f64) -> usize {
    let energy = |part: &[f32]| part.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>();
    let silent = SILENT * energy(response);
    let mut sum = 0.0;
    let first = response.iter().position(|value| {
        sum += f64::from(*value).powi(2);
        sum > silent
    });
    (onset.ceil().max(0.0) as usize).saturating_sub(first.unwrap_or(0))
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
    // Vertices of ever smaller parabolas: the peak is smooth and alone within a sample.
    [0.5, 0.1, 0.02].into_iter().fold(coarse, |middle, step| {
        let (before, here, after) = (at(middle - step), at(middle), at(middle + step));
        let bend = before - 2.0 * here + after;
        let vertex = if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
        middle + step * vertex.clamp(-2.0, 2.0)
    })
}

/// Chooses among the candidates of each direction so that neighbours agree: in the head's shadow the highest correlation may be a
/// ripple. `expected` are delays by a model of the head, up to a constant; `neighbours` are those of each direction.
pub fn choose(candidates: &[Vec<Candidate>], expected: &[f64], neighbours: &[Vec<usize>]) -> Vec<f64> {
    /// Samples by which a head may differ from the model, and a direction from its neighbours.
    const FROM_MODEL: f64 = 8.0;
    const FROM_NEIGHBOURS: f64 = 2.0;
    let best = |at: usize, wanted: f64, scale: f64| {
        let score = |c: &Candidate| c.height - ((c.delay - wanted) / scale).powi(2);
        let best = candidates[at].iter().max_by(|a, b| score(a).total_cmp(&score(b)));
        best.map_or(wanted, |candidate| candidate.delay)
    };
    let highest = candidates.iter().zip(expected).map(|(found, model)| found[0].delay - model);
    let offset = median(&highest.collect::<Vec<_>>());
    let mut chosen: Vec<f64> = (0..candidates.len()).map(|at| best(at, expected[at] + offset, FROM_MODEL)).collect();
    // It settles in a few rounds. A pair that keeps swapping is as good either way.
    for _ in 0..20 {
        let around = |at: usize| median(&neighbours[at].iter().map(|other| chosen[*other]).collect::<Vec<_>>());
        let next: Vec<f64> = (0..candidates.len()).map(|at| best(at, around(at), FROM_NEIGHBOURS)).collect();
        if next == chosen {
            break;
        }
        chosen = next;
    }
    chosen
}
