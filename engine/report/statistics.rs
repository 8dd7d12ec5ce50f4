//! Statistics of few numbers: measurements that are repeated, runs with several seeds.

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

/// The standard deviation of what `n` values are drawn from, by their sum and the sum of their squares; NaN of less than two.
pub fn deviation_of_sums(n: f64, sum: f64, squares: f64) -> f64 {
    if n > 1.0 { ((squares - sum * sum / n) / (n - 1.0)).max(0.0).sqrt() } else { f64::NAN }
}

/// Mean and standard error of the mean of at least two values, and their degrees of freedom.
fn standard_error(values: &[f64]) -> Option<(f64, f64, usize)> {
    let (n, mean) = (values.len() as f64, mean(values.iter().copied())?);
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (values.len() > 1).then(|| (mean, (variance / n).sqrt(), values.len() - 1))
}

/// Student's t for 1 to 9 degrees of freedom at 0.95 and 0.975; above, what is added to the normal quantile over the degrees
/// of freedom, within 1 %.
struct Student {
    table: [f64; 9],
    normal: f64,
    over_freedom: f64,
}

const ONE_SIDED: Student = Student {
    table: [6.314, 2.920, 2.353, 2.132, 2.015, 1.943, 1.895, 1.860, 1.833],
    normal: 1.645,
    over_freedom: 1.6,
};
const TWO_SIDED: Student = Student {
    table: [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262],
    normal: 1.96,
    over_freedom: 2.5,
};

impl Student {
    fn at(&self, freedom: usize) -> f64 {
        let known = freedom.checked_sub(1).and_then(|at| self.table.get(at)).copied();
        known.unwrap_or(self.normal + self.over_freedom / freedom as f64)
    }
}

/// A mean with the half-width of its interval of 95 % confidence.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Student's interval is the mean plus and minus this; none for less than two values.
    pub half_width: Option<f64>,
}

impl Estimate {
    /// That of `values`; none when there is no value.
    pub fn new(values: &[f64]) -> Option<Self> {
        let half_width = standard_error(values).map(|(_, error, freedom)| TWO_SIDED.at(freedom) * error);
        Some(Estimate { mean: mean(values.iter().copied())?, half_width })
    }

    /// With a sign, and its interval where it has one.
    pub fn signed(&self, decimals: usize) -> String {
        let half = self.half_width.map_or(String::new(), |half| format!(" +- {half:.decimals$}"));
        format!("{:+.decimals$}{half}", self.mean)
    }
}

/// Whether two one-sided t-tests at 5 % put the mean of `values` within `margin` of 0.
pub fn is_equivalent(values: &[f64], margin: f64) -> bool {
    standard_error(values).is_some_and(|(mean, error, freedom)| mean.abs() + ONE_SIDED.at(freedom) * error < margin)
}

/// A median with the lowest and the highest value.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spread {
    /// The middle value, or the mean of the two.
    pub median: f64,
    /// The lowest.
    pub low: f64,
    /// The highest.
    pub high: f64,
}

impl Spread {
    /// That of `values`; none without any.
    pub fn new(values: &[f64]) -> Option<Self> {
        let [low, high] = range(values.iter().copied());
        (!values.is_empty()).then(|| Spread { median: median(values), low, high })
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_and_deviations_are_those_of_known_numbers() {
        let values = [9.0, 1.0, 4.0, 2.0, 100.0];
        assert_eq!((mean(values), range(values)), (Some(23.2), [1.0, 100.0]));
        assert_eq!((median(&values), mad(&values), median_high(values)), (4.0, 3.0, Some(4.0)));
        assert_eq!((quantile(&values, 0.0), quantile(&values, 1.0), quantile(&values, 0.25)), (1.0, 100.0, 2.0));
        // Between the fourth (9) and the fifth (100), 0.8 of the way.
        assert!((quantile(&values, 0.95) - (9.0 + 0.8 * 91.0)).abs() < 1e-12);
        assert_eq!((median(&[3.0, 1.0]), quantile(&[3.0, 1.0], 0.5), median_high([3.0, 1.0])), (2.0, 2.0, Some(3.0)));
        assert_eq!(Spread::new(&[4.0, 2.0, 7.0, 3.0]), Some(Spread { median: 3.5, low: 2.0, high: 7.0 }));
        // 2, 4, 4, 4, 5, 5, 7, 9: their squares come to 232, their variance to 32 / 7.
        assert!((deviation_of_sums(8.0, 40.0, 232.0) - (32.0f64 / 7.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn of_no_value_nothing_is_said() {
        assert!(median(&[]).is_nan() && mad(&[]).is_nan() && quantile(&[], 0.5).is_nan());
        assert!(deviation_of_sums(1.0, 3.0, 9.0).is_nan());
        assert_eq!((mean([]), median_high([]), Spread::new(&[]), Estimate::new(&[])), (None, None, None, None));
        assert!(!is_equivalent(&[], 1.0));
    }

    #[test]
    fn intervals_are_students() {
        let e = Estimate::new(&[1.0, 2.0, 3.0]).unwrap();
        assert!((e.mean - 2.0).abs() < 1e-12 && (e.half_width.unwrap() - 4.303 / 3f64.sqrt()).abs() < 1e-9);
        assert_eq!((e.signed(2), Estimate::new(&[-5.0]).unwrap().signed(1)), ("+2.00 +- 2.48".into(), "-5.0".into()));
        assert_eq!(Estimate::new(&[5.0]).unwrap(), Estimate { mean: 5.0, half_width: None });
        // Published values of t for 10, 30 and 100 degrees of freedom.
        for (freedom, one, two) in [(1, 6.314, 12.706), (10, 1.812, 2.228), (30, 1.697, 2.042), (100, 1.660, 1.984)] {
            let (found, expected) = ([ONE_SIDED.at(freedom), TWO_SIDED.at(freedom)], [one, two]);
            assert!((0..2).all(|k| (found[k] / expected[k] - 1.0).abs() < 0.01), "{freedom}: {found:?}");
        }
    }

    #[test]
    fn equivalence_is_two_tests_and_needs_two_values() {
        assert!(is_equivalent(&[0.01, -0.01, 0.0], 0.05) && !is_equivalent(&[0.04, 0.05, 0.045], 0.05));
        assert!(!is_equivalent(&[0.0], 0.05) && !is_equivalent(&[0.2, -0.2], 0.05));
        // Student's t at 0.95 of two degrees of freedom: 2.92 * 0.01 / sqrt 3.
        assert!(is_equivalent(&[0.0, 0.01, -0.01], 0.0169) && !is_equivalent(&[0.0, 0.01, -0.01], 0.0168));
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
