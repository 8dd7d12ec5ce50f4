//! Measures that need no listener: time and level between the ears, spectra, levels, and where a sound seems to come from.

use crate::common::prelude::*;
use ivv::internals::report::statistics::mean;
use ivv::internals::sound::FS;
use ivv::internals::sound::align::peak;
use ivv::internals::sound::geometry::degrees;
use ivv::internals::sound::render::SPEED_OF_SOUND;
use ivv::internals::sound::spectrum::{Spectra, good_length};
use ivv::internals::sound::wola::Baker;
use realfft::num_complex::Complex64;
use std::f64::consts::PI;

/// Up to this frequency the ear uses differences of time, hertz.
const ITD_BAND: f64 = 1500.0;
/// The largest difference of time that is looked for, seconds.
const ITD_MAX: f64 = 1e-3;
/// Band of the spectral distance, hertz.
const LSD_BAND: [f64; 2] = [200.0, 16_000.0];

/// By how much the left ear leads, seconds: the highest correlation below 1.5 kHz within 1 ms.
pub fn itd(left: &[f32], right: &[f32]) -> f64 {
    let n = good_length(2 * left.len().max(right.len()));
    let mut spectra = Spectra::new(n);
    let [left, right] = [left, right].map(|ear| spectra.forward(ear.iter().map(|value| f64::from(*value))));
    let band = |k: usize| {
        let frequency = k as f64 * f64::from(FS) / n as f64;
        if frequency > ITD_BAND { 0.0 } else { 0.5 + 0.5 * (PI * frequency / ITD_BAND).cos() }
    };
    let bins: Vec<Complex64> = left.iter().zip(&right).enumerate().map(|(k, (l, r))| r * l.conj() * band(k)).collect();
    let last = (ITD_BAND * n as f64 / f64::from(FS)).ceil() as usize;
    let bins = &bins[..=last.min(bins.len() - 1)];
    let max = (ITD_MAX * f64::from(FS)) as i64;
    let at = |lag: i64| -> f64 {
        let turn = 2.0 * PI * lag as f64 / n as f64;
        bins.iter().enumerate().map(|(k, bin)| (bin * Complex64::from_polar(1.0, turn * k as f64)).re).sum()
    };
    let coarse = (-max..=max).max_by(|a, b| at(*a).total_cmp(&at(*b))).unwrap_or(0);
    peak(bins, n, coarse as f64) / f64::from(FS)
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Between {
    /// Seconds, the middle of a window of 0.1 s.
    pub t: f64,
    pub itd: f64,
    pub ild_db: f64,
}

/// Time and level between the ears over time, every 0.1 s, without windows 40 dB below the loudest.
pub fn ear_course(frames: &[[f32; 2]]) -> Vec<Between> {
    let window = FS as usize / 10;
    let windows: Vec<&[[f32; 2]]> = frames.chunks_exact(window).collect();
    let loudest = windows.iter().map(|frames| level_db(frames)).fold(f64::NEG_INFINITY, f64::max);
    let between = |(index, frames): (usize, &&[[f32; 2]])| {
        let [left, right] = [0, 1].map(|ear| frames.iter().map(|frame| frame[ear]).collect::<Vec<f32>>());
        let t = (index as f64 + 0.5) * window as f64 / f64::from(FS);
        (level_db(frames) > loudest - 40.0).then(|| Between {
            t,
            itd: itd(&left, &right),
            ild_db: ild_db(&left, &right),
        })
    };
    windows.iter().enumerate().filter_map(between).collect()
}

pub fn energy(signal: &[f32]) -> f64 {
    signal.iter().map(|value| f64::from(*value).powi(2)).sum()
}

pub fn ild_db(left: &[f32], right: &[f32]) -> f64 {
    10.0 * (energy(left) / energy(right).max(f64::MIN_POSITIVE)).log10()
}

pub fn level_db(frames: &[[f32; 2]]) -> f64 {
    10.0 * (energy(frames.as_flattened()) / (2 * frames.len()).max(1) as f64).max(f64::MIN_POSITIVE).log10()
}

pub fn residual_db(a: &[[f32; 2]], b: &[[f32; 2]]) -> f64 {
    let differences: Vec<f32> = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a - b).collect();
    10.0 * (energy(&differences) / energy(b.as_flattened()).max(f64::MIN_POSITIVE)).max(1e-40).log10()
}

/// Log-spectral distance of two responses: root mean square of the ratio of their magnitudes in decibels, 200 Hz to 16 kHz.
pub fn lsd_db(a: &[f32], b: &[f32]) -> f64 {
    let n = good_length(a.len().max(b.len()).max(1024));
    let mut spectra = Spectra::new(n);
    let [a, b] = [a, b].map(|response| spectra.forward(response.iter().map(|value| f64::from(*value))));
    let [first, last] = LSD_BAND.map(|frequency| (frequency * n as f64 / f64::from(FS)).round() as usize);
    let terms = (first..=last).map(|k| (20.0 * (a[k].norm().max(1e-12) / b[k].norm().max(1e-12)).log10()).powi(2));
    (terms.sum::<f64>() / (last - first + 1) as f64).sqrt()
}

/// Energy more than 100 Hz off a tone, relative to all, decibels: what moving a source adds that is not movement.
pub fn splatter_db(signal: &[f32], tone: f64) -> f64 {
    let n = signal.len() & !1;
    // Blackman and Harris' window: its side lobes lie below -92 dB and fall.
    let window = |i: usize| {
        let x = 2.0 * PI * i as f64 / n as f64;
        0.35875 - 0.48829 * x.cos() + 0.14128 * (2.0 * x).cos() - 0.01168 * (3.0 * x).cos()
    };
    let bins = Spectra::new(n).forward(signal.iter().enumerate().map(|(i, value)| f64::from(*value) * window(i)));
    let is_off = |k: usize| (k as f64 * f64::from(FS) / n as f64 - tone).abs() > 100.0;
    let sum =
        |off: bool| bins.iter().enumerate().filter(|(k, _)| !off || is_off(*k)).map(|(_, b)| b.norm_sqr()).sum::<f64>();
    10.0 * (sum(true) / sum(false).max(f64::MIN_POSITIVE)).max(1e-40).log10()
}

