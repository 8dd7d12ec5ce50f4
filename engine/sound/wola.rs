//! The paper's filtering in the short-time Fourier domain, without its circular wrap: windowed frames, padded, overlapped and added. The
//! analysis window is the only one, and crossfades from one filter to the next.

use std::f64::consts::PI;
use std::sync::Arc;

use realfft::num_complex::Complex32;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};

use super::align::LEAD;
use super::hrtf::Filter;
use super::spectrum::{Spectra, good_length};

/// Frames and transforms of one size.
pub struct Wola {
    frame: usize,
    hop: usize,
    pub window: Vec<f32>,
    n: usize,
    forward: Arc<dyn RealToComplex<f32>>,
    inverse: Arc<dyn ComplexToReal<f32>>,
    baker: Baker,
}

/// The spectra of a filter, by ear.
pub type EarSpectra = [Vec<Complex32>; 2];

impl Wola {
    /// Frames of `frame` samples every `hop` samples for filters of `taps` samples and delays of up to `max_delay`. `None` where `hop` does
    /// not divide `frame` at least twice: then Hann's windows would not sum to 1.
    pub fn new(frame: usize, hop: usize, taps: usize, max_delay: f64) -> Option<Self> {
        if hop == 0 || !frame.is_multiple_of(hop) || frame / hop < 2 {
            return None;
        }
        let scale = 2.0 * hop as f64 / frame as f64;
        let hann = |i: usize| (scale * (0.5 - 0.5 * (2.0 * PI * i as f64 / frame as f64).cos())) as f32;
        let baker = Baker::new(taps, max_delay);
        let n = good_length(frame + baker.size() - 1);
        let mut planner = RealFftPlanner::new();
        Some(Wola {
            frame,
            hop,
            window: (0..frame).map(hann).collect(),
            n,
            forward: planner.plan_fft_forward(n),
            inverse: planner.plan_fft_inverse(n),
            baker,
        })
    }

    /// A filter's spectra, its delays included.
    pub fn spectra(&mut self, filter: &Filter) -> EarSpectra {
        self.baker.bake(filter).map(|mut padded| {
            padded.resize(self.n, 0.0);
            let mut bins = self.forward.make_output_vec();
            // The lengths are the plan's own, which is all that can be wrong.
            let _ = self.forward.process(&mut padded, &mut bins);
            bins
        })
    }

    /// Adds the sound of `signal` at both ears to `out`, of its length. `filter` gives spectra (`None` for those of the frame before) and
    /// gain at a frame's centre, in samples.
    pub fn process(
        &mut self,
        signal: &[f32],
        out: &mut [[f32; 2]],
        mut filter: impl FnMut(&mut Self, f64) -> (Option<EarSpectra>, f32),
    ) {
        let mut now = [0, 1].map(|_| vec![Complex32::ZERO; self.n / 2 + 1]);
        let scale = 1.0 / self.n as f32;
        let (mut bins, mut product) = (self.forward.make_output_vec(), self.inverse.make_input_vec());
        let (mut frame, mut heard) = (self.forward.make_input_vec(), self.inverse.make_output_vec());
        let lead_in = (self.frame - self.hop) as i64;
        for start in (-lead_in..signal.len() as i64).step_by(self.hop) {
            let (changed, gain) = filter(self, start as f64 + self.frame as f64 / 2.0);
            if let Some(spectra) = changed {
                now = spectra;
            }
            let sample =
                |i: usize| usize::try_from(start + i as i64).ok().and_then(|at| signal.get(at)).copied().unwrap_or(0.0);
            frame.fill(0.0);
            for (i, (value, window)) in frame.iter_mut().zip(&self.window).enumerate() {
                *value = gain * window * sample(i);
            }
            let _ = self.forward.process(&mut frame, &mut bins);
            for (ear, response) in now.iter().enumerate() {
                product.iter_mut().zip(bins.iter().zip(response)).for_each(|(to, (a, b))| *to = a * b);
                product[0].im = 0.0;
                product[self.n / 2].im = 0.0;
                let _ = self.inverse.process(&mut product, &mut heard);
                // A filter's onset comes `LEAD` samples late.
                let first = start - LEAD as i64;
                let skip = usize::try_from(-first).unwrap_or(0);
                let to = out.iter_mut().skip(usize::try_from(first).unwrap_or(0));
                to.zip(heard.iter().skip(skip)).for_each(|(to, value)| to[ear] += scale * value);
            }
        }
    }
}

/// Puts a filter's delays into its responses.
pub struct Baker {
    spectra: Spectra,
}

impl Baker {
    /// For filters of `taps` samples with delays of up to `max_delay`.
    pub fn new(taps: usize, max_delay: f64) -> Self {
        // A fractional delay rings on both sides; 32 samples of room keep the ends from meeting.
        Baker { spectra: Spectra::new(good_length(taps + max_delay.ceil() as usize + 32)) }
    }

    pub fn size(&self) -> usize {
        self.spectra.size()
    }

    pub fn bake(&mut self, filter: &Filter) -> [Vec<f32>; 2] {
        [0, 1].map(|ear| {
            let delayed = self.spectra.delayed(&filter.responses[ear], filter.delays[ear]);
            delayed.into_iter().map(|value| value as f32).collect()
        })
    }
}
