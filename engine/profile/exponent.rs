//! The power by which a time grows with a size.

use serde::Serialize;
use std::fmt;

/// By which power of a size a time grows: 0 not at all, 1 in proportion; by least squares of the logarithms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Exponent {
    pub all: f64,
    /// Its standard error, from how far the points lie off the line; none of two points.
    pub error: Option<f64>,
    /// Between the last two points: where it is going.
    pub last: f64,
}

impl Exponent {
    /// Of (size, time) in order of size; none of fewer than two.
    pub fn of(points: impl Iterator<Item = [f64; 2]>) -> Option<Self> {
        let points: Vec<[f64; 2]> = points.map(|point| point.map(f64::ln)).collect();
        let [.., [x0, y0], [x1, y1]] = points[..] else { return None };
        let n = points.len() as f64;
        let mean = |k: usize| points.iter().map(|point| point[k]).sum::<f64>() / n;
        let (x, y) = (mean(0), mean(1));
        let squares: f64 = points.iter().map(|point| (point[0] - x).powi(2)).sum();
        let all = points.iter().map(|point| (point[0] - x) * (point[1] - y)).sum::<f64>() / squares;
        let off: f64 = points.iter().map(|point| (point[1] - y - all * (point[0] - x)).powi(2)).sum();
        let error = (points.len() > 2).then(|| (off / (n - 2.0) / squares).sqrt());
        Some(Exponent { all, error, last: (y1 - y0) / (x1 - x0) })
    }
}

impl fmt::Display for Exponent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2}", self.all)?;
        self.error.map_or(Ok(()), |error| write!(f, " ± {error:.2}"))?;
        write!(f, " (last two: {:.2})", self.last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_are_those_of_powers() {
        let of = |times: &[f64]| Exponent::of((0..).zip(times).map(|(k, ms)| [4f64.powi(k), *ms]));
        let linear = of(&[2.0, 8.0, 32.0]).unwrap();
        assert!((linear.all - 1.0).abs() < 1e-12 && (linear.last - 1.0).abs() < 1e-12 && linear.error.unwrap() < 1e-9);
        let flat = of(&[5.0, 5.0]).unwrap();
        assert_eq!((flat.all, flat.error, flat.last), (0.0, None, 0.0));
        // A step that is flat at first and then doubles: half a power of the last four times.
        let bent = of(&[1.0, 1.0, 2.0]).unwrap();
        assert!((bent.all - 0.25).abs() < 1e-12 && (bent.last - 0.5).abs() < 1e-12, "{bent}");
        assert!((bent.error.unwrap() - 0.25 / 3f64.sqrt()).abs() < 1e-12, "{bent}");
        assert!(of(&[1.0]).is_none() && of(&[]).is_none());
    }
}