/// Tells from two ears' signals the azimuth that a set of responses explains best, on the horizon.
pub struct Localiser {
    n: usize,
    spectra: Spectra,
    /// By candidate, the spectra of both ears.
    candidates: Vec<[Vec<Complex64>; 2]>,
}

impl Localiser {
    /// Azimuths are tried every so many degrees and the best is interpolated.
    const STEP: usize = 3;

    /// Judges frames of `n` samples, far longer than a response.
    pub fn new(hrtf: &HrtfSet, n: usize) -> Self {
        let mut spectra = Spectra::new(n);
        let mut baker = Baker::new(hrtf.taps(Lookup::Aligned), hrtf.max_delay());
        let candidate = |az: usize| {
            let baked = baker.bake(&hrtf.filter(degrees(az as f64, 0.0), Lookup::Aligned));
            baked.map(|response| spectra.forward(response.iter().map(|value| f64::from(*value))))
        };
        let candidates = (0..360).step_by(Self::STEP).map(candidate).collect();
        Localiser { n, spectra, candidates }
    }

    /// Azimuth in degrees in (-180, 180], left positive; `None` for silence.
    ///
    /// Where a direction is right, the left signal through the right response equals the right signal through the left
    /// response, whatever the source says.
    pub fn azimuth(&mut self, frames: &[[f32; 2]]) -> Option<f64> {
        let n = frames.len().min(self.n);
        let hann = |i: usize| 0.5 - 0.5 * (2.0 * PI * i as f64 / n as f64).cos();
        let ears = [0, 1].map(|ear| {
            self.spectra.forward(frames[..n].iter().enumerate().map(|(i, frame)| f64::from(frame[ear]) * hann(i)))
        });
        let [first, last] = LSD_BAND.map(|frequency| (frequency * self.n as f64 / f64::from(FS)).round() as usize);
        let heard: f64 = ears.iter().flat_map(|ear| &ear[first..=last]).map(Complex64::norm_sqr).sum();
        if heard < 1e-12 {
            return None;
        }
        let cost = |responses: &[Vec<Complex64>; 2]| -> f64 {
            let term = |k: usize| {
                let (left, right) = (responses[0][k], responses[1][k]);
                let wrong = (ears[0][k] * right - ears[1][k] * left).norm_sqr();
                wrong / (left.norm_sqr() + right.norm_sqr()).max(f64::MIN_POSITIVE)
            };
            (first..=last).map(term).sum()
        };
        let costs: Vec<f64> = self.candidates.iter().map(cost).collect();
        let best = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
        let [before, here, after] = [costs.len() - 1, 0, 1].map(|step| costs[(best + step) % costs.len()]);
        let bend = before - 2.0 * here + after;
        let part = if bend > 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
        Some(wrap_degrees((best as f64 + part) * Self::STEP as f64))
    }
}

pub fn wrap_degrees(angle: f64) -> f64 {
    180.0 - (180.0 - angle).rem_euclid(360.0)
}

/// Samples over which direction and level are judged.
const FRAME: usize = 4096;

#[derive(Clone, Copy, Debug)]
pub struct Difference {
    pub azimuth: f64,
    pub level: f64,
    pub frames: usize,
}

/// Compares what a template localiser hears in a rendering and in the truth, frame by frame.
///
/// `late` is by how many seconds the truth is later than the rendering at a time; the paper's modes leave that out.
pub fn compare(rendered: &[[f32; 2]], truth: &[[f32; 2]], hrtf: &HrtfSet, late: impl Fn(f64) -> f64) -> Difference {
    let mut localiser = Localiser::new(hrtf, FRAME);
    let (mut azimuths, mut levels) = (Vec::new(), Vec::new());
    // Nothing was said before the recording began, so its first moments are no matter.
    for start in (FRAME / 2..rendered.len().saturating_sub(FRAME)).step_by(FRAME / 2) {
        let middle = (start + FRAME / 2) as f64 / f64::from(FS);
        let there = start as f64 + late(middle) * f64::from(FS);
        if there < 0.0 || there as usize + FRAME > truth.len() {
            continue;
        }
        let (heard, meant) = (
            &rendered[start..start + FRAME],
            &truth[there.round() as usize..][..FRAME.min(truth.len() - there.round() as usize)],
        );
        if let (Some(a), Some(b)) = (localiser.azimuth(heard), localiser.azimuth(meant)) {
            azimuths.push(wrap_degrees(a - b).abs());
            levels.push((level_db(heard) - level_db(meant)).abs());
        }
    }
    assert!(!azimuths.is_empty(), "no frame of both holds sound");
    let mean = |values: &[f64]| mean(values.iter().copied()).unwrap_or(0.0);
    Difference { azimuth: mean(&azimuths), level: mean(&levels), frames: azimuths.len() }
}

/// By how much later a scene's first source is heard by a head than in the recording, seconds.
pub fn lateness(scene: &SoundScene, head: &PoseTrack, t: f64) -> f64 {
    let source = scene.sources.first().and_then(|source| source.track.at(t)).unwrap_or_default();
    let way = source.distance(head.at(t).p) - source.distance(scene.mic.pose.at(t).p);
    way * scene.metres_per_unit.unwrap_or(0.0) / SPEED_OF_SOUND
}
