//! By how much recordings of one place began apart, from what they hear.

use realfft::num_complex::Complex64;

use super::spectrum::{Spectra, good_length};

/// Hertz: below is hum and wind, above is little that all microphones of a room hear alike.
const BAND: [f64; 2] = [100.0, 3500.0];
/// How far loud frequencies are made as loud as faint ones: at 1 all count the same, noise too (GCC-PHAT; Knapp and Carter 1976).
const WHITENING: f64 = 0.85;
/// Frequencies fainter than this part of the loudest do not count: beside a steady tone they hold only the recording's ends.
const FAINT: f64 = 1e-4;
/// Seconds over which the ends of a recording fade, for the same reason.
const FADE: f64 = 0.25;
/// Seconds around the best match within which echoes are no other match.
const ECHO: f64 = 0.1;
/// A match that stands out by less may be chance: 1.2 for recordings that share nothing, 1.6 for a steady tone.
pub const CONFIDENT: f64 = 2.0;
/// A recording whose loudest sample is below this has no sound.
const SILENT: f32 = 1e-4;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// How much later it hears what the reference hears, seconds: as much earlier it began. Sound takes 3 ms for a metre, which counts.
    pub seconds: f64,
    /// The height of the correlation there over its height anywhere else; infinite for the reference.
    pub stands_out: f64,
}

/// The lags of recordings of `rate` samples per second against the longest; none for a silent one. A recording that does not match it
/// clearly is compared with those that do, and keeps its best match.
pub fn lags(recordings: &[Vec<f32>], rate: f64) -> Vec<Option<Lag>> {
    let is_silent = |samples: &[f32]| samples.iter().all(|sample| sample.abs() < SILENT);
    let longest = recordings.iter().map(Vec::len).max().unwrap_or(0);
    let n = good_length((2 * longest).max(2));
    let (mut spectra, mut inverse) = (Spectra::new(n), Spectra::new(n));
    // Not kept: those of minutes of many cameras are gigabytes.
    let mut bins = |at: usize| spectra.forward(faded(&recordings[at], (FADE * rate) as usize));
    let mut found: Vec<Option<Lag>> = vec![None; recordings.len()];
    let loud: Vec<usize> = (0..recordings.len()).filter(|at| !is_silent(&recordings[*at])).collect();
    let Some(reference) = loud.iter().copied().max_by_key(|at| (recordings[*at].len(), usize::MAX - at)) else {
        return found;
    };
    found[reference] = Some(Lag { seconds: 0.0, stands_out: f64::INFINITY });
    // Those that are sure, each compared once with all that are not.
    let mut sure = vec![reference];
    let mut next = 0;
    while let Some(against) = sure.get(next).copied() {
        next += 1;
        let (a, base) = (bins(against), found[against].map_or(0.0, |lag| lag.seconds));
        for &own in &loud {
            if found[own].is_some_and(|lag| lag.stands_out >= CONFIDENT) {
                continue;
            }
            let b = bins(own);
            let lag = compared(&mut inverse, &a, &b, rate);
            if found[own].is_none_or(|before| lag.stands_out > before.stands_out) {
                found[own] = Some(Lag { seconds: base + lag.seconds, ..lag });
            }
            if lag.stands_out >= CONFIDENT {
                sure.push(own);
            }
        }
    }
    found
}

fn faded(recording: &[f32], over: usize) -> impl Iterator<Item = f64> {
    let n = recording.len();
    recording.iter().enumerate().map(move |(at, sample)| {
        let part = (at.min(n - 1 - at) as f64 + 0.5) / over.max(1) as f64;
        f64::from(*sample) * (0.5 - 0.5 * (std::f64::consts::PI * part.min(1.0)).cos())
    })
}

/// How much later `b` hears what `a` hears.
fn compared(spectra: &mut Spectra, a: &[Complex64], b: &[Complex64], rate: f64) -> Lag {
    let n = spectra.size();
    let cross = |(k, (a, b)): (usize, (&Complex64, &Complex64))| {
        let frequency = k as f64 * rate / n as f64;
        if (BAND[0]..BAND[1]).contains(&frequency) { b * a.conj() } else { Complex64::ZERO }
    };
    let mut cross: Vec<Complex64> = a.iter().zip(b).enumerate().map(cross).collect();
    let loudest = cross.iter().map(|bin| bin.norm()).fold(f64::MIN_POSITIVE, f64::max);
    for bin in &mut cross {
        let height = bin.norm();
        *bin = if height > FAINT * loudest { *bin * height.powf(-WHITENING) } else { Complex64::ZERO };
    }
    let correlation = spectra.inverse(&cross);
    let higher = |best: (usize, f64), (at, height): (usize, f64)| if height > best.1 { (at, height) } else { best };
    let (best, height) = correlation.iter().copied().enumerate().fold((0, f64::MIN_POSITIVE), higher);
    let near = (ECHO * rate) as usize;
    let is_other = |at: usize| {
        let apart = at.abs_diff(best);
        apart.min(n - apart) > near
    };
    let other = correlation.iter().enumerate().filter(|(at, _)| is_other(*at)).map(|(_, height)| *height);
    let other = other.fold(f64::MIN_POSITIVE, f64::max);
    // The second half is of lags below 0.
    let lag = if best > n / 2 { best as f64 - n as f64 } else { best as f64 };
    Lag { seconds: lag / rate, stands_out: height / other }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u32, n: usize) -> Vec<f32> {
        let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
        let mut next = || {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            state as f32 / u32::MAX as f32 * 2.0 - 1.0
        };
        (0..n).map(|_| next()).collect()
    }

    #[test]
    fn lags_are_found_through_gains_and_noise_and_chance_does_not_stand_out() {
        let rate = 8000.0;
        let scene = noise(1, 80_000);
        let heard = |from: usize, n: usize, gain: f32, hiss: f32, seed: u32| -> Vec<f32> {
            scene[from..from + n].iter().zip(noise(seed, n)).map(|(x, noise)| gain * x + hiss * noise).collect()
        };
        let recordings = [
            heard(0, 60_000, 1.0, 0.1, 2),
            heard(2000, 50_000, 0.05, 0.05, 3),
            heard(12_345, 40_000, 0.5, 0.5, 4),
            noise(5, 50_000),
            vec![0.0; 50_000],
        ];
        let found = lags(&recordings, rate);
        let [first, second, third, other, silent] = found[..] else { panic!() };
        assert_eq!(first, Some(Lag { seconds: 0.0, stands_out: f64::INFINITY }));
        assert_eq!(second.map(|lag| lag.seconds), Some(-0.25));
        assert_eq!(third.map(|lag| lag.seconds), Some(-12_345.0 / rate));
        assert!([second, third].iter().flatten().all(|lag| lag.stands_out > 2.0 * CONFIDENT), "{found:?}");
        assert!(other.is_some_and(|lag| lag.stands_out < 1.2), "{other:?}");
        assert_eq!(silent, None);
    }

    #[test]
    fn a_tone_repeats_itself_and_tells_nothing() {
        let tone = |from: usize| (from..from + 40_000).map(|k| (k as f32 * 0.35).sin()).collect::<Vec<f32>>();
        let found = lags(&[tone(0), tone(1000)], 8000.0);
        assert!(found[1].is_some_and(|lag| lag.stands_out < CONFIDENT), "{found:?}");
    }
}
