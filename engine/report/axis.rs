use super::statistics::range;

#[derive(Clone, Debug)]
pub struct Axis {
    pub label: String,
    is_log: bool,
    /// Logarithms on a logarithmic axis.
    span: [f64; 2],
    ticks: Vec<(f64, String)>,
}

impl Axis {
    /// Linear, with room around `values`, which are taken to be at least `least` apart.
    pub fn around(label: &str, values: impl IntoIterator<Item = f64>, least: f64) -> Self {
        Axis::ticked(label, padded(values, least), 4.0)
    }

    pub fn between(label: &str, first: f64, last: f64) -> Self {
        Axis::ticked(label, [first, last], 5.0)
    }

    /// Linear, from a tick to a tick around `values`.
    pub fn rounded(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let [low, high] = range(values);
        let height = if high > low { high - low } else { 1e-3 * high.abs().max(1.0) };
        let step = round_step(height / 4.0);
        Axis::stepped(label, [(low / step).floor() * step, ((low + height) / step).ceil() * step], step)
    }

    /// Logarithmic, with room around `values`, which are taken to be at least a factor of `least` apart.
    pub fn log(label: &str, values: impl IntoIterator<Item = f64>, least: f64, ticks: &[f64]) -> Self {
        let span = padded(values.into_iter().map(logarithm), least.ln());
        let shown = ticks.iter().filter(|tick| (span[0]..=span[1]).contains(&logarithm(**tick)));
        let ticks = shown.map(|tick| (*tick, tick.to_string())).collect();
        Axis { label: label.to_owned(), is_log: true, span, ticks }
    }

    /// Logarithmic, in powers of ten around `values`.
    pub fn decades(label: &str, values: impl IntoIterator<Item = f64>, text: impl Fn(f64) -> String) -> Self {
        let [low, high] = range(values).map(f64::log10);
        let low = low.floor() as i32;
        let high = (high.ceil() as i32).max(low + 1);
        let power = |exponent: i32| 10f64.powi(exponent);
        let ticks = (low..=high).map(|exponent| (power(exponent), text(power(exponent)))).collect();
        Axis { label: label.to_owned(), is_log: true, span: [power(low), power(high)].map(f64::ln), ticks }
    }

    fn ticked(label: &str, span: [f64; 2], n: f64) -> Self {
        Axis::stepped(label, span, round_step((span[1] - span[0]) / n))
    }

    fn stepped(label: &str, span: [f64; 2], step: f64) -> Self {
        let ticks = multiples(span, step).map(|value| (value, number(value, step))).collect();
        Axis { label: label.to_owned(), is_log: false, span, ticks }
    }

    pub fn in_whole_numbers(self) -> Self {
        let [first, last] = self.span;
        Axis::stepped(&self.label, self.span, round_step((last - first) / 5.0).max(1.0))
    }

    pub fn ends(&self) -> [f64; 2] {
        if self.is_log { self.span.map(f64::exp) } else { self.span }
    }

    /// 0 at one end, 1 at the other.
    pub fn part(&self, value: f64) -> f64 {
        let value = if self.is_log { logarithm(value) } else { value };
        (value - self.span[0]) / (self.span[1] - self.span[0])
    }

    pub(super) fn ticks(&self) -> impl Iterator<Item = (f64, &str)> {
        self.ticks.iter().map(|(value, text)| (self.part(*value), text.as_str()))
    }
}

fn logarithm(value: f64) -> f64 {
    value.max(1e-9).ln()
}

fn padded(values: impl IntoIterator<Item = f64>, least: f64) -> [f64; 2] {
    let [low, high] = range(values);
    if low > high {
        return [0.0, 1.0];
    }
    let (middle, half) = (low.midpoint(high), 0.56 * (high - low).max(least));
    [middle - half, middle + half]
}

/// 1, 2 or 5 times a power of ten, at least `least`.
fn round_step(least: f64) -> f64 {
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0].into_iter().map(|m| m * power).find(|step| *step >= 0.999_999 * least).unwrap_or(10.0 * power)
}

fn multiples([first, last]: [f64; 2], step: f64) -> impl Iterator<Item = f64> {
    let begin = (first / step - 1e-6).ceil();
    let n = ((last / step + 1e-6).floor() - begin) as i64;
    // Not minus zero.
    (0..=n).map(move |k| (begin + k as f64) * step + 0.0)
}

/// As many digits as `step` asks for.
fn number(value: f64, step: f64) -> String {
    for (unit, suffix) in [(1e6, "M"), (1e3, "k")] {
        if step >= unit / 10.0 && value.abs() >= unit {
            let decimals = usize::from(step < unit);
            return format!("{:.decimals$}{suffix}", value / unit);
        }
    }
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(axis: &Axis) -> Vec<(String, String)> {
        axis.ticks().map(|(part, text)| (format!("{part:.2}"), text.to_owned())).collect()
    }

    fn pairs<const N: usize>(pairs: [(&str, &str); N]) -> Vec<(String, String)> {
        pairs.map(|(a, b)| (a.to_owned(), b.to_owned())).to_vec()
    }

    #[test]
    fn ticks_are_round_numbers_within_the_axis() {
        let expected = pairs([("0.00", "0.0"), ("0.25", "0.5"), ("0.50", "1.0"), ("0.75", "1.5"), ("1.00", "2.0")]);
        assert_eq!(ticks(&Axis::rounded("", [0.3, 1.9])), expected);
        assert_eq!(ticks(&Axis::rounded("", [14.9, 18.6])).len(), 6, "from 14 to 19");
        assert_eq!(ticks(&Axis::between("", 0.0, 1.2e7)).last().unwrap().1, "10M");
        let ends = Axis::around("", [1.0, 3.0], 0.1).ends();
        assert!((ends[0] - 0.88).abs() < 1e-12 && (ends[1] - 3.12).abs() < 1e-12, "{ends:?}");
        let half = Axis::between("", 1.0, 3.0);
        assert_eq!((half.ticks.len(), half.clone().in_whole_numbers().ticks.len()), (5, 3));
        assert_eq!(ticks(&half.in_whole_numbers())[0].1, "1");
    }

    #[test]
    fn logarithmic_axes_have_equal_steps_for_equal_factors() {
        let axis = Axis::decades("", [3.0, 40.0], |value| format!("{value} x"));
        assert_eq!(ticks(&axis), pairs([("0.00", "1 x"), ("0.50", "10 x"), ("1.00", "100 x")]));
        let axis = Axis::log("", [1.0, 4.0], 2.0, &[0.5, 1.0, 2.0, 4.0, 8.0]);
        assert_eq!(ticks(&axis).len(), 3);
        assert!((axis.part(2.0) - 0.5).abs() < 1e-9);
    }

    #[test]
    fn axes_of_nothing_have_a_length() {
        assert!(Axis::around("", [], 1.0).part(0.5).is_finite() && Axis::rounded("", [2.0]).part(2.0).is_finite());
    }
}
