//! The line through points that aligns a depth prior: the one through two points that leaves the least median residual
//! (Rousseeuw 1984), then least squares over the points near it. Almost half of the points may be wrong.

use crate::random::Keyed;
use crate::report::statistics::{mean, median_high};

const FEWEST: usize = 10;
const LINES: u64 = 500;
/// Largest residual of a near point, in standard deviations.
const NEAR: f64 = 2.5;
/// Standard deviations in a median magnitude of normal numbers.
const PER_MEDIAN: f64 = 1.4826;
/// Least squares over the near points, each time anew.
const ITERATIONS: usize = 5;
/// Largest standard error of the scale, in units of the scale.
const UNSURE: f64 = 0.25;
/// Largest median residual, in units of the median depth.
const LOOSE: f64 = 0.1;
const KEY: u64 = 0x0064_6570_7468;

/// The depth of an image is `scale * prior + shift`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DepthFit {
    /// Positive.
    pub scale: f64,
    /// In units of the capture's world.
    pub shift: f64,
    pub n_points: usize,
    /// Median magnitude of the residuals, in units of the median depth.
    pub residual: f64,
}

pub(super) type Outcome = Result<DepthFit, Unfit>;

/// Why an image's prior is not used; see [`Unfit::reason`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unfit {
    NoPrior,
    FewPoints,
    Flat,
    Inverted,
    /// Half of the points lie farther from the line than a tenth of their depth.
    Loose,
}

impl Unfit {
    pub fn reason(self) -> &'static str {
        match self {
            Unfit::NoPrior => "no file",
            Unfit::FewPoints => "fewer than 10 points seen",
            Unfit::Flat => "the points do not tell the scale",
            Unfit::Inverted => "the scale is not positive",
            Unfit::Loose => "the points do not follow the prior",
        }
    }
}

pub(super) fn fit_line(pairs: &[(f64, f64)]) -> Outcome {
    let n = pairs.len();
    if n < FEWEST {
        return Err(Unfit::FewPoints);
    }
    // There is at least one value.
    let middle = |values: &mut dyn Iterator<Item = f64>| median_high(values).unwrap_or(f64::NAN);
    let random = Keyed::new(&[KEY, n as u64]);
    let off_line = |[scale, shift]: [f64; 2], (x, y): &(f64, f64)| (y - (scale * x + shift)).abs();
    let mut best = (f64::INFINITY, [0.0; 2]);
    for line in 0..LINES {
        let [(x0, y0), (x1, y1)] = [2 * line, 2 * line + 1].map(|i| pairs[(random.bits(i) % n as u64) as usize]);
        let scale = (y1 - y0) / (x1 - x0);
        let line = [scale, y0 - scale * x0];
        let off = middle(&mut pairs.iter().map(|pair| off_line(line, pair)));
        // A line through points of one prior is not finite and is not taken.
        if off < best.0 {
            best = (off, line);
        }
    }
    let (mut off, mut line) = best;
    if !off.is_finite() {
        return Err(Unfit::Flat);
    }
    let typical = middle(&mut pairs.iter().map(|(_, depth)| depth.abs()));
    let (mut n_near, mut spread, mut sigma) = (0, 0.0, 0.0);
    for _ in 0..ITERATIONS {
        // The floor keeps points that lie on the line but for rounding.
        let reach = NEAR * PER_MEDIAN * off + 1e-9 * typical;
        let near: Vec<(f64, f64)> = pairs.iter().copied().filter(|pair| off_line(line, pair) <= reach).collect();
        n_near = near.len();
        let mean = |of: fn(&(f64, f64)) -> f64| mean(near.iter().map(of)).unwrap_or(f64::NAN);
        let (mean_x, mean_y) = (mean(|pair| pair.0), mean(|pair| pair.1));
        let sum = |of: &dyn Fn(f64, f64) -> f64| near.iter().map(|(x, y)| of(x - mean_x, y - mean_y)).sum::<f64>();
        spread = sum(&|x, _| x * x);
        let scale = sum(&|x, y| x * y) / spread;
        line = [scale, mean_y - scale * mean_x];
        sigma = (sum(&|x, y| (y - scale * x).powi(2)) / n_near as f64).sqrt();
        off = middle(&mut near.iter().map(|pair| off_line(line, pair)));
    }
    let [scale, shift] = line;
    let fit = DepthFit { scale, shift, n_points: n_near, residual: off / typical };
    // Each test is written so that NaN fails it.
    let is_sure = sigma / spread.sqrt() <= UNSURE * scale.abs() && scale.is_finite() && shift.is_finite();
    match () {
        () if n_near < FEWEST => Err(Unfit::FewPoints),
        () if !is_sure => Err(Unfit::Flat),
        () if scale <= 0.0 => Err(Unfit::Inverted),
        () if fit.residual <= LOOSE => Ok(fit),
        () => Err(Unfit::Loose),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on the line 0.5 x - 0.2 but for noise, every `every`-th anywhere.
    fn pairs(n: u64, noise: f64, every: u64) -> Vec<(f64, f64)> {
        let random = Keyed::new(&[3]);
        let pair = |i: u64| {
            let x = 1.0 + random.uniform(3 * i);
            let y = 0.5 * x - 0.2 + noise * random.normal(1000 + i);
            (x, if i % every == every - 1 { 2.0 * random.uniform(3 * i + 1) } else { y })
        };
        (0..n).map(pair).collect()
    }

    #[test]
    fn a_line_is_found_among_outliers() {
        for (n, every, tolerance) in [(200, 1000, 0.01), (200, 3, 0.02), (40, 4, 0.03)] {
            let fit = fit_line(&pairs(n, 0.005, every)).unwrap();
            assert!((fit.scale - 0.5).abs() < tolerance && (fit.shift + 0.2).abs() < 1.5 * tolerance, "{n}: {fit:?}");
        }
        let exact = fit_line(&pairs(10, 0.0, 1000)).unwrap();
        assert!((exact.scale - 0.5).abs() < 1e-9 && (exact.shift + 0.2).abs() < 1e-9 && exact.n_points == 10);
    }

    #[test]
    fn what_tells_no_scale_is_refused_with_its_reason() {
        assert_eq!(fit_line(&pairs(9, 0.0, 1000)).unwrap_err(), Unfit::FewPoints);
        assert_eq!(fit_line(&[(1.0, 2.0); 30]).unwrap_err(), Unfit::Flat);
        let alike: Vec<_> = pairs(100, 0.05, 1000).iter().map(|(x, y)| (1.0 + 1e-3 * x, *y)).collect();
        assert!(fit_line(&alike).is_ok(), "a small range of the prior is no fault");
        let flat: Vec<_> = pairs(100, 0.0, 1).into_iter().map(|(x, y)| (x, 1.0 + 1e-3 * y)).collect();
        assert_eq!(fit_line(&flat).unwrap_err(), Unfit::Flat);
        let inverted: Vec<_> = pairs(100, 0.005, 1000).into_iter().map(|(x, y)| (-x, y)).collect();
        assert_eq!(fit_line(&inverted).unwrap_err(), Unfit::Inverted);
        let loose: Vec<_> = pairs(100, 0.15, 1000);
        assert!([Unfit::Loose, Unfit::Flat].contains(&fit_line(&loose).unwrap_err()));
    }
}
