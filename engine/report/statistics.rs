/// The mean; none of no value.
pub fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (n, sum) = values.into_iter().fold((0.0, 0.0), |(n, sum), value| (n + 1.0, sum + value));
    (n > 0.0).then(|| sum / n)
}

/// The least and the most; infinity and minus infinity of no value. NaN is passed over.
pub fn range(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    values.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// The `q`-quantile, 0 to 1, interpolated between neighbours; NaN of no value.
pub fn quantile(values: &[f64], q: f64) -> f64 {
    let sorted = sorted(values);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = q.clamp(0.0, 1.0) * last as f64;
    let low = at.floor() as usize;
    let high = (low + 1).min(last);
    sorted[low] + (at - low as f64) * (sorted[high] - sorted[low])
}

/// The median: the middle value, or the mean of the two; NaN of no value.
pub fn median(values: &[f64]) -> f64 {
    let sorted = sorted(values);
    let at = |index: usize| sorted.get(index).copied().unwrap_or(f64::NAN);
    0.5 * (at(sorted.len().saturating_sub(1) / 2) + at(sorted.len() / 2))
}

/// The middle value, or the higher of the two: always one of the values. None of no value; NaN counts as largest.
pub fn median_high(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
}

/// The median absolute deviation from the median, not scaled to a standard deviation.
pub fn mad(values: &[f64]) -> f64 {
    let middle = median(values);
    median(&values.iter().map(|value| (value - middle).abs()).collect::<Vec<_>>())
}

pub fn standard_error(values: &[f64]) -> Option<f64> {
    let (n, mean) = (values.len() as f64, mean(values.iter().copied())?);
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (values.len() > 1).then(|| (variance / n).sqrt())
}

/// Student's t at 0.975 for so many degrees of freedom; above nine within 1 %.
fn student(freedom: usize) -> f64 {
    const TABLE: [f64; 9] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262];
    let known = freedom.checked_sub(1).and_then(|at| TABLE.get(at)).copied();
    known.unwrap_or(1.96 + 2.5 / freedom as f64)
}

/// A mean with the half-width of its interval of 95 % confidence.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Estimate {
    pub mean: f64,
    /// None of fewer than two values.
    pub half_width: Option<f64>,
}

impl Estimate {
    pub fn new(values: &[f64]) -> Option<Self> {
        let half_width = standard_error(values).map(|error| student(values.len() - 1) * error);
        Some(Estimate { mean: mean(values.iter().copied())?, half_width })
    }

    pub fn signed(&self, decimals: usize) -> String {
        let half = self.half_width.map_or(String::new(), |half| format!(" +- {half:.decimals$}"));
        format!("{:+.decimals$}{half}", self.mean)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Ratio {
    pub median: f64,
    pub low: f64,
    pub high: f64,
}

impl std::fmt::Display for Ratio {
    /// One pair alone has no interval.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Ratio { median, low, high } = self;
        if low == high { write!(f, "{median:.3}") } else { write!(f, "{median:.3} ({low:.3} to {high:.3})") }
    }
}

/// The median of `over[i] / under[i]`, and the order statistics that hold it with 95 % confidence (sign test). Fewer than six
/// pairs have the whole range.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_known_numbers() {
        let values = [9.0, 1.0, 4.0, 2.0, 100.0];
        assert_eq!((mean(values), range(values)), (Some(23.2), [1.0, 100.0]));
        assert_eq!((median(&values), mad(&values), median_high(values)), (4.0, 3.0, Some(4.0)));
        assert_eq!((quantile(&values, 0.0), quantile(&values, 1.0), quantile(&values, 0.25)), (1.0, 100.0, 2.0));
        // Between the fourth (9) and the fifth (100), 0.8 of the way.
        assert!((quantile(&values, 0.95) - (9.0 + 0.8 * 91.0)).abs() < 1e-12);
        assert_eq!((median(&[3.0, 1.0]), quantile(&[3.0, 1.0], 0.5), median_high([3.0, 1.0])), (2.0, 2.0, Some(3.0)));
    }

    #[test]
    fn of_no_value_nothing_is_said() {
        assert!(median(&[]).is_nan() && mad(&[]).is_nan() && quantile(&[], 0.5).is_nan());
        assert_eq!((mean([]), median_high([]), standard_error(&[]), Estimate::new(&[])), (None, None, None, None));
    }

    #[test]
    fn intervals_are_students() {
        let e = Estimate::new(&[1.0, 2.0, 3.0]).unwrap();
        assert!((e.mean - 2.0).abs() < 1e-12 && (e.half_width.unwrap() - 4.303 / 3f64.sqrt()).abs() < 1e-9);
        assert_eq!((e.signed(2), Estimate::new(&[-5.0]).unwrap().signed(1)), ("+2.00 +- 2.48".into(), "-5.0".into()));
        assert_eq!(Estimate::new(&[5.0]).unwrap(), Estimate { mean: 5.0, half_width: None });
        // Published values of t for 10, 30 and 100 degrees of freedom.
        for (freedom, known) in [(1, 12.706), (10, 2.228), (30, 2.042), (100, 1.984)] {
            assert!((student(freedom) / known - 1.0).abs() < 0.01, "{freedom}: {}", student(freedom));
        }
    }

    #[test]
    fn the_interval_of_a_paired_ratio_is_that_of_the_sign_test() {
        // 20 ratios 1.01 to 1.20: of 20 throws of a coin, 5 or fewer are heads with 2.07 %, 6 or fewer with 5.77 %.
        let under: Vec<f64> = (0..20).map(|i| 1.0 + f64::from(i)).collect();
        let over: Vec<f64> = under.iter().zip(1..).map(|(under, i)| under * (1.0 + 0.01 * f64::from(i))).collect();
        let ratio = paired_ratio(&over, &under);
        assert!((ratio.median - 1.105).abs() < 1e-12);
        assert!((ratio.low - 1.06).abs() < 1e-12 && (ratio.high - 1.15).abs() < 1e-12, "{ratio:?}");
        // Too few pairs to leave any out.
        let few = paired_ratio(&[1.0, 2.0, 3.0], &[1.0, 1.0, 1.0]);
        assert_eq!((few.low, few.median, few.high), (1.0, 2.0, 3.0));
    }
}
