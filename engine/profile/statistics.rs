//! Robust statistics of repeated measurements.

/// The `q`-quantile, 0 to 1, interpolated between neighbours; NaN of no value.
pub fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = q.clamp(0.0, 1.0) * last as f64;
    let low = at.floor() as usize;
    let high = (low + 1).min(last);
    sorted[low] + (at - low as f64) * (sorted[high] - sorted[low])
}

/// The median.
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// The median absolute deviation from the median, not scaled to a standard deviation.
pub fn mad(values: &[f64]) -> f64 {
    let middle = median(values);
    median(&values.iter().map(|value| (value - middle).abs()).collect::<Vec<_>>())
}

/// The median of paired ratios with its interval.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Ratio {
    /// The median.
    pub median: f64,
    /// The lower end of the interval.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

impl std::fmt::Display for Ratio {
    /// One pair alone has no interval.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Ratio { median, low, high } = self;
        if low == high { write!(f, "{median:.3}") } else { write!(f, "{median:.3} ({low:.3} to {high:.3})") }
    }
}

/// `over[i] / under[i]`: their median, and between which of them it lies with 95 % confidence whatever their
/// distribution: the k-th smallest and the k-th largest, with the largest k for which a fair coin thrown n times shows
/// fewer than k heads with a probability of at most 2.5 %. Fewer than six pairs have the whole range.
pub fn paired_ratio(over: &[f64], under: &[f64]) -> Ratio {
    let mut ratios: Vec<f64> = over.iter().zip(under).map(|(over, under)| over / under).collect();
    ratios.sort_by(f64::total_cmp);
    let n = ratios.len();
    let (mut tail, mut probability, mut k) = (0.0, 0.5f64.powi(n as i32), 0);
    while k < n / 2 {
        tail += probability;
        if tail > 0.025 {
            break;
        }
        probability *= (n - k) as f64 / (k + 1) as f64;
        k += 1;
    }
    let k = k.max(1);
    let at = |index: Option<usize>| index.and_then(|index| ratios.get(index)).copied().unwrap_or(f64::NAN);
    Ratio { median: median(&ratios), low: at(k.checked_sub(1)), high: at(n.checked_sub(k)) }
}
