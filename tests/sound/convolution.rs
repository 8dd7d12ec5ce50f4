//! Filtering against direct sums: T18, T19, T20, T21, T24.

use super::measure::{energy, residual_db};
use super::{db, ear, head, horizon, noise, scene, sphere, track};
use crate::common::prelude::*;
use ivv::internals::sound::fir::{State, Voice};
use ivv::internals::sound::geometry::Mode;
use ivv::internals::sound::hrtf::{Filter, degrees};
use ivv::internals::sound::sinc::DelayTable;
use ivv::internals::sound::wola::{Baker, Wola};
use realfft::RealFftPlanner;
use std::rc::Rc;

/// Decibels of what differs between two signals, relative to the second.
fn off(a: &[f32], b: &[f32]) -> f64 {
    let differences: Vec<f32> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    db(energy(&differences) / energy(b))
}

/// The plain sum of products, in f64; the onset is `lead` samples late.
fn direct(signal: &[f32], response: &[f32], lead: usize) -> Vec<f32> {
    let value = |n: usize| -> f64 {
        let first = (n + lead + 1).saturating_sub(signal.len());
        (first..response.len().min(n + lead + 1))
            .map(|k| f64::from(response[k]) * f64::from(signal[n + lead - k]))
            .sum()
    };
    (0..signal.len()).map(|n| value(n) as f32).collect()
}

#[test]
fn t18_the_paper_mode_is_the_direct_sum_and_wrapping_is_not() {
    let set = sphere();
    let signal = noise(3000, 20);
    let filter = set.filter(degrees(65.0, 12.0), Lookup::Aligned);
    let baked = Baker::new(set.taps(Lookup::Aligned), set.max_delay()).bake(&filter);
    let mut wola = Wola::new(1024, 512, set.taps(Lookup::Aligned), set.max_delay()).unwrap();
    let spectra = wola.spectra(&filter);
    let mut out = vec![[0.0; 2]; signal.len()];
    wola.process(&signal, &mut out, |_, _| (Some(spectra.clone()), 1.0));
    for (side, baked) in baked.iter().enumerate() {
        let expected = direct(&signal, baked, 64);
        assert!(off(&ear(&out, side), &expected) < -110.0, "{}", off(&ear(&out, side), &expected));
        // Transforms of a frame's length wrap. The same windows, filter and sums, so it is the padding that counts.
        let wrapped = circular(&signal, &wola.window, baked, 64);
        let wrapping = off(&wrapped[1024..2000], &expected[1024..2000]);
        assert!(wrapping > -70.0, "without padding: {wrapping} dB");
    }
}

/// Overlap-add with transforms as long as a frame.
fn circular(signal: &[f32], window: &[f32], response: &[f32], lead: usize) -> Vec<f32> {
    let n = window.len();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, inverse) = (planner.plan_fft_forward(n), planner.plan_fft_inverse(n));
    let transform = |from: Vec<f64>| {
        let (mut from, mut bins) = (from, forward.make_output_vec());
        forward.process(&mut from, &mut bins).unwrap();
        bins
    };
    let mut padded: Vec<f64> = response.iter().map(|value| f64::from(*value)).collect();
    padded.resize(n, 0.0);
    let filter = transform(padded);
    let mut out = vec![0.0; signal.len() + n];
    for start in (0..signal.len() - n).step_by(n / 2) {
        let frame = (0..n).map(|i| f64::from(window[i] * signal[start + i])).collect();
        let mut bins: Vec<_> = transform(frame).iter().zip(&filter).map(|(a, b)| a * b).collect();
        (bins[0].im, bins[n / 2].im) = (0.0, 0.0);
        let mut heard = inverse.make_output_vec();
        inverse.process(&mut bins, &mut heard).unwrap();
        heard.iter().enumerate().for_each(|(i, value)| out[start + i] += (value / n as f64) as f32);
    }
    out[lead..lead + signal.len()].to_vec()
}

#[test]
fn t19_windows_sum_to_one() {
    for (frame, hop) in [(256, 128), (1024, 512), (1024, 256), (2048, 512), (960, 320)] {
        let wola = Wola::new(frame, hop, 100, 10.0).unwrap();
        for i in 0..hop {
            let sum: f32 = wola.window.iter().skip(i).step_by(hop).sum();
            assert!((sum - 1.0).abs() < 1e-6, "{frame} {hop}: {sum}");
        }
    }
    for (frame, hop) in [(1024, 0), (1024, 1024), (1024, 300), (512, 1024)] {
        assert!(Wola::new(frame, hop, 100, 10.0).is_none());
        let config = RenderConfig { frame, hop, ..RenderConfig::default() };
        let source = track("a", &[(0.0, DVec3::Y)]);
        assert!(render_signals(&scene(source), &[vec![0.0; 100]], &head(DVec3::ZERO, 0.0), sphere(), &config).is_err());
    }
}

