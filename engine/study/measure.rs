//! The scores that runs are compared by.

use crate::report::statistics::mean;
use serde_json::Value;

/// A score that runs are compared by, `snake_case` in studies. PSNR is the mean over the test views, dB, unless it says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    Psnr,
    /// After the affine map of colours that brings each view closest to its image.
    PsnrAligned,
    /// Over the capture's foreground masks.
    PsnrForeground,
    /// Over the pixels that a training camera sees, by the capture's co-visibility masks.
    PsnrCovisible,
    /// Of the worst view.
    PsnrWorst,
    /// Of the test camera farthest from the middle of all.
    PsnrPeripheral,
    PsnrPeripheralCovisible,
    /// Of all test cameras but the peripheral one.
    PsnrInner,
    PsnrInnerWorst,
    Ssim,
    /// Of runs with weights for it.
    Lpips,
    /// Change between frames in static pixels, over that of the images, which is noise.
    Flicker,
    /// Root mean square, where the true offsets are known.
    OffsetError,
    FirstGaussians,
    LastGaussians,
    SceneBytes,
    /// Of stepping, reviews included.
    Seconds,
    StepTime,
}

type Of = fn(&Files) -> Option<f64>;
/// In the order of the enum, which is that of tables: head of the column, decimals, value of a run.
const TABLE: [(Measure, &str, usize, Of); 18] = [
    (Measure::Psnr, "PSNR, dB", 2, |run| run.eval("psnr")),
    (Measure::PsnrAligned, "PSNR, colours aligned, dB", 2, |run| run.eval("psnr_aligned")),
    (Measure::PsnrForeground, "PSNR of what moves, dB", 2, |run| run.eval("psnr_foreground")),
    (Measure::PsnrCovisible, "PSNR where co-visible, dB", 2, |run| run.eval("psnr_covisible")),
    (Measure::PsnrWorst, "PSNR of the worst view, dB", 2, |run| least(run.views("psnr", |_| true))),
    (Measure::PsnrPeripheral, "PSNR of the peripheral camera, dB", 2, |run| mean(run.outer("psnr"))),
    (Measure::PsnrPeripheralCovisible, "peripheral PSNR where co-visible, dB", 2, |run| {
        mean(run.outer("psnr_covisible"))
    }),
    (Measure::PsnrInner, "PSNR of the other test cameras, dB", 2, |run| mean(run.inner("psnr"))),
    (Measure::PsnrInnerWorst, "of their worst view, dB", 2, |run| least(run.inner("psnr"))),
    (Measure::Ssim, "SSIM", 4, |run| run.eval("ssim")),
    (Measure::Lpips, "LPIPS", 4, |run| run.eval("lpips")),
    (Measure::Flicker, "flicker over the images' own", 2, |run| {
        Some(run.eval("flicker")? / run.eval("flicker_true")?.max(LEAST_NOISE))
    }),
    (Measure::OffsetError, "error of the offsets, frames", 3, |run| run.train["offset_error"].as_f64()),
    (Measure::FirstGaussians, "first Gaussians", 0, |run| run.train["plan"]["begin"]["gaussians"].as_f64()),
    (Measure::LastGaussians, "Gaussians", 0, |run| run.eval("gaussians")),
    (Measure::SceneBytes, "bytes", 0, |run| run.eval("bytes")),
    (Measure::Seconds, "seconds", 1, |run| run.train["seconds_stepping"].as_f64()),
    (Measure::StepTime, "ms a step", 2, |run| run.train["seconds_per_step"].as_f64().map(|seconds| 1e3 * seconds)),
];

/// Least noise of images, half a step of 8 bits: synthetic images may have none.
const LEAST_NOISE: f64 = 0.5 / 255.0;

impl Measure {
    pub fn all() -> impl Iterator<Item = Measure> {
        TABLE.iter().map(|row| row.0)
    }

    /// Head of its column, and decimals.
    pub fn column(self) -> (&'static str, usize) {
        let (_, head, decimals, _) = TABLE[self as usize];
        (head, decimals)
    }

    /// True if a lower value is better.
    pub fn is_less_better(self) -> bool {
        self.is_cost() || matches!(self, Measure::Flicker | Measure::Lpips | Measure::OffsetError)
    }

    /// Compared by ratio.
    pub fn is_cost(self) -> bool {
        use Measure::{FirstGaussians, LastGaussians, SceneBytes, Seconds, StepTime};
        matches!(self, FirstGaussians | LastGaussians | SceneBytes | Seconds | StepTime)
    }

    /// An arm that is worse by more on any capture is harmful.
    pub(super) fn harm(self) -> f64 {
        match self {
            Measure::Lpips | Measure::Ssim | Measure::OffsetError => 0.01,
            _ => 0.1,
        }
    }

    /// None if the run's capture does not allow it.
    pub(super) fn of(self, run: &Files) -> Option<f64> {
        (TABLE[self as usize].3)(run)
    }
}

/// Files of a run, and the name of its peripheral camera.
pub(super) struct Files<'a> {
    /// eval.json
    pub eval: &'a Value,
    /// train.json
    pub train: &'a Value,
    pub peripheral: Option<&'a str>,
}

impl Files<'_> {
    fn eval(&self, key: &str) -> Option<f64> {
        self.eval[key].as_f64()
    }

    /// A score of the test views of some cameras, of those that have it.
    fn views(&self, score: &str, of: impl Fn(&str) -> bool) -> Vec<f64> {
        let views = self.eval["views"].as_array().into_iter().flatten();
        let some = views.filter(|view| view["camera"].as_str().is_some_and(&of));
        some.filter_map(|view| view[score].as_f64()).collect()
    }

    fn outer(&self, score: &str) -> Vec<f64> {
        self.views(score, |camera| Some(camera) == self.peripheral)
    }

    fn inner(&self, score: &str) -> Vec<f64> {
        self.views(score, |camera| self.peripheral.is_some_and(|other| other != camera))
    }
}

fn least(values: Vec<f64>) -> Option<f64> {
    values.into_iter().min_by(f64::total_cmp)
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
        let of = |measure: Measure| measure.of(&Files { eval: &eval, train: &train, peripheral: Some("b") });
        assert_eq!(
            (of(Measure::Psnr), of(Measure::PsnrWorst), of(Measure::StepTime)),
            (Some(25.0), Some(20.0), Some(250.0))
        );
        assert_eq!((of(Measure::PsnrPeripheral), of(Measure::PsnrInner)), (Some(31.0), Some(22.0)));
        assert_eq!((of(Measure::PsnrInnerWorst), of(Measure::Lpips)), (Some(20.0), None));
        assert!((of(Measure::Flicker).unwrap() - 5.1).abs() < 1e-12);
        let empty = Files { eval: &Value::Null, train: &Value::Null, peripheral: None };
        assert!(Measure::all().all(|measure| measure.of(&empty).is_none()));
        assert!(TABLE.iter().enumerate().all(|(at, row)| row.0 as usize == at), "in the order of the enum");
    }
}
