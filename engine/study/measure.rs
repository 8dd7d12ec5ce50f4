use crate::report::statistics::mean;
use serde_json::Value;

/// A score that runs are compared by, in the order of tables. `snake_case` in studies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// At the beginning.
    FirstGaussians,
    LastGaussians,
    /// Mean over the test views, dB, as all PSNR.
    Psnr,
    /// Over the capture's foreground masks.
    PsnrForeground,
    /// Over the pixels that a training camera sees, by the capture's co-visibility masks.
    PsnrCovisible,
    /// The lowest of a view.
    PsnrWorst,
    /// After the affine map of colours that brings each view closest to its image.
    PsnrAligned,
    /// Of the test camera farthest from the middle of all.
    PsnrPeripheral,
    PsnrPeripheralCovisible,
    /// Of all test cameras but the peripheral one.
    PsnrInner,
    PsnrInnerWorst,
    Ssim,
    /// Change between frames in static pixels, over that of the images, which is noise.
    Flicker,
    /// Of runs with weights for it.
    Lpips,
    /// Of stepping, reviews included.
    Seconds,
    SceneBytes,
    /// Milliseconds, reviews included.
    StepTime,
    /// Root mean square, frames, where the true offsets are known.
    OffsetError,
}

/// Least noise of images, half a step of 8 bits: synthetic images may have none.
const LEAST_NOISE: f64 = 0.5 / 255.0;

impl Measure {
    pub const ALL: [Measure; 18] = [
        Measure::Psnr,
        Measure::PsnrAligned,
        Measure::PsnrForeground,
        Measure::PsnrCovisible,
        Measure::PsnrWorst,
        Measure::PsnrPeripheral,
        Measure::PsnrPeripheralCovisible,
        Measure::PsnrInner,
        Measure::PsnrInnerWorst,
        Measure::Ssim,
        Measure::Lpips,
        Measure::Flicker,
        Measure::OffsetError,
        Measure::FirstGaussians,
        Measure::LastGaussians,
        Measure::SceneBytes,
        Measure::Seconds,
        Measure::StepTime,
    ];

    /// Head of its column, and decimals.
    pub fn column(self) -> (&'static str, usize) {
        match self {
            Measure::FirstGaussians => ("first Gaussians", 0),
            Measure::LastGaussians => ("Gaussians", 0),
            Measure::Psnr => ("PSNR, dB", 2),
            Measure::PsnrForeground => ("PSNR of what moves, dB", 2),
            Measure::PsnrCovisible => ("PSNR where co-visible, dB", 2),
            Measure::PsnrWorst => ("PSNR of the worst view, dB", 2),
            Measure::PsnrAligned => ("PSNR, colours aligned, dB", 2),
            Measure::Ssim => ("SSIM", 4),
            Measure::Flicker => ("flicker over the images' own", 2),
            Measure::PsnrPeripheral => ("PSNR of the peripheral camera, dB", 2),
            Measure::PsnrPeripheralCovisible => ("peripheral PSNR where co-visible, dB", 2),
            Measure::PsnrInner => ("PSNR of the other test cameras, dB", 2),
            Measure::PsnrInnerWorst => ("of their worst view, dB", 2),
            Measure::Lpips => ("LPIPS", 4),
            Measure::Seconds => ("seconds", 1),
            Measure::SceneBytes => ("bytes", 0),
            Measure::StepTime => ("ms a step", 2),
            Measure::OffsetError => ("error of the offsets, frames", 3),
        }
    }

    pub fn is_less_better(self) -> bool {
        self.is_cost() || matches!(self, Measure::Flicker | Measure::Lpips | Measure::OffsetError)
    }

    /// Compared by ratio.
    pub fn is_cost(self) -> bool {
        matches!(self, Measure::Seconds | Measure::StepTime | Measure::SceneBytes)
            || matches!(self, Measure::FirstGaussians | Measure::LastGaussians)
    }