fn below_16_khz(n: usize) -> Vec<f32> {
    let tones =
        |i: usize| (0..12).map(|k| (i as f64 * (0.05 + 0.17 * f64::from(k)) + f64::from(k * k)).sin()).sum::<f64>();
    (0..n).map(|i| (0.05 * tones(i)) as f32).collect()
}

#[test]
fn t20_the_physical_mode_is_the_direct_sum_with_a_fractional_delay() {
    let set = sphere();
    let signal = below_16_khz(2400);
    // 3.7 m farther from the head than from the microphone.
    let source = DVec3::new(-1.0, 2.0, 0.4);
    let way = scene(track("a", &[(0.0, source)]));
    let at = source + (DVec3::new(2.0, -5.0, 0.3).normalize() * (source.length() + 3.7));
    let config = RenderConfig { mode: Mode::Physical, ..RenderConfig::default() };
    let rendered = render_signals(&way, std::slice::from_ref(&signal), &head(at, 30.0), set, &config).unwrap();
    let cue = rendered.cues[0][0];
    assert!((cue.delay - 3.7 / 343.2).abs() < 1e-9, "{}", cue.delay);
    let mut filter = set.filter(degrees(cue.az.to_degrees(), cue.el.to_degrees()), Lookup::Aligned);
    // The way's delay and the gain, put into the responses; the delay is exact there.
    filter.delays = filter.delays.map(|delay| delay + cue.delay * 48_000.0);
    filter.responses.iter_mut().flatten().for_each(|value| *value *= cue.gain as f32);
    let baked = Baker::new(set.taps(Lookup::Aligned), set.max_delay() + 600.0).bake(&filter);
    for (side, baked) in baked.iter().enumerate() {
        let expected = direct(&signal, baked, 64);
        // The signal begins at once, so its first samples have no limited band.
        let error = off(&ear(&rendered.samples, side)[1200..], &expected[1200..]);
        assert!(error < -80.0, "{error} dB");
    }
}

#[test]
fn t21_the_size_of_blocks_does_not_matter() {
    let signal = below_16_khz(9600);
    let heard = |block: usize, turn: f64| {
        let source = |az: f64| DVec3::new(-(az.to_radians().sin()), az.to_radians().cos(), 0.0) * 2.0;
        let way: Vec<(f64, DVec3)> =
            (0..=20).map(|k| (0.01 * f64::from(k), source(40.0 + turn * 0.01 * f64::from(k)))).collect();
        let config = RenderConfig { mode: Mode::Physical, block, ..RenderConfig::default() };
        let scene = scene(track("a", &way));
        render_signals(&scene, std::slice::from_ref(&signal), &head(DVec3::ZERO, 0.0), horizon(), &config)
            .unwrap()
            .samples
    };
    for (turn, bound) in [(0.0, -110.0), (30.0, -60.0)] {
        let reference = heard(64, turn);
        for block in [128, 256] {
            let error = residual_db(&heard(block, turn), &reference);
            assert!(error <= bound, "{block} samples, {turn} degrees a second: {error} dB");
        }
    }
}

#[test]
fn t24_a_crossfade_between_equal_filters_is_none() {
    let table = DelayTable::new();
    let signal = noise(2000, 24);
    let filter = sphere().filter(degrees(-40.0, 0.0), Lookup::Aligned);
    let delays = filter.delays.map(|delay| delay + 3.3);
    let state = |filter: &Rc<Filter>| State { filter: filter.clone(), gain: 0.7 };
    let heard = |filters: [Rc<Filter>; 2]| {
        let mut voice = Voice::new(&table, &signal, 0, state(&filters[0]), delays);
        let mut out = vec![[0.0; 2]; 512];
        for start in [0, 256] {
            let out = &mut out[start..start + 256];
            voice.block(start, state(&filters[start / 256]), 256, |_| delays, out, |_| 1.0);
        }
        out
    };
    let same = Rc::new(filter.clone());
    // Equal, but not the same, so that it is crossfaded.
    let (once, faded) = (heard([same.clone(), same]), heard([Rc::new(filter.clone()), Rc::new(filter)]));
    let worst = once.iter().flatten().zip(faded.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-6 && energy(once.as_flattened()) > 1.0, "{worst}");
}
