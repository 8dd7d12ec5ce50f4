//! A signal between its samples: sums of Kaiser-windowed sincs, for delays that vary and for other sample rates.

use std::f64::consts::PI;

/// Taps of a delay: flat within -80 dB up to 0.8 of the Nyquist frequency.
pub const DELAY_TAPS: usize = 32;
const DELAY_PHASES: usize = 256;
const BETA: f64 = 9.0;
/// Zero crossings to each side when the sample rate changes, and the cut-off as a part of the lower Nyquist frequency.
const RESAMPLE_CROSSINGS: f64 = 32.0;
const RESAMPLE_CUT: f64 = 0.95;

/// Modified Bessel function of the first kind, order 0, by its series.
fn bessel_i0(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut term, mut sum) = (1.0, 1.0);
    let mut k = 1.0;
    while term > 1e-17 * sum {
        term *= quarter / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

/// Kaiser's window at `x` in [-1, 1], zero beyond.
fn kaiser(x: f64) -> f64 {
    let inside = 1.0 - x * x;
    if inside < 0.0 { 0.0 } else { bessel_i0(BETA * inside.sqrt()) / bessel_i0(BETA) }
}

/// Weights of a delay's taps by fractional part, interpolated linearly.
pub struct DelayTable {
    rows: Vec<[f32; DELAY_TAPS]>,
}

impl DelayTable {
    /// The table; each row sums to 1, so that a constant passes unchanged.
    pub fn new() -> Self {
        let half = DELAY_TAPS as f64 / 2.0;
        let row = |phase: usize| {
            let part = phase as f64 / DELAY_PHASES as f64;
            let tap = |k: usize| {
                let x = k as f64 - (half - 1.0) - part;
                sinc(x) * kaiser(x / half)
            };
            let taps: [f64; DELAY_TAPS] = std::array::from_fn(tap);
            let sum: f64 = taps.iter().sum();
            taps.map(|tap| (tap / sum) as f32)
        };
        DelayTable { rows: (0..=DELAY_PHASES).map(row).collect() }
    }

    /// `signal` at the time `at` in samples; zero outside.
    pub fn at(&self, signal: &[f32], at: f64) -> f32 {
        let whole = at.floor();
        let phase = (at - whole) * DELAY_PHASES as f64;
        let row = (phase as usize).min(DELAY_PHASES - 1);
        let part = (phase - row as f64) as f32;
        let first = whole as i64 - (DELAY_TAPS as i64 / 2 - 1);
        let (low, high) = (&self.rows[row], &self.rows[row + 1]);
        if first >= 0 && first as usize + DELAY_TAPS <= signal.len() {
            let from = &signal[first as usize..first as usize + DELAY_TAPS];
            let sums =
                from.iter().zip(low.iter().zip(high)).fold((0.0, 0.0), |(a, b), (x, (l, h))| (a + x * l, b + x * h));
            return sums.0 + part * (sums.1 - sums.0);
        }
        let value =
            |k: usize| usize::try_from(first + k as i64).ok().and_then(|i| signal.get(i)).copied().unwrap_or(0.0);
        (0..DELAY_TAPS).map(|k| value(k) * (low[k] + part * (high[k] - low[k]))).sum()
    }
}

impl Default for DelayTable {
    fn default() -> Self {
        Self::new()
    }
}

/// A change of sample rate, prepared once for any number of signals.
pub struct Resampler {
    from: u32,
    to: u32,
    shift: f64,
    /// By output sample of a period: the first input sample and the weights.
    phases: Vec<(i64, Vec<f32>)>,
    /// Input samples of a period.
    step: i64,
}

impl Resampler {
    /// Sample `i` of the result will be the signal at `i / to - shift` seconds. A change of rate loses what lies above 0.95 of the lower
    /// Nyquist frequency.
    pub fn new(from: u32, to: u32, shift: f64) -> Self {
        let (from, to) = (from.max(1), to.max(1));
        let divisor = greatest_common_divisor(from, to);
        let rates = (f64::from(from), f64::from(to));
        let cut = if from == to { 1.0 } else { RESAMPLE_CUT * (rates.1 / rates.0).min(1.0) };
        let reach = RESAMPLE_CROSSINGS / cut;
        let phase = |i: u32| {
            let at = (f64::from(i) / rates.1 - shift) * rates.0;
            let first = (at - reach).ceil();
            let weight = |k: i64| {
                let x = first + k as f64 - at;
                (cut * sinc(cut * x) * kaiser(x / reach)) as f32
            };
            (first as i64, (0..=(2.0 * reach) as i64).map(weight).collect())
        };
        let is_identity = from == to && shift == 0.0;
        let phases = if is_identity { Vec::new() } else { (0..to / divisor).map(phase).collect() };
        Resampler { from, to, shift, phases, step: i64::from(from / divisor) }
    }

    /// The signal at the new rate, from the time 0 to its end.
    pub fn apply(&self, signal: &[f32]) -> Vec<f32> {
        if self.phases.is_empty() {
            return signal.to_vec();
        }
        let seconds = signal.len() as f64 / f64::from(self.from) + self.shift;
        let n = (seconds * f64::from(self.to)).round().max(0.0) as usize;
        let value = |i: usize| {
            let (first, weights) = &self.phases[i % self.phases.len()];
            let first = first + (i / self.phases.len()) as i64 * self.step;
            let skip = usize::try_from(-first).unwrap_or(0);
            let from = signal.iter().skip(usize::try_from(first).unwrap_or(0));
            from.zip(weights.iter().skip(skip)).map(|(x, w)| x * w).sum()
        };
        (0..n).map(value).collect()
    }
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}