    /// An arm that is worse by more on any capture is harmful.
    pub(super) fn harm(self) -> f64 {
        match self {
            Measure::Lpips | Measure::Ssim | Measure::OffsetError => 0.01,
            _ => 0.1,
        }
    }

    /// From eval.json and train.json; none if the capture does not allow it.
    pub(super) fn of(self, eval: &Value, train: &Value, peripheral: Option<&str>) -> Option<f64> {
        let is_outer = |camera: &str| Some(camera) == peripheral;
        let is_inner = |camera: &str| peripheral.is_some_and(|other| other != camera);
        let least = |values: Vec<f64>| values.into_iter().min_by(f64::total_cmp);
        match self {
            Measure::FirstGaussians => train["plan"]["begin"]["gaussians"].as_f64(),
            Measure::LastGaussians => eval["gaussians"].as_f64(),
            Measure::Psnr => eval["psnr"].as_f64(),
            Measure::PsnrForeground => eval["psnr_foreground"].as_f64(),
            Measure::PsnrCovisible => eval["psnr_covisible"].as_f64(),
            Measure::PsnrWorst => least(scores(eval, "psnr", |_| true)),
            Measure::PsnrAligned => eval["psnr_aligned"].as_f64(),
            Measure::Ssim => eval["ssim"].as_f64(),
            Measure::Flicker => Some(eval["flicker"].as_f64()? / eval["flicker_true"].as_f64()?.max(LEAST_NOISE)),
            Measure::PsnrPeripheral => mean(scores(eval, "psnr", is_outer)),
            Measure::PsnrPeripheralCovisible => mean(scores(eval, "psnr_covisible", is_outer)),
            Measure::PsnrInner => mean(scores(eval, "psnr", is_inner)),
            Measure::PsnrInnerWorst => least(scores(eval, "psnr", is_inner)),
            Measure::Lpips => eval["lpips"].as_f64(),
            Measure::Seconds => train["seconds_stepping"].as_f64(),
            Measure::SceneBytes => eval["bytes"].as_f64(),
            Measure::StepTime => train["seconds_per_step"].as_f64().map(|seconds| 1e3 * seconds),
            Measure::OffsetError => train["offset_error"].as_f64(),
        }
    }
}

fn scores(eval: &Value, score: &str, of: impl Fn(&str) -> bool) -> Vec<f64> {
    let views = eval["views"].as_array().into_iter().flatten();
    let some = views.filter(|view| view["camera"].as_str().is_some_and(&of));
    some.filter_map(|view| view[score].as_f64()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_run_is_measured_by_its_files() {
        let view = |camera: &str, psnr: f64| json!({ "camera": camera, "psnr": psnr });
        let eval = json!({ "psnr": 25.0, "flicker": 0.01, "flicker_true": 0.0,
                           "views": [view("a", 20.0), view("a", 24.0), view("b", 31.0)] });
        let train = json!({ "seconds_per_step": 0.25 });
        let of = |measure: Measure| measure.of(&eval, &train, Some("b"));
        assert_eq!(
            (of(Measure::Psnr), of(Measure::PsnrWorst), of(Measure::StepTime)),
            (Some(25.0), Some(20.0), Some(250.0))
        );
        assert_eq!((of(Measure::PsnrPeripheral), of(Measure::PsnrInner)), (Some(31.0), Some(22.0)));
        assert_eq!((of(Measure::PsnrInnerWorst), of(Measure::Lpips)), (Some(20.0), None));
        assert!((of(Measure::Flicker).unwrap() - 5.1).abs() < 1e-12);
        let none: Vec<_> = Measure::ALL.map(|measure| measure.of(&Value::Null, &Value::Null, None)).into();
        assert!(none.iter().all(Option::is_none), "{none:?}");
        let mut all = Measure::ALL;
        all.sort();
        assert!(all.windows(2).all(|pair| pair[0] != pair[1]));
    }
}
